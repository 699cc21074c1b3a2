"""Design of constant velocities: exact D- and c-optimal designs by exchange.

    F = known + sum over runs of s(v) s(v)' / noise**2,    s = dT_ss / dp (9)
    D-optimal: least -log det F;    c-optimal for one parameter: least log (F**-1)_kk

(9) is linear in all parameters but v_s, and alpha_1 only scales one column, so a design depends on v_s alone, and each
criterion is averaged over plausible values of v_s. Other shape parameters of a peak stay at their estimates. One
direction at a time; speeds are positive.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from bristle.arrays import Array, result
from bristle.errors import InputError
from bristle.model import functions
from bristle.model.parameters import Direction, Lugre, ParameterName, Stribeck, static_estimated_of
from bristle.model.vectorize import evaluate
from bristle.questions.experiment_design.loading import seen_covariance
from bristle.questions.experiment_design.references import fastest
from bristle.questions.experiment_design.start import Start, inverse
from bristle.simulation.fisher import covariance, static_information
from bristle.simulation.limits import Limits

CANDIDATES = 200  # speeds of the exchange, evenly spaced in log(v)
NODES = 5  # values of v_s of equal probability
STARTS = 3  # random initial designs, beside the log-spaced and the evenly spaced one
SEED = 0
_UNSEEN = 1e-300  # information about a parameter that is not identifiable
_V_S = Stribeck._fields.index("v_s")  # also its index among the static parameters of any law


@result
class DesignProblem:
    """Estimate and limits of one direction."""

    p: Lugre[float]  # the estimate; sigma_0 and sigma_1 do not matter
    nodes: Array  # plausible values of v_s, rad/s, (k,)
    prior_information: Array  # in the order of `names`, (4, 4)
    noise: float  # standard error of one run's mean torque, N*m, > 0
    low: float  # slowest speed, rad/s, > 0
    high: float  # fastest speed, rad/s, > low

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters of the curve: the four of `Stribeck`, or those of another law."""
        return static_estimated_of(self.p.law)

    @property
    def estimate(self) -> Array:
        """Values of `names`."""
        return np.array([getattr(self.p, name) for name in self.names])


class Design(NamedTuple):
    """Constant velocities to run, and the expected errors."""

    aim: str  # parameter of a c-optimal design, or `all`: D-optimal
    speeds: Array  # one per run, rad/s, ascending, (n,)
    errors: Array  # expected standard errors of the problem's `names`, with the prior; inf: not identifiable, (4,)

    @property
    def runs(self) -> list[tuple[float, int]]:
        """Distinct speeds, ascending, and their number of runs."""
        speeds, counts = np.unique(self.speeds, return_counts=True)
        return list(zip(speeds.tolist(), counts.tolist(), strict=True))


@result
class VelocityPlan:
    """The constant velocities of one direction."""

    direction: Direction
    problem: DesignProblem
    chosen: Design

    @property
    def velocities(self) -> list[float]:
        """One per run, rad/s, signed; with one set for both directions each speed is run back and forth."""
        signs = {Direction.POSITIVE: (1,), Direction.NEGATIVE: (-1,)}.get(self.direction, (1, -1))
        return [sign * speed for speed in self.chosen.speeds.tolist() for sign in signs]


def plan_velocities(
    start: Start, direction: Direction, limits: Limits, count: int, aim: str, share: float
) -> VelocityPlan:
    """The design of `count` runs of one direction for an aim; `share`: of the plan's usual time.

    Raises InputError where the drive's torque or the travel leaves no speeds to choose from.
    """
    p, passes = start.p(direction), 2 if direction is Direction.BOTH else 1

    # The fastest speed with a hold at which steady sliding is within the drive's torque.
    speeds = np.geomspace(limits.slowest, fastest(largest_deflection(start), limits), CANDIDATES)
    within = speeds[np.abs(evaluate(functions.steady_torque_function(p.law), speeds, *p.stribeck)[0]) <= limits.torque]
    if within.size < 2:
        raise InputError(
            f"the largest torque, {limits.torque:.3g}, does not carry the joint beyond {limits.slowest:.3g}; raise plan.torque"
        )
    high = float(within[-1])

    # Marginal information about the curve; none where one of its parameters is a guess, on which the others rest.
    names = static_estimated_of(start.law)
    at = start.indices(direction, names)
    prior_information, v_s_error = np.zeros((len(names), len(names))), np.inf
    guessed = {name for name in names if ParameterName(name, direction) in start.guessed}
    if not guessed and (np.diag(start.known)[at] > 0).all():
        spread = seen_covariance(start.known, at)
        prior_information, v_s_error = inverse(spread), float(np.sqrt(spread[_V_S, _V_S]) / start.estimate[at[_V_S]])
    problem = DesignProblem(
        p=p,
        nodes=np.geomspace(limits.slowest, high / 2, NODES) if "v_s" in guessed else nodes_of(p.v_s, v_s_error),
        prior_information=prior_information,
        noise=start.noise[direction] * float(np.sqrt(1 / passes / share)),
        low=limits.slowest,
        high=high,
    )
    chosen = design(problem, count, aim if aim in problem.names else "all")
    return VelocityPlan(direction=direction, problem=problem, chosen=chosen)


def largest_deflection(start: Start) -> float:
    """Largest steady deflection of the bristle in both directions, rad."""
    return max((p.alpha_0 + p.alpha_1) / p.sigma_0 for p in start.sets)


def nodes_of(v_s: float, relative_error: float) -> Array:
    """Values of v_s of equal probability, (k,), log-normal with this relative standard error, at most 1.2."""
    middle = (np.arange(NODES) + 0.5) / NODES
    return np.asarray(v_s * np.exp(min(relative_error, 1.2) * ndtri(middle)))


def design(problem: DesignProblem, count: int, aim: str = "all") -> Design:
    """The best `count` runs (one per parameter or more) for a parameter or `all`, by exchange, near speeds merged."""
    grid = np.geomspace(problem.low, problem.high, CANDIDATES)
    criterion = _Criterion(problem, aim)
    rows = criterion.rows(grid)
    rng = np.random.default_rng(SEED)
    spaced = (apart(problem.low, problem.high, count) for apart in (np.geomspace, np.linspace))
    starts = [np.searchsorted(grid, speeds).clip(0, grid.size - 1) for speeds in spaced]
    starts += [rng.integers(0, grid.size, count) for _ in range(STARTS)]
    ends = dict.fromkeys(tuple(np.sort(_exchange(criterion, rows, start)).tolist()) for start in starts)
    best = min((grid[[*end]] for end in ends), key=criterion.value)
    # Near speeds are merged where that costs at most 0.01 of the logarithm of the variance.
    best = np.sort(best)
    few = []
    for factor in (1.05, 1.1, 1.2):
        groups = np.split(best, np.flatnonzero(np.diff(np.log(best)) > np.log(factor)) + 1)
        centres = [g.mean() for g in groups]
        if len(groups) > 1:
            centres[0], centres[-1] = best[0], best[-1]
        near = np.concatenate([np.full(g.size, c) for g, c in zip(groups, centres, strict=True)])
        few += [near] if criterion.value(near) <= criterion.value(best) + 0.01 else []
    return evaluate_design(problem, min([best, *few], key=lambda x: np.unique(x).size), aim)


def evaluate_design(problem: DesignProblem, speeds: Array, aim: str = "") -> Design:
    """The design of given speeds, (n,), rad/s."""
    speeds = np.sort(speeds)
    information = problem.prior_information + static_information(speeds, problem.p, problem.noise)
    return Design(aim, speeds, covariance(information)[0])


class _Criterion:
    """Criterion of a design, averaged over v_s, with parameters scaled to a unit diagonal of the information."""

    def __init__(self, problem: DesignProblem, aim: str) -> None:
        """Scale the prior, regularised so that the information can be inverted."""
        self.problem, self.aim = problem, None if aim == "all" else problem.names.index(aim)
        speeds = np.geomspace(problem.low, problem.high, 50)
        sets = (problem.p._replace(v_s=float(x)) for x in problem.nodes)
        whole = [problem.prior_information + static_information(speeds, p, problem.noise) for p in sets]
        self.size = np.sqrt(np.maximum(np.diagonal(whole, axis1=1, axis2=2), _UNSEEN))
        scale = self.size[:, :, None] * self.size[:, None, :]
        self.known = problem.prior_information / scale + 1e-11 * np.eye(len(problem.names))

    def rows(self, speeds: Array) -> Array:
        """s(v) / noise at each v_s, scaled, (k, m, 4)."""
        curve: Stribeck[Any] = self.problem.p.stribeck
        wide = self.problem.nodes.size, speeds.size
        slopes = functions.steady_jacobian_function(curve.law)
        by = evaluate(slopes, speeds, *curve._replace(v_s=self.problem.nodes[:, None]))[: len(self.problem.names)]
        rows = np.stack([np.broadcast_to(x, wide) for x in by], axis=-1)
        return np.asarray(rows / self.problem.noise / self.size[:, None, :])

    def value(self, speeds: Array) -> float:
        """The criterion of speeds (n,)."""
        rows = self.rows(speeds)
        whole = self.known + np.einsum("knp,knq->kpq", rows, rows)
        if self.aim is None:
            return float(-np.linalg.slogdet(whole)[1].mean())
        return float(np.log(np.linalg.inv(whole)[:, self.aim, self.aim]).mean())

    def with_one(self, rest: Array, rows: Array) -> Array:
        """The criterion, (m,), with each row (k, m, 4) added to an information (k, 4, 4) by updates of rank one."""
        inverse = np.linalg.inv(rest)
        along = rows @ inverse
        grown = np.einsum("kmp,kmp->km", along, rows)
        if self.aim is None:
            return np.asarray(-(np.linalg.slogdet(rest)[1][:, None] + np.log1p(grown)).mean(axis=0))
        variance = inverse[:, self.aim, self.aim, None] - along[:, :, self.aim] ** 2 / (1 + grown)
        return np.asarray(np.log(np.maximum(variance, 1e-300)).mean(axis=0))


def _exchange(criterion: _Criterion, rows: Array, start: NDArray[np.intp]) -> NDArray[np.intp]:
    """Fedorov's exchange of indices (n,): the best swap of a run for a candidate (k, m, 4), until none helps."""
    chosen, value = np.array(start), np.inf
    while True:
        run = rows[:, chosen]
        whole = criterion.known + np.einsum("knp,knq->kpq", run, run)
        swaps = []  # criterion, candidate removed and candidate added
        for leaving in np.unique(chosen):
            out = rows[:, leaving]
            values = criterion.with_one(whole - out[:, :, None] * out[:, None, :], rows)
            swaps.append((values.min(), leaving, values.argmin()))
        best, leaving, comes = min(swaps, key=lambda swap: swap[0])
        if not best < value - 1e-9:
            return chosen
        value, chosen[np.flatnonzero(chosen == leaving)[0]] = best, comes

"""Trials of regressors and directions by cross-validation of linear fits, with columns at a few v_s for the peak."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.data.experiment.load import Experiment
from bristle.data.record import Record
from bristle.estimation import levels
from bristle.estimation.information import bic, power_of
from bristle.identification.comparison import APART, SYMMETRIC
from bristle.identification.moving_runs import (
    DIRECTIONS,
    REGRESSORS,
    directions,
    inertia,
    regressors,
    shows_gravity,
    terms_of,
)
from bristle.identification.static.grid import subsets
from bristle.identification.static.points import point_regressors, points_problem
from bristle.identification.static.problem import Regression, from_records
from bristle.identification.static.strays import refit
from bristle.model.parameters import of_curve, slides

_PARTS = 5  # held out in turn
_BLOCKS = 25  # stretches of moving runs, each part every fifth, so that none is a motion of one kind
_BENT = (0.03, 0.1, 0.3)  # of the fastest speed: v_s of the columns in place of the Stribeck term
_RANK = 1e-10  # of the largest eigenvalue: smaller ones count as zero


@dataclass(frozen=True, slots=True)
class SetUp:
    """Directions and regressors of a fit."""

    directions: tuple[str, ...]
    regressors: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class BetterSetUp:
    """A set-up with a smaller error than the one asked for."""

    asked: SetUp
    set_up: SetUp
    asked_error: float  # 100 * norm(error) / norm(torque) on held-out parts, percent, as asked for ...
    error: float  # ... and with this set-up.


class Trial(NamedTuple):
    """The set-ups that can be tried on some data."""

    asked: SetUp
    sides: tuple[str, ...]  # The directions in which the data go
    possible: Sequence[str]  # Regressors that the signals allow
    pose: Callable[[tuple[str, ...]], Regression]  # All that is possible, at once, in some directions
    blocks: int  # Into so many stretches the equations are cut, of which a part is every fifth

    def better(self) -> BetterSetUp | None:
        """A clearly better set-up with at least what was asked for, or None."""
        both = self.asked.directions == ("both",)
        better = self._simplest(self.asked, (("both",), tuple(DIRECTIONS)) if both else (self.asked.directions,))
        return better if better and better.error < levels.CLEARLY * better.asked_error else None

    def proposed(self) -> BetterSetUp | None:
        """The set-up to begin with, compared with the plainest one; None where nothing can be tried."""
        ways = (("both",), self.sides) if len(self.sides) == len(DIRECTIONS) else (self.sides,)
        return self._simplest(SetUp(ways[0], tuple(x for x in self.possible if x == "inertia")), ways)

    def _simplest(self, asked: SetUp, ways: Sequence[tuple[str, ...]]) -> BetterSetUp | None:
        """The smallest set-up within one standard error of the best on held-out parts, without driving friction."""
        tried = list[tuple[int, Array, SetUp]]()
        for sides in ways:
            problem = self.pose(sides)
            products, driven = _products(problem, self.blocks), _drives(problem)
            # what was asked for with any possible regressors; offsets for one friction alone
            told, beside = (
                [x for x in names if x != "offset" or sides == ("both",)] for names in (asked.regressors, self.possible)
            )
            for some in subsets([x for x in beside if x not in told]):
                set_up = SetUp(sides, (*told, *some))
                found = products.errors(set_up.regressors)
                drives = (driven and "gravity" not in set_up.regressors) or products.falls(set_up.regressors)
                if found is not None and (set_up == asked or not drives):
                    tried.append((*found, set_up))
        first = next((errors for _, errors, set_up in tried if set_up == asked), None)
        if first is None:
            return None
        without = [one for one in tried if "spring" not in set(one[2].regressors) - {*asked.regressors}]
        (errors, chosen), (sprung, other) = _as_good(without), _as_good(tried)
        if sprung @ sprung < errors @ errors / 2:  # a spring, which is rare, must explain half of what is left
            errors, chosen = sprung, other
        return BetterSetUp(asked, chosen, float(np.linalg.norm(first)), float(np.linalg.norm(errors)))


def _as_good(tried: Sequence[tuple[int, Array, SetUp]]) -> tuple[Array, SetUp]:
    """Of set-ups with a size and their errors on each part, the smallest within one standard error of the best, or hardly worse."""
    best = min((errors for _, errors, _ in tried), key=lambda x: float(x @ x))
    within = []
    for one in tried:
        more = one[1] ** 2 - best**2
        room = max(np.std(more, ddof=1) / np.sqrt(more.size), (levels.WORTH**2 - 1) * np.mean(best**2))
        if more.mean() <= room:
            within.append(one)
    _, errors, chosen = min(within, key=lambda x: (x[0], float(x[1] @ x[1])))
    return errors, chosen


def trial_of_motion(experiment: Experiment, records: Sequence[Record]) -> Trial:
    """Of moving runs; parts are stretches of time. Raises InputError as their fit does."""
    fixed, _ = inertia(experiment)
    signals, asked = ("position", "velocity", "acceleration"), regressors(experiment)
    has = {name for name in signals if all(getattr(r, name) is not None for r in records)}
    has |= {"link_torque"} if "links" in asked else set()  # else it is known, and no column
    known = {*(r.made_of for r in records), *(() if fixed is None else ("inertia",))}
    possible = [name for name, terms in REGRESSORS.items() if set(terms.needs) <= has]
    possible += [name for name in asked if name not in REGRESSORS]  # periodic regressors are not tried, only kept
    if "position" in has:  # what depends on it is gravity, or a spring where the joint slides
        shown = shows_gravity(experiment.joint.kind, *(np.asarray(r.position) for r in records))
        known |= {*(() if shown else ("gravity",)), *(() if slides(experiment.joint.kind) else ("spring",))} - {*asked}
    possible = [name for name in possible if name not in known]
    velocity = np.concatenate([np.zeros(1) if r.velocity is None else r.velocity for r in records])
    sides = tuple(d for d, sign in DIRECTIONS.items() if (velocity * sign > 0).any())

    def pose(sides: tuple[str, ...]) -> Regression:
        return from_records(records, sides, possible, experiment.fit.every, fixed)[0]

    return Trial(SetUp(directions(experiment, records), asked), sides, possible, pose, _BLOCKS)


def trial_of_points(experiment: Experiment, points: Sequence[Segment]) -> Trial:
    """Of points at constant velocity; a part is every fifth by speed."""
    ordered, sides, asked = sorted(points, key=lambda s: s.velocity), sides_of(points), point_regressors(experiment)
    at = np.array([s.position for s in points if s.position is not None])
    gravity = at.size == len(points) and shows_gravity(experiment.joint.kind, at)
    possible = ["offset", *["gravity"] * gravity, "quadratic"]
    possible += [name for name in asked if name not in REGRESSORS]
    own = SetUp(sides if experiment.fit.directions == "separate" else ("both",), asked)
    return Trial(own, sides, possible, lambda sides: points_problem(ordered, sides, possible), len(ordered))


def directions_of_points(experiment: Experiment, points: Sequence[Segment]) -> dict[str, float]:
    """BIC of points in both directions by `SYMMETRIC`, about an offset, and `APART`; infinite of too few, or empty."""
    sides = sides_of(points)
    asked = tuple(name for name in point_regressors(experiment) if name != "offset")
    ways = {SYMMETRIC: (("both",), (*asked, "offset")), APART: (sides, asked)}
    found = dict[str, float]()
    for way, (ways_of, regressors_of) in ways.items() if len(sides) == len(DIRECTIONS) else ():
        problem = points_problem(points, ways_of, regressors_of, experiment.fit.friction)
        n, p = problem.torque.size, len(problem.names)
        if n < p + levels.SPARE_POINTS or (_drives(problem) and "gravity" not in asked):
            found[way] = np.inf
            continue
        found[way] = bic(refit(problem).residuals, p, n, power_of(problem.torque))
    return found if np.isfinite(list(found.values())).any() else {}


def sides_of(points: Sequence[Segment]) -> tuple[str, ...]:
    """The directions of some points."""
    return tuple(d for d, sign in DIRECTIONS.items() if any(s.velocity * sign > 0 for s in points))


def _drives(problem: Regression) -> bool:
    """Whether the friction of one of two directions drives the joint, as gravity may."""
    if len(problem.directions) == 1:
        return False
    coulomb = problem.linear[:, [name.name == "alpha_0" for name in problem.linear_names]]
    return bool((problem.torque @ coulomb < 0).any())


class _Products(NamedTuple):
    """Normal equations of each of k parts, columns of unit length."""

    names: list[str]  # The parameter of each column, empty where it is friction's, (p,)
    gram: Array  # (k, p, p)
    moment: Array  # Columns times torque, (k, p)
    power: Array  # Torque squared, (k,)
    norm: float  # Of the measured torque
    n: int

    def falls(self, regressors: Sequence[str]) -> bool:
        """Whether a quadratic term would drive."""
        if "quadratic" not in regressors:
            return False
        keep = self._columns(regressors)
        G, b = self.gram[:, keep][:, :, keep].sum(axis=0), self.moment[:, keep].sum(axis=0)
        theta = np.linalg.pinv(G, rcond=_RANK, hermitian=True) @ b
        return bool(theta[[self.names[k] for k in keep].index("quadratic")] < 0)

    def _columns(self, regressors: Sequence[str]) -> list[int]:
        """Columns of friction and of these regressors."""
        wanted = {name for regressor in regressors for name in terms_of(regressor).names}
        return [k for k, name in enumerate(self.names) if name in wanted or not name]

    def errors(self, regressors: Sequence[str]) -> tuple[int, Array] | None:
        """Number of parameters and relative error of each part, percent, (k,); None of too few equations."""
        keep = self._columns(regressors)
        if self.n < levels.EQUATIONS_EACH * len(keep) or not self.norm:
            return None
        G, b = self.gram[:, keep][:, :, keep], self.moment[:, keep]
        rest = np.linalg.pinv(G.sum(axis=0) - G, rcond=_RANK, hermitian=True)
        theta = np.einsum("kpq,kq->kp", rest, b.sum(axis=0) - b)
        left = self.power - 2 * np.einsum("kp,kp->k", theta, b) + np.einsum("kp,kpq,kq->k", theta, G, theta)
        errors: Array = 100 * np.sqrt(np.maximum(left, 0.0)) / self.norm
        return len(keep), errors


def _products(problem: Regression, blocks: int) -> _Products:
    v_s = np.array(_BENT) * float(np.abs(problem.velocity).max())
    bent = [problem.shapes(v_s, k) for k in range(len(problem.peaks))]
    X, y = np.concatenate([problem.linear, *bent], axis=1), problem.torque
    X = X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    names = ["" if of_curve(name.name) else name.name for name in problem.linear_names]
    parts = [np.arange(y.size) * blocks // y.size % _PARTS == k for k in range(_PARTS)]
    gram, moment = (np.array([X[m].T @ other[m] for m in parts]) for other in (X, y))
    power, norm = np.array([y[m] @ y[m] for m in parts]), float(np.linalg.norm(problem.measured))
    return _Products(names + [""] * (X.shape[1] - len(names)), gram, moment, power, norm, y.size)

"""Moving data solved from several starts: the lowest minimum, and what the scatter of its residuals says of each unknown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.levenberg_marquardt import Minimum
from bristle.estimation.linear import inverse_gram
from bristle.estimation.separable import projected
from bristle.identification.dynamic.problem import Tracking, is_start, parameters
from bristle.identification.dynamic.unknowns import fit, polished, scales, slopes_of_scaling
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout

_APART = {"sigma_0": 10.0, "sigma_1": 10.0, "v_s": 6.0}
"""How far random starts lie from the first one, as a factor either way; 3 for the other parameters."""
_SAME = 1e-6
SEEN = 1e-9
"""Of the longest column of the Jacobian: an unknown with a shorter one has no influence."""
_TRIES = 30
"""Steps that a random start is given to reach the lowest cost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A minimum with what is known of it."""

    values: Mapping[str, float]
    minimum: Minimum
    names: tuple[str, ...]
    scaled_errors: Array
    """Standard errors of the scaled unknowns, (p,); inf where nothing is seen of one."""
    covariance: Array
    """Of the parameters, (p, p)."""
    freedom: float
    stretch: float
    starts: int
    reached: int


def judge(
    problem: Tracking, start: Mapping[str, float], starts: int, seed: int, others: Sequence[Mapping[str, float]] = ()
) -> Judged:
    """The lowest minimum from several starts, and the covariance there."""
    rng = np.random.default_rng(seed)
    first = with_deflections(problem, start)
    ends = [fit(problem, whole) for whole in (first, *others)]
    for _ in range(starts - 1):
        moved = {name: value * _factor(name, rng) for name, value in start.items()}
        try:
            ends.append(fit(problem, with_deflections(problem, moved), _TRIES))
        except InputError:  # a random start may well lie where nothing depends on anything
            continue
    values, minimum = polished(problem, *min(ends, key=lambda end: end[1].cost))
    reached = max(sum(m.cost <= minimum.cost * (1 + _SAME) + 1e-20 for _, m in ends), 1)
    scatter = _scatter if problem.quantity == "torque" else _scatter_of_windows
    errors, covariance, freedom, stretch = scatter(problem, values, minimum)
    return Judged(
        values=values,
        minimum=minimum,
        names=problem.names,
        scaled_errors=errors,
        covariance=covariance,
        freedom=freedom,
        stretch=stretch,
        starts=starts + len(others),
        reached=reached,
    )


def equations_left(problem: Tracking, judged: Judged) -> Array:
    """Measured less modelled of every equation at the minimum, without its run's weight, N*m or rad, (n,)."""
    weight = np.repeat([m.weight for m in problem.motions], [m.size for m in problem.motions])
    rows: Array = judged.minimum.residuals[: weight.size] / weight
    return rows


def _factor(name: str, rng: np.random.Generator) -> float:
    reach = np.log(_APART.get(name.rstrip("+-"), 3.0))
    return float(np.exp(rng.uniform(-reach, reach))) if name.startswith(("alpha", "v_s", "sigma")) else 1.0


def with_deflections(problem: Tracking, start: Mapping[str, float]) -> dict[str, float]:
    """A start with what each motion begins with: the deflection that carries its first torque, within the steady one, and the first position.

    Where a motion goes on from the one before, the deflection is that to which the estimated velocity has brought it.
    """
    p = parameters(problem, start)
    out, end = dict(start), 0.0
    for k, m in enumerate(problem.motions):
        own = p if isinstance(p, Lugre) else p[int(m.torque[0] < 0)]
        most = own.alpha_0 / own.sigma_0
        z0 = float(np.clip(m.torque[: max(m.torque.size // 100, 1)].mean() / own.sigma_0, -most, most))
        if m.goes_on:
            z0 = end
        end = float(rollout(m.velocity, m.step, p, z0).z[-1]) if problem.quantity == "position" else z0
        first = {"y0": float(m.measured[0]), "v0": float(m.velocity[0]), "z0": z0}
        out |= {f"{name}[{k}]": first[name] for name in problem.begins}
    return out


def without_deflections(values: Mapping[str, float]) -> dict[str, float]:
    """The values without the deflections at the start of each stretch."""
    return {name: value for name, value in values.items() if not is_start(name)}


def _scatter(problem: Tracking, values: Mapping[str, float], minimum: Minimum) -> tuple[Array, Array, float, float]:
    """Standard errors of the scaled unknowns, the parameters' covariance, degrees of freedom, and the widening by correlated residuals.

    Each unknown's error is a weighted sum of the residuals; its variance allows for their correlation and for a variance that changes.
    """
    jacobian, rest = minimum.jacobian, minimum.residuals
    length = np.sqrt(np.einsum("np,np->p", jacobian, jacobian))
    seen = length > SEEN * length.max()
    n, p = jacobian.shape[0], int(seen.sum())
    priors = sum(len(prior.names) for prior in problem.priors)
    inner = inverse_gram(jacobian[:, seen])
    weights = jacobian[:, seen] @ inner
    naive = np.diag(inner) * minimum.cost / max(n - p, 1)
    scores = weights[: n - priors] * rest[: n - priors, None]
    stretch = np.array([inflation(score) for score in scores.T])
    spread = np.einsum("np,np->p", scores, scores) * stretch * n / max(n - p, 1)
    spread += problem.sigma**2 * np.einsum("np,np->p", weights[n - priors :], weights[n - priors :])
    spread = np.maximum(spread, naive if not priors else 0.0)
    ratio = np.sqrt(spread / naive)
    named = np.array([not is_start(name) for name in problem.names])[seen]
    chain = slopes_of_scaling(problem, values, scales(problem, values))
    covariance = np.full((length.size, length.size), np.nan)
    covariance[np.ix_(seen, seen)] = (
        inner * minimum.cost / max(n - p, 1) * np.outer(ratio, ratio) * np.outer(chain[seen], chain[seen])
    )
    errors = np.full(length.size, np.inf)
    errors[seen] = np.sqrt(spread)
    widening = float(np.median(ratio[named])) if named.any() else 1.0
    return errors, covariance, max(n / float(stretch[named].max(initial=1.0)) - p, 1.0), widening


def _scatter_of_windows(
    problem: Tracking, values: Mapping[str, float], minimum: Minimum
) -> tuple[Array, Array, float, float]:
    """The same as `_scatter` where each motion has a start of its own, so that motions err independently, however their residuals are correlated.

    The jackknife over windows, linearised: with A_w the window's part of J'J and b_w of J'r, its start eliminated, leaving the window out moves the
    estimate by G**-1 (I - A_w G**-1)**-1 b_w, where G = sum of A_w. Nothing is said of the starts themselves.
    """
    named = np.flatnonzero([not is_start(name) for name in problem.names])
    jacobian, rest = minimum.jacobian[:, named], minimum.residuals
    length = np.sqrt(np.einsum("np,np->p", jacobian, jacobian))
    seen = length > SEEN * length.max()
    own, size = named[seen], length[seen]
    blocks = problem.blocks
    left = projected(minimum.jacobian, own, blocks) / size
    grams = [left[rows].T @ left[rows] for rows, _ in blocks]
    slopes = [left[rows].T @ rest[rows] for rows, _ in blocks]
    told = left[blocks[-1].rows.stop :]  # the priors
    inner = np.linalg.pinv(sum(grams) + told.T @ told, hermitian=True)
    one, windows = np.eye(own.size), len(blocks)
    moves = np.array(
        [inner @ np.linalg.lstsq(one - A @ inner, b, rcond=None)[0] for A, b in zip(grams, slopes, strict=True)]
    )
    spread = (windows - 1) / windows * moves.T @ moves + problem.sigma**2 * inner @ told.T @ told @ inner
    spread /= np.outer(size, size)
    chain = slopes_of_scaling(problem, values, scales(problem, values))[own]
    covariance = np.full((len(problem.names), len(problem.names)), np.nan)
    covariance[np.ix_(own, own)] = spread * np.outer(chain, chain)
    errors = np.full(len(problem.names), np.inf)
    errors[own] = np.sqrt(spread.diagonal())
    naive = np.diag(inner) / size**2 * minimum.cost / max(rest.size - len(problem.names), 1)
    return errors, covariance, max(windows - 1.0, 1.0), float(np.median(errors[own] / np.sqrt(naive)))

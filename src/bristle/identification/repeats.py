"""Scatter of a parameter over several runs, and errors widened by it (Birge, Phys. Rev. 40, 1932; jackknife)."""

from collections.abc import Callable, Container, Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from scipy.special import fdtrc

from bristle.arrays import Array, Interval
from bristle.estimation import levels
from bristle.estimation.covariance import moved_without_each, student
from bristle.findings import CAUTION, Finding
from bristle.identification.fits import Estimate, RunScatter, StaticFit, TrackingFit, Uncertainty
from bristle.model.parameters import ParameterName, least_of

Key = TypeVar("Key", bound=Hashable)
Fitted = TypeVar("Fitted", StaticFit, TrackingFit)


def scatter_of(
    by_run: Mapping[str, float], errors: Array, freedoms: Array, error: float, freedom: float
) -> RunScatter | None:
    """Scatter over runs fitted apart, with their errors and freedoms, (k,), and those of the fit of all."""
    count, x, weights = len(by_run), np.array(list(by_run.values())), errors**-2.0
    if count < 2 or not error:
        return None
    chi2 = float(weights @ (x - weights @ x / weights.sum()) ** 2) / (count - 1)
    ratio, factor, stretched = float(np.sqrt(chi2)), 1.0, 1.0
    if chi2 > 1 and float(fdtrc(count - 1, freedoms.sum(), chi2)) < levels.SIGNIFICANCE:
        factor = ratio * float(weights.sum()) ** -0.5 / error
        factor, stretched = max(factor, 1.0), max(factor * _fewer(count - 1, freedom), 1.0)
    return RunScatter(before=ratio, widened=factor, stretched=stretched, by_run=dict(by_run))


def clustered(
    names: Sequence[Hashable],
    parts: Mapping[str, tuple[Array, Array]],
    of_all: Mapping[Key, Estimate],
    freedom: float | Mapping[Any, float],
    logarithmic: Container[Key] = (),
    *,
    independent: bool = False,
) -> dict[Key, RunScatter]:
    """Scatter of each parameter over runs by the first-order jackknife (`moved_without_each`).

    `parts` are each run's model Jacobian, (n, p), by `names` (or their logarithm) and residuals, (n,), by file;
    `freedom` is that of the intervals. With white residuals (`independent`) an F test of all parameters at once counts
    too.
    """
    if len(parts) < levels.JACKKNIFE_RUNS:
        return {}
    J = np.concatenate([jacobian for jacobian, _ in parts.values()])
    size = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
    gram = (J / size).T @ (J / size)
    inverse = np.linalg.pinv(gram, hermitian=True)
    count, found = len(parts), dict[Key, RunScatter]()
    scaled = [(jacobian / size, left) for jacobian, left in parts.values()]
    grams = [X.T @ X for X, _ in scaled]
    moves = moved_without_each(inverse, grams, [X.T @ left for X, left in scaled]) / size
    errors = np.sqrt((count - 1) / count * (moves**2).sum(axis=0))
    # parameters that one run alone determines are left out
    without = (np.linalg.eigh(gram - of_run) for of_run in grams)
    apiece = np.array([(V**2 / np.maximum(w, 1e-12 * w[-1])).sum(axis=1) for w, V in without])
    told = np.all(apiece < levels.ONE_RUN**2 * np.diag(inverse), axis=0).tolist()
    column = {name: k for k, name in enumerate(names) if told[k]}
    apart = independent and _differ(scaled)
    for name, e in of_all.items():
        if name not in column or e.value is None or not e.standard_error:
            continue
        error, move = float(errors[column[name]]), moves[:, column[name]]
        as_logarithm = name in logarithmic
        ratio = error / (e.standard_error / (e.value if as_logarithm else 1.0))
        own = freedom[name] if isinstance(freedom, Mapping) else freedom
        more = ratio > 1 and (apart or float(fdtrc(count - 1, own, ratio**2)) < levels.SIGNIFICANCE)
        values = e.value * np.exp((count - 1) * move) if as_logarithm else e.value + (count - 1) * move
        found[name] = RunScatter(
            before=ratio, widened=ratio if more else 1.0,
            stretched=max(ratio * _fewer(count - 1, own), 1.0) if more else 1.0,
            by_run=dict(zip(parts, values.tolist(), strict=True)),
        )  # fmt: skip  # a list of values
    return found


def _differ(parts: Sequence[tuple[Array, Array]]) -> bool:
    """Whether runs fitted apart leave significantly less than the fit of all."""
    rank, explained, left, n = 0, 0.0, 0.0, 0
    for X, rest in parts:
        made, _, own, _ = np.linalg.lstsq(X, rest, rcond=1e-9)
        rank, n = rank + int(own), n + rest.size
        explained += float(rest @ (X @ made))
        left += float(np.sum((rest - X @ made) ** 2))
    more, freedom = rank - parts[0][0].shape[1], n - rank
    if more < 1 or freedom < 1 or not left > 0:
        return False
    return float(fdtrc(more, freedom, explained / more / (left / freedom))) < levels.SIGNIFICANCE


def _fewer(most: int, own: float) -> float:
    """Ratio of interval widths at fewer degrees of freedom."""
    return student(min(most, own)) / student(own)


def widened(fit: Fitted, scatter: Mapping[Any, RunScatter], logarithmic: Container[str] = ()) -> Fitted:
    """The fit, widened by the scatter, and a caution; `logarithmic` parameters spread as logarithms."""
    parameters, three = dict(fit.parameters), dict(fit.uncertainty)
    for name, x in scatter.items():
        e: Estimate = fit.parameters[name]
        if x.stretched > 1 and e.value is not None:
            bare = getattr(name, "name", name)
            spread = spreader(e.value, x.stretched, bare, logarithmic=bare in logarithmic)
            parameters[name] = wider_estimate(e, x, spread)
            if name in three:
                three[name] = wider_three(three[name], spread)
    factor = np.array([scatter[name].widened if name in scatter else 1.0 for name in fit.names])
    return replace(
        fit, parameters=parameters, uncertainty=three, covariance=fit.covariance * np.outer(factor, factor),
        repeats=dict(scatter),
    )  # fmt: skip  # a list of values


Spread = Callable[[Array], Array]


def spreader(value: float, factor: float, bare: str, *, logarithmic: bool = False) -> Spread:
    """A function that spreads interval ends about a value by a factor, (k,) -> (k,), within the parameter's bounds."""
    least = least_of(bare)

    def spread(ends: Array) -> Array:
        if logarithmic and value > 0:
            with np.errstate(over="ignore"):  # an end beyond all numbers is open
                return np.asarray(value * (np.maximum(ends, 0.0) / value) ** factor)
        return np.maximum(value + (ends - value) * factor, least)

    return spread


def wider_estimate(e: Estimate, x: RunScatter, spread: Spread) -> Estimate:
    """The estimate with widened error and interval, and the caution."""
    runs, freedom, middle = len(x.by_run), len(x.by_run) - 1, float(np.median(list(x.by_run.values())))
    farthest = max(x.by_run, key=lambda file: abs(x.by_run[file] - middle))
    message = (
        f"The {runs} runs differ by more than chance (1 %): they scatter by {x.before:.2g} times what their errors say, {farthest} "
        f"farthest from the median. The standard error is multiplied by {x.widened:.2g}, and the interval has Student's t of {freedom} "
        f"degree{'' if freedom == 1 else 's'} of freedom; look for what changed between the runs (temperature, load, wear)."
    )
    numbers = {"runs": runs, "scatter": x.before, "widened": x.widened, "freedom": freedom, "farthest": farthest}
    why = Finding("runs-scatter", CAUTION, message, numbers)
    error = None if e.standard_error is None else e.standard_error * x.widened
    return replace(e, standard_error=error, interval=_spread_pair(e.interval, spread), warnings=(*e.warnings, why))


def wider_three(three: Uncertainty, spread: Spread) -> Uncertainty:
    """All three intervals, spread alike."""
    return replace(
        three, covariance=_spread_pair(three.covariance, spread), profile=_spread_pair(three.profile, spread),
        bootstrap=_spread_pair(three.bootstrap, spread), curve=np.stack([spread(three.curve[0]), three.curve[1]]),
        draws=spread(three.draws),
    )  # fmt: skip  # a list of values


def _spread_pair(ends: Interval | None, spread: Spread) -> Interval | None:
    if ends is None:
        return None
    low, high = spread(np.array(ends)).tolist()
    return low, high


def limit_widening(x: RunScatter, widened_by: float) -> RunScatter:
    """The scatter with its standard error widened at most by this."""
    share = (min(widened_by, x.widened) - 1) / (x.widened - 1) if x.widened > 1 else 1.0
    return replace(x, widened=1 + share * (x.widened - 1), stretched=1 + share * (x.stretched - 1))


def with_priors_beside(
    scatter: Mapping[ParameterName, RunScatter], alone: TrackingFit, joint: TrackingFit
) -> dict[ParameterName, RunScatter]:
    """Scatter with priors: C_j + W (F C_a F - C_a) W', W = C_j C_a**-1, C_a of the runs alone, F factors."""
    seen = [
        {name for name, x in zip(fit.names, fit.covariance.diagonal(), strict=True) if x > 0} for fit in (alone, joint)
    ]
    names = [name for name in joint.names if name in seen[0] & seen[1]]
    rows, own = ([fit.names.index(name) for name in names] for fit in (joint, alone))
    C_j, C_a = joint.covariance[np.ix_(rows, rows)], alone.covariance[np.ix_(own, own)]
    size = np.sqrt(C_a.diagonal())
    inverse = np.linalg.pinv(C_a / np.outer(size, size), hermitian=True) / np.outer(size, size)
    factor = np.array([scatter[name].widened if name in scatter else 1.0 for name in names])
    W = C_j @ inverse
    more = W @ (C_a * (np.outer(factor, factor) - 1)) @ W.T
    wider = np.sqrt(np.maximum(1 + more.diagonal() / C_j.diagonal(), 1.0)).tolist()
    return {name: limit_widening(scatter[name], one) for name, one in zip(names, wider, strict=True) if name in scatter}

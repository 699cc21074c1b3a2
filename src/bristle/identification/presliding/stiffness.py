"""The stiffness sigma_0 from slow loading, by four estimators.

(14) as printed, its closed-form inverse, edge to edge, and all samples. While the joint loads slowly from zero torque,
T = g0 (1 - exp(-sigma_0 y / g0)), so U = -g0 log(1 - T / g0) is sigma_0 times the displacement y. Where inside a count
the joint rests is not known: only differences of y are. One encoder count is q.

    printed      T1 / x1 at the first displacement x1 that is measured (14)
    corrected    U1 / x1: exact where rest lies on a count edge
    edges        the slope of U over y at the count edges, each loading with an intercept of its own
    samples      one over the slope of y over U, all samples, time as the instrument: neither counts nor
                 torque noise follow the time
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data.slow_loading import Loading
from bristle.diagnostics import Diagnostic, Kind
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.covariance import LEVEL, student
from bristle.identification.fits import Estimate
from bristle.model import functions
from bristle.model.parameters import Kind as JointKind
from bristle.model.parameters import unit
from bristle.model.vectorize import evaluate

REACH = 0.8
"""Of g0: above, a little noise in T is much in log(1 - T / g0)."""
_LIMIT = 0.97
"""Of g0: noise may reach above REACH, but not to where U has no value."""
_PHASES = 64
"""Where inside a count the joint may rest, for the spread that counts alone cause."""


class KnownValue(NamedTuple):
    """A quantity from elsewhere.

    g0 = alpha_0 + alpha_1, the torque at which slow loading slides (N*m), or the inertia (kg*m**2).
    """

    value: float
    standard_error: float
    source: Diagnostic
    shifts: Mapping[str, float] = MappingProxyType({})
    """As of an `Estimate`."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A loading as the estimators take it."""

    time: Array
    y: Array
    U: Array
    edge_y: Array
    edge_U: Array
    weight: Array
    """Of the edges: one over the variance of U at constant noise in T."""


def stiffness(loadings: Sequence[Loading], level: KnownValue, kind: JointKind) -> dict[str, Estimate]:
    """sigma_0 of one direction by each estimator, `printed`, `corrected`, `edges` and `samples`.

    A lower bound where counts hide the motion.

    Args:
        loadings: of one direction, at least one.
        level: g0 of this direction.
        kind: of the joint.
    """
    quantum = max(loading.quantum for loading in loadings)
    pieces = [of_loading(loading, level.value) for loading in loadings]
    still = max(float(np.ptp(piece.y)) for piece in pieces) == 0
    if still or (quantum > 0 and not any(piece.edge_y.size > 1 for piece in pieces)):
        return dict.fromkeys(("printed", "corrected", "edges", "samples"), _lower_bound(pieces, quantum, kind))
    return _estimates(loadings, level, quantum, kind)


def torque_shares(loadings: Sequence[Loading]) -> dict[str, float]:
    """Relative change of the torque of some loadings per standard error of each constant: the mean, by their torque."""
    weight = [float(np.square(loading.torque).sum()) for loading in loadings]
    names = dict.fromkeys(name for loading in loadings for name in loading.shares)
    shares = {name: [loading.shares.get(name, 0.0) for loading in loadings] for name in names}
    return {name: float(np.average(share, weights=weight)) for name, share in shares.items()}


def with_shifts(
    estimates: Mapping[str, Estimate], loadings: Sequence[Loading], level: KnownValue
) -> dict[str, Estimate]:
    """The estimates of `stiffness` with what errors of constants do to them.

    Where torque and g0 grow by one factor, so does sigma_0: a torque that grows by e does to it what g0 less by e does,
    and e of its value beside.
    """
    shares = torque_shares(loadings)
    constants, by_level = (*dict.fromkeys((*shares, *level.shifts)),), dict.fromkeys(estimates, 0.0)
    if not constants:
        return dict(estimates)
    width, quantum = _width(level), max(loading.quantum for loading in loadings)
    pieces = [[of_loading(x, level.value + k * width) for x in loadings] for k in (-1, 0, 1)]
    for name, estimator in (("edges", by_edges), ("samples", by_samples)):
        less, value, more = (estimator(piece)[0] for piece in pieces)
        by_level[name] = _slope(less, value, more, width)
    first = _first_torque(loadings, level.value)
    if quantum > 0 and first.size:
        slopes = evaluate(functions.loading_displacement_function(), first, level.value, 1.0)[1]
        by_level["corrected"] = float(np.mean(slopes)) / quantum
    moved = {c: level.shifts.get(c, 0.0) - level.value * shares.get(c, 0.0) for c in constants}
    return {
        name: e.shifted({c: (e.value or 0.0) * shares.get(c, 0.0) + by_level[name] * moved[c] for c in constants})
        for name, e in estimates.items()
    }


def count_edges(loadings: Sequence[Loading], level: KnownValue) -> int:
    """Count edges that the loadings crossed below REACH of g0."""
    return sum(of_loading(loading, level.value).edge_y.size for loading in loadings)


def printed_bias(u: Array) -> tuple[Array, Array, Array]:
    """Relative bias of (14) for u = sigma_0 q / g0: -0.5 is half of the truth.

    Returns it where rest lies on a count edge, (1 - exp(-u)) / u - 1; then its mean and its standard deviation over a
    uniformly distributed rest position in the count; each of the shape of u, u > 0.
    """
    on_edge = -np.expm1(-u) / u
    below = u < 1e-4  # where the differences below would be rounding
    safe = np.where(below, 1.0, u)
    at = -np.expm1(-safe) / safe
    mean = np.where(below, 0.5 - u / 6, (1 - at) / safe)
    square = np.where(below, 1 / 3 - u / 4, (1 - 2 * at - np.expm1(-2 * safe) / (2 * safe)) / safe**2)
    return on_edge - 1, mean - 1, np.sqrt(np.maximum(square - mean**2, 0.0))


def _unbent(torque: Array, g0: float) -> Array:
    """U = sigma_0 y of slow loading to this torque, N*m."""
    return evaluate(functions.loading_displacement_function(), torque, g0, 1.0)[0]


def of_loading(loading: Loading, g0: float) -> Piece:
    """A loading below REACH of g0, N*m, as the estimators take it."""
    low = loading.torque < REACH * g0
    stop = low.size if low.all() else int(np.argmin(low))
    reached = float(loading.displacement[:stop].max(initial=0.0))
    edge = loading.edge_displacement <= reached
    T = np.minimum(loading.edge_torque[edge], _LIMIT * g0)
    y, U = loading.edge_displacement[edge], _unbent(T, g0)
    # 1 - T / g0 from a line through the edges: from T itself, noise that raises U would also lower its weight
    line = np.polynomial.polynomial.polyfit(y, U, min(y.size - 1, 1), w=1 - T / g0) if y.size else np.zeros(1)
    return Piece(
        time=loading.time[:stop],
        y=loading.displacement[:stop],
        U=_unbent(np.minimum(loading.torque[:stop], _LIMIT * g0), g0),
        edge_y=y,
        edge_U=U,
        weight=np.exp(-2 * np.maximum(np.polynomial.polynomial.polyval(y, line), 0.0) / g0),
    )


def _estimates(loadings: Sequence[Loading], level: KnownValue, quantum: float, kind: JointKind) -> dict[str, Estimate]:
    """All four; the last two with the uncertainty at given g0, and the one that g0 adds."""
    width = _width(level)
    pieces, less, more = (
        [of_loading(loading, g0) for loading in loadings]
        for g0 in (level.value, level.value - width, level.value + width)
    )
    value, error, freedom = by_samples(pieces)
    by_level = _slope(by_samples(less)[0], value, by_samples(more)[0], width) * level.standard_error
    if quantum == 0:
        absent = Estimate(
            value=None,
            unit=unit("sigma_0", kind),
            warnings=(Kind.NO_COUNTS(),),
        )
        samples = _estimate(value, float(np.hypot(error, by_level)), freedom, kind)
        return {"printed": absent, "corrected": absent, "edges": absent, "samples": samples}
    bias, spread = by_phase(pieces, value, quantum)
    error = float(np.sqrt(error**2 + by_level**2 + spread**2))
    warnings = (Kind.COUNTS_BIAS(share=bias / value),) if abs(bias) > error else ()
    samples = _estimate(value, error, freedom, kind, warnings)
    value, error, freedom = by_edges(pieces)
    by_level = _slope(by_edges(less)[0], value, by_edges(more)[0], width) * level.standard_error
    return {
        "printed": _first_count(loadings, level.value, quantum, kind, _noise(pieces), corrected=False),
        "corrected": _first_count(loadings, level.value, quantum, kind, _noise(pieces), corrected=True),
        "edges": _estimate(value, float(np.hypot(error, by_level)), freedom, kind),
        "samples": samples,
    }


def _width(level: KnownValue) -> float:
    """How far g0 is moved to see what it does."""
    return max(1e-4 * level.value, min(level.standard_error, 0.1 * level.value))


def _slope(less: float, value: float, more: float, width: float) -> float:
    """How an estimate changes with g0, from it and those `width` below and above, of which one may not exist."""
    steps = [x for x in (value - less, more - value) if np.isfinite(x)]
    return float(np.mean(steps)) / width if steps else np.inf


def _estimate(
    value: float, error: float, freedom: float, kind: JointKind, warnings: tuple[Diagnostic, ...] = ()
) -> Estimate:
    wrong = () if 0 < value < np.inf and np.isfinite(error) else (Kind.NOT_POSITIVE(),)
    if not (np.isfinite(value) and np.isfinite(error)):
        return Estimate(value=None, unit=unit("sigma_0", kind), warnings=(*warnings, *wrong))
    reach = student(freedom) * error
    return Estimate(
        value=value,
        unit=unit("sigma_0", kind),
        standard_error=error,
        interval=(max(value - reach, 0.0), value + reach),
        warnings=(*warnings, *wrong),
    )


def _first_count(
    loadings: Sequence[Loading], g0: float, quantum: float, kind: JointKind, noise: float, *, corrected: bool
) -> Estimate:
    """(14), or its inverse, averaged over the loadings.

    The interval is that of a rest position anywhere in the count, and of noise in U.
    """
    T = _first_torque(loadings, g0)
    if T.size == 0:
        return Estimate(value=None, unit=unit("sigma_0", kind), warnings=(Kind.NOTHING_BELOW_G0(),))
    U = _unbent(T, g0)
    half = LEVEL / 2 if T.size == 1 else min(LEVEL / 2, 1.96 / float(np.sqrt(12 * T.size)))
    off = 1.96 * noise / float(np.sqrt(T.size))
    low = max(float(np.mean(U)) - off, 0.0) / (quantum * (0.5 + half))
    high = (float(np.mean(U)) + off) / (quantum * (0.5 - half))
    return Estimate(
        value=float(np.mean(U if corrected else T)) / quantum,
        unit=unit("sigma_0", kind),
        interval=(low, high),
        warnings=(Kind.WHOLE_COUNT(),),
    )


def _first_torque(loadings: Sequence[Loading], g0: float) -> Array:
    """Torque at the first count edge of each loading that has one below g0, N*m, (k,)."""
    return np.array([x.edge_torque[0] for x in loadings if x.edge_torque.size and x.edge_torque[0] < g0])


def centred(pieces: Sequence[Piece]) -> tuple[list[Array], list[Array]]:
    """Edges of each loading that has two or more, about their weighted means.

    y and U, each times the root of its weight.
    """
    ys, Us = [], []
    for p in pieces:
        if p.edge_y.size > 1:
            root, total = np.sqrt(p.weight), p.weight.sum()
            ys.append(root * (p.edge_y - p.weight @ p.edge_y / total))
            Us.append(root * (p.edge_U - p.weight @ p.edge_U / total))
    return ys, Us


def by_edges(pieces: Sequence[Piece]) -> tuple[float, float, float]:
    """Slope of U over y at the count edges by weighted least squares, its standard error and degrees of freedom.

    Infinite, with an infinite error, where no loading has two edges.
    """
    ys, Us = centred(pieces)
    if not ys:
        return np.inf, np.inf, 1.0
    y, U = np.concatenate(ys), np.concatenate(Us)
    slope = float(y @ U / (y @ y))
    score, freedom = y * (U - slope * y), y.size - len(ys) - 1
    variance_inflation = inflation(score)
    # two edges and an intercept leave no residual to judge by: then the slope may be off by as much as itself
    variance = (
        float(score @ score) * y.size / freedom * variance_inflation / float(y @ y) ** 2 if freedom > 0 else slope**2
    )
    return slope, float(np.sqrt(variance)), max(y.size / variance_inflation - len(ys) - 1, 1.0)


def _noise(pieces: Sequence[Piece]) -> float:
    """Standard deviation of U about the line through the edges, near zero torque."""
    ys, Us = centred(pieces)
    slope = by_edges(pieces)[0]
    rest = np.concatenate([u - slope * x for x, u in zip(ys, Us, strict=True)])
    return float(np.sqrt(rest @ rest / max(rest.size - len(ys) - 1, 1)))


def by_samples(pieces: Sequence[Piece], shifted: Sequence[Array] | None = None) -> tuple[float, float, float]:
    """One over the slope of y over U with time as the instrument, its standard error, and its degrees of freedom.

    Infinite, with an infinite error, where the displacement does not change with the torque.
    """
    pieces = [p for p in pieces if p.time.size]
    shifted = [y for y in shifted or [p.y for p in pieces] if y.size]
    if not pieces:
        return np.inf, np.inf, 1.0
    columns = [p.time for p in pieces], shifted, [p.U for p in pieces]
    t, y, U = (np.concatenate([values - values.mean() for values in column]) for column in columns)
    along = float(t @ U)
    compliance = float(t @ y) / along if along else 0.0
    rest = y - compliance * U
    score = t * rest  # what scatters, correlated and of a variance that grows with the torque
    variance_inflation = inflation(score)
    freedom = max(y.size / variance_inflation - len(pieces) - 1, 1.0)
    error = np.sqrt(float(score @ score) * variance_inflation * y.size / max(y.size - len(pieces) - 1, 1)) / abs(
        along or 1.0
    )
    if not compliance:
        return np.inf, np.inf, freedom
    return 1 / compliance, float(error / compliance**2), freedom


def by_phase(pieces: Sequence[Piece], sigma_0: float, quantum: float) -> tuple[float, float]:
    """Mean error and standard deviation of the all-sample estimate over where in a count the joint rests.

    They are found by counting the fitted displacement.
    """
    values = []
    for phase in (np.arange(_PHASES) + 0.5) / _PHASES:
        rest = [(phase + k * 0.618) % 1.0 for k in range(len(pieces))]  # another one in each loading
        shifted = [quantum * np.floor(p.U / (sigma_0 * quantum) + r) for p, r in zip(pieces, rest, strict=True)]
        values.append(by_samples(pieces, shifted)[0])
    return float(np.mean(values)) - sigma_0, float(np.std(values))


def _lower_bound(pieces: Sequence[Piece], quantum: float, kind: JointKind) -> Estimate:
    """What is left where the joint moves by no more than the encoder's noise."""
    loaded = max((float(piece.U.max(initial=0.0)) for piece in pieces), default=0.0)
    crossed = max(piece.edge_y.size for piece in pieces)
    least = loaded / ((crossed + 1) * quantum) if quantum > 0 else 0.0
    edges = Kind.ONE_EDGE() if crossed == 1 else Kind.EDGES(edges=crossed)
    return Estimate(
        value=None,
        unit=unit("sigma_0", kind),
        interval=(least, float("inf")),
        warnings=(Kind.WITHIN_NOISE(edges=edges, least=least, unit=unit("sigma_0", kind)),),
    )

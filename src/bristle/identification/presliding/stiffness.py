"""sigma_0 from slow loading; U = -g0 log(1 - T / g0) = sigma_0 y, one encoder count is q."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data.slow_loading import Loading
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.covariance import student
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding
from bristle.identification.fits import Estimate
from bristle.identification.systematic import shifted
from bristle.model import functions
from bristle.model.parameters import Kind, unit
from bristle.model.vectorize import evaluate

_STRAIGHT = 1e6  # of the largest torque held: a g0 that bends nothing
_NONE = 1e-60  # a smaller compliance is rounding


class KnownValue(NamedTuple):
    """g0 (N*m) or J (kg*m**2) from another stage."""

    value: float
    standard_error: float  # Infinite for a lower bound
    source: Finding
    shifts: Mapping[str, float] = MappingProxyType({})  # As in `Estimate`
    most: float = float("inf")  # Of a lower bound: the largest value allowed

    @property
    def is_bound(self) -> bool:
        """Whether the value is a lower bound."""
        return bool(np.isinf(self.standard_error))

    @property
    def middle(self) -> "KnownValue":
        """The value; of a lower bound the harmonic mean with `most`."""
        value = 2 / (1 / self.value + 1 / self.most)
        error = (self.most - self.value) / (2 * student(np.inf))
        return self._replace(value=value, standard_error=error) if self.is_bound else self


@dataclass(frozen=True, slots=True)
class Piece:
    """A loading below REACH of g0."""

    time: Array
    y: Array
    U: Array
    edge_y: Array
    edge_U: Array
    weight: Array  # Of edges: one over the variance of U


Estimator = Callable[[Sequence[Piece]], tuple[float, float, float]]
"""sigma_0, its standard error and degrees of freedom from pieces."""


def stiffness(loadings: Sequence[Loading], level: KnownValue, kind: Kind) -> Estimate:
    """sigma_0 of one direction from its count edges, or from all samples where no counts are seen.

    A lower bound if counts hide the motion; under a bound of g0 the interval is that over all g0.
    """
    if level.is_bound:
        most = min(level.most, _STRAIGHT * level.value)
        each = (KnownValue(g0, 0.0, level.source) for g0 in (level.value, level.middle.value, most))
        return _between(*(stiffness(loadings, given, kind) for given in each))
    quantum, pieces = quantum_of(loadings), [of_loading(loading, level.value) for loading in loadings]
    still = max((float(np.ptp(piece.y)) for piece in pieces if piece.y.size), default=0.0) == 0
    if still or (quantum > 0 and not any(piece.edge_y.size > 1 for piece in pieces)):
        # a lower bound where the joint moves within the encoder's noise
        loaded = max((float(piece.U.max(initial=0.0)) for piece in pieces), default=0.0)
        crossed, of = max(piece.edge_y.size for piece in pieces), unit("sigma_0", kind)
        least = loaded / ((crossed + 1) * quantum) if quantum > 0 else 0.0
        crossings = "1 count edge" if crossed == 1 else f"{crossed} count edges"
        message = (
            f"The displacement stays within the encoder's noise ({crossings} in the longest loading): sigma_0 is at least "
            f"{least:.3g} {of}; a finer encoder is needed for more."
        )
        why = Finding("within-noise", CAUTION, message, {"edges": crossings, "least": least, "unit": of})
        return Estimate(value=None, unit=of, interval=(least, float("inf")), warnings=(why,))
    solve = estimator_of(loadings)
    value, error, freedom = solve(pieces)
    error = float(np.hypot(error, by_level(solve, loadings, level) * level.standard_error))
    if not (0 < value < np.inf and np.isfinite(error)):
        message = "Not positive: the displacement does not increase with the torque."
        why = Finding("not-positive", CRITICAL, message)
        return Estimate(value=None, unit=unit("sigma_0", kind), warnings=(why,))
    reach = student(freedom) * error
    interval = max(value - reach, 0.0), value + reach
    return Estimate(value=value, unit=unit("sigma_0", kind), standard_error=error, interval=interval)


def printed(loadings: Sequence[Loading], g0: float, kind: Kind) -> Estimate:
    """(14) as printed, T1 / x1: the mean torque at the first count edge below g0, over a count; without an error."""
    T = [x.edge_torque[0] for x in loadings if x.edge_torque.size and x.edge_torque[0] < g0]
    quantum, of = quantum_of(loadings), unit("sigma_0", kind)
    if not quantum or not T:
        why = Finding("no-counts", NOTE, "No encoder counts are visible below g0; (14) needs them.")
        return Estimate(value=None, unit=of, warnings=(why,))
    message = (
        "Assumes that the joint moves a whole count to the first edge; it may be any part of one, so that (14) gives half of "
        "sigma_0 on average."
    )
    return Estimate(value=float(np.mean(T)) / quantum, unit=of, warnings=(Finding("whole-count", NOTE, message),))


def quantum_of(loadings: Sequence[Loading]) -> float:
    """One count, rad; 0 where no counts are seen."""
    return max(loading.quantum for loading in loadings)


def _between(near: Estimate, middle: Estimate, far: Estimate) -> Estimate:
    """The middle estimate with the union of the intervals and warnings of near and far, of equal ones far's."""
    warnings = (*{x.code: x for x in (*near.warnings, *far.warnings)}.values(),)
    known = [x.interval for x in (near, far) if x.interval]
    interval = (min(low for low, _ in known), max(high for _, high in known)) if len(known) == 2 else None
    if near.value is None or middle.value is None or far.value is None:
        if interval:
            interval = (interval[0], float("inf"))
        return Estimate(value=None, unit=near.unit, interval=interval, warnings=warnings)
    errors = [x.standard_error or 0.0 for x in (near, far)]
    error = float(np.hypot(max(errors), (near.value - far.value) / np.sqrt(12)))
    return replace(middle, standard_error=error, interval=interval, warnings=warnings)


def unbent(torque: Array, g0: float) -> Array:
    """U of slow loading to a torque, N*m."""
    return evaluate(functions.loading_displacement_function(), torque, g0, 1.0)[0]


def of_loading(loading: Loading, g0: float) -> Piece:
    """A loading below REACH of g0, N*m."""
    low = loading.torque < levels.REACH * g0
    stop = low.size if low.all() else int(np.argmin(low))
    reached = float(loading.displacement[:stop].max(initial=0.0))
    edge = loading.edge_displacement <= reached
    T = np.minimum(loading.edge_torque[edge], levels.NEAREST * g0)
    y, U = loading.edge_displacement[edge], unbent(T, g0)
    # weights from a line through the edges, because noise in T raises U and would lower its weight
    along = y / y[-1] if y.size else y
    line = np.polynomial.polynomial.polyfit(along, U, min(y.size - 1, 1), w=1 - T / g0) if y.size else np.zeros(1)
    return Piece(
        time=loading.time[:stop], y=loading.displacement[:stop],
        U=unbent(np.minimum(loading.torque[:stop], levels.NEAREST * g0), g0), edge_y=y, edge_U=U,
        weight=np.exp(-2 * np.maximum(np.polynomial.polynomial.polyval(along, line), 0.0) / g0),
    )  # fmt: skip  # a list of values


def by_level(estimator: Estimator, loadings: Sequence[Loading], level: KnownValue) -> float:
    """Derivative of an estimate by g0."""
    width = max(1e-4 * level.value, min(level.standard_error, 0.1 * level.value))
    less, value, more = (estimator([of_loading(x, level.value + k * width) for x in loadings])[0] for k in (-1, 0, 1))
    steps = [x for x in (value - less, more - value) if np.isfinite(x)]
    return float(np.mean(steps)) / width if steps else np.inf


def by_edges(pieces: Sequence[Piece]) -> tuple[float, float, float]:
    """Slope of U over y at count edges, standard error, degrees of freedom; infinite without two edges."""
    # weighted, each loading about its mean
    parts = [
        [np.sqrt(p.weight) * (x - p.weight @ x / p.weight.sum()) for x in (p.edge_y, p.edge_U)]
        for p in pieces
        if p.edge_y.size > 1
    ]
    lines = len(parts)
    if not parts:
        return np.inf, np.inf, 1.0
    y, U = np.concatenate(parts, axis=1)
    slope = float(y @ U / (y @ y))
    score, freedom = y * (U - slope * y), y.size - lines - 1
    variance_inflation = inflation(score)
    # two edges and an intercept leave no residual: the error is then the slope itself
    scattered = float(score @ score) * y.size / max(freedom, 1) * variance_inflation / float(y @ y) ** 2
    variance = scattered if freedom > 0 else slope**2
    return slope, float(np.sqrt(variance)), max(y.size / variance_inflation - lines - 1, 1.0)


def by_samples(pieces: Sequence[Piece]) -> tuple[float, float, float]:
    """One over the slope of y over U, standard error, degrees of freedom; infinite without displacement."""
    # with time as instrument, each loading about its mean
    parts = [np.stack([x - x.mean() for x in (p.U, p.y, p.time)]) for p in pieces if p.time.size]
    if not parts:
        return np.inf, np.inf, 1.0
    U, y, t = np.concatenate(parts, axis=1)
    along = float(t @ U)
    compliance = float(t @ y) / along if along else 0.0
    rest = y - compliance * U
    score = t * rest  # correlated, with a variance that grows with the torque
    variance_inflation = inflation(score)
    freedom = max(y.size / variance_inflation - len(parts) - 1, 1.0)
    scatter = float(score @ score) * variance_inflation * y.size / max(y.size - len(parts) - 1, 1)
    error = np.sqrt(scatter) / abs(along or 1.0)
    if abs(compliance) < _NONE:
        return np.inf, np.inf, freedom
    return 1 / compliance, float(error / compliance**2), freedom


def estimator_of(loadings: Sequence[Loading]) -> Estimator:
    """By count edges, or by all samples where no counts are seen."""
    return by_edges if quantum_of(loadings) > 0 else by_samples


def torque_shares(loadings: Sequence[Loading]) -> dict[str, float]:
    """Relative change of the loadings' torque per standard error of each constant."""
    weight = [float(np.square(loading.torque).sum()) for loading in loadings]
    names = dict.fromkeys(name for loading in loadings for name in loading.shares)
    shares = {name: [loading.shares.get(name, 0.0) for loading in loadings] for name in names}
    return {name: float(np.average(share, weights=weight)) for name, share in shares.items()}


def with_shifts(e: Estimate, loadings: Sequence[Loading], level: KnownValue) -> Estimate:
    """sigma_0 with errors of constants: it scales with torque and g0 together."""
    shares = torque_shares(loadings)
    constants = (*dict.fromkeys((*shares, *level.shifts)),)
    slope = by_level(estimator_of(loadings), loadings, level) if constants and not level.is_bound else 0.0
    by = {c: level.shifts.get(c, 0.0) - level.value * shares.get(c, 0.0) for c in constants}
    return shifted(e, {c: (e.value or 0.0) * shares.get(c, 0.0) + slope * by[c] for c in constants})

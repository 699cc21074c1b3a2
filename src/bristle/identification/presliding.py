"""sigma_0 and sigma_1 from slow loading below breakaway, 3.2: (14) as printed, its closed-form inverse, edge to edge, and all samples.

While the joint loads slowly from zero torque, T = g0 (1 - exp(-sigma_0 y / g0)), so U = -g0 log(1 - T / g0) is sigma_0 times the displacement y.
Where inside a count the joint rests is not known: only differences of y are. One encoder count is q.

    printed      T1 / x1 at the first displacement x1 that is measured (14)
    corrected    U1 / x1: exact where rest lies on a count edge
    edges        the slope of U over y at the count edges, each loading with an intercept of its own
    samples      one over the slope of y over U, all samples, time as the instrument: neither counts nor torque noise follow the time
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bristle.data.loading import Loading, Loop, find_loadings, find_loops
from bristle.data.options import FitOptions
from bristle.data.record import Record
from bristle.data.statistics import inflation
from bristle.identification.estimate import Estimate, Presliding, PreslidingFit
from bristle.identification.uncertainty import LEVEL, student
from bristle.model import functions
from bristle.model.arrays import Array, evaluate
from bristle.model.parameters import Kind, unit

DAMPING_RATIO = 0.1
"""What (15) assumes: 0.2 sqrt(J sigma_0) is 2 * 0.1 sqrt(J sigma_0)."""
_REACH = 0.8
"""Of g0: above, a little noise in T is much in log(1 - T / g0)."""
_LIMIT = 0.97
"""Of g0: noise may reach above _REACH, but not to where U has no value."""
_PHASES = 64
"""Where inside a count the joint may rest, for the spread that counts alone cause."""
_FEW = 8
"""Count edges in a loading below which they are called few."""
_YIELDS = 3.0
"""An edge-to-edge stiffness this many times below what the first count allows is that of a joint that slides."""
_OUTLIER = 0.2
"""A breakaway torque this far from the median, relative, is named."""
_SINGLE = 0.1
"""Standard error of a breakaway torque seen once, relative: a guess, said where it is used."""


class Level(NamedTuple):
    """A quantity from elsewhere: g0 = alpha_0 + alpha_1, the torque at which slow loading slides (N*m), or the inertia (kg*m**2)."""

    value: float
    standard_error: float
    source: str


@dataclass(frozen=True, slots=True)
class _Piece:
    """A loading as the estimators take it."""

    time: Array
    y: Array
    U: Array
    edge_y: Array
    edge_U: Array
    weight: Array
    """Of the edges: one over the variance of U at constant noise in T."""


def identify_presliding(
    records: Sequence[Record],
    levels: Mapping[str, Level],
    inertia: Level | None,
    options: FitOptions,
    resolution: float | None,
    kind: Kind,
) -> Presliding:
    """Everything that presliding runs show of a joint.

    Args:
        records: with position and torque.
        levels: g0 per direction, where other runs tell it; where none does, breakaway in these runs stands in.
        inertia: for (15); None where unknown.
        options: the experiment's `fit`.
        resolution: one encoder count, rad; None: from the data.
        kind: of the joint.

    Raises ValueError where a run holds no loading from zero torque, or slides from its start.
    """
    found: list[Loading] = []
    for record in records:
        own = find_loadings(record, options.presliding_cutoff, resolution, options.breakaway_displacement)
        if not own:
            raise ValueError(
                f"{record.file}: the torque never grows slowly from zero; a presliding run is a slow ramp or cycle of torque from rest"
            )
        found += own
    slid = [loading for loading in found if loading.breakaway is not None]
    fits, breakaway, doubts = {}, {}, list[str]()
    for direction in ("+", "-"):
        own_slid = [x for x in slid if x.direction == direction]
        if own_slid:
            breakaway[direction], said = _breakaway(own_slid, direction, kind)
            doubts += said
    for direction in sorted({loading.direction for loading in found}):
        level = levels.get(direction) or _from_breakaway(breakaway, direction)
        if level is None:
            doubts.append(
                f"No sigma_0 in direction {direction}: it needs the torque at which the joint slides; add ramp runs, or load up to breakaway once."
            )
            continue
        fits[direction] = fit_presliding([x for x in found if x.direction == direction], level, inertia, kind)
    loops = tuple(x for r in records for x in find_loops(r, options.presliding_cutoff, resolution))
    doubts += _loop_doubts(loops)
    return Presliding(fits=fits, breakaway=breakaway, breakaways=tuple(slid), loops=loops, doubts=tuple(doubts))


def fit_presliding(loadings: Sequence[Loading], level: Level, inertia: Level | None, kind: Kind) -> PreslidingFit:
    """sigma_0 of one direction by four estimators, side by side, and sigma_1 by (15).

    Args:
        loadings: of one direction, at least one.
        level: g0 of this direction.
        inertia: for (15); None: sigma_1 is absent, with the reason.
        kind: of the joint.
    """
    quantum = max(loading.quantum for loading in loadings)
    pieces = [_piece(loading, level.value) for loading in loadings]
    counts = sum(piece.edge_y.size for piece in pieces)
    still = max(float(np.ptp(piece.y)) for piece in pieces) == 0
    doubts: list[str] = []
    if still or (quantum > 0 and not any(piece.edge_y.size > 1 for piece in pieces)):
        bound = _lower_bound(pieces, quantum, kind)
        estimates = dict.fromkeys(("printed", "corrected", "edges", "samples"), bound)
        doubts.extend(bound.doubts)
    else:
        estimates = _estimates(loadings, level, quantum, kind)
    if 0 < counts < _FEW * len(pieces):
        doubts.append(
            f"Few encoder counts: {counts} edges in {len(pieces)} loadings; a finer encoder, or torque nearer to breakaway, would help."
        )
    first = estimates["corrected"]
    if first.interval and (estimates["edges"].value or np.inf) < first.interval[0] / _YIELDS:
        doubts.append(
            "The joint moves much further than its first counts let expect: it slides, or this is no slow loading below breakaway."
        )
    best = "edges" if quantum > 0 else "samples"
    sigma_0 = estimates[best]
    u = np.array([max((sigma_0.value or 0.0) * quantum / level.value, 1e-9)])
    on_edge, mean, spread = (float(x[0]) for x in printed_bias(u))
    reached = max(float(loading.torque.max()) for loading in loadings)
    if reached > level.value:
        doubts.append(
            f"The torque reaches {reached:.3g} without sliding, above g0 = {level.value:.3g} ({level.source}): g0 may be too low. "
            f"Samples above {_REACH:g} g0 are left out."
        )
    return PreslidingFit(
        direction=loadings[0].direction,
        **estimates,
        sigma_1=_sigma_1(sigma_0, inertia, kind),
        recommended=best,
        level=level.value,
        level_standard_error=level.standard_error,
        level_source=level.source,
        quantum=quantum,
        counts=counts,
        bias_on_edge=on_edge,
        bias_mean=mean,
        bias_spread=spread,
        loadings=tuple(loadings),
        doubts=tuple(doubts),
    )


def printed_bias(u: Array) -> tuple[Array, Array, Array]:
    """Relative bias of (14) for u = sigma_0 q / g0: -0.5 is half of the truth.

    Returns it where rest lies on a count edge, (1 - exp(-u)) / u - 1; then its mean and its standard deviation over a uniformly distributed rest
    position in the count; each of the shape of u, u > 0.
    """
    on_edge = -np.expm1(-u) / u
    below = u < 1e-4  # where the differences below would be rounding
    safe = np.where(below, 1.0, u)
    at = -np.expm1(-safe) / safe
    mean = np.where(below, 0.5 - u / 6, (1 - at) / safe)
    square = np.where(below, 1 / 3 - u / 4, (1 - 2 * at - np.expm1(-2 * safe) / (2 * safe)) / safe**2)
    return on_edge - 1, mean - 1, np.sqrt(np.maximum(square - mean**2, 0.0))


def _breakaway(slid: Sequence[Loading], direction: str, kind: Kind) -> tuple[Estimate, list[str]]:
    """The median breakaway torque of some loadings, and its outliers by name."""
    torque = np.array([loading.breakaway for loading in slid], dtype=float)
    middle, n = float(np.median(torque)), torque.size
    if n == 1:
        return Estimate(value=middle, unit=unit("torque", kind), doubts=("One run only: no error can be given.",)), []
    error = float(1.2533 * 1.4826 * np.median(np.abs(torque - middle)) / np.sqrt(n))  # of a median of normal values
    reach = student(n - 1) * error
    doubts = [
        f"{loading.file} is an outlier: it breaks away at {value:.4g}; the median of {n} runs in direction {direction} is {middle:.4g}."
        for loading, value in zip(slid, torque.tolist(), strict=True)
        if n > 2 and abs(value - middle) > _OUTLIER * middle
    ]
    return Estimate(
        value=middle,
        unit=unit("torque", kind),
        standard_error=error,
        interval=(max(middle - reach, 0.0), middle + reach),
    ), doubts


def _from_breakaway(breakaway: Mapping[str, Estimate], direction: str) -> Level | None:
    """g0 from the breakaway of this direction, or else of the other one."""
    for d in (direction, "-" if direction == "+" else "+"):
        if d in breakaway:
            value, error = breakaway[d].value or 0.0, breakaway[d].standard_error
            guess = "" if error else f"; its error of {_SINGLE:.0%} is a guess"
            return Level(value, error or _SINGLE * value, f"breakaway in direction {d}{guess}")
    return None


def _loop_doubts(loops: Sequence[Loop]) -> list[str]:
    few = [x.counts for x in loops if 0 < x.counts < 2 * _FEW]
    if not few:
        return []
    span = f"{min(few)}" if min(few) == max(few) else f"{min(few)} to {max(few)}"
    return [f"The hysteresis loops span only {span} encoder counts: their slopes and losses are coarse."]


def _unbent(torque: Array, g0: float) -> Array:
    """U = sigma_0 y of slow loading to this torque, N*m."""
    return evaluate(functions.loading_displacement(), torque, g0, 1.0)[0]


def _piece(loading: Loading, g0: float) -> _Piece:
    low = loading.torque < _REACH * g0
    stop = low.size if low.all() else int(np.argmin(low))
    reached = float(loading.displacement[:stop].max(initial=0.0))
    edge = loading.edge_displacement <= reached
    T = np.minimum(loading.edge_torque[edge], _LIMIT * g0)
    y, U = loading.edge_displacement[edge], _unbent(T, g0)
    # 1 - T / g0 from a line through the edges: from T itself, noise that raises U would also lower its weight
    line = np.polynomial.polynomial.polyfit(y, U, min(y.size - 1, 1), w=1 - T / g0) if y.size else np.zeros(1)
    return _Piece(
        time=loading.time[:stop],
        y=loading.displacement[:stop],
        U=_unbent(np.minimum(loading.torque[:stop], _LIMIT * g0), g0),
        edge_y=y,
        edge_U=U,
        weight=np.exp(-2 * np.maximum(np.polynomial.polynomial.polyval(y, line), 0.0) / g0),
    )


def _estimates(loadings: Sequence[Loading], level: Level, quantum: float, kind: Kind) -> dict[str, Estimate]:
    """All four; the last two with the uncertainty at given g0, and the one that g0 adds."""
    width = max(1e-4 * level.value, min(level.standard_error, 0.1 * level.value))
    pieces, less, more = (
        [_piece(loading, g0) for loading in loadings] for g0 in (level.value, level.value - width, level.value + width)
    )
    value, error, freedom = _samples(pieces)
    by_level = (_samples(more)[0] - _samples(less)[0]) / (2 * width) * level.standard_error
    if quantum == 0:
        absent = Estimate(
            value=None,
            unit=unit("sigma_0", kind),
            doubts=("No encoder counts are seen: (14) and the count edges need them.",),
        )
        samples = _estimate(value, float(np.hypot(error, by_level)), freedom, kind)
        return {"printed": absent, "corrected": absent, "edges": absent, "samples": samples}
    bias, spread = _by_phase(pieces, value, quantum)
    error = float(np.sqrt(error**2 + by_level**2 + spread**2))
    doubt = (
        f"Counts bias this estimate by about {bias / value:.1%}, more than its standard error."
        if abs(bias) > error
        else ""
    )
    samples = _estimate(value, error, freedom, kind, doubt)
    value, error, freedom = _edges(pieces)
    by_level = (_edges(more)[0] - _edges(less)[0]) / (2 * width) * level.standard_error
    return {
        "printed": _first_count(loadings, level.value, quantum, kind, _noise(pieces), corrected=False),
        "corrected": _first_count(loadings, level.value, quantum, kind, _noise(pieces), corrected=True),
        "edges": _estimate(value, float(np.hypot(error, by_level)), freedom, kind),
        "samples": samples,
    }


def _estimate(value: float, error: float, freedom: float, kind: Kind, doubt: str = "") -> Estimate:
    reach = student(freedom) * error
    wrong = "" if value > 0 else "Not positive: the displacement does not grow with the torque."
    return Estimate(
        value=value,
        unit=unit("sigma_0", kind),
        standard_error=error,
        interval=(max(value - reach, 0.0), value + reach),
        doubts=tuple(filter(None, (doubt, wrong))),
    )


def _first_count(
    loadings: Sequence[Loading], g0: float, quantum: float, kind: Kind, noise: float, *, corrected: bool
) -> Estimate:
    """(14), or its inverse, averaged over the loadings; the interval is that of a rest position anywhere in the count, and of noise in U."""
    T = np.array([x.edge_torque[0] for x in loadings if x.edge_torque.size and x.edge_torque[0] < g0])
    if T.size == 0:
        return Estimate(value=None, unit=unit("sigma_0", kind), doubts=("No displacement was measured below g0.",))
    U = _unbent(T, g0)
    half = LEVEL / 2 if T.size == 1 else min(LEVEL / 2, 1.96 / float(np.sqrt(12 * T.size)))
    off = 1.96 * noise / float(np.sqrt(T.size))
    low = max(float(np.mean(U)) - off, 0.0) / (quantum * (0.5 + half))
    high = (float(np.mean(U)) + off) / (quantum * (0.5 - half))
    return Estimate(
        value=float(np.mean(U if corrected else T)) / quantum,
        unit=unit("sigma_0", kind),
        interval=(low, high),
        doubts=(
            "Takes a whole count for the way to the first edge, of which any part may be true; the interval is that of an unknown rest position.",
        ),
    )


def _centred(pieces: Sequence[_Piece]) -> tuple[list[Array], list[Array]]:
    """Edges of each loading that has two or more, about their weighted means: y and U, each times the root of its weight."""
    ys, Us = [], []
    for p in pieces:
        if p.edge_y.size > 1:
            root, total = np.sqrt(p.weight), p.weight.sum()
            ys.append(root * (p.edge_y - p.weight @ p.edge_y / total))
            Us.append(root * (p.edge_U - p.weight @ p.edge_U / total))
    return ys, Us


def _edges(pieces: Sequence[_Piece]) -> tuple[float, float, float]:
    """Slope of U over y at the count edges by weighted least squares, its standard error, and its degrees of freedom."""
    ys, Us = _centred(pieces)
    y, U = np.concatenate(ys), np.concatenate(Us)
    slope = float(y @ U / (y @ y))
    score, freedom = y * (U - slope * y), y.size - len(ys) - 1
    stretch = inflation(score)
    # two edges and an intercept leave no residual to judge by: then the slope may be off by as much as itself
    variance = float(score @ score) * y.size / freedom * stretch / float(y @ y) ** 2 if freedom > 0 else slope**2
    return slope, float(np.sqrt(variance)), max(y.size / stretch - len(ys) - 1, 1.0)


def _noise(pieces: Sequence[_Piece]) -> float:
    """Standard deviation of U about the line through the edges, near zero torque."""
    ys, Us = _centred(pieces)
    slope = _edges(pieces)[0]
    rest = np.concatenate([u - slope * x for x, u in zip(ys, Us, strict=True)])
    return float(np.sqrt(rest @ rest / max(rest.size - len(ys) - 1, 1)))


def _samples(pieces: Sequence[_Piece], shifted: Sequence[Array] | None = None) -> tuple[float, float, float]:
    """One over the slope of y over U with time as the instrument, its standard error, and its degrees of freedom."""
    columns = [p.time for p in pieces], shifted or [p.y for p in pieces], [p.U for p in pieces]
    t, y, U = (np.concatenate([values - values.mean() for values in column]) for column in columns)
    along = float(t @ U)
    compliance = float(t @ y) / along if along else 0.0
    rest = y - compliance * U
    score = t * rest  # what scatters, correlated and of a variance that grows with the torque
    stretch = inflation(score)
    freedom = max(y.size / stretch - len(pieces) - 1, 1.0)
    error = np.sqrt(float(score @ score) * stretch * y.size / max(y.size - len(pieces) - 1, 1)) / abs(along or 1.0)
    value = 1 / compliance if compliance else float("inf")
    return value, float(error * value**2), freedom


def _by_phase(pieces: Sequence[_Piece], sigma_0: float, quantum: float) -> tuple[float, float]:
    """Mean error and standard deviation of the all-sample estimate over where in a count the joint rests, by counting the fitted displacement."""
    found = []
    for phase in (np.arange(_PHASES) + 0.5) / _PHASES:
        rest = [(phase + k * 0.618) % 1.0 for k in range(len(pieces))]  # another one in each loading
        shifted = [quantum * np.floor(p.U / (sigma_0 * quantum) + r) for p, r in zip(pieces, rest, strict=True)]
        found.append(_samples(pieces, shifted)[0])
    return float(np.mean(found)) - sigma_0, float(np.std(found))


def _lower_bound(pieces: Sequence[_Piece], quantum: float, kind: Kind) -> Estimate:
    """What is left where the joint moves by no more than the encoder's noise."""
    loaded = max((float(piece.U.max(initial=0.0)) for piece in pieces), default=0.0)
    crossed = max(piece.edge_y.size for piece in pieces)
    least = loaded / ((crossed + 1) * quantum) if quantum > 0 else 0.0
    seen = f"{crossed} count edge{'' if crossed == 1 else 's'} in the longest loading"
    return Estimate(
        value=None,
        unit=unit("sigma_0", kind),
        interval=(least, float("inf")),
        doubts=(
            f"The displacement stays within the encoder's noise ({seen}): sigma_0 is at least {least:.3g} {unit('sigma_0', kind)}; "
            "a finer encoder is needed for more.",
        ),
    )


def _sigma_1(sigma_0: Estimate, inertia: Level | None, kind: Kind) -> Estimate:
    """(15): a prior from an assumed damping ratio, no estimate."""
    if inertia is None or not sigma_0.value or sigma_0.value < 0:
        why = (
            "there is no sigma_0"
            if inertia
            else "no inertia is known: give inertia in the experiment file, or moving runs"
        )
        return Estimate(
            value=None, unit=unit("sigma_1", kind), doubts=(f"Absent: (15) needs J and sigma_0, and {why}.",)
        )
    value, by_sigma_0, by_J = (
        float(x) for x in evaluate(functions.presliding_damping(), sigma_0.value, inertia.value, DAMPING_RATIO)
    )
    return Estimate(
        value=value,
        unit=unit("sigma_1", kind),
        standard_error=float(np.hypot(by_sigma_0 * (sigma_0.standard_error or 0.0), by_J * inertia.standard_error)),
        doubts=(
            f"A prior, not an estimate: (15) assumes a damping ratio of {DAMPING_RATIO:g} (J: {inertia.source}); "
            "its error holds none of that assumption's.",
        ),
    )

"""Delay of the torque of slow loading: a bristle turns torque and displacement at the same time."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from bristle.arrays import Array
from bristle.data.differentiation import between_gaps, smoothed
from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.data.slow_loading import Loading, find_all_loadings, torque_turns
from bristle.errors import InputError
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.linear import inverse_gram
from bristle.findings import CAUTION, Finding
from bristle.identification.presliding.stiffness import by_samples, of_loading, unbent

_SURE = 4.0  # standard errors of a reported lag
_SHARE = 0.02  # least change of sigma_0 that is reported
_ORDER = 5  # coefficients of the torque on each side
_SIDE = 0.4  # of the time to the next turn: a fitted side
_APART = 0.1  # of a side, next to the turn: not fitted, because the low pass distorts it
_HELD = 4.0  # error of a turn's time per torque held back where the sides meet
_BELOW = 1.05  # least ratio of g0 to the torque of a turn
_COUNTS = 8.0  # least motion on each side, counts
_PER_SIDE = 20  # least samples on a side
_MOST = 2000  # samples about a turn; more are thinned
_DRAWS = 100  # of the torque's coefficients, for the error of its turn
_GRID = 601  # times at which a turn is sought
_LOOKS = (0.4, 0.04, 0.004)  # ranges of successive searches for the delay, in sides
_LOOK = 21  # values per search
_PIECE = 0.005  # of a side: step of the derivative by the delay
_TINY = 1e-300  # no division by zero


def turning_lag(
    records: Sequence[Record],
    loadings: Sequence[Loading],
    levels: Mapping[str, float],
    options: FitOptions,
    resolution: float | None,
) -> list[Finding]:
    """A caution where the torque is late or early and this changes sigma_0; `levels` are g0, N*m, resolution in rad."""
    # lag of the torque and its standard error, s, at each turn before which nothing slides
    lags = list[tuple[float, float]]()
    for record in records:
        own = [x for x in loadings if x.file == record.file]
        slid = [x.start for x in own if x.breakaway is not None]
        torque, position, time = np.asarray(record.torque), np.asarray(record.position), record.time
        for before, at, after, sign in _turns(record):
            side = _SIDE * float(min(time[at] - time[before], time[after] - time[at]))
            g0 = levels.get("+" if sign > 0 else "-", 0.0)
            if any(before <= start < at for start in slid) or not g0:
                continue
            near = np.flatnonzero(abs(time - time[at]) < side)
            near = near[:: 1 + near.size // _MOST]
            s, y, far = (time[near] - time[at]) / side, sign * position[near], max(_COUNTS * own[0].quantum, _TINY)
            if all(np.count_nonzero(rows) > _PER_SIDE and np.ptp(y[rows]) >= far for rows in (near < at, near > at)):
                value, error = _lag(s, sign * torque[near], y, g0)
                lags.append((side * value, float(np.hypot(side * error, record.step / 2))))
    if not lags:
        return []
    values, errors = np.array(lags).T
    weight = errors**-2
    lag = float(weight @ values / weight.sum())
    scatter = float(weight @ (values - lag) ** 2) / max(values.size - 1, 1)
    if abs(lag) < _SURE * np.sqrt(max(scatter, 1.0) / weight.sum()):
        return []
    in_time = [replace(r, torque=np.interp(r.time + lag, r.time, np.asarray(r.torque))) for r in records]
    try:
        found = find_all_loadings(in_time, resolution, options.breakaway_displacement)
    except InputError:
        return []
    moved, changes = [x for of_record in found for x in of_record], list[float]()
    for d, g0 in levels.items():
        pieces = [[of_loading(x, g0) for x in of if x.direction == d] for of in (moved, loadings)]
        changes += [by_samples(pieces[0])[0] / by_samples(pieces[1])[0] - 1] if all(pieces) else []
    change = max((x for x in changes if np.isfinite(x)), key=abs, default=0.0)
    if abs(change) < _SHARE:
        return []
    step = float(np.median([r.step for r in records]))
    seconds, samples, when = abs(lag), abs(lag) / step, "later" if lag > 0 else "earlier"
    message = (
        f"The torque of slow loading turns {seconds:.2g} s ({samples:.2g} samples) {when} than the displacement, where a "
        f"bristle turns both at once: taken in time it changes sigma_0 by {100 * change:+.0f} %. Check the time stamps, or "
        f"write `delay: {lag:.3g} s` under signals.torque (or the signal it comes from)."
    )
    numbers = {"seconds": seconds, "samples": samples, "when": when, "change": change, "delay": lag}
    return [Finding("turns-late", CAUTION, message, numbers)]


def _turns(record: Record) -> list[tuple[int, int, int, float]]:
    """Samples of each turn of the torque and of its neighbours; 1 at a top, -1 at a bottom."""
    torque = np.asarray(record.torque)
    slow = smoothed(record, torque, record.cutoff) if record.cutoff < 0.5 / record.step else torque
    found = list[tuple[int, int, int, float]]()
    for segment in between_gaps(record):
        tops, bottoms = torque_turns(slow[segment])
        turns = np.sort(np.concatenate([tops, bottoms])) + segment.start
        bounds = [segment.start, *turns.tolist(), segment.stop - 1]
        signs = np.where(np.isin(turns, tops + segment.start), 1.0, -1.0).tolist()
        found += zip(bounds[:-2], bounds[1:-1], bounds[2:], signs, strict=True)
    return found


def _lag(s: Array, T: Array, y: Array, g0: float) -> tuple[float, float]:
    """The lag and its error, in sides, from times about the turn, torques and displacements, (n,)."""
    # the torque: two quartics of time, which meet at the turn
    rng, sides = np.random.default_rng(0), []
    for rows in (s < -_APART, s > _APART):
        powers = np.vander(s[rows], _ORDER)
        inverse = inverse_gram(powers)
        best = inverse @ (powers.T @ T[rows])
        rest = T[rows] - powers @ best
        spread = np.sqrt(float(rest @ rest) / (rest.size - _ORDER) * inflation(rest))
        draws = rng.standard_normal((_DRAWS, _ORDER)) @ np.linalg.cholesky(inverse).T
        sides.append(np.vstack([best, best + spread * draws]))
    at = np.linspace(-3 * _APART, 3 * _APART, _GRID)
    powers = np.vander(at, _ORDER).T
    turns = at[np.argmax(np.minimum(sides[0] @ powers, sides[1] @ powers), axis=1)]
    top = min(float(np.polyval(x[0], turns[0])) for x in sides)
    near, fall = abs(s) <= _APART, top - (np.polyval(sides[0][0], -1.0) + np.polyval(sides[1][0], 1.0)) / 2
    below = np.minimum(*(np.polyval(x[0], s[near]) for x in sides)) - T[near]
    seen = abs(float(below.mean())) + 2 * float(below.std()) / np.sqrt(below.size) if below.size else 0.0
    held = _HELD * seen / max(float(fall), _TINY)
    of_turn = float(np.linalg.norm([np.std(turns[1:]), at[1] - at[0], held]))
    up, down, turn, g0 = sides[0][0], sides[1][0], float(turns[0]), max(g0, _BELOW * top)
    most = g0 / _BELOW
    top = float(np.clip(min(np.polyval(x, turn) for x in (up, down)), -most, most))

    def shapes(delay: float) -> Array:
        """Columns of the displacement at the delayed torque, (n, 5)."""
        before = s + delay < turn
        load = np.clip(np.where(before, np.polyval(up, s + delay), np.polyval(down, s + delay)), -most, top)
        rise, fall = (unbent(x * load, g0) - unbent(np.array(x * top), g0) for x in (1, -1))
        rise, fall = np.where(before, rise, 0.0), np.where(before, 0.0, fall)
        columns = np.column_stack([np.ones(s.size), rise, rise**2, fall, fall**2])
        return np.asarray(columns / np.maximum(np.linalg.norm(columns, axis=0), _TINY))

    def fitted(delay: float) -> Array:
        """The fitted displacement, (n,)."""
        columns = shapes(delay)
        return columns @ (inverse_gram(columns) @ (columns.T @ y))

    delay = 0.0
    for reach in _LOOKS:
        tried = (delay + reach * np.linspace(-1, 1, _LOOK)).tolist()
        delay = tried[int(np.argmin([np.sum((y - fitted(x)) ** 2) for x in tried]))]
    columns, rest = shapes(delay), y - fitted(delay)
    slope = (fitted(delay + _PIECE) - fitted(delay - _PIECE)) / (2 * _PIECE)
    beside = slope - columns @ (inverse_gram(columns) @ (columns.T @ slope))
    variance = float(rest @ rest) / (rest.size - columns.shape[1] - 1) * inflation(rest)
    error = np.sqrt(variance / max(float(beside @ beside), _TINY))
    return delay, float(np.hypot(error, of_turn))

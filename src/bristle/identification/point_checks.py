"""Checks of all points of constant velocity together: drift, order of speeds, swings, copies, offset."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.linalg import block_diag
from scipy.special import stdtr

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.data.experiment.load import Experiment
from bristle.data.record import Record
from bristle.estimation.levels import RARE, SIGNIFICANCE
from bristle.findings import CAUTION, NOTE, Finding, in_direction, unit_of
from bristle.identification.fits import StaticFit
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import DIRECTIONS
from bristle.identification.shared_findings import offset_of_levels, offset_or_friction
from bristle.identification.static.points import point_regressors
from bristle.model import functions
from bristle.model.parameters import Direction, ParameterName
from bristle.model.vectorize import evaluate

_ENOUGH = 5  # points of a direction for an order or a drift
_COPIES = 3  # copies that are no chance
_SWINGS = 0.15  # of the mean velocity, rms: smaller swings do not matter
_PHASES = 16  # of a sine, for averages
_IN_ORDER = 0.9  # rank correlation of speed and time from which they are confounded
_SETTLES = 6  # the first of so many parts of a hold is left out


def point_warnings(measured: Measured, points: Sequence[Segment], static: Mapping[str, StaticFit]) -> Iterator[Finding]:
    """Warnings about the fitted points, taken together."""
    records = {run.record.file: run.record for run in measured.runs if run.kind == "ramp" and not run.hold_out}
    scatter = [fit.rms for fit in static.values() if fit.rms is not None]
    if scatter:
        yield from _drift([s for s in points if s.file in records], records, max(scatter))
    yield from _swinging(points, static)
    yield from _repeated(measured, points)
    yield from _offset(measured.experiment, static)


def _drift(points: Sequence[Segment], records: Mapping[str, Record], scatter: float) -> Iterator[Finding]:
    """Drift of the torque within holds (t test of slopes), and speeds in order of time."""
    if not points:
        return
    in_order = dict[str, float]()  # rank correlation of speeds with their order
    for d, sign in DIRECTIONS.items():
        speeds = [abs(s.velocity) for s in points if s.velocity * sign > 0]
        ranks = np.argsort(np.argsort(speeds))
        order = float(np.corrcoef(ranks, np.arange(len(speeds)))[0, 1]) if len(speeds) >= _ENOUGH else 0.0
        in_order |= {d: order} if abs(order) > _IN_ORDER else {}
    # slopes of the torque along the motion, N*m/s, without the beginning of each hold; durations, s
    slopes, durations = np.zeros((2, len(points)))
    for k, s in enumerate(points):
        record, part = records[s.file], slice(s.start + (s.stop - s.start) // _SETTLES, s.stop)
        torque = np.zeros(0) if record.torque is None else record.torque
        time = record.time[part] - record.time[part].mean()
        slopes[k] = float(time @ torque[part]) / (float(time @ time) or 1.0) * float(np.sign(s.velocity))
        durations[k] = np.ptp(time)
    level = float(np.median(np.abs([s.torque for s in points])))
    if not level or np.count_nonzero(durations) < _ENOUGH:
        return
    weight = durations**3 / np.sum(durations**3)  # the variance of a slope falls with the third power of its length
    mean = float(weight @ slopes)
    error = float(np.sqrt(weight**2 @ (slopes - mean) ** 2 / (1 - weight.max())))
    times = [s.time for s in points if s.time is not None]
    one = len({s.file for s in points}) == 1 and len(times) == len(points)
    across = abs(mean) * (max(times) - min(times) if one else float(durations.sum()))  # from first point to last
    level_of_test = SIGNIFICANCE if in_order else RARE
    chance = 2 * stdtr(1 / (weight @ weight) - 1, -abs(mean) / error) if error else 1.0
    if chance > level_of_test or across < 2 * scatter:
        return
    numbers, T = {"slope": mean, "across": across, "share": across / level}, unit_of("torque")
    effect, share = {"torque": across}, f"{100 * across / level:.0f} % of the torque"
    if not in_order:
        message = (
            f"The torque drifts within the holds, by {mean:+.2g}{T} per second and {across:.3g}{T} from first to last ({share}): it depends on "
            "time or temperature, and the points scatter by it. Warm up, and repeat the first speeds at the end."
        )
        yield Finding("drift-over-runs", CAUTION, message, numbers, effect)
        return
    first = next(iter(in_order))
    direction, way = first if len(in_order) == 1 else "both", "rises" if in_order[first] > 0 else "falls"
    message = (
        f"Speed {way} with the order of the runs{in_direction(direction)} while the torque drifts within them ({mean:+.2g}{T} per second, "
        f"{across:.3g}{T} from first to last, {share}): drift and speed cannot be told apart. Warm up, and take the speeds in random order."
    )
    yield Finding("drift-in-order", CAUTION, message, {"direction": direction, "way": way, **numbers}, effect)


def _swinging(points: Sequence[Segment], static: Mapping[str, StaticFit]) -> Iterator[Finding]:
    """Holds whose velocity swings where friction bends: the fitted law is averaged over a sine of that size."""
    phases = np.sin(2 * np.pi * (np.arange(_PHASES) + 0.5) / _PHASES)
    off = list[tuple[float, Segment]]()
    for d, fit in static.items():
        law, sign = fit.values(), DIRECTIONS.get(d)
        own = [s for s in points if s.swing > _SWINGS * abs(s.velocity) and (sign is None or s.velocity * sign > 0)]
        if law is None or not fit.rms or not own:
            continue
        v, swing = (np.array([[getattr(s, name)] for s in own]) for name in ("velocity", "swing"))
        speeds = np.hstack([np.abs(v), np.abs(v) + np.sqrt(2) * swing * phases])
        (torque,) = evaluate(functions.steady_torque_function(law.law), speeds, *law)
        moved: Array = torque[:, 1:].mean(axis=1) - torque[:, 0]
        off += [(float(x) / fit.rms, s) for s, x in zip(own, np.abs(moved), strict=True) if x > fit.rms]
    if off:
        ratio, worst = max(off, key=lambda x: x[0])
        largest = max(s.swing / abs(s.velocity) for _, s in off)
        message = (
            f"In {len(off)} of {len(points)} holds the velocity swings by up to {100 * largest:.0f} % of its mean (rms) where friction bends with "
            f"speed: the mean torque is then not the friction at the mean speed, and is off by up to {ratio:.2g} times the residuals of the "
            f"fit ({worst.file} {worst.where}). Tune the speed loop, or hold these speeds again."
        )
        numbers = {"count": len(off), "points": len(points), "swing": largest, "ratio": ratio}
        yield Finding("holds-swing", CAUTION, message, {**numbers, "file": worst.file, "where": worst.where})


def _repeated(measured: Measured, points: Sequence[Segment]) -> Iterator[Finding]:
    """Points that are exact copies of others."""
    for file in (run.record.file for run in measured.runs if run.kind == "points" and not run.hold_out):
        own = [s for s in points if s.file == file]
        values = np.array([(s.velocity, s.torque) for s in own]).reshape(-1, 2)
        distinct = np.unique(values, axis=0, return_index=True)[1]
        copies = np.setdiff1d(np.arange(len(own)), distinct)
        if copies.size >= _COPIES and distinct.size == np.unique(values[:, 0]).size:
            factor, where = float(np.sqrt(len(own) / distinct.size)), own[copies[0]].subject[1]
            message = (
                f"{copies.size} of {len(own)} points of {file} repeat the speed and the torque of another exactly, first {where}: if they were "
                f"written twice, errors are too small, by up to {factor:.2g} times. Leave the copies out with `exclude` under fit."
            )
            numbers = {"count": copies.size, "points": len(own), "file": file, "where": where, "factor": factor}
            yield Finding("points-repeated", CAUTION, message, numbers)


def _offset(experiment: Experiment, static: Mapping[str, StaticFit]) -> list[Finding]:
    """Whether the two directions differ by a constant alone, else the offset they would have."""
    fits = [static[d] for d in DIRECTIONS if d in static]
    if experiment.fit.directions != "separate" or len(fits) < 2 or any(fit.is_superseded for fit in fits):
        return []
    if not point_regressors(experiment):
        names = [ParameterName(name, Direction(fit.direction)) for fit in fits for name in fit.names]
        values = {name: static[name.direction].parameters[name.name].value or 0.0 for name in names}
        both = block_diag(*(fit.covariance for fit in fits))
        if found := offset_or_friction(names, values, both, min(fit.degrees_of_freedom or 0 for fit in fits)):
            return found
    if (found_apart := offset_of_levels(*(fit.parameters["alpha_0"] for fit in fits))) is None:
        return []
    (offset, common), T = found_apart, unit_of("torque")
    message = (
        f"An offset of the torque cannot be told from a difference of alpha_0, and is not fitted. If alpha_0 were {common:.4g}{T} in both "
        f"directions, the offset would be {offset:.3g}{T}: see whether the torque is zero where nothing loads the joint."
    )
    return [Finding("offset-left-out", NOTE, message, {"offset": offset, "common": common})]

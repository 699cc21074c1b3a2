"""A drift of the torque that no residual shows, because speed goes with time."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.special import stdtr

from bristle.data.constant_velocity.segments import Segment
from bristle.estimation import levels
from bristle.findings import CAUTION, Finding, in_direction, unit_of
from bristle.identification.fits import StaticFit
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import DIRECTIONS

_SETTLES = 6  # the first of so many parts of a hold is left out


def point_warnings(measured: Measured, points: Sequence[Segment], static: Mapping[str, StaticFit]) -> Iterator[Finding]:
    """A caution where speeds come in the order of time while the torque drifts within the holds (t test of slopes)."""
    records = {run.record.file: run.record for run in measured.runs if run.kind == "ramp" and not run.hold_out}
    points = [s for s in points if s.file in records]
    in_order = dict[str, float]()  # rank correlation of speeds with their order
    for d, sign in DIRECTIONS.items():
        speeds = [abs(s.velocity) for s in points if s.velocity * sign > 0]
        ranks = np.argsort(np.argsort(speeds))
        order = float(np.corrcoef(ranks, np.arange(len(speeds)))[0, 1]) if len(speeds) >= levels.SEVERAL else 0.0
        in_order |= {d: order} if abs(order) > levels.IN_ORDER else {}
    scatter = max((fit.rms for fit in static.values() if fit.rms is not None), default=np.inf)
    level = float(np.median(np.abs([s.torque for s in points]))) if points else 0.0
    if not in_order or not level:
        return
    # slopes of the torque along the motion, N*m/s, without the beginning of each hold; durations, s
    slopes, durations = np.zeros((2, len(points)))
    for k, s in enumerate(points):
        record, part = records[s.file], slice(s.start + (s.stop - s.start) // _SETTLES, s.stop)
        torque = np.zeros(0) if record.torque is None else record.torque
        time = record.time[part] - record.time[part].mean()
        slopes[k] = float(time @ torque[part]) / (float(time @ time) or 1.0) * float(np.sign(s.velocity))
        durations[k] = np.ptp(time)
    if np.count_nonzero(durations) < levels.SEVERAL:
        return
    weight = durations**3 / np.sum(durations**3)  # the variance of a slope falls with the third power of its length
    mean = float(weight @ slopes)
    error = float(np.sqrt(weight**2 @ (slopes - mean) ** 2 / (1 - weight.max())))
    times = [s.time for s in points if s.time is not None]
    one = len({s.file for s in points}) == 1 and len(times) == len(points)
    across = abs(mean) * (max(times) - min(times) if one else float(durations.sum()))  # from first point to last
    chance = 2 * stdtr(1 / (weight @ weight) - 1, -abs(mean) / error) if error else 1.0
    if chance > levels.SIGNIFICANCE or across < levels.DRIFTED * scatter:
        return
    first = next(iter(in_order))
    direction, way = first if len(in_order) == 1 else "both", "rises" if in_order[first] > 0 else "falls"
    T = unit_of("torque")
    message = (
        f"Speed {way} with the order of the runs{in_direction(direction)} while the torque drifts within them ({mean:+.2g}{T} per second, "
        f"{across:.3g}{T} from first to last, {100 * across / level:.0f} % of the torque): drift and speed cannot be told apart. Warm up, "
        "and take the speeds in random order."
    )
    numbers = {"direction": direction, "way": way, "slope": mean, "across": across, "share": across / level}
    yield Finding("drift-in-order", CAUTION, message, numbers, {"torque": across})

"""Limits of a plan: as declared, else as the measured runs went."""

from dataclasses import dataclass, replace

import numpy as np

from bristle.data.experiment.load import Run
from bristle.errors import InputError
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.measured import Measured
from bristle.model.parameters import has_own_unit, unit

HOLD = 3.0
"""Assumed duration of a hold, s, without measured ones; measured ones are clipped to `_HOLDS`, s."""
_HOLDS = (1.0, 10.0)
FREQUENCY = 10.0  # highest of the tracking motion by default, Hz
SAMPLES = 10.0  # least samples of its reference per period
_SLOW_SHARE = 0.02  # of the fastest speed: the slowest one by default
_REACH = 0.5  # time from rest to the fastest speed by default, s
_RARE = 99.0  # percentile that counts as the largest value: beyond are transients and noise

_LEAST_LEFT = 0.1  # of a drive's torque, beside that of the links


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a plan keeps within; m, N in place of rad, N*m for a prismatic joint."""

    position: tuple[float, float]  # rad
    slowest: float  # Slowest constant velocity, rad/s
    velocity: float  # rad/s
    acceleration: float  # rad/s**2
    torque: float  # Of the drive, N*m; inf where unknown
    time: float | None  # s; None: unlimited
    hold: float  # Duration of a hold, s
    frequency: float  # Highest frequency of the tracking motion, Hz
    rate: float  # Samples of the references per second, Hz

    @property
    def travel(self) -> float:
        """From the lowest to the highest position, rad."""
        return self.position[1] - self.position[0]


def limits_of(measured: Measured) -> tuple[Limits, tuple[Finding, ...]]:
    """The limits of an experiment, and a finding on each undeclared one. Raises InputError without a speed or time."""
    experiment, asked, kind = measured.experiment, measured.experiment.plan, measured.experiment.joint.kind
    points = [s for s in measured.points(hold_out=False) if not s.stick_slip]
    speeds, assumed = np.abs([s.velocity for s in points]), list[Finding]()
    velocity, slowest, of = asked.velocity, asked.minimum_velocity, unit("velocity", kind)
    if velocity is None:
        velocity = _rounded(float(speeds.max()) if points else _largest(measured.runs, "velocity"))
        assumed.append(_assumed("velocity", "Fastest speed", velocity, of, "the fastest measured"))
    if slowest is None:
        slowest = _rounded(min(float(speeds.min()), 0.5 * velocity) if points else _SLOW_SHARE * velocity)
        how = "the slowest measured that did not stick and slip"
        if not points:
            how = f"{_SLOW_SHARE:g} of the fastest: no run at constant velocity shows where the drive begins to stick and slip"
        what = "Slowest constant speed"
        assumed.append(_assumed("minimum_velocity", what, slowest, of, how, guessed=not points))
    if not slowest < velocity:
        raise InputError(
            f"{experiment.path.name}: plan: the slowest constant speed, {slowest:g}, is not below the fastest, {velocity:g}; "
            "give plan.minimum_velocity and plan.velocity"
        )
    hold = asked.hold
    if hold is None:  # the median duration of the accepted segments
        steps = {run.record.file: run.record.step for run in measured.runs if run.kind == "ramp"}
        spans = [(s.stop - s.start) * steps[s.file] for s in measured.points(hold_out=False) if s.file in steps]
        hold = _rounded(float(np.clip(np.median(spans), *_HOLDS)) if spans else HOLD)
        how = "the usual hold so far" if points else "a guess"
        assumed.append(_assumed("hold", "Averaged over", hold, "s", how, guessed=not points))
    position, of = asked.position, unit("position", kind)
    if position is None:
        position = measured.positions or (0.0, _rounded(velocity * 1.5 * hold))
        how = "as far as the measured runs went, in their coordinates"
        how = how if measured.positions else "which the fastest hold needs: no run has positions"
        assumed.append(_assumed("position", "Positions", position, of, how, guessed=not measured.positions))
    acceleration = asked.acceleration
    if acceleration is None:
        seen = _largest(measured.runs, "acceleration")
        acceleration, what = _rounded(seen or velocity / _REACH), "Largest acceleration"
        how = "the largest measured" if seen else f"{_REACH:g} s from rest to the fastest speed"
        of = unit("acceleration", kind)
        assumed.append(_assumed("acceleration", what, acceleration, of, how, guessed=not seen))
    torque, of = asked.torque, unit("torque", kind)
    if torque is None:
        torque = _rounded(_largest(measured.runs, "torque"))
        assumed.append(_assumed("torque", "Largest torque", torque, of, "the largest measured"))
    links = 0.0 if has_own_unit(kind) else _largest(measured.runs, "link_torque")
    if torque and links:  # not available for friction and inertia
        message = (
            f"Of the torque limit {links:.3g} {of} are kept for the links, the most that they asked for in these runs; the other "
            "joints are planned to rest."
        )
        assumed.append(Finding("limit-links", NOTE, message, {"links": links, "unit": of}))
        torque = max(torque - links, _LEAST_LEFT * torque)
    if "rate" not in asked.model_fields_set:
        assumed.append(_assumed("rate", "Rate of the references", asked.rate, "Hz", "a default", guessed=True))
    limits = Limits(
        position=position, slowest=slowest, velocity=velocity, acceleration=acceleration, torque=torque or np.inf,
        time=asked.time, hold=hold, frequency=asked.frequency or FREQUENCY, rate=asked.rate,
    )  # fmt: skip  # a list of values
    return limits, tuple(assumed)


def followed(limits: Limits, declared: float | None) -> tuple[Limits, tuple[Finding, ...]]:
    """The limits with a frequency that the references' rate resolves, and a finding unless `declared`, Hz."""
    cap, why = limits.rate / SAMPLES, f"plan.rate, {limits.rate:g} Hz, gives {SAMPLES:g} samples to a period"
    reachable = replace(limits, frequency=min(limits.frequency, cap))
    if declared is None:
        capped = f"at which {why}, " if cap < FREQUENCY else ""
        how, what = f"{capped}which the controller must be able to follow", "Highest frequency of the motion"
        return reachable, (_assumed("frequency", what, reachable.frequency, "Hz", how, guessed=True),)
    if declared <= cap:
        return reachable, ()
    message = f"Highest frequency of the motion: {cap:.3g} Hz, not the declared {declared:g} Hz: at {cap:.3g} Hz {why}."
    numbers = {"frequency": cap, "declared": declared, "why": why}
    return reachable, (Finding("frequency-lowered", CAUTION, message, numbers),)


def _assumed(
    key: str, what: str, value: float | tuple[float, float], of: str, how: str, *, guessed: bool = False
) -> Finding:
    """The finding on a limit that was measured or guessed, with the key of `plan` that sets it."""
    told = f"{value[0]:.3g} to {value[1]:.3g}" if isinstance(value, tuple) else f"{value:.3g}"
    message = f"{what}: {told} {of}, {how}; set plan.{key} to override."
    numbers = {"limit": key, "value": value, "unit": of}
    return (
        Finding("limit-guessed", CAUTION, message, numbers)
        if guessed
        else Finding("limit-measured", NOTE, message, numbers)
    )


def _rounded(seen: float) -> float:
    """To three digits."""
    return float(f"{seen:.3g}")


def _largest(runs: tuple[Run, ...], signal: str) -> float:
    """99th percentile of a signal's magnitude over all runs; 0 where no run has it."""
    signals = [np.abs(values) for run in runs if (values := getattr(run.record, signal)) is not None and values.size]
    return max((float(np.percentile(x, _RARE)) for x in signals), default=0.0)

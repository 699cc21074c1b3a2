"""Limits of a plan: as declared, else as the measured runs went."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from bristle.data.experiment.load import Run
from bristle.errors import InputError
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.measured import Measured
from bristle.model.parameters import has_own_unit, unit

_HOLD, _HOLDS = 3.0, (1.0, 10.0)  # assumed duration of a hold without measured ones, and least and most of these, s
_FREQUENCY = 10.0  # highest of the tracking motion by default, Hz
SAMPLES = 10.0  # least samples of its reference per period
_SLOW_SHARE = 0.02  # of the fastest speed: the slowest one by default
_REACH = 0.5  # time from rest to the fastest speed by default, s
_RARE = 99.0  # percentile that counts as the largest value: beyond are transients and noise
_LEAST_LEFT = 0.1  # of a drive's torque, beside that of the links

T = TypeVar("T", float, tuple[float, float])


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

    def limit(key: str, what: str, seen: T, of: str, how: str, *, guessed: bool) -> T:
        """As declared, else as seen or guessed, which is said."""
        declared: T | None = getattr(asked, key) if key in asked.model_fields_set else None
        if declared is not None:
            return declared
        told = f"{seen[0]:.3g} to {seen[1]:.3g}" if isinstance(seen, tuple) else f"{seen:.3g}"
        message = f"{what}: {told} {of}, {how}; set plan.{key} to override."
        numbers = {"limit": key, "value": seen, "unit": of}
        guess, known = (
            Finding("limit-guessed", CAUTION, message, numbers),
            Finding("limit-measured", NOTE, message, numbers),
        )
        assumed.append(guess if guessed else known)
        return seen

    seen = _rounded(float(speeds.max()) if points else _largest(measured.runs, "velocity"))
    velocity = limit("velocity", "Fastest speed", seen, unit("velocity", kind), "the fastest measured", guessed=False)
    seen = _rounded(min(float(speeds.min()), 0.5 * velocity) if points else _SLOW_SHARE * velocity)
    how = "the slowest measured that did not stick and slip"
    if not points:
        how = f"{_SLOW_SHARE:g} of the fastest: no run at constant velocity shows where the drive begins to stick and slip"
    of = unit("velocity", kind)
    slowest = limit("minimum_velocity", "Slowest constant speed", seen, of, how, guessed=not points)
    if not slowest < velocity:
        raise InputError(
            f"{experiment.path.name}: plan: the slowest constant speed, {slowest:g}, is not below the fastest, {velocity:g}; "
            "give plan.minimum_velocity and plan.velocity"
        )
    # the median duration of the accepted segments
    steps = {run.record.file: run.record.step for run in measured.runs if run.kind == "ramp"}
    spans = [(s.stop - s.start) * steps[s.file] for s in measured.points(hold_out=False) if s.file in steps]
    how = "the usual hold so far" if points else "a guess"
    seen = _rounded(float(np.clip(np.median(spans), *_HOLDS))) if spans else _HOLD
    hold = limit("hold", "Averaged over", seen, "s", how, guessed=not points)
    how = "as far as the measured runs went, in their coordinates"
    how = how if measured.positions else "which the fastest hold needs: no run has positions"
    reach = measured.positions or (0.0, _rounded(velocity * 1.5 * hold))
    position = limit("position", "Positions", reach, unit("position", kind), how, guessed=not measured.positions)
    largest = _largest(measured.runs, "acceleration")
    how = "the largest measured" if largest else f"{_REACH:g} s from rest to the fastest speed"
    seen, of = _rounded(largest or velocity / _REACH), unit("acceleration", kind)
    acceleration = limit("acceleration", "Largest acceleration", seen, of, how, guessed=not largest)
    seen, of = _rounded(_largest(measured.runs, "torque")), unit("torque", kind)
    torque = limit("torque", "Largest torque", seen, of, "the largest measured", guessed=False)
    links = 0.0 if has_own_unit(kind) else _largest(measured.runs, "link_torque")
    if torque and links:  # not available for friction and inertia
        message = (
            f"Of the torque limit {links:.3g} {of} are kept for the links, the most that they asked for in these runs; the other "
            "joints are planned to rest."
        )
        assumed.append(Finding("limit-links", NOTE, message, {"links": links, "unit": of}))
        torque = max(torque - links, _LEAST_LEFT * torque)
    rate = limit("rate", "Rate of the references", asked.rate, "Hz", "a default", guessed=True)
    seen, how = min(_FREQUENCY, rate / SAMPLES), "which the controller must be able to follow"
    frequency = limit("frequency", "Highest frequency of the motion", seen, "Hz", how, guessed=True)
    limits = Limits(
        position=position, slowest=slowest, velocity=velocity, acceleration=acceleration, torque=torque or np.inf,
        time=asked.time, hold=hold, frequency=frequency, rate=rate,
    )  # fmt: skip  # a list of values
    return limits, tuple(assumed)


def _rounded(seen: float) -> float:
    """To three digits."""
    return float(f"{seen:.3g}")


def _largest(runs: tuple[Run, ...], signal: str) -> float:
    """99th percentile of a signal's magnitude over all runs; 0 where no run has it."""
    signals = [np.abs(values) for run in runs if (values := getattr(run.record, signal)) is not None and values.size]
    return max((float(np.percentile(x, _RARE)) for x in signals), default=0.0)

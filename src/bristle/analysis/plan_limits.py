"""Within which limits to plan: as the experiment file declares them, else as far as the measured runs went, which is said."""

from dataclasses import dataclass, replace

import numpy as np

from bristle.data.experiment import Run
from bristle.identification.pipeline import Measured
from bristle.model.arrays import Array
from bristle.model.parameters import unit

HOLD = 3.0
"""Time over which a constant velocity is averaged where no run shows any, s; measured holds count from `_HOLDS[0]` to `_HOLDS[1]` s."""
_HOLDS = (1.0, 10.0)
FREQUENCY = 10.0
"""Highest of the tracking motion where nothing is declared, Hz ..."""
_SLOW_SHARE = 0.02
"""Of the fastest speed: the slowest where no run at constant velocity shows one that does not stick."""
_REACH = 0.5
"""Time from rest to the fastest speed where no moving run shows an acceleration, s."""
_RARE = 99.0
"""Percentile of a measured signal that counts as its largest: beyond are transients and noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a plan keeps within; m, N stand in for rad, N*m where prismatic."""

    position: tuple[float, float]
    """rad."""
    slowest: float
    """Of constant velocities, rad/s."""
    velocity: float
    """rad/s."""
    acceleration: float
    """rad/s**2."""
    torque: float
    """Of the drive, N*m; inf: not known."""
    time: float | None
    """s; None: none."""
    hold: float
    """Time over which a constant velocity is averaged, s."""
    frequency: float
    """Highest of the tracking motion, Hz."""
    rate: float
    """Of the references, Hz."""

    @property
    def travel(self) -> float:
        """From the lowest to the highest position, rad."""
        return self.position[1] - self.position[0]


def limits_of(measured: Measured) -> tuple[Limits, tuple[str, ...]]:
    """The limits of an experiment, and a sentence for each that nobody declared.

    Raises ValueError where declared limits leave no speed to choose, or no time.
    """
    experiment, asked = measured.experiment, measured.experiment.plan
    kind = experiment.joint.kind
    said: list[str] = []

    def taken(declared: float | None, found: float, name: str, what: str, source: str, si: str = "") -> float:
        """The declared value, or what was found, which is then said."""
        if declared is not None:
            return declared
        found = float(f"{found:.3g}")
        said.append(f"{what}: {found:g} {unit(si, kind) if si else 's'}, {source}; give plan.{name}.")
        return found

    points = [s for s in measured.points(hold_out=False) if not s.stick_slip]
    speeds = np.abs([s.velocity for s in points]) if points else np.zeros(0)
    fastest = float(speeds.max()) if speeds.size else _largest(measured.runs, "velocity")
    velocity = taken(asked.velocity, fastest, "velocity", "Fastest speed", "the fastest measured", "velocity")
    slowest = taken(
        asked.minimum_velocity,
        min(float(speeds.min()), 0.5 * velocity) if speeds.size else _SLOW_SHARE * velocity,
        "minimum_velocity",
        "Slowest constant speed",
        "the slowest measured that did not stick and slip"
        if speeds.size
        else f"{_SLOW_SHARE:g} of the fastest: no run at constant velocity shows where the drive begins to stick and slip",
        "velocity",
    )
    hold = taken(asked.hold, _hold(measured), "hold", "Averaged over", "the usual hold so far" if points else "a guess")
    acceleration = _largest(measured.runs, "acceleration")
    limits = Limits(
        position=asked.position or _span(measured, velocity * 1.5 * hold, said),
        slowest=slowest,
        velocity=velocity,
        acceleration=taken(
            asked.acceleration,
            acceleration or velocity / _REACH,
            "acceleration",
            "Largest acceleration",
            "the largest measured" if acceleration else f"{_REACH:g} s from rest to the fastest speed",
            "acceleration",
        ),
        torque=taken(
            asked.torque,
            _largest(measured.runs, "torque"),
            "torque",
            "Largest torque",
            "the largest measured",
            "torque",
        )
        or np.inf,
        time=asked.time,
        hold=hold,
        frequency=asked.frequency or FREQUENCY,
        rate=asked.rate,
    )
    if not limits.slowest < limits.velocity:
        raise ValueError(
            f"{experiment.path.name}: plan: the slowest constant speed, {limits.slowest:g}, is not below the fastest, {limits.velocity:g}; "
            "give plan.minimum_velocity and plan.velocity"
        )
    return limits, tuple(said)


def shortened(limits: Limits, share: float) -> Limits:
    """The same with holds that take this share of their time."""
    return replace(limits, hold=limits.hold * share)


def _largest(runs: tuple[Run, ...], signal: str) -> float:
    """Of a signal's magnitude in all runs, rare peaks apart; 0 where no run has it."""
    found = [np.abs(values) for run in runs if (values := getattr(run.record, signal)) is not None and values.size]
    return max((float(np.percentile(x, _RARE)) for x in found), default=0.0)


def _hold(measured: Measured) -> float:
    """Median duration of the accepted segments, s."""
    steps = {run.record.file: run.record.step for run in measured.runs if run.kind == "ramp"}
    spans = [(s.stop - s.start) * steps[s.file] for s in measured.points(hold_out=False) if s.file in steps]
    return float(np.clip(np.median(spans), *_HOLDS)) if spans else HOLD


def _span(measured: Measured, wanted: float, said: list[str]) -> tuple[float, float]:
    """From the lowest to the highest position of all runs, or as far as the fastest hold asks for where no run has positions."""
    q = unit("position", measured.experiment.joint.kind)
    found: list[Array] = [run.record.position for run in measured.runs if run.record.position is not None]
    if not found:
        said.append(
            f"Positions: 0 to {wanted:.3g} {q}, what the fastest hold asks for: no run has positions; give plan.position."
        )
        return 0.0, float(f"{wanted:.3g}")
    low, high = min(float(x.min()) for x in found), max(float(x.max()) for x in found)
    said.append(
        f"Positions: {low:.3g} to {high:.3g} {q}, as far as the measured runs went, counted as they do; give plan.position."
    )
    return low, high

"""Within which limits to plan: as the experiment file declares them, else as far as the measured runs went, which is said."""

from dataclasses import dataclass, field, replace

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.load import Run
from bristle.errors import InputError
from bristle.findings import Finding
from bristle.identification.measured import Measured
from bristle.identification.messages import Kind
from bristle.model.parameters import Kind as JointKind
from bristle.model.parameters import in_current, unit

HOLD = 3.0
"""Time over which a constant velocity is averaged where no run shows any, s; measured holds count from `_HOLDS[0]` to `_HOLDS[1]` s."""
_HOLDS = (1.0, 10.0)
FREQUENCY = 10.0
"""Highest of the tracking motion where nothing is declared, Hz ..."""
SAMPLES = 10.0
"""... with so many samples of its reference to a period at least."""
_SLOW_SHARE = 0.02
"""Of the fastest speed: the slowest where no run at constant velocity shows one that does not stick."""
_REACH = 0.5
"""Time from rest to the fastest speed where no moving run shows an acceleration, s."""
_RARE = 99.0
"""Percentile of a measured signal that counts as its largest: beyond are transients and noise."""

_LEAST_LEFT = 0.1
"""Of a drive's torque, where the links ask for all of it."""


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


def limits_of(measured: Measured) -> tuple[Limits, tuple[Finding, ...]]:
    """The limits of an experiment, and what is assumed: a diagnostic for each that nobody declared.

    Raises InputError where declared limits leave no speed to choose, or no time.
    """
    experiment, asked = measured.experiment, measured.experiment.plan
    points = [s for s in measured.points(hold_out=False) if not s.stick_slip]
    choice = _Choice(experiment.joint.kind)
    slowest, velocity = _constant_speeds(measured, np.abs([s.velocity for s in points]), choice)
    hold = choice.taken(asked.hold, _hold(measured), Kind.LIMIT_HOLD if points else Kind.LIMIT_HOLD_GUESSED)
    position = asked.position or _span(measured, velocity * 1.5 * hold, choice.assumed)
    acceleration = _largest(measured.runs, "acceleration")
    limits = Limits(
        position=position,
        slowest=slowest,
        velocity=velocity,
        acceleration=choice.taken(
            asked.acceleration,
            acceleration or velocity / _REACH,
            Kind.LIMIT_ACCELERATION if acceleration else Kind.LIMIT_ACCELERATION_GUESSED,
            "acceleration",
            seconds=_REACH,
        ),
        torque=_torque(measured, choice),
        time=asked.time,
        hold=hold,
        frequency=asked.frequency or FREQUENCY,
        rate=asked.rate,
    )
    if "rate" not in asked.model_fields_set:
        choice.assumed.append(Kind.LIMIT_RATE(rate=asked.rate))
    return limits, tuple(choice.assumed)


def _torque(measured: Measured, choice: "_Choice") -> float:
    """What the drive has for friction and inertia, N*m: of a robot's joint less than its limit, by what the links ask for; inf: not known."""
    whole = choice.taken(
        measured.experiment.plan.torque, _largest(measured.runs, "torque"), Kind.LIMIT_TORQUE, "torque"
    )
    links = 0.0 if in_current(choice.joint) else _largest(measured.runs, "link_torque")
    if not whole or not links:
        return whole or np.inf
    choice.assumed.append(Kind.LIMIT_LINKS(links=links, unit=unit("torque", choice.joint)))
    return max(whole - links, _LEAST_LEFT * whole)


@dataclass(frozen=True, slots=True)
class _Choice:
    """Takes what is declared, else what was measured, which it says."""

    joint: JointKind
    assumed: list[Finding] = field(default_factory=list)

    def taken(self, declared: float | None, seen: float, kind: Kind, si: str = "", **numbers: float) -> float:
        """The value declared, or the one seen, to three digits, which `kind` and its other numbers say; `si` is whose unit it has, s if no one's."""
        if declared is not None:
            return declared
        seen = float(f"{seen:.3g}")
        self.assumed.append(kind(value=seen, unit=unit(si, self.joint) if si else "s", **numbers))
        return seen


def _constant_speeds(measured: Measured, speeds: Array, choice: _Choice) -> tuple[float, float]:
    """The slowest and the fastest constant speed, rad/s; `speeds`, (n,), are those measured that did not stick and slip.

    Raises InputError where they leave nothing between them.
    """
    experiment, asked = measured.experiment, measured.experiment.plan
    fastest = float(speeds.max()) if speeds.size else _largest(measured.runs, "velocity")
    velocity = choice.taken(asked.velocity, fastest, Kind.LIMIT_SPEED, "velocity")
    slowest = choice.taken(
        asked.minimum_velocity,
        min(float(speeds.min()), 0.5 * velocity) if speeds.size else _SLOW_SHARE * velocity,
        Kind.LIMIT_SLOWEST if speeds.size else Kind.LIMIT_SLOWEST_GUESSED,
        "velocity",
        share=_SLOW_SHARE,
    )
    if not slowest < velocity:
        raise InputError(
            f"{experiment.path.name}: plan: the slowest constant speed, {slowest:g}, is not below the fastest, {velocity:g}; "
            "give plan.minimum_velocity and plan.velocity"
        )
    return slowest, velocity


def followed(limits: Limits, declared: float | None) -> tuple[Limits, tuple[Finding, ...]]:
    """The limits with the highest frequency that the rate of the references lets a motion have, and a diagnostic where that was not declared, Hz."""
    cap, why = limits.rate / SAMPLES, Kind.CAPPED_BY_RATE(rate=limits.rate, samples=SAMPLES)
    reachable = replace(limits, frequency=min(limits.frequency, cap))
    if declared is None:
        capped = Kind.AT_WHICH(why=why) if cap < FREQUENCY else ""
        return reachable, (Kind.LIMIT_FREQUENCY(frequency=reachable.frequency, capped=capped),)
    if declared <= cap:
        return reachable, ()
    return reachable, (Kind.FREQUENCY_LOWERED(frequency=cap, declared=declared, why=why),)


def shortened(limits: Limits, share: float) -> Limits:
    """The same with holds that take this share of their time."""
    return replace(limits, hold=limits.hold * share)


def _largest(runs: tuple[Run, ...], signal: str) -> float:
    """Of a signal's magnitude in all runs, rare peaks apart; 0 where no run has it."""
    signals = [np.abs(values) for run in runs if (values := getattr(run.record, signal)) is not None and values.size]
    return max((float(np.percentile(x, _RARE)) for x in signals), default=0.0)


def _hold(measured: Measured) -> float:
    """Median duration of the accepted segments, s."""
    steps = {run.record.file: run.record.step for run in measured.runs if run.kind == "ramp"}
    spans = [(s.stop - s.start) * steps[s.file] for s in measured.points(hold_out=False) if s.file in steps]
    return float(np.clip(np.median(spans), *_HOLDS)) if spans else HOLD


def _span(measured: Measured, wanted: float, assumed: list[Finding]) -> tuple[float, float]:
    """From the lowest to the highest position of all runs, or as far as the fastest hold asks for where no run has positions."""
    q, positions = unit("position", measured.experiment.joint.kind), measured.positions
    if positions is None:
        assumed.append(Kind.LIMIT_POSITIONS_GUESSED(high=wanted, unit=q))
        return 0.0, float(f"{wanted:.3g}")
    low, high = positions
    assumed.append(Kind.LIMIT_POSITIONS(low=low, high=high, unit=q))
    return low, high

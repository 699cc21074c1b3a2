"""Within which limits to plan: as the experiment file declares them, else as far as the measured runs went, which is said."""

from dataclasses import dataclass, field, replace

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.load import Run
from bristle.errors import InputError
from bristle.identification.measured import Measured
from bristle.model.parameters import Kind, unit

HOLD = 3.0
"""Time over which a constant velocity is averaged where no run shows any, s; measured holds count from `_HOLDS[0]` to `_HOLDS[1]` s."""
_HOLDS = (1.0, 10.0)
FREQUENCY = 10.0
"""Highest of the tracking motion where nothing is declared, Hz ..."""
SAMPLES = 10.0
"""... with so many samples of its reference, and so many equations, to a period at least; ..."""
EQUATIONS = 5.0
"""... and where it is declared, so many equations: the decimation filter halves what has 2.5."""
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

    Raises InputError where declared limits leave no speed to choose, or no time.
    """
    experiment, asked = measured.experiment, measured.experiment.plan
    points = [s for s in measured.points(hold_out=False) if not s.stick_slip]
    choice = _Choice(experiment.joint.kind)
    slowest, velocity = _constant_speeds(measured, np.abs([s.velocity for s in points]), choice)
    usual = "the usual hold so far" if points else "a guess"
    hold = choice.taken(asked.hold, _hold(measured), "hold", "Averaged over", usual)
    position = asked.position or _span(measured, velocity * 1.5 * hold, choice.sentences)
    acceleration = _largest(measured.runs, "acceleration")
    limits = Limits(
        position=position,
        slowest=slowest,
        velocity=velocity,
        acceleration=choice.taken(
            asked.acceleration,
            acceleration or velocity / _REACH,
            "acceleration",
            "Largest acceleration",
            "the largest measured" if acceleration else f"{_REACH:g} s from rest to the fastest speed",
            "acceleration",
        ),
        torque=choice.taken(
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
    if "rate" not in asked.model_fields_set:
        choice.sentences.append(f"Rate of the references: {asked.rate:g} Hz, a default; set plan.rate to override.")
    return limits, tuple(choice.sentences)


@dataclass(frozen=True, slots=True)
class _Choice:
    """Takes what is declared, else what was measured, which it says."""

    kind: Kind
    sentences: list[str] = field(default_factory=list)

    def taken(self, declared: float | None, seen: float, name: str, what: str, source: str, si: str = "") -> float:
        """The declared value of `plan.name`, or the one seen, to three digits; `si` is whose unit it has, s if no one's."""
        if declared is not None:
            return declared
        seen = float(f"{seen:.3g}")
        self.sentences.append(
            f"{what}: {seen:g} {unit(si, self.kind) if si else 's'}, {source}; set plan.{name} to override."
        )
        return seen


def _constant_speeds(measured: Measured, speeds: Array, choice: _Choice) -> tuple[float, float]:
    """The slowest and the fastest constant speed, rad/s; `speeds`, (n,), are those measured that did not stick and slip.

    Raises InputError where they leave nothing between them.
    """
    experiment, asked = measured.experiment, measured.experiment.plan
    fastest = float(speeds.max()) if speeds.size else _largest(measured.runs, "velocity")
    velocity = choice.taken(asked.velocity, fastest, "velocity", "Fastest speed", "the fastest measured", "velocity")
    slowest = choice.taken(
        asked.minimum_velocity,
        min(float(speeds.min()), 0.5 * velocity) if speeds.size else _SLOW_SHARE * velocity,
        "minimum_velocity",
        "Slowest constant speed",
        "the slowest measured that did not stick and slip"
        if speeds.size
        else f"{_SLOW_SHARE:g} of the fastest: no run at constant velocity shows where the drive begins to stick and slip",
        "velocity",
    )
    if not slowest < velocity:
        raise InputError(
            f"{experiment.path.name}: plan: the slowest constant speed, {slowest:g}, is not below the fastest, {velocity:g}; "
            "give plan.minimum_velocity and plan.velocity"
        )
    return slowest, velocity


def followed(limits: Limits, measured: Measured, step: float | None) -> tuple[Limits, tuple[str, ...]]:
    """The limits with the highest frequency that a motion can have, and a sentence where that is not what was declared.

    Args:
        limits: as declared.
        measured: what they are of.
        step: time between equations of the moving runs so far, s; None: there are none, which caps nothing.
    """
    asked, decimation = measured.experiment.plan, measured.experiment.fit.decimation
    caps = {limits.rate / SAMPLES: f"plan.rate, {limits.rate:g} Hz, gives {SAMPLES:g} samples to a period"}
    if step is not None:
        least = EQUATIONS if asked.frequency else SAMPLES
        why = f"fit.decimation, {decimation}, leaves" if decimation > 1 else "the sampling of the moving runs leaves"
        caps[1 / (least * step)] = f"{why} one equation in {step:.3g} s, {least:g} to a period"
    cap = min(caps)
    reachable = replace(limits, frequency=min(limits.frequency, cap))
    if asked.frequency is None:
        capped = f", at which {caps[cap]}" if cap < FREQUENCY else ""
        return reachable, (
            f"Highest frequency of the motion: {reachable.frequency:.3g} Hz{capped}, "
            "which the controller must be able to follow; set plan.frequency to override.",
        )
    if asked.frequency <= cap:
        return reachable, ()
    return reachable, (
        f"Highest frequency of the motion: {cap:.3g} Hz, not the declared {asked.frequency:g} Hz: at {cap:.3g} Hz {caps[cap]}.",
    )


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


def _span(measured: Measured, wanted: float, sentences: list[str]) -> tuple[float, float]:
    """From the lowest to the highest position of all runs, or as far as the fastest hold asks for where no run has positions."""
    q = unit("position", measured.experiment.joint.kind)
    positions: list[Array] = [run.record.position for run in measured.runs if run.record.position is not None]
    if not positions:
        sentences.append(
            f"Positions: 0 to {wanted:.3g} {q}, which the fastest hold needs: no run has positions; set plan.position to override."
        )
        return 0.0, float(f"{wanted:.3g}")
    low, high = min(float(x.min()) for x in positions), max(float(x.max()) for x in positions)
    sentences.append(
        f"Positions: {low:.3g} to {high:.3g} {q}, as far as the measured runs went, in their coordinates; set plan.position to override."
    )
    return low, high

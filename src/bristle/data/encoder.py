"""The encoder's count, as declared and as the readings show it."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from bristle.arrays import Array
from bristle.data import units
from bristle.data.experiment.signals import Context, Position, Signal
from bristle.data.record import OTHER_FILES, Record
from bristle.estimation import levels
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding
from bristle.model.parameters import unit as unit_of

if TYPE_CHECKING:
    from bristle.data.experiment.load import Experiment

UNITS = {  # in which signals are logged
    "velocity": {"revolute": ("rad/s", "deg/s", "rpm", "rev/s", "mrad/s"), "prismatic": ("m/s", "mm/s", "cm/s")},
    "position": {"revolute": ("rad", "deg", "rev", "mrad"), "prismatic": ("m", "mm", "cm")},
}


def resolution(experiment: "Experiment", records: Sequence[Record]) -> float:
    """One encoder count, rad, as declared or as the positions show it; 0 without a grid."""
    steps = [smallest_step(r.position) for r in records if r.position is not None]
    return experiment.encoder_resolution or max(steps, default=0.0)


def smallest_step(position: Array) -> float:
    """The encoder's count, from the steps between readings, in the unit of position; 0 where they keep to no grid."""
    step, multiples = _grid(readings := np.unique(position))
    return step if multiples.size >= levels.FEW or readings.size <= position.size / 2 else 0.0


def _grid(readings: Array) -> tuple[float, Array]:
    """The step of the grid of readings in rising order, 0 where there is none, and the small multiples of it."""
    if readings.size < 2:
        return 0.0, np.zeros(0)
    steps = np.diff(readings)
    steps = steps[steps > 1e-3 * np.median(steps)]
    near = steps[steps < levels.NEAR_COUNTS * steps.min()]
    step = float(near.sum() / np.round(near / np.median(near[near < 1.5 * near.min()])).sum())
    multiples = np.round(near / step)
    return (step if np.abs(near / step - multiples).max() < levels.ON_GRID else 0.0), multiples


def unit_of_counts(logged: Array) -> tuple[str, int] | None:
    """The unit in which a turn of logged positions, (n,), has a power of two of counts, and how many.

    None where they keep to no grid, there is no such unit, or it is rad.
    """
    step = smallest_step(logged)
    for unit in UNITS["position"]["revolute"] if step else ():
        counts = 2 * np.pi / step / units.factor(unit, "rad")
        if counts > levels.COARSEST and _power_of_two(counts, levels.POWER_OF_TWO):
            return None if unit == "rad" else (unit, round(counts))
    return None


def whole_positions(file: str, logged: Array, signal: Position, context: Context) -> Finding | None:
    """The warning of logged positions, (n,), that are whole numbers of a unit in which no encoder counts."""
    if signal.unit.strip().startswith("count"):
        return None
    seen = logged[np.isfinite(logged)]
    if not (seen == np.round(seen)).all() or np.unique(seen).size < 3:
        return None
    size = abs(signal.factor("position", context) / context.to_joint("position"))
    if size >= levels.LARGEST_COUNT:
        message = (
            f"Every position of {file}{OTHER_FILES} is a whole number of {signal.unit}: encoder counts. Write `unit: counts` "
            "under signals.position, and give encoder_resolution, such as `encoder_resolution: 4096 counts/rev`."
        )
        return Finding("whole-positions", CRITICAL, message, {"files": (file,)})
    declared = context.resolution is not None and apart(size / context.resolution, 1.0) < levels.SAME_FACTOR
    degrees = (
        context.kind_of("position") == "revolute" and apart(size, units.factor("deg", "rad")) < levels.KNOWN_FACTOR
    )
    if declared or not degrees:
        return None
    message = (
        f"Every position of {file}{OTHER_FILES} is a whole number of deg: encoder counts (then write `unit: counts` under "
        "signals.position, and give encoder_resolution), or a sensor with steps of 1 deg, which hides inertia and v_s."
    )
    return Finding("whole-degrees", CAUTION, message, {"files": (file,)})


def count_mismatch(record: Record, signal: Position | None, context: Context) -> Finding | None:
    """The warning of positions whose steps are not those of the declared encoder, or a power of two in another unit."""
    told_before = any(d.code in {"whole-positions", "whole-degrees"} for d in record.warnings)
    if record.position is None or signal is None or signal.unit.strip().startswith("count") or told_before:
        return None
    readings = np.unique(record.position)
    step, multiples = _grid(readings)
    repeats = readings.size <= record.position.size / 2
    if not step or multiples.size < levels.FEW or not (repeats or np.unique(multiples).size > levels.MULTIPLES):
        return None
    step /= abs(context.to_joint("position"))
    if context.resolution is None:
        return _turn_of_another_unit(record.file, step, signal, context)
    ratio = step / context.resolution
    return None if apart(ratio, 1.0) < levels.SAME_FACTOR else _mismatch(record.file, step, ratio, signal, context)


def _mismatch(file: str, step: float, ratio: float, signal: Position, context: Context) -> Finding:
    """The finding of steps that are `ratio` times the declared count: a wrong unit, bits, rounding, or else."""
    now = signal.factor("position", context) / context.to_joint("position")
    others = other_units("position", signal, context)
    line = next(
        (f"`unit: {u}`" for u, by in others if apart(ratio * by, 1.0) < levels.KNOWN_FACTOR < apart(by, 1.0)), None
    )
    numbers: dict[str, Any] = {"files": (file,), "step": step, "ratio": ratio}
    position = f"The position of {file}{OTHER_FILES}"
    times = f"{ratio:.4g} times the declared encoder_resolution"
    seen = f"{step:.4g} {unit_of('position', context.kind_of('position'))}"
    if line is not None:
        message = (
            f"{position} changes in steps of {seen}, {times}: a wrong unit. Write {line} under signals.position; where the "
            f"position is right, write `encoder_resolution: {seen}`."
        )
        return Finding("count-unit", CRITICAL, message, {**numbers, "remedy": line})
    if _power_of_two(ratio, levels.KNOWN_FACTOR):
        message = (
            f"{position} changes in steps of {seen}, {times}, a power of two: quadrature, or a different number of bits. "
            f"Write `encoder_resolution: {seen}`."
        )
        return Finding("count-bits", NOTE, message, numbers)
    x = step / abs(now)
    if any(apart(x, digit * 10.0 ** np.floor(np.log10(1.001 * x))) < levels.ROUND_COUNT for digit in (1, 2, 5)):
        rounded = f"{position} is rounded to steps of {seen}, {times}"
        message = f"{rounded}: log more digits, or write `encoder_resolution: {seen}`."
        return Finding("count-rounded", CAUTION, message, numbers)
    message = (
        f"{position} changes in steps of {seen}, {times}: one of the two is wrong. Where the position is right, write "
        f"`encoder_resolution: {seen}`; else correct the unit or scale of signals.position, the gear included."
    )
    return Finding("count-contradicts", CRITICAL, message, numbers)


def _turn_of_another_unit(file: str, step: float, signal: Position, context: Context) -> Finding | None:
    """The caution that the counts of a turn are a power of two in another unit than the declared one."""
    turn = 2 * np.pi / step
    if context.kind_of("position") != "revolute" or _power_of_two(turn, levels.POWER_OF_TWO):
        return None
    for unit, by in other_units("position", signal, context):
        if (
            turn / by > levels.COARSEST
            and _power_of_two(turn / by, levels.POWER_OF_TWO)
            and apart(by, 1.0) > levels.KNOWN_FACTOR
        ):
            counts, remedy = round(turn / by), f"`unit: {unit}`"
            message = (
                f"A turn of {file}{OTHER_FILES} has {turn:.6g} counts as declared, and {counts} with {remedy} under "
                "signals.position: a power of two, as encoders have. Check the unit."
            )
            numbers = {"files": (file,), "declared": turn, "counts": counts, "remedy": remedy}
            return Finding("counts-of-a-turn", CAUTION, message, numbers)
    return None


def other_units(name: str, signal: Signal, context: Context) -> Iterator[tuple[str, float]]:
    """Units in which a position or a velocity may have been logged, with the factor of each on the declared signal."""
    now = signal.factor(name, context)
    counts = ["counts"] if name == "position" and context.resolution else []
    for unit in (*UNITS[name][context.kind_of(name)], *counts):
        with suppress(ValueError):  # where the scale converts the unit
            yield unit, signal.model_copy(update={"unit": unit}).factor(name, context) / now


def apart(x: float, wanted: float) -> float:
    """Absolute logarithm of the ratio of the sizes of two numbers."""
    return abs(float(np.log(abs(x) / wanted)))


def _power_of_two(x: float, within: float) -> bool:
    return apart(x, 2.0 ** round(np.log2(x))) < within

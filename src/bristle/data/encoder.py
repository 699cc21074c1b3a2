"""The encoder's count, as declared and as the readings show it."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.signals import Context, Position, Signal
from bristle.data.record import OTHER_FILES, Record
from bristle.findings import CAUTION, CRITICAL, Finding
from bristle.model.parameters import unit as unit_of

if TYPE_CHECKING:
    from bristle.data.experiment.load import Experiment

UNITS = {  # in which signals are logged
    "velocity": {"revolute": ("rad/s", "deg/s", "rpm", "rev/s", "mrad/s"), "prismatic": ("m/s", "mm/s", "cm/s")},
    "position": {"revolute": ("rad", "deg", "rev", "mrad"), "prismatic": ("m", "mm", "cm")},
}
# steps of up to 50 counts tell the count (beyond, rounding in the log adds up); fewer than 8 may lie on a grid by chance
_NEAR, _ENOUGH = 50.0, 8
_FACTOR = 0.05  # by which declared and seen counts differ at most: an encoder is known better than that
_NAMED = 0.01  # within which a larger factor is a known one
# counts a turn are a power of two within 5e-5: a random number is, in one of the three other units, once in 2000 times
_POWER, _COARSEST = 5e-5, 256


def resolution(experiment: "Experiment", records: Sequence[Record]) -> float:
    """One encoder count, rad, as declared or as the positions show it; 0 without a grid."""
    steps = [smallest_step(r.position) for r in records if r.position is not None]
    return experiment.encoder_resolution or max(steps, default=0.0)


def smallest_step(position: Array) -> float:
    """The encoder's count, from the steps between readings, in the unit of position; 0 where they keep to no grid."""
    step, multiples = _grid(levels := np.unique(position))
    return step if multiples.size >= _ENOUGH or levels.size <= position.size / 2 else 0.0


def _grid(levels: Array) -> tuple[float, Array]:
    """The step of the grid of readings in rising order, 0 where there is none, and the small multiples of it."""
    if levels.size < 2:
        return 0.0, np.zeros(0)
    steps = np.diff(levels)
    steps = steps[steps > 1e-3 * np.median(steps)]
    near = steps[steps < _NEAR * steps.min()]
    step = float(near.sum() / np.round(near / np.median(near[near < 1.5 * near.min()])).sum())
    multiples = np.round(near / step)
    return (step if np.abs(near / step - multiples).max() < 0.1 else 0.0), multiples


def whole_positions(file: str, logged: Array, signal: Position, context: Context) -> Finding | None:
    """The warning of logged positions, (n,), that are whole numbers of a unit in which no encoder counts."""
    if signal.unit.strip().startswith("count"):
        return None
    seen = logged[np.isfinite(logged)]
    if not (seen == np.round(seen)).all() or np.unique(seen).size < 3:
        return None
    size = abs(signal.factor("position", context) / context.to_joint("position"))
    if size >= 0.5:  # no encoder has a count so large, rad or m
        message = f"Every position of {file}{OTHER_FILES} is a whole number of {signal.unit}: encoder counts. Write `unit: counts`."
        return Finding("whole-positions", CRITICAL, message, {"files": (file,)})
    return None


def count_mismatch(record: Record, signal: Position | None, context: Context) -> Finding | None:
    """The warning of positions whose steps are not those of the declared encoder, or a power of two in another unit."""
    told_before = any(d.code == "whole-positions" for d in record.warnings)
    if record.position is None or signal is None or signal.unit.strip().startswith("count") or told_before:
        return None
    levels = np.unique(record.position)
    step, multiples = _grid(levels)
    repeats = levels.size <= record.position.size / 2
    # 3 multiples of a count among the steps, beyond which a grid is no constant speed, where readings hardly repeat
    if not step or multiples.size < _ENOUGH or not (repeats or np.unique(multiples).size > 3):
        return None
    step /= abs(context.to_joint("position"))
    if context.resolution is None:
        return _turn_of_another_unit(record.file, step, signal, context)
    ratio = step / context.resolution
    return None if apart(ratio, 1.0) < _FACTOR else _mismatch(record.file, step, ratio, signal, context)


def _mismatch(file: str, step: float, ratio: float, signal: Position, context: Context) -> Finding:
    """The finding of steps that are `ratio` times the declared count: a wrong unit, bits, rounding, or else."""
    now = signal.factor("position", context) / context.to_joint("position")
    others = other_units("position", signal, context)
    line = next((f"`unit: {u}`" for u, by in others if apart(ratio * by, 1.0) < _NAMED < apart(by, 1.0)), None)
    numbers: dict[str, Any] = {"files": (file,), "step": step, "ratio": ratio}
    position = f"The position of {file}{OTHER_FILES}"
    times = f"{ratio:.4g} times the declared encoder_resolution"
    seen = f"{step:.4g} {unit_of('position', context.kind_of('position'))}"
    if line is not None:
        message = f"{position} changes in steps of {seen}, {times}. Write {line}, or `encoder_resolution: {seen}`."
        return Finding("count-unit", CRITICAL, message, {**numbers, "remedy": line})
    x = step / abs(now)
    few_digits = any(apart(x, digit * 10.0 ** np.floor(np.log10(1.001 * x))) < 1e-3 for digit in (1, 2, 5))
    if few_digits or _power_of_two(ratio, _NAMED):
        why = "it is rounded in the log: log more digits" if few_digits else "quadrature, or another number of bits"
        message = f"{position} changes in steps of {seen}, {times}: {why}, or write `encoder_resolution: {seen}`."
        return Finding("count-rounded", CAUTION, message, numbers)
    message = f"{position} changes in steps of {seen}, {times}. Correct its unit or scale, or the encoder_resolution."
    return Finding("count-contradicts", CRITICAL, message, numbers)


def _turn_of_another_unit(file: str, step: float, signal: Position, context: Context) -> Finding | None:
    """The caution that the counts of a turn are a power of two in another unit than the declared one."""
    turn = 2 * np.pi / step
    if context.kind_of("position") != "revolute" or _power_of_two(turn, _POWER):
        return None
    for unit, by in other_units("position", signal, context):
        if turn / by > _COARSEST and _power_of_two(turn / by, _POWER) and apart(by, 1.0) > _NAMED:
            counts, remedy = round(turn / by), f"`unit: {unit}`"
            message = f"A turn of {file}{OTHER_FILES} has {turn:.6g} counts, {counts} with {remedy}: check the unit."
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

"""What a run says about its units: where a file states another than was declared, and what a gear did to which signal."""

from collections.abc import Mapping
from contextlib import suppress

from bristle.data import units
from bristle.data.experiment.gear import SIDED
from bristle.data.experiment.signals import DRIVE, Context, Signal, Signals
from bristle.data.record import OTHER_FILES
from bristle.data.timestamps import ISO
from bristle.errors import InputError
from bristle.findings import CAUTION, NOTE, Finding


def check_units(file: str, stated: Mapping[str, str], signals: Signals) -> tuple[Finding, ...]:
    """Signals whose unit is another than the one that the file states of their column, `stated` by signal.

    A signal with a scale other than 1 or -1 was thought about, and nothing is said of it.
    """
    found = []
    for name, unit in stated.items():
        signal = getattr(signals, name)
        plain = not isinstance(signal, Signal) or abs(units.scale_parts(signal.scale)[0]) == 1
        declared = signal.unit
        if unit and declared and plain and declared != ISO and not _alike(unit, declared):
            remedy = f"`unit: {unit}` under signals.{name}"
            message = (
                f"Unit of {name}: the header of {file}{OTHER_FILES} states {unit}, and {declared} is declared. Write {remedy}; where the header "
                "is wrong, correct it, or leave the unit out of it."
            )
            numbers = {"files": (file,), "signal": name, "stated": unit, "declared": declared, "remedy": remedy}
            found.append(Finding("unit-differs", CAUTION, message, numbers))
    return tuple(found)


def _alike(unit: str, other: str) -> bool:
    if other.strip().startswith("count"):
        return True
    with suppress(InputError):
        return abs(units.factor(unit, other) - 1) < 1e-6  # units differ by more
    return False


def gear_note(signals: Signals, context: Context) -> tuple[Finding, ...]:
    """What a gear did to which signals of a run; nothing without one."""
    if context.gear is None:
        return ()
    logged = [name for name in (*SIDED, *DRIVE) if getattr(signals, name) is not None]
    moved = dict.fromkeys(name for name in logged if context.gear.at_motor(name))
    ratio, unit = context.gear.ratio, "" if context.kind == "revolute" else " rad/m"
    signals_moved = ", ".join(moved) or "no signal"
    message = f"Gear of ratio {ratio:g}{unit}: logged at the motor, and brought to the joint: {signals_moved}."
    return (Finding("gear-taken", NOTE, message, {"ratio": ratio}),)

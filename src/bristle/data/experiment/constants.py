"""The constants between what a run logged and its torque, and what an error of each does to that torque."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data import units
from bristle.data.experiment.schema import MotorConstants, PlusMinus
from bristle.data.experiment.signals import Context, Signals, motor_si
from bristle.data.record import Record
from bristle.findings import NOTE, Finding
from bristle.model.functions import drive_torque_slopes_function
from bristle.model.vectorize import evaluate

TORQUE_CONSTANT, RESISTANCE = "torque_constant", "resistance"
_OF_DRIVE = {"torque": (), "current": (TORQUE_CONSTANT,), "voltage": (TORQUE_CONSTANT, RESISTANCE)}
"""What of the motor stands between a logged signal and the torque."""


class Constant(NamedTuple):
    """A constant that a torque was computed with; it prints by name and value, by which it is told from others."""

    name: str
    """`torque_constant`, `resistance`, or the scale of a signal."""
    value: float
    error: float | None
    """Standard error, in `unit`; None where none was declared: it is taken as exact."""
    unit: str

    def __str__(self) -> str:
        error = "" if self.error is None else f" +/- {self.error:g}"
        return f"{self.name} {self.value:g}{error} {self.unit}".removesuffix(" 1")


def torque_constants(signals: Signals, motor: MotorConstants | None, context: Context) -> Iterator[Constant]:
    """The constants that the torque of a run with these signals is computed with; a mere change of sign is none."""
    drive = signals.drive()
    signal = getattr(signals, drive) if drive else None
    if drive is None or signal is None:
        return
    for name in _OF_DRIVE[drive]:
        known: PlusMinus | None = getattr(motor, name, None)
        if known is not None:
            unit = motor_si({TORQUE_CONSTANT: "k_t", RESISTANCE: "R"}[name], context)
            yield Constant(name, known.value, known.standard_error, unit)
    number, unit, relative = units.scale_parts(signal.scale)
    if relative is not None or abs(number) != 1 or unit != "1":
        yield Constant(f"scale of {drive}", number, None if relative is None else abs(number) * relative, unit)


def torque_scale(constants: Sequence[Constant], *, simulated: bool) -> Finding | None:
    """Which constants have an error, and which are taken as exact.

    None where no torque was computed with any, and where data were simulated with exact ones.
    """
    uncertain = tuple(c for c in constants if c.error is not None)
    exact = () if simulated else tuple(c for c in constants if c.error is None)
    if uncertain:
        rest = f"; assuming {_listed(exact)} exact" if exact else ""
        message = (
            f"Torque: every interval contains the error of {_listed(uncertain)}, which moves the parameters together; "
            f"its part is shown as systematic{rest}."
        )
        return Finding("torque-uncertain", NOTE, message, {"constants": uncertain, "rest": rest})
    if not exact:
        return None
    first = exact[0]
    line = f"{first.name.split()[0]}: {first.value:g} +/- {abs(first.value) / 50:.2g} {first.unit}".removesuffix(" 1")
    message = (
        f"Torque: assuming {_listed(exact)} exact: no interval contains that error, which is often the largest; "
        f"give it, as in {line} for 2 %."
    )
    return Finding("torque-exact", NOTE, message, {"constants": exact})


def _listed(constants: Sequence[Constant]) -> str:
    return " and ".join(map(str, constants))


def torque_shifts(record: Record, signals: Signals, motor: MotorConstants | None, context: Context) -> dict[str, Array]:
    """Change of a run's torque per standard error of each constant that has one, by how the constant prints, N*m, (n,).

    Torque from a current, or measured itself, goes with its constants by one factor; from a voltage it is (7)-(8).
    """
    shifts: dict[str, Array] = {}
    for constant in torque_constants(signals, motor, context):
        if constant.error is not None and record.torque is not None:
            by = record.torque / constant.value
            m = None if motor is None else motor.at_joint()
            if record.voltage is not None and record.velocity is not None and m is not None:
                by = np.zeros(record.voltage.size)
                if m.torque_constant is not None and m.resistance is not None:
                    k_t, R = m.torque_constant.value, m.resistance.value
                    slopes = evaluate(drive_torque_slopes_function(), record.voltage, record.velocity, k_t, R)
                    by_V, by_k_t, by_R = slopes
                    by = by_R if constant.name == RESISTANCE else by_V * record.voltage / constant.value
                    if constant.name == TORQUE_CONSTANT:  # as declared: the motor's own where there is a gear
                        by = by_k_t * (k_t / constant.value)
            shifts[str(constant)] = by * constant.error
    return shifts

"""Constants between the logged signals and the torque, and the effect of their errors on the torque."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data import units
from bristle.data.differentiation import without_ends
from bristle.data.experiment.schema import Coasting, MotorConstants, PlusMinus
from bristle.data.experiment.signals import Context, Signals, motor_si, si
from bristle.data.record import OTHER_FILES, Record
from bristle.errors import InputError
from bristle.findings import CAUTION, NOTE, Finding
from bristle.model.functions import drive_torque_slopes_function
from bristle.model.parameters import slides
from bristle.model.vectorize import evaluate

TORQUE_CONSTANT, RESISTANCE = "torque_constant", "resistance"
_OF_DRIVE = {
    "torque": (), "current": (TORQUE_CONSTANT,), "voltage": (TORQUE_CONSTANT, RESISTANCE), "command": ("kp", "kd")
}  # fmt: skip  # a table
_SYMBOLS = {TORQUE_CONSTANT: "k_t", RESISTANCE: "R", "kp": "K_p", "kd": "K_d"}  # of the motor


class Constant(NamedTuple):
    """A constant that a torque was computed with; printed by name and value."""

    name: str  # `torque_constant`, `resistance`, or the scale of a signal
    value: float
    error: float | None  # standard error, in `unit`; None where none was declared: it is taken as exact
    unit: str

    def __str__(self) -> str:
        error = "" if self.error is None else f" +/- {self.error:g}"
        return f"{self.name} {self.value:g}{error} {self.unit}".removesuffix(" 1")


def torque_constants(
    signals: Signals, motor: MotorConstants | None, context: Context, coasting: Coasting | None = None
) -> Iterator[Constant]:
    """The constants that the torque of a run is computed with; a mere change of sign is none."""
    drive = signals.drive()
    if coasting is not None and coasting.known is not None:
        made, size = coasting.made_of, coasting.known
        unit = si("torque" if made == "gravity" else made, context)
        yield Constant(f"coasting {made}", size.value, size.standard_error, unit)
    if drive is None:
        return
    known: dict[str, PlusMinus | None] = {name: getattr(motor, name, None) for name in _OF_DRIVE[drive]}
    if known.get("kp") is not None:
        known.pop("kd")  # both err together
    for name, of in known.items():
        if of is not None:
            yield Constant(name, of.value, of.standard_error, motor_si(_SYMBOLS[name], context))
    signal = None if drive == "command" else getattr(signals, drive)
    if signal is None:
        return
    number, unit, relative = units.scale_parts(signal.scale)
    if relative is not None or abs(number) != 1 or unit != "1":
        yield Constant(f"scale of {drive}", number, None if relative is None else abs(number) * relative, unit)


ONE = MotorConstants(kp=PlusMinus(value=1.0))  # of an unknown drive: its torque is in rad of position error


def commanded_torque(
    rows: Mapping[str, Array], motor: MotorConstants, starts: Sequence[int], period: float | None, *, held: bool
) -> Array:
    """The torque that a drive makes of its commands, K_p (q_d - q) + K_d (dq_d - dq), within its limit, N*m, (n,).

    Held commands are half a sample old in the mean, which the measurements of a drive that is faster than the log are
    not. `rows` are the signals in SI, (n,) each, `starts` the first row of each part between gaps; the position wraps
    at `period`, rad; None: nowhere.
    """

    def less(name: str, measured: Array, period: float | None = None) -> Array:
        """A command less the measurement; if held, the mean with the command of the sample before."""
        told, before = rows.get(name, np.zeros(measured.size)), np.zeros(measured.size)
        before[1:] = told[:-1]
        before[list(starts)] = told[list(starts)]
        errors = [x - measured for x in ([told, before] if held else [told])]
        wrapped = [e if period is None else e - period * np.round(e / period) for e in errors]
        mean: Array = sum(wrapped, np.zeros(measured.size)) / len(wrapped)
        return mean

    at_joint, v, torque = motor.at_joint(), rows.get("velocity"), np.zeros(rows["time"].size)
    K_p, K_d = (0.0 if gain is None else gain.value for gain in (at_joint.kp, at_joint.kd))
    if "command" in rows:
        torque += K_p * less("command", rows["position"], period)
    if v is None and K_d:  # such a drive takes it from its encoder
        parts = [np.split(rows[name], starts[1:]) for name in ("position", "time")]
        slopes = [np.gradient(q, t) if t.size > 1 else np.zeros(t.size) for q, t in zip(*parts, strict=True)]
        v = np.concatenate(slopes)
    if v is not None:
        torque += K_d * less("velocity_command", v)
    most = at_joint.torque_limit
    return torque if most is None else np.clip(torque, -most, most)


def followed_at_once(file: str, rows: Mapping[str, Array], motor: MotorConstants, context: Context) -> Finding:
    """The caution that commands are taken as not held between samples, with the effect if they were."""
    gain, step = motor.at_joint().kp, float(np.median(np.diff(rows["time"])))
    lower, of = step / 2 * (gain.value if gain else 0.0), "s" if motor is ONE else si("alpha_2", context)
    message = (
        f"Commands of {file}{OTHER_FILES} are taken as followed at once. If a faster drive holds each until the next, alpha_2 "
        f"is about {lower:.2g} {of} lower: write `held: true` (or `false`) under signals.command."
    )
    return Finding("commands-at-once", CAUTION, message, {"files": (file,), "lower": lower})


def coasted(record: Record, coasting: Coasting, context: Context) -> Record:
    """The record of a coasting joint with the torque of its known part: gravity, or less inertia times acceleration.

    The position counts from where the joint hangs, by `hangs_at`. Raises InputError where gravity is known, and a run
    has no position or the joint slides.
    """
    size = 1.0 if coasting.known is None else coasting.known.value
    if coasting.made_of == "inertia":
        inner = without_ends(record)
        return replace(inner, torque=-size * np.asarray(inner.acceleration), made_of="inertia")
    hangs = hangs_at(record, context, -np.asarray(record.acceleration))
    q = np.asarray(record.position) - hangs
    message = f"Position counted from where the joint hangs, which is at {hangs:.5g} rad."
    note = Finding("hangs-at", NOTE, message, {"position": hangs})
    torque = -size * np.sin(q)
    return replace(record, position=q, torque=torque, made_of="gravity", notes=(*record.notes, note))


def hangs_at(record: Record, context: Context, effort: Array, *beside: Array) -> float:
    """Where a joint hangs, rad: zero of the sine in a regression of an effort on sin(q), cos(q), sgn(v), v and others.

    Raises InputError where the run has no position, or the joint slides.
    """
    if record.position is None or slides(context.kind):
        raise InputError(f"{record.file}: a known gravity needs the position of a joint that turns")
    v = np.asarray(record.velocity)
    columns = np.stack([np.sin(record.position), np.cos(record.position), np.sign(v), v, *beside], axis=1)
    by_sin, by_cos, *_ = np.linalg.lstsq(columns, effort, rcond=None)[0]
    return float(np.arctan2(-by_cos, by_sin))


def torque_scale(constants: Sequence[Constant], *, simulated: bool) -> Finding | None:
    """The note on which constants have an error, and which are taken as exact.

    None where no torque was computed with any, and where data were simulated with exact ones.
    """
    uncertain = tuple(c for c in constants if c.error is not None)
    exact = () if simulated else tuple(c for c in constants if c.error is None)
    known, assumed = (" and ".join(map(str, x)) for x in (uncertain, exact))
    if uncertain:
        rest = f"; assuming {assumed} exact" if exact else ""
        message = f"Torque: every interval contains the error of {known}, shown as systematic{rest}."
        return Finding("torque-uncertain", NOTE, message, {"constants": uncertain, "rest": rest, "exact": assumed})
    if not exact:
        return None
    first = exact[0]
    key, _, part = first.name.partition(" ")
    value = f"{first.value:g} +/- {abs(first.value) / 50:.2g} {first.unit}".removesuffix(" 1")
    line = f"{key}: {{{part}: {value}}}" if key == "coasting" else f"{key}: {value}"
    message = f"Torque: assuming {assumed} exact: no interval contains that error; give it, as in {line} for 2 %."
    return Finding("torque-exact", NOTE, message, {"constants": exact, "exact": assumed})


def torque_shifts(
    record: Record, signals: Signals, motor: MotorConstants | None, context: Context, coasting: Coasting | None
) -> dict[str, Array]:
    """Change of a run's torque per standard error of each constant that has one, by the constant's text, N*m, (n,).

    Torque from a current, or measured itself, is proportional to its constants; from a voltage it is (7)-(8).
    """
    shifts: dict[str, Array] = {}
    for constant in torque_constants(signals, motor, context, coasting):
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

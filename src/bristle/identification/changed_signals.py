"""What a joint measured, with other signals of its moving runs: what the decisions about what was logged try."""

from collections.abc import Container
from dataclasses import replace

import numpy as np

from bristle.arrays import Array
from bristle.data.bandwidth import of_motion
from bristle.data.differentiation import derivative, smoothed, usable
from bristle.data.experiment.constants import ONE
from bristle.data.record import Record
from bristle.data.sampling import with_motion
from bristle.identification.measured import Measured, changed, decimable, refiltered, with_options


def with_slopes(measured: Measured, files: Container[str]) -> Measured:
    """The same with velocities of some moving runs that are slopes of their positions, where both were logged."""

    def slope(record: Record) -> Record:
        """A run of those files that has both."""
        both = record.position is not None and not record.velocity_estimated and not record.integrated
        return refiltered(record, of_motion, logged=False) if both and record.file in files else record

    return replace(measured, runs=changed(measured.runs, slope))


def with_wider_low_pass(measured: Measured, factor: float) -> Measured:
    """The same with the low pass of moving runs wider by a factor, at the same decimation."""
    return replace(measured, runs=changed(measured.runs, lambda r: refiltered(r, usable(r, factor * r.cutoff))))


def with_decimation(measured: Measured, every: int) -> Measured | None:
    """The same with so many samples an equation, without stretches that are too short for that; None where all of a run's are."""
    if any(decimable(r, every) is None for r in (run.record for run in measured.runs if run.kind == "tracking")):
        return None
    runs = changed(measured.runs, lambda r: decimable(r, every) or r)
    return with_options(replace(measured, runs=runs), decimation=every)


def without_twist(measured: Measured, compliance: float, inertia: float, before: float) -> Measured:
    """The same with the position where moving runs rub, of an inertia with a share before what twists, all SI.

    It is behind by `compliance` times the torque less that share's; the acceleration is the mean of both inertias.
    """

    def rubs(record: Record) -> Record:
        """A run with position, torque and motion; its motion is estimated again."""
        whole = record.fine or record
        if whole.position is None or whole.torque is None or whole.acceleration is None:
            return record
        behind = compliance * smoothed(whole, whole.torque - before * inertia * whole.acceleration, record.cutoff)
        there = replace(whole, position=whole.position - behind, notes=record.notes)
        if whole.velocity is not None and not whole.velocity_estimated:
            there = replace(there, velocity=whole.velocity - derivative(whole, behind))
        moved = refiltered(there, record.cutoff)
        both = np.asarray(moved.acceleration) + before * derivative(whole, behind, 2)
        return with_motion(record, replace(moved, acceleration=both))

    return replace(measured, runs=changed(measured.runs, rubs))


def without_lag(measured: Measured, lag: float) -> Measured:
    """The same with a logged velocity that follows the true one with a time constant, s, as of an observer."""

    def true(record: Record) -> Record:
        """A run with velocity and acceleration; the latter is estimated again."""
        whole = record.fine or record
        if whole.velocity is None or whole.acceleration is None:
            return record
        place = None if whole.position is None else whole.position + lag * whole.velocity
        there = replace(whole, position=place, velocity=whole.velocity + lag * whole.acceleration)
        return refiltered(there if record.fine is None else replace(record, fine=there), record.cutoff)

    return replace(measured, runs=changed(measured.runs, true))


def without_delay(measured: Measured, late: float, error: float = 0.0, *, final: bool = False) -> Measured:
    """The same with torques `late` s earlier, and their error; `final` keeps measurements that a drive uses fresh."""
    command, motor = measured.experiment.signals.command, measured.experiment.motor_constants or ONE
    gains = {}
    if final and command is not None and command.fresh:
        gains = {"position": motor.at_joint().kp, "velocity": motor.at_joint().kd}

    def earlier(record: Record) -> Record:
        """A run with its torque, and what goes with it, so much earlier."""

        def moved(x: Array, by: float = late) -> Array:
            """A signal `by` s earlier."""
            return np.interp(record.time + by, record.time, x)

        def torque(by: float) -> Array:
            """The torque `by` s earlier; what the drive makes of fresh measurements stays."""
            made = moved(np.asarray(record.torque), by)
            for name, gain in gains.items():
                was = np.asarray(getattr(record, name))
                made = made + (gain.value if gain else 0.0) * (moved(was, by) - was)
            return made

        if record.torque is None:
            return record
        shifts = {name: moved(x) for name, x in record.torque_shifts.items()}
        if error:
            shifts[f"the delay, {late:.3g} +/- {error:.2g} s"] = (torque(late + error) - torque(late - error)) / 2
        voltage = None if record.voltage is None else moved(record.voltage)
        unknown = None if record.unknown is None else moved(record.unknown.astype(float)) > 0
        return replace(record, torque=torque(late), voltage=voltage, torque_shifts=shifts, unknown=unknown)

    return replace(measured, runs=changed(measured.runs, earlier))

"""The compensated joint in closed loop: plant, sampled controller with compensator, drive and encoder, batched over cases; and what a run measured.

One control period: the encoder reads, PID and compensator ask for a torque, the drive gives it (or the voltage that the motor model makes of it), and
the plant goes on by exact steps of its frozen linear system. Numbers are inputs of one compiled function, so that cases with other parameters, gains
and encoders share it.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from math import inf

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.control import compensator as compensating
from bristle.control.period import at_rest, numbers_of, stiff_tick, tick
from bristle.control.plant import THREADS
from bristle.control.stability import refuse_long_period
from bristle.control.wiring import Case, Course, Wiring
from bristle.errors import InputError
from bristle.model.vectorize import bound, chained

_CHUNK = 1000
"""Samples of every case in one CasADi call: what bounds the memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """What happened, at every control period; arrays of shape (cases, n)."""

    time: Array
    """s, (n,)."""
    reference: Array
    """rad, (n,) or (cases, n)."""
    position: Array
    """True, rad."""
    velocity: Array
    """True, rad/s."""
    torque: Array
    """Asked of the drive, N*m."""
    voltage: Array
    """V; nan where the drive takes a torque."""
    friction: Array
    """True, N*m."""
    compensation: Array
    """Torque of the compensator, N*m."""
    predicted: Array | float = float("nan")
    """Friction as the compensator predicts it, all of it, N*m; nan where its share is zero."""
    theta: Array
    """Gains of each adapted parameter, (cases, parameters, n)."""

    @property
    def error(self) -> Array:
        """Position error, measured from the reference: y_ref - y, rad."""
        return self.reference - self.position

    def rms_error(self, since: float = 0.0) -> Array:
        """Root mean square of the position error from a time on, rad, (cases,)."""
        return self._rms(self.error, since)

    def peak_error(self, since: float = 0.0) -> Array:
        """Largest position error from a time on, rad, (cases,)."""
        peak: Array = np.abs(self.error[:, self.time >= since]).max(axis=1)
        return peak

    def rms_torque(self, since: float = 0.0) -> Array:
        """Root mean square of the torque asked for, N*m, (cases,)."""
        return self._rms(self.torque, since)

    def chatter(self, since: float = 0.0) -> Array:
        """Total variation of the torque asked for, per second, N*m/s, (cases,)."""
        kept = self.time >= since
        varied: Array = np.abs(np.diff(self.torque[:, kept], axis=1)).sum(axis=1)
        return varied / float(np.ptp(self.time[kept]))

    def energy(self, since: float = 0.0) -> Array:
        """Work that the drive did at the joint, its torque held over each period, J, (cases,)."""
        kept = self.time >= since
        return np.asarray(np.sum(self.torque[:, kept][:, :-1] * np.diff(self.position[:, kept], axis=1), axis=1))

    def _rms(self, values: Array, since: float) -> Array:
        with np.errstate(over="ignore", invalid="ignore"):  # of a loop that diverges
            return np.asarray(np.sqrt(np.mean(values[:, self.time >= since] ** 2, axis=1)))


def simulate(
    wiring: Wiring, cases: Sequence[Case], course: Course, period: float, *, stiff: bool = False
) -> Trajectory:
    """Runs every case from rest at its first reference position.

    Args:
        wiring: shared by all.
        cases: one or more.
        course: what is given at every control period.
        period: s.
        stiff: whether CVODES solves the plant between samples: the reference to compare with, some hundred times slower.

    Raises InputError where the period is not positive or longer than the loop bears, something is not finite, the motor lacks the inductance that the
    wiring has, or nothing is to be run.
    """
    n = course.position.shape[-1]
    if not cases or n < 2 or not 0 < period < inf:
        raise InputError(
            f"got {len(cases)} cases, {n} samples and a period of {period:g} s; expected at least one, two, and a positive period"
        )
    given = np.stack([np.broadcast_to(np.asarray(x, dtype=float), (len(cases), n)) for x in course], axis=-1)
    numbers = np.array([numbers_of(case, period) for case in cases])
    if not (np.isfinite(given).all() and np.isfinite(numbers).all()):
        raise InputError(
            "the reference, load, drift or noise of a run, or its case, holds a value that is not finite; expected numbers throughout"
        )
    lacking = [k for k, case in enumerate(cases) if wiring.inductance and not case.motor.L > 0]
    if lacking:
        raise InputError(
            f"wiring: inductance: got L = {cases[lacking[0]].motor.L:g} H for case {lacking[0]}; expected a positive number, or no inductance"
        )
    refuse_long_period(wiring, cases, period)
    parts = np.array_split(np.arange(len(cases)), 1 if stiff else min(THREADS, len(cases)))
    lengths = {min(_CHUNK, n - first) for first in range(0, n, _CHUNK)}
    for samples, own in product(lengths, parts):  # built here: CasADi makes functions in one thread alone
        _run(wiring, samples, len(own), stiff=stiff)
    with ThreadPoolExecutor(len(parts)) as pool:  # CasADi leaves Python to the others while it runs
        ran = pool.map(lambda own: _logged(wiring, given[own], numbers[own], stiff=stiff), parts)
        logs = np.concatenate(list(ran), axis=1)
    y, v, T, V, friction, own = logs[:6]
    share, forward = wiring.compensator.share, wiring.compensator.inertia * course.acceleration
    return Trajectory(
        time=np.asarray(period * np.arange(n)), reference=course.position, position=y, velocity=v, torque=T,
        voltage=V if wiring.drive == "voltage" else np.full_like(V, np.nan), friction=friction, compensation=own,
        predicted=(own - forward) / share if share else np.full_like(own, np.nan),
        theta=np.moveaxis(logs[6:], 0, 1),
    )  # fmt: skip  # a list of values


def _logged(wiring: Wiring, given: Array, numbers: Array, *, stiff: bool) -> Array:
    """What each case logs, (rows, cases, n)."""
    cases, n, _ = given.shape
    memory = np.array([at_rest(wiring, float(y)) for y in given[:, 0, 0]])
    logs = np.empty((6 + compensating.adapted_count(wiring.compensator), cases, n))
    for first in range(0, n, _CHUNK):
        last = min(first + _CHUNK, n)
        before, memory = memory, np.empty_like(memory)
        log = np.empty((cases, last - first, len(logs)))
        inputs = np.ascontiguousarray(given[:, first:last])
        bound(_run(wiring, last - first, cases, stiff=stiff), (before, inputs, numbers), (memory, log))()
        logs[:, :, first:last] = np.moveaxis(log, -1, 0)
    return logs


@lru_cache(maxsize=32)
def _run(wiring: Wiring, samples: int, cases: int, *, stiff: bool) -> ca.Function:
    run = chained(stiff_tick(wiring) if stiff else tick(wiring), samples)
    return run if cases == 1 else run.map(cases)

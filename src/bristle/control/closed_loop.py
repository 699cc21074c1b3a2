"""Batched simulation of the compensated joint in closed loop: plant, sampled controller, drive and encoder."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise
from math import inf

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.control.compensator import Reference
from bristle.control.control_period import (
    Case,
    Disturbance,
    Given,
    LoopOptions,
    Numbers,
    at_rest,
    blank_log,
    control_period,
    flat,
    numbers_of,
    shaped,
    with_law_of,
)
from bristle.errors import InputError
from bristle.model.vectorize import bound, chained
from bristle.workers import threads

_CHUNK = 1000  # samples per CasADi call, which bounds memory
Run = Callable[[int, int], ca.Function]  # (samples, cases) -> their control periods as one function


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """Signals at every control period, (cases, n)."""

    time: Array  # s, (n,)
    reference: Array  # rad, (n,) or (cases, n)
    position: Array  # True, rad
    velocity: Array  # True, rad/s
    torque: Array  # Command to the drive, N*m
    voltage: Array  # V; nan where the drive takes a torque
    friction: Array  # True, N*m
    compensation: Array  # Of the compensator, N*m
    measured: Array | float = float("nan")  # Position as measured, rad; nan where nothing is sampled
    theta: Array  # Gains, (cases, parameters, n)

    @property
    def error(self) -> Array:
        """Position error, y_ref - y, rad."""
        return self.reference - self.position

    def rms_error(self, since: float = 0.0) -> Array:
        """Rms position error from a time on, rad, (cases,)."""
        with np.errstate(over="ignore", invalid="ignore"):  # of a loop that diverges
            return np.asarray(np.sqrt(np.mean(self.error[:, self.time >= since] ** 2, axis=1)))


def simulate(
    options: LoopOptions,
    cases: Sequence[Case],
    reference: Reference,
    period: float,
    disturbance: Disturbance | None = None,
    *,
    alike: bool = False,
) -> Trajectory:
    """Run every case from rest at its first reference position, under common options.

    `alike`: all cases equal the first, whose numbers become constants; the embedded logs rest on its rounding. A loop
    that diverges ends in numbers that are not finite. Raises InputError where an input is not possible.
    """
    n = reference.position.shape[-1]
    if not cases or n < 2 or not 0 < period < inf:
        raise InputError(
            f"got {len(cases)} cases, {n} samples and a period of {period:g} s; expected at least one, two, and a positive period"
        )
    signals = [np.asarray(x, dtype=float) for x in flat(Given(reference, disturbance or Disturbance()))]
    numbers = np.array([flat(numbers_of(case, period)) for case in cases])
    if not (all(np.isfinite(x).all() for x in signals) and np.isfinite(numbers).all()):
        raise InputError(
            "the reference, load, drift or noise of a run, or its case, holds a value that is not finite; expected numbers throughout"
        )
    options = with_law_of(options, cases)
    given = [np.broadcast_to(x, (len(cases), n)) for x in signals]
    run = partial(_run, options, numbers_of(cases[0], period) if alike else None)
    workers = min(threads(), len(cases))
    parts = [slice(*ends) for ends in pairwise(round(k * len(cases) / workers) for k in range(workers + 1))]
    for part in parts:
        run(_length(n), part.stop - part.start)  # built here: CasADi does so in one thread alone
    with ThreadPoolExecutor(workers) as pool:  # CasADi releases the interpreter
        ran = pool.map(lambda part: _logged(options, run, [x[part] for x in given], numbers[part]), parts)
        logs = np.concatenate(list(ran), axis=1)
    log = shaped(blank_log(options), iter(logs))
    return Trajectory(
        time=np.asarray(period * np.arange(n)), reference=reference.position, position=log.position, velocity=log.velocity,
        measured=log.measured, torque=log.torque,
        voltage=log.voltage if options.drive == "voltage" else np.full((len(cases), n), np.nan),
        friction=log.friction, compensation=log.compensation,
        theta=np.reshape(log.theta, (-1, len(cases), n)).swapaxes(0, 1),
    )  # fmt: skip  # a list of values


def _logged(options: LoopOptions, run: Run, given: Sequence[Array], numbers: Array) -> Array:
    """Logs of each case, (rows, cases, n), from its inputs, (cases, n) each, in one thread, in chunks of one length."""
    cases, n = given[0].shape
    memory = np.array([flat(at_rest(options, float(y))) for y in given[0][:, 0]])
    length = _length(n)
    logs = np.empty((len(flat(blank_log(options))), cases, n))
    log, inputs = np.empty((cases, length, len(logs))), np.empty((cases, length, len(given)))
    for first in range(0, n, length):
        last = min(first + length, n)
        before, memory = memory, np.empty_like(memory)
        inputs[:, : last - first] = np.stack([x[:, first:last] for x in given], axis=-1)
        inputs[:, last - first :] = inputs[:, last - first - 1, None]
        bound(run(length, cases), (before, inputs, numbers), (memory, log))()
        logs[:, :, first:last] = np.moveaxis(log[:, : last - first], -1, 0)
    return logs


def _length(n: int) -> int:
    """Samples of a call."""
    return min(_CHUNK, 10 * -(-n // 10))  # a multiple of ten, which CasADi evaluates together


@lru_cache(maxsize=32)
def _run(options: LoopOptions, constants: Numbers | None, samples: int, cases: int) -> ca.Function:
    """Control periods of cases as one function: (memory, given, numbers) -> (memory, logs)."""
    run = chained(control_period(options, constants), samples)
    return run if cases == 1 else run.map(cases)

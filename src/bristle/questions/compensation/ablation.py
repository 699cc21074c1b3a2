"""Comparison of all compensators over encoder resolution, delay and compensated share of the friction."""

from collections.abc import Sequence
from dataclasses import replace
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.control.closed_loop import Trajectory, simulate
from bristle.control.compensator import Compensator, Reference
from bristle.control.control_period import LoopOptions
from bristle.estimation import levels
from bristle.model.laws.parts import FASTEST
from bristle.model.parameters import Pair
from bristle.simulation.joint_loop import JointLoop

SHARES = (0.5, 0.75, 1.0, 1.25, 1.5)  # of the identified friction that is compensated
BITS = (20, 14, 12)  # an encoder has 2**bits counts in 2 pi times the amplitude of the reference
DELAYS = (0, 2, 5)  # control periods from the command to the drive
HOLD = 2.0  # time at rest at the end, s
_WATCHED = 1.5  # part of it in which limit cycles are looked for, s
WAYS: dict[str, Compensator] = {
    "none": Compensator(name="none"),
    "Coulomb, reference velocity": Compensator(name="coulomb"),
    "Coulomb, measured velocity": Compensator(name="coulomb", velocity="measured"),
    "Stribeck, reference velocity": Compensator(name="stribeck"),
    "Stribeck, measured velocity": Compensator(name="stribeck", velocity="measured"),
    "LuGre, reference velocity": Compensator(name="lugre"),
    "LuGre, measured velocity": Compensator(name="lugre-feedback"),
    "LuGre observer": Compensator(name="lugre-observer"),
}


class AblationRow(NamedTuple):
    """One compensator with one encoder, delay and compensated share."""

    compensator: str
    encoder_bits: int
    delay: int  # control periods
    share: float
    rms_error: float  # while the reference moves, rad
    over_none: float  # ratio to the error without compensation, same encoder, no delay
    limit_cycle: bool  # whether the joint swings when it is held
    diverges: bool


def ablate(loop: JointLoop) -> tuple[AblationRow, ...]:
    """Every compensator under every condition; the joint moves back and forth twice, then is held at rest."""
    reference, moving = _back_and_forth(loop)
    tried = [(bits, share) for bits in BITS for share in SHARES]
    scaled = (loop.case(model=_scaled(loop.model, share)) for _, share in tried)
    cases = [replace(case, resolution=_count(loop, bits)) for case, (bits, _) in zip(scaled, tried, strict=True)]
    rows: list[AblationRow] = []
    bare: dict[int, float] = {}
    for way, compensator in WAYS.items():
        own = replace(compensator, filter_time=5 * loop.period, observer_gain=loop.observer_gain)
        chosen = [k for k, (_, share) in enumerate(tried) if way != "none" or share == 1.0]
        for delay in DELAYS:
            options = LoopOptions(compensator=own, encoder=True, delay=delay)
            run = simulate(options, [cases[k] for k in chosen], reference, loop.period)
            found = _judged(loop, run, moving, [tried[k][0] for k in chosen])
            for k, (rms, cycles, diverges) in zip(chosen, found, strict=True):
                bits, share = tried[k]
                ends = rms, rms / bare.setdefault(bits, rms), cycles, diverges
                rows.append(AblationRow(way, bits, delay, share if way != "none" else 0.0, *ends))
    return tuple(rows)


def _count(loop: JointLoop, bits: int) -> float:
    """One encoder count, rad."""
    return float(2 * pi * loop.amplitude / 2**bits)


def _scaled(model: Pair[float], share: float) -> Pair[float]:
    """A model with this share of the torque: T_f is of degree one in all parameters but the speeds."""
    kept = {*model.law.shape_parameters, FASTEST}
    return Pair(*(p._replace(**{n: share * x for n, x in p._asdict().items() if n not in kept}) for p in model))


def _back_and_forth(loop: JointLoop) -> tuple[Reference, NDArray[np.bool_]]:
    """The reference: back and forth twice, then held; and the samples at which it moves fast."""
    w, h = 2 * np.pi * loop.frequency, loop.period
    t: Array = h * np.arange(round((2 / loop.frequency + HOLD) / h) + 1, dtype=np.float64)
    on, half = t < 2 / loop.frequency, loop.amplitude / 2
    course = (on * half * x for x in (1 - np.cos(w * t), w * np.sin(w * t), w**2 * np.cos(w * t)))
    reference = loop.under_load(Reference(*course))
    return reference, np.abs(reference.velocity) > 0.2 * half * w


def _judged(
    loop: JointLoop, run: Trajectory, moving: NDArray[np.bool_], bits: Sequence[int]
) -> list[tuple[float, bool, bool]]:
    """RMS error, limit cycle and divergence of each case."""
    late = run.time >= run.time[-1] - _WATCHED
    with np.errstate(over="ignore", invalid="ignore"):
        rms = np.sqrt(np.mean(run.error[:, moving] ** 2, axis=1))
        held = run.position[:, late]
        about = held - held.mean(axis=1, keepdims=True)
        wide = np.ptp(held, axis=1)
    swings = np.count_nonzero(np.diff(np.signbit(about), axis=1), axis=1)
    deflection = max((p.alpha_0 + p.alpha_1) / p.sigma_0 for p in loop.plant)
    least = [max(levels.CYCLE_COUNTS * _count(loop, b), levels.CYCLE_BEND * deflection) for b in bits]
    diverges = ~(rms < levels.DIVERGED * loop.amplitude)
    cycles = (swings >= levels.CYCLE_SWINGS) & (wide > np.array(least)) & ~diverges
    return list(zip(rms.tolist(), cycles.tolist(), diverges.tolist(), strict=True))

"""How to load the joint below breakaway next, and along which motion to drive it: what each should tell, and the best found.

Slow loading: at count edge k the torque T_k is read with noise, y(T_k; g0, sigma_0) = k q - y0, with y of `law.loading_displacement` and y0, where
inside a count the joint rested, not known. The motion: a sum of sines; its information is J'J / noise**2 with J = dT/dp through the bristle.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bristle.arrays import Array
from bristle.control.compensator import Reference
from bristle.data.record import freeze
from bristle.identification.fisher import covariance, gram
from bristle.identification.limits import Limits
from bristle.model import functions
from bristle.model.parameters import Lugre, Pair
from bristle.model.rollout import rollout_into
from bristle.model.vectorize import evaluate
from bristle.simulation.references import Multisine

LINES = 6
"""Sines of a motion."""
SEED = 0
TRIES, STEPS = 30, 500
"""Motions to begin with, and exchanges tried from the best of them."""
_REACH = (0.02, 0.4)
"""Least and largest standard deviation of an exchange, as a share of the range."""
PEAKS = np.linspace(0.1, 0.8, 36)
"""Where loading may turn, as shares of g0 = alpha_0 + alpha_1: above, a little noise in the torque is much displacement."""
RISES = np.array([5.0, 8.0, 14.0, 25.0, 40.0])
"""Times to the peak, s ..."""
_WORTH = 1.1
"""... of which the shortest is taken that is at most this factor worse than the longest."""
CYCLES = 2
"""Rises in a run."""
_ROUGH = 10.0
"""Nodes so many times farther apart while motions are compared: errors a few percent off, in a quarter of the time."""
_MOST = 400
"""Count edges that are looked at; a finer encoder has them stand for the others."""
_SCALINGS = 20
"""Tries to bring a motion's torque below the limit."""
_GOOD = 0.97
"""Of each limit is used, for what lies between samples."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadingDesign:
    """Slow loading of one direction."""

    tag: str
    peak: float
    """Torque where it turns, N*m."""
    share: float
    """Of g0."""
    rise: float
    """Time from zero to the peak, s."""
    counts: float
    """Encoder counts that the joint should move; inf: a count is not known."""
    lag: float
    """Torque of sigma_1 and alpha_2 at the end of the rise, which the estimate neglects, as a share of its torque."""
    scatter: float
    """Expected standard error of sigma_0 by noise alone, N*m/rad, of `CYCLES` rises; inf: not seen."""
    error: float
    """The same with `lag` times sigma_0 counted as an error beside it (root of the sum of squares), N*m/rad."""
    by_peak: Array
    """The same for each of `PEAKS` (columns) and `RISES` (rows), (m, k)."""

    def __post_init__(self) -> None:
        """Copy and freeze every array."""
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionDesign:
    """A motion to track, and what it should tell."""

    name: str
    lines: Multisine
    """As they are played: scaled to the limits."""
    duration: float
    """s."""
    torque: float
    """Largest of the drive that it takes, N*m."""
    information: Array
    """Of its own at the estimate, in the order of the start's names, (p, p)."""
    errors: Array
    """Expected standard errors, what is known before included, (p,); inf where not seen."""

    def __post_init__(self) -> None:
        """Copy and freeze every array."""
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """What a motion is judged by."""

    sets: tuple[Pair[float] | Lugre[float], ...]
    """The estimate, then what else the joint may be."""
    inertias: tuple[float, ...]
    known: Array
    """Information before it, (p, p)."""
    noise: float
    """Of an equation, N*m."""
    step: float
    """Time between equations, s."""
    limits: Limits
    duration: float
    """s."""
    aims: tuple[int, ...]
    """Of which parameters the errors count."""


def loads(tag: str, p: Lugre[float], g0_error: float, noise: float, count: float, share: float = 1.0) -> LoadingDesign:
    """The peak and the rise of slow loading that show sigma_0 best, what the quasi-static estimate neglects counted as an error.

    Args:
        tag: of the direction.
        p: the estimate.
        g0_error: standard error of alpha_0 + alpha_1, N*m.
        noise: torque noise of a tenth of a second's mean, white, N*m.
        count: one encoder count, rad; 0: not known, edges then do not limit.
        share: of the time in `RISES` that there is.
    """
    g0, rises = p.alpha_0 + p.alpha_1, share * RISES
    noise = noise / CYCLES**0.5
    scatter = np.array([[_stiffness_error(p, r * g0, g0_error, noise, count, rise) for r in PEAKS] for rise in rises])
    y, y_T = evaluate(functions.loading_slope(), PEAKS * g0, g0, p.sigma_0)[:2]
    lag = (p.sigma_1 + p.alpha_2) * y_T / rises[:, None]
    table = np.hypot(scatter, lag * p.sigma_0)
    best = table.min(axis=1)
    row = int(np.argmax(best <= _WORTH * best[-1])) if np.isfinite(best[-1]) else RISES.size - 1
    column = int(table[row].argmin()) if np.isfinite(best[-1]) else PEAKS.size - 1
    return LoadingDesign(
        tag=tag,
        peak=float(PEAKS[column] * g0),
        share=float(PEAKS[column]),
        rise=float(rises[row]),
        counts=float(y[column] / count) if count else np.inf,
        lag=float(lag[row, column]),
        scatter=float(scatter[row, column]),
        error=float(table[row, column]),
        by_peak=table,
    )


def _stiffness_error(p: Lugre[float], peak: float, g0_error: float, noise: float, count: float, rise: float) -> float:
    """Standard error of sigma_0 from one rise to a peak, with the rest position unknown and g0 known with an error; inf below two edges."""
    g0 = p.alpha_0 + p.alpha_1
    reach = float(evaluate(functions.loading_displacement(), peak, g0, p.sigma_0)[0])
    edges = reach / count if count else np.inf
    if edges < 2:
        return np.inf
    looked = int(min(edges, _MOST))
    T = g0 * -np.expm1(-p.sigma_0 / g0 * reach * (np.arange(looked) + 0.5) / looked)  # where the edges are, no model
    _, y_T, y_g0, y_sigma_0 = evaluate(functions.loading_slope(), T, g0, p.sigma_0)
    alone = max(1.0, edges / (rise / 0.1)) * looked / edges if np.isfinite(edges) else looked / (rise / 0.1)
    rows = np.column_stack([y_sigma_0, np.ones(looked), y_g0]) / (y_T * noise * np.sqrt(alone))[:, None]
    matrix = rows.T @ rows + np.diag([0.0, 0.0, max(g0_error, 1e-9 * g0) ** -2])
    return float(covariance(matrix)[0][0])


def course(lines: Multisine, limits: Limits, duration: float, step: float) -> Reference:
    """The motion about the middle of the positions, faded in and out; scaled down where it would leave a limit."""
    found = _faded(limited(lines, limits, duration, step), duration, step)
    return found._replace(position=(limits.position[0] + limits.position[1]) / 2 + found.position)


def limited(lines: Multisine, limits: Limits, duration: float, step: float) -> Multisine:
    """The same sines scaled down by one factor where they would leave a limit of position, velocity or acceleration: as they are played."""
    most, (*moved, _) = (limits.travel / 2, limits.velocity, limits.acceleration), _faded(lines, duration, step)
    share = min(_GOOD * x / max(float(np.abs(own).max()), 1e-300) for x, own in zip(most, moved, strict=True))
    return lines._replace(amplitude=lines.amplitude * min(1.0, share))


def _faded(lines: Multisine, duration: float, step: float) -> Reference:
    """The sum of all sines about zero."""
    time: Array = np.arange(round(duration / step) + 1, dtype=np.float64) * step
    return lines.at(time, float(time[-1]))


def plain_lines(limits: Limits) -> Multisine:
    """A plain multisine: frequencies spaced evenly in log(f), all sines of the same speed, Schroeder's phases."""
    frequency = np.geomspace(2.0 / 15.0, limits.frequency, LINES)
    k = np.arange(LINES)
    return Multisine(
        limits.velocity / (2 * np.pi * frequency * np.sqrt(LINES)), frequency, -np.pi * k * (k - 1) / LINES
    )


def judged(name: str, lines: Multisine, drive: Drive) -> MotionDesign:
    """A motion with its sines as they are played, and what it should tell of each parameter, at the estimate."""
    lines = limited(lines, drive.limits, drive.duration, 1 / drive.limits.rate)
    run = course(lines, drive.limits, drive.duration, drive.step)
    matrix, torque = information(run.velocity, run.acceleration, drive)
    return MotionDesign(
        name=name,
        lines=lines,
        duration=drive.duration,
        torque=torque,
        information=matrix,
        errors=covariance(drive.known + matrix)[0],
    )


def within_torque(lines: Multisine, drive: Drive) -> Multisine:
    """The same scaled down, where it would take more torque than the drive has, until it does not at the estimate."""
    for _ in range(_SCALINGS):
        run = course(lines, drive.limits, drive.duration, drive.step)
        _, torque = information(run.velocity, run.acceleration, drive, rough=_ROUGH)
        if torque <= _GOOD * drive.limits.torque:
            break
        lines = limited(lines, drive.limits, drive.duration, drive.step)
        lines = lines._replace(amplitude=lines.amplitude * min(0.95, drive.limits.torque / torque))
    return lines


def best_motion(drive: Drive, progress: Callable[[int, int], None] | None = None) -> MotionDesign:
    """The sum of sines that shrinks the widest relative intervals: the best of the plain one and some at random, then random coordinate exchange.

    Least log of the sum of squared relative standard errors of `aims`, averaged over `sets`. Amplitudes, frequencies and phases are free; each step
    changes up to three of them, by less the longer none has helped.
    """
    rng = np.random.default_rng(SEED)
    low, high = _box(drive.limits)
    starts = [_packed(within_torque(plain_lines(drive.limits), drive)).clip(low, high)]
    starts += [low + (high - low) * rng.random(low.size) for _ in range(TRIES - 1)]
    costs = []
    for k, x in enumerate(starts):
        costs.append(_cost(x, drive))
        if progress is not None:
            progress(k, TRIES + STEPS)
    best, least, reach = starts[int(np.argmin(costs))], min(costs), _REACH[1]
    for k in range(STEPS):
        moved = best.copy()
        own = rng.integers(0, low.size, rng.integers(1, 4))
        moved[own] = np.clip(best[own] + reach * (high - low)[own] * rng.standard_normal(own.size), low[own], high[own])
        cost = _cost(moved, drive)
        helped = cost < least
        if helped:
            best, least = moved, cost
        reach = float(np.clip(reach * (1.5 if helped else 0.97), *_REACH))
        if progress is not None:
            progress(TRIES + k, TRIES + STEPS)
    return judged("planned", _unpacked(best), drive)


def _box(limits: Limits) -> tuple[Array, Array]:
    """Bounds of log(speed amplitude), log(frequency) and phase of each sine."""
    slow = 0.5 * limits.slowest
    ends = (np.log([slow, limits.velocity]), np.log([0.1, limits.frequency]), np.array([0.0, 2 * np.pi]))
    low, high = (np.repeat([e[k] for e in ends], LINES) for k in (0, 1))
    return low, high


def _packed(lines: Multisine) -> Array:
    """Log(speed amplitude), log(frequency) and phase, (3 k,)."""
    speed = 2 * np.pi * lines.frequency * lines.amplitude
    return np.concatenate([np.log(speed), np.log(lines.frequency), np.mod(lines.phase, 2 * np.pi)])


def _unpacked(x: Array) -> Multisine:
    speed, frequency, phase = np.exp(x[:LINES]), np.exp(x[LINES : 2 * LINES]), x[2 * LINES :]
    return Multisine(speed / (2 * np.pi * frequency), frequency, phase)


def _cost(x: Array, drive: Drive) -> float:
    """The criterion; where the motion takes more torque than the drive has, it is worse by as much."""
    run = course(_unpacked(x), drive.limits, drive.duration, drive.step)
    total = 0.0
    for k, p in enumerate(drive.sets):
        matrix, torque = information(run.velocity, run.acceleration, drive, k, _ROUGH)
        values = np.array([*(p if isinstance(p, Lugre) else (*p.positive, *p.negative)), drive.inertias[k]])
        relative = covariance(drive.known + matrix)[0] / np.maximum(np.abs(values), 1e-300)
        wide = np.minimum(relative[list(drive.aims)], 1e6)
        total += float(np.log(wide @ wide)) + 100 * max(torque / (_GOOD * drive.limits.torque) - 1, 0.0)
    return total / len(drive.sets)


def information(
    velocity: Array, acceleration: Array, drive: Drive, which: int = 0, rough: float = 1.0
) -> tuple[Array, float]:
    """What a motion (n,) tells of all parameters at one of the drive's sets, (p, p), and the largest torque that it takes, N*m.

    `rough` as in `rollout`.
    """
    p = drive.sets[which]
    rows = np.empty((7 if isinstance(p, Lugre) else 13, velocity.size))
    rolled = rollout_into(list(rows), velocity, drive.step, p, None, rough)
    rows[-1] = acceleration  # in the place of the derivative by the start, which is steady
    return gram(rows.T, drive.noise), float(np.abs(rolled.torque + drive.inertias[which] * acceleration).max())

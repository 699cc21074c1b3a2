"""Design of the tracking motion, a sum of sines with the information J'J / noise**2, J = dT/dp through the bristle."""

from dataclasses import dataclass

import numpy as np

from bristle.arrays import Array, result
from bristle.control.compensator import Reference
from bristle.model.parameters import Lugre, Pair, fields_of
from bristle.model.rollout import rollout_into
from bristle.progress import Progress, teller
from bristle.questions.experiment_design.start import Start
from bristle.simulation.fisher import covariance, gram, of_estimated, values_of
from bristle.simulation.limits import SAMPLES, Limits
from bristle.simulation.references import Multisine

LINES = 6  # sines of a motion
SEED = 0
TRIES, STEPS = 30, 500  # random motions, and exchanges from the best of them
_REACH = (0.02, 0.4)  # least and largest standard deviation of an exchange, over the range
_ROUGH = 10.0  # coarsening while motions are compared: errors within a few percent in a quarter of the time
_UNSURE = 1.0  # standard deviation of the logarithm of a guess
_GOOD = 0.97  # used share of each limit, because of peaks between samples


@result
class MotionDesign:
    """A planned motion for a tracking run, and the standard errors to expect from it."""

    lines: Multisine  # scaled to the limits
    duration: float  # s
    torque: float  # largest torque of the drive, N*m
    errors: Array  # expected standard errors with the prior, (p,); inf: not identifiable


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionProblem:
    """What a motion is optimised for: plausible joints, prior, noise, limits and the parameters that count."""

    sets: tuple[Pair[float] | Lugre[float], ...]  # the estimate, then other plausible joints
    inertias: tuple[float, ...]
    prior_information: Array  # (p, p)
    noise: float  # of an equation, N*m
    step: float  # time between equations, s
    limits: Limits
    duration: float  # s
    aims: tuple[int, ...]  # indices of the parameters whose errors count


def motion_problem(start: Start, limits: Limits, prior_information: Array, aim: str, duration: float) -> MotionProblem:
    """The problem for a parameter or `all`; other plausible joints are drawn where parameters are unsure."""
    relative = covariance(start.known)[0] / np.abs(start.estimate)
    guessed = np.array([name in start.guessed for name in start.names])
    spread = np.where(guessed, _UNSURE, np.where(np.isfinite(relative), np.minimum(relative, _UNSURE), 0.0))
    rng = np.random.default_rng(SEED)
    others = 2 if spread.max() > 0.2 else 0
    drawn = [
        start.estimate,
        *(start.estimate * np.exp(spread * rng.standard_normal(spread.size)) for _ in range(others)),
    ]
    # Samples may be finer than the equations, with the same information.
    step = min(start.equation_step, 1 / (SAMPLES * limits.frequency))
    return MotionProblem(
        sets=tuple(map(start.at, drawn)), inertias=tuple(float(x[-1]) for x in drawn),
        prior_information=prior_information, noise=start.equation_noise * float(np.sqrt(start.equation_step / step)),
        step=step, limits=limits, duration=duration,
        aims=tuple(k for k, n in enumerate(start.names) if n not in start.given and aim in ("all", n.name)),
    )  # fmt: skip  # a list of values


def course(lines: Multisine, limits: Limits, duration: float, step: float) -> Reference:
    """The motion about the middle of the positions, faded in and out, and scaled to the limits."""
    found = _faded(limited(lines, limits, duration, step), duration, step)
    return found._replace(position=(limits.position[0] + limits.position[1]) / 2 + found.position)


def limited(lines: Multisine, limits: Limits, duration: float, step: float) -> Multisine:
    """The sines, scaled down by one factor to the limits of position, velocity and acceleration."""
    moved, most = _faded(lines, duration, step)[:3], (limits.travel / 2, limits.velocity, limits.acceleration)
    share = min(_GOOD * x / max(float(np.abs(own).max()), 1e-300) for x, own in zip(most, moved, strict=True))
    return lines._replace(amplitude=lines.amplitude * min(1.0, share))


def _faded(lines: Multisine, duration: float, step: float) -> Reference:
    """The sum of all sines about zero."""
    time: Array = np.arange(round(duration / step) + 1, dtype=np.float64) * step
    return lines.at(time, float(time[-1]))


def plain_lines(limits: Limits) -> Multisine:
    """A plain multisine: frequencies evenly spaced in log(f), equal speeds, Schroeder's phases."""
    frequency = np.geomspace(2.0 / 15.0, limits.frequency, LINES)
    k, amplitude = np.arange(LINES), limits.velocity / (2 * np.pi * frequency * np.sqrt(LINES))
    return Multisine(amplitude, frequency, -np.pi * k * (k - 1) / LINES)


def evaluate_motion(lines: Multisine, problem: MotionProblem) -> MotionDesign:
    """A motion scaled to the limits, with the expected errors at the estimate."""
    lines = limited(lines, problem.limits, problem.duration, 1 / problem.limits.rate)
    run = course(lines, problem.limits, problem.duration, problem.step)
    matrix, torque = information(run.velocity, run.acceleration, problem)
    errors = covariance(problem.prior_information + matrix)[0]
    return MotionDesign(lines=lines, duration=problem.duration, torque=torque, errors=errors)


def within_torque(lines: Multisine, problem: MotionProblem) -> Multisine:
    """The sines, scaled down to the drive's torque at the estimate."""
    for _ in range(20):
        run = course(lines, problem.limits, problem.duration, problem.step)
        _, torque = information(run.velocity, run.acceleration, problem, coarsening=_ROUGH)
        if torque <= _GOOD * problem.limits.torque:
            break
        lines = limited(lines, problem.limits, problem.duration, problem.step)
        lines = lines._replace(amplitude=lines.amplitude * min(0.95, problem.limits.torque / torque))
    return lines


def best_motion(problem: MotionProblem, progress: Progress | None = None) -> MotionDesign:
    """The sum of sines with the least squared relative errors of `aims`, mean over `sets`, by random exchange."""
    rng, limits = np.random.default_rng(SEED), problem.limits
    # Of each sine log(speed amplitude), log(frequency) and phase, within these bounds.
    ends = (np.log([0.5 * limits.slowest, limits.velocity]), np.log([0.1, limits.frequency]), np.array([0, 2 * np.pi]))
    low, high = (np.repeat([e[k] for e in ends], LINES) for k in (0, 1))
    plain = within_torque(plain_lines(limits), problem)
    speed = 2 * np.pi * plain.frequency * plain.amplitude
    packed = np.concatenate([np.log(speed), np.log(plain.frequency), np.mod(plain.phase, 2 * np.pi)])
    starts = [packed.clip(low, high)]
    starts += [low + (high - low) * rng.random(low.size) for _ in range(TRIES - 1)]
    tell, costs = teller(progress, TRIES + STEPS), []
    for x in starts:
        costs.append(_cost(x, problem))
        tell("tracking motion")
    best, least, reach = starts[int(np.argmin(costs))], min(costs), _REACH[1]
    for _ in range(STEPS):
        moved = best.copy()
        at = rng.integers(0, low.size, rng.integers(1, 4))
        moved[at] = np.clip(best[at] + reach * (high - low)[at] * rng.standard_normal(at.size), low[at], high[at])
        cost = _cost(moved, problem)
        helped = cost < least
        if helped:
            best, least = moved, cost
        reach = float(np.clip(reach * (1.5 if helped else 0.97), *_REACH))
        tell("tracking motion")
    return evaluate_motion(_unpacked(best), problem)


def _unpacked(x: Array) -> Multisine:
    speed, frequency, phase = np.exp(x[:LINES]), np.exp(x[LINES : 2 * LINES]), x[2 * LINES :]
    return Multisine(speed / (2 * np.pi * frequency), frequency, phase)


def _cost(x: Array, problem: MotionProblem) -> float:
    """The criterion, with a penalty on torque beyond the drive's."""
    run = course(_unpacked(x), problem.limits, problem.duration, problem.step)
    total = 0.0
    for k, p in enumerate(problem.sets):
        matrix, torque = information(run.velocity, run.acceleration, problem, k, _ROUGH)
        values = np.array([*values_of(p), problem.inertias[k]])
        relative = covariance(problem.prior_information + matrix)[0] / np.maximum(np.abs(values), 1e-300)
        wide = np.minimum(relative[list(problem.aims)], 1e6)
        total += float(np.log(wide @ wide)) + 100 * max(torque / (_GOOD * problem.limits.torque) - 1, 0.0)
    return total / len(problem.sets)


def information(
    velocity: Array, acceleration: Array, problem: MotionProblem, which: int = 0, coarsening: float = 1.0
) -> tuple[Array, float]:
    """Information of a motion (n,) at one of the problem's sets, (p, p), and its largest torque, N*m."""
    p = problem.sets[which]
    rows = np.empty((len(fields_of(p.law)) * (1 if isinstance(p, Lugre) else 2) + 1, velocity.size))
    rolled = rollout_into(list(rows), velocity, problem.step, p, None, coarsening)  # the last: by the start, is steady
    columns = np.column_stack([of_estimated(rows[:-1].T, p), acceleration])
    return gram(columns, problem.noise), float(np.abs(rolled.torque + problem.inertias[which] * acceleration).max())

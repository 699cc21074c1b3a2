"""Studies beyond the paper: maps of the adapted values, drift, other controllers, parameter uncertainty."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.control.adaptation import Adaptation
from bristle.control.closed_loop import simulate
from bristle.control.compensator import Reference
from bristle.control.control_period import Disturbance, LoopOptions
from bristle.control.pid import Sliding
from bristle.questions.compensation import paper_experiments as paper
from bristle.simulation.joint_loop import JointLoop
from bristle.simulation.references import stacked

GAMMAS = (1.0, 5.0, 10.0, 20.0, 50.0)  # learning rates of the maps, over a twentieth of the loop's
FREQUENCIES = (0.25, 0.5, 1.0, 2.0, 4.0)  # of the maps, over the loop's
AMPLITUDES = (0.1, 0.25, 0.5, 1.0, 2.0)


class AdaptationMap(NamedTuple):
    """Final values of the adapted parameters, as ratios to the model's."""

    gammas: Array  # learning rates, (k,)
    frequencies: Array  # Hz, (m,)
    amplitudes: Array  # rad, (l,)
    by_gamma: Array  # (parameters, k, m)
    by_amplitude: Array  # (parameters, l, m)


def map_adaptation(loop: JointLoop) -> AdaptationMap:
    """Adapted values over learning rate, amplitude and frequency."""
    plan = loop.adaptation
    top = float(np.max(plan.gamma)) or 1.0
    gammas = top * np.array(GAMMAS) / 20.0
    f, A = loop.frequency * np.array(FREQUENCIES), loop.amplitude * np.array(AMPLITUDES)
    case = loop.case(model=loop.wrong_start(loop.model))
    begun = np.array([loop.start.get(name, 1.0) for name in plan.parameters])

    def ends(share: float, references: Sequence[Reference]) -> Array:
        """Final ratios after these references, at a share of the loop's rates, (parameters, references)."""
        a = replace(plan, gamma=tuple(share * g for g in plan.gamma))
        options = LoopOptions(compensator=replace(loop.compensator, adaptation=a))
        run = simulate(options, [case] * len(references), stacked(references), loop.period)
        return np.asarray(begun[:, None] * run.theta[:, :, -1].T)

    by_amplitude = ends(1.0, [loop.sine(x, paper.SHORT, a) for a in A for x in f]).reshape(begun.size, A.size, f.size)
    own = by_amplitude[:, AMPLITUDES.index(1.0)]  # at the loop's amplitude and rates
    by_gamma = [own if g == top else ends(float(g) / top, [loop.sine(x, paper.SHORT) for x in f]) for g in gammas]
    return AdaptationMap(gammas, f, A, np.stack(by_gamma, axis=1), by_amplitude)


class Drift(NamedTuple):
    """RMS errors while alpha_0 and alpha_2 rise by half over 30 s, rad."""

    joint: str
    frequency: float
    way: str  # `known` (the model drifts with the plant), `fixed`, or the adaptation
    gamma: float  # of the first adapted parameter; nan where nothing is adapted
    rms_error: float
    over_known: float  # ratio to the error with the known model
    largest_gain: float  # largest factor of a gain from 1; nan where nothing is adapted


def drifts(loop: JointLoop) -> tuple[Drift, ...]:
    """Both frequencies: known, fixed, adapted at a quarter of the rates and at all, without limits, normalised."""
    frequencies = (loop.slow, loop.frequency)
    reference = stacked([loop.sine(f, paper.LONG) for f in frequencies])
    rising: Array = np.linspace(1.0, 1.5, reference.position.shape[-1], dtype=np.float64)
    drifting = Disturbance(drift_0=rising, drift_2=rising)
    plan, cases = loop.adaptation, [loop.case(model=loop.plant)] * len(frequencies)
    ways: list[tuple[str, Adaptation | None]] = [
        ("known", None),
        ("fixed", None),
        (plan.law, replace(plan, gamma=tuple(0.25 * g for g in plan.gamma))),
        (plan.law, plan),
        (f"{plan.law}, without limits", replace(plan, limits=(1e-12, 1e12))),
        (f"{plan.law}, normalised", replace(plan, step="normalised")),
    ]
    rows: dict[float, list[Drift]] = {f: [] for f in frequencies}
    for way, a in ways:
        options = LoopOptions(compensator=replace(loop.compensator, adaptation=a), informed=way == "known")
        run = simulate(options, cases, reference, loop.period, drifting)
        for f, rms, theta in zip(frequencies, run.rms_error().tolist(), run.theta, strict=True):
            gain = float(np.exp(np.abs(np.log(theta)).max())) if a else np.nan
            known = rows[f][0].rms_error if rows[f] else rms
            rows[f].append(Drift(loop.name, f, way, a.gamma[0] if a else np.nan, rms, rms / known, gain))
    return tuple(row for f in frequencies for row in rows[f])


class Controlled(NamedTuple):
    """One controller on the fast sine: errors in rad, torque in N*m, its total variation in N*m/s, work in J."""

    controller: str
    rms_error: float
    peak_error: float
    rms_torque: float
    chatter: float
    energy: float


def compare_controllers(loop: JointLoop) -> tuple[Controlled, ...]:
    """PID alone, with LuGre feed-forward, and sliding mode with three boundary layers.

    Sliding mode has five times the torque that the reference needs, and the slope K_p / K_d; its widest layer is a PD
    controller of the same K_d.
    """
    reference, gains = loop.sine(loop.frequency, paper.SHORT), loop.gains
    fastest, hardest = float(np.abs(reference.velocity).max()), float(np.abs(reference.acceleration).max())
    steady = max(p.alpha_0 + p.alpha_1 + p.alpha_2 * fastest for p in loop.plant) + float(np.max(reference.level))
    needed = steady + loop.J * hardest
    K_d = gains.K_d or gains.K_p / 10
    ways = {
        "PID alone": (LoopOptions(compensator=paper.BARE), loop.case()),
        "PID with LuGre feed-forward": (LoopOptions(compensator=loop.compensator), loop.case()),
    }
    for share in (1.0, 0.1, 0.01):
        law = Sliding(5 * needed, gains.K_p / K_d, share * 5 * needed / K_d, gains.filter_time)
        case = replace(loop.case(), sliding=law)
        ways[f"sliding mode, layer {law.layer:.2g}"] = (LoopOptions(compensator=paper.BARE, controller="sliding"), case)
    runs = {name: simulate(options, [case], reference, loop.period) for name, (options, case) in ways.items()}
    since = paper.SHORT / 5
    return tuple(
        Controlled(name, *(float(f(since)[0]) for f in (r.rms_error, r.peak_error, r.rms_torque, r.chatter, r.energy)))
        for name, r in runs.items()
    )


class Band(NamedTuple):
    """Tracking error with the identified model on joints drawn from its covariance."""

    time: Array  # s, (n,)
    lower: Array  # 2.5 % quantile of the joints' errors, rad, (n,)
    upper: Array  # 97.5 % quantile
    actual: Array  # on the plant, rad, (n,)
    rms: tuple[float, float, float]  # RMS error: 2.5 %, median and 97.5 % of the joints, rad
    rms_actual: float
    joints: int
    rms_systematic: tuple[float, float] | None = None  # 2.5 % and 97.5 % by errors of constants alone, rad


def band(loop: JointLoop) -> Band | None:
    """The second period of the slow sine on joints drawn from the covariance; None without a covariance."""
    if not loop.draws:
        return None
    reference = loop.sine(loop.slow, 2 / loop.slow)
    drawn, count = (*loop.draws, *loop.draws_by_constants), 1 + len(loop.draws)
    cases = [loop.case(), *(loop.case(plant=pair, J=J) for pair, J in drawn)]
    run = simulate(LoopOptions(compensator=loop.compensator), cases, reference, loop.period)
    late = run.time >= 1 / loop.slow
    e = run.error[:, late]
    lower, upper = np.quantile(e[1:count], (0.025, 0.975), axis=0)
    rms = np.sqrt(np.mean(e**2, axis=1))
    low, middle, high = np.quantile(rms[1:count], (0.025, 0.5, 0.975)).tolist()
    alone = tuple(np.quantile(rms[count:], (0.025, 0.975)).tolist()) if loop.draws_by_constants else None
    return Band(run.time[late], lower, upper, e[0], (low, middle, high), float(rms[0]), len(loop.draws), alone)

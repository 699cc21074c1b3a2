"""Experiments of a compensation study: the paper's 3.3 to 5, maps of adapted values, drift, band."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.control.adaptation import Adaptation, laws_for
from bristle.control.closed_loop import Trajectory, simulate
from bristle.control.compensator import Compensator, Reference
from bristle.control.control_period import Case, Disturbance, LoopOptions
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.simulation.joint_loop import JointLoop
from bristle.simulation.references import stacked

LONG, SETTLE, SHORT = 30.0, 10.0, 20.0  # s: a run of Fig. 8, the start of its RMS error, a run of the adaptation
BARE = Compensator(name="none")
GAMMAS = (1.0, 5.0, 10.0, 20.0, 50.0)  # learning rates of the maps, over a twentieth of the loop's
FREQUENCIES = (0.25, 0.5, 1.0, 2.0, 4.0)  # of the maps, over the loop's
AMPLITUDES = (0.1, 0.25, 0.5, 1.0, 2.0)


class Errors(NamedTuple):
    """A row of Fig. 8: RMS errors of one joint, rad."""

    joint: str
    frequency: float  # Hz
    inertia: bool  # whether inertia feed-forward is added, to all four
    without: float  # without friction compensation
    true: float  # LuGre feed-forward with the plant's parameters
    identified: float  # with the identified parameters
    adaptive: float  # with adaptation, initialised at the identified parameters


def errors(loop: JointLoop) -> tuple[Errors, ...]:
    """Fig. 8 of a joint, without and with inertia feed-forward. Raises InputError where a loop diverges."""
    frequencies, own, found = (loop.slow, loop.frequency), loop.case(model=loop.plant), loop.case()
    references = [loop.sine(f, LONG) for f in frequencies]

    def run(compensator: Compensator, cases: Sequence[Case], J: float) -> Trajectory:
        """Both references for each pair of cases, with an inertia J fed forward."""
        options = LoopOptions(compensator=replace(compensator, inertia=J))
        return simulate(options, cases, stacked(references * (len(cases) // 2)), loop.period)

    rows = []
    for inertia in (False, True):
        J = loop.J if inertia else 0.0
        bare, steady = run(BARE, [found] * 2, J), run(loop.compensator, [own, own, found, found], J)
        moved = run(replace(loop.compensator, adaptation=loop.adaptation), [found] * 2, J)
        without, fed, adaptive = (t.rms_error(SETTLE).tolist() for t in (bare, steady, moved))
        if not all(x < levels.DIVERGED * loop.amplitude for x in fed):
            raise InputError(
                f"{loop.name}: the loop diverges with {loop.compensator.name}, the gains of its PID and a period of {loop.period:g} s; choose lugre, "
                "lower adapt.gains or a shorter adapt.period"
            )
        rows += [
            Errors(loop.name, f, inertia, without[k], fed[k], fed[2 + k], adaptive[k])
            for k, f in enumerate(frequencies)
        ]
    return tuple(sorted(rows, key=lambda row: (row.frequency, row.inertia)))


def followed(loop: JointLoop) -> dict[str, Trajectory]:
    """Figs 5 to 7: the slow sine without friction compensation and with the identified model's."""
    reference = loop.sine(loop.slow, 2 / loop.slow)
    options = {"without": LoopOptions(compensator=BARE), "with": LoopOptions(compensator=loop.compensator)}
    return {name: simulate(w, [loop.case()], reference, loop.period) for name, w in options.items()}


class Factors(NamedTuple):
    """A row of Table 2: one parameter adapted by one law, as a ratio to the model's value."""

    law: str
    parameter: str
    initial: float
    early: float  # after a fifth of the run
    final: float


class Adapted(NamedTuple):
    """Figs 9 to 12 and Table 2: adaptation from wrong parameters by each law."""

    runs: Mapping[str, Trajectory]  # by law, and `not adapted`
    factors: tuple[Factors, ...]


def adapted(loop: JointLoop) -> Adapted:
    """Adaptation from the wrong start, by every law that can adapt the parameters."""
    plan, reference = loop.adaptation, loop.sine(loop.frequency, SHORT)
    case = loop.case(model=loop.wrong_start(loop.model))
    laws = laws_for(plan.parameters)
    ways = {"not adapted": None} | {law: replace(plan, law=law, gamma=loop.comparable_rates(law)) for law in laws}
    runs = {
        name: simulate(LoopOptions(compensator=replace(loop.compensator, adaptation=a)), [case], reference, loop.period)
        for name, a in ways.items()
    }
    factors = [
        Factors(law, name, begun, float(begun * theta[theta.size // 5]), float(begun * theta[-1]))
        for law in laws
        for name, theta in zip(plan.parameters, runs[law].theta[0], strict=True)
        for begun in [loop.start.get(name, 1.0)]
    ]
    return Adapted(runs, tuple(factors))


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

    by_amplitude = ends(1.0, [loop.sine(x, SHORT, a) for a in A for x in f]).reshape(begun.size, A.size, f.size)
    own = by_amplitude[:, AMPLITUDES.index(1.0)]  # at the loop's amplitude and rates
    by_gamma = [own if g == top else ends(float(g) / top, [loop.sine(x, SHORT) for x in f]) for g in gammas]
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
    reference = stacked([loop.sine(f, LONG) for f in frequencies])
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

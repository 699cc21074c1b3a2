"""The paper's experiments 3.3 to 5 in closed loop, for any joint, and what goes beyond them: Figs 5 to 12, Table 2, maps, drift, bands.

RMS errors leave out what precedes `SETTLE`, s, where the loop starts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from bristle.compensation.subject import Subject, sine
from bristle.control import adaptation
from bristle.control.adaptation import LAWS, Adaptation, Law, Learnt
from bristle.control.closed import Course, Trajectory, Wiring, simulate
from bristle.control.compensator import Compensator
from bristle.control.continuous import Sine, simulate_continuous
from bristle.control.pid import Sliding
from bristle.model import functions
from bristle.model.arrays import Array, evaluate
from bristle.model.parameters import Lugre

LONG, SETTLE, SHORT = 30.0, 10.0, 20.0
"""s: a run of Fig. 8, from when on its error counts, and a run of the adaptation."""
GAMMAS = (1.0, 5.0, 10.0, 20.0, 50.0)
"""Rates of the maps, as multiples of a twentieth of the plan's."""
FREQUENCIES = (0.25, 0.5, 1.0, 2.0, 4.0)
AMPLITUDES = (0.1, 0.25, 0.5, 1.0, 2.0)
"""Of the maps, as multiples of the plan's."""
RISE = 0.5
"""By how much alpha_0 and alpha_2 grow in a drift."""
BARE = Compensator(name="none")


class Errors(NamedTuple):
    """A row of Fig. 8: RMS errors of one joint, rad, and torques, N*m."""

    joint: str
    frequency: float
    """Hz."""
    inertia: bool
    """Whether inertia feed-forward is added, to all four."""
    without: float
    """Without friction compensation."""
    true: float
    """LuGre feed-forward with the plant's own parameters."""
    identified: float
    """With the identified ones."""
    adaptive: float
    """With the identified ones to begin with, adapted."""
    torque_without: float
    """RMS of the torque asked for."""
    torque_with: float
    """The same with the identified parameters."""


def errors(subjects: Sequence[Subject]) -> tuple[Errors, ...]:
    """Fig. 8 at both frequencies of each joint, without and with inertia feed-forward."""
    return tuple(
        _errors(subject, frequency, inertia=inertia)
        for subject in subjects
        for frequency in (subject.slow, subject.frequency)
        for inertia in (False, True)
    )


def _errors(subject: Subject, frequency: float, *, inertia: bool) -> Errors:
    course, J = subject.sine(frequency, LONG), subject.J if inertia else 0.0
    fed, true = subject.case(), subject.case(model=subject.plant)

    def run(compensator: Compensator, *cases: object) -> Trajectory:
        return simulate(Wiring(compensator=replace(compensator, inertia=J)), cases, course, subject.period)  # type: ignore[arg-type]

    bare, steady = run(BARE, fed), run(subject.compensator, true, fed)
    moved = run(replace(subject.compensator, adaptation=subject.adaptation), fed)
    without, (own, found), adaptive = (t.rms_error(SETTLE).tolist() for t in (bare, steady, moved))
    return Errors(
        subject.name, frequency, inertia, without[0], own, found, adaptive[0], float(bare.rms_torque(SETTLE)[0]), float(steady.rms_torque(SETTLE)[1])
    )  # fmt: skip  # a list of values


def followed(subject: Subject) -> dict[str, Trajectory]:
    """Figs 5 to 7: the slow sine without friction compensation and with the identified model's."""
    course = subject.sine(subject.slow, 2 / subject.slow)
    wirings = {"without": Wiring(compensator=BARE), "with": Wiring(compensator=subject.compensator)}
    return {name: simulate(w, [subject.case()], course, subject.period) for name, w in wirings.items()}


class Factors(NamedTuple):
    """A row of Table 2: one adapted parameter under one law, as a share of the plant's or, where they differ, the model's own."""

    law: str
    parameter: str
    initial: float
    early: float
    """A fifth of the run after its start."""
    final: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Adapted:
    """Figs 9 to 12 and Table 2: a start with wrong parameters, adapted by each law."""

    runs: Mapping[str, Trajectory]
    """By law; `not adapted` without."""
    factors: tuple[Factors, ...]
    adaptation: Adaptation


def adapted(subject: Subject) -> Adapted:
    """The adaptation from the wrong start, by every law that can adapt the plan's parameters."""
    plan, course = subject.adaptation, subject.sine(subject.frequency, SHORT)
    case = subject.case(model=subject.begun(subject.model))
    laws: list[Law] = [law for law in LAWS if law != "printed" or {*plan.parameters} <= {"alpha_0", "alpha_2"}]
    ways = {"not adapted": None} | {law: replace(plan, law=law, gamma=_fair(subject, law)) for law in laws}
    runs = {
        name: simulate(Wiring(compensator=replace(subject.compensator, adaptation=a)), [case], course, subject.period)
        for name, a in ways.items()
    }
    factors = [
        Factors(law, name, begun, float(begun * theta[theta.size // 5]), float(begun * theta[-1]))
        for law in laws
        for name, theta in zip(plan.parameters, runs[law].theta[0], strict=True)
        for begun in [subject.start.get(name, 1.0)]
    ]
    return Adapted(runs=runs, factors=tuple(factors), adaptation=plan)


def _fair(subject: Subject, law: Law) -> tuple[float, ...]:
    """Rates of a law: those of the plan, but over the parameter where the law's gradient has it once more, so that all could move alike."""
    plan = subject.adaptation
    if law != "partial-theta":
        return plan.gamma
    begun = subject.begun(subject.model).positive
    return tuple(gamma / getattr(begun, name) for gamma, name in zip(plan.gamma, plan.parameters, strict=True))


class Map(NamedTuple):
    """Where the adapted parameters end, as shares of the model's: over rate and frequency, and over amplitude and frequency."""

    gammas: Array
    """Learning rates, (k,)."""
    frequencies: Array
    """Hz, (m,)."""
    amplitudes: Array
    """rad, (l,)."""
    by_gamma: Array
    """(parameters, k, m)."""
    by_amplitude: Array
    """(parameters, l, m)."""


def landings(subject: Subject) -> Map:
    """How the adapted values move with rate, amplitude and frequency, after the length of a run of the adaptation."""
    plan = subject.adaptation
    top = float(np.max(plan.gamma))
    gammas = top * np.array(GAMMAS) / 20.0
    f, A = subject.frequency * np.array(FREQUENCIES), subject.amplitude * np.array(AMPLITUDES)
    case = subject.case(model=subject.begun(subject.model))
    begun = np.array([subject.start.get(name, 1.0) for name in plan.parameters])

    def ends(share: float, courses: Sequence[Course]) -> Array:
        a = replace(plan, gamma=tuple(share * g for g in plan.gamma))
        wiring = Wiring(compensator=replace(subject.compensator, adaptation=a))
        course = Course(
            *(np.stack([getattr(c, part) for c in courses]) for part in ("position", "velocity", "acceleration"))
        )
        run = simulate(wiring, [case] * len(courses), course, subject.period)
        final: Array = begun[:, None] * run.theta[:, :, -1].T
        return final

    by_gamma = [ends(float(g) / top, [subject.sine(x, SHORT) for x in f]) for g in gammas]
    grid = ends(1.0, [subject.sine(x, SHORT, a) for a in A for x in f])
    return Map(gammas, f, A, np.stack(by_gamma, axis=1), grid.reshape(begun.size, A.size, f.size))


def gradients(p: Lugre[float], parameter: str, points: int = 121) -> tuple[Array, dict[str, Array]]:
    """Speeds, rad/s, (points,), and what each law's G is in steady sliding at them, relative to the total derivative's largest.

    The `partial-theta` one is left out: it is the partial one times the parameter.
    """
    v = np.geomspace(0.02, 30.0, points) * p.v_s
    z, *by = evaluate(functions.steady_deflection(), v, *p)
    slope = by[Lugre._fields.index(parameter)]
    found: dict[str, Array] = {}
    for law in LAWS:
        if law == "partial-theta" or (law == "printed" and parameter not in {"alpha_0", "alpha_2"}):
            continue
        a = Adaptation(law=law, parameters=(parameter,), gamma=(1.0,))
        own = [
            float(adaptation.gradient(a, zk, vk, p, Learnt((1.0,), (sk * getattr(p, parameter),), ()))[0])
            for zk, vk, sk in zip(z.tolist(), v.tolist(), slope.tolist(), strict=True)
        ]
        found[law] = np.abs(np.array(own))
    top = float(found["total"].max())
    return v, {law: g / top for law, g in found.items()}


class Drift(NamedTuple):
    """A row: RMS errors while alpha_0 and alpha_2 rise by half over 30 s, rad."""

    joint: str
    frequency: float
    way: str
    """`known` (the model drifts with the plant), `fixed`, or the adaptation."""
    gamma: float
    """Of the first adapted parameter; nan where nothing is adapted."""
    rms: float
    over_known: float
    """That over the one of the known model."""
    largest_gain: float
    """Farthest that a gain went from 1, as a factor; nan where nothing is adapted."""


_UNLIMITED = (1e-12, 1e12)


def drifts(subjects: Sequence[Subject], shares: Sequence[float] = (0.25, 1.0)) -> tuple[Drift, ...]:
    """Every joint at the plan's frequency and at its slow one: known, fixed, adapted at shares of the plan's rates, unprojected, normalised."""
    return tuple(
        row for subject in subjects for f in (subject.slow, subject.frequency) for row in _drift(subject, f, shares)
    )


def _drift(subject: Subject, frequency: float, shares: Sequence[float]) -> list[Drift]:
    course = subject.sine(frequency, LONG)
    rising: Array = np.linspace(1.0, 1.0 + RISE, course.position.size, dtype=np.float64)
    course = course._replace(drift_0=rising, drift_2=rising)
    plan, case = subject.adaptation, subject.case(model=subject.plant)
    ways: list[tuple[str, Adaptation | None]] = [("known", None), ("fixed", None)]
    ways += [(plan.law, replace(plan, gamma=tuple(share * g for g in plan.gamma))) for share in shares]
    ways += [
        (f"{plan.law}, without limits", replace(plan, limits=_UNLIMITED)),
        (f"{plan.law}, normalised", replace(plan, step="normalised")),
    ]
    rows: list[Drift] = []
    for way, a in ways:
        wiring = Wiring(compensator=replace(subject.compensator, adaptation=a), informed=way == "known")
        run = simulate(wiring, [case], course, subject.period)
        rms = float(run.rms_error()[0])
        gain = float(np.exp(np.abs(np.log(run.theta)).max())) if a else np.nan
        known = rows[0].rms if rows else rms
        rows.append(Drift(subject.name, frequency, way, a.gamma[0] if a else np.nan, rms, rms / known, gain))
    return rows


class Controlled(NamedTuple):
    """A row: one controller on the plan's fast sine."""

    controller: str
    rms_error: float
    """rad, as the peak error."""
    peak_error: float
    rms_torque: float
    """N*m."""
    chatter: float
    """Total variation of the torque, N*m/s."""
    energy: float
    """Work at the joint, J."""


def controllers(subject: Subject) -> tuple[Controlled, ...]:
    """PID alone, with LuGre feed-forward, and sliding mode, which needs no model, with boundary layers in which it is PD of the same K_d or steeper.

    Sliding mode has five times the torque that the reference needs, and the slope K_p / K_d.
    """
    course, gains = subject.sine(subject.frequency, SHORT), subject.gains
    fastest, hardest = float(np.abs(course.velocity).max()), float(np.abs(course.acceleration).max())
    needed = max(p.alpha_0 + p.alpha_1 + p.alpha_2 * fastest for p in subject.plant) + subject.J * hardest
    K_d = gains.K_d or gains.K_p / 10
    ways = {
        "PID alone": (Wiring(compensator=BARE), subject.case()),
        "PID with LuGre feed-forward": (Wiring(compensator=subject.compensator), subject.case()),
    }
    for share in (1.0, 0.1, 0.01):
        law = Sliding(5 * needed, gains.K_p / K_d, share * 5 * needed / K_d, gains.filter_time)
        case = replace(subject.case(), sliding=law)
        ways[f"sliding mode, layer {law.layer:.2g}"] = (Wiring(compensator=BARE, controller="sliding"), case)
    runs = {name: simulate(wiring, [case], course, subject.period) for name, (wiring, case) in ways.items()}
    since = SHORT / 5
    return tuple(
        Controlled(name, *(float(f(since)[0]) for f in (r.rms_error, r.peak_error, r.rms_torque, r.chatter, r.energy)))
        for name, r in runs.items()
    )


class Sampled(NamedTuple):
    """A row: how far the sampled loop is from the continuous one, which the paper ran, with the same feed-forward."""

    joint: str
    period: float
    """s."""
    distance: float
    """Largest difference of the positions over the run, rad."""


def sampling(subjects: Sequence[Subject]) -> tuple[Sampled, ...]:
    """Every joint at twice, once and half its control period."""
    rows = []
    for subject in subjects:
        wave = Sine(subject.amplitude, subject.frequency)
        case = replace(subject.case(), gains=subject.gains._replace(filter_time=0.0))  # the continuous loop has none
        for factor in (2.0, 1.0, 0.5):
            h = factor * subject.period
            exact = simulate_continuous(case, subject.compensator, wave, SETTLE, h)
            course = sine(subject.amplitude, subject.frequency, SETTLE, h)
            try:
                held = simulate(Wiring(compensator=subject.compensator), [case], course, h)
            except ValueError:  # a longer period than the loop bears
                continue
            rows.append(Sampled(subject.name, h, float(np.abs(held.position - exact.position).max())))
    return tuple(rows)


class Band(NamedTuple):
    """The tracking error with the identified model on joints that its covariance allows."""

    time: Array
    """s, (n,)."""
    lower: Array
    """2.5 % of the joints have an error below this, rad, (n,)."""
    upper: Array
    """and 2.5 % one above this."""
    actual: Array
    """On the plant, rad, (n,)."""
    rms: tuple[float, float, float]
    """RMS error: 2.5 %, median and 97.5 % of the joints, rad."""
    rms_actual: float
    joints: int


def band(subject: Subject) -> Band | None:
    """One period of the slow sine after the first, over joints drawn from the covariance; None where there is none."""
    if not subject.draws:
        return None
    course = subject.sine(subject.slow, 2 / subject.slow)
    cases = [subject.case(), *(subject.case(plant=pair, J=J) for pair, J in subject.draws)]
    run = simulate(Wiring(compensator=subject.compensator), cases, course, subject.period)
    late = run.time >= 1 / subject.slow
    e = run.error[:, late]
    lower, upper = np.quantile(e[1:], (0.025, 0.975), axis=0)
    rms = np.sqrt(np.mean(e**2, axis=1))
    low, middle, high = np.quantile(rms[1:], (0.025, 0.5, 0.975)).tolist()
    return Band(run.time[late], lower, upper, e[0], (low, middle, high), float(rms[0]), len(subject.draws))

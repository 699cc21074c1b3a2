import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.control import closed_loop
from bristle.control.adaptation import LAWS, STEPS, Adaptation, Law, Step
from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator, Name, Reference
from bristle.control.control_period import Case, Disturbance, LoopOptions
from bristle.control.pid import AT_REST, Gains, Memory, Sliding, pid, sliding
from bristle.control.stability import growth, refuse_long_period
from bristle.model.parameters import Lugre, Motor, Pair
from bristle.simulation import edro

from ..conftest import present
from .conftest import PAIR, H, P, case, follow, sine

BATCH, SAMPLES = 100, 1001  # cases of each law and step, and samples of each case: 1200 random runs of 1 s in all
ADAPTING: tuple[Name, ...] = ("lugre", "lugre-feedback", "lugre-observer")


def random_options(rng: np.random.Generator, law: Law, step: Step) -> LoopOptions:
    """Any adaptive compensator, parameters, rates, limits, dead zone, leakage, forgetting; any drive, encoder and delay up to eight periods."""
    known = ("alpha_0", "alpha_2") if law == "printed" else Lugre._fields
    names = tuple(rng.permutation(known)[: rng.integers(1, len(known) + 1)].tolist())
    dead_zone, leakage, forgetting, inertia, filter_time = (
        rng.choice([0.0, 1.0], 5) * (0.05, 0.1, 5.0, 0.01, 0.005)
    ).tolist()
    adaptation = Adaptation(
        law=law, step=step, parameters=names, gamma=tuple((10 ** rng.uniform(-1, 4, len(names))).tolist()),
        limits=(float(rng.uniform(0.01, 1.0)), float(rng.uniform(1.0, 10.0))), dead_zone=dead_zone, leakage=leakage, forgetting=forgetting,
    )  # fmt: skip  # a list of values
    own = Compensator(
        name=ADAPTING[rng.integers(3)], adaptation=adaptation, inertia=inertia, filter_time=filter_time
    )  # fmt: skip  # as above
    encoder, speedometer, volts = (rng.random(3) < 0.5).tolist()
    return LoopOptions(
        compensator=own, drive="voltage" if volts else "torque", delay=int(rng.integers(9)), encoder=encoder, speedometer=speedometer,
    )  # fmt: skip  # as above


def positions(rng: np.random.Generator) -> Iterator[Array]:
    """References of one batch, rad, (SAMPLES,) each: steps, sines up to 10 rad and 10 Hz, random walks, all at once, from anywhere."""
    t = H * np.arange(SAMPLES)
    for k in range(BATCH):
        step = rng.uniform(-3, 3) * (t > rng.uniform(0, 1))
        wave = 10 ** rng.uniform(-3, 1) * np.sin(2 * np.pi * 10 ** rng.uniform(-1, 1) * t + rng.uniform(0, 7))
        walk = np.cumsum(10 ** rng.uniform(-5, -2) * rng.standard_normal(SAMPLES))
        yield np.asarray((step, wave, walk, step + wave + walk)[k % 4] + rng.uniform(-1, 1), dtype=np.float64)


def course(rng: np.random.Generator) -> tuple[Reference, Disturbance]:
    y = np.stack([*positions(rng)])
    v = np.gradient(y, H, axis=1) * rng.choice([0.0, 1.0], (BATCH, 1), p=[0.2, 0.8])  # a user may not know it
    load = rng.uniform(-0.2, 0.2, (BATCH, 1)) * np.sign(np.sin(20 * H * np.arange(SAMPLES)))
    noise = 10 ** rng.uniform(-6, -1, (BATCH, 1)) * rng.standard_normal((BATCH, SAMPLES))
    drift_0, drift_2 = (np.linspace(1.0, rng.uniform(0.5, 2.0), SAMPLES) for _ in range(2))
    return Reference(y, v, np.gradient(v, H, axis=1)), Disturbance(load, drift_0, drift_2, noise)


def random_case(rng: np.random.Generator, options: LoopOptions) -> Case:
    """A joint of Table 1, its model from 0.05 to 5 times the truth, a PID that its loop bears, and a drive with a limit."""
    # a drive without a limit is left where nothing measured feeds the compensator: friction fed back five times over
    # makes any joint run away
    joint = case(str(rng.choice(list(edro.TABLE_1))), resolution=10 ** rng.uniform(-6, -1))
    wrong = Pair(*(Lugre(*(np.geomspace(0.05, 5.0, 101)[rng.integers(101, size=6)] * p).tolist()) for p in joint.model))
    own = options.compensator.name == "lugre" and options.drive == "torque"
    limit = np.inf if own and rng.random() < 0.5 else 10 ** rng.uniform(-2, 2)
    gains = rng.uniform(0.3, 2.0) * np.array(edro.PID_GAINS)
    while True:
        one = replace(joint, model=wrong, gains=Gains(*gains.tolist()), torque_limit=float(limit))
        try:
            refuse_long_period(options, [one], H)
        except ValueError:
            gains *= 0.7
        else:
            return one


@pytest.mark.parametrize(("law", "step"), list(product(LAWS, STEPS)))
def test_gains_and_signals_stay_finite_whatever_comes(law: Law, step: Step) -> None:
    """Over more than 1000 random references, noise levels, delays and starts every gain is within its limits, and every signal finite."""
    rng = np.random.default_rng([LAWS.index(law), STEPS.index(step)])
    options = random_options(rng, law, step)
    cases = [random_case(rng, options) for _ in range(BATCH)]
    reference, disturbance = course(rng)
    run = simulate(options, cases, reference, H, disturbance)
    a = present(options.compensator.adaptation)
    low, high = a.limits
    assert (low <= run.theta).all()
    assert (run.theta <= high).all()
    for signal in (run.position, run.velocity, run.torque, run.friction, run.compensation, run.theta):
        assert np.isfinite(signal).all()
    assert (np.abs(run.torque).max(axis=1) <= [one.torque_limit for one in cases]).all()


RISING = np.linspace(1.0, 1.5, 30_001)
SINE, DRIFT = sine(30.0, 0.5), Disturbance(drift_0=RISING, drift_2=RISING)
"""1 rad at 0.5 Hz, and alpha_0 and alpha_2 that rise by half meanwhile."""


def adapting(**changes: object) -> LoopOptions:
    """Adapted by the partial law at the rate 20."""
    return LoopOptions(compensator=Compensator(adaptation=Adaptation(**changes)))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["elbow pitch", "base rotation"])
def test_limits_and_normalisation_keep_inertia_from_being_learnt_as_friction(name: str) -> None:
    """Unprojected, the error that inertia makes drives the gains past a million and the joint away; within limits, or normalised, it is tracked."""
    known = simulate(LoopOptions(informed=True), [case(name)], SINE, H, DRIFT).rms_error()[0]
    free, held, normalised = (
        simulate(adapting(**changes), [case(name)], SINE, H, DRIFT)
        for changes in ({"limits": (1e-12, 1e12)}, {}, {"limits": (1e-12, 1e12), "step": "normalised"})
    )
    assert free.theta.max() > 1e6
    assert free.rms_error()[0] > 50 * known
    assert held.theta.max() <= 5.0
    assert normalised.theta.max() < 2.0
    assert max(held.rms_error()[0], normalised.rms_error()[0]) < 1.5 * known


def scaled(pair: Pair[float], share: float) -> Pair[float]:
    """All parameters times a share but v_s."""
    return Pair(*(Lugre(*(share * np.array(p)).tolist())._replace(v_s=p.v_s) for p in pair))


@pytest.mark.parametrize("name", ["lugre", "lugre-feedback"])
@settings(max_examples=30)
@given(st.lists(st.integers(-30_000, 30_000), min_size=1, max_size=60), st.floats(0.01, 100.0), st.integers(-6, 6))
def test_a_share_of_all_parameters_is_that_share_of_the_torque(
    name: Name, speeds: list[int], share: float, power: int
) -> None:
    """At any motion T_f is of degree one in all parameters but v_s: to rounding for any share, to the last bit for powers of two."""
    v, own = 1e-3 * np.array(speeds), Compensator(name=name)
    _, whole = follow(own, v)
    np.testing.assert_allclose(follow(own, v, scaled(PAIR, share))[1], share * whole, rtol=1e-9, atol=1e-12 * share)
    np.testing.assert_array_equal(follow(own, v, scaled(PAIR, 2.0**power))[1], 2.0**power * whole)


@pytest.mark.parametrize("name", ["lugre", "lugre-feedback"])
@pytest.mark.parametrize("stiff", [0, 1])
@pytest.mark.parametrize("law", [None, "partial", "total"])
def test_a_reversal_onto_another_stiffness_makes_no_jump(name: Name, stiff: int, law: str | None) -> None:
    """Where one direction's bristle is 1e5 times as stiff, no torque exceeds the steady friction by more than bristle damping, at any reversal."""
    sets = [P._replace(sigma_1=0.0)] * 2
    sets[stiff] = sets[stiff]._replace(sigma_0=1e5 * P.sigma_0)
    adaptation = None if law is None else Adaptation(law=law, gamma=(0.0, 0.0))  # type: ignore[arg-type]
    for frequency in (0.3, 3.0, 30.0):
        v = 0.2 * np.sin(2 * np.pi * frequency * H * np.arange(1500) + 0.3)
        _, T = follow(Compensator(name=name, adaptation=adaptation), v, Pair(*sets))
        steady = P.alpha_0 + P.alpha_1 + P.alpha_2 * np.abs(v)
        assert (np.abs(T) <= steady * (1 + 1e-9)).all()


BARE = LoopOptions(compensator=Compensator(name="none"))


def test_what_controllers_bear_refuse_and_saturate_at() -> None:
    """A period of 0.1 s on the gripper with the paper's PID: what was got, how fast it grows, what it bears, what to do."""
    with pytest.raises(
        ValueError,
        match=r"^case 1: got a control period of 0\.1 s, in which the loop's fastest mode grows by a factor of 9\.1\d+; "
        r"the loop bears about 0\.013 s: shorten the period, or lower the gains or the delay$",
    ):
        simulate(LoopOptions(), [case("base rotation"), case("gripper rotation")], sine(10.0, 0.5, 0.1), 0.1)
    # every joint of Table 1 with the paper's PID at 1 kHz, up to five periods late; sliding mode at any period
    cases = [case(name) for name in edro.TABLE_1]
    for delay in range(6):
        for options in (LoopOptions(delay=delay), LoopOptions(delay=delay, drive="voltage")):
            refuse_long_period(options, cases, H)
            assert (growth(options, cases, np.full(len(cases), H)) < 1e-4).all()
    slide = LoopOptions(controller="sliding", compensator=Compensator(name="none"))
    assert (growth(slide, cases, np.full(len(cases), 0.1)) > 0.1).any()
    refuse_long_period(slide, cases, 0.1)
    # with too much integral for its damping the continuous loop is unstable itself; no gains at all do not grow; neither is refused
    p = P._replace(alpha_2=0.0)
    one = case("gripper rotation", plant=Pair(p, p), gains=Gains(1.0, 1000.0, 0.01, 0.0))
    free = replace(one, gains=Gains(0.0, 0.0, 0.0, 0.0))
    for h in (1e-4, 1e-3):
        refuse_long_period(BARE, [one], h)
        refuse_long_period(BARE, [free], 1000 * h)
        assert growth(BARE, [one], np.array([h])) > 1e-4
        assert growth(BARE, [free], np.array([1000 * h])) < 1e-4
    # in a batch every case has the growth that it has by itself, and a refusal names the worst
    gains = [Gains(3.0, 1.2, K_d, 0.0) for K_d in (0.2, 2.0, 5.0, 1.0)]
    cases = [case("gripper rotation", gains=g) for g in gains]
    every = growth(BARE, cases, np.full(len(cases), H))
    alone = [growth(BARE, [one], np.array([H]))[0] for one in cases]
    np.testing.assert_array_equal(every, alone)
    with pytest.raises(ValueError, match=r"^case 2: "):
        refuse_long_period(BARE, cases, H)
    # after a long saturation the output leaves its limit within a few samples of the error's change of sign
    gains, limit = Gains(1.0, 10.0, 0.0, 0.0), 1.0
    outputs = [u for u, _ in run([2.0] * 5000 + [-0.1] * 5, gains, limit)]
    assert outputs[4999] == limit
    assert max(outputs[5000:]) < 0
    # on an error that grows steadily the filtered derivative goes to its slope
    h, slope = 1e-3, 0.5
    _, memory = run([slope * h * (k + 1) for k in range(400)], Gains(0.0, 0.0, 1.0, 0.01), h=h)[-1]
    assert memory.derivative == pytest.approx(slope, rel=1e-12)
    # there T = K / layer (de/dt + slope e), which is (21) with K_d = K / layer and K_p = slope K_d; beyond, T = +-K
    gains, layer = Sliding(K=2.0, slope=15.0, layer=10.0, filter_time=0.002), AT_REST
    same, alike = Gains(K_p=3.0, K_i=0.0, K_d=0.2, filter_time=0.002), AT_REST
    for error in 0.02 * np.sin(np.arange(30)):
        T, layer = sliding(layer, float(error), 0.01, gains)
        expected, alike = pid(alike, float(error), 0.01, same, 1e9)
        assert float(T) == pytest.approx(float(expected), abs=1e-12)
    for error, T in ((50.0, 2.0), (-50.0, -2.0)):
        assert float(sliding(Memory(0.0, 0.0, error), error, 0.01, gains)[0]) == T


@pytest.mark.parametrize("options", [BARE, replace(BARE, drive="voltage"), replace(BARE, delay=3)])
@pytest.mark.parametrize("name", ["gripper rotation", "wrist pitch"])
def test_below_the_bound_it_runs_and_above_it_diverges(
    options: LoopOptions, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a blow of a thousand breakaway torques, 0.9 of the named period brings the joint back; 1.2 of it, unrefused, loses it."""
    with pytest.raises(ValueError, match="control period") as refused:
        simulate(options, [case(name)], sine(50.0, 0.1, 0.5), 0.5)
    named = float(present(re.search(r"bears about (\S+) s", str(refused.value)))[1])
    monkeypatch.setattr(closed_loop, "refuse_long_period", lambda *_: None)
    ends = []
    for h in (0.9 * named, 1.2 * named):
        zero, load = np.zeros(601), np.zeros(601)
        load[:5] = 1000 * case(name).plant.positive.alpha_0
        run = simulate(options, [case(name)], Reference(zero, zero, zero), h, Disturbance(load=load))
        blow, end = np.abs(run.error[0, :50]).max(), np.abs(run.error[0, -50:]).max()
        ends.append(end / blow)
    assert ends[0] < 0.1
    assert not ends[1] < 10


def test_growth_of_the_linear_loop_and_swings_in_stick() -> None:
    """An inertia with K_d = k J / h alone and no viscous friction: of (y, v, the last y) the modes are those of a matrix that a pencil writes."""
    for k in (0.5, 1.3, 2.5):
        J, h, p = 1e-3, 0.01, P._replace(alpha_2=0.0)
        one = case(
            "wrist pitch", plant=Pair(p, p), motor=Motor(1.0, 1.0, 0.0, J), gains=Gains(0.0, 0.0, k * J / h, 0.0)
        )
        step = np.array([[1 - k / 2, h, k / 2], [-k / h, 1.0, k / h], [1.0, 0.0, 0.0]])
        (found,) = growth(BARE, [one], np.array([h]))
        assert np.exp(found) == pytest.approx(np.abs(np.linalg.eigvals(step)).max(), rel=1e-3)
    # a bristle however stiff at 1 kHz: what grows in stick ends where the joint breaks away, and the loop tracks
    for sigma_0 in (6.0, 1e3, 1e4, 1e5):
        p = P._replace(sigma_0=sigma_0)
        run = simulate(BARE, [case("gripper rotation", plant=Pair(p, p))], sine(4.0, 0.5), H)
        assert run.peak_error(1.0)[0] < 0.06


GAINS = Gains(3.0, 1.2, 0.2, 0.0)
errors = st.lists(st.floats(-1, 1), min_size=1, max_size=30)


def run(
    values: list[float], gains: Gains[float] = GAINS, limit: float = 1e9, h: float = 1e-3
) -> list[tuple[float, Memory[float]]]:
    """The output and the memory after each error."""
    out, memory = [], AT_REST
    for error in values:
        output, memory = pid(memory, error, h, gains, limit)
        out.append((output, memory))
    return out


@given(errors)
def test_unlimited_output_is_21(values: list[float]) -> None:
    """Far from the limit, the output is K_p e + K_i sum(e) h + K_d (e - e_before) / h."""
    h, e = 1e-3, np.array(values)
    expected = 3 * e + 1.2 * h * np.cumsum(e) + 0.2 * np.diff(e, prepend=0.0) / h
    np.testing.assert_allclose([u for u, _ in run(values)], expected, rtol=1e-12, atol=1e-12)


@given(errors, st.floats(1e-3, 10))
def test_integral_never_pushes_into_the_limit(values: list[float], limit: float) -> None:
    """The output stays within the limit; a sample whose output meets it with room to spare does not move the integral further that way."""
    before = 0.0
    for output, memory in run(values, limit=limit):
        assert abs(output) <= limit
        wanted = GAINS.K_p * memory.error + GAINS.K_d * memory.derivative + before
        if abs(wanted) > limit:
            assert memory.integral * np.sign(wanted) <= before * np.sign(wanted) + 1e-15
        before = memory.integral

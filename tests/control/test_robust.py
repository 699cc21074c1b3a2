from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.control.adaptation import LAWS, STEPS, Adaptation, Law, Step
from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator, Name, Reference
from bristle.control.control_period import Case, Disturbance, LoopOptions
from bristle.control.pid import AT_REST, Gains, Memory, pid
from bristle.model.parameters import Lugre, Pair
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
    own = Compensator(name=ADAPTING[rng.integers(3)], adaptation=adaptation, inertia=inertia, filter_time=filter_time)
    encoder, volts = (rng.random(2) < 0.5).tolist()
    return LoopOptions(
        compensator=own, drive="voltage" if volts else "torque", delay=int(rng.integers(9)), encoder=encoder
    )


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
    """A joint of Table 1, its model from 0.05 to 5 times the truth, a PID, and a drive with a limit."""
    # a drive without a limit is left where nothing measured or late feeds the compensator: friction fed back five times
    # over makes any joint run away
    joint = case(str(rng.choice(list(edro.TABLE_1))), resolution=10 ** rng.uniform(-6, -1))
    wrong = Pair(*(Lugre(*(np.geomspace(0.05, 5.0, 101)[rng.integers(101, size=6)] * p).tolist()) for p in joint.model))
    own = options.compensator.name == "lugre" and options.drive == "torque" and options.delay < 6
    limit = np.inf if own and rng.random() < 0.5 else 10 ** rng.uniform(-2, 2)
    gains = Gains(*(rng.uniform(0.3, 1.0) * np.array(edro.PID_GAINS)).tolist())
    return replace(joint, model=wrong, gains=gains, torque_limit=float(limit))


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


def test_stiff_bristles_saturation_and_the_derivative() -> None:
    """A bristle however stiff at 1 kHz: what grows in stick ends where the joint breaks away, and the loop tracks."""
    for sigma_0 in (6.0, 1e5):
        p = P._replace(sigma_0=sigma_0)
        bare = LoopOptions(compensator=Compensator(name="none"))
        track = simulate(bare, [case("gripper rotation", plant=Pair(p, p))], sine(4.0, 0.5), H)
        assert np.abs(track.error[0, 1000:]).max() < 0.06
    # after a long saturation the output leaves its limit within a few samples of the error's change of sign
    gains, limit = Gains(1.0, 10.0, 0.0, 0.0), 1.0
    outputs = [u for u, _ in run([2.0] * 5000 + [-0.1] * 5, gains, limit)]
    assert outputs[4999] == limit
    assert max(outputs[5000:]) < 0
    # on an error that grows steadily the filtered derivative goes to its slope
    h, slope = 1e-3, 0.5
    _, memory = run([slope * h * (k + 1) for k in range(400)], Gains(0.0, 0.0, 1.0, 0.01), h=h)[-1]
    assert memory.derivative == pytest.approx(slope, rel=1e-12)


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

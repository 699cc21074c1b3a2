import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.control.adaptation import Adaptation
from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator, Name
from bristle.control.control_period import Disturbance, LoopOptions
from bristle.control.pid import AT_REST, Gains, Memory, pid
from bristle.model.parameters import Lugre, Pair

from .conftest import PAIR, H, P, case, follow, sine

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


def test_stiff_bristles_and_the_derivative() -> None:
    """A bristle however stiff at 1 kHz: what grows in stick ends where the joint breaks away, and the loop tracks."""
    for sigma_0 in (6.0, 1e5):
        p = P._replace(sigma_0=sigma_0)
        bare = LoopOptions(compensator=Compensator(name="none"))
        track = simulate(bare, [case("gripper rotation", plant=Pair(p, p))], sine(4.0, 0.5), H)
        assert np.abs(track.error[0, 1000:]).max() < 0.06
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

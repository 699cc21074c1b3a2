from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bristle.arrays import Array
from bristle.identification.fisher import covariance, motion_information
from bristle.identification.limits import Limits
from bristle.model import functions
from bristle.model.vectorize import evaluate
from bristle.questions.experiment_design import excitation
from bristle.questions.experiment_design.excitation import (
    Drive,
    best_motion,
    course,
    information,
    judged,
    limited,
    loads,
    plain_lines,
    within_torque,
)
from bristle.simulation.edro import TABLE_1, inertia
from bristle.simulation.references import Multisine

PAIR = TABLE_1["gripper rotation"]
P = PAIR.positive
J = inertia(PAIR)
LIMITS = Limits(
    position=(-0.5, 1.5),
    slowest=0.02,
    velocity=1.2,
    acceleration=15.0,
    torque=0.06,
    time=None,
    hold=3.0,
    frequency=8.0,
    rate=100.0,
)
VALUES = np.array([*PAIR.positive, *PAIR.negative, J])
DRIVE = Drive(
    sets=(PAIR,),
    inertias=(J,),
    known=np.diag((0.05 * VALUES) ** -2),
    noise=4e-4,
    step=0.01,
    limits=LIMITS,
    duration=4.0,
    aims=tuple(range(13)),
)


def relative(errors: Array) -> float:
    """Root of the sum of squared relative standard errors."""
    return float(np.linalg.norm(errors / VALUES))


@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.tuples(st.floats(1e-4, 5.0), st.floats(0.1, 8.0), st.floats(0.0, 6.3)), min_size=1, max_size=6),
    st.floats(1.5, 3.0),
)
def test_a_motion_stays_within_its_limits(sines: list[tuple[float, float, float]], duration: float) -> None:
    """Position, velocity and acceleration keep within their limits whatever is asked; it begins and ends at rest in the middle."""
    lines = Multisine(*np.array(sines).T)
    run = course(lines, LIMITS, duration, 0.01)
    assert LIMITS.position[0] <= run.position.min() <= run.position.max() <= LIMITS.position[1]
    assert np.abs(run.velocity).max() <= LIMITS.velocity
    assert np.abs(run.acceleration).max() <= LIMITS.acceleration
    assert run.position[[0, -1]] == pytest.approx(0.5)
    assert np.abs(run.velocity[[0, -1]]).max() <= 1e-9


def test_velocity_and_acceleration_are_derivatives_of_the_position() -> None:
    """Differences of a fine course agree with them, where it fades in and out too."""
    step = 5e-4
    fine = course(plain_lines(LIMITS), LIMITS, 2.0, step)
    assert np.gradient(fine.position, step)[1:-1] == pytest.approx(fine.velocity[1:-1], abs=1e-3 * LIMITS.velocity)
    assert np.gradient(fine.velocity, step)[1:-1] == pytest.approx(
        fine.acceleration[1:-1], abs=1e-2 * LIMITS.acceleration
    )


def test_information_is_that_of_the_model_and_the_acceleration() -> None:
    """What a motion tells is J'J / noise**2 of friction through the bristle with the acceleration for the inertia, as the other route has it."""
    run = course(plain_lines(LIMITS), LIMITS, 2.0, 0.01)
    matrix, torque = information(run.velocity, run.acceleration, DRIVE)
    other = motion_information(run.velocity, 0.01, PAIR, DRIVE.noise, {"inertia": run.acceleration})
    assert matrix == pytest.approx(other, rel=1e-9, abs=1e-9 * np.abs(other).max())
    assert torque > J * np.abs(run.acceleration).max() / 2
    found = judged("it", plain_lines(LIMITS), replace(DRIVE, duration=2.0))
    assert found.errors == pytest.approx(covariance(DRIVE.known + other)[0], rel=1e-6)


def test_the_planned_motion_beats_the_plain_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its relative errors are smaller than those of a plain multisine, within the torque limit; the same each time; longer is better."""
    monkeypatch.setattr(excitation, "TRIES", 6)
    monkeypatch.setattr(excitation, "STEPS", 60)
    calls: list[tuple[int, int]] = []
    found = best_motion(DRIVE, lambda done, total: calls.append((done, total)))
    plain = judged("plain", within_torque(plain_lines(LIMITS), DRIVE), DRIVE)
    assert relative(found.errors) < 0.98 * relative(plain.errors)
    assert max(found.torque, plain.torque) <= LIMITS.torque
    assert found.errors.tolist() == best_motion(DRIVE).errors.tolist()
    assert relative(judged("longer", found.lines, replace(DRIVE, duration=8.0)).errors) < relative(found.errors)
    assert calls == [(k, 66) for k in range(66)]


def test_a_motion_for_one_parameter_is_better_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Planned for sigma_1 alone, its two errors are smaller than when planned for all."""
    monkeypatch.setattr(excitation, "TRIES", 10)
    monkeypatch.setattr(excitation, "STEPS", 60)
    own = (5, 11)
    one, every = best_motion(replace(DRIVE, aims=own)), best_motion(DRIVE)
    assert relative(np.where(np.isin(range(13), own), one.errors, 0)) < relative(
        np.where(np.isin(range(13), own), every.errors, 0)
    )


def test_a_motion_is_scaled_down_to_the_torque_of_the_drive() -> None:
    """Where it would take too much torque it is scaled down until it does not, and left as it is where it would not."""
    weak = replace(DRIVE, limits=replace(LIMITS, torque=0.04))
    lines = plain_lines(LIMITS)
    assert judged("as it is", lines, weak).torque > 0.04
    assert judged("scaled", within_torque(lines, weak), weak).torque <= 0.04
    strong = replace(DRIVE, limits=replace(LIMITS, torque=1.0))
    assert within_torque(lines, strong).amplitude.tolist() == lines.amplitude.tolist()


def test_the_error_of_sigma_0_is_what_simulated_loadings_scatter_by() -> None:
    """With g0 known, weighted straight lines through simulated count edges scatter by the error predicted for as many independent edges."""
    g0, edges, noise = P.alpha_0 + P.alpha_1, 40, 1e-4
    peak = 0.6 * g0
    reach = float(evaluate(functions.loading_displacement(), peak, g0, P.sigma_0)[0])
    predicted = excitation._stiffness_error(P, peak, 0.0, noise, reach / edges, rise=0.1 * edges)
    y = reach * (np.arange(edges) + 0.5) / edges
    T = g0 * -np.expm1(-P.sigma_0 * y / g0)
    rng = np.random.default_rng(0)
    U = evaluate(functions.loading_displacement(), T + noise * rng.standard_normal((4000, edges)), g0, 1.0)[0]
    weight = 1 - T / g0
    slopes = np.polynomial.polynomial.polyfit(y, U.T, 1, w=weight)[1]
    assert slopes.mean() == pytest.approx(P.sigma_0, rel=0.02)
    assert predicted == pytest.approx(slopes.std(), rel=0.05)


def test_loading_is_planned_as_its_error_asks() -> None:
    """Half the noise is half the error where g0 is known; longer rises and finer encoders are no worse; an unsure g0 lowers the peak."""
    fine = P.alpha_0 / P.sigma_0 / 500
    known = loads("+", P, 0.0, 1e-4, fine)
    half = loads("+", P, 0.0, 5e-5, fine)
    k = excitation.RISES.tolist().index(known.rise), int(np.abs(excitation.PEAKS - known.share).argmin())
    lag = known.lag * P.sigma_0
    assert np.sqrt(half.by_peak[k] ** 2 - lag**2) == pytest.approx(known.scatter / 2, rel=1e-3)
    assert (np.diff(known.by_peak, axis=0) <= 1e-9).all()
    assert known.error <= loads("+", P, 0.0, 1e-4, 20 * fine).error
    assert known.peak == pytest.approx(known.share * (P.alpha_0 + P.alpha_1))
    unsure = loads("+", P, 0.005 * P.alpha_0, 1e-4, fine)
    assert unsure.share < known.share
    assert unsure.error > known.error
    reach = float(evaluate(functions.loading_displacement(), known.peak, P.alpha_0 + P.alpha_1, P.sigma_0)[0])
    assert known.counts == pytest.approx(reach / fine)
    assert loads("+", P, 0.0, 1e-4, fine, share=0.5).rise == known.rise / 2


@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.tuples(st.floats(1e-3, 5.0), st.floats(0.1, 8.0), st.floats(0.0, 6.3)), min_size=1, max_size=6),
    st.floats(1.5, 3.0),
)
def test_lines_as_played_are_the_course(sines: list[tuple[float, float, float]], duration: float) -> None:
    """Sines once scaled to the limits are not scaled again, keep their frequencies and phases, and give the course of those asked for."""
    asked = Multisine(*np.array(sines).T)
    played = limited(asked, LIMITS, duration, 0.01)
    assert limited(played, LIMITS, duration, 0.01).amplitude == pytest.approx(played.amplitude, rel=1e-12)
    assert (played.frequency.tolist(), played.phase.tolist()) == (asked.frequency.tolist(), asked.phase.tolist())
    assert course(played, LIMITS, duration, 0.01).position == pytest.approx(
        course(asked, LIMITS, duration, 0.01).position, abs=1e-12
    )
    wanted = judged("it", asked, replace(DRIVE, duration=duration, limits=replace(LIMITS, rate=100.0))).lines
    assert wanted.amplitude == pytest.approx(played.amplitude)


@pytest.mark.parametrize("share", [0.4, 0.6, 0.8])
@pytest.mark.parametrize("rise", [5.0, 25.0])
def test_what_loading_neglects_is_within_the_error_that_is_promised(rise: float, share: float) -> None:
    """sigma_0 of a simulated rise without noise is off by 0.4 to 1 times the viscous share, which is the promised error where there is no noise."""
    g0 = P.alpha_0 + P.alpha_1
    peak, time = share * g0, np.linspace(0.0, rise, 300)

    def speed(t: float, state: Array) -> tuple[float, float]:
        """dz/dt and velocity under the torque of time t, the bristle of (3) at no speed."""
        held = P.sigma_0 * state[0]
        v = (peak * t / rise - held) / (P.sigma_1 * (1 - held / g0) + P.alpha_2)
        return v * (1 - held / g0), v

    found = solve_ivp(speed, (0.0, rise), [0.0, 0.0], method="LSODA", t_eval=time, rtol=1e-9, atol=1e-13)
    T, x = peak * time[10:] / rise, found.y[1][10:]
    U = evaluate(functions.loading_displacement(), T, g0, 1.0)[0]
    slope = np.polynomial.polynomial.polyfit(x, U, 1, w=1 - T / g0)[1]
    row, column = excitation.RISES.tolist().index(rise), int(np.abs(excitation.PEAKS - share).argmin())
    promised = loads("+", P, 0.0, 1e-12, 0.0).by_peak[row, column]
    assert 0.4 * promised < abs(slope - P.sigma_0) < promised


def test_a_slower_rise_wins_where_much_is_neglected() -> None:
    """With hardly any noise the slowest rise is planned, its error is the viscous share; ten times the damping never makes the error smaller."""
    quiet = loads("+", P, 0.0, 1e-9, 0.0)
    assert quiet.rise == excitation.RISES[-1]
    assert quiet.error == pytest.approx(quiet.lag * P.sigma_0, rel=1e-3)
    usual = loads("+", P, 0.001 * P.alpha_0, 1e-4, 0.0)
    assert usual.error == pytest.approx(np.hypot(usual.scatter, usual.lag * P.sigma_0))
    damped = loads("+", P._replace(sigma_1=10 * P.sigma_1), 0.001 * P.alpha_0, 1e-4, 0.0)
    assert damped.error > usual.error
    assert damped.share <= usual.share
    assert (damped.by_peak >= usual.by_peak).all()


def test_a_coarse_encoder_sees_no_stiffness() -> None:
    """Where the joint moves less than two counts below breakaway the error is infinite, and the peak the highest."""
    coarse = loads("-", P, 0.0, 1e-4, 1.1 * P.alpha_0 / P.sigma_0)
    assert coarse.error == np.inf
    assert coarse.counts < 2
    assert coarse.share == excitation.PEAKS[-1]

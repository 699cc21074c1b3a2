import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bristle.arrays import Array
from bristle.model import functions
from bristle.model.parameters import Direction
from bristle.model.vectorize import evaluate
from bristle.questions.experiment_design import loading
from bristle.questions.experiment_design.loading import design_loading, loading_errors
from bristle.simulation.edro import TABLE_1

P = TABLE_1["gripper rotation"].positive


def test_the_error_of_sigma_0_is_what_simulated_loadings_scatter_by() -> None:
    """With g0 known, weighted straight lines through simulated count edges scatter by the error predicted for as many independent edges."""
    g0, edges, noise = P.alpha_0 + P.alpha_1, 40, 1e-4
    peak = 0.6 * g0
    reach = float(evaluate(functions.loading_displacement_function(), peak, g0, P.sigma_0)[0])
    predicted = loading._stiffness_error(P, peak, 0.0, noise, reach / edges, rise=0.1 * edges)
    y = reach * (np.arange(edges) + 0.5) / edges
    T = g0 * -np.expm1(-P.sigma_0 * y / g0)
    rng = np.random.default_rng(0)
    U = evaluate(functions.loading_displacement_function(), T + noise * rng.standard_normal((4000, edges)), g0, 1.0)[0]
    weight = 1 - T / g0
    slopes = np.polynomial.polynomial.polyfit(y, U.T, 1, w=weight)[1]
    assert slopes.mean() == pytest.approx(P.sigma_0, rel=0.02)
    assert predicted == pytest.approx(slopes.std(), rel=0.05)


def test_loading_is_planned_as_its_error_asks() -> None:
    """Half the noise is half the error where g0 is known; longer rises and finer encoders are no worse; an unsure g0 lowers the peak."""
    fine = P.alpha_0 / P.sigma_0 / 500
    known = design_loading(Direction.POSITIVE, P, 0.0, 1e-4, fine)
    row, column = loading.RISES.tolist().index(known.rise), loading.PEAKS.tolist().index(known.share)
    scatter, viscous, _ = loading_errors(P, 0.0, 1e-4, fine, loading.RISES)
    assert (scatter[row, column], viscous[row, column]) == (known.noise_error, known.viscous_share)
    assert loading_errors(P, 0.0, 5e-5, fine, loading.RISES)[0][row, column] == pytest.approx(known.noise_error / 2)
    assert (np.diff(np.hypot(scatter, viscous * P.sigma_0), axis=0) <= 1e-9).all()
    assert known.error <= design_loading(Direction.POSITIVE, P, 0.0, 1e-4, 20 * fine).error
    assert known.peak == pytest.approx(known.share * (P.alpha_0 + P.alpha_1))
    unsure = design_loading(Direction.POSITIVE, P, 0.005 * P.alpha_0, 1e-4, fine)
    assert unsure.share < known.share
    assert unsure.error > known.error
    reach = float(evaluate(functions.loading_displacement_function(), known.peak, P.alpha_0 + P.alpha_1, P.sigma_0)[0])
    assert known.counts == pytest.approx(reach / fine)
    assert design_loading(Direction.POSITIVE, P, 0.0, 1e-4, fine, share=0.5).rise == known.rise / 2


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
    U = evaluate(functions.loading_displacement_function(), T, g0, 1.0)[0]
    slope = np.polynomial.polynomial.polyfit(x, U, 1, w=1 - T / g0)[1]
    row, column = loading.RISES.tolist().index(rise), int(np.abs(loading.PEAKS - share).argmin())
    promised = P.sigma_0 * loading_errors(P, 0.0, 1e-12, 0.0, loading.RISES)[1][row, column]
    assert 0.4 * promised < abs(slope - P.sigma_0) < promised


def test_a_slower_rise_wins_where_much_is_neglected() -> None:
    """With hardly any noise the slowest rise is planned, its error is the viscous share; ten times the damping never makes the error smaller."""
    quiet = design_loading(Direction.POSITIVE, P, 0.0, 1e-9, 0.0)
    assert quiet.rise == loading.RISES[-1]
    assert quiet.error == pytest.approx(quiet.viscous_share * P.sigma_0, rel=1e-3)
    usual = design_loading(Direction.POSITIVE, P, 0.001 * P.alpha_0, 1e-4, 0.0)
    assert usual.error == pytest.approx(np.hypot(usual.noise_error, usual.viscous_share * P.sigma_0))
    more = P._replace(sigma_1=10 * P.sigma_1)
    damped = design_loading(Direction.POSITIVE, more, 0.001 * P.alpha_0, 1e-4, 0.0)
    assert damped.error > usual.error
    assert damped.share <= usual.share
    found = (loading_errors(p, 0.001 * P.alpha_0, 1e-4, 0.0, loading.RISES)[:2] for p in (P, more))
    of_usual, of_damped = (np.hypot(scatter, viscous * P.sigma_0) for scatter, viscous in found)
    assert (of_damped >= of_usual).all()


def test_a_coarse_encoder_sees_no_stiffness() -> None:
    """Where the joint moves less than two counts below breakaway the error is infinite, and the peak the highest."""
    coarse = design_loading(Direction.NEGATIVE, P, 0.0, 1e-4, 1.1 * P.alpha_0 / P.sigma_0)
    assert coarse.error == np.inf
    assert coarse.counts < 2
    assert coarse.share == loading.PEAKS[-1]

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.identification.fisher import covariance, static_information, static_jacobian
from bristle.questions.experiment_design import velocities
from bristle.questions.experiment_design.velocities import (
    Design,
    DesignProblem,
    design,
    evaluate_design,
    nodes_of,
)
from bristle.simulation.edro import TABLE_1

from .simulated_fits import simulated_errors, spaced_speeds

P = TABLE_1["gripper rotation"].positive
RUNS = 12


def errors_by_v_s(own: DesignProblem, speeds: Array, v_s: Array) -> Array:
    """Standard error of v_s over it, were it another one than the estimate, for v_s (k,)."""
    known = (own.prior_information + static_information(speeds, P._replace(v_s=float(x)), own.noise) for x in v_s)
    return np.array([covariance(x)[0][3] for x in known]) / v_s


def problem(low: float = 0.15, high: float = 0.8, relative: float = 0.0, **changed: object) -> DesignProblem:
    """Gripper rotation (+), from `low` v_s to `high` rad/s, with nothing known before."""
    given_ = {
        "p": P,
        "nodes": nodes_of(P.v_s, relative),
        "prior_information": np.zeros((4, 4)),
        "noise": 0.005 * P.alpha_0,
    }
    return DesignProblem(**{**given_, "low": low * P.v_s, "high": high, **changed})  # type: ignore[arg-type]  # of mixed types


def loss(own: DesignProblem, found: Design) -> float:
    """-log det of the information, averaged over the nodes."""
    sets = [own.p._replace(v_s=float(x)) for x in own.nodes]
    each = [np.linalg.slogdet(own.prior_information + static_information(found.speeds, p, own.noise))[1] for p in sets]
    return -float(np.mean(each))


def test_planned_velocities_beat_log_spaced_ones_for_v_s() -> None:
    """Twelve runs planned for v_s alone give it at most 0.67 times the standard error of twelve log-spaced ones; simulated fits agree."""
    own = problem()
    planned, log = design(own, RUNS, "v_s"), evaluate_design(own, spaced_speeds(own, RUNS, "log"))
    assert planned.alone[3] <= 0.67 * log.alone[3]
    seen = [simulated_errors(own, speeds, 20_000)[3] for speeds in (planned.speeds, log.speeds)]
    assert seen[0] <= 0.67 * seen[1]
    assert seen[0] == pytest.approx(planned.alone[3], rel=0.05)


@pytest.mark.parametrize(("low", "high"), [(0.05, 0.8), (1.0, 0.8), (0.15, 0.3)])
def test_planned_velocities_win_in_every_range(low: float, high: float) -> None:
    """For v_s and alpha_1, the runs planned for it are at least as good as spaced ones of the same range."""
    own = problem(low, high)
    for k, aim in ((1, "alpha_1"), (3, "v_s")):
        found = design(own, RUNS, aim)
        assert found.aim == aim
        assert all(
            found.errors[k] <= evaluate_design(own, spaced_speeds(own, RUNS, kind)).errors[k]
            for kind in ("log", "even")
        )


def test_speeds_that_show_no_peak_are_planned_for_the_rest() -> None:
    """Far above v_s, where the peak's information is zero to the last digit, Coulomb and viscous friction are planned as without a peak."""
    own = problem(low=40.0, high=80 * P.v_s)
    assert not (static_jacobian(np.array([own.low]), P)[0, [1, 3]] ** 2).any()
    found = design(own, RUNS, "alpha_2")
    assert np.isfinite(found.errors[[0, 2]]).all()
    assert {*np.round(found.speeds, 9).tolist()} == {round(own.low, 9), round(own.high, 9)}


def test_d_optimal_runs_satisfy_the_equivalence_theorem() -> None:
    """Kiefer and Wolfowitz: with a multiple of four runs, n s'(v) F**-1 s(v) / noise**2 is at most 4 anywhere, and 4 at each speed that is run."""
    own = problem()
    found = design(own, RUNS)
    inverse = np.linalg.inv(static_information(found.speeds, P, own.noise))

    def reach(speeds: Array) -> Array:
        """Runs times s' F**-1 s / noise**2."""
        rows = static_jacobian(speeds, P) / own.noise
        return np.asarray(RUNS * np.einsum("np,pq,nq->n", rows, inverse, rows))

    assert reach(np.geomspace(own.low, own.high, 2000)).max() <= 4 * 1.001
    assert reach(found.speeds) == pytest.approx(4.0, rel=1e-3)
    assert np.unique(found.speeds).size == 4


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0.0, 1.0), min_size=RUNS, max_size=RUNS))
def test_no_other_runs_are_better(where: list[float]) -> None:
    """Any twelve speeds of the range have an information no larger, and an error of v_s no smaller, than those planned; averaged over v_s."""
    own = problem(relative=0.3)
    speeds = own.low * (own.high / own.low) ** np.array(where)
    other = evaluate_design(own, speeds)
    assert loss(own, other) >= loss(own, _PLANNED["all"]) - 0.02
    variance = 2 * np.log(errors_by_v_s(own, speeds, own.nodes)).mean()
    assert variance >= 2 * np.log(errors_by_v_s(own, _PLANNED["v_s"].speeds, own.nodes)).mean() - 0.02


_PLANNED = {aim: design(problem(relative=0.3), RUNS, aim) for aim in ("all", "v_s")}


def test_one_unknown_parameter_has_a_closed_form() -> None:
    """Where all but alpha_2 is known, its runs all go to the fastest speed v, and its error is noise / (sqrt(n) v)."""
    own = problem(prior_information=np.diag([1e14, 1e14, 0.0, 1e14]))
    found = design(own, 9, "alpha_2")
    assert found.speeds == pytest.approx(np.full(9, own.high), rel=1e-6)
    assert found.errors[2] == pytest.approx(own.noise / (3 * own.high), rel=1e-3)


def test_what_is_known_is_added_up() -> None:
    """Standard errors are those of the sum of both informations, and smaller than those of the runs alone; known runs move the design."""
    first = spaced_speeds(problem(), 6, "log")
    own = problem(prior_information=static_information(first, P, problem().noise))
    found = design(own, 6, "v_s")
    together = evaluate_design(problem(), np.concatenate([first, found.speeds]))
    assert found.errors == pytest.approx(together.errors, rel=1e-6)
    assert (found.errors < found.alone).all()
    assert found.errors[3] < evaluate_design(own, design(problem(), 6, "v_s").speeds).errors[3]


def test_an_average_over_v_s_survives_a_poor_estimate() -> None:
    """Where v_s is known to a factor of two only, the averaged design is worse at the estimate, and better where v_s is half of it."""
    averaged, local = design(problem(relative=0.7), RUNS, "v_s"), design(problem(), RUNS, "v_s")
    there = errors_by_v_s(problem(), averaged.speeds, np.array([P.v_s, P.v_s / 2]))
    here = errors_by_v_s(problem(), local.speeds, np.array([P.v_s, P.v_s / 2]))
    assert there[0] > here[0]
    assert there[1] < 0.9 * here[1]


def test_predictions_are_what_simulated_fits_scatter_by() -> None:
    """At little noise the scatter of fits of simulated runs is the predicted standard error of each parameter, within 3 %."""
    own = problem(noise=5e-4 * P.alpha_0)
    speeds = spaced_speeds(own, RUNS, "log")
    assert simulated_errors(own, speeds, 20_000) == pytest.approx(evaluate_design(own, speeds).alone, rel=0.03)


@pytest.mark.parametrize("aim", ["all", "alpha_1"])
def test_the_grid_is_fine_enough(aim: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten times as many speeds to choose from lower no design's criterion by 1 %."""
    own, judged = problem(), velocities._Criterion(problem(), aim)
    usual = judged.value(design(own, RUNS, aim).speeds)
    monkeypatch.setattr(velocities, "CANDIDATES", 10 * velocities.CANDIDATES)
    assert usual <= judged.value(design(own, RUNS, aim).speeds) + 0.01


def test_nodes_lie_about_the_estimate() -> None:
    """Their middle and geometric mean are the estimate; they spread with its error, and all are the estimate where it has none."""
    nodes = nodes_of(P.v_s, 0.3)
    assert nodes[2] == pytest.approx(P.v_s)
    assert np.exp(np.log(nodes).mean()) == pytest.approx(P.v_s)
    assert np.ptp(nodes_of(P.v_s, 0.6)) > 1.5 * np.ptp(nodes)
    assert nodes_of(P.v_s, 0.0) == pytest.approx(np.full(5, P.v_s))


@settings(max_examples=8, deadline=None)
@given(low=st.floats(0.02, 2.0), share=st.floats(1.5, 100.0), count=st.integers(4, 9))
def test_runs_stay_within_their_range(low: float, share: float, count: int) -> None:
    """Every planned speed lies between the slowest and the fastest, and there are as many as were asked for."""
    own = problem(low, low * P.v_s * share)
    found = design(own, count).speeds
    assert found.size == count
    assert own.low <= found.min()
    assert found.max() <= own.high

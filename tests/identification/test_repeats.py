from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.data.slow_loading import Loading
from bristle.estimation.covariance import student
from bristle.identification.dynamic.descent import logarithms
from bristle.identification.dynamic.fit import DynamicSolution, fit_tracking
from bristle.identification.dynamic.problem import dynamic_problem
from bristle.identification.dynamic.uncertainty import parts_of_runs
from bristle.identification.fits import Estimate, RunScatter, TrackingFit, Uncertainty
from bristle.identification.presliding.fit import fit_presliding
from bristle.identification.repeats import (
    clustered,
    scatter_of,
    spreader,
    widened,
    wider_estimate,
    wider_three,
    with_priors_beside,
)
from bristle.identification.static.problem import from_points
from bristle.identification.static.solution import solve_static
from bristle.identification.static.uncertainty import parts_of_runs as parts_of_curves
from bristle.model.parameters import Direction, Lugre, ParameterName

from ..conftest import present
from .conftest import G0, GRIPPER, by_name, codes, curve, error_of, known, moved, tones, value_of, white

ALPHA_0, SIGMA_0 = ParameterName("alpha_0", Direction.BOTH), ParameterName("sigma_0", Direction.BOTH)


def of_runs(values: Sequence[float], error: float = 1.0, freedom: float = 1e6, of_all: float = 1.0) -> RunScatter:
    """Runs that show one parameter, with the same standard error, and that of the fit of all."""
    count, by_run = len(values), {f"run {k}": float(x) for k, x in enumerate(values)}
    found = scatter_of(by_run, np.full(count, error), np.full(count, freedom), of_all, 1e6)
    assert found is not None
    return found


def scattered(widened_by: float = 3.0, count: int = 5) -> RunScatter:
    runs = {f"run {k}": 1.0 for k in range(count)}
    return RunScatter(before=widened_by, widened=widened_by, stretched=1.5 * widened_by, by_run=runs)


def test_the_scatter_is_the_root_of_the_reduced_chi_squared() -> None:
    """Of values 0, 3 and 6 with errors of 2 it is sqrt((9 + 9) / 4 / 2) = 1.5; widened errors leave 1."""
    # an error of the fit of all runs that is as large as their scatter already is not widened again
    x = of_runs([10.0, 13.0, 16.0], 2.0, of_all=2 / 3**0.5)
    assert x.before == pytest.approx(1.5)
    assert x.widened == 1.0
    far = of_runs([10.0, 13.0, 16.0], 0.5, of_all=0.5 / 3**0.5)
    assert [far.before, far.widened] == pytest.approx([6.0, 6.0])
    assert far.by_run == {"run 0": 10.0, "run 1": 13.0, "run 2": 16.0}
    assert far.stretched == pytest.approx(6 * student(2) / student(1e6))
    sure = of_runs([10.0, 13.0, 16.0], 0.5, of_all=4.0)
    assert (sure.widened, sure.stretched) == (1.0, 1.0)
    assert scatter_of({"run 0": 1.0}, np.ones(1), np.ones(1), 1.0, 1.0) is None
    assert scatter_of({}, np.zeros(0), np.zeros(0), 1.0, 1.0) is None
    # 95 % intervals of the mean cover 90 to 98 % of them; unwidened ones cover less than half
    rng, inside, before = np.random.default_rng(1), [], []
    for _ in range(600):
        x = 100 + rng.standard_normal(5) * 10**0.5
        mean, e = float(x.mean()), 5**-0.5
        ends = mean + np.array([-1.96, 1.96]) * e
        low, high = spreader(mean, of_runs(x.tolist(), of_all=e).stretched, "p")(ends)
        inside.append(low < 100 < high)
        before.append(abs(mean - 100) < 1.96 * e)
    assert 0.9 < np.mean(inside) < 0.98
    assert np.mean(before) < 0.55
    # by the scatter and Student's t of k - 1 degrees; open ends stay, none passes zero, the estimate stays inside
    e = Estimate(value=2.0, unit="N*m", standard_error=0.1, interval=(1.8, 2.2))
    reach = scattered().stretched
    spread = spreader(2.0, reach, "alpha_0")
    wide = wider_estimate(e, scattered(), spread)
    assert wide.standard_error == pytest.approx(0.3)
    assert wide.interval == pytest.approx((2 - 0.2 * reach, 2 + 0.2 * reach))
    assert codes(wide.warnings) == ["runs-scatter"]
    far = replace(scattered(), by_run={"near": 1.0, "middle": 1.1, "far": 2.0})
    assert wider_estimate(e, far, spread).warnings[0].numbers["farthest"] == "far"
    three = Uncertainty(
        covariance=(1.8, 2.2), profile=(0.5, np.inf), bootstrap=None, curve=np.array([[1.9, 2.5], [1.0, 1.0]])
    )
    spread_three = wider_three(three, spread)
    assert (spread_three.covariance, spread_three.profile) == (wide.interval, (0.0, np.inf))
    assert spread_three.curve[0] == pytest.approx([2 - 0.1 * reach, 2 + 0.5 * reach])
    low, high = spreader(2.0, reach, "sigma_0", logarithmic=True)(np.array([1.0, 4.0]))
    assert (low * high, high) == pytest.approx((4.0, 2 * 2**reach))


@pytest.mark.slow
def test_an_interval_is_widened_in_one_case_of_a_hundred_by_chance() -> None:
    """Of 4000 sets of five runs that differ by their errors alone 1 % are widened, whether errors are known well or by few degrees of freedom."""
    rng = np.random.default_rng(0)
    sets = rng.standard_normal((4000, 5)) + 10
    all_of_five = 5**-0.5  # of the error of one
    found = [of_runs(x.tolist(), of_all=all_of_five) for x in sets]
    share = np.mean([x.widened > 1 for x in found])
    assert 0.005 < share < 0.016
    spread = np.sqrt(rng.chisquare(20, 4000) / 20)  # of one variance for all runs, known by 4 degrees each
    few = [of_runs(x.tolist(), e, 4.0, e * all_of_five) for x, e in zip(sets, spread, strict=True)]
    assert 0.005 < np.mean([x.widened > 1 for x in few]) < 0.016


def moving(truths: Sequence[Lugre[float]]) -> DynamicSolution:
    v = tones(np.arange(0, 4, 2e-3))
    records = [moved(v, 2e-3, p, 1e-4, seed=k, file=f"run {k}") for k, p in enumerate(truths)]
    problem = dynamic_problem(records, ("both",), ("inertia",), 1, None)
    return fit_tracking(problem, by_name(truths[0]), "revolute", search=False)


def test_the_error_by_runs_is_their_scatter() -> None:
    """Of six runs whose sigma_0 differs by 2 %, the error of sigma_0 is that of their scatter; equal runs widen nothing."""
    stiff = [1.0, 1.02, 0.98, 1.01, 0.99, 1.0]
    solved = moving([GRIPPER._replace(sigma_0=x * GRIPPER.sigma_0) for x in stiff])
    e, logarithmic = solved.fit.parameters[SIGMA_0], logarithms(solved.fit.names)
    x = clustered(*parts_of_runs(solved), solved.fit.parameters, 1e6, logarithmic)[SIGMA_0]
    assert list(x.by_run) == [f"run {k}" for k in range(6)]
    assert list(x.by_run.values()) == pytest.approx([k * GRIPPER.sigma_0 for k in stiff], rel=5e-3)
    assert x.before * error_of(e) == pytest.approx(np.std(stiff, ddof=1) / 6**0.5 * GRIPPER.sigma_0, rel=0.1)
    same = moving([GRIPPER] * 3)
    found = clustered(*parts_of_runs(same), same.fit.parameters, 1e6, logarithms(same.fit.names))
    assert len(found) >= 5
    assert not any(one.widened > 1 for one in found.values())
    assert not clustered(*parts_of_runs(moving([GRIPPER])), same.fit.parameters, 1e6)
    # the errors of the fit and of the joint covariance grow alike, the value stays, and the sentence says by how much
    fit = moving([GRIPPER] * 6).fit
    wide = widened(fit, {SIGMA_0: scattered()}, ("sigma_0",))
    e, before = wide.parameters[SIGMA_0], fit.parameters[SIGMA_0]
    assert e.value == before.value
    assert error_of(e) == pytest.approx(3 * error_of(before))
    row = fit.names.index(SIGMA_0)
    assert wide.covariance[row, row] == pytest.approx(9 * fit.covariance[row, row])
    assert "runs-scatter" in codes(e.warnings)
    # a prior that says nothing leaves all of it; one that says as much as the runs leaves the part that C + W (F C F - C) W' has
    fit = moving([GRIPPER]).fit
    scatter = {name: scattered() for name in fit.names}
    assert [x.widened for x in with_priors_beside(scatter, fit, fit).values()] == pytest.approx([3.0] * len(fit.names))

    def joint(share: float) -> TrackingFit:
        return replace(fit, covariance=fit.covariance * share)

    half = with_priors_beside(scatter, fit, joint(0.5)).values()
    assert [x.widened for x in half] == pytest.approx([(1 + 0.5 * 8) ** 0.5] * len(fit.names))
    none = with_priors_beside(scatter, fit, joint(1e-9)).values()
    assert [(x.widened, x.stretched) for x in none] == [pytest.approx((1.0, 1.0))] * len(fit.names)
    blind = fit.covariance.copy()
    blind[0], blind[:, 0] = np.nan, np.nan
    rest = with_priors_beside(scatter, replace(fit, covariance=blind), fit)
    assert list(rest) == list(fit.names[1:])


def test_curves_of_points_that_differ_hold_the_mean(speeds: Array) -> None:
    """Of five runs that each give a whole curve, whose Coulomb torques scatter by 5 %, 88 to 99 % of the intervals hold the mean."""
    held = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        torques = [
            curve(speeds, GRIPPER._replace(alpha_0=x * GRIPPER.alpha_0)) + 5e-5 * rng.standard_normal(speeds.size)
            for x in 1 + 0.05 * rng.standard_normal(5)
        ]
        runs = [(f"run {k}", from_points(speeds, T, ("both",))) for k, T in enumerate(torques)]
        core = solve_static(
            from_points(np.tile(speeds, 5), np.concatenate(torques), ("both",)), FitOptions(), "revolute"
        )
        e, v_s = core.parameters[ALPHA_0], {ParameterName("v_s", Direction.BOTH)}
        x = clustered(*parts_of_curves(core, runs), core.parameters, core.freedom, v_s, independent=True)[ALPHA_0]
        assert list(x.by_run) == [name for name, _ in runs]
        low, high = spreader(value_of(e), x.stretched, "alpha_0")(np.array(present(e.interval)))
        held.append(low < GRIPPER.alpha_0 < high)
    assert 0.88 <= np.mean(held) <= 0.99
    # runs whose stiffness differs by 10 % widen sigma_0, which is said; equal runs do not: the error of g0 is common
    level = known(G0, 1e-4)
    for shares in ((1.0, 1.1, 0.9, 1.05), (1.0, 1.0, 1.0, 1.0)):
        own = [loading(x * GRIPPER.sigma_0, f"run {k}", 2e-5, k) for k, x in enumerate(shares)]
        fit = fit_presliding(own, level, None, "revolute")
        x, differ = fit.repeats["sigma_0"], shares[1] > 1
        assert list(x.by_run.values()) == pytest.approx([s * GRIPPER.sigma_0 for s in shares], rel=0.02)
        assert (x.widened > 1) == differ
        assert ("runs-scatter" in codes(fit.sigma_0.warnings)) == differ
        assert fit.uncertainty["sigma_0"].covariance == pytest.approx(fit.sigma_0.interval)


def loading(stiffness: float, file: str, noise: float, seed: int) -> Loading:
    """A slow loading of 400 samples without counts."""
    torque = np.linspace(0, 0.75 * G0, 400)
    y = -G0 / stiffness * np.log(1 - torque / G0) + white(400, noise, seed)
    return Loading(
        file=file, start=0, direction="+", time=np.linspace(0, 10, 400), displacement=y, torque=torque, quantum=0.0,
        edge_displacement=np.zeros(0), edge_torque=np.zeros(0), breakaway=None, held=float(torque.max()),
    )  # fmt: skip  # a list of values

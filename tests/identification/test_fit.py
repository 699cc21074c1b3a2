import numpy as np
import pytest
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.data.experiment.schema import FitOptions
from bristle.identification.fits import StaticFit
from bristle.identification.static.fit import PointInfo, estimate_static, fit_static
from bristle.identification.static.problem import from_points
from bristle.model.parameters import Lugre

from .conftest import GRIPPER, codes, curve, holds, white

STATIC = ("alpha_0", "alpha_1", "alpha_2", "v_s")


def segments_of(velocity: Array, torque: Array, stick_slip: NDArray[np.bool_] | None = None) -> tuple[Segment, ...]:
    return tuple(
        Segment(
            file=f"run_{k}.csv", start=0, stop=100, velocity=v, torque=T, standard_error=None, accepted=True,
            stick_slip=stick_slip is not None and bool(stick_slip[k]),
        )
        for k, (v, T) in enumerate(zip(velocity.tolist(), torque.tolist(), strict=True))
    )  # fmt: skip  # a list of values


def points(velocity: Array, torque: Array, stick_slip: NDArray[np.bool_] | None = None) -> StaticFit:
    where = PointInfo(segments=segments_of(velocity, torque, stick_slip))
    return fit_static(from_points(velocity, torque, ("+",)), FitOptions(), "revolute", where)[0]["+"]


@pytest.mark.slow
def test_intervals_cover_the_truth_as_often_as_they_say(gripper: Lugre[float], speeds: Array) -> None:
    """95 % intervals cover each true parameter in 95 % of 300 repetitions, within three binomial deviations; `benchmarks/coverage.py` does 1000."""
    rng = np.random.default_rng(0)
    hits = dict.fromkeys(STATIC, 0)
    for _ in range(300):
        torque = curve(speeds, gripper) + 0.01 * gripper.alpha_0 * rng.standard_normal(speeds.size)
        found = estimate_static(from_points(speeds, torque, ("+",)), FitOptions(), "revolute")
        for name in STATIC:
            hits[name] += holds(found[name].interval, getattr(gripper, name))
    assert all(abs(count / 300 - 0.95) < 3 * np.sqrt(0.95 * 0.05 / 300) for count in hits.values()), hits


def test_peaks_are_found_where_they_are(speeds: Array, gripper: Lugre[float]) -> None:
    """From Coulomb and viscous friction alone, alpha_1 and v_s do not exist and say why; the other two are there and right."""
    torque = 0.02 + 0.04 * speeds + white(speeds.size, 1e-4, 3)
    fit = points(speeds, torque)
    assert fit.outcome.code == "static-no-stribeck"
    for name in ("alpha_1", "v_s"):
        estimate = fit.parameters[name]
        assert estimate.value is None
        assert estimate.warnings[0].code == "no-stribeck"
    for name, true in (("alpha_0", 0.02), ("alpha_2", 0.04)):
        assert holds(fit.parameters[name].interval, true)
    # a significant concave bend over the whole range, as worn or lubricated drives show it, is not fitted by a Stribeck term
    velocity = np.linspace(0.01, 0.12, 40)
    torque = 20 + 200 * velocity - 400 * velocity**2 + white(40, 0.02, 4)
    fit = points(velocity, torque)
    assert fit.outcome.code == "static-no-stribeck"
    (refused,) = (warning for warning in fit.warnings if warning.code == "no-stribeck")
    assert refused.numbers["why"].code in {"bend", "like-noise"}
    # a curve that rises at every speed still has its Stribeck term where the data show it: alpha_2 > 0.86 alpha_1 / v_s is no reason to
    # drop it
    p = gripper._replace(alpha_2=gripper.alpha_1 / gripper.v_s)
    assert (np.diff(curve(speeds, p)) > 0).all()
    fit = points(speeds, curve(speeds, p) + white(speeds.size, 2e-5, 6))
    assert fit.outcome.code == "static-converged"
    assert fit.parameters["v_s"].value == pytest.approx(p.v_s, rel=0.1)
    # with flagged points the warning has the fit without them, from the other points alone
    flags = speeds < 0.02
    torque = curve(speeds, gripper) + white(speeds.size, 1e-4, 6)
    fit = points(speeds, torque, flags)
    alone = points(speeds[~flags], torque[~flags])
    (warning,) = (w for w in fit.warnings if w.code == "stick-slip-points")
    assert warning.numbers["alpha_0"] == pytest.approx(alone.parameters["alpha_0"].value, rel=1e-5)
    # ten points at one speed cannot tell Coulomb from viscous friction, and say so; together they are known
    velocity = np.full(10, 0.2)
    fit = points(velocity, curve(velocity, gripper) + white(10, 1e-5, 8))
    assert all("one-speed-only" in codes(fit.parameters[name].warnings) for name in ("alpha_0", "alpha_2"))
    assert fit.parameters["alpha_0"].value == pytest.approx(float(curve(np.array([0.2]), gripper)[0]), rel=1e-3)
    assert fit.parameters["alpha_2"].value == 0
    # with no speed below v_s the Stribeck term is dropped, or its interval is open and a warning asks for slower speeds
    velocity = np.geomspace(1.2 * gripper.v_s, 0.8, 14)
    torque = curve(velocity, gripper) + white(14, 2e-5, 8)
    fit = points(velocity, torque)
    if fit.parameters["v_s"].value is None:
        assert fit.outcome.code == "static-no-stribeck"
    else:
        assert "few-below-v-s" in codes(fit.warnings)
    # where only stick-slip points show the Stribeck region, the outcome itself says that the term rests on them
    v = np.concatenate([np.geomspace(0.01, 0.1, 6), np.linspace(0.3, 1.2, 12)])
    torque = curve(v, gripper) + white(v.size, 1e-4, 1)
    fit = points(v, torque, v < 0.2)
    assert fit.parameters["alpha_1"].value is not None
    assert any("alpha_0" in w.numbers for w in fit.warnings if w.code == "stick-slip-points")
    assert fit.outcome.code == "static-stick-slip"


@pytest.mark.parametrize(
    ("count", "outcome"), [(1, "static-too-few"), (2, "static-too-few"), (4, "static-no-stribeck")]
)
def test_few_points_give_few_parameters(count: int, outcome: str, gripper: Lugre[float]) -> None:
    """Never more parameters than the points carry: none from two, two from four, each absence with its reason."""
    velocity = np.linspace(0.05, 0.5, count)
    fit = points(velocity, curve(velocity, gripper))
    assert fit.outcome.code == outcome
    assert all(estimate.value is not None or estimate.warnings for estimate in fit.parameters.values())


def test_units_directions_and_checks_of_a_fit(speeds: Array, gripper: Lugre[float]) -> None:
    """The same fit of a prismatic joint is in N, N*s/m and m/s."""
    torque = curve(speeds, GRIPPER) + white(speeds.size, 1e-5, 10)
    found = estimate_static(from_points(speeds, torque, ("both",)), FitOptions(), "prismatic")
    assert [found[name].unit for name in STATIC] == ["N", "N", "N*s/m", "m/s"]
    # where two directions share a regressor, what is left without the points that stick is each direction's own, not the other's
    v = np.concatenate([speeds, -speeds])
    torque = np.concatenate([curve(speeds, gripper), -0.5 * curve(speeds, gripper)])
    torque = torque + white(v.size, 1e-5, 2)
    q = np.random.default_rng(3).uniform(0.0, 3.0, v.size)
    problem = from_points(
        v, torque + 0.01 * np.sin(q), ("+", "-"), {"gravity_sin": np.sin(q), "gravity_cos": np.cos(q)}
    )
    where = PointInfo(segments=segments_of(v, torque, np.arange(v.size) % 5 == 1))
    fits, _ = fit_static(problem, FitOptions(), "revolute", where)
    (warning,) = (w for w in fits["shared"].warnings if w.code == "stick-slip-points")
    for d, share in (("+", 1.0), ("-", 0.5)):
        assert warning.numbers[f"alpha_0{d}"] == pytest.approx(share * gripper.alpha_0, rel=0.1)
    assert {"gravity_sin", "gravity_cos"} <= warning.numbers.keys()
    # without a Stribeck term the full fit has none either, and finds the cost that the reported residuals have
    torque = 0.02 + 0.04 * speeds + white(speeds.size, 1e-4, 3)
    options = FitOptions()
    fits, checks = fit_static(from_points(speeds, torque, ("+",)), options, "revolute", PointInfo())
    assert fits["+"].outcome.code == "static-no-stribeck"
    assert checks["+"].cost_grid == pytest.approx(float(fits["+"].residuals @ fits["+"].residuals), rel=1e-12)
    assert checks["+"].agrees
    assert set(map(str, checks["+"].parameters)) == {"alpha_0+", "alpha_2+"}
    # Coulomb and viscous friction asked for: the outcome says so; where the data show a peak, alpha_0 and alpha_2 are cautioned, else not
    noise = white(speeds.size, 1e-4, 4)
    for p, shown in ((gripper, True), (gripper._replace(alpha_1=0.0), False)):
        problem = from_points(speeds, curve(speeds, p) + noise, ("+",))
        fit = fit_static(problem, FitOptions(law="coulomb-viscous"), "revolute", PointInfo())[0]["+"]
        assert fit.outcome.code == "static-as-asked"
        assert fit.parameters["alpha_1"].value is None
        assert ("peak-left-out" in codes(fit.warnings)) == shown
        for name in ("alpha_0", "alpha_2"):
            assert ("takes-up-peak" in codes(fit.parameters[name].warnings)) == shown

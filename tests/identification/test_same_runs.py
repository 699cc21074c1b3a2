"""A static fit of moving runs beside LuGre's of the same runs: where the two differ, the static error spans both."""

from dataclasses import replace

import numpy as np
import pytest

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.findings import CRITICAL, NOTE, Finding, Severity
from bristle.identification.dynamic.fit import fit_tracking
from bristle.identification.dynamic.problem import dynamic_problem
from bristle.identification.fits import Estimate, StaticFit, TrackingFit
from bristle.identification.same_runs import beside_moving, is_superseded
from bristle.identification.static.fit import PointInfo, fit_static
from bristle.identification.static.problem import from_records
from bristle.model.parameters import INERTIA, Direction, ParameterName, unit
from bristle.model.rollout import rollout

from ..names import parse
from .conftest import GRIPPER

STEP, J = 1e-3, 1.27e-3
CONVERGED = Finding("converged", NOTE, "The fit converged.")


def moving(scale: float) -> Record:
    """A run of the gripper, fast or slow."""
    t = np.arange(0, 8, STEP)
    lines = ((0.25, 0.3), (0.06, 1.3), (0.04, 3.1), (0.02, 7.0), (0.01, 12.0))
    v: Array = scale * np.sum([a * np.sin(2 * np.pi * f * t + k) for k, (a, f) in enumerate(lines)], axis=0)
    a, noise = np.gradient(v, t), 2e-4 * np.random.default_rng(0).standard_normal(t.size)
    return Record(
        file="run.csv",
        time=t,
        velocity=v,
        acceleration=a,
        torque=rollout(v, STEP, GRIPPER, None).torque + J * a + noise,
    )


def test_an_inertia_that_presliding_spoils_is_as_unsure_as_it_is_wrong() -> None:
    """A static inertia more than three standard errors off has, beside LuGre's, which is right, an interval that holds the truth, and a note."""
    run = moving(5.0)
    start = {ParameterName(n, Direction.BOTH): x for n, x in GRIPPER._asdict().items()} | {INERTIA: J}
    lugre = fit_tracking(dynamic_problem([run], ("both",), ("inertia",), 5, None), start, "revolute", starts=1).fit
    problem, _, _ = from_records([run], ("both",), ("inertia",), 5)
    static, _ = fit_static(problem, FitOptions(), "revolute", PointInfo())
    before, after = (fits["both"].parameters["inertia"] for fits in (static, beside_moving(static, lugre)))
    assert before.value is not None
    assert before.standard_error is not None
    assert abs(before.value - J) > 3 * before.standard_error
    assert after.value == before.value
    assert after.interval is not None
    assert after.interval[0] < J < after.interval[1]
    (said,) = after.warnings
    assert said.code == "widened-to-moving"
    assert said.numbers["value"] == pytest.approx(J, rel=1e-3)


def test_a_poorer_law_of_the_same_runs_warns_of_nothing() -> None:
    """Where LuGre's fit describes the runs, the static fit has no caution but LuGre's, intervals that hold its values, and no unseen peak."""
    run, flat = moving(5.0), GRIPPER._replace(alpha_1=0.0)
    assert run.velocity is not None
    assert run.acceleration is not None
    left = np.asarray(run.torque) - rollout(run.velocity, STEP, GRIPPER, None).torque
    for truth in (GRIPPER, flat):
        records = [replace(run, torque=left + rollout(run.velocity, STEP, truth, None).torque)]
        start = {ParameterName(n, Direction.BOTH): x for n, x in GRIPPER._asdict().items()} | {INERTIA: J}
        lugre = fit_tracking(
            dynamic_problem(records, ("both",), ("inertia",), 5, None), start, "revolute", starts=2
        ).fit
        problem, _, _ = from_records(records, ("both",), ("inertia",), 5)
        fit = beside_moving(fit_static(problem, FitOptions(), "revolute", PointInfo())[0], lugre)["both"]
        said = {w for w in fit.all_warnings() if w.severity is not Severity.NOTE}
        assert said <= set(lugre.all_warnings())
        assert fit.outcome.code == "static-superseded"
        for name, e in fit.parameters.items():
            known = {n.name: x.value for n, x in lugre.parameters.items()}[name]
            if known is None:
                assert e.value is None
            if e.value is not None:
                assert e.interval is not None
                assert known is not None
                assert e.interval[0] < known < e.interval[1]
        assert fit.covariance.shape == (len(fit.names), len(fit.names))


def estimate(name: str, value: float | None, error: float) -> Estimate:
    """One parameter with a normal interval."""
    ends = None if value is None else (value - 1.96 * error, value + 1.96 * error)
    return Estimate(value=value, unit=unit(name), standard_error=error, interval=ends)


def static_fit(**values: tuple[float | None, float]) -> StaticFit:
    """Both directions as one, with these values and standard errors."""
    parameters = {name: estimate(name, *x) for name, x in values.items()}
    names = tuple(name for name, (value, _) in values.items() if value is not None)
    covariance = np.diag([values[name][1] ** 2 for name in names])
    return StaticFit(
        direction="both", parameters=parameters, rms=1.0, relative_error=1.0, n=9, outcome=CONVERGED, names=names, covariance=covariance
    )  # fmt: skip  # a list of values


def lugre_fit(**values: tuple[float | None, float]) -> TrackingFit:
    """The same of all parameters."""
    parameters = {parse(name): estimate(name, *x) for name, x in values.items()}
    return TrackingFit(
        parameters=parameters, rms=1.0, relative_error=1.0, n=9, outcome=CONVERGED, starts=1, reached=1, condition=9.0
    )  # fmt: skip  # a list of values


def widened(static: StaticFit, lugre: TrackingFit) -> set[str]:
    """Which parameters get a wider error; the others stay as they are, bit by bit."""
    fit = beside_moving({"both": static}, lugre)["both"]
    wider = {name for name, e in fit.parameters.items() if e is not static.parameters[name]}
    for k, name in enumerate(static.names):
        error = fit.parameters[name].standard_error
        assert error is not None
        assert fit.covariance[k, k] == pytest.approx(error**2)
        assert (error > (static.parameters[name].standard_error or 0.0)) is (name in wider)
    return wider


def test_only_what_differs_is_widened() -> None:
    """A difference counts beyond LuGre's chance and the static interval; where LuGre fails, or the static law alone has a peak, none does."""
    own = static_fit(alpha_0=(1.0, 0.01), alpha_2=(2.0, 0.01), inertia=(3.0, 0.01))
    assert widened(own, lugre_fit(alpha_0=(1.0, 0.01), alpha_2=(2.02, 0.01), inertia=(3.1, 0.01))) == {"inertia"}
    assert widened(own, lugre_fit(inertia=(3.1, 0.04))) == set()
    assert widened(own, lugre_fit(inertia=(3.01, 1e-4))) == set()
    assert widened(own, lugre_fit(inertia=(None, 1e-4))) == set()
    assert widened(own, lugre_fit(alpha_0=(1.2, 0.01), alpha_1=(0.1, 0.01), inertia=(3.0, 0.01))) == {"alpha_0"}
    failed = lugre_fit(inertia=(3.1, 0.01))
    poor = replace(failed, warnings=(Finding("unexplained", CRITICAL, "The error is 30 %."),))
    assert widened(own, failed) == {"inertia"}
    better = replace(lugre_fit(alpha_0=(1.0, 0.01), inertia=(3.0, 0.01)), relative_error=0.1)
    assert is_superseded(beside_moving({"both": own}, better)["both"])
    nothing = replace(lugre_fit(alpha_0=(None, 0.01), inertia=(3.0, 0.01)), relative_error=0.1)
    assert beside_moving({"both": own}, nothing) == {"both": own}
    assert widened(own, poor) == set()
    assert beside_moving({"both": own}, None) == {"both": own}
    peaked = static_fit(alpha_0=(1.0, 0.01), alpha_1=(0.5, 0.01), inertia=(3.0, 0.01))
    assert widened(peaked, lugre_fit(alpha_0=(1.4, 0.01), alpha_1=(None, 0.01), inertia=(3.1, 0.01))) == {"inertia"}


def test_one_in_a_thousand_is_widened_by_chance() -> None:
    """Where both laws are right, the two differ by less than LuGre's standard error: of 2000 fits of six parameters at most six have one widened."""
    rng, hits = np.random.default_rng(0), 0
    names = ("alpha_0", "alpha_2", "inertia", "offset", "gravity_sin", "gravity_cos")
    for _ in range(2000):
        apart = rng.standard_normal(6)
        own = static_fit(**dict.fromkeys(names, (5.0, 0.5)))
        hits += bool(widened(own, lugre_fit(**{n: (5.0 + x, 1.0) for n, x in zip(names, apart, strict=True)})))
    assert hits <= 6

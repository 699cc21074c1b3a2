"""A static fit of moving runs beside LuGre's of the same runs, which is the one to use."""

from dataclasses import replace

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.identification.dynamic.fit import fit_tracking
from bristle.identification.dynamic.problem import dynamic_problem
from bristle.identification.same_runs import beside_moving
from bristle.identification.static.fit import PointInfo, fit_static
from bristle.identification.static.problem import from_records
from bristle.model.parameters import INERTIA, Direction, ParameterName
from bristle.model.rollout import rollout

from ..names import parse
from .conftest import GRIPPER

STEP, J = 1e-3, 1.27e-3


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


def test_a_poorer_law_of_the_same_runs_says_so_and_warns_of_nothing() -> None:
    """Where LuGre's fit knows friction, the static fit keeps its numbers and says which to use; beside one that knows none it is as it was."""
    run = moving(5.0)
    start = {ParameterName(n, Direction.BOTH): x for n, x in GRIPPER._asdict().items()} | {INERTIA: J}
    lugre = fit_tracking(dynamic_problem([run], ("both",), ("inertia",), 5, None), start, "revolute", search=False).fit
    problem, _, _ = from_records([run], ("both",), ("inertia",), 5)
    static, _ = fit_static(problem, FitOptions(), "revolute", PointInfo())
    fit = beside_moving(static, lugre)["both"]
    assert fit.outcome.code == "static-superseded"
    assert fit.outcome.numbers["other"] == lugre.relative_error
    assert fit.parameters == static["both"].parameters
    assert fit.warnings == ()
    alpha_0 = lugre.parameters[parse("alpha_0")]
    blind = replace(lugre, parameters={parse("alpha_0"): replace(alpha_0, value=None)})
    assert beside_moving(static, blind) == beside_moving(static, None) == static
    nothing = {"both": replace(static["both"], relative_error=None)}
    assert beside_moving(nothing, lugre) == nothing

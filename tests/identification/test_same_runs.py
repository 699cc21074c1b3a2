"""A static fit of moving runs beside LuGre's of the same runs, which is the one to use."""

from dataclasses import replace

import numpy as np

from bristle.data.experiment.schema import FitOptions
from bristle.identification.same_runs import beside_moving
from bristle.identification.static.fit import PointInfo, fit_static
from bristle.identification.static.problem import from_records

from ..names import parse
from .conftest import fitted, moved, posed, tones


def test_a_poorer_law_of_the_same_runs_says_so_and_warns_of_nothing() -> None:
    """Where LuGre's fit knows friction, the static fit keeps its numbers and says which to use; beside one that knows none it is as it was."""
    run = moved(5.0 * tones(np.arange(0, 8, 1e-3)), 1e-3, noise=2e-4)
    lugre = fitted(posed(run, decimation=5))
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

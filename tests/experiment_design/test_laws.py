from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle.errors import InputError
from bristle.identification.fisher import static_jacobian
from bristle.questions.experiment_design import excitation
from bristle.questions.experiment_design.plan import Plan, check_plan
from bristle.questions.experiment_design.start import start_of
from bristle.questions.experiment_design.velocities import DesignProblem, design, evaluate_design

from ..laws import DRAG, EXPONENT, OUTSIDE, motion, points, registered, truth_of
from ..pages import page_text
from .simulated_fits import simulated_errors, spaced_speeds

OWN = {DRAG: "alpha_3", EXPONENT: "delta", OUTSIDE: "blunt"}


@pytest.fixture(autouse=True, scope="module")
def known() -> Iterator[None]:
    """The law from outside is known, and few motions are tried."""
    with registered(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(excitation, "TRIES", 3)
        patch.setattr(excitation, "STEPS", 12)
        yield


@pytest.fixture(scope="module", params=OWN)
def plan(request: pytest.FixtureRequest) -> Plan:
    return bristle.plan(motion(request.param))


def problem(law: str) -> DesignProblem:
    p = truth_of(law)
    size = len(p.law.shape_parameters) + len(p.law.coefficients) + 3
    nothing = np.zeros((size, size))
    return DesignProblem(p=p, nodes=np.full(5, p.v_s), prior_information=nothing, noise=1e-4, low=0.015, high=0.8)


def test_the_laws_own_parameter_is_planned_for(plan: Plan) -> None:
    """Each part of the plan tells no less of it than before, all of it more; tables have it, and v_end is in none."""
    own = OWN[plan.joint.law.name]
    k = [str(name) for name in plan.start.names].index(own)
    errors = [plan.standard_errors[part][k] for part in ("now", "with velocities", "with loading", "with motion")]
    assert np.isfinite(errors).all()
    assert (np.diff(errors) <= 1e-9 * errors[0]).all()
    assert errors[-1] < 0.9 * errors[0]
    assert "v_end" not in {name.name for name in plan.start.names}
    assert any(row.startswith(own) for row in plan.to_frame()["parameter"])
    # the scatter of fits under the law is the prediction within a fifth, for planned and for spaced runs
    for x in plan.velocities:
        own, count = (
            replace(x.problem, prior_information=np.zeros_like(x.problem.prior_information)),
            x.chosen.speeds.size,
        )
        spaced = (spaced_speeds(own, count, kind) for kind in ("log", "even"))
        for speeds in (design(own, count, x.chosen.aim).speeds, *spaced):
            assert simulated_errors(own, speeds) == pytest.approx(evaluate_design(own, speeds).alone, rel=0.2)


@pytest.mark.parametrize("plan", [OUTSIDE], indirect=True)
def test_the_page_has_the_laws_own_parameter(plan: Plan, tmp_path: Path) -> None:
    """Its symbol stands there, also of a law from outside."""
    assert "β" in page_text(bristle.report_of(plan).write(tmp_path / "page"))


@pytest.mark.parametrize("law", OWN)
def test_runs_planned_for_the_laws_own_parameter_beat_spaced_ones(law: str) -> None:
    """Ten runs that are c-optimal for it give it a smaller error than ten spaced ones, and than the D-optimal ones."""
    own, k = problem(law), problem(law).names.index(OWN[law])
    planned = design(own, 10, OWN[law])
    others = [design(own, 10), *(evaluate_design(own, spaced_speeds(own, 10, kind)) for kind in ("log", "even"))]
    assert planned.alone[k] < min(x.alone[k] for x in others)
    # the derivative of steady torque by each parameter that is estimated is its central difference, to 1e-6
    p, v = truth_of(law), np.geomspace(0.01, 1.2, 30)
    found = static_jacobian(v, p)
    for k, name in enumerate(problem(law).names):
        x = getattr(p, name)
        up, down = (bristle.friction(v, p._replace(**{name: x * (1 + h)})) for h in (1e-5, -1e-5))
        difference = (up - down) / (2e-5 * x)
        assert np.linalg.norm(difference - found[:, k]) <= 1e-6 * np.linalg.norm(found[:, k])


def test_what_is_no_parameter_of_the_joints_law_is_refused() -> None:
    """Before the law is known any law's parameter counts; then its own alone, and v_end never; it takes as many runs as parameters."""
    check_plan(12, "alpha_3")
    for aim in ("v_end", "stiffness"):
        with pytest.raises(InputError, match="as what to plan for"):
            check_plan(12, aim)
    with pytest.raises(InputError, match="expected one of alpha_0"):
        bristle.plan(points(EXPONENT), aim="alpha_3")
    with pytest.raises(InputError, match="expected 5 to 1000"):
        bristle.plan(points(DRAG), velocities=4)
    # without a peak all of it is a guess, its shape in the middle of where it is looked for, which is said
    fit = points(EXPONENT)
    static = fit.joint.static["both"]
    none = {
        name: replace(e, value=None) for name, e in static.parameters.items() if name in ("alpha_1", "v_s", "delta")
    }
    bare = replace(fit.joint, static={"both": replace(static, parameters={**static.parameters, **none})})
    start = start_of(fit.measured, bare, bristle.plan(fit, velocities=5).limits)
    assert {name.name for name in start.guessed} == {"alpha_1", "v_s", "delta", "sigma_0", "sigma_1"}
    assert start.sets.positive._asdict()["delta"] == pytest.approx(np.sqrt(0.5 * 4.0))
    (shape,) = (x for x in start.assumptions if x.numbers.get("name") == "delta")
    assert str(shape).endswith("in the middle of where it is looked for.")

from dataclasses import replace

import numpy as np
import pytest

from bristle.findings import Finding, Severity
from bristle.identification.fits import Estimate, StaticFit, TrackingFit
from bristle.identification.results import Accuracy, Joint
from bristle.identification.shared_findings import not_shown
from bristle.identification.verdict import Trust, other_warnings, value_warnings, verdict
from bristle.model.parameters import ParameterName

from ..names import parse
from ..simulation.joints import GRIPPER, joint, tracked, unseen, values_of

CRITICAL = Finding("stages-do-not-fit", Severity.CRITICAL, "The stages contradict each other.")
CAUTION = Finding("not-passive", Severity.CAUTION, "The model can feed energy back in direction +.")
WORTH = Finding("friction-drifts", Severity.CAUTION, "Friction grows.", effect={"torque": 0.1})
NOTE = Finding("correlated", Severity.NOTE, "Residuals are correlated.")
OUT_OF_STEPS = Finding(
    "out-of-steps", Severity.CRITICAL, "The fit reached its limit of iterations before it converged."
)
NOT_CONVERGED = Finding("not-converged", Severity.CRITICAL, "The fit did not converge; it gives no estimates.")


def whole(*warnings: Finding) -> TrackingFit:
    """A fit that knows every parameter, with warnings about it."""
    return tracked(values_of(GRIPPER), warnings=warnings)


def said(fit: TrackingFit, name: str, *warnings: Finding) -> TrackingFit:
    own = {parse(name): replace(fit.parameters[parse(name)], warnings=warnings)}
    return replace(fit, parameters={**fit.parameters, **own})


def static(*warnings: Finding) -> StaticFit:
    """A static fit of direction +, of which nothing is shown beside a moving fit that knows all."""
    estimate = Estimate(value=1.0, unit="N*m")
    return StaticFit(
        direction="+", parameters={"alpha_0": estimate}, rms=None, relative_error=None, n=9,
        outcome=Finding("static-converged", Severity.NOTE, "Converged."), warnings=warnings,
    )  # fmt: skip  # a list of values


@pytest.mark.parametrize(
    ("own", "trust", "reason"),
    [
        pytest.param(joint(whole()), Trust.USE, None, id="nothing is said"),
        pytest.param(joint(whole(NOTE)), Trust.USE, None, id="a note"),
        pytest.param(joint(whole(CAUTION, NOTE)), Trust.USE, None, id="a caution about the fit"),
        pytest.param(joint(whole(), warnings=(CAUTION,)), Trust.USE, None, id="a caution about the joint"),
        pytest.param(joint(said(whole(), "v_s-", CAUTION)), Trust.USE, None, id="a caution about a value"),
        pytest.param(joint(whole(CAUTION, CRITICAL)), Trust.DO_NOT_USE, CRITICAL, id="something critical, behind a caution"),
        pytest.param(joint(whole(), static={"+": static(CRITICAL)}), Trust.USE, None, id="a fit whose values are not shown"),
        pytest.param(joint(whole(CRITICAL), joint_fit=whole()), Trust.USE, None, id="the moving runs alone, beside a joint fit"),
        pytest.param(
            joint(replace(whole(), outcome=OUT_OF_STEPS)), Trust.DO_NOT_USE, OUT_OF_STEPS, id="how the fit ended",
        ),
    ],
)  # fmt: skip  # a table
def test_the_weightiest_warning_about_the_values_decides(own: Joint, trust: Trust, reason: Finding | None) -> None:
    """Critical: do not use; a caution, a note, or a warning about a fit that gives no value: use."""
    assert verdict(own) == (trust, reason)
    counted = (*value_warnings(own), *other_warnings(own))
    assert len(counted) == len(set(counted))


def test_causes_of_a_verdict() -> None:
    """Of a fit that leaves a pattern, critical, and of what makes it, a caution, the cause is the reason; both stand among the findings."""
    size = Finding("unexplained", Severity.CRITICAL, "The relative error is 40 %.")
    cause = Finding("reversals-left", Severity.CAUTION, "About reversals the fit leaves more.")
    own = joint(whole(size, CAUTION, cause))
    assert verdict(own) == (Trust.DO_NOT_USE, cause)
    assert {size, cause} <= set(value_warnings(own))
    assert verdict(joint(whole(size, CAUTION))).reason == size
    # what no stage shows is no warning, nor what is said of it; what another stage shows is neither
    fit = unseen(
        whole(*not_shown(map(parse, ("alpha_0+", "sigma_0+", "sigma_1+")))),
        {"alpha_0+": 1.0, "sigma_0+": 1.0, "sigma_1+": 1.0},
    )
    for name in ("alpha_0+", "sigma_0+", "sigma_1+"):
        fit = said(
            fit,
            name,
            Finding("at-bound", Severity.CAUTION, "At its physical bound of zero."),
            Finding("unseen-far", Severity.NOTE, "Not identifiable from this motion."),
        )
    own = joint(fit, static={"+": static()})
    assert value_warnings(own) == ()
    # a Coulomb friction of zero, as of a set-up that takes all of it up, is no friction vs velocity
    fit = whole(CAUTION)
    zero = {n: replace(e, value=0.0) if n.name == "alpha_0" else e for n, e in fit.parameters.items()}
    found = verdict(joint(replace(fit, parameters=zero)))
    assert (found.trust, found.reason and found.reason.code) == (Trust.DO_NOT_USE, "no-curve")
    # with the weightiest reason that there is, how its fit ended too; nothing known at all has none
    nothing: dict[ParameterName, Estimate] = {n: replace(e, value=None) for n, e in whole().parameters.items()}
    own = joint(replace(whole(), parameters=nothing, outcome=NOT_CONVERGED))
    assert verdict(replace(own, warnings=(CAUTION,))) == (Trust.DO_NOT_USE, NOT_CONVERGED)
    assert verdict(replace(own, tracking=None)) == (Trust.DO_NOT_USE, None)


@pytest.mark.parametrize(
    ("band", "apart", "warnings", "trust", "code"),
    [
        (9.9, 0.0, (CAUTION,), Trust.USE, None),
        (10.1, 0.0, (CAUTION,), Trust.DO_NOT_USE, "too-uncertain"),
        (10.1, 0.0, (CAUTION, WORTH), Trust.DO_NOT_USE, "friction-drifts"),
        (10.1, 0.0, (), Trust.DO_NOT_USE, "too-uncertain"),
        (12.0, 11.0, (), Trust.DO_NOT_USE, "opinions-differ"),
        (np.inf, 0.0, (), Trust.DO_NOT_USE, "too-uncertain"),
        (2.0, 0.0, (CRITICAL, CAUTION), Trust.DO_NOT_USE, "stages-do-not-fit"),
    ],
)
def test_friction_has_to_be_known_as_well_as_it_is_needed(
    band: float, apart: float, warnings: tuple[Finding, ...], trust: Trust, code: str | None
) -> None:
    """The values are used where the band is at most what is asked for, and nothing critical is said; the largest part of the band is the reason."""
    known = Accuracy(slowest=0.1, fastest=1.0, band=band, statistical=5.0, apart=apart, share=1.0, opinion="peak")
    own = replace(joint(whole(*warnings)), accuracy=known)
    found = verdict(own)
    assert (found.trust, found.reason and found.reason.code) == (trust, code)
    assert (verdict(replace(own, need=1000.0)).trust is Trust.USE) == (CRITICAL not in warnings and band < np.inf)

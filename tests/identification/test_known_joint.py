import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import bristle
from bristle.errors import InputError
from bristle.findings import NOTE, Finding, Severity
from bristle.identification.fits import Estimate, StaticFit, TrackingFit
from bristle.identification.known_joint import DEFLECTION, Source, chosen, known_joint, whole
from bristle.identification.results import Accuracy, Joint
from bristle.identification.shared_findings import not_shown
from bristle.identification.verdict import Trust, other_warnings, value_warnings, verdict
from bristle.model.law import DAMPING_RATIO
from bristle.model.parameters import SIGNED, Direction, Pair, ParameterName
from bristle.simulation.drawn_joints import draws_of
from bristle.simulation.joint_model import JointModel

from ..conftest import speeds, write
from ..names import parse
from ..simulation.joints import GRIPPER, J, joint, tracked, unseen, values_of

WAY = 0.7  # how far the joint goes, rad


def static(*warnings: Finding, **values: float | None) -> dict[str, StaticFit]:
    """A static fit of direction + from other runs."""
    fit = StaticFit(
        direction="+", parameters={n: Estimate(value=x, unit="-") for n, x in values.items()}, rms=None, relative_error=None,
        n=9, outcome=Finding("static-converged", NOTE, "Converged."), warnings=warnings,
    )  # fmt: skip  # a list of values
    return {"+": fit}


OTHERS = {"alpha_0": 2 * GRIPPER.positive.alpha_0, "alpha_2": 1.0, "v_s": 0.1}  # twice the moving runs' friction


def test_what_is_known_and_drawn_of_a_joint() -> None:
    """Of a joint with every parameter the sets are the fit's, nothing is missing, and each row says its stage."""
    known = known_joint(joint())
    assert known.directions == SIGNED
    assert known.pair(WAY, J) == GRIPPER
    assert {known.missing(d) for d in SIGNED} == {()}
    assert {row.source for row in chosen(joint())} == {Source.TRACKING}
    # where the moving runs show no peak their alpha_0 is the sum; the peak of another stage is neither put on top of it nor listed
    fit = unseen(tracked(values_of(GRIPPER)), {"alpha_1+": 0.0, "v_s+": 0.2})
    own = joint(fit, static=static(**OTHERS, alpha_1=0.01))
    known = known_joint(own)
    assert known.values(Direction.POSITIVE)["alpha_1"] == 0.0
    assert "alpha_1" in known.missing(Direction.POSITIVE)
    listed = {row.parameter: row for row in chosen(own)}
    assert listed[parse("alpha_1+")].source == Source.TRACKING
    assert listed[parse("alpha_1+")].estimate.value is None
    assert listed[parse("alpha_0+")].source == Source.TRACKING
    # an unseen sigma_0 bends by its share of the way, an unseen sigma_1 damps by (15), in the model and in every draw; the rest stays
    own = joint(unseen(tracked(values_of(GRIPPER)), {"sigma_0+": 1.0, "sigma_1+": 9.0}))
    known = known_joint(own)
    p, n = known.pair(WAY, J)
    assert p.sigma_0 == pytest.approx(p.alpha_0 / (DEFLECTION * WAY))
    assert p.sigma_1 == pytest.approx(2 * DAMPING_RATIO * np.sqrt(J * p.sigma_0))
    assert p.stribeck == pytest.approx(GRIPPER.positive.stribeck)
    assert n == pytest.approx(GRIPPER.negative)
    for pair, _ in draws_of(own, known, WAY, J):
        assert pair.positive.sigma_0 == pytest.approx(pair.positive.alpha_0 / (DEFLECTION * WAY))
    # where no parameter of the moving runs is identifiable the law is that of another stage, and no joint is drawn from the moving fit
    values = values_of(GRIPPER)
    own = joint(unseen(tracked(values), values), static=static(**OTHERS, alpha_1=0.1))
    assert draws_of(own, known_joint(own), WAY, J) == ()
    # a fit of one set for both directions gives each direction the same, and is known of `both`
    values = {**GRIPPER.positive._asdict(), "inertia": J}
    known = known_joint(joint(tracked(values)))
    assert known.directions == (Direction.BOTH,)
    assert known.pair(WAY, J) == Pair(GRIPPER.positive, GRIPPER.positive)
    assert known.estimate("alpha_0", Direction.NEGATIVE) is known.estimates[ParameterName("alpha_0", Direction.BOTH)]
    # at alpha_0 = 0 no bristle could carry a torque: the direction counts as not known, and what needs it is refused in a sentence
    own = joint(tracked(values_of(GRIPPER) | {"alpha_0-": 0.0}))
    assert known_joint(own).directions == (Direction.POSITIVE,)
    with pytest.raises(InputError, match="nothing is known of the friction vs velocity in direction -"):
        whole(own)
    with pytest.raises(InputError, match="nothing is known of the friction vs velocity in direction -"):
        known_joint(own).filled(Direction.NEGATIVE, WAY, J)


CRITICAL = Finding("stages-do-not-fit", Severity.CRITICAL, "The stages contradict each other.")
CAUTIONED = Finding("not-passive", Severity.CAUTION, "The model can feed energy back in direction +.")
WORTH = Finding("friction-drifts", Severity.CAUTION, "Friction grows.", effect={"torque": 0.1})
NOTED = Finding("correlated", Severity.NOTE, "Residuals are correlated.")
NOT_CONVERGED = Finding("not-converged", Severity.CRITICAL, "The fit did not converge; it gives no estimates.")


def knowing(*warnings: Finding) -> TrackingFit:
    """A fit that knows every parameter, with warnings about it."""
    return tracked(values_of(GRIPPER), warnings=warnings)


def said(fit: TrackingFit, name: str, *warnings: Finding) -> TrackingFit:
    own = {parse(name): replace(fit.parameters[parse(name)], warnings=warnings)}
    return replace(fit, parameters={**fit.parameters, **own})


def test_what_decides_a_verdict() -> None:
    """Critical, or a band wider than needed: do not use; cautions, notes, and fits that give no value: use. The largest part is the reason."""
    minor = said(knowing(CAUTIONED, NOTED), "v_s-", CAUTIONED)
    cases: list[tuple[Joint, str | None]] = [
        (joint(minor, warnings=(CAUTIONED,), static=static(CRITICAL, alpha_0=1.0)), None),
        (joint(knowing(CRITICAL), joint_fit=knowing()), None),
        (joint(knowing(CAUTIONED, CRITICAL)), "stages-do-not-fit"),
        (joint(replace(knowing(), outcome=NOT_CONVERGED)), "not-converged"),
    ]
    for band, apart, warnings, code in (
        (9.9, 0.0, [CAUTIONED], None),
        (10.1, 0.0, [CAUTIONED], "too-uncertain"),
        (10.1, 0.0, [CAUTIONED, WORTH], "friction-drifts"),
        (12.0, 11.0, [], "opinions-differ"),
        (np.inf, 0.0, [], "too-uncertain"),
        (2.0, 0.0, [CRITICAL, CAUTIONED], "stages-do-not-fit"),
    ):
        known = Accuracy(slowest=0.1, fastest=1.0, band=band, statistical=5.0, apart=apart, share=1.0, opinion="peak")
        own = joint(knowing(*warnings), accuracy=known)
        cases.append((own, code))
        cases += [(replace(own, need=1000.0), None)] if CRITICAL not in warnings and band < np.inf else []
    wrong = []
    for own, code in cases:
        found, counted = verdict(own), (*value_warnings(own), *other_warnings(own))
        trust = Trust.USE if code is None else Trust.DO_NOT_USE
        if (found.trust, found.reason and found.reason.code) != (trust, code) or len(counted) != len(set(counted)):
            wrong.append((code, found))
    assert wrong == []


def test_causes_of_a_verdict() -> None:
    """Of a fit that leaves a pattern, critical, and of what makes it, a caution, the cause is the reason; both stand among the findings."""
    size = Finding("unexplained", Severity.CRITICAL, "The relative error is 40 %.")
    cause = Finding("reversals-left", Severity.CAUTION, "About reversals the fit leaves more.")
    own = joint(knowing(size, CAUTIONED, cause))
    assert verdict(own) == (Trust.DO_NOT_USE, cause)
    assert {size, cause} <= set(value_warnings(own))
    assert verdict(joint(knowing(size, CAUTIONED))).reason == size
    # what no stage shows is no warning, nor what is said of it; what another stage shows is neither
    fit = unseen(
        knowing(*not_shown(map(parse, ("alpha_0+", "sigma_0+", "sigma_1+")))),
        {"alpha_0+": 1.0, "sigma_0+": 1.0, "sigma_1+": 1.0},
    )
    for name in ("alpha_0+", "sigma_0+", "sigma_1+"):
        fit = said(
            fit,
            name,
            Finding("at-bound", Severity.CAUTION, "At its physical bound of zero."),
            Finding("unseen-wide", Severity.NOTE, "Not identifiable from this motion."),
        )
    own = joint(fit, static=static(alpha_0=1.0))
    assert value_warnings(own) == ()
    # a Coulomb friction of zero, as of a set-up that takes all of it up, is no friction vs velocity
    fit = knowing(CAUTIONED)
    zero = {n: replace(e, value=0.0) if n.name == "alpha_0" else e for n, e in fit.parameters.items()}
    found = verdict(joint(replace(fit, parameters=zero)))
    assert (found.trust, found.reason and found.reason.code) == (Trust.DO_NOT_USE, "no-curve")
    # with the weightiest reason that there is, how its fit ended too; nothing known at all has none
    nothing: dict[ParameterName, Estimate] = {n: replace(e, value=None) for n, e in knowing().parameters.items()}
    own = joint(replace(knowing(), parameters=nothing, outcome=NOT_CONVERGED))
    assert verdict(replace(own, warnings=(CAUTIONED,))) == (Trust.DO_NOT_USE, NOT_CONVERGED)
    assert verdict(replace(own, tracking=None)) == (Trust.DO_NOT_USE, None)


@pytest.fixture(scope="module")
def wrist(edro_results: Path) -> JointModel:
    return bristle.read_results(edro_results).model("wrist pitch")


def test_every_way_to_its_friction_agrees(tmp_path: Path, wrist: JointModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Points in one direction give no friction in the other, and no compensator, in one sentence."""
    alone = bristle.identify(write(tmp_path, speeds(both=False))).model()
    assert np.isnan(alone.friction(-0.1))
    assert alone.friction(0.1) > 0
    with pytest.raises(bristle.InputError, match="a compensator needs"):
        alone.casadi()
    # `friction`, CasADi's steady torque, LuGre at the deflection where dz/dt = 0, and the table, at both signs
    v = np.array([-1.0, -0.02, 0.01, 0.6])
    steady, torque = wrist.casadi().steady, wrist.casadi().torque
    np.testing.assert_allclose(wrist.friction(v), steady(v.reshape(1, -1)).full().ravel(), rtol=1e-12)
    for speed in v.tolist():
        p = wrist.parameters[0 if speed > 0 else 1]
        z = math.copysign(p.alpha_0 + p.alpha_1 * math.exp(-((speed / p.v_s) ** 2)), speed) / p.sigma_0
        T, dz = torque(z, speed)
        assert float(dz) == pytest.approx(0.0, abs=1e-12)
        assert float(T) == pytest.approx(float(wrist.friction(speed)), rel=1e-12)
    rows = wrist.to_frame().to_dict("index")
    for d, p in zip(SIGNED, wrist.parameters, strict=True):
        row = rows[f"alpha_0{d}"]
        assert row["lower"] < row["value"] < row["upper"]
        assert row["value"] == p.alpha_0
    # without adaptation, and driven at one velocity for long, the compensator adds the friction of steady sliding
    running = wrist.compensator(law=None)
    torque = 0.0
    for k in range(4000):
        torque = running.step(1e-3, (0.3e-3 * k, 0.3), 0.3e-3 * k)
    assert torque == pytest.approx(float(wrist.friction(0.3)), rel=1e-6)
    # with `regressors: [quadratic]` friction is what was measured, and CasADi's has as much of it
    for module in ("identification.curve", "simulation.joint_model"):
        monkeypatch.setattr(f"bristle.{module}.drag_of", lambda _: 0.3)
    assert float(wrist.casadi().steady(-0.7)) == pytest.approx(float(wrist.friction(-0.7)), rel=1e-12)
    monkeypatch.undo()
    file, log = write(tmp_path, speeds()), pd.read_csv(tmp_path / "wrist.csv")
    torque = log.tau + 0.05 * log.v * log.v.abs()
    log.assign(tau=torque).to_csv(tmp_path / "wrist.csv", index=False)
    file.write_text(
        f"{file.read_text('utf-8')}fit: {{regressors: [quadratic], set_up: as-written}}\n", encoding="utf-8"
    )
    np.testing.assert_allclose(bristle.identify(file).model().friction(log.v), torque, rtol=0.02)

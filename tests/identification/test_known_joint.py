from dataclasses import replace

import numpy as np
import pytest

from bristle.errors import InputError
from bristle.findings import NOTE, Finding
from bristle.identification.fits import Estimate, StaticFit
from bristle.identification.known_joint import DEFLECTION, Source, chosen, draws_of, known_joint, whole
from bristle.identification.results import Joint
from bristle.model.law import DAMPING_RATIO
from bristle.model.parameters import SIGNED, Direction, Pair, ParameterName

from ..names import parse
from ..simulation.joints import GRIPPER, J, joint, tracked, unseen, values_of

WAY = 0.7  # how far the joint goes, rad


def with_static(own: Joint, alpha_1: float | None) -> Joint:
    """The joint with a static fit of direction + from other runs, twice the moving runs' friction."""
    values = {"alpha_0": 2 * GRIPPER.positive.alpha_0, "alpha_1": alpha_1, "alpha_2": 1.0, "v_s": 0.1}
    fit = StaticFit(
        direction="+", parameters={n: Estimate(value=x, unit="-") for n, x in values.items()}, rms=None, relative_error=None,
        n=0, outcome=Finding("static-converged", NOTE, "Converged."),
    )  # fmt: skip  # a list of values
    return replace(own, static={"+": fit})


def test_what_is_known_and_drawn_of_a_joint() -> None:
    """Of a joint with every parameter the sets are the fit's, nothing is missing, and each row says its stage."""
    known = known_joint(joint())
    assert known.directions == SIGNED
    assert known.pair(WAY, J) == GRIPPER
    assert {known.missing(d) for d in SIGNED} == {()}
    assert {row.source for row in chosen(joint())} == {Source.TRACKING}
    # where the moving runs show no peak their alpha_0 is the sum; the peak of another stage is neither put on top of it nor listed
    own = with_static(joint(unseen(tracked(values_of(GRIPPER)), {"alpha_1+": 0.0, "v_s+": 0.2})), alpha_1=0.01)
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
    # with standard errors of a thousand times the values a drawn v_s, alpha_0, sigma_0 and J stay within e**5 of the estimate, never zero
    fit = tracked(values_of(GRIPPER))
    values = np.array([fit.parameters[name].value for name in fit.names], float)
    own = joint(replace(fit, covariance=np.diag((1e3 * values) ** 2)))
    for pair, inertia in draws_of(own, known_joint(own), WAY, J):
        assert np.exp(-5.001) <= inertia / J <= np.exp(5.001)
        for drawn, estimated in zip(pair, GRIPPER, strict=True):
            ratios = np.array([getattr(drawn, n) / getattr(estimated, n) for n in ("alpha_0", "v_s", "sigma_0")])
            assert (np.abs(np.log(ratios)) < 5.001).all()
    # where no parameter of the moving runs is identifiable the law is that of another stage, and no joint is drawn from the moving fit
    values = values_of(GRIPPER)
    own = with_static(joint(unseen(tracked(values), values)), alpha_1=0.1)
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

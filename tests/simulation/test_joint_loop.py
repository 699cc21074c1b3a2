import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bristle.control.adaptation import LAWS, Adaptation
from bristle.control.closed_loop import simulate
from bristle.control.control_period import LoopOptions
from bristle.control.pid import Gains
from bristle.identification.fits import TrackingFit
from bristle.identification.systematic import shifted
from bristle.model.parameters import Pair
from bristle.simulation import drawn_joints, edro
from bristle.simulation.joint_loop import JointLoop, of_experiment, of_paper, one_way

from ..sameness import of_kind
from .joints import FASTEST, GRIPPER, J, experiment, joint, joint_loop, tracked, unseen, values_of

ASKED = {
    "amplitude": "20 deg", "frequency": "2 Hz", "period": "2 ms",
    "gains": "{K_p: 2 N*m/rad, K_i: 1 N*m/(rad*s), K_d: 0.1 N*m*s/rad, filter_time: 3 ms}", "compensator": "lugre-feedback", "law": "total",
    "step": "least-squares", "parameters": "[alpha_2, alpha_0]", "gamma": "[3, 4]", "limits": "[0.1, 3]", "dead_zone": "0.001", "leakage": "0.02",
    "forgetting": "0.5", "start": "{alpha_0: 0.7}",
}  # fmt: skip  # a table
"""Every option of `adapt`, none as it is by default."""


def options(given: Mapping[str, str]) -> str:
    return ", ".join(f"{name}: {value}" for name, value in given.items())


def test_loops_of_table_2() -> None:
    """Table 2's joint: plant and model have the (+) set both ways, J that of this set alone, and no uncertainty."""
    one = one_way(joint_loop(model=Pair(GRIPPER.negative, GRIPPER.negative)))
    assert one.plant == one.model == Pair(GRIPPER.positive, GRIPPER.positive)
    assert pytest.approx((0.0184 / 0.2) ** 2 / 6.1843) == one.J
    assert one.draws == ()
    # `wrong_start` multiplies the named parameters of both sets by their shares and leaves all others
    one = joint_loop(start={"alpha_0": 0.3, "v_s": 2.0})
    for before, after in zip(GRIPPER, one.wrong_start(GRIPPER), strict=True):
        assert after == before._replace(alpha_0=0.3 * before.alpha_0, v_s=2.0 * before.v_s)
    # four loops in the order of Table 1: its sets as plant, what was identified as model, the PID of (21), J by (15), and Table 2's start
    wrong = {name: Pair(*(p._replace(alpha_0=1.1 * p.alpha_0) for p in pair)) for name, pair in edro.TABLE_1.items()}
    found = of_paper([joint(tracked(values_of(pair)), name) for name, pair in wrong.items()])
    assert [one.name for one in found] == list(edro.TABLE_1)
    for one in found:
        assert one.plant == edro.TABLE_1[one.name]
        np.testing.assert_allclose(one.model, wrong[one.name])
        assert one.gains == Gains(3.0, 1.2, 0.2, 0.0)
        assert pytest.approx(np.mean([(p.sigma_1 / 0.2) ** 2 / p.sigma_0 for p in one.plant])) == one.J
        assert one.adaptation == Adaptation(law="partial", parameters=("alpha_0", "alpha_2"), gamma=(20.0, 20.0))
        assert one.start == {"alpha_0": 0.3, "alpha_2": 0.5}
        assert (one.amplitude, one.frequency, one.slow, one.period) == (1.0, 0.5, 0.2, 1e-3)
        assert len(one.draws) == drawn_joints.DRAWS
        assert one.assumptions


def test_where_the_parts_of_a_loop_come_from(tmp_path: Path) -> None:
    """Every option of `adapt` reaches the loop in SI, and nothing that was given is called an assumption."""
    one = of_experiment(experiment(tmp_path, options(ASKED)), joint())
    assert one.amplitude == pytest.approx(np.deg2rad(20))
    assert (one.frequency, one.slow, one.period) == (2.0, 0.8, 2e-3)
    assert one.gains == pytest.approx(Gains(2.0, 1.0, 0.1, 3e-3))
    assert one.compensator.name == "lugre-feedback"
    assert one.compensator.adaptation is None
    assert one.adaptation == Adaptation(
        law="total", step="least-squares", parameters=("alpha_2", "alpha_0"), gamma=(3.0, 4.0), limits=(0.1, 3.0), dead_zone=0.001, leakage=0.02,
        forgetting=0.5,
    )  # fmt: skip  # a list of values
    assert one.start == {"alpha_0": 0.7}
    assert pytest.approx(J) == one.J
    np.testing.assert_allclose(one.model, GRIPPER)
    assert not of_kind(one.assumptions, "default-pid", "reference-taken", "rates-taken")
    # with a truth that is whole the plant is the truth; without one, or with part of one, it is the identified model, and that is said
    true = Pair(GRIPPER.negative, GRIPPER.negative)
    part = {"both": GRIPPER.negative._replace(sigma_1=float("nan"))}
    for truth, plant in ((dict(zip("+-", true, strict=True)), true), (part, GRIPPER), ({}, GRIPPER)):
        one = of_experiment(experiment(tmp_path), joint(truth=truth))
        np.testing.assert_allclose(one.plant, plant)
        assert bool(of_kind(one.assumptions, "plant-is-model")) == (plant is GRIPPER)
    # what moving runs showed of the inertia comes first, then `inertia`, then `motor.inertia`
    motor = "motor: {torque_constant: 0.35 N*m/A, inertia: 0.003 kg*m**2}\n"
    known, nothing = joint(), joint(tracked(values_of(GRIPPER, None)))
    assert pytest.approx(J) == of_experiment(experiment(tmp_path, "", f"inertia: 0.002 kg*m**2\n{motor}"), known).J
    assert of_experiment(experiment(tmp_path, "", f"inertia: 0.002 kg*m**2\n{motor}"), nothing).J == 0.002
    assert of_experiment(experiment(tmp_path, "", motor), nothing).J == 0.003
    # the refusal names the joint, what is missing, and how to give it or which runs show it
    with pytest.raises(
        ValueError, match=r"^wrist: no inertia is known, .*give it as inertia, or a tracking run that shows it$"
    ):
        of_experiment(experiment(tmp_path), nothing)
    with pytest.raises(ValueError, match=r"^wrist: nothing is known of the friction vs velocity in direction \+; "):
        of_experiment(experiment(tmp_path), replace(joint(), tracking=None))
    # one bad option among good ones: a single sentence with the file's name, the key, what was got and what was expected
    failed = []
    for what, (spoilt, said) in REFUSED.items():
        with pytest.raises(ValueError) as refused:  # noqa: PT011  # the pattern is below
            of_experiment(experiment(tmp_path, options({**ASKED, **spoilt})), joint())
        failed += (
            [] if re.fullmatch(f"{tmp_path / 'e.yaml'}: {said}.*", str(refused.value)) else [(what, refused.value)]
        )
    assert failed == []
    # without gains K_p = J w**2, K_i = J w**3 / 5, K_d = 2 J w, w <= 30 rad/s; half of the fastest measured speed
    for period, bandwidth in (("0.1 ms", 30.0), ("2 ms", 10.0)):
        one = of_experiment(experiment(tmp_path, f"period: {period}"), joint())
        assert len(of_kind(one.assumptions, "default-pid", "reference-taken", "rates-taken")) == 3
        w = bandwidth
        assert one.gains == pytest.approx(Gains(J * w**2, 0.2 * J * w**3, 2 * J * w, 0.0))
        assert one.frequency == 0.5
        assert 2 * np.pi * one.frequency * one.amplitude == pytest.approx(0.5 * FASTEST, rel=0.05)


@pytest.mark.parametrize("parameter", ["alpha_0", "alpha_2"])
@pytest.mark.parametrize("law", ["partial", "partial-theta"])
def test_derived_rates_mend_about_half_of_an_error_in_a_second(tmp_path: Path, parameter: str, law: str) -> None:
    """In the loop that a joint gets without any option, a parameter that is a tenth too small is mended by a quarter to three quarters in 1 s."""
    one = of_experiment(
        experiment(tmp_path, f"law: {law}, parameters: [{parameter}], start: {{{parameter}: 0.9}}"), joint()
    )
    options = LoopOptions(compensator=replace(one.compensator, adaptation=one.adaptation))
    run = simulate(options, [one.case(model=one.wrong_start(one.model))], one.sine(one.frequency, 1.0), one.period)
    assert 0.25 < (0.9 * run.theta[0, 0, -1] - 0.9) / 0.1 < 0.75


@pytest.mark.parametrize(("travel", "how"), [(None, "of the amplitude"), (0.9, "of the travel")])
def test_what_the_motion_does_not_show_is_filled_and_said(tmp_path: Path, travel: float | None, how: str) -> None:
    """An unseen sigma_0 is alpha_0 over a thousandth of the travel, as a plan takes it, or of the amplitude where no travel is known."""
    # an unseen sigma_1 is that of (15)
    deflection = 1e-3 * (travel or 0.4)
    fit = unseen(tracked(values_of(GRIPPER)), {"sigma_0+": 1.0, "sigma_1+": 9.0, "sigma_1-": 9.0})
    one = of_experiment(experiment(tmp_path, "amplitude: 0.4 rad"), replace(joint(fit), travel=travel))
    positive, negative = one.model
    assert positive.sigma_0 == pytest.approx(GRIPPER.positive.alpha_0 / deflection)
    assert positive.sigma_1 == pytest.approx(0.2 * np.sqrt(J * positive.sigma_0))
    assert negative.sigma_0 == pytest.approx(GRIPPER.negative.sigma_0)
    assert negative.sigma_1 == pytest.approx(0.2 * np.sqrt(J * negative.sigma_0))
    said = of_kind(one.assumptions, "bristle-filled")
    filled = [d.numbers for d in said]
    assert [(x["name"], x["direction"]) for x in filled] == [("sigma_0", "+"), ("sigma_1", "+"), ("sigma_1", "-")]
    assert [x["value"] for x in filled] == [positive.sigma_0, positive.sigma_1, negative.sigma_1]
    assert f"from a deflection of 0.001 {how}." in str(said[0])


REFUSED = {
    "negative rate": ({"gamma": "[-1, 4]"}, r"adapt: gamma: got -1; expected zero or more"),
    "rate that is no number": ({"gamma": "[3, .nan]"}, r"adapt: gamma: got nan"),
    "too many rates": ({"gamma": "[3, 4, 5]"}, r"adapt: gamma: got 3 rates for 2 parameters"),
    "limits above the start": ({"limits": "[1.5, 3]"}, r"adapt: limits: got 1\.5 to 3; expected 0 < lower <= 1 <= upper"),
    "unknown law": ({"law": "exact"}, r"adapt: law: got 'exact'; expected one of printed, partial, partial-theta, total"),
    "printed for v_s": ({"law": "printed", "parameters": "[alpha_0, v_s]"}, r"adapt: law: printed is typeset for alpha_0 and alpha_2 alone"),
    "unknown step": ({"step": "newton"}, r"adapt: step: got 'newton'; expected one of gradient, normalised, least-squares"),
    "unknown parameter": ({"parameters": "[alpha_0, mass]"}, r"adapt: parameters: got alpha_0, mass"),
    "parameter twice": ({"parameters": "[v_s, v_s]"}, r"adapt: parameters: got v_s, v_s"),
    "negative dead zone": ({"dead_zone": "-1"}, r"adapt: dead_zone: got -1"),
    "unknown compensator": ({"compensator": "dahl"}, r"adapt: compensator: got 'dahl'; expected one of"),
    "start of what does not exist": ({"start": "{mass: 0.5}"}, r"adapt\.start: got 'mass'; expected some of alpha_0"),
    "compensator that cannot adapt": ({"compensator": "coulomb"}, r"adapt: compensator: coulomb cannot adapt"),
    "period too long": ({"period": "20 ms"}, r"adapt\.period: got 0\.02 s; expected at most 0\.01 s"),
    "reference too fast": ({"amplitude": "50 rad"}, r"adapt: a reference of 50 at 2 Hz is 314 times as fast as anything measured"),
}  # fmt: skip  # a table


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("parameters", ["alpha_0, alpha_2", "v_s", "alpha_1, sigma_1", "sigma_0"])
def test_derived_rates_are_finite_whatever_adapts(tmp_path: Path, law: str, parameters: str) -> None:
    """A default rate is finite, also where a gradient vanishes over most of a sine; zero, and said, where sliding shows nothing."""
    if law == "printed" and parameters != "alpha_0, alpha_2":
        return
    given = {"law": law, "parameters": f"[{parameters}]", "amplitude": "2 rad", "frequency": "1 Hz"}
    one = of_experiment(experiment(tmp_path, options(given)), joint())
    assert np.isfinite(one.adaptation.gamma).all()
    assert max(one.adaptation.gamma) < 1e10
    (said,) = of_kind(one.assumptions, "rates-taken")
    assert said.numbers["rates"] == one.adaptation.gamma
    assert ("; zero where" in str(said)) == (0.0 in one.adaptation.gamma)
    assert parameters != "alpha_0, alpha_2" or law == "printed" or 0.0 not in one.adaptation.gamma


def drawn(folder: Path, fit: TrackingFit) -> JointLoop:
    return of_experiment(experiment(folder), joint(fit))


def test_draws_are_those_of_the_covariance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By constants alone every parameter of a draw has the same factor, the inertia too; without errors of constants there are no such draws."""
    fit = tracked(values_of(GRIPPER), 1e-9)
    assert drawn(tmp_path, fit).draws_by_constants == ()
    moved = {name: shifted(e, {"K": 1e-3 * (e.value or 0.0)}) for name, e in fit.parameters.items()}
    loop = drawn(tmp_path, replace(fit, parameters=moved))
    for found in (loop.draws, loop.draws_by_constants):
        rows = np.array([[*pair.positive, *pair.negative, inertia] for pair, inertia in found])
        factors = rows / list(values_of(GRIPPER).values())
        assert np.abs(factors - factors[:, :1]).max() < 1e-5
        assert np.std(factors[:, 0]) == pytest.approx(1e-3, rel=0.3)
    # the same draws in every run; over many, errors being small, the fit's values, and its covariance with its correlations
    n = 4000
    monkeypatch.setattr(drawn_joints, "DRAWS", n)
    values = values_of(GRIPPER)
    fit = tracked(values, 0.02)
    found = drawn(tmp_path, fit).draws
    assert drawn(tmp_path, fit).draws == found
    rows = np.array([[*pair.positive, *pair.negative, inertia] for pair, inertia in found])
    errors = np.sqrt(np.diag(fit.covariance))
    assert rows.shape == (n, 13)
    assert (np.abs(rows.mean(axis=0) - [*values.values()]) < 5 * errors / np.sqrt(n)).all()
    np.testing.assert_allclose(
        np.cov(rows.T) / np.outer(errors, errors), fit.covariance / np.outer(errors, errors), atol=0.1
    )

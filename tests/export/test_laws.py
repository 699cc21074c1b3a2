import ctypes
import math
import re
import shutil
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from bristle.arrays import Array
from bristle.control.adaptation import Adaptation
from bristle.control.compensator import Compensator
from bristle.errors import InputError
from bristle.model import functions, law
from bristle.model.formula import as_text, formula_of
from bristle.model.laws import registry
from bristle.model.laws.parts import FASTEST, Law, OwnParameter, Peak, ViscousTerm
from bristle.model.parameters import Direction, Lugre, ParameterName
from bristle.model.vectorize import evaluate
from bristle.questions.export import c_header, coulomb_viscous, export, fmu, mjcf
from bristle.questions.export.export import TARGETS, Request, equations
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.json_document import write_json
from bristle.questions.export.latex import write_latex
from bristle.questions.export.loss import all_motions, losses, lugre
from bristle.questions.export.matlab import write_matlab
from export_checks import check
from export_checks.c import compiled, motion
from export_checks.documents import check_json
from export_checks.fmu import compared, fmu_problems

from .conftest import OTHERS, Handed, beside, of_law, same
from .test_c_header import Build, built
from .test_fmu import runs

ASK = Request()
WITH_TERMS = [of for of in OTHERS if of.terms]
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc, which is not installed")
each_law = pytest.mark.parametrize("of", OTHERS, ids=lambda of: of.name)


@needs_gcc
@each_law
def test_c_is_python(of: Law, handed: Handed) -> None:
    """In double precision no torque differs, within v_end and beyond it; in single 5e-6; the self-tests pass."""
    check_header(of_law(handed("wrist pitch"), of), Compensator())
    if of == OTHERS[-1]:  # the same adapting
        adaptation = Adaptation(law="total", step="least-squares")
        check_header(of_law(handed("wrist pitch"), of), Compensator(adaptation=adaptation))
    # `stribeck` is the steady curve of the law in both directions, far beyond v_end too, where a term below zero is held
    joint, compensator = of_law(handed("wrist pitch"), of), Compensator(name="stribeck")
    speeds = joint.fastest * np.array([0.01, 0.1, 0.3, 1.0, 3.0])
    v = np.concatenate([speeds, -speeds]).astype(np.float32).astype(np.float64)
    with compiled(c_header.header(joint, compensator), joint, compensator, np.float64) as code:
        found = code({"reference_velocity": v, "reference_acceleration": 0 * v})
    up, down = (evaluate(functions.steady_torque_function(of), v, *p)[0] for p in joint.curves)
    np.testing.assert_allclose(found, np.where(v < 0, down, up), rtol=1e-14)


def check_header(joint: ExportedJoint, compensator: Compensator) -> None:
    """Hold the C of a joint against Python."""
    request = Request(compensator=compensator)
    double, single = check("c", c_header.TARGET.write([joint], request), [joint], request)
    assert double.startswith("double precision: 0.0e+00 of the peak torque"), joint.law.name
    assert double.endswith("passed")
    assert single.endswith("passed")
    if joint.law.terms:
        end = getattr(joint.curves[0], FASTEST)
        assert np.abs(motion(joint)["reference_velocity"]).max() > 1.1 * end


@each_law
def test_each_target_has_the_law_as_far_as_it_can(of: Law, handed: Handed) -> None:
    """The name in the comment, each parameter in the struct with its unit and range; one out of range is refused."""
    joint = of_law(handed("wrist pitch"), of)
    text = c_header.header(joint, Compensator())
    assert f" * friction law: {of.name}\n" in text
    for name, line in {
        "alpha_3": "br_real alpha_3; /* N*m*s**2/rad**2, [-10000, 10000]: viscous friction: quadratic */",
        "delta": "br_real delta; /* 1, [0.5, 4]: shape of the peak: free-exponent */",
        FASTEST: "br_real v_end; /* rad/s, [1e-05, 1000]: fastest measured speed: ",
    }.items():
        assert (line in text) == (name in of.more)
    for name in of.more:
        rows = (replace(x, value=2e4) if x.parameter.name == name else x for x in joint.parameters)
        with pytest.raises(InputError, match=rf"wrist pitch: {name}: got 20000; the C code takes"):
            c_header.header(replace(joint, parameters=tuple(rows)), Compensator())
    # what MuJoCo cannot hold is fitted, better than by leaving it out, and said with its loss, also where both directions are the same
    artefact = mjcf.TARGET.write([joint], ASK)
    motions, found = all_motions(joint), artefact.losses[joint.name]
    cut = Lugre(*((a + b) / 2 for a, b in zip(joint.pair.positive[:6], joint.pair.negative[:6], strict=True)))
    without = losses(joint, lugre(cut), motions)
    assert sum(x.percent**2 for x in found) < sum(x.percent**2 for x in without)
    assert "its peak is Gaussian and its viscous friction linear" in artefact.holds
    assert (max(x.percent for x in found) > 10) == any(x.code == "export-loses" for x in artefact.said)
    alike = same(joint)
    assert alike.pair.positive == alike.pair.negative
    assert max(x.percent for x in mjcf.TARGET.write([alike], ASK).losses[joint.name]) > 0.1
    # JSON names the law, and is read back as it was, to the last bit
    artefact = write_json([joint], ASK)
    assert of.name in artefact.content.decode()
    assert check_json(artefact, [joint], ASK) == ("bristle-export/1: valid", "read back: equal to the last bit")
    # in both directions, within v_end and beyond it; of the paper's law there are none, as before
    check_equations(joint)
    assert not [*equations(handed("wrist pitch"))]


@runs
def test_the_fmu_has_the_law_and_cogging(cogs: ExportedJoint) -> None:
    """Its variables are the parameters of the law; it is valid, as Python steps it, and close to the continuous equations; not without cogging."""
    joint = of_law(cogs, OTHERS[-1])
    starts = {x.name: x.start for x in fmu.fmu_variables(joint)}
    for d, p in zip(("positive", "negative"), joint.pair, strict=True):
        assert {name: starts[f"{d}.{name}"] for name in p._fields} == p._asdict()
    content = fmu.TARGET.write([joint], ASK).content
    assert fmu_problems(content) == []
    (python, radau), (without, _) = compared(joint, content), compared(without_cogging(joint), content)
    assert float(re.findall(r"sliding: (\S+) of", python)[0]) <= 1e-12
    assert float(re.findall(r"Radau: (\S+) %", radau)[0]) <= 0.01
    assert float(re.findall(r"sliding: (\S+) of", without)[0]) > 1e-3


def test_latex_shows_the_equations(handed: Handed) -> None:
    """They stand below the table, one paragraph where both directions have them alike, and need no package."""
    joint = handed("wrist pitch")
    text = write_latex([of_law(joint, OTHERS[1])], ASK).content.decode()
    assert r"$g(v) = \alpha_{0} + \alpha_{1} e^{- \frac{\left|{v}\right|}{v_{s}}}$" in text
    assert (
        r"$T_f = \alpha_{2} v + \sigma_{0} z + \sigma_{1} \left(v - \frac{\sigma_{0} z \left|{v}\right|}{g}\right)$"
        in text
    )
    assert text.count("Friction law exponential") == 1
    both = of_law(joint, registry.law_named("lorentzian+quadratic"))
    text = write_latex([both, joint], ASK).content.decode()
    assert r"$\alpha_{3}^+$ & " in text
    up, down = text.split("Friction law lorentzian+quadratic, direction ")[1:]
    assert (up[:3], down[:3]) == ("$+$", "$-$")
    assert r"\min\left(v_{end}, \left|{v}\right|\right)" in up
    assert r"v \left(\alpha_{2} + \alpha_{3} \left|{v}\right|\right)" in down
    assert not re.search(r"\\(operatorname|text|begin\{cases)", text)


def matlab_value(text: str, p: dict[str, float], z: float, v: float) -> float:
    python = re.sub(r"p\.(\w+)\.value", r"p['\1']", text).replace(".*", "*").replace("./", "/").replace(".^", "**")
    words = {"min": np.fmin, "max": np.fmax, "abs": np.abs, "sign": np.sign, "exp": np.exp, "log": np.log, "sqrt": np.sqrt,
             "atan": np.arctan, "realmax": np.finfo(float).max}  # fmt: skip  # a table
    return float(eval(python.replace("~", "1.0 - "), {"__builtins__": {}, **words, "p": p, "z": z, "v": v}))  # noqa: S307  # our own text


def check_equations(joint: ExportedJoint) -> None:
    """MATLAB's functions and the formulas that LaTeX shows have the values of the law."""
    script = write_matlab([joint], ASK).content.decode("ascii")
    found = dict(re.findall(r"^wrist_pitch\.(\w+) = @\([zvp, ]+\) (.*); % \S+$", script, re.MULTILINE))
    shown = {one.name: one.expression for one in equations(joint)}
    assert found.keys() == shown.keys() == {"level", "rate", "torque"}
    assert f"wrist_pitch.law = '{joint.law.name}';" in script
    for p in joint.pair:
        values, signed = p._asdict(), {name: getattr(p, name) for name in joint.law.coefficients}
        for v in joint.fastest * np.array([-2.0, -0.1, 1e-3, 0.3, 2.0]):
            true = {"level": law.stribeck(v, p), "rate": law.bristle_rate(1e-3, v, p), "torque": law.torque(1e-3, v, p)}
            for name, expected in true.items():
                formula = eval(as_text(formula_of(shown[name], signed)), {**_PYTHON, **values, "z": 1e-3, "v": v})  # noqa: S307  # our own text
                assert matlab_value(found[name], values, 1e-3, v) == pytest.approx(float(expected), rel=1e-12)
                assert formula == pytest.approx(float(expected), rel=1e-9)


_PYTHON = {
    "Min": min, "Max": max, "sign": np.sign, **{name: getattr(math, name) for name in ("exp", "log", "sqrt", "atan")},
}  # fmt: skip  # a list of values
"""What SymPy's text calls."""


def test_every_target_takes_a_law(handed: Handed, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is written, names the law, and leaves none of its parameters out silently: those that it cannot hold count in its losses."""
    joint = of_law(handed("wrist pitch"), WITH_TERMS[-1])
    failed = []
    for to in TARGETS:
        handed_over = export.export_joints([joint], to, ASK)
        named = b"friction law: free-exponent+quadratic" in handed_over.content or to in {"json", "fmu"}
        said = "wrist pitch: friction law free-exponent+quadratic" in handed_over.text()
        whole = not any(x.code == "export-leaves-out" for x in handed_over.artefact.said)
        failed += [(to, named, said, whole)] * (not (named and said and whole))
    assert failed == []
    # a law of an operation that C has not is one sentence
    monkeypatch.setattr(registry, "_PARTS", dict(registry._PARTS))
    registry.register_law(
        Peak(name="odd", title="odd", shape=lambda v, v_s: ca.exp(-ca.erfinv(v**2 / (v**2 + v_s**2))), reach=1.0),
        compete=False,
    )
    joint = of_law(handed("wrist pitch"), registry.law_named("odd"))
    with pytest.raises(InputError, match="has no C99 counterpart; write the expression without it"):
        c_header.header(joint, Compensator(name="stribeck"))


@needs_gcc
def test_a_law_from_outside_is_handed_over(handed: Handed, monkeypatch: pytest.MonkeyPatch) -> None:
    """C, FMU, JSON, MATLAB and LaTeX have a registered law as they have bristle's own; MJCF says what it loses."""
    monkeypatch.setattr(registry, "_PARTS", dict(registry._PARTS))
    width = OwnParameter(name="width", symbol="w", units=("1", "1"), searched=(0.5, 3.0))
    root = OwnParameter(name="beta", symbol="β", units=("N*m*s**1.5/rad**1.5", "N*s**1.5/m**1.5"), least=-math.inf)
    peak = Peak(
        name="arc", title="arc", shape=lambda v, v_s, w: 1 - 2 / ca.pi * ca.atan(w * (v / v_s) ** 2), own=(width,),
        reach=2.5,
    )  # fmt: skip  # a list of values
    registry.register_law(peak, compete=False)
    registry.register_law(ViscousTerm(name="root", title="v·√|v|", coefficient=root, rate=ca.sqrt), compete=False)
    outside = registry.law_named("arc+root")
    joint = of_law(handed("wrist pitch"), outside)
    check_header(joint, Compensator())
    assert "#define BR_ATAN atan\n" in c_header.header(joint, Compensator())
    description = fmu.base_units("N*m*s**1.5/rad**1.5")
    assert description is None
    assert export.export_joints([joint], "fmu", ASK).content
    assert check_json(write_json([joint], ASK), [joint], ASK)[1] == "read back: equal to the last bit"
    check_equations(joint)
    assert r"\operatorname{atan}" not in write_latex([joint], ASK).content.decode()
    assert export.export_joints([joint], "mujoco", ASK).artefact.losses[joint.name][0].percent > 0


__all__ = ["built"]
WAVES = {"cogging_sin_6": 0.05, "cogging_cos_6": -0.02, "cogging_sin_11": 0.01, "cogging_cos_11": 0.03}


def cogging(q: Array) -> Array:
    """What the joint has, N*m."""
    return 0.05 * np.sin(6 * q) - 0.02 * np.cos(6 * q) + 0.01 * np.sin(11 * q) + 0.03 * np.cos(11 * q)


@pytest.fixture
def cogs(handed: Handed) -> ExportedJoint:
    return beside(handed("wrist pitch"), **WAVES)


@needs_gcc
def test_the_c_has_it(cogs: ExportedJoint, handed: Handed, built: Build) -> None:
    """A function of its own, in double and single precision; a joint without has none, and of one that slides orders are per metre."""
    source = '#include "joint.h"\nbr_real f(br_real q) { return bristle_wrist_pitch_cogging(q); }\n'
    q = np.linspace(-4.0, 4.0, 101)
    for joint, of in ((cogs, 1.0), (replace(cogs, kind="prismatic"), 2 * np.pi)):
        text = c_header.header(joint, Compensator())
        for real, options, most in ((ctypes.c_double, (), 1e-14), (ctypes.c_float, ("-DBRISTLE_SINGLE",), 2e-6)):
            f = built(text, source, *options).f
            f.argtypes, f.restype = [real], real
            found = np.array([f(x) for x in q])
            assert np.abs(found - cogging(of * q.astype(real))).max() < most * (1 if of == 1 else 10)
    assert "_cogging" not in c_header.header(handed("wrist pitch"), Compensator())


def without_cogging(joint: ExportedJoint) -> ExportedJoint:
    """The joint as if nothing had been identified beside its friction."""
    return replace(joint, parameters=tuple(x for x in joint.parameters if x.parameter.name not in WAVES))


def test_cogging_and_load_in_mujoco_and_elsewhere(cogs: ExportedJoint, handed: Handed) -> None:
    """C, FMU and MJCF say nothing of cogging; Isaac and frictionloss name its parameters; a ripple of friction is nobody's."""
    rippled = beside(cogs, ripple_sin_6=0.01)
    for target, holds in (
        (c_header.TARGET, True),
        (fmu.TARGET, True),
        (mjcf.TARGET, True),
        (mjcf.FRICTIONLOSS, False),
        (coulomb_viscous.ISAAC, False),
    ):
        artefact = target.write([rippled], Request())
        left = [x.numbers["names"] for x in artefact.said if x.code == "export-leaves-out"]
        assert ("cogging" in artefact.holds) == holds
        assert [name for name in left[0] if name.startswith("cogging")] == ([] if holds else [*WAVES])
        assert str(ParameterName("ripple_sin_6", Direction.SHARED)) in left[0]
    # its actuators give at rest what they give without, less the cogging; Python's friction moves the joint as they do
    mujoco: Any = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    from bristle.mujoco import Friction

    positions, forces = np.linspace(-3.0, 3.0, 25), []
    for joint in (cogs, without_cogging(cogs)):
        model = mujoco.MjModel.from_xml_string(mjcf.TARGET.write([joint], Request()).content.decode())
        data = mujoco.MjData(model)
        for q in positions:
            data.qpos[0] = q
            mujoco.mj_forward(model, data)
            forces.append(float(data.qfrc_actuator[0]))
    assert np.subtract(forces[:25], forces[25:]) == pytest.approx(-cogging(positions), abs=1e-7)

    # a free joint, let go where cogging pulls
    text = (
        '<mujoco><option timestep="0.001" gravity="0 0 0"/><worldbody><body><joint name="wrist pitch" axis="0 0 1" armature="0.01"/>'
        '<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/></body></worldbody><actuator>ACTUATORS</actuator></mujoco>'
    )
    of_wave = [line for line in mjcf.mjcf_actuators(mjcf.mjcf_held(cogs, Request())).split("\n") if "cogging" in line]
    ends = []
    for actuators, joint in (("", cogs), ("\n".join(of_wave), without_cogging(cogs))):
        model = mujoco.MjModel.from_xml_string(text.replace("ACTUATORS", actuators))
        data, friction = mujoco.MjData(model), Friction(model, "wrist pitch", joint)
        for _ in range(400):
            friction.apply(data, 0.15)
            mujoco.mj_step(model, data)
        ends.append(float(data.qpos[0]))
    assert ends[0] == pytest.approx(ends[1], rel=1e-6)
    assert abs(ends[0]) > 0.05
    # a joint pulled along with a weight on it brakes by its friction at that load, of which alpha_0 has a part
    text = (
        '<mujoco><option timestep="0.001" gravity="0 0 -9.81"/><worldbody><body><joint name="wrist pitch" axis="0 1 0" armature="0.01"/>'
        '<inertial pos="0.1 0 0" mass="0.5" diaginertia="1e-9 1e-9 1e-9"/></body></worldbody></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(text)
    weight, torque, found = 0.5 * 9.81 * 0.1, 0.9, {}
    for rises in ({}, {"link_load": 0.1}, {"motor_load": 0.1}, {"gear_load": 0.05, "gear_load_squared": 0.02}):
        joint = beside(handed("wrist pitch"), **rises)
        data, friction = mujoco.MjData(model), Friction(model, "wrist pitch", joint)
        data.qvel[0] = 0.5
        for _ in range(40):  # until the bristle is bent
            data.qpos[0], data.qvel[0] = 0.0, 0.5
            friction.apply(data, torque)
            mujoco.mj_step(model, data)
        found[max(rises, default="", key=len)] = friction.torque
    plain, carried = found.pop(""), torque - weight
    expected = {
        "link_load": 0.1 * weight, "motor_load": 0.1 * torque, "gear_load_squared": 0.05 * carried + 0.02 * carried**2,
    }  # fmt: skip  # a table
    assert {name: x - plain for name, x in found.items()} == pytest.approx(expected, rel=0.05)

"""Cogging, and friction that rises with load, in the targets that hold them; of the others it is said that they are left out."""

import ctypes
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bristle.arrays import Array
from bristle.control.compensator import Compensator
from bristle.model.parameters import Direction, ParameterName
from bristle.questions.export import c_header, fmu, isaac, mjcf
from bristle.questions.export.artefact import Request
from bristle.questions.export.exported import ExportedJoint
from export_checks import check

from .conftest import Handed, beside
from .test_c_header import Build, built, needs_gcc
from .test_fmu import runs

__all__ = ["built"]
WAVES = {"cogging_sin_6": 0.05, "cogging_cos_6": -0.02, "cogging_sin_11": 0.01, "cogging_cos_11": 0.03}


def cogging(q: Array) -> Array:
    """What the joint has, N*m."""
    return 0.05 * np.sin(6 * q) - 0.02 * np.cos(6 * q) + 0.01 * np.sin(11 * q) + 0.03 * np.cos(11 * q)


@pytest.fixture
def cogs(handed: Handed) -> ExportedJoint:
    """A joint with two orders of cogging."""
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


@runs
def test_the_fmu_has_it(cogs: ExportedJoint) -> None:
    """The joint moves as Python and Radau have it, 1e-12 and 0.01 % off, and not as it would without."""
    artefact = fmu.TARGET.write([cogs], Request())
    _, python, radau, *_ = check("fmu", artefact, [cogs], Request())
    assert float(python.split("sliding: ")[1].split()[0]) <= 1e-12
    assert float(radau.split("Radau: ")[1].split()[0]) <= 0.01
    _, without, *_ = check("fmu", artefact, [without_cogging(cogs)], Request())
    assert float(without.split("sliding: ")[1].split()[0]) > 1e-3


def without_cogging(joint: ExportedJoint) -> ExportedJoint:
    """The joint as if nothing had been identified beside its friction."""
    return replace(joint, parameters=tuple(x for x in joint.parameters if x.parameter.name not in WAVES))


def test_mujoco_has_it(cogs: ExportedJoint) -> None:
    """What its actuators give at rest is what they give of the joint without, less the cogging; Python's friction moves the joint as they do."""
    mujoco: Any = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    from bristle.mujoco import Friction

    models = [
        mujoco.MjModel.from_xml_string(mjcf.TARGET.write([x], Request()).content.decode())
        for x in (cogs, without_cogging(cogs))
    ]
    both = [(model, mujoco.MjData(model)) for model in models]
    for q in np.linspace(-3.0, 3.0, 25):
        forces = []
        for model, data in both:
            data.qpos[0] = q
            mujoco.mj_forward(model, data)
            forces.append(float(data.qfrc_actuator[0]))
        assert forces[0] - forces[1] == pytest.approx(-cogging(q), abs=1e-7)

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


def test_others_say_that_they_leave_it_out(cogs: ExportedJoint) -> None:
    """C, FMU and MJCF say nothing of cogging; Isaac and frictionloss name its parameters; a ripple of friction is nobody's."""
    rippled = beside(cogs, ripple_sin_6=0.01)
    for target, holds in (
        (c_header.TARGET, True),
        (fmu.TARGET, True),
        (mjcf.TARGET, True),
        (mjcf.FRICTIONLOSS, False),
        (isaac.TARGET, False),
    ):
        artefact = target.write([rippled], Request())
        left = [x.numbers["names"] for x in artefact.said if x.code == "export-leaves-out"]
        assert ("cogging" in artefact.holds) == holds
        assert [name for name in left[0] if name.startswith("cogging")] == ([] if holds else [*WAVES])
        assert str(ParameterName("ripple_sin_6", Direction.SHARED)) in left[0]


def test_friction_rises_with_load_in_mujoco(handed: Handed) -> None:
    """A joint that is pulled along, with a weight on it, brakes by its friction at that load, of which its alpha_0 has a part."""
    mujoco: Any = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    from bristle.mujoco import Friction

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

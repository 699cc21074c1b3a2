"""`bristle.mujoco.Friction`: a simulation with it is the continuous equation, as well as its time step allows."""

import math
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bristle
from bristle.arrays import Array
from bristle.errors import InputError
from bristle.model import law
from bristle.mujoco import Friction
from bristle.questions.export import mjcf
from bristle.questions.export.artefact import Request
from bristle.questions.export.exported import ExportedJoint
from export_checks.fmu import radau_continuous

from .conftest import OTHERS, Handed, assumed, beside, of_law, scaled

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
ONE = """<mujoco><option timestep="{h}" gravity="0 0 0" integrator="{integrator}"/><worldbody><body>
<joint name="{name}" type="{kind}" axis="0 0 1" armature="{J}" {more}/><inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>
</body></worldbody><actuator><motor joint="{name}"/>{actuators}</actuator></mujoco>"""
TWO = """<mujoco><option timestep="{h}" integrator="{integrator}" gravity="0 0 0"><flag contact="disable"/></option><worldbody>
<body><joint name="a" axis="0 1 0" armature="0.002"/><geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".2"/>
<body pos=".1 0 0"><joint name="b" axis="0 1 0" armature="0.001"/><geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".2"/>
</body></body></worldbody><actuator><motor joint="a"/><motor joint="b"/></actuator></mujoco>"""


def one(h: float = 0.002, **changes: Any) -> Any:
    """A model of one joint, driven by a torque."""
    values = {
        "name": "wrist pitch",
        "integrator": "Euler",
        "kind": "hinge",
        "J": 0.00868,
        "more": "",
        "actuators": "",
        **changes,
    }
    return mujoco.MjModel.from_xml_string(ONE.format(h=h, **values))


def drive(t: float) -> float:
    """N*m: from presliding through reversals to sliding."""
    w = 2 * math.pi
    return 0.16 * math.sin(0.2 * w * t) + 0.1 * math.sin(0.5 * w * t + 1) + 0.06 * math.sin(1.1 * w * t + 2)


def velocity(joint: ExportedJoint, h: float, duration: float = 10.0, **changes: Any) -> Array:
    """Rad/s at each time step, (n,), with the torque that is due when the step begins."""
    model = one(h, J=joint.inertia, **changes)
    data, friction = mujoco.MjData(model), Friction(model, joint.name, joint)
    v = np.empty(round(duration / h))
    for k in range(v.size):
        v[k] = data.qvel[0]
        data.ctrl[0] = drive(data.time)
        friction.apply(data)
        mujoco.mj_step(model, data)
    return v


def continuous(joint: ExportedJoint, duration: float = 10.0) -> Array:
    """Rad/s at every millisecond by Radau to 1e-8, the torque continuous."""
    t = np.arange(round(1000 * duration)) / 1000

    def drag(v: Any) -> Any:
        """V abs(v), where the joint has it, N*m."""
        return -joint.quadratic * law.load_terms(0.0, v, 0.0, 0.0)["quadratic"]

    return radau_continuous(joint, drive, t, drag, (1e-8, 1e-11))


def off(v: Array, true: Array) -> float:
    """Per cent."""
    return 100 * float(np.sqrt(np.mean((v - true) ** 2) / np.mean(true**2)))


def test_a_pair_driven_by_a_torque_follows_the_continuous_equation(handed: Handed) -> None:
    """Presliding, reversals and sliding for 10 s: velocity at most 0.5 % off at 2 ms, 0.3 % at 1 ms."""
    joint = handed("wrist pitch")
    true = continuous(joint)
    assert 0.02 < np.mean(np.abs(true) < 0.002) < 0.5
    assert np.abs(true).max() > 0.5 * joint.fastest
    assert off(velocity(joint, 0.002), true[::2]) <= 0.5
    assert off(velocity(joint, 0.001), true) <= 0.3


def test_other_laws_and_a_drag_follow_their_continuous_equations(handed: Handed) -> None:
    """The same of laws with other peaks and terms, within v_end and beyond it, and of a quadratic term that brakes as well."""
    plain = handed("wrist pitch")
    for joint in (*(of_law(plain, of) for of in OTHERS[-3:]), beside(plain, quadratic=0.1)):
        true = continuous(joint, 4.0)
        assert not joint.law.terms or np.abs(true).max() > joint.fastest / 3
        assert off(velocity(joint, 0.001, 4.0), true) <= 0.5, joint.law.name


def test_integrators_agree(handed: Handed) -> None:
    """Euler, implicit and implicitfast give the same simulation."""
    joint = handed("wrist pitch")
    euler = velocity(joint, 0.002, 2.0)
    for integrator in ("implicit", "implicitfast"):
        assert velocity(joint, 0.002, 2.0, integrator=integrator) == pytest.approx(euler, abs=1e-12)


def test_stiff_bristles_of_coupled_joints_come_to_rest(handed: Handed) -> None:
    """Two links at 2 ms with bristles up to 1e8 times as stiff: nothing rings in stick, in whatever order frictions are applied."""
    failed = []
    for case in product((1.0, 1e2, 1e4, 1e8), ((0, 1), (1, 0)), ("Euler", "implicitfast")):
        times, order, integrator = case
        model = mujoco.MjModel.from_xml_string(TWO.format(h=0.002, integrator=integrator))
        data = mujoco.MjData(model)
        frictions = [
            Friction(model, name, scaled(handed(of), sigma_0=times, sigma_1=times**0.5))
            for name, of in (("a", "wrist pitch"), ("b", "gripper rotation"))
        ]
        for k in range(2500):
            moved = (0.25, 0.06) * np.sin(2 * np.pi * np.array([0.8, 1.4]) * data.time)
            data.ctrl[:] = moved if k < 1000 else (0.02, 0.005)
            for which in order:
                frictions[which].apply(data)
            mujoco.mj_step(model, data)
        ends = np.abs(data.qvel).max(), [x.torque for x in frictions]
        failed += [(case, ends)] * (not ends[0] < 1e-6 or ends[1] != pytest.approx([0.02, 0.005], abs=1e-5))
    assert failed == []


def test_a_limit_does_not_wind_the_bristle_up(handed: Handed) -> None:
    """Pushed against a limit, the joint stands, its bristle is not bent beyond breakaway, and it leaves the limit when it is pulled."""
    joint = handed("wrist pitch")
    model = one(more='limited="true" range="-10 10"', J=joint.inertia)
    data, friction = mujoco.MjData(model), Friction(model, "wrist pitch", joint)
    for k in range(3000):
        data.ctrl[0] = 0.3 if k < 1500 else -0.3
        friction.apply(data)
        mujoco.mj_step(model, data)
        assert abs(friction.deflection) <= 1.02 * max((p.alpha_0 + p.alpha_1) / p.sigma_0 for p in joint.pair)
    assert data.qpos[0] < 0


def test_a_torque_of_ones_own_acts_as_a_control(handed: Handed) -> None:
    """The argument `torque` acts as a control does; once it is zero, the joint comes to rest."""
    joint = handed("wrist pitch")
    ends = []
    for way in ("control", "argument"):
        model = one(J=joint.inertia)
        data, friction = mujoco.MjData(model), Friction(model, "wrist pitch", joint)
        for _ in range(2000):
            data.ctrl[0] = 0.3 if way == "control" else 0.0
            friction.apply(data, torque=0.0 if way == "control" else 0.3)
            mujoco.mj_step(model, data)
        ends.append(data.qvel[0])
        data.ctrl[0] = 0.0
        for _ in range(2000):
            friction.apply(data)
            mujoco.mj_step(model, data)
        assert abs(data.qvel[0]) < 1e-9
    assert ends[0] > 1
    assert ends == pytest.approx([ends[0]] * 2, rel=1e-12)


def test_what_begins_anew_repeats_itself(handed: Handed) -> None:
    """After mj_resetData the same motion comes out, also after a call at time 0 with a wild velocity; two calls at one time do as one.

    `reset` takes a deflection.
    """
    joint = handed("wrist pitch")
    model = one(J=joint.inertia)
    data, friction = mujoco.MjData(model), Friction(model, "wrist pitch", joint)
    data.qvel[0] = -3.0
    friction.apply(data)
    seen = []
    for calls in (1, 2):
        mujoco.mj_resetData(model, data)
        for _ in range(50):
            data.ctrl[0] = 0.3
            for _ in range(calls):
                friction.apply(data)
            mujoco.mj_step(model, data)
        seen.append((data.qvel[0], friction.deflection, friction.torque))
    fresh, new = mujoco.MjData(model), Friction(model, "wrist pitch", joint)
    for _ in range(50):
        fresh.ctrl[0] = 0.3
        new.apply(fresh)
        mujoco.mj_step(model, fresh)
    assert seen == [(fresh.qvel[0], new.deflection, new.torque)] * 2
    friction.reset(1e-3)
    assert friction.deflection == 1e-3
    friction.apply(data)
    assert friction.deflection == 1e-3


def test_a_step_that_was_left_out_is_refused(handed: Handed) -> None:
    """The torque of one step, held over two, is not that of the law."""
    joint = handed("wrist pitch")
    model = one()
    data, friction = mujoco.MjData(model), Friction(model, "wrist pitch", joint)
    friction.apply(data)
    mujoco.mj_step(model, data)
    mujoco.mj_step(model, data)
    with pytest.raises(InputError, match="before every mj_step"):
        friction.apply(data)


def test_a_joint_of_the_results_is_found(handed: Handed, edro_results: Path) -> None:
    """By its name, of results or of their file; the only one whatever the model calls it."""
    model = one()
    results = bristle.read_results(edro_results)
    torques = []
    for result in (handed("wrist pitch"), results, edro_results, str(edro_results)):
        data = mujoco.MjData(model)
        data.qvel[0] = 1.0
        friction = Friction(model, "wrist pitch", result)
        friction.apply(data)
        torques.append(friction.torque)
    assert torques == [torques[0]] * 4
    other = one(name="other")
    Friction(other, "other", handed("wrist pitch"))
    with pytest.raises(InputError, match="no joint 'other'"):
        Friction(other, "other", results)


def test_a_joint_that_slides_has_friction(handed: Handed) -> None:
    """In m and N."""
    model = one(kind="slide")
    friction = Friction(model, "wrist pitch", handed("wrist pitch", kind="prismatic"))
    data = mujoco.MjData(model)
    data.qvel[0] = 1.0
    friction.apply(data)
    assert data.qfrc_applied[0] == -friction.torque < 0


BALL = '<mujoco><worldbody><body><joint name="wrist pitch" type="ball"/><geom size="1"/></body></worldbody></mujoco>'


def test_what_does_not_fit_is_refused(handed: Handed) -> None:
    """One sentence each: the names that are there are listed; the dcmotor of an export would count twice; sigma_0 must be known."""
    joint = handed("wrist pitch")
    written = mujoco.MjModel.from_xml_string(mjcf.TARGET.write([joint], Request()).content.decode())
    cases: dict[str, tuple[Any, str, ExportedJoint]] = {
        "RK4": (one(integrator="RK4"), joint.name, joint),
        "hinge": (one(kind="slide"), joint.name, joint),
        "neither": (mujoco.MjModel.from_xml_string(BALL), joint.name, joint),
        "damping 0.1": (one(more='damping="0.1"'), joint.name, joint),
        "frictionloss 0.1": (one(more='frictionloss="0.1"'), joint.name, joint),
        "it has 'wrist pitch'": (one(), "wrist", joint),
        "dcmotor": (written, joint.name, joint),
        "sigma_0": (one(), joint.name, assumed(joint, "sigma_0")),
    }
    failed = []
    for said, arguments in cases.items():
        with pytest.raises(InputError) as refused:
            Friction(*arguments)
        failed += [(said, str(refused.value))] * (said not in str(refused.value))
    assert failed == []

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
from bristle.model.parameters import Lugre
from bristle.mujoco import Friction
from bristle.questions.export import mjcf
from bristle.questions.export.export import ExportTarget, Request
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import all_motions, best_symmetric, losses, lugre
from export_checks import check
from export_checks.common import as_read
from export_checks.fmu import radau_continuous

from .conftest import HOSTILE, OTHERS, SURROGATE, Handed, assumed, beside, of_law, same, scaled

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
TARGETS = [mjcf.TARGET, mjcf.FRICTIONLOSS]
ROBOT = b"""<?xml version='1.0'?>
<!-- a robot -->
<mujoco model="arm">\r
\t<compiler angle="degree"/>
  <default><motor gear="100" ctrlrange="-1 1" forcerange="-0.001 0.001"/><joint damping="3" frictionloss="2"/></default>
  <worldbody>
    <body name='upper' ><joint   name='wrist pitch' axis='0 1 0'   range="-90 90"/>
      <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01"/></body>
  </worldbody>
</mujoco>
<!-- end -->
"""


def error(line: str, of: str) -> float:
    """The per cent that a line of `check` has of the model held, or of the joint."""
    return float(line.split(f" % of the {of}", maxsplit=1)[0].rsplit(maxsplit=1)[-1])


def test_one_set_and_its_largest_step(handed: Handed) -> None:
    """One set imposed at 0.5 Hz and 2 ms: torque RMS error at most 0.5 % at 1, 0.1 and 0.02 rad, and nothing is lost."""
    one_set = same(handed("wrist pitch"))
    artefact = mjcf.TARGET.write([one_set], Request())
    lines = check("mujoco", artefact, [one_set], Request())
    assert [line.split()[2] for line in lines[:3]] == ["1", "0.1", "0.02"]
    assert all(error(line, "model held") <= 0.5 for line in lines)
    assert [x.percent for x in artefact.losses[one_set.name]] == [0.0] * 4
    assert not artefact.said
    assert b"<general" not in artefact.content
    # no parameter of the set can be moved by 3 % and lower the cost, nor the bias, nor is none better; a term that is zero stays zero
    joint = handed("wrist pitch")
    motions = all_motions(joint)

    def cost(p: Lugre[float], bias: float) -> float:
        return sum(x.percent**2 for x in losses(joint, lugre(p, bias), motions))

    p, bias = best = best_symmetric(joint, motions)
    others = [(p, bias * factor) for factor in (0.0, 0.97, 1.03)]
    others += [(p._replace(**{name: p[k] * x}), bias) for k, name in enumerate(Lugre._fields) for x in (0.97, 1.03)]
    assert [other for other in others if cost(*other) <= cost(*best)] == []
    flat = scaled(joint, alpha_1=0.0)
    assert best_symmetric(flat, all_motions(flat)).parameters.alpha_1 == 0
    # a joint at rest with a small push settles 10 % below the time step that is named, and does not 10 % above
    joint = handed("wrist pitch")
    content = mjcf.TARGET.write([joint], Request()).content.decode()
    limit = float(content.split("Keep the time step well below ")[1].split()[0])
    for factor, settles in ((0.9, True), (1.1, False)):
        model = mujoco.MjModel.from_xml_string(content)
        model.opt.timestep = factor * limit
        data = mujoco.MjData(model)
        data.qvel[0] = 0.005
        for _ in range(5000):
            mujoco.mj_step(model, data)
        assert bool(abs(data.qvel[0]) < 1e-6) is settles
    # where the model has actuators ours come after them, so that the places of their controls stay
    into = ROBOT.replace(b"</worldbody>", b"</worldbody>\n  <actuator><motor name='m' joint='wrist pitch'/></actuator>")
    merged = mjcf.TARGET.write([handed("wrist pitch")], Request(into=into, into_name="arm.xml"))
    assert merged.content.count(b"<actuator>") == 1
    assert mujoco.MjModel.from_xml_string(merged.content.decode()).actuator("m").id == 0


@pytest.mark.parametrize("name", ["gripper rotation", "wrist pitch", "elbow pitch", "base rotation"])
def test_a_pair_loses_what_is_said(handed: Handed, name: str) -> None:
    """Directions that differ: MuJoCo has the set that is written to 0.5 %, and loses of the joint what the artefact says, to 0.5 % of the torque."""
    joint = handed(name)
    artefact = mjcf.TARGET.write([joint], Request())
    lines = check("mujoco", artefact, [joint], Request())
    assert all(error(line, "model held") <= 0.5 for line in lines)
    for line, said in zip(lines[3:], artefact.losses[name], strict=True):
        assert abs(error(line, "joint") - said.percent) < 0.6


def called(target: ExportTarget) -> str:
    return mjcf.NAME if target is mjcf.TARGET else mjcf.FRICTIONLOSS_NAME


@pytest.mark.parametrize("target", TARGETS)
def test_what_is_written_and_merged_loads(handed: Handed, target: ExportTarget) -> None:
    """Two joints, one that slides: the example loads by itself, with the armature that was identified, and checks itself."""
    # of a joint whose links are known that is the rotor's alone; without an inertia none is written, which is said
    joints = [handed("wrist pitch"), handed("gripper rotation", kind="prismatic")]
    artefact = target.write(joints, Request())
    model = mujoco.MjModel.from_xml_string(artefact.content.decode())
    assert [model.joint(x.name).type[0] for x in joints] == [3, 2]
    assert [model.joint(x.name).armature[0] for x in joints] == [x.rotor_inertia for x in joints]
    assert len(check(called(target), artefact, joints, Request())) == 14
    loaded = handed("wrist pitch", inertia=10.0)
    model = mujoco.MjModel.from_xml_string(target.write([loaded], Request()).content.decode())
    assert model.joint("wrist pitch").armature[0] == loaded.rotor_inertia != 10.0
    artefact = target.write([handed("wrist pitch", inertia=None, rotor_inertia=None)], Request())
    assert "export-without-inertia" in {x.code for x in artefact.said}
    assert b"armature=" not in artefact.content
    mujoco.MjModel.from_xml_string(artefact.content.decode())
    # whatever joints are called, MuJoCo loads the file, and has a body, a joint and our actuators for each, by its name
    joints = [handed("wrist pitch", name=name) for name in (*HOSTILE, SURROGATE) if name]
    artefact = target.write(joints, Request())
    model, n = mujoco.MjModel.from_xml_string(artefact.content.decode()), len(joints)
    assert (model.nbody, model.njnt, model.nu) == (1 + n, n, 2 * n if target is mjcf.TARGET else 0)
    assert [model.joint(k).name for k in range(n)] == [as_read(joint.name) for joint in joints]
    owned = {model.actuator(k).name: int(model.actuator(k).trnid[0]) for k in range(model.nu)}
    assert all(owned[as_read(mjcf.own_actuator(x.name))] == k for k, x in enumerate(joints) if owned)
    assert all(c.isprintable() or c == "\n" for c in artefact.content.decode())
    # merged, all lines but the joint's are as they were; MuJoCo has the friction despite its defaults
    joint, request = handed("wrist pitch"), Request(into=ROBOT, into_name="arm.xml")
    artefact = target.write([joint], request)
    assert [x for x in ROBOT.split(b"\n") if x not in artefact.content.split(b"\n")] == [ROBOT.split(b"\n")[6]]
    lines = check(called(target), artefact, [joint], request)
    model = mujoco.MjModel.from_xml_string(artefact.content.decode())
    assert model.dof_armature[0] == joint.inertia
    if target is mjcf.TARGET:
        assert (model.dof_damping[0], model.dof_frictionloss[0]) == (0, 0)
        assert all(error(line, "model held") <= 0.5 for line in lines)


TWICE = '<mujoco>\n<worldbody><body>\n<joint name="wrist pitch"/>{}\n<joint name="wrist pitch"/></body></worldbody></mujoco>'


@pytest.mark.parametrize("target", TARGETS)
def test_what_cannot_be_merged_into_is_refused(handed: Handed, target: ExportTarget) -> None:
    """A missing joint, one that stands twice, one of another kind, a document type and another format: one sentence each."""
    # into a model that holds LuGre nothing is merged, which would count twice; frictionloss is written anew
    joint = handed("wrist pitch")
    changes = {
        (b"'wrist pitch'", b"'wrist'"): "'wrist'",
        (b"name='wrist pitch'", b"name='wrist pitch' type='ball'"): "hinge",
        (b"name='wrist pitch'", b"name='wrist pitch' springdamper='1 1'"): "springdamper",
        (b"name='wrist pitch'", b"name='wrist pitch' actuatorfrcrange='-1 1'"): "would cut the friction too",
        (b"<worldbody>", b"<default><joint type='slide'/></default><worldbody>"): "write type on the joint itself",
        (b"<!-- a robot -->", b"<!DOCTYPE mujoco>"): "document type",
        (b"mujoco", b"robot"): "MJCF",
    }
    twice = "arm.xml: has joint 'wrist pitch' twice, in lines 3 and 4"
    cases = [(ROBOT.replace(*change), said) for change, said in changes.items()]
    cases += [(TWICE.format(between).encode(), twice) for between in ("", "</body><body>")]
    held = mjcf.TARGET.write([joint], Request(into=ROBOT, into_name="arm.xml")).content
    cases.append((held, "already" if target is mjcf.TARGET else "already, which holds this joint's friction"))
    failed = []
    for content, said in cases:
        with pytest.raises(InputError) as refused:
            target.write([joint], Request(into=content, into_name="arm.xml"))
        failed += [(said, str(refused.value))] * (said not in str(refused.value))
    assert failed == []
    if target is mjcf.FRICTIONLOSS:
        once = target.write([joint], Request(into=ROBOT, into_name="arm.xml")).content
        assert target.write([joint], Request(into=once, into_name="arm.xml")).content == once


ONE = """<mujoco><option timestep="{h}" gravity="0 0 0" integrator="{integrator}"/><worldbody><body>
<joint name="{name}" type="{kind}" axis="0 0 1" armature="{J}" {more}/><inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>
</body></worldbody><actuator><motor joint="{name}"/>{actuators}</actuator></mujoco>"""
TWO = """<mujoco><option timestep="{h}" integrator="{integrator}" gravity="0 0 0"><flag contact="disable"/></option><worldbody>
<body><joint name="a" axis="0 1 0" armature="0.002"/><geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".2"/>
<body pos=".1 0 0"><joint name="b" axis="0 1 0" armature="0.001"/><geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".2"/>
</body></body></worldbody><actuator><motor joint="a"/><motor joint="b"/></actuator></mujoco>"""


def one(h: float = 0.002, **changes: Any) -> Any:
    values = {
        "name": "wrist pitch", "integrator": "Euler", "kind": "hinge", "J": 0.00868, "more": "", "actuators": "",
        **changes,
    }  # fmt: skip  # a list of values
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
        return -joint.quadratic * law.load_terms(0.0, v, 0.0, 0.0)["quadratic"]

    return radau_continuous(joint, drive, t, drag, (1e-8, 1e-11))


def off(v: Array, true: Array) -> float:
    """Per cent."""
    return 100 * float(np.sqrt(np.mean((v - true) ** 2) / np.mean(true**2)))


def test_pairs_and_stiff_bristles(handed: Handed) -> None:
    """Presliding, reversals and sliding for 10 s: velocity at most 0.5 % off at 2 ms, 0.3 % at 1 ms."""
    joint = handed("wrist pitch")
    true = continuous(joint)
    assert 0.02 < np.mean(np.abs(true) < 0.002) < 0.5
    assert np.abs(true).max() > 0.5 * joint.fastest
    assert off(velocity(joint, 0.002), true[::2]) <= 0.5
    assert off(velocity(joint, 0.001), true) <= 0.3
    # the same of laws with other peaks and terms, within v_end and beyond it, and of a quadratic term that brakes as well
    plain = handed("wrist pitch")
    for joint in (*(of_law(plain, of) for of in OTHERS[-3:]), beside(plain, quadratic=0.1)):
        true = continuous(joint, 4.0)
        assert not joint.law.terms or np.abs(true).max() > joint.fastest / 3
        assert off(velocity(joint, 0.001, 4.0), true) <= 0.5, joint.law.name
    # Euler and implicit give the same simulation
    joint = handed("wrist pitch")
    both = (velocity(joint, 0.002, 2.0, integrator=name) for name in ("Euler", "implicit"))
    assert next(both) == pytest.approx(next(both), abs=1e-12)
    # two links at 2 ms, bristles up to 1e8 times as stiff: nothing rings in stick, whatever the order of frictions
    failed = []
    for case in product((1.0, 1e4, 1e8), ((0, 1), (1, 0)), ("Euler", "implicitfast")):
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


def test_a_torque_of_ones_own_acts_as_a_control(handed: Handed, edro_results: Path) -> None:
    """The argument `torque` acts as a control does; once it is zero, the joint comes to rest."""
    joint = handed("wrist pitch")
    ends = []
    for control, argument in ((0.3, 0.0), (0.0, 0.3)):
        model = one(J=joint.inertia)
        data, friction = mujoco.MjData(model), Friction(model, "wrist pitch", joint)
        for k in range(4000):
            data.ctrl[0] = control * (k < 2000)
            friction.apply(data, torque=argument * (k < 2000))
            mujoco.mj_step(model, data)
            ends += [data.qvel[0]] * (k in (1999, 3999))
    assert ends[0] > 1
    assert ends == pytest.approx([ends[0], 0.0] * 2, rel=1e-12, abs=1e-9)
    # by its name, of results or of their file; the only one whatever the model calls it
    results, torques = bristle.read_results(edro_results), []
    for kind, result in (
        ("hinge", joint), ("hinge", results), ("hinge", str(edro_results)), ("slide", handed("wrist pitch", kind="prismatic")),
    ):  # fmt: skip  # a table
        model = one(kind=kind)
        data, friction = mujoco.MjData(model), Friction(model, "wrist pitch", result)
        data.qvel[0] = 1.0
        friction.apply(data)
        torques += [friction.torque, -data.qfrc_applied[0]]
    assert torques == [torques[0]] * 8
    assert torques[0] > 0
    other = one(name="other")
    Friction(other, "other", joint)
    with pytest.raises(InputError, match="no joint 'other'"):
        Friction(other, "other", results)


def test_what_begins_anew_repeats_itself(handed: Handed) -> None:
    """After mj_resetData the same motion comes out, also after a call at time 0 with a wild velocity; two calls at one time do as one."""
    # `reset` takes a deflection
    joint = handed("wrist pitch")
    model = one(J=joint.inertia)
    data, friction = mujoco.MjData(model), Friction(model, "wrist pitch", joint)
    data.qvel[0] = -3.0
    friction.apply(data)
    seen, used = [], (data, friction)
    fresh = mujoco.MjData(model), Friction(model, "wrist pitch", joint)
    for (data, friction), calls in ((used, 1), (used, 2), (fresh, 1)):
        mujoco.mj_resetData(model, data)
        for _ in range(50):
            data.ctrl[0] = 0.3
            for _ in range(calls):
                friction.apply(data)
            mujoco.mj_step(model, data)
        seen.append((data.qvel[0], friction.deflection, friction.torque))
    assert seen == [seen[0]] * 3
    friction.reset(1e-3)
    assert friction.deflection == 1e-3
    friction.apply(data)
    assert friction.deflection == 1e-3
    # the torque of one step, held over two, is not that of the law
    for _ in range(2):
        mujoco.mj_step(model, data)
    with pytest.raises(InputError, match="before every mj_step"):
        friction.apply(data)
    # one sentence each: the names that are there are listed; the dcmotor of an export would count twice; sigma_0 must be known
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


BALL = '<mujoco><worldbody><body><joint name="wrist pitch" type="ball"/><geom size="1"/></body></worldbody></mujoco>'

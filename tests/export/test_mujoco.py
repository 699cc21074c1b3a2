"""Friction in MJCF: what MuJoCo then does is what is written, and what is lost is said."""

import pytest

from bristle.errors import InputError
from bristle.model.parameters import Lugre
from bristle.questions.export import mjcf
from bristle.questions.export.artefact import ExportTarget, Request
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import all_motions, best_symmetric, losses, lugre
from export_checks import check
from export_checks.common import as_read

from .conftest import HOSTILE, SURROGATE, Handed, same, scaled

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


@pytest.fixture
def one_set(handed: Handed) -> ExportedJoint:
    """A joint whose directions are the same."""
    return same(handed("wrist pitch"))


def error(line: str, of: str) -> float:
    """The per cent that a line of `check` has of the model held, or of the joint."""
    return float(line.split(f" % of the {of}", maxsplit=1)[0].rsplit(maxsplit=1)[-1])


def test_one_set_is_what_mujoco_has(one_set: ExportedJoint) -> None:
    """One set imposed at 0.5 Hz and 2 ms: torque RMS error at most 0.5 % at 1, 0.1 and 0.02 rad, and nothing is lost."""
    artefact = mjcf.TARGET.write([one_set], Request())
    lines = check("mujoco", artefact, [one_set], Request())
    assert [line.split()[2] for line in lines[:3]] == ["1", "0.1", "0.02"]
    assert all(error(line, "model held") <= 0.5 for line in lines)
    assert [x.percent for x in artefact.losses[one_set.name]] == [0.0] * 4
    assert not artefact.said
    assert b"<general" not in artefact.content


@pytest.mark.parametrize("name", ["gripper rotation", "wrist pitch", "elbow pitch", "base rotation"])
def test_a_pair_loses_what_is_said(handed: Handed, name: str) -> None:
    """Directions that differ: MuJoCo has the set that is written to 0.5 %, and loses of the joint what the artefact says, to 0.5 % of the torque."""
    joint = handed(name)
    artefact = mjcf.TARGET.write([joint], Request())
    lines = check("mujoco", artefact, [joint], Request())
    assert all(error(line, "model held") <= 0.5 for line in lines)
    for line, said in zip(lines[3:], artefact.losses[name], strict=True):
        assert abs(error(line, "joint") - said.percent) < 0.6


def test_the_symmetric_set_is_the_best(handed: Handed) -> None:
    """No parameter of the set, and no bias, can be moved by 3 % and lower the cost; a bias lowers it; a term that is zero stays zero."""
    joint = handed("wrist pitch")
    motions = all_motions(joint)

    def cost(p: Lugre[float], bias: float) -> float:
        """Sum of the squared losses, which is what is minimised."""
        return sum(x.percent**2 for x in losses(joint, lugre(p, bias), motions))

    alone, both = best_symmetric(joint, motions, bias=False), best_symmetric(joint, motions)
    assert cost(*both) < cost(*alone)
    for k, name in enumerate(Lugre._fields):
        for factor in (0.97, 1.03):
            assert cost(both.parameters._replace(**{name: both.parameters[k] * factor}), both.bias) > cost(*both)
    assert all(cost(both.parameters, both.bias * factor) > cost(*both) for factor in (0.97, 1.03))
    flat = scaled(joint, alpha_1=0.0)
    assert best_symmetric(flat, all_motions(flat)).parameters.alpha_1 == 0


def test_the_largest_time_step_is_one(handed: Handed) -> None:
    """A joint at rest with a small push settles 10 % below the time step that is named, and does not 10 % above."""
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


def called(target: ExportTarget) -> str:
    """Its name."""
    return mjcf.NAME if target is mjcf.TARGET else mjcf.FRICTIONLOSS_NAME


@pytest.mark.parametrize("target", TARGETS)
def test_what_mujoco_loads_is_written(handed: Handed, target: ExportTarget) -> None:
    """Two joints, one that slides: the example loads by itself, with the armature that was identified, and checks itself.

    Of a joint whose links are known that is the rotor's alone; without an inertia none is written, which is said.
    """
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


@pytest.mark.parametrize("target", TARGETS)
def test_hostile_names_stay_names(handed: Handed, target: ExportTarget) -> None:
    """Whatever joints are called, MuJoCo loads the file, and has a body, a joint and our actuators for each, by its name."""
    joints = [handed("wrist pitch", name=name) for name in (*HOSTILE, SURROGATE) if name]
    artefact = target.write(joints, Request())
    model, n = mujoco.MjModel.from_xml_string(artefact.content.decode()), len(joints)
    assert (model.nbody, model.njnt, model.nu) == (1 + n, n, 2 * n if target is mjcf.TARGET else 0)
    assert [model.joint(k).name for k in range(n)] == [as_read(joint.name) for joint in joints]
    owned = {model.actuator(k).name: int(model.actuator(k).trnid[0]) for k in range(model.nu)}
    assert all(owned[as_read(mjcf.own_actuator(x.name))] == k for k, x in enumerate(joints) if owned)
    assert all(c.isprintable() or c == "\n" for c in artefact.content.decode())
    odd = handed("wrist pitch", name="NUL\0\x01")
    assert check(called(target), target.write([odd], Request()), [odd], Request())


@pytest.mark.parametrize("target", TARGETS)
def test_merging_touches_nothing_else(handed: Handed, target: ExportTarget) -> None:
    """Taken out again, what was inserted leaves the file as it was, byte by byte, and MuJoCo has the friction in spite of the file's defaults."""
    joint, request = handed("wrist pitch"), Request(into=ROBOT, into_name="arm.xml")
    artefact = target.write([joint], request)
    old, rest = ROBOT, artefact.content
    begin = next(k for k, (a, b) in enumerate(zip(old, rest, strict=False)) if a != b)
    assert old[:begin].endswith(b'range="-90 90"')
    assert rest.startswith(old[:begin])
    assert rest.endswith(b"\n</mujoco>\n<!-- end -->\n")
    assert old.split(b'range="-90 90"/>')[1].split(b"\n</mujoco>")[0] in rest
    lines = check(called(target), artefact, [joint], request)
    model = mujoco.MjModel.from_xml_string(rest.decode())
    assert model.dof_armature[0] == joint.inertia
    if target is mjcf.TARGET:
        assert (model.dof_damping[0], model.dof_frictionloss[0]) == (0, 0)
        assert all(error(line, "model held") <= 0.5 for line in lines)


def test_a_model_that_needs_its_files_is_merged_into(handed: Handed) -> None:
    """A mesh that is not beside the text: the merge is written, and its friction is run in the example, which is said."""
    into = ROBOT.replace(b"<worldbody>", b'<asset><mesh file="no.stl"/></asset><worldbody>')
    request = Request(into=into, into_name="arm.xml")
    lines = check("mujoco", mjcf.TARGET.write([handed("wrist pitch")], request), [handed("wrist pitch")], request)
    assert "does not load" in lines[0]
    assert len(lines) == 8


def test_an_actuator_section_is_used(handed: Handed) -> None:
    """Where the model has actuators ours come after them, so that the places of their controls stay."""
    into = ROBOT.replace(b"</worldbody>", b"</worldbody>\n  <actuator><motor name='m' joint='wrist pitch'/></actuator>")
    merged = mjcf.TARGET.write([handed("wrist pitch")], Request(into=into, into_name="arm.xml"))
    assert merged.content.count(b"<actuator>") == 1
    assert mujoco.MjModel.from_xml_string(merged.content.decode()).actuator("m").id == 0


TWICE = '<mujoco>\n<worldbody><body>\n<joint name="wrist pitch"/>{}\n<joint name="wrist pitch"/></body></worldbody></mujoco>'


@pytest.mark.parametrize("target", TARGETS)
def test_what_cannot_be_merged_into_is_refused(handed: Handed, target: ExportTarget) -> None:
    """A missing joint, one that stands twice, one of another kind, a document type and another format: one sentence each.

    Into a model that holds LuGre already nothing is merged, which would count twice; frictionloss is written anew, and is the same.
    """
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

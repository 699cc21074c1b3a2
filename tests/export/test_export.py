import json
import math
import os
import re
import shlex
import shutil
import subprocess
import zipfile
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any, get_args

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bristle
from bristle.errors import InputError
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.known_joint import chosen
from bristle.identification.verdict import Trust
from bristle.model.parameters import Direction, Kind, Lugre, Pair, ParameterName, Stribeck, unit
from bristle.questions.export.export import TARGETS, Request, export_joints, target
from bristle.questions.export.exported import ExportedJoint, ExportedParameter, Origin, exported
from bristle.questions.export.json_document import as_json, export_schema, joints_in, read_export, write_json
from bristle.questions.export.latex import latex_text, write_latex
from bristle.questions.export.loss import (
    all_motions,
    best_coulomb_viscous,
    coulomb_viscous,
    friction_of,
    losses,
    lugre,
    stated_motions,
)
from bristle.questions.export.matlab import write_matlab
from export_checks.common import NotInstalled
from export_checks.documents import check_json, check_latex, check_matlab

from ..conftest import FEW, present, run, speeds, write
from .conftest import HOSTILE, Handed, assumed, beside

LAW = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)
DOCS = Path(__file__).parents[2] / "docs"


def test_values_are_those_to_use(edro_results: Path) -> None:
    """Of each joint the exported value, error, interval and source of every parameter are those of the report's first screen."""
    results = bristle.read_results(edro_results)
    for joint, handed in zip(results.joints, results.export("json").joints, strict=True):
        rows = {row.parameter: row for row in chosen(joint) if row.estimate.value is not None}
        assert rows.keys() == {x.parameter for x in handed.parameters}
        for x in handed.parameters:
            e = rows[x.parameter].estimate
            expected = (e.value, e.standard_error, e.interval, e.unit, str(rows[x.parameter].source))
            assert (x.value, x.standard_error, x.interval, x.unit, x.source) == expected
        assert handed.simulated
        assert handed.origin.logs == {one.file: one.sha256 for one in joint.inputs}
    # slow loading and an inertia give sigma_1 by (15), an assumption: its source is `assumed`, and the warning goes along
    joint = replace(results.joint("wrist pitch"), tracking=None, joint_fit=None)
    one = exported(
        joint, results.logs.experiment_of(joint), Origin(bristle="0", results_sha256=None, experiment=None, logs={})
    )
    assert {x.source for x in one.parameters if x.parameter.name == "sigma_1"} == {"assumed"}
    assert {x.source for x in one.parameters if x.parameter.name == "sigma_0"} == {"presliding"}
    assert "prior" in {x.code for x in one.said}
    # Coulomb and Stribeck compensators have losses; the LuGre ones have none
    for name, least in (("coulomb", 20.0), ("stribeck", 0.01)):
        handed_over = bristle.export(edro_results, "c", joint="wrist pitch", compensator=name)
        (found,) = handed_over.artefact.losses.values()
        assert max(x.percent for x in found) > least
    assert not bristle.export(edro_results, "c", joint="wrist pitch").artefact.losses
    plain, theta = (
        bristle.export(results, "c", joint="wrist pitch", adapt=law) for law in ("partial", "partial-theta")
    )
    assert present(plain.request.compensator.adaptation).gamma == (20.0, 20.0)
    assert present(theta.request.compensator.adaptation).gamma != (20.0, 20.0)


@pytest.mark.parametrize("to", TARGETS)
def test_every_target_is_written_by_the_command(
    to: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, edro_results: Path
) -> None:
    """The command writes one file by the joint's name, says SIMULATED, and the same bytes a second time; a file that is there stays."""
    monkeypatch.chdir(tmp_path)
    ran = run("export", edro_results, "--to", to, "--joint", "wrist pitch")
    assert (ran.code, ran.said) == (0, [])
    (written,) = tmp_path.iterdir()
    assert written.name.startswith("wrist_pitch")
    assert f"File: {written.name}" in ran.out
    assert "SIMULATED" in ran.words
    again = tmp_path / "again"
    assert run("export", edro_results, "--to", to, "--joint", "wrist pitch", "-o", again).code == 0
    assert again.read_bytes() == written.read_bytes()
    refused = run("export", edro_results, "--to", to, "--joint", "wrist pitch", "-o", again)
    assert refused.code == 2
    assert "is there already" in refused.err


REFUSED = {
    "--to urd": "to: got 'urd'; expected one of c, mujoco",
    "--to c": "c holds one joint, and the results have 4: say which with joint, one of gripper rotation",
    "--to urdf --joint knee": "joint: got 'knee'; expected one of gripper rotation",
    "--to urdf --adapt partial": "urdf holds no compensator; leave compensator and adapt out",
    "--to c --joint 'wrist pitch' --step gradient": "give adapt as well",
    "--to c --joint 'wrist pitch' --adapt best": "law: got 'best'; expected one of printed",
    "--to c --joint 'wrist pitch' --compensator pid": "compensator: got 'pid'; expected one of",
    "--to c --joint 'wrist pitch' --adapt total --compensator coulomb": "coulomb cannot adapt",
    "--to c --joint 'wrist pitch' --into a.urdf": "into: c is written as a file of its own",
    "--to urdf --into none.urdf": "no such file",
    "--to urdf --amplitude '-1 rad'": "amplitude: got -1 rad; expected a quantity above 0",
    "--to urdf --amplitude '1 s'": "amplitude: unit 's' is not a unit of rad",
    "--to json --amplitude '1 rad'": "json has no values that are fitted along a motion",
    "--to urdf --frequency '0 Hz'": "frequency: got 0 Hz; expected a quantity above 0",
}


def test_bad_requests_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, edro_results: Path) -> None:
    """One sentence, exit code 2, and nothing written."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.urdf").write_text("<robot/>", encoding="utf-8")
    failed = []
    for asked, sentence in REFUSED.items():
        ran = run("export", edro_results, *shlex.split(asked), "-o", "out")
        failed += [(asked, ran)] * ((ran.code, len(ran.said)) != (2, 1) or sentence not in ran.err)
    assert failed == []
    assert [path.name for path in tmp_path.iterdir()] == ["a.urdf"]


def test_points_alone_have_no_bristle(tmp_path: Path) -> None:
    """A joint of constant velocities goes where no bristle is needed, without sigma_0 and sigma_1; where one is, it is refused."""
    results = bristle.identify(write(tmp_path, speeds()))
    path = tmp_path / "results.json"
    path.write_text(results.to_json(tmp_path), encoding="utf-8")
    points = path
    handed = bristle.export(points, "json").joints[0]
    assert {x.parameter.name for x in handed.parameters} == {*Stribeck._fields}
    assert not handed.has_bristle
    assert "presliding" not in [motion.name for motion in stated_motions(handed)]
    for to in ("c", "mujoco", "fmu"):
        ran = run("export", points, "--to", to, "-o", tmp_path / "out")
        assert ran.code == 2
        assert f"sigma_0 is not identified, and {to} " in ran.err
    ran = run("export", points, "--to", "urdf", "-o", tmp_path / "out.urdf")
    assert ran.code == 0
    assert "The bristle (sigma_0, sigma_1) is not identified, and is not exported" in ran.words
    assert "is not exported" in (tmp_path / "out.urdf").read_text(encoding="utf-8")
    curve = bristle.export(points, "urdf")
    (losses_of,) = curve.artefact.losses.values()
    assert [x.motion.name for x in losses_of] == ["fitted", "medium", "slow"]
    assert losses_of[0].percent < 5
    assert run("export", points, "--to", "c", "--compensator", "stribeck", "-o", tmp_path / "out.h").code == 0
    # alpha_1 may be none, v_s may not: a note and a caution
    data = json.loads(points.read_text(encoding="utf-8"))
    fits = data["joints"]["wrist"]["static"]
    for fit in fits.values():
        fit["parameters"]["alpha_1"]["interval"] = [-1.0, 1.0]
        fit["parameters"]["v_s"]["interval"] = [-1.0, 1.0]
    points.write_text(json.dumps(data), encoding="utf-8")
    said = bristle.export(points, "json").joints[0].said
    assert {"interval-with-zero", "interval-with-zero-impossible"} <= {x.code for x in said}
    # what is known in one direction alone is no joint that can be handed over
    ran = run("export", write(tmp_path, speeds(both=False)), "--to", "urdf", "-o", tmp_path / "out")
    assert ran.code == 2
    assert "nothing is known of the friction vs velocity in direction -" in ran.err
    few = run("export", write(tmp_path / "few", FEW), "--to", "urdf", "-o", tmp_path / "out")
    assert few.code == 2


NUMBERS_ONLY = ("mujoco-frictionloss", "urdf", "sdf", "isaac")  # targets with values that stand for the friction
DOCUMENTS = ("json", "matlab", "latex")


@pytest.mark.parametrize("to", [to for to in TARGETS if to != "json"])
def test_an_artefact_says_where_its_numbers_are_from(to: str, handed: Handed) -> None:
    """Version, hash, data, trust, every parameter with its interval, what is assumed and the losses stand in it."""
    joint = assumed(handed("wrist pitch"), "sigma_1")
    artefact = target(to).write([joint], Request())
    content = artefact.content
    if to == "fmu":
        with zipfile.ZipFile(BytesIO(content)) as archive:
            content = archive.read("sources/joint.h")
    text = re.sub(r"\s+(\* )?", " ", content.decode())
    said = [
        "identified by bristle 0", "sha256 " + "0" * 64, "experiment: edro.yaml, 1 logs", "SIMULATED", "ASSUMED",
        "95 % [",
    ]  # fmt: skip  # a list of values
    said += ["torque RMS error"] if artefact.losses else []
    said += ["Test vector", "N*m*s/rad, [0, 10000]"] if to == "c" else []
    said += [f"{x.parameter} = " for x in joint.parameters]
    assert [part for part in said if part not in text] == []


@pytest.mark.parametrize("to", TARGETS)
def test_what_is_lost_and_left_out_is_said(to: str, handed: Handed) -> None:
    """Losses above ten per cent are a caution, and so is what was identified beside the friction; v abs(v) counts in the losses."""
    joint = beside(handed("wrist pitch"), offset=0.1, quadratic=0.2)
    artefact = target(to).write([joint], Request())
    names = {"names": ("offset",)} if to in NUMBERS_ONLY else {"names": ("offset", "quadratic")}
    if to in DOCUMENTS:
        assert (artefact.losses, artefact.said) == ({}, ())
        return
    found = artefact.losses[joint.name]
    *lost, beside_it = artefact.said
    assert found[0].percent > 1
    assert [x.code for x in lost] == ["export-loses"] * any(x.percent > 10 for x in found)
    large = ", ".join(f"{x.percent:.0f} % {x.motion.name}" for x in found if x.percent > 10)
    assert all(f"wrist pitch: {to} cannot hold this friction; the torque RMS error is {large}." in str(x) for x in lost)
    assert beside_it.code == "export-leaves-out"
    assert names.items() <= beside_it.numbers.items()
    assert f"{to} does not hold {' and '.join(names['names'])}, identified beside the friction" in str(beside_it)
    if to in NUMBERS_ONLY:
        plain = target(to).write([handed("wrist pitch")], Request()).losses[joint.name]
        assert [x.percent > 10 for x in plain] == [True] * 4


def test_which_joints_a_target_takes_and_what_is_said(handed: Handed, edro_results: Path) -> None:
    """A joint whose torque is known as one, or per inertia, goes to the documents, to C and to the FMU, and is refused elsewhere."""
    request = Request()
    for kind, alone in (
        ("revolute in A", "current alone, .* give motor\\.torque_constant, id"),
        ("revolute in V", "voltage alone, .* give motor\\.torque_constant and motor\\.resistance, id"),
        ("revolute per inertia", "deceleration alone, .* give coasting\\.inertia or coasting\\.gravity, id"),
    ):
        joint = handed(kind=kind)
        for to in TARGETS:
            if to in ("c", "fmu", *DOCUMENTS):
                assert target(to).write([joint], request).content
            else:
                with pytest.raises(bristle.InputError, match=f"known as a {alone}"):
                    target(to).write([joint], request)
    # a joint that a target cannot take is left out and named; where it takes none, that is refused
    good, bad = handed("wrist pitch"), handed("elbow pitch", kind="revolute in A")
    one = export_joints([good, bad], "urdf", Request())
    assert [joint.name for joint in one.joints] == ["wrist pitch"]
    assert "Left out: elbow pitch: its torque is known as a current alone" in one.text().replace("\n", " ")
    with pytest.raises(bristle.InputError, match="known as a current alone"):
        export_joints([bad, bad], "urdf", Request())
    # base rotation is not passive, which stands in what is printed and in the artefact; an interval that holds zero is said too
    handed_over = bristle.export(edro_results, "c", joint="base rotation")
    assert "can feed energy back in direction -" in " ".join(handed_over.text().split())
    assert b"can feed energy back in direction -" in handed_over.content
    one = handed("base rotation")
    assert one.reason is None
    assert "not-passive" in [x.code for x in one.said]
    # of `both` directions, + and - are the same set
    joint = handed()
    both = tuple(
        replace(x, parameter=x.parameter._replace(direction=Direction.BOTH))
        for x in joint.parameters
        if x.parameter.direction == Direction.POSITIVE
    )
    pair = replace(joint, parameters=both).pair
    assert pair.positive == pair.negative == joint.pair.positive
    assert len(both) == len(Lugre._fields)
    # a symmetric curve and a bristle per direction: both directions are exported, with the bristle
    v = np.concatenate([np.geomspace(0.015, 0.8, 12), -np.geomspace(0.015, 0.8, 12)])
    T = bristle.friction(v, LAW) + 2e-5 * np.random.default_rng(0).standard_normal(v.size)
    t = np.arange(0, 8, 0.002)
    load = 0.02 * np.interp(t, [0, 2, 6, 8], [0, 1, -1, 0])
    bend = np.cumsum(np.diff(load, prepend=0.0) / (6.0 * (1 - np.abs(load) / 0.026)))
    slow = bristle.fit_presliding(t, bend, load, breakaway=bristle.fit(v, T, directions="symmetric"))
    known = {row.parameter: row.estimate.value for row in chosen(slow.joint) if row.estimate.value is not None}
    assert ParameterName("sigma_0", Direction.POSITIVE) in known
    one = bristle.export(slow, "json").joints[0]
    assert one.has_bristle
    assert one.pair.positive.sigma_0 == known[ParameterName("sigma_0", Direction.POSITIVE)]


def test_the_loss_is_its_formula(handed: Handed) -> None:
    """100 rms(difference) / rms(torque) over the last period; nothing of the joint's own friction, all of none at all."""
    # with a term v abs(v) the best viscous value rises, and the loss of LuGre alone is that of the term
    joint = handed("wrist pitch")
    motions = all_motions(joint)
    assert [x.percent for x in losses(joint, lugre(joint.pair), motions)] == [0.0] * 4
    assert [x.percent for x in losses(joint, coulomb_viscous(0.0, 0.0), motions)] == [100.0] * 4
    one = Pair(joint.pair.positive, joint.pair.positive)
    kept = [friction_of(joint)(m.velocity, m.step)[-2000:] for m in motions]
    for motion, found, true in zip(motions, losses(joint, lugre(one), motions), kept, strict=True):
        off = lugre(one)(motion.velocity, motion.step)[-2000:] - true
        assert found.percent == pytest.approx(100 * np.sqrt(np.mean(off**2) / np.mean(true**2)), rel=1e-12)
    assert [m.name for m in motions] == ["fitted", "medium", "slow", "presliding"]
    dragged = beside(joint, quadratic=0.05)
    assert best_coulomb_viscous(dragged, motions[0])[1] > best_coulomb_viscous(joint, motions[0])[1]
    assert losses(dragged, lugre(joint.pair), motions[:1])[0].percent > 1


def example(name: str) -> str:
    text = (DOCS / "export.md").read_text(encoding="utf-8")
    found = present(re.search(rf"<!-- example: {name} -->\n```\w+\n(.*?)```", text, re.DOTALL))
    return found[1]


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc, which is not installed")
def test_the_microcontroller_of_the_docs_compiles(handed: Handed, tmp_path: Path) -> None:
    """In at most twenty lines, without a warning."""
    code = example("microcontroller")
    assert len(code.splitlines()) <= 20
    header = target("c").write([replace(handed(), name="wrist")], Request())
    (tmp_path / "wrist.h").write_bytes(header.content)
    declared = "int friction_begin(void);\nfloat friction_torque(float v);\n"
    (tmp_path / "f.c").write_text(declared + code, encoding="utf-8")
    flags = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Werror", "-std=c99", "-O2")
    done = subprocess.run(["gcc", *flags, "-c", "f.c"], cwd=tmp_path, capture_output=True, text=True, check=False)  # noqa: S603, S607
    assert done.returncode == 0, done.stderr


STUBS = """
#include <vector>
namespace rclcpp { struct Time {}; struct Duration { double seconds() const { return 1e-3; } }; }
namespace rclcpp_lifecycle { struct State {}; }
enum class CallbackReturn { SUCCESS, ERROR };
namespace controller_interface {
enum class return_type { OK };
struct Handle { double value = 0; double get_value() const { return value; } void set_value(double x) { value = x; } };
struct ControllerInterface {
    std::vector<Handle> state_interfaces_{1}, command_interfaces_{1};
    double velocity_reference_ = 0.1, effort_reference_ = 0;
    virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) = 0;
    virtual return_type update(const rclcpp::Time &, const rclcpp::Duration &) = 0;
    virtual ~ControllerInterface() = default;
};
}
"""
MAIN = """
int main()
{
    FrictionCompensation c;
    if (c.on_activate(rclcpp_lifecycle::State{}) != CallbackReturn::SUCCESS) return 1;
    for (int k = 0; k < 3000; k++) c.update(rclcpp::Time{}, rclcpp::Duration{});
    return c.command_interfaces_[0].value > 0.01 ? 0 : 2;
}
"""


@pytest.mark.skipif(shutil.which("g++") is None, reason="needs g++, which is not installed")
def test_the_controller_of_the_docs_runs(handed: Handed, tmp_path: Path) -> None:
    """With stand-ins for ros2_control's classes it compiles, and after 3 s at 0.1 rad/s asks for the joint's friction."""
    code = example("ros2_control")
    assert len(code.splitlines()) <= 20
    header = target("c").write([replace(handed(), name="wrist")], Request())
    (tmp_path / "wrist.h").write_bytes(header.content)
    (tmp_path / "f.cpp").write_text(STUBS + code + MAIN, encoding="utf-8")
    build = ["g++", "-std=c++17", "-O2", "-o", "f", "f.cpp"]
    done = subprocess.run(build, cwd=tmp_path, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stderr
    assert subprocess.run([tmp_path / "f"], check=False).returncode == 0  # noqa: S603


DOCS = Path(__file__).parents[2] / "docs"
NAMES = ("gripper rotation", "wrist pitch", "elbow pitch", "base rotation")
ASK = Request()
positive = st.floats(1e-300, 1e300)
ends = st.floats(allow_nan=False)
intervals = st.tuples(ends, ends).map(lambda x: (min(x), max(x)))
words = st.text(st.characters(codec="utf-8"), max_size=12)


def _holding(interval: tuple[float, float], value: float) -> tuple[float, float]:
    return min(*interval, value), max(*interval, value)


@st.composite
def parameters(draw: st.DrawFn, kind: Kind) -> tuple[ExportedParameter, ...]:
    """A whole set for both directions, or one of each."""
    directions = draw(st.sampled_from([(Direction.BOTH,), (Direction.POSITIVE, Direction.NEGATIVE)]))
    names = [ParameterName(name, d) for d in directions for name in Lugre._fields]
    shared = draw(st.lists(st.sampled_from(["inertia", "offset", "gravity_sin", "quadratic"]), unique=True))
    names += [ParameterName(name, Direction.SHARED) for name in shared]
    values = [draw(positive) for _ in names]
    return tuple(
        ExportedParameter(
            parameter=name, value=value, unit=unit(name.name, kind),
            standard_error=draw(st.none() | positive | st.just(math.inf)),
            interval=draw(st.none() | st.builds(_holding, intervals, st.just(value))),
            source=draw(st.sampled_from(["joint", "static", "given", "assumed"])),
        )
        for name, value in zip(names, values, strict=True)
    )  # fmt: skip  # a list of values


diagnostics = st.one_of(
    st.builds(
        lambda x, y: Finding("not-passive", CAUTION, f"{x:.3g} < {y:.3g}", {"direction": Direction.POSITIVE, "alpha_2": x, "least": y}),
        positive,
        positive,
    ),
    st.builds(lambda x: Finding("interval-with-zero", NOTE, x, {"name": x}), words),
    st.builds(lambda x: Finding("bristle-filled", CAUTION, f"assumed {x:.3g} N*m/rad", {"name": "sigma_0", "value": x}), positive),
)  # fmt: skip  # a list


@st.composite
def made(draw: st.DrawFn) -> ExportedJoint:
    kind: Kind = draw(st.sampled_from(get_args(Kind)))
    return ExportedJoint(
        name=draw(words), kind=kind, simulated=draw(st.booleans()), trust=draw(st.sampled_from(Trust)),
        reason=draw(st.none() | diagnostics), parameters=draw(parameters(kind)), inertia=draw(st.none() | positive),
        rotor_inertia=draw(st.none() | positive),
        fastest=draw(positive), said=tuple(draw(st.lists(diagnostics, max_size=2))),
        origin=Origin(bristle=draw(words), results_sha256=draw(st.none() | words), experiment=draw(st.none() | words),
                      logs=draw(st.dictionaries(words, words, max_size=2))),
    )  # fmt: skip  # a list of values


def robot(handed: Handed) -> list[ExportedJoint]:
    return [handed(name) for name in NAMES]


def test_documents_and_their_schema(handed: Handed, tmp_path: Path) -> None:
    """docs/export.schema.json is what `export_schema()` gives; BRISTLE_REGENERATE=1 rewrites it."""
    text = json.dumps(export_schema(), indent=2) + "\n"
    path = DOCS / "export.schema.json"
    if os.environ.get("BRISTLE_REGENERATE"):
        path.write_text(text, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == text
    # the schema is not empty words: a parameter without its unit is refused
    document = json.loads(as_json([handed()]))
    jsonschema.validate(document, export_schema())
    del document["joints"][0]["parameters"][0]["unit"]
    with pytest.raises(jsonschema.ValidationError, match="unit"):
        jsonschema.validate(document, export_schema())
    # a value that was filled in has the source `assumed`; a diagnostic has its code, severity and sentence, with units
    joint = handed("base rotation")
    row = replace(joint.parameters[0], source="assumed", standard_error=None, interval=(0.0, math.inf))
    document = json.loads(as_json([replace(joint, parameters=(row, *joint.parameters[1:]))]))["joints"][0]
    assert document["parameters"][0]["source"] == "assumed"
    assert document["parameters"][0]["standard_error"] is None
    assert document["parameters"][0]["interval"] == [0.0, "inf"]
    assert document["reason"] is None
    (said,) = document["said"]
    assert (said["severity"], said["code"]) == ("caution", "not-passive")
    assert "N*m*s/rad" in said["message"]
    # every joint of the report comes back as it was, and the check says so; a name is a name, whatever it looks like
    joints = [*robot(handed), *(handed("wrist pitch", name=name) for name in HOSTILE)]
    artefact = write_json(joints, ASK)
    (tmp_path / artefact.name).write_bytes(artefact.content)
    assert read_export(tmp_path / artefact.name) == tuple(joints)
    assert check_json(artefact, joints, ASK) == ("bristle-export/1: valid", "read back: equal to the last bit")
    assert check_json(artefact, joints[:2], ASK)[1] == "read back: NOT what was exported"
    # other schemas, missing parameters, impossible numbers and whatever else a file may hold: one sentence that names the file
    none = "is not a document of schema bristle-export/1 ("
    cases: list[tuple[str, bytes | None, str, str]] = []
    cases += [("e.json", text.encode(), none, why) for why, text in spoilt(as_json([handed("wrist pitch")])).items()]
    cases += [("e.json", b"\xff", none, ""), ("e.yaml", b"a: 2020-01-01", none, ""), ("e.json", b"[1]", none, "")]
    cases += [
        ("e.json", b" " * 10_000_001, "is larger than 10000000 bytes", ""),
        ("none/e.json", None, "no such file", ""),
    ]
    failed = []
    for name, content, begins, why in cases:
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(InputError) as error:
            read_export(path)
        named = str(error.value).startswith(f"{path}: {begins}")
        if not (named and (why in str(error.value) or why in {"recursion", "Unable to"})):
            failed.append((why, str(error.value)))
    assert failed == []


@pytest.mark.slow
@settings(max_examples=60)
@given(made())
def test_any_joint_comes_back(joint: ExportedJoint) -> None:
    """Each number, name and sentence is the same again, whatever it is; the document satisfies its schema."""
    text = write_json([joint], ASK).content.decode()
    (read,) = joints_in(text)
    assert read == joint
    assert as_json([read]) == as_json([joint])
    jsonschema.validate(json.loads(text), export_schema())


def changed(text: str, **fields: Any) -> str:
    document = json.loads(text)
    document["joints"][0].update(fields)
    return json.dumps(document)


def spoilt(text: str) -> dict[str, str]:
    document = json.loads(text)
    rows = document["joints"][0]["parameters"]
    error = json.dumps(rows[0]["standard_error"])
    return {
        "bristle-export/1": text.replace("bristle-export/1", "bristle-export/9"),
        "has no parameter 'alpha_0+'": changed(text, parameters=rows[1:]),
        "has parameter 'alpha_0+' twice": changed(text, parameters=[rows[0], *rows]),
        "got alpha_0+ = -1 N*m; expected more than 0": changed(text, parameters=[{**rows[0], "value": -1.0}, *rows[1:]]),
        "got v_s+ = 0 rad/s; expected": changed(text, parameters=[*rows[:3], {**rows[3], "value": 0.0}, *rows[4:]]),
        "got fastest = 0": changed(text, fastest=0.0),
        "got inertia = -1": changed(text, inertia=-1.0),
        "got rotor_inertia = 0": changed(text, rotor_inertia=0.0),
        "alpha_0+ has a standard error below zero": changed(text, parameters=[{**rows[0], "standard_error": -1.0}, *rows[1:]]),
        "joint 'wrist pitch': got alpha_0+ ": changed(text, parameters=[{**rows[0], "interval": [2.0, 1.0]}, *rows[1:]]),
        "is there twice": json.dumps({**document, "joints": document["joints"] * 2}),
        "valid number": changed(text, fastest="1"),
        "Out of range float": text.replace(error, "NaN"),
        "not JSON compliant": text.replace(error, "1e999"),
        "more than 1000000": "[" + "," * 1_000_001 + "]",
        "line 1 column 1": "",
        "recursion": "[" * 100_000,
        "Unable to": "null",
        "has 101 joints": json.dumps({**document, "joints": document["joints"] * 101}),
    }  # fmt: skip  # a table


TEXT = r"(?:'(?:[^'\n]|'')*'|native2unicode\(uint8\(\[[\d ]*\]\), 'UTF-8'\))"
NUMBER = r"(?:-?\d[\d.e+-]*|-?Inf|NaN|\[\])"
VALUE = rf"(?:{TEXT}|{NUMBER}|true|false|\[{NUMBER}, {NUMBER}\])"
ASSIGNED = re.compile(
    rf"[A-Za-z]\w{{0,62}}(?:\.[A-Za-z]\w{{0,62}})* = (?:struct\((?:'\w+', {VALUE}(?:, )?)*\)|{VALUE});(?: % .*)?",
    re.ASCII,
)
"""All that a line of the script is, beside comments."""


def test_a_script_for_matlab_assigns_every_value_and_nothing_else(handed: Handed) -> None:
    """Whatever the joint is called, each line is a comment or one assignment of constants, in ASCII; its name is there, byte by byte."""
    failed: list[tuple[str, object]] = []
    for name in (*HOSTILE, *NAMES):
        joint = handed("wrist pitch", name=name)
        alone = write_matlab([joint], ASK)
        both = write_matlab([joint, handed("wrist pitch")], ASK).content + alone.content
        for line in both.decode("ascii").splitlines():
            comment = line.startswith("%") and not line.startswith(("%{", "%}"))
            failed += [(name, line)] * (not comment and not ASSIGNED.fullmatch(line))
        (shown,) = re.findall(r"^\w+\.name = (.*);$", alone.content.decode(), re.MULTILINE)
        codes = re.search(r"\[([\d ]*)\]", shown)
        as_bytes = bytes(map(int, codes[1].split())).decode() if "uint8" in shown and codes else None
        read = shown[1:-1].replace("''", "'") if as_bytes is None else as_bytes
        failed += [(name, (read, alone.name))] * (read != name or not re.fullmatch(r"[a-z]\w*_friction\.m", alone.name))
    assert failed == []
    # values, units, errors, intervals and sources of every joint are in the script, every digit of them
    joints = robot(handed)
    rows = (
        replace(joints[0].parameters[0], source="assumed", interval=(0.0, math.inf), standard_error=None),
        *joints[0].parameters[1:],
    )
    joints[0] = replace(joints[0], parameters=rows)
    text = write_matlab(joints, ASK).content.decode()
    assert (
        f"robot.gripper_rotation.positive.alpha_0 = struct('value', {rows[0].value!r}, 'unit', 'N*m', 'standard_error', [], "
        in text
    )
    assert "'interval', [0.0, Inf], 'source', 'assumed', 'assumed', true);" in text
    for joint in joints:
        for one in joint.parameters:
            assert f"'value', {one.value!r}, 'unit', '{one.unit}'" in text
    for part in ("SIMULATED", "sha256 " + "0" * 64):
        assert part in text


def test_the_script_runs_in_octave(handed: Handed) -> None:
    """Octave has each value to the last bit."""
    joints = [*robot(handed), *(handed("wrist pitch", name=name) for name in HOSTILE[:4])]
    try:
        said = check_matlab(write_matlab(joints, ASK), joints, ASK)
    except NotInstalled as missing:
        pytest.skip(f"needs Octave: {missing}")
    assert said[0].endswith("as exported, to the last bit")
    assert "NOT" not in said[0]


def test_the_table_of_a_paper(handed: Handed) -> None:
    """Without its escapes a name has no special character, is short, and stands on one line; comments are ASCII."""
    failed = []
    for name in (*HOSTILE, *NAMES):
        text = latex_text(name)
        bare = re.sub(r"\\(?:text[a-z]+\{\}|[{}$&#%_])|\{''\}|\{-\}", "", text)
        content = write_latex([handed("wrist pitch", name=name), handed("wrist pitch")], ASK).content.decode()
        lines = content.splitlines()
        title = next(line for line in lines if line.startswith("\\multicolumn"))
        held = (
            not set(bare) & set('\\{}$&#%_^~<>|"'),
            text.isprintable(),
            all(c.isascii() or "\u00c0" <= c <= "\u00ff" for c in text),
            content.count("\\begin{table}") == content.count("\\end{table}") == 1,
            title == rf"\multicolumn{{5}}{{l}}{{{text}}} \\",
            all(line.isascii() for line in lines if line.startswith("%")),
            max(map(len, lines)) < 2000,
        )
        failed += [(name, held)] * (not all(held))
    assert failed == []
    # values are rounded to two digits of their errors; what is assumed has an asterisk, which the caption explains; no package is needed
    joint = handed("wrist pitch")
    rows = assumed(joint, "sigma_1").parameters
    text = write_latex([replace(joint, parameters=rows)], ASK).content.decode()
    assert r"$\alpha_0^+$ & $0.07053 \pm 0.00022$ & N\,m & $[0.07010, 0.07096]$ & joint fit \\" in text
    sigma_1 = next(x.value for x in rows if x.parameter == ("sigma_1", "+"))
    assert rf"$\sigma_1^+$ & ${sigma_1:.4g}$$^*$ & N\,m\,s/rad &  & assumed \\" in text
    assert r"inertia & $0.008682 \pm 0.000015$ & kg\,m$^2$ & $[0.008652, 0.008712]$ & joint fit \\" in text
    assert "Values with an asterisk are assumed, not identified." in text
    assert "asterisk" not in write_latex([joint], ASK).content.decode()
    assert "Identified from simulated data." in text
    assert "usepackage" not in text
    assert "rule" not in text
    extreme = replace(rows[0], value=1.23456e-9, standard_error=4.5e-12, interval=(-math.inf, 1e-7))
    text = write_latex([replace(joint, parameters=(extreme, *rows[1:]))], ASK).content.decode()
    assert r"$(1.2346 \pm 0.0045) \times 10^{-9}$ & N\,m & $[-\infty, 1 \times 10^{-7}]$" in text


def test_latex_sets_the_table(handed: Handed) -> None:
    """LaTeX takes it, whatever the joints are called."""
    joints = [*robot(handed), *(handed("wrist pitch", name=name) for name in HOSTILE)]
    try:
        said = check_latex(write_latex(joints, ASK), joints, ASK)
    except NotInstalled as missing:
        pytest.skip(f"needs pdflatex: {missing}")
    assert said == ("pdflatex: sets it",)

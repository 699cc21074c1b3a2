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

import jsonschema
import numpy as np
import pytest

import bristle
from bristle.identification.known_joint import chosen
from bristle.model.parameters import Direction, ParameterName, Stribeck
from bristle.questions.export.export import TARGETS, Request, export_joints, target
from bristle.questions.export.exported import ExportedJoint, Origin, exported
from bristle.questions.export.json_document import export_schema, write_json
from bristle.questions.export.latex import latex_text, write_latex
from bristle.questions.export.loss import (
    all_motions,
    best_coulomb_viscous,
    coulomb_viscous,
    losses,
    lugre,
)
from bristle.questions.export.matlab import write_matlab
from export_checks.documents import check_json

from ..conftest import present, run, speeds, write
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
    # Coulomb and Stribeck compensators have losses, the LuGre one has none; rates are those of the joint's loop
    lost = {}
    for name in ("coulomb", "stribeck", "lugre"):
        artefact = bristle.export(results, "c", joint="wrist pitch", compensator=name).artefact
        lost[name] = max((x.percent for found in artefact.losses.values() for x in found), default=0.0)
    assert min(lost["coulomb"], lost["stribeck"]) > 20 > lost["lugre"] == 0
    for law, same in (("partial", True), ("partial-theta", False)):
        request = bristle.export(results, "c", joint="wrist pitch", adapt=law).request
        assert (present(request.compensator.adaptation).gamma == (20.0, 20.0)) == same


@pytest.mark.parametrize("to", TARGETS)
def test_every_target_is_written_and_says_what_it_is(
    to: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, edro_results: Path, handed: Handed
) -> None:
    """The command writes one file by the joint's name, says SIMULATED, and the same bytes a second time; a file that is there stays."""
    monkeypatch.chdir(tmp_path)
    ran = run("export", edro_results, "--to", to, "--joint", "wrist pitch")
    assert (ran.code, ran.said) == (0, [])
    (written,) = tmp_path.iterdir()
    assert written.name.startswith("wrist_pitch")
    assert f"File: {written.name}" in ran.out
    assert "SIMULATED" in ran.words
    first = written.read_bytes()
    refused = run("export", edro_results, "--to", to, "--joint", "wrist pitch")
    assert (refused.code, "is there already" in refused.err, written.read_bytes()) == (2, True, first)
    assert run("export", edro_results, "--to", to, "--joint", "wrist pitch", "-o", "again").code == 0
    assert (tmp_path / "again").read_bytes() == first
    # version, hash, data, trust, every parameter with its interval, what is assumed and the losses stand in it
    joint = assumed(handed("wrist pitch"), "sigma_1")
    artefact = target(to).write([joint], Request())
    content = artefact.content
    if to == "fmu":
        with zipfile.ZipFile(BytesIO(content)) as archive:
            content = archive.read("sources/joint.h")
    text = re.sub(r"\s+(\* )?", " ", content.decode())
    held = [
        "identified by bristle 0",
        "experiment: edro.yaml, 1 logs",
        "SIMULATED",
        "ASSUMED",
        "95 % [",
        "sha256 " + "0" * 64,
    ]
    held += ["torque RMS error"] if artefact.losses else []
    held += ["Test vector", "N*m*s/rad, [0, 10000]"] if to == "c" else []
    held += [f"{x.parameter} = " for x in joint.parameters]
    assert to == "json" or [part for part in held if part not in text] == []
    # losses above ten per cent are a caution, and so is what was identified beside the friction; v abs(v) counts in the losses
    joint = beside(handed("wrist pitch"), offset=0.1, quadratic=0.2)
    artefact = target(to).write([joint], Request())
    if to in DOCUMENTS:
        assert (artefact.losses, artefact.said) == ({}, ())
        return
    found, (*lost, beside_it) = artefact.losses[joint.name], artefact.said
    assert found[0].percent > 1
    large = ", ".join(f"{x.percent:.0f} % {x.motion.name}" for x in found if x.percent > 10)
    caution = f"wrist pitch: {to} cannot hold this friction; the torque RMS error is {large}."
    assert [(x.code, str(x).startswith(caution)) for x in lost] == [("export-loses", True)] * bool(large)
    names = ("offset",) if to in NUMBERS_ONLY else ("offset", "quadratic")
    assert (beside_it.code, beside_it.numbers["names"]) == ("export-leaves-out", names)


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
    points = tmp_path / "results.json"
    points.write_text(bristle.identify(write(tmp_path, speeds())).to_json(tmp_path), encoding="utf-8")
    handed = bristle.export(points, "json").joints[0]
    assert {x.parameter.name for x in handed.parameters} == {*Stribeck._fields}
    for to in ("c", "mujoco", "fmu"):
        ran = run("export", points, "--to", to, "-o", tmp_path / "out")
        assert ran.code == 2
        assert f"sigma_0 is not identified, and {to} " in ran.err
    ran = run("export", points, "--to", "urdf", "-o", tmp_path / "out.urdf")
    assert ran.code == 0
    assert "The bristle (sigma_0, sigma_1) is not identified, and is not exported" in ran.words
    (losses_of,) = bristle.export(points, "urdf").artefact.losses.values()
    assert [x.motion.name for x in losses_of] == ["fitted", "medium", "slow"]
    assert losses_of[0].percent < 5
    assert run("export", points, "--to", "c", "--compensator", "stribeck", "-o", tmp_path / "out.h").code == 0
    # alpha_1 may be none, v_s may not: a note and a caution
    data = json.loads(points.read_text(encoding="utf-8"))
    for fit in data["joints"]["wrist"]["static"].values():
        for name in ("alpha_1", "v_s"):
            fit["parameters"][name]["interval"] = [-1.0, 1.0]
    points.write_text(json.dumps(data), encoding="utf-8")
    said = bristle.export(points, "json").joints[0].said
    assert {"interval-with-zero", "interval-with-zero-impossible"} <= {x.code for x in said}
    # what is known in one direction alone is no joint that can be handed over
    ran = run("export", write(tmp_path, speeds(both=False)), "--to", "urdf", "-o", tmp_path / "out")
    assert ran.code == 2
    assert "nothing is known of the friction vs velocity in direction -" in ran.err


NUMBERS_ONLY = ("mujoco-frictionloss", "urdf", "sdf", "isaac")  # targets with values that stand for the friction
DOCUMENTS = ("json", "matlab", "latex")


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
    # base rotation is not passive, which stands in what is printed and in the artefact
    handed_over = bristle.export(edro_results, "c", joint="base rotation")
    assert "can feed energy back in direction -" in " ".join(handed_over.text().split())
    assert b"can feed energy back in direction -" in handed_over.content
    # of `both` directions, + and - are the same set
    joint = handed()
    both = tuple(
        replace(x, parameter=x.parameter._replace(direction=Direction.BOTH))
        for x in joint.parameters
        if x.parameter.direction == Direction.POSITIVE
    )
    pair = replace(joint, parameters=both).pair
    assert pair.positive == pair.negative == joint.pair.positive
    # a symmetric curve and a bristle per direction: both directions are exported, with the bristle
    v = np.geomspace(0.015, 0.8, 24) * np.tile([1, -1], 12)
    T = bristle.friction(v, LAW) + 2e-5 * np.random.default_rng(0).standard_normal(v.size)
    t = np.arange(0, 8, 0.002)
    load = 0.02 * np.interp(t, [0, 2, 6, 8], [0, 1, -1, 0])
    bend = np.cumsum(np.diff(load, prepend=0.0) / (6.0 * (1 - np.abs(load) / 0.026)))
    slow = bristle.fit_presliding(t, bend, load, breakaway=bristle.fit(v, T, directions="symmetric"))
    known = {row.parameter: row.estimate.value or 0.0 for row in chosen(slow.joint)}
    one = bristle.export(slow, "json").joints[0]
    assert one.has_bristle
    assert one.pair.positive.sigma_0 == known[ParameterName("sigma_0", Direction.POSITIVE)] > 0


def test_what_is_held_loses_nothing(handed: Handed) -> None:
    """Nothing is lost of the joint's own friction, all of none at all; with a term v abs(v) the best viscous value rises."""
    joint = handed("wrist pitch")
    motions = all_motions(joint)
    assert [m.name for m in motions] == ["fitted", "medium", "slow", "presliding"]
    assert [x.percent for x in losses(joint, lugre(joint.pair), motions)] == [0.0] * 4
    assert [x.percent for x in losses(joint, coulomb_viscous(0.0, 0.0), motions)] == [100.0] * 4
    dragged = beside(joint, quadratic=0.05)
    assert best_coulomb_viscous(dragged, motions[0])[1] > best_coulomb_viscous(joint, motions[0])[1]
    assert losses(dragged, lugre(joint.pair), motions[:1])[0].percent > 1


STUBS = """
namespace rclcpp { struct Time {}; struct Duration { double seconds() const { return 1e-3; } }; }
namespace rclcpp_lifecycle { struct State {}; }
enum class CallbackReturn { SUCCESS, ERROR };
namespace controller_interface {
enum class return_type { OK };
struct Handle { double value = 0; void set_value(double x) { value = x; } };
struct ControllerInterface {
    Handle command_interfaces_[1];
    double velocity_reference_ = 0.1, effort_reference_ = 0;
    virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) = 0;
    virtual return_type update(const rclcpp::Time &, const rclcpp::Duration &) = 0;
};
}
EXAMPLE
int main()
{
    FrictionCompensation c;
    if (c.on_activate(rclcpp_lifecycle::State{}) != CallbackReturn::SUCCESS) return 1;
    for (int k = 0; k < 3000; k++) c.update(rclcpp::Time{}, rclcpp::Duration{});
    return c.command_interfaces_[0].value > 0.01 ? 0 : 2;
}
"""


@pytest.mark.skipif(shutil.which("g++") is None, reason="needs g++, which is not installed")
def test_the_examples_of_the_docs_compile_and_run(handed: Handed, tmp_path: Path) -> None:
    """The microcontroller's without a warning; ros2_control's, with stand-ins for its classes, asks for the joint's friction after 3 s."""
    text = (DOCS / "export.md").read_text(encoding="utf-8")
    examples = dict(re.findall(r"<!-- example: (\w+) -->\n```\w+\n(.*?)```", text, re.DOTALL))
    assert max(len(code.splitlines()) for code in examples.values()) <= 20
    (tmp_path / "wrist.h").write_bytes(target("c").write([replace(handed(), name="wrist")], Request()).content)
    declared = "int friction_begin(void);\nfloat friction_torque(float v);\n"
    (tmp_path / "f.c").write_text(declared + examples["microcontroller"], encoding="utf-8")
    (tmp_path / "f.cpp").write_text(STUBS.replace("EXAMPLE", examples["ros2_control"]), encoding="utf-8")
    flags = (
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Wconversion",
        "-Wdouble-promotion",
        "-Werror",
        "-std=c99",
        "-O2",
        "-c",
        "f.c",
    )
    for command in (["gcc", *flags], ["g++", "-std=c++17", "-O2", "-o", "f", "f.cpp"], ["./f"]):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)  # noqa: S603
        assert (command, done.returncode) == (command, 0), done.stderr


NAMES = ("gripper rotation", "wrist pitch", "elbow pitch", "base rotation")
ASK = Request()


def robot(handed: Handed) -> list[ExportedJoint]:
    return [handed(name) for name in NAMES]


def test_documents_and_their_schema(handed: Handed) -> None:
    """docs/export.schema.json is what `export_schema()` gives; BRISTLE_REGENERATE=1 rewrites it."""
    text = json.dumps(export_schema(), indent=2) + "\n"
    path = DOCS / "export.schema.json"
    if os.environ.get("BRISTLE_REGENERATE"):
        path.write_text(text, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == text
    # the schema is not empty words: a parameter without its unit is refused
    document = json.loads(write_json([handed()], ASK).content)
    del document["joints"][0]["parameters"][0]["unit"]
    with pytest.raises(jsonschema.ValidationError, match="unit"):
        jsonschema.validate(document, export_schema())
    # a value that was filled in has the source `assumed`; a finding has its code, severity and sentence, with units
    joint = handed("base rotation")
    row = replace(joint.parameters[0], source="assumed", standard_error=None, interval=(0.0, math.inf))
    open_ended = replace(joint, parameters=(row, *joint.parameters[1:]))
    document = json.loads(write_json([open_ended], ASK).content)["joints"][0]
    shown = document["parameters"][0]
    assert (shown["source"], shown["standard_error"], shown["interval"]) == ("assumed", None, [0.0, "inf"])
    assert document["reason"] is None
    (said,) = document["said"]
    assert (said["severity"], said["code"]) == ("caution", "not-passive")
    assert "N*m*s/rad" in said["message"]
    # every joint comes back as it was, whatever its name looks like, and the check says so
    odd = replace(row, value=5e-324, standard_error=math.inf, interval=(-math.inf, 1.7e308))
    joints = [*robot(handed), open_ended, replace(joint, parameters=(odd,)), *(handed(name=name) for name in HOSTILE)]
    artefact = write_json(joints, ASK)
    assert check_json(artefact, joints, ASK) == ("bristle-export/1: valid", "read back: equal to the last bit")
    assert check_json(artefact, joints[:2], ASK)[1] == "read back: NOT what was exported"


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
        codes = re.fullmatch(r"native2unicode\(uint8\(\[([\d ]*)\]\), 'UTF-8'\)", shown)
        read = bytes(map(int, codes[1].split())).decode() if codes else shown[1:-1].replace("''", "'")
        failed += [(name, (read, alone.name))] * (read != name or not re.fullmatch(r"[a-z]\w*_friction\.m", alone.name))
    assert failed == []
    # values, units, errors, intervals and sources of every joint are in the script, every digit of them
    joints = robot(handed)
    first, *rest = joints[0].parameters
    first = replace(first, source="assumed", interval=(0.0, math.inf), standard_error=None)
    joints[0] = replace(joints[0], parameters=(first, *rest))
    text = write_matlab(joints, ASK).content.decode()
    whole = f"'value', {first.value!r}, 'unit', 'N*m', 'standard_error', [], 'interval', [0.0, Inf], 'source', 'assumed', 'assumed', true"
    assert f"robot.gripper_rotation.positive.alpha_0 = struct({whole});" in text
    rows = [f"'value', {one.value!r}, 'unit', '{one.unit}'" for joint in joints for one in joint.parameters]
    assert [row for row in rows if row not in text] == []


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
    assert "Identified from simulated data. Values with an asterisk are assumed, not identified." in text
    assert "asterisk" not in write_latex([joint], ASK).content.decode()
    extreme = replace(rows[0], value=1.23456e-9, standard_error=4.5e-12, interval=(-math.inf, 1e-7))
    text = write_latex([replace(joint, parameters=(extreme, *rows[1:]))], ASK).content.decode()
    assert r"$(1.2346 \pm 0.0045) \times 10^{-9}$ & N\,m & $[-\infty, 1 \times 10^{-7}]$" in text

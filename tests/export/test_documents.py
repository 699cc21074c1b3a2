import json
import math
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.errors import InputError
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.verdict import Trust
from bristle.model.parameters import Direction, Kind, Lugre, ParameterName, unit
from bristle.questions.export.export import Artefact, Request
from bristle.questions.export.exported import ExportedJoint, ExportedParameter, Origin
from bristle.questions.export.json_document import as_json, export_schema, joints_in, read_export, write_json
from bristle.questions.export.latex import latex_text, write_latex
from bristle.questions.export.matlab import write_matlab
from export_checks.common import NotInstalled
from export_checks.documents import check_json, check_latex, check_matlab

from .conftest import HOSTILE, Handed, assumed

DOCS = Path(__file__).parents[2] / "docs"
NAMES = ("gripper rotation", "wrist pitch", "elbow pitch", "base rotation")
ASK = Request()
positive = st.floats(1e-300, 1e300)
ends = st.floats(allow_nan=False)
intervals = st.tuples(ends, ends).map(lambda x: (min(x), max(x)))
words = st.text(st.characters(codec="utf-8"), max_size=12)


def _holding(interval: tuple[float, float], value: float) -> tuple[float, float]:
    """The interval, widened to hold a value."""
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
    """Any joint that can be exported."""
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
    """Every joint of the embedded report."""
    return [handed(name) for name in NAMES]


def saved(folder: Path, artefact: Artefact) -> Path:
    """The file."""
    path = folder / artefact.name
    path.write_bytes(artefact.content)
    return path


def test_the_schema_and_what_stands_in_a_document(handed: Handed) -> None:
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


def test_what_was_exported_is_read_back_to_the_last_bit(handed: Handed, tmp_path: Path) -> None:
    """Every joint of the report comes back as it was, and the check says so; a name is a name, whatever it looks like."""
    joints = [*robot(handed), *(handed("wrist pitch", name=name) for name in HOSTILE)]
    artefact = write_json(joints, ASK)
    assert read_export(saved(tmp_path, artefact)) == tuple(joints)
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
@settings(deadline=None, max_examples=60)
@given(made())
def test_any_joint_comes_back(joint: ExportedJoint) -> None:
    """Each number, name and sentence is the same again, whatever it is; the document satisfies its schema."""
    text = write_json([joint], ASK).content.decode()
    (read,) = joints_in(text)
    assert read == joint
    assert as_json([read]) == as_json([joint])
    jsonschema.validate(json.loads(text), export_schema())


def changed(text: str, **fields: Any) -> str:
    """The document with other fields in its first joint."""
    document = json.loads(text)
    document["joints"][0].update(fields)
    return json.dumps(document)


def spoilt(text: str) -> dict[str, str]:
    """Documents that are none, by what is told of them."""
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

"""Documents read back: JSON by its schema, MATLAB by Octave, LaTeX by pdflatex, the snippet of Isaac Lab by Python."""

import ast
import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from bristle.errors import one_line
from bristle.questions.export.coulomb_viscous import best_values, static_effort
from bristle.questions.export.export import Artefact, Request
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.json_document import SCHEMA, document_adapter, export_schema
from export_checks.common import Failed, NotInstalled, told_by

_ASSIGNED = re.compile(r"(\w[\w.]*) = struct\('value'")
"""A parameter in the script."""


def check_json(artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:  # noqa: ARG001  # whatever is asked
    """Validates the document by its schema, and reads it back."""
    text = artefact.content.decode()
    same = document_adapter().validate_json(text).joints == tuple(joints)
    return validated(json.loads(text)), told_by(
        same, "read back: equal to the last bit", "read back: NOT what was exported"
    )


def validated(values: object) -> str:
    """A line: whether a document is as its schema says, by jsonschema, or else by pydantic as it is read."""
    try:
        import jsonschema
    except ImportError:
        return f"{SCHEMA}: pydantic takes it; install jsonschema to hold it to docs/export.schema.json"
    wrong = next(iter(jsonschema.Draft202012Validator(export_schema()).iter_errors(values)), None)
    return f"{SCHEMA}: valid" if wrong is None else Failed(f"{SCHEMA}: NOT valid ({one_line(wrong.message, 120)})")


def check_matlab(artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:  # noqa: ARG001  # whatever is asked
    """Runs the script in Octave, and compares every value. Raises NotInstalled where that is not installed."""
    octave = shutil.which("octave-cli") or shutil.which("octave")
    if octave is None:
        raise NotInstalled("Octave, which runs the script, is not here: install octave")
    lines = artefact.content.decode("ascii").splitlines()
    places = [found[1] for line in lines if (found := _ASSIGNED.match(line))]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "checked.m"
        shown = "\n".join(f"printf('%.17g\\n', {place}.value);" for place in places)
        path.write_bytes(artefact.content + shown.encode("ascii") + b"\n")
        done = subprocess.run(  # noqa: S603  # the program that was found, and our own file
            [octave, "--no-gui", "--norc", str(path)], capture_output=True, text=True, timeout=60, check=False
        )
    if done.returncode:
        return (f"Octave refuses it: {one_line(done.stderr, 200)}",)
    held = [float(x) for x in done.stdout.split()]
    same = held == [one.value for joint in joints for one in joint.parameters]
    return (f"Octave: its {len(held)} values are {'as exported, to the last bit' if same else 'NOT as exported'}",)


def check_latex(artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:  # noqa: ARG001  # whatever is asked
    """Sets the table by pdflatex, without leave to run programs. Raises NotInstalled where that is not installed."""
    program = shutil.which("pdflatex")
    if program is None:
        raise NotInstalled("pdflatex, which sets the table, is not here: install texlive")
    with tempfile.TemporaryDirectory() as folder:
        page = b"\\documentclass{article}\\begin{document}\n%b\\end{document}\n"
        (Path(folder) / "checked.tex").write_bytes(page % artefact.content)
        done = subprocess.run(  # noqa: S603  # the program that was found, and our own file
            [program, "-no-shell-escape", "-interaction=nonstopmode", "-halt-on-error", "checked.tex"],
            cwd=folder, capture_output=True, text=True, errors="replace", timeout=120, check=False,
        )  # fmt: skip  # a call
    wrong = next((line for line in done.stdout.splitlines() if line.startswith("!")), f"status {done.returncode}")
    return ("pdflatex: sets it" if done.returncode == 0 else f"pdflatex refuses it: {one_line(wrong, 200)}",)


def check_isaac(artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:
    """Compiles the snippet and reads its numbers. Raises NotInstalled where Isaac Lab is not installed, which would run it."""
    found = best_values(joints, request, "isaac")
    held = list(_numbers(artefact.content.decode()))
    expected = [(static_effort(x), x.coulomb, x.viscous, x.joint.rotor_inertia) for x in found]
    line = told_by(
        held == expected, "compiled: its numbers are as exported", "compiled: its numbers are NOT as exported"
    )
    try:
        exec(compile(artefact.content, artefact.name, "exec"), {})  # noqa: S102  # our own text, whose numbers were just read
    except ImportError as error:
        raise NotInstalled(
            f"{line}; Isaac Lab, which takes them, is not here: install isaaclab in Isaac Sim's Python"
        ) from error
    return line, "Isaac Lab: takes it"


def _numbers(text: str) -> Iterator[tuple[object, ...]]:
    """Static, dynamic and viscous friction and armature of each actuator."""
    wanted = ("friction", "dynamic_friction", "viscous_friction", "armature")
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call):
            values = {x.arg: x.value for x in node.keywords}
            yield tuple(ast.literal_eval(values[name]) for name in wanted)

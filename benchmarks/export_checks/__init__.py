"""Runs exported files where their targets are installed: C, MuJoCo, FMI, URDF and SDF, documents; for the tests and `export.py`.

    check("c", artefact, joints, request)

Each function says in lines what came out; a line that is `Failed` found the artefact wrong.
"""

from collections.abc import Sequence
from importlib import import_module

from bristle.questions.export.export import Artefact, Request
from bristle.questions.export.exported import ExportedJoint

_BY_TARGET = {
    "c": ("c", "check_header"), "mujoco": ("mjcf", "check_mjcf"), "mujoco-frictionloss": ("mjcf", "check_frictionloss"),
    "fmu": ("fmu", "check_fmu"), "urdf": ("axes", "check_urdf"), "sdf": ("axes", "check_sdf"), "isaac": ("documents", "check_isaac"),
    "json": ("documents", "check_json"), "matlab": ("documents", "check_matlab"), "latex": ("documents", "check_latex"),
}  # fmt: skip  # a table


def check(to: str, artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:
    """Run an artefact in its target; lines say what came out. Raises NotInstalled where that is missing."""
    module, name = _BY_TARGET[to]
    lines: tuple[str, ...] = getattr(import_module(f"export_checks.{module}"), name)(artefact, joints, request)
    return lines

"""What a joint can be exported to, by name; each target stands in a module of its own, loaded when it is asked for."""

from importlib import import_module

from bristle.errors import InputError
from bristle.questions.export.artefact import ExportTarget

_MODULES = {
    "c": "c_header",
    "mujoco": "mjcf",
    "mujoco-frictionloss": "mjcf_frictionloss",
    "fmu": "fmu",
    "urdf": "urdf",
    "sdf": "sdf",
    "isaac": "isaac",
    "json": "json_document",
    "matlab": "matlab",
    "latex": "latex",
}
TARGETS = tuple(_MODULES)
"""Their names, in the order of docs/export.md."""


def target(name: str) -> ExportTarget:
    """The target of a name. Raises InputError where there is none."""
    if name not in _MODULES:
        raise InputError(f"to: got {name!r}; expected one of {', '.join(TARGETS)}")
    found: ExportTarget = import_module(f"bristle.questions.export.{_MODULES[name]}").TARGET
    return found

"""Export as JSON of schema bristle-export/1, which is generated from the classes, and its reader."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from bristle import __version__
from bristle.errors import InputError, one_line, read_at_most, short
from bristle.findings import in_units
from bristle.identification.document import check_most, parsed, schema_of, validated
from bristle.identification.known_joint import fault_of
from bristle.identification.results import first_reason
from bristle.model.parameters import INERTIA, fields_of, of_friction, units_of
from bristle.questions.export.export import Artefact, ExportTarget, Request, slug
from bristle.questions.export.exported import ExportedJoint

if TYPE_CHECKING:
    from pydantic import TypeAdapter

SCHEMA: Literal["bristle-export/1"] = "bristle-export/1"
_LARGEST = 10_000_000  # most bytes of a document; a joint has about 10 000
_HOLDS = "everything that is exported of the joints, every digit of it; schema bristle-export/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportDocument:
    """Exported joints. An open bound is "inf" or "-inf"; a missing value is null."""

    schema: Literal["bristle-export/1"] = SCHEMA
    bristle: str  # version that wrote it
    joints: tuple[ExportedJoint, ...]


@cache
def document_adapter() -> "TypeAdapter[ExportDocument]":
    """Writer and reader of the document."""
    from pydantic import TypeAdapter

    return TypeAdapter(ExportDocument)


def export_schema() -> dict[str, Any]:
    """The JSON schema of bristle-export/1, docs/export.schema.json; every field is required."""
    return schema_of(document_adapter(), SCHEMA)


def as_json(joints: Sequence[ExportedJoint]) -> str:
    """The document as JSON; floats keep all digits."""
    document = ExportDocument(bristle=__version__, joints=tuple(map(_with_units, joints)))
    return document_adapter().dump_json(document, indent=1).decode() + "\n"


def write_json(joints: Sequence[ExportedJoint], request: Request) -> Artefact:  # noqa: ARG001  # nothing is lost along any motion
    """The document as JSON."""
    return Artefact(name=f"{slug(joints)}_friction.json", content=as_json(joints).encode(), holds=_HOLDS)


TARGET = ExportTarget(write=write_json, loaded=True)


def read_export(path: Path) -> tuple[ExportedJoint, ...]:
    """The joints of a file of schema bristle-export/1. Raises InputError where it cannot be read, or is none."""
    data = read_at_most(path, _LARGEST, "an export of bristle")
    try:
        return joints_in(data.decode("utf-8"))
    except (ValueError, TypeError, RecursionError) as error:  # InputError is a ValueError
        why = str(error) if isinstance(error, InputError) else first_reason(error)
        raise InputError(
            f"{path}: is not a document of schema {SCHEMA} ({one_line(why, 300)}); expected one that bristle exported"
        ) from error


def joints_in(text: str) -> tuple[ExportedJoint, ...]:
    """The joints of a document in JSON. Raises InputError or ValueError where it is not of the schema."""
    document = validated(parsed(text), document_adapter())
    check_most("joints", len(document.joints))
    if twice := [name for name, n in Counter(joint.name for joint in document.joints).items() if n > 1]:
        raise InputError(f"joint {short(twice[0])} is there twice")
    return tuple(_whole(joint) for joint in document.joints)


def _whole(joint: ExportedJoint) -> ExportedJoint:
    """The joint with units in its findings. Raises InputError where a parameter is missing, doubled or impossible."""
    check_most("parameters of a joint", len(joint.parameters))
    if twice := [name for name, n in Counter(x.parameter for x in joint.parameters).items() if n > 1]:
        raise InputError(f"joint {short(joint.name)} has parameter {short(str(twice[0]))} twice")
    for row in joint.parameters:
        if of_friction(row.parameter.name) and row.parameter.name not in fields_of(joint.law):
            raise InputError(
                f"joint {short(joint.name)} has parameter {row.parameter}, and its law, {joint.law.name}, has none of that name"
            )
    try:
        _ = joint.pair if joint.has_bristle else joint.curves
    except KeyError as error:
        raise InputError(f"joint {short(joint.name)} has no parameter {short(error.args[0])}") from error
    for what, x in (("fastest", joint.fastest), ("inertia", joint.inertia), ("rotor_inertia", joint.rotor_inertia)):
        if x is not None and not (isfinite(x) and x > 0):
            raise InputError(f"joint {short(joint.name)}: got {what} = {x:g}; expected a number above zero")
    for row in joint.parameters:
        if row.standard_error is not None and row.standard_error < 0:
            raise InputError(f"joint {short(joint.name)}: {row.parameter} has a standard error below zero")
        fault = fault_of(row.parameter, row.value, row.unit, row.interval)
        if fault and row.parameter != INERTIA:  # of a rotor beside links, checked as `rotor_inertia`
            raise InputError(f"joint {short(joint.name)}: {fault}")
    return _with_units(joint)


def _with_units(joint: ExportedJoint) -> ExportedJoint:
    """The joint with units in its findings."""
    units = units_of(joint.kind)
    reason = joint.reason and replace(joint.reason, message=in_units(joint.reason.message, units))
    return replace(joint, reason=reason, said=tuple(replace(x, message=in_units(x.message, units)) for x in joint.said))

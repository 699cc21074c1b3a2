"""Exported joints as a document of schema bristle-export/1, read off the classes themselves."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import isfinite
from typing import TYPE_CHECKING, Any, Literal

from bristle import __version__
from bristle.errors import InputError, short
from bristle.findings import in_units
from bristle.identification.document import check_most, parsed, validated
from bristle.identification.known_joint import fault_of
from bristle.model.parameters import INERTIA, fields_of, of_friction, units_of
from bristle.questions.export.exported import ExportedJoint

if TYPE_CHECKING:
    from pydantic import TypeAdapter

SCHEMA: Literal["bristle-export/1"] = "bristle-export/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportDocument:
    """Identified joints, as they are handed over. A bound that is open is "inf" or "-inf"; what does not exist is null."""

    schema: Literal["bristle-export/1"] = SCHEMA
    bristle: str
    """Version that wrote it."""
    joints: tuple[ExportedJoint, ...]


@cache
def document_adapter() -> "TypeAdapter[ExportDocument]":
    """What writes and reads the document."""
    from pydantic import TypeAdapter

    return TypeAdapter(ExportDocument)


def export_schema() -> dict[str, Any]:
    """The JSON schema of bristle-export/1, docs/export.schema.json; every field is written, and so every field is required."""
    from pydantic.json_schema import GenerateJsonSchema

    class AllRequired(GenerateJsonSchema):
        def field_is_required(self, field: Any, total: bool) -> bool:  # noqa: ARG002  # whatever it is
            """Every field is written, so that each is required."""
            return True

    document = document_adapter().json_schema(mode="serialization", schema_generator=AllRequired)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **document, "title": SCHEMA}


def as_json(joints: Sequence[ExportedJoint]) -> str:
    """The document as JSON. Floats keep every digit."""
    document = ExportDocument(bristle=__version__, joints=tuple(map(_with_units, joints)))
    return document_adapter().dump_json(document, indent=1).decode() + "\n"


def as_values(joints: Sequence[ExportedJoint]) -> Any:
    """The document as JSON has it: objects, lists, numbers and text."""
    return json.loads(as_json(joints))


def joints_in(text: str) -> tuple[ExportedJoint, ...]:
    """The joints of a document in JSON, whoever wrote it.

    Raises InputError, or ValueError as pydantic does, where it is none of the schema, or holds a joint that none can be.
    """
    document = validated(parsed(text), document_adapter())
    check_most("joints", len(document.joints))
    name, count = Counter(joint.name for joint in document.joints).most_common(1)[0] if document.joints else ("", 0)
    if count > 1:
        raise InputError(f"joint {short(name)} is there twice")
    return tuple(_whole(joint) for joint in document.joints)


def _whole(joint: ExportedJoint) -> ExportedJoint:
    """The joint, whose diagnostics know their units. Raises InputError where a parameter is missing, there twice, or has an impossible value."""
    check_most("parameters of a joint", len(joint.parameters))
    name, count = Counter(x.parameter for x in joint.parameters).most_common(1)[0] if joint.parameters else ("", 0)
    if count > 1:
        raise InputError(f"joint {short(joint.name)} has parameter {short(str(name))} twice")
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
        if fault and row.parameter != INERTIA:  # of a rotor beside links: `rotor_inertia` has it where it is one
            raise InputError(f"joint {short(joint.name)}: {fault}")
    return _with_units(joint)


def _with_units(joint: ExportedJoint) -> ExportedJoint:
    """The joint, whose sentences have units: a file keeps the sentences, and not by which units they are made."""
    units = units_of(joint.kind)
    reason = joint.reason and replace(joint.reason, message=in_units(joint.reason.message, units))
    return replace(joint, reason=reason, said=tuple(replace(x, message=in_units(x.message, units)) for x in joint.said))

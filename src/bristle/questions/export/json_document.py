"""Export as JSON of schema bristle-export/1, which is generated from the classes."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

from bristle import __version__
from bristle.identification.document import schema_of
from bristle.questions.export.export import Artefact, ExportTarget, Request, slug
from bristle.questions.export.exported import ExportedJoint

if TYPE_CHECKING:
    from pydantic import TypeAdapter

SCHEMA: Literal["bristle-export/1"] = "bristle-export/1"
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


def write_json(joints: Sequence[ExportedJoint], request: Request) -> Artefact:  # noqa: ARG001  # nothing is lost along any motion
    """The document as JSON; floats keep all digits."""
    document = ExportDocument(bristle=__version__, joints=tuple(joints))
    content = document_adapter().dump_json(document, indent=1) + b"\n"
    return Artefact(name=f"{slug(joints)}_friction.json", content=content, holds=_HOLDS)


TARGET = ExportTarget(write=write_json, loaded=True)

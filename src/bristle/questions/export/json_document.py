"""JSON of schema bristle-export/1: all that is known of the joints, to the last digit; and how it is read back."""

from collections.abc import Sequence
from pathlib import Path

from bristle.errors import InputError, one_line, read_at_most
from bristle.identification.results import first_reason
from bristle.questions.export.artefact import Artefact, ExportTarget, Request, slug
from bristle.questions.export.document_schema import SCHEMA, as_json, joints_in
from bristle.questions.export.exported import ExportedJoint

LARGEST_EXPORT = 10_000_000
"""Bytes that a document may have; a joint has about 10 000."""
HOLDS_ALL = "everything that is exported of the joints, every digit of it; schema bristle-export/1"
_SHOWN = 300
"""Characters of a reason that are quoted."""


def write_json(joints: Sequence[ExportedJoint], request: Request) -> Artefact:  # noqa: ARG001  # nothing is lost along any motion
    """The document as JSON."""
    return Artefact(name=f"{slug(joints)}_friction.json", content=as_json(joints).encode(), holds=HOLDS_ALL)


def read_export(path: Path | str) -> tuple[ExportedJoint, ...]:
    """The joints of a document of schema bristle-export/1. Raises InputError where it cannot be read, or is no such document."""
    path = Path(path)
    data = read_at_most(path, LARGEST_EXPORT, "an export of bristle")
    try:
        return joints_in(data.decode("utf-8"))
    except (ValueError, TypeError, RecursionError) as error:  # InputError is a ValueError
        why = str(error) if isinstance(error, InputError) else first_reason(error)
        raise InputError(
            f"{path}: is no document of schema {SCHEMA} ({one_line(why, _SHOWN)}); expected one that bristle exported"
        ) from error


TARGET = ExportTarget(write=write_json, loaded=True)

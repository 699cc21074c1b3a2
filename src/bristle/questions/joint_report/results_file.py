"""Results as JSON (schema bristle-results/2, generated from the result classes) and as a tidy table."""

from collections.abc import Sequence
from typing import Any

from bristle import __version__
from bristle.identification.results import Document, Joint, adapter
from bristle.questions.joint_report.frame import to_frame
from bristle.questions.joint_report.text import fit_report

__all__ = ["fit_report", "schema", "to_frame", "to_json"]


def schema() -> dict[str, Any]:
    """The JSON schema of `results.json`; bristle writes every field, and so every field is required."""
    from pydantic.json_schema import GenerateJsonSchema

    class Complete(GenerateJsonSchema):
        def field_is_required(self, field: Any, total: bool) -> bool:  # noqa: ARG002  # whatever it is
            return True

    document = adapter().json_schema(mode="serialization", schema_generator=Complete)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **document, "title": "bristle-results/2"}


def to_json(joints: Sequence[Joint]) -> str:
    """`results.json` of schema bristle-results/2.

    Floats keep every digit. A bound that is open is "inf" or "-inf"; what does not exist is null. Warnings and outcomes
    have their kind, severity, sentence and numbers. Arrays with an entry per sample are left out.
    """
    document = Document(bristle=__version__, joints={joint.name: joint for joint in joints})
    return adapter().dump_json(document, indent=1).decode() + "\n"

"""The document `results.json`, schema bristle-results/2: the result classes themselves, by pydantic's TypeAdapter."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Literal

from bristle.identification.results import Joint

if TYPE_CHECKING:
    from pydantic import TypeAdapter


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """What bristle identified. A bound that is open is "inf" or "-inf"; what these data do not give is null."""

    schema: Literal["bristle-results/2"] = "bristle-results/2"
    bristle: str
    """Version that wrote it."""
    joints: Mapping[str, Joint]


@cache
def adapter() -> "TypeAdapter[Document]":
    """What writes and reads the document; without the fields that are marked as unwritten, which come back empty."""
    from pydantic import TypeAdapter

    return TypeAdapter(Document)

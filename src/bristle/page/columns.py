"""A table as the page shows it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns, and rows of what stands in them."""

    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]


def shown(frame: "pd.DataFrame") -> Table:
    """A frame of one joint, without its name and without columns that say nothing."""
    empty = [
        c for c in ("warnings", "labels", "joint") if c in frame and (c == "joint" or not frame[c].astype(bool).any())
    ]
    frame = frame.drop(columns=empty)
    rows = frame.astype(object).itertuples(index=False, name=None)
    return Table(columns=tuple(map(str, frame.columns)), rows=tuple(rows))

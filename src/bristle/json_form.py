"""How results hold what JSON has no word for.

pydantic reads these forms off the result classes where results.json is made or read, and only there. Floats keep every
digit. An open bound is "inf" or "-inf"; what does not exist is null, and nan where it is read back as a number.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isnan
from types import FunctionType, MappingProxyType
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bound = float | Literal["inf", "-inf"]
"""An infinite bound is a string: JSON has no infinity."""


@dataclass(frozen=True, slots=True)
class JsonForm:
    """What a value is in JSON, and the ways there and back; it annotates a type, and pydantic asks it for the schema."""

    form: Any
    """The type of what is written, or a function that gives it."""
    write: Callable[[Any], Any]
    read: Callable[[Any], Any]
    """Of what satisfies the form, or `older`; may raise ValueError."""
    older: Any = None
    """The type of what may be read instead, as files had it once; None: nothing."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """The schema of the form, with `read` after it is checked and `write` before it is written."""
        from pydantic_core import core_schema

        inner = handler.generate_schema(self.form() if isinstance(self.form, FunctionType) else self.form)
        writer = core_schema.plain_serializer_function_ser_schema(self.write, return_schema=inner)
        if self.older is not None:
            inner = core_schema.union_schema([inner, handler.generate_schema(self.older)])
        return core_schema.no_info_after_validator_function(self.read, inner, serialization=writer)


def to_bound(x: float) -> Bound | None:
    """A number as JSON has it; null where it is none."""
    return None if isnan(x) else "inf" if x == inf else "-inf" if x == -inf else float(x)


def _to_interval(ends: tuple[float, float]) -> tuple[Bound | None, Bound | None] | None:
    return None if any(map(isnan, ends)) else (to_bound(ends[0]), to_bound(ends[1]))


def _from_interval(ends: tuple[Bound, Bound] | None) -> tuple[float, float] | None:
    return ends and (float(ends[0]), float(ends[1]))


def _to_rows(array: Floats) -> list[list[float | None]]:
    return np.where(np.isfinite(array), array, None).tolist()  # type: ignore[call-overload,no-any-return]  # objects


def _from_rows(rows: list[list[float | None]]) -> Floats:
    if len({len(row) for row in rows}) > 1:
        raise ValueError("its rows are not of one length")
    return np.array(rows, dtype=float) if rows else np.zeros((0, 0))


def _rows() -> Any:
    """Rows of numbers, of which the first wrong one is told: a foreign file may have a million."""
    from pydantic import FailFast

    return Annotated[list[Annotated[list[float | None], FailFast()]], FailFast()]


Number = Annotated[float, JsonForm(Bound | None, to_bound, lambda x: float("nan") if x is None else float(x))]
"""A number that may be infinite, or not exist."""
Interval = Annotated[tuple[float, float], JsonForm(tuple[Bound, Bound] | None, _to_interval, _from_interval)]
"""Two ends, of which either may be infinite."""
Matrix = Annotated[Floats, JsonForm(_rows, _to_rows, _from_rows)]
"""Rows of numbers, (n, m); null where one does not exist."""
UNWRITTEN = MappingProxyType({"exclude": True})
"""Metadata of a field that stays out of the file: an array with an entry per sample, or what figures alone need."""

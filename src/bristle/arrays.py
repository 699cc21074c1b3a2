"""Arrays, the values that hold them, and their exact form in JSON, for pydantic.

An open bound is "inf" or "-inf"; what does not exist is null, and nan where it is read back as a number.
"""

import binascii
from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from math import inf, isnan, prod
from types import FunctionType, MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T")
Floats = NDArray[np.float64]
Bound = float | Literal["inf", "-inf"]  # an infinite bound is a string: JSON has no infinity


@dataclass(frozen=True, slots=True)
class JsonForm:
    """The form of a value in JSON, and the ways there and back: annotates a type, for pydantic."""

    form: Any  # the type of what is written, or a function that gives it
    write: Callable[[Any], Any]
    read: Callable[[Any], Any]  # of what satisfies the form; may raise ValueError

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """The schema of the form, with `read` after it is checked and `write` before it is written."""
        from pydantic_core import core_schema

        inner = handler.generate_schema(self.form() if isinstance(self.form, FunctionType) else self.form)
        writer = core_schema.plain_serializer_function_ser_schema(self.write, return_schema=inner)
        return core_schema.no_info_after_validator_function(self.read, inner, serialization=writer)


def to_bound(x: float) -> Bound | None:
    """A number in JSON; null for nan."""
    return None if isnan(x) else "inf" if x == inf else "-inf" if x == -inf else float(x)


def _to_interval(ends: tuple[float, float]) -> tuple[Bound | None, Bound | None] | None:
    return None if any(map(isnan, ends)) else (to_bound(ends[0]), to_bound(ends[1]))


def _to_rows(array: Floats) -> list[list[float | None]]:
    return np.where(np.isfinite(array), array, None).tolist()  # type: ignore[call-overload,no-any-return]  # objects


def _from_rows(rows: list[list[float | None]]) -> Floats:
    if len({len(row) for row in rows}) > 1:
        raise ValueError("its rows are not of one length")
    return np.array(rows, dtype=float) if rows else np.zeros((0, 0))


def _rows() -> Any:
    """Rows of numbers; only the first error is reported: a foreign file may have a million."""
    from pydantic import FailFast

    return Annotated[list[Annotated[list[float | None], FailFast()]], FailFast()]


Number = Annotated[float, JsonForm(Bound | None, to_bound, lambda x: float("nan") if x is None else float(x))]
"""A number that may be infinite, or not exist."""
Interval = Annotated[
    tuple[float, float], JsonForm(tuple[Bound, Bound] | None, _to_interval, lambda x: x and (float(x[0]), float(x[1])))
]
"""Two ends, of which either may be infinite."""
Matrix = Annotated[Floats, JsonForm(_rows, _to_rows, _from_rows)]
"""Rows of numbers, (n, m); null where one does not exist."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenArray:
    """An array in JSON, exact to the last bit."""

    shape: tuple[int, ...]
    float64: str  #: Base64 of its numbers, row by row, as little-endian float64


def _to_base64(array: Floats) -> WrittenArray:
    if array.dtype != np.float64:
        raise TypeError(f"an array of {array.dtype} has no form in JSON; expected float64")
    return WrittenArray(shape=array.shape, float64=b64encode(array.astype("<f8").tobytes()).decode())


def _from_base64(x: WrittenArray) -> Floats:
    try:
        data = b64decode(x.float64, validate=True)
    except binascii.Error as error:
        raise ValueError("is not base64") from error
    if len(x.shape) > 4 or min(x.shape, default=0) < 0 or 8 * prod(x.shape) != len(data):
        raise ValueError(f"has {len(data)} bytes, which are not float64 of the shape that it states")
    return np.frombuffer(data, "<f8").reshape(x.shape).astype(np.float64)


Array = Annotated[Floats, JsonForm(WrittenArray, _to_base64, _from_base64)]
UNWRITTEN = MappingProxyType({"exclude": True})
"""Metadata of a field under `samples` in the file: an entry per sample, or for figures alone."""


def sized(*shape: str) -> Mapping[str, Any]:
    """Metadata of the shape of a field: numbers, or names of equal numbers in fields of an object; `n?` may be 0."""
    return MappingProxyType({"shape": shape})


def unwritten(*shape: str) -> Mapping[str, Any]:
    """`sized`, and `UNWRITTEN`."""
    return MappingProxyType({**UNWRITTEN, **sized(*shape)})


def as_floats(values: Any) -> Floats:
    """A new array of floats; values hidden by a NumPy mask are nan."""
    return np.asarray(np.ma.filled(np.ma.array(values, dtype=float, copy=True), np.nan))


def freeze(value: "DataclassInstance") -> None:
    """Replace every array of a frozen dataclass by a read-only copy; for its `__post_init__`."""
    for item in fields(value):
        held = getattr(value, item.name)
        if isinstance(held, np.ndarray):
            array = held.copy()
            array.setflags(write=False)
            object.__setattr__(value, item.name, array)


@dataclass_transform(kw_only_default=True, frozen_default=True)
def result(cls: type[T]) -> type[T]:
    """A frozen dataclass with slots, made by keywords, whose arrays are copied and cannot be written to."""
    cls.__post_init__ = freeze  # type: ignore[attr-defined]  # which dataclass calls
    return dataclass(frozen=True, slots=True, kw_only=True)(cls)

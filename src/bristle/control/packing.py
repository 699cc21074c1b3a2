"""Nested tuples of numbers as one vector and back: CasADi takes vectors, and who reads them goes by names."""

from collections.abc import Iterator
from typing import Any, TypeVar

import casadi as ca

T = TypeVar("T")


def flat(value: Any) -> list[Any]:
    """Every number of nested tuples, in order."""
    return [x for part in value for x in flat(part)] if isinstance(value, tuple) else [value]


def shaped(like: T, values: Iterator[Any]) -> T:
    """The inverse of `flat`: the next values in the shape of these nested tuples."""
    if not isinstance(like, tuple):
        value: T = next(values)
        return value
    parts = [shaped(part, values) for part in like]
    return type(like)(*parts) if hasattr(like, "_fields") else type(like)(parts)


def symbols(name: str, like: T) -> tuple[ca.SX, T]:
    """A CasADi vector, (n, 1), and its elements in the shape of these nested tuples of n numbers."""
    vector = ca.SX.sym(name, len(flat(like)))
    return vector, shaped(like, iter(ca.vertsplit(vector)))

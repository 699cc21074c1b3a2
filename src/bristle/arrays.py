"""The array that every floor of the house hands to the next, and the values that hold them."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T")
Array = NDArray[np.float64]


def freeze(value: "DataclassInstance") -> None:
    """Replace every array in a frozen dataclass by a read-only copy; for use in its `__post_init__`."""
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

"""The array that every floor of the house hands to the next, and the values that hold them."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import NDArray

from bristle.json_form import JsonForm

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T")
Array = Annotated[NDArray[np.float64], JsonForm(list[Any], np.ndarray.tolist, np.array)]


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

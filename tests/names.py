"""Parameters by text, as alpha_0+, for tests that write them down."""

from collections.abc import Mapping
from typing import TypeVar

from bristle.model.parameters import ParameterName

T = TypeVar("T")
parse = ParameterName.parse


def named(values: Mapping[str, T]) -> dict[ParameterName, T]:
    return {parse(name): value for name, value in values.items()}

"""Arrays of results.json with an entry per sample, stored apart by their path, such as `static/+/residuals`."""

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from bristle.errors import InputError, short
from bristle.findings import PLAIN, Finding
from bristle.identification.results import Joint

if TYPE_CHECKING:
    from pydantic import TypeAdapter

_FAR = 1e100  # largest sample, in any unit: its square is finite


def samples_of(joint: Joint) -> dict[str, Any]:
    """Unwritten values of a joint that are no defaults, as JSON, by path."""
    samples: dict[str, Any] = {}

    def walk(value: Any, at: str) -> None:
        for name, held, item in _parts(value):
            way = f"{at}/{name}" if at else name
            if item is not None and item.metadata.get("exclude"):
                default = item.default if item.default_factory is MISSING else item.default_factory()
                of: Any = item.type
                form, nothing = (_adapter(of).dump_python(x, mode="json") for x in (held, default))
                if form == nothing:
                    continue
                samples[way] = form
            walk(held, way)

    walk(joint, "")
    return samples


def put_back(joint: Any, samples: Mapping[str, Any]) -> None:
    """Put samples where they belong in a parsed joint. Raises InputError where a path leads nowhere or is taken."""
    for way in sorted(samples, key=lambda way: way.count("/")):
        owner = joint
        *above, name = way.split("/")
        for step in above:
            try:
                owner = owner[int(step) if isinstance(owner, list) else step]
            except (LookupError, TypeError, ValueError):
                owner = None
        if not isinstance(owner, dict) or name in owner:
            raise InputError(f"samples: {short(way)} is not a field of the joint")
        owner[name] = samples[way]


def check_samples(value: Any, at: str = "") -> None:
    """Raise InputError where array shapes contradict the fields, or a number is beyond reason."""
    sizes: dict[str, int] = {}
    for name, held, item in _parts(value):
        way = f"{at}/{name}" if at else name
        check_samples(held, way)
        stated = item.metadata.get("shape") if item is not None else None
        shape = held.shape if isinstance(held, np.ndarray) else (len(held),) if stated else ()
        if stated is not None and not (
            len(shape) == len(stated)
            and all(
                (of.endswith("?") and size == 0)
                or size == (int(of) if of.isdigit() else sizes.setdefault(of.rstrip("?"), size))
                for of, size in zip(stated, shape, strict=True)
            )
        ):
            expected = ", ".join(stated)
            raise InputError(f"samples: {short(way)} has shape {shape}; expected ({expected}) as beside it")
        if stated is not None and isinstance(held, np.ndarray) and (np.abs(held) > _FAR).any():
            raise InputError(f"samples: {short(way)} has a number beyond {_FAR:g}")


def _parts(value: Any) -> Iterator[tuple[str, Any, "Field[Any] | None"]]:
    """Members of a value by name."""
    if type(value) in PLAIN or isinstance(value, Finding):
        return
    if isinstance(value, Mapping):
        yield from ((str(key), held, None) for key, held in value.items())
    elif type(value) is tuple:
        yield from ((str(k), held, None) for k, held in enumerate(value))
    elif is_dataclass(value):
        yield from ((item.name, getattr(value, item.name), item) for item in fields(value))


@cache
def _adapter(of: Hashable) -> "TypeAdapter[Any]":
    from pydantic import TypeAdapter

    return TypeAdapter(of)  # type: ignore[arg-type]  # a type, or an annotation

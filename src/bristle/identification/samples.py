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
    """Unwritten values of a joint that are no defaults, as JSON, by path; an equal value is its path."""
    samples: dict[str, Any] = {}
    first: dict[Hashable, str] = {}

    def walk(value: Any, at: str) -> None:
        for name, held, item in _parts(value):
            way = f"{at}/{name}" if at else name
            if item is None or not item.metadata.get("exclude"):
                walk(held, way)
                if item is None and is_dataclass(held):
                    first.setdefault(_exact(held), way)
                continue
            default = item.default if item.default_factory is MISSING else item.default_factory()
            if _exact(held) == _exact(default):
                continue
            hint: Any = item.type
            if isinstance(held, np.ndarray):
                samples[way] = form(held, way, hint)
            elif isinstance(held, tuple) and is_dataclass(held[0]):
                samples[way] = [form(x, f"{way}/{k}", type(x)) for k, x in enumerate(held)]
            else:
                samples[way] = _adapter(hint).dump_python(held, mode="json")

    def form(value: Any, way: str, kind: Any) -> Any:
        """The JSON form, or the path of an equal value."""
        earlier = first.setdefault(_exact(value), way)
        if earlier != way:
            return earlier
        walk(value, way)
        return _adapter(kind).dump_python(value, mode="json")

    walk(joint, "")
    return samples


def put_back(joint: Any, samples: Mapping[str, Any]) -> None:
    """Put samples where they belong in a parsed joint. Raises InputError where a path leads nowhere or is taken."""
    ways = {way: way.rpartition("/") for way in sorted(samples, key=lambda way: way.count("/"))}
    for way, (above, _, name) in ways.items():
        owner = _at(joint, above)
        if not isinstance(owner, dict) or name in owner:
            raise InputError(f"samples: {short(way)} is not a field of the joint")
        owner[name] = samples[way]
    for way, (above, _, name) in ways.items():
        form = samples[way]
        if isinstance(form, list):
            form[:] = [_at(joint, x) if isinstance(x, str) else x for x in form]
        elif isinstance(form, str):
            _at(joint, above)[name] = _at(joint, form)


def _at(joint: Any, way: str) -> Any:
    """The value at a path; the path itself where there is none."""
    value = joint
    for step in way.split("/") if way else ():
        try:
            value = value[int(step) if isinstance(value, list) else step]
        except (LookupError, TypeError, ValueError):
            return way
    return value


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
    """Members of a value by name, last field first, because earlier ones refer to segments."""
    if type(value) in PLAIN or isinstance(value, Finding):
        return
    if isinstance(value, Mapping):
        yield from ((str(key), held, None) for key, held in value.items())
    elif type(value) is tuple:
        yield from ((str(k), held, None) for k, held in enumerate(value))
    elif is_dataclass(value):
        yield from ((item.name, getattr(value, item.name), item) for item in reversed(fields(value)))


def _exact(value: Any) -> Hashable:
    """A key that is equal for bitwise equal values."""
    if isinstance(value, np.ndarray):
        return value.shape, value.tobytes()
    if isinstance(value, Finding):
        return value.code, str(value), value.subject
    if type(value) not in PLAIN and (parts := [(name, _exact(held)) for name, held, _ in _parts(value)]):
        return type(value).__name__, *parts
    return repr(value)


@cache
def _adapter(of: Hashable) -> "TypeAdapter[Any]":
    from pydantic import TypeAdapter

    return TypeAdapter(of)  # type: ignore[arg-type]  # a type, or an annotation

"""What stands apart in results.json: arrays with an entry per sample, and what figures alone need, by the way to each.

One walk over the result classes finds every field that is marked as unwritten; no field is named here. The way to a value
is made of fields, keys and places in lists, as `static/+/residuals`. What is there already, as a segment that was fitted
among all segments, is written as the way to it.
"""

import json
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, get_args, get_origin, get_type_hints

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError, short
from bristle.findings import PLAIN, Finding
from bristle.identification.results import Joint, first_reason

if TYPE_CHECKING:
    from pydantic import TypeAdapter


_GONE = "/pulled"
"""A field that earlier versions wrote."""


def samples_of(joint: Joint) -> dict[str, Any]:
    """Every unwritten value of a joint that is not its default, as JSON has it, by the way to it."""
    writer = _Writer()
    writer.walk(joint, "")
    return writer.samples


def with_samples(joint: Joint, samples: Mapping[str, Any]) -> Joint:
    """The joint with what stood apart, exact to the last bit.

    Raises InputError, or pydantic's ValidationError, where a value is not of its field, an array has another shape than
    those beside it, or a way leads nowhere.
    """
    reader = _Reader({way: x for way, x in samples.items() if not way.endswith(_GONE)})
    found: Joint = reader.walk(joint, "")
    if reader.samples:
        raise InputError(f"samples: {short(next(iter(reader.samples)))} is no field of the joint")
    return found


def _parts(value: Any) -> Iterator[tuple[str, Any, "Field[Any] | None"]]:
    """What a value holds, by name; the last field first, for earlier ones refer to segments, which come last."""
    if type(value) in PLAIN:
        return
    match value:
        case Finding():
            return
        case Mapping():
            yield from ((str(key), held, None) for key, held in value.items())
        case tuple() if not hasattr(value, "_fields"):
            yield from ((str(k), held, None) for k, held in enumerate(value))
        case _ if is_dataclass(value):
            yield from ((item.name, getattr(value, item.name), item) for item in reversed(fields(value)))


class _Writer:
    """Collects what is unwritten, each value once."""

    def __init__(self) -> None:
        self.samples: dict[str, Any] = {}
        self.first: dict[Hashable, str] = {}

    def walk(self, value: Any, at: str) -> None:
        """What is unwritten below a value that is written."""
        for name, held, item in _parts(value):
            way = f"{at}/{name}" if at else name
            if item is None or not item.metadata.get("exclude"):
                self.walk(held, way)
                if item is None and is_dataclass(held):
                    self.first.setdefault(_exact(held), way)
            elif _exact(held) != _exact(_default(item)):
                self.samples[way] = self._form(held, way, _hints(value.__class__)[name])

    def _form(self, value: Any, way: str, hint: Any) -> Any:
        if isinstance(value, np.ndarray):
            return self._once(value, way, hint)
        if (inner := _element(hint)) is not None:
            return [self._once(x, f"{way}/{k}", inner) for k, x in enumerate(value)]
        self.walk(value, way)
        return _adapter(hint).dump_python(value, mode="json")

    def _once(self, value: Any, way: str, hint: Any) -> Any:
        """Its form, or the way to what is exactly the same."""
        earlier = self.first.setdefault(_exact(value), way)
        if earlier != way:
            return earlier
        self.walk(value, way)
        return _adapter(hint).dump_python(value, mode="json")


class _Reader:
    """Puts back what a writer collected, in the order in which that went."""

    def __init__(self, samples: Mapping[str, Any]) -> None:
        self.samples = dict(samples)
        """What was not put back yet."""
        self.first: dict[str, Any] = {}

    def walk(self, value: Any, at: str) -> Any:
        """The value with what is unwritten below it."""
        parts, same = dict[str, Any](), True
        for name, held, item in _parts(value):
            way = f"{at}/{name}" if at else name
            if item is None or not item.metadata.get("exclude"):
                parts[name] = held if type(held) in PLAIN else self.walk(held, way)
                self.first.setdefault(way, parts[name])
                same = same and parts[name] is held
            elif way in self.samples:
                parts[name], same = self._value(self.samples.pop(way), way, _hints(value.__class__)[name]), False
        if not parts:
            return value
        if isinstance(value, Mapping | tuple):
            made = dict(zip(value, parts.values(), strict=True)) if isinstance(value, Mapping) else (*parts.values(),)
            return value if same else made
        made = value if same else replace(value, **parts)
        _check_shapes(made, at)
        return made

    def _value(self, form: Any, way: str, hint: Any) -> Any:
        if (inner := _element(hint)) is None:
            return self._once(form, way, hint)
        if not isinstance(form, list):
            raise InputError(f"samples: {short(way)}: got {short(form)}; expected a list")
        return tuple(self._once(x, f"{way}/{k}", inner) for k, x in enumerate(form))

    def _once(self, form: Any, way: str, hint: Any) -> Any:
        """The value of a form, or what an earlier way led to."""
        kind = np.ndarray if hint == Array else hint
        if isinstance(form, str) and isinstance(kind, type):
            if not isinstance(self.first.get(form), kind):
                raise InputError(f"samples: {short(way)}: {short(form)} leads to nothing of its kind")
            return self.first[form]
        try:
            read = _adapter(hint).validate_json(json.dumps(form), strict=True)
        except ValueError as error:
            raise InputError(f"samples: {short(way)}: {first_reason(error)}") from error
        self.first[way] = self.walk(read, way)
        return self.first[way]


def _check_shapes(value: Any, at: str) -> None:
    """InputError where arrays of an object have other shapes than its fields state, differ where they must not, or hold a number beyond reason."""
    sizes: dict[str, int] = {}
    for item in fields(value):
        stated, held = item.metadata.get("shape"), getattr(value, item.name)
        if stated is None:
            continue
        shape = held.shape if isinstance(held, np.ndarray) else (len(held),)
        whole = len(shape) == len(stated) and all(
            (name.endswith("?") and size == 0)
            or size == (int(name) if name.isdigit() else sizes.setdefault(name.rstrip("?"), size))
            for name, size in zip(stated, shape, strict=True)
        )
        if not whole:
            raise InputError(
                f"samples: {short(f'{at}/{item.name}')} has shape {shape}; expected ({', '.join(stated)}) as beside it"
            )
        if isinstance(held, np.ndarray) and (np.abs(held) > _FAR).any():
            raise InputError(f"samples: {short(f'{at}/{item.name}')} has a number beyond {_FAR:g}")


_FAR = 1e100
"""Of a sample, in any unit; its square still is a number."""


def _exact(value: Any) -> Hashable:
    """What two values have in common that are the same to the last bit."""
    match value:
        case np.ndarray():
            return value.shape, value.dtype.str, value.tobytes()
        case float() | str() | int() | None:  # before types that are slower to tell
            pass
        case Finding():
            return value.code, str(value), value.subject
        case Mapping():
            return tuple((key, _exact(held)) for key, held in value.items())
        case _ if is_dataclass(value):
            return type(value), *(_exact(getattr(value, item.name)) for item in fields(value))
        case tuple() if not hasattr(value, "_fields"):
            return tuple(map(_exact, value))
    return repr(value)


def _default(item: "Field[Any]") -> Any:
    if item.default_factory is not MISSING:
        return item.default_factory()
    return None if item.default is MISSING else item.default


def _element(hint: Any) -> Any:
    """The class of a list's entries, where these are results themselves."""
    inner = get_args(hint)[0] if get_origin(hint) is tuple else None
    return inner if is_dataclass(inner) else None


@cache
def _hints(of: Hashable) -> dict[str, Any]:
    return get_type_hints(of, include_extras=True)


@cache
def _adapter(hint: Any) -> "TypeAdapter[Any]":
    from pydantic import TypeAdapter

    return TypeAdapter(hint)

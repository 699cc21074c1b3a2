"""results.json read back: by its pydantic model, with what stands apart put where it belongs."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from bristle.errors import InputError, check_regular, one_line, read_at_most, short
from bristle.identification.fits import StaticFit, TrackingFit
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Document, Joint, adapter, first_reason
from bristle.identification.samples import check_samples, put_back
from bristle.model.laws.parts import FASTEST
from bristle.model.laws.registry import LOADS
from bristle.model.parameters import ParameterName, fields_of, of_friction, of_load, static_fields_of, unit

if TYPE_CHECKING:
    from pydantic import TypeAdapter

T = TypeVar("T")
LARGEST = 100_000_000  # bytes of a results file, about two million equations; the embedded joints have a few millions
_MOST = {"commas": 1_000_000, "objects": 200_000, "joints": 100, "parameters of a joint": 400}  # what else it may have
_DIGITS = 18  # of a whole number: counts have fewer
_SHOWN = 300  # characters of a reason that are quoted


@contextmanager
def reading(path: Path) -> Iterator[Any]:
    """A results file as JSON has it; what its body raises of it becomes one sentence.

    Raises InputError where it cannot be read, or is not a results file of schema bristle-results/3.
    """
    data = read_at_most(path, LARGEST, "a results file")
    try:
        yield parsed(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # no UTF-8, no JSON, nested too deep, not as pydantic or we want it
        why = one_line(str(error) if isinstance(error, InputError) else first_reason(error), _SHOWN)
        raise InputError(
            f"{path}: is not a results file of schema bristle-results/3 ({why}); expected a results.json that bristle wrote"
        ) from error


def is_results(path: Path) -> bool:
    """Whether a file is a JSON object that names a version of bristle-results. Raises OSError where it cannot be read."""
    check_regular(path)
    with path.open("rb") as file:
        begun = file.read(_BEGINNING)
        if not begun.lstrip().startswith(b"{"):
            return False
        return b'"bristle-results/' in begun + file.read(LARGEST)  # one that is damaged is told so when it is read


_BEGINNING = 4096  # bytes by which a file of another kind is told


def parsed(text: str) -> Any:
    """What a text holds as JSON has it. Raises InputError, or ValueError, where it is too large, or none."""
    for what, mark in (("commas", ","), ("objects", "{")):
        check_most(what, text.count(mark))
    return json.loads(text, parse_int=lambda x: int(x) if len(x) <= _DIGITS else float(x))


def validated(found: Any, by: "TypeAdapter[T]") -> T:
    """What pydantic makes of what JSON holds, text for a number, NaN and infinities apart, for which it raises ValueError."""
    return by.validate_json(json.dumps(found, allow_nan=False), strict=True)


def schema_of(adapter: "TypeAdapter[Any]", title: str) -> dict[str, Any]:
    """The JSON schema of what bristle writes so: every field is written, and so every field is required."""
    from pydantic.json_schema import GenerateJsonSchema

    class Complete(GenerateJsonSchema):
        def field_is_required(self, field: Any, total: bool) -> bool:  # noqa: ARG002  # whatever it is
            return True

    document = adapter.json_schema(mode="serialization", schema_generator=Complete)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **document, "title": title}


def with_samples(found: Any) -> Any:
    """A results file as JSON has it, in which what stands apart is where it belongs. Raises InputError where it has no place."""
    match found:
        case {"joints": dict(joints), "samples": dict(samples)}:
            for name, apart in samples.items():
                if name not in joints or not isinstance(apart, dict):
                    why = "holds no samples by name" if name in joints else "is not a joint"
                    raise InputError(f"samples: {short(name)} {why}")
                put_back(joints[name], apart)
            return {**found, "samples": {name: {} for name in samples}}
    return found


def document_of(found: Any) -> Document:
    """The document that JSON holds, its joints named as they stand there.

    Raises InputError, ValueError, or pydantic's ValidationError, where it is not of schema bristle-results/3.
    """
    document = validated(found, adapter())
    check_most("joints", len(document.joints))
    named = {name: replace(joint, name=name).with_subjects() for name, joint in document.joints.items()}
    return replace(document, joints=named)


def joints_of(document: Document) -> tuple[Joint, ...]:
    """Its joints. Raises InputError where samples contradict one another, or a fit has not the parameters of its law, in the joint's units."""
    if lacking := document.joints.keys() - document.samples.keys():
        raise InputError(f"samples: has none of {short(min(lacking))}")
    for joint in document.joints.values():
        check_samples(joint)
        fits: list[StaticFit | TrackingFit] = [*joint.static.values(), *moving_fits(joint).values()]
        for fit in fits:
            moving = fit if isinstance(fit, TrackingFit) else None
            found = {ParameterName.parse(str(name)): e for name, e in fit.parameters.items()}
            if odd := {*map(str, fit.uncertainty)} - {*map(str, fit.parameters)}:
                raise InputError(f"{joint.name}: uncertainty: {short(min(odd))} is none of the fit's parameters")
            there = {name.name for name in (*found, *(moving.fixed if moving else {})) if of_friction(name.name)}
            asked = {*(fields_of if moving else static_fields_of)(fit.law)} - {FASTEST}
            if there and (lacking := asked - there):
                raise InputError(f"{joint.name}: has no {min(lacking)}, and its law, {fit.law.name}, has one")
            for name, e in found.items():
                if of_friction(name.name) and e.unit != (expected := unit(name.name, joint.kind)):
                    raise InputError(f"{joint.name}: {name}: got the unit {short(e.unit)}; expected {expected}")
            rises = {name.name for name in found if of_load(name.name)}
            if moving and (rises or moving.load.size) and rises not in map(set, LOADS.values()):
                told = " and ".join(sorted(rises)) or "none"
                raise InputError(
                    f"{joint.name}: has {told} as coefficients of its load; expected those of one of {', '.join(LOADS)}"
                )
    return tuple(document.joints.values())


def check_most(what: str, count: int) -> None:
    """InputError where a file has more of something than it may."""
    if count > _MOST[what]:
        raise InputError(f"it has {count} {what}, more than {_MOST[what]}")

"""Reading of results.json."""

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
LARGEST = 100_000_000  # bytes of a results file, about two million equations
_MOST = {"commas": 1_000_000, "objects": 200_000, "joints": 100, "parameters of a joint": 400}
_DIGITS = 18  # of an integer: counts have fewer
_SHOWN = 300  # characters of a quoted reason


@contextmanager
def reading(path: Path) -> Iterator[Any]:
    """A results file as parsed JSON; bad content inside the with block raises one InputError that names the file."""
    data = read_at_most(path, LARGEST, "a results file")
    try:
        yield parsed(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # no UTF-8, no JSON, nested too deep, or wrong content
        why = one_line(str(error) if isinstance(error, InputError) else first_reason(error), _SHOWN)
        raise InputError(
            f"{path}: is not a results file of schema bristle-results/3 ({why}); expected a results.json that bristle wrote"
        ) from error


def is_results(path: Path) -> bool:
    """Whether a file is a JSON object that names bristle-results. Raises OSError where it cannot be read."""
    check_regular(path)
    with path.open("rb") as file:
        begun = file.read(_BEGINNING)  # damage is reported on reading
        return begun.lstrip().startswith(b"{") and b'"bristle-results/' in begun + file.read(LARGEST)


_BEGINNING = 4096  # bytes that tell another kind of file


def parsed(text: str) -> Any:
    """A text as JSON. Raises InputError or ValueError where it is too large or no JSON."""
    for what, mark in (("commas", ","), ("objects", "{")):
        check_most(what, text.count(mark))
    return json.loads(text, parse_int=lambda x: int(x) if len(x) <= _DIGITS else float(x))


def validated(found: Any, by: "TypeAdapter[T]") -> T:
    """Parsed JSON as a pydantic type. Raises ValueError where it does not fit, or has NaN."""
    return by.validate_json(json.dumps(found, allow_nan=False), strict=True)


def schema_of(adapter: "TypeAdapter[Any]", title: str) -> dict[str, Any]:
    """The JSON schema of a type as bristle writes it, with every field required."""
    from pydantic.json_schema import GenerateJsonSchema

    class Complete(GenerateJsonSchema):
        def field_is_required(self, field: Any, total: bool) -> bool:  # noqa: ARG002  # whatever it is
            return True

    document = adapter.json_schema(mode="serialization", schema_generator=Complete)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **document, "title": title}


def with_samples(found: Any) -> Any:
    """Parsed results with `samples` moved to where they belong. Raises InputError where one has no place."""
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
    """The document in parsed JSON. Raises InputError, ValueError or ValidationError if not bristle-results/3."""
    document = validated(found, adapter())
    check_most("joints", len(document.joints))
    named = {name: replace(joint, name=name).with_subjects() for name, joint in document.joints.items()}
    return replace(document, joints=named)


def joints_of(document: Document) -> tuple[Joint, ...]:
    """The joints of a document. Raises InputError where samples, parameters or units contradict one another."""
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
    """Raise InputError where a file has more of something than allowed."""
    if count > _MOST[what]:
        raise InputError(f"it has {count} {what}, more than {_MOST[what]}")

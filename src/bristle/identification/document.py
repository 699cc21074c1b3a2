"""results.json read back, whoever wrote it: a file may hold anything, and is checked before anything is made of it."""

import json
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import isinf
from pathlib import Path
from typing import Any

from bristle.errors import InputError, check_regular, one_line, read_at_most, short
from bristle.identification.fits import StaticFit, TrackingFit
from bristle.identification.results import Document, Joint, adapter, first_reason
from bristle.identification.samples import with_samples
from bristle.model.laws.parts import FASTEST
from bristle.model.laws.registry import LOADS
from bristle.model.parameters import ParameterName, fields_of, of_friction, of_load, static_fields_of, unit

LARGEST = 100_000_000
"""Bytes that a results file may have: about two million equations; the four embedded joints have a few millions."""
_MOST = {"commas": 1_000_000, "objects": 200_000, "joints": 100, "parameters of a joint": 400}
"""What else it may have."""
_DIGITS = 18
"""Of a whole number: counts have fewer, and numbers with a fraction are written with an exponent."""
_SHOWN = 300
"""Characters of a reason that are quoted."""


@contextmanager
def reading(path: Path) -> Iterator[str]:
    """The text of a results file; what its body raises of it becomes one sentence.

    Raises InputError where it cannot be read, or is no results file of schema bristle-results/3 or 2.
    """
    data = read_at_most(path, LARGEST, "a results file")
    try:
        yield data.decode("utf-8")
    except InputError as error:
        raise _no_results(path, str(error)) from error
    except (ValueError, RecursionError) as error:  # no UTF-8, no JSON, nested too deep, not as pydantic wants it
        raise _no_results(path, first_reason(error)) from error


def is_results(path: Path) -> bool:
    """Whether a file is a JSON object whose `schema` is a version of bristle-results. Raises OSError where it cannot be read."""
    check_regular(path)
    with path.open("rb") as file:
        begun = file.read(_BEGINNING)
        if not begun.lstrip().startswith(b"{") or b'"' not in begun:
            return False
        data = begun + file.read(LARGEST + 1 - len(begun))
    try:
        found = json.loads(data)
    except (ValueError, RecursionError):
        return b'"bristle-results/' in begun  # one that is damaged is told so when it is read
    return isinstance(found, dict) and str(found.get("schema")).startswith("bristle-results/")


_BEGINNING = 4096
"""Bytes by which a file of another kind is told."""


def checked(text: str) -> Any:
    """What a text holds as JSON has it, key by key and number by number. Raises InputError, or ValueError, where it is none."""
    for what, mark in (("commas", ","), ("objects", "{")):
        check_most(what, text.count(mark))
    return json.loads(text, parse_constant=_refuse, parse_int=_whole, parse_float=_finite, object_pairs_hook=_once)


def document_of(text: str) -> Document:
    """The document that a text holds, its joints named as they stand there, without samples.

    The text is read twice: as it is written, key by key and number by number, and by pydantic, which takes no text for a
    number. Raises InputError, ValueError, or pydantic's ValidationError, where it is not of schema bristle-results/3 or 2.
    """
    found = checked(text)
    if isinstance(found, dict) and found.get("schema") == "bristle-results/2":
        text = json.dumps(json.loads(text, object_hook=_finding))
    document = adapter().validate_json(text, strict=True)
    check_most("joints", len(document.joints))
    return replace(
        document, joints={name: replace(joint, name=name).with_subjects() for name, joint in document.joints.items()}
    )


def _finding(x: dict[str, Any]) -> Any:
    """What schema 2 calls a diagnostic, as a finding; a part of one, as its text; all else as it is."""
    if not {"kind", "text", "numbers"} <= x.keys():
        return x
    named = {"code": str(x["kind"]).lower().replace("_", "-"), "message": x["text"]}
    return (
        {**named, **{key: x[key] for key in x.keys() - {"kind", "text"}}, "effect": {}}
        if "severity" in x
        else x["text"]
    )


def joints_of(document: Document) -> tuple[Joint, ...]:
    """Its joints with their samples. Raises InputError where these are not theirs."""
    samples = document.samples or {}
    if odd := samples.keys() - document.joints.keys():
        raise InputError(f"samples: {short(min(odd))} is no joint")
    for joint in document.joints.values():
        fits: list[StaticFit | TrackingFit] = [*joint.static.values()]
        fits += [fit for fit in (joint.tracking, joint.joint_fit) if fit is not None]
        for fit in fits:
            _check_compared(joint.name, fit)
            _check_parameters(joint, fit)
    joints = tuple(with_samples(joint, samples.get(name, {})) for name, joint in document.joints.items())
    for joint in joints:
        for moving in (joint.tracking, joint.joint_fit):
            if moving is not None:
                _check_load(joint.name, moving)
    return joints


def _check_compared(joint: str, fit: StaticFit | TrackingFit) -> None:
    """InputError where a fit has intervals of a parameter that it does not have."""
    if odd := {*map(str, fit.uncertainty)} - {*map(str, fit.parameters)}:
        raise InputError(f"{joint}: uncertainty: {short(min(odd))} is none of the fit's parameters")


def _check_parameters(joint: Joint, fit: StaticFit | TrackingFit) -> None:
    """InputError where a fit lacks a parameter of its law, or one is in another unit than the joint's."""
    found = {ParameterName.parse(str(name)): e for name, e in fit.parameters.items()}
    fixed = fit.fixed if isinstance(fit, TrackingFit) else {}
    there = {name.name for name in (*found, *fixed) if of_friction(name.name)}
    asked = fields_of(fit.law) if isinstance(fit, TrackingFit) else static_fields_of(fit.law)
    if there and (lacking := [name for name in asked if name not in there and name != FASTEST]):
        raise InputError(f"{joint.name}: has no {lacking[0]}, and its law, {fit.law.name}, has one")
    for name, e in found.items():
        if of_friction(name.name) and e.unit != (expected := unit(name.name, joint.kind)):
            raise InputError(f"{joint.name}: {name}: got the unit {short(e.unit)}; expected {expected}")


def _check_load(joint: str, fit: TrackingFit) -> None:
    """InputError where the coefficients of a load are not those of one."""
    rises = {n.name: e.value for n, e in fit.parameters.items() if of_load(n.name)}
    whole = any({*rises} == {*names} for names in LOADS.values())
    if (rises or fit.load.size) and not whole:
        told = " and ".join(rises) or "none"
        raise InputError(
            f"{joint}: has {told} as coefficients of its load; expected those of one of {', '.join(LOADS)}"
        )


def check_most(what: str, count: int) -> None:
    """InputError where a file has more of something than it may."""
    if count > _MOST[what]:
        raise InputError(f"it has {count} {what}, more than {_MOST[what]}")


def _refuse(token: str) -> Any:
    raise InputError(f"{token} is no JSON")


def _whole(token: str) -> int:
    if len(token) > _DIGITS:
        raise InputError(f"{token[:_DIGITS]}... is a number of {len(token)} digits")
    return int(token)


def _finite(token: str) -> float:
    if isinf(x := float(token)):
        raise InputError(f"{one_line(token, 60)} is beyond every number")
    return x


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """The object; raises InputError where a key is given twice."""
    found = dict(pairs)
    if len(found) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise InputError(f"key {short(twice)} is given twice")
    return found


def _no_results(path: Path, why: str) -> InputError:
    return InputError(
        f"{path}: is no results file of schema bristle-results/3 or 2 ({one_line(why, _SHOWN)}); "
        "expected a results.json that bristle wrote"
    )

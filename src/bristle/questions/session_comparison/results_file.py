"""Results files read back: `results.json` of schema bristle-results/1 as a session to compare. A file may hold anything; it is checked first."""

import json
from collections import Counter
from collections.abc import Iterator
from math import copysign, inf, isinf
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from bristle.arrays import Array
from bristle.errors import InputError, check_name, check_regular, short
from bristle.identification.results import Estimate
from bristle.identification.results_schema import Bound, FitJson, JointJson, ParameterJson, ResultsJson, TrackingJson
from bristle.model.parameters import Direction, ParameterName
from bristle.page.wording import printable, shortened
from bristle.questions.session_comparison.results import Fit, Session, SessionJoint

LARGEST = 20_000_000
"""Bytes that a results file may have; four joints have 340 000."""
_MOST = {"commas": 1_000_000, "objects": 100_000, "joints": 100, "parameters of a joint": 400}
"""What else it may have."""
_WRONG = 1000
"""Wrong entries of which the first is looked for."""
_DIGITS = 18
"""Of a whole number: counts have fewer, and numbers with a fraction are written with an exponent."""
_NAME = 400
"""Characters of a name or unit."""
_FAR = 1e60
"""No friction parameter, in any unit, is larger, or has a larger inverse; squares of such numbers still are numbers."""
_NOT_CONVERGED = "The fit did not converge"


def read_session(path: Path) -> Session:
    """The joints of a results file, by name.

    Raises InputError in one sentence where it is no results file of schema bristle-results/1, and OSError where it cannot be read.
    """
    check_regular(path)
    with path.open("rb") as file:
        data = file.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise InputError(f"{path}: has {path.stat().st_size} bytes; a results file has at most {LARGEST}")
    try:
        results = _results(data.decode("utf-8"))
        return {name: _joint(name, joint, results) for name, joint in results.joints.items()}
    except ValidationError as error:
        raise _no_results(path, _first(error)) from error
    except InputError as error:
        raise _no_results(path, str(error)) from error
    except (ValueError, RecursionError) as error:  # no UTF-8, no JSON, nested too deep
        raise _no_results(path, shortened(str(error))) from error


def _results(text: str) -> ResultsJson:
    """The document, read twice: as it is written, key by key and number by number, and by pydantic, which takes no text for a number."""
    for what, mark in (("commas", ","), ("objects", "{")):
        _check_most(what, text.count(mark))
    json.loads(text, parse_constant=_refuse, parse_int=_whole, parse_float=_finite, object_pairs_hook=_once)
    results = ResultsJson.model_validate_json(text, strict=True)
    _check_most("joints", len(results.joints))
    return results


def _first(error: ValidationError) -> str:
    """What is wrong first, where so much is not that it takes long to tell."""
    if error.error_count() > _WRONG:
        return f"{error.error_count()} of its entries are wrong or missing"
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    where = ".".join(str(part) for part in first["loc"]) or "the file"
    return f"{shortened(where, 120)}: {shortened(first['msg'], 120)}"


def _check_most(what: str, count: int) -> None:
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
        raise InputError(f"{shortened(token)} is beyond every number")
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
        f"{path}: is no results file of schema bristle-results/1 ({printable(why)}); expected a results.json that bristle wrote"
    )


def _joint(name: str, joint: JointJson, results: ResultsJson) -> SessionJoint:
    _shown(name, "joint")
    try:
        fits = tuple(_fits(joint))
        _check_most("parameters of a joint", sum(len(fit.parameters) for fit in fits))
    except InputError as error:
        raise InputError(f"{shortened(name)}: {error}") from error
    inputs = tuple(x.sha256 for x in results.inputs if x.joint == name)
    return SessionJoint(kind=joint.kind, fits=fits, simulated=joint.simulated, inputs=inputs)


def _shown(text: str, what: str) -> str:
    """Text that is shown somewhere; raises InputError where it holds a control character, or is a book."""
    if len(text) > _NAME:
        raise InputError(f"{what} {short(text)} has {len(text)} characters, more than {_NAME}")
    return check_name(text, what)


def _fits(joint: JointJson) -> Iterator[Fit]:
    """The fits of a joint in the order in which their numbers are used."""
    for source, moving in (("joint", joint.joint_fit), ("tracking", joint.tracking)):
        if moving is not None:
            yield _moving(source, moving)
    for d, fit in joint.static.items():
        if fit.degrees_of_freedom < 0:
            raise InputError(f"a fit has {fit.degrees_of_freedom} degrees of freedom")
        yield Fit(
            source=f"static {d}",
            parameters=_parameters(fit, d),
            names=tuple(_named(name, d) for name in fit.free),
            covariance=_matrix(fit),
            freedom=max(fit.degrees_of_freedom, 1),
        )
    for d, slow in joint.presliding.items():
        own = {"edges": slow.edges, "samples": slow.samples}.get(slow.recommended)
        if own is not None:
            yield Fit(source=f"presliding {d}", parameters={_named("sigma_0", d): _estimate(own)})


def _named(name: str, direction: str = "") -> ParameterName:
    """A parameter as a fit of some direction names it."""
    bare = ParameterName.parse(_shown(name, "parameter"))
    return ParameterName(name, Direction(direction)) if _shown(direction, "direction") in ("+", "-") else bare


def _parameters(fit: FitJson | TrackingJson, direction: str = "") -> dict[ParameterName, Estimate]:
    return {_named(name, direction): _estimate(p) for name, p in fit.parameters.items()}


def _moving(source: str, fit: TrackingJson) -> Fit:
    outcome = _shown(fit.outcome, "outcome")
    return Fit(
        source=source,
        parameters=_parameters(fit),
        names=tuple(map(_named, fit.free)),
        covariance=_matrix(fit),
        freedom=inf,
        distrusted=outcome if outcome.startswith(_NOT_CONVERGED) else "",
    )


def _estimate(p: ParameterJson) -> Estimate:
    """The estimate; raises InputError where its numbers are none, or contradict one another."""
    interval = None if p.interval is None else (_number(p.interval[0]), _number(p.interval[1]))
    if not all(x is None or x == 0 or 1 / _FAR < abs(x) < _FAR for x in (p.value, p.standard_error)):
        raise InputError(f"a value or standard error is beyond {_FAR:g}, or below {1 / _FAR:g}")
    if (p.standard_error or 0.0) < 0 or (interval is not None and not interval[0] <= interval[1]):
        raise InputError("a standard error is negative, or an interval ends before it begins")
    return Estimate(
        value=p.value,
        unit=_shown(p.unit, "unit"),
        standard_error=p.standard_error,
        interval=interval,
    )


def _number(bound: Bound) -> float:
    """A bound; one that is far beyond every parameter is none, and one far below is zero."""
    x = float(bound)
    if abs(x) < 1 / _FAR:
        return 0.0
    return x if abs(x) < _FAR else copysign(inf, x)


def _matrix(fit: FitJson | TrackingJson) -> Array:
    """The covariance of the free parameters, square, nan where it has no number; raises InputError where it has another shape."""
    rows, size = fit.covariance, len(fit.free)
    if len(rows) != size or any(len(row) != size for row in rows):
        raise InputError(f"a covariance is not of the {size} parameters that are free")
    found = np.array([[np.nan if x is None or abs(x) > _FAR**2 else x for x in row] for row in rows], dtype=float)
    found[np.abs(found) < 1 / _FAR**2] = 0.0
    return found.reshape(size, size)

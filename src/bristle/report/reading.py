"""Results files read back: `results.json` of schema bristle-results/1 as a session to compare. A file may hold anything; it is checked first."""

import json
from collections.abc import Iterator
from math import copysign, inf
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from bristle.analysis.compared import Fit, Session, SessionJoint
from bristle.errors import InputError
from bristle.identification.estimate import Estimate
from bristle.model.arrays import Array
from bristle.report.schema import Bound, JointJson, ParameterJson, ResultsJson, TrackingJson
from bristle.report.wording import printable, shortened

LARGEST = 50_000_000
"""Bytes that a results file may have."""
_FAR = 1e60
"""No friction parameter, in any unit, is larger, or has a larger inverse; squares of such numbers still are numbers."""
_NOT_CONVERGED = "The fit did not converge"


def read_session(path: Path) -> Session:
    """The joints of a results file, by name.

    Raises InputError in one sentence where it is no results file of schema bristle-results/1, and OSError where it cannot be read.
    """
    if path.is_file() and path.stat().st_size > LARGEST:
        raise InputError(f"{path}: has {path.stat().st_size} bytes; a results file has at most {LARGEST}")
    try:
        document = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse)
        results = ResultsJson.model_validate(document)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        raise _no_results(path, f"{shortened(where)}: {first['msg']}") from error
    except (ValueError, RecursionError) as error:  # no UTF-8, no JSON, nested too deep
        raise _no_results(path, shortened(str(error))) from error
    return {name: _joint(path, name, joint, results) for name, joint in results.joints.items()}


def _refuse(token: str) -> Any:
    raise InputError(f"{token} is no JSON")


def _no_results(path: Path, why: str) -> InputError:
    return InputError(
        f"{path}: is no results file of schema bristle-results/1 ({printable(why)}); expected a results.json that bristle wrote"
    )


def _joint(path: Path, name: str, joint: JointJson, results: ResultsJson) -> SessionJoint:
    try:
        fits = tuple(_fits(joint))
    except InputError as error:
        raise _no_results(path, f"{shortened(name)}: {error}") from error
    inputs = tuple(x.sha256 for x in results.inputs if x.joint == name)
    return SessionJoint(kind=joint.kind, fits=fits, simulated=joint.simulated, inputs=inputs)


def _fits(joint: JointJson) -> Iterator[Fit]:
    """The fits of a joint in the order in which their numbers are used."""
    for source, moving in (("joint", joint.joint_fit), ("tracking", joint.tracking)):
        if moving is not None:
            yield _moving(source, moving)
    for d, fit in joint.static.items():
        tag = d if d in {"+", "-"} else ""
        yield Fit(
            source=f"static {d}",
            parameters={name + tag: _estimate(p) for name, p in fit.parameters.items()},
            names=tuple(name + tag for name in fit.free),
            covariance=_matrix(fit.covariance, len(fit.free)),
            freedom=max(fit.degrees_of_freedom, 1),
        )
    for d, slow in joint.presliding.items():
        tag = d if d in {"+", "-"} else ""
        own = {"edges": slow.edges, "samples": slow.samples}.get(slow.recommended)
        if own is not None:
            yield Fit(source=f"presliding {d}", parameters={f"sigma_0{tag}": _estimate(own)})


def _moving(source: str, fit: TrackingJson) -> Fit:
    return Fit(
        source=source,
        parameters={name: _estimate(p) for name, p in fit.parameters.items()},
        names=tuple(fit.free),
        covariance=_matrix(fit.covariance, len(fit.free)),
        freedom=inf,
        distrusted=fit.outcome if fit.outcome.startswith(_NOT_CONVERGED) else "",
    )


def _estimate(p: ParameterJson) -> Estimate:
    """The estimate; raises InputError where its numbers are none, or contradict one another."""
    interval = None if p.interval is None else (_number(p.interval[0]), _number(p.interval[1]))
    if not all(x is None or x == 0 or 1 / _FAR < abs(x) < _FAR for x in (p.value, p.standard_error)):
        raise InputError(f"a value or standard error is beyond {_FAR:g}, or below {1 / _FAR:g}")
    if (p.standard_error or 0.0) < 0 or (interval is not None and not interval[0] <= interval[1]):
        raise InputError("a standard error is negative, or an interval ends before it begins")
    return Estimate(
        value=p.value, unit=p.unit, standard_error=p.standard_error, interval=interval, doubts=tuple(p.doubts)
    )


def _number(bound: Bound) -> float:
    """A bound; one that is far beyond every parameter is none."""
    x = float(bound)
    return x if abs(x) < _FAR else copysign(inf, x)


def _matrix(rows: list[list[float | None]], size: int) -> Array:
    """The covariance, (size, size), nan where it has no number; raises InputError where it has another shape."""
    if len(rows) != size or any(len(row) != size for row in rows):
        raise InputError(f"a covariance is not of the {size} parameters that are free")
    return np.array(
        [[np.nan if x is None or abs(x) > _FAR**2 else x for x in row] for row in rows], dtype=float
    ).reshape(size, size)

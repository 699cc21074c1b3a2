"""Results files read back: `results.json` as a session to compare. A file may hold anything; it is checked first."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import copysign, hypot, inf
from pathlib import Path

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError, check_name, short
from bristle.identification.document import check_most, document_of, reading
from bristle.identification.fits import Estimate, StaticFit, TrackingFit
from bristle.identification.results import Joint
from bristle.model.laws.parts import FASTEST
from bristle.model.parameters import Direction, ParameterName
from bristle.page.wording import shortened
from bristle.questions.session_comparison.results import Session, SessionFit, SessionJoint

_FAR = 1e60
"""No friction parameter, in any unit, is larger, or has a larger inverse; squares of such numbers still are numbers."""


def read_session(path: Path) -> Session:
    """The joints of a results file, by name.

    Raises InputError in one sentence where it is no results file of schema bristle-results/3 or 2, and OSError where it cannot be read.
    """
    with reading(path) as found:
        return session_of(document_of(found).joints.values())


def session_of(joints: Iterable[Joint]) -> Session:
    """Identified joints, by name, as a session to compare. Raises InputError where a number is none."""
    session = {}
    for joint in joints:
        _shown(joint.name, "joint")
        try:
            fits = tuple(_fits(joint))
            check_most("parameters of a joint", sum(len(fit.parameters) for fit in fits))
        except InputError as error:
            raise InputError(f"{shortened(joint.name)}: {error}") from error
        session[joint.name] = SessionJoint(
            kind=joint.kind, fits=fits, law=joint.law, simulated=joint.simulated,
            torque_scale=joint.torque_scale, inputs=tuple(x.sha256 for x in joint.inputs),
        )  # fmt: skip  # a list of values
    return session


def _shown(text: str, what: str) -> str:
    """Text that is shown somewhere; raises InputError where it holds a control character, or is a book."""
    if len(text) > 400:
        raise InputError(f"{what} {short(text)} has {len(text)} characters, more than 400")
    return check_name(text, what)


def _fits(joint: Joint) -> Iterator[SessionFit]:
    """The fits of a joint in the order in which their numbers are used; without v_end, which is no estimate."""
    for source, moving in (("joint", joint.joint_fit), ("tracking", joint.tracking)):
        if moving is not None:
            yield SessionFit(
                source=source,
                parameters={_name(name): _checked(e) for name, e in moving.parameters.items()},
                names=tuple(map(_name, moving.names)),
                covariance=_covariance(moving),
                distrusted=moving.outcome if moving.outcome.code == "not-converged" else None,
            )
    for d, fit in joint.static.items():
        if fit.degrees_of_freedom < 0:
            raise InputError(f"a fit has {fit.degrees_of_freedom} degrees of freedom")
        yield SessionFit(
            source=f"static {d}",
            parameters={_named(name, d): _checked(e) for name, e in fit.parameters.items() if name != FASTEST},
            names=tuple(_named(name, d) for name in fit.names),
            covariance=_covariance(fit),
            freedom=max(fit.degrees_of_freedom, 1),
        )
    for d, slow in (joint.presliding.fits if joint.presliding else {}).items():
        own = {"edges": slow.edges, "samples": slow.samples}.get(slow.recommended)
        if own is not None:
            yield SessionFit(source=f"presliding {d}", parameters={_named("sigma_0", d): _checked(own)})


def _name(name: ParameterName) -> ParameterName:
    return ParameterName(_shown(name.name, "parameter"), name.direction)


def _named(name: str, direction: str) -> ParameterName:
    """A parameter as a fit of some direction names it."""
    bare = ParameterName.parse(_shown(name, "parameter"))
    return ParameterName(name, Direction(direction)) if _shown(direction, "direction") in ("+", "-") else bare


def _checked(e: Estimate) -> Estimate:
    """The estimate alone; raises InputError where its numbers are none, or contradict one another."""
    interval = None if e.interval is None else (_near(e.interval[0]), _near(e.interval[1]))
    if not all(x is None or x == 0 or 1 / _FAR < abs(x) < _FAR for x in (e.value, e.standard_error)):
        raise InputError(f"a value or standard error is beyond {_FAR:g}, or below {1 / _FAR:g}")
    if (e.standard_error or 0.0) < 0 or (interval is not None and not interval[0] <= interval[1]):
        raise InputError("a standard error is negative, or an interval ends before it begins")
    shifts = {_shown(name, "constant"): shift for name, shift in e.shifts.items()}
    if not all(abs(shift) < _FAR for shift in shifts.values()):
        raise InputError(f"a systematic error is none, or beyond {_FAR:g}")
    known = Estimate(value=e.value, unit=_shown(e.unit, "unit"), standard_error=e.standard_error, interval=interval)
    return replace(known, shifts=shifts, systematic=hypot(*shifts.values()) if shifts else None)


def _near(bound: float) -> float:
    """A bound; one that is far beyond every parameter is none, and one far below is zero."""
    if abs(bound) < 1 / _FAR:
        return 0.0
    return bound if abs(bound) < _FAR else copysign(inf, bound)


def _covariance(fit: StaticFit | TrackingFit) -> Array:
    """Of the free parameters, square, nan where it has no number; raises InputError where it has another shape."""
    size = len(fit.names)
    if fit.covariance.shape != (size, size):
        raise InputError(f"a covariance is not of the {size} parameters that are free")
    known = np.where(np.abs(fit.covariance) > _FAR**2, np.nan, fit.covariance)
    return np.where(np.abs(known) < 1 / _FAR**2, 0.0, known)

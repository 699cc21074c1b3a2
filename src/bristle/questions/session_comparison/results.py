"""Values of a comparison of two sessions: each session's fits, as identified or read from a file, and the changes."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import copysign, hypot, inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bristle.arrays import Array, result
from bristle.errors import InputError, check_name, short
from bristle.findings import Finding
from bristle.identification.document import check_most, document_of, reading
from bristle.identification.fits import Estimate, StaticFit, TrackingFit
from bristle.identification.results import Joint
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.parameters import Direction, Kind, ParameterName, of_curve
from bristle.page.wording import shortened

if TYPE_CHECKING:
    import pandas as pd


_FAR = 1e60  # largest size of a parameter in any unit, and of its inverse, so that squares stay finite


@result
class SessionFit:
    """One fit of a session."""

    source: str  # as `joint`, `tracking`, `static +` or `presliding -`
    parameters: Mapping[ParameterName, Estimate]
    names: tuple[ParameterName, ...] = ()  # those of the covariance
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    freedom: float = inf  # degrees of freedom
    distrusted: Finding | None = None  # why the fit is not to be trusted, and is used last


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionJoint:
    """One joint in one session."""

    kind: Kind
    fits: tuple[SessionFit, ...]  # in the order of use
    law: Law = GAUSSIAN
    simulated: bool = False
    torque_scale: Finding | None = None  # as of a `Joint`
    inputs: tuple[str, ...] = ()  # checksums of its files


Session = Mapping[str, SessionJoint]  # joints by name


class FitPair(NamedTuple):
    """The fits of one source in both sessions."""

    first: SessionFit
    second: SessionFit

    @property
    def distrusted(self) -> Finding | None:
        """Why one of the fits is not to be trusted; None where both are."""
        return self.first.distrusted or self.second.distrusted


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One parameter of one joint in both sessions; numbers are None where it cannot be compared."""

    joint: str
    parameter: ParameterName
    unit: str
    source: str  # of both values; empty where they cannot be compared
    first: Estimate | None
    second: Estimate | None
    difference: float | None = None  # second less first, in `unit`
    error: float | None = None  # standard error of the difference, in `unit`
    z: float | None = None  # difference over its standard error, of logarithms for v_s, sigma_0 and shapes of peaks
    p: float | None = None  # probability of at least this difference by chance
    adjusted: float | None = None  # Holm's, for all comparisons
    changed: bool | None = None  # whether it changed beyond the joint uncertainty
    verdict: Finding  # rose, fell, no change, or why it cannot be compared

    @property
    def percent(self) -> float | None:
        """The difference in percent of the first session's value; None where there is none, or that value is zero."""
        if self.difference is None or self.first is None or not self.first.value:
            return None
        return 100 * self.difference / abs(self.first.value)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetChange:
    """All parameters of one fit, compared at once."""

    joint: str
    source: str
    names: tuple[ParameterName, ...]
    statistic: float  # d' (C_a + C_b)**-1 d over their number
    freedom: float
    p: float
    adjusted: float  # Holm's, for all fits compared
    changed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Changes between two sessions. `bristle.report_of` gives its text, page and tables."""

    changes: tuple[Change, ...]
    sets: tuple[SetChange, ...]
    kinds: Mapping[str, Kind]
    """Kind of each joint compared."""
    sentence: Finding
    """The overall verdict."""
    warnings: tuple[Finding, ...]
    """The limits of the comparison."""
    simulated: bool

    def to_frame(self) -> "pd.DataFrame":
        """One row per joint and parameter: both values, the difference with its joint uncertainty, and the verdict."""
        import pandas as pd

        numbers = (
            "first_value", "first_error", "second_value", "second_error", "difference", "error", "z", "p", "adjusted_p",
        )  # fmt: skip  # a list of words
        rows = [
            (
                c.joint, c.parameter.name, c.parameter.direction, c.unit, c.source,
                *(x for e in (c.first, c.second) for x in ((e.value, e.standard_error) if e else (None, None))),
                c.difference, c.error, c.z, c.p, c.adjusted, c.changed, str(c.verdict),
            )
            for c in self.changes
        ]  # fmt: skip  # one row, one line
        columns = ["joint", "parameter", "direction", "unit", "source", *numbers, "changed", "verdict"]
        return pd.DataFrame(rows, columns=columns).astype({**dict.fromkeys(numbers, float), "changed": object})


def alike(name: str, first: Law, second: Law) -> bool:
    """Whether a parameter means the same in two laws: one of friction in sliding in one law alone.

    The tail of one peak, or a term, is the level alpha_0 or the viscous friction of another law: on one curve alpha_0
    may differ by tens of percent, and no cause is behind it.
    """
    return first == second or not of_curve(name)


def usable(e: Estimate) -> bool:
    """Whether an estimate has a value, a standard error and an interval closed on both sides."""
    numbers = (e.value, e.standard_error, *(e.interval or (None,)))
    return all(x is not None and isfinite(x) for x in numbers) and (e.standard_error or 0.0) > 0


def pairs(first: SessionJoint, second: SessionJoint) -> list[FitPair]:
    """Fits of one source in both sessions: trusted ones first, then in the order of use."""
    others = {fit.source: fit for fit in second.fits}
    found = [FitPair(fit, others[fit.source]) for fit in first.fits if fit.source in others]
    return sorted(found, key=lambda pair: bool(pair.distrusted))


def read_session(path: Path) -> Session:
    """The joints of a results file, by name. Raises InputError and OSError as `reading` and `session_of`."""
    with reading(path) as found:
        return session_of(document_of(found).joints.values())


def session_of(joints: Iterable[Joint]) -> Session:
    """Identified joints, by name, as a session to compare. Raises InputError where a number or a text is impossible."""
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
    """The text. Raises InputError where it has a control character or more than 400 characters."""
    if len(text) > 400:
        raise InputError(f"{what} {short(text)} has {len(text)} characters, more than 400")
    return check_name(text, what)


def _fits(joint: Joint) -> Iterator[SessionFit]:
    """The fits of a joint in the order of use, without v_end, which is no estimate."""
    for source, moving in (("joint", joint.joint_fit), ("tracking", joint.tracking)):
        if moving is not None:
            yield SessionFit(
                source=source, parameters={_name(name): _checked(e) for name, e in moving.parameters.items()},
                names=tuple(map(_name, moving.names)), covariance=_covariance(moving),
                distrusted=moving.outcome if moving.outcome.code == "not-converged" else None,
            )  # fmt: skip  # a list of values
    for d, fit in joint.static.items():
        if fit.degrees_of_freedom < 0:
            raise InputError(f"a fit has {fit.degrees_of_freedom} degrees of freedom")
        own = {_named(name, d): _checked(e) for name, e in fit.parameters.items() if name != FASTEST}
        names, freedom = tuple(_named(name, d) for name in fit.names), max(fit.degrees_of_freedom, 1)
        yield SessionFit(
            source=f"static {d}", parameters=own, names=names, covariance=_covariance(fit), freedom=freedom
        )
    for d, slow in (joint.presliding.fits if joint.presliding else {}).items():
        yield SessionFit(source=f"presliding {d}", parameters={_named("sigma_0", d): _checked(slow.sigma_0)})


def _name(name: ParameterName) -> ParameterName:
    return ParameterName(_shown(name.name, "parameter"), name.direction)


def _named(name: str, direction: str) -> ParameterName:
    """A parameter of a fit of some direction."""
    bare = ParameterName.parse(_shown(name, "parameter"))
    return ParameterName(name, Direction(direction)) if _shown(direction, "direction") in ("+", "-") else bare


def _checked(e: Estimate) -> Estimate:
    """The estimate without its findings. Raises InputError where its numbers are impossible or contradictory."""
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
    """A bound of an interval: infinite beyond `_FAR`, zero below its inverse."""
    if abs(bound) < 1 / _FAR:
        return 0.0
    return bound if abs(bound) < _FAR else copysign(inf, bound)


def _covariance(fit: StaticFit | TrackingFit) -> Array:
    """Covariance of the free parameters, nan where a number is too large. Raises InputError for another shape."""
    size = len(fit.names)
    if fit.covariance.shape != (size, size):
        raise InputError(f"a covariance is not of the {size} parameters that are free")
    known = np.where(np.abs(fit.covariance) > _FAR**2, np.nan, fit.covariance)
    return np.where(np.abs(known) < 1 / _FAR**2, 0.0, known)

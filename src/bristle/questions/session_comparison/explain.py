"""What a comparison of two sessions says: verdicts, reasons, and guesses at causes that are said to be guesses."""

from collections.abc import Iterator, Sequence

import numpy as np

from bristle.diagnostics import Kind
from bristle.findings import Finding
from bristle.identification.fits import Estimate
from bristle.model.parameters import ParameterName
from bristle.questions.session_comparison.results import Change, Session, SessionJoint, SetChange, alike, pairs, usable

_ALIKE = 0.5
"""Shares that differ by less than this part of their mean are one share."""
_LARGE = 1e6
"""A change of more percent is told by its power of ten."""
_CAUSES = {
    "alpha_0": (Kind.ALPHA_0_ROSE, Kind.ALPHA_0_FELL),
    "alpha_2": (Kind.ALPHA_2_ROSE, Kind.ALPHA_2_FELL),
    "sigma_0": (Kind.SIGMA_0_ROSE, Kind.SIGMA_0_FELL),
    "inertia": (Kind.INERTIA_ROSE, Kind.INERTIA_FELL),
}
"""Of what rose, and of what fell."""


def incomparable(joint: str, name: ParameterName, first: SessionJoint, second: SessionJoint, *, same: bool) -> Change:
    """A parameter that cannot be compared, with the reason; `same`: some stage has it in both sessions."""
    a, b = (_any(session, name) for session in (first, second))
    known = a or b
    return Change(
        joint=joint,
        parameter=name,
        unit=known.unit if known else "",
        source="",
        first=a,
        second=b,
        verdict=Kind.NOT_COMPARABLE(why=_why_not(name, first, second, same=same)),
    )


def _any(session: SessionJoint, name: ParameterName) -> Estimate | None:
    """What the first fit that knows it says of a parameter, or the first that names it."""
    found = [fit.parameters[name] for fit in session.fits if name in fit.parameters]
    return next((e for e in found if e.value is not None), found[0] if found else None)


def _why_not(name: ParameterName, first: SessionJoint, second: SessionJoint, *, same: bool) -> Finding:
    if not alike(name.name, first.law, second.law):
        return Kind.OF_OTHER_LAWS()
    told = {"first": _any(first, name), "second": _any(second, name)}
    for which, session in (("first", first), ("second", second)):
        if told[which] is None:
            others = {n.name for fit in session.fits for n in fit.parameters}
            return (Kind.IN_OTHER_DIRECTIONS if name.name in others else Kind.NOT_IN_SESSION)(which=which)
    unknown = [which for which, e in told.items() if e is None or e.value is None]
    if unknown:
        return Kind.NOT_IDENTIFIABLE_IN(where=_the(unknown))
    if not same:
        return Kind.OF_OTHER_STAGES()
    return Kind.OPEN_IN(where=_the([which for which, e in told.items() if e is None or not usable(e)]))


def _the(which: Sequence[str]) -> Finding:
    return Kind.ONE_SESSION(which=which[0]) if len(which) == 1 else Kind.BOTH_SESSIONS()


def verdict(c: Change, *, changed: bool) -> Finding:
    """What became of one parameter."""
    if not changed:
        return Kind.NO_CHANGE()
    return Kind.ROSE() if (c.difference or 0.0) > 0 else Kind.FELL()


def sentence(changes: Sequence[Change], sets: Sequence[SetChange]) -> Finding:
    """The overall verdict."""
    compared = [c for c in changes if c.changed is not None]
    if not compared:
        return Kind.NOTHING_COMPARED()
    moved = [c for c in compared if c.changed]
    several = len({c.joint for c in changes}) > 1
    left = len(changes) - len(compared)
    rest = Kind.MORE_NOT_COMPARABLE(count=left) if left else ""
    if moved:
        return Kind.PARAMETERS_CHANGED(
            moved=len(moved),
            compared=len(compared),
            changes=tuple(_change(c, several=several) for c in moved),
            sets=_together(moved, sets, several=several),
            rest=rest,
        )
    together = tuple(_named(x, several=several) for x in sets if x.changed)
    if together:
        return Kind.ONLY_SETS_CHANGED(compared=len(compared), fits=together, rest=rest)
    return Kind.NONE_CHANGED(compared=len(compared), rest=rest)


def _together(moved: Sequence[Change], sets: Sequence[SetChange], *, several: bool) -> Finding | str:
    """The sets that changed without any of their parameters doing so alone; empty where there are none."""
    alone = {(c.joint, c.parameter) for c in moved}
    silent = [x for x in sets if x.changed and alone.isdisjoint((x.joint, name) for name in x.names)]
    fits = tuple(_named(x, several=several) for x in silent)
    return Kind.SETS_CHANGED_TOO(fits=fits) if fits else ""


def _named(x: SetChange, *, several: bool) -> str:
    return f"{x.joint}, {x.source}" if several else x.source


def _change(c: Change, *, several: bool) -> Finding | str:
    """A parameter that changed, and by how many percent of the first session's value, where that is not zero."""
    name = f"{c.joint} {c.parameter}" if several else str(c.parameter)
    if c.percent is None:
        return name
    return (Kind.CHANGED_BY if abs(c.percent) < _LARGE else Kind.CHANGED_BY_POWERS)(name=name, percent=c.percent)


def hints(changes: Sequence[Change]) -> Iterator[Finding]:
    """What such changes may come from, joint by joint: guesses, said as such."""
    for joint in dict.fromkeys(c.joint for c in changes):
        yield from _hints_of(joint, [c for c in changes if c.joint == joint and c.changed is not None])


def _hints_of(joint: str, own: Sequence[Change]) -> Iterator[Finding]:
    torques = [c for c in own if c.parameter.name in ("alpha_0", "alpha_2", "inertia")]
    shares = [(c.difference or 0.0) / abs(c.first.value) for c in torques if c.first and c.first.value]
    if len(shares) > 2 and any(c.changed for c in torques) and np.ptp(shares) < _ALIKE * abs(np.mean(shares)):
        yield Kind.TORQUE_SCALE(joint=joint)
        return
    for name, (rose, fell) in _CAUSES.items():
        found = [c for c in own if c.parameter.name == name]
        signs = {(c.difference or 0.0) > 0 for c in found}
        if any(c.changed for c in found) and len(signs) == 1:
            everywhere = Kind.IN_BOTH_DIRECTIONS() if len(found) > 1 else ""
            yield (rose if signs == {True} else fell)(joint=joint, everywhere=everywhere)


def warnings(first: Session, second: Session, shared: Sequence[str]) -> Iterator[Finding]:
    """What limits the comparison."""
    for which, session, other in (("first", first, second), ("second", second, first)):
        alone = tuple(name for name in session if name not in other)
        if alone:
            yield Kind.IN_ONE_SESSION(which=which, names=alone)
    for name in shared:
        yield from _warnings_of(name, first[name], second[name])


def _of_constants(joint: str, a: SessionJoint, b: SessionJoint) -> Iterator[Finding]:
    """What is said of the constants that torques were computed with."""
    of_a, of_b = ({c: 0 for fit in x.fits for e in fit.parameters.values() for c in e.shifts} for x in (a, b))
    common, own = tuple(c for c in of_a if c in of_b), tuple(sorted(of_a.keys() ^ of_b.keys()))
    if common:
        yield Kind.COMMON_CONSTANTS(joint=joint, constants=common)
    if own:
        yield Kind.OWN_CONSTANTS(joint=joint, constants=own)
    yield from dict.fromkeys(x.torque_scale for x in (a, b) if x.torque_scale and not (common or own))


def _warnings_of(joint: str, a: SessionJoint, b: SessionJoint) -> Iterator[Finding]:
    same, files = len(set(a.inputs) & set(b.inputs)), max(len(set(a.inputs)), len(set(b.inputs)))
    if same:
        yield (
            Kind.FILES_ALL_SHARED(joint=joint)
            if same == files
            else Kind.FILES_SHARED(joint=joint, same=same, files=files)
        )
    yield from _of_constants(joint, a, b)
    if a.simulated != b.simulated:
        yield Kind.ONE_SIMULATED(joint=joint)
    if a.law != b.law:
        yield Kind.LAWS_DIFFER(joint=joint, first=a.law.name, second=b.law.name)
    for pair in pairs(a, b):
        source = pair.first.source
        if pair.distrusted:
            yield Kind.FIT_DISTRUSTED(joint=joint, source=source, why=pair.distrusted)
        known = [{n for n, e in fit.parameters.items() if e.value is not None} for fit in pair]
        for which, more in (("first", known[0] - known[1]), ("second", known[1] - known[0])):
            own = (n for n in more if alike(n.name, a.law, b.law))
            terms = tuple(sorted(str(n) for n in own if n.name.startswith(("alpha", "offset"))))
            if terms:
                yield Kind.MODELS_DIFFER(joint=joint, terms=terms, which=which, source=source)

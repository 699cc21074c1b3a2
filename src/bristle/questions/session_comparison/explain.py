"""What a comparison of two sessions says: verdicts, reasons, and guesses at causes that are said to be guesses."""

from collections.abc import Iterator, Sequence

import numpy as np

from bristle.identification.results import Estimate
from bristle.model.parameters import ParameterName
from bristle.questions.session_comparison.results import Change, Session, SessionJoint, SetChange, pairs, usable

_ALIKE = 0.5
"""Shares that differ by less than this part of their mean are one share."""
_LARGE = 1e6
"""A change of more percent is told by its power of ten."""
_LOAD = 2 * (
    "another load, or another scale of the torque (motor constant, drive gain), which would scale the friction alike,",
)
_CAUSES = {
    "alpha_0": ("wear, dirt, a tighter preload or a colder joint", "running in, a warmer joint or a lost preload"),
    "alpha_2": ("a colder or stiffer lubricant", "a warmer or thinner lubricant"),
    "sigma_0": ("a tighter preload", "wear or a lost preload"),
    "inertia": _LOAD,
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
        verdict=f"Not comparable: {_why_not(name, first, second, same=same)}.",
    )


def _any(session: SessionJoint, name: ParameterName) -> Estimate | None:
    """What the first fit that knows it says of a parameter, or the first that names it."""
    found = [fit.parameters[name] for fit in session.fits if name in fit.parameters]
    return next((e for e in found if e.value is not None), found[0] if found else None)


def _why_not(name: ParameterName, first: SessionJoint, second: SessionJoint, *, same: bool) -> str:
    told = {"first": _any(first, name), "second": _any(second, name)}
    for which, session in (("first", first), ("second", second)):
        if told[which] is None:
            names = {n for fit in session.fits for n in fit.parameters}
            split = name.name in {n.name for n in names}
            how = (
                "has it in other directions; identify both with the same fit.directions"
                if split
                else "does not have it"
            )
            return f"the {which} session {how}"
    unknown = [which for which, e in told.items() if e is None or e.value is None]
    if unknown:
        return f"it is not identifiable in {_the(unknown)}"
    if not same:
        return "the sessions have it from different stages"
    return f"its interval is open, or one-sided, in {_the([which for which, e in told.items() if e is None or not usable(e)])}"


def _the(which: Sequence[str]) -> str:
    return f"the {which[0]} session" if len(which) == 1 else "both sessions"


def verdict(c: Change, *, changed: bool) -> str:
    """What became of one parameter."""
    if not changed:
        return "No change beyond the joint uncertainty."
    return f"{'Rose' if (c.difference or 0.0) > 0 else 'Fell'} beyond the joint uncertainty."


def sentence(changes: Sequence[Change], sets: Sequence[SetChange]) -> str:
    """The overall verdict."""
    compared = [c for c in changes if c.changed is not None]
    if not compared:
        return "Nothing can be compared: no parameter has a closed interval from the same stage in both sessions."
    moved = [c for c in compared if c.changed]
    several = len({c.joint for c in changes}) > 1
    left = len(changes) - len(compared)
    rest = f" {left} more cannot be compared." if left else ""
    if moved:
        said = ", ".join(f"{f'{c.joint} ' * several}{c.parameter}{_share(c)}" for c in moved)
        rest = f"{_together(moved, sets, several=several)}{rest}"
        return f"{len(moved)} of {len(compared)} parameters changed beyond their joint uncertainty: {said}.{rest}"
    together = [_named(x, several=several) for x in sets if x.changed]
    if together:
        return (
            f"None of {len(compared)} parameters changed beyond its joint uncertainty alone, but as a set those of {'; '.join(together)} did: "
            f"the friction changed, and which of them is not told apart.{rest}"
        )
    return f"None of {len(compared)} parameters changed beyond its joint uncertainty.{rest}"


def _together(moved: Sequence[Change], sets: Sequence[SetChange], *, several: bool) -> str:
    """The sets that changed without any of their parameters doing so alone; one sentence, or none."""
    alone = {(c.joint, c.parameter) for c in moved}
    silent = [x for x in sets if x.changed and alone.isdisjoint((x.joint, name) for name in x.names)]
    found = [_named(x, several=several) for x in silent]
    return f" As a set, though none alone, so did those of the fit {'; '.join(found)}." if found else ""


def _named(x: SetChange, *, several: bool) -> str:
    return f"{x.joint}, {x.source}" if several else x.source


def _share(c: Change) -> str:
    """By how much, in percent of the first session's value."""
    share = 100 * (c.difference or 0.0) / abs(c.first.value) if c.first and c.first.value else None
    return "" if share is None else f" ({share:+.1f} %)" if abs(share) < _LARGE else f" ({share:+.1e} %)"


def hints(changes: Sequence[Change]) -> Iterator[str]:
    """What such changes may come from, joint by joint: guesses, said as such."""
    for joint in dict.fromkeys(c.joint for c in changes):
        own = [c for c in changes if c.joint == joint and c.changed is not None]
        yield from (f"{joint}: {hint}" for hint in _hints_of(own))


def _hints_of(own: Sequence[Change]) -> Iterator[str]:
    torques = [c for c in own if c.parameter.name in ("alpha_0", "alpha_2", "inertia")]
    shares = [(c.difference or 0.0) / abs(c.first.value) for c in torques if c.first and c.first.value]
    if len(shares) > 2 and any(c.changed for c in torques) and np.ptp(shares) < _ALIKE * abs(np.mean(shares)):
        yield "friction and inertia changed by one share; that may be the torque's scale (motor constant, drive gain), not the friction."
        return
    for name, (rose, fell) in _CAUSES.items():
        found = [c for c in own if c.parameter.name == name]
        signs = {(c.difference or 0.0) > 0 for c in found}
        if any(c.changed for c in found) and len(signs) == 1:
            everywhere = " in both directions" if len(found) > 1 else ""
            how, cause = ("rose", rose) if signs == {True} else ("fell", fell)
            yield f"{name} {how}{everywhere}; {cause} may do that."


def warnings(first: Session, second: Session, shared: Sequence[str]) -> Iterator[str]:
    """What limits the comparison."""
    for which, session, other in (("first", first, second), ("second", second, first)):
        alone = [name for name in session if name not in other]
        if alone:
            yield f"In the {which} session alone: {', '.join(alone)}."
    for name in shared:
        yield from (f"{name}: {said}" for said in _warnings_of(first[name], second[name]))


def _warnings_of(a: SessionJoint, b: SessionJoint) -> Iterator[str]:
    same = len(set(a.inputs) & set(b.inputs))
    if same:
        of = max(len(set(a.inputs)), len(set(b.inputs)))
        yield (
            f"the sessions share data and are not independent: {'all' if same == of else f'{same} of {of}'} of the files are the same in both. "
            "Errors of differences are overstated, and changes missed."
        )
    if a.simulated != b.simulated:
        yield "one session is SIMULATED, the other measured."
    for pair in pairs(a, b):
        why = " ".join(dict.fromkeys(fit.distrusted for fit in pair if fit.distrusted))
        if why:
            yield f"the {pair.first.source} fit is used only for what no other fit knows: {why}"
        known = [{n for n, e in fit.parameters.items() if e.value is not None} for fit in pair]
        for which, more in (("first", known[0] - known[1]), ("second", known[1] - known[0])):
            terms = sorted(str(n) for n in more if n.name.startswith(("alpha", "offset")))
            if terms:
                yield (
                    f"{', '.join(terms)} is known of the {which} session alone by its {pair.first.source} fit: the two models differ, and so may "
                    "the other parameters without any change of the joint."
                )

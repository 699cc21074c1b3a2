"""Findings of a comparison of two sessions: its verdict, why parameters cannot be compared, and its limits."""

from collections.abc import Iterator, Sequence

import numpy as np

from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.fits import Estimate
from bristle.model.parameters import ParameterName
from bristle.questions.session_comparison.results import Change, Session, SessionJoint, SetChange, alike, pairs, usable

_ALIKE = 0.5  # relative changes whose range is less than this share of their mean count as one ratio
NO_CHANGE = Finding("no-change", NOTE, "No change beyond the joint uncertainty.")


def incomparable(joint: str, name: ParameterName, first: SessionJoint, second: SessionJoint, *, same: bool) -> Change:
    """A parameter that cannot be compared, with the reason; `same`: some stage has it in both sessions."""
    found: dict[str, Estimate | None] = {}
    for which, session in (("first", first), ("second", second)):  # the first estimate with a value, or without one
        own = [fit.parameters[name] for fit in session.fits if name in fit.parameters]
        found[which] = next((e for e in own if e.value is not None), own[0] if own else None)
    lacking = [which for which, e in found.items() if e is None]
    unknown = [which for which, e in found.items() if e is None or e.value is None]
    opened = [which for which, e in found.items() if e is None or not usable(e)]
    those = unknown or opened
    where = f"the {those[0]} session" if len(those) == 1 else "both sessions"
    why = f"it is not identifiable in {where}" if unknown else f"its interval is open, or one-sided, in {where}"
    if not alike(name.name, first.law, second.law):
        why = "it means another thing in the law of each session"
    elif lacking:
        names = {n.name for fit in (first if lacking[0] == "first" else second).fits for n in fit.parameters}
        why = f"the {lacking[0]} session does not have it"
        if name.name in names:
            why = f"the {lacking[0]} session has it in other directions; identify both with the same fit.directions"
    elif not unknown and not same:
        why = "the sessions have it from different stages"
    a, b = found.values()
    unit = next((e.unit for e in (a, b) if e), "")
    finding = Finding("not-comparable", NOTE, f"Not comparable: {why}.")
    return Change(joint=joint, parameter=name, unit=unit, source="", first=a, second=b, verdict=finding)


def sentence(changes: Sequence[Change], sets: Sequence[SetChange]) -> Finding:
    """The overall verdict."""
    compared = [c for c in changes if c.changed is not None]
    if not compared:
        message = "Nothing can be compared: no parameter has a closed interval from the same stage in both sessions."
        return Finding("nothing-compared", CAUTION, message)
    moved = [c for c in compared if c.changed]
    alone = {(c.joint, c.parameter) for c in moved}
    silent = [x for x in sets if x.changed and alone.isdisjoint((x.joint, name) for name in x.names)]
    several = len({c.joint for c in changes}) > 1
    fits = tuple(f"{x.joint}, {x.source}" if several else x.source for x in silent)
    left = len(changes) - len(compared)
    rest = f" {left} more cannot be compared." if left else ""
    if moved:
        listed = []  # and by how many percent of the first session's value, where that is not zero
        for c in moved:
            by = ""
            if c.percent is not None:
                by = f" ({c.percent:+.1f} %)" if abs(c.percent) < 1e6 else f" ({c.percent:+.1e} %)"
            listed.append(f"{f'{c.joint} ' * several}{c.parameter}{by}")
        together = f" As a set, though none alone, so did those of the fit {'; '.join(fits)}." if fits else ""
        message = f"{len(moved)} of {len(compared)} parameters changed beyond their joint uncertainty: {', '.join(listed)}.{together}{rest}"
        percents = tuple((c.joint, str(c.parameter), c.percent) for c in moved)
        numbers = {"compared": len(compared), "changes": percents, "fits": fits}
        return Finding("parameters-changed", NOTE, message, numbers)
    if fits:
        message = (
            f"None of {len(compared)} parameters changed beyond its joint uncertainty alone, but as a set those of "
            f"{'; '.join(fits)} did: the friction changed, and which of them is not told apart.{rest}"
        )
        return Finding("only-sets-changed", NOTE, message, {"compared": len(compared), "fits": fits})
    message = f"None of {len(compared)} parameters changed beyond its joint uncertainty.{rest}"
    return Finding("none-changed", NOTE, message, {"compared": len(compared)})


def warnings(first: Session, second: Session, shared: Sequence[str], changes: Sequence[Change]) -> Iterator[Finding]:
    """The limits of a comparison: joints in one session, a scale of torque, shared data and constants, other models."""
    for which, session, other in (("first", first, second), ("second", second, first)):
        alone = tuple(name for name in session if name not in other)
        if alone:
            message = f"Only the {which} session has {', '.join(alone)}: it cannot be compared."
            yield Finding("in-one-session", CAUTION, message, {"names": alone})
    for name in shared:
        torques = [c for c in changes if c.joint == name and c.parameter.name in ("alpha_0", "alpha_2", "inertia")]
        known = [
            (c.difference or 0.0) / abs(c.first.value)
            for c in torques
            if c.changed is not None and c.first and c.first.value
        ]
        if len(known) > 2 and any(c.changed for c in torques) and np.ptp(known) < _ALIKE * abs(np.mean(known)):
            message = (
                f"{name}: friction and inertia changed by the same ratio; that may be the torque's scale (motor "
                "constant, drive gain), not the friction."
            )
            yield Finding("torque-scale", NOTE, message)
        yield from _warnings_of(name, first[name], second[name])


def _warnings_of(joint: str, a: SessionJoint, b: SessionJoint) -> Iterator[Finding]:
    same, files = len(set(a.inputs) & set(b.inputs)), max(len(set(a.inputs)), len(set(b.inputs)))
    if same:
        which = "all" if same == files else f"{same} of {files}"
        message = (
            f"{joint}: the sessions share data and are not independent: {which} of the files are the same in both. "
            "Errors of differences are overstated, and changes missed."
        )
        yield Finding("files-shared", CAUTION, message, {"same": same, "files": files})
    # The constants that torques were computed with.
    of_a, of_b = ({c: 0 for fit in x.fits for e in fit.parameters.values() for c in e.shifts} for x in (a, b))
    common, alone = tuple(c for c in of_a if c in of_b), tuple(sorted(of_a.keys() ^ of_b.keys()))
    if common:
        message = (
            f"{joint}: {' and '.join(common)} is common to both sessions: its error moves both alike, "
            "and does not widen their difference."
        )
        yield Finding("common-constants", NOTE, message, {"constants": common})
    if alone:
        message = f"{joint}: {' and '.join(alone)} belongs to one session only: its error widens the differences."
        yield Finding("own-constants", NOTE, message, {"constants": alone})
    yield from dict.fromkeys(x.torque_scale for x in (a, b) if x.torque_scale and not (common or alone))
    if a.simulated != b.simulated:
        yield Finding("one-simulated", CAUTION, f"{joint}: one session is SIMULATED, the other measured.")
    if a.law != b.law:
        message = (
            f"{joint}: the first session has the friction law {a.law.name}, the second {b.law.name}, so only parameters "
            "that mean the same in both are compared; to compare all, identify both sessions with one law, "
            f"as `law: {b.law.name}` under fit."
        )
        yield Finding("laws-differ", CAUTION, message)
    for pair in pairs(a, b):
        source = pair.first.source
        if pair.distrusted:
            why = pair.distrusted.message
            message = f"{joint}: the {source} fit is used only for what no other fit knows: {why}"
            yield Finding("fit-distrusted", CAUTION, message)
        known = [{n for n, e in fit.parameters.items() if e.value is not None} for fit in pair]
        for which, more in (("first", known[0] - known[1]), ("second", known[1] - known[0])):
            own = (n for n in more if alike(n.name, a.law, b.law))
            terms = tuple(sorted(str(n) for n in own if n.name.startswith(("alpha", "offset"))))
            if terms:
                message = (
                    f"{joint}: {', '.join(terms)} is known only in the {which} session, by its {source} fit: "
                    "the two models differ, and so may the other parameters without any change of the joint."
                )
                yield Finding("models-differ", CAUTION, message, {"terms": terms})

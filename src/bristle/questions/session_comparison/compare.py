"""Comparison of two sessions: which parameters changed beyond their joint uncertainty.

The sessions are independent, so the variances add. The standard error of a value is the half of its interval on the
side of the other session's value (Zou and Donner, 2008), over Student's t, and at least the stated standard error. The
degrees of freedom of a difference are Welch's; p-values are adjusted for many comparisons (Holm, 1979). The error of a
constant that both sessions used, as a torque constant, moves both values alike, and only its effect on their difference
counts. One test per fit asks whether its parameters changed as a set: d' (C_a + C_b)**-1 d. Under different friction
laws only parameters with the same meaning in both are compared.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import hypot, inf, isfinite, log

import numpy as np
from scipy.special import fdtrc, stdtr, stdtrit

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.fits import Estimate
from bristle.identification.systematic import statistical
from bristle.model.parameters import ParameterName, of_shape
from bristle.questions.session_comparison import results

_MANY = 1e9  # stands for infinite degrees of freedom
NO_CHANGE = Finding("no-change", NOTE, "No change beyond the joint uncertainty.")


def compare(first: results.Session, second: results.Session) -> results.Comparison:
    """Changes of the joints in both sessions. Raises InputError without such a joint, or for other kinds or units."""
    shared = [name for name in first if name in second]
    if not shared:
        listed = (", ".join(session) or "none" for session in (first, second))
        one, other = (names if len(names) <= 120 else f"{names[:120]}..." for names in listed)
        raise InputError(
            f"no joint is in both sessions: one has {one}, the other {other}; give the joint one name in both experiment files"
        )
    for name in shared:
        if first[name].kind != second[name].kind:
            raise InputError(
                f"{name}: is {first[name].kind} in one session and {second[name].kind} in the other; compare results of one joint"
            )
    both = {name: (first[name], second[name]) for name in shared}
    changes = [change for name, (a, b) in both.items() for change in _changes(name, a, b)]
    known = [k for k, c in enumerate(changes) if c.p is not None]
    for k, p in zip(known, holm(np.array([changes[k].p for k in known], dtype=float)).tolist(), strict=True):
        rose = (changes[k].difference or 0.0) > 0
        moved = Finding("rose" if rose else "fell", NOTE, f"{'Rose' if rose else 'Fell'} beyond the joint uncertainty.")
        changes[k] = replace(
            changes[k], adjusted=p, changed=p < levels.NAMED, verdict=moved if p < levels.NAMED else NO_CHANGE
        )
    sets = [x for name, (a, b) in both.items() for x in _sets(name, a, b)]
    adjusted = holm(np.array([x.p for x in sets])).tolist()
    sets = [replace(x, adjusted=p, changed=p < levels.NAMED) for x, p in zip(sets, adjusted, strict=True)]
    return results.Comparison(
        changes=tuple(changes), sets=tuple(sets), kinds={name: first[name].kind for name in shared},
        sentence=sentence(changes, sets), warnings=tuple(warnings(first, second, shared, changes)),
        simulated=any(session[name].simulated for session in (first, second) for name in shared),
    )  # fmt: skip  # a list of values


def holm(p: Array) -> Array:
    """Holm's adjusted p-values, (n,): the k-th smallest times n - k + 1, not decreasing, at most 1."""
    order = np.argsort(p, kind="stable")
    adjusted = np.empty(p.size)
    adjusted[order] = np.minimum(np.maximum.accumulate(np.sort(p) * (p.size - np.arange(p.size))), 1.0)
    return adjusted


def _changes(joint: str, first: results.SessionJoint, second: results.SessionJoint) -> Iterator[results.Change]:
    """The change of each parameter, by the first fit that knows it in both sessions. Raises InputError as `compare`."""
    paired = results.pairs(first, second)
    for name in dict.fromkeys(name for session in (first, second) for fit in session.fits for name in fit.parameters):
        fits = paired if results.alike(name.name, first.law, second.law) else []
        both = [pair for pair in fits if name in pair.first.parameters and name in pair.second.parameters]
        known = next((pair for pair in both if all(results.usable(fit.parameters[name]) for fit in pair)), None)
        found = (fit.parameters[name].unit for x in (first, second) for fit in x.fits if name in fit.parameters)
        units = list(dict.fromkeys(found))
        if len(units) > 1:
            raise InputError(
                f"{joint}: {name} is in {units[0]} and in {units[1]}; compare results of one joint, in one unit"
            )
        if known is None:
            yield incomparable(joint, name, first, second, same=bool(both))
        else:
            yield _difference(joint, name, known)


def _difference(joint: str, name: ParameterName, pair: results.FitPair) -> results.Change:
    """The change of a parameter between two fits, not yet adjusted for many comparisons."""
    a, b = (fit.parameters[name] for fit in pair)
    value = (b.value or 0.0) - (a.value or 0.0)
    lowest = min(x for e in (a, b) for x in (e.interval[0] if e.interval else -inf, e.value or 0.0))
    by_factor = _by_factor(name) and lowest > 0
    scale = log if by_factor else float
    apart = scale(b.value or 0.0) - scale(a.value or 0.0)
    sides = zip((a, b), pair, (1, -1), strict=True)
    errors = [_facing(e, apart * side, fit.freedom, log_scale=by_factor) for e, fit, side in sides]
    slopes = [1 / (e.value or 1.0) if by_factor else 1.0 for e in (a, b)]
    errors += _systematic(a, b, *slopes).values()
    z = apart / hypot(*errors)
    # Degrees of freedom of a difference (Welch and Satterthwaite); infinite for the error of a constant.
    shares = [e**2 / sum(x**2 for x in errors) for e in errors[:2]]
    freedom = 1 / max(sum(s**2 / fit.freedom for s, fit in zip(shares, pair, strict=True)), 1e-9)
    p = 2 * float(stdtr(min(freedom, _MANY), -abs(z)))
    error = abs(value / z) if z else hypot(a.standard_error or 0.0, b.standard_error or 0.0)
    return results.Change(
        joint=joint, parameter=name, unit=a.unit, source=pair.first.source, first=a, second=b,
        difference=value, error=error, z=z, p=p, verdict=NO_CHANGE,
    )  # fmt: skip  # a list of values


def _systematic(a: Estimate, b: Estimate, by_a: float, by_b: float) -> dict[str, float]:
    """Change of by_b b - by_a a per standard error of each constant."""
    constants = dict.fromkeys((*a.shifts, *b.shifts))
    return {c: b.shifts.get(c, 0.0) * by_b - a.shifts.get(c, 0.0) * by_a for c in constants}


def _facing(e: Estimate, towards: float, freedom: float, *, log_scale: bool) -> float:
    """Standard error by scatter alone, on the upper side where `towards` is positive, else on the lower."""
    value, error, (low, high) = e.value or 0.0, e.standard_error or 0.0, statistical(e) or (0.0, 0.0)
    if log_scale:
        error, half = error / value, log(high / value) if towards > 0 else log(value / low)
    else:
        half = high - value if towards > 0 else value - low
    return max(error, half / float(stdtrit(min(freedom, _MANY), 0.975)))


def _sets(joint: str, first: results.SessionJoint, second: results.SessionJoint) -> Iterator[results.SetChange]:
    """The test of each fit that both sessions have and trust, over the parameters that both know."""
    for a, b in results.pairs(first, second):
        shared = (n for n in dict.fromkeys(a.names) if n in b.names and results.alike(n.name, first.law, second.law))
        known = ({n for n, e in fit.parameters.items() if results.usable(e)} for fit in (a, b))
        both = set.intersection(*known)
        names = tuple(n for n in shared if n in both)
        freedom = min(a.freedom, b.freedom)
        if len(names) < 2 or freedom - len(names) < levels.LEAST_FREEDOM or results.FitPair(a, b).distrusted:
            continue
        statistic = _statistic(a, b, names)
        if statistic is None:
            continue
        p = float(fdtrc(len(names), min(freedom, _MANY), statistic))
        yield results.SetChange(
            joint=joint, source=a.source, names=names, statistic=statistic, freedom=freedom, p=p, adjusted=p, changed=False
        )  # fmt: skip  # a list of values


def _statistic(a: results.SessionFit, b: results.SessionFit, names: Sequence[ParameterName]) -> float | None:
    """The statistic d' (C_a + C_b)**-1 d over the number of parameters; None where the sum is not positive definite."""
    with np.errstate(all="ignore"):  # a foreign file may hold any numbers
        first, second = (np.array([_scaled(fit, n) for n in names]) for fit in (a, b))
        apart = second[:, 0] - first[:, 0]
        total = np.zeros((len(names), len(names)))
        for fit, slope in ((a, first[:, 1]), (b, second[:, 1])):
            own = [fit.names.index(n) for n in names]
            total += fit.covariance[np.ix_(own, own)] * np.outer(slope, slope)
        slopes = zip(names, first[:, 1].tolist(), second[:, 1].tolist(), strict=True)
        moved = [_systematic(a.parameters[n], b.parameters[n], by_a, by_b) for n, by_a, by_b in slopes]
        for constant in dict.fromkeys(c for by in moved for c in by):
            together = np.array([by.get(constant, 0.0) for by in moved])
            total += np.outer(together, together)
        size = np.sqrt(np.diag(total))
        correlation = total / np.outer(size, size)
        correlation, far = (correlation + correlation.T) / 2, np.abs(correlation - correlation.T).max()
        if not np.isfinite(correlation).all() or far > 1e-6 or np.linalg.eigvalsh(correlation).min() <= 1e-10:
            return None
        statistic = float(apart / size @ np.linalg.solve(correlation, apart / size)) / len(names)
    return statistic if isfinite(statistic) else None


def _by_factor(name: ParameterName) -> bool:
    """Whether a parameter is compared by its logarithm."""
    return name.name in ("v_s", "sigma_0") or of_shape(name.name)


def _scaled(fit: results.SessionFit, name: ParameterName) -> tuple[float, float]:
    """The value that is compared, or its logarithm, and the derivative of that by the value."""
    value = fit.parameters[name].value or 0.0
    return (log(value), 1 / value) if _by_factor(name) and value > 0 else (value, 1.0)


def incomparable(
    joint: str, name: ParameterName, first: results.SessionJoint, second: results.SessionJoint, *, same: bool
) -> results.Change:
    """A parameter that cannot be compared, with the reason; `same`: some stage has it in both sessions."""
    found: dict[str, Estimate | None] = {}
    for which, session in (("first", first), ("second", second)):  # the first estimate with a value, or without one
        own = [fit.parameters[name] for fit in session.fits if name in fit.parameters]
        found[which] = next((e for e in own if e.value is not None), own[0] if own else None)
    lacking = [which for which, e in found.items() if e is None]
    unknown = [which for which, e in found.items() if e is None or e.value is None]
    opened = [which for which, e in found.items() if e is None or not results.usable(e)]
    those = unknown or opened
    where = f"the {those[0]} session" if len(those) == 1 else "both sessions"
    why = f"it is not identifiable in {where}" if unknown else f"its interval is open, or one-sided, in {where}"
    if not results.alike(name.name, first.law, second.law):
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
    return results.Change(joint=joint, parameter=name, unit=unit, source="", first=a, second=b, verdict=finding)


def sentence(changes: Sequence[results.Change], sets: Sequence[results.SetChange]) -> Finding:
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


def warnings(
    first: results.Session, second: results.Session, shared: Sequence[str], changes: Sequence[results.Change]
) -> Iterator[Finding]:
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
        if (
            len(known) > 2
            and any(c.changed for c in torques)
            and np.ptp(known) < levels.ONE_RATIO * abs(np.mean(known))
        ):
            message = (
                f"{name}: friction and inertia changed by the same ratio; that may be the torque's scale (motor "
                "constant, drive gain), not the friction."
            )
            yield Finding("torque-scale", NOTE, message)
        yield from _warnings_of(name, first[name], second[name])


def _warnings_of(joint: str, a: results.SessionJoint, b: results.SessionJoint) -> Iterator[Finding]:
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
    for pair in results.pairs(a, b):
        source = pair.first.source
        if pair.distrusted:
            why = pair.distrusted.message
            message = f"{joint}: the {source} fit is used only for what no other fit knows: {why}"
            yield Finding("fit-distrusted", CAUTION, message)
        known = [{n for n, e in fit.parameters.items() if e.value is not None} for fit in pair]
        for which, more in (("first", known[0] - known[1]), ("second", known[1] - known[0])):
            own = (n for n in more if results.alike(n.name, a.law, b.law))
            terms = tuple(sorted(str(n) for n in own if n.name.startswith(("alpha", "offset"))))
            if terms:
                message = (
                    f"{joint}: {', '.join(terms)} is known only in the {which} session, by its {source} fit: "
                    "the two models differ, and so may the other parameters without any change of the joint."
                )
                yield Finding("models-differ", CAUTION, message, {"terms": terms})

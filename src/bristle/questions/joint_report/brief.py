"""Text of the command line: the short fit report, and lines on fits, segments, laws and cross-checks."""

from collections import Counter
from collections.abc import Iterator, Sequence
from math import inf, isfinite

import numpy as np

from bristle.arrays import Array
from bristle.findings import Finding, Severity
from bristle.identification.curve import stated_curve, tops_of
from bristle.identification.fits import Estimate, TrackingFit
from bristle.identification.known_joint import Known, Source, as_identified, chosen, value_fits
from bristle.identification.measured import Measured
from bristle.identification.results import Joint
from bristle.identification.shared_findings import NOT_IDENTIFIABLE
from bristle.identification.verdict import other_warnings, value_warnings, verdict
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST
from bristle.model.parameters import (
    SIGNED,
    Direction,
    Lugre,
    ParameterName,
    Stribeck,
    in_direction,
    of_curve,
    of_friction,
    unit,
)
from bristle.page.plain import columns, in_unit, interval, pair, wrapped
from bristle.page.said import with_places
from bristle.page.wording import FITS, counted, number, printable, shortened
from bristle.questions.joint_report.sentences import held_out, known_to

LINES = 3  # most lines of findings that are not critical
_SOURCES = {Source.STATIC: "static fit", Source.PRESLIDING: "presliding"}


def brief_report(joints: Sequence[Joint]) -> str:
    """A line per joint of several, then each joint's values and warnings, critical ones first."""
    lines = list(verdicts(joints)) if len(joints) > 1 else []
    for joint in joints:
        found, simulated = verdict(joint), ", SIMULATED data" if joint.simulated else ""
        trust = f"{printable(joint.name)} ({joint.kind}{simulated}): {found.trust}. {known_to(joint, '+/-')}"
        lines += [*([""] if lines else []), *wrapped([trust])]
        if found.reason is not None:
            lines += _sentence(joint, found.reason)
        told = (*friction_line(joint), *decided(joint))
        lines += wrapped(f"  {about}: {printable(said)}" for about, said in told)
        lines += (*_values(joint), *_rest(joint, found.reason))
    return "\n".join([*lines, "", "What a code in brackets means: bristle explain CODE. Every fit: --full."]) + "\n"


def verdicts(joints: Sequence[Joint]) -> Iterator[str]:
    """A table: whether to use each joint's values, why not, and the largest hold-out error."""
    rows = [("joint", "its values", "friction to", "reason", "hold-out error")]
    for joint in joints:
        found, held, known = verdict(joint), held_out(joint), joint.accuracy
        error = "-" if held is None else f"{number(held, 2)} %"
        to = "-" if known is None or not isfinite(known.band) else f"+/- {number(known.band, 2)} %"
        rows.append((shortened(joint.name, 32), str(found.trust), to, _code(found.reason), error))
    yield from columns(rows, indent=0)


def _code(reason: Finding | None) -> str:
    return "" if reason is None else f"[{reason.code}]"


def friction_line(joint: Joint) -> Iterator[tuple[str, str]]:
    """Friction at the slowest and the fastest speed, with its band."""
    known, speed = joint.accuracy, unit("v_s", joint.kind)
    if known is None:
        return
    ways = dict[str, Array]()
    for tops in (known.fastest, known.fastest), tops_of(joint):  # of each direction where they differ
        v = np.array([[known.slowest, tops[0]], [-known.slowest, -tops[1]]]).ravel()
        plus, minus = np.stack([*np.abs(stated_curve(joint, v)), np.abs(v)], axis=1).reshape(2, -1, 3)
        ways = {"+": plus, "-": minus}
        if np.allclose(plus, minus, rtol=1e-9):
            ways = {"": plus}
            break
    model = as_identified(joint)
    given = {name for d in SIGNED for name, value in model.values(d).items() if value}
    claimed = [row for row in chosen(joint) if row.estimate.value is not None]
    given |= {row.parameter.name for row in chosen(joint) if row.estimate.value}
    terms = {
        "alpha_0": "alpha_0",
        "alpha_1": "alpha_1 exp(-(v / v_s)**2)",
        "alpha_2": "alpha_2 v",
        "quadratic": "quadratic v**2",
    }
    torque = unit("alpha_0", joint.kind)
    told = []
    for d, curve in ways.items():
        if np.isfinite(curve[:, 0]).all():
            ends = (
                f"{number(T, 3)} {torque} {f'{interval((T - half, T + half))} ' * isfinite(half)}at {number(at, 3)} {speed}"
                for T, half, at in curve.tolist()
            )
            # What is not claimed is still part of the fitted curve.
            side = Direction(d or "+")
            told_of = {row.parameter.name for row in claimed if row.parameter.direction in (side, Direction.BOTH)}
            peak = model.values(side).get("alpha_1")
            asked = (x for x in Stribeck._fields if x not in told_of and (peak or x != "v_s"))
            held = {x: value for x in asked if (value := in_direction(model.held, x, side))}
            shape = ", ".join(f"{x} {number(value, 3)} {unit(x, joint.kind)}" for x, value in held.items())
            unclaimed = f", with the fit's {shape}, which are not identifiable one by one" * (len(held) > 1)
            told.append(f"{' and '.join(dict.fromkeys(ends))}{f' ({d})' * bool(d)}{unclaimed}")
    law = f"{' + '.join(text for name, text in terms.items() if name in given)} = " * (joint.law_name == GAUSSIAN.name)
    yield "friction", f"{law}{'; '.join(told)}"


def decided(joint: Joint) -> Iterator[tuple[str, str]]:
    """Decisions by subject: changed levels, a law other than the paper's, and choices by the data for the values to use."""
    law = joint.settings.get("law", joint.law_name)
    if not law.startswith(f"{GAUSSIAN.name}:") and law != GAUSSIAN.name:
        yield "law", law
    told = {"levels": "levels", "regressors": "chosen regressors", "directions": "chosen directions"}
    of_points = any(x.data == "points" for x in joint.models)  # else static fits are of moving runs, too
    if any(isinstance(fit, TrackingFit) or not of_points for fit in value_fits(joint)):
        told |= {
            "scale": "chosen scale",
            "position": "chosen position",
            "velocity": "chosen velocity",
            "torque": "chosen delay",
            "vibration": "chosen vibration",
            "filters": "filters",
        }
        notes = [note for x in joint.inputs for note in x.notes]
        gaps = sum(note.numbers["gaps"] for note in notes if note.code == "gaps-bridged")
        made = [f"{gaps} gap{'s' * (gaps > 1)} bridged by the motion beside"] * bool(gaps)
        even = {"samples-uneven": "interpolated at even times", "stamps-jitter": "stamps that jitter made even"}
        made += [text for code, text in even.items() if code in {note.code for note in notes}]
        if made:
            yield "samples", f"{', '.join(made)} (cleaning.times overrules)"
    yield from ((name, joint.settings[key]) for name, key in told.items() if key in joint.settings)
    fits = [fit for fit in value_fits(joint) if not isinstance(fit, TrackingFit)]
    why = [reason.code for s in joint.segments for reason in s.reasons]
    strays, resting = why.count("stray-dropped"), why.count("below-breakaway")
    left_out = [f"{strays} off the law of the others (fit.set_up: as-written keeps them)"] * bool(strays)
    left_out += [f"{resting} at which the joint did not slide (bristle inspect lists them)"] * bool(resting)
    if left_out:
        fitted = len({s.place for fit in fits for s in fit.segments})
        yield "points", f"{fitted} fitted; left out are {' and '.join(left_out)}"


def _values(joint: Joint) -> Iterator[str]:
    """The table of values by direction, shared ones last; parameters without a value in one line per direction."""
    rows, known = {row.parameter: row for row in chosen(joint)}, as_identified(joint)
    fixed = {name: value for name, value in known.given.items() if name not in rows and name.name != FASTEST}
    cells: list[tuple[str, ...]] = [("parameter", "value +/- standard error", "95 % interval", "from")]
    missing: dict[Direction, dict[str, list[str]]] = {}
    names = {*rows, *fixed}
    ways = {d for name, d in names if of_friction(name)}
    for of_law in Lugre._fields:  # parameters without a run, of each direction
        there = {d for own, d in names if own == of_law}
        if Direction.BOTH not in there:
            names |= {ParameterName(of_law, d) for d in ways - there - ({Direction.BOTH} if there else set())}
    given = {(x.parameter.name, x.estimate.value is not None) for x in rows.values() if x.parameter.direction in SIGNED}
    place = {name: k for k, name in enumerate(Lugre._fields)}
    for name in sorted(names, key=lambda x: ([*Direction].index(x.direction), place.get(x.name, len(place)), x.name)):
        row = rows.get(name)
        if row is not None and (row.estimate.value is not None or (states_errors(joint) and _bounded(row.estimate))):
            cells.append(_cells(row, stated=states_errors(joint)))
        elif name in fixed:
            value = in_unit(f"{fixed[name]:.6g}", unit(name.name, joint.kind))
            cells.append((str(name), value, "", "experiment file"))
        elif name.direction is not Direction.BOTH or (name.name, True) not in given:
            runs = "constant velocities" if of_curve(name.name) else "slow loading"
            why = f"not measured; {runs} or tracking runs would show them"
            if row is not None:
                warnings = row.estimate.warnings
                unseen = any(w.code in NOT_IDENTIFIABLE or w.severity is not Severity.NOTE for w in warnings)
                why = "not identifiable" if unseen else "not estimated (--full says why)"
            missing.setdefault(name.direction, {}).setdefault(why, []).append(str(name))
    yield from columns(cells) if len(cells) > 1 else ()
    for by_reason in missing.values():
        yield from wrapped(f"  {', '.join(names)}: {why}" for why, names in by_reason.items())
    if joint.torque_scale is not None:
        uncertain, rest = " and ".join(joint.uncertain_constants), joint.torque_scale.numbers.get("rest", "")
        said = f"Standard errors include that of {uncertain}{rest}." if uncertain else str(joint.torque_scale)
        yield from wrapped([f"  {printable(said)}"])


def _bounded(e: Estimate) -> bool:
    """Whether an interval of a value from zero up is informative: an end is closed, and the ratio is at most 1e6."""
    low, high = e.interval or (0.0, inf)
    return (low > 0 or isfinite(high)) and not (low > 0 and 1e6 * low < high < inf)


def upper_bound(e: Estimate) -> float | None:
    """The 95 % bound of an estimate that is consistent with zero, else None."""
    low, high = e.interval or (0.0, inf)
    return high if low == 0 and isfinite(high) else None


def states_errors(joint: Joint) -> bool:
    """Whether the data tell how far its values are off; a curve without a stated error has none."""
    return joint.accuracy is None or isfinite(joint.accuracy.band)


def _cells(row: Known, *, stated: bool) -> tuple[str, ...]:
    e, source = row.estimate, _SOURCES.get(row.source) or FITS[row.source]
    one_speed = any(warning.code == "one-speed-only" for warning in e.warnings)
    if e.value is None or (one_speed and row.parameter.name == "alpha_2"):
        if (bound := upper_bound(e)) is not None:
            return str(row.parameter), in_unit(f"< {bound:.3g}", e.unit), "(95 %)", source
        return str(row.parameter), "not identifiable", in_unit(interval(e.interval), e.unit), source
    if not stated:
        return str(row.parameter), in_unit(number(e.value, 3), e.unit), "not stated", source
    if one_speed:  # only the sum is known
        return f"{row.parameter} + alpha_2 v", in_unit(pair(e.value, e.total_error), e.unit), "", source
    return str(row.parameter), in_unit(pair(e.value, e.total_error), e.unit), interval(e.interval), source


def _sentence(joint: Joint, warning: Finding) -> list[str]:
    """A warning with its code and subjects."""
    ((about, _),) = with_places((x for x in joint.all_warnings() if x == warning), str) or [("", warning)]
    where = f" ({printable(about)})" if about else ""
    return list(wrapped([f"  {warning.severity} {_code(warning)}{where}: {printable(str(warning))}"]))


def _rest(joint: Joint, reason: Finding | None) -> Iterator[str]:
    """Critical warnings but the reason, then others within `LINES`, then the number of the rest."""
    rest = [x for x in value_warnings(joint) if x != reason]
    others = len(other_warnings(joint))
    critical = [x for x in rest if x.severity is Severity.CRITICAL]
    more, room = [x for x in rest if x not in critical], LINES
    for finding in critical:
        yield from _sentence(joint, finding)
    while more and (lines := _sentence(joint, more[0])) and len(lines) <= room:
        yield from lines
        room -= len(lines)
        del more[0]
    if more or others:
        codes = ", ".join(code if n == 1 else f"{code} {n} times" for code, n in Counter(x.code for x in more).items())
        told = [f"{counted(len(more), 'more finding')} about these values ({codes})"] * bool(more)
        told += [f"{counted(others, 'finding')} about other fits and segments"] * bool(others)
        yield from wrapped([f"  {' and '.join(told)}: --full"])


def outcomes(joints: Sequence[Joint]) -> Iterator[str]:
    """The verdicts; then how well each joint's friction is known, and why it is not to be used."""
    yield from verdicts(joints)
    for joint in joints:
        why = verdict(joint).reason
        yield f"{joint.name}: {known_to(joint, '+/-')}{f' {why.flagged}' if why else ''}"


def segment_lines(measured: Measured) -> Iterator[str]:
    """What each run holds: its notes, and its candidate segments, kept or rejected with their reasons."""
    v, T = (unit(name, measured.experiment.joint.kind) for name in ("velocity", "torque"))
    for recorded, found in zip(measured.runs, measured.segments, strict=True):
        record = recorded.record
        yield f"{record.file} ({recorded.kind}{', held out' if recorded.hold_out else ''}): {record.rows} rows, {record.dropped} dropped"
        yield from (f"    {note.flagged}" for note in (*record.notes, *record.warnings))
        told = [s for s in found if not any(reason.code == "transient" for reason in s.reasons)]
        for s in told:
            values = f"{s.velocity:.4g} {v}, {pair(s.torque, s.standard_error)} {T}"
            yield f"  {'kept    ' if s.accepted else 'rejected'} {s.where}: {values}"
            yield from (f"           {reason.coded}" for reason in (*s.reasons, *s.warnings))
        if passing := len(found) - len(told):
            yield f"  rejected {counted(passing, 'transient')} from one speed to another"
    kept = sum(s.accepted for found in measured.segments for s in found)
    yield f"{kept} of {sum(map(len, measured.segments))} candidates kept."

"""The short fit report: of each joint the values to use, whether to trust them and why not, and what it is warned of."""

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from typing import NamedTuple

from bristle.findings import Finding, Severity
from bristle.identification.fits import Estimate, StaticFit, TrackingFit
from bristle.identification.known_joint import Known, Source, as_identified, chosen, mixed, value_fits
from bristle.identification.results import Joint
from bristle.identification.verdict import other_warnings, value_warnings, verdict
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.parameters import SIGNED, Direction, Lugre, ParameterName, effort, of_curve, of_friction, unit
from bristle.page.plain import columns, in_unit, interval, pair, shortened_lines, wrapped
from bristle.page.wording import FITS, counted, printable, shortened
from bristle.questions.joint_report.text import total_error

LINES = 40
"""Of one joint with two directions at most."""
_SOURCES = {Source.STATIC: "static fit", Source.PRESLIDING: "presliding"}
_HEAD = ("parameter", "value +/- standard error", "95 % interval", "from")
_END = "What a code in brackets means: bristle explain CODE. Every fit: --full."
_LONGEST = 6
"""Lines of the reason."""


def brief_report(joints: Sequence[Joint]) -> str:
    """Of several joints one line each; then of each the table of its values, and its warnings, critical ones first."""
    lines = list(verdicts(joints)) if len(joints) > 1 else []
    for joint in joints:
        lines += [*([""] if lines else []), *_joint(joint)]
    return "\n".join([*lines, "", _END]) + "\n"


def verdicts(joints: Sequence[Joint]) -> Iterator[str]:
    """Whether to use each joint's values, why not, and the largest hold-out error: a line each."""
    rows = [("joint", "its values", "reason", "hold-out error")]
    for joint in joints:
        found, held = verdict(joint), [x.relative_error for fit in value_fits(joint) for x in fit.hold_out]
        error = f"{max(held):.2g} %" if held else "-"
        rows.append((shortened(joint.name, 32), str(found.trust), _code(found.reason), error))
    yield from columns(rows, indent=0)


def _code(reason: Finding | None) -> str:
    return "" if reason is None else f"[{reason.code}]"


def _joint(joint: Joint) -> Iterator[str]:
    found, simulated = verdict(joint), ", SIMULATED data" if joint.simulated else ""
    lines = list(wrapped([f"{printable(joint.name)} ({joint.kind}{simulated}): {found.trust}"]))
    if found.reason is not None:
        lines += shortened_lines(_sentence(joint, found.reason), _LONGEST)
    lines += wrapped([*law_in_force(joint), *_chosen(joint)])
    lines += [*shortened_lines(list(wrapped(_errors(joint))), _LONGEST), *_values(joint), *wrapped([_count(joint)])]
    yield from lines
    yield from _rest(joint, found.reason, LINES - len(lines) - 2)


def law_in_force(joint: Joint) -> Iterator[str]:
    """The law and the load of the fits, and whether the data chose them; nothing of the paper's law where that was asked for."""
    told = joint.settings.get("law", joint.law_name)
    if not told.startswith(f"{GAUSSIAN.name}:") and told != GAUSSIAN.name:
        yield f"  law: {printable(told)}"


def _chosen(joint: Joint) -> Iterator[str]:
    """Directions, low pass and decimation of moving runs whose values these are, where the data chose them."""
    if any(isinstance(fit, TrackingFit) for fit in value_fits(joint)):
        told = {"directions": "chosen directions", "filters": "filters"}
        yield from (
            f"  {name}: {printable(joint.settings[key])}" for name, key in told.items() if key in joint.settings
        )


def _errors(joint: Joint) -> Iterator[str]:
    """The hold-out error of each of these fits, and that on the data fitted, in percent of what it predicts."""
    for fit in value_fits(joint):
        what = "position" if isinstance(fit, TrackingFit) and fit.quantity == "position" else effort(joint.kind)
        of = f" ({fit.direction})" if isinstance(fit, StaticFit) and fit.direction in SIGNED else ""
        if fit.hold_out:
            told = ", ".join(f"{x.relative_error:.2g} % of the {what} on {printable(x.file)}" for x in fit.hold_out)
            yield f"  hold-out error{of}: {told}; {fit.relative_error:.2g} % in the fit"
        elif fit.relative_error is not None:
            yield f"  relative error{of}: {fit.relative_error:.2g} % of the {what}, in the fit; no run was held out"


class _Given(NamedTuple):
    """A parameter that the experiment file fixed."""

    parameter: ParameterName
    value: float


def _values(joint: Joint) -> Iterator[str]:
    """The table, direction by direction, what is shared last; parameters without a value in one line a direction."""
    rows, known = {row.parameter: row for row in chosen(joint)}, as_identified(joint)
    fixed = {name: _Given(name, value) for name, value in known.given.items() if name not in rows}
    cells: list[tuple[str, ...]] = [_HEAD]
    missing: dict[Direction, dict[str, list[str]]] = {}
    for name in sorted({*rows, *fixed, *_unmeasured(rows, fixed)}, key=_place):
        row = rows.get(name)
        if row is not None and (row.estimate.value is not None or _bounded(row.estimate)):
            cells.append(_cells(row))
        elif name in fixed:
            cells.append(
                (str(name), in_unit(f"{fixed[name].value:.6g}", unit(name.name, joint.kind)), "", "experiment file")
            )
        else:
            missing.setdefault(name.direction, {}).setdefault(_why_none(name, row), []).append(str(name))
    yield from columns(cells) if len(cells) > 1 else ()
    for by_reason in missing.values():
        yield from wrapped(f"  {', '.join(names)}: {why}" for why, names in by_reason.items())
    yield from wrapped(f"  {sentence} See --full." for sentence in mixed(joint))
    if joint.torque_scale is not None:
        yield from wrapped([f"  {printable(_scale(joint, joint.torque_scale))}"])


def _scale(joint: Joint, said: Finding) -> str:
    """Which constants have an error that the table includes, or else are taken as exact."""
    uncertain = " and ".join(joint.uncertain_constants)
    return f"Standard errors include that of {uncertain}{said.numbers['rest']}." if uncertain else str(said)


def _place(name: ParameterName) -> tuple[int, int, str]:
    order = Lugre._fields
    return (
        list(Direction).index(name.direction),
        order.index(name.name) if name.name in order else len(order),
        name.name,
    )


def _unmeasured(*known: Mapping[ParameterName, object]) -> Iterator[ParameterName]:
    """The LuGre parameters that no run is about, of each direction that there is."""
    names = {name for some in known for name in some}
    directions = {d for name, d in names if of_friction(name)}
    for name in Lugre._fields:
        there = {d for own, d in names if own == name}
        if Direction.BOTH not in there:
            lacking = directions - there - ({Direction.BOTH} if there else set())
            yield from (ParameterName(name, d) for d in lacking)


def _why_none(name: ParameterName, row: Known | None) -> str:
    if row is None:
        runs = "constant velocities" if of_curve(name.name) else "slow loading"
        return f"not measured; {runs} or tracking runs would show them"
    cautioned = any(warning.severity is not Severity.NOTE for warning in row.estimate.warnings)
    return "not identifiable" if cautioned else "not estimated"


def _bounded(e: Estimate) -> bool:
    """Whether an interval says anything, of a value that is at least zero."""
    return e.interval is not None and (e.interval[0] > 0 or isfinite(e.interval[1]))


def _cells(row: Known) -> tuple[str, ...]:
    e, source = row.estimate, _SOURCES.get(row.source) or FITS[row.source]
    if e.value is None:
        return str(row.parameter), "not identifiable", in_unit(interval(e.interval), e.unit), source
    return str(row.parameter), in_unit(pair(e.value, total_error(e)), e.unit), interval(e.interval), source


def _count(joint: Joint) -> str:
    """How many warnings are about the values, by severity, and how many about all else."""
    found, others = value_warnings(joint), len(other_warnings(joint))
    number = {severity: sum(warning.severity is severity for warning in found) for severity in Severity}
    critical, cautions = number[Severity.CRITICAL], number[Severity.CAUTION]
    told = [f"{critical} critical"] * bool(critical) + [counted(cautions, "caution")] * bool(cautions)
    more = f"; {counted(others, 'warning')} about other fits and segments" if others else ""
    return f"Warnings about these values: {', '.join(told) or 'none'}{more}"


def _sentence(joint: Joint, warning: Finding) -> list[str]:
    """A warning with its code, and with what it is about, fit by fit."""
    about = dict.fromkeys(" ".join(x.subject) for x in joint.all_warnings() if x == warning and x.subject)
    where = f" ({printable(', '.join(about))})" if about else ""
    return list(wrapped([f"  {warning.severity} {_code(warning)}{where}: {printable(str(warning))}"]))


def _rest(joint: Joint, reason: Finding | None, room: int) -> Iterator[str]:
    """All warnings but the reason, which stands above; in whole sentences where these fit, else their beginnings."""
    rest = [warning for warning in value_warnings(joint) if warning != reason]
    sentences = [_sentence(joint, warning) for warning in rest]
    most = next((n for n in (9, 2) if sum(min(len(s), n) for s in sentences) <= room), 1)
    listed = sentences if most > 1 or len(sentences) <= room else sentences[: max(room - 1, 0)]
    for sentence in listed:
        yield from shortened_lines(sentence, most)
    if len(listed) < len(sentences):
        yield f"  and {counted(len(sentences) - len(listed), 'more warning')}"

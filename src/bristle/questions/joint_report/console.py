"""What the command line prints of fits, segments and cross-checks, a line each."""

from collections.abc import Iterator, Sequence

from bristle.identification.fits import Crosscheck
from bristle.identification.measured import Measured
from bristle.identification.results import Joint
from bristle.identification.verdict import verdict
from bristle.model.parameters import unit
from bristle.page.plain import columns, interval, pair, wrapped
from bristle.page.wording import FITS, counted, printable
from bristle.questions.joint_report.brief import verdicts
from bristle.questions.joint_report.sentences import cost_change, known_to
from bristle.questions.joint_report.tables import WAYS, IntervalRow, interval_rows


def outcomes(joints: Sequence[Joint]) -> Iterator[str]:
    """Whether to use each joint's values; then to what its friction is known, and why it is not to be used where it is not."""
    yield from verdicts(joints)
    for joint in joints:
        why = verdict(joint).reason
        yield f"{joint.name}: {known_to(joint, '+/-')}{f' {why.flagged}' if why else ''}"


def checks(joint: Joint) -> Iterator[str]:
    """Each fit of a joint beside a full nonlinear one on the same data."""
    for direction, check in joint.crosscheck.items():
        yield from _check(f"{joint.name} {direction}", "the grid", check, direction)
    if joint.tracking is not None and joint.tracking.crosscheck is not None:
        yield from _check(f"{joint.name}, moving runs", "Gauss-Newton", joint.tracking.crosscheck)
    elif joint.tracking is not None:
        yield f"{joint.name}, moving runs: a simulated position has no second route; it was not checked"


def law_lines(joints: Sequence[Joint]) -> Iterator[str]:
    """The friction laws side by side, joint by joint, the lowest BIC first; then which the data want, and why.

    Parameters fitted, BIC and AICc above the lowest, errors at speeds (and runs) that were left out, and the weight.
    """
    for joint in joints:
        found = joint.laws
        if found is None:
            yield f"{printable(joint.name)}: friction laws were not compared; too few points or samples for any but the paper's"
            continue
        yield f"{printable(joint.name)}: friction laws on {counted(found.n, 'point' if found.data == 'points' else 'sample')}"
        by_run = any(row.run_left_out is not None for row in found.rows)
        heads = ("law", "parameters", "BIC", "AICc", "left out", *(("runs",) if by_run else ()), "weight", "")
        rows: list[tuple[str, ...]] = [heads]
        for row in sorted(found.rows, key=lambda row: row.bic):
            left = [
                "-" if x is None else f"{x:.3g} %" for x in (row.left_out, *((row.run_left_out,) if by_run else ()))
            ]
            bic, aicc = f"+{row.bic:.1f}", "-" if row.aicc is None else f"+{row.aicc:.1f}"
            told = "in use" if row.in_force else "wanted" if row.chosen else ""
            rows.append((row.law, str(row.parameters), bic, aicc, *left, f"{100 * row.weight:.0f} %", told))
        yield from columns(rows)
        yield from wrapped([f"  {printable(str(found.sentence))}"])


def _check(title: str, first: str, check: Crosscheck, direction: str = "") -> Iterator[str]:
    yield f"{title}: {check.verdict}"
    if not check.agrees:
        yield f"  cost: {cost_change(check, first)}"
    for name, value in check.parameters.items():
        distance = check.difference_in_se.get(name)
        apart = "" if distance is None else f" {distance:+.1e} standard errors from {first}"
        yield f"  {name.within(direction):<12} {value:<12.4g}{apart}"


def interval_lines(joints: Sequence[Joint]) -> Iterator[str]:
    """Each parameter's 95 % interval three ways, fit by fit, and the warnings about them, each once."""
    for joint in joints:
        by_fit: dict[str, list[IntervalRow]] = {}
        for row in interval_rows(joint):
            by_fit.setdefault(row.fit, []).append(row)
        for fit, own in by_fit.items():
            yield f"{printable(joint.name)}, {FITS.get(fit, fit)}: 95 % intervals"
            cells = [(x.estimate.unit, (x.name, *(interval(getattr(x.three, way)) for way in WAYS))) for x in own]
            for si in dict.fromkeys(si for si, _ in cells):
                yield from columns([(si, *WAYS), *(row for of, row in cells if of == si)], indent=0)
            said = {warning: x.name for x in own for warning in x.three.warnings}
            yield from (f"  {name}: {printable(warning.flagged)}" for warning, name in said.items())


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

"""The report of joints that were identified: the answer, then a page for each thing that it rests on."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib import resources
from itertools import compress
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import pandas as pd

from bristle.estimation import levels
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding, Severity
from bristle.identification.curve import curve
from bristle.identification.known_joint import Known, chosen, moving_fits
from bristle.identification.results import Joint
from bristle.identification.verdict import Trust, value_warnings, verdict
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST
from bristle.model.parameters import SIGNED, Direction, fields_of, in_direction, of_friction, unit
from bristle.page.page import Drawing
from bristle.page.plain import in_unit, wrapped
from bristle.page.report import Answer, Answered, Cell, Page, Report, Section, Table
from bristle.page.said import Link, Mark, Said
from bristle.page.wording import (
    FITS,
    counted,
    direction,
    in_print,
    in_symbols,
    measured,
    number,
    pretty,
    printable,
    slugs,
    span,
)
from bristle.questions.joint_report import moving_sections, presliding_sections, static_sections, tables
from bristle.questions.joint_report.brief import decided, friction_line, states_errors, upper_bound
from bristle.questions.joint_report.figures import drawings
from bristle.questions.joint_report.interval_sections import INTRO, intervals
from bristle.questions.joint_report.sentences import choice, friction_left, held_out, known_to
from bristle.questions.joint_report.static_figures import FIG_1, FIG_1_V_S, stribeck_figure

_Figures = Mapping[str, Drawing]
_NONE = "n.i."
"""In place of a value that the data do not identify."""


def report(
    joints: Sequence[Joint],
    *,
    title: str,
    seed: int | None,
    compensation: tuple[Section, ...] = (),
    worth: Mapping[str, str] = MappingProxyType({}),
    adverse: Sequence[Finding] = (),
    frames: Mapping[str, pd.DataFrame] = MappingProxyType({}),
    explored: Sequence[str] | None = None,
    begun: Mapping[str, _Figures] = MappingProxyType({}),
    files: Mapping[str, bytes] = MappingProxyType({}),
) -> Report:
    """The answer and the pages that there is something for.

    Args:
        joints: at least one; names differ.
        title: what they are called together.
        seed: of whatever random numbers the results rest on; None where there are none.
        compensation: the sections on their compensation, which are a page; empty: there are none.
        worth: what those say of each joint, by name, in half a line.
        adverse: what was found that speaks against compensation.
        frames: the tables of those sections, by the names of their files.
        explored: the names of the joints on the interactive page, explore.html among `files`; None: there is none.
        begun: by joint what `drawings` gave of it; figures of others begin to be drawn when they are written.
        files: results.json and others, by relative path.

    Raises ValueError where there is no joint, or two have one name.
    """
    names = [joint.name for joint in joints]
    if not joints or len(set(names)) < len(names):
        raise ValueError(f"a report needs joints of different names; got {', '.join(names) or 'none'}")
    known_as, figures = dict(zip(names, slugs(names), strict=True)), dict[str, _Figures]()
    for joint in joints:
        own = begun.get(joint.name) or drawings(joint)
        figures[joint.name] = {kind: x._replace(name=f"{known_as[joint.name]}-{x.name}") for kind, x in own.items()}

    def page(
        file: str, name: str, purpose: str, of_joint: Callable[[Joint, _Figures], list[Section]], text: str = ""
    ) -> Page:
        """Each joint that has something for the page, under its name."""
        sections: list[Section] = []
        for joint in joints:
            if own := of_joint(joint, figures[joint.name]):
                about, anchor = f"{joint.kind}{', SIMULATED data' * joint.simulated}", f"{known_as[joint.name]}--joint"
                sections += [Section(joint.name, about=about, id=anchor), *own]
        return Page(file, name, purpose, tuple(sections), text=text)

    pages = [page(*x) for x in _PAGES]
    closed = "what the model is worth in a loop, and adaptation: the paper's Figs 2 and 5 to 12, Table 2"
    fed = "LuGre feed-forward and its adaptation."
    pages[-1:-1] = [Page("compensation.html", "Compensation", closed, compensation, text=fed)]
    source = "Equation numbers are those of “Adaptive Friction Compensation: Application to a Robotic Manipulator”."
    pages.append(Page("method.html", "Method", "equations, and what the paper leaves open", _method(), text=source))
    pages = [x for x in pages if x.sections]
    if explored is not None:
        hand = "the model in the hand: sliders, loops and responses that follow them"
        pages.append(Page("explore.html", "Explore", hand))

    against = [
        replace(x, subject=(joint.name, *x.subject))
        for joint in joints
        for x in joint.all_warnings()
        if x.severity is CRITICAL
    ]
    found = [*["critical warnings"] * bool(against), *["where adaptation does not help"] * bool(adverse)]
    sections = [Section("", answer=_answer(joints, known_as, figures, worth, explored or ()))]
    if found:
        sections.append(Section(", and ".join(found).capitalize(), findings=(*against, *adverse)))
    if "curve" in figures[names[0]]:
        picture = static_sections.curve(joints[0], figures[names[0]])
        sections.append(Section("The fit in a picture", figure=picture))
    of = {joint.name: f"{joint.name}, " if len(joints) > 1 else "" for joint in joints}
    facts = [
        (f"{of[joint.name]}{about}", in_print(told))
        for joint in joints
        for about, told in (*friction_line(joint), *decided(joint))
    ]
    facts += [(f"{of[joint.name]}torque", in_print(joint.torque_scale)) for joint in joints if joint.torque_scale]
    cautions = tuple(
        replace(x, subject=(joint.name, *x.subject) if len(joints) > 1 else x.subject)
        for joint in joints
        for x in value_warnings(joint)
        if x.severity is CAUTION and x != verdict(joint).reason
    )
    if facts or cautions:
        about = "What was decided, and cautions about these values"
        sections.append(Section(about, facts=tuple(facts), findings=cautions, lines=()))
    simulated = "Nothing here was measured on a real joint."
    if not all(joint.simulated for joint in joints):
        simulated = "Some of these joints were not measured but simulated; each says so."
    return Report(
        f"Friction of {title}",
        tuple(sections),
        about="LuGre model.",
        pages=tuple(pages),
        simulated=simulated if any(joint.simulated for joint in joints) else "",
        seed=seed,
        tables={**tables.all_tables(joints), **frames},
        files=files,
    )


def full_text(joints: Sequence[Joint], *only: str) -> str:
    """Each joint as its pages have it, 80 columns wide: every fit, or `only` some pages by their files."""
    lines = []
    for joint in joints:
        figures = drawings(joint)
        lines.append(f"[[{printable(joint.name)}]] {joint.kind}{', SIMULATED data' * joint.simulated}")
        for file, _, _, sections, *_ in _PAGES:
            if file in only or not (only or file == "data.html"):
                lines += [line for section in sections(joint, figures) for line in section.plain()]
    return "\n".join(wrapped([*lines, "What a code in brackets means: bristle explain CODE"])) + "\n"


def _mark(joint: Joint) -> Mark:
    """Whether to use a joint's values."""
    use = verdict(joint).trust is Trust.USE
    return Mark("use" if use else "do not use", use)


def _of_joint(joint: Joint, figures: _Figures) -> list[Section]:
    """How each fit ended, the parameters, the figures and the warnings."""

    def error(count: str, relative: float | None) -> str:
        return "" if relative is None else f"{count}, relative error {number(relative, 3)} %."

    ended: list[tuple[str, Said]] = []
    for d, fit in joint.static.items():
        free = counted(fit.degrees_of_freedom, "degree")
        left = error(f"{counted(fit.n, 'point')}, {free} of freedom", fit.relative_error)
        ended.append((direction(d), f"{in_print(fit.outcome)} {left}"))
    for d, slow in (joint.presliding.fits if joint.presliding else {}).items():
        ended.append((f"presliding {direction(d)}", in_print(choice(slow))))
    for kind, moving in moving_fits(joint).items():
        left = error(counted(moving.n, "equation"), moving.relative_error)
        ended.append((FITS[kind], f"{in_print(moving.outcome)} {left}"))
    if joint.torque_scale:
        ended.append(("torque", in_print(joint.torque_scale)))
    inside = tables.table_1([joint])["inside"].dropna().astype(bool)
    if len(inside):
        together = "; misses are not independent: the estimates of one direction come from the same data"
        more = together * bool(inside.mean() < levels.MANY_INSIDE)
        ended.append(("truth", f"{inside.sum()} of {len(inside)} true values lie inside their 95 % intervals{more}."))
    drawn = static_sections.curve_and_residuals(joint, figures) if "curve" in figures else ()
    course = moving_sections.course(joint, figures)
    critical = tuple(x for x in joint.all_warnings() if x.severity is CRITICAL)
    trusted: tuple[Said, ...] = (_mark(joint), *filter(None, (verdict(joint).reason,)))
    sections = [
        Section("Critical warnings" if critical else "", text=trusted, findings=critical, form="part"),
        Section("How each fit ended", facts=tuple(ended), form="folded"),
        *static_sections.parameters(joint),
        Section("", figures=(*drawn, *filter(None, (course,))), form="part"),
        *static_sections.hold_out(joint, joint.static),
        *static_sections.correlations(joint),
    ]
    forms: dict[Severity, Literal["part", "folded"]] = {CAUTION: "part", NOTE: "folded"}
    for severity, form in forms.items():
        own = tuple(x for x in joint.all_warnings() if x.severity is severity)
        if own:
            title = counted(len({str(x) for x in own}), str(severity))
            sections.append(Section(title, findings=own, coded=True, form=form))
    return sections


def _answer(
    joints: Sequence[Joint],
    known_as: Mapping[str, str],
    figures: Mapping[str, _Figures],
    worth: Mapping[str, str],
    explored: Sequence[str],
) -> Answer:
    """Of each joint the values to use, whether to trust them, and why not."""
    names = tuple(dict.fromkeys(n for joint in joints for n in fields_of(joint.law) if n != FASTEST))
    known = {joint.name: {row.parameter: row for row in chosen(joint)} for joint in joints}
    units = {
        name: {pretty(row.estimate.unit) for rows in known.values() for p, row in rows.items() if p.name == name}
        for name in names
    }
    common = {name: next(iter(own)) for name, own in units.items() if len(own) == 1}
    things, mixed = [], not all(joint.simulated for joint in joints)
    for joint in joints:
        rows = known[joint.name]
        used = {row.source for p, row in rows.items() if row.estimate.value is not None and of_friction(p.name)}
        source = FITS.get(only, only) if len(used) == 1 and (only := next(iter(used))) else ""
        line: list[Said] = [_mark(joint), known_to(joint, beside=True), *filter(None, (verdict(joint).reason,))]
        if source:
            line.append(f"From the {source}{'' if source in FITS.values() else ' stage'}.")
        if joint.name in worth:
            line.append(f"{worth[joint.name]}.")
        if law := dict(decided(joint)).get("law"):
            line.append(f"Law: {law}.")
        beside = [
            f"{in_symbols(p.name).replace('_', ' ')} {in_unit(measured(e.value, e.total_error), pretty(e.unit))}"
            for p, e in ((p, row.estimate) for p, row in rows.items())
            if not of_friction(p.name) and e.value is not None
        ]
        if beside:
            line.append(f"Also: {', '.join(beside)}.")
        if joint.name in explored:
            line.append(Link("Explore", f"explore.html#joint={explored.index(joint.name)}"))
        there = [d for d in (*SIGNED, Direction.BOTH) if any(p.direction == d and of_friction(p.name) for p in rows)]
        lines = []
        for d in [d for d in there if d in SIGNED] or there:
            of_law = fields_of(joint.law)
            cells = (
                _cell(in_direction(rows, n, d), common, source, stated=states_errors(joint))
                if n in of_law
                else Cell("")
                for n in names
            )
            lines.append(("+/−" if d == Direction.BOTH else direction(d).strip("()"), tuple(cells)))
        shown = f"{joint.name}{' (SIMULATED)' * (joint.simulated and mixed)}"
        place = Link(shown, f"joints.html#{known_as[joint.name]}--joint")
        things.append(Answered(place, tuple(line), tuple(lines), _beside(joint, figures[joint.name])))
    # Of what stands beside the values only what is known of some joint.
    seen = [any(cell != Cell() for cell in column) for column in zip(*(x.whole for x in things), strict=True)]
    things = [x._replace(whole=tuple(compress(x.whole, seen))) for x in things]
    columns = tuple((name, "" if common.get(name) == "1" else common.get(name, "")) for name in names)

    missing = any(cell.value == _NONE for x in things for _, cells in x.rows for cell in cells)
    loaded = " without load" if any(joint.law_name != joint.law.name for joint in joints) else ""
    other = "vₛ is that of the law's own peak; α₃ multiplies v·|v| and may have either sign. "
    other_law = any(joint.law != GAUSSIAN for joint in joints)
    left = (
        " Compensation leaves: how much of friction remains on the joint’s own runs once that of these values is fed "
        "forward, at most: the error of the torque relative to friction alone, 100 % without compensation."
    )
    linked = any(joint.link_inertia is not None for joint in joints)
    constants = any(row.estimate.systematic is not None for rows in known.values() for row in rows.values())
    how = (
        f"Value to use ± one standard error{', errors of constants included,' * constants} and [95 % interval]"
        f"{'; n.i.: not identifiable from these data' * missing}. "
        f"{other * other_law}{'All others' if other_law else 'All'} are positive in both directions: α₀ Coulomb, α₁ "
        f"Stribeck amplitude (breakaway is α₀ + α₁{loaded}), α₂ viscous friction, vₛ Stribeck velocity, σ₀ and σ₁ "
        "bristle stiffness and damping. Joint fit: of all runs at once."
        f"{' Hold-out error: of the torque on runs that were not fitted, relative to its norm.' * seen[0]}"
        f"{left * seen[1]}"
        f"{' The inertia of a joint with known links is what it has beside them: the rotor’s.' * linked}"
    )
    return Answer("dir.", columns, tuple(things), tuple(compress(_BESIDE, seen)), how)


_BESIDE = ("hold-out error", "compensation leaves", "curve")


def _beside(joint: Joint, figures: _Figures) -> tuple[Cell | Drawing, ...]:
    """Of `_BESIDE` what is known of a joint, as far as its results tell: nothing is computed for the page."""
    held, left = held_out(joint), friction_left(joint)
    runs = "fitted" if held is None else "held-out"
    return (
        Cell() if held is None else Cell(f"{number(held, 2)} %"),
        Cell() if left is None else Cell(f"{number(left, 2)} %", ("of friction", f"in {runs} runs")),
        figures.get("small") or Cell(),
    )


def _cell(row: Known | None, common: Mapping[str, str], source: str, *, stated: bool) -> Cell:
    """Value and interval, or a bound; the unit where the joints differ in it, the stage where the values come from several."""
    if row is None:
        return Cell(_NONE)
    e, unit_of = row.estimate, "" if common.get(row.parameter.name) else f" {pretty(row.estimate.unit)}"
    if e.value is None:
        bound = upper_bound(e) if stated else None
        return Cell(_NONE) if bound is None else Cell(f"< {number(bound, 3)}{unit_of}", ("95 %",))
    below = (span(e.interval) if stated else "error not stated", *[FITS.get(row.source, row.source)] * (not source))
    return Cell(f"{measured(e.value, e.total_error) if stated else number(e.value, 3)}{unit_of}", below)


def _data(joint: Joint, _: _Figures) -> list[Section]:
    """The candidate segments, kept or rejected but for passing from one speed to another; each file; the settings in force."""
    sections = []
    if joint.segments:
        velocity, torque = (f"{name} ({pretty(unit(name, joint.kind))})" for name in ("velocity", "torque"))
        error = f"its standard error ({pretty(unit('torque', joint.kind))})"
        headings = {"velocity": velocity, "torque": torque, "standard_error": error}
        frame = tables.segments([joint]).rename(columns=headings)
        for name in ("reasons", "warnings"):
            frame[name] = pd.Series([getattr(x, name) for x in joint.segments], dtype=object)
        passes = [any(reason.code == "transient" for reason in x.reasons) for x in joint.segments]
        passing = pd.Series(passes, dtype=bool)
        kept = frame[frame["accepted"]].drop(columns=["accepted", "reasons", "stick_slip", "start", "stop"])
        rejected = frame[~frame["accepted"] & ~passing][["file", "where", velocity, torque, "reasons"]]
        told = [f"{len(kept)} segments kept, {len(rejected)} rejected"]
        if passing.any():
            told.append(f"{passing.sum()} changes from one speed to another")
        if frame["stick_slip"].any():
            told.append(f"{frame['stick_slip'].sum()} stick-slip")
        sections.append(Section("", text=f"{'; '.join(told)}.", form="part"))
        parts = {"Rejected": (rejected, "Rejected, and what would make them pass"), "Kept": (kept, "Kept")}
        for name, (part, title) in parts.items():
            if len(part):
                table = Table("segments", f"{name} segments", part=part)
                sections.append(Section(title, table=table, form="folded"))
    else:
        moving = "moving data were fitted, not constant-velocity segments"
        why = moving if joint.static else "no run at constant velocity was given"
        sections.append(Section("", text=f"No segments: {why}.", form="part"))

    rows, dropped = (sum(getattr(x, name) for x in joint.inputs) for name in ("rows", "dropped"))
    files = f"{counted(len(joint.inputs), 'file')}, {rows} rows, {dropped} dropped."
    frame = tables.inputs([joint])
    frame["notes"] = pd.Series([x.notes for x in joint.inputs], dtype=object)
    frame["sha256"] = [f"{text[:12]}…" if text else "" for text in frame["sha256"]]
    table = Table("inputs", "Files", part=frame, note="The file has the whole of sha256.")
    sections.append(Section("", text=files, form="part"))
    sections.append(Section("Files and what was done with them", table=table, form="folded"))
    if joint.settings:
        sections.append(Section("Settings in force", facts=tuple(joint.settings.items()), form="folded"))
    return sections


def _method() -> tuple[Section, ...]:
    """The paragraphs of method.txt, each after what it is about, and the paper's Fig. 1."""
    text = resources.files("bristle.questions.joint_report").joinpath("method.txt").read_text(encoding="utf-8")
    told = []
    for part in text.split("\n\n\n"):
        title, *lines = (" ".join(x.split()) for x in part.strip().split("\n\n"))
        facts = (line.partition(": ") for line in lines)
        told.append(Section(title, facts=tuple((about, said) for about, _, said in facts)))
    steps, opened = told
    v = np.linspace(1e-3, 0.5, 500)
    torque = curve(v, FIG_1.stribeck)
    low = int(np.argmin(torque))
    least, at = number(float(torque[low]), 3), number(float(v[low]), 2)
    caption = (
        f"Friction is highest at rest, {number(FIG_1.alpha_0 + FIG_1.alpha_1, 3)} N·m, and lowest at {at} rad/s, "
        f"{least} N·m, for vₛ = {FIG_1_V_S[1]} rad/s. Computed from (9), no data: α₀ = {FIG_1.alpha_0}, "
        f"α₁ = {FIG_1.alpha_1}, α₂ = {FIG_1.alpha_2} as in the paper; the three vₛ are assumed: the paper names none."
    )
    shape = Drawing(stribeck_figure, "paper-fig1-stribeck", "the steady-state curve", caption, paper="Fig. 1")
    return steps, Section("The shape of the curve", figure=shape), opened


_PAGES: tuple[tuple[Any, ...], ...] = (
    (
        "joints.html", "Joints", "per joint the parameters, the curve and the warnings", _of_joint,
        "Numbers in brackets, as (9), are equations of the paper; the page on the method has them.",
    ),
    (
        "presliding.html", "Presliding", "stiffness, breakaway and hysteresis from slow loading", presliding_sections.presliding,
        "While a joint loads slowly from rest, the bristle bends before anything slides: torque / displacement gives "
        "its stiffness σ₀, by four methods.",
    ),
    ("moving.html", "Moving runs", "all parameters at once", moving_sections.moving),
    ("checks.html", "Cross-checks", "the same numbers by other routes, and other models", static_sections.checks),
    ("uncertainty.html", "Uncertainty", "each interval three ways", intervals, INTRO),
    ("data.html", "Data", "files, segments and settings", _data),
)  # fmt: skip  # a table
"""File, name and purpose of each page that goes joint by joint, what makes a joint's sections, and its first line."""

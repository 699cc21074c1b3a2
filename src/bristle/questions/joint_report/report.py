"""The report of joints that were identified: the answer, then a page for each thing that it rests on."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal

from bristle.findings import CAUTION, CRITICAL, NOTE, Severity
from bristle.identification.known_joint import Known, chosen, moving_fits
from bristle.identification.results import Joint
from bristle.identification.verdict import Trust, verdict
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST
from bristle.model.parameters import SIGNED, Direction, fields_of, in_direction, of_friction
from bristle.page.page import Drawing, Templated
from bristle.page.plain import in_unit
from bristle.page.report import Answer, Answered, Cell, Page, Report, Section
from bristle.page.said import Link, Mark, Said
from bristle.page.wording import FITS, counted, direction, in_print, in_symbols, measured, number, pretty, slugs, span
from bristle.questions.joint_report import dynamic_sections, presliding_sections, static_sections, tables
from bristle.questions.joint_report.brief import law_in_force
from bristle.questions.joint_report.data_sections import data
from bristle.questions.joint_report.figures import drawings
from bristle.questions.joint_report.interval_sections import INTRO, intervals
from bristle.questions.joint_report.method_sections import INTRO as METHOD
from bristle.questions.joint_report.method_sections import method
from bristle.questions.joint_report.next_measurements import next_measurements
from bristle.questions.joint_report.sentences import choice, known_to

_Figures = Mapping[str, Drawing]
_NONE = "n.i."
"""In place of a value that the data do not identify."""


def report(
    joints: Sequence[Joint],
    *,
    title: str,
    seed: int | None,
    compensation: Templated | None = None,
    explored: Sequence[str] | None = None,
    begun: Mapping[str, _Figures] = MappingProxyType({}),
    files: Mapping[str, bytes] = MappingProxyType({}),
) -> Report:
    """The answer and the pages that there is something for.

    Args:
        joints: at least one; names differ.
        title: what they are called together.
        seed: of whatever random numbers the results rest on; None where there are none.
        compensation: the page of their compensation; None: there is none.
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
    worth = "what the model is worth in a loop, and adaptation: the paper's Figs 2 and 5 to 12, Table 2"
    pages[-1:-1] = [Page("compensation.html", "Compensation", worth, templated=compensation)]
    pages.append(Page("method.html", "Method", "equations, and what the paper leaves open", method(), text=METHOD))
    pages = [x for x in pages if x.sections or x.templated]
    if explored is not None:
        pages.append(
            Page("explore.html", "Explore", "the model in the hand: sliders, loops and responses that follow them")
        )

    against = [
        replace(x, subject=(joint.name, *x.subject))
        for joint in joints
        for x in joint.all_warnings()
        if x.severity is CRITICAL
    ]
    adverse = compensation.adverse if compensation else ()
    found = [*["critical warnings"] * bool(against), *["where adaptation does not help"] * bool(adverse)]
    sections = [Section("", answer=_answer(joints, known_as, figures, compensation, explored or ()))]
    if found:
        sections.append(Section(", and ".join(found).capitalize(), findings=(*against, *adverse)))
    if "curve" in figures[names[0]]:
        curve = static_sections.curve(joints[0], figures[names[0]])
        sections.append(Section("The fit in a picture", figure=curve))
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
        tables=tables.all_tables(joints),
        files={**files, **(compensation.files if compensation else {})},
    )


def _mark(joint: Joint) -> Mark:
    """Whether to use a joint's values."""
    use = verdict(joint).trust is Trust.USE
    return Mark("use" if use else "do not use", use)


def _of_joint(joint: Joint, figures: _Figures) -> list[Section]:
    """How each fit ended, the parameters, the figures, the warnings, and what to measure next."""
    ended: list[tuple[str, Said]] = []
    for d, fit in joint.static.items():
        ended.append((direction(d), f"{in_print(fit.outcome)} {_error(fit.n, 'point', fit.relative_error)}"))
    for d, slow in (joint.presliding.fits if joint.presliding else {}).items():
        ended.append((f"presliding {direction(d)}", in_print(choice(slow))))
    for kind, moving in moving_fits(joint).items():
        ended.append((FITS[kind], f"{in_print(moving.outcome)} {_error(moving.n, 'equation', moving.relative_error)}"))
    if joint.torque_scale:
        ended.append(("torque", in_print(joint.torque_scale)))
    inside = tables.table_1([joint])["inside"].dropna().astype(bool)
    if len(inside):
        together = "; misses are not independent: the estimates of one direction come from the same data"
        more = together if inside.mean() < 0.8 else ""
        hold = f"{inside.sum()} of {len(inside)} true values lie inside their 95 % intervals{more}."
        ended.append(("truth", hold))
    drawn = static_sections.curve_and_residuals(joint, figures) if joint.static else ()
    course = dynamic_sections.course(joint, figures)
    critical = tuple(x for x in joint.all_warnings() if x.severity is CRITICAL)
    trusted: tuple[Said, ...] = (_mark(joint), *filter(None, (verdict(joint).reason,)))
    sections = [
        Section("Critical warnings" if critical else "", text=trusted, findings=critical, form="part"),
        Section("How each fit ended", facts=tuple(ended), form="folded"),
        *static_sections.parameters(joint),
        Section("", figures=(*drawn, *filter(None, (course,))), form="part"),
        *static_sections.hold_out(joint),
    ]
    forms: dict[Severity, Literal["part", "folded"]] = {CAUTION: "part", NOTE: "folded"}
    for severity, form in forms.items():
        own = tuple(x for x in joint.all_warnings() if x.severity is severity)
        if own:
            title = counted(len({str(x) for x in own}), str(severity))
            sections.append(Section(title, findings=own, coded=True, form=form))
    nothing = "Nothing in particular: repeat the experiment on another day and compare."
    advice = next_measurements(joint)
    sections.append(
        Section("What to measure next", text="" if advice else nothing, findings=advice, coded=True, form="part")
    )
    return sections


def _error(count: int, of: str, error: float | None) -> str:
    return "" if error is None else f"{counted(count, of)}, relative error {number(error, 3)} %."


def _answer(
    joints: Sequence[Joint],
    known_as: Mapping[str, str],
    figures: Mapping[str, _Figures],
    compensation: Templated | None,
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
        line: list[Said] = [_mark(joint), known_to(joint), *filter(None, (verdict(joint).reason,))]
        if source:
            line.append(f"From the {source}{'' if source in FITS.values() else ' stage'}.")
        if compensation and joint.name in compensation.about:
            line.append(f"{compensation.about[joint.name]}.")
        if law := "".join(law_in_force(joint)).removeprefix("  law: "):
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
        signed = [d for d in there if d in SIGNED] or there
        things.append(
            Answered(
                Link(
                    f"{joint.name}{' (SIMULATED)' * (joint.simulated and mixed)}",
                    f"joints.html#{known_as[joint.name]}--joint",
                ),
                tuple(line),
                tuple(
                    (
                        "+/−" if d == Direction.BOTH else direction(d).strip("()"),
                        tuple(
                            _cell(in_direction(rows, n, d), common, source) if n in fields_of(joint.law) else Cell("")
                            for n in names
                        ),
                    )
                    for d in signed
                ),
                figures[joint.name].get("small"),
            )
        )
    columns = tuple((name, "" if common.get(name) == "1" else common.get(name, "")) for name in names)
    return Answer("dir.", columns, tuple(things), "curve", _how_to_read(joints, things))


def _cell(row: Known | None, common: Mapping[str, str], source: str) -> Cell:
    """Value and interval; the unit where the joints differ in it, the stage where the values come from several."""
    if row is None or row.estimate.value is None:
        return Cell(_NONE)
    e = row.estimate
    value = measured(e.value, e.total_error)
    below = (span(e.interval), *[FITS.get(row.source, row.source)] * (not source))
    return Cell(value if common.get(row.parameter.name) else f"{value} {pretty(e.unit)}", below)


def _how_to_read(joints: Sequence[Joint], things: Sequence[Answered]) -> str:
    missing = any(cell.value == _NONE for x in things for _, cells in x.rows for cell in cells)
    loaded = " without load" if any(joint.law_name != joint.law.name for joint in joints) else ""
    other = "vₛ is that of the law's own peak; α₃ multiplies v·|v| and may have either sign. "
    other_law = any(joint.law != GAUSSIAN for joint in joints)
    linked = any(joint.link_inertia is not None for joint in joints)
    return (
        "Value to use ± one standard error, errors of constants included, and [95 % "
        f"interval]{'; n.i.: not identifiable from these data' * missing}. "
        f"{other * other_law}{'All others' if other_law else 'All'} are positive in both directions: α₀ Coulomb, α₁ "
        f"Stribeck amplitude (breakaway is α₀ + α₁{loaded}), α₂ viscous friction, vₛ Stribeck velocity, σ₀ and σ₁ "
        "bristle stiffness and damping. Joint fit: of all runs at once. Held out: error of the torque on runs that "
        "were not fitted, relative to its "
        f"norm.{' The inertia of a joint with known links is what it has beside them: the rotor’s.' * linked}"
    )


_PAGES: tuple[tuple[Any, ...], ...] = (
    (
        "joints.html", "Joints", "per joint the parameters, the curve, the warnings, and what to measure next", _of_joint,
        "Numbers in brackets, as (9), are equations of the paper; the page on the method has them.",
    ),
    (
        "presliding.html", "Presliding", "stiffness, breakaway and hysteresis from slow loading", presliding_sections.presliding,
        "While a joint loads slowly from rest, the bristle bends before anything slides: torque / displacement gives "
        "its stiffness σ₀, by four methods.",
    ),
    ("moving.html", "Moving runs", "all parameters at once", dynamic_sections.moving),
    ("checks.html", "Cross-checks", "the same numbers by other routes, and other models", static_sections.checks),
    ("uncertainty.html", "Uncertainty", "each interval three ways", intervals, INTRO),
    ("data.html", "Data", "files, segments and settings", data),
)  # fmt: skip  # a table
"""File, name and purpose of each page that goes joint by joint, what makes a joint's sections, and its first line."""

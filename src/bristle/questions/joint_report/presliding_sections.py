"""What the page shows of presliding runs: sigma_0 by four methods, breakaway and hysteresis."""

from collections.abc import Iterator, Mapping

from bristle.identification.fits import Presliding
from bristle.identification.results import Joint
from bristle.model.parameters import unit
from bristle.page.page import Drawing
from bristle.page.report import Section, Table
from bristle.page.said import Said
from bristle.page.wording import WORK, counted, direction, in_print, measured, number, pretty, sentence, span
from bristle.questions.joint_report import tables
from bristle.questions.joint_report.presliding_figures import MOST_LOOPS
from bristle.questions.joint_report.sentences import bias, choice, level, pair


def presliding(joint: Joint, figures: Mapping[str, Drawing]) -> list[Section]:
    """All of it; empty without presliding runs."""
    slow = joint.presliding
    if slow is None:
        return []
    return [
        _stiffness(joint, slow),
        Section("", figures=tuple(_figures(slow, figures)), form="part"),
        *_amplitudes(joint, slow),
        *_breakaway_and_cycles(joint, slow),
        Section("As a whole" if slow.warnings else "", findings=slow.warnings, form="part"),
    ]


def _stiffness(joint: Joint, slow: Presliding) -> Section:
    """sigma_0 side by side, and each direction in words."""
    frame = tables.presliding([joint])
    frame.insert(3, "recommended", frame.pop("recommended"))
    notes = [
        "± one standard error. The intervals of (14) and of its inverse allow for any rest position inside a count; a "
        "value that this excludes has none. Count edge to count edge, σ₀ comes from encoder transitions and is "
        "insensitive to where inside a count the joint rests."
    ]
    if joint.truth:
        notes.append("True: the value that was simulated. Error: (value − true) / true.")
    facts: list[tuple[str, tuple[Said, ...]]] = []
    for fit in slow.fits.values():
        prior, counts = fit.sigma_1, counted(fit.counts, "count edge")
        damping = "none" if prior.value is None else f"{pair(prior)} {pretty(prior.unit)}"
        said = (
            f"{in_print(choice(fit))} {counted(len(fit.loadings), 'loading')} and {counts} crossed.",
            f"g₀ = {pretty(level(fit, joint.kind))}, from {in_print(fit.level_source)}.",
            f"Bias of (14) as printed with this encoder: {in_print(bias(fit, joint.kind))}",
            f"σ₁ of an assumed damping ratio: {damping}.",
        )
        facts.append((direction(fit.direction), (*said, *prior.warnings)))
    return Section(
        "Stiffness",
        text="" if slow.fits else "No σ₀: see below for what is missing.",
        facts=tuple(facts),
        table=Table("presliding", "Stiffness by four methods", part=frame, note=" ".join(notes)),
        form="part",
    )


def _figures(slow: Presliding, figures: Mapping[str, Drawing]) -> Iterator[Drawing]:
    """The loadings and the closed cycles."""
    found = "; ".join(
        f"{direction(d)}: σ₀ = {measured(fit.sigma_0.value, fit.sigma_0.standard_error)} {pretty(fit.sigma_0.unit)}"
        for d, fit in slow.fits.items()
        if fit.sigma_0.value is not None
    )
    how = (
        "Torque vs displacement of each loading (grey), shifted so that its fitted rest position is at zero; circles: "
        "count edges, evenly thinned where there are many. Lines: T = g₀ (1 − exp(−σ₀ y / g₀)) with the σ₀ of three "
        "methods; they level off at g₀ (where it is a lower bound alone, at the one above it with which σ₀ fits the "
        "edges best), and end with the displacement that was measured."
    )
    yield figures["presliding"]._replace(caption=sentence(found), how=how)
    losses = [x.loss for x in slow.loops]
    if not losses:
        return
    least, most = number(min(losses), 2), number(max(losses), 2)
    lost = f"{least if least == most else f'{least} to {most}'} {WORK} lost in {counted(len(losses), 'closed cycle')}."
    how = (
        "Closed cycles of torque vs displacement (grey), from one peak of the torque to the next of the same sign. "
        "Solid: regression of torque on displacement; dashed: one over the regression of displacement on torque; "
        "dotted: between the extremes of the torque. The area is the energy dissipated."
    )
    left_out = len(losses) - MOST_LOOPS
    rest = f" The first {MOST_LOOPS} are drawn; {left_out} more are in the table." if left_out > 0 else ""
    yield figures["hysteresis"]._replace(caption=f"{lost}{rest}", how=how, data="hysteresis")


def _amplitudes(joint: Joint, slow: Presliding) -> Iterator[Section]:
    """Stiffness vs amplitude; the unit of stiffness stands below the table, which is narrow so."""
    frame = tables.stiffness([joint])
    if frame.empty:
        return
    softens = any(warning.code == "softens" for fit in slow.fits.values() for warning in fit.warnings)
    found = "the joint softens by more than" if softens else "no softening is found beyond"
    how = (
        f"Stiffness in {pretty(unit('sigma_0', joint.kind))}, torque / displacement from rest; beside it what "
        "T = g₀ (1 − exp(−σ₀ y / g₀)) gives from the initial stiffness on."
    )
    torque, position = (pretty(unit(name, joint.kind)) for name in ("torque", "position"))
    headings = {"torque": f"torque ({torque})", "displacement": f"displacement ({position})", "value": "stiffness"}
    part = frame.drop(columns="sigma_0").rename(columns=headings | {"lugre": "LuGre's own"})
    table = Table("stiffness", "Stiffness vs amplitude", part=part, note=how)
    yield Section(f"Stiffness vs amplitude: {found} LuGre's own exponential", table=table, form="folded")


def _breakaway_and_cycles(joint: Joint, slow: Presliding) -> Iterator[Section]:
    """Each breakaway, and closed cycles, likewise narrow: rows in one column, amplitudes as half of a range."""
    torque, position = (pretty(unit(name, joint.kind)) for name in ("torque", "position"))
    frame = tables.breakaway([joint])
    if not frame.empty:
        medians = []
        for d, e in slow.breakaway.items():
            ends = "" if e.interval is None else f", 95 %: {span(e.interval)}"
            medians.append((direction(d), in_print(f"the median breakaway torque is {pair(e)} {e.unit}{ends}.")))
        yield Section("", facts=tuple(medians), form="part")
        headings = {"breakaway": f"torque ({torque})", "start": "first sample"}
        table = Table("breakaway", "Breakaway", part=frame.rename(columns=headings))
        yield Section("Each breakaway", table=table, form="folded")
    if not slow.loops:
        return
    frame = tables.hysteresis([joint])
    frame["samples"] = [f"{start}\u2013{stop}" for start, stop in zip(frame["start"], frame["stop"], strict=True)]
    columns = {
        "file": "file", "samples": "samples", "counts": "counts", "torque_amplitude": f"± torque ({torque})",
        "displacement_amplitude": f"± displacement ({position})", "slope": "regression", "inverse_slope": "inverse",
        "secant": "secant", "loss": f"loss per cycle ({WORK})",
    }  # fmt: skip  # a table of words
    how = (
        "Regression of torque on displacement, inverse regression and secant, in "
        f"{pretty(unit('sigma_0', joint.kind))}, differ because the loop is wide: none of them is σ₀. Amplitudes are "
        "half of the range."
    )
    table = Table("hysteresis", "Cycles", part=frame[[*columns]].rename(columns=columns), note=how)
    yield Section("Each cycle", table=table, form="folded")

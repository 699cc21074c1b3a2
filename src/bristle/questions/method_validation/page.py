"""The page and the text of a validation: results -> figures by name, what the template names, and lines."""

from pathlib import Path
from typing import Any

import pandas as pd

from bristle.identification.static.grid import PLAIN_GRID
from bristle.model.parameters import Kind, unit
from bristle.page.columns import Table, shown
from bristle.page.page import write_part
from bristle.page.wording import counted, in_percent, number, pretty, slugs
from bristle.questions.method_validation import figures, tables
from bristle.questions.method_validation.intervals import BOOTSTRAP_SETS, INTERVAL_SETS
from bristle.questions.method_validation.results import SAME_COST, CaseResult, Validation
from bristle.questions.method_validation.run import LOCAL_SETS, REFINED
from bristle.questions.method_validation.solvers import LMFIT
from bristle.questions.method_validation.verdict import overall, verdict

FEW = 6
"""Cases at most of which each has its own verdict in the text, and its own section on the page."""


_WORDS = {
    " elsewhere": ", other minimum", "declined": "no estimate returned", "lower_beyond": "lower outside the range",
    "ipopt_lead": "IPOPT below the grid (relative)", f"plain_{PLAIN_GRID}_error": f"error of the plain grid of {PLAIN_GRID}",
}  # fmt: skip  # a table
"""What the page calls parts of the columns of tables."""


def write_validation(validation: Validation, folder: Path) -> Path:
    """Write a validation as a page with figures and tables.

    Returns the path of index.html. Raises as `write_page` does.
    """
    kind, drawn = validation.case_set.kind, figures.showcase(validation, FEW)
    names = slugs([f"{x.case.label} {x.case.design}".replace("(+)", "plus").replace("(-)", "minus") for x in drawn])
    draw: dict[str, Any] = {
        "resolution": (lambda: figures.resolution_figure(validation), "error of the plain grid vs its resolution")
    }
    for name, result in zip(names, drawn, strict=True):
        label = result.case.label
        draw |= {
            f"{name}-cost": (lambda x=result: figures.cost_figure(x, kind), f"cost vs v_s of {label}"),
            f"{name}-starts": (lambda x=result: figures.starts_figure(x, kind), f"success vs start of {label}"),
            f"{name}-methods": (lambda x=result: figures.methods_figure(x), f"v_s by each method of {label}"),
        }
    torque = pretty(unit("torque", kind))
    sections = [
        {
            "name": name,
            "case": result.case,
            "noise": f"{result.case.noise:.2g} {torque}",
            "verdict": verdict(result),
            "captions": captions(result, kind),
            "methods": _rounded(tables.v_s_by_method(result)),
        }
        for name, result in zip(names, drawn, strict=True)
    ]
    frames = tables.all_tables(validation)
    context = {
        "title": validation.case_set.title,
        "seed": validation.seed,
        "validation": validation,
        "overall": overall(validation),
        "sections": sections,
        "resolution": resolution_caption(validation),
        **{name: _rounded(frames[name].rename(columns=_heading)) for name in ("cases", "coverage")},
        "local": min(LOCAL_SETS, validation.repetitions),
        "covered": min(INTERVAL_SETS, validation.repetitions),
        "bootstrapped": min(BOOTSTRAP_SETS, validation.repetitions),
        "lmfit": LMFIT,
        "same": f"{SAME_COST:g}",
        "plain": PLAIN_GRID,
    }
    return write_part(folder, "bristle.questions.method_validation", "validation.html", context, draw, frames)


def text(validation: Validation) -> str:
    """What the command line prints; with the verdict on each case where these are few."""
    title, torque = validation.case_set.title, unit("torque", validation.case_set.kind)
    lines = [f"{title} {direction}: {reason.coded}" for direction, reason in validation.case_set.skipped.items()]
    for result in validation.cases if len(validation.cases) <= FEW else ():
        case = result.case
        lines.append(f"{case.label}, SIMULATED, {case.design}, noise {case.noise:.2g} {torque}:")
        lines += [f"  {diagnostic.flagged}" for diagnostic in verdict(result)]
    return "\n".join([*lines, *(x.flagged for x in overall(validation))])


def captions(result: CaseResult, kind: Kind) -> dict[str, str]:
    """What each figure of a case shows, in a sentence with a number: the beginning of its caption."""
    lost = f"vₛ is not identifiable in {in_percent(result.declined)} of the data sets. " * result.not_identifiable
    return {
        "cost": f"{lost}{_cost(result, kind)}.",
        "starts": f"{_starts(result)}.",
        "methods": f"{lost}{_methods(result)}.",
    }


def _cost(result: CaseResult, kind: Kind) -> str:
    """Where the refined grid ends, and from how many starts the worst solver misses it, or which solver ends below it."""
    starts, v = result.starts, pretty(unit("v_s", kind))
    lowest = min(starts.solvers, key=lambda name: float(starts.cost[name].min()))
    cost, v_s = starts.cost[lowest], starts.final[lowest][-1]
    at = f"at vₛ = {number(starts.best[-1], 3)} {v}"
    if starts.best_cost > cost.min() * (1 + SAME_COST):
        excess, below = in_percent(starts.best_cost / float(cost.min()) - 1), number(v_s[cost.argmin()], 3)
        return (
            f"The refined grid ends {at}, at a cost {excess} above the lowest, which {lowest} finds at vₛ = {below} {v}"
        )
    (fewest, worst), *_ = _reached(result)
    missed, many = v_s.size - fewest, counted(v_s.size, "random start")
    miss = f"the worst solver ({worst}) misses it from {missed}" if missed else "no solver misses it from any"
    return f"The refined grid finds the minimum {at}; {miss} of {many}"


def _reached(result: CaseResult) -> list[tuple[int, str]]:
    """From how many starts solvers reach the best minimum, and which of them do, the fewest first."""
    starts = result.starts
    by_count: dict[int, list[str]] = {}
    for name in starts.solvers:
        by_count.setdefault(int((~starts.in_other_minimum(name)).sum()), []).append(name)
    return [(count, " and ".join(names)) for count, names in sorted(by_count.items())]


def _starts(result: CaseResult) -> str:
    (fewest, worst), *others = _reached(result)
    by = f"{worst} (worst)" if others else f"{'every' if fewest else 'any'} solver"
    from_fewest = f"{fewest or 'none'} of {counted(result.starts.initial_v_s.size, 'random start')} by {by}"
    return ", ".join([f"The best minimum is reached from {from_fewest}", *(f"{n} by {names}" for n, names in others)])


def _methods(result: CaseResult) -> str:
    """Median error of v_s and failures, of the refined grid and of the solvers at their worst."""
    local = [(name, result.methods[f"{name}, random start"]) for name in result.starts.solvers]
    grid, v_s = result.methods[REFINED], result.case.truth.v_s
    error, solver = max((abs(float(m.bias[-1])) / v_s, name) for name, m in local)
    failed = in_percent(max(m.failed for _, m in local))
    return (
        f"The median error of vₛ is {in_percent(abs(float(grid.bias[-1])) / v_s)} by the refined grid and up to "
        f"{in_percent(error)} by a solver ({solver}); the grid fails in {in_percent(grid.failed)} of the data sets, "
        f"a solver in up to {failed}"
    )


def resolution_caption(validation: Validation) -> str:
    """How many values a plain grid needs, or that those tried are too few; empty where v_s can be known nowhere."""
    needed = [x.resolution.enough for x in validation.resolvable]
    if not needed:
        return ""
    most, found = validation.resolvable[0].resolution.counts[-1], sorted({n for n in needed if n is not None})
    coarse = f"{needed.count(None)} of {counted(len(needed), 'case')}"
    if not found:
        return f"Even {most} values leave a plain grid's error of vₛ above a tenth of its standard error in {coarse}."
    values = f"{found[0]} to {found[-1]}" if len(found) > 1 else f"{found[0]}"
    more = f", and more than {most} in {coarse}" if None in needed else ""
    return f"A plain grid needs {values} values for an error of vₛ below a tenth of its standard error{more}."


def _heading(column: str) -> str:
    """A column's name as the page has it."""
    for name, words in _WORDS.items():
        column = column.replace(name, words)
    return column.replace("_percent", " (%)").replace("_", " ")


def _rounded(frame: pd.DataFrame) -> Table:
    """Numbers to three digits, as text that stays a number."""
    columns = frame.select_dtypes("float").columns
    frame[columns] = frame[columns].map(lambda x: float(f"{x:.3g}"))
    return shown(frame.astype(object).where(frame.notna(), None))

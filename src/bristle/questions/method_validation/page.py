"""The page and the text of a validation: results -> figures by name, what the template names, and lines."""

from pathlib import Path
from typing import Any

import pandas as pd

from bristle.identification.static.grid import PLAIN_GRID
from bristle.model.parameters import unit
from bristle.page.columns import Table, shown
from bristle.page.page import write_part
from bristle.page.wording import pretty, slugs
from bristle.questions.method_validation import figures, tables
from bristle.questions.method_validation.intervals import BOOTSTRAP_SETS, INTERVAL_SETS
from bristle.questions.method_validation.results import SAME_COST, Validation
from bristle.questions.method_validation.run import LOCAL_SETS
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

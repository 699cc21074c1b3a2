"""A validation as page, tables and text."""

from pathlib import Path
from typing import Any

import pandas as pd

from bristle.identification.static.grid import PLAIN_GRID
from bristle.model.parameters import Kind, unit
from bristle.page.columns import Table, shown
from bristle.page.page import write_part
from bristle.page.wording import counted, in_percent, number, pretty, slugs
from bristle.questions.method_validation import figures
from bristle.questions.method_validation.results import SAME_COST, CaseResult, Validation
from bristle.questions.method_validation.run import BOOTSTRAP_SETS, INTERVAL_SETS, LOCAL_SETS, REFINED
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
    """Write a validation as a page with figures and tables; returns the path of index.html. Raises as `write_part` does."""
    kind, drawn = validation.case_set.kind, validation.cases
    if len(drawn) > FEW:  # those of the first set at its highest noise
        first = [x for x in drawn if x.case.label == drawn[0].case.label]
        drawn = tuple(x for x in first if x.case.noise == max(y.case.noise for y in first))
    names = slugs([f"{x.case.label} {x.case.design}".replace("(+)", "plus").replace("(-)", "minus") for x in drawn])
    torque, sections = pretty(unit("torque", kind)), []
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
        said = {"verdict": verdict(result), "captions": captions(result, kind)}
        shown_of = {"case": result.case, "noise": f"{result.case.noise:.2g} {torque}"}
        sections.append({"name": name, **shown_of, **said, "methods": _rounded(v_s_by_method(result))})
    frames = {"cases": validation.to_frame(), **{f.__name__: f(validation) for f in (methods, coverage, resolution)}}
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
    starts, truth, v = result.starts, result.case.truth.v_s, pretty(unit("v_s", kind))
    many = counted(starts.initial_v_s.size, "random start")

    # From how many starts solvers reach the best minimum, and which of them do, the fewest first.
    by_count: dict[int, list[str]] = {}
    for name in starts.solvers:
        by_count.setdefault(int((~starts.in_other_minimum(name)).sum()), []).append(name)
    (fewest, worst), *others = [(count, " and ".join(names)) for count, names in sorted(by_count.items())]

    # Where the refined grid ends, and from how many starts the worst solver misses it, or which solver ends below it.
    lowest = min(starts.solvers, key=lambda name: float(starts.cost[name].min()))
    cost, at = starts.cost[lowest], f"at vₛ = {number(starts.best[-1], 3)} {v}"
    if starts.best_cost > cost.min() * (1 + SAME_COST):
        excess = in_percent(starts.best_cost / float(cost.min()) - 1)
        below = number(starts.final[lowest][-1][cost.argmin()], 3)
        of_cost = (
            f"The refined grid ends {at}, at a cost {excess} above the lowest, which {lowest} finds at vₛ = {below} {v}"
        )
    else:
        missed = starts.initial_v_s.size - fewest
        miss = f"the worst solver ({worst}) misses it from {missed}" if missed else "no solver misses it from any"
        of_cost = f"The refined grid finds the minimum {at}; {miss} of {many}"

    by = f"{worst} (worst)" if others else f"{'every' if fewest else 'any'} solver"
    reached = (f"{fewest or 'none'} of {many} by {by}", *(f"{n} by {names}" for n, names in others))

    # Median error of v_s and failures, of the refined grid and of the solvers at their worst.
    local, grid = [(name, result.methods[f"{name}, random start"]) for name in starts.solvers], result.methods[REFINED]
    error, solver = max((abs(float(m.bias[-1])) / truth, name) for name, m in local)
    return {
        "cost": f"{lost}{of_cost}.",
        "starts": f"The best minimum is reached from {', '.join(reached)}.",
        "methods": f"{lost}The median error of vₛ is {in_percent(abs(float(grid.bias[-1])) / truth)} by the refined grid and up to "
        f"{in_percent(error)} by a solver ({solver}); the grid fails in {in_percent(grid.failed)} of the data sets, "
        f"a solver in up to {in_percent(max(m.failed for _, m in local))}.",
    }


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


def methods(validation: Validation) -> pd.DataFrame:
    """One row per case, method and parameter."""
    rows = [
        {
            **result.which,
            "method": method.name, "repetitions": method.repetitions, "parameter": name,
            "truth": float(result.case.theta[k]), "bias": float(method.bias[k]), "spread": float(method.spread[k]),
            "coverage_percent": 100 * float(method.coverage[k]), "failed_percent": 100 * method.failed,
            "elsewhere_percent": None if method.other_minimum is None else 100 * method.other_minimum,
            "seconds": method.seconds,
        }
        for result in validation.cases
        for method in result.methods.values()
        for k, name in enumerate(result.case.names)
    ]  # fmt: skip  # a table
    return pd.DataFrame(rows)


def coverage(validation: Validation) -> pd.DataFrame:
    """One row per case and kind of interval: how often it covers, percent, by parameter."""
    rows = [
        {**result.which, "interval": coverage.kind, "repetitions": coverage.repetitions}
        | {f"{name}_percent": 100 * float(x) for name, x in zip(result.case.names, coverage.share, strict=True)}
        for result in validation.cases
        for coverage in result.coverage
    ]
    return pd.DataFrame(rows)


def resolution(validation: Validation) -> pd.DataFrame:
    """One row per case and plain grid: its error of v_s, and the statistical one."""
    rows = [
        {**result.which, "values": values, "error": float(error), "floor": result.resolution.floor}
        for result in validation.cases
        for values, error in zip(result.resolution.counts, result.resolution.error, strict=True)
    ]
    return pd.DataFrame(rows)


def v_s_by_method(result: CaseResult) -> pd.DataFrame:
    """The methods of one case: v_s relative to the truth, and times relative to the refined grid's."""
    v_s, base = result.case.truth.v_s, result.methods[REFINED].seconds
    rows = [
        {
            "method": method.name, "sets": method.repetitions, "bias of v_s (%)": 100 * float(method.bias[-1]) / v_s,
            "spread of v_s (%)": 100 * float(method.spread[-1]) / v_s,
            **{f"covers {name} (%)": 100 * float(x) for name, x in zip(result.case.names, method.coverage, strict=True)},
            "fails (%)": 100 * method.failed,
            "other minimum (%)": None if method.other_minimum is None else 100 * method.other_minimum,
            "ms": 1e3 * method.seconds, "time ratio to refined grid": method.seconds / base,
        }
        for method in result.methods.values()
    ]  # fmt: skip  # a table
    return pd.DataFrame(rows)

"""The report of a validation: the claim, each case, the resolution that a plain grid needs, and coverage."""

from functools import partial

import pandas as pd

from bristle.identification.static.grid import PLAIN_GRID
from bristle.model.parameters import Kind, unit
from bristle.page.page import Drawing
from bristle.page.report import Report, Section, Table
from bristle.page.wording import counted, in_percent, number, pretty, slugs
from bristle.questions.method_validation import figures
from bristle.questions.method_validation.results import SAME_COST, CaseResult, Validation
from bristle.questions.method_validation.run import BOOTSTRAP_SETS, INTERVAL_SETS, LOCAL_SETS, REFINED
from bristle.questions.method_validation.solvers import LMFIT
from bristle.questions.method_validation.verdict import overall, verdict

FEW = 6  # most cases of which each has a verdict in the text and a section on the page
_WORDS = {
    " elsewhere": ", other minimum", "declined": "no estimate returned", "lower_beyond": "lower outside the range",
    "ipopt_lead": "IPOPT below the grid (relative)", f"plain_{PLAIN_GRID}_error": f"error of the plain grid of {PLAIN_GRID}",
}  # fmt: skip  # parts of columns, as the page calls them


def report(validation: Validation) -> Report:
    """The claim, each case, or of many those of the first set, then resolution and coverage."""
    case_set, claims, drawn = validation.case_set, overall(validation), validation.cases
    few = len(drawn) <= FEW
    if not few:  # at its highest noise
        first = [x for x in drawn if x.case.label == drawn[0].case.label]
        drawn = tuple(x for x in first if x.case.noise == max(y.case.noise for y in first))
    local = min(LOCAL_SETS, validation.repetitions)
    how = (
        f"{validation.repetitions} repetitions; local solvers fit the first {local} of them, each from one random start, and the "
        f"first data set also from {validation.starts} random starts; starts are drawn within the grid's bounds. Seed "
        f"{validation.seed}.{'' if LMFIT else ' lmfit is not installed and was not compared.'}"
    )
    sections = [Section("", findings=claims[:1]), Section("Verdict", text=how, findings=claims[1:], id="verdict")]
    if skipped := tuple(case_set.skipped.items()):
        lines = tuple(f"{case_set.title} {direction}: {why.coded}" for direction, why in skipped)
        sections.append(Section("Not validated", facts=skipped, lines=lines, form="part"))
    sections.append(Section("Assumed", findings=case_set.assumptions, lines=(), form="part"))
    names = slugs([f"{x.case.label} {x.case.design}".replace("(+)", "plus").replace("(-)", "minus") for x in drawn])
    for name, x in zip(names, drawn, strict=True):
        case, said, torque = x.case, verdict(x), unit("torque", case_set.kind)
        line = f"{case.label}, SIMULATED, {case.design}, noise {case.noise:.2g} {torque}:"
        sections.append(Section(
            case.label, about=f"{case.design}; noise {case.noise:.2g} {pretty(torque)}", findings=said,
            figures=drawings(x, case_set.kind, name), lines=(line, *(f"  {one.flagged}" for one in said)) if few else (),
            id=f"{name}--case",
        ))  # fmt: skip  # a list of values
    if drawn:
        covered, bootstrapped = (min(sets, validation.repetitions) for sets in (INTERVAL_SETS, BOOTSTRAP_SETS))
        shown = "91 to 98 %" if covered >= 200 else "a less precise figure"
        cases = Table(
            "cases",
            "Solvers and plain grids by case",
            part=_rounded(validation.to_frame().rename(columns=_heading)),
            note="Noise in percent of α₀. No estimate returned: bristle reports vₛ as not identifiable, or gives it no finite interval. "
            f"Other minimum: of {validation.starts} random starts. Lower outside the range: with vₛ free, they find a lower cost outside "
            "the grid's range. IPOPT below the grid: by how much its cost is below the refined grid's within the range. Error of the "
            f"plain grid of {PLAIN_GRID}: of vₛ, relative to its standard error; values needed: for an error of a tenth, of the grids tried.",
        )
        covers = Table(
            "coverage",
            "Coverage of the 95 % intervals",
            part=_rounded(coverage(validation).rename(columns=_heading)),
            note=f"Covariance and profile over {covered} data sets, bootstrap-t over {bootstrapped}, where vₛ is identifiable. With so many "
            f"data sets, a true coverage of 95 % shows as {shown} in nineteen tables of twenty.",
        )
        sections += [
            Section("How fine must a plain grid be?", text=resolution_said(validation), lines=(), id="all"),
            Section("All cases", table=cases),
            Section("Do the 95 % intervals cover the truth?", table=covers),
        ]
    return Report(
        f"Validation of the grid search: {case_set.title}",
        tuple(sections),
        about="Grids against full nonlinear fits.",
        simulated="Validation needs true values: all torques here are simulated from the models named below.",
        seed=validation.seed,
        tables={"cases": validation.to_frame(), **{f.__name__: f(validation) for f in (methods, coverage, resolution)}},
    )


def drawings(result: CaseResult, kind: Kind, file: str) -> tuple[Drawing, ...]:
    """The figures of a case, cost and methods; `file` begins the names of their files."""
    lost = f"vₛ is not identifiable in {in_percent(result.declined)} of the data sets. " * result.not_identifiable
    starts, truth, v = result.starts, result.case.truth.v_s, pretty(unit("v_s", kind))
    many = counted(starts.initial_v_s.size, "random start")

    # The minimum of the refined grid, and the starts from which the worst solver misses it, or a solver's lower cost.
    misses = {name: int(starts.in_other_minimum(name).sum()) for name in starts.solvers}
    missed = max(misses.values())
    worst = " and ".join(name for name, count in misses.items() if count == missed)
    lowest = min(starts.solvers, key=lambda name: float(starts.cost[name].min()))
    cost, at = starts.cost[lowest], f"at vₛ = {number(starts.best[-1], 3)} {v}"
    if starts.best_cost > cost.min() * (1 + SAME_COST):
        excess = in_percent(starts.best_cost / float(cost.min()) - 1)
        below = number(starts.final[lowest][-1][cost.argmin()], 3)
        of_cost = (
            f"The refined grid ends {at}, at a cost {excess} above the lowest, which {lowest} finds at vₛ = {below} {v}"
        )
    else:
        miss = f"the worst solver ({worst}) misses it from {missed}" if missed else "no solver misses it from any"
        of_cost = f"The refined grid finds the minimum {at}; {miss} of {many}"

    # Median error of v_s and failures, of the refined grid and of the solvers at their worst.
    local, grid = [(name, result.methods[f"{name}, random start"]) for name in starts.solvers], result.methods[REFINED]
    error, solver = max((abs(float(m.bias[-1])) / truth, name) for name, m in local)
    label = result.case.label
    of_methods = (
        f"{lost}The median error of vₛ is {in_percent(abs(float(grid.bias[-1])) / truth)} by the refined grid and up to "
        f"{in_percent(error)} by a solver ({solver}); the grid fails in {in_percent(grid.failed)} of the data sets, "
        f"a solver in up to {in_percent(max(m.failed for _, m in local))}."
    )
    found = (
        (
            "cost", partial(figures.cost_figure, result, kind), f"cost vs v_s of {label}",
            f"{lost}{of_cost}. Cost of the first data set vs vₛ, all other parameters re-optimised, relative to the refined grid. "
            "Dashed: the 95 % threshold; the data allow any vₛ below it. Markers: three plain grids, the refined grid, and the "
            f"final values of {starts.initial_v_s.size} random starts of each solver.",
        ),
        (
            "methods", partial(figures.methods_figure, result), f"v_s by each method of {label}",
            f"{of_methods} Median error of vₛ with the width of the middle 68 % over the repetitions; right: how often each fails, "
            "that is, ends at a cost at which even the true model would be rejected.",
        ),
    )  # fmt: skip  # a table
    return tuple(Drawing(draw, f"{file}-{what}", said, text, simulated=True) for what, draw, said, text in found)


def resolution_said(validation: Validation) -> str:
    """The number of values that a plain grid needs, in a sentence."""
    needed = [x.resolution.enough for x in validation.resolvable]
    if not needed:
        return "vₛ is not identifiable in any case, so the resolution does not matter."
    most, found = validation.resolvable[0].resolution.counts[-1], sorted({n for n in needed if n is not None})
    coarse = f"{needed.count(None)} of {counted(len(needed), 'case')}"
    if not found:
        return f"Even {most} values leave a plain grid's error of vₛ above a tenth of its standard error in {coarse}."
    values = f"{found[0]} to {found[-1]}" if len(found) > 1 else f"{found[0]}"
    more = f", and more than {most} in {coarse}" if None in needed else ""
    return f"A plain grid needs {values} values for an error of vₛ below a tenth of its standard error{more}."


def _heading(column: str) -> str:
    for name, words in _WORDS.items():
        column = column.replace(name, words)
    return column.replace("_percent", " (%)").replace("_", " ")


def _rounded(frame: pd.DataFrame) -> pd.DataFrame:
    """A frame with numbers of three digits, and None for missing ones."""
    columns = frame.select_dtypes("float").columns
    frame[columns] = frame[columns].map(lambda x: float(f"{x:.3g}"))
    return frame.astype(object).where(frame.notna(), None)


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

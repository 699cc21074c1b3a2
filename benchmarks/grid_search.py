"""The grid search validated: `python benchmarks/grid_search.py [--repetitions 1000] [--starts 100] [--joints 4]`.

Every set of Table 1, at two noise levels and three designs, SIMULATED: does IPOPT from random starts within its bounds ever find a lower cost than
the refined grid, where do local solvers end in another minimum, how fine must a plain grid be, how often do
95 % intervals cover the truth, and how long does it all take.
"""

import argparse
from dataclasses import replace

import numpy as np

from bristle.identification.static.grid import PLAIN_GRID
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.questions.method_validation.cases import NOISES, sweep
from bristle.questions.method_validation.results import SAME_COST, CaseResult
from bristle.questions.method_validation.run import POLISHED, REFINED, SEED, validate
from bristle.questions.method_validation.solvers import case_names
from bristle.questions.method_validation.verdict import overall


def main() -> None:
    """Validate, and print the tables and the verdict."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=1000)
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--joints", type=int, default=4, help="of Table 1, the first so many")
    chosen = parser.parse_args()
    every = sweep()
    cases = every.cases[: chosen.joints * 2 * 3 * len(NOISES)]
    validation = validate(replace(every, cases=cases), repetitions=chosen.repetitions, starts=chosen.starts)
    print(
        f"{len(cases)} cases, {validation.repetitions} repetitions, {validation.starts} starts, seed {SEED}; all SIMULATED"
    )
    of_cases(validation.cases)
    of_methods(validation.cases)
    of_coverage(validation.cases)
    for sentence in overall(validation):
        print(sentence)
    worst = max(result.cost_deficit for result in validation.cases)
    print(
        f"asked: IPOPT's cost is never more than {SAME_COST:g} relative below the refined grid's: "
        f"{'holds' if worst <= SAME_COST else 'FAILS'}, {worst:.1e}"
    )


def of_cases(cases: tuple[CaseResult, ...]) -> None:
    """A row per case."""
    solvers = cases[0].starts.solvers
    print(
        "\n% of random starts in another minimum; IPOPT's cost below the grid's, relative; % lower outside the range; % no estimate returned;"
    )
    print(
        f"error of v_s by a plain grid of {PLAIN_GRID}, in % of the standard error, and how many values make that a tenth (of those tried)"
    )
    heads = "".join(f"{name:>11}" for name in (*solvers, "below", "outside", "no value", "error", "needed"))
    print(f"{'set':<22}{'noise':>7}{heads}")
    design = ""
    for result in sorted(cases, key=lambda t: [c.case.design for c in cases].index(t.case.design)):
        if result.case.design != design:
            design = result.case.design
            print(design)
        away = "".join(f"{100 * result.starts.in_other_minimum(n).mean():11.0f}" for n in solvers)
        r = result.resolution
        error = "-" if result.not_identifiable else f"{100 * r.share(PLAIN_GRID):.1f}"
        needed = "-" if result.not_identifiable else f"{r.enough or 'more'}"
        noise = f"{100 * result.case.noise / result.case.truth.alpha_0:.1f}%"
        lead = f"{max(result.cost_deficit, 0.0):11.0e}"
        shares = "".join(f"{100 * share:11.0f}" for share in (result.outside_range.mean(), result.declined))
        print(f"  {result.case.label:<20}{noise:>7}{away}{lead}{shares}{error:>11}{needed:>11}")


def of_methods(cases: tuple[CaseResult, ...]) -> None:
    """A row per method, over the cases in which v_s is identifiable."""
    known = [result for result in cases if not result.not_identifiable]
    print(
        f"\nmethods, in the {len(known)} cases in which v_s is identifiable: medians of |bias| and spread of v_s (% of it),"
    )
    print(
        "% that fail (end where even the true model is rejected), % above the lowest cost, median time and its ratio to the refined grid's"
    )
    print(f"{'':<28}{'bias':>8}{'spread':>8}{'fails':>9}{'above':>9}{'ms':>9}{'ratio':>9}")
    for name in known[0].methods:
        rows = [(t.methods[name], t.case.truth.v_s, t.methods[REFINED].seconds) for t in known]
        bias = np.median([100 * abs(m.bias[3]) / v_s for m, v_s, _ in rows])
        spread = np.median([100 * m.spread[3] / v_s for m, v_s, _ in rows])
        fails = 100 * np.mean([m.failed for m, _, _ in rows])
        away = [m.other_minimum for m, _, _ in rows if m.other_minimum is not None]
        above = f"{100 * np.mean(away):8.1f}%" if away else f"{'-':>9}"
        ms, ratio = (
            1e3 * np.median([m.seconds for m, _, _ in rows]),
            np.median([m.seconds / base for m, _, base in rows]),
        )
        print(f"{name:<28}{bias:8.2f}{spread:8.2f}{fails:8.1f}%{above}{ms:9.3f}{ratio:9.2f}")
    moved = max(t.polish_shift for t in known)
    print(f"{POLISHED} moves by at most {moved:.1e} spreads of any parameter in them")


def of_coverage(cases: tuple[CaseResult, ...]) -> None:
    """A row per design and kind of interval: how often it covers the truth, by parameter, lowest and highest of its cases."""
    print("\n95 % intervals that cover the truth, lowest to highest of a design's cases, %")
    print(f"{'':<60}{'cases':>6} " + "".join(f"{name:>16}" for name in case_names(GAUSSIAN)))
    for design in dict.fromkeys(t.case.design for t in cases):
        own = [t for t in cases if t.case.design == design]
        for kind in ("covariance", "profile", "bootstrap-t"):
            rows = [c.share for t in own for c in t.coverage if c.kind == kind]
            if rows:
                low, high = 100 * np.min(rows, axis=0), 100 * np.max(rows, axis=0)
                cells = "".join(f"{x:8.1f} - {y:5.1f}" for x, y in zip(low, high, strict=True))
                print(f"{f'{design}: {kind}':<62}{len(rows):>4} {cells}")


if __name__ == "__main__":
    main()

"""What the figures of `bristle validate` say first: a finding with its number, adverse ones in the same place."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bristle.model.parameters import Kind
from bristle.questions.method_validation.report import drawings, resolution_said
from bristle.questions.method_validation.results import CaseResult, Validation
from bristle.questions.method_validation.run import REFINED


def captions(result: CaseResult, kind: Kind) -> dict[str, str]:
    """What each figure of a case shows, which its caption begins with: all before it says what is drawn."""
    drawn = {"cost": " Cost of the first data set", "methods": " Median error of vₛ with"}
    texts = [x.caption for x in drawings(result, kind, "case")]
    return {name: text.partition(how)[0] for (name, how), text in zip(drawn.items(), texts, strict=True)}


def with_costs(result: CaseResult, costs: Mapping[str, list[float]]) -> CaseResult:
    """The same, with a refined grid at a cost of 1 and v_s of 0.5, and solvers that end at these costs, with v_s of 0.25."""
    ends = np.full((4, len(next(iter(costs.values())))), 0.25)
    starts = replace(
        result.starts, initial_v_s=ends[3], final=dict.fromkeys(costs, ends), best=np.full(4, 0.5), best_cost=1.0,
        cost={name: np.array(cost) for name, cost in costs.items()},
    )  # fmt: skip  # a list of values
    return replace(result, starts=starts, declined=0.0)


ENDS = {
    "some miss": (
        {"IPOPT": [1.0, 1.0, 1.0], "SciPy TRF": [2.0, 1.0, 2.0], "lmfit": [1.0, 2.0, 1.0]},
        "The refined grid finds the minimum at vₛ = 0.5 m/s; the worst solver (SciPy TRF) misses it from 2 of 3 random starts.",
    ),
    "two are worst": (
        {"IPOPT": [1.0, 1.0], "SciPy TRF": [2.0, 2.0], "lmfit": [2.0, 2.0]},
        "The refined grid finds the minimum at vₛ = 0.5 m/s; the worst solver (SciPy TRF and lmfit) misses it from 2 of 2 random starts.",
    ),
    "none misses": (
        {"IPOPT": [1.0], "SciPy TRF": [1.0]},
        "The refined grid finds the minimum at vₛ = 0.5 m/s; no solver misses it from any of 1 random start.",
    ),
    "all fail": (
        {"IPOPT": [2.0, 3.0], "SciPy TRF": [3.0, 3.0]},
        "The refined grid finds the minimum at vₛ = 0.5 m/s; the worst solver (IPOPT and SciPy TRF) misses it from 2 of 2 random starts.",
    ),
    "the grid is undercut": (
        {"IPOPT": [1.0, 0.8], "SciPy TRF": [1.0, 1.0]},
        "The refined grid ends at vₛ = 0.5 m/s, at a cost 25 % above the lowest, which IPOPT finds at vₛ = 0.25 m/s.",
    ),
}  # fmt: skip  # a table


def test_where_grid_and_solvers_end(validation: Validation) -> None:
    """The worst solver is named with its count, and a refined grid that a solver undercuts says so."""
    for what, (costs, end) in ENDS.items():
        found = captions(with_costs(validation.cases[0], costs), "prismatic")
        assert found["cost"] == end, what


def test_v_s_that_is_not_identifiable_stands_first(validation: Validation) -> None:
    """Cost and errors of a case that cannot tell v_s begin with that, in percent of its data sets; of others they do not."""
    known, _, lost = validation.cases
    for name in ("cost", "methods"):
        assert captions(replace(lost, declined=0.9), "revolute")[name].startswith(
            "vₛ is not identifiable in 90 % of the data sets. The "
        )
        assert captions(known, "revolute")[name].startswith("The ")


def test_median_errors_and_failures_of_the_worst_solvers(validation: Validation) -> None:
    """The grid's error is told beside the largest of the solvers', without signs, and both failures."""
    result = validation.cases[0]
    v_s = result.case.truth.v_s
    given = {REFINED: (-0.01, 0.0), "IPOPT": (-0.3, 0.25), "SciPy TRF": (0.02, 0.5), "lmfit": (0.0, 0.0)}
    methods = {
        name: replace(m, bias=np.full(4, given[key][0] * v_s), failed=given[key][1])
        if (key := name.removesuffix(", random start")) in given
        else m
        for name, m in result.methods.items()
    }
    assert captions(replace(result, methods=methods, declined=0.0), "revolute")["methods"] == (
        "The median error of vₛ is 1 % by the refined grid and up to 30 % by a solver (IPOPT); "
        "the grid fails in 0 % of the data sets, a solver in up to 50 %."
    )


def test_values_that_a_plain_grid_needs(validation: Validation) -> None:
    """They span the cases, those that none of the grids tried is fine enough for are counted, and without a case that is said."""
    one = validation.cases[0]
    counts = np.array(one.resolution.counts)
    for fine_from, expected in (
        ([125], "A plain grid needs 125 values for an error of vₛ below a tenth of its standard error."),
        ([125, 1000], "A plain grid needs 125 to 1000 values for an error of vₛ below a tenth of its standard error."),
        (
            [64, None, None],
            "A plain grid needs 64 values for an error of vₛ below a tenth of its standard error, and more than 2000 in 2 of 3 cases.",
        ),
        (
            [None],
            "Even 2000 values leave a plain grid's error of vₛ above a tenth of its standard error in 1 of 1 case.",
        ),
        ([], "vₛ is not identifiable in any case, so the resolution does not matter."),
    ):
        errors = [np.where(counts >= (np.inf if n is None else n), 0.01, 1.0) for n in fine_from]
        resolutions = [replace(one.resolution, floor=1.0, error=error) for error in errors]
        cases = tuple(replace(one, declined=0.0, resolution=r) for r in resolutions)
        assert resolution_said(replace(validation, cases=cases)) == expected, fine_from

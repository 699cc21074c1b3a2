"""A validation as tables."""

from collections.abc import Mapping

import pandas as pd

from bristle.identification.static.grid import PLAIN_GRID
from bristle.questions.method_validation.results import CaseResult, Validation
from bristle.questions.method_validation.run import REFINED


def all_tables(validation: Validation) -> Mapping[str, pd.DataFrame]:
    """Every table by the name of its file."""
    return {table.__name__: table(validation) for table in (cases, methods, coverage, resolution)}


def cases(validation: Validation) -> pd.DataFrame:
    """One row per case: what was simulated, and how local solvers and the plain grid did."""
    return pd.DataFrame([_case(result) for result in validation.cases])


def _case(result: CaseResult) -> dict[str, object]:
    starts, grid = result.starts, result.resolution
    knowable = not result.not_identifiable
    return {
        **_which(result),
        "declined_percent": 100 * result.declined,
        **{f"{name} elsewhere_percent": 100 * float(starts.in_other_minimum(name).mean()) for name in starts.solvers},
        "lower_beyond_percent": 100 * float(result.outside_range.mean()),
        "ipopt_lead": max(result.cost_deficit, 0.0),
        f"plain_{PLAIN_GRID}_error_percent": 100 * grid.share(PLAIN_GRID) if knowable else None,
        "values_needed": str(grid.enough) if knowable and grid.enough is not None else None,
    }


def methods(validation: Validation) -> pd.DataFrame:
    """One row per case, method and parameter."""
    rows = [
        {
            **_which(result),
            "method": method.name,
            "repetitions": method.repetitions,
            "parameter": name,
            "truth": float(result.case.theta[k]),
            "bias": float(method.bias[k]),
            "spread": float(method.spread[k]),
            "coverage_percent": 100 * float(method.coverage[k]),
            "failed_percent": 100 * method.failed,
            "elsewhere_percent": None if method.other_minimum is None else 100 * method.other_minimum,
            "seconds": method.seconds,
        }
        for result in validation.cases
        for method in result.methods.values()
        for k, name in enumerate(result.case.names)
    ]
    return pd.DataFrame(rows)


def coverage(validation: Validation) -> pd.DataFrame:
    """One row per case and kind of interval: how often it covers, percent, by parameter."""
    rows = [
        {**_which(result), "interval": coverage.kind, "repetitions": coverage.repetitions}
        | {f"{name}_percent": 100 * float(x) for name, x in zip(result.case.names, coverage.share, strict=True)}
        for result in validation.cases
        for coverage in result.coverage
    ]
    return pd.DataFrame(rows)


def resolution(validation: Validation) -> pd.DataFrame:
    """One row per case and plain grid: its error of v_s, and the statistical one."""
    rows = [
        {**_which(result), "values": values, "error": float(error), "floor": result.resolution.floor}
        for result in validation.cases
        for values, error in zip(result.resolution.counts, result.resolution.error, strict=True)
    ]
    return pd.DataFrame(rows)


def v_s_by_method(result: CaseResult) -> pd.DataFrame:
    """The methods of one case: v_s relative to the truth, and times relative to the refined grid's."""
    v_s, base = result.case.truth.v_s, result.methods[REFINED].seconds
    rows = [
        {
            "method": method.name,
            "sets": method.repetitions,
            "bias of v_s (%)": 100 * float(method.bias[-1]) / v_s,
            "spread of v_s (%)": 100 * float(method.spread[-1]) / v_s,
            **{
                f"covers {name} (%)": 100 * float(x) for name, x in zip(result.case.names, method.coverage, strict=True)
            },
            "fails (%)": 100 * method.failed,
            "other minimum (%)": None if method.other_minimum is None else 100 * method.other_minimum,
            "ms": 1e3 * method.seconds,
            "time ratio to refined grid": method.seconds / base,
        }
        for method in result.methods.values()
    ]
    return pd.DataFrame(rows)


def _which(result: CaseResult) -> dict[str, object]:
    case = result.case
    share = 100 * case.noise / case.truth.alpha_0 if case.truth.alpha_0 else None
    return {"of": case.label, "design": case.design, "noise_percent": share}

"""Results of a validation: per method, resolution of the grid, random start and case."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array, result
from bristle.estimation import levels
from bristle.identification.static.grid import PLAIN_GRID
from bristle.questions.method_validation.cases import CaseSet
from bristle.questions.method_validation.solvers import ValidationCase

if TYPE_CHECKING:
    import pandas as pd

SAME_COST = 1e-6  # largest relative difference of the costs of one minimum
FREE = "IPOPT, v_s free"


@result
class MethodResult:
    """One method over the repetitions; arrays (p,) in the order of the case's `names`."""

    name: str
    repetitions: int
    bias: Array  # median estimate minus truth
    spread: Array  # half the width of the middle 68.3 % of the estimates
    failed: float  # share outside the 95 % region
    other_minimum: float | None  # share above the lowest cost by more than `SAME_COST`; None for a plain grid
    seconds: float  # mean time of one data set


@result
class GridResolution:
    """Errors of the plain grid over its number of values."""

    counts: tuple[int, ...]
    error: Array  # RMS distance of the plain grid's v_s from the continuous minimum, rad/s, one per count
    floor: float  # spread of v_s at the continuous minimum, by noise alone, rad/s

    @property
    def enough(self) -> int | None:
        """The fewest of `counts` from which on the error is at most `FINE_ENOUGH` times the floor, if any."""
        fine = self.error <= levels.FINE_ENOUGH * self.floor
        first = next((k for k in range(fine.size) if fine[k:].all()), None)
        return None if first is None else self.counts[first]

    def share(self, count: int) -> float:
        """The error with this many values, over the floor."""
        return float(self.error[self.counts.index(count)]) / self.floor if self.floor else float("inf")


@result
class RandomStarts:
    """One data set, fitted from many random starts."""

    initial_v_s: Array  # v_s of each start, rad/s, (s,)
    final: Mapping[str, Array]  # per local solver, theta where each start ended, (4, s)
    cost: Mapping[str, Array]  # J_s (10) there, (s,)
    best: Array  # theta of the refined grid, (4,)
    best_cost: float

    @property
    def solvers(self) -> list[str]:
        """The local solvers that keep v_s within the grid's range, by name."""
        return [name for name in self.final if name != FREE]

    def in_other_minimum(self, name: str) -> NDArray[np.bool_]:
        """Starts of a solver that ended above the lowest cost within the range, (s,)."""
        lowest = min(self.best_cost, *(float(self.cost[solver].min()) for solver in self.solvers))
        return np.asarray(self.cost[name] > lowest * (1 + SAME_COST))


@result
class CostCurve:
    """Cost of the same data set vs v_s, minimised over all else."""

    v_s: Array
    cost: Array
    threshold: float  # of the 95 % interval of v_s
    plain: Mapping[int, float]  # v_s of plain grids, by their number of values


@result
class Coverage:
    """Coverage of one kind of 95 % interval."""

    kind: str
    repetitions: int
    share: Array  # (p,), in the order of the case's `names`


@result
class CaseResult:
    """Results of one case."""

    case: ValidationCase
    methods: Mapping[str, MethodResult]
    resolution: GridResolution
    starts: RandomStarts
    cost_curve: CostCurve
    coverage: tuple[Coverage, ...]
    declined: float  # share of the repetitions in which bristle gives no finite interval of v_s
    polish_shift: float  # largest move of IPOPT from the grid's estimate, in spreads; inf where one is zero
    cost_deficit: float  # largest relative deficit of IPOPT's cost within the range below the refined grid's

    @property
    def outside_range(self) -> NDArray[np.bool_]:
        """Starts that end beyond the grid's range at a lower cost than any within, with v_s free, (s,)."""
        v_s, (low, high), cost = self.starts.final[FREE][-1], self.case.v_s_range, self.starts.cost[FREE]
        return np.asarray((cost < self.starts.best_cost * (1 - SAME_COST)) & ((v_s < low) | (v_s > high)))

    @property
    def not_identifiable(self) -> bool:
        """Whether no method can identify v_s from these data."""
        return self.declined > levels.MOST_DECLINED

    @property
    def which(self) -> dict[str, object]:
        """Columns that name the case in tables."""
        case = self.case
        share = 100 * case.noise / case.truth.alpha_0 if case.truth.alpha_0 else None
        return {"of": case.label, "design": case.design, "noise_percent": share}


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """Results of a validation. `bristle.report_of` gives its text, page and tables."""

    case_set: CaseSet
    cases: tuple[CaseResult, ...]
    """In the order of the case set's."""
    repetitions: int
    starts: int
    seed: int

    @property
    def resolvable(self) -> tuple[CaseResult, ...]:
        """Cases in which v_s is identifiable, and noise scatters it."""
        return tuple(x for x in self.cases if not x.not_identifiable and x.resolution.floor > 0)

    def to_frame(self) -> "pd.DataFrame":
        """One row per case: its design, and errors of the local solvers and of the plain grid."""
        import pandas as pd

        rows = []
        for x in self.cases:
            starts, grid, knowable = x.starts, x.resolution, not x.not_identifiable
            elsewhere = {name: 100 * float(starts.in_other_minimum(name).mean()) for name in starts.solvers}
            rows.append({
                **x.which, "declined_percent": 100 * x.declined,
                **{f"{name} elsewhere_percent": percent for name, percent in elsewhere.items()},
                "lower_beyond_percent": 100 * float(x.outside_range.mean()), "ipopt_lead": max(x.cost_deficit, 0.0),
                f"plain_{PLAIN_GRID}_error_percent": 100 * grid.share(PLAIN_GRID) if knowable else None,
                "values_needed": str(grid.enough) if knowable and grid.enough is not None else None,
            })  # fmt: skip  # a table
        return pd.DataFrame(rows)

"""What a trial found, as values: per method, per resolution of the grid, per random start, and per case."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.record import freeze
from bristle.questions.method_validation.cases import Subject
from bristle.questions.method_validation.solvers import Case

SAME = 1e-6
"""Relative difference in cost below which two minima are the same."""
ENOUGH = 0.1
"""A grid is fine enough where its error of v_s is at most this share of the statistical one: together they are then 0.5 % larger."""
BLIND = 0.5
"""Where bristle declines to give v_s more often than this, nobody can know it."""
FREE = "IPOPT, v_s free"


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """How one method did over the repetitions; arrays (4,) in the order of `NAMES`."""

    name: str
    repetitions: int
    bias: Array
    """Median estimate minus truth."""
    spread: Array
    """Half the width that holds the middle 68.3 % of the estimates: their standard deviation where they are Gaussian, and no outlier's."""
    coverage: Array
    """Share of the repetitions in which the 95 % interval by covariance covers the truth; one that does not exist does not cover."""
    failed: float
    """Share that ended outside the 95 % region: at a cost at which even the right model is refused."""
    elsewhere: float | None
    """Share that ended more than 1e-6, relative, above the lowest cost that any method found; None for a plain grid, which always does."""
    seconds: float
    """Mean time of one data set."""

    def __post_init__(self) -> None:
        """Copy and freeze every array."""
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolution:
    """What the resolution of the plain grid costs."""

    counts: tuple[int, ...]
    error: Array
    """RMS distance of the plain grid's v_s from the continuous minimum, rad/s, one per count."""
    floor: float
    """`Method.spread` of v_s at the continuous minimum, rad/s: what noise alone does."""
    predicted: int
    """Values with which the error of even rounding, a step over the square root of 12, is `ENOUGH` times the floor; 0 without a floor."""

    def __post_init__(self) -> None:
        """Copy and freeze every array."""
        freeze(self)

    @property
    def enough(self) -> int | None:
        """The fewest of `counts` from which on the error is at most `ENOUGH` times the floor; None where not even the last is."""
        fine = self.error <= ENOUGH * self.floor
        first = next((k for k in range(fine.size) if fine[k:].all()), None)
        return None if first is None else self.counts[first]

    def share(self, count: int) -> float:
        """The error of one of `counts`, over the floor."""
        return float(self.error[self.counts.index(count)]) / self.floor if self.floor else float("inf")


@dataclass(frozen=True, slots=True, kw_only=True)
class Starts:
    """One data set, fitted from many random starts."""

    torque: Array
    """The data set, N*m, (n,)."""
    begun: Array
    """v_s of each start, rad/s, (s,)."""
    ended: Mapping[str, Array]
    """Per local solver, theta where each start ended, (4, s)."""
    cost: Mapping[str, Array]
    """J_s (10) there, (s,)."""
    best: Array
    """Theta of the refined grid, (4,)."""
    best_cost: float

    def __post_init__(self) -> None:
        """Copy and freeze every array."""
        freeze(self)

    def elsewhere(self, name: str) -> NDArray[np.bool_]:
        """Which starts of a solver ended above the lowest cost found within the range, (s,)."""
        lowest = min(self.best_cost, *(float(c.min()) for n, c in self.cost.items() if n != FREE))
        away: NDArray[np.bool_] = self.cost[name] > lowest * (1 + SAME)
        return away

    def without_peak(self, name: str) -> NDArray[np.bool_]:
        """Which of them ended without a Stribeck term: alpha_1 is nothing beside alpha_0, (s,)."""
        theta = self.ended[name]
        flat: NDArray[np.bool_] = self.elsewhere(name) & (theta[2] < 1e-4 * theta[0])
        return flat


@dataclass(frozen=True, slots=True, kw_only=True)
class Landscape:
    """The cost of the same data set over v_s, minimised over all else."""

    v_s: Array
    cost: Array
    threshold: float
    """The cost at which v_s leaves its 95 % interval."""
    plain: Mapping[int, float]
    """v_s of plain grids, by their number of values."""

    def __post_init__(self) -> None:
        """Copy and freeze every array."""
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """How often one kind of 95 % interval covers the truth."""

    kind: str
    repetitions: int
    share: Array
    """(4,), in the order of `NAMES`."""

    def __post_init__(self) -> None:
        """Copy and freeze every array."""
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """One case, tried."""

    case: Case
    methods: Mapping[str, Method]
    resolution: Resolution
    starts: Starts
    landscape: Landscape
    coverage: tuple[Coverage, ...]
    declined: float
    """Share of the repetitions in which bristle itself says that v_s is not identifiable, or has no finite interval."""
    moved: float
    """How far IPOPT goes from the grid's answer, at most, in spreads of any parameter; infinite where one does not spread."""
    beaten: float
    """By how much IPOPT's lowest cost within the range undercuts the refined grid's, relative, at most over all starts and repetitions."""
    beyond: NDArray[np.bool_]
    """Which starts end beyond the grid's range at a lower cost than any within, where v_s is free, (s,)."""

    def __post_init__(self) -> None:
        """Copy and freeze every array."""
        freeze(self)

    @property
    def blind(self) -> bool:
        """Whether these data cannot tell v_s, whatever the method."""
        return self.declined > BLIND


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """All cases, tried."""

    subject: Subject
    cases: tuple[Tried, ...]
    """In the order of the subject's."""
    repetitions: int
    starts: int
    seed: int

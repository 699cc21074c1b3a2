"""Results of fits as values: estimates, and the static, presliding and moving fits."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import hypot
from typing import Annotated

import numpy as np

from bristle.arrays import UNWRITTEN, Array, Interval, JsonForm, Matrix, Number, result, sized, unwritten
from bristle.data.constant_velocity.segments import Segment
from bristle.data.slow_loading import Loading, Loop
from bristle.errors import short
from bristle.findings import Finding
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.laws.registry import law_named
from bristle.model.parameters import Lugre, ParameterName, Stribeck, in_direction, lugre_of, static_of, without_peak

Shifts = Annotated[
    Mapping[str, Number], JsonForm(dict[str, Number] | None, lambda x: dict(x) or None, lambda x: x or {})
]
"""Changes by the constant that causes them, as it prints; null in JSON where there are none."""


def _law(name: str) -> Law:
    """The law of a name. Raises ValueError where there is none."""
    try:
        return law_named(name)
    except KeyError as error:
        raise ValueError(f"got the law {short(name)}; expected one of {error.args[0]}") from None


LawByName = Annotated[Law, JsonForm(str, lambda law: law.name, _law)]  # in JSON, its name


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """One parameter in `unit`; what does not exist is None, with a warning that says why."""

    value: float | None
    unit: str
    standard_error: float | None = None
    """Statistical, from the scatter of the data."""
    interval: Interval | None = None
    """95 %, of both errors; an open end is infinite."""
    systematic: float | None = None
    """Standard error from the declared errors of constants; None where none was declared."""
    shifts: Shifts = field(default_factory=dict)
    """Change of the value per standard error of each constant."""
    warnings: tuple[Finding, ...] = ()

    @property
    def total_error(self) -> float | None:
        """Both errors in quadrature; None where the data give none."""
        parts = [x for x in (self.standard_error, self.systematic) if x is not None]
        return hypot(*parts) if parts else None


def _and_of(warnings: tuple[Finding, ...], estimates: Iterable[Estimate]) -> Iterator[Finding]:
    """Warnings about a fit, then those about single estimates."""
    yield from warnings
    yield from (warning for e in estimates for warning in e.warnings if warning not in warnings)


@result
class Uncertainty:
    """The 95 % interval of one parameter three ways, in its unit; None where one does not exist."""

    covariance: Interval | None
    """By Student's t from the exact Jacobian, widened for correlated residuals."""
    profile: Interval | None
    """Where the cost, minimised over all other parameters, stays below its threshold."""
    bootstrap: Interval | None
    """From fits of resampled data."""
    curve: Array = field(default_factory=lambda: np.zeros((2, 0)), metadata=unwritten("2", "k"))
    """Values, ascending, and (cost - least) / (threshold - least) there, (2, k): 1 at the interval's ends."""
    draws: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("b"))
    """Values in resampled data, (b,)."""
    warnings: tuple[Finding, ...] = ()


@result
class Profile:
    """The cost J_s (10) as a function of v_s, minimised over all other parameters."""

    v_s: Array = field(metadata=sized("k"))
    """The grid, rad/s, ascending, (k,)."""
    cost: Array = field(metadata=sized("k"))
    """J_s at the grid, (N*m)**2, (k,)."""
    near_v_s: Array = field(metadata=sized("l"))
    """Values around the minimum, for a smooth curve, rad/s, ascending, (l,)."""
    near_cost: Array = field(metadata=sized("l"))
    """J_s there, (l,)."""
    best: float
    """The continuous minimum, rad/s."""
    best_cost: float
    threshold: float
    """The cost where v_s leaves its 95 % interval: J_min (1 + F(0.95; 1, n - p) / (n - p))."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldOut:
    """Prediction error on a held-out run."""

    file: str
    relative_error: Number
    """100 * norm(measured - predicted) / norm(measured), percent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunScatter:
    """Scatter of one parameter over several runs."""

    before: Number
    """Square root of the reduced chi-squared of the runs' estimates, by their own standard errors."""
    widened: Number
    """Factor on the standard error of the fit of all runs, >= 1."""
    stretched: Number
    """Factor on its 95 % interval, with Student's t of (runs - 1) degrees of freedom."""
    by_run: Mapping[str, Number]
    """Estimate of each run, by file; jackknife pseudo-values where the runs were not fitted apart."""


@result
class StaticFit:
    """Static parameters of one direction (`+`, `-`), of both (`both`), or shared by the two (`shared`)."""

    direction: str
    law: LawByName = GAUSSIAN
    parameters: Mapping[str, Estimate]
    rms: float | None
    """Root mean square residual, N*m."""
    relative_error: float | None
    """100 * norm(residual) / norm(torque), percent."""
    n: int
    outcome: Finding
    warnings: tuple[Finding, ...] = ()
    hold_out: tuple[HoldOut, ...] = ()
    names: tuple[str, ...] = ()
    """Free parameters, in the order of `covariance`."""
    covariance: Matrix = field(default_factory=lambda: np.zeros((0, 0)))
    degrees_of_freedom: int = 0
    profile: Profile | None = field(default=None, metadata=UNWRITTEN)
    uncertainty: Mapping[str, Uncertainty] = field(default_factory=dict)
    """Intervals three ways, by parameter."""
    plain_grid: Mapping[str, Number] = field(default_factory=dict)
    """Parameters at the best value of the paper's plain grid."""
    strays: tuple[Segment, ...] = field(default=(), metadata=UNWRITTEN)
    """Points off the law of the others, the one that lowers the cost most first."""
    repeats: Mapping[str, RunScatter] = field(default_factory=dict)
    """Scatter over the runs, by parameter; empty for one run."""
    velocity: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    """Of each point or equation, rad/s, (n,)."""
    torque: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    """Measured, N*m, (n,)."""
    residuals: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    """Measured minus fitted torque, N*m, (n,)."""
    segments: tuple[Segment, ...] = field(default=(), metadata=unwritten("n?"))
    """Segment behind each point, (n,); empty for moving data."""
    time: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n?"))
    """s from the start of its run, (n,); empty where unknown."""
    position: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n?"))
    """rad, (n,); empty where unknown."""

    def all_warnings(self) -> Iterator[Finding]:
        """Those about the fit, then those about single parameters."""
        return _and_of(self.warnings, self.parameters.values())

    @property
    def is_superseded(self) -> bool:
        """Whether the LuGre fit of the same moving runs is the one to use."""
        return self.outcome.code == "static-superseded"

    def values(self) -> Stribeck[float] | None:
        """The fitted law, with `without_peak` where it has no peak; None where nothing was fitted."""
        one = static_of(self.law)
        fitted = {n: e.value for n in one._fields if (e := self.parameters.get(n)) is not None and e.value is not None}
        nothing = dict.fromkeys(one._fields, 0.0) | without_peak(self.law)
        return one(**{**nothing, **fitted}) if "alpha_0" in fitted else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Crosscheck:
    """The full nonlinear fit of the same data, as a check."""

    parameters: Mapping[ParameterName, Number]
    difference_in_se: Mapping[ParameterName, Number]
    """(full - grid) in standard errors of the grid fit."""
    verdict: Finding
    agrees: bool = True
    """Whether both found the same cost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreslidingFit:
    """sigma_0 of one direction, and sigma_1 by (15)."""

    direction: str
    printed: Estimate
    """(14) as printed, T1 / x1."""
    sigma_0: Estimate
    """From count edge to count edge, or from all samples where no counts are seen."""
    sigma_1: Estimate
    """(15) with an assumed damping ratio, without a standard error."""
    degrees_of_freedom: Number = float("inf")
    """Of its standard error."""
    level: Number
    """g0, the torque at which slow loading slides, N*m."""
    level_standard_error: Number
    """Infinite where g0 is a lower bound, the largest torque held."""
    level_source: Finding
    """Origin of g0."""
    quantum: float
    """One count, rad; 0 where no counts are seen."""
    counts: int
    """Count edges crossed in all loadings."""
    loadings: tuple[Loading, ...] = field(default=(), metadata=UNWRITTEN)
    warnings: tuple[Finding, ...] = ()
    uncertainty: Mapping[str, Uncertainty] = field(default_factory=dict)
    """Intervals of `sigma_0` three ways."""
    repeats: Mapping[str, RunScatter] = field(default_factory=dict)
    """Scatter of `sigma_0` over the runs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Presliding:
    """Results of slow loading: sigma_0 per direction, breakaway, hysteresis."""

    fits: Mapping[str, PreslidingFit]
    breakaway: Mapping[str, Estimate]
    """Median breakaway torque per direction."""
    breakaways: tuple[Loading, ...] = field(default=(), metadata=UNWRITTEN)
    loops: tuple[Loop, ...] = ()
    warnings: tuple[Finding, ...] = ()

    def warnings_of(self, direction: str) -> Iterator[Finding]:
        """Those about the fit of a direction, then those about its estimates and its breakaway."""
        fit, broken = self.fits[direction], self.breakaway.get(direction)
        estimates = (fit.printed, fit.sigma_0, fit.sigma_1, *((broken,) if broken else ()))
        return _and_of(fit.warnings, estimates)


@result
class TrackingFit:
    """All parameters from moving runs."""

    law: LawByName = GAUSSIAN
    parameters: Mapping[ParameterName, Estimate]
    rms: Number
    """Root mean square residual, N*m."""
    relative_error: Number
    """100 * norm(residual) / norm(measured), percent."""
    n: int
    outcome: Finding
    starts: int
    reached: int
    """Starts that ended at the lowest cost, within 1e-6 of it."""
    condition: Number
    """Of the Jacobian with columns of unit length."""
    warnings: tuple[Finding, ...] = ()
    hold_out: tuple[HoldOut, ...] = ()
    names: tuple[ParameterName, ...] = ()
    """Free parameters, in the order of `covariance`."""
    covariance: Matrix = field(default_factory=lambda: np.zeros((0, 0)))
    fixed: Mapping[ParameterName, Number] = field(default_factory=dict)
    """Values of parameters that were given, or that the motion does not show."""
    count_bias: Mapping[ParameterName, Number] = field(default_factory=dict)
    """Bias by encoder counts, already subtracted; empty where it was not estimated."""
    time: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    """Of each equation, s from the start of its run, (n,)."""
    velocity: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    measured: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    """Torque, N*m, (n,)."""
    residuals: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    friction: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n?"))
    """Measured friction, N*m, (n,): measured torque less the other modelled terms; empty where unknown."""
    load: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n?"))
    """The load that friction rises with, N*m, (n,); empty without load."""
    starts_of_runs: tuple[int, ...] = field(default=(0,), metadata=UNWRITTEN)
    """First equation of each segment between gaps."""
    late: tuple[float, float] = field(default=(0.0, np.inf), metadata=UNWRITTEN)
    """Delay of the logged torque, to first order, and its standard error, s."""
    uncertainty: Mapping[ParameterName, Uncertainty] = field(default_factory=dict)
    """Intervals three ways, by parameter; empty unless asked for."""
    repeats: Mapping[ParameterName, RunScatter] = field(default_factory=dict)
    """Scatter over the runs, by parameter; empty for one run."""

    def all_warnings(self) -> Iterator[Finding]:
        """Those about the fit, then those about single parameters."""
        return _and_of(self.warnings, self.parameters.values())

    @property
    def known(self) -> dict[ParameterName, float]:
        """Every value, estimated or fixed."""
        return {**self.fixed, **{name: e.value for name, e in self.parameters.items() if e.value is not None}}

    def values(self, direction: str) -> Lugre[float] | None:
        """The LuGre set of a direction (`+`, `-`, `both`), estimated or fixed; None where it is incomplete."""
        known, one = self.known, lugre_of(self.law)
        values = [x for name in one._fields if (x := in_direction(known, name, direction)) is not None]
        return one(*values) if len(values) == len(one._fields) else None

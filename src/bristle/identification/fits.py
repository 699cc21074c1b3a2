"""Fits as values: an estimate, and what static, presliding and moving runs each gave, with their warnings."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import hypot
from typing import Annotated, Literal

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
    """The law of a name; raises ValueError where there is none."""
    try:
        return law_named(name)
    except KeyError as error:
        raise ValueError(f"got the law {short(name)}; expected one of {error.args[0]}") from None


LawByName = Annotated[Law, JsonForm(str, lambda law: law.name, _law)]  # in JSON, its name


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """One parameter: value, standard error and 95 % interval in `unit`.

    What does not exist is None, with a warning that says why; an interval that is open on a side has an infinite bound.
    """

    value: float | None
    unit: str
    standard_error: float | None = None
    """Statistical: how far the scatter of the data leaves the parameter open."""
    interval: Interval | None = None
    """Of both errors, the statistical and the systematic one."""
    systematic: float | None = None
    """Standard error that the declared errors of constants add; None where none was declared."""
    shifts: Shifts = field(default_factory=dict)
    """Change of the value per standard error of each such constant: those of one constant go together."""
    warnings: tuple[Finding, ...] = ()

    @property
    def total_error(self) -> float | None:
        """Standard error of both kinds, in `unit`; None where the data give none."""
        parts = [x for x in (self.standard_error, self.systematic) if x is not None]
        return hypot(*parts) if parts else None


def _and_of(warnings: tuple[Finding, ...], estimates: Iterable[Estimate]) -> Iterator[Finding]:
    """Warnings about a fit, then those about one of its estimates alone."""
    yield from warnings
    yield from (warning for e in estimates for warning in e.warnings if warning not in warnings)


@result
class Uncertainty:
    """One parameter's 95 % interval, three ways, in the parameter's unit.

    What does not exist is None, with the reason among the warnings.
    """

    covariance: Interval | None
    """By Student's t from the exact Jacobian, widened for correlated residuals."""
    profile: Interval | None
    """Where the cost, minimised over all else, stays below its threshold; an open side is infinite, or the physical bound."""
    bootstrap: Interval | None
    """From fits of resampled data."""
    curve: Array = field(default_factory=lambda: np.zeros((2, 0)), metadata=unwritten("2", "k"))
    """Values of the parameter, ascending, and (cost - least) / (threshold - least) there, (2, k): 1 at the interval's ends."""
    draws: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("b"))
    """The parameter in resampled data, (b,)."""
    warnings: tuple[Finding, ...] = ()


@result
class Profile:
    """The cost J_s (10), minimised over all other parameters, as a function of v_s."""

    v_s: Array = field(metadata=sized("k"))
    """The grid, rad/s, ascending, shape (k,)."""
    cost: Array = field(metadata=sized("k"))
    """J_s at the grid, (N*m)**2, shape (k,)."""
    plain_v_s: Array = field(metadata=sized("m"))
    """The paper's plain grid, rad/s, shape (m,)."""
    plain_cost: Array = field(metadata=sized("m"))
    """J_s at the plain grid, shape (m,)."""
    near_v_s: Array = field(metadata=sized("l"))
    """Values of v_s around the minimum, close enough to draw a curve through, rad/s, ascending, shape (l,)."""
    near_cost: Array = field(metadata=sized("l"))
    """J_s there, shape (l,)."""
    best: float
    """The continuous minimum, rad/s."""
    best_cost: float
    threshold: float
    """The cost at which v_s leaves its 95 % interval: J_min (1 + F(0.95; 1, n - p) / (n - p))."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldOut:
    """How well a fit predicts a run that it has not seen."""

    file: str
    relative_error: Number
    """100 * norm(measured - predicted) / norm(measured), percent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunScatter:
    """One parameter of each of several runs of one kind, and how far they scatter beside their errors."""

    before: Number
    """Square root of the reduced chi-squared of the runs' estimates, by their own standard errors."""
    after: Number
    """The same by those errors as they are widened."""
    widened: Number
    """What the standard error of the fit of all runs is multiplied by; 1 where the runs scatter by chance alone, or that fit knows of it."""
    stretched: Number
    """The same of its 95 % interval: with Student's t of one degree of freedom less than there are runs."""
    by_run: Mapping[str, Number]
    """By its file, the estimate of each run that shows the parameter. Where none was fitted apart these are pseudo-values, the
    estimate moved by as many times what the run does to it as there are runs, and `before` is their error over that of the fit."""

    @property
    def significant(self) -> bool:
        """Whether the runs differ by more than chance."""
        return self.after < self.before


@result
class StaticFit:
    """The static parameters of one direction (`+`, `-`), of both (`both`), or what the two share (`shared`)."""

    direction: str
    law: LawByName = GAUSSIAN
    """Of the friction."""
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
    """The free parameters, in the order of `covariance`."""
    covariance: Matrix = field(default_factory=lambda: np.zeros((0, 0)))
    degrees_of_freedom: int = 0
    profile: Profile | None = field(default=None, metadata=UNWRITTEN)
    uncertainty: Mapping[str, Uncertainty] = field(default_factory=dict)
    """Each parameter's interval three ways."""
    plain_grid: Mapping[str, Number] = field(default_factory=dict)
    """The parameters at the best value of the paper's plain grid."""
    strays: tuple[Segment, ...] = field(default=(), metadata=UNWRITTEN)
    """Points that do not belong to the law of the others, the one that lowers the cost most first."""
    repeats: Mapping[str, RunScatter] = field(default_factory=dict)
    """How the parameters scatter over the runs; empty where there is but one."""
    velocity: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    """What was fitted: velocity, rad/s, shape (n,)."""
    torque: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    """Measured torque, N*m, shape (n,)."""
    residuals: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    """Measured minus fitted torque, N*m, shape (n,)."""
    segments: tuple[Segment, ...] = field(default=(), metadata=unwritten("n?"))
    """Where each point comes from, (n,); empty for moving data."""
    time: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n?"))
    """When each point was measured, s from the start of its run, shape (n,); empty where unknown."""
    position: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n?"))
    """Where each point was measured, rad, shape (n,); empty where unknown."""

    def all_warnings(self) -> Iterator[Finding]:
        """Those about the fit, then those about one parameter."""
        return _and_of(self.warnings, self.parameters.values())

    def values(self) -> Stribeck[float] | None:
        """The fitted law, or None where nothing was fitted; a law without a peak is as in `without_peak`."""
        one = static_of(self.law)
        fitted = {n: e.value for n in one._fields if (e := self.parameters.get(n)) is not None and e.value is not None}
        nothing = dict.fromkeys(one._fields, 0.0) | without_peak(self.law)
        return one(**{**nothing, **fitted}) if "alpha_0" in fitted else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Crosscheck:
    """The full nonlinear fit beside the grid, on the same data."""

    cost_grid: Number
    cost_full: Number
    starts: int
    reached: int
    """How many starts ended within 1e-6 relative of the lowest cost that any of them found."""
    parameters: Mapping[ParameterName, Number]
    difference_in_se: Mapping[ParameterName, Number]
    """(full - grid) in standard errors of the grid fit."""
    verdict: Finding
    agrees: bool = True
    """Whether both found the same cost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AmplitudeStiffness:
    """The stiffness of slow loading from rest up to one torque."""

    kind: Literal["initial", "secant"]
    torque: Number
    """N*m."""
    displacement: Number
    """rad."""
    value: Number
    """One over the other, N*m/rad."""
    standard_error: Number
    lugre: Number
    """What LuGre's own exponential gives there, from the initial stiffness on, N*m/rad."""
    sigma_0: Number
    """Of the LuGre joint that bends this far, N*m/rad: the same at every amplitude where LuGre holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreslidingFit:
    """sigma_0 of one direction by four estimators side by side, and sigma_1 by (15)."""

    direction: str
    printed: Estimate
    """(14) as it stands, T1 / x1."""
    corrected: Estimate
    """Its closed-form inverse, exact where rest lies on a count edge."""
    edges: Estimate
    """From count edge to count edge."""
    samples: Estimate
    """From all samples."""
    sigma_1: Estimate
    """(15): of an assumed damping ratio, without a standard error."""
    recommended: str
    """Which of the four to use."""
    degrees_of_freedom: Number = float("inf")
    """Of its standard error."""
    level: Number
    """g0, the torque at which slow loading slides, N*m."""
    level_standard_error: Number
    """Infinite where g0 is a lower bound: the largest torque held."""
    level_source: Finding
    """Where g0 comes from."""
    quantum: float
    """One count, rad; 0 where no counts are seen."""
    counts: int
    """Count edges crossed in all loadings."""
    bias_on_edge: Number
    """Relative bias of (14) where rest lies on a count edge; like the next two nan without an encoder count and a sigma_0."""
    bias_mean: Number
    """Its mean over rest positions anywhere in the count."""
    bias_spread: Number
    """Its standard deviation over them."""
    amplitudes: tuple[AmplitudeStiffness, ...] = ()
    """The stiffness at some amplitudes, the initial one first; empty where the loadings show too little."""
    loadings: tuple[Loading, ...] = field(default=(), metadata=UNWRITTEN)
    warnings: tuple[Finding, ...] = ()
    uncertainty: Mapping[str, Uncertainty] = field(default_factory=dict)
    """The recommended sigma_0's interval three ways, under `sigma_0`."""
    repeats: Mapping[str, RunScatter] = field(default_factory=dict)
    """How the recommended sigma_0 scatters over the runs, under `sigma_0`."""

    @property
    def sigma_0(self) -> Estimate:
        """The recommended estimate."""
        return {"edges": self.edges, "samples": self.samples}[self.recommended]


@dataclass(frozen=True, slots=True, kw_only=True)
class Presliding:
    """What slow loading showed: sigma_0 per direction, breakaway, and hysteresis."""

    fits: Mapping[str, PreslidingFit]
    breakaway: Mapping[str, Estimate]
    """Per direction, the median torque at which the joint began to slide."""
    breakaways: tuple[Loading, ...] = field(default=(), metadata=UNWRITTEN)
    """The loadings that broke away."""
    loops: tuple[Loop, ...] = ()
    warnings: tuple[Finding, ...] = ()

    def warnings_of(self, direction: str) -> Iterator[Finding]:
        """Those about the fit of a direction, then those about one of its estimates or its breakaway."""
        fit, broken = self.fits[direction], self.breakaway.get(direction)
        estimates = (fit.printed, fit.corrected, fit.edges, fit.samples, fit.sigma_1, *((broken,) if broken else ()))
        return _and_of(fit.warnings, estimates)


@result
class TrackingFit:
    """All parameters from moving data."""

    law: LawByName = GAUSSIAN
    """Of the friction."""
    parameters: Mapping[ParameterName, Estimate]
    rms: Number
    """Root mean square residual of the equations, N*m (rad where the position is predicted)."""
    relative_error: Number
    """100 * norm(residual) / norm(measured), percent; a position is measured from the mean of its window."""
    n: int
    outcome: Finding
    starts: int
    reached: int
    """How many starts ended within 1e-6 relative of the lowest cost."""
    condition: Number
    """Of the Jacobian with columns of unit length."""
    warnings: tuple[Finding, ...] = ()
    hold_out: tuple[HoldOut, ...] = ()
    names: tuple[ParameterName, ...] = ()
    """The free parameters, in the order of `covariance`."""
    covariance: Matrix = field(default_factory=lambda: np.zeros((0, 0)))
    fixed: Mapping[ParameterName, Number] = field(default_factory=dict)
    """With what the others were fitted, of parameters that were given, or that the motion does not show."""
    count_bias: Mapping[ParameterName, Number] = field(default_factory=dict)
    """What encoder counts were found to add to each parameter, and has been taken off; empty where that was not looked at."""
    crosscheck: Crosscheck | None = None
    """The same problem by CasADi and IPOPT."""
    time: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    """Of each equation, s from the start of its run, (n,)."""
    quantity: Literal["torque", "position"] = "torque"
    """What the fit predicts."""
    velocity: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    measured: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    """Torque, N*m, or position, rad, (n,)."""
    residuals: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    friction: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n?"))
    """Measured friction, N*m, (n,): the measured torque less all other fitted terms; empty where the position is predicted."""
    load: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n?"))
    """The load that friction rises with, N*m, (n,); empty where it does not."""
    starts_of_runs: tuple[int, ...] = field(default=(0,), metadata=UNWRITTEN)
    """First equation of each segment between gaps."""
    late: tuple[float, float] = field(default=(0.0, np.inf), metadata=UNWRITTEN)
    """By how much the torque was logged late, to first order beside all that was fitted, and its standard error, s."""
    windows: int = 0
    """Pieces that were simulated, each from a start of its own; 0 where the torque is predicted."""
    uncertainty: Mapping[ParameterName, Uncertainty] = field(default_factory=dict)
    """Each parameter's interval three ways; empty where that was not asked for."""
    repeats: Mapping[ParameterName, RunScatter] = field(default_factory=dict)
    """How the parameters scatter over the runs; empty where there is but one."""

    def all_warnings(self) -> Iterator[Finding]:
        """Those about the fit, then those about one parameter."""
        return _and_of(self.warnings, self.parameters.values())

    @property
    def known(self) -> dict[ParameterName, float]:
        """Every value: estimated, or as it was fixed."""
        return {**self.fixed, **{name: e.value for name, e in self.parameters.items() if e.value is not None}}

    def values(self, direction: str) -> Lugre[float] | None:
        """The set of a direction (`+`, `-`, `both`), what is not identifiable as it was fixed; None where there is none."""
        known, one = self.known, lugre_of(self.law)
        values = [x for name in one._fields if (x := in_direction(known, name, direction)) is not None]
        return one(*values) if len(values) == len(one._fields) else None

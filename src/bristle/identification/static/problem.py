"""Static problems as arrays, linear but for v_s and the `shape` of the law's peak, which is held: (9)-(12)."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from bristle.arrays import Array
from bristle.data.record import Record
from bristle.estimation.linear import bounded_least_squares
from bristle.estimation.nonlinear import Unknowns
from bristle.identification.load_levels import level_columns, levels_of, settled_weights
from bristle.identification.moving_runs import decimator, extra_columns, given_by, known_torque, needed, torque_shifts
from bristle.model.functions import linear_shapes_function, stribeck_shape_function, stribeck_shape_slope_function
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.parameters import INERTIA, Direction, ParameterName, least_of, of_curve
from bristle.model.vectorize import evaluate

_AT_ONCE = 1_000_000  # samples times values of v_s smoothed at a time
Tables = tuple[Array, ...]
"""Columns over v_s, (n, k), one table per output of a function."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Regression:
    """A static problem of n equations from N samples (n = N unless smoothed)."""

    directions: tuple[Direction, ...]  # `both`, or those of + and - that were measured
    peaks: tuple[Direction, ...]  # Directions with a Stribeck term
    velocity: Array  # rad/s, (N,)
    torque: Array  # N*m, (n,)
    linear: Array  # Columns of the linear parameters but alpha_1, (n, m)
    linear_names: tuple[ParameterName, ...]
    """alpha_0, alpha_2 and the law's coefficients per direction, then the extra regressors."""
    law: Law = GAUSSIAN
    shape: tuple[float, ...] = ()  # Parameters of the peak beside v_s
    smooth: sparse.csr_array | None = None  # The decimation filter, (n, N)
    memory: dict[tuple[object, str, bytes, tuple[float, ...]], Tables] = field(default_factory=dict, repr=False)
    """Smoothed columns, which take long."""
    shifts: Mapping[str, Array] = field(default_factory=dict)
    """Change of `torque` per standard error of each constant, (n,)."""
    given: tuple[str, ...] = ()  # Parameters that `torque` was made of, where the joint coasts
    known: Array | None = None  # Torque taken off `torque` (a fixed inertia's), (n,)
    weights: Mapping[str, float] = field(default_factory=dict)
    """Assumed coefficients of gravity and links, where the level rises with load."""

    @property
    def names(self) -> tuple[ParameterName, ...]:
        """The names of theta."""
        return (*self.linear_names, *(ParameterName(name, d) for name in ("alpha_1", "v_s") for d in self.peaks))

    def without(self, names: Collection[ParameterName]) -> "Regression":
        """The problem without some linear columns."""
        keep = [k for k, name in enumerate(self.linear_names) if name not in names]
        return replace(self, linear=self.linear[:, keep], linear_names=tuple(self.linear_names[k] for k in keep))

    def named(self, theta: Array) -> dict[ParameterName, float]:
        """Values of theta, or of its linear part, by name."""
        return dict(zip(self.names, theta.tolist(), strict=False))

    def text(self, name: ParameterName) -> str:
        """A parameter in print, bare where there is one direction."""
        return name.name if len(self.directions) == 1 else str(name)

    def speeds(self, direction: str) -> Array:
        """Nonzero speeds of a direction, or of `both`, rad/s."""
        moving = {"+": self.velocity > 0, "-": self.velocity < 0}.get(direction, self.velocity != 0)
        return np.asarray(np.abs(self.velocity[moving]))

    @property
    def least(self) -> Array:
        """Lower bounds of `names`: 0 for friction, -inf for extra regressors."""
        return np.array([-np.inf if name == INERTIA else least_of(name.name) for name in self.names])

    @property
    def lower(self) -> Array:
        """`least` of the linear columns, (m,)."""
        return self.least[: len(self.linear_names)]

    @property
    def logarithmic(self) -> NDArray[np.bool_]:
        """Which of `names` are stepped as logarithms: v_s."""
        return np.array([name.name == "v_s" for name in self.names])

    @property
    def measured(self) -> Array:
        """`torque` and what was taken off it, N*m, (n,)."""
        return self.torque if self.known is None else self.torque + self.known

    @property
    def equation_velocity(self) -> Array:
        """Velocity of each equation, rad/s, (n,)."""
        return self.velocity if self.smooth is None else self.smooth @ self.velocity

    def shapes(self, v_s: Array, direction: int = 0) -> Array:
        """Stribeck columns of a peak for each v_s, (n, k)."""
        return self._columns(stribeck_shape_function(self.law), v_s, direction)[0]

    def slopes(self, v_s: Array, direction: int = 0) -> tuple[Array, Array]:
        """`shapes` and their derivatives by v_s, (n, k) each."""
        shapes, slopes, *_ = self._columns(stribeck_shape_slope_function(self.law), v_s, direction)
        return shapes, slopes

    def own_slopes(self, v_s: float, direction: int = 0) -> Tables:
        """Derivatives of `shapes` at one v_s by the other shape parameters, (n, 1) each."""
        return self._columns(stribeck_shape_slope_function(self.law), np.array([v_s]), direction)[2:]

    def design(self, v_s: Sequence[float] | Array) -> Array:
        """All linear columns at given v_s, one per peak, (n, m + peaks)."""
        return np.concatenate([self.linear, *(self.shapes(np.array([s]), d) for d, s in enumerate(v_s))], axis=1)

    def columns(self, v_s: Sequence[float] | Array) -> tuple[Array, Array]:
        """`design`, and the derivative of its last columns by their v_s, (n, peaks)."""
        if not self.peaks:
            return self.linear, np.zeros((self.torque.size, 0))
        tables = [self.slopes(np.array([s]), d) for d, s in enumerate(v_s)]
        shapes, slopes = zip(*tables, strict=True)
        return np.concatenate([self.linear, *shapes], axis=1), np.concatenate(slopes, axis=1)

    def jacobian(self, theta: Array) -> Array:
        """Exact derivative of the modelled torque by theta, (n, p)."""
        linear, v_s = self.split(theta)
        design, slopes = self.columns(v_s)
        return np.concatenate([design, slopes * linear[self.linear.shape[1] :]], axis=1)

    def residuals(self, theta: Array) -> Array:
        """Measured minus modelled torque, (n,)."""
        linear, v_s = self.split(theta)
        modelled: Array = self.design(v_s) @ linear
        return self.torque - modelled

    def relative_error(self, theta: Array) -> float:
        """100 * norm(measured - modelled) / norm(measured), percent; nan for a torque of zero."""
        norm = float(np.linalg.norm(self.measured))
        return 100 * float(np.linalg.norm(self.residuals(theta))) / norm if norm else float("nan")

    def split(self, theta: Array) -> tuple[Array, Array]:
        """Linear part, (m + peaks,), and v_s, (peaks,), of theta."""
        count = theta.size - len(self.peaks)
        return theta[:count], theta[count:]

    def friction(self, theta: Array) -> Array:
        """Measured torque less the extra regressors, (n,)."""
        extra = [k for k, name in enumerate(self.linear_names) if not of_curve(name.name)]
        known: Array = self.linear[:, extra] @ theta[extra]
        return self.torque - known

    def with_torque(self, torque: Array) -> "Regression":
        """The same velocities with another torque, N*m, (n,)."""
        return replace(self, torque=torque.copy(), memory={})

    def rows(self, keep: NDArray[np.bool_]) -> "Regression":
        """The problem with some of its equations, by mask, (n,)."""
        return replace(
            self, velocity=self.velocity[keep] if self.smooth is None else self.velocity, torque=self.torque[keep],
            linear=self.linear[keep], smooth=None if self.smooth is None else self.smooth[np.flatnonzero(keep)],
            known=None if self.known is None else self.known[keep],
            shifts={name: shift[keep] for name, shift in self.shifts.items()},
            memory={key: tuple(table[keep] for table in tables) for key, tables in self.memory.items()},
        )  # fmt: skip  # a list of values

    def _columns(self, function: ca.Function, v_s: Array, peak: int) -> Tables:
        direction, smooth = self.peaks[peak], self.smooth
        if smooth is None:
            return self._raw(function, v_s, direction)
        key = (function, direction, v_s.tobytes(), self.shape)
        if key not in self.memory:
            # a few values of v_s at a time, to save memory
            parts = np.array_split(v_s, min(ceil(v_s.size * smooth.shape[1] / _AT_ONCE), v_s.size))
            by_v_s = [[np.asarray(smooth @ t) for t in self._raw(function, part, direction)] for part in parts]
            self.memory[key] = tuple(np.concatenate(columns, axis=1) for columns in zip(*by_v_s, strict=True))
        return self.memory[key]

    def _raw(self, function: ca.Function, v_s: Array, direction: str) -> Tables:
        rows = evaluate(function, self.velocity, v_s[:, None], *self.shape)  # a row per v_s: long inner loops
        if len(self.directions) == 2:
            moves = _moves(self.velocity, direction)
            rows = tuple(row * moves for row in rows)
        return tuple(row.T for row in rows)


def log_grid(v_s_range: tuple[float, float], grid: int) -> Array:
    """Values of v_s even in log(v_s), both ends included, (grid,)."""
    low, high = v_s_range
    return np.asarray(low * np.exp(np.arange(grid) * (np.log(high / low) / (grid - 1))))


def from_points(
    velocity: Array,
    torque: Array,
    directions: tuple[str, ...],
    extra: Mapping[str, Array] | None = None,
    shifts: Mapping[str, Array] | None = None,
    law: Law = GAUSSIAN,
    smooth: sparse.csr_array | None = None,
) -> Regression:
    """The problem (12) for points, rad/s and N*m, (n,), with extra columns and `shifts` by name."""
    names, shapes = ("alpha_0", "alpha_2", *law.coefficients), evaluate(linear_shapes_function(law), velocity)
    friction, sides, extra = dict[ParameterName, Array](), tuple(map(Direction, directions)), extra or {}
    for direction in sides:
        mask = None if len(sides) == 1 else _moves(velocity, direction)
        for name, shape in zip(names, shapes, strict=True):
            friction[ParameterName(name, direction)] = shape if mask is None else mask * shape
    columns = np.array([*friction.values(), *extra.values()]).T
    if smooth is not None:
        columns, torque = smooth @ columns, smooth @ torque
    return Regression(
        directions=sides, peaks=sides, velocity=velocity, torque=torque, linear=columns,
        linear_names=(*friction, *(ParameterName(name, Direction.SHARED) for name in extra)), law=law,
        shape=tuple(own.middle for own in law.peak.own), smooth=smooth, shifts=shifts or {},
    )  # fmt: skip  # a list of values


def from_records(
    records: Sequence[Record],
    directions: tuple[str, ...],
    regressors: Sequence[str],
    decimation: int,
    inertia: float | None = None,
    law: Law = GAUSSIAN,
    weights: Mapping[str, float] | None = None,
) -> tuple[Regression, tuple[Array, Array], int]:
    """The problem for moving data: both sides pass a zero-phase Butterworth filter to one sample in `decimation`.

    A known `inertia`, kg*m**2, is taken off; `weights` are coefficients of gravity and links where the level rises with
    load; None: those of the fit without a peak. Returns the problem, time (s from the start of its run) and position (rad, or
    empty) of each equation, and the samples dropped at ends. Raises InputError where a segment is too short or a signal
    is missing.
    """
    filters = [
        decimator([np.diff([*r.starts, r.time.size])], r.decimation(decimation), r.file, r.lost) for r in records
    ]
    smooth = sparse.csr_array(sparse.block_diag([matrix for matrix, _ in filters], format="csr"))
    dropped = sum(lost for _, lost in filters)
    velocity = np.concatenate([needed(r, "velocity") for r in records])
    torque = np.concatenate([needed(r, "torque") for r in records])

    def fitted(weights: Mapping[str, float]) -> Mapping[ParameterName, float]:
        """The linear parameters, without a peak, with these coefficients of gravity and links."""
        p = from_records(records, directions, regressors, decimation, inertia, weights=weights)[0]
        return p.named(bounded_least_squares(p.linear, p.torque, p.lower))

    if weights is None:
        weights = settled_weights(fitted) if levels_of(regressors) else {}
    columns = [
        extra_columns(regressors, r) | level_columns(r, regressors, r.decimation(decimation), weights) for r in records
    ]
    extra = {name: np.concatenate([of_record[name] for of_record in columns]) for name in columns[0]}
    shifts = {name: smooth @ shift for name, shift in torque_shifts(records).items()}
    built = from_points(velocity, torque, directions, extra, shifts, law, smooth)
    problem = replace(built, weights=weights, given=given_by(records))
    off = [x for r in records if (x := known_torque(r, inertia, regressors)) is not None]
    if off:
        known = smooth @ np.concatenate(off)
        problem = replace(problem, torque=problem.torque - known, known=known)
    time = smooth @ np.concatenate([r.time - r.time[0] for r in records])
    has_position = all(r.position is not None for r in records)
    position = smooth @ np.concatenate([needed(r, "position") for r in records]) if has_position else np.zeros(0)
    return problem, (time, position), dropped


def _moves(velocity: Array, direction: str) -> Array:
    return np.where(velocity > 0 if direction == "+" else velocity < 0, 1.0, 0.0)


def unknowns_of(problem: Regression, v_s_range: tuple[float, float]) -> Unknowns[ParameterName]:
    """The parameters in the order of `names`; a typical size is the torque over the column's largest entry."""
    torque, peaks = float(np.abs(problem.torque).max()) or 1.0, len(problem.peaks)
    columns = np.abs(problem.linear).max(axis=0)
    columns[columns == 0] = 1.0
    low, high = np.log(v_s_range)
    return Unknowns(
        names=problem.names, logarithmic=problem.logarithmic, least=problem.least,
        scale=np.concatenate([torque / columns, np.full(peaks, torque), np.ones(peaks)]),
        lower=np.concatenate([problem.lower, np.zeros(peaks), np.full(peaks, low)]),
        upper=np.concatenate([np.full(columns.size + peaks, np.inf), np.full(peaks, high)]),
    )  # fmt: skip  # a list of values

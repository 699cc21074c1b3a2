"""The moving problem: the measured velocity drives LuGre, which must explain the measured torque."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from operator import itemgetter
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.ndimage import minimum_filter1d

from bristle.arrays import Array
from bristle.data.differentiation import between_gaps
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.identification.load_levels import Load, levels_of, load_of
from bristle.identification.moving_runs import DIRECTIONS, decimator, extra_columns, given_by, known_torque
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.parameters import Direction, Lugre, Pair, ParameterName, fields_of, lugre_of
from bristle.model.rollout import AT_ONCE, rollout, rollout_into


class InitialState(NamedTuple):
    """An unknown initial state of a motion."""

    name: str
    motion: int

    def __str__(self) -> str:
        return f"{self.name}[{self.motion}]"


Unknown = ParameterName | InitialState
Values = Mapping[Any, float]  # of parameters, or of every unknown
_ROUGH = 4.0  # factor on the distance of nodes, where a hundredth of friction is near enough


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A segment between gaps, of N samples and n equations."""

    file: str
    time: Array  # s from the start of its run, (N,)
    velocity: Array  # rad/s, (N,)
    torque: Array  # Measured, less a fixed inertia's, N*m, (N,)
    extra: Array  # Columns of the extra regressors, (N, k)
    smooth: sparse.csr_array | None  # The decimation filter, (n, N), or None
    weight: Array = field(default_factory=lambda: np.ones(1))  # Factor on each residual, (n,) or (1,)
    measured: Array  # Measured torque, N*m, (N,)
    position: Array = field(default_factory=lambda: np.zeros(0))  # rad, (N,), or empty
    coarsening: float = 1.0  # As in `rollout`
    shifts: Mapping[str, Array] = field(default_factory=dict)
    """Change of the torque per standard error of each constant, N*m, (N,)."""
    load: Load | None = None
    """Load that the friction level rises with, (N,), or None; its coefficients have zero columns in `extra`."""

    @property
    def size(self) -> int:
        """Equations, n."""
        return int(self.time.size if self.smooth is None else self.smooth.shape[0])

    @property
    def step(self) -> Array:
        """Time between samples, s, (N - 1,)."""
        return np.diff(self.time)

    def smoothed(self, values: Array) -> Array:
        """Values at samples, (N,) or (N, k), as the equations see them, (n,) or (n, k)."""
        return values if self.smooth is None else np.asarray(self.smooth @ values)

    def weighted(self, values: Array) -> Array:
        """`smoothed`, times the weight."""
        return (self.weight * self.smoothed(values).T).T

    def rough(self) -> "Motion":
        """Means of samples away from reversals, five an equation or more, and fewer nodes: residuals are the same to 1 %."""
        count = 1 if self.smooth is None else self.time.size // (5 * self.size)
        if self.smooth is None or count < 2:
            return replace(self, coarsening=_ROUGH)
        block = np.arange(self.time.size) // count
        turns = np.bincount(block[1:], np.diff(np.sign(self.velocity)) != 0)
        alone = np.convolve(turns, np.ones(9))[4:-4] > 0  # up to four blocks from a reversal
        edges = np.flatnonzero(alone[block] | (np.diff(block, prepend=-1) > 0))
        share = np.diff(edges, append=self.time.size)

        def means(x: Array) -> Array:
            return np.add.reduceat(x, edges, axis=0) / share.reshape(-1, *[1] * (x.ndim - 1))

        of_mean = sparse.csr_array(
            (np.ones(self.time.size), np.repeat(np.arange(edges.size), share), np.arange(self.time.size + 1))
        )
        return replace(
            self, time=means(self.time), velocity=means(self.velocity), torque=means(self.torque), extra=means(self.extra),
            measured=means(self.measured), position=means(self.position) if self.position.size else self.position,
            smooth=self.smooth @ of_mean, coarsening=_ROUGH, shifts={}, load=None if self.load is None else self.load.through(means),
        )  # fmt: skip  # a list of values


@dataclass(frozen=True, slots=True)
class Prior:
    """A normal distribution of some parameters from another stage."""

    stage: str  # `static`, `presliding` or `experiment file`
    names: tuple[ParameterName, ...]
    value: Array  # (p,)
    root: Array  # Inverse Cholesky factor of the covariance, (p, p): `root @ (x - value)` scatters by one
    shifts: Mapping[str, Array] = field(default_factory=dict)
    """Change of `value` per standard error of each constant, (p,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DynamicProblem:
    """Nonlinear least squares of moving data."""

    motions: tuple[Motion, ...]
    directions: tuple[Direction, ...]  # `both`, or those of + and - with motion
    extra_names: tuple[ParameterName, ...]
    fixed: Mapping[ParameterName, float]  # Parameters that are not estimated
    law: Law = GAUSSIAN
    priors: tuple[Prior, ...] = ()
    sigma: float = 1.0  # Scatter of the residuals, N*m: the weight of priors
    count: float = 0.0  # Encoder count behind the velocity, rad, or 0
    cutoff: float = 0.0  # Of the low pass of the motion, Hz, or 0
    position_logged: bool = False  # In all runs
    stribeck: Literal["auto", "coulomb-viscous", "stribeck"] = "auto"  # As `fit.model`
    given: tuple[str, ...] = ()  # As in `Regression`

    def rough(self) -> "DynamicProblem":
        """The same over means of samples; a rough one is itself."""
        return self if self.is_rough else replace(self, motions=tuple(m.rough() for m in self.motions))

    @property
    def is_rough(self) -> bool:
        """Whether it is over means of samples, or over fewer nodes."""
        return any(m.coarsening != 1 for m in self.motions)

    @property
    def friction_names(self) -> tuple[ParameterName, ...]:
        """LuGre parameters by direction."""
        return tuple(ParameterName(name, d) for d in self.directions for name in fields_of(self.law))

    @property
    def names(self) -> tuple[Unknown, ...]:
        """Unknowns: free LuGre parameters, extra regressors, initial deflections."""
        every = (*self.friction_names, *self.extra_names)
        return (*(n for n in every if n not in self.fixed), *(InitialState("z0", k) for k in range(len(self.motions))))

    @property
    def size(self) -> int:
        """Equations, n."""
        return sum(m.size for m in self.motions)

    @property
    def fastest(self) -> float:
        """The largest speed, rad/s."""
        return max(float(np.abs(m.velocity).max()) for m in self.motions)

    @property
    def travel(self) -> float:
        """Largest way between two positions of a motion, rad."""
        return max(float(np.ptp(np.cumsum(m.velocity[1:] * m.step))) for m in self.motions)

    @property
    def stroke(self) -> float:
        """Longest way in one direction, rad, median of the motions."""
        strokes = []
        for m in self.motions:
            way = np.append(0.0, np.cumsum(m.velocity[1:] * m.step))
            turns = np.flatnonzero(np.diff(np.sign(m.velocity)))
            strokes.append(float(np.abs(np.diff(way[[0, *turns.tolist(), -1]])).max()))
        return float(np.median(strokes))

    @property
    def with_prior(self) -> frozenset[ParameterName]:
        """Parameters with a prior."""
        return frozenset(name for prior in self.priors for name in prior.names)

    @property
    def file(self) -> NDArray[np.str_]:
        """Run of each equation, (n,)."""
        return np.repeat([m.file for m in self.motions], [m.size for m in self.motions])

    @property
    def starts(self) -> tuple[int, ...]:
        """First equation of each segment between gaps."""
        return tuple(np.cumsum([0, *(m.size for m in self.motions[:-1])]).tolist())

    @property
    def weight(self) -> Array:
        """Factor on each residual, (n,)."""
        return np.concatenate([np.broadcast_to(m.weight, m.size) for m in self.motions])

    def with_weights(self, weight: Array) -> "DynamicProblem":
        """The same with this factor on each residual, (n,)."""
        parts = np.split(weight, self.starts[1:])
        return replace(self, motions=tuple(replace(m, weight=w) for m, w in zip(self.motions, parts, strict=True)))

    @property
    def turns(self) -> NDArray[np.bool_]:
        """Equations at a reversal or at rest, and their neighbours, (n,)."""
        speed = np.abs(self.velocity)
        slowest = minimum_filter1d(speed, 2 * levels.TURNING_BESIDE + 1)
        return np.asarray(slowest < levels.TURNING * np.sqrt(np.mean(speed**2)))

    @property
    def measured(self) -> Array:
        """Measured torque of each equation, N*m, (n,)."""
        return np.concatenate([m.smoothed(m.measured) for m in self.motions])

    @property
    def extent(self) -> float:
        """Norm of the measured torque."""
        return float(np.linalg.norm(self.measured))

    def percent(self, rows: Array) -> float:
        """100 * norm(rows) / extent, percent; nan without an extent."""
        extent = self.extent
        return float(100 * np.linalg.norm(rows) / extent) if extent > 0 else float("nan")

    @property
    def velocity(self) -> Array:
        """Of each equation, rad/s, (n,)."""
        return np.concatenate([m.smoothed(m.velocity) for m in self.motions])

    @property
    def position(self) -> Array:
        """Of each equation, rad, (n,); empty if not known throughout."""
        known = all(m.position.size for m in self.motions)
        return np.concatenate([m.smoothed(m.position) for m in self.motions]) if known else np.zeros(0)

    @property
    def time(self) -> Array:
        """Of each equation, s, (n,)."""
        return np.concatenate([m.smoothed(m.time) for m in self.motions])


def dynamic_problem(
    records: Sequence[Record],
    directions: tuple[str, ...],
    regressors: Sequence[str],
    decimation: int,
    inertia: float | None,
    fixed: Mapping[ParameterName, float] | None = None,
    law: Law = GAUSSIAN,
) -> DynamicProblem:
    """The problem of moving records, as `static.problem.from_records`. Raises InputError as that does."""
    motions: list[Motion] = []
    names: tuple[str, ...] = ()
    for record in records:
        spacing = record.decimation(decimation)
        load = load_of(record, regressors, spacing)
        extra = extra_columns(regressors, record) | dict.fromkeys(levels_of(regressors), np.zeros(record.time.size))
        names = tuple(extra)
        columns = np.column_stack(list(extra.values())) if extra else np.zeros((record.time.size, 0))
        if record.velocity is None or record.torque is None or (inertia is not None and record.acceleration is None):
            raise InputError(
                f"{record.file}: a tracking run needs position (or velocity) and torque; name them under signals"
            )
        if not record.velocity.any():
            raise InputError(
                f"{record.file}: at rest throughout; a tracking run needs motion in both directions, slow and fast"
            )
        known = known_torque(record, inertia, regressors)
        for part, smooth in _segments(record, spacing):
            motions.append(
                Motion(
                    file=record.file, time=record.time[part] - record.time[0], velocity=record.velocity[part],
                    torque=(record.torque if known is None else record.torque - known)[part], extra=columns[part],
                    smooth=smooth, measured=record.torque[part],
                    position=np.zeros(0) if record.position is None else record.position[part],
                    shifts={name: shift[part] for name, shift in record.torque_shifts.items()},
                    load=None if load is None else load.through(itemgetter(part)),
                )
            )  # fmt: skip  # a list of values
    fastest = dict[ParameterName, float]()
    for d in map(Direction, directions) if law.terms else ():  # fastest measured speeds
        along = (m.velocity * DIRECTIONS[d] if d in DIRECTIONS else np.abs(m.velocity) for m in motions)
        fastest[ParameterName(FASTEST, d)] = max(float(v.max()) for v in along)
    return DynamicProblem(
        motions=tuple(motions), directions=tuple(map(Direction, directions)),
        extra_names=tuple(ParameterName(name, Direction.SHARED) for name in names), fixed={**fastest, **(fixed or {})},
        law=law, given=given_by(records),
    )  # fmt: skip  # a list of values


def _segments(record: Record, spacing: int) -> Iterator[tuple[slice, sparse.csr_array | None]]:
    """Segments between gaps, and from rest to rest, each with the decimation filter of the equations centred on it."""
    for part in between_gaps(record):
        n = part.stop - part.start
        smooth, _ = decimator([np.array([n])], spacing, record.file, record.lost[part])
        centre, rests = smooth @ np.arange(n), np.searchsorted(record.time[part], record.rests)
        with_equations = np.unique(np.searchsorted(rests, centre, side="right"))
        for start, stop in pairwise([0, *rests[with_equations[1:] - 1].tolist(), n]):
            rows = smooth[(start <= centre) & (centre < stop)][:, start:stop]
            within = sparse.csr_array(sparse.diags_array(1 / rows.sum(axis=1)) @ rows)
            yield slice(part.start + start, part.start + stop), None if smooth.shape == (n, n) else within


def sets_of(problem: DynamicProblem, values: Values) -> dict[Direction, Lugre[float]]:
    """LuGre set of each direction."""
    known: Values = {**problem.fixed, **values}
    one = lugre_of(problem.law)
    return {d: one(*(known[ParameterName(name, d)] for name in one._fields)) for d in problem.directions}


def parameters(problem: DynamicProblem, values: Values) -> Lugre[float] | Pair[float]:
    """LuGre set, or pair of sets."""
    sets = sets_of(problem, values).values()
    return next(iter(sets)) if len(sets) == 1 else Pair(*sets)


def residuals(problem: DynamicProblem, values: Values, chain: Array | None = None) -> tuple[Array, Array]:
    """Measured less modelled, (n,), and its exact derivative by `names`, times `chain` (p,), without priors.

    Of the k parameters, and in a last column of the initial deflection of each equation's motion, (n, k + 1).
    """
    known: Values = {**problem.fixed, **values}
    names, k = problem.names, len(problem.names) - len(problem.motions)
    row_of = {name: min(j, k) for j, name in enumerate(names)}
    factor = dict(zip(names, (-np.ones(len(names)) if chain is None else -chain).tolist(), strict=True))
    left = np.empty(problem.size)
    slopes = np.zeros((k + 1, left.size))  # a row per parameter: long inner loops
    rows = pairwise((*problem.starts, left.size))
    for m, (first, stop), (rest, slope_of) in zip(problem.motions, rows, _equations(problem, known), strict=True):
        seen = [name for name in slope_of if name in row_of]
        columns = [rest, *(slope_of[name] for name in seen)]
        if m.smooth is not None:  # in one product, which is faster
            columns = list(np.asarray(m.smooth @ np.stack(columns, axis=1)).T)
        left[first:stop] = columns[0]
        for name, column in zip(seen, columns[1:], strict=True):
            np.multiply(column, factor[name], out=slopes[row_of[name], first:stop])
    return left, slopes.T


def _equations(problem: DynamicProblem, known: Values) -> Iterator[tuple[Array, dict[Unknown, Array]]]:
    """Of each motion measured less modelled torque, N*m, (N,), and the derivatives of the latter."""
    p, extra = parameters(problem, known), np.array([known[name] for name in problem.extra_names])
    keys = problem.friction_names
    for parts, raised, given in _rollout_groups(problem, known):
        rows = [*np.empty((len(keys) + len(raised) + 1, given["velocity"].size))]
        torque = rollout_into(rows, parameters=p, **given).torque
        for k, at in parts.items():
            m = problem.motions[k]
            slopes: dict[Unknown, Array] = {name: row[at] for name, row in zip(keys, rows, strict=False)}
            slopes[InitialState("z0", k)] = rows[-1][at]
            slopes |= dict(zip(problem.extra_names, m.extra.T, strict=True))
            slopes |= {name: slopes[name] + row[at] for name, row in zip(raised, rows[len(keys) : -1], strict=True)}
            yield m.torque - torque[at] - m.extra @ extra, slopes


def _rollout_groups(
    problem: DynamicProblem, known: Values
) -> Iterator[tuple[dict[int, slice], tuple[ParameterName, ...], dict[str, Any]]]:
    """Groups of motions for one rollout: slices by motion, parameters of the level, arguments of `rollout`."""
    sizes = np.array([m.velocity.size for m in problem.motions])
    group = (np.cumsum(sizes) - sizes) // AT_ONCE
    for members in np.split(np.arange(sizes.size), np.flatnonzero(np.diff(group)) + 1):
        which, stops = members.tolist(), np.cumsum(sizes[members])
        motions, begins = [problem.motions[k] for k in which], stops - sizes[members]
        friction, (raised, *_) = zip(*(_level(m, known) for m in motions), strict=True)
        yield (
            dict(zip(which, map(slice, begins.tolist(), stops.tolist()), strict=True)),
            raised,
            {
                "velocity": np.concatenate([m.velocity for m in motions]), "coarsening": motions[0].coarsening,
                "step": np.concatenate([x for m in motions for x in (m.step, [1.0])])[:-1], "begins": begins,
                "z0": np.array([known[InitialState("z0", k)] for k in which]),
                "level": None if friction[0] is None else np.hstack(friction),
            },
        )  # fmt: skip  # a list of values


def _level(motion: Motion, known: Values) -> tuple[Array | None, tuple[ParameterName, ...]]:
    """Rise of the level, N*m, with its derivatives, (1 + k, N), and their parameters; None and none without load."""
    load = motion.load
    if load is None:
        return None, ()
    both = (load.levels, load.weights)
    rising, weights = ([ParameterName(name, Direction.SHARED) for name in names] for names in both)
    rises, slopes = load.by({name.name: known[name] for name in weights})
    by = np.array([known[name] for name in rising])
    return np.vstack([by @ rises, rises, np.einsum("m,mkn->kn", by, slopes)]), (*rising, *weights)


def modelled(problem: DynamicProblem, values: Values) -> list[Array]:
    """Modelled torque at the samples of each motion, N*m, (N,) each."""
    known: Values = {**problem.fixed, **values}
    extra = np.array([known[name] for name in problem.extra_names])
    return [T + m.extra @ extra + (m.measured - m.torque) for m, T, _ in _frictions(problem, known)]


def _frictions(problem: DynamicProblem, known: Values) -> Iterator[tuple[Motion, Array, Array | None]]:
    """Each motion, its modelled friction, N*m, (N,), and its level as in `_level`."""
    p = parameters(problem, known)
    for parts, _, given in _rollout_groups(problem, known):
        level = given.pop("level")
        torque = rollout(parameters=p, level=None if level is None else level[0], **given).torque
        for k, at in parts.items():
            yield problem.motions[k], torque[at], None if level is None else level[:, at]


def friction_and_load(problem: DynamicProblem, values: Values) -> tuple[Array, Array]:
    """Modelled friction and load of each equation, N*m, (n,) each; the load is empty where there is none."""
    friction, carried = [np.zeros(0)], [np.zeros(0)]
    for m, T, level in _frictions(problem, {**problem.fixed, **values}):
        friction.append(m.smoothed(T))
        if level is not None:
            carried.append(m.smoothed(level[1]))
    return np.concatenate(friction), np.concatenate(carried)

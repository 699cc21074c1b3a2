"""Points at constant velocity as static problems, and their strays."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from bristle.arrays import Array, result
from bristle.data.constant_velocity.segments import Segment
from bristle.data.experiment.load import Experiment
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.score_test import scores
from bristle.findings import NOTE, Finding, unit_of
from bristle.identification.moving_runs import DIRECTIONS, declared, load_columns, terms_of
from bristle.identification.static.grid import default_range
from bristle.identification.static.problem import Regression, from_points
from bristle.identification.static.profiles import with_best_shape
from bristle.identification.static.strays import all_but, find_strays, refit
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law


@result
class PointSearch:
    """The strays of one solve."""

    sides: tuple[str, ...]  # Directions of the solve
    points: tuple[Segment, ...]
    problem: Regression  # Of all points
    strays: tuple[int, ...] = ()  # Sliding points off the law, the one that lowers the cost most first
    resting: tuple[int, ...] = ()  # Slow points below breakaway
    matter: bool = False  # Whether the curve moves without them
    apart: bool = True  # Whether strays are few and isolated; others show a term that the law lacks
    misfit: bool = False  # Whether there are more strays than allowed
    expected: Array  # Torque of the law of the others, N*m, (n,)

    @property
    def left_out(self) -> tuple[int, ...]:
        """Strays to leave out."""
        return self.strays if self.matter and self.apart and not self.misfit else ()

    @property
    def sliding(self) -> NDArray[np.bool_]:
        """Mask of points that slide, (n,)."""
        return all_but(len(self.points), self.resting)

    @property
    def kept(self) -> NDArray[np.bool_]:
        """Mask of points on the law, (n,)."""
        return all_but(len(self.points), (*self.resting, *self.strays))


def sliding_points(searches: Sequence[PointSearch]) -> list[Segment]:
    """All points but those at rest."""
    return [s for x in searches for s, slides in zip(x.points, x.sliding.tolist(), strict=True) if slides]


def search_points(experiment: Experiment, points: Sequence[Segment], law: Law | None = None) -> tuple[PointSearch, ...]:
    """The strays of each solve, under the experiment's law or another."""
    asked, law = point_regressors(experiment), law or experiment.fit.friction
    found = tuple(_search(sides, group, asked, law) for sides, group in groups(experiment, points))
    few = sum(len(x.strays) for x in found) <= max(levels.STRAYS * len(points), 1)
    return tuple(replace(x, apart=few and x.apart) for x in found)


def strays_under_all(
    experiment: Experiment, searches: Sequence[PointSearch], laws: Sequence[Law]
) -> frozenset[tuple[str, int, int]]:
    """Places of the points that are strays under all laws: under one alone the law may lack a term."""
    places, points = None, sliding_points(searches)
    for found in chain([searches], (search_points(experiment, points, law) for law in laws)):
        own = frozenset(x.points[k].place for x in found if not x.misfit for k in x.strays)
        places = own if places is None else places & own
        if not places:
            break
    return places or frozenset()


def _search(sides: tuple[str, ...], points: tuple[Segment, ...], asked: Sequence[str], law: Law) -> PointSearch:
    problem = points_problem(points, sides, asked, law)
    problem = with_best_shape(problem, default_range(problem.velocity))
    n, resting = len(points), _resting(problem)
    sliding = all_but(n, resting)
    search = find_strays(problem.rows(sliding))
    strays = tuple(np.flatnonzero(sliding)[list(search.rows)].tolist())
    found = PointSearch(
        sides=sides, points=points, problem=problem, strays=strays, resting=resting, misfit=search.misfit,
        expected=problem.torque,
    )  # fmt: skip  # a list of values
    if not (resting or strays):
        return found
    # points within the scatter of their own standard errors are no strays
    out, sure = () if search.misfit else strays, ndtri(1 - levels.SIGNIFICANCE / (2 * n))
    off = _off_the_others(problem, (*resting, *out))
    out = tuple(k for k in out if not abs(off[k]) <= sure * (points[k].standard_error or 0.0))
    strays = strays if search.misfit else out
    expected = problem.torque - _off_the_others(problem, (*resting, *out))
    moved = problem.torque[sliding] - refit(problem.rows(sliding)).residuals - expected[sliding]
    # isolated: no three neighbours in order of velocity, none at an end
    among = np.pad(
        np.isin(np.argsort(problem.velocity), strays).astype(float), levels.NEIGHBOURS - 1, constant_values=1.0
    )
    return replace(
        found, strays=strays, expected=expected, matter=bool((np.abs(moved) > levels.MATTERS * np.abs(expected[sliding])).any()),
        apart=bool(among.size < levels.NEIGHBOURS or np.convolve(among, np.ones(levels.NEIGHBOURS)).max() < levels.NEIGHBOURS),
    )  # fmt: skip  # a list of values


def _off_the_others(problem: Regression, rows: Sequence[int]) -> Array:
    """Torque less that of the law of all other points, N*m, (n,)."""
    return problem.residuals(refit(problem.rows(all_but(problem.torque.size, rows))).theta)


def _resting(problem: Regression) -> tuple[int, ...]:
    """The slowest points (at most a third) with friction far below alpha_0 of the faster ones, by a score test."""
    speed, sign = np.abs(problem.velocity), np.sign(problem.velocity)
    ends = np.unique(speed[speed > 0])
    ends = ends[: ends.size // 3]
    if not ends.size or speed.size <= len(problem.names) + 2:
        return ()
    theta = refit(problem).theta
    order = np.argsort(problem.velocity, kind="stable")
    steps = [(sign * (speed <= x))[order, None] for x in ends]
    found = scores(problem.jacobian(theta)[order], problem.residuals(theta)[order], steps)
    best = int(np.argmax([x.share for x in found]))
    if not (found[best].p * ends.size < levels.SIGNIFICANCE and found[best].sizes[0] < 0):
        return ()
    rows = np.flatnonzero(speed <= ends[best])
    law = refit(problem.rows(all_but(speed.size, rows.tolist())))
    coulomb = [x for name, x in problem.named(law.theta).items() if name.name == "alpha_0"]
    friction = float(np.mean((sign * problem.friction(law.theta))[rows]))
    return tuple(rows.tolist()) if friction < levels.NOT_SLIDING * min(coulomb, default=0.0) else ()


def without_strays(experiment: Experiment, searches: Sequence[PointSearch]) -> Iterator[Segment]:
    """The points to leave out, each with the reason."""
    dropped = experiment.fit.drops_strays
    for search in searches:
        for k in search.resting:
            s = search.points[k]
            speed, expected = abs(s.velocity), float(search.expected[k])
            message = (
                f"Below breakaway: at {speed:.3g}{unit_of('velocity')} its torque is {s.torque:.4g}{unit_of('torque')}, and that of the "
                f"sliding points around it {expected:.4g}{unit_of('torque')}; leave it out, or measure there for longer."
            )
            numbers = {"speed": speed, "torque": s.torque, "expected": expected}
            reason = Finding("below-breakaway", NOTE, message, numbers)
            yield replace(s, accepted=False, reasons=(reason,))
        for k in search.left_out if dropped else ():
            off = search.points[k].torque - float(search.expected[k])
            message = (
                f"Off the law of the others by {off:.2g}{unit_of('torque')}; fit.set_up: as-written would make it pass."
            )
            reason = Finding("stray-dropped", NOTE, message, {"off": off})
            yield replace(search.points[k], accepted=False, reasons=(reason,))


def point_regressors(experiment: Experiment) -> tuple[str, ...]:
    """Regressors of the points: as asked for, without the inertia."""
    return tuple(name for name in declared(experiment) or () if name != "inertia")


def groups(
    experiment: Experiment, points: Sequence[Segment]
) -> tuple[tuple[tuple[str, ...], tuple[Segment, ...]], ...]:
    """The points of each solve, with its directions."""
    if experiment.fit.directions == "symmetric":
        return ((("both",), tuple(points)),) if points else ()
    apart = [((d,), tuple(s for s in points if s.velocity * sign > 0)) for d, sign in DIRECTIONS.items()]
    present = [(sides, group) for sides, group in apart if group]
    if point_regressors(experiment) and len(present) == 2:  # shared regressors need one solve
        return ((tuple(DIRECTIONS), tuple(points)),)
    return tuple(present)


def points_problem(
    points: Sequence[Segment], sides: tuple[str, ...], asked: Sequence[str], law: Law = GAUSSIAN
) -> Regression:
    """The regression of some points. Raises InputError where a regressor needs a position and a point has none."""
    placed = [name.partition("_")[0] for name in asked if "position" in terms_of(name).needs]
    if placed and any(s.position is None for s in points):
        raise InputError(
            f"fit.regressors: {placed[0]} needs the position of every point; add position under signals, or leave {placed[0]} out"
        )

    def signal(name: str) -> Array:
        return np.array([getattr(s, name) for s in points], dtype=float)

    velocity, torque, middles = signal("velocity"), signal("torque"), load_columns(asked, signal, len(points))
    extra = {
        name: np.array([s.loads.get(name, x) for s, x in zip(points, middle, strict=True)])
        for name, middle in middles.items()
    }
    names = dict.fromkeys(name for s in points for name in s.torque_shifts)
    shifts = {name: np.array([s.torque_shifts.get(name, 0.0) for s in points]) for name in names}
    return from_points(velocity, torque, sides, extra, shifts, law)

"""A static fit from velocity-torque points: their regression, direction by direction or of both, and the runs held out."""

from collections.abc import Sequence

import numpy as np

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.errors import InputError
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import DIRECTIONS, gravity, refuse_opposing
from bristle.identification.results import Crosscheck, StaticFit
from bristle.identification.static import problem
from bristle.identification.static.fit import PointInfo, fit_static
from bristle.identification.static.problem import Regression


def fit_points(
    measured: Measured, points: Sequence[Segment], timings: dict[str, float] | None
) -> tuple[dict[str, StaticFit], dict[str, Crosscheck]]:
    """Static parameters and the declared regressors from points at constant velocity: fits and cross-checks.

    Raises InputError where a regressor needs what points do not have, or torque opposes velocity.
    """
    experiment = measured.experiment
    regressors = tuple(experiment.fit.regressors or ())
    if measured.moving(hold_out=False):  # which can tell the inertia, as points cannot
        regressors = tuple(r for r in regressors if r != "inertia")
    if "inertia" in regressors:
        raise InputError(
            f"{experiment.path.name}: fit.regressors: inertia needs acceleration, which constant-velocity points do not have; "
            "leave it out, or give the runs as experiment: tracking"
        )
    held = measured.points(hold_out=True)
    static: dict[str, StaticFit] = {}
    checks: dict[str, Crosscheck] = {}
    for d, sign in DIRECTIONS.items() if not regressors else ():
        v, T = (np.array([getattr(s, x) for s in points if s.velocity * sign > 0]) for x in ("velocity", "torque"))
        refuse_opposing(experiment, v, T, f"at the {v.size} points of direction {d}")
    for directions, group in _groups(points, regressors, symmetric=experiment.fit.directions == "symmetric"):
        signs = [DIRECTIONS[d] for d in directions if d in DIRECTIONS] or list(DIRECTIONS.values())
        by_file = {s.file: [h for h in held if h.file == s.file and np.sign(h.velocity) in signs] for s in held}
        tests = [(file, points_problem(s, directions, regressors)) for file, s in by_file.items() if s]
        fits, checked = fit_static(
            points_problem(group, directions, regressors),
            experiment.fit,
            experiment.joint.kind,
            _point_info(group),
            tests,
            timings,
        )
        static |= fits
        checks |= checked
    return static, checks


def _groups(
    points: Sequence[Segment], regressors: Sequence[str], *, symmetric: bool
) -> list[tuple[tuple[str, ...], tuple[Segment, ...]]]:
    """The points of each solve, with the directions that it is of."""
    if symmetric:
        return [(("both",), tuple(points))]
    groups = [((d,), tuple(s for s in points if s.velocity * sign > 0)) for d, sign in DIRECTIONS.items()]
    present = [(directions, group) for directions, group in groups if group]
    if regressors and len(present) == 2:  # what both directions share comes from one solve
        return [(tuple(DIRECTIONS), tuple(points))]
    return [*present]


def points_problem(points: Sequence[Segment], directions: tuple[str, ...], regressors: Sequence[str]) -> Regression:
    """The regression of some points in these directions, with an offset or gravity where asked for.

    Raises InputError where gravity is asked for and a point has no position.
    """
    extra: dict[str, Array] = {}
    if "offset" in regressors:
        extra["offset"] = np.ones(len(points))
    if "gravity" in regressors:
        if any(s.position is None for s in points):
            raise InputError(
                "fit.regressors: gravity needs the position of every point; add position under signals, or leave gravity out"
            )
        extra |= gravity(np.array([s.position for s in points], dtype=float))
    velocity, torque = np.array([s.velocity for s in points]), np.array([s.torque for s in points])
    return problem.from_points(velocity, torque, directions, extra)


def _point_info(points: Sequence[Segment]) -> PointInfo:
    def known(values: list[float | None]) -> Array:
        """The values, or none of them where any is missing."""
        return np.zeros(0) if any(x is None for x in values) else np.array(values, dtype=float)

    alone = len({s.file for s in points})  # a run of one point has no course over time
    return PointInfo(
        segments=tuple(points),
        time=known([s.time for s in points]) if alone < len(points) else np.zeros(0),
        position=known([s.position for s in points]),
    )

"""What is said of points that do not belong to the law: how far off they are, and what the fit becomes without them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bristle.data.experiment.schema import FitOptions
from bristle.findings import Finding
from bristle.identification.fits import Estimate, OtherPoints, StaticFit, Stray
from bristle.identification.messages import Kind, but
from bristle.identification.moving_runs import DIRECTIONS
from bristle.identification.static.points import PointSearch
from bristle.identification.static.solution import StaticSolution, solve_static
from bristle.identification.static.strays import SINGLY, most_strays
from bristle.model.parameters import Direction
from bristle.model.parameters import Kind as JointKind

_LISTED = 50
"""Points that a warning names; of more it says how many there are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StrayReport:
    """What is said of the points of one solve that do not belong to its law."""

    strays: tuple[Stray, ...] = ()
    other: Mapping[Direction, OtherPoints] = field(default_factory=dict)
    """The fit with another choice of points, by direction."""
    warnings: tuple[Finding, ...] = ()

    def of(self, part: Direction) -> tuple[Stray, ...]:
        """Those of a direction; all of what both share."""
        return tuple(stray for stray in self.strays if DIRECTIONS.get(part, 0.0) * stray.velocity >= 0)


def report_strays(
    core: StaticSolution, search: PointSearch | None, options: FitOptions, kind: JointKind
) -> StrayReport:
    """The strays of a solve, and the fit without them, or with them where they are left out.

    Args:
        core: the fit.
        search: which of its points do not belong; None: nobody looked.
        options: the experiment's `fit`.
        kind: for units.
    """
    if search is None:
        return StrayReport()
    side = search.sides[0] if len(search.sides) == 1 else ""
    warnings = []
    if search.resting:
        resting = _listed(search, search.resting)
        warnings.append(Kind.RESTING_LEFT_OUT(count=len(search.resting), direction=side, points=resting))
    named = _listed(search, search.strays)
    if search.misfit:
        warnings.append(
            Kind.MISFIT(direction=side, most=most_strays(search.problem), count=len(search.points), points=named)
        )
    if search.misfit or not named:
        return StrayReport(warnings=tuple(warnings))
    dropped = options.drops_strays and bool(search.left_out)
    second = solve_static(search.problem.rows(search.sliding if dropped else search.kept), options, kind)
    strays = tuple(_stray(search, k, options, kind) for k in search.strays)
    values = _values(core, second)
    numbers = {"values": values, "error": _relative_error(second), "now": _relative_error(core)}
    moved = _moved(core, second)
    said = {"count": len(search.strays), "points": named}
    if dropped:
        warning = Kind.STRAYS_LEFT_OUT(**said, other=Kind.WITH_STRAYS(**numbers))
    else:
        said |= {"other": Kind.WITHOUT_STRAYS(**numbers), "advice": _advice(search, options)}
        warning = Kind.STRAYS_MATTER(**said, moved=moved) if moved and search.matter else Kind.STRAYS(**said)
    parts = search.problem.directions
    return StrayReport(strays=strays, other={d: _other_points(second, d) for d in parts}, warnings=(*warnings, warning))


def _advice(search: PointSearch, options: FitOptions) -> Finding:
    """What to do about strays that are not left out."""
    if not options.drops_strays:
        return Kind.TO_LEAVE_OUT()
    speed = np.abs([s.velocity for s in search.points])
    side = np.sign([s.velocity for s in search.points])
    own = list(search.strays)
    others = np.delete(speed, [*own, *search.resting])
    weaker = all(side[k] * search.deviations[k] < 0 for k in own)
    if others.size and weaker and speed[own].max() < others.min():
        return Kind.FALLS_OFF(speed=float(others.min()))
    return Kind.NOT_STRAYS()


def advised(fit: StaticFit) -> StaticFit:
    """The fit, whose strays are not to be left out before a term is added that explains more of what it leaves than they do."""
    explained = [_share(w.numbers) for w in fit.warnings if w.code == "lacks-a-term"]
    if not explained:
        return fit
    return replace(
        fit,
        warnings=tuple(
            but(w, advice=Kind.TERM_FIRST())
            if w.code in {"strays", "strays-matter"} and _share(w.numbers["other"].numbers) < max(explained)
            else w
            for w in fit.warnings
        ),
    )


def _share(x: Mapping[str, Any]) -> float:
    """Of the squares that a fit leaves, what a change of it explains; all where it predicts parts held out, which strays do not make it do."""
    if "asked" in x:
        return 1.0
    return float(x["share"] if "share" in x else 1 - (x["error"] / x["now"]) ** 2)


def _listed(search: PointSearch, rows: Sequence[int]) -> tuple[Finding | str, ...]:
    """The first points by name, and how many there are beside them."""
    rest = len(rows) - _LISTED
    return (*(_named(search, k) for k in rows[:_LISTED]), *([f"and {rest} more"] if rest > 0 else []))


def _named(search: PointSearch, k: int) -> Finding:
    s = search.points[k]
    file, where = s.subject
    number = {"file": file, "where": where, "torque": s.torque, "velocity": s.velocity}
    off = search.deviations[k]
    return Kind.STRAY_POINT(**number, deviations=off) if off else Kind.POINT_NAMED(**number)


def _stray(search: PointSearch, k: int, options: FitOptions, kind: JointKind) -> Stray:
    """One stray, and what the parameters become without it alone."""
    s = search.points[k]
    file, where = s.subject
    own = dict[str, Estimate]()
    if len(search.points) <= SINGLY:
        keep = search.sliding
        keep[k] = False
        alone = solve_static(search.problem.rows(keep), options, kind)
        own = {n.name: e for n, e in alone.parameters.items() if DIRECTIONS.get(n.direction, 0.0) * s.velocity >= 0}
    return Stray(
        file=file, where=where, velocity=s.velocity, torque=s.torque, deviations=float(search.deviations[k]),
        without={name: e.value for name, e in own.items() if e.value is not None},
    )  # fmt: skip  # a list of values


def _relative_error(solved: StaticSolution) -> float:
    return solved.problem.relative_error(solved.solution.theta)


def _values(core: StaticSolution, second: StaticSolution) -> tuple[Finding, ...]:
    """The second fit's parameters, each with its error."""
    return tuple(
        Kind.PARAMETER_WITH_ERROR(name=core.problem.text(name), value=e.value, error=e.standard_error)
        if e.standard_error
        else Kind.PARAMETER_VALUE(name=core.problem.text(name), value=e.value)
        for name, e in second.parameters.items()
        if e.value is not None
    )


def _moved(core: StaticSolution, second: StaticSolution) -> tuple[str, ...]:
    """Parameters that differ by more than a standard error of the fit, or that one of the two does not identify."""
    names = dict.fromkeys((*core.parameters, *second.parameters))
    return tuple(core.problem.text(n) for n in names if _differ(core.parameters.get(n), second.parameters.get(n)))


def _differ(one: Estimate | None, other: Estimate | None) -> bool:
    if one is None or other is None or one.value is None or other.value is None:
        return True
    return abs(one.value - other.value) > (one.standard_error or 0.0)


def _other_points(solved: StaticSolution, part: Direction) -> OtherPoints:
    """The second fit's part of one direction."""
    problem, theta = solved.problem, solved.solution.theta
    one = len(problem.directions) == 1
    rows = np.ones(problem.torque.size, bool) if one else problem.velocity * DIRECTIONS[part] > 0
    residuals = problem.residuals(theta)[rows]
    norm = float(np.linalg.norm(problem.measured[rows]))
    return OtherPoints(
        n=int(rows.sum()),
        rms=float(np.sqrt(np.mean(residuals**2))),
        relative_error=100 * float(np.linalg.norm(residuals)) / norm if norm else float("nan"),
        parameters={n.name: e for n, e in solved.estimates.items() if one or n.direction is part},
    )

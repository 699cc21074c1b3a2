"""What is said of points that do not belong to the law: how far off they are, and what the fit becomes without them."""

from collections.abc import Mapping, Sequence

import numpy as np

from bristle.data.experiment.schema import FitOptions
from bristle.findings import CAUTION, NOTE, Finding, in_direction, in_units, unit_of
from bristle.identification.fits import Estimate, OtherPoints, Stray
from bristle.identification.moving_runs import DIRECTIONS
from bristle.identification.static.points import PointSearch
from bristle.identification.static.solution import StaticSolution, apart, solve_static
from bristle.identification.static.strays import SINGLY, most_strays
from bristle.model.parameters import Direction, Kind

_LISTED = 50  # points that a warning names; of more it says how many there are


def report_strays(
    core: StaticSolution, search: PointSearch | None, options: FitOptions, kind: Kind
) -> tuple[tuple[Stray, ...], Mapping[Direction, OtherPoints], tuple[Finding, ...]]:
    """The strays of a solve; by direction the fit without them, or with them where they are left out; and what is said of both.

    `search` says which points do not belong; None: nobody looked.
    """
    if search is None:
        return (), {}, ()
    side = search.sides[0] if len(search.sides) == 1 else ""
    warnings = []
    if search.resting:
        count, named = len(search.resting), _listed(search, search.resting)
        message = f"{_points(count)} below breakaway left out{in_direction(side)}: {'; '.join(named)}; the joint does not slide there."
        numbers = {"count": count, "direction": side, "points": _told(named)}
        warnings.append(Finding("resting-left-out", NOTE, message, numbers))
    named = _listed(search, search.strays)
    if search.misfit:
        most, count = most_strays(search.problem), len(search.points)
        message = (
            f"The law does not fit{in_direction(side)}: more than {most} of {count} points would have to be left out, "
            f"{'; '.join(named)} first. Look at the residuals for what is missing; `exclude` under fit leaves out points that you know "
            "to be faulty."
        )
        numbers = {"direction": side, "most": most, "count": count, "points": _told(named)}
        left = core.problem.residuals(core.solution.theta)
        warnings.append(Finding("misfit", CAUTION, message, numbers, {"torque": float(np.sqrt(np.mean(left**2)))}))
    if search.misfit or not named:
        return (), {}, tuple(warnings)
    dropped = options.drops_strays and bool(search.left_out)
    second = solve_static(search.problem.rows(search.sliding if dropped else search.kept), options, kind)
    strays = tuple(_stray(search, k, options, kind) for k in search.strays)
    error, now = (x.problem.relative_error(x.solution.theta) for x in (second, core))
    values = []
    for name, estimate in second.parameters.items():
        if estimate.value is not None:
            text = core.problem.text(name)
            off = f" +/- {estimate.standard_error:.2g}" if estimate.standard_error else ""
            values.append(f"{text} {estimate.value:.4g}{off}{unit_of(text)}")
    other = f"{', '.join(values)}; relative error {error:.2g} % instead of {now:.2g} %."
    names = dict.fromkeys((*core.parameters, *second.parameters))
    # by more than a standard error, or one of the two is not identified
    ours, theirs = ({n: e.value for n, e in x.parameters.items() if e.value is not None} for x in (core, second))
    errors = {n: core.parameters[n].standard_error or 0.0 for n in ours}
    alike = {n for n in ours.keys() & theirs.keys() if abs(ours[n] - theirs[n]) <= errors[n]}
    moved = tuple(core.problem.text(n) for n in names if n not in alike)
    numbers = {"count": len(search.strays), "points": _told(named)}
    message = f"{_points(len(search.strays))} off the law of the others"
    if dropped:
        other = f"With: {other}"
        message = f"{message}, left out: {'; '.join(named)}. {other} To keep, write `set_up: as-written` under fit."
        numbers |= {"other": in_units(other, {})}
        warning = Finding("strays-left-out", CAUTION, message, numbers)
    else:
        other = f"Without: {other}"
        advice = _advice(search, options)
        message = f"{message}: {'; '.join(named)}. {other}"
        numbers |= {"other": in_units(other, {}), "advice": in_units(advice, {})}
        if moved and search.matter:
            message = f"{message} That is more than one standard error of {', '.join(moved)}. {advice}"
            warning = Finding(
                "strays-matter", CAUTION, message, {**numbers, "moved": moved}, {"torque": apart(core, second)}
            )
        else:
            warning = Finding("strays", CAUTION, f"{message} {advice}", numbers)
    parts = search.problem.directions
    return strays, {d: _other_points(second, d) for d in parts}, (*warnings, warning)


def _advice(search: PointSearch, options: FitOptions) -> str:
    """What to do about strays that are not left out."""
    if not options.drops_strays:
        return "To leave out, leave `set_up: as-written` out."
    speed = np.abs([s.velocity for s in search.points])
    side = np.sign([s.velocity for s in search.points])
    own = list(search.strays)
    others = np.delete(speed, [*own, *search.resting])
    weaker = all(side[k] * search.deviations[k] < 0 for k in own)
    if others.size and weaker and speed[own].max() < others.min():
        slowest = f"{others.min():.3g}{unit_of('velocity')}"
        return (
            f"They are the slowest, and have less friction than the law: below {slowest} it falls towards 0, as a regularised "
            f"law does, or they do not slide. Write `segments: {{minimum_velocity: {slowest}}}` to leave them out."
        )
    return "They stay: neighbours, the ends of the range, or more than a tenth of the points are not strays, but show what the law lacks."


def _points(count: int) -> str:
    return f"{count} point{'' if count == 1 else 's'}"


def _told(points: Sequence[str]) -> tuple[str, ...]:
    """Points by name, as they are where no unit is known."""
    return tuple(in_units(point, {}) for point in points)


def _listed(search: PointSearch, rows: Sequence[int]) -> tuple[str, ...]:
    """The first points by name, and how many there are beside them."""
    named, rest = list[str](), len(rows) - _LISTED
    for k in rows[:_LISTED]:
        s = search.points[k]
        file, where = s.subject
        off = f", {search.deviations[k]:+.0f} standard deviations off" if search.deviations[k] else ""
        named.append(
            f"{file} {where} ({s.torque:.4g}{unit_of('torque')} at {s.velocity:.3g}{unit_of('velocity')}{off})"
        )
    return (*named, *([f"and {rest} more"] if rest > 0 else []))


def _stray(search: PointSearch, k: int, options: FitOptions, kind: Kind) -> Stray:
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

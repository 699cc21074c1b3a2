"""Friction laws on the same equations: which one the data want, by BIC and by speeds that were left out.

The paper's law is left only for one whose BIC is lower by more than 10, and whose squared error over five blocks of
speed, each left out in turn, is lower too: BIC alone takes up what the scatter looks like, an error at speeds that were
left out alone what happens to lie at one end. Each law has a Stribeck term in every direction: whether the data show
one is the fit's to say.

With the equations of each solve, n of them of which n' are independent, and k parameters, the noise variance among
them, a law's BIC is the sum of n' log(RSS / n) + k log(n'). Its weight is exp(-BIC / 2) over the sum of all (Burnham
and Anderson, Model Selection and Multimodel Inference, 2002), and so is the average of a parameter over laws: its
variance is what each law leaves open, and how far it lies from the average.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import or_
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.record import Record
from bristle.diagnostics import Diagnostic, Kind
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.covariance import covariance, student
from bristle.identification.fits import StaticFit
from bristle.identification.measured import Measured
from bristle.identification.model_criteria import power_of, scores
from bristle.identification.moving_runs import directions, inertia, regressors
from bristle.identification.results import Averaged, LawComparison, LawRow
from bristle.identification.static.grid import Solution, default_range, solve
from bristle.identification.static.points import groups, point_regressors, points_problem
from bristle.identification.static.problem import Regression, from_records
from bristle.identification.static.shape_search import with_best_shape
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.laws.registry import competing
from bristle.model.parameters import ParameterName

GAIN = 10.0
"""Of BIC, by which another law has to be better than the paper's."""
BLOCKS = 5
"""Of speed, each left out in turn."""
_SPREAD = 0.95
"""A law with less than this of the weights is not the only one that the data allow."""
_AVERAGED = ("alpha_0", "alpha_1", "alpha_2")
"""What means the same in every law: v_s does not."""
_WORTH = 1e-3
"""A law with a smaller weight does not move an average."""
_STICKS_OUT = 0.1
"""Of an interval's width."""

Pose = Callable[[Law], Sequence[Regression]]
"""The solves of a law, the same equations for every law."""


@dataclass(frozen=True, slots=True)
class _Fitted:
    """A law fitted to every solve."""

    law: Law
    problems: tuple[Regression, ...]
    solutions: tuple[Solution, ...]

    @property
    def residuals(self) -> Array:
        """Of every equation, (n,)."""
        return np.concatenate([solution.residuals for solution in self.solutions])

    @property
    def count(self) -> int:
        """Parameters."""
        return sum(len(problem.names) + len(problem.shape) for problem in self.problems)


def laws_of(measured: Measured, in_force: Law) -> LawComparison | None:
    """The laws on what an experiment measured: its points without those that do not belong, or else its moving runs.

    None where there are too few equations, or the moving runs are not about a torque. Raises InputError as the fits do.
    """
    experiment, options = measured.experiment, measured.experiment.fit
    points = measured.points(hold_out=False)
    if points:
        asked, stray = point_regressors(experiment), {s.points[k].place for s in measured.searches for k in s.strays}
        chosen = groups(experiment, [s for s in points if s.place not in stray])

        def pose(law: Law) -> Sequence[Regression]:
            """The points of each solve."""
            return [points_problem(group, sides, asked, law) for sides, group in chosen]

        return compare_laws("points", pose, in_force, options.v_s_range)
    records = measured.moving(hold_out=False)
    if not records or options.predict != "torque":
        return None
    sides, asked, (fixed, _) = directions(experiment, records), regressors(experiment), inertia(experiment)

    def pose_motion(some: Sequence[Record], law: Law) -> Sequence[Regression]:
        """The moving runs as one solve."""
        whole = from_records(some, sides, asked, options.decimation, fixed, law)[0]
        speed = options.moving_above
        return [whole if speed is None else whole.rows(np.abs(whole.equation_velocity) > speed)]

    runs = [partial(pose_motion, [record]) for record in records] if len(records) > 1 else []
    return compare_laws("moving runs", partial(pose_motion, records), in_force, options.v_s_range, runs)


def law_warnings(laws: LawComparison | None) -> tuple[Diagnostic, ...]:
    """That another law is clearly better than the one in force, with the line to write."""
    if laws is None:
        return ()
    own, best = next(row for row in laws.rows if row.in_force), laws.chosen
    clearly = own.bic - best.bic > GAIN and (best.left_out or np.inf) < (own.left_out or 0.0)
    if best.in_force or not clearly:
        return ()
    return (
        Kind.OTHER_LAW(law=best.law, own=own.law, gain=own.bic - best.bic, error=best.left_out, before=own.left_out),
    )


def with_averages(fits: Mapping[str, StaticFit], laws: LawComparison | None) -> dict[str, StaticFit]:
    """The fits of a law that the data chose; each estimate beside which other laws allow more says so."""
    out = dict(fits)
    for name, over in (laws.averaged if laws is not None else {}).items():
        fit = out.get(name.direction)
        e = (
            fit.parameters.get(name.name) if fit is not None and not fit.strays else None
        )  # with strays it is of other points
        if fit is not None and e is not None and e.interval is not None and _beyond(over.interval, e.interval):
            why = Kind.OVER_LAWS(low=over.interval[0], high=over.interval[1], unit=e.unit)
            told = replace(e, warnings=(*e.warnings, why))
            out[name.direction] = replace(fit, parameters={**fit.parameters, name.name: told})
    return out


def _beyond(over: tuple[float, float], own: tuple[float, float]) -> bool:
    """Whether one interval sticks out of another by a tenth of its width."""
    room = _STICKS_OUT * (own[1] - own[0])
    return over[0] < own[0] - room or over[1] > own[1] + room


def compare_laws(
    data: Literal["points", "moving runs"],
    pose: Pose,
    in_force: Law,
    v_s_range: tuple[float, float] | None,
    runs: Sequence[Pose] = (),
) -> LawComparison | None:
    """The laws that compete, and the one in force, on the same equations; None where there are too few for any other than the paper's.

    Args:
        data: what the equations are about.
        pose: poses them for a law.
        in_force: the law of the fits.
        v_s_range: where v_s is searched, rad/s; None: from the speeds.
        runs: of moving data each run alone; where there are several, each is left out in turn as well.
    """
    every = {law.name: law for law in (*competing(), in_force)}
    fitted = [x for law in every.values() if (x := _fitted(law, pose(law), v_s_range)) is not None]
    if not any(x.law == GAUSSIAN for x in fitted) or len(fitted) < 2:
        return None
    power = sum(power_of(p.measured) for p in fitted[0].problems)
    best = min(fitted, key=lambda x: power_of(x.residuals))
    wider = [
        inflation(s.residuals) if p.smooth is not None else 1.0
        for p, s in zip(best.problems, best.solutions, strict=True)
    ]
    marks = np.array([_scores(x, wider) for x in fitted])
    bic = marks[:, 1] - marks[:, 1].min()
    weights = np.exp(-bic / 2) / np.exp(-bic / 2).sum()
    left_out = [_left_out(x, v_s_range, power, runs) for x in fitted]
    paper = next(k for k, x in enumerate(fitted) if x.law == GAUSSIAN)
    chosen = _chosen(fitted, bic, left_out, paper)
    rows = tuple(
        LawRow(
            law=x.law.name,
            parameters=x.count,
            rms=float(np.sqrt(power_of(x.residuals) / x.residuals.size)),
            aicc=None if np.isnan(aicc) else float(aicc - np.nanmin(marks[:, 0])),
            bic=float(above),
            left_out=left[0],
            run_left_out=left[1],
            weight=float(weight),
            in_force=x.law == in_force,
            chosen=k == chosen,
        )
        for k, (x, aicc, above, left, weight) in enumerate(
            zip(fitted, marks[:, 0], bic, left_out, weights, strict=True)
        )
    )
    return LawComparison(
        data=data,
        n=fitted[0].residuals.size,
        rows=rows,
        sentence=_sentence(rows, chosen, paper),
        averaged=_averaged(fitted, weights, wider) if float(weights.max()) < _SPREAD else {},
    )


def _fitted(law: Law, problems: Sequence[Regression], v_s_range: tuple[float, float] | None) -> _Fitted | None:
    """A law fitted; None where there are too few equations."""
    if not problems or any(p.torque.size <= len(p.names) + len(p.shape) + 1 for p in problems):
        return None
    shaped = [with_best_shape(p, v_s_range or default_range(p.velocity)) for p in problems]
    return _Fitted(law, tuple(shaped), tuple(solve(p, v_s_range or default_range(p.velocity)) for p in shaped))


def _scores(x: _Fitted, wider: Sequence[float]) -> tuple[float, float]:
    """AICc, nan where there are too few independent equations, and BIC."""
    marks = [
        scores(s.residuals, len(p.names) + len(p.shape), p.torque.size / by, power_of(p.measured))
        for p, s, by in zip(x.problems, x.solutions, wider, strict=True)
    ]
    return sum(np.nan if aicc is None else aicc for aicc, _ in marks), sum(bic for _, bic in marks)


def _left_out(
    x: _Fitted, v_s_range: tuple[float, float] | None, power: float, runs: Sequence[Pose]
) -> tuple[float | None, float | None]:
    """100 * norm(error) / norm(measured), percent, over blocks of speed, and over runs, each left out in turn.

    None where what is left is too little.
    """
    by_speed = [_predicted(p, parts_by_speed(p), v_s_range) for p in x.problems]
    by_run: list[float | None] = [None]
    if len(runs) > 1:
        apart = [pose(x.law) for pose in runs]
        by_run = [_runs_predicted([of_run[k] for of_run in apart], p, v_s_range) for k, p in enumerate(x.problems)]
    return _percent(by_speed, power), _percent(by_run, power)


def _percent(costs: Sequence[float | None], power: float) -> float | None:
    known = [cost for cost in costs if cost is not None]
    return 100 * float(np.sqrt(sum(known) / power)) if power and len(known) == len(costs) else None


def parts_by_speed(problem: Regression) -> NDArray[np.int_]:
    """Which of the blocks of speed each equation is in, the slowest first, (n,)."""
    part = np.empty(problem.torque.size, dtype=int)
    part[np.argsort(np.abs(problem.equation_velocity), kind="stable")] = (
        np.arange(problem.torque.size) * BLOCKS // problem.torque.size
    )
    return part


def _predicted(problem: Regression, part: NDArray[np.int_], v_s_range: tuple[float, float] | None) -> float | None:
    """The squared error of every part, predicted from the others; None where these are too few."""
    v_s_range = v_s_range or default_range(problem.velocity)
    cost = 0.0
    for k in range(BLOCKS):
        rest = problem.rows(part != k)
        if rest.torque.size <= len(rest.names) or np.linalg.matrix_rank(rest.linear) < rest.linear.shape[1]:
            return None
        cost += power_of(problem.rows(part == k).residuals(solve(rest, v_s_range).theta))
    return cost


def _runs_predicted(
    runs: Sequence[Regression], whole: Regression, v_s_range: tuple[float, float] | None
) -> float | None:
    """The squared error of every run, predicted from the others."""
    first = np.cumsum([0, *(run.torque.size for run in runs)])
    if first[-1] != whole.torque.size:
        return None
    cost, places = 0.0, np.arange(whole.torque.size)
    for start, stop in zip(first[:-1].tolist(), first[1:].tolist(), strict=True):
        own = (places >= start) & (places < stop)
        rest = whole.rows(~own)
        if rest.torque.size <= len(rest.names):
            return None
        cost += power_of(whole.rows(own).residuals(solve(rest, v_s_range or default_range(whole.velocity)).theta))
    return cost


def _chosen(
    fitted: Sequence[_Fitted], bic: Array, left_out: Sequence[tuple[float | None, float | None]], paper: int
) -> int:
    """The law of lowest BIC among those that are clearly better than the paper's, which else stays."""
    compete = {law.name for law in competing()}
    own, _ = left_out[paper]
    better = [
        k
        for k, x in enumerate(fitted)
        if x.law.name in compete and bic[paper] - bic[k] > GAIN and own is not None and (left_out[k][0] or np.inf) < own
    ]
    return min(better, key=lambda k: bic[k], default=paper)


def _sentence(rows: Sequence[LawRow], chosen: int, paper: int) -> Diagnostic:
    """Which law the data want, and why."""
    own, best = rows[paper], rows[chosen]
    if chosen != paper:
        return Kind.LAW_WANTED(law=best.law, gain=own.bic - best.bic, error=best.left_out, before=own.left_out)
    other = min((row for row in rows if row is not own), key=lambda row: row.bic)
    gain = own.bic - other.bic
    if own.left_out is None:
        return Kind.LAWS_TOO_FEW()
    if gain > GAIN:
        return Kind.LAW_NOT_PREDICTING(law=other.law, gain=gain)
    return Kind.LAW_KEPT(law=other.law, gain=gain) if gain > 0 else Kind.LAW_BEST(law=other.law, gap=-gain)


def _averaged(fitted: Sequence[_Fitted], weights: Array, wider: Sequence[float]) -> Mapping[ParameterName, Averaged]:
    """What all laws have, over those that the data allow."""
    likely = [(x, weight) for x, weight in zip(fitted, weights.tolist(), strict=True) if weight > _WORTH]
    tables = [_estimates(x, wider) for x, _ in likely]
    shares = np.array([weight for _, weight in likely])
    shares = shares / shares.sum()
    averaged = {}
    names = reduce(or_, (dict.fromkeys(table) for table in tables))
    for name in names:
        if name.name in _AVERAGED and all(name in table for table in tables):
            value, error, freedom = np.array([table[name] for table in tables]).T
            mean = float(shares @ value)
            own = float(shares @ np.sqrt(error**2 + (value - mean) ** 2))
            reach = student(float(freedom.min())) * own
            averaged[name] = Averaged(value=mean, standard_error=own, interval=(max(mean - reach, 0.0), mean + reach))
    return averaged


def _estimates(x: _Fitted, wider: Sequence[float]) -> dict[ParameterName, tuple[float, float, float]]:
    """Value, standard error and its degrees of freedom of each parameter that is at no bound."""
    out = dict[ParameterName, tuple[float, float, float]]()
    for problem, solution, by in zip(x.problems, x.solutions, wider, strict=True):
        free = np.array([name not in solution.at_bound for name in problem.names])
        matrix, freedom = covariance(solution.jacobian[:, free], solution.cost, by)
        errors = np.sqrt(np.diag(matrix)).tolist()
        names = [name for name, keep in zip(problem.names, free.tolist(), strict=True) if keep]
        values = solution.theta[free].tolist()
        out |= {n: (v, e, freedom) for n, v, e in zip(names, values, errors, strict=True) if np.isfinite(e)}
    return out

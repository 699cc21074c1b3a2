"""Friction laws on what was measured: fitted to the same equations, ranked, and what is said of them.

Each law has a Stribeck term in every direction. Points are solved on the grid; moving runs, in which a slow speed is
seldom seen but in presliding, by LuGre itself (`dynamic.laws`). Both leave out five blocks of speed in turn.

The paper's law is left only for one whose BIC is lower by more than 10, and whose squared error over five blocks of
speed, each left out in turn, is lower too: BIC alone takes up what the scatter looks like, an error at speeds that were
left out alone what happens to lie at one end.

A level that rises with the motor's torque makes a torque explain part of itself. The likelihood of T - f(T) has the
factor 1 - df/dT in each equation, so BIC loses 2 n' mean(log(1 - df/dT)), and an error at what was left out is that of
the torque which solves T = f(T): without both, such a law would win on noise.

A law's BIC is the sum of those of its solves (`estimation.information`). Its weight is exp(-BIC / 2) over the sum of all
(Burnham and Anderson, Model Selection and Multimodel Inference, 2002), and so is the average of a parameter over laws:
its variance is what each law leaves open, and how far it lies from the average.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import compress
from operator import or_
from typing import Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.experiment.schema import AS_WRITTEN, FitOptions
from bristle.estimation.covariance import covariance, seen, student
from bristle.estimation.information import criteria, power_of
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.dynamic.laws import MovingLaw, fitted_to_motion, left_out_costs
from bristle.identification.dynamic.problem import Values
from bristle.identification.fits import Estimate, StaticFit, TrackingFit
from bristle.identification.load_levels import load_is_known
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import regressors
from bristle.identification.results import Averaged, LawComparison, LawRow
from bristle.identification.static import points
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import Regression
from bristle.identification.static.profiles import with_best_shape
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.laws.registry import LOADS, competing
from bristle.model.parameters import ParameterName

Name = TypeVar("Name")

BLOCKS = 5  # of speed, each left out in turn
WITH_DRAG = "gaussian+quadratic"  # the paper's law with v abs(v)
_WORTH = 1.05  # times by which a term has to lower the error at speeds that were left out, to be taken unasked
_MOSTLY = float(np.sqrt(2))  # the same of a load, which a torque that is logged late imitates
_STICKS_OUT = 0.1  # of an interval's width
GAIN = 10.0  # of BIC, by which another law has to be better than the paper's
_SPREAD = 0.95  # a law with less than this of the weights is not the only one that the data allow
_AVERAGED = ("alpha_0", "alpha_1", "alpha_2")  # what means the same in every law: v_s does not
_LIKELY = 1e-3  # a law with a smaller weight does not move an average
LeftOut = tuple[float | None, float | None]
"""100 * norm(error) / norm(measured), percent, over blocks of speed and over runs, each predicted from the others; None where these are too few."""
Known = dict[ParameterName, tuple[float, float, float]]
"""Value, standard error and its degrees of freedom of each parameter that is at no bound."""


class Solve(NamedTuple):
    """One of a law's solves: what its BIC is made of."""

    residuals: Array
    """(n,)."""
    parameters: int
    effective: float
    """How many of the equations are independent."""
    power: float
    """Sum of squares of what is explained."""
    itself: float = 0.0
    """Sum of log(1 - s) over the equations, s the share of a change of the torque that its own law makes of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedLaw:
    """A law fitted to every solve."""

    law: Law
    load: tuple[str, ...] = ()
    """By what its level rises, of `registry.LOADS`."""
    solves: tuple[Solve, ...]
    left_out: Callable[[], LeftOut]
    """Works out how it predicts what was left out."""
    known: Known

    @property
    def name(self) -> str:
        """As `fit.law` takes it."""
        return "+".join((self.law.name, *self.load))

    @property
    def residuals(self) -> Array:
        """Of every equation, (n,)."""
        return np.concatenate([solve.residuals for solve in self.solves])


def laws_beside(in_force: Law) -> tuple[Law, ...]:
    """The laws that are compared: those that compete, and the one in force."""
    return tuple({law.name: law for law in (*competing(), in_force)}.values())


def laws_of_points(measured: Measured, in_force: Law) -> LawComparison | None:
    """The laws on the points of an experiment, those that belong to none left out; None where there are too few.

    Raises InputError as the fit of points does.
    """
    asked = points.point_regressors(measured.experiment)
    others = [law for law in competing() if law != in_force]
    stray = points.strays_under_all(measured.experiment, measured.searches, others)
    chosen = points.groups(
        measured.experiment, [s for s in points.sliding_points(measured.searches) if s.place not in stray]
    )

    def pose(law: Law) -> Sequence[Regression]:
        return [points.points_problem(group, sides, asked, law) for sides, group in chosen]

    return compare_laws(pose, in_force)


def laws_of_motion(
    measured: Measured, alone: TrackingFit, *, every: bool
) -> tuple[LawComparison | None, dict[str, Values]]:
    """The laws on the moving runs, beside the fit of these under the law in force, and where the fit of each ended, by name.

    None where there are too few equations, or that fit is not about a torque. `every`: whether laws with other peaks are compared
    although it shows no peak.
    """
    records = measured.moving(hold_out=False)
    if alone.quantity != "torque":
        return None, {}
    own = measured.experiment.fit.load
    every = every or any(name.name == "alpha_1" and e.value for name, e in alone.parameters.items())
    beside = [law for law in laws_beside(alone.law) if every or law.peak in (alone.law.peak, GAUSSIAN.peak)]
    chosen = dict.fromkeys([(GAUSSIAN, ()), *((law, own) for law in beside)])
    if load_is_known(records, regressors(measured.experiment)):
        chosen |= dict.fromkeys((alone.law, load) for load in [(), *((name,) for name in LOADS)])
    found = [(load, fitted_to_motion(measured.experiment, records, alone, law, load)) for law, load in chosen]
    effective = min((x.effective for _, x in found if x is not None), default=0.0)
    fitted = [None if x is None else _of_motion(x, effective, load) for load, x in found]
    ends: dict[str, Values] = {
        f.name: {**x.problem.fixed, **x.values} for f, (_, x) in zip(fitted, found, strict=True) if f and x
    }
    return ranked("moving runs", fitted, "+".join((alone.law.name, *own)), sparing=True), ends


def _of_motion(one: MovingLaw, effective: float, load: tuple[str, ...]) -> FittedLaw:
    """A law fitted to moving runs, of whose equations so many are independent."""
    power, freedom = power_of(one.problem.measured), one.residuals.size / max(effective, 1.0)

    def left_out() -> LeftOut:
        """Over blocks of speed, and over runs."""
        part, names = parts_by_speed(one.problem.velocity), dict.fromkeys(one.problem.file.tolist())
        runs = [one.problem.file == name for name in names] if len(names) > 1 else []
        by_speed = percent_of(left_out_costs(one, [part == k for k in range(BLOCKS)]), power)
        return by_speed, percent_of(left_out_costs(one, runs), power) if runs else None

    # of what has an influence
    free = seen(one.jacobian)
    matrix, own_freedom = covariance(one.jacobian[:, free], power_of(one.residuals), freedom)
    errors = (np.sqrt(np.diag(matrix)) * np.abs(one.unknowns.slopes(one.x)[free])).tolist()
    pairs = zip(compress(one.problem.names, free), errors, strict=True)
    known = {n: (one.values[n], e, own_freedom) for n, e in pairs if isinstance(n, ParameterName)}
    solve = Solve(one.residuals, len(one.problem.names), effective, power, float(np.log(one.not_itself).sum()))
    return FittedLaw(law=one.law, load=load, solves=(solve,), left_out=left_out, known=known)


def law_warnings(laws: LawComparison | None) -> tuple[Finding, ...]:
    """That another law is clearly better than the one in force, with the line to write."""
    if laws is None:
        return ()
    best, own = laws.chosen, next((row for row in laws.rows if row.in_force), None)
    if own is None:  # too few points for it, which its fit says
        return ()
    clearly = own.bic - best.bic > GAIN and (best.left_out or np.inf) < (own.left_out or 0.0)
    if best.in_force or not clearly:
        return ()
    gain, error, before = own.bic - best.bic, best.left_out, own.left_out
    message = (
        f"Law {best.law} fits better: its BIC is {gain:.1f} lower than that of {own.law}, and its error at left-out speeds is "
        f"{error:.3g} % of the torque instead of {before:.3g} %. Under fit, write `law: {best.law}` (or `law: auto`)."
    )
    numbers = {"law": best.law, "own": own.law, "gain": gain, "error": error, "before": before}
    return (Finding("other-law", CAUTION, message, numbers),)


def term_that_pays(fit: FitOptions, laws: LawComparison) -> str | None:
    """The law with the term that is taken beside the paper's peak, v abs(v) or a rise with load; None: no term is.

    The file names no law, speeds that were left out are predicted better with it, by a twentieth with v abs(v) and by more than half
    of the squares with a load, and BIC is lower by `GAIN`; of several the one of lowest BIC.
    """
    paper, loads = laws.row(GAUSSIAN.name), dict.fromkeys((f"{GAUSSIAN.name}+{name}" for name in LOADS), _MOSTLY)
    worth = {**loads, **({} if "quadratic" in (fit.regressors or ()) else {WITH_DRAG: _WORTH})}
    if fit.set_up == AS_WRITTEN or "law" in fit.model_fields_set or paper is None or paper.left_out is None:
        return None
    rows = [
        row
        for row in laws.rows
        if row.law in worth and row.left_out is not None and worth[row.law] * row.left_out < paper.left_out
    ]
    best = min(rows, key=lambda row: row.bic, default=None)
    return best.law if best is not None and paper.bic - best.bic > GAIN else None


def with_averages(fits: Mapping[str, StaticFit], laws: LawComparison | None) -> dict[str, StaticFit]:
    """The fits of points under a law that the data chose; each estimate beside which other laws allow more says so.

    An average is of what was compared: a fit of other points, or without the Stribeck term that every compared law has, is
    as it was.
    """
    n, told = sum(fit.n for d, fit in fits.items() if d != "shared"), dict(fits)
    if laws is not None and laws.data == "points" and n == laws.n:
        for d, fit in fits.items():
            own = {n.name: x for n, x in laws.averaged.items() if n.direction == d and "v_s" in fit.parameters}
            told[d] = replace(fit, parameters=_told(fit.parameters, own))
    return told


def with_averages_of_motion(fit: TrackingFit | None, laws: LawComparison | None) -> TrackingFit | None:
    """The same of moving runs fitted by LuGre itself, as the laws were."""
    if fit is None or laws is None or laws.data == "points" or not any(n.name == "v_s" for n in fit.parameters):
        return fit
    return replace(fit, parameters=_told(fit.parameters, laws.averaged))


def _told(estimates: Mapping[Name, Estimate], averaged: Mapping[Name, Averaged]) -> dict[Name, Estimate]:
    """Estimates, of which those say so beside which other laws allow more."""
    out = dict(estimates)
    for name, own in estimates.items():
        over = averaged.get(name)
        if over is None or own.interval is None:
            continue
        (low, high), (least, most) = over.interval, own.interval
        room = _STICKS_OUT * (most - least)
        if low < least - room or high > most + room:
            message = (
                "Its interval takes the law as known, which the data chose. Over the laws that they allow it is "
                f"{low:.3g} to {high:.3g} {own.unit}."
            )
            why = Finding("over-laws", CAUTION, message, {"low": low, "high": high, "unit": own.unit})
            out[name] = replace(own, warnings=(*own.warnings, why))
    return out


def compare_laws(pose: Callable[[Law], Sequence[Regression]], in_force: Law) -> LawComparison | None:
    """The laws that compete, and the one in force, on the same points, which `pose` makes the solves of a law of.

    None where there are too few for any other than the paper's.
    """
    fitted = list[FittedLaw]()
    for law in laws_beside(in_force):
        problems = pose(law)
        if not problems or any(p.torque.size <= len(p.names) + len(p.shape) + 1 for p in problems):
            continue
        shaped = [with_best_shape(p, default_range(p.velocity)) for p in problems]
        solutions = [solve(p, default_range(p.velocity)) for p in shaped]
        solves = tuple(
            Solve(s.residuals, len(p.names) + len(p.shape), p.torque.size, power_of(p.measured))
            for p, s in zip(shaped, solutions, strict=True)
        )
        known: Known = {}
        for problem, solution in zip(shaped, solutions, strict=True):
            free = np.array([name not in solution.at_bound for name in problem.names])
            matrix, freedom = covariance(solution.jacobian[:, free], solution.cost)
            errors = np.sqrt(np.diag(matrix)).tolist()
            rows = zip(compress(problem.names, free), solution.theta[free].tolist(), errors, strict=True)
            known |= {n: (v, e, freedom) for n, v, e in rows if np.isfinite(e)}
        fitted.append(FittedLaw(law=law, solves=solves, left_out=partial(_left_out, shaped), known=known))
    return ranked("points", fitted, in_force.name)


def percent_of(costs: Sequence[float | None], power: float) -> float | None:
    """100 times the root of some costs over a power; None where one of them is not known."""
    known = [cost for cost in costs if cost is not None]
    return 100 * float(np.sqrt(sum(known) / power)) if power and len(known) == len(costs) else None


def _left_out(problems: Sequence[Regression]) -> LeftOut:
    """Over blocks of speed, each predicted from the others."""
    total = 0.0
    for problem in problems:
        part, cost = parts_by_speed(problem.equation_velocity), 0.0
        for k in range(BLOCKS):
            rest = problem.rows(part != k)
            if rest.torque.size <= len(rest.names) or np.linalg.matrix_rank(rest.linear) < rest.linear.shape[1]:
                return None, None
            low, high = default_range(rest.velocity)
            slowest = float(np.abs(rest.velocity[rest.velocity != 0]).min())
            if slowest < high:  # as the fit has it: without a speed below v_s a peak is invented
                low = max(low, slowest)
            cost += power_of(problem.rows(part == k).residuals(solve(rest, (low, high)).theta))
        total += cost
    return percent_of([total], sum(power_of(p.measured) for p in problems)), None


def parts_by_speed(velocity: Array) -> NDArray[np.int_]:
    """Which of the blocks of speed each equation is in, the slowest first, (n,); velocity, rad/s, (n,)."""
    part = np.empty(velocity.size, dtype=int)
    part[np.argsort(np.abs(velocity), kind="stable")] = np.arange(velocity.size) * BLOCKS // velocity.size
    return part


def ranked(
    data: Literal["points", "moving runs"], fitted: Sequence[FittedLaw | None], in_force: str, *, sparing: bool = False
) -> LawComparison | None:
    """Fitted laws, None where there were too few equations, as rows, with the one that the data want; None where there is none beside the paper's.

    `in_force` names the law of the fits; where `sparing`, errors at what is left out are worked out only where BIC prefers a law to the
    paper's: for those laws, and the ones that they are compared with.
    """
    found = [x for x in fitted if x is not None]
    paper = next((k for k, x in enumerate(found) if x.name == GAUSSIAN.name), None)
    if paper is None or len(found) < 2:
        return None
    marks = np.zeros((len(found), 2))  # AICc, nan where there are too few independent equations, and BIC
    for k, x in enumerate(found):
        for one in x.solves:
            aicc, own = criteria(*one[:4])
            itself = -2 * one.effective / one.residuals.size * one.itself
            marks[k] += np.nan if aicc is None else aicc + itself, own + itself
    bic = marks[:, 1] - marks[:, 1].min()
    weights = np.exp(-bic / 2) / np.exp(-bic / 2).sum()
    better = bic[paper] - bic > GAIN
    wanted = [
        not sparing or better[k] or (better.any() and (k == paper or x.name == in_force)) for k, x in enumerate(found)
    ]
    left_out = [x.left_out() if asked else (None, None) for x, asked in zip(found, wanted, strict=True)]
    # the law of lowest BIC among those that are clearly better than the paper's, which else stays
    compete, (own_left, _) = {law.name for law in competing()}, left_out[paper]
    clearly = [
        k
        for k, x in enumerate(found)
        if x.law.name in compete and better[k] and own_left is not None and (left_out[k][0] or np.inf) < own_left
    ]
    chosen = min(clearly, key=lambda k: bic[k], default=paper)
    rows = tuple(
        LawRow(
            law=x.name, parameters=sum(solve.parameters for solve in x.solves),
            rms=float(np.sqrt(power_of(x.residuals) / x.residuals.size)),
            aicc=None if np.isnan(aicc) else float(aicc - np.nanmin(marks[:, 0])), bic=float(above), left_out=left[0],
            run_left_out=left[1], weight=float(weight), in_force=x.name == in_force, chosen=k == chosen,
        )
        for k, (x, aicc, above, left, weight) in enumerate(zip(found, marks[:, 0], bic, left_out, weights, strict=True))
    )  # fmt: skip  # a list of values
    averaged = _averaged(found, weights) if float(weights.max()) < _SPREAD else {}
    sentence = _sentence(rows, chosen, paper, asked=any(wanted))
    return LawComparison(data=data, n=found[0].residuals.size, rows=rows, sentence=sentence, averaged=averaged)


def _sentence(rows: Sequence[LawRow], chosen: int, paper: int, *, asked: bool) -> Finding:
    """Which law the data want, and why; `asked`: whether it was worked out what the laws predict of what is left out."""
    own, best = rows[paper], rows[chosen]
    if chosen != paper:
        gain, error, before = own.bic - best.bic, best.left_out, own.left_out
        message = (
            f"The data favour {best.law}: its BIC is {gain:.1f} lower than the paper's law's, and at five blocks of speed, each left "
            f"out in turn, its error is {error:.3g} % of the torque instead of {before:.3g} %."
        )
        return Finding("law-wanted", NOTE, message, {"law": best.law, "gain": gain, "error": error, "before": before})
    other = min((row for row in rows if row is not own), key=lambda row: row.bic)
    gain = own.bic - other.bic
    if asked and own.left_out is None:
        message = "The data cannot favour another law than the paper's: there are too few points to leave speeds out."
        return Finding("laws-too-few", NOTE, message)
    kept = "The data favour no other law than the paper's:"
    lower, numbers = f"{kept} the BIC of {other.law} is {gain:.1f} lower", {"law": other.law, "gain": gain}
    if gain > GAIN:
        message = f"{lower}, but it predicts speeds that were left out no better."
        return Finding("law-not-predicting", NOTE, message, numbers)
    if gain > 0:
        return Finding("law-kept", NOTE, f"{lower}, less than the 10 required.", numbers)
    message = f"{kept} it has the lowest BIC ({other.law} has {-gain:.1f} more)."
    return Finding("law-best", NOTE, message, {"law": other.law, "gap": -gain})


def _averaged(fitted: Sequence[FittedLaw], weights: Array) -> Mapping[ParameterName, Averaged]:
    """What nearly all laws have by weight, over those that the data allow."""
    likely = [(x, weight) for x, weight in zip(fitted, weights.tolist(), strict=True) if weight > _LIKELY]
    tables = [(x.known, weight) for x, weight in likely]
    averaged = {}
    for name in reduce(or_, (dict.fromkeys(table) for table, _ in tables)):
        having = [(*table[name], weight) for table, weight in tables if name in table]
        value, error, freedom, shares = np.array(having).T
        if name.name in _AVERAGED and shares.sum() > _SPREAD:  # a law in which it is at a bound may lack it
            shares = shares / shares.sum()
            mean = float(shares @ value)
            own = float(shares @ np.sqrt(error**2 + (value - mean) ** 2))
            reach = student(float(freedom.min())) * own
            averaged[name] = Averaged(value=mean, standard_error=own, interval=(max(mean - reach, 0.0), mean + reach))
    return averaged

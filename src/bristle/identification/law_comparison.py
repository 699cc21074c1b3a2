"""Friction laws on what was measured: fitted to the same equations, ranked, and what is said of them.

Each law has a Stribeck term in every direction. Points are solved on the grid; moving runs, in which a slow speed is
seldom seen but in presliding, by LuGre itself (`dynamic.laws`). Both leave out five blocks of speed in turn.

The paper's law is left only for one whose BIC is lower by more than 10, and whose squared error over five blocks of
speed, each left out in turn, is lower too: BIC alone takes up what the scatter looks like, an error at speeds that were
left out alone what happens to lie at one end.

A level that rises with the motor's torque makes a torque explain part of itself. The likelihood of T - f(T) has the
factor 1 - df/dT in each equation, so BIC loses 2 n' mean(log(1 - df/dT)), and an error at what was left out is that of
the torque which solves T = f(T): without both, such a law would win on noise.

The average of a parameter over laws is by their weights; its variance is what each law leaves open, and how far it lies
from the average.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, compress
from typing import TypeVar

import numpy as np

from bristle.data.experiment.schema import AS_WRITTEN, FitOptions
from bristle.estimation.covariance import covariance, student
from bristle.estimation.information import power_of
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.comparison import (
    Averaged,
    Comparison,
    Data,
    Fitted,
    LeftOut,
    Row,
    Solve,
    bic_above,
    blocks_of_speed,
    rows_of,
)
from bristle.identification.dynamic.laws import fitted_to_motion
from bristle.identification.dynamic.problem import Values
from bristle.identification.fits import Estimate, StaticFit, TrackingFit
from bristle.identification.load_levels import load_is_known
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import regressors
from bristle.identification.static import points
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import Regression
from bristle.identification.static.profiles import with_best_shape
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.laws.registry import LOADS, competing
from bristle.model.parameters import ParameterName

Name = TypeVar("Name")

WITH_DRAG = "gaussian+quadratic"  # the paper's law with v abs(v)
_WORTH = 1.05  # times by which a term has to lower the error at speeds that were left out, to be taken unasked
_MOSTLY = float(np.sqrt(2))  # the same of a load, which a torque that is logged late imitates
_STICKS_OUT = 0.1  # of an interval's width
GAIN = 10.0  # of BIC, by which another law has to be better than the paper's
_SPREAD = 0.95  # a law with less than this of the weights is not the only one that the data allow
_AVERAGED = ("alpha_0", "alpha_1", "alpha_2")  # what means the same in every law: v_s does not
_LIKELY = 1e-3  # a law with a smaller weight does not move an average


def laws_beside(in_force: Law) -> tuple[Law, ...]:
    """The laws that are compared: those that compete, and the one in force."""
    return tuple({law.name: law for law in (*competing(), in_force)}.values())


def laws_of_points(measured: Measured, in_force: Law) -> Comparison | None:
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
) -> tuple[Comparison | None, dict[str, Values]]:
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
    found = (fitted_to_motion(measured.experiment, records, alone, law, load) for law, load in chosen)
    ended = [x for x in found if x is not None]
    effective = min((x.effective for x in ended), default=0.0)
    ends: dict[str, Values] = {x.name: {**x.problem.fixed, **x.values} for x in ended}
    in_force = "+".join((alone.law.name, *own))
    return ranked("moving runs", [x.fitted(effective) for x in ended], in_force, sparing=True), ends


def law_warnings(laws: Comparison | None) -> tuple[Finding, ...]:
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
        f"Law {best.name} fits better: its BIC is {gain:.1f} lower than that of {own.name}, and its error at left-out speeds is "
        f"{error:.3g} % of the torque instead of {before:.3g} %. Under fit, write `law: {best.name}` (or `law: auto`)."
    )
    numbers = {"law": best.name, "own": own.name, "gain": gain, "error": error, "before": before}
    return (Finding("other-law", CAUTION, message, numbers),)


def term_that_pays(fit: FitOptions, laws: Comparison) -> str | None:
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
        if row.name in worth and row.left_out is not None and worth[row.name] * row.left_out < paper.left_out
    ]
    best = min(rows, key=lambda row: row.bic, default=None)
    return best.name if best is not None and paper.bic - best.bic > GAIN else None


def with_averages(
    static: dict[str, StaticFit], moving: TrackingFit | None, laws: Comparison | None
) -> tuple[dict[str, StaticFit], TrackingFit | None]:
    """The fits under a law that the data chose; each estimate beside which other laws allow more says so.

    An average is of what was compared: a fit of other data, or without the Stribeck term that every compared law has, is
    as it was.
    """
    if laws is None:
        return static, moving
    if laws.data == "points":
        n = sum(fit.n for d, fit in static.items() if d != "shared")
        of_these = {d: fit for d, fit in static.items() if n == laws.n and "v_s" in fit.parameters}
        for d, fit in of_these.items():
            own = {name.name: x for name, x in laws.averaged.items() if name.direction == d}
            static = {**static, d: replace(fit, parameters=_told(fit.parameters, own))}
    elif moving is not None and any(n.name == "v_s" for n in moving.parameters):
        moving = replace(moving, parameters=_told(moving.parameters, laws.averaged))
    return static, moving


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


def compare_laws(pose: Callable[[Law], Sequence[Regression]], in_force: Law) -> Comparison | None:
    """The laws that compete, and the one in force, on the same points, which `pose` makes the solves of a law of.

    None where there are too few for any other than the paper's.
    """
    fitted, compete = list[Fitted](), competing()
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
        known = dict[ParameterName, tuple[float, float, float]]()
        for problem, solution in zip(shaped, solutions, strict=True):
            free = np.array([name not in solution.at_bound for name in problem.names])
            matrix, freedom = covariance(solution.jacobian[:, free], solution.cost)
            errors = np.sqrt(np.diag(matrix)).tolist()
            rows = zip(compress(problem.names, free), solution.theta[free].tolist(), errors, strict=True)
            known |= {n: (v, e, freedom) for n, v, e in rows if np.isfinite(e)}
        predicts = partial(_left_out, shaped)
        fitted.append(Fitted(name=law.name, solves=solves, candidate=law in compete, predicts=predicts, known=known))
    return ranked("points", fitted, in_force.name)


def _left_out(problems: Sequence[Regression]) -> LeftOut:
    """Over blocks of speed, each predicted from the others."""
    total = 0.0
    for problem in problems:
        cost = 0.0
        for part in blocks_of_speed(problem.equation_velocity):
            rest = problem.rows(~part)
            if rest.torque.size <= len(rest.names) or np.linalg.matrix_rank(rest.linear) < rest.linear.shape[1]:
                return None
            low, high = default_range(rest.velocity)
            slowest = float(np.abs(rest.velocity[rest.velocity != 0]).min())
            if slowest < high:  # as the fit has it: without a speed below v_s a peak is invented
                low = max(low, slowest)
            cost += power_of(problem.rows(part).residuals(solve(rest, (low, high)).theta))
        total += cost
    power = sum(power_of(p.measured) for p in problems)
    return 100 * float(np.sqrt(total / power)) if power else None


def ranked(data: Data, fitted: Sequence[Fitted], in_force: str, *, sparing: bool = False) -> Comparison | None:
    """Fitted laws as rows, with the one that the data want; None where there is none beside the paper's.

    `in_force` names the law of the fits; where `sparing`, errors at what is left out are worked out only where BIC prefers a law to the
    paper's: for those laws, and the ones that they are compared with.
    """
    paper = next((k for k, x in enumerate(fitted) if x.name == GAUSSIAN.name), None)
    if paper is None or len(fitted) < 2:
        return None
    bic = bic_above(fitted)
    better = bic[paper] - bic > GAIN
    wanted = [
        not sparing or better[k] or (better.any() and (k == paper or x.name == in_force)) for k, x in enumerate(fitted)
    ]
    fitted = [replace(x, left_out=x.predicts()) if asked else x for x, asked in zip(fitted, wanted, strict=True)]
    # the law of lowest BIC among those that are clearly better than the paper's, which else stays
    least = fitted[paper].left_out
    clearly = [
        k
        for k, x in enumerate(fitted)
        if x.candidate and better[k] and least is not None and (x.left_out or np.inf) < least
    ]
    chosen = min(clearly, key=lambda k: bic[k], default=paper)
    rows = rows_of(fitted, chosen, in_force)
    averaged = _averaged(fitted, rows) if max(row.weight or 0.0 for row in rows) < _SPREAD else {}
    sentence, solves = _sentence(rows, chosen, paper, asked=any(wanted)), fitted[0].solves
    return Comparison(
        data=data, n=fitted[0].size, effective=sum(x.effective for x in solves), rows=rows, sentence=sentence,
        averaged=averaged,
    )  # fmt: skip  # a list of values


def _sentence(rows: Sequence[Row], chosen: int, paper: int, *, asked: bool) -> Finding:
    """Which law the data want, and why; `asked`: whether it was worked out what the laws predict of what is left out."""
    own, best = rows[paper], rows[chosen]
    if chosen != paper:
        gain, error, before = own.bic - best.bic, best.left_out, own.left_out
        message = (
            f"The data favour {best.name}: its BIC is {gain:.1f} lower than the paper's law's, and at five blocks of speed, each left "
            f"out in turn, its error is {error:.3g} % of the torque instead of {before:.3g} %."
        )
        return Finding("law-wanted", NOTE, message, {"law": best.name, "gain": gain, "error": error, "before": before})
    other = min((row for row in rows if row is not own), key=lambda row: row.bic)
    gain = own.bic - other.bic
    if asked and own.left_out is None:
        message = "The data cannot favour another law than the paper's: there are too few points to leave speeds out."
        return Finding("laws-too-few", NOTE, message)
    kept = "The data favour no other law than the paper's:"
    lower, numbers = f"{kept} the BIC of {other.name} is {gain:.1f} lower", {"law": other.name, "gain": gain}
    if gain > GAIN:
        message = f"{lower}, but it predicts speeds that were left out no better."
        return Finding("law-not-predicting", NOTE, message, numbers)
    if gain > 0:
        return Finding("law-kept", NOTE, f"{lower}, less than the 10 required.", numbers)
    message = f"{kept} it has the lowest BIC ({other.name} has {-gain:.1f} more)."
    return Finding("law-best", NOTE, message, {"law": other.name, "gap": -gain})


def _averaged(fitted: Sequence[Fitted], rows: Sequence[Row]) -> Mapping[ParameterName, Averaged]:
    """What nearly all laws have by weight, over those that the data allow."""
    pairs = ((x.known, row.weight or 0.0) for x, row in zip(fitted, rows, strict=True))
    tables = [(known, weight) for known, weight in pairs if weight > _LIKELY]
    averaged = {}
    for name in dict.fromkeys(chain.from_iterable(table for table, _ in tables)):
        having = [(*table[name], weight) for table, weight in tables if name in table]
        value, error, freedom, shares = np.array(having).T
        if name.name in _AVERAGED and shares.sum() > _SPREAD:  # a law in which it is at a bound may lack it
            shares = shares / shares.sum()
            mean = float(shares @ value)
            own = float(shares @ np.sqrt(error**2 + (value - mean) ** 2))
            reach = student(float(freedom.min())) * own
            averaged[name] = Averaged(value=mean, standard_error=own, interval=(max(mean - reach, 0.0), mean + reach))
    return averaged

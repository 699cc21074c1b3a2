"""Comparison of friction laws on points (by the grid) and on moving runs (by LuGre, from the end of the last fit).

The paper's law is left only for one with a BIC lower by more than 10 and a lower error at left-out blocks of speed. A
level that rises with the motor's torque makes a torque explain part of itself: the likelihood of T - f(T) has the
factor 1 - df/dT, so BIC loses 2 n' mean(log(1 - df/dT)).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.load import Experiment
from bristle.data.experiment.schema import AS_WRITTEN, FitOptions
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.information import power_of
from bristle.estimation.nonlinear import Minimum, Unknowns
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.comparison import Comparison, Data, Fitted, LeftOut, Row, blocks_of_speed, rows_of
from bristle.identification.dynamic.descent import solved, with_deflections
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, Values, dynamic_problem, modelled
from bristle.identification.fits import TrackingFit
from bristle.identification.load_levels import LINEAR, load_is_known
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import LEVELS, directions, inertia, regressors
from bristle.identification.static import points
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import Regression
from bristle.identification.static.profiles import with_best_shape
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.laws.registry import LOADS, competing, law_named
from bristle.model.parameters import INERTIA, ParameterName, in_direction, of_load

WITH_DRAG = "gaussian+quadratic"  # the paper's law with v abs(v)
_MOSTLY = float(np.sqrt(2))  # the same of a load, which a delayed torque imitates
_STEPS = 40  # most iterations of a fit
_ENOUGH = 0.2  # of n' log(RSS), a fiftieth of what chooses a law: a smaller gain ends a fit
_BRISTLE = ("sigma_0", "sigma_1")
_START = {"alpha_1": 0.1, "v_s": 0.1, "load": 0.03}
"""Where terms begin that the law in force does not have: shares of alpha_0, of the fastest speed, of the load."""
_DAMPING = (1e-8, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)  # tried in turn, for columns of unit length
_LEAST = 0.05  # of 1 - df/dT


def laws_beside(in_force: Law) -> tuple[Law, ...]:
    """The competing laws and the one in force."""
    return tuple({law.name: law for law in (*competing(), in_force)}.values())


def laws_of_points(measured: Measured, in_force: Law) -> Comparison | None:
    """The laws compared on points, strays left out; None of too few. Raises InputError as the fit of points does."""
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
    """The laws on the moving runs, other peaks with `every`, and where each fit ended, by name; None of too few."""
    records = measured.moving(hold_out=False)
    own = measured.experiment.fit.load
    every = every or any(name.name == "alpha_1" and e.value for name, e in alone.parameters.items())
    beside = [law for law in laws_beside(alone.law) if every or law.peak in (alone.law.peak, GAUSSIAN.peak)]
    chosen = dict.fromkeys([(GAUSSIAN, ()), *((law, own) for law in beside)])
    if load_is_known(records, regressors(measured.experiment)):
        chosen |= dict.fromkeys((alone.law, load) for load in [(), *((name,) for name in LOADS)])
    found = (_fitted_to_motion(measured.experiment, records, alone, law, load) for law, load in chosen)
    # a term that drives is not friction, unless any law is asked for
    ended = [x for x in found if x is not None and (every or x.law == alone.law or brakes(x.values))]
    effective = min((x.effective for x in ended), default=0.0)
    ends: dict[str, Values] = {x.name: {**x.problem.fixed, **x.values} for x in ended}
    return ranked("moving runs", [x.fitted(effective) for x in ended], "+".join((alone.law.name, *own))), ends


class _MovingLaw(NamedTuple):
    """A law fitted to moving runs."""

    name: str
    law: Law
    problem: DynamicProblem
    values: Mapping[Unknown, float]
    minimum: Minimum
    unknowns: Unknowns[Unknown]

    @property
    def effective(self) -> float:
        """Number of independent equations."""
        return self.minimum.residuals.size / inflation(self.minimum.residuals)

    def fitted(self, effective: float) -> Fitted:
        """As a `Fitted` with this number of independent equations."""
        residuals = self.minimum.residuals
        itself = 2 * effective / residuals.size * float(np.log(self._torque_independence()).sum())
        solve = (residuals, len(self.problem.names), effective, power_of(self.problem.measured))
        return Fitted(self.name, [solve], self.law in competing(), self._blocks_left_out, itself)

    def _torque_independence(self) -> Array:
        """1 - df/dT of each equation, (n,); one without a load."""
        of_all = (*self.problem.fixed.items(), *self.values.items())
        known = {n.name: x for n, x in of_all if isinstance(n, ParameterName)}
        rows = [
            m.smoothed(np.ones(m.velocity.size) if m.load is None else 1 - np.sign(m.velocity) * m.load.by_motor(known))
            for m in self.problem.motions
        ]
        return np.maximum(np.concatenate(rows), _LEAST)

    def _blocks_left_out(self) -> LeftOut:
        """Left-out error over blocks of speed, by damped Gauss-Newton steps; each motion's first equation stays in."""
        x_all, _, residuals, jacobian, *_, private = self.minimum
        problem, unknowns, share, total = self.problem, self.unknowns, self._torque_independence(), 0.0
        size, k, measured = np.sqrt((jacobian**2).sum(axis=0)), jacobian.shape[1], problem.measured
        free = (size > 0) & ((x_all > unknowns.lower) & (x_all < unknowns.upper))[:k]
        for part in blocks_of_speed(problem.velocity):
            out = part.copy()
            out[[*problem.starts]] = False
            if part.size - out.sum() < free.sum():
                return None
            kept = private._replace(column=private.column * ~out)
            J = kept.off(~out[:, None] * jacobian[:, free] / size[free])
            gram, slope, left = J.T @ J, J.T @ residuals, residuals
            for damping in _DAMPING:
                x = x_all.copy()
                x[:k][free] -= np.linalg.solve(gram + damping * np.eye(slope.size), slope) / size[free]
                x = np.clip(x, unknowns.lower, unknowns.upper)
                with np.errstate(over="ignore", invalid="ignore"):  # of a step too far
                    model = modelled(problem, {**self.values, **unknowns.values(x)})
                trial = measured - np.concatenate([m.smoothed(T) for m, T in zip(problem.motions, model, strict=True)])
                trial -= private.column * private.spread(kept.shares(trial))  # deflections follow
                if power_of(trial[~out]) <= power_of(residuals[~out]):
                    left = trial
                    break
            total += power_of(left[part] / share[part])
        power = power_of(measured)
        return 100 * float(np.sqrt(total / power)) if power else None


def _fitted_to_motion(
    experiment: Experiment, records: Sequence[Record], alone: TrackingFit, law: Law, load: tuple[str, ...] = ()
) -> _MovingLaw | None:
    """LuGre with another law, from the end of the last fit with its bristle held; None of too few equations."""
    sides, (fixed, _) = directions(experiment, records), inertia(experiment)
    asked = (*(name for name in regressors(experiment) if name not in LEVELS), *load)
    options = experiment.fit
    whole = dynamic_problem(records, sides, asked, options.every, fixed, law=law)
    held = {
        name: x
        for name, x in alone.fixed.items()
        if name.name in _BRISTLE or not {name.name, str(name)}.isdisjoint(options.fixed)
    }
    middle = {ParameterName(own.name, d): own.middle for d, own in product(whole.directions, law.peak.own)}
    known = {**whole.fixed, **middle, **{name: x for name, x in held.items() if name in whole.friction_names}}
    problem = replace(whole, fixed=known).rough()
    if problem.size <= len(problem.names) + 1:
        return None
    # values of the other law, with a small peak if it has none, zero new terms, inertia >= 0
    began = alone.known
    start = {name: in_direction(began, *name) or 0.0 for name in (*problem.friction_names, *problem.extra_names)}
    for name in problem.friction_names:
        if name.name == "alpha_1" and not start[name]:
            start[name] = _START["alpha_1"] * began[name._replace(name="alpha_0")]
            start[name._replace(name="v_s")] = _START["v_s"] * problem.fastest
    start |= {n: _START["load"] for n in problem.extra_names if n.name in LINEAR and not start[n]}
    if INERTIA in start:
        start[INERTIA] = max(start[INERTIA], 0.0)
    start = {name: x for name, x in start.items() if name not in problem.fixed}
    try:
        enough = _ENOUGH * alone.rms**2 * inflation(alone.residuals)
        posed, minimum = solved(problem, with_deflections(problem, start), _STEPS, enough=enough)
    except InputError:  # a start without influence: leave this law out
        return None
    values = posed.unknowns.values(minimum.x)
    return _MovingLaw("+".join((law.name, *load)), law, problem, values, minimum, posed.unknowns)


def brakes(values: Mapping[Any, float]) -> bool:
    """Whether v abs(v) and a rise with load, of values by name, brake in every direction."""
    drag = law_named(WITH_DRAG).coefficients
    return all(x > 0 for name, x in values.items() if name.name in drag or of_load(name.name))


def fitted_law(fit: FitOptions) -> str:
    """The law of the fits, with its load."""
    return "+".join((fit.friction.name, *fit.load))


def law_warnings(laws: Comparison | None, fit: FitOptions) -> tuple[Finding, ...]:
    """A caution where another law is clearly better than that of the fits."""
    if laws is None:  # too few points are reported by the fit
        return ()
    best, own = laws.chosen, laws.row(fitted_law(fit)) or laws.row(fit.friction.name)
    if own is None or not own.bic - best.bic > levels.BIC_GAIN or not _predicts_better(best, own):
        return ()
    words, numbers = _gain(best, own)
    message = f"Law {best.name} fits better: {words}. Under fit, write `law: {best.name}` (or `law: auto`)."
    return (Finding("other-law", CAUTION, message, numbers),)


def term_that_pays(fit: FitOptions, laws: Comparison) -> str | None:
    """The law with v abs(v) or a rise with load, taken unasked for a better BIC and left-out error; None: no term."""
    paper, loads = laws.row(GAUSSIAN.name), dict.fromkeys((f"{GAUSSIAN.name}+{name}" for name in LOADS), _MOSTLY)
    worth = {**loads, **({} if "quadratic" in (fit.regressors or ()) else {WITH_DRAG: levels.WORTH})}
    if fit.set_up == AS_WRITTEN or "law" in fit.model_fields_set or paper is None or paper.left_out is None:
        return None
    rows = [
        row
        for row in laws.rows
        if row.name in worth and row.left_out is not None and worth[row.name] * row.left_out < paper.left_out
    ]
    best = min(rows, key=lambda row: row.bic, default=None)
    return best.name if best is not None and paper.bic - best.bic > levels.BIC_GAIN else None


def compare_laws(pose: Callable[[Law], Sequence[Regression]], in_force: Law) -> Comparison | None:
    """The laws on points, which `pose` turns into the solves of a law; None where only the paper's can be fitted."""
    fitted, compete = list[Fitted](), competing()
    for law in laws_beside(in_force):
        problems = pose(law)
        if not problems or any(p.torque.size <= len(p.names) + len(p.shape) + 1 for p in problems):
            continue
        shaped = [with_best_shape(p, default_range(p.velocity)) for p in problems]
        solves = [
            (
                solve(p, default_range(p.velocity)).residuals,
                len(p.names) + len(p.shape),
                p.torque.size,
                power_of(p.measured),
            )
            for p in shaped
        ]
        fitted.append(Fitted(law.name, solves, law in compete, partial(_left_out, shaped)))
    return ranked("points", fitted, in_force.name)


def _left_out(problems: Sequence[Regression]) -> LeftOut:
    """Left-out error of points over blocks of speed."""
    total = 0.0
    for problem in problems:
        cost = 0.0
        for part in blocks_of_speed(problem.equation_velocity):
            rest = problem.rows(~part)
            if rest.torque.size <= len(rest.names) or np.linalg.matrix_rank(rest.linear) < rest.linear.shape[1]:
                return None
            low, high = default_range(rest.velocity)
            slowest = float(np.abs(rest.velocity[rest.velocity != 0]).min())
            if slowest < high:  # as in the fit: a peak needs a speed below v_s
                low = max(low, slowest)
            cost += power_of(problem.rows(part).residuals(solve(rest, (low, high)).theta))
        total += cost
    power = sum(power_of(p.measured) for p in problems)
    return 100 * float(np.sqrt(total / power)) if power else None


def ranked(data: Data, fitted: Sequence[Fitted], in_force: str) -> Comparison | None:
    """Fitted laws as a comparison with the chosen one, or None of the paper's alone; `in_force` is the fits'."""
    rows = rows_of(fitted) if fitted else []
    known = {row.name: row.bic for row in rows}
    if GAUSSIAN.name not in known or len(rows) < 2:
        return None
    better = {name for name, bic in known.items() if known[GAUSSIAN.name] - bic > levels.BIC_GAIN}
    doubted = known.get(in_force, -np.inf) - known[GAUSSIAN.name] > levels.BIC_GAIN
    predicted = {*better, GAUSSIAN.name, in_force} if better or doubted else set[str]()
    pairs = zip(fitted, rows, strict=True)
    rows = [replace(row, left_out=x.predicts() if x.name in predicted else None) for x, row in pairs]
    (paper,), others = ([row for row in rows if (row.name == GAUSSIAN.name) == own] for own in (True, False))
    # the lowest BIC among laws clearly better than the paper's, else that
    clearly = [row for row in others if row.candidate and row.name in better and _predicts_better(row, paper)]
    best, other = min(clearly, key=lambda row: row.bic, default=paper), min(others, key=lambda row: row.bic)
    gain = paper.bic - other.bic
    why = (
        "it is not shown to predict speeds that were left out better"
        if better
        else f"{levels.BIC_GAIN:g} lower is required"
    )
    message = (
        f"The data favour no other law than the paper's: the BIC of {other.name} is {abs(gain):.1f} {'lower' if gain > 0 else 'higher'}, "
        f"and {why}."
    )
    sentence = Finding("law-kept", NOTE, message, {"law": other.name, "gain": gain})
    if best is not paper:
        words, numbers = _gain(best, paper)
        sentence = Finding("law-wanted", NOTE, f"The data favour {best.name}: {words}.", numbers)
    return Comparison(
        data=data, n=fitted[0].size, effective=fitted[0].effective, sentence=sentence,
        rows=tuple(replace(row, chosen=row is best) for row in rows),
    )  # fmt: skip  # a list of values


def _predicts_better(row: Row, than: Row) -> bool:
    return (row.left_out or np.inf) < (than.left_out or 0.0)


def _gain(best: Row, own: Row) -> tuple[str, dict[str, Any]]:
    """How much better a law is than another, as words and as numbers."""
    gain, error, before = own.bic - best.bic, best.left_out, own.left_out
    words = (
        f"its BIC is {gain:.1f} lower than that of {own.name}, and its error at left-out speeds is {error:.3g} % of the torque instead "
        f"of {before:.3g} %"
    )
    return words, {"law": best.name, "own": own.name, "gain": gain, "error": error, "before": before}

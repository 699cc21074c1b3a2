"""Comparison of friction models (Coulomb, viscous, Stribeck and LuGre), and of one friction with one per direction."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.experiment.load import Experiment
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.covariance import condition
from bristle.estimation.information import bic, power_of
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.comparison import APART, SYMMETRIC, Comparison, Data, Fitted, rows_of
from bristle.identification.dynamic.descent import carried, fit, with_deflections, without_deflections
from bristle.identification.dynamic.problem import Values, dynamic_problem
from bristle.identification.fits import StaticFit, TrackingFit
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import DIRECTIONS, directions, inertia, moved_in, regressors
from bristle.identification.results import Joint
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.points import point_regressors, points_problem
from bristle.identification.static.problem import Regression, from_records
from bristle.identification.static.set_up import sides_of

COULOMB, VISCOUS, STRIBECK, LUGRE = "Coulomb", "Coulomb + viscous", "Stribeck curve", "LuGre"
"""Nested models; the Stribeck curve (9) adds alpha_1 and v_s, LuGre sigma_0 and sigma_1."""
_STEPS = 100  # most iterations of a LuGre fit: one friction for directions that differ converges slowly
_WORTH = 0.05  # of BIC: the gain at which a fit per direction ends


def compare_models(measured: Measured, joint: Joint) -> tuple[Comparison, ...]:
    """The models on the points, and on the moving runs with LuGre as fitted; none of too few."""
    experiment, found = measured.experiment, list[Comparison | None]()
    law = experiment.fit.friction
    if points := measured.points(hold_out=False):
        sides = sides_of(points) if experiment.fit.directions == "separate" else ("both",)
        asked = [name for name in point_regressors(experiment) if name != "offset" or sides == ("both",)]
        found.append(compared(points_problem(points, sides, asked, law), joint.static))
    if joint.tracking is not None:
        records = measured.moving(hold_out=False)
        sides, (fixed, _) = directions(experiment, records), inertia(experiment)
        asked = [*asked_regressors(experiment, sides)]
        whole, *_ = from_records(records, sides, asked, experiment.fit.every, fixed, law)
        static = {} if points else {d: fit for d, fit in joint.static.items() if not fit.is_superseded}
        found.append(compared(whole, static, joint.tracking))
    return tuple(x for x in found if x is not None)


def compared(whole: Regression, static: Mapping[str, StaticFit], alone: TrackingFit | None = None) -> Comparison | None:
    """Coulomb, viscous and Stribeck friction on the equations of `whole`, and LuGre as fitted to them; None of too few.

    The advice is the lowest BIC among models with the terms that `static` and `alone`, the fits of them, support.
    """
    solves = dict[str, tuple[Array, int]]()
    for model in (COULOMB, VISCOUS, STRIBECK):
        lost = {name for name in whole.linear_names if model == COULOMB and name.name == "alpha_2"}
        problem = whole if model == STRIBECK else replace(whole.without(lost), peaks=())
        if problem.torque.size > len(problem.names) and condition(problem.linear) <= levels.DEPENDENT:
            solution = solve(problem, default_range(problem.velocity))
            solves[model] = solution.residuals, len(problem.names)
    if alone is not None:
        solves[LUGRE] = alone.residuals, _unknowns(alone)
    if not solves:
        return None
    n, effective = whole.torque.size, float(whole.torque.size)
    if alone is not None:
        effective = n / inflation(min((residuals for residuals, _ in solves.values()), key=power_of))
    shown = {name for own in static.values() for name, e in own.parameters.items() if e.value is not None}
    shown |= {name.name for name, e in (alone.parameters if alone else {}).items() if e.value is not None}
    supported = {STRIBECK} if "alpha_1" in shown else {COULOMB, VISCOUS}
    supported |= {LUGRE} if "sigma_0" in shown else set()
    power = power_of(whole.measured)
    fitted = [Fitted(model, [(*own, effective, power)], model in supported) for model, own in solves.items()]
    rows = rows_of(fitted)
    best = min((row for row in rows if row.candidate), key=lambda row: row.bic, default=None)
    sentence = Finding(
        "no-model", CAUTION, "No model with the terms that the fit supports can be fitted to so few points."
    )
    if best is not None:
        others = ", ".join(f"{row.name} {row.bic - best.bic:+.1f}" for row in rows if row is not best)
        message = f"Use {best.name}: of the models with the terms that the fit supports it has the lowest BIC ({others or 'the only one'})."
        sentence = Finding("use-model", NOTE, message, {"model": best.name})
    rows = [replace(row, chosen=row is best) for row in rows]
    data: Data = "points" if alone is None else "moving runs"
    return Comparison(data=data, n=n, effective=effective, rows=tuple(rows), sentence=sentence)


def _unknowns(fit: TrackingFit) -> int:
    """Parameters of LuGre as fitted, with the deflections at the start of its runs."""
    return len(fit.names) + len(fit.starts_of_runs)


class Refitted(NamedTuple):
    """LuGre fitted again to the moving runs."""

    residuals: Array
    parameters: int
    values: Values  # Where the fit ended
    file: NDArray[np.str_]  # Run of each residual


def refitted(
    measured: Measured,
    alone: TrackingFit,
    sides: tuple[str, ...],
    worth: float = 0.0,
    *,
    near: Values | None = None,
    rough: bool = False,
) -> Refitted:
    """LuGre in other directions, or on other records, from `alone`, or `near`, to steps worth less than `worth` of BIC."""
    experiment = measured.experiment
    asked, (fixed, _) = asked_regressors(experiment, sides), inertia(experiment)
    records, law = measured.moving(hold_out=False), experiment.fit.friction
    whole = dynamic_problem(records, sides, asked, experiment.fit.every, fixed, law=law)
    # given values are held in other directions too
    given = {name.name for name in alone.known} - {name.name for name in alone.names if name in alone.known}
    known = carried(whole, {**alone.known, **without_deflections(near or {})})
    problem = replace(whole, fixed={name: x for name, x in known.items() if name.name in given})
    start = {name: x for name, x in known.items() if name not in problem.fixed}
    enough = worth * alone.rms**2 * inflation(alone.residuals) if worth else 0.0
    problem = problem.rough() if rough else problem
    values, minimum = fit(problem, with_deflections(problem, start), _STEPS, enough)
    return Refitted(minimum.residuals, len(problem.names), values, problem.file)


def asked_regressors(experiment: Experiment, sides: tuple[str, ...]) -> tuple[str, ...]:
    """Regressors of moving runs in some directions; an offset only where one friction serves both."""
    asked = regressors(experiment)
    if experiment.fit.regressors is None and "offset" not in asked:
        asked = (*asked, "offset")
    return tuple(name for name in asked if name != "offset" or sides == ("both",))


def bic_of_directions(
    measured: Measured, alone: TrackingFit, each: TrackingFit | None = None
) -> tuple[dict[str, float], Values | None]:
    """BIC of LuGre by `SYMMETRIC` and `APART` (`each`, or fitted here, with its end); empty for one direction."""
    if len(moved_in(measured.moving(hold_out=False))) < len(DIRECTIONS):
        return {}, None
    if each is not None:
        residuals, parameters, end = each.residuals, _unknowns(each), None
    else:
        try:
            residuals, parameters, end, _ = refitted(measured, alone, tuple(DIRECTIONS), _WORTH)
        except InputError:  # a start without influence
            return {}, None
    both = {SYMMETRIC: (alone.residuals, _unknowns(alone)), APART: (residuals, parameters)}
    effective = alone.residuals.size / inflation(min((own for own, _ in both.values()), key=power_of))
    power = power_of(alone.measured)
    return {called: bic(own, count, effective, power) for called, (own, count) in both.items()}, end

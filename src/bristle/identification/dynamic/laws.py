"""Friction laws on moving runs, each by LuGre's fit from where that of the law in force ended.

A slow speed is seldom seen there but in presliding, which a static law would take for its peak. What is left out are
equations: the bristle still passes through all samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import compress, product
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.load import Experiment
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.covariance import covariance, seen
from bristle.estimation.information import power_of
from bristle.estimation.nonlinear import Minimum, Unknowns
from bristle.identification.comparison import Fitted, LeftOut, Solve, blocks_of_speed
from bristle.identification.dynamic.descent import solved, with_deflections
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, dynamic_problem, modelled
from bristle.identification.fits import TrackingFit
from bristle.identification.load_levels import LINEAR
from bristle.identification.moving_runs import LEVELS, directions, inertia, regressors
from bristle.model.laws.parts import Law
from bristle.model.laws.registry import competing
from bristle.model.parameters import INERTIA, ParameterName, in_direction

_STEPS = 40  # of each fit, at the most
_WORTH = 0.05  # of n' log(RSS), n' independent equations: a step that would lower it by less ends a fit
_ROUGH = 4.0  # nodes between samples stand so many times farther apart than usual
_BRISTLE = ("sigma_0", "sigma_1")
_START = {"alpha_1": 0.1, "v_s": 0.1, "load": 0.03}
"""Where a term begins that the law in force does not show: shares of alpha_0, of the fastest speed, and of the load."""
_DAMPING = (1e-8, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)  # added in turn to the squared length of each column, one
_LEAST = 0.05  # of a change of the torque: that much of it is never made by the torque itself


class MovingLaw(NamedTuple):
    """A law fitted to moving runs."""

    name: str
    """As `fit.law` takes it."""
    law: Law
    problem: DynamicProblem
    values: Mapping[Unknown, float]
    minimum: Minimum
    """Over the scaled unknowns."""
    unknowns: Unknowns[Unknown]

    @property
    def effective(self) -> float:
        """How many equations are independent."""
        return self.minimum.residuals.size / inflation(self.minimum.residuals)

    def fitted(self, effective: float) -> Fitted:
        """The same where so many equations are independent; what it predicts of blocks of speed is worked out when it is asked for."""
        residuals, names = self.minimum.residuals, self.problem.names
        free = seen(self.minimum.jacobian)
        freedom = residuals.size / max(effective, 1.0)
        matrix, own_freedom = covariance(self.minimum.jacobian[:, free], power_of(residuals), freedom)
        errors = np.sqrt(np.diag(matrix)) * np.abs(self.unknowns.slopes(self.minimum.x)[free])
        pairs = zip(compress(names, free), errors.tolist(), strict=True)
        power, itself = power_of(self.problem.measured), float(np.log(self._not_itself()).sum())
        return Fitted(
            name=self.name,
            solves=(Solve(residuals, len(names), effective, power, itself),),
            candidate=self.law.name in {law.name for law in competing()},
            predicts=self._left_out,
            known={n: (self.values[n], e, own_freedom) for n, e in pairs if isinstance(n, ParameterName)},
        )

    def _not_itself(self) -> Array:
        """The share of a change of each equation's torque that its own law does not make of it, (n,): one without a load."""
        known = {n.name: x for n, x in {**self.problem.fixed, **self.values}.items() if isinstance(n, ParameterName)}
        rows = [
            m.smoothed(np.ones(m.velocity.size) if m.load is None else 1 - np.sign(m.velocity) * m.load.by_motor(known))
            for m in self.problem.motions
        ]
        return np.maximum(np.concatenate(rows), _LEAST)

    def _left_out(self) -> LeftOut:
        """Over blocks of speed, each predicted from all others.

        The others' own minimum is one step of Gauss and Newton away from that of all, damped where it would leave them more;
        the first equation of each motion is always among them, without which its deflection would be anything.
        """
        x_all, _, residuals, jacobian, *_ = self.minimum
        problem, unknowns, share, total = self.problem, self.unknowns, self._not_itself(), 0.0
        first = [block.rows.start for block in problem.blocks]
        size = np.sqrt((jacobian**2).sum(axis=0))
        free, measured = (size > 0) & (x_all > unknowns.lower) & (x_all < unknowns.upper), problem.measured
        J = jacobian[:, free] / size[free]
        gram, slope = J.T @ J, J.T @ residuals
        for part in blocks_of_speed(problem.velocity):
            out = part.copy()
            out[first] = False
            if part.size - out.sum() < free.sum():
                return None
            rest, pull = gram - J[out].T @ J[out], slope - J[out].T @ residuals[out]
            left = residuals
            for damping in _DAMPING:
                x = x_all.copy()
                x[free] -= np.linalg.solve(rest + damping * np.eye(pull.size), pull) / size[free]
                x = np.clip(x, unknowns.lower, unknowns.upper)
                model = modelled(problem, {**self.values, **unknowns.values(x)})
                trial = measured - np.concatenate([m.smoothed(T) for m, T in zip(problem.motions, model, strict=True)])
                if power_of(trial[~out]) <= power_of(residuals[~out]):
                    left = trial
                    break
            total += power_of(left[part] / share[part])
        power = power_of(measured)
        return 100 * float(np.sqrt(total / power)) if power else None


def fitted_to_motion(
    experiment: Experiment, records: Sequence[Record], alone: TrackingFit, law: Law, load: tuple[str, ...] = ()
) -> MovingLaw | None:
    """LuGre of a law on moving runs, from where the fit of another ended; None where that shows nothing, or is too few equations.

    What that fit held, its bristle and what the experiment fixes, is held here too; a Stribeck term is free in every direction.
    """
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
    motions = tuple(replace(m, coarsening=_ROUGH) for m in whole.motions)
    problem = replace(whole, fixed=known, motions=motions)
    if problem.size <= len(problem.names) + 1:
        return None
    # the values of the other law; a small peak where it has none, no other term, an inertia above zero
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
        enough = _WORTH * alone.rms**2 * inflation(alone.residuals)
        posed, minimum = solved(problem, with_deflections(problem, start), _STEPS, enough=enough)
    except InputError:  # a start that shows nothing is no reason to fail
        return None
    values = posed.unknowns.values(minimum.x)
    return MovingLaw("+".join((law.name, *load)), law, problem, values, minimum, posed.unknowns)

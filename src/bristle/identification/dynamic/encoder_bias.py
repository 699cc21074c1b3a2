"""What encoder counts do to a fit of moving data.

A parametric bootstrap at the estimate measures the bias, and takes it off.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bristle.arrays import Array
from bristle.control.plant import quantise
from bristle.data.differentiation import derivative, estimate_motion, smoothed, usable
from bristle.data.record import Record
from bristle.diagnostics import Kind
from bristle.identification.dynamic.fit import DynamicSolution
from bristle.identification.dynamic.problem import DynamicProblem, modelled
from bristle.identification.dynamic.unknowns import fit
from bristle.identification.fits import TrackingFit
from bristle.model.parameters import ParameterName

REPETITIONS = 6
"""Rest positions inside a count at which the motion is measured again."""
_STEPS = 8
"""Steps from the estimate to where counting moves it: without noise the last digits would take many more."""
_SEED = 0
Pose = Callable[[Sequence[Record], Mapping[ParameterName, float]], DynamicProblem]


def without_count_bias(
    solved: DynamicSolution, records: Sequence[Record], pose: Pose, cutoff: float, resolution: float
) -> TrackingFit:
    """The fit with the bias that counting adds taken off each parameter, and its scatter added to the standard error.

    The smoothed motion stands for the true one: at the estimate it gives a torque without noise; counted anew, with the
    joint resting elsewhere in a count, and differentiated as the data were, it gives other estimates. Their mean
    distance from the estimate is the bias.

    Args:
        solved: the fit.
        records: its training runs, whose velocity comes from the position.
        pose: makes the problem from such runs, with some parameters fixed.
        cutoff: of the position, Hz.
        resolution: one count, rad.
    """
    if any(r.position is None for r in records):
        return solved.fit
    rng = np.random.default_rng(_SEED)
    true = [_as_if_true(r, cutoff) for r in records]
    torque = np.concatenate(modelled(pose(true, solved.problem.fixed), solved.values))
    torques = np.split(torque, np.cumsum([r.time.size for r in true])[:-1])
    # the priors now say what the estimate says, else their pull on it would be called a bias of counts
    priors = tuple(
        replace(prior, value=np.array([solved.values[name] for name in prior.names])) for prior in solved.problem.priors
    )
    known = [name for name in solved.problem.names if isinstance(name, ParameterName)]
    ends = []
    for _ in range(REPETITIONS):
        counted = [_counted(r, T, cutoff, resolution, rng.uniform()) for r, T in zip(true, torques, strict=True)]
        posed = pose(counted, solved.problem.fixed)
        pairs = zip(posed.motions, solved.problem.motions, strict=True)
        motions = tuple(replace(m, weight=fitted.weight) for m, fitted in pairs)
        problem = replace(posed, motions=motions, priors=priors, sigma=solved.problem.sigma)
        values, _ = fit(problem, solved.values, _STEPS)
        ends.append([values[name] for name in known])
    bias = np.mean(ends, axis=0) - np.array([solved.values[name] for name in known])
    moved = zip(known, bias.tolist(), np.std(ends, axis=0).tolist(), strict=True)
    return _corrected(solved.fit, {name: both for name, *both in moved})


def _as_if_true(record: Record, cutoff: float) -> Record:
    smooth = smoothed(record, np.asarray(record.position), usable(record, cutoff))
    return replace(
        record, position=smooth, velocity=derivative(record, smooth), acceleration=derivative(record, smooth, 2)
    )


def _counted(record: Record, torque: Array, cutoff: float, resolution: float, phase: float) -> Record:
    position = np.asarray(quantise(np.asarray(record.position) + phase * resolution, resolution)).ravel()
    return replace(
        estimate_motion(replace(record, position=position, velocity=None, acceleration=None), cutoff), torque=torque
    )


def _corrected(biased: TrackingFit, moved: Mapping[ParameterName, Sequence[float]]) -> TrackingFit:
    """The fit with the bias of each parameter taken off, and the scatter that comes with it, both in `moved`."""
    parameters, large = dict(biased.parameters), []
    for name, e in biased.parameters.items():
        if e.value is None or e.standard_error is None or e.interval is None or name not in moved:
            continue
        bias, scatter = moved[name]
        if abs(bias) > e.standard_error:
            large.append(name)
        new = e.value - bias if (e.value - bias) * e.value > 0 else e.value
        wider = float(np.hypot(e.standard_error, scatter)) / e.standard_error if e.standard_error else 1.0
        low, high = e.interval
        ends = max(new - (e.value - low) * wider, 0.0 if low >= 0 else -np.inf), new + (high - e.value) * wider
        parameters[name] = replace(e, value=new, standard_error=e.standard_error * wider, interval=ends)
    warning = (Kind.COUNT_BIAS(names=tuple(large)),) if large else ()
    return replace(
        biased,
        parameters=parameters,
        count_bias={n: bias for n, (bias, _) in moved.items()},
        warnings=(*biased.warnings, *warning),
    )

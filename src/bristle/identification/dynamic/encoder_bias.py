"""What encoder counts do to a fit of moving data.

A parametric bootstrap at the estimate measures the bias, and takes it off. The motion that stands for the true one is
the smoothest that the counts allow: readings that are only differentiated carry the counts themselves, and counting
them again shows hardly any bias. It keeps as near to the readings as these to the truth, q / sqrt(12) for a count q, so
that by the triangle inequality it errs by at most twice as much as they do. A fit that explains it more than twice as
badly as the readings is one of the counts, and so is one that, of its own torque, would leave more than twice what the
readings leave of the measured one. Then nothing is taken off, and presliding and the peak are not identifiable.

The bias b is that at the estimate. With a parameter theta it changes by about b / theta of itself on the way from the
estimate to the truth; where this is more than half a standard error, and b more than one, the parameter is not
identifiable.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bristle.control.plant import quantise
from bristle.data.differentiation import LOWEST, derivative, estimate_motion, smoothed
from bristle.data.record import Record
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.dynamic.claims import warned, without_weak
from bristle.identification.dynamic.descent import fit
from bristle.identification.dynamic.fit import OF_PHYSICS, DynamicSolution, physics
from bristle.identification.dynamic.problem import DynamicProblem, modelled, residuals
from bristle.identification.fits import TrackingFit
from bristle.identification.shared_findings import not_shown
from bristle.model.parameters import ParameterName, of_friction

REPETITIONS = 6  # rest positions inside a count at which the motion is measured again
_STEPS = 8  # steps from the estimate to where counting moves it: what counts hide may take many more
_EXACT = 0.03  # of a standard error, to which that place is found: six of them scatter by more
_SEED = 0
_LOST = 2.0  # times the residuals at the readings, which those at the smooth motion may have
_UNSURE = 0.5  # of a standard error, by which the bias may change on the way to the truth
_LADDER = 1.25  # between two cut-offs tried
_SLOW = ("alpha_1", "v_s", "sigma_0", "sigma_1")  # what shows near reversals alone
Pose = Callable[[Sequence[Record], Mapping[ParameterName, float]], DynamicProblem]


def without_count_bias(
    solved: DynamicSolution, records: Sequence[Record], pose: Pose, resolution: float
) -> TrackingFit:
    """The fit with the bias that counting adds taken off each parameter, and its scatter added to the standard error.

    The smoothest motion that the counts allow stands for the true one: at the estimate it gives a torque without noise;
    counted anew, with the joint resting elsewhere in a count, and differentiated as the data were, it gives other
    estimates. Their mean distance from that without counts, differentiated alike, is the bias: what filters alone do,
    at the ends of runs above all, is not that of counts. What counts hide loses its value.

    `records` are the training runs, whose velocity comes from the position; `pose` makes the problem from such runs, with
    some parameters fixed; `resolution` is one count, rad.
    """
    if any(r.position is None for r in records):
        return solved.fit
    rng, true = np.random.default_rng(_SEED), [between_counts(r, resolution) for r in records]
    smooth = pose(true, solved.problem.fixed)
    # root mean square residuals of the smooth motion over those of the readings, both at the estimate
    left, right = (float(np.linalg.norm(residuals(x, solved.values)[0])) for x in (smooth, solved.problem))
    ratio = left / max(right, 1e-300)
    if ratio > _LOST:
        return _of_counts(solved, ratio)
    whole = np.concatenate(modelled(smooth, solved.values))
    torques = np.split(whole, np.cumsum([r.time.size for r in true])[:-1])
    # the priors now say what the estimate says, else their pull on it would be called a bias of counts
    told = ([solved.values[name] for name in prior.names] for prior in solved.problem.priors)
    priors = tuple(replace(x, value=np.array(own)) for x, own in zip(solved.problem.priors, told, strict=True))
    known = [name for name in solved.problem.names if isinstance(name, ParameterName)]
    minimum, ends = solved.solution.minimum, []
    enough = _EXACT**2 * minimum.cost / minimum.residuals.size
    for count in (0.0, *[resolution] * REPETITIONS):
        counted = list[Record]()  # the motion by an encoder of such counts, 0: without, that rests anywhere in one
        for r, torque in zip(true, torques, strict=True):
            position, phase = np.asarray(r.position), rng.uniform()
            position = np.asarray(quantise(position + phase * count, count)).ravel() if count else position
            bare = replace(r, position=position, velocity=None, acceleration=None)
            counted.append(replace(estimate_motion(bare, r.cutoff), torque=torque))
        posed = pose(counted, solved.problem.fixed)
        pairs = zip(posed.motions, solved.problem.motions, strict=True)
        motions = tuple(replace(m, weight=fitted.weight) for m, fitted in pairs)
        problem = replace(posed, motions=motions, priors=priors, sigma=solved.problem.sigma)
        values, moved = fit(problem, solved.values, _STEPS, enough)
        ratio = float(np.sqrt(moved.cost / max(minimum.cost, 1e-300)))
        if count and ratio > _LOST:
            return _of_counts(solved, ratio)
        ends.append([values[name] for name in known])
    uncounted, *ends = ends
    bias = np.mean(ends, axis=0) - np.array(uncounted)
    by_name = {name: both for name, *both in zip(known, bias.tolist(), np.std(ends, axis=0).tolist(), strict=True)}
    judged = _doubted(solved, *_corrected(solved.fit, by_name))
    # verdicts that need no data are about the values without the bias
    lost = {name: e for name, e in judged.parameters.items() if e.value is None}
    rest = (w for w in judged.warnings if w.code not in OF_PHYSICS)
    return replace(judged, warnings=(*rest, *physics(solved.problem, {**solved.values, **judged.known}, lost)))


def between_counts(record: Record, resolution: float) -> Record:
    """The record with the smoothest motion that leaves of its positions, (n,), no more than counts of this size do.

    As it is where it has none. The low pass of `estimate_motion` with the lowest cut-off, from the record's own down, whose
    root mean square distance from the readings is at most that of counts, resolution / sqrt(12), rad. Raises InputError
    as `smoothed` does.
    """
    if record.position is None:
        return record
    position = np.asarray(record.position)
    smooth, lower = smoothed(record, position, record.cutoff), record.cutoff / _LADDER
    while lower * record.step > LOWEST:
        smoother = smoothed(record, position, lower)
        if np.sqrt(np.mean((smoother - position) ** 2)) > resolution / np.sqrt(12):
            break
        smooth, lower = smoother, lower / _LADDER
    velocity, acceleration = (derivative(record, smooth, order) for order in (1, 2))
    return replace(record, position=smooth, velocity=velocity, acceleration=acceleration)


def _of_counts(solved: DynamicSolution, ratio: float) -> TrackingFit:
    """The fit where it is one of the counts: without what shows near reversals alone, and with its biases unknown."""
    slow = (n for n, e in solved.fit.parameters.items() if n.name in _SLOW and n in solved.values and e.value)
    message = (
        "Not identifiable from this motion: a motion between the encoder's counts would explain the torque "
        f"{ratio:.2g} times worse than the counts themselves, so that what was fitted is theirs; a finer encoder would "
        "show it."
    )
    why = Finding("unseen-in-counts", NOTE, message, {"ratio": ratio})
    left = _doubted(solved, solved.fit, dict.fromkeys(slow, why))
    message = (
        "Encoder counts decide this fit: what they add to its numbers cannot be told, and is not subtracted. Take a finer "
        "encoder, or fit.predict: position, which simulates the motor and differentiates nothing."
    )
    return replace(left, warnings=(*left.warnings, Finding("count-bias-unknown", CAUTION, message)))


def _doubted(solved: DynamicSolution, fit: TrackingFit, doubts: Mapping[ParameterName, Finding]) -> TrackingFit:
    """The fit without the values that counts hide, which stay fixed as they were found."""
    estimates = without_weak(solved.problem, warned(fit.parameters, doubts))
    unseen = [name for name, e in estimates.items() if e.value is None]
    lost = {n: solved.values[n] for n in unseen if n in solved.values}
    rest = (w for w in fit.warnings if w.code != "unseen")
    return replace(fit, parameters=estimates, fixed={**fit.fixed, **lost}, warnings=(*rest, *not_shown(unseen)))


def _corrected(
    biased: TrackingFit, moved: Mapping[ParameterName, Sequence[float]]
) -> tuple[TrackingFit, dict[ParameterName, Finding]]:
    """The fit without the bias of each parameter, with its scatter, both in `moved`; and doubts where it changes too much up to the truth."""
    parameters, large, doubts = dict(biased.parameters), [], dict[ParameterName, Finding]()
    for name, e in biased.parameters.items():
        if e.value is None or e.standard_error is None or name not in moved:
            continue
        (bias, scatter), value, error = moved[name], e.value, e.standard_error
        if of_friction(name.name) and value and error:
            errors, share = abs(bias) / error, abs(bias / value)
            if errors > 1 and errors * share > _UNSURE:
                message = (
                    f"Not identifiable from this motion: encoder counts bias it by {100 * share:.0f} % of its value, "
                    f"{errors:.1f} standard errors, too much to be subtracted; a finer encoder would show it."
                )
                doubts[name] = Finding("unseen-biased", NOTE, message, {"share": share, "errors": errors})
        if e.interval is None:
            continue
        if abs(bias) > error:
            large.append(name)
        new = value - bias if (value - bias) * value > 0 else value
        wider, (low, high) = float(np.hypot(error, scatter)) / error if error else 1.0, e.interval
        ends = max(new - (value - low) * wider, 0.0 if low >= 0 else -np.inf), new + (high - value) * wider
        parameters[name] = replace(e, value=new, standard_error=error * wider, interval=ends)
    message = (
        f"Encoder counts bias {', '.join(map(str, large))} by more than a standard error. The bias was subtracted, but a "
        "finer encoder is better, or fit.predict: position, which simulates the motor and differentiates nothing."
    )
    warning = (Finding("count-bias", CAUTION, message, {"names": tuple(large)}),) if large else ()
    bias_of = {name: bias for name, (bias, _) in moved.items()}
    return replace(biased, parameters=parameters, count_bias=bias_of, warnings=(*biased.warnings, *warning)), doubts

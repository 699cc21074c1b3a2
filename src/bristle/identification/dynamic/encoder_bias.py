"""Bias of moving fits by encoder counts, from a parametric bootstrap at the estimate.

The smoothest motion within the counts stands for the true one: within q / sqrt(12) of the readings for a count q, rms,
and within q everywhere. If it explains the torque more than twice as badly as the readings, the fit is one of counts:
nothing is subtracted, and presliding and the peak are not identifiable. A bias b changes by about b / theta of itself
up to the truth; a parameter with more than half a standard error of that, and b above one, is not identifiable.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bristle.control.plant import quantise
from bristle.data.differentiation import LOWEST, derivative, estimate_motion, smoothed
from bristle.data.record import Record
from bristle.data.sampling import with_motion
from bristle.estimation import levels
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.dynamic.claims import warned, without_weak
from bristle.identification.dynamic.descent import fit
from bristle.identification.dynamic.fit import OF_PHYSICS, DynamicSolution, physics
from bristle.identification.dynamic.problem import DynamicProblem, modelled, residuals
from bristle.identification.fits import TrackingFit
from bristle.identification.shared_findings import not_shown
from bristle.model.parameters import ParameterName, of_friction

REPETITIONS = 6  # rest positions in a count
_STEPS = 8  # most steps of each fit
_EXACT = 0.03  # of a standard error: tolerance of each fit
_SEED = 0
_LADDER = 1.25  # ratio of successive cut-offs
_SLOW = ("alpha_1", "v_s", "sigma_0", "sigma_1")  # seen near reversals alone
Pose = Callable[[Sequence[Record], Mapping[ParameterName, float]], DynamicProblem]


def without_count_bias(
    solved: DynamicSolution, records: Sequence[Record], pose: Pose, resolution: float
) -> TrackingFit:
    """The fit with the bias of counts of `resolution`, rad, subtracted, its scatter added to the errors."""
    if any(r.position is None or r.integrated for r in records):
        return solved.fit
    rng, true = np.random.default_rng(_SEED), [between_counts(r.fine or r, resolution) for r in records]
    smooth = pose([with_motion(r, x) for r, x in zip(records, true, strict=True)], solved.problem.fixed)
    # root mean square residuals of the smooth motion over those of the readings, both at the estimate
    left, right = (float(np.linalg.norm(residuals(x, solved.values)[0])) for x in (smooth, solved.problem))
    ratio = left / max(right, 1e-300)
    if ratio > levels.MUCH_WORSE:
        return _of_counts(solved, ratio)
    whole = np.concatenate(modelled(smooth, solved.values))
    torques = np.split(whole, np.cumsum([r.time.size for r in records])[:-1])
    # the priors now say what the estimate says, else their pull on it would be called a bias of counts
    told = ([solved.values[name] for name in prior.names] for prior in solved.problem.priors)
    priors = tuple(replace(x, value=np.array(own)) for x, own in zip(solved.problem.priors, told, strict=True))
    known = [name for name in solved.problem.names if isinstance(name, ParameterName)]
    minimum, ends = solved.solution.minimum, []
    enough = _EXACT**2 * minimum.cost / minimum.residuals.size
    for count in (0.0, *[resolution] * REPETITIONS):
        counted = list[Record]()  # the motion by an encoder of such counts, 0: without, that rests anywhere in one
        for record, r, torque in zip(records, true, torques, strict=True):
            position, phase = np.asarray(r.position), rng.uniform()
            position = np.asarray(quantise(position + phase * count, count)).ravel() if count else position
            bare = replace(r, position=position, velocity=None, acceleration=None)
            there = with_motion(record, estimate_motion(bare, r.cutoff))
            counted.append(replace(there, torque=torque))  # the same equations
        posed = pose(counted, solved.problem.fixed).with_weights(solved.problem.weight)
        problem = replace(posed, priors=priors, sigma=solved.problem.sigma).rough()
        values, moved = fit(problem, solved.values, _STEPS, enough)
        ratio = float(np.sqrt(moved.cost / max(minimum.cost, 1e-300)))
        if count and ratio > levels.MUCH_WORSE:
            return _of_counts(solved, ratio)
        ends.append([values[name] for name in known])
    uncounted, *ends = ends
    bias = np.mean(ends, axis=0) - np.array(uncounted)
    by_name = {name: both for name, *both in zip(known, bias.tolist(), np.std(ends, axis=0).tolist(), strict=True)}
    judged = _doubted(solved, *_corrected(solved.fit, by_name))
    # verdicts that need no data are about the values without the bias
    rest = (w for w in judged.warnings if w.code not in OF_PHYSICS)
    return replace(
        judged, warnings=(*rest, *physics(solved.problem, {**solved.values, **judged.known}, judged.parameters))
    )


def between_counts(record: Record, resolution: float) -> Record:
    """The record with the smoothest motion within resolution / sqrt(12), rad, rms, and a count of its positions."""
    if record.position is None:
        return record
    position = np.asarray(record.position)
    smooth, lower = smoothed(record, position, record.cutoff), record.cutoff / _LADDER
    while lower * record.step > LOWEST:
        smoother = smoothed(record, position, lower)
        off = np.abs(smoother - position)
        if np.sqrt(np.mean(off**2)) > resolution / np.sqrt(12) or off.max() > resolution:
            break
        smooth, lower = smoother, lower / _LADDER
    velocity, acceleration = (derivative(record, smooth, order) for order in (1, 2))
    return replace(record, position=smooth, velocity=velocity, acceleration=acceleration)


def _of_counts(solved: DynamicSolution, ratio: float) -> TrackingFit:
    """The fit without what shows near reversals alone, and with a caution that counts decide it."""
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
        "encoder."
    )
    return replace(left, warnings=(*left.warnings, Finding("count-bias-unknown", CAUTION, message)))


def _doubted(solved: DynamicSolution, fit: TrackingFit, doubts: Mapping[ParameterName, Finding]) -> TrackingFit:
    """The fit without the values that counts hide, which stay fixed."""
    estimates = without_weak(solved.problem, warned(fit.parameters, doubts))
    unseen = [name for name, e in estimates.items() if e.value is None]
    lost = {n: solved.values[n] for n in unseen if n in solved.values}
    rest = (w for w in fit.warnings if w.code != "unseen")
    return replace(fit, parameters=estimates, fixed={**fit.fixed, **lost}, warnings=(*rest, *not_shown(unseen)))


def _corrected(
    biased: TrackingFit, moved: Mapping[ParameterName, Sequence[float]]
) -> tuple[TrackingFit, dict[ParameterName, Finding]]:
    """The fit less the bias, with its scatter, both in `moved`; and doubts where the bias is too large."""
    parameters, large, doubts = dict(biased.parameters), [], dict[ParameterName, Finding]()
    for name, e in biased.parameters.items():
        if e.value is None or e.standard_error is None or name not in moved:
            continue
        (bias, scatter), value, error = moved[name], e.value, e.standard_error
        if of_friction(name.name) and value and error:
            errors, share = abs(bias) / error, abs(bias / value)
            if errors > 1 and errors * share > levels.BIAS_UNSURE:
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
        "finer encoder is better."
    )
    warning = (Finding("count-bias", CAUTION, message, {"names": tuple(large)}),) if large else ()
    bias_of = {name: bias for name, (bias, _) in moved.items()}
    return replace(biased, parameters=parameters, count_bias=bias_of, warnings=(*biased.warnings, *warning)), doubts

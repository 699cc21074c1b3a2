"""The links of a robot: torque constants from their known torque, and plausibility of log and URDF."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from bristle.arrays import Array
from bristle.data.bandwidth import decimation
from bristle.data.experiment.load import Experiment
from bristle.data.record import Record
from bristle.data.robot.motion import RigidBody
from bristle.estimation import levels
from bristle.estimation.covariance import student
from bristle.findings import CAUTION, CRITICAL, Finding
from bristle.identification.dynamic.fit import fit_tracking
from bristle.identification.dynamic.priors import posed_and_start
from bristle.identification.fits import Estimate
from bristle.identification.moving_runs import decimator, directions, regressors
from bristle.identification.static.fit import estimate_static, fit_moving
from bristle.identification.static.problem import from_records
from bristle.model.parameters import Direction, Kind, ParameterName, unit

_SAMPLES = 4000  # by which orders are compared


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkScale:
    """Scale of the links' torque in a joint's logged torque."""

    scale: float  # Units of the logged torque per N*m
    error: float
    explained: float  # RMS explained by the links alone, in the logged unit
    left: float  # RMS of the residuals

    @property
    def told(self) -> bool:
        """Whether the links' torque stands out of the residuals."""
        return self.explained > self.left and levels.SURE * self.error < abs(self.scale)


UNSEEN = LinkScale(scale=0.0, error=np.inf, explained=0.0, left=0.0)  # without information


def link_scale(experiment: Experiment, records: Sequence[Record]) -> LinkScale:
    """The scale by the static fit with links as regressor; UNSEEN of too few samples."""
    if not records:
        return UNSEEN
    asked = tuple(dict.fromkeys((*regressors(experiment), "links")))
    every = experiment.fit.decimation or decimation(records)
    problem = from_records(records, directions(experiment, records), asked, every, None)[0]
    if problem.torque.size <= len(problem.names):
        return UNSEEN
    estimate = estimate_static(problem, experiment.fit, experiment.joint.kind)["links"]
    value, error = estimate.value or 0.0, estimate.standard_error or np.inf
    # RMS of the links' column beside the others, and of the torque beside all
    links = next(k for k, name in enumerate(problem.linear_names) if name.name == "links")
    others = np.delete(problem.linear, links, axis=1)
    pairs = ((problem.linear[:, links], others), (problem.torque, problem.linear))
    rests = (y - A @ np.linalg.lstsq(A, y, rcond=None)[0] for y, A in pairs)
    own, left = (float(np.sqrt(np.mean(rest**2))) for rest in rests)
    return LinkScale(scale=value, error=error, explained=abs(value) * own, left=left)


def scale_beside_bristles(experiment: Experiment, records: Sequence[Record], found: LinkScale) -> LinkScale:
    """The scale by the LuGre fit with links as a regressor, where it is more precise and fits better."""
    if not found.scale:
        return found
    static = fit_moving(experiment, records, ())
    problem, start = posed_and_start(experiment, directions(experiment, records), records, static, None)
    fit = fit_tracking(problem, start, experiment.joint.kind).fit
    links = fit.parameters[ParameterName("links", Direction.SHARED)]
    if not links.value or not links.standard_error or links.standard_error > found.error or fit.rms >= found.left:
        return found
    explained = found.explained * abs(links.value / found.scale)
    return LinkScale(scale=links.value, error=links.standard_error, explained=explained, left=fit.rms)


def torque_constant(found: LinkScale, kind: Kind, effort: str = "A") -> Estimate:
    """N*m or N per unit of effort, as the links tell it; without a value where they do not."""
    of = unit("torque", kind)
    in_torque = f"{of}/{effort}"
    if found.scale + levels.SURE * found.error < 0 and found.explained > found.left:
        message = (
            f"The effort goes against the torque of the links ({found.scale:.3g} +/- {found.error:.2g} {effort}/({of})): check "
            "gravity, the order of the joints, and the sign of the effort."
        )
        why = Finding("links-oppose", CRITICAL, message, {"scale": found.scale, "error": found.error})
        return Estimate(value=None, unit=in_torque, warnings=(why,))
    if not found.told or found.scale <= 0:
        message = (
            f"Torque per {effort} not identifiable: the links explain {found.explained:.2g} {effort}, and {found.left:.2g} {effort} stay "
            f"unexplained. Friction is in {effort}; give the constant under motor, or log a motion that loads this joint more."
        )
        why = Finding("constant-unseen", CAUTION, message, {"explained": found.explained, "left": found.left})
        return Estimate(value=None, unit=in_torque, warnings=(why,))
    reach, error = student(np.inf) * found.error, found.error / found.scale**2
    digits = 2 - int(np.floor(np.log10(error)))  # of the error three: it is printed wherever a torque is spoken of
    value, ends = round(1 / found.scale, digits), (1 / (found.scale + reach), 1 / (found.scale - reach))
    return Estimate(value=value, unit=in_torque, standard_error=round(error, digits), interval=ends)


def scale_warnings(found: LinkScale) -> Iterator[Finding]:
    """A caution where known links would fit with another scale."""
    if found.explained > found.left and abs(found.scale - 1) > max(levels.SURE * found.error, levels.LINKS_OFF):
        message = (
            f"The torque of the links would fit {found.scale:.3g} +/- {found.error:.2g} times as large as the URDF has it: "
            "check its masses, robot.payload and the torque constant."
        )
        yield Finding("links-scale", CAUTION, message, {"scale": found.scale, "error": found.error})


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """Motion and torques of all joints in one run, (n, joints), at times (n,)."""

    time: Array
    q: Array
    v: Array
    a: Array
    torque: Array  # As logged
    kinds: tuple[str, ...]


def thinned(course: Course, decimation: int, file: str) -> tuple[Course, Array]:
    """The course through the decimation filter, and whether each joint moves up, then down, (n, 2 joints)."""
    smooth, _ = decimator([np.array([course.time.size])], decimation, file)
    moved = np.hstack([course.v > 0, course.v < 0]).astype(float)
    filtered = np.asarray(smooth @ np.hstack([course.q, course.v, course.a, course.torque, moved]))
    every = max(1, len(filtered) // _SAMPLES)
    q, v, a, torque, *ways = np.split(filtered[::every], 6, axis=1)
    time = np.asarray(smooth @ course.time)[::every]
    return replace(course, time=time, q=q, v=v, a=a, torque=torque), np.hstack(ways)


def _score(course: Course, moved: Array, links: Array) -> float:
    """Sum over joints of log(relative error) of friction, own inertia and scaled links."""
    joints, total = course.q.shape[1], 0.0
    for k in range(joints):
        y = course.torque[:, k]
        A = np.column_stack([moved[:, k], -moved[:, joints + k], course.v[:, k], course.a[:, k]])
        rest, own = (x - A @ np.linalg.lstsq(A, x, rcond=None)[0] for x in (y, links[:, k]))
        size = float(own @ own)
        scale = max(float(own @ rest) / size, 0.0) if size > 0 else 0.0
        total += 0.5 * float(np.log(np.mean((rest - scale * own) ** 2) / np.mean(y**2)))
    return total


def order_warnings(
    course: Course, moved: Array, names: Sequence[str], body: RigidBody, gravity: Sequence[float]
) -> tuple[Finding, ...]:
    """A finding where another order of columns (two swapped, or reversed) or another gravity fits the URDF better."""
    links = body.torques(course.q, course.v, course.a, gravity=gravity)
    as_given, found, identity = _score(course, moved, links), [], list(range(len(names)))
    swapped = ([k if x == i else i if x == k else x for x in identity] for i, k in combinations(identity, 2))
    for order in (identity[::-1], *swapped):
        if order == identity or any(course.kinds[i] != course.kinds[k] for i, k in enumerate(order)):
            continue
        other = replace(course, **{name: getattr(course, name)[:, order] for name in ("q", "v", "a", "torque")})
        both = np.hstack([part[:, order] for part in np.split(moved, 2, axis=1)])
        whole = _score(other, both, body.torques(other.q, other.v, other.a, gravity=gravity))
        alone = _score(replace(course, torque=other.torque), moved, links)
        for score, what in ((whole, "columns"), (alone, "torque or current")):
            swaps = tuple(f"{names[i]} takes the {what} of {names[k]}" for i, k in enumerate(order) if i != k)
            message = (
                f"The log goes better with the URDF where {', '.join(swaps)} (sum of log relative errors lower by "
                f"{as_given - score:.2g}). Check the order of the columns against the names of the joints."
            )
            numbers = {"swaps": swaps, "gain": as_given - score}
            found.append((score, Finding("joint-order", CRITICAL, message, numbers)))
    size = float(np.linalg.norm(gravity))
    for direction in [(s * size * e).tolist() for e in np.eye(3) for s in (1.0, -1.0)] if size else []:
        score = _score(course, moved, body.torques(course.q, course.v, course.a, gravity=direction))
        better = tuple(round(x, 2) + 0.0 for x in direction)
        message = (
            f"The log goes better with gravity along {', '.join(map(str, better))} m/s**2 in the frame of the base (sum of "
            f"log relative errors lower by {as_given - score:.2g}). Check robot.gravity, and the signs of positions and "
            "torques."
        )
        numbers = {"better": better, "gain": as_given - score}
        found.append((score, Finding("gravity-direction", CRITICAL, message, numbers)))
    best, warning = min(found, key=lambda x: x[0], default=(as_given, None))
    return (warning,) if warning is not None and best < as_given - levels.ORDER_BETTER else ()


def coupling(course: Course, moved: Array, joint: int) -> float:
    """Share of a torque's RMS that the motion of other joints explains."""
    joints, y, k = course.q.shape[1], course.torque[:, joint], joint
    own = [moved[:, k], -moved[:, joints + k], course.v[:, k], course.a[:, k], np.ones(len(y))]
    sums = [course.q[:, i : j + 1].sum(axis=1) for i in range(joints) for j in range(i, joints)]
    more = [f(x) for x in sums for f in (np.sin, np.cos)] + list(np.delete(course.a, k, axis=1).T)
    A, B = np.column_stack(own), np.column_stack([*own, *more])
    left = [y - X @ np.linalg.lstsq(X, y, rcond=None)[0] for X in (A, B)]
    before, after = (float(x @ x) / max(len(y) - X.shape[1], 1) for x, X in zip(left, (A, B), strict=True))
    return float(np.sqrt(max(before - after, 0.0) / np.mean(y**2)))

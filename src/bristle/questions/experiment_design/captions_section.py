"""What each figure of a plan shows, in a sentence with a number: the beginning of its caption."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from bristle.arrays import Array
from bristle.model.parameters import unit
from bristle.page.wording import counted, direction, number, pretty, symbol, two_digits
from bristle.questions.experiment_design.excitation import MotionDesign
from bristle.questions.experiment_design.figures import CEILING, percentage
from bristle.questions.experiment_design.plan import Plan
from bristle.questions.experiment_design.velocities import errors_by_v_s


def captions(plan: Plan) -> dict[str, str]:
    """By figure."""
    found = {
        "intervals": _intervals(plan),
        "velocities": f"Constant velocities, {'; '.join(_velocities(plan))}",
        "robustness": f"Expected error of vₛ, {'; '.join(_robustness(plan))}",
        "loading": f"Expected error of σ₀, {'; '.join(_loading(plan))}",
        "motion": _motion(plan),
        "motions": _motions(plan),
        "whole": _whole(plan),
    }
    return {f"plan-{name}": f"{text}." for name, text in found.items()}


def _intervals(plan: Plan) -> str:
    """The parameter that stays widest, or those that the plan is for; which of them stay open where any does."""
    now, then = (_relative(plan, plan.standard_errors[stage]) for stage in ("now", "with motion"))
    unseen = [k for k in plan.aimed if not then[k] < CEILING]
    if unseen:
        return f"Standard error over {CEILING:g} %, not identifiable, even after the plan: {_names(plan, unseen)}"
    largest = plan.aim == "all"
    shown = [max(plan.aimed, key=then.__getitem__)] if largest else plan.aimed
    errors = (f"{percentage(then[k])} % of {_names(plan, [k])}, from {percentage(now[k])} % now" for k in shown)
    return f"{'Largest standard' if largest else 'Standard'} error expected after the plan: {'; '.join(errors)}"


def _velocities(plan: Plan) -> Iterator[str]:
    v = pretty(unit("velocity", plan.joint.kind))
    for x in plan.velocities:
        speeds = [speed for speed, _ in x.chosen.runs]
        ends = dict.fromkeys(number(speed, 3) for speed in (speeds[0], speeds[-1]))
        runs, at = counted(len(x.velocities), "run"), counted(len(speeds), "speed")
        yield f"{direction(x.direction)}: {runs} at {at}, {' to '.join(ends)} {v}"


def _robustness(plan: Plan) -> Iterator[str]:
    v = pretty(unit("velocity", plan.joint.kind))
    for x in plan.velocities:
        low, high = x.problem.nodes.min(), x.problem.nodes.max()
        v_s = np.geomspace(low, high, 60)
        errors = 100 * errors_by_v_s(x.problem, x.chosen.speeds, v_s)[:, 3] / v_s
        between = dict.fromkeys(number(float(end), 3) for end in (low, high))
        ends = _ends(errors.tolist(), percentage)
        yield f"{direction(x.direction)}: {' to '.join(ends)} % for a true vₛ of {' to '.join(between)} {v}"


def _loading(plan: Plan) -> Iterator[str]:
    T = pretty(unit("torque", plan.joint.kind))
    for x in plan.loadings:
        peak = f"{number(x.peak, 3)} {T}"
        yield f"{direction(x.direction)}: " + (
            f"{percentage(100 * x.error / plan.start.p(x.direction).sigma_0)} % with rises of {number(x.rise, 3)} s to {peak}"
            if np.isfinite(x.error)
            else f"not identifiable, as the joint moves only {number(x.counts, 2)} encoder counts at {peak}"
        )


def _motion(plan: Plan) -> str:
    played, limits = plan.references[-1], plan.limits
    q, v = (pretty(unit(name, plan.joint.kind)) for name in ("position", "velocity"))
    peak, low, high = (float(x) for x in (np.abs(played.velocity).max(), played.position.min(), played.position.max()))
    return (
        f"Peak velocity {number(peak, 3)} {v}, {number(limits.velocity, 3)} {v} allowed; positions {number(low, 3)} to {number(high, 3)} {q}, "
        f"{' to '.join(number(x, 3) for x in limits.position)} {q} allowed"
    )


def _motions(plan: Plan) -> str:
    planned, *others = plan.motions
    return f"Standard errors, planned motion {'; '.join(_beside(plan, planned, x) for x in others)}"


def _beside(plan: Plan, planned: MotionDesign, other: MotionDesign) -> str:
    """From the largest gain to the worst loss in what the plan is for; what of it one of the two motions alone shows."""
    mine, theirs = (_relative(plan, x.errors) for x in (planned, other))
    ratio = {k: mine[k] / theirs[k] for k in plan.aimed if mine[k] < CEILING and theirs[k] < CEILING}
    by = [f"{two_digits(ratio[k])} times for {_names(plan, [k])}" for k in sorted(ratio, key=ratio.__getitem__)]
    ends = " to ".join(dict.fromkeys((by[0], by[-1]))) if by else f"none below {CEILING:g} % after both"
    gained = _names(plan, [k for k in plan.aimed if mine[k] < CEILING and k not in ratio])
    lost = _names(plan, [k for k in plan.aimed if theirs[k] < CEILING and k not in ratio])
    alone = f", only the planned one shows {gained}" * bool(gained) + f", only the other one shows {lost}" * bool(lost)
    return f"vs {other.name}: {ends}{alone}"


def _whole(plan: Plan) -> str:
    runs = Counter(kind for kind, _ in dict.fromkeys((r.kind, r.run) for r in plan.references))
    tracking = counted(runs["tracking"], "tracking motion")
    return f"The plan takes {number(plan.duration, 3)} s: {runs['ramp']} runs at constant velocity, {runs['presliding']} of slow loading, {tracking}"


def _relative(plan: Plan, errors: Array) -> list[float]:
    """Of each parameter, percent."""
    return list(map(float, 100 * errors / np.abs(plan.start.estimate)))


def _names(plan: Plan, at: Sequence[int]) -> str:
    return ", ".join(symbol(plan.start.names[k]) for k in at)


def _ends(values: Sequence[float], written: Callable[[float], str] = two_digits) -> Iterable[str]:
    """The least and the largest, as they are written; one where these do not differ."""
    return dict.fromkeys(written(x) for x in (min(values), max(values)))

"""What each figure of a plan shows, in a sentence with a number: the beginning of its caption."""

from collections import Counter
from collections.abc import Sequence

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
    kind, limits, played = plan.joint.kind, plan.limits, plan.references[-1]
    q, v, T = (pretty(unit(name, kind)) for name in ("position", "velocity", "torque"))

    # The parameter that stays widest, or those that the plan is for; which of them stay open where any does.
    now, then = (_relative(plan, plan.standard_errors[stage]) for stage in ("now", "with motion"))
    largest, unseen = plan.aim == "all", [k for k in plan.aimed if not then[k] < CEILING]
    shown = [max(plan.aimed, key=then.__getitem__)] if largest else plan.aimed
    errors = (f"{percentage(then[k])} % of {_names(plan, [k])}, from {percentage(now[k])} % now" for k in shown)
    intervals = f"{'Largest standard' if largest else 'Standard'} error expected after the plan: {'; '.join(errors)}"
    if unseen:
        intervals = f"Standard error over {CEILING:g} %, not identifiable, even after the plan: {_names(plan, unseen)}"

    velocities, robustness, loading = [], [], []
    for x in plan.velocities:
        speeds = [speed for speed, _ in x.chosen.runs]
        ends = dict.fromkeys(number(speed, 3) for speed in (speeds[0], speeds[-1]))
        runs, at = counted(len(x.velocities), "run"), counted(len(speeds), "speed")
        velocities.append(f"{direction(x.direction)}: {runs} at {at}, {' to '.join(ends)} {v}")
        low, high = x.problem.nodes.min(), x.problem.nodes.max()
        of_v_s = errors_by_v_s(x.problem, x.chosen.speeds, np.geomspace(low, high, 60))
        between = dict.fromkeys(number(float(end), 3) for end in (low, high))
        ends = dict.fromkeys(percentage(end) for end in (float(of_v_s.min()), float(of_v_s.max())))
        robustness.append(
            f"{direction(x.direction)}: {' to '.join(ends)} % for a true vₛ of {' to '.join(between)} {v}"
        )
    for load in plan.loadings:
        peak = f"{number(load.peak, 3)} {T}"
        loading.append(
            f"{direction(load.direction)}: "
            + (
                f"{percentage(100 * load.error / plan.start.p(load.direction).sigma_0)} % with rises of {number(load.rise, 3)} s to {peak}"
                if np.isfinite(load.error)
                else f"not identifiable, as the joint moves only {number(load.counts, 2)} encoder counts at {peak}"
            )
        )

    fastest, low, high = (
        number(float(x), 3) for x in (np.abs(played.velocity).max(), played.position.min(), played.position.max())
    )
    planned, *others = plan.motions
    kinds = Counter(kind for kind, _ in dict.fromkeys((r.kind, r.run) for r in plan.references))
    found = {
        "intervals": intervals,
        "velocities": f"Constant velocities, {'; '.join(velocities)}",
        "robustness": f"Expected error of vₛ, {'; '.join(robustness)}",
        "loading": f"Expected error of σ₀, {'; '.join(loading)}",
        "motion": f"Peak velocity {fastest} {v}, {number(limits.velocity, 3)} {v} allowed; positions {low} to {high} {q}, "
        f"{' to '.join(number(x, 3) for x in limits.position)} {q} allowed",
        "motions": f"Standard errors, planned motion {'; '.join(_beside(plan, planned, x) for x in others)}",
        "whole": f"The plan takes {number(plan.duration, 3)} s: {kinds['ramp']} runs at constant velocity, {kinds['presliding']} of slow loading, "
        f"{counted(kinds['tracking'], 'tracking motion')}",
    }
    return {f"plan-{name}": f"{text}." for name, text in found.items()}


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


def _relative(plan: Plan, errors: Array) -> list[float]:
    """Of each parameter, percent."""
    return list(map(float, 100 * errors / np.abs(plan.start.estimate)))


def _names(plan: Plan, at: Sequence[int]) -> str:
    return ", ".join(symbol(plan.start.names[k]) for k in at)

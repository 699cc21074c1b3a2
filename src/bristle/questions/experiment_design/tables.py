"""A plan as tables, and as the file of references that a controller plays."""

import numpy as np
import pandas as pd

from bristle.model.parameters import unit
from bristle.questions.experiment_design.plan import NORMAL, Plan
from bristle.questions.experiment_design.velocities import Design


def references(plan: Plan) -> pd.DataFrame:
    """Every sample to play, in order: time, experiment, run, and references of position and velocity, or of torque, with units in their names."""
    runs, kind, sizes = plan.references, plan.joint.kind, [r.position.size for r in plan.references]
    frame = pd.DataFrame({"time (s)": np.arange(sum(sizes)) / plan.limits.rate})
    frame["experiment"] = np.repeat([r.kind for r in runs], sizes)
    frame["run"] = np.repeat([r.run for r in runs], sizes)
    for name in ("position", "velocity", "torque"):
        frame[f"{name} reference ({unit(name, kind)})"] = np.concatenate([getattr(r, name) for r in runs])
    return frame


def velocities(plan: Plan) -> pd.DataFrame:
    """The constant velocities to run: direction, velocity, and how many runs at it."""
    rows = [(x.direction, speed, count) for x in plan.velocities for speed, count in x.chosen.runs]
    return pd.DataFrame(rows, columns=["direction", "velocity", "runs"])


def designs(plan: Plan) -> pd.DataFrame:
    """Of each design the relative standard error to expect of each parameter, what is known already included, percent."""
    rows = []
    for x in plan.velocities:
        for aim, design in x.designs.items():
            name = "D-optimal" if aim == "all" else f"for {aim} alone"
            percent = (100 * design.errors / np.abs(x.problem.estimate)).tolist()
            errors = dict(zip(x.problem.names, map(_finite, percent), strict=True))
            rows.append({"direction": x.direction, "design": name, **errors, "velocities": listed(design, "{:.3g}")})
    return pd.DataFrame(rows)


def listed(design: Design, number: str) -> str:
    """The speeds of a design, each with how often it is run where that is more than once."""
    return ", ".join(number.format(speed) + (f" x{count}" if count > 1 else "") for speed, count in design.runs)


def intervals(plan: Plan) -> pd.DataFrame:
    """Half of each parameter's 95 % interval now, and as expected after each part of the plan, in its unit, without what is given as exact."""
    rows = []
    for k in plan.free:
        name, value = plan.start.names[k], float(plan.start.estimate[k])
        half = {stage: _finite(NORMAL * errors[k]) for stage, errors in plan.standard_errors.items()}
        last = half["with motion"]
        guess = name in plan.start.guessed or (name.name == "inertia" and half["now"] is None)
        row = {"parameter": str(name), "estimate": value, "guess": guess, "unit": unit(name.name, plan.joint.kind)}
        rows.append({**row, **half, "in percent": None if last is None else 100 * last / abs(value)})
    return pd.DataFrame(rows).astype(dict.fromkeys((*plan.standard_errors, "in percent"), object))


def loading(plan: Plan) -> pd.DataFrame:
    """Slow loading per direction: peak, over breakaway, rise, counts, neglected share, error of sigma_0 by noise, and with that share."""
    rows = [
        {
            "direction": x.direction, "peak": x.peak, "share_of_breakaway": x.share, "rise": x.rise, "counts": _finite(x.counts),
            "viscous_share": x.viscous_share, "by_noise": _finite(x.noise_error), "standard_error": _finite(x.error),
        }
        for x in plan.loadings
    ]  # fmt: skip  # a table
    return pd.DataFrame(rows)


def lines(plan: Plan) -> pd.DataFrame:
    """The sines of the tracking motion as played, slowest first: each a sin(2 pi f t + phase) about the middle of the positions, fading apart."""
    sines = plan.motions[0].lines
    order = np.argsort(sines.frequency)
    return pd.DataFrame({name: getattr(sines, name)[order] for name in sines._fields})


def motions(plan: Plan) -> pd.DataFrame:
    """The planned motion beside others of its duration: relative standard error of each parameter after it, percent, and their mean square root."""
    names = {k: plan.start.names[k] for k in plan.free}
    rows = []
    for motion in plan.motions:
        relative = plan.percent(motion.errors)
        errors = {str(name): _finite(relative[k]) for k, name in names.items()}
        rows.append({"motion": motion.name, **errors, "rms": _finite(np.sqrt(np.mean(relative[plan.aimed] ** 2)))})
    return pd.DataFrame(rows)


def _finite(x: float) -> float | None:
    """The number, or None where there is none."""
    return float(x) if np.isfinite(x) else None

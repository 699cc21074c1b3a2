"""A plan as tables, and as the file of references that a controller plays."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from bristle.arrays import Array
from bristle.identification.fisher import STATIC
from bristle.model.parameters import unit
from bristle.page import spreadsheet
from bristle.questions.experiment_design.plan import AIMS, Plan

NORMAL = 1.96
"""Half of a 95 % interval in standard errors."""
SPACINGS = {"planned": "planned", "log": "log-spaced", "even": "evenly spaced"}


def references(plan: Plan) -> pd.DataFrame:
    """Every sample to play, in order: time, experiment, run, and references of position and velocity, or of torque, with units in their names."""
    q, v, T = (unit(name, plan.kind) for name in ("position", "velocity", "torque"))
    sizes = [r.position.size for r in plan.references]
    return pd.DataFrame(
        {
            "time (s)": np.arange(sum(sizes)) / plan.limits.rate,
            "experiment": np.repeat([r.kind for r in plan.references], sizes),
            "run": np.repeat([r.run for r in plan.references], sizes),
            f"position reference ({q})": np.concatenate([r.position for r in plan.references]),
            f"velocity reference ({v})": np.concatenate([r.velocity for r in plan.references]),
            f"torque reference ({T})": np.concatenate([r.torque for r in plan.references]),
        }
    )


def to_csv(plan: Plan) -> str:
    """`references` as CSV; what is not commanded is empty."""
    return spreadsheet.to_csv(references(plan), "%.10g")


def velocities(plan: Plan) -> pd.DataFrame:
    """The constant velocities to run: direction, velocity, and how many runs at it."""
    rows = [
        {"direction": d.tag or "both", "velocity": float(v), "runs": int(n)}
        for d in plan.directions
        for v, n in zip(*np.unique(d.chosen.speeds, return_counts=True), strict=True)
    ]
    return pd.DataFrame(rows)


def designs(plan: Plan) -> pd.DataFrame:
    """Each design beside the spaced ones: relative standard error to expect of each parameter, what is known already included, percent."""
    rows = []
    for d in plan.directions:
        named = {"D-optimal" if a == "all" else f"for {a} alone": x for a, x in d.designs.items()}
        named |= {SPACINGS[kind]: x for kind, x in d.spaced.items()}
        for name, x in named.items():
            speeds = ", ".join(
                f"{v:.3g}" + (f" x{n}" if n > 1 else "")
                for v, n in zip(*np.unique(x.speeds, return_counts=True), strict=True)
            )
            rows.append(
                {"direction": d.tag or "both", "design": name, **_percent(x.errors, d.task.p[:4]), "velocities": speeds}
            )
    return pd.DataFrame(rows)


def comparison(plan: Plan) -> pd.DataFrame:
    """As many runs by themselves, nothing known before: relative standard error as predicted, and as fits of SIMULATED runs scatter, percent."""
    rows = []
    for d in plan.directions:
        for kind, label in SPACINGS.items():
            for how, errors in (("predicted", d.alone[kind].errors), ("simulated", d.simulated[kind])):
                rows.append(
                    {"direction": d.tag or "both", "design": label, "way": how, **_percent(errors, d.task.p[:4])}
                )
    return pd.DataFrame(rows)


def intervals(plan: Plan) -> pd.DataFrame:
    """Half of each parameter's 95 % interval now, and as expected after each part of the plan, in its unit; without what is given as exact."""
    rows = []
    for k in plan.free:
        name = plan.start.names[k]
        value = float(plan.start.estimate[k])
        guess = name in plan.start.guessed or (name == "inertia" and not np.isfinite(plan.stages["now"][k]))
        half = {stage: _finite(NORMAL * errors[k]) for stage, errors in plan.stages.items()}
        last = half["with motion"]
        rows.append(
            {
                "parameter": name,
                "estimate": value,
                "guess": guess,
                "unit": unit(name.rstrip("+-"), plan.kind),
                **half,
                "in percent": None if last is None else 100 * last / abs(value),
            }
        )
    return pd.DataFrame(rows).astype(dict.fromkeys((*plan.stages, "in percent"), object))


def loading(plan: Plan) -> pd.DataFrame:
    """Slow loading per direction: peak, over breakaway, rise, counts, neglected share, and the error of sigma_0 by noise, and with that share."""
    rows = [
        {
            "direction": x.tag,
            "peak": x.peak,
            "share_of_breakaway": x.share,
            "rise": x.rise,
            "counts": _finite(x.counts),
            "viscous_share": x.lag,
            "by_noise": _finite(x.scatter),
            "standard_error": _finite(x.error),
        }
        for x in plan.loads
    ]
    return pd.DataFrame(rows)


def lines(plan: Plan) -> pd.DataFrame:
    """The sines of the tracking motion as they are played, fading apart, slowest first: a sin(2 pi f t + phase) about the middle of the positions."""
    found = plan.motions[0].lines
    order = np.argsort(found.frequency)
    return pd.DataFrame(
        {name: getattr(found, name)[order] for name in ("amplitude", "frequency", "phase")},
    )


def motions(plan: Plan) -> pd.DataFrame:
    """The planned motion beside others of its duration: relative standard error of each parameter after it, percent, and their mean square root."""
    rows = []
    for x in plan.motions:
        relative = 100 * x.errors / np.abs(plan.start.estimate)
        names = {k: plan.start.names[k] for k in plan.free}
        aimed = [k for k, n in names.items() if plan.aim not in AIMS or n.rstrip("+-") == plan.aim]
        rows.append(
            {
                "motion": x.name,
                **{n: _finite(relative[k]) for k, n in names.items()},
                "rms": _finite(np.sqrt(np.mean(relative[aimed] ** 2))),
            }
        )
    return pd.DataFrame(rows)


def all_tables(plan: Plan) -> Mapping[str, pd.DataFrame]:
    """Every table by the name of its file."""
    return {
        "velocities": velocities(plan),
        "designs": designs(plan),
        "comparison": comparison(plan),
        "intervals": intervals(plan),
        "loading": loading(plan),
        "lines": lines(plan),
        "motions": motions(plan),
    }


def _percent(errors: Array, values: tuple[float, ...]) -> dict[str, float | None]:
    return {name: _finite(100 * e / abs(x)) for name, e, x in zip(STATIC, errors.tolist(), values, strict=True)}


def _finite(x: float) -> float | None:
    """The number, or None where there is none."""
    return float(x) if np.isfinite(x) else None

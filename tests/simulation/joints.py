"""Joints, experiment files and joints in their loops that are made by hand, so that nothing is identified first."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.control.adaptation import Adaptation
from bristle.data.experiment.load import Experiment, load_experiment
from bristle.findings import NOTE, Finding
from bristle.identification.fits import Estimate, TrackingFit
from bristle.identification.results import Joint
from bristle.model.parameters import Lugre, Pair, ParameterName, unit
from bristle.simulation import edro
from bristle.simulation.joint_loop import JointLoop

GRIPPER = edro.TABLE_1["gripper rotation"]
J = edro.inertia(GRIPPER)
FASTEST = 2.0  # the fastest measured speed of `joint`, rad/s


def joint_loop(name: str = "gripper rotation", **changes: Any) -> JointLoop:
    """A joint of Table 1 as `of_paper` has it, the model being the truth."""
    pair = edro.TABLE_1[name]
    own = JointLoop(
        name=name, kind="revolute", plant=pair, model=pair, J=edro.inertia(pair), gains=edro.PID_GAINS, amplitude=1.0, frequency=0.5, slow=0.2,
        period=1e-3, adaptation=Adaptation(), start={"alpha_0": 0.3, "alpha_2": 0.5}, simulated=True,
    )  # fmt: skip  # a list of values
    return replace(own, **changes)


def values_of(pair: Pair[float], inertia: float | None = J) -> dict[str, float]:
    """Parameters of a pair by their names in a fit of moving runs."""
    own = {f"{name}{d}": x for d, p in zip("+-", pair, strict=True) for name, x in p._asdict().items()}
    return own | ({} if inertia is None else {"inertia": inertia})


def tracked(values: Mapping[str, float], share: float = 0.02, **changes: Any) -> TrackingFit:
    """A fit of moving runs with these values, and standard errors of that share of them."""
    # their covariance is correlated at random
    root = np.random.default_rng(1).standard_normal((len(values), 2 * len(values)))
    whole = root @ root.T
    error = share * np.array([*values.values()]) / np.sqrt(np.diag(whole))
    matrix: Array = whole * np.outer(error, error)
    own = TrackingFit(
        parameters={
            (p := ParameterName.parse(name)): Estimate(value=x, unit=unit(p.name), standard_error=float(s))
            for (name, x), s in zip(values.items(), np.sqrt(np.diag(matrix)), strict=True)
        },
        rms=1e-4, relative_error=1.0, n=3, outcome=Finding("converged", NOTE, "The fit converged."), starts=1, reached=1, condition=9.0,
        names=tuple(map(ParameterName.parse, values)), covariance=matrix, velocity=np.array([-1.0, 0.5, FASTEST]),
    )  # fmt: skip  # a list of values
    return replace(own, **changes)


def unseen(fit: TrackingFit, fixed: Mapping[str, float]) -> TrackingFit:
    """The fit where the motion does not show some parameters, which were taken as these to fit the others."""
    held = {ParameterName.parse(name): x for name, x in fixed.items()}
    missing = {name: replace(fit.parameters[name], value=None, standard_error=None) for name in held}
    return replace(fit, parameters={**fit.parameters, **missing}, fixed={**fit.fixed, **held})


def joint(fit: TrackingFit | None = None, name: str = "wrist", **changes: Any) -> Joint:
    """A joint of which moving runs showed this; without a fit Table 1's gripper."""
    own = Joint(name=name, kind="revolute", inputs=(), segments=(), static={}, crosscheck={})
    return replace(own, tracking=fit or tracked(values_of(GRIPPER)), **changes)


def experiment(folder: Path, adapt: str = "", more: str = "") -> Experiment:
    """An experiment of one moving run, `run.csv`, with options under `adapt` and other keys."""
    own = f"adapt: {{{adapt}}}\n" if adapt else ""
    path = folder / "e.yaml"
    path.write_text(
        f"joint: {{name: wrist}}\n{own}{more}signals:\n  time: {{column: t, unit: s}}\n  velocity: {{column: v, unit: rad/s}}\n"
        "  torque: {column: tau, unit: N*m}\nruns:\n  - {files: run.csv, experiment: tracking}\n",
        encoding="utf-8",
    )
    return load_experiment(path)


def share_of(p: Lugre[float], share: float) -> Lugre[float]:
    return p._replace(alpha_0=share * p.alpha_0, alpha_2=share * p.alpha_2)

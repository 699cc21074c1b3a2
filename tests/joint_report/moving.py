"""Joints with moving runs, built by hand: Table 1's gripper, two stretches, three reversals, and residuals that are known."""

from dataclasses import replace
from typing import Any

import numpy as np

from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.fits import Estimate, HoldOut, TrackingFit
from bristle.identification.results import Consistency, Joint
from bristle.model.parameters import ParameterName, unit

from ..names import named
from .conftest import TABLE_1, loaded

VALUES = {f"{name}{d}": value for d, p in TABLE_1.items() for name, value in p._asdict().items()} | {"inertia": 1.3e-3}
"""The true parameters by their names in a fit of moving runs."""
AGREE = Finding("stage-agrees", NOTE, "They agree.")
DIFFER = Finding("stage-differs", CAUTION, "They differ by more than chance.")
NOT_SHOWN = Finding("stage-unseen", NOTE, "Not identifiable from the tracking runs.")
UNSEEN = Finding("unseen-wide", CAUTION, "Not identifiable from this motion.")
CORRELATED = Finding("correlated", NOTE, "Residuals are correlated (lag one 0.62).")
STRETCH = 701  # equations of the first stretch
REVERSAL = 5.0  # when the joint turns hardest, s from the start of the second stretch


def estimate(name: str, factor: float = 1.0) -> Estimate:
    """The truth times a factor, with a standard error of one in a hundred."""
    x = VALUES[name] * factor
    return Estimate(value=x, unit=unit(name.rstrip("+-")), standard_error=0.01 * x, interval=(0.98 * x, 1.02 * x))


def tracked(factor: float = 1.0, **changes: Any) -> TrackingFit:
    """A fit whose parameters are the truth times a factor; its second stretch turns hardest at REVERSAL."""
    first, second = np.arange(STRETCH) / 100, np.arange(1000) / 100
    velocity = np.concatenate([0.2 * np.cos(first), 2.0 * np.tanh(20 * (REVERSAL - second))])
    torque = 0.02 * np.sign(velocity) + 0.04 * velocity
    errors = np.array([0.01 * value * factor for value in VALUES.values()])
    correlation = np.eye(len(VALUES))
    correlation[0, 1] = correlation[1, 0] = -0.9
    fit = TrackingFit(
        parameters={ParameterName.parse(name): estimate(name, factor) for name in VALUES}, rms=4e-4, relative_error=1.25, n=velocity.size,
        outcome=Finding("converged", NOTE, "The fit converged."), starts=4, reached=3, condition=8.9, names=tuple(map(ParameterName.parse, VALUES)),
        covariance=correlation * np.outer(errors, errors), time=np.concatenate([first, second]), velocity=velocity, measured=torque,
        residuals=4e-4 * np.sin(np.arange(velocity.size)), starts_of_runs=(0, STRETCH), hold_out=(HoldOut(file="held.csv", relative_error=1.5),),
    )  # fmt: skip  # a list of values
    return replace(fit, **changes)


def compared(parameter: str, difference: float | None, verdict: Finding, stage: str = "static") -> Consistency:
    value = VALUES[parameter]
    seen = difference is not None
    return Consistency(
        parameter=ParameterName.parse(parameter), stage=stage, stage_value=value, stage_error=0.01 * value,
        tracking_value=1.05 * value if seen else None, tracking_error=0.01 * value if seen else None, joint_value=value,
        joint_error=0.005 * value, difference_in_se=difference, verdict=verdict,
    )  # fmt: skip  # as above


def without(fit: TrackingFit, *names: str) -> TrackingFit:
    """The fit where the motion does not show some parameters."""
    missing = {
        (p := ParameterName.parse(name)): replace(
            fit.parameters[p], value=None, standard_error=None, warnings=(UNSEEN,)
        )
        for name in names
    }
    return replace(fit, parameters={**fit.parameters, **missing})


def moving(name: str = "gripper rotation", file: str = "held.csv") -> Joint:
    """The gripper with every stage: alone the moving runs do not show alpha_1-, alpha_0- differs between stages, counts bias sigma_0+ alone."""
    held = (HoldOut(file=file, relative_error=1.5),)
    alone = tracked(
        1.05, hold_out=held, warnings=(CORRELATED,), count_bias=named({"sigma_0+": -0.02, "sigma_0-": 1e-4})
    )
    both = tracked(1.01, hold_out=held, starts=1, reached=1, relative_error=1.3)
    return replace(
        loaded(name), tracking=without(alone, "alpha_1-"), joint_fit=both,
        consistency=(
            compared("alpha_0+", 0.5, AGREE), compared("alpha_0-", -3.2, DIFFER),
            compared("alpha_1-", None, NOT_SHOWN), compared("sigma_0+", 1.0, AGREE, "presliding"),
        ),
    )  # fmt: skip  # as above

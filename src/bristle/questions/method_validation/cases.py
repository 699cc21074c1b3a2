"""What the grid search is validated on.

A joint's own directions as they were measured, or a declared sweep over Table 1.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation.autocorrelation import inflation
from bristle.findings import NOTE, Finding
from bristle.identification.fits import StaticFit
from bristle.identification.known_joint import fault_of
from bristle.identification.results import Joint
from bristle.identification.static.grid import default_range
from bristle.model.parameters import Direction, ParameterName, Stribeck
from bristle.model.parameters import Kind as JointKind
from bristle.questions.method_validation.solvers import ValidationCase, case_names
from bristle.simulation import edro

NOISES = (0.005, 0.05)
"""Of the sweep: standard deviation of a point's torque over alpha_0."""
FASTEST = 11.0
"""Of the sweep: the fastest speed over v_s."""
MOST_POINTS = 400
"""Points of a case; of more equations so many are simulated, with as much less noise as there are fewer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseSet:
    """The cases of one validation."""

    title: str
    kind: JointKind
    cases: tuple[ValidationCase, ...]
    skipped: Mapping[str, Finding] = field(default_factory=dict)
    """Directions that cannot be tried, each with the reason."""
    assumptions: tuple[Finding, ...] = (
        Finding(
            "points-simulated",
            NOTE,
            "SIMULATED: torques are those of the model at the given velocities, with white Gaussian noise; no run is simulated, "
            "and the velocities have no error.",
        ),
        Finding(
            "directions-alone",
            NOTE,
            "Each direction is validated separately: what directions share (inertia, gravity, offset) is taken as known.",
        ),
    )


def sweep_designs(v_s: float) -> dict[str, Array]:
    """Three designs for a Stribeck velocity (rad/s): velocities, rad/s, by what they are."""
    return {
        "16 speeds, even in the logarithm, from 0.15 v_s": np.geomspace(0.15 * v_s, FASTEST * v_s, 16),
        "12 speeds, even, from 0.5 v_s": np.linspace(0.5 * v_s, FASTEST * v_s, 12),
        "12 speeds, even, none below 1.5 v_s": np.linspace(1.5 * v_s, FASTEST * v_s, 12),
    }


def sweep(noise: float | None = None) -> CaseSet:
    """Every set of Table 1, at two noise levels (or at `noise`, a share of alpha_0, > 0) and three designs."""
    levels = NOISES if noise is None else (noise,)
    cases = tuple(
        _case(f"{name} ({sign})", design, p.stribeck, speeds if sign == "+" else -speeds, level * p.alpha_0)
        for name, pair in edro.TABLE_1.items()
        for sign, p in zip("+-", pair, strict=True)
        for design, speeds in sweep_designs(p.v_s).items()
        for level in levels
    )
    return CaseSet(title="Table 1", kind="revolute", cases=cases)


def joint_cases(joint: Joint, noise: float | None = None) -> CaseSet:
    """A case per direction in which the joint's static fit has a Stribeck term, and why the others have none.

    Args:
        joint: identified.
        noise: standard deviation of a point's torque over alpha_0, > 0; None: the fit's own, its rms corrected for its
            parameters.

    Raises InputError where nothing at all was fitted, or a fit has a number that no joint has.
    """
    check_fitted(joint)
    cases, skipped = [], {}
    for direction, fit in joint.static.items():
        if direction == "shared":
            continue
        p = fit.values()
        if p is None or not p.alpha_1 or fit.profile is None:
            skipped[direction] = Finding("no-stribeck-term", NOTE, f"nothing to validate: {fit.outcome.message}")
            continue
        if fit.velocity.size <= len(case_names(fit.law)):
            points = fit.velocity.size
            skipped[direction] = Finding(
                "too-few-to-validate",
                NOTE,
                f"nothing to validate: {points} points were fitted; four parameters and their noise need at least 5",
                {"points": points},
            )
            continue
        faults = (fault_of(ParameterName(name, Direction(direction)), x) for name, x in p._asdict().items())
        if fault := next(filter(None, faults), None):
            raise InputError(f"{joint.name}: {fault}: identify it anew")
        velocity, fitted_noise = _points(fit)
        level = fitted_noise if noise is None else noise * p.alpha_0
        if level <= 1e-9 * p.alpha_0:
            skipped[direction] = Finding(
                "points-without-noise",
                NOTE,
                "nothing to validate: the points lie on the model without noise; choose a noise level with --noise",
            )
            continue
        ends = (float(fit.profile.v_s[0]), float(fit.profile.v_s[-1]))
        label = joint.name if direction == "both" else f"{joint.name} ({direction})"
        cases.append(_case(label, f"the {fit.n} points measured", p, velocity, level, ends))
    if not cases and not skipped:
        message = "nothing to validate: the grid fitted no friction curve."
        skipped["both directions"] = Finding("no-grid-fit", NOTE, message)
    return CaseSet(title=joint.name, kind=joint.kind, cases=tuple(cases), skipped=skipped)


def check_fitted(joint: Joint) -> None:
    """Raises InputError where a joint has neither a static nor a moving fit, so that there is nothing to check."""
    if joint.moving is not None or any(fit.values() for d, fit in joint.static.items() if d != "shared"):
        return
    outcomes = "; ".join(dict.fromkeys(str(fit.outcome).rstrip(".") for fit in joint.static.values()))
    got = (
        f"no fit of friction vs velocity ({outcomes})" if outcomes else "no ramp, points or tracking run that is fitted"
    )
    raise InputError(f"{joint.name}: nothing to check: got {got}; add ramp, points or tracking runs")


def _points(fit: StaticFit) -> tuple[Array, float]:
    """Velocities to simulate, rad/s, and their noise, N*m.

    Equations of moving data are thinned, their noise widened for its correlation.
    """
    v = fit.velocity
    level = float(np.sqrt(np.sum(fit.residuals**2) / (v.size - len(case_names(fit.law)))))
    if v.size <= MOST_POINTS:
        return v, level
    evenly = np.sort(v)[np.linspace(0, v.size - 1, MOST_POINTS).astype(np.intp)]
    return evenly[evenly != 0], level * float(np.sqrt(inflation(fit.residuals) * MOST_POINTS / v.size))


def _case(
    label: str, design: str, p: Stribeck[float], velocity: Array, noise: float, ends: tuple[float, float] | None = None
) -> ValidationCase:
    return ValidationCase(
        label=label, design=design, truth=p, velocity=velocity, noise=noise, v_s_range=ends or default_range(velocity)
    )

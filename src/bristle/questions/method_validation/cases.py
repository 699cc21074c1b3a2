"""Cases of a validation: a joint's own directions as they were measured, or a sweep over Table 1."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from bristle.errors import InputError
from bristle.estimation.autocorrelation import inflation
from bristle.findings import NOTE, Finding
from bristle.identification.known_joint import fault_of
from bristle.identification.results import Joint
from bristle.identification.static.grid import default_range
from bristle.model.parameters import Direction, Kind, ParameterName
from bristle.questions.method_validation.solvers import ValidationCase, case_names
from bristle.simulation import edro

NOISES = (0.005, 0.05)  # of the sweep: standard deviation of a point's torque over alpha_0
MOST_POINTS = 400  # simulated points of a case; for more equations with as much less noise
_SIMULATED = (
    "SIMULATED: torques are those of the model at the given velocities, with white Gaussian noise; no run is simulated, "
    "and the velocities have no error."
)
_ALONE = "Each direction is validated separately: what directions share (inertia, gravity, offset) is taken as known."


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseSet:
    """The cases of one validation."""

    title: str
    kind: Kind
    cases: tuple[ValidationCase, ...]
    skipped: Mapping[str, Finding] = field(default_factory=dict)  # directions that cannot be validated, with the reason
    assumptions: tuple[Finding, ...] = (
        Finding("points-simulated", NOTE, _SIMULATED), Finding("directions-alone", NOTE, _ALONE),
    )  # fmt: skip  # a list of values


def sweep(noise: float | None = None) -> CaseSet:
    """Every set of Table 1, at two noise levels (or at `noise` over alpha_0, > 0) and three designs."""
    levels, cases = NOISES if noise is None else (noise,), list[ValidationCase]()
    for name, pair in edro.TABLE_1.items():
        for sign, p in zip("+-", pair, strict=True):
            designs = {
                "16 speeds, even in the logarithm, from 0.15 v_s": np.geomspace(0.15 * p.v_s, 11 * p.v_s, 16),
                "12 speeds, even, from 0.5 v_s": np.linspace(0.5 * p.v_s, 11 * p.v_s, 12),
                "12 speeds, even, none below 1.5 v_s": np.linspace(1.5 * p.v_s, 11 * p.v_s, 12),
            }
            cases += [
                ValidationCase(
                    label=f"{name} ({sign})", design=design, truth=p.stribeck, velocity=speeds if sign == "+" else -speeds,
                    noise=level * p.alpha_0, v_s_range=default_range(speeds),
                )
                for design, speeds in designs.items() for level in levels
            ]  # fmt: skip  # a list of values
    return CaseSet(title="Table 1", kind="revolute", cases=tuple(cases))


def joint_cases(joint: Joint, noise: float | None = None) -> CaseSet:
    """A case per direction whose static fit has a Stribeck term, and why the other directions have none.

    `noise`: standard deviation of a point's torque over alpha_0, > 0; None: the fit's own, corrected for its parameters.
    Raises InputError where nothing was fitted, or a fit has an impossible number.
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
            few = f"nothing to validate: {points} points were fitted; four parameters and their noise need at least 5"
            skipped[direction] = Finding("too-few-to-validate", NOTE, few, {"points": points})
            continue
        faults = (fault_of(ParameterName(name, Direction(direction)), x) for name, x in p._asdict().items())
        if fault := next(filter(None, faults), None):
            raise InputError(f"{joint.name}: {fault}: identify it anew")
        # Equations of moving data are thinned, and their noise is widened for its correlation.
        velocity = fit.velocity
        level = float(np.sqrt(np.sum(fit.residuals**2) / (velocity.size - len(case_names(fit.law)))))
        if velocity.size > MOST_POINTS:
            level *= float(np.sqrt(inflation(fit.residuals) * MOST_POINTS / velocity.size))
            velocity = np.sort(velocity)[np.linspace(0, velocity.size - 1, MOST_POINTS).astype(np.intp)]
            velocity = velocity[velocity != 0]
        level = level if noise is None else noise * p.alpha_0
        if level <= 1e-9 * p.alpha_0:
            exact = "nothing to validate: the points lie on the model without noise; choose a noise level with --noise"
            skipped[direction] = Finding("points-without-noise", NOTE, exact)
            continue
        label = joint.name if direction == "both" else f"{joint.name} ({direction})"
        design, ends = f"the {fit.n} points measured", (float(fit.profile.v_s[0]), float(fit.profile.v_s[-1]))
        cases.append(
            ValidationCase(label=label, design=design, truth=p, velocity=velocity, noise=level, v_s_range=ends)
        )
    if not cases and not skipped:
        message = "nothing to validate: the grid fitted no friction curve."
        skipped["both directions"] = Finding("no-grid-fit", NOTE, message)
    return CaseSet(title=joint.name, kind=joint.kind, cases=tuple(cases), skipped=skipped)


def check_fitted(joint: Joint) -> None:
    """Raise InputError where a joint has neither a static nor a moving fit."""
    if joint.moving is not None or any(fit.values() for d, fit in joint.static.items() if d != "shared"):
        return
    outcomes = "; ".join(dict.fromkeys(str(fit.outcome).rstrip(".") for fit in joint.static.values()))
    got = f"fit of friction vs velocity ({outcomes})" if outcomes else "ramp, points or tracking run that is fitted"
    raise InputError(f"{joint.name}: nothing to check: got no {got}; add ramp, points or tracking runs")

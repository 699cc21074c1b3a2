"""Which parameters of moving data are claimed: the bristle's where presliding is resolved, the peak's where it is significant."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bristle.data.record import Record
from bristle.estimation.multistart import MultistartSolution
from bristle.identification.dynamic.descent import solve_dynamic
from bristle.identification.dynamic.problem import Unknown
from bristle.identification.fits import TrackingFit
from bristle.model.parameters import Lugre

from ..names import named, parse
from .conftest import GRIPPER, by_name, codes, ends_of, fitted, holds, moved, posed, tones, torque_of, value_of

SIGMA_0 = parse("sigma_0")


def run(step: float, p: Lugre[float] = GRIPPER, changed: Lugre[float] | None = None, forward: bool = False) -> Record:
    """Sixteen seconds of five tones, sampled this often from a simulation at 2 kHz; from the middle on with another joint, if given."""
    v = tones(np.arange(0, 16, 5e-4))
    v = np.abs(v) + 0.05 if forward else v
    whole, half = moved(v, 5e-4, p, 1e-4, seed=3), v.size // 2
    torque = torque_of(whole).copy()
    if changed is not None:
        torque[half:] = torque_of(moved(v, 5e-4, changed, 1e-4, seed=3))[half:]
    every = slice(None, None, round(step / 5e-4))
    signals = {n: getattr(whole, n)[every] for n in ("time", "velocity", "acceleration")}
    return replace(whole, torque=torque[every], **signals)


@cache
def resolved(count: float = 0.0) -> TrackingFit:
    """The fit of a run at 2 kHz through slow reversals, behind counts of that size."""
    return fitted(replace(posed(run(5e-4)), count=count))


def reasons(fit: TrackingFit, name: str) -> set[str]:
    """Why a parameter has no value; empty where it has one."""
    estimate = fit.parameters[parse(name)]
    return set() if estimate.value is not None else set(codes(estimate.warnings))


def test_a_bristle_that_the_motion_resolves_is_claimed() -> None:
    """At 2 kHz, through slow reversals, sigma_0 and sigma_1 have values whose intervals hold the truth."""
    for name in ("sigma_0", "sigma_1"):
        estimate = resolved().parameters[parse(name)]
        assert estimate.value is not None
        assert holds(estimate.interval, getattr(GRIPPER, name))


@pytest.mark.parametrize("why", ["unseen-fast", "unseen-below-count", "unseen-no-reversal", "unseen-halves"])
def test_a_bristle_that_the_motion_does_not_resolve_has_no_value(why: str) -> None:
    """Passed too fast, below an encoder count, without a reversal, or changing over the record, sigma_0 is not identifiable, for that reason.

    Nor is sigma_1.
    """
    if why == "unseen-below-count":
        made = resolved(0.01)
    elif why == "unseen-fast":
        made = fitted(posed(run(1e-2, GRIPPER._replace(sigma_0=400.0, sigma_1=0.1))))
    elif why == "unseen-no-reversal":
        made = fitted(posed(run(5e-4, forward=True)))
    else:
        made = fitted(posed(run(5e-4, changed=GRIPPER._replace(sigma_0=12.0))))
    assert why in reasons(made, "sigma_0")
    assert reasons(made, "sigma_1")
    assert [made.parameters[parse(name)].interval for name in ("sigma_0", "sigma_1")] == [None, None]
    assert made.parameters[parse("alpha_0")].value is not None


def test_coulomb_viscous_by_hand_has_no_peak() -> None:
    """A peak that is held at none is no parameter; one that is asked for by hand stays, however unsure."""
    problem = posed(run(1e-3, GRIPPER._replace(alpha_1=0.0)))
    auto, asked = (fitted(replace(problem, stribeck=model)).parameters for model in ("auto", "stribeck"))
    assert auto[parse("alpha_1")].value is None
    assert asked[parse("alpha_1")].value is not None
    assert asked[parse("v_s")].value is not None


def test_the_bend_is_judged_by_the_stiffest_bristle_of_the_interval() -> None:
    """A count between g0 over the upper end of sigma_0's interval and g0 over sigma_0 hides the bristle; one below both does not."""
    fit = resolved()
    value, (_, high) = value_of(fit.parameters[SIGMA_0]), ends_of(fit.parameters[SIGMA_0].interval)
    g0 = sum(fit.parameters[parse(name)].value or 0.0 for name in ("alpha_0", "alpha_1"))
    assert "unseen-below-count" in reasons(resolved(g0 / np.sqrt(value * high)), "sigma_0")
    assert not reasons(resolved(0.9 * g0 / high), "sigma_0")


@pytest.mark.parametrize("alpha_1", [0.0, GRIPPER.alpha_1])
def test_a_peak_that_is_left_out_is_taken_up(alpha_1: float) -> None:
    """Where a peak is there and left out by hand, alpha_2, which it moves by more than its error, says so; without a peak nothing does."""
    fixed = named({"alpha_1": 0.0, "v_s": 1.0})
    problem = replace(posed(run(1e-3, GRIPPER._replace(alpha_1=alpha_1))), fixed=fixed)
    fit = fitted(problem, {name: value for name, value in by_name(GRIPPER).items() if name not in fixed})
    said = {n.name for n, e in fit.parameters.items() if "takes-up-peak" in codes(e.warnings)}
    assert ("alpha_2" in said) == bool(said) == bool(alpha_1)
    assert said <= {"alpha_0", "alpha_2"}


def test_a_fit_that_did_not_converge_has_no_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is said of the fit, and no parameter has a value, an error or an interval, a peak that is asked for among them."""

    def unfinished(*given: object, **options: object) -> MultistartSolution[Unknown]:
        """The solution, as if it had run out of steps."""
        solution: MultistartSolution[Unknown] = solve_dynamic(*given, **options)  # type: ignore[arg-type]
        return solution._replace(minimum=solution.minimum._replace(converged=False))

    monkeypatch.setattr("bristle.identification.dynamic.fit.solve_dynamic", unfinished)
    fit = fitted(replace(posed(run(1e-3)), stribeck="stribeck"))
    assert fit.outcome.code == "not-converged"
    assert {(e.value, e.standard_error, e.interval) for e in fit.parameters.values()} == {(None, None, None)}

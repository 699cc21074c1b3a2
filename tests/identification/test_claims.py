"""Which parameters of moving data are claimed: the bristle's where presliding is resolved, the peak's where it is significant."""

from dataclasses import replace

import numpy as np
import pytest

from bristle.arrays import Array
from bristle.data.record import Record
from bristle.estimation.multistart import MultistartSolution
from bristle.identification.dynamic.fit import fit_tracking
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, dynamic_problem
from bristle.identification.dynamic.starts import solve_dynamic
from bristle.identification.fits import TrackingFit
from bristle.model.parameters import INERTIA, Direction, Lugre, ParameterName
from bristle.model.rollout import rollout

TRUTH = Lugre(0.0194, 0.0055, 0.0394, 0.0720, 6.1843, 0.0184)
J = 1.27e-3
NAMES = {name: ParameterName(name, Direction.BOTH) for name in Lugre._fields}


def run(step: float, p: Lugre[float] = TRUTH, changed: Lugre[float] | None = None, forward: bool = False) -> Record:
    """Sixteen seconds of five tones, sampled this often from a simulation at 2 kHz; from the middle on with another joint, if given."""
    t = np.arange(0, 16, 5e-4)
    lines = ((0.25, 0.3), (0.06, 1.3), (0.04, 3.1), (0.02, 7.0), (0.01, 12.0))
    v: Array = np.sum([a * np.sin(2 * np.pi * f * t + k) for k, (a, f) in enumerate(lines)], axis=0)
    v = np.abs(v) + 0.05 if forward else v
    half = t.size // 2
    torque = rollout(v, 5e-4, p).torque
    if changed is not None:
        torque = np.concatenate([torque[:half], rollout(v, 5e-4, changed).torque[half:]])
    a = np.gradient(v, t)
    torque = torque + J * a + 1e-4 * np.random.default_rng(3).standard_normal(t.size)
    every = slice(None, None, round(step / 5e-4))
    return Record(file="run.csv", time=t[every], velocity=v[every], acceleration=a[every], torque=torque[every])


def fitted(record: Record, count: float = 0.0) -> TrackingFit:
    """The fit of all parameters from near the truth."""
    problem: DynamicProblem = replace(dynamic_problem([record], ("both",), ("inertia",), 1, None), count=count)
    start = {NAMES[name]: value for name, value in TRUTH._asdict().items()} | {INERTIA: J}
    return fit_tracking(problem, start, "revolute", search=False).fit


def reasons(fit: TrackingFit, name: str) -> set[str]:
    """Why a parameter has no value; empty where it has one."""
    estimate = fit.parameters[NAMES[name]]
    return set() if estimate.value is not None else {warning.code for warning in estimate.warnings}


def test_a_bristle_that_the_motion_resolves_is_claimed() -> None:
    """At 2 kHz, through slow reversals, sigma_0 and sigma_1 have values whose intervals hold the truth."""
    fit = fitted(run(5e-4))
    for name in ("sigma_0", "sigma_1"):
        estimate = fit.parameters[NAMES[name]]
        assert estimate.value is not None
        assert estimate.interval is not None
        assert estimate.interval[0] <= getattr(TRUTH, name) <= estimate.interval[1]


@pytest.mark.parametrize(
    ("fit", "why"),
    [
        (lambda: fitted(run(1e-2, TRUTH._replace(sigma_0=400.0, sigma_1=0.1))), "unseen-fast"),
        (lambda: fitted(run(5e-4), count=0.01), "unseen-below-count"),
        (lambda: fitted(run(5e-4, forward=True)), "unseen-no-reversal"),
        (lambda: fitted(run(5e-4, changed=TRUTH._replace(sigma_0=12.0))), "unseen-halves"),
    ],
    ids=["sampled too seldom", "below a count", "one way", "halves differ"],
)
def test_a_bristle_that_the_motion_does_not_resolve_has_no_value(fit: object, why: str) -> None:
    """Passed too fast, below an encoder count, without a reversal, or changing over the record, sigma_0 is not identifiable, for that reason.

    Nor is sigma_1.
    """
    assert callable(fit)
    made = fit()
    assert why in reasons(made, "sigma_0")
    assert reasons(made, "sigma_1")
    assert made.parameters[NAMES["sigma_0"]].interval is None
    assert made.parameters[NAMES["sigma_1"]].interval is None
    assert made.parameters[NAMES["alpha_0"]].value is not None


def test_coulomb_viscous_by_hand_has_no_peak() -> None:
    """A peak that is held at none is no parameter; one that is asked for by hand stays, however unsure."""
    record = run(1e-3, TRUTH._replace(alpha_1=0.0))
    problem = dynamic_problem([record], ("both",), ("inertia",), 1, None)
    start = {NAMES[name]: value for name, value in TRUTH._asdict().items()} | {INERTIA: J}
    auto, asked = (
        fit_tracking(replace(problem, stribeck=model), start, "revolute", search=False).fit
        for model in ("auto", "stribeck")
    )
    assert auto.parameters[NAMES["alpha_1"]].value is None
    assert asked.parameters[NAMES["alpha_1"]].value is not None
    assert asked.parameters[NAMES["v_s"]].value is not None


def test_the_bend_is_judged_by_the_stiffest_bristle_of_the_interval() -> None:
    """A count between g0 over the upper end of sigma_0's interval and g0 over sigma_0 hides the bristle; one below both does not."""
    record = run(5e-4)
    fit = fitted(record)
    e = fit.parameters[NAMES["sigma_0"]]
    assert e.value is not None
    assert e.interval is not None
    g0 = sum(fit.parameters[NAMES[name]].value or 0.0 for name in ("alpha_0", "alpha_1"))
    between, below = g0 / np.sqrt(e.value * e.interval[1]), 0.9 * g0 / e.interval[1]
    assert "unseen-below-count" in reasons(fitted(record, count=between), "sigma_0")
    assert not reasons(fitted(record, count=below), "sigma_0")


@pytest.mark.parametrize("alpha_1", [0.0, TRUTH.alpha_1])
def test_a_peak_that_is_left_out_is_taken_up(alpha_1: float) -> None:
    """Where a peak is there and left out by hand, alpha_2, which it moves by more than its error, says so; without a peak nothing does."""
    problem = dynamic_problem([run(1e-3, TRUTH._replace(alpha_1=alpha_1))], ("both",), ("inertia",), 1, None)
    fixed = {NAMES["alpha_1"]: 0.0, NAMES["v_s"]: 1.0}
    start = {NAMES[name]: value for name, value in TRUTH._asdict().items() if NAMES[name] not in fixed} | {INERTIA: J}
    fit = fit_tracking(replace(problem, fixed=fixed), start, "revolute", search=False).fit
    said = {n.name for n, e in fit.parameters.items() if "takes-up-peak" in {w.code for w in e.warnings}}
    assert ("alpha_2" in said) == bool(alpha_1)
    assert said <= {"alpha_0", "alpha_2"}
    assert bool(said) == bool(alpha_1)


def test_a_fit_that_did_not_converge_has_no_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is said of the fit, and no parameter has a value, an error or an interval, a peak that is asked for among them."""

    def unfinished(*given: object, **named: object) -> MultistartSolution[Unknown]:
        """The solution, as if it had run out of steps."""
        solution: MultistartSolution[Unknown] = solve_dynamic(*given, **named)  # type: ignore[arg-type]
        return solution._replace(minimum=solution.minimum._replace(converged=False))

    monkeypatch.setattr("bristle.identification.dynamic.fit.solve_dynamic", unfinished)
    problem = replace(dynamic_problem([run(1e-3)], ("both",), ("inertia",), 1, None), stribeck="stribeck")
    start = {NAMES[name]: value for name, value in TRUTH._asdict().items()} | {INERTIA: J}
    fit = fit_tracking(problem, start, "revolute", search=False).fit
    assert fit.outcome.code == "not-converged"
    assert {(e.value, e.standard_error, e.interval) for e in fit.parameters.values()} == {(None, None, None)}

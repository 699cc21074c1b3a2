from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.identification.fisher import covariance, gram, motion_jacobian
from bristle.questions.experiment_design import excitation
from bristle.questions.experiment_design.excitation import (
    MotionProblem,
    best_motion,
    course,
    evaluate_motion,
    information,
    limited,
    plain_lines,
    within_torque,
)
from bristle.simulation.edro import TABLE_1, inertia
from bristle.simulation.references import Multisine

from .limits import LIMITS

PAIR = TABLE_1["gripper rotation"]
P = PAIR.positive
J = inertia(PAIR)
VALUES = np.array([*PAIR.positive, *PAIR.negative, J])
PROBLEM = MotionProblem(
    sets=(PAIR,),
    inertias=(J,),
    prior_information=np.diag((0.05 * VALUES) ** -2),
    noise=4e-4,
    step=0.01,
    limits=LIMITS,
    duration=4.0,
    aims=tuple(range(13)),
)


def relative(errors: Array) -> float:
    """Root of the sum of squared relative standard errors."""
    return float(np.linalg.norm(errors / VALUES))


@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.tuples(st.floats(1e-4, 5.0), st.floats(0.1, 8.0), st.floats(0.0, 6.3)), min_size=1, max_size=6),
    st.floats(1.5, 3.0),
)
def test_a_motion_stays_within_its_limits(sines: list[tuple[float, float, float]], duration: float) -> None:
    """Position, velocity and acceleration keep within their limits whatever is asked; it begins and ends at rest in the middle.

    Sines once scaled to the limits are not scaled again, keep their frequencies and phases, and give the course of those asked for.
    """
    lines = Multisine(*np.array(sines).T)
    run = course(lines, LIMITS, duration, 0.01)
    assert LIMITS.position[0] <= run.position.min() <= run.position.max() <= LIMITS.position[1]
    assert np.abs(run.velocity).max() <= LIMITS.velocity
    assert np.abs(run.acceleration).max() <= LIMITS.acceleration
    assert run.position[[0, -1]] == pytest.approx(0.5)
    assert np.abs(run.velocity[[0, -1]]).max() <= 1e-9
    played = limited(lines, LIMITS, duration, 0.01)
    assert limited(played, LIMITS, duration, 0.01).amplitude == pytest.approx(played.amplitude, rel=1e-12)
    assert (played.frequency.tolist(), played.phase.tolist()) == (lines.frequency.tolist(), lines.phase.tolist())
    assert course(played, LIMITS, duration, 0.01).position == pytest.approx(run.position, abs=1e-12)
    wanted = evaluate_motion(lines, replace(PROBLEM, duration=duration)).lines
    assert wanted.amplitude == pytest.approx(played.amplitude)


def test_information_is_that_of_the_model_and_the_acceleration() -> None:
    """What a motion tells is J'J / noise**2 of friction through the bristle with the acceleration for the inertia, as the other route has it."""
    run = course(plain_lines(LIMITS), LIMITS, 2.0, 0.01)
    matrix, torque = information(run.velocity, run.acceleration, PROBLEM)
    other = gram(motion_jacobian(run.velocity, 0.01, PAIR, {"inertia": run.acceleration}), PROBLEM.noise)
    assert matrix == pytest.approx(other, rel=1e-9, abs=1e-9 * np.abs(other).max())
    assert torque > J * np.abs(run.acceleration).max() / 2
    found = evaluate_motion(plain_lines(LIMITS), replace(PROBLEM, duration=2.0))
    assert found.errors == pytest.approx(covariance(PROBLEM.prior_information + other)[0], rel=1e-6)


def test_the_planned_motion_beats_the_plain_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its relative errors are smaller than those of a plain multisine, within the torque limit; the same each time; longer is better.

    Planned for sigma_1 alone, its two errors are smaller than when planned for all.
    """
    monkeypatch.setattr(excitation, "TRIES", 10)
    monkeypatch.setattr(excitation, "STEPS", 60)
    calls: list[tuple[int, int]] = []
    found = best_motion(PROBLEM, lambda _, done, total: calls.append((done, total)))
    plain = evaluate_motion(within_torque(plain_lines(LIMITS), PROBLEM), PROBLEM)
    assert relative(found.errors) < 0.98 * relative(plain.errors)
    assert max(found.torque, plain.torque) <= LIMITS.torque
    assert found.errors.tolist() == best_motion(PROBLEM).errors.tolist()
    assert relative(evaluate_motion(found.lines, replace(PROBLEM, duration=8.0)).errors) < relative(found.errors)
    assert calls == [(k, 70) for k in range(70)]
    own = (5, 11)
    one = best_motion(replace(PROBLEM, aims=own))
    of_one, of_all = (relative(np.where(np.isin(range(13), own), x.errors, 0)) for x in (one, found))
    assert of_one < of_all


def test_a_motion_is_scaled_down_to_the_torque_of_the_drive() -> None:
    """Where it would take too much torque it is scaled down until it does not, and left as it is where it would not."""
    weak = replace(PROBLEM, limits=replace(LIMITS, torque=0.04))
    lines = plain_lines(LIMITS)
    assert evaluate_motion(lines, weak).torque > 0.04
    assert evaluate_motion(within_torque(lines, weak), weak).torque <= 0.04
    strong = replace(PROBLEM, limits=replace(LIMITS, torque=1.0))
    assert within_torque(lines, strong).amplitude.tolist() == lines.amplitude.tolist()

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.identification.limits import Limits
from bristle.model.parameters import Direction
from bristle.questions.experiment_design import references as reference
from bristle.questions.experiment_design.loading import CYCLES, design_loading
from bristle.questions.experiment_design.references import PlannedRun
from bristle.simulation.edro import TABLE_1

from .limits import LIMITS

P = TABLE_1["gripper rotation"].positive
STEP = 0.01


def played(velocities: list[float], limits: Limits, deflection: float) -> list[PlannedRun]:
    """Each pass and the moves between, in order."""
    holds = [h for k, v in enumerate(velocities, 1) for h in reference.passes(v, k, deflection, limits)]
    found, at = [], sum(limits.position) / 2
    for where, hold in reference.ordered(holds, limits):
        found += [reference.played(reference.move_within(at, where, limits), STEP), reference.played(hold, STEP, where)]
        at = where + hold.travel
    return found


@settings(max_examples=25, deadline=None)
@given(
    speeds=st.lists(st.tuples(st.floats(0.05, 1.0), st.sampled_from([-1, 1])), min_size=1, max_size=6),
    low=st.floats(-3.0, 3.0),
    travel=st.floats(1.5, 6.0),
    acceleration=st.floats(3.0, 30.0),
    deflection=st.floats(1e-4, 0.01),
    hold=st.floats(0.3, 4.0),
)
def test_references_respect_every_limit(
    speeds: list[tuple[float, int]], low: float, travel: float, acceleration: float, deflection: float, hold: float
) -> None:
    """Positions, velocities and accelerations keep within their limits; position is the integral of velocity, and nowhere jumps."""
    limits = replace(LIMITS, position=(low, low + travel), velocity=1.0, acceleration=acceleration, hold=hold)
    found = played([v * sign for v, sign in speeds], limits, deflection)
    for r in found:
        assert limits.position[0] <= r.position.min() <= r.position.max() <= limits.position[1]
        assert np.abs(r.velocity).max() <= limits.velocity
        assert np.abs(np.diff(r.velocity)).max() <= limits.acceleration * STEP
        assert r.velocity[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-12)
        trapezoid = np.cumsum((r.velocity[1:] + r.velocity[:-1]) * STEP / 2)
        assert r.position[1:] - r.position[0] == pytest.approx(trapezoid, abs=limits.acceleration * STEP**2)
    assert all(abs(a.position[-1] - b.position[0]) <= 1e-9 for a, b in pairwise(found))


@settings(max_examples=25, deadline=None)
@given(speed=st.floats(0.02, 1.0), deflection=st.floats(1e-4, 0.01), hold=st.floats(0.5, 8.0))
def test_every_run_is_averaged_as_long_as_asked(speed: float, deflection: float, hold: float) -> None:
    """A run's passes add up to the averaging time, each at exactly its speed after a run-in of eight deflections and 0.6 s."""
    limits = replace(LIMITS, hold=hold)
    holds = reference.passes(-speed, 3, deflection, limits)
    assert sum(h.averaged for h in holds) == pytest.approx(hold)
    for h in holds:
        assert h.run_in * speed >= 8 * deflection * (1 - 1e-12)
        assert h.run_in >= 0.6
        r = reference.played(h, STEP)
        steady = np.flatnonzero(r.velocity == -speed)
        assert (np.diff(steady) == 1).all()
        assert (steady.size + 1) * STEP >= h.run_in + h.averaged
        assert r.position[-1] == pytest.approx(h.travel)
        assert r.run == 3


def test_acceleration_is_continuous() -> None:
    """Between a velocity and the next the acceleration of a fine reference never jumps by more than a few percent of its peak."""
    hold = reference.passes(1.0, 1, 1e-3, replace(LIMITS, hold=0.5))[0]
    a = np.diff(reference.played(hold, 1e-4).velocity) / 1e-4
    assert np.abs(np.diff(a)).max() <= 0.01 * np.abs(a).max()


def test_too_little_travel_is_refused() -> None:
    """A speed at which nothing is left to average is refused in one sentence, and the fastest that is allowed leaves enough."""
    short = replace(LIMITS, position=(0.0, 0.3))
    with pytest.raises(ValueError, match=r"the travel of 0\.3 leaves"):
        reference.passes(1.0, 1, 1e-3, short)
    most = reference.fastest(1e-3, short)
    assert LIMITS.slowest < most < 1.0
    assert sum(h.averaged for h in reference.passes(most, 1, 1e-3, short)) == pytest.approx(3.0)
    with pytest.raises(ValueError, match="too short for a hold"):
        reference.fastest(1e-3, replace(LIMITS, position=(0.0, 0.01)))


@pytest.mark.parametrize(("tag", "sign"), [("+", 1.0), ("-", -1.0)])
def test_loading_rises_to_its_peak_and_falls(tag: str, sign: float) -> None:
    """Torque begins and ends at zero, reaches the peak of its sign once a cycle, never beyond, and rises as slowly as planned."""
    plan = design_loading(Direction(tag), P, 0.0, 1e-4, 0.0)
    torque = sign * reference.played(reference.slow_loads(plan), STEP, run=7).torque
    assert torque[0] == torque[-1] == 0
    assert torque.min() >= 0
    assert torque.max() == pytest.approx(plan.peak, rel=1e-9)
    assert np.diff(torque).max() == pytest.approx(plan.peak * STEP / plan.rise)
    tops = (torque[1:-1] >= torque[:-2]) & (torque[1:-1] > torque[2:])
    assert tops.sum() == CYCLES

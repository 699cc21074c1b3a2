"""Slow loading: pieces, count edges, breakaway, hysteresis loops."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.data.differentiation import smoothed
from bristle.data.encoder import smallest_step
from bristle.data.record import Record
from bristle.data.slow_loading import find_loadings, find_loops
from bristle.errors import InputError
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout

P = Lugre(0.0194, 0.0055, 0.0394, 0.0720, 6.1843, 0.0184)
G0 = P.alpha_0 + P.alpha_1
STEP = 0.01


def displacement(torque: Array) -> Array:
    """Where slow loading from rest brings the joint."""
    y: Array = -(G0 / P.sigma_0) * np.log(1 - torque / G0)
    return y


def ramp(quantum: float, phase: float = 0.0, share: float = 0.8, sign: float = 1.0) -> Record:
    """Torque from zero to a share of g0 in 20 s, seen by an encoder."""
    time = np.arange(0, 20, STEP)
    torque = share * G0 * time / time[-1]
    y = displacement(torque)
    position = y if quantum == 0 else quantum * np.floor(y / quantum + phase)
    return Record(file="ramp.csv", time=time, position=sign * position, torque=sign * torque)


def cycle(turns: int = 3, share: float = 0.8) -> Record:
    """A triangle of displacement, driven through LuGre itself: closed loops."""
    reach = float(displacement(np.array([share * G0]))[0])
    time = np.arange(0, 4.0 * turns + 1, STEP)
    position = reach * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * time / 4))
    torque = P.sigma_0 * rollout(np.gradient(position, time), STEP, P, 0.0).z
    return Record(file="cycle.csv", time=time, position=position, torque=torque)


@given(st.floats(0, 0.999), st.sampled_from([1.0, -1.0]), st.sampled_from([12, 14, 16]))
@settings(deadline=None, max_examples=40)
def test_edges_lie_on_the_true_displacement(phase: float, sign: float, bits: int) -> None:
    """Wherever the joint rests in a count, the torque at each edge is the one that brings it there, to a sample; and edges are one count apart."""
    quantum = 2 * np.pi / 2**bits
    (found,) = find_loadings(ramp(quantum, phase, sign=sign), 1e3, quantum, None)
    assert found.direction == ("+" if sign > 0 else "-")
    np.testing.assert_allclose(np.diff(found.edge_displacement), quantum, rtol=1e-9)
    true = displacement(found.edge_torque)
    np.testing.assert_allclose(
        true - true[0],
        found.edge_displacement - found.edge_displacement[0],
        atol=2 * np.ptp(displacement(np.array([0.8, 0.7995]) * G0)),
    )


def test_a_cycle_is_cut_where_its_torque_passes_zero() -> None:
    """Each half cycle loads once in each direction, from zero torque up to its turn, with torque and displacement positive along it."""
    found = find_loadings(cycle(), 1e3, None, None)
    assert [x.direction for x in found] == ["+", "-", "+", "-", "+", "-", "+"]
    for x in found:
        assert 0 < x.torque[0] < 0.05 * G0
        assert x.torque[-1] == pytest.approx(x.torque.max(), rel=1e-6)
        assert (np.diff(x.displacement) > -1e-12).all()
        assert x.breakaway is None


def test_loops_have_the_loss_and_stiffness_of_the_law() -> None:
    """A closed cycle loses the work of the law around it, cycles settle to one loss, and no regression is stiffer than the bristle."""
    record = cycle(turns=8)
    found, drifts = find_loops(record, 1e3, None)
    assert drifts == ()
    assert len(found) == 7
    assert record.torque is not None
    assert record.position is not None
    one = slice(found[-1].start, found[-1].stop + 1)
    middle = (record.torque[one][1:] + record.torque[one][:-1]) / 2
    assert found[-1].loss == pytest.approx(abs(float(middle @ np.diff(record.position[one]))), rel=1e-9)
    assert found[-1].loss == pytest.approx(found[-2].loss, rel=2e-3)
    assert 0 < found[-1].slope < found[-1].inverse_slope
    assert found[-1].slope < P.sigma_0


def test_a_cycle_that_drifts_is_no_loop() -> None:
    """A cycle whose ends are a third of its range apart is not given as a loop; how far apart they are is."""
    record = cycle(turns=8)
    assert record.position is not None
    drift = np.ptp(record.position) * record.time / record.time[-1]
    found, drifts = find_loops(replace(record, position=record.position + 3 * drift), 1e3, None)
    assert found == ()
    assert len(drifts) == 7
    assert all(0.2 < share < 0.5 for share in drifts)


def test_breakaway_is_seen_where_the_joint_slides() -> None:
    """A ramp of torque past g0 breaks away near g0; a displacement that is declared is found where the displacement is reached."""
    time = np.arange(0, 12, STEP)
    torque = 1.2 * G0 * time / 12
    below = np.minimum(torque, 0.999 * G0)
    slid = np.cumsum(np.maximum(torque - G0, 0.0) / P.alpha_2) * STEP
    position = displacement(below) + slid
    record = Record(file="slip.csv", time=time, position=position, torque=torque)
    (found,) = find_loadings(record, 2.0, None, None)
    assert found.breakaway == pytest.approx(G0, rel=0.1)
    (declared,) = find_loadings(record, 2.0, None, 0.004)
    assert declared.breakaway == pytest.approx(float(np.interp(0.004, position, torque)), rel=0.01)


def test_a_run_that_slides_is_refused() -> None:
    """Sliding to and fro is no presliding: the torque is there at once and the joint travels; one sentence says so."""
    time = np.arange(0, 10, STEP)
    velocity = 0.2 * np.sin(2 * np.pi * 0.2 * time)
    position = np.cumsum(velocity) * STEP
    record = Record(file="slide.csv", time=time, position=position, torque=rollout(velocity, STEP, P, 0.0).torque)
    with pytest.raises(
        ValueError, match=r"slide\.csv: the joint slides: .* give this one as experiment: tracking or ramp"
    ):
        find_loadings(record, 1e3, None, None)


@given(st.floats(1e-7, 1e-2), st.integers(2, 60), st.integers(0, 5))
@settings(deadline=None)
def test_the_count_is_found_in_the_readings(quantum: float, levels: int, seed: int) -> None:
    """Whatever the count, readings on its grid show it, rounded to six digits as in a log; noise on no grid shows none."""
    rng = np.random.default_rng(seed)
    readings = quantum * np.concatenate([np.arange(levels), rng.integers(0, levels, 100)])
    assert smallest_step(readings) == pytest.approx(quantum, rel=1e-6)
    assert smallest_step(rng.standard_normal(50)) == 0.0
    assert smallest_step(np.ones(10)) == 0.0


def test_a_count_far_below_the_readings_is_thinned_and_an_absurd_one_refused() -> None:
    """Whatever count is declared, no more than four edges a reading are kept, in order; one of more counts than any encoder has is bad input."""
    (first, *_) = find_loadings(cycle(), 1e3, 1e-12, None)
    assert 0 < first.edge_torque.size <= 4 * first.torque.size
    assert (np.diff(first.edge_displacement) > 0).all()
    for absurd in (1e-30, 1e-300):
        with pytest.raises(
            InputError, match=r"counts of encoder_resolution, more than any encoder has; check its unit"
        ):
            find_loadings(cycle(), 1e3, absurd, None)
        with pytest.raises(InputError, match="encoder_resolution"):
            find_loops(cycle(), 1e3, absurd)


@given(st.floats(1e-30, 1.0))
@settings(deadline=None)
def test_a_low_pass_can_be_computed_or_is_refused(cutoff: float) -> None:
    """Any cut-off gives a finite signal that is no larger than a few times what went in, or one sentence about units."""
    record = cycle()
    assert record.torque is not None
    try:
        smooth = smoothed(record, record.torque, cutoff)
    except InputError as refused:
        assert "the unit of time" in str(refused)  # noqa: PT017  # either way is right, and which depends on the cut-off
        return
    assert np.isfinite(smooth).all()
    assert np.abs(smooth).max() <= 3 * np.abs(record.torque).max()

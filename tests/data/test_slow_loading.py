from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.data.differentiation import smoothed
from bristle.data.encoder import smallest_step
from bristle.data.record import Record
from bristle.data.slow_loading import find_all_loadings, find_loadings, find_loops
from bristle.errors import InputError
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout

from ..conftest import present

P = Lugre(0.0194, 0.0055, 0.0394, 0.0720, 6.1843, 0.0184)
G0 = P.alpha_0 + P.alpha_1
STEP = 0.01


def displacement(torque: Array) -> Array:
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


def test_cycles_and_loops() -> None:
    """Each half cycle loads once in each direction, from zero torque up to its turn, with torque and displacement positive along it."""
    found = find_loadings(cycle(), 1e3, None, None)
    assert [x.direction for x in found] == ["+", "-", "+", "-", "+", "-", "+"]
    for x in found:
        assert 0 < x.torque[0] < 0.05 * G0
        assert x.torque[-1] == pytest.approx(x.torque.max(), rel=1e-6)
        assert (np.diff(x.displacement) > -1e-12).all()
        assert x.breakaway is None
    # a closed cycle loses the work of the law around it, cycles settle to one loss, and no regression is stiffer than the bristle
    record = cycle(turns=8)
    found, drifts = find_loops(record, 1e3, None)
    assert drifts == ()
    assert len(found) == 7
    one = slice(found[-1].start, found[-1].stop + 1)
    middle = (present(record.torque)[one][1:] + present(record.torque)[one][:-1]) / 2
    assert found[-1].loss == pytest.approx(abs(float(middle @ np.diff(present(record.position)[one]))), rel=1e-9)
    assert found[-1].loss == pytest.approx(found[-2].loss, rel=2e-3)
    slope, inverse = found[-1].slope, found[-1].inverse_slope
    assert slope is not None
    assert inverse is not None
    assert 0 < slope < inverse
    assert slope < P.sigma_0
    x = found[-1].torque_amplitude / G0
    assert found[-1].secant == pytest.approx(P.sigma_0 * x / np.arctanh(x), rel=0.02)
    assert found[-1].torque_amplitude == pytest.approx(
        found[-1].displacement_amplitude * (found[-1].secant or 0), rel=2e-3
    )
    # a cycle whose ends are a third of its range apart is not given as a loop; how far apart they are is
    drift = np.ptp(present(record.position)) * record.time / record.time[-1]
    found, drifts = find_loops(replace(record, position=present(record.position) + 3 * drift), 1e3, None)
    assert found == ()
    assert len(drifts) == 7
    assert all(0.2 < share < 0.5 for share in drifts)
    # sliding back and forth is no presliding: the torque is there at once and the joint travels; one sentence says so
    time = np.arange(0, 10, STEP)
    velocity = 0.2 * np.sin(2 * np.pi * 0.2 * time)
    position = np.cumsum(velocity) * STEP
    record = Record(file="slide.csv", time=time, position=position, torque=rollout(velocity, STEP, P, 0.0).torque)
    with pytest.raises(
        ValueError, match=r"slide\.csv: the joint slides: .* give this one as experiment: tracking or ramp"
    ):
        find_loadings(record, 1e3, None, None)


def slipped(level: float, top: float, seconds: float = 12.0, back: bool = False) -> Record:
    """A ramp of torque to a top, which breaks away at a level; with `back` the torque falls again and the joint sticks."""
    time = np.arange(0, seconds, STEP)
    torque = top * time / seconds
    slid = np.cumsum(np.maximum(torque - level, 0.0) / P.alpha_2) * STEP
    position = -(level / P.sigma_0) * np.log(1 - np.minimum(torque, 0.99 * level) / level) + slid
    if back:
        time, torque = np.arange(0, 2 * seconds, STEP), np.append(torque, torque[::-1])
        position = np.append(position, np.full(position.size, position[-1]))
    return Record(file="slip.csv", time=time[: torque.size], position=position, torque=torque)


@pytest.mark.parametrize("top", [1.1, 1.5, 2.0, 4.0])
@pytest.mark.parametrize("back", [False, True])
def test_breakaway_does_not_depend_on_what_follows(top: float, back: bool) -> None:
    """However far the torque rises beyond, and whether or not it falls again, the joint breaks away near g0, or where it was declared to."""
    record = slipped(G0, top * G0, back=back)
    (first, *_), (declared, *_) = (find_loadings(record, 2.0, None, x) for x in (None, 0.004))
    assert first.breakaway == pytest.approx(G0, rel=0.12)
    at = int(np.argmax(present(record.position) >= 0.004))
    assert declared.breakaway == pytest.approx(present(record.torque)[at], rel=0.01)


def test_a_torque_exceeded_without_sliding_is_no_breakaway() -> None:
    """A jump by some counts at half of g0, and then no more, is no breakaway: nor is fast creep up to a torque that another run holds."""
    # a joint that slides far has broken away, though another run held more
    calm = ramp(0.0)
    hop = replace(calm, position=present(calm.position) + 2e-3 * (calm.time > 9))
    assert [x.breakaway for x in find_loadings(hop, 2.0, None, None)] == [None]
    creep = replace(calm, file="creep.csv", position=present(calm.position) + 2e-3 * np.maximum(calm.time - 19.5, 0.0))
    assert calm.torque is not None
    higher = ramp(0.0, share=0.9)
    (alone,) = find_loadings(creep, 5.0, None, None)
    assert alone.breakaway == pytest.approx(0.78 * G0, rel=0.02)
    (with_more,), (more,) = find_all_loadings([replace(x, cutoff=5.0) for x in (creep, higher)], None, None)
    assert (with_more.breakaway, more.breakaway) == (None, None)
    assert with_more.torque.size > alone.torque.size
    (slid,), _ = find_all_loadings([replace(x, cutoff=2.0) for x in (slipped(0.7 * G0, G0), higher)], None, None)
    assert slid.breakaway == pytest.approx(0.7 * G0, rel=0.12)
    # a count of more than any encoder has is bad input
    with pytest.raises(InputError, match=r"counts of encoder_resolution, more than any encoder has; check its unit"):
        find_loops(cycle(), 1e3, 1e-30)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-4, 1e-3]), st.floats(0, 10))
@settings(max_examples=60)
def test_what_is_no_stiffness_is_absent(seed: int, quantum: float, noise: float) -> None:
    """Whatever a cycle is, noise, standstill and motion against the torque among it, a slope is positive and finite or absent."""
    # NumPy warns of nothing
    rng, record = np.random.default_rng(seed), cycle()
    position = rng.choice([-1.0, 0.0, 1.0]) * present(record.position) + noise * 1e-3 * rng.standard_normal(
        record.time.size
    )
    if quantum:
        position = quantum * np.floor(position / quantum)
    for x in find_loops(replace(record, position=position), 2.0, quantum or None)[0]:
        for value in (x.secant, x.slope, x.inverse_slope):
            assert value is None or 0 < value < np.inf


@given(st.floats(1e-7, 1e-2), st.integers(2, 60), st.integers(0, 5))
def test_the_count_is_found_in_the_readings(quantum: float, levels: int, seed: int) -> None:
    """Whatever the count, readings on its grid show it, rounded to six digits as in a log; noise on no grid shows none."""
    rng = np.random.default_rng(seed)
    readings = quantum * np.concatenate([np.arange(levels), rng.integers(0, levels, 100)])
    assert smallest_step(readings) == pytest.approx(quantum, rel=1e-6)
    assert smallest_step(rng.standard_normal(50)) == 0.0
    assert smallest_step(np.ones(10)) == 0.0


@given(st.floats(1e-30, 1.0))
def test_a_low_pass_can_be_computed_or_is_refused(cutoff: float) -> None:
    """Any cut-off gives a finite signal that is no larger than a few times what went in, or one sentence about units."""
    record = cycle()
    try:
        smooth = smoothed(record, present(record.torque), cutoff)
    except InputError as refused:
        assert "the unit of time" in str(refused)  # noqa: PT017  # either way is right, and which depends on the cut-off
        return
    assert np.isfinite(smooth).all()
    assert np.abs(smooth).max() <= 3 * np.abs(present(record.torque)).max()

"""Which experiment a log is of: velocities held, slow loading, any other motion, and mixtures of them."""

import numpy as np
import pytest

from bristle.arrays import Array
from bristle.data.differentiation import estimate_motion
from bristle.data.record import Record
from bristle.data.run_kinds import Stretches, kinds_of, stretches
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout

G0, STIFFNESS, J = 0.5, 100.0, 0.05  # N*m, N*m/rad, kg*m**2: the joint bends by 5 mrad, of which a count is a hundredth


def log(rate: float, v: Array, q: Array | None = None, T: Array | None = None, *, velocity: bool = True) -> Record:
    """A motion with Coulomb and viscous friction and an inertia, or with the torque given, with noise and counts."""
    rng, q = np.random.default_rng(0), np.cumsum(v) / rate if q is None else q
    T = G0 * np.tanh(v / 0.003) + 0.2 * v + J * np.gradient(v) * rate if T is None else T
    record = Record(
        file="log.csv",
        time=np.arange(q.size) / rate,
        position=5e-5 * np.round(q / 5e-5),
        torque=T + 0.01 * G0 * rng.standard_normal(q.size),
        velocity=v + 1e-3 * rng.standard_normal(v.size) if velocity else None,
    )
    return record if velocity else estimate_motion(record, 10.0)


def held(rate: float, speeds: Array) -> Array:
    """Each speed back and forth for 2 s, with a rest and a tenth of a second to speed up."""
    rise = np.linspace(0, 1, int(0.1 * rate))
    shape = np.concatenate([rise, np.ones(int(2 * rate)), rise[::-1], np.zeros(int(0.3 * rate))])
    return np.concatenate([sign * v * shape for v in speeds for sign in (1, -1)])


def swung(rate: float, seconds: float) -> Array:
    """The velocity of two sines, rad/s."""
    t = np.arange(int(seconds * rate)) / rate
    return 1.0 * np.sin(2 * np.pi * 0.3 * t) + 0.6 * np.sin(2 * np.pi * 0.8 * t)


def loaded(rate: float, share: float) -> Record:
    """Three slow cycles of torque up to a share of breakaway, with the bristles' own softening."""
    quarter = np.linspace(0, share * G0, int(1.5 * rate))
    T = np.tile(np.concatenate([quarter, quarter[::-1], -quarter, -quarter[::-1]]), 3)
    dT = np.gradient(T)
    q = np.cumsum(dT / (STIFFNESS * (1 - np.sign(dT) * T / G0)))
    return log(rate, np.gradient(q) * rate, q, T)


def kind(record: Record) -> str:
    """What a log alone is taken for."""
    return kinds_of([(record.file, stretches(record, "revolute"))])[0]


@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("velocity", [True, False])
def test_held_velocities_are_ramps_and_swings_are_tracking(rate: float, velocity: bool) -> None:
    """At 100 and 1000 Hz, with a logged velocity and without: six speeds held are a ramp run, two sines a tracking one."""
    assert kind(log(rate, held(rate, np.geomspace(0.05, 1.5, 6)), velocity=velocity)) == "ramp"
    assert kind(log(rate, swung(rate, 20), velocity=velocity)) == "tracking"


@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_slow_loading_is_presliding(rate: float) -> None:
    """Cycles of torque below breakaway are slow loading, whole; a small but sliding motion of the same travel is not."""
    record = loaded(rate, 0.8)
    assert kind(record) == "presliding"
    assert stretches(record, "revolute").loaded > 0.8 * record.time[-1]
    small = 0.02 * np.sin(2 * np.pi * np.arange(int(10 * rate)) / rate)
    assert kind(log(rate, small)) == "tracking"


def test_a_slow_sine_of_torque_below_breakaway_is_presliding() -> None:
    """Each rise of 0.5 s is one, though at 67 Hz it has 33 or 34 samples, 0.48 or 0.49 s from the first to the last."""
    t = np.arange(670) / 67.0
    T = 0.8 * G0 * np.sin(np.pi * t + 0.03)
    q = np.cumsum(np.gradient(T) / (STIFFNESS * (1 - np.sign(np.gradient(T)) * T / G0)))
    found = stretches(log(67.0, np.gradient(q) * 67.0, q, T, velocity=False), "revolute")
    assert (found.kind, found.moving) == ("presliding", 0.0)


def test_slow_loading_until_it_slides_both_ways_is_presliding() -> None:
    """A slow cycle of torque that breaks the joint away in each direction is slow loading, though the second begins elsewhere."""
    rate, quarter = 500.0, np.linspace(0, 0.99 * G0, 5000)
    way = np.cumsum(np.gradient(quarter) / (STIFFNESS * (1 - quarter / G0)))
    slide = np.linspace(0, 1.0, 1500)
    q = np.concatenate([way, way[-1] + slide, way[-1] + 1.0 - way, 0.0 - slide])
    T = np.concatenate([quarter, np.full(1500, 1.05 * G0), -quarter, np.full(1500, -1.05 * G0)])
    assert kind(log(rate, np.gradient(q) * rate, q, T)) == "presliding"


def test_short_strokes_that_slide_are_tracking() -> None:
    """A motion of several sines within 15 mrad, seven times as far as the bristle bends, goes with its direction more than with its position."""
    t = np.arange(0, 30, 2e-3)
    sines = np.sin(2 * np.pi * np.array([[0.3], [0.9], [2.1]]) * t)
    q = np.minimum(t / 2, 1) ** 3 * (np.array([0.012, 0.004, 0.0015]) @ sines)
    v = np.gradient(q, t)
    T = rollout(v, 2e-3, Lugre(1.2, 0.5, 0.8, 0.05, 900.0, 6.0)).torque + 0.06 * np.gradient(v, t)
    assert kind(log(500.0, v, q, T, velocity=False)) == "tracking"


def test_slow_turns_are_no_slow_loading() -> None:
    """A joint that slides for a moment at each of some speeds takes half a second to turn, and slides all the same."""
    speeds = np.ravel([(x, -x) for x in np.geomspace(0.008, 0.3, 8)])
    moves = np.concatenate([np.append(np.full(300, x), np.zeros(500)) for x in speeds])
    v = np.convolve(moves, np.full(1000, 1e-3), "valid")
    T = rollout(v, 1e-3, Lugre(0.8, 0.35, 0.6, 0.05, 1000.0, 1.0)).torque
    T = T + 0.01 * np.random.default_rng(0).standard_normal(v.size)
    assert kind(log(1000.0, v, np.cumsum(v) / 1000, T, velocity=False)) == "tracking"


def test_what_is_done_most_decides() -> None:
    """Slow loading, as of a joint that sticks before each of many speeds, is presliding where hardly anything else is done.

    With a third of the time between its speeds a run is tracking, one log of several too; with a fifth it is a ramp.
    """
    speeds = (0.1, 0.2, 0.4, -0.1, -0.2, -0.4)
    assert Stretches(held=5, loaded=26, broken=0, moving=17, total=48, speeds=speeds).kind == "tracking"
    assert Stretches(held=6, loaded=20, broken=0, moving=1, total=27, speeds=(0.3, -0.3)).kind == "presliding"
    few = Stretches(held=10, loaded=0, broken=0, moving=5, total=16, speeds=speeds)
    more = Stretches(held=12, loaded=0, broken=0, moving=3, total=16, speeds=(0.05, 0.8, 1.6, -0.8))
    single = Stretches(held=3, loaded=0, broken=0, moving=1.5, total=5, speeds=(0.1,))
    assert [kinds_of([("a.csv", x)]) for x in (few, more, single)] == [["tracking"], ["ramp"], ["ramp"]]
    assert kinds_of([("a.csv", few), ("b.csv", more)]) == ["tracking", "tracking"]


def test_logs_of_one_family_are_of_one_kind() -> None:
    """Logs whose names differ in numbers alone are what most of them are: one that sticks and slips does not leave its series."""
    steady = Stretches(held=9, loaded=0, broken=0, moving=1, total=10, speeds=(0.5,))
    sticks = Stretches(held=0, loaded=0, broken=0, moving=10, total=10)
    logs = [("v_0.01.csv", sticks), ("v_0.1.csv", steady), ("v_0.5.csv", steady), ("swing.csv", sticks)]
    assert kinds_of(logs) == ["ramp", "ramp", "ramp", "tracking"]
    several = Stretches(held=9, loaded=0, broken=0, moving=1, total=10, speeds=(0.1, 0.2, 0.5))
    slow = Stretches(held=0, loaded=10, broken=0, moving=0, total=10)
    for of, kinds in (
        ([slow, several, several], ["presliding", "ramp", "ramp"]),
        ([several, several, sticks], ["ramp", "ramp", "tracking"]),
    ):
        assert kinds_of([(f"log{k}.csv", does) for k, does in enumerate(of)]) == kinds


def test_what_a_mixture_leaves_out_is_told() -> None:
    """Of velocities held and two sines after them, the share that a ramp run leaves out is that of the sines; a tracking run leaves out nothing."""
    record = log(250.0, np.concatenate([held(250.0, np.geomspace(0.05, 1.5, 6)), swung(250.0, 13)]))
    does = stretches(record, "revolute")
    assert does.kind == "ramp"
    assert does.unused("ramp") == pytest.approx(13 / (13 + 26.4), abs=0.1)
    assert does.unused("tracking") == 0
    assert str(does) == "constant velocity 59%, other motion 41%"

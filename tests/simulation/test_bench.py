import numpy as np
import pytest
from scipy.stats import kstest

import simulated_edro
import virtual_bench
from bristle.arrays import Array
from bristle.control.plant import Sensors
from bristle.model import law, motor
from bristle.simulation import bench, edro
from virtual_bench import Clock, Logs, Ramps, Rig

PAIR = edro.TABLE_1["gripper rotation"]
CLOCK = Clock(2e-3, 5)
RAMPS = Ramps((0.02, 0.1, 0.6), plateau=2.0, run_in=0.03)
NOISE = 2e-4  # standard error of a plateau's mean torque, N*m


def gripper(noise: float) -> Rig:
    """The gripper on the bench; `noise` as NOISE."""
    m = simulated_edro.motor("gripper rotation")
    per_sample = noise * np.sqrt(RAMPS.plateau / (CLOCK.period * CLOCK.decimation))
    sensors = Sensors(simulated_edro.RESOLUTION, per_sample * m.R / m.k_t, 0.0)
    return Rig(PAIR, m, virtual_bench.ramp_gains(m.J, 60.0), 12.0 * m.k_t / m.R, sensors, CLOCK)


def means(joint: Rig, logs: Logs) -> tuple[Array, Array, Array]:
    """Velocity (slope of position), torque by (8) and (9) at that velocity, each (plateaus, seeds)."""
    rows = []
    for plateau in logs.plateaus:
        kept = (logs.time >= plateau.start) & (logs.time < plateau.stop)
        t = logs.time[kept] - logs.time[kept].mean()
        v = logs.position[:, kept] @ t / (t @ t)
        T = motor.drive_torque(logs.voltage[:, kept].mean(axis=1), v, joint.motor)
        p = PAIR[int(plateau.velocity < 0)]
        rows.append((v, T, np.array([float(law.steady_torque(float(x), p)) for x in v])))
    v, T, expected = np.array(rows).transpose(1, 0, 2)
    return v, T, expected


def test_plateaus_lie_on_the_steady_curve() -> None:
    """Without noise, each plateau moves at the speed that was asked for and shows the torque of (9), to 0.5 % of alpha_0."""
    joint = gripper(0.0)
    logs = virtual_bench.ramp_logs(joint, RAMPS, [0])
    v, T, expected = means(joint, logs)
    np.testing.assert_allclose(v[:, 0], [p.velocity for p in logs.plateaus], rtol=5e-3)
    assert np.abs(T - expected).max() < 0.005 * PAIR.negative.alpha_0


def test_noise_is_what_was_asked_for() -> None:
    """Over seeds, the plateaus' torques scatter about (9) with the standard error that the voltage noise implies, and normally."""
    joint = gripper(NOISE)
    _, T, expected = means(joint, virtual_bench.ramp_logs(joint, RAMPS, range(12)))
    z = ((T - expected) / NOISE).ravel()
    assert abs(z.mean()) < 4 / np.sqrt(z.size)
    assert abs(z.std() - 1) < 4 / np.sqrt(2 * z.size)
    assert kstest(z, "norm").pvalue > 1e-3


def test_the_seed_alone_decides() -> None:
    """One seed gives one log, bit for bit, whichever seeds run beside it; another seed gives another."""
    joint, short = gripper(NOISE), Ramps((0.2,), plateau=0.5)
    alone = virtual_bench.ramp_logs(joint, short, [7])
    batch = virtual_bench.ramp_logs(joint, short, [3, 7])
    np.testing.assert_array_equal(alone.voltage[0], batch.voltage[1])
    np.testing.assert_array_equal(alone.position[0], batch.position[1])
    assert not np.array_equal(batch.voltage[0], batch.voltage[1])


def test_joint_ends_where_it_began() -> None:
    """Each speed goes back and forth by the same angle, so that the excursion is that of one leg."""
    reference = RAMPS.at(CLOCK.instants(RAMPS.duration))
    legs = [p.velocity * (p.stop - p.start) for p in RAMPS.plateaus]
    assert abs(reference.position[-1]) < 2e-3
    assert np.ptp(reference.position) < 1.6 * max(legs)
    assert legs[0::2] == pytest.approx([-x for x in legs[1::2]])


def test_run_in_covers_the_angle_asked_for() -> None:
    """Between the turn and the plateau, every leg travels at least `run_in` and takes at least `settle`, so that the bristle has settled."""
    time = CLOCK.instants(RAMPS.duration)
    reference = RAMPS.at(time)
    for plateau in RAMPS.plateaus:
        at_start = np.searchsorted(time, plateau.start)
        turned = np.flatnonzero(reference.velocity[:at_start] * plateau.velocity <= 0)[-1]
        travelled = abs(reference.position[at_start] - reference.position[turned])
        assert travelled > RAMPS.run_in * 0.98
        assert time[at_start] - time[turned] >= RAMPS.settle


def test_planned_points_are_9_plus_noise() -> None:
    """Monte Carlo points have (9) as their mean and the stated deviation."""
    v, p = np.array([-0.5, -0.05, 0.05, 0.5]), PAIR.positive
    T = bench.steady_points(p, v, 1e-3, np.random.default_rng(0), 20_000)
    expected = [float(law.steady_torque(x, p)) for x in v.tolist()]
    assert T.shape == (20_000, 4)
    assert np.abs(T.mean(axis=0) - expected).max() < 5e-3 / np.sqrt(20_000)
    np.testing.assert_allclose(T.std(axis=0), 1e-3, rtol=0.03)

import runpy
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest

import simulated_edro
import virtual_bench
from bristle.arrays import Array
from bristle.control.compensator import Reference
from bristle.control.plant import Sensors
from bristle.data.experiment.load import load_experiment, read_runs
from bristle.identification.measured import measure
from bristle.model import law, motor
from bristle.model.law import is_passive
from bristle.model.parameters import Pair
from bristle.simulation import bench, edro
from bristle.simulation.references import FASTEST, HARDEST, STEEPEST, Hold, Move, Multisine, Sine, SlowLoads
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


def test_plateaus_and_slow_loads() -> None:
    """Without noise, each plateau moves at the speed that was asked for and shows the torque of (9), to 0.5 % of alpha_0."""
    joint = gripper(0.0)
    logs = virtual_bench.ramp_logs(joint, RAMPS, [0])
    v, T, expected = means(joint, logs)
    np.testing.assert_allclose(v[:, 0], [p.velocity for p in logs.plateaus], rtol=5e-3)
    assert np.abs(T - expected).max() < 0.005 * PAIR.negative.alpha_0
    # over seeds, the plateaus' torques scatter about (9) with the standard error that the voltage noise implies, and normally
    joint = gripper(NOISE)
    _, T, expected = means(joint, virtual_bench.ramp_logs(joint, RAMPS, range(12)))
    z = ((T - expected) / NOISE).ravel()
    assert abs(z.mean()) < 4 / np.sqrt(z.size)
    assert abs(z.std() - 1) < 4 / np.sqrt(2 * z.size)
    assert kstest(z, "norm").pvalue > 1e-3
    # Monte Carlo points have (9) as their mean and the stated deviation
    v, p = np.array([-0.5, -0.05, 0.05, 0.5]), PAIR.positive
    T = bench.steady_points(p, v, 1e-3, np.random.default_rng(0), 20_000)
    expected = [float(law.steady_torque(x, p)) for x in v.tolist()]
    assert T.shape == (20_000, 4)
    assert np.abs(T.mean(axis=0) - expected).max() < 5e-3 / np.sqrt(20_000)
    np.testing.assert_allclose(T.std(axis=0), 1e-3, rtol=0.03)
    # each peak with its sign after its rise, zero before, after and at each pause; the joint is asked to stay
    loads = SlowLoads((0.3, -0.2), rise=2.0, fall=0.5, rest=1.0, pause=0.25)
    r = loads.at(instants(loads.duration, 0.25))
    assert loads.duration == 1.0 + 2.0 + 0.5 + 0.25 + 2.0 + 0.5 + 1.0
    np.testing.assert_allclose(
        r.torque[[0, 4, 8, 12, 14, 15, 23, 25, 29]], [0, 0, 0.15, 0.3, 0, 0, -0.2, 0, 0], atol=1e-15
    )
    assert not np.any([r.position, r.velocity, r.acceleration])


STEP = 1e-4
HOLD = Hold(run=1, velocity=-0.7, run_in=0.6, averaged=0.4, ramp=0.3)
MOVE = Move(start=0.2, stop=-0.5, duration=0.8)
SINES = Multisine(np.array([0.3, 0.02]), np.array([0.4, 5.0]), np.array([0.0, 2.0]))
SINE = Sine(0.4, 1.5)
KINDS: dict[str, tuple[float, Callable[[Array], Reference]]] = {
    "hold": (HOLD.duration, lambda t: HOLD.at(t, 0.5)), "move": (MOVE.duration, MOVE.at),
    "multisine": (2.0, lambda t: SINES.at(t, 2.0)), "sine": (1.0, SINE.at),
}  # fmt: skip  # a table


def instants(duration: float, step: float = STEP) -> Array:
    """From 0 to the duration, s."""
    return np.arange(round(duration / step) + 1, dtype=np.float64) * step


def test_motions_begin_at_rest_and_have_their_derivatives() -> None:
    """Central differences of the position give the velocity, and those of the velocity the acceleration, to a thousandth."""
    for kind in list(KINDS):
        duration, at = KINDS[kind]
        r, inner = at(instants(duration)), slice(1, -1)
        for whole, slope in ((r.position, r.velocity), (r.velocity, r.acceleration)):
            np.testing.assert_allclose(np.gradient(whole, STEP)[inner], slope[inner], atol=1e-3 * np.abs(slope).max())
        assert r.torque == 0.0
    # velocity is zero at both ends, and a hold and a move end where they say
    for kind in ("hold", "move", "multisine"):
        duration, at = KINDS[kind]
        r = at(instants(duration))
        np.testing.assert_allclose(r.velocity[[0, -1]], 0.0, atol=1e-12)
        travelled = {"hold": HOLD.travel, "move": MOVE.stop - MOVE.start, "multisine": 0.0}[kind]
        assert r.position[-1] - r.position[0] == pytest.approx(travelled, abs=1e-12)


@settings(max_examples=20)
@given(st.floats(0.1, 2.0), st.floats(0.2, 3.0))
def test_the_largest_slopes_are_those_that_are_stated(velocity: float, duration: float) -> None:
    """A hold's ramp and a move reach the largest velocity and acceleration that their constants give, and no more."""
    hold = Hold(1, velocity, 0.1, 0.1, duration).at(instants(2 * duration + 0.2, duration / 1000))
    assert np.abs(hold.acceleration).max() == pytest.approx(STEEPEST * velocity / duration, rel=1e-5)
    move = Move(0.0, velocity, duration).at(instants(duration, duration / 1000))
    assert move.velocity.max() == pytest.approx(FASTEST * velocity / duration, rel=1e-5)
    assert np.abs(move.acceleration).max() == pytest.approx(HARDEST * velocity / duration**2, rel=1e-5)


FOLDER = edro.datasets_folder()
KINDS_OF_RUNS = ("ramp", "presliding", "tracking", "tracking")


# The rows of Table 1 as printed: (+) and (-) of each parameter in turn; columns gripper, wrist, elbow, base.
PRINTED = """
0.0194 0.0704 0.1018 0.2371
0.0148 0.1058 0.0957 0.1731
0.0055 0.0145 0.0514 0.0285
0.0040 0.0107 0.0209 0.1098
0.0394 0.1362 0.2216 0.1394
0.0307 0.1200 0.1495 0.1338
0.0720 0.0320 0.1230 0.0750
0.0720 0.0710 0.0450 0.0620
6.1843 38.3236 59.3440 70.5845
4.5356 40.0495 38.4564 50.2721
0.0184 0.1168 0.2579 0.4673
0.0146 0.1162 0.1874 0.3908
"""


def test_the_embedded_data_set(tmp_path: Path) -> None:
    """All of it is under 5 MB, and its README says SIMULATED and holds every assumption."""
    readme = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert sum(p.stat().st_size for p in FOLDER.iterdir()) < 5e6
    assert "SIMULATED" in readme
    for sentence in simulated_edro.ASSUMPTIONS:
        assert sentence in readme
    # each experiment file loads, says that it is simulated, holds the truth of Table 1, all assumptions, and logs that read without loss
    failed = []
    for path in edro.experiments():
        experiment = load_experiment(path)
        runs = read_runs(experiment)
        pair = edro.TABLE_1[experiment.joint.name]
        told = experiment.simulated and tuple(experiment.assumptions) == simulated_edro.ASSUMPTIONS
        true = (experiment.truth["+"], experiment.truth["-"]) == tuple(pair)
        kinds = [(run.kind, run.hold_out) for run in runs] == [
            *zip(KINDS_OF_RUNS, (False, False, False, True), strict=True)
        ]
        whole = all(run.record.dropped == 0 and run.record.rows == run.record.time.size for run in runs)
        failed += [] if told and true and kinds and whole else [path]
    assert failed == []
    # in the embedded example no negative plateau from 0.4 to 1.0 v_s is kept, stick-slip is the reason given, and those from 3 v_s are kept
    measured = measure(FOLDER / "base_paper_pid.yaml")
    v_s = edro.TABLE_1["base rotation"].negative.v_s
    (found,) = measured.segments
    backward = [s for s in found if s.velocity < 0]
    assert not [s for s in backward if s.accepted and -s.velocity < 1.1 * v_s]
    slow = [s for s in backward if 0.9 * v_s < -s.velocity < 1.3 * v_s]
    assert any(reason.code == "unsteady" for s in slow for reason in s.reasons)
    kept = [-s.velocity / v_s for s in backward if s.accepted]
    assert all(
        min(abs(k - speed) for k in kept) < 0.1 * speed for speed in simulated_edro.PAPER_PID_SPEEDS if speed >= 3
    )
    # entered a second time, row by row as the paper prints it, Table 1 is the same; one set breaks the passivity condition
    rows = np.array([row.split() for row in PRINTED.split("\n") if row], dtype=float)
    entered = np.array(list(edro.TABLE_1.values()))  # joint, direction, parameter
    np.testing.assert_array_equal(entered.transpose(2, 1, 0).reshape(12, 4), rows)
    assert [not is_passive(p) for pair in edro.TABLE_1.values() for p in pair] == [False] * 7 + [True]
    # (15), sigma_1 = 0.2 sqrt(J sigma_0), inverts to J = (sigma_1 / 0.2)**2 / sigma_0, the mean of both directions; in three digits
    found = [edro.inertia(pair) for pair in edro.TABLE_1.values()]
    assert np.array(found)[[0, 1, 3]] == pytest.approx([1.27e-3, 8.65e-3, 7.665e-2], rel=0.01)
    assert edro.inertia(Pair(PAIR.positive, PAIR.positive)) == pytest.approx((0.0184 / 0.2) ** 2 / 6.1843)
    # the script remakes every log and every experiment file, byte for byte, and leaves nothing else behind
    runpy.run_path(str(FOLDER / "make.py"))["main"](tmp_path)
    made = sorted(path.name for path in tmp_path.iterdir())
    assert made == sorted(path.name for path in FOLDER.iterdir() if path.suffix in {".csv", ".yaml"})
    for name in made:
        assert (tmp_path / name).read_bytes() == (FOLDER / name).read_bytes()

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bristle.arrays import Array
from bristle.control.adaptation import Adaptation
from bristle.identification.measured import measure
from bristle.model.parameters import Pair
from bristle.model.rollout import rollout
from bristle.questions.compensation.replay import Replay, replays
from bristle.simulation.joint_loop import JointLoop

from ..simulation.joints import GRIPPER, J, experiment, joint, joint_loop, share_of

STEP, SECONDS = 2e-3, 10.0
LINES = ((1.0, 0.3), (0.24, 1.3), (0.16, 3.1), (0.08, 7.0))  # amplitude, rad/s, and frequency, Hz, of the velocity
INERTIA = f"inertia: {J!r} kg*m**2\n"
GAP = (3.0, 5.0)


def motion(inertia: float = J, pair: Pair[float] = GRIPPER) -> tuple[Array, Array, Array]:
    """Time, velocity and torque of a joint of such friction and inertia."""
    t = np.arange(0, SECONDS, STEP)
    v = np.sum([a * np.sin(2 * np.pi * f * t + k) for k, (a, f) in enumerate(LINES)], axis=0)
    return t, v, rollout(v, STEP, pair, 0.0).torque + inertia * np.gradient(v, t)


def written(folder: Path, friction: float = 1.0, *, gap: bool = False) -> None:
    """The run of a gripper with so many times its Coulomb and viscous friction, as a log."""
    rows = zip(*motion(pair=Pair(*(share_of(p, friction) for p in GRIPPER))), strict=True)
    kept = (row for row in rows if not (gap and GAP[0] <= row[0] < GAP[1]))
    (folder / "run.csv").write_text("t,v,tau\n" + "".join(f"{a:.6g},{b:.12g},{c:.12g}\n" for a, b, c in kept), "utf-8")


def replayed(
    folder: Path, friction: float, one: JointLoop | None = None, more: str = INERTIA, *, gap: bool = False
) -> tuple[Replay, Replay]:
    """That run, replayed with the gripper's model, right and from a wrong start."""
    written(folder, friction, gap=gap)
    first, second = replays(one or joint_loop(), joint(), measure(experiment(folder, "", more)))
    return first, second


def test_a_replay_is_of_every_sample(tmp_path: Path) -> None:
    """Time, velocity, torques and gains are of the run's samples; friction is the torque without that of inertia, given or identified."""
    t, v, torque = motion()
    for more in (INERTIA, ""):
        for run, begun in zip(
            replayed(tmp_path, 1.0, None, more), ("identified", "0.3 alpha_0, 0.5 alpha_2"), strict=True
        ):
            assert (run.file, run.begun) == ("run.csv", begun)
            np.testing.assert_allclose(run.time, t, atol=1e-9)
            np.testing.assert_allclose(run.velocity, v, rtol=1e-9)
            assert run.measured.shape == run.fixed.shape == run.adapted.shape == t.shape
            assert run.theta.shape == (2, t.size)
            friction = rollout(v, STEP, GRIPPER, 0.0).torque
            assert np.abs(run.measured - friction)[50:-50].max() < 0.01 * np.abs(torque).max()
    # on a run of the model's own joint the gains stay at 1 to a hundredth, and the verdict is that adaptation changes nothing
    run, _ = replayed(tmp_path, 1.0)
    np.testing.assert_allclose(run.theta, 1.0, atol=0.01)
    before, after = run.relative_errors()
    assert max(before, after) < 1.0
    assert run.verdict.code == "adaptation-idle"
    assert run.verdict.numbers == {"before": before, "after": after, "ratios": run.ratios}
    # where Coulomb and viscous friction are 1.5 times the model's, both shares go most of the way, the error halves, and the verdict says
    # so. Errors are 100 norm(measured - predicted) / norm(measured) from the middle of the run on, with gains of 1 and adapted
    run, wrong = replayed(tmp_path, 1.5)
    assert (np.abs(run.theta[:, -1] - 1.5) < 0.2).all()
    assert (np.diff(run.theta[:, ::1000], axis=1) > 0).all()
    before, after = run.relative_errors()
    late = slice(run.time.size // 2, None)
    for found, predicted in ((before, run.fixed), (after, run.adapted)):
        left = np.linalg.norm((run.measured - predicted)[late]) / np.linalg.norm(run.measured[late])
        assert found == pytest.approx(100 * float(left))
    assert before == pytest.approx(100 / 3, abs=1.0)
    assert after < 0.5 * before
    assert run.verdict.code == "adaptation-helps"
    assert run.verdict.numbers == {"before": before, "after": after, "ratios": run.ratios}
    assert run.shares in str(run.verdict)
    np.testing.assert_allclose(wrong.theta[:, 0], [0.3, 0.5], rtol=0.01)
    assert (wrong.theta[:, -1] > wrong.theta[:, 0]).all()
    assert wrong.relative_errors()[1] < wrong.relative_errors()[0]


def test_gains_rates_and_limits_of_replays(tmp_path: Path) -> None:
    """A run with a gap is replayed stretch by stretch: as without one up to the gap, then from the gains that it had before it."""
    whole, _ = replayed(tmp_path, 1.5)
    run, _ = replayed(tmp_path, 1.5, gap=True)
    before = np.flatnonzero(run.time < GAP[0])
    assert run.theta.shape == (2, run.time.size)
    assert run.time.size == whole.time.size - round((GAP[1] - GAP[0]) / STEP)
    assert run.time[before.size] - run.time[before[-1]] > GAP[1] - GAP[0]
    np.testing.assert_allclose(run.theta[:, : before.size - 50], whole.theta[:, : before.size - 50], atol=1e-3)
    np.testing.assert_allclose(run.theta[:, before.size], run.theta[:, before[-1]], rtol=0.02)
    assert (run.theta[:, before.size] > 1.05).all()
    assert (run.theta[:, -1] > run.theta[:, before.size]).all()
    assert run.relative_errors()[1] < 0.5 * run.relative_errors()[0]
    # the torque error teaches as an error of position over K_p: twice the gain with twice the rates is the same replay
    one = joint_loop()
    stiff = joint_loop(gains=one.gains._replace(K_p=2 * one.gains.K_p), adaptation=Adaptation(gamma=(40.0, 40.0)))
    first, second = (replayed(tmp_path, 1.5, own)[0] for own in (one, stiff))
    np.testing.assert_allclose(first.theta, second.theta, rtol=1e-9)
    # where a gain ends at its upper limit the verdict is to leave the adaptation off, or to lower its rate
    one = joint_loop(adaptation=Adaptation(limits=(0.5, 1.2)))
    run, _ = replayed(tmp_path, 1.5, one)
    assert run.theta.max() == pytest.approx(1.2)
    assert run.verdict.code == "gain-at-limit"
    # where the rate is so high that every sample overshoots, a model that was right explains less, and the verdict is to leave it off
    run, _ = replayed(tmp_path, 1.0, joint_loop(adaptation=Adaptation(gamma=(0.0, 1e5), limits=(0.01, 100.0))))
    before, after = run.relative_errors()
    assert after > before + 10
    assert run.verdict.code == "adaptation-harms"
    # limits are those of the gains, not of the shares: one that never moved is at none, one that doubled is at two
    still = joint_loop(start={"alpha_0": 0.4}, adaptation=Adaptation(gamma=(0.0, 0.0), limits=(0.5, 2.0)))
    assert replayed(tmp_path, 1.0, still)[1].verdict.code != "gain-at-limit"
    driven = joint_loop(
        start={"alpha_0": 0.3, "alpha_2": 0.1}, adaptation=Adaptation(gamma=(20.0, 200.0), limits=(0.05, 2.0))
    )
    assert replayed(tmp_path, 1.0, driven)[1].verdict.code == "gain-at-limit"
    # with rates of zero the torque that adapts is the one with gains of 1, but for where z passes zero within a sample
    run = replayed(tmp_path, 1.0, joint_loop(adaptation=Adaptation(gamma=(0.0, 0.0))))[0]
    np.testing.assert_allclose(run.adapted, run.fixed, atol=1e-4 * np.abs(run.fixed).max())
    # where nothing but the inertia is known beside friction, a right model still explains the run
    written(tmp_path)
    measured = measure(experiment(tmp_path, "", ""))
    first = replays(joint_loop(), replace(joint(), tracking=None), measured)[0]
    assert first.relative_errors()[0] < 0.1

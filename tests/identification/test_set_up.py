from pathlib import Path

import numpy as np
import pytest

from bristle.arrays import Array
from bristle.data.experiment.load import load_experiment
from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.estimation.autocorrelation import unexplained
from bristle.identification.static.fit import PointInfo, terms_left_out
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import from_points, from_records
from bristle.identification.static.set_up import BetterSetUp, SetUp, trial_of_motion, trial_of_points
from bristle.identification.static.solution import solve_static
from bristle.model.parameters import Lugre

from .conftest import GRIPPER, curve, experiment_file, points_file, torque_of, white
from .test_fit import segments_of

JOINT = Lugre(2.0, 1.0, 1.5, 0.1, 1.0, 0.0)


def motion(seed: float = 0, noise: float = 0.05, **loads: float) -> Record:
    """Eight seconds of a two-tone motion at 500 Hz over a radian with friction (9), an inertia, and loads by name."""
    t = np.arange(4000) / 500
    q = 0.6 * np.sin(2 * np.pi * 0.3 * t) + 0.4 * np.sin(2 * np.pi * 0.8 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    sign = np.where(v > 0, loads.get("apart", 1.0), 1.0)
    torque = sign * curve(v, JOINT) + 0.05 * a + loads.get("gravity", 0.0) * np.sin(q + 0.4)
    torque += loads.get("quadratic", 0.0) * v * np.abs(v) + loads.get("offset", 0.0)
    torque += white(t.size, noise, int(seed))
    return Record(file="log.csv", time=t, position=q, velocity=v, acceleration=a, torque=torque)


def found(folder: Path, record: Record, fit: str = "") -> BetterSetUp | None:
    some = np.zeros(2)
    options = f"decimation: 10{fit and ', '}{fit}"
    path = experiment_file(folder, {"t": some, "q": some, "T": some}, fit=options)
    return trial_of_motion(load_experiment(path), [record]).better()


@pytest.mark.parametrize(
    ("load", "size", "fit", "lines"),
    [
        ("gravity", 3.0, "", "regressors: [inertia, gravity]"),
        ("quadratic", 2.0, "", "regressors: [inertia, quadratic]"),
        ("gravity", 3.0, "regressors: []", "regressors: [inertia, gravity]"),
        ("offset", 1.0, "directions: symmetric, regressors: [inertia]", "regressors: [inertia, offset]"),
        ("apart", 2.0, "directions: symmetric", "directions: separate, regressors: [inertia]"),
    ],
)
def test_the_term_that_is_missing_is_named(tmp_path: Path, load: str, size: float, fit: str, lines: str) -> None:
    """A load that the fit lacks is the one proposed, with the lines that ask for it, and the error that is left is the noise's."""
    record = motion(**{load: size})
    better = found(tmp_path, record, fit)
    assert better is not None
    assert better.lines == lines
    assert better.error < 100 * 0.05 / np.sqrt(np.mean(torque_of(record) ** 2)) < 0.75 * better.asked_error


def test_nothing_is_proposed_where_nothing_is_missing(tmp_path: Path) -> None:
    """In forty runs without any other load, of both set-ups, none is proposed."""
    for seed in range(20):
        for fit in ("", "directions: symmetric"):
            assert found(tmp_path, motion(seed), fit) is None
    # asked for, the drag is fitted with the friction: within 2 % of the truth, as are the others
    problem, _, _ = from_records([motion(quadratic=2.0, noise=0.0)], ("both",), ("inertia", "quadratic"), 10)
    theta = dict(zip(map(str, problem.names), solve(problem, default_range(problem.velocity)).theta, strict=True))
    assert theta["quadratic"] == pytest.approx(2.0, rel=0.02)
    assert theta["alpha_2"] == pytest.approx(JOINT.alpha_2, rel=0.02)
    # a pattern of half the torque is critical, with the noise told from it within a quarter. Pure noise of any size, or a pattern of a
    # tenth of the torque, is not
    (said,) = unexplained(left(0.5), np.sqrt(400.0))
    assert said.code == "unexplained"
    assert said.numbers["noise"] == pytest.approx(100 * np.sqrt(0.5), rel=0.25)
    assert not [s for s in range(300) if unexplained(left(0.0, seed=s), 20.0)]
    assert not unexplained(left(0.5), 10 * np.sqrt(400.0))
    assert not unexplained(left(0.5)[:7], 1.0)


@pytest.mark.parametrize("quadratic", [0.0, 0.02])
def test_points_ask_for_what_they_lack(tmp_path: Path, quadratic: float) -> None:
    """Points with a drag that grows with the square of the speed ask for it; points without do not."""
    speeds = np.geomspace(0.15 * GRIPPER.v_s, 2.0, 24)
    v = np.concatenate([speeds, -speeds])
    torque = curve(v, GRIPPER) + quadratic * v * np.abs(v) + white(v.size, 1e-4, 1)
    better = trial_of_points(load_experiment(points_file(tmp_path, v, torque)), segments_of(v, torque)).better()
    assert (better is not None) == (quadratic > 0)
    assert better is None or better.set_up == SetUp(("+", "-"), ("quadratic",))


def left(share: float, n: int = 400, seed: int = 0) -> Array:
    """Residuals of unit power of which a slow wave has that share."""
    wave: Array = np.sqrt(2 * share) * np.sin(2 * np.pi * 3 * np.arange(n) / n)
    wave += np.sqrt(1 - share) * np.random.default_rng(seed).standard_normal(n)
    return wave


@pytest.mark.parametrize(("drag", "least", "most"), [(0.0, 0, 1), (0.1, 95, 100)])
def test_a_drag_that_the_points_show(drag: float, least: int, most: int) -> None:
    """Of a hundred tables of 22 points, those with v * abs(v) are told; of those without it at most one is."""
    v, rng, told = np.geomspace(0.01, 1.5, 22), np.random.default_rng(0), 0
    joint = Lugre(0.5, 0.2, 0.4, 0.08, 1.0, 0.0)
    for _ in range(100):
        torque = curve(v, joint) + drag * v**2 + 0.005 * rng.standard_normal(v.size)
        core = solve_static(from_points(v, torque, ("+",)), FitOptions(), "revolute")
        said = [w for w in terms_left_out(core, "revolute", PointInfo()) if w.code == "lacks-a-term"]
        told += bool(said)
        assert not said or "regressors: [quadratic]" in str(said[0])
    assert least <= told <= most

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat

import bristle
from bristle.data.constant_velocity.segments import Thresholds, find_segments
from bristle.data.differentiation import estimate_motion
from bristle.data.record import Record
from bristle.identification.fits import StaticFit
from bristle.identification.results import Joint
from bristle.identification.shared_findings import NOT_IDENTIFIABLE
from bristle.model.parameters import INERTIA

from ..conftest import present
from ..sameness import of_kind

KINOVA = """
joint: {name: kinova joint 7, kind: revolute}
signals:
  time:     {rate: 999 Hz}
  position: {column: 1, unit: rad, wraps: true}
  velocity: {column: 2, unit: rad/s}
  torque:   {column: 5, unit: A, scale: 7.6 N*m/A}
runs:
  - {files: "${BRISTLE_DATA}/kinova_gen3_joint7/velocity_*.csv", experiment: ramp}
"""
EMPS = """
joint: {name: EMPS, kind: prismatic}
signals:
  time:     {column: t, unit: s}
  position: {column: qm, unit: m}
  torque:   {column: vir, unit: V, scale: 35.15 N/V}
runs:
  - {files: "${BRISTLE_DATA}/emps/DATA_EMPS.mat", experiment: tracking}
  - {files: "${BRISTLE_DATA}/emps/DATA_EMPS_PULSES.mat", experiment: tracking, hold_out: true}
fit: {directions: DIRECTIONS, position_cutoff: 100 Hz, decimation: 10}
"""


SERVO_SIGNALS = """
joint: {name: servo}
encoder_resolution: 6.283e-4 rad
signals:
  time:     {rate: 1 kHz}
  position: {column: 0, unit: rad}
  torque:   {column: 4, unit: N*m}
runs:
"""
SERVO = (
    SERVO_SIGNALS
    + """\
  - {files: "${BRISTLE_DATA}/servo_lugre/J_2.txt", experiment: tracking}
  - {files: "${BRISTLE_DATA}/servo_lugre/J_3.txt", experiment: tracking, hold_out: true}
  - {files: "${BRISTLE_DATA}/servo_lugre/Fs_*.txt", experiment: presliding}
  - {files: "${BRISTLE_DATA}/servo_lugre/sigma0_*.txt", experiment: presliding}
fit: {directions: symmetric, position_cutoff: 10 Hz, decimation: 40, breakaway_displacement: 0.01 rad}
"""
)


def identified(folder: Path, text: str) -> Joint:
    file = folder / "experiment.yaml"
    file.write_text(text)
    return bristle.identify(file).joints[0]


Known = Callable[[str], Joint]


@pytest.fixture(scope="module")
def known(measured_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Known:
    """As `identified`, once for each text: several tests look at the same joints."""
    assert measured_data.is_dir()
    return cache(lambda text: identified(tmp_path_factory.mktemp("known"), text))


KINOVA_SEEN = (
    [0.041, 0.068, 0.113, 0.117, 0.319, 0.510, 0.714, 0.918, 1.310, 1.505],
    [1.52, 1.49, 1.48, 1.43, 1.57, 1.72, 1.85, 2.01, 2.31, 2.47],
)
"""Mean velocity, rad/s, and torque, N*m, of the last two thirds of each run."""


def test_kinova_is_identified_as_it_is(known: Known) -> None:
    """Ten constant-velocity runs with wrapped positions and inf rows: slow runs kept with a warning, wide intervals."""
    # one segment of each run is accepted, with the means of its last two thirds; the two slowest stick and slip. The
    # curve is that of a plain least-squares fit of (9) to the mean velocity and torque of the last two thirds of each
    # run: alpha_0 1.326 N m, alpha_2 0.754 N m s/rad, 0.0115 N m rms (0.0436 without the Stribeck term)
    joint = known(KINOVA)
    fit = joint.static["+"]
    assert fit.n == 10
    assert fit.rms is not None
    assert fit.rms <= 0.013
    assert fit.parameters["alpha_0"].value == pytest.approx(1.325, abs=0.075)
    assert fit.parameters["alpha_2"].value == pytest.approx(0.75, abs=0.05)
    segments = [s for s in joint.segments if s.accepted]
    assert [s.velocity for s in segments] == pytest.approx(KINOVA_SEEN[0], rel=0.03)
    assert [s.torque for s in segments] == pytest.approx(KINOVA_SEEN[1], rel=0.03)
    assert [s.stick_slip for s in segments] == [True] * 2 + [False] * 8
    assert any(w.code == "stick-slip-points" and "alpha_0" in w.numbers for w in fit.warnings)
    low, high = fit.parameters["v_s"].interval or (0.0, 0.0)
    assert high > 1.5 * low
    assert any(of_kind(one.notes, "unwrapped") for one in joint.inputs)
    for name, three in fit.uncertainty.items():
        for ends in (three.covariance, three.profile, three.bootstrap):
            assert ends is not None
            assert 0 < ends[0] < (fit.parameters[name].value or 0.0) < ends[1] < np.inf
    (models,) = joint.models
    assert models.sentence.code == "use-model"
    assert models.chosen.name == "Stribeck curve"
    assert min(row.bic for row in models.rows if not row.chosen) > 10


def moving_is_no_worse(joint: Joint, static: StaticFit) -> None:
    """The full LuGre fit explains the force as well as the static fit of the same data, in training and held out, and says what it cannot see."""
    moving = present(joint.tracking)
    assert static.relative_error is not None
    assert moving.relative_error <= static.relative_error + 0.05
    assert moving.hold_out[0].relative_error <= static.hold_out[0].relative_error + 0.05
    unseen = [name for name, e in moving.parameters.items() if e.value is None]
    assert {name.name for name in unseen} >= {"alpha_1", "v_s"}
    assert all(any(warning.code in NOT_IDENTIFIABLE for warning in moving.parameters[name].warnings) for name in unseen)


def test_emps_symmetric_gives_the_published_figures(known: Known, measured_data: Path, tmp_path: Path) -> None:
    """Mass, viscous, Coulomb and offset within 1 % of Janot, Gautier and Brunot (2019), who made the data."""
    # no Stribeck peak; relative errors are at most a little above theirs, 4.083 % and 5.982 % with pulses
    joint = known(EMPS.replace("DIRECTIONS", "symmetric"))
    fit = joint.static["both"]
    moving_is_no_worse(joint, fit)
    published = {"inertia": 95.109, "alpha_2": 203.50, "alpha_0": 20.394, "offset": -3.165}
    assert {n: fit.parameters[n].value for n in published} == pytest.approx(published, rel=0.01)
    assert fit.relative_error is not None
    assert fit.relative_error <= 4.15
    assert fit.hold_out[0].relative_error <= 6.1
    assert fit.parameters["alpha_1"].value is None
    # UR10e, one joint moving: the draft has gravity, its fit leaves at most 6 % of the torque, and sigma_0 and sigma_1 are not identifiable
    told = bristle.Told(
        columns={"time": "0", "position": "2", "velocity": "8", "current": "14"}, torque_constant="10.7 N*m/A"
    )
    text, _ = bristle.draft(measured_data / "ur10e" / "joint_2_alone.csv", told=told, folder=tmp_path)
    (tmp_path / "arm.yaml").write_text(text)
    (joint,) = bristle.identify(tmp_path / "arm.yaml").joints
    assert "gravity" in text
    assert joint.tracking is not None
    assert joint.tracking.relative_error is not None
    assert joint.tracking.relative_error <= 6
    bristles = [e for name, e in joint.tracking.parameters.items() if name.name in ("sigma_0", "sigma_1")]
    assert bristles
    assert all(e.value is None and e.warnings for e in bristles)


@pytest.mark.slow
def test_emps_per_direction_gives_the_published_figures(measured_data: Path, tmp_path: Path) -> None:
    """With a law per direction the figures of Janot, Gautier and Brunot (2019), to 1 %."""
    # these are mass 95.154 kg, viscous 166.71 and 240.42 N s/m, Coulomb 20.144 and 20.628 N, relative error 3.112 %
    assert measured_data.is_dir()
    joint = identified(tmp_path, EMPS.replace("DIRECTIONS", "separate"))
    static = joint.static
    moving_is_no_worse(joint, static["shared"])
    assert static["shared"].parameters["inertia"].value == pytest.approx(95.154, rel=0.01)
    assert [static[d].parameters["alpha_2"].value for d in "+-"] == pytest.approx([166.71, 240.42], rel=0.01)
    assert [static[d].parameters["alpha_0"].value for d in "+-"] == pytest.approx([20.144, 20.628], rel=0.01)
    assert static["shared"].relative_error is not None
    assert static["shared"].relative_error <= 3.25
    assert static["shared"].hold_out[0].relative_error <= 5.5
    assert static["+"].parameters["alpha_1"].value is static["-"].parameters["alpha_1"].value is None
    for d in ("+", "-", "shared"):
        for three in static[d].uncertainty.values():  # without a peak the problem is linear, and the first two are one
            assert three.profile == pytest.approx(three.covariance, rel=1e-9)
            assert three.bootstrap == pytest.approx(three.covariance, rel=0.02)
            assert not three.warnings
    (models,) = joint.models
    assert models.chosen.name == "Coulomb + viscous"


def test_emps_gives_its_three_plateaus_in_both_directions(measured_data: Path) -> None:
    """Every accepted segment lies at 0.042, 0.083 or 0.125 m/s, each level many times and in both directions."""
    data = loadmat(measured_data / "emps" / "DATA_EMPS.mat")
    time, position, drive = (data[name].ravel() for name in ("t", "qm", "vir"))
    record = estimate_motion(Record(file="EMPS", time=time, position=position, torque=35.15 * drive), 100.0)
    v = np.array([s.velocity for s in find_segments(record, Thresholds()) if s.accepted])
    levels = np.array([0.042, 0.083, 0.125])
    nearest = np.argmin(np.abs(np.abs(v)[:, None] - levels), axis=1)
    assert np.abs(v) == pytest.approx(levels[nearest], rel=0.02)
    assert len(set(zip(nearest.tolist(), (v > 0).tolist(), strict=True))) == 6
    assert 24 <= v.size <= 40
    # each measured log is drafted as the experiment that those who recorded it say it is, with units and constants told and nothing else
    emps = {"columns": {"torque": "vir"}, "units": {"torque": "V", "position": "m"}, "scales": {"torque": "35.15 N/V"}}
    kinova = {"columns": {"position": "1", "velocity": "2", "current": "5"}, "rate": "999 Hz"}
    servo = {"columns": {"position": "0", "torque": "4"}, "rate": "1 kHz"}
    xl330 = {"columns": {"position": "1", "velocity": "2", "voltage": "3"}, "scales": {"voltage": "0.00836"}}
    cases: dict[str, tuple[dict[str, Any], str]] = {
        "emps/DATA_EMPS.mat": (emps, "tracking"),
        "kinova_gen3_joint7/velocity_*.csv": ({**kinova, "torque_constant": "7.6 N*m/A"}, "ramp"),
        "servo_lugre/*_1.txt": (servo, "presliding tracking presliding"),
        "arm_static/joint_*.csv": ({}, "points"),
        "bam_xl330/kp100_*.csv": ({**xl330, "torque_constant": "0.3867 N*m/A", "resistance": "4.017 ohm"}, "tracking"),
    }
    taken, meant = {}, {}
    for files, (told, kinds) in cases.items():
        text, _ = bristle.draft(*sorted(measured_data.glob(files)), told=bristle.Told(**told))
        taken[files] = re.findall(r"experiment: (\w+)\}", text)
        meant[files] = kinds.split() if " " in kinds else [kinds] * len(taken[files])
    assert taken == meant


def test_servo_protocol(measured_data: Path, known: Known) -> None:
    """One file for all: inertia and Coulomb above 10 rad/s, breakaway with its outlier, stiffness, a hold-out."""
    # inertia and Coulomb are those of plain least squares on such runs, |v| > 10 rad/s, both sides below 10 Hz: 1.97e-4
    # kg m**2, 0.031 N m, relative error 2.2 %. The breakaway torque published with the data is 0.0230 N m. Each of the
    # slow cycles closes one loop; regression of torque on displacement gives a stiffness of 5.0 to 5.3 N m/rad on them,
    # and the inverse regression and the secant are stiffer
    joint = known(SERVO)
    fit = present(joint.tracking)
    assert fit.known[INERTIA] == pytest.approx(1.97e-4, rel=0.03)
    slow = present(joint.presliding)
    assert slow.breakaway["+"].value == pytest.approx(0.0235, abs=0.0025)
    outliers = [str(warning.numbers["file"]) for warning in slow.warnings if warning.code == "outlier"]
    assert outliers
    assert all("Fs_1" in file for file in outliers)
    assert [loop.file.rpartition("/")[2] for loop in slow.loops] == [
        file.name for file in sorted((measured_data / "servo_lugre").glob("sigma0_*.txt"))
    ]
    for loop in slow.loops:
        assert loop.slope is not None
        assert loop.secant is not None
        assert loop.inverse_slope is not None
        assert 4.9 < loop.slope < 5.7
        assert loop.slope < loop.secant < loop.inverse_slope
    assert joint.tracking is not None
    assert joint.tracking.relative_error < 10
    assert joint.tracking.hold_out[0].relative_error < 15

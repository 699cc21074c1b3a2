from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle import api
from bristle.arrays import Array
from bristle.data.experiment.draft import Told
from bristle.data.experiment.load import load_experiment
from bristle.data.experiment.schema import FitOptions, PlusMinus
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation.autocorrelation import unexplained
from bristle.identification.known_joint import chosen
from bristle.identification.measured import measure
from bristle.identification.static.fit import PointInfo, terms_left_out
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import from_points, from_records
from bristle.identification.static.set_up import BetterSetUp, SetUp, trial_of_motion, trial_of_points
from bristle.identification.static.solution import solve_static
from bristle.identification.verdict import Trust, verdict
from bristle.model.parameters import SIGNED, Direction, Lugre, Pair

from ..conftest import present
from .conftest import GRIPPER, curve, experiment_file, moved, points_file, white
from .test_fit import segments_of

RATE = 250.0
HEADER = "time_s,pos_deg,motor_current_A"


def swung(folder: Path, name: str = "log.csv", gravity: float = 0.0, apart: float = 1.0, seed: int = 0) -> Path:
    """A log of ten seconds of two sines with Coulomb and viscous friction, in degrees and amperes of 0.5 N*m each."""
    t = np.arange(int(10 * RATE)) / RATE
    q = 0.6 * np.sin(2 * np.pi * 0.3 * t) + 0.4 * np.sin(2 * np.pi * 0.8 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    T = np.where(v > 0, apart, 1.0) * (2 * np.tanh(v / 0.01) + v) + 0.05 * a + gravity * np.sin(q)
    T += 0.05 * np.random.default_rng(seed).standard_normal(t.size)
    return written(folder / name, HEADER, t, np.degrees(q), T / 0.5)


def written(path: Path, header: str, *columns: Array) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.8g")
    return path


MOTOR = Told(torque_constant="0.5 N*m/A")


@pytest.mark.parametrize(
    ("gravity", "apart", "regressors"),
    [(3.0, 1.0, "inertia, gravity"), (0.0, 1.6, "inertia"), (3.0, 1.6, "inertia, gravity")],
)
def test_a_draft_has_the_set_up_that_pays(tmp_path: Path, gravity: float, apart: float, regressors: str) -> None:
    """Gravity is drafted where it is there, and the directions are left to the fit; the draft loads as it is."""
    text, said = api.draft(swung(tmp_path, gravity=gravity, apart=apart), told=MOTOR, folder=str(tmp_path))
    (tmp_path / "draft.yaml").write_text(text)
    experiment = load_experiment(tmp_path / "draft.yaml")
    lines = f"directions: auto, regressors: [{regressors}]"
    assert f"fit: {{{lines}}}" in text
    assert any(sentence.startswith(f"fit: {lines}; a first regression") for sentence in said)
    assert [run.kind for run in measure(experiment).runs] == ["tracking"]


@pytest.mark.parametrize(
    ("apart", "which"),
    [pytest.param(1.0, "the same friction both ways", marks=pytest.mark.slow), (1.2, "each its own friction")],
)
def test_directions_are_chosen_by_the_fit(tmp_path: Path, apart: float, which: str) -> None:
    """One friction for both where they are alike, one for each where they differ by a fifth, which is said; a line overrules it."""
    t = np.arange(int(8 * RATE)) / RATE
    q = 0.6 * np.sin(2 * np.pi * 0.3 * t) + 0.4 * np.sin(2 * np.pi * 0.8 * t)
    sets = (Lugre(0.8 * x, 0.3 * x, 0.4 * x, 0.1, 400.0, 2.0) for x in (1.0, apart))
    run = moved(np.gradient(q, t), 1 / RATE, Pair(*sets), 0.01, inertia=0.05)
    log = written(tmp_path / "log.csv", HEADER, t, np.degrees(q), present(run.torque) / 0.5)
    text, _ = api.draft(log, told=MOTOR, folder=tmp_path)
    (tmp_path / "draft.yaml").write_text(text)
    found = bristle.identify(tmp_path / "draft.yaml")
    tracking = present(found.joint().tracking)
    sided = {name.direction for name in tracking.parameters if name.name == "alpha_0"}
    assert sided == (set(SIGNED) if apart > 1 else {Direction.BOTH})
    assert f"directions: {which}" in found.text()
    assert "fit.directions overrules" in " ".join(found.text().split())
    (tmp_path / "law.yaml").write_text(text.replace("directions: auto", "directions: auto, law: auto"))
    assert which in bristle.identify(tmp_path / "law.yaml").joint().settings["chosen directions"]
    other = "symmetric" if apart > 1 else "separate"
    (tmp_path / "other.yaml").write_text(text.replace("directions: auto", f"directions: {other}"))
    overruled = bristle.identify(tmp_path / "other.yaml").joint()
    assert overruled.settings["directions"] == other
    assert "chosen directions" not in overruled.settings


def test_a_stage_with_two_frictions_has_no_gravity(tmp_path: Path) -> None:
    """Gravity of a joint that slides is a constant: two frictions are told as such, and not as sine and cosine of its way in metres."""
    rise = np.linspace(0, 1, 25)
    shape = np.concatenate([rise, np.ones(500), rise[::-1], np.zeros(75)])
    v = np.concatenate([s * x * shape for x in np.geomspace(0.005, 0.25, 7) for s in (1, -1)])
    sides = Lugre(11.5, 3.5, 48.0, 0.012, 1.0, 0.0), Lugre(9.0, 3.0, 41.0, 0.012, 1.0, 0.0)
    T = np.where(v > 0, curve(v, sides[0]), curve(v, sides[1])) + 0.4 * np.random.default_rng(0).standard_normal(v.size)
    t = np.arange(v.size) / RATE
    log = written(tmp_path / "stage.csv", "t [s],pos [mm],force [N]", t, 1e3 * np.cumsum(v) / RATE, T)
    text, _ = api.draft(log, folder=tmp_path)
    assert "fit: {directions: auto}" in text
    (tmp_path / "stage.yaml").write_text(text)
    joint = api.identify(tmp_path / "stage.yaml").joint()
    assert verdict(joint).trust is Trust.USE
    for d, truth in zip(SIGNED, sides, strict=True):
        low, high = joint.static[d].parameters["alpha_0"].interval or (0.0, 0.0)
        assert low < truth.alpha_0 < high < 1.05 * low


@pytest.mark.slow
def test_a_draft_of_a_gravity_joint_identifies(tmp_path: Path) -> None:
    """A draft made from a log and a torque constant alone is identified: gravity, inertia and friction come back within 10 %."""
    text, _ = api.draft(swung(tmp_path, gravity=3.0, apart=1.6), told=MOTOR, folder=tmp_path)
    (tmp_path / "draft.yaml").write_text(text)
    found = api.identify(tmp_path / "draft.yaml").joints[0].static
    truth = {"+": 3.2, "-": 2.0}
    for direction, alpha_0 in truth.items():
        assert found[direction].parameters["alpha_0"].value == pytest.approx(alpha_0, rel=0.1)
    assert found["shared"].parameters["gravity_sin"].value == pytest.approx(3.0, rel=0.1)


def test_logs_of_two_kinds_are_drafted_together(tmp_path: Path) -> None:
    """Each log gets its own kind and the reason; velocity-torque pairs need neither time nor position."""
    rise = np.linspace(0, 1, 25)
    shape = np.concatenate([rise, np.ones(500), rise[::-1], np.zeros(75)])
    v = np.concatenate([s * x * shape for x in np.geomspace(0.05, 1, 6) for s in (1, -1)])
    T = 2 * np.tanh(v / 0.01) + v + 0.02 * np.random.default_rng(0).standard_normal(v.size)
    t = np.arange(v.size) / RATE
    holds = written(tmp_path / "holds.csv", HEADER, t, np.degrees(np.cumsum(v) / RATE), T / 0.5)
    text, said = api.draft(holds, swung(tmp_path), told=MOTOR, folder=tmp_path)
    assert "experiment: ramp}   # constant velocity " in text
    assert "experiment: tracking}   # other motion 100%" in text
    assert "experiment: 1 ramp, 1 tracking, by what the signals do" in said
    pairs = written(tmp_path / "pairs.csv", "velocity,torque", v[::300][1:9], T[::300][1:9])
    assert "experiment: points}" in api.draft(pairs, folder=tmp_path)[0]
    # logs sampled at different rates are one experiment, which runs, and notes how much faster each was than the slowest. It runs with one
    # friction for both directions, which is the quicker fit
    logs = [swung(tmp_path, f"{name}.csv", seed=k) for k, name in enumerate(("first", "other", "third"))]
    written(logs[1], HEADER, np.loadtxt(logs[1], delimiter=",", skiprows=1)[::2])
    text, _ = api.draft(*logs, told=MOTOR, folder=tmp_path)
    (tmp_path / "draft.yaml").write_text(text.replace("directions: auto", "directions: symmetric"))
    files = [run.files for run in load_experiment(tmp_path / "draft.yaml").runs]
    assert files == ["first.csv", "other.csv", "third.csv"]
    found = bristle.identify(tmp_path / "draft.yaml")
    told = [d for x in found.joint().inputs for d in x.notes if d.code == "sampled-faster"]
    assert [d.numbers["ratio"] for d in told] == pytest.approx([2.0, 2.0], rel=1e-6)
    # name, gear, inertia, directions and a log that is held out stand in the draft as told; unsaid, logs name the joint by what they have
    # in common. Of a robot they are refused
    logs = [swung(tmp_path, f"wrist_{k}.csv", seed=k) for k in (1, 2)]
    gear, held = "ratio: 2, position: joint", swung(tmp_path, "other.csv", seed=3)
    told = replace(
        MOTOR, name="elbow", gear=gear, inertia="0.05 +/- 0.01 kg*m^2", directions="symmetric", hold_out=(held,)
    )
    text, _ = api.draft(*logs, told=told, folder=tmp_path)
    (tmp_path / "draft.yaml").write_text(text)
    e = load_experiment(tmp_path / "draft.yaml")
    assert (e.joint.name, present(e.context.gear).ratio, e.inertia, e.fit.directions) == (
        "elbow", 2.0, PlusMinus(value=0.05, standard_error=0.01), "symmetric",
    )  # fmt: skip  # a list of values
    assert [(run.files, run.hold_out) for run in e.runs] == [
        ("wrist_1.csv", False),
        ("wrist_2.csv", False),
        ("other.csv", True),
    ]
    text, _ = api.draft(*logs, told=MOTOR, folder=tmp_path)
    assert text.startswith('joint: {name: "wrist", kind: revolute}')
    with pytest.raises(InputError, match="gear is of one joint, and a robot has several"):
        api.draft(tmp_path / "arm.urdf", *logs, told=told)


def test_what_contradicts_coasting_is_refused_before_the_log_is_drafted(tmp_path: Path) -> None:
    """A column of a torque, or gains, beside coasting: none is passed over."""
    log = swung(tmp_path)
    for told in (Told(coasting=True, columns={"current": "motor_current_A"}), Told(coasting=True, kp="2 N*m/rad")):
        with pytest.raises(
            InputError, match=r"got --coasting and .*; expected --coasting of a joint that nothing drives"
        ):
            api.draft(log, told=told)
    # an inertia in a bearing of air: a bound on its friction, and no word of a sign; with the sign turned it is turned round
    t = np.arange(int(10 * RATE)) / RATE
    q = 0.6 * np.sin(2 * np.pi * 0.3 * t) + 0.4 * np.sin(2 * np.pi * 0.8 * t)
    T = 0.05 * np.gradient(np.gradient(q, t), t) + 0.005 * np.random.default_rng(1).standard_normal(t.size)
    text, _ = api.draft(written(tmp_path / "air.csv", "t,q,tau", t, q, T), folder=tmp_path)
    (tmp_path / "air.yaml").write_text(text, encoding="utf-8")
    found = chosen_of(tmp_path / "air.yaml")
    assert found["inertia"] == pytest.approx(0.05, rel=0.01)
    assert found.get("alpha_0", 0.0) < 0.002
    # a torque in a file of its own, with its own clock, told by FILE:COLUMN: the draft names both, and identifies as one file does
    whole = np.loadtxt(swung(tmp_path), delimiter=",", skiprows=1)
    encoder = written(tmp_path / "encoder.csv", "t,joint_pos_deg", *whole[:, :2].T)
    t = np.arange(0.003, whole[-1, 0], 0.004)
    drive = written(tmp_path / "drive.csv", "stamp [ms],Mz", 1000 * t, 0.5 * np.interp(t, whole[:, 0], whole[:, 2]))
    told = Told(columns={"torque": f"{drive}:Mz"}, units={"torque": "N*m"})
    text, said = api.draft(encoder, told=told, folder=tmp_path)
    assert 'torque: {column: "Mz", unit: "N*m", file: "drive.csv", time: {column: "stamp [ms]", unit: "ms"}}' in text
    assert not any("torque" in x for x in said)
    (tmp_path / "both.yaml").write_text(text, encoding="utf-8")
    found = chosen_of(tmp_path / "both.yaml")
    assert [found["alpha_0"], found["inertia"]] == pytest.approx([2.0, 0.05], rel=0.03)
    with pytest.raises(InputError, match=r"drive.csv: no column named 'Fz'; there are: stamp \[ms\], Mz"):
        api.draft(encoder, told=Told(columns={"torque": f"{drive}:Fz"}), folder=tmp_path)
    written(drive, "Mz", t)
    with pytest.raises(
        InputError, match=r"drive.csv: no column is named as the time, which a signal of another file needs"
    ):
        api.draft(encoder, told=told, folder=tmp_path)


def chosen_of(path: Path) -> dict[str, float]:
    joint = api.identify(path).joint()
    return {x.parameter.name: x.estimate.value for x in chosen(joint) if x.estimate.value is not None}


def test_what_no_draft_can_be_made_of(tmp_path: Path) -> None:
    """A torque that opposes the motion cannot be drafted into a file that runs: the sentence has the scale that turns it."""
    told = Told(torque_constant="0.5 N*m/A", scales={"current": "-1"})
    with pytest.raises(InputError, match=r"the torque opposes the velocity .* scale: -1"):
        api.draft(swung(tmp_path), told=told, folder=tmp_path)
    # one speed both ways under a constant load: the draft has an offset, not a friction that drives in one direction
    t = np.arange(6000) / 100
    stroke, moving = t // 4, t % 4 >= 0.3
    speed = 0.0125 * (1 + 0.02 * np.random.default_rng(1).standard_normal(15))[stroke.astype(int)]
    v = np.where(stroke % 2, -speed, speed)
    T = 53 + 6.7 * np.sign(v) + 0.1 * np.random.default_rng(0).standard_normal(t.size)
    q = np.where(stroke % 2, 4.0 - t % 4, t % 4) * speed
    kept = (x[moving] for x in (t, q, T))
    log = written(tmp_path / "log.csv", "t [s],q [m],F [N]", *kept)
    text, _ = api.draft(log, told=Told(columns={"torque": "F [N]"}), folder=tmp_path)
    assert "fit: {directions: auto}" in text
    (tmp_path / "e.yaml").write_text(text)
    fit = bristle.identify(tmp_path / "e.yaml").joints[0].static["both"]
    assert fit.parameters["offset"].value == pytest.approx(53, abs=0.1)
    # hysteresis of bristles within 0.3 mrad looks like a spring, and over so little gravity does too: it is not drafted
    t = np.arange(4000) / 400
    T = 6 * np.sin(2 * np.pi * 2 * t)
    dT = np.gradient(T)
    q = np.cumsum(dT / (40_000 * (1 - np.sign(dT) * T / 11)))
    log = written(tmp_path / "log.csv", "t [s],q [rad],tau [N*m]", t, 5e-6 * np.round(q / 5e-6), T)
    text, _ = api.draft(log, folder=tmp_path)
    assert "experiment: tracking" in text
    assert "gravity" not in text
    # whatever stands under runs and signals, what cannot be used is refused in one sentence
    half = tmp_path / "half.yaml"
    for runs in ("  - {}", "  - 3", "  {a: 1}", "  - {files: log.csv}\nsignals: 3", "  - {files: [1]}"):
        half.write_text(f"joint: {{name: a}}\nruns:\n{runs}\n")
        with pytest.raises(InputError):
            api.complete(half)
    # two infinite positions in a row, of a sensor that lost its signal, are passed over without a warning of NumPy's
    log = swung(tmp_path)
    rows = log.read_text().splitlines()
    for k in (700, 701):
        time, _, current = rows[k].split(",")
        rows[k] = f"{time},inf,{current}"
    (tmp_path / "gap.csv").write_text("\n".join(rows) + "\n")
    text, _ = api.draft(tmp_path / "gap.csv", told=MOTOR, folder=tmp_path)
    assert "experiment: tracking" in text


@pytest.mark.parametrize("runs", ["  - {files: log.csv}\n", "  - files: log.csv\n    load: none\n"])
def test_a_half_filled_file_gets_its_kinds(tmp_path: Path, runs: str) -> None:
    """A run without `experiment` gets the one that its files are of, in the place where it belongs; all else stays as it was written."""
    swung(tmp_path, gravity=3.0)
    half = tmp_path / "half.yaml"
    half.write_text(
        "joint: {name: wrist}   # mine\nmotor: {torque_constant: 0.5 N*m/A}\nsignals:\n  time: {column: time_s, unit: s}\n"
        "  position: {column: pos_deg, unit: deg}\n  current: {column: motor_current_A, unit: A}\nruns:\n" + runs
    )
    text, said = api.complete(half)
    (tmp_path / "full.yaml").write_text(text)
    assert load_experiment(tmp_path / "full.yaml").runs[0].experiment == "tracking"
    assert said.startswith(
        "experiment: 1 tracking, by what the signals do; added under fit: regressors: [inertia, gravity]; "
    )
    bare = text.replace("experiment: tracking, ", "").replace("experiment: tracking\n    ", "")
    assert bare.startswith(half.read_text())


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


def better_set_up(folder: Path, record: Record, fit: str = "") -> BetterSetUp | None:
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
    better = present(better_set_up(tmp_path, record, fit))
    assert better.lines == lines
    assert better.error < 100 * 0.05 / np.sqrt(np.mean(present(record.torque) ** 2)) < 0.75 * better.asked_error


def test_what_is_proposed_of_clean_runs_and_of_drag(tmp_path: Path) -> None:
    """In forty runs without any other load, of both set-ups, none is proposed."""
    for seed in range(20):
        for fit in ("", "directions: symmetric"):
            assert better_set_up(tmp_path, motion(seed), fit) is None
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
    # points with a drag that grows with the square of the speed ask for it; points without do not
    for quadratic in (0.0, 0.02):
        speeds = np.geomspace(0.15 * GRIPPER.v_s, 2.0, 24)
        v = np.concatenate([speeds, -speeds])
        torque = curve(v, GRIPPER) + quadratic * v * np.abs(v) + white(v.size, 1e-4, 1)
        better = trial_of_points(load_experiment(points_file(tmp_path, v, torque)), segments_of(v, torque)).better()
        assert (better is not None) == (quadratic > 0)
        assert better is None or better.set_up == SetUp(("+", "-"), ("quadratic",))
    # of a hundred tables of 22 points, those with v * abs(v) are told; of those without it at most one is
    for drag, least, most in ((0.0, 0, 1), (0.1, 95, 100)):
        v, rng, told = np.geomspace(0.01, 1.5, 22), np.random.default_rng(0), 0
        joint = Lugre(0.5, 0.2, 0.4, 0.08, 1.0, 0.0)
        for _ in range(100):
            torque = curve(v, joint) + drag * v**2 + 0.005 * rng.standard_normal(v.size)
            core = solve_static(from_points(v, torque, ("+",)), FitOptions(), "revolute")
            said = [w for w in terms_left_out(core, "revolute", PointInfo()) if w.code == "lacks-a-term"]
            told += bool(said)
            assert not said or "regressors: [quadratic]" in str(said[0])
        assert least <= told <= most


def left(share: float, n: int = 400, seed: int = 0) -> Array:
    """Residuals of unit power of which a slow wave has that share."""
    wave: Array = np.sqrt(2 * share) * np.sin(2 * np.pi * 3 * np.arange(n) / n)
    wave += np.sqrt(1 - share) * np.random.default_rng(seed).standard_normal(n)
    return wave

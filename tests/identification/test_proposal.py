from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle import api
from bristle.arrays import Array
from bristle.data.experiment.draft import Told
from bristle.data.experiment.load import load_experiment
from bristle.data.experiment.schema import PlusMinus
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation.autocorrelation import unexplained
from bristle.identification.known_joint import chosen
from bristle.identification.measured import measure
from bristle.identification.static.set_up import BetterSetUp, SetUp, trial_of_motion, trial_of_points
from bristle.identification.verdict import Trust, verdict
from bristle.model.parameters import SIGNED, Direction, Lugre, Pair

from ..conftest import present
from .conftest import GRIPPER, curve, experiment_file, moved, points_file, white, written
from .test_fit import segments_of

RATE = 250.0
HEADER = ("time_s", "pos_deg", "motor_current_A")
MOTOR = Told(torque_constant="0.5 N*m/A")


def two_tones(seconds: float, rate: float = RATE) -> tuple[Array, Array, Array, Array]:
    """Time, position, velocity and acceleration of two sines, in SI, (n,)."""
    t = np.arange(int(seconds * rate)) / rate
    q = 0.6 * np.sin(2 * np.pi * 0.3 * t) + 0.4 * np.sin(2 * np.pi * 0.8 * t)
    v = np.gradient(q, t)
    return t, q, v, np.gradient(v, t)


def swung(folder: Path, name: str = "log.csv", gravity: float = 0.0, apart: float = 1.0, seed: int = 0) -> Path:
    """A log of ten seconds of two sines with Coulomb and viscous friction, in degrees and amperes of 0.5 N*m each."""
    t, q, v, a = two_tones(10)
    T = np.where(v > 0, apart, 1.0) * (2 * np.tanh(v / 0.01) + v) + 0.05 * a + gravity * np.sin(q)
    return logged(folder / name, HEADER, t, np.degrees(q), (T + white(t.size, 0.05, seed)) / 0.5)


def logged(path: Path, names: Iterable[str], *columns: Array) -> Path:
    return written(path, **dict(zip(names, columns, strict=True)))


def drafts(*logs: Path, told: Told = MOTOR) -> tuple[Path, str, tuple[str, ...]]:
    """The draft beside the first log, its text, and what was guessed."""
    text, said = api.draft(*logs, told=told)
    path = logs[0].with_name("draft.yaml")
    path.write_text(text, encoding="utf-8")
    return path, text, said


def test_a_draft_has_the_set_up_that_pays(tmp_path: Path) -> None:
    """Gravity is drafted where it is there, and the directions are left to the fit; the draft loads as it is."""
    cases, wrong = ((3.0, 1.0, "inertia, gravity"), (0.0, 1.6, "inertia"), (3.0, 1.6, "inertia, gravity")), []
    for gravity, apart, regressors in cases:
        path, text, said = drafts(swung(tmp_path, gravity=gravity, apart=apart))
        line, kinds = f"directions: auto, regressors: [{regressors}]", [run.kind for run in measure(path).runs]
        told = any(sentence.startswith(f"fit: {line}; a first regression") for sentence in said)
        if not told or f"fit: {{{line}}}" not in text or kinds != ["tracking"]:
            wrong.append((gravity, apart, said))
    assert wrong == []


@pytest.mark.parametrize(
    ("apart", "which"),
    [pytest.param(1.0, "the same friction both ways", marks=pytest.mark.slow), (1.2, "each its own friction")],
)
def test_directions_are_chosen_by_the_fit(tmp_path: Path, apart: float, which: str) -> None:
    """One friction for both where they are alike, one for each where they differ by a fifth, which is said; a line overrules it."""
    t, q, v, _ = two_tones(8)
    sets = (Lugre(0.8 * x, 0.3 * x, 0.4 * x, 0.1, 400.0, 2.0) for x in (1.0, apart))
    run = moved(v, 1 / RATE, Pair(*sets), 0.01, inertia=0.05)
    path, text, _ = drafts(logged(tmp_path / "log.csv", HEADER, t, np.degrees(q), present(run.torque) / 0.5))
    found = bristle.identify(path)
    tracking = present(found.joint().tracking)
    sided = {name.direction for name in tracking.parameters if name.name == "alpha_0"}
    assert sided == (set(SIGNED) if apart > 1 else {Direction.BOTH})
    assert f"directions: {which}" in found.text()
    assert "fit.directions overrules" in " ".join(found.text().split())
    path.write_text(text.replace("directions: auto", "directions: auto, law: auto"))
    assert which in bristle.identify(path).joint().settings["chosen directions"]
    other = "symmetric" if apart > 1 else "separate"
    path.write_text(text.replace("directions: auto", f"directions: {other}"))
    overruled = bristle.identify(path).joint()
    assert overruled.settings["directions"] == other
    assert "chosen directions" not in overruled.settings


def held(speeds: Array) -> tuple[Array, Array]:
    """Time and velocity of a joint that holds each speed for two seconds, both ways, with a rest between, (n,)."""
    rise = np.linspace(0, 1, 25)
    shape = np.concatenate([rise, np.ones(500), rise[::-1], np.zeros(75)])
    v = np.concatenate([s * x * shape for x in speeds for s in (1, -1)])
    return np.arange(v.size) / RATE, v


def test_a_stage_with_two_frictions_has_no_gravity(tmp_path: Path) -> None:
    """Gravity of a joint that slides is a constant: two frictions are told as such, and not as sine and cosine of its way in metres."""
    t, v = held(np.geomspace(0.005, 0.25, 7))
    sides = Lugre(11.5, 3.5, 48.0, 0.012, 1.0, 0.0), Lugre(9.0, 3.0, 41.0, 0.012, 1.0, 0.0)
    T = np.where(v > 0, curve(v, sides[0]), curve(v, sides[1])) + white(v.size, 0.4)
    log = logged(tmp_path / "stage.csv", ("t [s]", "pos [mm]", "force [N]"), t, 1e3 * np.cumsum(v) / RATE, T)
    path, text, _ = drafts(log, told=Told())
    assert "fit: {directions: auto}" in text
    joint = api.identify(path).joint()
    assert verdict(joint).trust is Trust.USE
    for d, truth in zip(SIGNED, sides, strict=True):
        low, high = joint.static[d].parameters["alpha_0"].interval or (0.0, 0.0)
        assert low < truth.alpha_0 < high < 1.05 * low


def test_gravity_of_points_pays_beside_two_frictions(tmp_path: Path) -> None:
    """Directions that differ by a twelfth are no gravity, which one friction for both would ask for."""
    t, v = held(np.geomspace(0.0015, 0.15, 9))
    sides = Lugre(160.0, 60.0, 700.0, 0.005, 1.0, 0.0), Lugre(147.0, 64.0, 640.0, 0.005, 1.0, 0.0)
    T = np.where(v > 0, curve(v, sides[0]), curve(v, sides[1])) + white(v.size, 1.5)
    log = logged(tmp_path / "held.csv", ("t_s", "q_rad", "tau_Nm"), t, np.cumsum(v) / RATE, T)
    path, text, _ = drafts(log, told=Told())
    assert "gravity" not in text
    assert verdict(bristle.identify(path).joint()).trust is Trust.USE


def test_logs_of_two_kinds_are_drafted_together(tmp_path: Path) -> None:
    """Each log gets its own kind and the reason; velocity-torque pairs need neither time nor position."""
    t, v = held(np.geomspace(0.05, 1, 6))
    T = 2 * np.tanh(v / 0.01) + v + white(v.size, 0.02)
    holds = logged(tmp_path / "holds.csv", HEADER, t, np.degrees(np.cumsum(v) / RATE), T / 0.5)
    _, text, said = drafts(holds, swung(tmp_path))
    assert "experiment: ramp}   # constant velocity " in text
    assert "experiment: tracking}   # other motion 100%" in text
    assert "experiment: 1 ramp, 1 tracking, by what the signals do" in said
    pairs = logged(tmp_path / "pairs.csv", ("velocity", "torque"), v[::300][1:9], T[::300][1:9])
    assert "experiment: points}" in drafts(pairs, told=Told())[1]
    # logs sampled at different rates are one experiment, which runs, and notes how much faster each was than the slowest. It runs with one
    # friction for both directions, which is the quicker fit
    logs = [swung(tmp_path, f"{name}.csv", seed=k) for k, name in enumerate(("first", "other", "third"))]
    logged(logs[1], HEADER, *np.loadtxt(logs[1], delimiter=",", skiprows=1)[::2].T)
    path, text, _ = drafts(*logs)
    path.write_text(text.replace("directions: auto", "directions: symmetric"))
    assert [run.files for run in load_experiment(path).runs] == ["first.csv", "other.csv", "third.csv"]
    told = [d for x in bristle.identify(path).joint().inputs for d in x.notes if d.code == "sampled-faster"]
    assert [d.numbers["ratio"] for d in told] == pytest.approx([2.0, 2.0], rel=1e-6)
    # name, gear, inertia, directions and a log that is held out stand in the draft as told; unsaid, logs name the joint by what they have
    # in common. Of a robot they are refused
    logs = [swung(tmp_path, f"wrist_{k}.csv", seed=k) for k in (1, 2)]
    gear, kept = "ratio: 2, position: joint", swung(tmp_path, "other.csv", seed=3)
    told = replace(
        MOTOR, name="elbow", gear=gear, inertia="0.05 +/- 0.01 kg*m^2", directions="symmetric", hold_out=(kept,)
    )
    e = load_experiment(drafts(*logs, told=told)[0])
    assert (e.joint.name, present(e.context.gear).ratio, e.inertia, e.fit.directions) == (
        "elbow", 2.0, PlusMinus(value=0.05, standard_error=0.01), "symmetric",
    )  # fmt: skip  # a list of values
    assert [(run.files, run.hold_out) for run in e.runs] == [
        ("wrist_1.csv", False), ("wrist_2.csv", False), ("other.csv", True),
    ]  # fmt: skip  # a list of values
    assert drafts(*logs)[1].startswith('joint: {name: "wrist", kind: revolute}')
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
    t, q, _, a = two_tones(10)
    log = logged(tmp_path / "air.csv", "tqT", t, q, 0.05 * a + white(t.size, 0.005, 1))
    found = chosen_of(drafts(log, told=Told(columns={"torque": "T"}))[0])
    assert found["inertia"] == pytest.approx(0.05, rel=0.01)
    assert found.get("alpha_0", 0.0) < 0.002
    # a torque in a file of its own, with its own clock, told by FILE:COLUMN: the draft names both, and identifies as one file does
    whole = np.loadtxt(swung(tmp_path), delimiter=",", skiprows=1)
    encoder = logged(tmp_path / "encoder.csv", ("t", "joint_pos_deg"), *whole[:, :2].T)
    t, stamps = np.arange(0.003, whole[-1, 0], 0.004), ("stamp [ms]", "Mz")
    drive = logged(tmp_path / "drive.csv", stamps, 1000 * t, 0.5 * np.interp(t, whole[:, 0], whole[:, 2]))
    told = Told(columns={"torque": f"{drive}:Mz"}, units={"torque": "N*m"})
    path, text, said = drafts(encoder, told=told)
    assert 'torque: {column: "Mz", unit: "N*m", file: "drive.csv", time: {column: "stamp [ms]", unit: "ms"}}' in text
    assert not any("torque" in x for x in said)
    found = chosen_of(path)
    assert [found["alpha_0"], found["inertia"]] == pytest.approx([2.0, 0.05], rel=0.03)
    slow = logged(tmp_path / "slow.csv", stamps, *np.loadtxt(drive, delimiter=",", skiprows=1)[::3].T)
    _, turned, said = drafts(encoder, told=replace(told, columns={"torque": f"{slow}:Mz"}))
    assert '- {files: "slow.csv", experiment: tracking}' in turned
    assert "runs: slow.csv, whose samples are further apart, with the signals of encoder.csv at its times" in said
    with pytest.raises(InputError, match=r"drive.csv: no column named 'Fz'; there are: stamp \[ms\], Mz"):
        api.draft(encoder, told=Told(columns={"torque": f"{drive}:Fz"}))
    logged(drive, ["Mz"], t)
    with pytest.raises(
        InputError, match=r"drive.csv: no column is named as the time, which a signal of another file needs"
    ):
        api.draft(encoder, told=told)


def chosen_of(path: Path) -> dict[str, float]:
    joint = api.identify(path).joint()
    return {x.parameter.name: x.estimate.value for x in chosen(joint) if x.estimate.value is not None}


def test_what_no_draft_can_be_made_of(tmp_path: Path) -> None:
    """What would make a file that does not run, or one that says what is not there."""
    # one speed both ways under a constant load: the draft has an offset, not a friction that drives in one direction
    t = np.arange(6000) / 100
    stroke, moving = t // 4, t % 4 >= 0.3
    speed = 0.0125 * (1 + white(15, 0.02, 1))[stroke.astype(int)]
    T = 53 + 6.7 * np.where(stroke % 2, -1, 1) + white(t.size, 0.1)
    q = np.where(stroke % 2, 4.0 - t % 4, t % 4) * speed
    log = logged(tmp_path / "log.csv", ("t [s]", "q [m]", "F [N]"), *(x[moving] for x in (t, q, T)))
    path, text, _ = drafts(log, told=Told(columns={"torque": "F [N]"}))
    assert "fit: {directions: auto}" in text
    fit = bristle.identify(path).joints[0].static["both"]
    assert fit.parameters["offset"].value == pytest.approx(53, abs=0.1)
    # hysteresis of bristles within 0.3 mrad looks like a spring, and over so little gravity does too: it is not drafted
    t = np.arange(4000) / 400
    T = 6 * np.sin(2 * np.pi * 2 * t)
    dT = np.gradient(T)
    q = np.cumsum(dT / (40_000 * (1 - np.sign(dT) * T / 11)))
    log = logged(tmp_path / "log.csv", ("t [s]", "q [rad]", "tau [N*m]"), t, 5e-6 * np.round(q / 5e-6), T)
    text = drafts(log, told=Told())[1]
    assert "experiment: tracking" in text
    assert "gravity" not in text


JOINT = Lugre(2.0, 1.0, 1.5, 0.1, 1.0, 0.0)


def motion(seed: float = 0, noise: float = 0.05, **loads: float) -> Record:
    """Eight seconds of a two-tone motion at 500 Hz over a radian with friction (9), an inertia, and loads by name."""
    t, q, v, a = two_tones(8, 500)
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


def test_the_term_that_is_missing_is_named(tmp_path: Path) -> None:
    """A load that the fit lacks is the one proposed, with the lines that ask for it, and the error that is left is the noise's."""
    cases = {
        ("gravity", 3.0, ""): SetUp(("+", "-"), ("inertia", "gravity")),
        ("quadratic", 2.0, ""): SetUp(("+", "-"), ("inertia", "quadratic")),
        ("gravity", 3.0, "regressors: []"): SetUp(("+", "-"), ("inertia", "gravity")),
        ("offset", 1.0, "directions: symmetric, regressors: [inertia]"): SetUp(("both",), ("inertia", "offset")),
        ("apart", 2.0, "directions: symmetric"): SetUp(("+", "-"), ("inertia",)),
    }
    wrong = []
    for (load, size, fit), expected in cases.items():
        record = motion(**{load: size})
        found, noise = better_set_up(tmp_path, record, fit), 5 / np.sqrt(np.mean(present(record.torque) ** 2))
        if found is None or found.set_up != expected or not found.error < noise < 0.75 * found.asked_error:
            wrong.append((load, fit, found))
    assert wrong == []


def test_what_is_proposed_of_clean_runs_and_of_drag(tmp_path: Path) -> None:
    """In forty runs without any other load, of both set-ups, none is proposed."""
    for seed in range(20):
        for fit in ("", "directions: symmetric"):
            assert better_set_up(tmp_path, motion(seed), fit) is None
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


def left(share: float, n: int = 400, seed: int = 0) -> Array:
    """Residuals of unit power of which a slow wave has that share."""
    wave: Array = np.sqrt(2 * share) * np.sin(2 * np.pi * 3 * np.arange(n) / n)
    wave += np.sqrt(1 - share) * np.random.default_rng(seed).standard_normal(n)
    return wave

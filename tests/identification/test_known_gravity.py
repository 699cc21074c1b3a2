from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import bristle
from bristle.arrays import Array
from bristle.data.experiment.load import load_experiment
from bristle.errors import InputError
from bristle.identification.known_joint import chosen, inertia_of
from bristle.identification.results import Joint
from bristle.identification.verdict import Trust, verdict
from bristle.model.parameters import Lugre

from .conftest import accepted, codes, drafted, white, written
from .test_decisions import sines, tracked

TRUTH = Lugre(0.06, 0.0, 0.03, 0.05, 300.0, 0.3)
INERTIA, GRAVITY, HANGS = 0.02, 0.8, 0.4
EFFORTS = {"current": 0.35, "voltage": 0.12, "command": 12.0}  # signals, and N*m per unit of each


def swung() -> tuple[Array, Array, Array, Array]:
    """A joint that swings some radians, at 250 Hz: time, position, velocity and the torque of its drive, (n,)."""
    t, q, v, a = sines(250.0, 24.0, [(1.2, 0.21, 0.2), (0.5, 0.53, 1.0), (0.2, 1.1, 2.0)])
    torque = bristle.simulate(v, t[1], TRUTH) + INERTIA * a + GRAVITY * np.sin(q - HANGS)
    return t, q, v, torque + white(t.size, 0.005)


def logged(folder: Path, signal: str, damping: float = 0.0) -> Path:
    """A CSV with the position and that signal; a drive that is told a position damps as well, N*m*s/rad."""
    t, q, v, torque = swung()
    effort = (torque + damping * v) / EFFORTS[signal]
    column = {"goal": q + effort} if signal == "command" else {signal: effort}
    return written(folder / "log.csv", t=t, q=q, **column)


def near(joint: Joint, widest: float, **truth: float) -> None:
    """Each parameter is within three of its errors, which are no larger than a share of it."""
    found, wrong = {row.parameter.name: row.estimate for row in chosen(joint)}, {}
    for name, x in truth.items():
        value, error = found[name].value or np.inf, found[name].total_error or np.inf
        if not abs(value - x) < 3 * error < 3 * widest * x:
            wrong[name] = (value, error, x)
    assert wrong == {}


def test_unknown_gains_and_known_gravities(tmp_path: Path) -> None:
    """Its command alone: all is in rad of position error, as a share of kp, and its damping is in alpha_2; how to get N m is said."""
    log, kp = logged(tmp_path, "command", damping=0.4), EFFORTS["command"]
    joint = drafted(log)
    units = tuple(tracked(joint)[name].unit for name in ("alpha_2", "inertia"))
    assert (joint.kind, *units) == ("revolute in rad", "s", "s**2")
    near(joint, 0.08, alpha_0=0.06 / kp, alpha_2=(0.03 + 0.4) / kp, inertia=INERTIA / kp)
    assert verdict(joint).trust is Trust.USE
    (said,) = (w for w in joint.warnings if w.code == "no-torque-constant")
    assert "as a share of kp, and alpha_2 holds what the drive damps: write `motor: {kp: 20 N*m/rad}`" in said.message
    text = bristle.Results(joints=(joint,)).text()
    assert "fitted position error within" in " ".join(text.split())
    with pytest.raises(InputError, match=r"known as a position error alone, and urdf takes N\*m or N; give motor.kp"):
        bristle.export(bristle.Results(joints=(joint,)), "urdf")
    assert b"0.005" in bristle.export(bristle.Results(joints=(joint,)), "json").content
    # a joint that turns about a vertical axis: its friction stays in A, and it is said what is missing
    t, q, _, torque = swung()
    torque -= GRAVITY * np.sin(q - HANGS)
    log = written(tmp_path / "log.csv", t=t, q=q, current=torque / 0.35)
    joint = drafted(log, told=bristle.Told(gravity="0.8 N*m"))
    assert joint.kind == "revolute in A"
    assert "constant-unseen" in codes(joint.warnings)
    assert "chosen scale" not in joint.settings
    # beside a torque, constants of the motor, or points; of a joint that slides; without a centre: a sentence each
    log = logged(tmp_path, "current")
    text, _ = bristle.draft(log, told=bristle.Told(gravity="0.8 N*m"))
    whole = 'gravity: "0.8 N*m"'
    beside = "gravity: a known gravity scales a voltage, a current or a command without constants under motor"
    wrong = [
        ('current: {column: "current", unit: "A"}', 'torque: {column: "current", unit: "N*m"}', beside),
        (whole, f"{whole}\nmotor: {{torque_constant: 0.35 N*m/A}}", beside),
        (whole, "gravity: {mass: 1 kg}", r"gravity\.centre: missing"),
        (whole, "gravity: 1 kg", r"not a unit of N\*m"),
        (whole, "gravity: -1 N*m", "greater than 0"),
    ]
    assert accepted(log.with_suffix(".yaml"), text, wrong) == []
    # of a joint of a robot, by its name: a quarter turn from where it hangs; a vertical axis has none
    pytest.importorskip("pinocchio", reason="needs the extra robot")
    of_arm = bristle.Told(gravity=str(Path(__file__).parents[2] / "datasets" / "arm" / "arm.urdf"))
    text, _ = bristle.draft(log, told=replace(of_arm, name="wrist_pitch"))
    moments = 0.9 * 0.012 + 0.4 * 0.03, 0.9 * 0.05 + 0.4 * (0.09 + 0.06)  # of its link and the flange's, kg*m
    assert float(text.split('gravity: "')[1].split()[0]) == pytest.approx(9.81 * np.hypot(*moments), rel=1e-3)
    for name, says in (
        (None, "has 6 joints: .*; name the one of the log, as in --name turret"),
        ("turret", "makes no torque of turret"),
    ):
        with pytest.raises(InputError, match=says):
            bristle.draft(log, told=replace(of_arm, name=name))


@pytest.mark.parametrize("signal", list(EFFORTS))
def test_a_known_gravity_scales_it(tmp_path: Path, signal: str) -> None:
    """With its torque, or a mass and where it is, all is in N m, its scale within three errors; an error of the gravity is in the intervals."""
    log, scale = logged(tmp_path, signal), EFFORTS[signal]
    exact = drafted(log, told=bristle.Told(gravity=f"{GRAVITY} N*m"))
    near(exact, 0.08, alpha_0=0.06, alpha_2=0.03, inertia=INERTIA)
    told = exact.settings["chosen scale"]
    found, error = (float(x) for x in told.split(" N*m/")[0].rsplit(" ", 3)[1::2])
    assert abs(found - scale) <= 3 * error < 0.05 * scale
    assert ("assumed exact" in told, "alpha_2 holds" in told) == (True, signal != "current")
    kg = GRAVITY / 9.81 / 0.08
    mass = drafted(log, told=bristle.Told(gravity=f"mass: {kg} +/- {0.05 * kg} kg, centre: 80 mm"))
    near(mass, 0.08, alpha_0=0.06, inertia=INERTIA)
    for name in ("alpha_0", "inertia"):
        estimate = tracked(mass)[name]
        assert estimate.interval is not None
        assert np.ptp(estimate.interval) > 0.19 * float(estimate.value or 0.0)
    assert "assumed exact" not in mass.settings["chosen scale"]
    assert "torque-uncertain" in codes([mass.torque_scale] if mass.torque_scale else [])


WEIGHT, J, COULOMB, VISCOUS = 0.695, 0.0225, 5e-3, 3e-4
COUNT = 2 * np.pi / 4096


def swing(folder: Path, zero: float = 0.0) -> list[Path]:
    """SIMULATED ring-downs of a pendulum, three of 40 s from 1.2 to 2.6 rad at 150 Hz and 4096 counts, whose encoder has its zero elsewhere."""
    t = np.arange(0, 40, 1 / 150)

    def rates(_: float, x: Array) -> list[float]:
        return [x[1], (-WEIGHT * np.sin(x[0]) - COULOMB * np.tanh(x[1] / 2e-3) - VISCOUS * x[1]) / J]

    logs = []
    for k, start in enumerate((1.2, 1.9, 2.6)):
        q = solve_ivp(rates, (0, 40), [start, 0.0], "LSODA", t, rtol=1e-9, atol=1e-11, max_step=5e-3).y[0]
        logs.append(written(folder / f"swing_{k}.csv", t=t, q=np.round((q + zero) / COUNT) * COUNT))
    return logs


def spin(folder: Path) -> list[Path]:
    """SIMULATED wheels that spin down, of J / 100, twice COULOMB and VISCOUS / 15: dw/dt = -(C sgn(w) + B w) / J."""
    logs, (C, B, inertia) = [], (2 * COULOMB, VISCOUS / 15, J / 100)
    for k, start in enumerate((150.0, -120.0, 80.0)):
        stops = inertia / B * np.log(1 + B * abs(start) / C)
        t = np.arange(0, stops, 1 / 200)
        q = (abs(start) + C / B) * inertia / B * -np.expm1(-B * t / inertia) - C / B * t
        logs.append(written(folder / f"spin_{k}.csv", t=t, q=np.sign(start) * np.round(q / COUNT) * COUNT))
    return logs


@pytest.mark.parametrize(
    ("known", "zero"), [("gravity", 0.013), ("gravity", 2.4), pytest.param("inertia", 2.4, marks=pytest.mark.slow)]
)
def test_a_pendulum_that_was_let_go(tmp_path: Path, known: str, zero: float) -> None:
    """Coulomb and viscous friction, and what is not known of gravity and inertia, wherever the encoder has its zero."""
    of_gravity = bristle.Told(coasting=True, gravity=f"{WEIGHT} N*m")
    of_inertia = bristle.Told(coasting=True, inertia=f"{J} kg*m^2")
    joint = drafted(*swing(tmp_path, zero), told=of_gravity if known == "gravity" else of_inertia)
    near(joint, 0.15, alpha_0=COULOMB, alpha_2=VISCOUS)
    assert verdict(joint).trust is Trust.USE
    found = {row.parameter.name: row.estimate.value for row in chosen(joint)}
    if known == "gravity":
        assert found["inertia"] == pytest.approx(J, rel=0.001)
    else:
        assert np.hypot(found["gravity_sin"] or 0.0, found["gravity_cos"] or 0.0) == pytest.approx(WEIGHT, rel=0.001)
    assert inertia_of(load_experiment(tmp_path / "swing_0.yaml"), joint) == pytest.approx(J, rel=0.001)


def test_a_hand_that_holds_before_it_lets_go_is_no_friction(tmp_path: Path) -> None:
    """One to three seconds of a hand that trembles, and the rest at the end: left out, which is said, and friction is as without."""
    logs, rng = swing(tmp_path), np.random.default_rng(4)
    for k, log in enumerate(logs, 1):
        q = np.loadtxt(log, delimiter=",", skiprows=1)[:, 1]
        trembles = COUNT * np.round(rng.normal(0, 0.2, 150 * k).cumsum())
        whole = np.concatenate([q[0] + trembles - trembles[-1], q])
        written(log, t=np.arange(whole.size) / 150, q=whole)
    joint = drafted(*logs, told=bristle.Told(coasting=True, gravity=f"{WEIGHT} N*m"))
    near(joint, 0.15, alpha_0=COULOMB, alpha_2=VISCOUS)
    said = [next(n for n in x.notes if n.code == "rests-left-out") for x in joint.inputs]
    assert [n.numbers["rows"] >= 140 * k for k, n in enumerate(said, 1)] == [True, True, True]
    # a torque, another kind of run, what the torque is made of as a regressor, and both gravity and inertia: one sentence each
    (log,) = spin(tmp_path)[:1]
    text, _ = bristle.draft(log, told=bristle.Told(coasting=True, inertia="1 kg*m^2"))
    line, path = 'coasting: {inertia: "1 kg*m^2"}', tmp_path / "bad.yaml"
    wrong = [
        (line, 'coasting: {inertia: "1 kg*m^2", gravity: 1 N*m}', "got gravity and inertia; expected one of them"),
        (line, f"{line}\ninertia: 1 kg*m^2", "coasting: got inertia beside it"),
        ("tracking}", "ramp}", "got a run of kind ramp beside it; expected tracking runs"),
        ("signals:", 'signals:\n  torque: {column: "q", unit: "N*m"}', r"got signals\.torque beside it"),
        ("regressors: []", "regressors: [inertia]", r"got fit\.regressors: inertia beside it"),
    ]
    assert accepted(path, text, wrong) == []
    path.write_text(text.replace(line, "coasting: {gravity: 1 N*m}\ninertia: 1 kg*m^2"), encoding="utf-8")
    load_experiment(path)


@pytest.mark.parametrize(
    ("told", "kind", "by"),
    [(f"{J / 100} +/- {J / 1e4} kg*m^2", "revolute", 1.0), (None, "revolute per inertia", 100 / J)],
)
def test_a_wheel_that_spins_down(tmp_path: Path, told: str | None, kind: str, by: float) -> None:
    """In N m with an inertia, whose error is in those of friction; else per inertia, in units of an acceleration, which is said."""
    joint = drafted(*spin(tmp_path), told=bristle.Told(coasting=True, inertia=told))
    assert joint.kind == kind
    near(joint, 0.05, alpha_0=2 * COULOMB * by)
    near(joint, 0.25, alpha_2=VISCOUS / 15 * by)
    found = {row.parameter.name: row.estimate for row in chosen(joint)}
    assert [found[name].unit for name in ("alpha_0", "alpha_2")] == (
        ["N*m", "N*m*s/rad"] if told else ["rad/s**2", "1/s"]
    )
    assert ("per-inertia" in {w.code for w in joint.warnings}) == (not told)
    if told:
        assert (found["alpha_0"].standard_error or 0.0) > 0.01 * 2 * COULOMB

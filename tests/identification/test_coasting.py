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

from .conftest import drafted, written

GRAVITY, J, COULOMB, VISCOUS = 0.695, 0.0225, 5e-3, 3e-4
COUNT = 2 * np.pi / 4096


def swing(folder: Path, zero: float = 0.0) -> list[Path]:
    """SIMULATED ring-downs of a pendulum, three of 40 s from 1.2 to 2.6 rad at 150 Hz and 4096 counts, whose encoder has its zero elsewhere."""
    t = np.arange(0, 40, 1 / 150)

    def rates(_: float, x: Array) -> list[float]:
        return [x[1], (-GRAVITY * np.sin(x[0]) - COULOMB * np.tanh(x[1] / 2e-3) - VISCOUS * x[1]) / J]

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


def near(joint: Joint, widest: float, **truth: float) -> None:
    """Each parameter is within three of its errors, which are no larger than a share of it."""
    found = {row.parameter.name: row.estimate for row in chosen(joint)}
    for name, value in truth.items():
        error = found[name].standard_error
        assert error is not None
        assert abs((found[name].value or np.inf) - value) < 3 * error < 3 * widest * value, name


@pytest.mark.parametrize(
    ("known", "zero"), [("gravity", 0.013), ("gravity", 2.4), pytest.param("inertia", 2.4, marks=pytest.mark.slow)]
)
def test_a_pendulum_that_was_let_go(tmp_path: Path, known: str, zero: float) -> None:
    """Coulomb and viscous friction, and what is not known of gravity and inertia, wherever the encoder has its zero."""
    of_gravity = bristle.Told(coasting=True, gravity=f"{GRAVITY} N*m")
    of_inertia = bristle.Told(coasting=True, inertia=f"{J} kg*m^2")
    joint = drafted(*swing(tmp_path, zero), told=of_gravity if known == "gravity" else of_inertia)
    near(joint, 0.15, alpha_0=COULOMB, alpha_2=VISCOUS)
    assert verdict(joint).trust is Trust.USE
    found = {row.parameter.name: row.estimate.value for row in chosen(joint)}
    if known == "gravity":
        assert found["inertia"] == pytest.approx(J, rel=0.001)
    else:
        assert np.hypot(found["gravity_sin"] or 0.0, found["gravity_cos"] or 0.0) == pytest.approx(GRAVITY, rel=0.001)
    assert inertia_of(load_experiment(tmp_path / "swing_0.yaml"), joint) == pytest.approx(J, rel=0.001)


def test_a_hand_that_holds_before_it_lets_go_is_no_friction(tmp_path: Path) -> None:
    """One to three seconds of a hand that trembles, and the rest at the end: left out, which is said, and friction is as without."""
    logs, rng = swing(tmp_path), np.random.default_rng(4)
    for k, log in enumerate(logs, 1):
        q = np.loadtxt(log, delimiter=",", skiprows=1)[:, 1]
        trembles = COUNT * np.round(rng.normal(0, 0.2, 150 * k).cumsum())
        whole = np.concatenate([q[0] + trembles - trembles[-1], q])
        written(log, t=np.arange(whole.size) / 150, q=whole)
    joint = drafted(*logs, told=bristle.Told(coasting=True, gravity=f"{GRAVITY} N*m"))
    near(joint, 0.15, alpha_0=COULOMB, alpha_2=VISCOUS)
    said = [next(n for n in x.notes if n.code == "rests-left-out") for x in joint.inputs]
    assert [n.numbers["rows"] >= 140 * k for k, n in enumerate(said, 1)] == [True, True, True]
    # a torque, another kind of run, what the torque is made of as a regressor, and both gravity and inertia: one sentence each
    (log,) = spin(tmp_path)[:1]
    text, _ = bristle.draft(log, told=bristle.Told(coasting=True, inertia="1 kg*m^2"))
    line, path = 'coasting: {inertia: "1 kg*m^2"}', tmp_path / "bad.yaml"
    for old, new, says in (
        (line, 'coasting: {inertia: "1 kg*m^2", gravity: 1 N*m}', "got gravity and inertia; expected one of them"),
        (line, f"{line}\ninertia: 1 kg*m^2", "coasting: got inertia beside it"),
        ("tracking}", "ramp}", "got a run of kind ramp beside it; expected tracking runs"),
        ("signals:", 'signals:\n  torque: {column: "q", unit: "N*m"}', r"got signals\.torque beside it"),
        ("regressors: []", "regressors: [inertia]", r"got fit\.regressors: inertia beside it"),
    ):
        path.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(InputError, match=says):
            load_experiment(path)
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

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import bristle
from bristle.arrays import Array
from bristle.data.differentiation import smoothed, without_noise_at_rest
from bristle.data.record import Record
from bristle.findings import NOTE, Finding
from bristle.identification.changed_signals import with_decimation, without_delay
from bristle.identification.curve import LEAST, known_curve, slowest_shown
from bristle.identification.fits import Estimate, TrackingFit
from bristle.identification.known_joint import chosen
from bristle.identification.results import Joint
from bristle.identification.verdict import Trust, verdict
from bristle.model.parameters import Direction, Lugre, Pair, ParameterName

from ..conftest import present
from .conftest import codes, drafted, experiment_file, holds, white, written

TRUTH = Lugre(0.8, 0.3, 0.5, 0.06, 2000.0, 5.0)
INERTIA, RATE = 0.05, 500.0
COUNTS = 2**18 / (2 * np.pi)  # of an encoder, per rad


def sines(rate: float, seconds: float, lines: list[tuple[float, float, float]]) -> tuple[Array, Array, Array, Array]:
    """Time, position, velocity and acceleration of sines of an amplitude, a frequency and a phase, in SI, (n,)."""
    t = np.arange(int(seconds * rate)) / rate
    w = [(a, 2 * np.pi * f, phase) for a, f, phase in lines]
    q = sum((a * np.sin(k * t + p) for a, k, p in w), np.zeros(t.size))
    v = sum((a * k * np.cos(k * t + p) for a, k, p in w), np.zeros(t.size))
    return t, q, v, sum((-a * k**2 * np.sin(k * t + p) for a, k, p in w), np.zeros(t.size))


def motion(seconds: float = 15.0) -> tuple[Array, Array, Array, Array]:
    """The same of four sines."""
    return sines(RATE, seconds, [(0.4, 0.13, 0.2), (0.3, 0.31, 1.0), (0.15, 0.71, 2.0), (0.05, 1.3, 0.4)])


def log(folder: Path, torque: Array, fit: str = "", limit: float = np.inf, noise: float = 0.01) -> Path:
    """An experiment of one moving run with this torque, (n,), and white noise, N*m, cut off at a limit."""
    t, q, _, _ = motion()
    noisy = np.clip(torque + white(t.size, noise), -limit, limit)
    return experiment_file(folder, {"t": t, "q": q, "T": noisy}, fit=f"directions: symmetric{fit}")


def tracked(joint: Joint) -> dict[str, Estimate]:
    return {name.name: e for name, e in present(joint.tracking).parameters.items()}


def clean() -> Array:
    """The torque of the joint, N*m."""
    _, _, v, a = motion()
    return bristle.simulate(v, 1 / RATE, TRUTH) + INERTIA * a


def near(joint: Joint, errors: float = 4.0, **truth: float) -> None:
    """Each of some parameters of the moving runs is within so many of its errors, or a hundredth."""
    found = tracked(joint)
    for name, value in truth.items():
        error = max(errors * (found[name].standard_error or 0.0), 0.01 * value)
        assert found[name].value == pytest.approx(value, abs=error), name


@pytest.mark.slow
def test_levels_that_differ_are_told_from_an_offset_by_reversals(tmp_path: Path) -> None:
    """Directions whose levels differ by a constant have each its own; under an offset of the torque they have the same."""
    t, q, v, a = motion()
    lower = Pair(TRUTH, TRUTH._replace(alpha_0=0.5))
    torques = {
        "each its own": bristle.simulate(v, 1 / RATE, lower),
        "the same": bristle.simulate(v, 1 / RATE, TRUTH) + 0.15,
    }
    for said, torque in torques.items():
        joint = drafted(written(tmp_path / "log.csv", t=t, q=q, tau=torque + INERTIA * a + white(t.size, 0.005)))
        assert joint.settings["chosen directions"].startswith(said)
        levels = [x.estimate.value for x in chosen(joint) if x.parameter.name == "alpha_0"]
        assert levels == pytest.approx([0.8, 0.5] if said == "each its own" else [0.8], rel=0.02)


@pytest.mark.slow
def test_friction_that_differs_is_told(tmp_path: Path) -> None:
    """Of a run, fitted or held out, and of places: a period is fitted."""
    t, q, _, a = motion()
    rest = INERTIA * a + white(t.size, 0.01)
    warm = 0.75 * (clean() - INERTIA * a)
    names = ("cold.csv", "warm.csv")
    logs = [
        written(tmp_path / name, t=t, q=q, tau=x + rest) for name, x in zip(names, (warm / 0.75, warm), strict=True)
    ]
    for held in (False, True):
        told = bristle.Told(hold_out=(logs[1],)) if held else None
        text, _ = bristle.draft(*logs[: 2 - held], told=told)
        (tmp_path / "e.yaml").write_text(text)
        found = verdict(bristle.identify(tmp_path / "e.yaml").joint())
        assert (found.trust, present(found.reason).code) == (Trust.DO_NOT_USE, "run-differs")
        assert present(found.reason).numbers["by"] == pytest.approx(-0.25 if held else 0.28, abs=0.06)
    joint = drafted(written(tmp_path / "log.csv", t=t, q=q, tau=(1 + 0.2 * np.sin(6 * q)) * warm + rest))
    assert "ripple of order 6" in joint.settings["chosen regressors"]
    near(joint, 8.0, alpha_0=0.6, alpha_2=0.375, inertia=INERTIA)


@pytest.mark.slow
def test_a_delay_is_taken_off(tmp_path: Path) -> None:
    """A torque that was logged 20 ms late, or 12 ms early: the delay is found to 2 ms and said, and the numbers are the joint's."""
    for late in (0.02, -0.012):
        t, _, _, _ = motion()
        joint = bristle.identify(log(tmp_path, np.interp(t - late, t, clean()))).joint()
        told = joint.settings["chosen delay"]
        assert float(told.split()[1]) == pytest.approx(abs(late), abs=2e-3)
        assert ("late" if late > 0 else "early") in told
        near(joint, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)
        assert "which is taken off" in " ".join(bristle.Results(joints=(joint,)).text().split())
    # what is written alone is fitted, and no more: the delay is a finding
    joint = bristle.identify(log(tmp_path, np.interp(t - 0.02, t, clean()), ", set_up: as-written")).joint()
    assert "chosen delay" not in joint.settings
    assert "torque-delayed" in codes(present(joint.tracking).warnings)


def test_terms_of_the_position_are_taken_where_they_explain_what_is_left(tmp_path: Path) -> None:
    """Gravity, a spring and cogging are fitted though an inertia alone is written, and the line says so; `as-written` leaves them a finding."""
    _, q, _, _ = motion()
    asked, missed = ", regressors: [inertia]", list[str]()
    for term, load, truth in (
        ("gravity", 0.2 * np.cos(q), {"gravity_cos": 0.2}),
        ("spring", 0.5 * q, {"spring": 0.5}),
        ("cogging", 0.15 * np.sin(9 * q), {"cogging_sin_9": 0.15}),
    ):
        joint = bristle.identify(log(tmp_path, clean() + load, asked)).joint()
        told, found = joint.settings.get("chosen regressors", ""), tracked(joint)
        right = {**truth, "alpha_0": 0.8, "inertia": INERTIA}
        wrong = [n for n, x in right.items() if n not in found or found[n].value != pytest.approx(x, rel=0.03)]
        if wrong or f"{term} explains" not in told:
            missed.append(f"{term}: {told}, {wrong}")
        written_alone = bristle.identify(log(tmp_path, clean() + load, f"{asked}, set_up: as-written")).joint()
        if not {"lacks-a-term", "residual-ripple", "residual-trend"} & {
            *codes(present(written_alone.tracking).warnings)
        }:
            missed.append(f"{term}: no finding where it is not fitted")
    assert not missed
    assert "chosen regressors" not in bristle.identify(log(tmp_path, clean(), asked)).joint().settings


def test_clipped_samples_are_left_out(tmp_path: Path) -> None:
    """A torque cut off at a limit, where most samples may be clipped, or zero in a dead zone: they are named, and the joint comes back."""
    torque = clean()
    for share in (0.7, 0.55):
        joint = bristle.identify(log(tmp_path, torque, limit=share * float(np.abs(torque).max()))).joint()
        assert "clipped-left-out" in codes(joint.warnings), share
        near(joint, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)
    # a limit that noise was added to, of half the samples
    joint = bristle.identify(log(tmp_path, np.clip(torque, -0.9, 0.9))).joint()
    assert "clipped-left-out" in codes(joint.warnings)
    near(joint, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)
    # so are those in a dead zone, below a third of the friction
    joint = bristle.identify(log(tmp_path, np.where(np.abs(torque) < 0.3, 0.0, torque), noise=0.0)).joint()
    assert "dead-zone-left-out" in codes(joint.warnings)
    near(joint, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)


def test_a_noisy_or_late_velocity_gives_way_to_the_slope_of_the_position(tmp_path: Path) -> None:
    """Where it is five times as noisy, or 10 ms late, which is said: the bristle would take that for motion; a good one stays."""
    t, q, v, a = sines(500.0, 30.0, [(0.4, 0.13, 0.2), (0.3, 0.31, 1.0), (0.15, 0.71, 2.0)])
    torque = bristle.simulate(v, 1 / 500, TRUTH) + INERTIA * a + white(t.size, 0.01)
    for noise, late in ((0.02, 0.0), (1e-5, 0.0), (1e-5, 0.01)):
        seen = np.interp(t - late, t, v) + white(t.size, noise, 1)
        joint = drafted(written(tmp_path / "log.csv", t=t, q=np.round(q * COUNTS) / COUNTS, dq=seen, tau=torque))
        assert ("chosen velocity" in joint.settings) == (noise > 1e-3 or late > 0)
        assert "chosen delay" not in joint.settings
        near(joint, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)


def test_a_velocity_that_is_logged_alone_shows_gravity(tmp_path: Path) -> None:
    """Its integral is the angle but for where it began: gravity's size comes back with friction; without gravity nothing is said of it."""
    t, q, v, a = sines(500.0, 30.0, [(0.4, 0.13, 0.2), (0.3, 0.31, 1.0), (0.15, 0.71, 2.0)])
    for gravity in (0.0, 1.5):
        torque = bristle.simulate(v, 1 / 500, TRUTH) + INERTIA * a + gravity * np.sin(q + 0.4)
        joint = drafted(
            written(tmp_path / "log.csv", t=t, dq=v + white(t.size, 1e-4, 1), tau=torque + white(t.size, 0.01))
        )
        assert ("chosen position" in joint.settings) == (gravity > 0)
        near(joint, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)
        extra = {name.name: e.value for name, e in present(joint.tracking).parameters.items()}
        size = np.hypot(extra.get("gravity_sin") or 0.0, extra.get("gravity_cos") or 0.0)
        assert size == pytest.approx(gravity, rel=0.02)


def test_a_drive_that_twists_is_taken_off_the_position(tmp_path: Path) -> None:
    """An encoder before a belt: its compliance within a hundredth, and friction as behind it; a stiff drive has none."""
    t, q, v, a = sines(500.0, 30.0, [(0.4, 0.13, 0.2), (0.3, 0.31, 1.0), (0.15, 0.71, 2.0)])
    torque = bristle.simulate(v, 1 / 500, TRUTH) + INERTIA * a
    for compliance in (0.0, 1 / 1000):
        turned = np.round((q + compliance * torque) * COUNTS) / COUNTS
        joint = drafted(written(tmp_path / "log.csv", t=t, q=turned, tau=torque + white(t.size, 0.01)))
        told = joint.settings.get("chosen position", "by 0 +/-").split("by ")[1].split()[0]
        assert float(told) == pytest.approx(compliance, rel=0.01)
        near(joint, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)


def test_a_noisy_velocity_is_compared_with_a_position_of_another_unit(tmp_path: Path) -> None:
    """Degrees taken as rad, whose slope is quieter: the factor between the two is what is said, and the log is refused."""
    t, q, v, a = sines(500.0, 30.0, [(0.4, 0.13, 0.2), (0.3, 0.31, 1.0), (0.15, 0.71, 2.0)])
    torque = bristle.simulate(v, 1 / 500, TRUTH) + INERTIA * a + white(t.size, 0.01)
    joint = drafted(written(tmp_path / "log.csv", t=t, q=np.degrees(q), dq=v + white(t.size, 0.02, 1), tau=torque))
    assert present(verdict(joint).reason).code == "velocity-factor"


def test_a_velocity_alone_that_an_observer_made_late(tmp_path: Path) -> None:
    """Its time constant within a twentieth, and friction as without it; a true one has none."""
    t, _, v, a = sines(500.0, 30.0, [(0.4, 0.13, 0.2), (0.3, 0.31, 1.0), (0.15, 0.71, 2.0)])
    torque = bristle.simulate(v, 1 / 500, TRUTH) + INERTIA * a + white(t.size, 0.01)
    for lag in (0.0, 0.02):
        fading = np.exp(-1 / (500 * lag)) if lag else 0.0
        seen = lfilter([1 - fading], [1, -fading], v) + white(t.size, 1e-4, 1)
        joint = drafted(written(tmp_path / "log.csv", t=t, dq=seen, tau=torque))
        told = joint.settings.get("chosen velocity", "constant of 0 s").split("constant of ")[1].split()[0]
        assert float(told) == pytest.approx(lag, rel=0.05)
        near(joint, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)


def test_velocity_and_torque_through_one_filter_beside_a_raw_position(tmp_path: Path) -> None:
    """Gravity is of the position, which is early: what its torque lags by looks viscous, unless both are taken as late."""
    t, q, v, _ = motion()
    share = 1 / (0.016 * RATE)
    late, torque = (lfilter([share], [1, share - 1], x) for x in (v, clean() + 20 * np.sin(q)))
    counted, dq = np.round(q * COUNTS / 16) * 16 / COUNTS, late + white(t.size, 1e-4)
    columns = {"t": t, "q": counted, "dq": dq, "tau": torque + white(t.size, 0.01)}
    joint = drafted(written(tmp_path / "log.csv", **{name: x[200:] for name, x in columns.items()}))
    assert "both were logged through a filter" in joint.settings["chosen velocity"]
    near(joint, alpha_0=0.8, alpha_2=0.5, gravity_sin=20.0)


def test_a_vibration_that_no_signal_has_is_filtered_out(tmp_path: Path) -> None:
    """A force of 0.5 N*m that shakes the joint: its line is named, no delay is, and friction is as without it."""
    t, q, v, a = sines(500.0, 30.0, [(0.4, 0.13, 0.2), (0.3, 0.31, 1.0), (0.15, 0.71, 2.0)])
    for shaken in (0.0, 0.5):
        w = 2 * np.pi * 11
        off, dv = (-shaken / INERTIA / w**2 * np.sin(w * t), -shaken / INERTIA / w * np.cos(w * t))
        torque = (
            bristle.simulate(v + dv, 1 / 500, TRUTH) + INERTIA * a + white(t.size, 0.01)
        )  # the force accelerates the rest
        joint = drafted(written(tmp_path / "log.csv", t=t, q=np.round((q + off) * COUNTS) / COUNTS, tau=torque))
        assert "chosen delay" not in joint.settings
        assert joint.settings.get("chosen vibration", "").startswith("near 11 Hz") == (shaken > 0)
        near(joint, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)
    # stretches between gaps that are too short for the filter of more samples an equation are left out, unless all of a run's are
    kept = (np.arange(t.size) + 700) % 2500 < 1300
    measured = bristle.fit_dynamic(t[kept], (q + off)[kept], torque[kept], directions="symmetric").measured
    (before,), (after,) = (m.moving(hold_out=False) for m in (measured, present(with_decimation(measured, 20))))
    assert before.time.size - after.time.size == 600 + 700
    assert with_decimation(measured, 40) is None
    # what is clipped is not known, and where it is moves with a delay of the torque that is taken off
    clipped = bristle.fit_dynamic(t, q + off, np.clip(torque, -1.0, 1.0), directions="symmetric").measured
    at, late = (clipped.moving(hold_out=False)[0].lost, without_delay(clipped, 0.0101).moving(hold_out=False)[0].lost)
    assert np.array_equal(at, np.abs(torque) >= 1.0)
    assert np.array_equal(late[:-6], at[5:-1] | at[6:])


@pytest.mark.slow
def test_moves_from_point_to_point(tmp_path: Path) -> None:
    """Two speeds each way, others in each: one friction for both, and its curve, after rests that an encoder sees within counts."""
    speeds = np.tile([1.5, -0.2, 0.6, -0.05], 4)
    moves = [
        np.repeat([0.0, x], [100, int(250 * far / abs(x))])
        for x, far in zip(speeds, np.linspace(0.6, 0.3, 16), strict=True)
    ]
    v = np.convolve(np.concatenate(moves), np.full(20, 0.05), "same")
    t = np.arange(v.size) / 250
    torque = bristle.simulate(v, 1 / 250, TRUTH) + INERTIA * np.gradient(v, t) + white(t.size, 0.01)
    q = np.round(np.cumsum(v) / 250 * COUNTS) / COUNTS
    joint = drafted(written(tmp_path / "log.csv", t=t, q=q, tau=torque))
    assert verdict(joint).trust is Trust.USE
    shown = np.geomspace(0.05, 1.5, 20)
    true = TRUTH.alpha_0 + TRUTH.alpha_1 * np.exp(-((shown / TRUTH.v_s) ** 2)) + TRUTH.alpha_2 * shown
    assert known_curve(joint, shown)[0] == pytest.approx(true, rel=0.01)


def test_means_stand_for_a_log_that_is_sampled_fast(tmp_path: Path) -> None:
    """A motion that is logged at 5 kHz is fitted by means of samples, says so, and gives what it gives at 500 Hz, within two standard errors."""
    found = []
    for rate in (500.0, 5000.0):
        t, q, v, a = sines(rate, 12.0, [(0.4, 0.13, 0.2), (0.3, 0.31, 1.0), (0.15, 0.71, 2.0)])
        torque = bristle.simulate(v, 1 / rate, TRUTH) + INERTIA * a + white(t.size, 0.01)
        joint = drafted(written(tmp_path / "log.csv", t=t, q=np.round(q * COUNTS) / COUNTS, tau=torque))
        assert ("samples-averaged" in codes(joint.inputs[0].notes)) == (rate > 500)
        near(joint, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)
        found.append(tracked(joint))
    one, other = found
    for name in ("alpha_0", "alpha_2", "inertia", "sigma_0"):
        assert one[name].value == pytest.approx(other[name].value, abs=2 * (one[name].standard_error or 0.0)), name


@pytest.mark.slow
def test_drag_is_in_the_law_where_the_torque_has_it(tmp_path: Path) -> None:
    """Its coefficient comes back, and the line says so; a clean joint keeps the paper's law."""
    _, _, v, _ = motion()
    dragged = bristle.identify(log(tmp_path, clean() + 0.4 * v * np.abs(v))).joint()
    near(dragged, alpha_0=0.8, alpha_2=0.5, alpha_3=0.4, inertia=INERTIA)
    assert "gaussian+quadratic, which the data chose" in " ".join(bristle.Results(joints=(dragged,)).text().split())
    plain = bristle.identify(log(tmp_path, clean())).joint()
    assert plain.law_name == "gaussian"
    near(plain, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)


def test_points_at_rest_and_points_that_are_clipped_are_left_out() -> None:
    """Of forty points the two slowest of each direction do not slide, and the fastest are at a limit: the law of the others comes back."""
    v = np.concatenate([x * np.geomspace(0.005, 1.0, 40) for x in (1, -1)])
    T = bristle.friction(v, TRUTH) + 2e-3 * np.random.default_rng(1).standard_normal(v.size)
    T = np.clip(np.where(np.abs(v) < 0.006, 0.5 * T, T), -1.1, 1.1)
    fit = bristle.fit(v, T, directions="symmetric", regressors=())
    reasons = [reason.code for s in fit.joint.segments for reason in s.reasons]
    assert reasons.count("below-breakaway") == int(np.sum(np.abs(v) < 0.006))
    assert reasons.count("saturated") == int(np.sum(np.abs(T) == 1.1))
    for name in ("alpha_0", "alpha_1", "alpha_2", "v_s"):
        assert holds(fit.joint.static["both"].parameters[name].interval, getattr(TRUTH, name)), name
    # points at one speed both ways about an offset: friction there is known, its split is not, and alpha_2 is at most all of it
    v = np.repeat([0.4, -0.4], 20) * (1 + 0.01 * np.random.default_rng(2).standard_normal(40))
    T = bristle.friction(v, TRUTH) + 0.3 + 1e-3 * np.random.default_rng(3).standard_normal(40)
    fit = bristle.fit(v, T, directions="symmetric", regressors=("offset",))
    found, whole = fit.joint.static["both"].parameters, 0.8 + 0.5 * 0.4
    assert found["offset"].value == pytest.approx(0.3, abs=2e-3)
    assert fit.friction(0.4) == pytest.approx(whole, abs=3e-3)
    assert found["alpha_0"].interval == pytest.approx((0.0, whole), abs=3e-3)
    assert found["alpha_2"].interval == pytest.approx((0.0, whole / 0.4), abs=0.02)
    assert all("one-speed-only" in codes(found[name].warnings) for name in ("alpha_0", "alpha_2"))
    assert ParameterName.parse("alpha_2") not in fit.joint.crosscheck["both"].parameters
    assert present(fit.joint.accuracy).band < 1


@pytest.mark.slow
def test_points_that_are_all_at_a_limit_state_no_error(tmp_path: Path) -> None:
    """What is beyond the limit nobody knows: no error is stated, the limit is the reason, and figures are drawn all the same."""
    v = np.concatenate([x * np.geomspace(0.02, 1.0, 14) for x in (1, -1)])
    rows = np.column_stack([v, np.clip(bristle.friction(v, TRUTH) + white(v.size, 1e-3), -0.55, 0.55)])
    np.savetxt(tmp_path / "p.csv", rows, delimiter=",", header="v [rad/s],tau [N*m]", comments="", fmt="%.9g")
    (tmp_path / "p.yaml").write_text(bristle.draft(tmp_path / "p.csv")[0], encoding="utf-8")
    results = bristle.identify(tmp_path / "p.yaml")
    joint = results.joint()
    found = verdict(joint)
    assert (found.trust, found.reason and found.reason.code) == (Trust.DO_NOT_USE, "clipped")
    assert present(joint.accuracy).band == np.inf
    results.write(tmp_path / "out")
    assert (tmp_path / "out" / "index.html").is_file()
    again = bristle.read_results(tmp_path / "out" / "results.json").joint()
    assert [w.effect for w in again.warnings] == [w.effect for w in joint.warnings]


def test_a_time_without_a_unit_has_many_samples_a_second(tmp_path: Path) -> None:
    """Stamps in ms, us or ns that no name tells of are taken for that, and it is said."""
    _, q, _, _ = motion(8.0)
    said = {}
    for unit, step in {"ms": 2.0, "us": 2000.0, "ns": 2e6}.items():
        log = written(
            tmp_path / "log.csv", stamp=1e6 + step * np.arange(q.size, dtype=float), q=q, tau=clean()[: q.size]
        )
        said[unit] = " ".join(bristle.draft(log, told=bristle.Told(columns={"time": "stamp"}))[1])
    assert [
        unit for unit, words in said.items() if f"{unit}, because a log has many samples a second" not in words
    ] == []


def test_points_of_a_current_or_a_voltage(tmp_path: Path) -> None:
    """A table of speed and current has friction in A; with the motor's constants the torque of a current, or of a voltage, as known."""
    v, k_t, R = np.geomspace(0.02, 2.0, 12), 0.25, 2.0
    T = 0.8 + 0.3 * np.exp(-((v / 0.1) ** 2)) + 0.5 * v
    path = written(tmp_path / "table.csv", speed=v, I=T / k_t, V=T / k_t * R + k_t * v)
    constants: dict[str, Any] = {"torque_constant": f"{k_t} N*m/A", "resistance": f"{R} ohm"}
    draft, nothing = tmp_path / "table.yaml", dict[str, Any]()
    cases = [("current", "I", nothing, 1 / k_t), ("current", "I", constants, 1.0), ("voltage", "V", constants, 1.0)]
    for signal, column, told, times in cases:
        units = {"velocity": "rad/s", signal: "A" if column == "I" else "V"}
        asked = bristle.Told(columns={"velocity": "speed", signal: column}, units=units, **told)
        draft.write_text(bristle.draft(path, told=asked, folder=tmp_path)[0], encoding="utf-8")
        found = bristle.identify(draft).joint().static["+"].parameters["alpha_0"]
        assert found.value == pytest.approx(0.8 * times, rel=1e-3)


@pytest.mark.parametrize(("signal", "unit"), [("current", "A"), ("voltage", "V")])
def test_an_effort_without_constants_is_friction_in_its_own_unit(tmp_path: Path, signal: str, unit: str) -> None:
    """A current or a voltage that nothing tells the torque of: friction is in A or V, as much as the torque has over the constants."""
    # in V, alpha_2 has the motor's back-EMF too. It is said how to get N m, and with the constants it is N m
    path, k_t, R = log(tmp_path, clean() + (0.25**2 / 2 * motion()[2] if unit == "V" else 0.0)), 0.25, 2.0
    times, back_emf = (1 / k_t, 0.0) if unit == "A" else (R / k_t, k_t)
    told = f"{signal}: {{column: T, unit: m{unit}, scale: {1000 * times!r}}}"
    path.write_text(path.read_text().replace("torque: {column: T, unit: N*m}", told))
    joint = bristle.identify(path).joint()
    assert (joint.kind, "no-torque-constant" in codes(joint.warnings)) == (f"revolute in {unit}", True)
    assert tracked(joint)["inertia"].unit == f"{unit}*s**2/rad"
    near(joint, alpha_0=times * 0.8, alpha_2=times * 0.5 + back_emf, inertia=times * INERTIA)
    constants = f"torque_constant: {k_t} N*m/A, resistance: {R} ohm"
    path.write_text(path.read_text() + f"motor: {{{constants}}}\n")
    near(bristle.identify(path).joint(), alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)


@pytest.mark.parametrize(("late", "gains"), [(0.0, 1.0), (0.008, 2.5)])
def test_a_drive_that_is_told_what_to_follow_tells_friction(tmp_path: Path, late: float, gains: float) -> None:
    """No torque is logged: it is that of the drive's gains, as late as the drive acts, which is found within three errors; a declared delay is taken.

    Simulated commands are such that the drive's torque, so late, moves the joint as it moved.
    """
    t, q, v, _ = motion()
    torque, kp, kd = clean() + white(t.size, 0.01), 40.0 * gains, 1.5 * gains
    ahead, v_d = np.interp(t + late, t, torque), np.gradient(0.9 * q, t)
    q_d = q + (ahead - kd * (v_d - v)) / kp
    log = written(tmp_path / "log.csv", t=t, q=q, dq=v, q_des=q_d, dq_des=v_d)
    joint = drafted(log, told=bristle.Told(kp=f"{kp} N*m/rad", kd=f"{kd} N*m*s/rad"))
    near(joint, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)
    assert "ASSUMED not held between samples: held (--held), alpha_2 is" in joint.settings["chosen delay"]
    first = " ".join(bristle.Results(joints=(joint,)).text().split())
    assert "rad/s, ASSUMED commands are not held between samples" in first.partition(";")[0]
    found, error = map(float, joint.settings["chosen delay"].split(" s late")[0].split(", ")[1].split(" +/- "))
    assert abs(found - late) <= 3 * error < 0.001
    text = (tmp_path / "log.yaml").read_text(encoding="utf-8")
    declared = text.replace('"q_des", unit: "rad"', f'"q_des", unit: "rad", delay: {-late!r} s')
    (tmp_path / "log.yaml").write_text(declared, encoding="utf-8")
    again = bristle.identify(tmp_path / "log.yaml").joint()
    assert "chosen delay" not in again.settings
    assert "commands-at-once" in codes(again.warnings)
    near(again, alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)


def test_what_a_drive_compares_its_commands_with(tmp_path: Path) -> None:
    """Measurements of the moment, or as old as the commands: the two differ by kp times the delay, which is all that data can say."""
    # told which, also with a declared delay, the numbers are the joint's; untold, they are not to be used
    t, q, v, _ = motion()
    torque, kp, kd, late = clean() + white(t.size, 0.01), 40.0, 1.5, 0.008
    log = written(tmp_path / "log.csv", t=t, q=q, dq=v, q_des=np.interp(t + late, t, q + (torque + kd * v) / kp))
    gains = {"kp": f"{kp} N*m/rad", "kd": f"{kd} N*m*s/rad", "held": False}

    def identified(fresh: bool | None, delay: str = "") -> Joint:
        text, _ = bristle.draft(log, told=bristle.Told(fresh=fresh, **gains))  # type: ignore[arg-type]  # by name
        (tmp_path / "log.yaml").write_text(
            text.replace('"q_des", unit: "rad"', f'"q_des", unit: "rad"{delay}'), encoding="utf-8"
        )
        return bristle.identify(tmp_path / "log.yaml").joint()

    near(identified(True), alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)
    near(identified(True, f", delay: {-late!r} s"), alpha_0=0.8, alpha_2=0.5, inertia=INERTIA)
    near(identified(False), alpha_0=0.8, alpha_2=0.5 + kp * late)
    untold = identified(None)
    found, reason = verdict(untold)
    assert (found, reason and reason.code) == (Trust.DO_NOT_USE, "feedback-unknown")
    (said,) = (w for w in untold.warnings if w.code == "feedback-unknown")
    assert said.numbers["lower"] == pytest.approx(kp * late, rel=0.05)
    # commands that were logged 20 ms late, or gains that are wrong, look so: critical
    t, q, v, _ = motion()
    torque = clean() + white(t.size, 0.01)
    q_d = q + (np.interp(t - 0.02, t, torque) + 1.5 * v) / 40
    told = bristle.Told(kp="40 N*m/rad", kd="1.5 N*m*s/rad", held=False)
    joint = drafted(written(tmp_path / "log.csv", t=t, q=q, dq=v, q_des=q_d), told=told)
    assert verdict(joint).trust is Trust.DO_NOT_USE
    assert "acts-early" in codes(joint.warnings)
    assert "commands-at-once" not in codes(joint.warnings)


@pytest.mark.slow
def test_a_peak_that_is_not_claimed_is_in_the_band(tmp_path: Path) -> None:
    """Friction without a bristle, with a peak that counts of 14 bits hide: the true curve is within the stated band of the one without it."""
    t, q, v, acceleration = sines(200.0, 60.0, [(0.6, 0.15, 0.0), (0.12, 0.73, 0.0)])

    def friction(v: Array) -> Array:
        level: Array = (2.0 + 0.8 * np.exp(-((v / 0.05) ** 2))) * np.tanh(v / 1e-3) + 1.5 * v
        return level

    torque, count = friction(v) + 0.05 * acceleration, 2 * np.pi / 2**14
    torque += 0.02 * np.sqrt(np.mean(torque**2)) * np.random.default_rng(3).standard_normal(t.size)
    joint = drafted(written(tmp_path / "log.csv", t=t, q=count * np.round(q / count), tau=torque))
    known = present(joint.accuracy)
    speeds = np.linspace(known.slowest, known.fastest, 60)
    found, _ = known_curve(joint, speeds)
    off = 100 * np.sqrt(np.mean((found - friction(speeds)) ** 2) / np.mean(friction(speeds) ** 2))
    assert off < known.band < 10


def test_strokes_that_show_no_peak(tmp_path: Path) -> None:
    """Of a motion that shows no peak no speed is stated that it only passes through from one equation to the next; of one that does, all are."""
    hold, rush = np.repeat([0.1, 0.3, 1.0], 20), np.array([-1.0, 0.03, 1.0])
    for peak, least in ((None, 0.1), (0.2, LEAST)):
        fit = TrackingFit(
            parameters={ParameterName("alpha_1", Direction.BOTH): Estimate(value=peak, unit="N*m")}, rms=0.0, relative_error=0.0,
            n=63, outcome=Finding("converged", NOTE, "."), starts=1, reached=1, condition=1.0, velocity=np.concatenate([hold, rush, hold]),
        )  # fmt: skip  # a list of values
        assert slowest_shown([fit], 1.0) == pytest.approx(least)
    # a sine half as fast as v_s: the curve is right to 5 %; alpha_1, v_s and an inertia below zero are not claimed
    t, size, w = np.arange(0, 20, 1 / 2000), 0.01, 2 * np.pi * 0.5
    v = size * w * np.cos(w * t)
    torque = bristle.simulate(v, 1 / 2000, TRUTH) - INERTIA * size * w**2 * np.sin(w * t)
    q = np.floor(size * np.sin(w * t) * 2**18 / (2 * np.pi)) * 2 * np.pi / 2**18
    joint = drafted(written(tmp_path / "log.csv", t=t[::4], q=q[::4], tau=(torque + white(t.size, 0.005))[::4]))
    assert verdict(joint).trust is Trust.USE
    speeds = np.linspace(0.1, 1, 30) * size * w
    found, _ = known_curve(joint, speeds)
    true = TRUTH.alpha_0 + TRUTH.alpha_1 * np.exp(-((speeds / TRUTH.v_s) ** 2)) + TRUTH.alpha_2 * speeds
    assert np.sqrt(np.mean((found - true) ** 2)) < 0.05 * np.sqrt(np.mean(true**2))
    by_name = tracked(joint)
    for name in ("alpha_1", "v_s"):
        assert (by_name[name].value, codes(by_name[name].warnings)) == (None, ["unseen-shape"])
    assert by_name["inertia"].value is None or by_name["inertia"].value > 0
    # a triangle at one speed tells nothing as points; as a motion it gives the friction at that speed to 2 %
    t, speed = np.arange(0, 24, 1 / RATE), 0.02
    v = speed * np.tanh(40 * np.sin(2 * np.pi * t / 12))
    torque = bristle.simulate(v, 1 / RATE, TRUTH) + INERTIA * np.gradient(v, t)
    joint = drafted(written(tmp_path / "log.csv", t=t, q=np.cumsum(v) / RATE, tau=torque + white(t.size, 0.005)))
    found, _ = known_curve(joint, np.array([speed, -speed]))
    true = TRUTH.alpha_0 + TRUTH.alpha_1 * np.exp(-((speed / TRUTH.v_s) ** 2)) + TRUTH.alpha_2 * speed
    assert np.abs(found) == pytest.approx([true, true], rel=0.02)
    assert verdict(joint).trust is Trust.USE


def test_the_noise_of_a_logged_velocity_bends_no_bristle_at_rest(tmp_path: Path) -> None:
    """Between velocities a drive rests under torque: the velocity's noise is set to zero there, and friction is found within its errors."""
    rise, rest = np.linspace(0, 1, 60), np.zeros(80)
    shape = np.concatenate([rise, np.ones(160), rise[::-1], rest])
    v = np.concatenate([s * x * shape for x in (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0) for s in (1, -1)])
    t = np.arange(v.size) / 200
    torque = bristle.simulate(v, 1 / 200, TRUTH) + INERTIA * np.gradient(v, t) + white(v.size, 0.02)
    noisy = v + white(v.size, 0.004, 1)
    record = Record(file="log.csv", time=t)
    still = without_noise_at_rest(record, noisy, smoothed(record, noisy, 25.0), 25.0)
    assert (still[noisy != still] == 0.0).all()
    assert (v[noisy != still] == 0.0).mean() > 0.9
    joint = drafted(written(tmp_path / "log.csv", **{"t [s]": t, "v [rad/s]": noisy, "T [Nm]": torque}))
    assert verdict(joint).trust is Trust.USE
    near(joint, 3.0, alpha_0=TRUTH.alpha_0, alpha_1=TRUTH.alpha_1, alpha_2=TRUTH.alpha_2, inertia=INERTIA)

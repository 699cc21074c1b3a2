from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import bristle
from bristle.arrays import Array
from bristle.control.compensator import Measurement, Reference, compiled, initial_state
from bristle.errors import InputError
from bristle.questions.array_fit.fit import METHODS

P = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)
J = 1e-3
STEP = 0.002
MOVING = "{time: {column: t, unit: s}, position: {column: q, unit: rad}}"
RUNS = (
    ("motion", "tracking", MOVING), ("slow", "presliding", MOVING), ("points", "points", "{velocity: {column: v, unit: rad/s}}"),
)  # fmt: skip  # a list


def noise(n: int, size: float, seed: int = 0) -> Array:
    """White, (n,)."""
    return size * np.random.default_rng(seed).standard_normal(n)


def points() -> tuple[Array, Array]:
    """Velocities, rad/s, and torques, N*m."""
    v = np.geomspace(0.01, 1.0, 12)
    v = np.concatenate([v, -v])
    return v, bristle.friction(v, P) + noise(v.size, 5e-5)


def loading() -> tuple[Array, Array, Array]:
    """Time, s, position, rad, and torque, N*m, of two slow cycles below breakaway."""
    t = np.arange(0, 40, STEP)
    T = 0.8 * (P.alpha_0 + P.alpha_1) * np.interp(t % 20, [0, 5, 15, 20], [0, 1, -1, 0])
    dT = np.diff(T, prepend=0.0)
    q = np.cumsum(dT / (P.sigma_0 * (1 - np.sign(dT) * T / (P.alpha_0 + P.alpha_1))))
    count = 2 * np.pi / 2**20
    return t, count * np.round(q / count), T + noise(t.size, 5e-5, 1)


def motion() -> tuple[Array, Array, Array]:
    """Time, s, position, rad, and torque, N*m, of a motion that reverses."""
    t = np.arange(0, 8, STEP)
    v = 0.6 * np.sin(2.0 * t) + 0.3 * np.sin(5.3 * t)
    q = STEP * np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2)])
    return t, q, bristle.simulate(v, STEP, P) + J * np.gradient(v, t) + noise(t.size, 1e-4, 2)


def saved(folder: Path, name: str, header: str, *columns: Array) -> None:
    np.savetxt(folder / name, np.column_stack(columns), "%.17g", ",", header=header, comments="")


@pytest.fixture(scope="module")
def of_files(tmp_path_factory: pytest.TempPathFactory) -> bristle.Results:
    folder = tmp_path_factory.mktemp("files")
    saved(folder, "points.csv", "v,tau", *points())
    saved(folder, "slow.csv", "t,q,tau", *loading())
    saved(folder, "motion.csv", "t,q,tau", *motion())
    (folder / "e.yaml").write_text(
        "joint: {name: joint}\n"
        "signals: {torque: {column: tau, unit: N*m}}\nruns:\n"
        + "".join(
            f"  - {{files: {name}.csv, experiment: {what}, signals: {signals}}}\n" for name, what, signals in RUNS
        )
        + "fit: {directions: symmetric}\n",
        encoding="utf-8",
    )
    return bristle.identify(folder / "e.yaml")


Fits = tuple[bristle.Fit, bristle.Fit, bristle.Fit]  # of points, of slow loading and of a motion


@pytest.fixture(scope="module")
def fits() -> Fits:
    static = bristle.fit(*points(), directions="symmetric")
    slow = bristle.fit_presliding(*loading(), breakaway=static)
    return static, slow, bristle.fit_dynamic(*motion(), priors=[static, slow])


def test_arrays_give_what_files_give(of_files: bristle.Results, fits: Fits) -> None:
    """Static, presliding and joint estimates of arrays are those of files, with their errors and intervals."""
    (joint,), (static, slow, dynamic) = of_files.joints, fits
    assert joint.presliding is not None
    assert joint.joint_fit is not None
    for name, e in joint.static["both"].parameters.items():
        assert (static.params[name], static.stderr[name]) == (e.value, e.standard_error)
    for d, one in joint.presliding.fits.items():
        assert slow.params[f"sigma_0{d}"] == one.sigma_0.value
        assert tuple(slow.conf_int().loc[f"sigma_0{d}"]) == one.sigma_0.interval
    assert list(dynamic.params) == list(map(str, joint.joint_fit.parameters))
    for key, e in joint.joint_fit.parameters.items():
        assert dynamic.params[str(key)] == e.value
    # every parameter lies within four standard errors of what was simulated, sigma_1 of slow loading apart, which is assumed
    true = {**P._asdict(), "inertia": J, "offset": 0.0}
    for found in fits:
        for name, value in found.params.items():
            bare = name.rstrip("+-")
            if bare in true and np.isfinite(found.stderr[name]):
                assert abs(value - true[bare]) < 4 * found.stderr[name], (found.stage, name)
    dynamic = fits[-1]
    assert dynamic.friction([0.5]) == pytest.approx(bristle.friction([0.5], P), rel=0.01)
    v = 0.3 * np.sin(np.arange(1000) * 0.01)
    assert bristle.simulate(v, 0.01, dynamic) == pytest.approx(bristle.simulate(v, 0.01, P), abs=0.02 * P.alpha_0)
    # points show no bristle, and slow loading no friction vs velocity: a sentence each
    static, _, _ = fits
    slow = bristle.fit_presliding(*loading())
    with pytest.raises(InputError, match="simulate: sigma_0, sigma_1 of direction"):
        bristle.simulate([0.1, 0.2], 0.01, static)
    with pytest.raises(InputError, match="nothing is known of friction vs velocity"):
        slow.predict([0.1])
    with pytest.raises(InputError, match="dt: got 0"):
        bristle.simulate([0.1, 0.2], 0, P)


def test_a_motion_has_each_interval_where_it_is_asked_for(fits: Fits) -> None:
    """By covariance always; by profile and bootstrap with `uncertainty`; a sentence without."""
    *_, found = fits
    with pytest.raises(InputError, match="no interval by profile was made"):
        found.conf_int(method="profile")
    assert found.conf_int(method="covariance").loc["alpha_0"].notna().all()
    whole = bristle.fit_dynamic(*motion(), directions="symmetric", uncertainty=True)
    for method in METHODS:
        ends = whole.conf_int(method=method).to_dict("index")["alpha_0"]
        assert ends["lower"] < whole.params["alpha_0"] < ends["upper"]
    # each as text, as HTML, and as axes with quantity and unit
    labels = ("Velocity (rad/s)", "Displacement (rad)", "Time (s)")
    for found, label in zip(fits, labels, strict=True):
        ax = found.plot(Figure().subplots())
        assert (ax.get_xlabel(), ax.get_ylabel()) == (label, "Torque (N·m)")
        assert all(name in repr(found) for name in found.params)
        assert "<svg" in found._repr_html_()


def test_time_as_index_or_as_numbers() -> None:
    """The index of a series is the time; without one, time must be given."""
    t, q, T = loading()
    one, series = bristle.fit_presliding(t, q, T), pd.Series(q, index=t)
    assert bristle.fit_presliding(None, series, T).params == pytest.approx(one.params, rel=1e-6, nan_ok=True)
    with pytest.raises(InputError, match="t: missing"):
        bristle.fit_presliding(None, q, T)
    # an index that counts rows, complex numbers, units that are a text, priors that are no fits: a sentence each
    t, q, T = motion()
    with pytest.raises(InputError, match="t: missing; give n times"):
        bristle.fit_dynamic(None, pd.Series(q), T)
    with pytest.raises(InputError, match="expected n real numbers"):
        bristle.fit(np.array([1j, 2.0]), [1.0, 2.0])
    with pytest.raises(InputError, match="units: got 'deg/s'; expected units by signal"):
        bristle.fit([1.0, 2.0], [1.0, 2.0], units="deg/s")  # type: ignore[arg-type]  # what a user may write
    with pytest.raises(InputError, match="priors: got"):
        bristle.fit_dynamic(t, q, T, priors=[1])  # type: ignore[list-item]  # the same
    with pytest.raises(InputError, match="as of one column of a data frame"):
        bristle.fit_dynamic(t, pd.DataFrame({"q": q, "T": T}), T)
    # three held speeds and a ramp between them: the speeds are kept with their torque, all else has a reason
    v = np.concatenate([np.full(3000, 0.2), np.linspace(0.2, 0.6, 400), np.full(3000, 0.6)])
    t = np.arange(v.size) * STEP
    T = bristle.friction(v, P) + noise(v.size, 1e-4)
    found = bristle.find_segments(t, STEP * np.cumsum(v), T)
    kept = found[found.accepted]
    assert kept.velocity.to_numpy() == pytest.approx([0.2, 0.6], rel=1e-3)
    assert kept.torque.to_numpy() == pytest.approx(bristle.friction([0.2, 0.6], P), rel=5e-3)
    assert (found[~found.accepted].reasons != "").all()
    # as an index, or as the time itself, they give the segments that the seconds give
    t = np.arange(0, 6, STEP)
    v = np.repeat([0.1, 0.9], t.size // 2)
    q, T = np.cumsum(v) * STEP, 0.02 + 0.04 * v + noise(t.size, 1e-4)
    plain, past = bristle.find_segments(t, q, T), pd.to_timedelta(t, unit="s")
    instants = pd.Timestamp("2024-05-01", tz="Europe/Amsterdam") + past
    for clock in (past, pd.Timestamp("2024-05-01") + past, instants):
        for times, positions in ((None, pd.Series(q, index=clock)), (pd.Series(clock), q)):
            found = bristle.find_segments(times, positions, T)
            assert found.velocity.to_numpy() == pytest.approx(plain.velocity.to_numpy(), rel=1e-6)


def test_a_compensator_runs_and_learns(fits: Fits) -> None:
    """Step by step it gives the torque of the compiled one, follows friction, and adapts to a joint with more of it; reset begins anew."""
    static, _, dynamic = fits
    comp, still = dynamic.compensator(gamma=20.0), dynamic.compensator(law=None)
    state, step = initial_state(comp.compensator, comp.parameters), compiled(comp.compensator)
    for _ in range(500):
        state, expected = step(state, Reference(0.0, 0.3, 0.0), Measurement(-1e-3, 0.3), 1e-3)
        torque, unlearnt = comp.step(1e-3, (0.0, 0.3), -1e-3, 0.3), still.step(1e-3, (0.0, 0.3), -1e-3, 0.3)
        assert torque == expected
    assert unlearnt == pytest.approx(float(dynamic.friction(0.3)), rel=1e-3)
    assert torque > unlearnt
    assert comp.gains.keys() == {"alpha_0", "alpha_2"}
    assert min(comp.gains.values()) > 1
    assert still.gains == {}
    comp.reset()
    assert set(comp.gains.values()) == {1.0}
    assert comp.step(1e-3, (0.0, 0.3, 0.0), 0.0) == pytest.approx(comp.step(1e-3, (0.0, 0.3), 3e-4), rel=0.5)
    with pytest.raises(InputError, match="dt: got 0"):
        comp.step(0.0, (0.0, 0.3), 0.0)
    with pytest.raises(InputError, match="bristle stiffness"):
        static.compensator()

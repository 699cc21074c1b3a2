import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import bristle
from bristle.arrays import Array
from bristle.control.compensator import Measurement, Reference, compiled, initial_state
from bristle.errors import InputError
from bristle.model.parameters import fields_of
from bristle.page.wording import in_symbols, symbol
from bristle.questions.array_fit.fit import METHODS

from .. import laws
from ..laws import DRAG, EXPONENT, OUTSIDE, motion, registered, truth_of

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


def points(size: float = 5e-5, seed: int = 0) -> tuple[Array, Array]:
    """Velocities, rad/s, and torques, N*m."""
    v = np.geomspace(0.01, 1.0, 24)
    v = np.concatenate([v, -v])
    return v, bristle.friction(v, P) + noise(v.size, size, seed)


def loading() -> tuple[Array, Array, Array]:
    """Time, s, position, rad, and torque, N*m, of two slow cycles below breakaway."""
    t = np.arange(0, 40, STEP)
    T = 0.8 * (P.alpha_0 + P.alpha_1) * np.interp(t % 20, [0, 5, 15, 20], [0, 1, -1, 0])
    dT = np.diff(T, prepend=0.0)
    q = np.cumsum(dT / (P.sigma_0 * (1 - np.sign(dT) * T / (P.alpha_0 + P.alpha_1))))
    count = 2 * np.pi / 2**20
    return t, count * np.round(q / count), T + noise(t.size, 5e-5, 1)


def moved() -> tuple[Array, Array, Array]:
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
    saved(folder, "motion.csv", "t,q,tau", *moved())
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


@pytest.fixture(scope="module")
def plain() -> bristle.Fit:
    return bristle.fit(*points())


def test_arrays_of_any_kind(plain: bristle.Fit) -> None:
    """Lists, series, and columns of a data frame in other units are the same points."""
    v, T = points()
    frame = pd.DataFrame({"dq": np.degrees(v), "tau": 1e3 * T})
    for other in (
        bristle.fit(v.tolist(), T.tolist()),
        bristle.fit(pd.Series(v, index=v[::-1]), pd.Series(T)),
        bristle.fit(frame, velocity="dq", torque="tau", units={"velocity": "deg/s", "torque": "mN*m"}),
    ):
        assert other.params == pytest.approx(plain.params, rel=1e-9)
        assert other.stderr == pytest.approx(plain.stderr, rel=1e-7)
    # predicted torques are those of the law in each direction, nan in one that was not measured; gravity needs positions
    v, T = points(0.0)
    assert bristle.fit(v, T).predict(v.reshape(2, -1)) == pytest.approx(T.reshape(2, -1), rel=1e-6)
    assert np.isnan(bristle.fit(v[v > 0], T[v > 0]).predict([-0.5])).all()
    q = np.linspace(0, 5, v.size)
    loaded = bristle.fit(v, T + 0.01 * np.sin(q), position=q, directions="symmetric", regressors=["gravity"])
    assert loaded.predict(v, q) == pytest.approx(T + 0.01 * np.sin(q), rel=1e-4)
    with pytest.raises(InputError, match="gravity was fitted; give the position too"):
        loaded.predict(v)
    # intervals of a lower level lie inside the 95 % ones, by each method that has levels; at 68 % half of one is the standard error
    for method in METHODS[:2]:
        inner, outer = plain.conf_int(0.68, method), plain.conf_int(0.95, method)
        assert (outer["lower"] < inner["lower"]).all()
        assert (inner["upper"] < outer["upper"]).all()
    half = plain.conf_int(0.6827, "covariance")
    assert ((half["upper"] - half["lower"]) / 2).to_dict() == pytest.approx(plain.stderr, rel=0.05)
    # a method that there is not, and a level that a method does not have
    for level, method in ((1.5, "covariance"), (0.99, "profile"), (0.9, "bootstrap"), (0.95, "guess")):
        with pytest.raises(InputError, match="expected"):
            plain.conf_int(level, method)  # type: ignore[arg-type]  # what is wrong
    # without slow points there is no Stribeck term: nan in parameters, intervals and table, with a warning
    v, T = points()
    fast = np.abs(v) > 3 * P.v_s
    found = bristle.fit(v[fast], T[fast], directions="symmetric")
    assert np.isnan([found.params["alpha_1"], found.params["v_s"]]).all()
    assert found.conf_int().loc["v_s"].isna().all()
    assert "Stribeck term not identifiable" in repr(found)


Fits = tuple[bristle.Fit, bristle.Fit, bristle.Fit]  # of points, of slow loading and of a motion


@pytest.fixture(scope="module")
def fits() -> Fits:
    static = bristle.fit(*points(), directions="symmetric")
    slow = bristle.fit_presliding(*loading(), breakaway=static)
    return static, slow, bristle.fit_dynamic(*moved(), priors=[static, slow])


def test_what_cannot_be_fitted_is_one_sentence(fits: Fits) -> None:
    """Lengths, shapes, options, columns, units, priors, and what a fit does not know: each is refused with what was got and what to do."""
    fit: Any = bristle.fit  # to which a user may give anything
    two, (t, q, T), (static, _, dynamic) = [1.0, 2.0], moved(), fits
    calls: dict[str, Callable[[], object]] = {
        "arrays differ in length: velocity has 2, torque has 3": lambda: fit(two, [1.0, 2.0, 3.0]),
        "torque is not an array of numbers": lambda: fit(two, ["a", "b"]),
        "velocity has shape (1, 2)": lambda: fit([two], two),
        "torque: missing": lambda: fit(two),
        "did you mean 'directions'": lambda: fit(two, two, directons="separate"),
        "units: got 'speed'; expected one of velocity, torque": lambda: fit(two, two, units={"speed": "rpm"}),
        "names a column of a data frame": lambda: fit(two, two, velocity="dq"),
        "torque: got 'T'; expected one of the data frame's columns: v": lambda: fit(pd.DataFrame({"v": [1.0]}), "T", velocity="v"),
        "expected n real numbers": lambda: fit(np.array([1j, 2.0]), two),
        "units: got 'deg/s'; expected units by signal": lambda: fit(two, two, units="deg/s"),
        "t: missing; give n times": lambda: bristle.fit_dynamic(None, pd.Series(q), T),  # an index that counts rows
        "t: missing": lambda: bristle.fit_presliding(None, q, T),
        "priors: got": lambda: bristle.fit_dynamic(t, q, T, priors=[1]),  # type: ignore[list-item]
        "simulate: sigma_0, sigma_1 of direction": lambda: bristle.simulate(two, 0.01, static),
        "nothing is known of friction vs velocity": lambda: bristle.fit_presliding(*loading()).predict(two),
        "dt: got 0": lambda: bristle.simulate(two, 0, P),
        "no interval by profile was made": lambda: dynamic.conf_int(method="profile"),
        "bristle stiffness": static.compensator,
        "as of one column of a data frame": lambda: bristle.fit_dynamic(t, pd.DataFrame({"q": q, "T": T}), T),
    }  # fmt: skip  # a table

    def said(call: Callable[[], object]) -> str:
        try:
            return f"not refused: {call()}"
        except InputError as error:
            return str(error)

    assert [sentence for sentence, call in calls.items() if sentence not in said(call)] == []


def test_a_first_fit_loads_no_page_and_no_command_line() -> None:
    """Neither matplotlib nor Typer nor Jinja is imported for numbers, nor to print them."""
    code = (
        "import sys, bristle\nv = [0.02, 0.04, 0.08, 0.15, 0.3, 0.6, 1.0]\n"
        "T = [0.0251, 0.0250, 0.0241, 0.0254, 0.0312, 0.0431, 0.059]\nprint(len(repr(bristle.fit(v, T))) > 100)\n"
        "print([name for name in ('matplotlib', 'typer', 'jinja2') if name in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)  # noqa: S603  # our own code
    assert ran.stdout.split() == ["True", "[]"]


@pytest.mark.parametrize("law", [DRAG, EXPONENT])
def test_a_fit_under_a_law_has_its_curve(law: str) -> None:
    """Each parameter is near the true one, and friction and prediction are the true curve to a thousandth."""
    found, truth, v = laws.points(law), truth_of(law), np.linspace(-0.8, 0.8, 9)
    assert found.joint.law == truth.law
    for name in truth.law.own:
        assert found.params[name.name] == pytest.approx(getattr(truth, name.name), rel=0.1)
    for torque in (found.predict(v), bristle.friction(v, found)):
        assert torque == pytest.approx(bristle.friction(v, truth), rel=1e-3)
    # it is fitted under the law of the points without being told, and simulates as the true parameters do
    found, truth = motion(law), truth_of(law)
    assert found.joint.law == truth.law
    v = 0.5 * np.sin(2.0 * np.arange(0, 4, 0.002))
    true = bristle.simulate(v, 0.002, truth)
    assert np.linalg.norm(bristle.simulate(v, 0.002, found) - true) < 0.01 * np.linalg.norm(true)


def test_every_parameter_has_a_symbol() -> None:
    """Those of bristle's laws and of a registered one, alone, with a direction, and in a sentence where they are no words."""
    with registered():
        assert [symbol(name) for name in fields_of(truth_of(DRAG).law)[-2:]] == ["α₃", "vₑ"]
        assert symbol("delta+") == "δ (+)"
        assert symbol(fields_of(truth_of(OUTSIDE).law)[-1]) == "β"
        assert in_symbols("alpha_3+ beyond v_end; the blunt delta") == "α₃ (+) beyond vₑ; the blunt delta"


def test_arrays_give_what_files_give(of_files: bristle.Results, fits: Fits) -> None:
    """Static, presliding and joint estimates of arrays are those of files, with their errors and intervals."""
    (joint,), (static, slow, dynamic) = of_files.joints, fits
    assert joint.presliding is not None
    assert joint.joint_fit is not None
    for name, e in joint.static["both"].parameters.items():
        assert static.joint.static["both"].parameters[name] == e
        assert (static.params[name], static.stderr[name]) == (e.value, e.standard_error)
        assert tuple(static.conf_int().loc[name]) == e.interval
    for d, one in joint.presliding.fits.items():
        assert slow.params[f"sigma_0{d}"] == one.sigma_0.value
        assert tuple(slow.conf_int().loc[f"sigma_0{d}"]) == one.sigma_0.interval
    assert dynamic.params == {str(key): e.value for key, e in joint.joint_fit.parameters.items()}
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


def test_motions_of_arrays_have_intervals_and_a_compensator(fits: Fits) -> None:
    """By covariance always; by profile and bootstrap with `uncertainty`."""
    assert fits[-1].conf_int(method="covariance").loc["alpha_0"].notna().all()
    whole = bristle.fit_dynamic(*moved(), directions="symmetric", uncertainty=True)
    for method in METHODS:
        ends = whole.conf_int(method=method).to_dict("index")["alpha_0"]
        assert ends["lower"] < whole.params["alpha_0"] < ends["upper"]
    # each as text, as HTML with a picture and no script, and as axes with quantity and unit; the caller's style is left alone
    before = dict(mpl.rcParams)
    labels = ("Velocity (rad/s)", "Displacement (rad)", "Time (s)")
    for found, label in zip(fits, labels, strict=True):
        ax = found.plot(Figure().subplots())
        assert (ax.get_xlabel(), ax.get_ylabel()) == (label, "Torque (N·m)")
        assert all(name in repr(found) for name in found.params)
        assert [part in found._repr_html_() for part in ("<table", "<svg", "<script")] == [True, True, False]
    assert dict(mpl.rcParams) == before
    # step by step it gives the torque of the compiled one, follows friction, and adapts; reset begins anew
    *_, dynamic = fits
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
    with pytest.raises(InputError, match="dt: got 0"):
        comp.step(0.0, (0.0, 0.3), 0.0)


def test_time_as_index_or_as_numbers() -> None:
    """The index of a series is the time; without one, time must be given."""
    t, q, T = loading()
    one, series = bristle.fit_presliding(t, q, T), pd.Series(q, index=t)
    assert bristle.fit_presliding(None, series, T).params == pytest.approx(one.params, rel=1e-6, nan_ok=True)
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
    past, q = pd.to_timedelta(t, unit="s"), STEP * np.cumsum(v)
    instants = pd.Timestamp("2024-05-01", tz="Europe/Amsterdam") + past
    for clock in (past, pd.Timestamp("2024-05-01") + past, instants):
        for times, positions in ((None, pd.Series(q, index=clock)), (pd.Series(clock), q)):
            again = bristle.find_segments(times, positions, T)
            assert again.velocity.to_numpy() == pytest.approx(found.velocity.to_numpy(), rel=1e-6)

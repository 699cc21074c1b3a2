import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import bristle
from bristle.arrays import Array
from bristle.errors import InputError
from bristle.model.parameters import fields_of
from bristle.page.wording import in_symbols, symbol
from bristle.questions.array_fit.fit import METHODS
from bristle.simulation import edro

from .. import laws
from ..conftest import TRUTH, speeds
from ..laws import DRAG, EXPONENT, OUTSIDE, motion, registered, truth_of


def points(noise: float = 2e-5, seed: int = 0) -> tuple[Array, Array]:
    """Velocities, rad/s, and torques of `TRUTH` with noise, N*m."""
    v = speeds()
    p = TRUTH
    T = np.sign(v) * (p.alpha_0 + p.alpha_1 * np.exp(-((v / p.v_s) ** 2))) + p.alpha_2 * v
    return v, T + noise * np.random.default_rng(seed).standard_normal(v.size)


@pytest.fixture(scope="module")
def plain() -> bristle.Fit:
    return bristle.fit(*points())


def test_arrays_give_what_a_file_gives(tmp_path: Path, plain: bristle.Fit) -> None:
    """The embedded points as arrays and as a file: every estimate, interval and warning to the last digit."""
    (gripper, *_) = edro.experiments()
    kept = bristle.inspect(gripper).points(hold_out=False)
    v, T = (np.array([getattr(s, name) for s in kept]) for name in ("velocity", "torque"))
    np.savetxt(tmp_path / "points.csv", np.column_stack([v, T]), "%.17g", ",", header="v,T", comments="")
    (tmp_path / "e.yaml").write_text(
        "joint: {name: joint}\nsignals: {velocity: {column: v, unit: rad/s}, torque: {column: T, unit: N*m}}\n"
        "runs: [{files: points.csv, experiment: points}]\n",
        encoding="utf-8",
    )
    found, of_file = bristle.fit(v, T), bristle.identify(tmp_path / "e.yaml").joints[0]
    assert found.params.keys() == {f"{name}{d}" for d in "+-" for name in ("alpha_0", "alpha_1", "alpha_2", "v_s")}
    for d, fit in of_file.static.items():
        for name, e in fit.parameters.items():
            assert found.joint.static[d].parameters[name] == e
            assert found.params[f"{name}{d}"] == e.value
            assert tuple(found.conf_int().loc[f"{name}{d}"]) == e.interval
    assert [str(w) for w in found.warnings] == [str(w) for w in dict.fromkeys(of_file.all_warnings())]
    # arrays, lists, series, and columns of a data frame in other units are the same points
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
    found = bristle.fit(v, T)
    assert found.predict(v) == pytest.approx(T, rel=1e-6)
    assert found.predict(v.reshape(2, -1)).shape == (2, v.size // 2)
    forward = bristle.fit(v[v > 0], T[v > 0])
    assert np.isnan(forward.predict([-0.5])).all()
    q = np.linspace(0, 5, v.size)
    loaded = bristle.fit(v, T + 0.01 * np.sin(q), position=q, directions="symmetric", regressors=["gravity"])
    assert loaded.predict(v, q) == pytest.approx(T + 0.01 * np.sin(q), rel=1e-4)
    with pytest.raises(InputError, match="gravity was fitted; give the position too"):
        loaded.predict(v)
    # text, table and curve: into given axes, and as HTML with a picture and no script; the caller's style is left alone
    before = dict(mpl.rcParams)
    ax = Figure().subplots()
    assert plain.plot(ax) is ax
    assert ax.get_xlabel() == "Velocity (rad/s)"
    page = plain._repr_html_()
    assert [part in page for part in ("<table", "<svg", "<script")] == [True, True, False]
    assert list(plain.to_frame().index) == list(plain.params)
    assert dict(mpl.rcParams) == before


def test_intervals_by_each_method(plain: bristle.Fit) -> None:
    """Those of a lower level lie inside the 95 % ones, by each method that has levels; at 68 % half of one is the standard error."""
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
    # without slow points there is no Stribeck term: nan, in parameters, intervals and the table, with a warning that
    # says why
    v, T = points()
    fast = np.abs(v) > 3 * TRUTH.v_s
    found = bristle.fit(v[fast], T[fast], directions="symmetric")
    assert np.isnan([found.params["alpha_1"], found.params["v_s"]]).all()
    assert found.conf_int().loc["v_s"].isna().all()
    assert any("Stribeck term not identifiable" in str(w) for w in found.warnings)
    assert "Stribeck term not identifiable" in repr(found)


@pytest.mark.slow
def test_intervals_hold_the_truth() -> None:
    """The 95 % intervals hold the truth in most of 20 fits, by each method."""
    held = dict.fromkeys(METHODS, 0)
    for seed in range(20):
        found = bristle.fit(*points(seed=seed), directions="symmetric")
        for method in held:
            ends = found.conf_int(method=method)
            held[method] += sum(row.lower <= getattr(TRUTH, str(row.Index)) <= row.upper for row in ends.itertuples())
    assert min(held.values()) >= 0.9 * 20 * 4


@pytest.mark.parametrize(
    ("arguments", "options", "sentence"),
    [
        (([1.0, 2.0], [1.0, 2.0, 3.0]), {}, "arrays differ in length: velocity has 2, torque has 3"),
        (([1.0, 2.0], ["a", "b"]), {}, "torque is not an array of numbers"),
        (([[1.0, 2.0]], [1.0, 2.0]), {}, r"velocity has shape \(1, 2\)"),
        (([1.0, 2.0],), {}, "torque: missing"),
        (([1.0, 2.0], [1.0, 2.0]), {"directons": "separate"}, "did you mean 'directions'"),
        (([1.0, 2.0], [1.0, 2.0]), {"units": {"speed": "rpm"}}, "units: got 'speed'; expected one of velocity, torque"),
        (([1.0, 2.0], [1.0, 2.0]), {"velocity": "dq"}, "names a column of a data frame"),
        ((pd.DataFrame({"v": [1.0]}), "T"), {"velocity": "v"}, "torque: got 'T'; expected one of the data frame's columns: v"),
    ],
)  # fmt: skip  # a table
def test_what_cannot_be_fitted_is_one_sentence(
    arguments: tuple[object, ...], options: dict[str, object], sentence: str
) -> None:
    """Lengths, shapes, options and columns: each is refused with what was got and what to do."""
    with pytest.raises(InputError, match=sentence):
        bristle.fit(*arguments, **options)  # type: ignore[arg-type]  # what is wrong


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

import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.text import Text
from scipy import stats

import bristle
from bristle.data.experiment.schema import FitOptions
from bristle.findings import CRITICAL, Finding
from bristle.identification import document
from bristle.identification.fits import Estimate
from bristle.identification.static.fit import estimate_static
from bristle.identification.static.problem import from_points
from bristle.identification.systematic import shifted
from bristle.model.laws.registry import law_named
from bristle.model.parameters import Lugre, ParameterName, unit
from bristle.questions.session_comparison.compare import compare, holm
from bristle.questions.session_comparison.report import forest_figure, report
from bristle.questions.session_comparison.results import (
    Change,
    Comparison,
    Session,
    SessionFit,
    SessionJoint,
    alike,
    read_session,
    session_of,
)
from bristle.simulation.bench import steady_points

from ..conftest import TRUTH, experiment, present, run, speeds, tree, write
from ..laws import DRAG, EXPONENT, OUTSIDE, points, registered, truth_of
from ..pages import Elements, assert_tables_are_named, findings, page_text

SPEEDS = speeds(both=False)
Files = tuple[Path, Path]  # results files of two sessions
HOSTILE = '<script>alert("1")</script> ../../&x'


def estimate(
    value: float | None, error: float | None = 1.0, name: str = "alpha_0", reach: float = 1.959964
) -> Estimate:
    """A normal estimate."""
    interval = None if value is None or error is None else (value - reach * error, value + reach * error)
    known = None if value is None else error
    return Estimate(value=value, unit=unit(name.rstrip("+-")), standard_error=known, interval=interval)


def fit_of(*, source: str, parameters: Mapping[str, Estimate], names: Sequence[str] = (), **rest: Any) -> SessionFit:
    """A fit whose parameters are given by text, as alpha_0+."""
    by_name = {ParameterName.parse(name): e for name, e in parameters.items()}
    return SessionFit(source=source, parameters=by_name, names=tuple(map(ParameterName.parse, names)), **rest)


def session(*fits: SessionFit, joint: str = "wrist", kind: Any = "revolute", **known: Any) -> Session:
    return {joint: SessionJoint(kind=kind, fits=fits, **known)}


def plain(values: Mapping[str, float], error: float = 1.0, source: str = "static +", **rest: Any) -> SessionFit:
    return fit_of(source=source, parameters={n: estimate(x, error, n) for n, x in values.items()}, **rest)


def change(compared: Comparison, parameter: str) -> Change:
    (found,) = (c for c in compared.changes if str(c.parameter) == parameter)
    return found


def moved(compared: Comparison) -> dict[str, float]:
    """The parameters that the sentence says changed, and by how many percent."""
    assert compared.sentence.code == "parameters-changed"
    return {name: percent for _, name, percent in compared.sentence.numbers["changes"]}


def linear(rng: np.random.Generator, n: int, shift: float = 0.0) -> SessionFit:
    """Least squares of alpha_0 and alpha_2 from n points of known truth; alpha_0 is off by `shift` joint standard errors."""
    v = np.linspace(0.1, 1.0, n)
    columns = np.stack([np.ones(n), v], axis=1)
    inner = np.linalg.inv(columns.T @ columns)
    torque = columns @ [1.0 + shift * np.sqrt(2 * inner[0, 0]), 2.0] + rng.standard_normal(n)
    theta = inner @ columns.T @ torque
    dof = n - 2
    covariance = inner * np.sum((torque - columns @ theta) ** 2) / dof
    reach, errors = stats.t.ppf(0.975, dof), np.sqrt(np.diag(covariance))
    names = ("alpha_0", "alpha_2")
    parameters = {k: estimate(float(x), float(e), k, reach) for k, x, e in zip(names, theta, errors, strict=True)}
    return fit_of(source="static both", parameters=parameters, names=names, covariance=covariance, freedom=dof)


def most(tries: int, share: float) -> int:
    """Not exceeded by a binomial count but once in a thousand."""
    return int(stats.binom.ppf(0.999, tries, share))


@pytest.mark.parametrize("n", [6, 30])
def test_false_alarms_are_no_more_than_nominal(n: int) -> None:
    """Sessions of one truth: any parameter is called changed in at most one pair of twenty, and so is any set, within binomial bounds."""
    rng, tries = np.random.default_rng(n), 500
    pairs = [compare(session(linear(rng, n)), session(linear(rng, n))) for _ in range(tries)]
    alarms = sum(any(c.changed for c in x.changes) for x in pairs)
    assert alarms <= most(tries, 0.05)
    assert sum(any(c.p is not None and c.p < 0.05 for c in x.changes) for x in pairs) > tries * 0.03  # p is no constant
    if n == 30:
        assert sum(x.changed for pair in pairs for x in pair.sets) <= most(tries, 0.05)


def test_changes_are_found_in_the_fit_to_use() -> None:
    """alpha_0 moved by five joint standard errors: called so, with its sign, in nearly every pair; a set test finds it too."""
    rng, tries = np.random.default_rng(1), 200
    pairs = [compare(session(linear(rng, 40)), session(linear(rng, 40, 5.0))) for _ in range(tries)]
    found = [change(x, "alpha_0") for x in pairs]
    assert sum(bool(c.changed) and c.verdict.code == "rose" for c in found) >= 0.98 * tries
    assert sum(x.sets[0].changed for x in pairs) >= 0.98 * tries
    assert all("alpha_0" in moved(x) for x in pairs if change(x, "alpha_0").changed)
    # whole fits, v_s with its skewed profile: false alarms within binomial bounds; viscous friction less by a tenth is found
    rng, tries = np.random.default_rng(3), 50
    same = (compare(friction(rng, TRUTH), friction(rng, TRUTH)).changes for _ in range(tries))
    assert sum(any(c.changed for c in changes) for changes in same) <= most(tries, 0.05)
    warm = TRUTH._replace(alpha_2=0.9 * TRUTH.alpha_2)
    warmer = [compare(friction(rng, TRUTH), friction(rng, warm)) for _ in range(20)]
    found = [x for x in warmer if change(x, "alpha_2").verdict.code == "fell"]
    assert len(found) >= 19  # ten standard errors
    for x in found:
        assert max(x.changes, key=lambda c: abs(c.z or 0.0)).parameter.name == "alpha_2"
        assert moved(x)["alpha_2"] < 0
    assert np.median([change(x, "alpha_2").percent or 0.0 for x in found]) == pytest.approx(-10, abs=1)
    # the joint fit before tracking before static; one that did not converge comes last, and that is said
    values = {"joint": 1.0, "tracking": 2.0, "static both": 3.0}
    joint, moving, points = (plain({"alpha_0": x}, source=source) for source, x in values.items())
    assert change(compare(session(joint, moving, points), session(joint, moving, points)), "alpha_0").source == "joint"
    assert change(compare(session(moving, points), session(joint, moving, points)), "alpha_0").source == "tracking"
    bad = replace(moving, distrusted=Finding("not-converged", CRITICAL, "It did not converge."))
    compared = compare(session(bad, points), session(moving, points))
    assert change(compared, "alpha_0").source == "static both"
    (warning,) = compared.warnings
    assert warning.code == "fit-distrusted"
    assert change(compare(session(bad), session(moving)), "alpha_0").source == "tracking"
    # friction and inertia all up by a tenth: perhaps the motor constant
    names = ("alpha_0+", "alpha_2+", "inertia")
    compared = compare(session(plain(dict.fromkeys(names, 10.0), 0.1)), session(plain(dict.fromkeys(names, 11.0), 0.1)))
    assert "torque-scale" in [x.code for x in compared.warnings]
    assert moved(compared) == pytest.approx(dict.fromkeys(names, 10.0))


def friction(rng: np.random.Generator, p: Lugre[float]) -> Session:
    """What the static fit says of points of these parameters."""
    (torque,) = steady_points(p, SPEEDS, 1e-4, rng, 1)
    found = estimate_static(from_points(SPEEDS, torque, ("+",)), FitOptions(), "revolute")
    return session(fit_of(source="static +", parameters=found, freedom=SPEEDS.size - 4))


@given(p=st.lists(st.floats(0, 1), min_size=1, max_size=6))
def test_holm_is_the_closed_test(p: list[float]) -> None:
    """Holm's value of one hypothesis is the largest Bonferroni value over all sets of hypotheses that hold it (Marcus, Peritz, Gabriel)."""
    every = [s for size in range(1, len(p) + 1) for s in combinations(range(len(p)), size)]
    closed = [max(min(len(s) * min(p[k] for k in s), 1.0) for s in every if i in s) for i in range(len(p))]
    np.testing.assert_allclose(holm(np.array(p)), closed, rtol=1e-12, atol=0)


values = st.floats(-5, 5).map(lambda x: round(x, 3))


@given(a=values, b=values, e=st.floats(0.1, 3), f=st.floats(0.1, 3))
def test_a_difference_is_of_two_normals_and_turns_with_the_sessions(a: float, b: float, e: float, f: float) -> None:
    """The ratio is z = (b - a) / hypot(e, f), p of the normal distribution; the other way round it is -z with the same p."""
    there = change(compare(session(plain({"alpha_0": a}, e)), session(plain({"alpha_0": b}, f))), "alpha_0")
    back = change(compare(session(plain({"alpha_0": b}, f)), session(plain({"alpha_0": a}, e))), "alpha_0")
    z = (b - a) / np.hypot(e, f)
    assert there.z == pytest.approx(z, abs=1e-6)
    assert there.p == pytest.approx(2 * stats.norm.sf(abs(z)), abs=1e-6)
    assert back.z == pytest.approx(-z, abs=1e-6)
    assert back.p == pytest.approx(there.p, abs=1e-12)
    assert there.difference == pytest.approx(b - a)
    assert there.error == pytest.approx(np.hypot(e, f), rel=1e-5)


@given(a=st.floats(0.01, 100), ratio=st.floats(0.3, 3), scale=st.floats(0.01, 100))
def test_what_is_known_by_a_factor_is_compared_by_its_logarithm(a: float, ratio: float, scale: float) -> None:
    """Of v_s only the ratio counts: another unit of speed changes neither z nor p; z is log(ratio) over the errors of the logarithms."""

    def told(value: float) -> Session:
        ends = (value * np.exp(-0.3), value * np.exp(0.3))
        e = Estimate(value=value, unit="rad/s", standard_error=0.1 * value, interval=ends)
        return session(fit_of(source="static +", parameters={"v_s+": e}))

    one, other = (change(compare(told(k * a), told(k * a * ratio)), "v_s+") for k in (1.0, scale))
    assert one.z == pytest.approx(np.log(ratio) / np.hypot(0.3, 0.3) * 1.959964, rel=1e-5, abs=1e-9)
    assert other.z == pytest.approx(one.z, rel=1e-6, abs=1e-9)


def test_half_intervals_freedom_sets_and_many_tests() -> None:
    """A skewed interval: its long side is what a higher value meets, its short side, but no less than the standard error, a lower one."""
    skewed = Estimate(value=10.0, unit="N*m", standard_error=1.0, interval=(8.5, 10 + 4 * 1.959964))
    first = session(fit_of(source="static +", parameters={"alpha_0": skewed}))
    up, down = (change(compare(first, session(plain({"alpha_0": 10.0 + d}, 1e-6))), "alpha_0") for d in (8.0, -8.0))
    assert up.z == pytest.approx(2.0, rel=1e-6)
    assert down.z == pytest.approx(-8.0, rel=1e-6)
    # Welch: with 3 and 3 degrees of freedom and equal errors a difference has 6 of them
    reach = stats.t.ppf(0.975, 3)
    both = ({"alpha_0": estimate(x, 1.0, reach=reach)} for x in (0.0, 3.0))
    made = (session(fit_of(source="static +", parameters=parameters, freedom=3)) for parameters in both)
    found = change(compare(*made), "alpha_0")
    assert found.z == pytest.approx(3 / np.sqrt(2))
    assert found.p == pytest.approx(2 * stats.t.sf(3 / np.sqrt(2), 6), rel=1e-9)
    # the statistic d' (C_a + C_b)**-1 d / k finds what no parameter shows alone along the direction seen well: said
    a, b = correlated(0.0), correlated(1.5)
    compared = compare(session(a), session(b))
    d = np.array([0.15, 0.15])
    (found,) = compared.sets
    assert found.statistic == pytest.approx(d @ np.linalg.inv(a.covariance + b.covariance) @ d / 2)
    assert found.p == pytest.approx(stats.chi2.sf(2 * found.statistic, 2), rel=1e-6)
    assert found.changed
    assert not any(c.changed for c in compared.changes)
    assert (compared.sentence.code, compared.sentence.numbers["fits"]) == ("only-sets-changed", ("static +",))
    # where some parameters changed, the sentence names the sets that did and hold none of them, and no set that does
    a, b = (fit_of(source="static -", parameters={"inertia": estimate(x, 0.1)}) for x in (1.0, 3.0))
    compared = compare(session(a, correlated(0.0)), session(b, correlated(1.5)))
    assert [str(c.parameter) for c in compared.changes if c.changed] == ["inertia"]
    assert "As a set, though none alone, so did those of the fit static +." in str(compared.sentence)
    apart = compare(session(correlated(0.0)), session(correlated(9.0)))
    assert apart.sets[0].changed
    assert apart.sentence.numbers["fits"] == ()
    # differences of 2.2 standard errors: one alone is called a change, three are not, for Holm's values count; those are `holm` of p
    names = ("alpha_0+", "alpha_2+", "inertia")
    apart = 2.2 * np.sqrt(2)
    for several, changed in ((names[:1], True), (names, False)):
        first, second = (session(plain(dict.fromkeys(several, x))) for x in (10.0, 10 + apart))
        compared = compare(first, second)
        assert {c.changed for c in compared.changes} == {changed}
        expected = holm(np.array([c.p for c in compared.changes], dtype=float))
        assert [c.adjusted for c in compared.changes] == pytest.approx(expected.tolist())


def scaled(value: float, shift: float, constant: str, name: str = "alpha_0") -> SessionFit:
    """A fit of one parameter and of the same with the other sign, both moved by an error of a constant."""
    parameters = {n: shifted(estimate(value, 1.0, n), {constant: shift}) for n in (f"{name}+", f"{name}-")}
    return fit_of(source="static +", parameters=parameters, names=tuple(parameters), covariance=np.eye(2))


@given(a=values, b=values, shift=st.floats(0.1, 30))
def test_a_constant_of_both_sessions_does_not_widen_their_difference(a: float, b: float, shift: float) -> None:
    """Of one and the same constant nothing is left in the difference; of two their errors are added; and the warning says which is which."""
    same, own = (compare(session(scaled(a, shift, "K")), session(scaled(b, shift, k))) for k in ("K", "other K"))
    wide = np.hypot(np.sqrt(2), np.sqrt(2) * shift)
    assert change(same, "alpha_0+").z == pytest.approx((b - a) / np.sqrt(2), rel=1e-4, abs=1e-6)
    assert change(own, "alpha_0+").z == pytest.approx((b - a) / wide, rel=1e-4, abs=1e-6)
    assert [x.code for x in same.warnings] == ["common-constants"]
    assert [x.code for x in own.warnings] == ["own-constants"]
    assert same.sets[0].statistic == pytest.approx((b - a) ** 2 / 2, abs=1e-9)
    assert own.sets[0].statistic == pytest.approx((b - a) ** 2 / (2 + 4 * shift**2), rel=1e-6, abs=1e-9)


def correlated(shift: float) -> SessionFit:
    """alpha_0 and alpha_2 that are seen almost only as a sum, off by `shift` standard errors each."""
    names, error = ("alpha_0+", "alpha_2+"), 0.1
    covariance = error**2 * np.array([[1.0, -0.98], [-0.98, 1.0]])
    parameters = {n: estimate(1.0 + shift * error, error, n) for n in names}
    return fit_of(source="static +", parameters=parameters, names=names, covariance=covariance)


def test_what_is_compared_doubted_or_refused() -> None:
    """Nothing changes, every z is 0; that both rest on the same files is said."""
    own = session(correlated(0.3), inputs=("abc",))
    compared = compare(own, own)
    assert [c.z for c in compared.changes] == [0.0, 0.0]
    assert not any(c.changed for c in compared.changes)
    assert not any(x.changed for x in compared.sets)
    assert str(compared.sentence) == "None of 2 parameters changed beyond its joint uncertainty."
    assert [x.code for x in compared.warnings] == ["files-shared"]
    more = session(correlated(0.3), inputs=("abc", "def"))
    (shared,) = compare(own, more).warnings
    assert (shared.code, shared.numbers) == ("files-shared", {"same": 1, "files": 2})
    assert not compare(own, session(correlated(0.3), inputs=("def",))).warnings
    # not identifiable, an open interval, another direction, one session alone, other stages: each has its own reason, and no verdict
    opened = replace(estimate(1.0), interval=(0.5, np.inf))
    all_four = {"alpha_0": estimate(1.0), "alpha_1": estimate(None), "v_s": opened, "alpha_2": estimate(1.0)}
    first = fit_of(source="static +", parameters=all_four)
    second = fit_of(source="static +", parameters={"alpha_0+": estimate(1.0), "alpha_1": estimate(1.0), "v_s": opened})
    more = fit_of(source="tracking", parameters={"sigma_0": estimate(2.0)})
    other = fit_of(source="presliding +", parameters={"sigma_0": estimate(2.0)})
    compared = compare(session(first, more), session(second, other))
    elsewhere = "session has it in other directions; identify both with the same fit.directions"
    assert {str(c.parameter): str(c.verdict) for c in compared.changes} == {
        name: f"Not comparable: {why}."
        for name, why in {
            "alpha_0": f"the second {elsewhere}",
            "alpha_0+": f"the first {elsewhere}",
            "alpha_1": "it is not identifiable in the first session",
            "v_s": "its interval is open, or one-sided, in both sessions",
            "alpha_2": "the second session does not have it",
            "sigma_0": "the sessions have it from different stages",
        }.items()
    }
    assert {c.changed for c in compared.changes} == {None}
    assert compared.sentence.code == "nothing-compared"
    # where one session's fit has a Stribeck term and the other's has none, alpha_0 may differ without any change of the joint: said
    full = fit_of(source="static +", parameters={"alpha_0+": estimate(1.0), "alpha_1+": estimate(1.0)})
    flat = fit_of(source="static +", parameters={"alpha_0+": estimate(2.0), "alpha_1+": estimate(None)})
    (warning,) = compare(session(full), session(flat)).warnings
    assert (warning.code, warning.numbers["terms"]) == ("models-differ", ("alpha_1+",))
    assert "known only in the first session, by its static + fit" in str(warning)


def test_the_figure_shows_both_sessions_relative_to_the_first() -> None:
    """Two markers per parameter, the first session's at zero, the second's at its difference in percent; no figure of nothing."""
    a, b = (session(plain({"alpha_0+": x, "alpha_2+": 4.0}, 0.1)) for x in (2.0, 3.0))
    compared = compare(a, b)
    figure = present(forest_figure(compared, "wrist"))
    (ax,) = figure.axes
    marks = sorted(float(line.get_xdata()[0]) for line in ax.lines if line.get_marker() in {"o", "s"})  # type: ignore[arg-type, index]
    assert marks == pytest.approx([0, 0, 0, 50])
    assert sum(text.get_text() == "changed" for text in ax.texts) == 1
    assert forest_figure(compare(session(plain({"alpha_0": 0.0})), session(plain({"alpha_0": 0.0}))), "wrist") is None
    # title, legend and axes do not touch, whatever the number of rows
    for count in (1, 12):
        values = dict.fromkeys([name + d for d in "+-" for name in Lugre._fields][:count], 2.0)
        figure = present(forest_figure(compare(session(plain(values, 0.1)), session(plain(values, 0.1))), "wrist"))
        figure.draw_without_rendering()
        (ax,) = figure.axes
        box = present(ax.get_legend()).get_window_extent()
        (heading,) = (t for t in ax.get_children() if isinstance(t, Text) and t.get_text() == "wrist")
        assert ax.get_window_extent().y1 - 1 <= box.y0 < box.y1 < heading.get_window_extent().y0 - 3
        assert heading.get_window_extent().y1 <= figure.bbox.y1


def results(folder: Path, name: str, seed: int, alpha_2: float) -> Path:
    """The results.json of points of the gripper with a hostile name, whose viscous friction may differ."""
    v = speeds()
    (torque,) = steady_points(TRUTH._replace(alpha_2=alpha_2), v, 2e-5, np.random.default_rng(seed), 1)
    pd.DataFrame({"v": v, "tau": torque}).to_csv(folder / "data.csv", index=False)
    (folder / "e.yaml").write_text(experiment(joint=HOSTILE), encoding="utf-8")
    (folder / name).write_text(bristle.identify(folder / "e.yaml").to_json(), encoding="utf-8")
    return folder / name


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> Files:
    """Results of a joint with a hostile name, and of the same with an eighth less viscous friction."""
    folder = tmp_path_factory.mktemp("sessions")
    return results(folder, "a.json", 0, TRUTH.alpha_2), results(folder, "b.json", 1, 0.87 * TRUTH.alpha_2)


def test_what_was_written_is_read_back(sessions: Files, tmp_path: Path) -> None:
    """Every estimate and covariance of results.json comes back to the last digit."""
    document = json.loads(sessions[0].read_text(encoding="utf-8"))["joints"][HOSTILE]["static"]
    joint = read_session(sessions[0])[HOSTILE]
    assert [fit.source for fit in joint.fits] == ["static +", "static -"]
    for fit, (d, written) in zip(joint.fits, document.items(), strict=True):
        values = {n: p["value"] for n, p in written["parameters"].items()}
        assert {n.name: e.value for n, e in fit.parameters.items()} == values
        assert all(n.direction == d for n in (*fit.parameters, *fit.names))
        assert fit.covariance.tolist() == written["covariance"]
        assert fit.freedom == written["degrees_of_freedom"]
    assert joint.inputs
    # the same file by any path: exit 2, one sentence and no page. A copy is another file, of the same data: compared, with the warning
    again = sessions[0].parent / ".." / sessions[0].parent.name / sessions[0].name
    ran = run("compare", sessions[0], again, "-o", tmp_path / "out")
    assert (ran.code, len(ran.said)) == (2, 1)
    assert "is the same file as" in ran.err
    assert not list(tmp_path.iterdir())
    (tmp_path / "copy.json").write_bytes(sessions[0].read_bytes())
    ran = run("compare", sessions[0], tmp_path / "copy.json")
    assert ran.code == 0
    assert "the sessions share data and are not independent" in ran.words


def test_the_command_says_what_changed_and_writes_a_page(sessions: Files, tmp_path: Path) -> None:
    """Page, figure and tables land, the same bytes twice, and a hostile name stays text."""
    ran = run("compare", *sessions, "-o", tmp_path / "out")
    assert (ran.code, ran.said) == (0, [])
    out = ran.words
    assert "parameters changed beyond their joint uncertainty: " in out
    assert "alpha_2+ (-1" in out
    assert "alpha_2- (-1" in out
    first = tree(tmp_path / "out")
    assert {"index.html", "tables/changes.csv", "tables/sets.csv"} < set(first)
    assert sum(name.endswith(".png") for name in first) == 1
    page = page_text(tmp_path / "out" / "index.html")
    assert "<script" not in page.lower()
    assert Elements(page).runs == set()
    largest = r"\d of 8 parameters changed; the largest change: α₂ \([+−]\) fell by 1[\d.]+ ± [\d.]+ %\."
    assert [bool(re.fullmatch(largest, finding)) for finding in findings(page)] == [True]
    assert_tables_are_named(tmp_path / "out")
    assert b"nan" not in (first["tables/changes.csv"] or b"nan").lower()
    assert run("compare", *sessions, "-o", tmp_path / "out").code == 0
    assert tree(tmp_path / "out") == first
    # its report has its frame as a table, is written by path or text, begins with the verdict; others have none
    compared = compare(session(plain({"alpha_0": 2.0}, 0.1)), session(plain({"alpha_0": 3.0, "v_s": 1.0}, 0.1)))
    report = bristle.report_of(compared)
    pd.testing.assert_frame_equal(compared.to_frame(), report.frames["changes"])
    assert compared.to_frame()["verdict"].tolist() == [str(c.verdict) for c in compared.changes]
    assert report.text().splitlines()[:2] == [str(compared.sentence), "[[wrist]] revolute"]
    said = "got a Change; expected a result of adapt, compare, fleet, plan, sensitivity or validate"
    with pytest.raises(bristle.InputError, match=said):
        bristle.report_of(compared.changes[0])  # type: ignore[arg-type]


def test_captions() -> None:
    """The largest change in percent of the first value, in the unit where that is zero; else the largest difference."""

    def caption(first: Mapping[str, float], second: Mapping[str, float], kind: Any) -> str:
        both = []
        for values in (first, second):
            parameters = {
                n: Estimate(value=x, unit=unit(n[:-1], kind), standard_error=0.1, interval=(x - 0.196, x + 0.196))
                for n, x in values.items()
            }
            both.append(session(fit_of(source="static +", parameters=parameters), kind=kind))
        return next(section.figure.caption for section in report(compare(*both)).sections if section.figure)

    unchanged = "changed beyond its joint uncertainty; differences are"
    four = {"alpha_0+": 2.0, "alpha_2+": 4.0}
    cases: list[tuple[Mapping[str, float], Mapping[str, float], str, str]] = [
        (four, {"alpha_0+": 3.0, "alpha_2+": 1.0}, "revolute", "2 of 2 parameters changed; the largest change: α₂ (+) fell by 75.0 ± 3.5 %."),
        ({"alpha_0+": -2.0}, {"alpha_0+": -1.0}, "revolute", "1 of 1 parameter changed; the largest change: α₀ (+) rose by 50.0 ± 7.1 %."),
        ({"alpha_0+": 0.0}, {"alpha_0+": -3.0}, "prismatic", "1 of 1 parameter changed; the largest change: α₀ (+) fell by 3.00 ± 0.14 N."),
        (four, {"alpha_0+": 2.1, "alpha_2+": 3.8}, "revolute", f"None of 2 parameters {unchanged} 1.4 standard errors at most."),
    ]  # fmt: skip  # a table
    made = [(caption(first, second, kind), found) for first, second, kind, found in cases]
    assert [both for both in made if not both[0].startswith(f"{both[1]} Each parameter")] == []


Spoil = Callable[[dict[str, Any]], object]  # changes the joint of a document


def spoilt(path: Path, spoil: Spoil, made: Path) -> Path:
    """A results file of which the joint is changed."""
    whole = json.loads(path.read_text(encoding="utf-8"))
    spoil(whole["joints"][HOSTILE])
    made.write_text(json.dumps(whole), encoding="utf-8")
    return made


def plus(joint: dict[str, Any], **fields: object) -> dict[str, Any]:
    """Its fit of direction +, with some fields others."""
    fit: dict[str, Any] = joint["static"]["+"]
    fit.update(fields)
    return fit


def alpha(joint: dict[str, Any], **numbers: object) -> None:
    """Other numbers of alpha_0 in direction +."""
    plus(joint)["parameters"]["alpha_0"].update(numbers)


def every(joint: dict[str, Any], **numbers: object) -> None:
    """Other numbers of every parameter of every static fit."""
    for p in (p for fit in joint["static"].values() for p in fit["parameters"].values()):
        p.update(numbers)


def covariance(joint: dict[str, Any], *rows: Sequence[float | None]) -> None:
    """Of both directions."""
    for fit in joint["static"].values():
        fit["covariance"] = [list(row) for row in rows]


def many(joint: dict[str, Any], count: int) -> None:
    """So many parameters, none of them free."""
    p = plus(joint)["parameters"]["alpha_0"]
    plus(joint, parameters={f"p{k}": p for k in range(count)}, names=[], covariance=[])


def warned(joint: dict[str, Any], **fields: object) -> None:
    """One warning, with some fields others."""
    joint["warnings"] = [
        {"code": "a", "severity": "note", "message": "It sticks.", "numbers": {}, "effect": {}} | fields
    ]


REFUSED: dict[str, tuple[Spoil, str]] = {
    "truth for a number": (lambda x: alpha(x, value=True), "alpha_0.value: Input should be a valid number"),
    "infinite value": (lambda x: alpha(x, value="inf"), "alpha_0.value: Input should be a valid number"),
    "no number for a bound": (lambda x: alpha(x, interval=["nan", 1.0]), "alpha_0.interval.0"),
    "huge value": (lambda x: alpha(x, value=1e308), "is beyond 1e+60"),
    "tiny error": (lambda x: alpha(x, standard_error=1e-308), "below 1e-60"),
    "negative error": (lambda x: alpha(x, standard_error=-1.0), "a standard error is negative"),
    "number of 400 digits": (lambda x: alpha(x, value=10**400), "Out of range float"),
    "freedom below zero": (lambda x: plus(x, degrees_of_freedom=-3), "a fit has -3 degrees of freedom"),
    "empty joint": (lambda x: x.clear(), "kind: Field required"),
    "covariance without rows": (covariance, "a covariance is not of the 4 parameters"),
    "unit with an escape": (lambda x: alpha(x, unit="\x1b]0;N*m"), "U+001B, a control character"),
    "direction with a line end": (lambda x: x["static"].update({"a\nb": plus(x)}), "U+000A, a control character"),
    "unit that is a book": (lambda x: alpha(x, unit="a" * 10**6), "has 1000000 characters, more than 400"),
    "many parameters": (lambda x: many(x, 50_000), "parameters of a joint, more than 400"),
    "many numbers": (lambda x: x.update(assumptions=[""] * 1_000_001), "commas, more than 1000000"),
    "many empty fits": (lambda x: x["static"].update({f"s{k}": {} for k in range(90_000)}), "of its entries are wrong or missing"),
    "many objects": (lambda x: x.update(truth={f"s{k}": {} for k in range(200_000)}), "objects, more than 200000"),
    "a warning without numbers": (lambda x: warned(x, numbers=[1]), "warnings.0.numbers: Input should be"),
    "ragged covariance": (lambda x: covariance(x, [1.0], [1.0, 2.0]), "its rows are not of one length"),
    "a truth of other parameters": (lambda x: x.update(truth={"+": {"alpha_0": 1.0}}), "expected alpha_0, alpha_1"),
    "deep": (lambda x: warned(x, numbers={"a": json.loads(900 * "[" + 900 * "]")}), "recursion limit"),
}  # fmt: skip  # a table
COMPARED: dict[str, Spoil] = {
    "nothing known": lambda x: every(x, value=None, standard_error=None, interval=None),
    "no fit": lambda x: x.update(static={}),
    "all zero": lambda x: every(x, value=0, standard_error=0, interval=[0, 0]),
    "largest": lambda x: every(x, value=9e59, standard_error=9e59, interval=[1e-300, 1e308]),
    "smallest": lambda x: every(x, value=2e-60, standard_error=2e-60, interval=[-1e-300, 2e-60]),
    "open": lambda x: every(x, interval=["-inf", "inf"]),
    "unknown covariance": lambda x: covariance(x, *[[None] * 4] * 4),
    "tiny covariance": lambda x: covariance(x, *([5e-324 if i == j else 1e119 for i in range(4)] for j in range(4))),
    "lopsided covariance": lambda x: covariance(x, [1, 2, 0, 0], [0.5, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]),
    "much freedom": lambda x: plus(x, degrees_of_freedom=10**17, n=10**17),
    "no freedom": lambda x: plus(x, degrees_of_freedom=0, n=-1),
    "free parameters that are none": lambda x: plus(x, names=["a", "b", "c", "d"]),
    "one free parameter four times": lambda x: plus(x, names=["alpha_0"] * 4),
    "template for a name": lambda x: plus(x, parameters={r"\g<0>\q$\undefined{": plus(x)["parameters"]["alpha_0"]}),
    "as many parameters as can be": lambda x: many(x, 390),
}


def test_a_bad_file_is_one_sentence_and_nothing_is_written(
    sessions: Files, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is no results file, holds other joints, is missing, too large, a folder or a pipe: exit 2, one short line that names it, and no page."""
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "file").write_text("mine")
    os.mkfifo(tmp_path / "pipe")
    wrong, good = [], sessions[1].read_text(encoding="utf-8")

    def refused(second: Path, named: str, output: str = "out") -> None:
        ran = run("compare", sessions[0], second, "-o", tmp_path / output)
        short = ran.code == 2 and len(ran.said) == 1 and ran.err.startswith("bristle: ") and len(ran.err) < 600
        if not short or named not in ran.err or ran.out:
            wrong.append((named, ran))

    name = json.dumps(HOSTILE)
    for text, named in (
        ("{]", "is not a results file"),
        ('{"schema": NaN}', "Out of range float"),
        ('{"schema": ' + "9" * 5000 + "}", "is not a results file"),
        (good.replace("bristle-results/3", "bristle-results/1"), "is not a results file of schema bristle-results/3 (schema"),
        (good.replace(name, '"elbow"'), "no joint is in both sessions: one has <script>"),
        (good.replace(name, '"\\u001b[1mwrist"'), "U+001B, a control character"),
        (good.replace('"revolute"', '"prismatic"', 1), "is revolute in one session and prismatic in the other"),
    ):  # fmt: skip  # a table
        assert text != good
        (tmp_path / "b.json").write_text(text, encoding="utf-8")
        refused(tmp_path / "b.json", named)
    refused(
        spoilt(sessions[1], lambda x: alpha(x, unit="furlong"), tmp_path / "b.json"),
        "alpha_0+ is in N*m and in furlong",
    )
    refused(tmp_path / "none.json", "none.json")
    refused(tmp_path, str(tmp_path))
    refused(tmp_path / "binary", "is not a results file")
    refused(tmp_path / "pipe", "pipe: is a pipe; expected a file")
    refused(sessions[1], "file", "file")
    monkeypatch.setattr(document, "LARGEST", 1000)
    refused(sessions[1], "is larger than 1000 bytes; expected a results file")
    assert wrong == []
    assert set(tree(tmp_path)) == {"b.json", "binary", "file", "pipe"}


@pytest.mark.slow
def test_any_numbers_are_compared_or_refused(sessions: Files, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Numbers beyond all measure, in one session and in both: a result (of both a page), or one short sentence; no warning."""
    wrong = []
    for what, spoil in COMPARED.items():
        a, b = (spoilt(path, spoil, tmp_path / f"{k}.json") for k, path in enumerate(sessions))
        made, one = (bristle.report_of(bristle.compare(first, b)) for first in (a, sessions[0]))
        whole = made.html().endswith("</html>")
        wrong += [] if whole and "nan" not in made.text() + one.text() else [f"{what}: {made.text()[:200]}"]
    for what, (spoil, named) in REFUSED.items():
        sentence = ""
        try:
            bristle.compare(sessions[0], spoilt(sessions[1], spoil, tmp_path / "bad.json"))
        except bristle.InputError as error:
            sentence = str(error)
        if named not in sentence or "\n" in sentence or len(sentence) > 600 + len(str(tmp_path)):
            wrong.append(f"{what}: {sentence[:200]}")
        if not sentence.endswith("expected a results.json that bristle wrote"):
            wrong.append(f"{what} ends: {sentence[-200:]}")
    assert not wrong, "\n".join(wrong)
    # as many joints as a file may have end in a page, with a figure for each of the first ones and a table for all
    monkeypatch.setattr("bristle.page.page.render", lambda _: (b"<svg />", b""))
    for k, path in enumerate(sessions):
        document = json.loads(path.read_text(encoding="utf-8"))
        document["joints"] = {f"joint {j}": document["joints"][HOSTILE] for j in range(100)}
        (tmp_path / f"{k}.json").write_text(json.dumps(document), encoding="utf-8")
    ran = run("compare", tmp_path / "0.json", tmp_path / "1.json", "-o", tmp_path / "out")
    assert (ran.code, ran.said) == (0, [])
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert page.count("<h2>joint ") == 100
    assert page.count("<svg ") == 30
    assert "Figures show the first 30 joints; the tables contain all." in page


@pytest.fixture(scope="module")
def known() -> Iterator[None]:
    with registered():
        yield


@cache
def session_of_law(law: str, seed: int = 0, **changed: float) -> Session:
    """Points of a joint of a law, with some of its parameters others, fitted under it."""
    return session_of([points(law, truth_of(law)._replace(**changed), seed).joint])


def names(found: Comparison, *, compared: bool) -> set[str]:
    """The parameters that were compared, or those that could not be."""
    return {str(c.parameter) for c in found.changes if (c.changed is not None) is compared}


@pytest.mark.usefixtures("known")
@pytest.mark.parametrize("law", [DRAG, EXPONENT, OUTSIDE])
def test_sessions_of_one_law_are_compared_in_all_its_parameters(law: str) -> None:
    """All that the law estimates is compared, alone and as a set, and nothing changed; v_end is no estimate."""
    found = compare(session_of_law(law), session_of_law(law, seed=1))
    own = {"alpha_0", "alpha_1", "alpha_2", *law_named(law).shape_parameters, *law_named(law).coefficients}
    assert names(found, compared=True) == own
    assert not names(found, compared=False)
    assert {str(name) for name in found.sets[0].names} == own
    assert not any(c.changed for c in found.changes)
    assert not any(x.code == "laws-differ" for x in found.warnings)


@pytest.mark.usefixtures("known")
def test_what_is_compared_under_two_laws(tmp_path: Path) -> None:
    """Where alpha_3 alone is another, it changed, by as much."""
    found = compare(session_of_law(DRAG), session_of_law(DRAG, seed=1, alpha_3=-0.004))
    (change,) = (c for c in found.changes if c.parameter.name == "alpha_3")
    assert change.changed
    assert change.difference == pytest.approx(0.004, rel=0.2)
    # no parameter of the curve means the same in two laws, even of one peak; sigma_0, sigma_1 and the inertia always do
    a, b = law_named("lorentzian"), law_named(DRAG)
    assert all(alike(name, a, b) for name in ("sigma_0", "sigma_1", "inertia", "offset"))
    assert not any(alike(name, a, b) for name in ("alpha_0", "alpha_1", "alpha_2", "alpha_3", "v_s"))
    assert not alike("delta", law_named("paper"), law_named(EXPONENT))
    assert alike("alpha_0", b, b)
    # so of two results files nothing is compared; one sentence says so and what to do, on the page too
    paths = [write(tmp_path / stem, speeds(), stem=stem) for stem in ("first", "second")]
    paths[1].write_text(paths[1].read_text() + f"fit: {{law: {DRAG}}}\n")
    files = [path.parent / "results.json" for path in paths]
    for path, file in zip(paths, files, strict=True):
        file.write_text(bristle.identify(path).to_json(), encoding="utf-8")
    found = bristle.compare(*files)
    reasons = {str(c.verdict) for c in found.changes if c.changed is None}
    assert reasons == {"Not comparable: it means another thing in the law of each session."}
    assert not names(found, compared=True)
    (told,) = (x for x in found.warnings if x.code in ("laws-differ", "models-differ"))
    assert told.code == "laws-differ"
    assert f"law: {DRAG}" in str(told)
    assert "has the friction law gaussian" in page_text(bristle.report_of(found).write(tmp_path / "page"))

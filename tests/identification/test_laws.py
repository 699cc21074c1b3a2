from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as options
from hypothesis import strategies as st

import bristle
from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.estimation.autocorrelation import inflation
from bristle.identification.comparison import Comparison
from bristle.identification.dynamic.fit import fit_tracking
from bristle.identification.dynamic.problem import dynamic_problem
from bristle.identification.identify import identify_joint
from bristle.identification.law_comparison import compare_laws
from bristle.identification.measured import measure
from bristle.identification.model_selection import COULOMB, LUGRE, STRIBECK, VISCOUS, compared
from bristle.identification.results import Joint
from bristle.identification.static.crosscheck import full_fit
from bristle.identification.static.fit import estimate_static
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import Regression, from_points, from_records
from bristle.identification.static.profiles import with_best_shape
from bristle.model.functions import steady_torque_function
from bristle.model.laws import registry
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.laws.registry import competing, law_named
from bristle.model.parameters import (
    Lugre,
    Pair,
    Stribeck,
    lugre_of,
    static_fields_of,
    static_of,
)
from bristle.model.vectorize import evaluate

from ..conftest import Ran, present, run
from .conftest import GRIPPER, OTHER, TONES, accepted, by_name, codes, curve, holds, moved, points_file, tones

WIDE = np.geomspace(0.15 * GRIPPER.v_s, 11 * GRIPPER.v_s, 40)
SPEEDS = np.geomspace(0.15 * GRIPPER.v_s, 0.8, 22)
LAWS = tuple(law.name for law in competing())
STEP = 2e-3


def truth_of(law: Law, **own: float) -> Stribeck[float]:
    values = {**GRIPPER._asdict(), "alpha_3": 0.02, "delta": 1.4, FASTEST: 0.8, **own}
    return static_of(law)(**{name: values[name] for name in static_fields_of(law)})


def torques(p: Stribeck[float], v: Array, noise: float, seed: int | np.random.Generator) -> Array:
    """Steady torques with white noise, of a share of alpha_0."""
    clean: Array = evaluate(steady_torque_function(p.law), v, *p)[0]
    return clean + noise * p.alpha_0 * np.random.default_rng(seed).standard_normal(v.size)


def chosen(p: Stribeck[float], noise: float, seed: int) -> Comparison:
    """The laws side by side on 22 points."""
    T = torques(p, SPEEDS, noise, seed)

    def pose(law: Law) -> list[Regression]:
        return [from_points(SPEEDS, T, ("both",), law=law)]

    return present(compare_laws(pose, GAUSSIAN))


def test_laws_are_fitted_exactly_and_by_two_routes() -> None:
    """From exact torques each law's fit gives its own parameters to 1e-4, the exponent too, and the fastest speed as it was."""
    for name in (*LAWS, "free-exponent", "free-exponent+quadratic"):
        law = law_named(name)
        p = truth_of(law, v_end=float(WIDE.max()))
        problem = from_points(WIDE, torques(p, WIDE, 1e-9, 0), ("both",), law=law)
        found = estimate_static(problem, FitOptions(law=name, set_up="as-written"), "revolute")
        assert set(found) == set(static_fields_of(law))
        for parameter, e in found.items():
            assert e.value == pytest.approx(getattr(p, parameter), rel=1e-4), parameter
    # IPOPT on the law's own expression, from random starts, finds no lower cost than the grid, and the same parameters
    for name in LAWS:
        law = law_named(name)
        problem = from_points(SPEEDS, torques(truth_of(law), SPEEDS, 0.01, 3), ("both",), law=law)
        solution = solve(problem, default_range(SPEEDS))
        ends = full_fit(problem, default_range(SPEEDS), starts=4)
        costs = [float(np.sum(problem.residuals(end) ** 2)) for end in ends]
        assert solution.cost <= min(costs) * (1 + 1e-9)
        np.testing.assert_allclose(ends[int(np.argmin(costs))], solution.theta, rtol=1e-4)


@pytest.mark.slow
def test_intervals_hold_the_truth() -> None:
    """Of 40 noisy sets a law's 95 % intervals hold the truth in 85 to 100 %, parameter by parameter (of 400: benchmarks/laws.py)."""
    for name in ("exponential", "lorentzian+quadratic", "free-exponent"):
        law, rng = law_named(name), np.random.default_rng(0)
        p, inside = truth_of(law, v_end=float(WIDE.max())), dict[str, list[bool]]()
        for _ in range(40):
            problem = from_points(WIDE, torques(p, WIDE, 0.005, rng), ("both",), law=law)
            for parameter, e in estimate_static(problem, FitOptions(law=name, set_up="as-written"), "revolute").items():
                if e.interval is not None:
                    inside.setdefault(parameter, []).append(holds(e.interval, getattr(p, parameter)))
        assert set(inside) == set(static_fields_of(law)) - {FASTEST}
        shares = {k: np.mean(held) for k, held in inside.items()}
        assert min(shares.values()) >= 0.85, (name, shares)


def test_laws_that_compete() -> None:
    """Where the paper's law is the truth it is kept in 60 sets of 60, at small noise and at large."""
    for noise in (0.005, 0.05):
        kept = [chosen(truth_of(GAUSSIAN), noise, seed).chosen.name for seed in range(30)]
        assert kept.count("gaussian") >= 29
    # a strong v abs(v) is chosen in every one of 30 sets at large noise, and a weak one in nine of ten at small noise
    law = law_named("gaussian+quadratic")
    strong = [chosen(truth_of(law, alpha_3=1.5), 0.05, seed).chosen.name for seed in range(30)]
    weak = [chosen(truth_of(law, alpha_3=0.02), 0.005, seed).chosen.name for seed in range(30)]
    assert sum(name.endswith("+quadratic") for name in strong) == 30
    assert sum(name.endswith("+quadratic") for name in weak) >= 27
    # the lowest BIC is zero, and one law is in force
    found = chosen(truth_of(law_named("gaussian+quadratic"), alpha_3=1.5), 0.05, 1)
    assert min(row.bic for row in found.rows) == 0.0
    assert [row.name for row in found.rows] == [law.name for law in competing()]
    # the cost at the exponent that is found is no higher than at any other of 60, and v_s is free at each
    law = law_named("free-exponent")
    problem = from_points(SPEEDS, torques(truth_of(law), SPEEDS, 0.01, 5), ("both",), law=law)
    found = with_best_shape(problem, default_range(SPEEDS))
    best = solve(found, default_range(SPEEDS)).cost
    shapes = (replace(found, shape=(delta,)) for delta in np.geomspace(0.5, 4.0, 60).tolist())
    others = [solve(other, default_range(SPEEDS)).cost for other in shapes]
    assert best <= min(others) * (1 + 1e-6)
    # a strong bend makes strays of the paper's law, which are its evidence: it is found in nearly every set
    p = truth_of(law_named("lorentzian+quadratic"), alpha_3=-0.02)
    found = [bristle.fit(SPEEDS, torques(p, SPEEDS, 0.005, seed)).joint for seed in range(8)]
    wanted = [joint.laws.chosen.name for joint in found if joint.laws is not None]
    assert sum("quadratic" in law for law in wanted) >= 7
    assert any(joint.static["+"].strays for joint in found)
    # one torque half as large again is a stray of every law: with it left out, the paper's law is kept
    T = torques(GRIPPER.stribeck, SPEEDS, 0.005, 3)
    T[12] *= 1.5
    laws = present(bristle.fit(SPEEDS, T).joint.laws)
    assert laws.n == SPEEDS.size - 1
    assert laws.chosen.name == GAUSSIAN.name


def both_ways(folder: Path, p: Stribeck[float], noise: float, fit: str = "") -> Path:
    """An experiment of 44 points in both directions."""
    v = np.concatenate([SPEEDS, -SPEEDS])
    return points_file(folder, v, torques(p, v, noise, 7), fit)


def test_a_file_gets_the_law_that_it_asks_for(tmp_path: Path) -> None:
    """`paper` says which line the data want; `auto` and the law's name fit it, to the same numbers; results.json keeps it."""
    bent = truth_of(law_named("gaussian+quadratic"), alpha_3=-0.02)
    paper = bristle.identify(both_ways(tmp_path, bent, 0.002)).joint()
    (advice,) = [w for w in paper.warnings if w.code == "other-law"]
    assert (paper.law, advice.numbers["law"]) == (GAUSSIAN, "gaussian+quadratic")
    auto = bristle.identify(both_ways(tmp_path, bent, 0.002, "law: auto"))
    named = bristle.identify(both_ways(tmp_path, bent, 0.002, "law: gaussian+quadratic")).joint()
    assert auto.joint().law.name == named.law.name == "gaussian+quadratic"
    assert not any(w.code in {"other-law", "lacks-a-term"} for w in named.all_warnings())
    for d in "+-":
        one, other = auto.joint().static[d], named.static[d]
        assert {n: e.value for n, e in one.parameters.items()} == {n: e.value for n, e in other.parameters.items()}
        low, high = one.parameters["alpha_3"].interval or (0.0, 0.0)
        assert low <= -0.02 <= high < 0
        assert one.parameters[FASTEST].value == pytest.approx(0.8)
        assert "curve-held" in codes(one.parameters[FASTEST].warnings)
    assert "which the data chose" in auto.joint().settings["law"]
    (tmp_path / "results.json").write_text(auto.to_json(), encoding="utf-8")
    again = bristle.read_results(tmp_path / "results.json").joint()
    assert (again.law, again.laws) == (auto.joint().law, auto.joint().laws)
    assert again.static["+"].values() == auto.joint().static["+"].values()
    # so does a law by name that the data do not want
    other = bristle.identify(both_ways(tmp_path, truth_of(GAUSSIAN), 0.002, "law: exponential")).joint()
    (advice,) = [w for w in other.warnings if w.code == "other-law"]
    assert (advice.numbers["own"], advice.numbers["law"]) == ("exponential", "gaussian")
    # `--laws` prints a row a law, which one is fitted, which is wanted, and one sentence
    path = both_ways(tmp_path, truth_of(law_named("lorentzian")), 0.002)
    ran: Ran = run("identify", path, "--laws")
    assert ran.code == 0
    table = ran.out[ran.out.index("[[Which friction law?]]") :]
    assert all(name in table for name in LAWS)
    assert "The data favour lorentzian: its BIC is" in " ".join(table.split())
    # a law that there is not, or a term that it has already, is one sentence with what can be written
    wrong = [
        ("law: gauss", r"got 'gauss'; expected paper, auto, coulomb-viscous, or one of gaussian \| exponential"),
        ("law: gaussian+gaussian", r"each perhaps with \+quadratic"),
        ("law: 3", "law"),
        ("law: lorentzian+quadratic, regressors: [quadratic]", "the same term"),
    ]
    cases = [("fit: {}", f"fit: {{{fit}}}", says) for fit, says in wrong]
    assert accepted(path, path.read_text(encoding="utf-8"), cases) == []


def test_a_law_from_outside_is_fitted_reported_and_explored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A peak registered here alone, with a parameter of its own, wins under `auto`, and is on the pages that follow."""
    monkeypatch.setattr(registry, "_PARTS", dict(registry._PARTS))
    monkeypatch.setattr(registry, "_COMPETE", set(registry._COMPETE))
    drop = bristle.OwnParameter(name="drop", symbol="k", units=("1", "1"), searched=(0.5, 3.0))
    flat = bristle.Peak(
        name="flat", title="flat-top", shape=lambda v, v_s, drop: (1 + (v / v_s) ** 4) ** -drop, own=(drop,), reach=2.0
    )
    bristle.register_law(flat)
    path = both_ways(tmp_path, truth_of(law_named("flat"), drop=0.75), 0.001, "law: auto")
    results = bristle.report(path, folder=tmp_path / "report")
    found = results.joint()
    assert found.law.name == "flat"
    assert present(found.laws).chosen.name == "flat"
    assert holds(found.static["+"].parameters["alpha_0"].interval, GRIPPER.alpha_0)
    pages = "".join(p.read_text(encoding="utf-8") for p in (tmp_path / "report").rglob("*.html"))
    assert "flat-top" in pages
    assert "flat" in bristle.explore(results).html


def test_moving_runs_choose_their_law() -> None:
    """From a motion whose slow speeds are all presliding `auto` takes the true law, and its parameters are the truth's to 4 %."""
    law, truth = law_named("lorentzian+quadratic"), {**GRIPPER._asdict(), "alpha_3": -0.012, FASTEST: 10.0}
    t = np.arange(0.0, 20.0, STEP)
    v = tones(t, ((0.5, 0.31), (0.25, 0.9), (0.05, 3.1)))
    run = moved(v, STEP, lugre_of(law)(**truth), 2e-4, inertia=2e-3)
    fit = bristle.fit_dynamic(
        t=t, position=np.cumsum(v) * STEP, torque=present(run.torque), velocity=v, directions="symmetric", law="auto"
    )
    assert fit.joint.law == law
    wrong = {
        name: fit.params[name]
        for name, x in truth.items()
        if name in fit.params and abs(fit.params[name] / x - 1) > 0.04
    }
    assert {name: x for name, x in wrong.items() if name != FASTEST} == {}
    assert present(fit.joint.laws).data == "moving runs"


FLAT = Lugre(0.02, 0.0, 0.04, 1.0, 6.0, 0.02)
MODEL_SPEEDS = np.geomspace(0.015, 0.8, 12)
BOTH = np.concatenate([MODEL_SPEEDS, -MODEL_SPEEDS])


def on_points(folder: Path, plus: Lugre[float], minus: Lugre[float], v: Array, fit: str = "", seed: int = 0) -> Joint:
    """The joint identified from points of these sets, with noise."""
    torque = np.where(v > 0, curve(v, plus), curve(v, minus)) + 2e-4 * np.random.default_rng(seed).standard_normal(
        v.size
    )
    return identify_joint(measure(points_file(folder, v, torque, fit)))


@pytest.mark.parametrize("symmetric", [False, True])
def test_linear_models_have_the_criteria_by_their_definitions(tmp_path: Path, symmetric: bool) -> None:
    """For each linear model: rms by lstsq, BIC from the maximised Gaussian likelihood."""
    v, fit = BOTH, "directions: symmetric" if symmetric else ""
    joint = on_points(tmp_path, GRIPPER, OTHER, v, fit)
    (found,) = joint.models
    torque = np.concatenate([x.torque for x in joint.static.values()])
    sides = [np.ones(v.size)] if symmetric else [v > 0, v < 0]
    n, scores = v.size, []
    for model, terms in ((COULOMB, [np.sign(v)]), (VISCOUS, [np.sign(v), v])):
        columns = np.stack([x * side for side in sides for x in terms], axis=1)
        own, rest = present(found.row(model)), torque - columns @ np.linalg.lstsq(columns, torque)[0]
        assert own.rms == pytest.approx(np.sqrt(np.mean(rest**2)), rel=1e-9)
        assert own.parameters == columns.shape[1]
        variance, k = np.mean(rest**2), columns.shape[1] + 1
        likelihood = float(np.sum(-(rest**2) / (2 * variance) - 0.5 * np.log(2 * np.pi * variance)))
        scores.append(own.bic - (k * np.log(n) - 2 * likelihood))
    assert scores[0] == pytest.approx(scores[1], abs=1e-6)
    # a model with more terms leaves no more
    assert [row.name for row in found.rows] == [COULOMB, VISCOUS, STRIBECK]
    left = [row.rms for row in found.rows]
    assert left == sorted(left, reverse=True)
    assert min(row.bic for row in found.rows) == 0
    assert found.effective == found.n == n


def test_the_model_that_made_the_data_is_advised(tmp_path: Path) -> None:
    """From clear data, of one direction or two, alike or not; of few points no model with more terms than they tell is fitted."""
    cases = [(GRIPPER, OTHER, BOTH, STRIBECK), (GRIPPER, GRIPPER, MODEL_SPEEDS, STRIBECK)]
    cases += [(FLAT, FLAT._replace(alpha_2=0.06), BOTH, VISCOUS), (FLAT, FLAT, MODEL_SPEEDS, VISCOUS)]
    found = [on_points(tmp_path, plus, minus, v).models[0] for plus, minus, v, _ in cases]
    assert [x.chosen.name for x in found] == [model for *_, model in cases]
    assert [x.sentence.numbers["model"] for x in found] == [model for *_, model in cases]
    few = [np.array([0.1, 0.3, 0.6]), np.array([0.1, 0.1 + 1e-9, 0.1 + 2e-9])]
    fitted = [[row.name for x in on_points(tmp_path, FLAT, FLAT, v).models for row in x.rows] for v in few]
    assert fitted == [[COULOMB, VISCOUS], [COULOMB]]


@given(seed=st.integers(0, 10_000), alpha_1=st.sampled_from([0.0, 3e-4, 6e-4, 2e-3]))
@options(max_examples=12, deadline=None)
def test_advice_never_contradicts_the_fit(tmp_path_factory: pytest.TempPathFactory, seed: int, alpha_1: float) -> None:
    """Whatever the data: the advised model has a Stribeck term if and only if the fit keeps one, and is the best of those by BIC."""
    p = GRIPPER._replace(alpha_1=alpha_1)
    joint = on_points(tmp_path_factory.mktemp("x"), p, p, MODEL_SPEEDS, seed=seed)
    (found,) = joint.models
    kept = joint.static["+"].parameters["alpha_1"].value is not None
    assert (found.chosen.name == STRIBECK) == kept
    assert found.chosen.bic == min(row.bic for row in found.rows if row.candidate)


def test_models_on_a_moving_run() -> None:
    """LuGre made the run: it is advised, as it was fitted, unless the fit shows no sigma_0; BIC counts n / inflation equations."""
    run = moved(tones(np.arange(0.0, 6.0, STEP), TONES[:4]), STEP, Pair(GRIPPER, OTHER), 2e-5)
    sides, asked = ("+", "-"), ("inertia",)
    alone = fit_tracking(
        dynamic_problem([run], sides, asked, 2, None), by_name(Pair(GRIPPER, OTHER)), "revolute", search=False
    ).fit
    whole = from_records([run], sides, asked, 2)[0]
    found = present(compared(whole, {}, alone))
    assert [row.name for row in found.rows] == [COULOMB, VISCOUS, STRIBECK, LUGRE]
    *others, best = found.rows
    assert best.chosen
    assert best.parameters == len(alone.names) + 1
    assert best.rms == pytest.approx(alone.rms, rel=1e-12)
    assert best.rms < min(row.rms for row in others) / 10
    assert found.effective == pytest.approx(found.n / inflation(alone.residuals))
    a, b, n = *others[1:], found.effective
    more = 2 * n * np.log(b.rms / a.rms) + (b.parameters - a.parameters) * np.log(n)
    assert b.bic - a.bic == pytest.approx(more, abs=1e-6)
    blind = {n: replace(e, value=None) if n.name == "sigma_0" else e for n, e in alone.parameters.items()}
    judged = present(compared(whole, {}, replace(alone, parameters=blind)))
    assert judged.chosen.name == STRIBECK
    assert f"{LUGRE} -" in str(judged.sentence)

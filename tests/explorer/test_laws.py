import json
from collections.abc import Iterator
from dataclasses import replace
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

import bristle
from bristle.control.adaptation import LAWS
from bristle.estimation.linear import bounded_least_squares
from bristle.identification.results import Joint
from bristle.model import functions
from bristle.model.law import is_passive
from bristle.model.laws import registry
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law, OwnParameter, Peak
from bristle.model.laws.registry import competing, law_named, register_law
from bristle.model.parameters import Pair, ParameterName, least_of, lugre_of, unit
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate
from bristle.questions.explorer import engine
from bristle.questions.explorer.data import explored, ranges
from bristle.questions.explorer.page import Explorer, explorer

from ..conftest import TRUTH, experiment, speeds
from ..simulation.joints import joint as moving_joint
from ..simulation.joints import joint_loop, tracked, values_of
from .conftest import Node
from .test_browser import VIEWS, Tab
from .test_engine import CELLS, SPEEDS, TIME, Engine, check_loops, floats, of
from .test_page import known_of

OWN = {"delta": 1.3, "alpha_3": -0.004, FASTEST: 0.8, "sharpness": 2.5}
"""What the tests' sets have beside `TRUTH`, by name."""
BENT = law_named("lorentzian+quadratic")
SHARPNESS = OwnParameter(name="sharpness", symbol="<b>k</b>", units=("1", "1"), searched=(0.5, 6.0))
"""With a symbol that is HTML."""


def flat_top(v: Any, v_s: Any, sharpness: Any) -> Any:
    """1 / (1 + (v**2 / v_s**2)**sharpness), whose top is the flatter the larger the exponent."""
    return 1 / (1 + ca.exp(sharpness * ca.log(v**2 / v_s**2 + 1e-100)))


@pytest.fixture(scope="module")
def own_law() -> Iterator[Law]:
    """A law of a peak that is registered here, with a shape parameter of its own."""
    peak = Peak(name="flat-top", title="flat-top", shape=flat_top, own=(SHARPNESS,), reach=2.0)
    register_law(peak, compete=False)
    yield law_named("flat-top+quadratic")
    del registry._PARTS[peak.name]


@pytest.fixture(scope="module", params=[*(law.name for law in competing()), "free-exponent+quadratic", "own"])
def law(request: pytest.FixtureRequest) -> Law:
    """The paper's law, every one that competes with it, one with all that a law may have, and one of the user's own."""
    own: Law = request.getfixturevalue("own_law")
    return own if request.param == "own" else law_named(request.param)


@pytest.fixture(scope="module")
def js(law: Law, node: Node) -> Engine:
    """A script that knows the law beside the paper's."""
    return Engine(node, engine.script(laws=(GAUSSIAN, law)))


def pair_with(law: Law, **negative: float) -> Pair[float]:
    """`TRUTH` with what the law has beside it, the negative direction otherwise: its viscous friction does not bend down."""
    kind = lugre_of(law)
    values = TRUTH._asdict() | {name: OWN[name] for name in law.more}
    other = {"alpha_0": 0.021, "v_s": 0.06, "sigma_0": 9.0} | ({"alpha_3": 0.002} if law.terms else {}) | negative
    return Pair(kind(**values), kind(**(values | other)))


def test_every_function_of_a_law_is_that_of_python(law: Law, js: Engine) -> None:
    """In both directions, beyond the fastest measured speed too; it is told from where viscous friction is held."""
    pair = pair_with(law)
    acting = [np.where(SPEEDS < 0, n, p) for p, n in zip(*(p.stribeck for p in pair), strict=True)]
    (T,) = evaluate(functions.steady_torque_function(law), SPEEDS, *acting)
    np.testing.assert_allclose(floats(js("steady", SPEEDS, of(pair))), T, rtol=1e-12)
    for sigma_1 in (0.0, 0.05, 0.12, 0.2):
        p = pair.positive._replace(sigma_1=sigma_1)
        assert js("isPassive", p._asdict(), law.name) == bool(is_passive(p))
    held = [js("heldFrom", p._asdict(), law.name) for p in pair]
    assert held == [OWN[FASTEST] if law.terms else "Infinity", "Infinity"]
    # at its shape, where some of the coefficients meet their bound too; one with a sign has none, and the cost is that of `cost`
    rng, begun = np.random.default_rng(1), pair_with(law).positive
    v = np.concatenate([speeds(), 0.5 * speeds()])
    names = ("alpha_0", "alpha_1", "alpha_2", *law.coefficients)
    lower = np.array([least_of(name) for name in names])
    wholes = (
        (0.02, 0.005, 0.04, -0.01), (0.02, 0.0, 0.0, 0.0), (0.0, 0.03, 0.01, 0.01), (0.02, -0.01, 0.04, 0.01),
        (0.02, 0.01, -0.02, -0.02), (-0.1, 0.02, 0.3, 0.1),
    )  # fmt: skip  # a table
    level, *viscous = evaluate(functions.linear_shapes_function(law), v)
    for v_s, true in product((0.01, begun.v_s, 0.4), wholes):
        pair = Pair(begun._replace(v_s=v_s), begun)
        (peak,) = evaluate(
            functions.stribeck_shape_function(law), v, *(getattr(pair.positive, name) for name in law.shape_parameters)
        )
        design = np.stack([level, peak, *viscous], axis=1)
        T = design @ np.array(true[: len(names)]) + 1e-3 * rng.standard_normal(v.size)
        theirs = bounded_least_squares(design, T, lower)
        got = js("refit", v, T, law.name, pair.positive._asdict())
        ours = np.array([got[name] for name in names])
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-13)
        p = pair.positive._replace(**dict(zip(names, ours.tolist(), strict=True)))
        cost = float(((T - design @ ours) ** 2).sum())
        assert (got["cost"], js("cost", v, T, of(Pair(p, p)))) == pytest.approx((cost, cost), rel=1e-11)
    # of sets that differ between the directions, fast and in presliding, to 1e-9 of the largest torque
    pair = pair_with(law)
    for v in (
        1.2 * np.cos(np.pi * TIME[:4001]),
        2e-3 * np.sin(4.4 * TIME[:4001]) + 1e-3 * np.sin(20 * TIME[:4001] + 1),
    ):
        theirs, ours = rollout(v, 1e-3, pair), js("rollout", v, 1e-3, of(pair))
        for key in ("z", "torque"):
            expected = getattr(theirs, key)
            np.testing.assert_allclose(floats(ours[key]), expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    # plant and model of the law, from the wrong start
    pair = pair_with(law)
    loop = joint_loop(plant=pair, model=Pair(*(p._replace(alpha_0=0.9 * p.alpha_0) for p in pair)))
    assert [*check_loops(js, loop, 2.0)] == ["none", "fixed", *LAWS]


def test_a_page_knows_its_joints_laws_alone(several: Explorer) -> None:
    """What other laws take is printed where a joint has them alone."""
    text = engine.script()
    assert text.count('LAWS["') == 1
    assert text.count("function steadyTorque(") == 1
    assert engine.script(laws=(GAUSSIAN, law_named("lorentzian"))).count("function steadyTorque(") == 2
    # where its value is zero too; the exponent's goes as far as it is searched, and the fastest speed has none
    law = law_named("free-exponent+quadratic")
    p: Any = pair_with(law).positive
    for alpha_3, high in ((-0.004, 0.016), (0.0, 4 * p.alpha_0 / 0.64)):
        found = ranges(law, [p._replace(alpha_3=alpha_3)._asdict()], 0.8)
        assert [*found] == [name for name in p._fields if name != FASTEST]
        assert found["alpha_3"] == {
            "low": pytest.approx(-high), "high": pytest.approx(high), "log": False, "least": "-inf",
        }  # fmt: skip  # a list of values
        assert found["delta"] == {"low": 0.5, "high": 4.0, "log": True, "least": 0.0}
        assert (found["alpha_2"]["low"], found["alpha_2"]["least"]) == (0.0, 0.0)
    # parameters, units and truth by joint; no symbol of a law is HTML
    paper, bent, own = known_of(several)["joints"]
    assert [joint["law"] for joint in (paper, bent, own)] == ["gaussian", "lorentzian+quadratic", "flat-top+quadratic"]
    assert paper["law_title"] == ""
    assert "Lorentzian peak" in bent["law_title"]
    assert bent["truth_law"] == "gaussian"
    assert [*own["sets"][0]["values"]["+"]] == [*lugre_of(law_named(own["law"]))._fields]
    assert own["units"]["alpha_3"] == "N·m·s²/rad²"
    assert "<b>k" not in several.html
    assert "&lt;b&gt;k" in several.html


def identified(folder: Path, law: Law, *, joint: str, simulated: bool = False) -> bristle.Results:
    """A joint of points whose friction has a law, identified with it."""
    p = pair_with(law).positive.stribeck
    (torque,) = evaluate(functions.steady_torque_function(law), speeds(), *p)
    noisy = torque + 2e-5 * np.random.default_rng(0).standard_normal(torque.size)
    rows = (f"{v!r},{T!r}\n" for v, T in zip(speeds().tolist(), noisy.tolist(), strict=True))
    (folder / f"{joint}.csv").write_text("v,tau\n" + "".join(rows), encoding="utf-8")
    text = experiment(joint=joint, data=f"{joint}.csv") + f"fit: {{law: {law.name}}}\n"
    if simulated:
        told = ", ".join(f"{name}: '{x!r} {unit(name)}'" for name, x in TRUTH._asdict().items())
        text += f"simulated: true\ntruth: {{both: {{{told}}}}}\n"
    (folder / f"{joint}.yaml").write_text(text, encoding="utf-8")
    return bristle.identify(folder / f"{joint}.yaml")


def page_of(*results: bristle.Results) -> Explorer:
    joints: list[Joint] = [joint for one in results for joint in one.joints]
    return explorer(joints, {joint.name: "no loop" for joint in joints})


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> bristle.Results:
    """A joint whose law bends down, said to be simulated by the paper's."""
    return identified(tmp_path_factory.mktemp("bent"), BENT, joint="bent", simulated=True)


@pytest.fixture(scope="module")
def several(own_law: Law, bent: bristle.Results, tmp_path_factory: pytest.TempPathFactory) -> Explorer:
    """Three joints: of the paper's law, of one that bends down, and of the user's own."""
    folder = tmp_path_factory.mktemp("several")
    return page_of(identified(folder, GAUSSIAN, joint="paper"), bent, identified(folder, own_law, joint="own"))


def test_the_cost_map_of_a_moving_run_is_that_of_python(node: Node) -> None:
    """Over an exponent and a signed coefficient; the run's sets are of its law, with the fastest speed as it was given."""
    pair, v = pair_with(law_named("free-exponent+quadratic")), 1.2 * np.cos(40 * TIME[:100])
    values, fastest = values_of(pair), {ParameterName.parse(f"{FASTEST}{d}"): OWN[FASTEST] for d in "+-"}
    estimated = {name: x for name, x in values.items() if not name.startswith(FASTEST)}
    residuals = 1e-3 * np.random.default_rng(0).standard_normal(v.size)
    fit = tracked(
        estimated, law=pair.law, fixed=fastest, velocity=v, time=TIME[: v.size], residuals=residuals, measured=v
    )
    told = explored([moving_joint(fit)], {"wrist": "no loop"})["joints"][0]
    assert told["moving"]["pair"] == of(pair)
    assert {name: row["value"] for name, row in told["sets"][0]["values"]["-"].items()} == pair.negative._asdict()
    costs = (files("bristle.questions.explorer") / "costs.js").read_text(encoding="utf-8")
    module = node.module("\n".join((engine.script(laws=[pair.law]), costs, CELLS)))
    asked = {"job": 1, "n": 2, "names": ["delta", "alpha_3"], "ends": [[0.5, 2.5], [-0.02, 0.02]], "directions": ["-"]}
    (cells,) = node.call(
        module, [("cells", asked | {"pair": of(pair), "identified": of(pair), "moving": told["moving"]})]
    )
    negative: Any = pair.negative
    least, then = float(residuals @ residuals), rollout(v, 1e-3, pair).torque
    own = [negative._replace(delta=delta, alpha_3=x) for x in (-0.01, 0.01) for delta in (1.0, 2.0)]
    left = [residuals + then - rollout(v, 1e-3, pair._replace(negative=p)).torque for p in own]
    changes = [(float(r @ r) - least) / (3.84 * least / (v.size - 6)) for r in left]
    assert [cell["change"] for cell in cells] == pytest.approx(changes, rel=1e-6)
    assert [cell["active"] for cell in cells] == [not is_passive(p) for p in own]


def test_a_loop_of_two_laws_is_refused_in_a_sentence(bent: bristle.Results, tmp_path: Path, chromium: Any) -> None:
    """A simulated joint whose true friction has another law than the fit is not run in a loop."""
    pair, (joint,) = pair_with(BENT), bent.joints
    told = [
        explored([joint], {"bent": joint_loop(plant=plant, model=pair)})["joints"][0]["loop"]
        for plant in (pair, Pair(TRUTH, TRUTH))
    ]
    assert isinstance(told[0], list)
    json.dumps(told[0], allow_nan=False)
    assert "has gaussian friction, the fitted model lorentzian+quadratic" in told[1]
    # it runs there, and its model follows the sliders, that of the signed coefficient too
    page = explorer([joint], {"bent": replace(joint_loop(), plant=pair, model=pair)})
    tab = Tab(chromium, page.write(tmp_path / "loop.html"), "#view=compensation&loop-duration=2")
    rows = "[...document.querySelectorAll('#loop-rows tr')].map((x) => x.innerText)"
    before = tab.page.evaluate(rows)
    tab.set("alpha_3", 900)
    assert tab.page.evaluate(rows)[1] != before[1]
    assert not tab.wrong
    tab.context.close()


@pytest.mark.slow
def test_a_page_of_several_laws_in_a_browser(several: Explorer, chromium: Any, tmp_path: Path) -> None:
    """Each joint has the sliders of its law, a refit restores its cost, the curve that bends down is dashed where it is held, which is said."""
    # all of that on a phone; every view draws every joint without an error, and no figure is wider than a phone, nor
    # than a wide screen
    tab = Tab(chromium, several.write(tmp_path / "explore.html"), width=390)
    page = tab.page
    for k, (law, more) in enumerate((("", []), ("Lorentzian", ["alpha_3"]), ("flat-top", ["sharpness", "alpha_3"]))):
        page.select_option("#joint", str(k))
        tab.show("friction")
        assert law in page.inner_text("#friction-law")
        shown = [name for name in ("alpha_0", "sharpness", "alpha_3") if page.is_visible(f"#slider-{name}")]
        assert shown == ["alpha_0", *more]
        dashes = page.evaluate("explorer.named('now+.held').data.speed.length")
        assert bool(dashes) == bool("was not measured" in page.inner_text("#held-said")) == bool(more)
        cost = "+document.querySelector('#costs tr').dataset.cost"
        least = page.evaluate(cost)
        tab.set("alpha_2", 900)
        assert page.evaluate(cost) > 2 * least
        page.click("#refit")
        tab.settled()
        assert page.evaluate(cost) == pytest.approx(least, rel=1e-6)
        for view in VIEWS:
            tab.show(view)
            for width in (1280, 390):
                page.set_viewport_size({"width": width, "height": 900})
                tab.settled()
                assert page.evaluate("document.documentElement.scrollWidth") <= width
        if more:
            tab.set("alpha_3", 1000)
            tab.show("friction")
            assert "(+)" not in page.inner_text("#held-said")
            page.fill("#entry-alpha_3", "-0.001")
            page.press("#entry-alpha_3", "Enter")
            tab.settled()
            assert tab.state()["values"]["+"]["alpha_3"] == -0.001
            assert "(+)" in page.inner_text("#held-said")
    assert [page.is_visible(f"#true-{name}") for name in ("alpha_0", "v_s")] == [False, False]
    assert "α₃" in page.inner_text("#refit")
    assert not tab.wrong
    tab.context.close()

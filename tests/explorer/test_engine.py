import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pandas as pd
import pytest

import bristle
from bristle.arrays import Array
from bristle.control.adaptation import LAWS, Adaptation
from bristle.control.closed_loop import simulate
from bristle.control.compensator import NAMES, Compensator
from bristle.control.control_period import LoopOptions
from bristle.control.pid import Gains
from bristle.estimation.linear import bounded_least_squares
from bristle.model import functions
from bristle.model.law import is_passive
from bristle.model.laws import registry
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law, OwnParameter, Peak
from bristle.model.laws.registry import competing, law_named, register_law
from bristle.model.operations import OPERATIONS
from bristle.model.parameters import Lugre, Pair, ParameterName, least_of, lugre_of, pair_of, unit
from bristle.model.printing import Term
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate
from bristle.questions.compensation.experiments import LONG, SETTLE, SHORT
from bristle.questions.explorer import engine
from bristle.questions.explorer.data import explored, ranges
from bristle.questions.explorer.page import Explorer, explorer
from bristle.simulation import edro
from bristle.simulation.joint_loop import JointLoop, one_way

from ..conftest import TRUTH, experiment, speeds
from ..model.test_rollout import BINARY, OTHERS, UNARY, VALUES
from ..simulation.joints import joint as moving_joint
from ..simulation.joints import joint_loop, tracked, values_of
from .conftest import Explored, Node
from .test_browser import VIEWS, Tab
from .test_page import known_of

JOINTS = (*edro.TABLE_1,)


class Engine:
    """The functions of a script."""

    def __init__(self, node: Node, text: str) -> None:
        self._node, self._module = node, node.module(text)

    def __call__(self, name: str, *arguments: object) -> Any:
        return self._node.call(self._module, [(name, *arguments)])[0]

    def loops(self, *options: Mapping[str, object]) -> list[dict[str, Any]]:
        """Runs in the closed loop, without most of their signals."""
        keep = ("position", "torque", "factors", "diverged", "rms")
        return self._node.call(self._module, [("closedLoop", own) for own in options], keep)


@pytest.fixture(scope="module")
def js(node: Node) -> Engine:
    """The script as it is made for the paper's joints."""
    return Engine(node, engine.script())


def of(pair: Pair[float]) -> dict[str, Any]:
    """A pair as the script has it."""
    return {"law": pair.law.name, "+": pair.positive._asdict(), "-": pair.negative._asdict()}


def both(p: Lugre[float]) -> Pair[float]:
    """One set in both directions."""
    return Pair(p, p)


def floats(values: object) -> Array:
    """An array of an answer, in which what is no number stands as text."""
    return np.array(values, dtype=np.float64)


def printed_functions(node: Node, printed: Sequence[ca.Function]) -> str:
    """A module whose `each` evaluates the function of that number for every sample of its inputs; its path."""
    names = [f"f{k}" for k in range(len(printed))]
    texts = [engine.printed(f, name) for f, name in zip(printed, names, strict=True)]
    each = (
        "exports.each = (k, size, ...columns) => columns[0].map((_, i) => {\n"
        "  const out = new Float64Array(size), value = all[k](...columns.map((x) => x[i]), out);\n"
        "  return size === 1 ? [value] : out;\n});\n"
    )
    return node.module(engine.HELPERS + "".join(texts) + f"const all = [{', '.join(names)}];\n" + each)


def test_operations_are_casadis_and_numpys(node: Node) -> None:
    """Each operation that NumPy has a counterpart of, and those of its derivatives, give in JavaScript what CasADi gives, NaN too; erf has none."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    built = [(UNARY[name](x), [x]) for name in UNARY if name != "erf"] + [
        (BINARY[name](x, y), [x, y]) for name in BINARY
    ]
    outputs = [[expression, *ca.vertsplit(ca.jacobian(expression, ca.vertcat(*by)).T)] for expression, by in built]
    made = [ca.Function("f", by, [ca.densify(ca.vertcat(*out))]) for (_, by), out in zip(built, outputs, strict=True)]
    columns = [VALUES, OTHERS]
    calls = [("each", k, f.numel_out(0), *columns[: f.n_in()]) for k, f in enumerate(made)]
    answers = node.call(printed_functions(node, made), calls)
    for f, answer in zip(made, answers, strict=True):
        theirs = f.map(VALUES.size).call([ca.DM(c).T for c in columns[: f.n_in()]])[0].full().T
        np.testing.assert_allclose(floats(answer), theirs, rtol=1e-13, atol=1e-15)
    with pytest.raises(ValueError, match="no JavaScript counterpart"):
        engine.printed(ca.Function("f", [x], [ca.erf(x)]), "f")
    # infinity is written as it is called there, and constants are exact
    f = ca.Function("f", [x], [ca.vertcat(x * -1e-300, 1 / ca.SX(3), ca.inf, -ca.inf)])
    (((*got,),),) = node.call(printed_functions(node, [f]), [("each", 0, 4, [0.7])])
    assert floats(got).tolist() == [0.7 * -1e-300, 1 / 3, np.inf, -np.inf]
    # of the operations that `vectorised` takes, only erf cannot be printed
    lacking = []
    for code in OPERATIONS:
        try:
            engine.operation(code, [Term("x"), Term("y")])
        except KeyError:
            lacking.append(code)
    assert lacking == [ca.OP_ERF]
    # the script holds nothing of a user, nor what would run text; options are JSON without text of a user
    hostile = replace(joint_loop(), name="</script><b>alert")
    text, said = engine.script([hostile]), json.dumps(engine.loop_options(hostile), allow_nan=False)
    assert text == engine.script()
    assert text.isascii()
    words = ("eval(", "Function(", "</", "alert", "innerHTML", "document", "import(")
    assert not [word for word in words if word in text or word in said]


SPEEDS = np.concatenate([np.geomspace(1e-4, 3.0, 40), [0.0], -np.geomspace(1e-4, 3.0, 40)])


TIME = 1e-3 * np.arange(20_001)


@pytest.mark.parametrize("name", JOINTS)
def test_a_loop_is_that_of_python(name: str, js: Engine) -> None:
    """20 s of each joint of Table 1 from the wrong start: position, torque, RMS error and the adapted factors, these to 1e-6."""
    assert [*check_loops(js, joint_loop(name), 20.0)] == ["none", "fixed", *LAWS]


def test_a_rollout_is_that_of_python(js: Engine) -> None:
    """To 1e-9 of the largest torque, with any step and start, of Table 1 and of any sets over the sliders."""
    # the directions up to a factor of ten apart, alpha_1 up to a thousand alpha_0
    rng = np.random.default_rng(3)
    lowest, highest = np.array([-6.0, -2.0, -4.0, -6.0, -1.0, -4.0]), np.array([3.0, 2.0, 3.0, 1.0, 6.0, 3.0])
    pairs = [*edro.TABLE_1.values()]
    for _ in range(40):
        drawn = 10.0 ** rng.uniform(lowest, highest)
        own = [drawn, drawn * 10.0 ** rng.uniform(-1, 1, 6)]
        pairs.append(pair_of([number for x in own for number in (x[0], x[0] * x[1], *x[2:])]))
    for k, pair in enumerate(pairs):
        step, z0 = (1e-4, 1e-3, 5e-3, 2e-2)[k % 4], (None, 0.0, 2e-3)[k % 3]
        t = step * np.arange(1001)
        v = 10.0 ** rng.uniform(-4, 1) * (np.sin(19 * t) + 0.3 * np.sin(100 * t) + 0.1 * rng.normal(size=t.size))
        theirs, ours = rollout(v, step, pair, z0), js("rollout", v, step, of(pair), z0)
        for key in ("z", "torque"):
            expected = getattr(theirs, key)
            np.testing.assert_allclose(floats(ours[key]), expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    zero, one = (js("rollout", v[:n], 1e-3, of(pair))["z"] for n in (0, 1))
    assert (zero, one) == ([], [pytest.approx(rollout(v[:1], 1e-3, pair).z[0])])
    # slow loading goes as far as `law.loading_displacement` says, the same way in both directions, and a loop is a rollout from rest
    pair, amplitude, rate = edro.TABLE_1["wrist pitch"], 2e-3, 0.2
    g0, sigma_0 = pair.positive.alpha_0 + pair.positive.alpha_1, pair.positive.sigma_0
    T = np.linspace(0.0, 0.99 * g0, 20)
    y, *_ = evaluate(functions.loading_displacement_function(), T, g0, sigma_0)
    np.testing.assert_allclose(floats(js("loading", [*T, *-T], g0, sigma_0)), [*y, *-y], rtol=1e-12)
    assert np.isnan(floats(js("loading", [g0, -2 * g0], g0, sigma_0))).all()
    loop = js("hysteresis", of(pair), amplitude, rate, 2, 400)
    t = np.arange(801) / (rate * 400)
    np.testing.assert_allclose(floats(loop["y"]), amplitude * np.sin(2 * np.pi * rate * t), rtol=0, atol=1e-15)
    theirs = rollout(2 * np.pi * rate * amplitude * np.cos(2 * np.pi * rate * t), t[1], pair, 0.0).torque
    np.testing.assert_allclose(floats(loop["torque"]), theirs, rtol=0, atol=1e-9 * np.abs(theirs).max())


def compensator_of(loop: JointLoop, law: str) -> Compensator:
    if law == "none":
        return Compensator(name="none", inertia=loop.compensator.inertia)
    if law == "fixed":
        return loop.compensator
    own = replace(loop.adaptation, law=law, gamma=loop.comparable_rates(law))  # type: ignore[arg-type]  # a law by now
    return replace(loop.compensator, adaptation=own)


def check_loops(js: Engine, loop: JointLoop, duration: float) -> dict[str, dict[str, Any]]:
    """Hold every law's run of a joint against `simulate`; the script's runs, by law."""
    options = engine.loop_options(loop) | {"duration": duration, "settle": 0.5 * duration}
    got = dict(zip(options["laws"], js.loops(*({**options, "law": law} for law in options["laws"])), strict=True))
    case, reference = loop.case(model=loop.wrong_start(loop.model)), loop.sine(loop.frequency, duration)
    for law, ours in got.items():
        theirs = simulate(LoopOptions(compensator=compensator_of(loop, law)), [case], reference, loop.period)
        assert ours["diverged"] is None
        np.testing.assert_allclose(floats(ours["position"]), theirs.position[0], rtol=0, atol=1e-9 * loop.amplitude)
        np.testing.assert_allclose(
            floats(ours["torque"]), theirs.torque[0], rtol=0, atol=1e-6 * np.abs(theirs.torque).max()
        )
        assert ours["rms"] == pytest.approx(theirs.rms_error(0.5 * duration)[0], rel=1e-6)
        names = loop.adaptation.parameters if law in LAWS else ()
        assert [*ours["factors"]] == [*names]
        for name, theta in zip(names, theirs.theta[0], strict=True):
            np.testing.assert_allclose(
                floats(ours["factors"][name]), loop.start.get(name, 1.0) * theta, rtol=0, atol=1e-6
            )
    return got


def test_the_default_ends_where_table_2_does(js: Engine) -> None:
    """The gripper with its positive friction in both directions ends at 0.845 and 1.051, as `bristle adapt` says, after the paper's 20 s."""
    assert (engine.DURATION, engine.SETTLE) == (SHORT, SETTLE)
    assert LONG > SHORT
    loop = one_way(joint_loop())
    (own,) = js.loops(engine.loop_options(loop))
    courses = (own["factors"]["alpha_0"], own["factors"]["alpha_2"])
    assert [course[0] for course in courses] == pytest.approx([0.3, 0.5], abs=1e-3)
    assert [course[-1] for course in courses] == pytest.approx([0.845, 1.051], abs=5e-4)
    check_loops(js, loop, 4.0)
    # with gains that the control period does not bear every array ends where the error is ten times the amplitude; no RMS is said
    options = engine.loop_options(joint_loop()) | {"gains": {"K_p": 3.0, "K_i": 1.2, "K_d": 50.0, "filter_time": 0.0}}
    run = js("closedLoop", options)
    arrays = {name: x for name, x in (run | run["factors"]).items() if isinstance(x, list)}
    (size,) = {len(x) for x in arrays.values()}
    assert 1 < size < 2000
    assert (run["diverged"], run["rms"]) == (pytest.approx(1e-3 * size), None)
    assert np.abs(floats(run["error"])).max() <= 10.0
    np.testing.assert_array_equal(floats(run["error"]), floats(run["reference"]) - floats(run["position"]))
    # at every corner of the sliders, alone and against another corner, no function gives NaN or infinity; a loop is cut before it does
    rng, v = np.random.default_rng(4), np.concatenate([SPEEDS, 1e3 * SPEEDS])
    corners = [Lugre(*x) for x in product((1e-6, 1e3), (0.0, 1e3), (0.0, 1e3), (1e-6, 1e3), (1e-1, 1e6), (0.0, 1e3))]
    t = 1e-3 * np.arange(501)
    motion = 2 * np.sin(19 * t) + 1e-6 * np.sin(1000 * t)
    options = engine.loop_options(joint_loop()) | {"duration": 0.2, "settle": 0.1}
    laws = [*options["laws"]]
    for k, p in enumerate(corners):
        g0 = p.alpha_0 + p.alpha_1
        for other in (p, corners[rng.integers(len(corners))]):
            pair = of(Pair(p, other))
            answers = [
                js("steady", v, pair), js("cost", v, v, pair),
                js("refit", v, v + np.sign(v), "gaussian", p._asdict()), js("rollout", motion, 1e-3, pair),
                js("hysteresis", pair, 1e-3, 0.1, 1, 100), js("loading", [-0.5 * g0, 0.999999 * g0], g0, p.sigma_0),
                js("closedLoop", {**options, "plant": pair, "model": pair, "law": laws[k % len(laws)]}),
            ]  # fmt: skip  # a list of calls
            assert [finite(answer) for answer in answers] == [True] * len(answers), (p, other)


OTHER_LOOPS = [
    joint_loop(
        compensator=Compensator(name="lugre-feedback", share=0.9, filter_time=2e-3, inertia=1e-3),
        adaptation=Adaptation(
            law="total", step="normalised", parameters=("alpha_1", "v_s", "sigma_1"), gamma=(5.0, 3.0, 2.0), limits=(0.2, 3.0),
            dead_zone=1e-3, leakage=0.1,
        ),
        start={"v_s": 0.5, "alpha_1": 2.0}, gains=Gains(2.0, 1.0, 0.1, 5e-3), amplitude=0.4, frequency=1.0, period=2e-3,
    ),
    joint_loop(
        "elbow pitch", compensator=Compensator(name="lugre-observer", observer_gain=0.05),
        adaptation=Adaptation(law="partial-theta", step="least-squares", parameters=("sigma_0",), gamma=(30.0,), forgetting=0.5),
        start={"sigma_0": 0.7},
    ),
]  # fmt: skip  # values, a line of them each
"""Joints whose loops are not the paper's."""


@pytest.mark.parametrize("k", [0, 1])
def test_a_users_own_loop_is_that_of_python(k: int, node: Node) -> None:
    """Other compensators, steps, parameters, gains and filters too: the script is made for the joints it is given."""
    loop = OTHER_LOOPS[k]
    assert loop.compensator.name in NAMES
    check_loops(Engine(node, engine.script(OTHER_LOOPS)), loop, 1.0)


def finite(value: Any) -> bool:
    if isinstance(value, dict):
        return all(map(finite, value.values()))
    return value is None or bool(np.isfinite(floats(value)).all())


CELLS = "module.exports = { cells: (asked) => new Promise((done) => costs.map(asked, ({ cells }) => cells && done(cells))) };"


def map_of(node: Node, law: Law, **asked: object) -> list[dict[str, Any]]:
    """The cells of a cost map, by the scripts of which the page makes its worker."""
    costs = (files("bristle.questions.explorer") / "costs.js").read_text(encoding="utf-8")
    module = node.module("\n".join((engine.script(laws=[law]), costs, CELLS)))
    (cells,) = node.call(module, [("cells", {"job": 1, **asked})])
    return list(cells)


@pytest.mark.parametrize("directions", ["+", "+-"])
def test_a_map_of_points_is_that_of_python(directions: str, node: Node, edro: Explored) -> None:
    """Change of cost in changes up to the threshold to 1e-6 of the largest, and where LuGre is not passive; the others stay as they are."""
    joint = edro.results.joints[0]
    known = explored([joint], {joint.name: "no loop"})["joints"][0]
    found = {d: {name: row["value"] for name, row in rows.items()} for d, rows in known["sets"][0]["values"].items()}
    now = {d: p | {"alpha_2": 1.2 * p["alpha_2"]} for d, p in found.items()}
    law = {"law": "gaussian"}
    fits = [fit for fit in known["static"] if fit["direction"] in directions]
    begun = Lugre(**now["+"])
    v_s, sigma_1 = np.array([0.055, 0.065, 0.075, 0.085]), begun.alpha_2 * begun.alpha_0 / begun.alpha_1
    cells = map_of(
        node, GAUSSIAN, n=4, names=["v_s", "sigma_1"], ends=[[0.05, 0.09], [0.0, 2 * sigma_1]], pair=now | law, identified=found | law,
        fits=fits, directions=[*directions],
    )  # fmt: skip  # a list of values
    own = [begun._replace(v_s=v, sigma_1=s) for s in sigma_1 * np.array([0.25, 0.75, 1.25, 1.75]) for v in v_s]
    np.testing.assert_allclose(
        [(cell["x"], cell["y"]) for cell in cells], [(p.v_s, p.sigma_1) for p in own], rtol=1e-12
    )
    costs = []
    for p in own:
        sets = {d: p if d in directions else Lugre(**now[d]) for d in "+-"}
        steady = [
            evaluate(functions.steady_torque_function(), fit["velocity"], *sets[fit["direction"]].stribeck)[0]
            for fit in fits
        ]
        costs.append(sum(np.sum(np.square(fit["torque"] - T)) for fit, T in zip(fits, steady, strict=True)))
    least, by = sum(fit["least"] for fit in fits), max(fit["threshold"] - fit["least"] for fit in fits)
    changes = (np.array(costs) - least) / by
    assert np.ptp(changes) > 1
    np.testing.assert_allclose([cell["change"] for cell in cells], changes, rtol=0, atol=1e-6 * np.abs(changes).max())
    assert [cell["active"] for cell in cells] == (active := [not is_passive(p) for p in own])
    assert set(active) == {False, True}


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
def several_js(law: Law, node: Node) -> Engine:
    """A script that knows the law beside the paper's."""
    return Engine(node, engine.script(laws=(GAUSSIAN, law)))


def pair_with(law: Law, **negative: float) -> Pair[float]:
    """`TRUTH` with what the law has beside it, the negative direction otherwise: its viscous friction does not bend down."""
    kind = lugre_of(law)
    values = TRUTH._asdict() | {name: OWN[name] for name in law.more}
    other = {"alpha_0": 0.021, "v_s": 0.06, "sigma_0": 9.0} | ({"alpha_3": 0.002} if law.terms else {}) | negative
    return Pair(kind(**values), kind(**(values | other)))


def test_every_function_of_laws_is_that_of_python(law: Law, several_js: Engine) -> None:
    """In both directions, beyond the fastest measured speed too; it is told from where viscous friction is held."""
    pair = pair_with(law)
    acting = [np.where(SPEEDS < 0, n, p) for p, n in zip(*(p.stribeck for p in pair), strict=True)]
    (T,) = evaluate(functions.steady_torque_function(law), SPEEDS, *acting)
    np.testing.assert_allclose(floats(several_js("steady", SPEEDS, of(pair))), T, rtol=1e-12)
    for sigma_1 in (0.0, 0.05, 0.12, 0.2):
        p = pair.positive._replace(sigma_1=sigma_1)
        assert several_js("isPassive", p._asdict(), law.name) == bool(is_passive(p))
    held = [several_js("heldFrom", p._asdict(), law.name) for p in pair]
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
        got = several_js("refit", v, T, law.name, pair.positive._asdict())
        ours = np.array([got[name] for name in names])
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-13)
        p = pair.positive._replace(**dict(zip(names, ours.tolist(), strict=True)))
        cost = float(((T - design @ ours) ** 2).sum())
        assert (got["cost"], several_js("cost", v, T, of(Pair(p, p)))) == pytest.approx((cost, cost), rel=1e-11)
    # of sets that differ between the directions, fast and in presliding, to 1e-9 of the largest torque
    pair = pair_with(law)
    for v in (
        1.2 * np.cos(np.pi * TIME[:4001]),
        2e-3 * np.sin(4.4 * TIME[:4001]) + 1e-3 * np.sin(20 * TIME[:4001] + 1),
    ):
        theirs, ours = rollout(v, 1e-3, pair), several_js("rollout", v, 1e-3, of(pair))
        for key in ("z", "torque"):
            expected = getattr(theirs, key)
            np.testing.assert_allclose(floats(ours[key]), expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    # plant and model of the law, from the wrong start
    pair = pair_with(law)
    loop = joint_loop(plant=pair, model=Pair(*(p._replace(alpha_0=0.9 * p.alpha_0) for p in pair)))
    assert [*check_loops(several_js, loop, 2.0)] == ["none", "fixed", *LAWS]


def test_a_page_knows_its_joints_laws_alone(several: Explorer) -> None:
    """What other laws take is printed where a joint has them alone; parameters, units and truth are by joint; no symbol of a law is HTML."""
    text = engine.script()
    assert text.count('LAWS["') == text.count("function steadyTorque(") == 1
    assert engine.script(laws=(GAUSSIAN, law_named("lorentzian"))).count("function steadyTorque(") == 2
    paper, bent, own = known_of(several)["joints"]
    assert [joint["law"] for joint in (paper, bent, own)] == ["gaussian", "lorentzian+quadratic", "flat-top+quadratic"]
    assert paper["law_title"] == ""
    assert "Lorentzian peak" in bent["law_title"]
    assert bent["truth_law"] == "gaussian"
    assert [*own["sets"][0]["values"]["+"]] == [*lugre_of(law_named(own["law"]))._fields]
    assert own["units"]["alpha_3"] == "N·m·s²/rad²"
    assert "<b>k" not in several.html
    # a slider goes as far as a parameter is searched, and has a range where its value is zero; the fastest speed has none
    law = law_named("free-exponent+quadratic")
    p: Any = pair_with(law).positive
    found = ranges(law, [p._replace(alpha_3=0.0)._asdict()], 0.8)
    assert [*found] == [name for name in p._fields if name != FASTEST]
    assert found["delta"] == {"low": 0.5, "high": 4.0, "log": True, "least": 0.0}
    ends = [-4 * p.alpha_0 / 0.64, 4 * p.alpha_0 / 0.64]
    assert [found["alpha_3"][end] for end in ("low", "high")] == pytest.approx(ends)
    assert (found["alpha_3"]["log"], found["alpha_3"]["least"]) == (False, "-inf")


def identified(folder: Path, law: Law, *, joint: str, simulated: bool = False) -> bristle.Results:
    """A joint of points whose friction has a law, identified with it."""
    p = pair_with(law).positive.stribeck
    (torque,) = evaluate(functions.steady_torque_function(law), speeds(), *p)
    noisy = torque + 2e-5 * np.random.default_rng(0).standard_normal(torque.size)
    pd.DataFrame({"v": speeds(), "tau": noisy}).to_csv(folder / f"{joint}.csv", index=False)
    text = experiment(joint=joint, data=f"{joint}.csv") + f"fit: {{law: {law.name}}}\n"
    if simulated:
        told = ", ".join(f"{name}: '{x!r} {unit(name)}'" for name, x in TRUTH._asdict().items())
        text += f"simulated: true\ntruth: {{both: {{{told}}}}}\n"
    (folder / f"{joint}.yaml").write_text(text, encoding="utf-8")
    return bristle.identify(folder / f"{joint}.yaml")


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> bristle.Results:
    """A joint whose law bends down, said to be simulated by the paper's."""
    return identified(tmp_path_factory.mktemp("bent"), BENT, joint="bent", simulated=True)


@pytest.fixture(scope="module")
def several(own_law: Law, bent: bristle.Results, tmp_path_factory: pytest.TempPathFactory) -> Explorer:
    """Three joints: of the paper's law, of one that bends down, and of the user's own."""
    folder = tmp_path_factory.mktemp("several")
    known = (identified(folder, GAUSSIAN, joint="paper"), bent, identified(folder, own_law, joint="own"))
    joints = [joint for one in known for joint in one.joints]
    return explorer(joints, {joint.name: "no loop" for joint in joints})


def test_cost_maps_of_moving_runs_under_laws_are_those_of_python(node: Node) -> None:
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
    cells = map_of(
        node, pair.law, n=2, names=["delta", "alpha_3"], ends=[[0.5, 2.5], [-0.02, 0.02]], directions=["-"], pair=of(pair),
        identified=of(pair), moving=told["moving"],
    )  # fmt: skip  # a list of values
    negative: Any = pair.negative
    least, then = float(residuals @ residuals), rollout(v, 1e-3, pair).torque
    own = [negative._replace(delta=delta, alpha_3=x) for x in (-0.01, 0.01) for delta in (1.0, 2.0)]
    left = [residuals + then - rollout(v, 1e-3, pair._replace(negative=p)).torque for p in own]
    changes = [(float(r @ r) - least) / (3.84 * least / (v.size - 6)) for r in left]
    assert [cell["change"] for cell in cells] == pytest.approx(changes, rel=1e-6)
    assert [cell["active"] for cell in cells] == [not is_passive(p) for p in own]


def test_a_loop_of_two_laws_is_refused_in_a_sentence(bent: bristle.Results) -> None:
    """A simulated joint whose true friction has another law than the fit is not run in a loop."""
    pair, (joint,) = pair_with(BENT), bent.joints
    told = [
        explored([joint], {"bent": joint_loop(plant=plant, model=pair)})["joints"][0]["loop"]
        for plant in (pair, Pair(TRUTH, TRUTH))
    ]
    assert isinstance(told[0], list)
    json.dumps(told[0], allow_nan=False)
    assert "has gaussian friction, the fitted model lorentzian+quadratic" in told[1]


@pytest.mark.slow
def test_a_page_of_several_laws_in_a_browser(several: Explorer, chromium: Any, tmp_path: Path) -> None:
    """Each joint has the sliders of its law, a refit restores its cost, the curve that bends down is dashed where it is held, which is said."""
    # on a phone too every view draws every joint without an error, and no figure is wider than the screen
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
            assert page.evaluate("document.documentElement.scrollWidth") <= 390
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

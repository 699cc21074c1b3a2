"""The model and the cost maps in JavaScript are those of Python: each function of the explorer's script in Node against bristle's own."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from itertools import pairwise, product
from typing import Any

import casadi as ca
import numpy as np
import pytest

from bristle.arrays import Array
from bristle.control.adaptation import LAWS, Adaptation
from bristle.control.closed_loop import simulate
from bristle.control.compensator import NAMES, Compensator
from bristle.control.control_period import LoopOptions
from bristle.control.pid import Gains
from bristle.model import functions
from bristle.model.law import is_passive
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.operations import OPERATIONS
from bristle.model.parameters import Lugre, Pair, pair_of
from bristle.model.printing import Term
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate
from bristle.questions.compensation.experiments import LONG, SETTLE, SHORT
from bristle.questions.explorer import engine
from bristle.questions.explorer.data import explored
from bristle.simulation import edro
from bristle.simulation.joint_loop import JointLoop, one_way

from ..model.test_vectorize import BINARY, OTHERS, UNARY, VALUES
from ..simulation.joints import joint_loop
from .conftest import Explored, Node

JOINTS = (*edro.TABLE_1,)


class Engine:
    """The functions of a script."""

    def __init__(self, node: Node, text: str) -> None:
        self._node, self._module = node, node.module(text)

    def __call__(self, name: str, *arguments: object) -> Any:
        """What one returns."""
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


def test_every_operation_and_its_derivatives_equal_casadi(node: Node) -> None:
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
    # a vector is read by its elements, outputs follow one another, a zero without an instruction is written, and constants are exact
    x, q = ca.SX.sym("x"), ca.SX.sym("q", 3)
    zero = ca.SX(2, 1)
    zero[1] = q[2] - x
    f = ca.Function("f", [x, q], [zero, ca.vertcat(x * -1e-300, 1 / ca.SX(3), ca.inf, -ca.inf)], ["x", "q"], ["a", "b"])
    path = printed_functions(node, [f])
    (((*got,),),) = node.call(path, [("each", 0, 6, [0.7], [[1.0, 2.0, 0.1]])])
    assert floats(got).tolist() == [0.0, 0.1 - 0.7, 0.7 * -1e-300, 1 / 3, np.inf, -np.inf]


def test_the_printer_knows_what_numpy_knows() -> None:
    """Of the operations that `vectorised` takes, only erf cannot be printed."""
    lacking = []
    for code in OPERATIONS:
        try:
            engine.operation(code, [Term("x"), Term("y")])
        except KeyError:
            lacking.append(code)
    assert lacking == [ca.OP_ERF]
    # made again it is equal byte for byte; it holds nothing of a user, nor what would run text; options are JSON without text of a user
    hostile = replace(joint_loop(), name="</script><b>alert")
    text = engine.script([hostile])
    assert text == engine.script()
    assert engine._of_law.__wrapped__(GAUSSIAN, (*engine._ways(Compensator(), Adaptation()).values(),)) in text
    assert text.isascii()
    assert not [
        word for word in ("eval(", "Function(", "</", "alert", "innerHTML", "document", "import(") if word in text
    ]
    said = json.dumps(engine.loop_options(hostile), allow_nan=False)
    assert "alert" not in said


SPEEDS = np.concatenate([np.geomspace(1e-4, 3.0, 40), [0.0], -np.geomspace(1e-4, 3.0, 40)])


TIME = 1e-3 * np.arange(20_001)
MOTIONS = {
    "wide": 3.0 * np.cos(np.pi * TIME),
    "presliding": 2e-3 * np.sin(4.4 * TIME) + 1e-3 * np.sin(20 * TIME + 1),
    "both": 0.3 * np.sin(1.9 * TIME) + 0.2 * np.sin(19 * TIME),
}


@pytest.mark.parametrize("name", JOINTS)
def test_a_rollout_is_that_of_python(name: str, js: Engine) -> None:
    """20 s of a motion to 1e-9 of the largest torque, with each direction's set alone and with both, also where sigma_0 is 1e6."""
    soft = edro.TABLE_1[name]
    share = 1e6 / max(p.sigma_0 for p in soft)
    for pair in (soft, Pair(*(p._replace(sigma_0=share * p.sigma_0) for p in soft))):
        cases: list[tuple[Lugre[float] | Pair[float], Pair[float], Array]] = [
            (pair, pair, MOTIONS["wide"]), (pair, pair, MOTIONS["presliding"]), (pair, pair, MOTIONS["both"]),
            (pair.positive, both(pair.positive), MOTIONS["both"]), (pair.negative, both(pair.negative), MOTIONS["presliding"]),
        ]  # fmt: skip  # a table
        for parameters, shown, v in cases:
            theirs, ours = rollout(v, 1e-3, parameters), js("rollout", v, 1e-3, of(shown))
            for key in ("z", "torque"):
                expected = getattr(theirs, key)
                np.testing.assert_allclose(floats(ours[key]), expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    # 20 s of each joint of Table 1 from the wrong start: position, torque, RMS error and the adapted factors, these to 1e-6
    assert [*check_loops(js, joint_loop(name), 20.0)] == ["none", "fixed", *LAWS]


def test_a_rollout_takes_steps_of_any_length_and_a_start(js: Engine) -> None:
    """The same with other steps, few enough samples that nodes stand between them, and a bent bristle to begin with."""
    v = np.random.default_rng(2).normal(0.0, 0.3, 400)
    for pair, z0, step in product(edro.TABLE_1.values(), (None, 0.0, 2e-3), (1e-4, 5e-3, 2e-2)):
        theirs = rollout(v, step, pair, z0).torque
        ours = floats(js("rollout", v, step, of(pair), z0)["torque"])
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max())
    assert [js("rollout", v[:n], 1e-3, of(pair))["z"] for n in (0, 1)] == [
        [],
        [pytest.approx(rollout(v[:1], 1e-3, pair).z[0])],
    ]
    # any sets drawn over the sliders, the directions up to a factor of ten apart, alpha_1 up to a thousand alpha_0, to 1e-9
    rng = np.random.default_rng(3)
    lowest, highest = np.array([-6.0, -2.0, -4.0, -6.0, -1.0, -4.0]), np.array([3.0, 2.0, 3.0, 1.0, 6.0, 3.0])
    t = 1e-3 * np.arange(1001)
    for _ in range(40):
        drawn = 10.0 ** rng.uniform(lowest, highest)
        own = [drawn, drawn * 10.0 ** rng.uniform(-1, 1, 6)]
        pair = pair_of([number for x in own for number in (x[0], x[0] * x[1], *x[2:])])
        v = 10.0 ** rng.uniform(-4, 1) * (np.sin(19 * t) + 0.3 * np.sin(100 * t))
        theirs = rollout(v, 1e-3, pair).torque
        ours = floats(js("rollout", v, 1e-3, of(pair))["torque"])
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max())
    # slow loading goes as far as `law.loading_displacement` says, the same way in both directions, and a loop is a rollout from rest
    p = edro.TABLE_1["wrist pitch"].positive
    g0 = p.alpha_0 + p.alpha_1
    T = np.linspace(0.0, 0.99 * g0, 20)
    y, *_ = evaluate(functions.loading_displacement_function(), T, g0, p.sigma_0)
    np.testing.assert_allclose(floats(js("loading", [*T, *-T], g0, p.sigma_0)), [*y, *-y], rtol=1e-12)
    assert np.isnan(floats(js("loading", [g0, -2 * g0], g0, p.sigma_0))).all()
    pair, amplitude, rate = edro.TABLE_1["wrist pitch"], 2e-3, 0.2
    loop = js("hysteresis", of(pair), amplitude, rate, 2, 400)
    t = np.arange(801) / (rate * 400)
    np.testing.assert_allclose(floats(loop["y"]), amplitude * np.sin(2 * np.pi * rate * t), rtol=0, atol=1e-15)
    theirs = rollout(2 * np.pi * rate * amplitude * np.cos(2 * np.pi * rate * t), t[1], pair, 0.0).torque
    np.testing.assert_allclose(floats(loop["torque"]), theirs, rtol=0, atol=1e-9 * np.abs(theirs).max())


def compensator_of(loop: JointLoop, law: str) -> Compensator:
    """What a joint runs with under one of the script's laws."""
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
    size = len(run["time"])
    assert run["diverged"] == pytest.approx(1e-3 * size)
    assert 1 < size < 2000
    assert {len(x) for x in (*(x for x in run.values() if isinstance(x, list)), *run["factors"].values())} == {size}
    assert np.abs(floats(run["error"])).max() <= 10.0
    assert run["rms"] is None
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
    """Whether all numbers of an answer are finite."""
    if isinstance(value, dict):
        return all(map(finite, value.values()))
    return value is None or bool(np.isfinite(floats(value)).all())


CELLS = "module.exports = { cells: (asked) => new Promise((done) => costs.map(asked, ({ cells }) => cells && done(cells))) };"


@pytest.fixture(scope="module")
def module(node: Node) -> str:
    """The scripts of which the page makes its worker; `cells` gives a whole map."""
    costs = (files("bristle.questions.explorer") / "costs.js").read_text(encoding="utf-8")
    return node.module("\n".join((engine.script(), costs, CELLS)))


def cost_of(data: dict[str, Any], pair: Pair[float]) -> float:
    """Sum of squared residuals at these values."""
    if "fits" in data:
        return sum(
            float(np.sum(np.square(np.subtract(fit["torque"], steady(np.array(fit["velocity"]), pair)))))
            for fit in data["fits"]
        )
    run = data["moving"]
    begun = Pair(*(Lugre(**run["pair"][d]) for d in ("+", "-")))
    v, ends = np.array(run["velocity"]), [*run["starts"], len(run["velocity"])]
    change = [
        rollout(v[a:b], run["step"], begun).torque - rollout(v[a:b], run["step"], pair).torque
        for a, b in pairwise(ends)
    ]
    return float(np.sum(np.square(np.array(run["residuals"]) + np.concatenate(change))))


def steady(v: Any, pair: Pair[float]) -> Any:
    """The steady torque, each direction by its set."""
    own = [evaluate(functions.steady_torque_function(), v, *p.stribeck)[0] for p in pair]
    return np.where(v > 0, *own)


@pytest.mark.parametrize(("data", "directions"), [("fits", "+"), ("fits", "+-"), ("moving", "+"), ("moving", "-")])
def test_a_map_is_that_of_python(data: str, directions: str, module: str, node: Node, edro: Explored) -> None:
    """Change of cost in changes up to the threshold to 1e-6 of the largest, and where LuGre is not passive; the others stay as they are."""
    joint = edro.results.joints[0]
    known = explored([joint], {joint.name: "no loop"})["joints"][0]
    found = {d: {name: row["value"] for name, row in rows.items()} for d, rows in known["sets"][0]["values"].items()}
    now = {d: p | {"alpha_2": 1.2 * p["alpha_2"]} for d, p in found.items()}
    law = {"law": "gaussian"}
    fits = [fit for fit in known["static"] if fit["direction"] in directions]
    of = {"fits": fits} if data == "fits" else {"moving": known["moving"]}
    begun = now[directions[0]]
    x, y = ("v_s", (0.05, 0.09)), ("sigma_1", (0.0, 2 * begun["alpha_2"] * begun["alpha_0"] / begun["alpha_1"]))
    asked = {
        "job": 1, "n": 4, "names": [x[0], y[0]], "ends": [x[1], y[1]], "pair": now | law, "identified": found | law,
        **of,
    }  # fmt: skip  # a list of values
    (cells,) = node.call(module, [("cells", asked | {"directions": [*directions]})])
    middles = (np.arange(4) + 0.5) / 4
    places = [(x[1][0] + a * np.ptp(x[1]), y[1][0] + b * np.ptp(y[1])) for b in middles for a in middles]
    np.testing.assert_allclose([(cell["x"], cell["y"]) for cell in cells], places, rtol=1e-12)
    sets = {"+": Lugre(**now["+"]), "-": Lugre(**now["-"])}
    own = [sets[directions[0]]._replace(v_s=v_s, sigma_1=sigma_1) for v_s, sigma_1 in places]
    costs = [cost_of(of, Pair(*(p if d in directions else sets[d] for d in "+-"))) for p in own]
    if data == "fits":
        least, by = sum(fit["least"] for fit in fits), max(fit["threshold"] - fit["least"] for fit in fits)
    else:
        least = cost_of(of, Pair(*(Lugre(**found[d]) for d in "+-")))
        by = 3.84 * least / (len(known["moving"]["velocity"]) - 4)
    changes = (np.array(costs) - least) / by
    assert np.ptp(changes) > 1
    np.testing.assert_allclose([cell["change"] for cell in cells], changes, rtol=0, atol=1e-6 * np.abs(changes).max())
    active = [not is_passive(p) for p in own]
    assert [cell["active"] for cell in cells] == active
    assert set(active) == {False, True}

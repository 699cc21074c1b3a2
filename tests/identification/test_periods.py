"""Cogging and ripple: amplitudes of given orders, orders that are found, units, hold-outs, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bristle
from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.data.experiment.load import load_experiment
from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.identification.dynamic.descent import solve_dynamic
from bristle.identification.dynamic.problem import dynamic_problem
from bristle.identification.dynamic.residual_analysis import columns_of, jacobian_and_residuals
from bristle.identification.measured import with_loads
from bristle.identification.moving_runs import load_columns, with_orders
from bristle.identification.periods import shown_orders
from bristle.identification.static.fit import estimate_static
from bristle.identification.static.points import points_problem
from bristle.identification.static.problem import from_records
from bristle.model.parameters import Direction, Lugre, ParameterName, unit
from bristle.model.parameters import Kind as JointKind
from bristle.page.wording import symbol

from .conftest import curve, experiment_file, holds, way, white

JOINT = Lugre(0.3, 0.1, 0.05, 0.2, 100.0, 0.3)
WAVES = {
    "cogging_sin_4": 0.05, "cogging_cos_4": 0.02, "cogging_sin_11": 0.03, "cogging_cos_11": -0.02,
    "ripple_sin_4": 0.02, "ripple_cos_4": 0.01, "ripple_sin_11": 0.0, "ripple_cos_11": 0.01,
}  # fmt: skip  # a list of values
"""Amplitudes by parameter, N*m."""
ASKED = with_orders(("cogging", "ripple"), (4, 11), "revolute")
STEP = 4e-3


def moves(seconds: float = 8.0) -> tuple[Array, Array, Array]:
    """Time, position and velocity of a motion of two tones over more than a turn."""
    t = np.arange(0, seconds, STEP)
    v = 3.0 * np.sin(1.3 * t) + 1.2 * np.sin(3.7 * t)
    return t, way(v, STEP), v


def waves(q: Array, v: Array) -> Array:
    """The torque that repeats with the position, N*m, (n,), written out."""
    torque = np.zeros(q.size)
    for k in (4, 11):
        for name, wave in (("sin", np.sin(k * q)), ("cos", np.cos(k * q))):
            torque += WAVES[f"cogging_{name}_{k}"] * wave + WAVES[f"ripple_{name}_{k}"] * wave * np.sign(v)
    return torque


def record(seed: int, *, noise: float = 0.01, size: float = 1.0) -> Record:
    """A motion with friction (9), and so much of the torque that repeats."""
    t, q, v = moves()
    torque = curve(v, JOINT) + size * waves(q, v) + white(t.size, noise, seed)
    return Record(file="log.csv", time=t, position=q, velocity=v, torque=torque)


def bristles(seconds: float, size: float = 1.0) -> tuple[Array, Array, Array]:
    """Time, position and torque of the motion with friction of LuGre, an inertia, and so much of what repeats."""
    t, q, v = moves(seconds)
    torque = bristle.simulate(v, STEP, JOINT) + 0.01 * np.gradient(v, t) + size * waves(q, v)
    return t, q, torque + white(t.size, 0.01, 1)


@pytest.mark.slow
def test_amplitudes_of_given_orders_are_within_their_intervals() -> None:
    """Of cogging and ripple of orders 4 and 11, the 95 % intervals hold the true amplitudes in 92 to 98 % of fifty sets, whose noise is white."""
    held = []
    for seed in range(50):
        problem, _, _ = from_records([record(seed)], ("both",), ASKED, 1)
        found = estimate_static(problem, FitOptions(), "revolute")
        for name, true in WAVES.items():
            assert found[name].value == pytest.approx(true, abs=2e-3)
            held.append(holds(found[name].interval, true))
    assert 0.92 <= np.mean(held) <= 0.98


@pytest.mark.slow
def test_orders_are_found_and_none_in_clean_data() -> None:
    """Beside all LuGre parameters both orders are found in every one of 12 sets; of 60 clean sets at least 58 show none."""
    t, q, v = moves()
    torque, a = bristle.simulate(v, STEP, JOINT), np.gradient(v, t)
    plain = Record(file="log.csv", time=t, position=q, velocity=v, acceleration=a, torque=torque + 0.01 * a)
    problem = dynamic_problem([plain], ("+", "-"), ("inertia",), 8, None)
    signs = [Direction.POSITIVE, Direction.NEGATIVE]
    start = {ParameterName(name, d): x for name, x in JOINT._asdict().items() for d in signs}
    solution = solve_dynamic(problem, start | {ParameterName("inertia", Direction.SHARED): 0.01}, search=False)
    known, rest = jacobian_and_residuals(problem, solution)
    columns = {k: columns_of(problem, with_orders(("cogging", "ripple"), (k,), "revolute")) for k in range(2, 31)}
    (m,), rng = problem.motions, np.random.default_rng(0)
    noise = [m.weighted(0.03 * rng.standard_normal(t.size)) for _ in range(60)]
    assert sum(shown_orders(known, rest + x, columns) == () for x in noise) >= 58
    repeats = m.weighted(waves(q, v))
    assert all(shown_orders(known, rest + repeats + x, columns) == (4, 11) for x in noise[:12])


@pytest.mark.parametrize("size", [0.0, 1.0])
def test_a_fit_that_is_asked_to_finds_the_orders_and_says_so(size: float) -> None:
    """Cogging and ripple without orders get those that are there, told in a note and in the settings, or none; friction is the same."""
    found = bristle.fit_dynamic(
        *bristles(10.0, size), directions="symmetric", regressors=["inertia", "cogging", "ripple"]
    )
    (note,) = [w for w in found.joint.warnings if w.code in {"orders-found", "no-orders"}]
    assert (note.code == "orders-found") == (size > 0)
    assert found.joint.settings["orders"] == ("4, 11, periods per turn" if size else "none, periods per turn")
    amplitudes = {name: x for name, x in found.params.items() if name in WAVES}
    assert amplitudes == pytest.approx(WAVES if size else {}, abs=2e-3)
    assert found.params["alpha_0"] == pytest.approx(JOINT.alpha_0, rel=0.01)
    if size:
        q = np.array([0.3, 1.1])
        with pytest.raises(InputError, match="predict: cogging was fitted; give the position too"):
            found.predict(np.ones(2))
        wanted = curve(np.ones(2), JOINT) + waves(q, np.ones(2))
        assert found.predict(np.ones(2), q) == pytest.approx(wanted, abs=5e-3)
    # points scattered over a turn get the order of their cogging, and its amplitude; without any they get none
    rng = np.random.default_rng(2)
    v = np.tile(np.geomspace(0.03, 2.0, 30), 2) * np.repeat([1.0, -1.0], 30)
    q = rng.uniform(0, 2 * np.pi, v.size)
    torque = curve(v, JOINT) + 0.05 * size * np.cos(7 * q) + 0.003 * rng.standard_normal(v.size)
    found = bristle.fit(v, torque, position=q, directions="symmetric", regressors=["cogging"])
    wanted = {"cogging_sin_7": 0.0, "cogging_cos_7": 0.05} if size else {}
    assert {n: x for n, x in found.params.items() if "cogging" in n} == pytest.approx(wanted, abs=3e-3)


def test_what_is_held_out_is_predicted_with_the_same_orders(tmp_path: Path) -> None:
    """A run that was not fitted is predicted to its noise with the orders found in the others, and far worse without them."""
    t, q, torque = bristles(14.0)
    errors = {}
    for asked in ("[inertia]", "[inertia, cogging, ripple]"):
        fit = f"directions: symmetric, regressors: {asked}"
        for name, part in (("b", t >= 9), ("a", t < 9)):
            path = experiment_file(tmp_path, {"t": t[part], "q": q[part], "T": torque[part]}, fit=fit, file=name)
        held = "}, {files: b.csv, experiment: tracking, hold_out: true}]"
        path.write_text(path.read_text().replace("}]", held))
        found = bristle.identify(path).joints[0].tracking
        assert found is not None
        errors[asked] = found.hold_out[0].relative_error
    plain, repeating = errors.values()
    assert repeating < 0.3 * plain
    # orders of nothing, of none, that are no whole numbers or finer than the positions get one sentence, which says what is expected
    t, q, torque = bristles(4.0)
    for options, sentence in REFUSED:
        named: dict[str, Any] = {} if sentence.startswith("fit.orders: nothing") else {"regressors": ["cogging"]}
        with pytest.raises(InputError) as refused:
            bristle.fit_dynamic(t, q, torque, **named, **options)
        assert sentence in str(refused.value)
        assert "\n" not in str(refused.value)
    # runs and points without a position are refused, as for gravity
    some = np.ones(3)
    path = experiment_file(tmp_path, {"t": some, "v": some, "T": some}, fit="regressors: [ripple]")
    with pytest.raises(InputError, match="no position, which tracking runs need; name it under signals"):
        load_experiment(path)
    with pytest.raises(InputError, match=r"fit\.regressors: cogging needs the position of every point"):
        bristle.fit(np.linspace(0.1, 1, 20), np.linspace(0.2, 0.3, 20), regressors=["cogging"], orders=[4])


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"orders": [4]}, "fit.orders: nothing has orders; add cogging or ripple to fit.regressors, or leave it out"),
    ({"orders": [-4]}, "got -4; expected auto, or whole numbers from 1 to 100_000"),
    ({"orders": [0]}, "got 0; expected auto, or whole numbers"),
    ({"orders": [4.5]}, "got 4.5; expected auto, or whole numbers"),
    ({"orders": [True]}, "got True; expected auto, or whole numbers"),
    ({"orders": "all"}, "got 'all'; expected auto, or whole numbers"),
    ({"orders": []}, "got []; expected auto, or up to 20 orders, each once"),
    ({"orders": [4, 4]}, "got [4, 4]; expected auto, or up to 20 orders, each once"),
    ({"orders": [10**6]}, "got 1000000; expected auto, or whole numbers from 1 to 100_000"),
    ({"orders": [5000]}, "fit.orders: got 5000; expected at most"),
    (
        {"predict": "position"},
        "fit.regressors: cogging is fitted to a torque; leave it out, or set fit.predict: torque",
    ),
]
"""Orders that cannot be, and what is said of them."""


@pytest.mark.parametrize(("kind", "rate"), [("revolute", 4.0), ("prismatic", 8 * np.pi), ("prismatic in A", 8 * np.pi)])
def test_an_order_is_per_turn_or_per_metre(kind: JointKind, rate: float) -> None:
    """Order 4 is four periods a turn, or a metre; its amplitude has the unit of the torque, and a ripple turns with the motion."""
    q, v = np.linspace(0, 1, 50), np.linspace(-1, 1, 50)
    columns = load_columns(
        with_orders(("inertia", "cogging", "ripple"), (4,), kind), lambda name: {"position": q}.get(name, v), q.size
    )
    assert list(columns) == ["inertia", "cogging_sin_4", "cogging_cos_4", "ripple_sin_4", "ripple_cos_4"]
    assert columns["cogging_sin_4"] == pytest.approx(np.sin(rate * q))
    assert columns["ripple_cos_4"] == pytest.approx(np.cos(rate * q) * np.sign(v))
    assert {unit(name, kind) for name in list(columns)[1:]} == {unit("torque", kind)}
    assert symbol("cogging_sin_4") == "cogging (sin 4)"
    assert ParameterName.parse("cogging_sin_4") == ParameterName("cogging_sin_4", Direction.SHARED)


def test_whole_periods_average_out_of_a_hold() -> None:
    """A segment carries the means of its columns: zero over whole periods, whatever its middle is at."""
    t = np.arange(1000, dtype=float) / 1000
    q = 2 * np.pi * t / 4 + 0.3
    run = Record(file="a.csv", time=t, position=q, velocity=np.full(t.size, np.pi / 2), torque=np.zeros(t.size))
    found = Segment(
        file="a.csv", start=0, stop=t.size, velocity=1.0, torque=0.3, standard_error=None, accepted=True, position=1.0
    )
    asked = with_orders(("cogging", "ripple"), (4,), "revolute")
    (loaded,) = with_loads(run, (found,), asked)
    problem = points_problem([loaded], ("both",), asked)
    assert problem.linear[0, 2:] == pytest.approx(np.zeros(4), abs=1e-12)
    assert [name.name for name in problem.linear_names[2:]] == list(load_columns(asked, lambda _: q, q.size))

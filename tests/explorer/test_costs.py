"""The cost map in JavaScript is that of Python, cell by cell, on points of constant velocity and on a moving run."""

from importlib.resources import files
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from bristle.model import functions
from bristle.model.law import is_passive
from bristle.model.parameters import Lugre, Pair
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate
from bristle.questions.explorer import engine
from bristle.questions.explorer.data import explored

from .conftest import Explored, Node

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
        "job": 1,
        "n": 4,
        "names": [x[0], y[0]],
        "ends": [x[1], y[1]],
        "pair": now | law,
        "identified": found | law,
        **of,
    }
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

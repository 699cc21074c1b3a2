import math
import re
import sys
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bristle.errors import InputError
from bristle.model import functions
from bristle.model.formula import abbreviated, as_latex, as_text, formula_of
from bristle.model.parameters import Lugre
from bristle.questions.sensitivity.formulas import formulas
from bristle.simulation.edro import TABLE_1

from ..conftest import run

paper = cache(formulas)  # those of the paper's law, made once
GRIPPER = TABLE_1["gripper rotation"].positive
CALLS: dict[str, Callable[[float], float]] = {"abs": abs, "exp": math.exp, "sign": lambda x: float((x > 0) - (x < 0))}


def value(text: str, names: Mapping[str, float]) -> float:
    """A printed formula at some values."""
    return float(eval(text, {"__builtins__": {}}, {**CALLS, **names}))  # noqa: S307  # bristle's own formula


def python_of(latex: str) -> str:
    """The LaTeX that SymPy writes as Python: from the inside out, so that braces never nest; a space is a product."""
    text = re.sub(r"\\?(alpha|sigma|v)_\{(\w)\}", r"\1_\2", latex)
    text = text.replace(r"\left|{", "ABS{").replace(r"}\right|", "}").replace(r"\operatorname{sign}", "SIGN")
    text = text.replace(r"\left(", "(").replace(r" \right)", ")").replace(r"\right)", ")").replace(r"\cdot", "*")
    for _ in range(20):
        text = re.sub(r"\be\^\{([^{}]*)\}", r"exp(\1)", text)
        text = re.sub(r"\\frac\{([^{}]*)\}\{([^{}]*)\}", r"((\1)/(\2))", text)
        text = re.sub(r"(?<!\be)\^\{([^{}]*)\}", r"**(\1)", text)
        text = re.sub(r"(ABS|SIGN)\{([^{}]*)\}", lambda call: f"{call[1].lower()}({call[2]})", text)
    return re.sub(r"(?<=[\w)]) +(?=[\w(])", "*", text)


def point(z: float, v: float, p: Lugre[float]) -> dict[str, float]:
    """Values by name."""
    return {"z": z, "v": v, **p._asdict()}


positive = st.floats(0.05, 5.0)
sets = st.builds(Lugre, *[positive] * 6)
deflections = st.floats(-2.0, 2.0)
velocities = st.floats(-3.0, 3.0).filter(lambda v: abs(v) > 1e-3)


@given(deflections, velocities, sets)
def test_derivatives_are_casadis(z: float, v: float, p: Lugre[float]) -> None:
    """Each printed derivative of T_f, and of the steady torque, has the value of CasADi's own function anywhere."""
    names = point(z, v, p)
    _, *slopes = (float(x) for x in functions.torque_sensitivity_function()(z, v, *p))
    for name, slope in zip(("z", *Lugre._fields), slopes, strict=True):
        assert value(as_text(paper().partial[name]), names) == pytest.approx(slope, rel=1e-9, abs=1e-12)
    slopes = [float(x) for x in functions.steady_jacobian_function()(v, *p[:4])]
    for name, slope in zip(Lugre._fields, [*slopes, 0.0, 0.0], strict=True):
        assert value(as_text(paper().steady[name]), names) == pytest.approx(slope, rel=1e-9, abs=1e-12)
    # with g for g(v) each formula keeps its value, as text and as LaTeX, and g is the Stribeck curve (5)
    g = value(as_text(paper().stribeck), names)
    assert g == pytest.approx(p.alpha_0 + p.alpha_1 * math.exp(-((v / p.v_s) ** 2)), rel=1e-12)
    for formula in (paper().torque, *paper().partial.values()):
        whole, short = value(as_text(formula), names), abbreviated(formula, paper().stribeck)
        for written in (as_text(short), python_of(as_latex(short))):
            assert value(written, names | {"g": g}) == pytest.approx(whole, rel=1e-9, abs=1e-12)


def test_printed_formulas(monkeypatch: pytest.MonkeyPatch) -> None:
    """The formulas read as one would write them by hand, in the terminal and in LaTeX."""
    short = {row.what: row.with_g for row in paper().rows()}
    assert short["dT_f/dalpha_0 at fixed z"] == "sigma_0*sigma_1*z*abs(v)/g**2"
    assert short["dT_f/dalpha_2 at fixed z"] == "v"
    assert short["dT_f/dsigma_0 at fixed z"] == "z - sigma_1*z*abs(v)/g"
    assert short["dT_ss/dalpha_0, steady sliding"] == "sign(v)"
    assert short["g(v)"] == "alpha_0 + alpha_1*exp(-v**2/v_s**2)"
    assert as_latex(paper().partial["z"]).startswith(
        r"- \frac{\sigma_{0} \sigma_{1} \left|{v}\right|}{\alpha_{0} + \alpha_{1}"
    )
    # each formula in docs/sensitivity.md is the one that the command prints with g, character for character
    docs = (Path(__file__).parents[2] / "docs" / "sensitivity.md").read_text(encoding="utf-8")
    shown = dict(re.findall(r"^(.+)\n    = (.+)$", docs, flags=re.MULTILINE))
    assert len(shown) == 3
    assert shown.items() <= short.items()
    # an operation that has no place in a formula raises ValueError with its number
    with pytest.raises(ValueError, match="cannot be written"):
        formula_of(ca.atan2(X, Y))
    # (19) as printed is dT_f / dalpha_1 term by term, not dT_f / dalpha_0; the values are those of docs/paper.md
    assert paper().printed_is == ("alpha_1",)
    assert paper().printed == paper().partial["alpha_1"] != paper().partial["alpha_0"]
    at = point(0.003, 0.03, GRIPPER)
    assert value(as_text(paper().printed), at) == pytest.approx(0.0149170, abs=5e-8)
    assert value(as_text(paper().partial["alpha_0"]), at) == pytest.approx(0.0177452, abs=5e-8)
    # a missing SymPy is said in one sentence, with the command that installs it; on the command line that is all
    monkeypatch.setitem(sys.modules, "sympy", None)
    with pytest.raises(InputError, match=r"pip install 'bristle\[sensitivity\]'"):
        formulas()
    ran = run("sensitivity", "--symbolic")
    assert (ran.code, len(ran.said)) == (2, 1)
    assert "formulas need SymPy" in ran.said[0]


NAMES = ("a", "b")
X, Y = map(ca.SX.sym, NAMES)
leaves = st.sampled_from([X, Y, ca.SX(1.0), ca.SX(2.0), ca.SX(0.5)])


def grown(parts: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Larger expressions of smaller ones, defined and moderate where the names are positive and near one."""
    two = st.tuples(parts, parts)
    return st.one_of(
        two.map(lambda xy: xy[0] + xy[1]), two.map(lambda xy: xy[0] * xy[1]), two.map(lambda xy: xy[0] - xy[1]),
        two.map(lambda xy: xy[0] / (1 + xy[1] ** 2)), parts.map(lambda x: x**2), parts.map(lambda x: -x),
        parts.map(ca.fabs), parts.map(lambda x: ca.exp(-(x**2))), parts.map(lambda x: 1 / (2 + ca.fabs(x))),
    )  # fmt: skip  # a list of ways


@given(st.recursive(leaves, grown, max_leaves=8), st.floats(0.5, 1.5), st.floats(0.5, 1.5))
def test_any_expression_keeps_its_value(expression: Any, a: float, b: float) -> None:
    """Whatever is collected, reordered and written has the value of the CasADi expression, as text and as LaTeX."""
    exact = float(ca.Function("f", [X, Y], [expression])(a, b))
    formula = formula_of(expression)
    for written in (as_text(formula), python_of(as_latex(formula))):
        assert value(written, {"a": a, "b": b}) == pytest.approx(exact, rel=1e-9, abs=1e-9)


@given(st.recursive(leaves, grown, max_leaves=4), st.recursive(leaves, grown, max_leaves=4))
def test_order_does_not_matter(first: Any, second: Any) -> None:
    """Sums and products are the same formula either way round, and what is taken off itself is nothing."""
    assert formula_of(first + second) == formula_of(second + first)
    assert formula_of(first * second) == formula_of(second * first)
    assert as_text(formula_of(first - first)) == "0"

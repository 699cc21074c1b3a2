import ast
from collections.abc import Iterator
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from bristle.findings import NOTE, Finding, Severity, unit_of, with_subjects
from bristle.identification.verdict import WEIGHTIEST_FIRST
from bristle.model.parameters import units_of
from bristle.page.said import entries

from .source import SOURCE, nodes, trees


def test_findings_are_values_that_are_explained() -> None:
    """One comes back from JSON as it was, an open bound and no number too; parts of it that are findings become their text."""
    part = Finding("sum", NOTE, "A part.")
    ends, count = (-np.inf, np.float64(2.5)), np.int64(3)
    numbers = {"ends": ends, "count": count, "none": np.nan, "why": part, "names": ("a", "b")}
    made = Finding("strays", Severity.CRITICAL, "As it was.", numbers, {"friction": 0.1}, ("static", "+"))
    read = TypeAdapter(Finding)
    back = read.validate_json(read.dump_json(made))
    assert (back.code, back.severity, str(back), back.effect, back.subject) == (
        "strays", "critical", "As it was.", {"friction": 0.1}, ("static", "+"),
    )  # fmt: skip  # a value
    assert np.isnan(back.numbers["none"])
    assert {**back.numbers, "none": 0} == {
        "ends": (-np.inf, 2.5), "count": 3, "none": 0, "why": "A part.", "names": ("a", "b"),
    }  # fmt: skip  # a value
    # a joint's findings give its units; before the joint is known there are none, and what a file calls something stays as it is
    name = "{velocity} %s $x$ <b>"
    made = Finding("x", NOTE, f"{name}: {2.0:.3g}{unit_of('torque')} at {0.5:.3g}{unit_of('velocity')}.")
    assert str(made) == f"{name}: 2 at 0.5."
    shown: dict[Any, str] = {
        "revolute": "2 N*m at 0.5 rad/s.",
        "prismatic": "2 N at 0.5 m/s.",
        "revolute in A": "2 A at 0.5 rad/s.",
    }
    for kind, words in shown.items():
        (told,) = with_subjects((made,), {}, units_of(kind))
        assert str(told) == f"{name}: {words}"
    # each code that src makes is explained under its severity, in words without braces
    made = dict(codes())
    assert {code for code, x in entries().items() if made.get(code) != x.severity} == set()
    assert made.keys() - entries().keys() == set()
    for x in entries().values():
        assert x.reason.endswith("."), x.code
        assert x.advice.endswith("."), x.code
        assert not set("{}") & set(x.meaning + x.advice), x.code
    assert WEIGHTIEST_FIRST.keys() <= made.keys()
    # no file asks whether a text begins with, ends with or holds several words
    found = {(path.relative_to(SOURCE).as_posix(), text) for path, tree in trees().items() for text in decisions(tree)}
    assert found == set()
    # the search itself finds what it is for
    sources = (
        'warning.startswith("The fit")', 'any("only a sum" in d for d in warnings)', 'x = d.endswith(("a b", "c"))',
        'd not in ("They agree.",)', 'f"No bootstrap: {n}" in d',
    )  # fmt: skip  # a list
    assert not [source for source in sources if not list(decisions(ast.parse(source)))]
    # what asks it for words must say `str`
    assert not isinstance(Finding("x", NOTE, "x"), str)
    assert not hasattr(Finding, "startswith")


def codes() -> Iterator[tuple[str, str]]:
    for of_file in nodes().values():
        for node in of_file:
            match node:
                case ast.Call(func=ast.Name(id="Finding"), args=[code, severity, *_]):
                    for one in texts(code):
                        yield one, severity.id.lower() if isinstance(severity, ast.Name) else ""
                case _:
                    pass


def texts(node: ast.expr) -> Iterator[str]:
    """What an expression may be: a text, or one of two."""
    if isinstance(node, ast.IfExp):
        yield from (*texts(node.body), *texts(node.orelse))
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value


def decisions(tree: ast.AST) -> Iterator[str]:
    """Texts of several words that a file asks for by `startswith`, `endswith` or `in`."""
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Attribute(attr="startswith" | "endswith"), args=operands):
                asked = operands
            case ast.Compare(left=left, ops=[ast.In() | ast.NotIn(), *_], comparators=others):
                asked = [left, *others]
            case _:
                asked = []
        held = (x.value for operand in asked for x in ast.walk(operand) if isinstance(x, ast.Constant))
        yield from (text for text in held if isinstance(text, str) and " " in text.strip())

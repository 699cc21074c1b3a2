"""Diagnostics: every kind makes a sentence, they are values, src makes each with its numbers, and nothing is decided by words."""

import ast
import os
import re
from collections.abc import Iterator
from dataclasses import FrozenInstanceError
from pathlib import Path
from string import Formatter
from textwrap import fill
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from bristle.diagnostics import REASONS, Diagnostic, Kind, Severity, with_subjects
from bristle.model.parameters import units_of
from bristle.page.entries import entry

SOURCE = Path(__file__).parents[1] / "src" / "bristle"
WARNINGS = SOURCE.parents[1] / "docs" / "warnings.md"
TREES = {
    path.relative_to(SOURCE).as_posix(): ast.parse(path.read_text(encoding="utf-8"))
    for path in sorted(SOURCE.rglob("*.py"))
}
KINDS = list(Kind.__members__.values())
"""All, those that Python took for another's alias included."""

WORDS = ("abc+", "X-1 <b>", "0.5*q & 'r'", "/_.")
OF_CONVERSION: dict[str, tuple[Any, ...]] = {
    **dict.fromkeys("ljmt", (WORDS[:1], WORDS)),
    "g": ((-1e6,), (0.0, 1e-7, 123456.789)),
    "e": (0, 1, 1000),
    **dict.fromkeys("cnpx", (((WORDS[0], 0.0),), tuple((word, -2.5e5) for word in WORDS))),
    "i": (((WORDS[0], -1.0, np.inf),), tuple((word, 1e-3, 2e5) for word in WORDS[1:])),
    **dict.fromkeys("bd", ("+", "-", "both")),
    "w": (True, False),
    "u": WORDS,
}
"""What a field with this conversion may be."""


def fields(kind: Kind) -> dict[str, tuple[str, str]]:
    """Conversion and format of each number that a kind's sentence names."""
    return {
        name: (conversion or "", spec or "")
        for _, name, spec, conversion in Formatter().parse(kind.template)
        if name is not None
    }


def values(kind: Kind) -> Iterator[dict[str, Any]]:
    """Plausible numbers of a kind: words, counts or a part of a sentence where nothing else is asked."""
    plain, counted = (*WORDS, 7, Kind.BOUND(name=WORDS[1])), (-1e6, 0.0, 3, 1000)
    of = {name: OF_CONVERSION.get(c) or (counted if spec else plain) for name, (c, spec) in fields(kind).items()}
    for k in range(max(map(len, of.values()), default=1)):
        yield {name: x[k % len(x)] for name, x in of.items()}


def wrong_with(kind: Kind, given: dict[str, Any]) -> bool:
    """Whether a sentence is not one line without braces that holds each word given, or not the same, made again."""
    made, sentence = kind(**given), str(kind(**given))
    told = [
        (given[name] if conversion in {"l", "j", "m", "t"} else (str(given[name]),))
        for name, (conversion, spec) in fields(kind).items()
        if conversion in {"l", "j", "m", "t"} or not (conversion or spec)
    ]
    as_text = sentence.strip() and sentence.isprintable() and not set("{}") & set(sentence)
    again = made == kind(**given) and hash(made) == hash(kind(**given)) and made.severity is kind.severity
    return not (as_text and again and all(word in sentence for words in told for word in words))


def test_every_kind_makes_a_sentence() -> None:
    """With any plausible numbers it is one line that holds each word given; it equals itself, made again, and has a severity."""
    assert {kind.name for kind in KINDS for given in values(kind) if wrong_with(kind, given)} == set()
    assert all(isinstance(kind.severity, Severity) for kind in KINDS)


def test_every_kind_has_its_severity_for_one_reason() -> None:
    """Each kind stands at exactly one reason, a sentence; the kinds of a reason have one severity."""
    named = [name for names in REASONS.values() for name in names.split()]
    assert sorted(named) == sorted(Kind.__members__)
    assert all(len({Kind[name].severity for name in names.split()}) == 1 for names in REASONS.values())
    assert all(reason[0].isupper() and reason.endswith(".") for reason in REASONS)


def entries() -> Iterator[str]:
    """Every kind by severity and reason, in Markdown: a heading, which is the anchor, and a paragraph."""
    titles = {Severity.CRITICAL: "Critical", Severity.CAUTION: "Caution", Severity.NOTE: "Notes"}
    for severity in Severity:
        yield f"### {titles[severity]}"
        for names in REASONS.values():
            for kind in (Kind[name] for name in names.split()):
                if kind.severity is severity:
                    x = entry(kind)
                    yield f"#### {x.code}"
                    yield wrapped(x.meaning(lambda name: f"*{name}*", escaped))
                    yield wrapped(
                        f"**{x.severity}**: {x.reason} **{'What to do' if x.own else 'In general'}:** {x.advice}"
                    )


def escaped(text: str) -> str:
    """Text that Markdown shows as it is; code in backticks stays code."""
    parts = text.split("`")
    parts[::2] = [re.sub(r"([\\*_<>\[\]|])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


def wrapped(paragraph: str) -> str:
    """Lines of at most 120 characters, none of which begins as a list, a heading or a quotation would."""
    return re.sub(
        r"^([-+#>]|\d+\.)(?= |$)",
        r"\\\1",
        fill(paragraph, 118, break_long_words=False, break_on_hyphens=False),
        flags=re.M,
    )


def test_the_entries_of_the_document_are_those_of_the_code() -> None:
    """docs/warnings.md ends with an entry for every kind, under its code; BRISTLE_REGENERATE=1 rewrites them."""
    text = WARNINGS.read_text(encoding="utf-8")
    before, mark, _ = text.partition(
        "<!-- every kind, made by BRISTLE_REGENERATE=1 pytest tests/test_diagnostics.py -->\n"
    )
    assert mark
    written = "\n" + "\n\n".join(entries()) + "\n"
    if os.environ.get("BRISTLE_REGENERATE"):
        WARNINGS.write_text(before + mark + written, encoding="utf-8")
    assert WARNINGS.read_text(encoding="utf-8") == before + mark + written


def test_no_two_kinds_share_a_sentence() -> None:
    """Each template is one kind's alone, and none is an alias of another."""
    assert len(KINDS) == len(list(Kind))
    assert len({kind.template for kind in KINDS}) == len(KINDS)


def test_fields_have_names_and_nothing_is_looked_up_inside_them() -> None:
    """A template names its numbers plainly, so that a number from a file is never formatted by itself; conversions are those that are known."""
    for kind in KINDS:
        assert all(name.isidentifier() for name in fields(kind)), kind
        assert {conversion for conversion, _ in fields(kind).values()} <= {"", *OF_CONVERSION}, kind
        assert not any("{" in spec for _, spec in fields(kind).values()), kind
        assert kind.template.startswith(kind.title)


def test_a_diagnostic_is_a_value() -> None:
    """Equal and of one hash where kind and numbers are; NumPy's numbers are Python's; it cannot be assigned to."""
    made = Kind.FEW_STARTS(reached=1, starts=4)
    same, other = Kind.FEW_STARTS(reached=1, starts=4), Kind.FEW_STARTS(reached=2, starts=4)
    assert made == same
    assert made != other
    assert Kind.EDGES(edges=3) != Kind.RESIDUAL_BLOCKS(blocks=3)
    assert len({made, same, other}) == 2
    counted = Kind.FEW_STARTS(reached=np.int64(1), starts=np.int64(4))
    assert counted == made
    assert {type(x) for x in counted.numbers.values()} == {int}
    assert type(Kind.ILL_CONDITIONED(condition=np.float64(1e4)).numbers["condition"]) is float
    with pytest.raises(FrozenInstanceError):
        made.kind = Kind.BOUND  # type: ignore[misc]


def test_a_diagnostic_of_another_version_keeps_its_sentence() -> None:
    """One that lacks a number which its sentence names by now is read with the sentence that was written."""
    read = TypeAdapter(Diagnostic)
    written = {
        "kind": "STRAYS",
        "severity": "caution",
        "text": "As it was.",
        "numbers": {"count": 1},
        "subject": ["static", "+"],
    }
    found = read.validate_python(written)
    assert (str(found), found.kind, found.subject) == ("As it was.", Kind.UNKNOWN, ("static", "+"))


@pytest.mark.parametrize(
    ("kind", "shown"),
    [("revolute", "2 N*m at 0.5 rad/s"), ("prismatic", "2 N at 0.5 m/s"), ("revolute in A", "2 A at 0.5 rad/s")],
)
def test_numbers_have_the_units_of_their_joint(kind: Any, shown: str) -> None:
    """A joint's warnings give its units, in the parts of a sentence too; before the joint is known there are none."""
    part = Kind.POINT_NAMED(file="log.csv", where="row 1", torque=2.0, velocity=0.5)
    whole = Kind.UNKNOWN(text=part)
    assert str(whole) == str(part) == "log.csv row 1 (2 at 0.5)"
    told = with_subjects((whole, part), {}, units_of(kind))
    assert [str(x) for x in told] == [f"log.csv row 1 ({shown})"] * 2
    assert told == (whole, part)
    assert hash(told[0]) == hash(whole)


def test_every_quantity_has_a_unit() -> None:
    """What stands after a number's format is a signal or a parameter."""
    specs = [spec for kind in KINDS for _, _, spec, _ in Formatter().parse(kind.template) if spec and " " in spec]
    quantities = {spec.partition(" ")[2] for spec in specs}
    assert {"velocity", "torque", "position"} <= quantities
    assert quantities <= units_of("revolute").keys()


def test_but_changes_a_copy() -> None:
    """`but` gives another sentence and leaves the first; a part of a sentence is a diagnostic of its own."""
    asked = Kind.DURATION_ASKED(asked=0.2)
    made = Kind.TOO_SHORT(duration=0.02, asked=asked, option="", alone=True)
    before = str(made)
    other = made.but(alone=False)
    assert str(asked) in before
    assert before.endswith("A longer hold would make it pass.")
    assert str(other).endswith("A longer hold would remove this reason, not the other.")
    assert str(made) == before
    assert other != made
    assert other.kind is made.kind
    assert other.but(alone=True) == made
    assert str(made.but(asked=Kind.DEPENDENT_TORQUE())) != before


def test_a_number_from_a_file_stays_as_it_is() -> None:
    """Braces and conversions in a name are text."""
    name = "{kind} {0!r:>99} %s $x$ <b>"
    assert str(Kind.SINGLE_RUN()) == Kind.SINGLE_RUN.template
    assert str(Kind.OUTLIER(file=name, torque=0.1, runs=3, direction="both", median=0.2)).startswith(f"{name} is an ")


# how src makes and asks for them


def made(tree: ast.AST) -> Iterator[tuple[Kind, set[str]]]:
    """Each kind that a file calls, with the names of the numbers given; a call with ** is left out."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and (kind := named(node.func)) and all(k.arg for k in node.keywords):
            assert not node.args, ast.unparse(node)
            yield kind, {str(k.arg) for k in node.keywords}


def named(node: ast.AST) -> Kind | None:
    """The kind that an expression like `Kind.BOUND` names."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "Kind":
        return Kind.__members__.get(node.attr)
    return None


def test_src_gives_each_kind_the_numbers_of_its_sentence() -> None:
    """Each call of a kind names what its template names, no more and no less; `alone` is told by `but` when all reasons are known."""
    found = [
        (name, kind.name)
        for name, tree in TREES.items()
        for kind, given in made(tree)
        if given | ({"alone"} & set(fields(kind))) != set(fields(kind))
    ]
    assert found == []


def test_every_kind_is_made_somewhere() -> None:
    """No sentence stands in the table that nothing says."""
    used = {
        kind
        for name, tree in TREES.items()
        if name != "diagnostics.py"
        for node in ast.walk(tree)
        if (kind := named(node))
    }
    assert set(KINDS) - used == set()


ALLOWED = {
    ("simulation/edro.py", "Ramp controller"): "an assumption of the data that ship with it, replaced by its own words",
}
"""Where a text of several words is asked for, and why that is no decision by what a diagnostic says; no reader of data is among them."""
CONSTANTS = {
    target.id: node.value.value
    for tree in TREES.values()
    for node in tree.body
    if isinstance(node, ast.Assign | ast.AnnAssign)
    for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
    if isinstance(target, ast.Name) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
}
"""Texts that modules name: a decision by a name is one by what it stands for."""


def phrases(node: ast.AST) -> Iterator[str]:
    """Texts with a space that an operand is, or has among its items."""
    match node:
        case ast.Constant(value=str(text)) if " " in text:
            yield text
        case ast.Name(id=name) | ast.Attribute(attr=name) if " " in CONSTANTS.get(name, ""):
            yield CONSTANTS[name]
        case ast.JoinedStr(values=items) | ast.Tuple(elts=items) | ast.List(elts=items) | ast.Set(elts=items):
            for item in items:
                yield from phrases(item)
        case ast.FormattedValue(value=inner):
            yield from phrases(inner)
        case _:
            return


def decisions(tree: ast.AST) -> Iterator[str]:
    """Texts of several words that a file asks for by `startswith`, `endswith` or `in`."""
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Attribute(attr="startswith" | "endswith"), args=args):
                for operand in args:
                    yield from phrases(operand)
            case ast.Compare(left=left, ops=ops, comparators=others) if any(
                isinstance(op, ast.In | ast.NotIn) for op in ops
            ):
                for operand in (left, *others):
                    yield from phrases(operand)
            case _:
                pass


def test_nothing_is_decided_by_a_sentence() -> None:
    """No file asks whether a text begins with, ends with or holds several words, but for the places allowed, each of which is there."""
    found = {(name, text) for name, tree in TREES.items() for text in decisions(tree)}
    assert found == set(ALLOWED)


@pytest.mark.parametrize(
    "source",
    [
        'warning.startswith("The fit")',
        'any("only a sum" in d for d in warnings)',
        'x = d.endswith(("a b", "c"))',
        'd not in ("They agree.",)',
        'f"No bootstrap: {n}" in d',
    ],
)
def test_a_decision_by_a_sentence_is_seen(source: str) -> None:
    """The search itself finds what it is for."""
    assert list(decisions(ast.parse(source)))


def test_a_diagnostic_has_no_words_of_its_own() -> None:
    """It is no text: what asks it for words must say `str`."""
    assert not isinstance(Kind.BOUND(name="alpha_0"), str)
    assert not hasattr(Diagnostic, "startswith")

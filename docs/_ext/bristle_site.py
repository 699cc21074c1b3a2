"""What the site makes of the code when it is built: the Python reference, the commands, the results file, and formulas as MathML.

A page of docs/ asks for each by a comment (`<!-- commands -->`), which GitHub does not show.
"""

import ast
import inspect
import json
import re
from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import typer.main
from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx

import bristle
from bristle import cli

DOCS = Path(__file__).parents[1]
RETURNED = (
    "bristle.identification.results.Joint",
    "bristle.findings.Finding",
    "bristle.findings.Severity",
    "bristle.identification.measured.Measured",
    "bristle.questions.compensation.study.Study",
    "bristle.questions.experiment_design.plan.Plan",
    "bristle.questions.sensitivity.study.SensitivityStudy",
    "bristle.questions.explorer.page.Explorer",
    "bristle.questions.method_validation.results.Validation",
    "bristle.questions.session_comparison.results.Comparison",
    "bristle.page.report.Report",
    "bristle.page.report.Page",
    "bristle.page.report.Section",
    "bristle.page.report.Answer",
    "bristle.page.report.Table",
    "bristle.page.page.Drawing",
    "bristle.errors.InputError",
)
"""Classes that `bristle` returns or raises, and does not name itself."""


def commands() -> Iterator[str]:
    """Every command: what it does, its arguments and its options, from the application itself."""
    root: Any = typer.main.get_command(cli.app)
    for name, command in root.commands.items():
        yield f"## bristle {name}\n"
        context = command.make_context(name, [], resilient_parsing=True)
        arguments = [p.metavar for p in command.params if p.param_type_name == "argument"]
        yield f"```text\n{' '.join(['bristle', name, '[OPTIONS]', *arguments])}\n```\n"
        for paragraph in inspect.cleandoc(command.help).split("\n\n"):
            word, _, example = paragraph.partition(": ")
            yield f"Example:\n\n```sh\n{example}\n```\n" if word == "Example" else f"{_plain(paragraph)}\n"
        yield "| argument or option | meaning |\n| --- | --- |"
        for parameter in command.params:
            argument = parameter.param_type_name == "argument"
            record = (parameter.metavar, parameter.help) if argument else parameter.get_help_record(context)
            yield f"| `{_one_cell(record[0])}` | {_one_cell(_plain(record[1] or ''))} |"
        yield ""


def python() -> Iterator[str]:
    """Every public name of `bristle`, from its docstring: functions, then classes, then what these return and raise."""
    names = [name for name in bristle.__all__ if not name.startswith("__")]
    classes = [name for name in names if inspect.isclass(getattr(bristle, name))]
    functions = [name for name in names if name not in classes]
    yield "## Functions\n"
    yield "| name | what it does |\n| --- | --- |"
    yield from (
        f"| {{py:func}}`bristle.{name}` | {_one_cell(_summary(getattr(bristle, name)))} |" for name in functions
    )
    yield ""
    yield from (_directive("autofunction", f"bristle.{name}") for name in functions)
    yield "## Classes\n"
    yield from (_directive("autoclass", f"bristle.{name}", ":members:") for name in classes)
    yield "## Returned and raised\n"
    yield "Not names of `bristle` itself; functions return or raise them.\n"
    yield from (_directive("autoclass", name, ":members:") for name in RETURNED)
    yield "## Version\n"
    yield _directive("autodata", "bristle.__version__", ":no-value:")


def results() -> Iterator[str]:
    """Every object of results.json with its fields, from the schema."""
    schema = json.loads((DOCS / "results.schema.json").read_text(encoding="utf-8"))
    for name, part in {"The file": schema, **schema["$defs"]}.items():
        yield f"## {name}\n"
        yield f"{_plain(part.get('description', ''))}\n"
        if "enum" in part:
            yield f"One of {', '.join(f'`{json.dumps(value)}`' for value in part['enum'])}.\n"
        if "properties" in part:
            said = {field: _plain(_said_of().get((name, field), "")) for field in part["properties"]}
            yield (
                "| field | type | meaning |\n| --- | --- | --- |"
                if any(said.values())
                else "| field | type |\n| --- | --- |"
            )
            for field, value in part["properties"].items():
                meaning = f" {_one_cell(said[field])} |" if any(said.values()) else ""
                yield f"| `{field}` | {_type(value)} |{meaning}"
            yield ""


@cache
def _said_of() -> dict[tuple[str, str], str]:
    """What stands below a field in its class, by the names of both; the schema has the types alone, and a class's name is one class."""
    found = {}
    for path in (DOCS.parent / "src" / "bristle").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ClassDef):
                continue
            for field, below in pairwise(node.body):
                match field, below:
                    case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                        found[node.name, name] = text
    return found


def _type(value: dict[str, Any]) -> str:
    """A JSON type in words, with a link where it is an object of its own."""
    match value:
        case {"$ref": ref}:
            name = ref.rpartition("/")[2]
            words = f"[{name}](#{_slug(name)})"
        case {"anyOf": options} | {"oneOf": options}:
            words = " or ".join(dict.fromkeys(map(_type, options)))
        case {"const": constant}:
            words = f"`{json.dumps(constant)}`"
        case {"enum": options}:
            words = " or ".join(f"`{json.dumps(option)}`" for option in options)
        case {"type": "array", "items": items} if items:
            words = f"list of {_type(items)}"
        case {"type": "array", "prefixItems": items}:
            words = f"[{', '.join(map(_type, items))}]"
        case {"type": "object", "additionalProperties": dict(inner)} if inner:
            words = f"object of {_type(inner)}"
        case {"type": str(kind)}:
            words = kind
        case _:
            words = "any"
    return words


def _slug(title: str) -> str:
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def _summary(thing: Any) -> str:
    return _plain((inspect.getdoc(thing) or "").partition("\n\n")[0])


def _directive(name: str, argument: str, *options: str) -> str:
    """An autodoc directive, which is reStructuredText."""
    lines = [f".. {name}:: {argument}", *(f"   {option}" for option in options)]
    return "```{eval-rst}\n" + "\n".join(lines) + "\n```\n"


def _plain(text: str) -> str:
    """Text in which Markdown reads nothing but code in backticks."""
    parts = text.split("`")
    parts[::2] = [re.sub(r"([\\*_<>\[\]$])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


def _one_cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


OUTSIDE = {"../README.md": "index.md", "../datasets/edro/README.md": "edro.md"}
"""Documents beside docs/ that have a page on the site."""


def moved(link: re.Match[str]) -> str:
    """A link out of docs/, which GitHub follows: to its page on the site, or to a copy of the file."""
    path, heading = link[1], link[2] or ""
    if path in OUTSIDE:
        return f"]({OUTSIDE[path]}{'' if OUTSIDE[path] == 'index.md' else heading})"
    return f"](path:{path})"


MADE: dict[str, Callable[[], Iterator[str]]] = {"commands": commands, "python": python, "results": results}
"""By the comment that asks for it."""


def fill(_app: Sphinx, _name: str, source: list[str]) -> None:
    """Put what is made in the place of the comment, and the pages of the site in place of the files that GitHub has."""
    source[0] = re.sub(r"\]\((\.\./[^)#\s]+)(#[^)]*)?\)", moved, source[0])
    for name, make in MADE.items():
        mark = f"<!-- {name} -->"
        if mark in source[0]:
            source[0] = source[0].replace(mark, "\n".join(make()))


def literal(_app: Sphinx, _what: str, _name: str, _thing: Any, _options: Any, lines: list[str]) -> None:
    """Docstrings are text with code in backticks, and formulae in which * multiplies: none of it is markup of reStructuredText."""
    example = False
    for k, line in enumerate(lines):
        example = line.lstrip().startswith(">>>") or (example and bool(line.strip()))
        if not example:
            parts = line.split("`")
            parts[::2] = [re.sub(r"([\\*|])|(_)(?!\w)", r"\\\1\2", part) for part in parts[::2]]
            lines[k] = "``".join(parts)


def visit_math(self: Any, node: nodes.Element) -> None:
    """A formula as MathML, which browsers draw without a script."""
    block = isinstance(node, nodes.math_block)
    text = tex2mathml(node.astext(), as_block=block)
    self.body.append(f'<div class="formula">{text}</div>' if block else text)
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register."""
    app.connect("source-read", fill)
    app.connect("autodoc-process-docstring", literal, priority=400)  # before napoleon
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True, "parallel_write_safe": True}

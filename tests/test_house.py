import ast
import re
import tomllib
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
import yaml

import bristle

from .conftest import SLOW
from .source import FILES, SOURCE, nodes, trees

ROOT = Path(__file__).parents[1]
GROUND = {"arrays", "errors", "findings", "progress", "workers"}
"""What every floor stands on; it imports nothing of ours."""
CORE = {"model", "estimation", "data", "control", "identification", "simulation"}
BELOW = {
    **{name: set[str]() for name in GROUND}, "model": set[str](), "estimation": set[str](),
    "data": {"model", "estimation"}, "control": {"model", "estimation"},
    "identification": {"model", "estimation", "data", "control"},
    "simulation": {"model", "estimation", "data", "control", "identification"}, "page": {"model"},
    "questions": {*CORE, "page"}, "api": {*CORE, "page", "questions"}, "mujoco": {*CORE, "page", "questions", "api"},
    "terminal": set[str](), "cli": {*CORE, "page", "questions", "api", "terminal"},
}  # fmt: skip  # a list of values
"""Each floor, and those that it may import from, beside itself and the ground. The kit of pages knows no result, least squares no friction."""
STAGES = {"static", "presliding", "dynamic"}  # folders of identification that only `identify.py` puts together
DRAWING = {"report", "sections", "figures"}  # how names of files end that make the pages of a question with a report.py
ENTRANCES = {"__init__", "__main__"}  # modules of the package itself: they may offer what any floor has
MODULES = {path.relative_to(SOURCE.parent).with_suffix("").parts for path in FILES}


def place(path: Path) -> tuple[str, ...]:
    """Where a file stands in the package: its floor, perhaps a folder of it, and its name."""
    return path.relative_to(SOURCE).with_suffix("").parts


@cache
def imported(path: Path) -> set[tuple[str, ...]]:
    """The places of the package that a file imports, at its top or inside a function."""
    names = set()
    for node in nodes()[path]:
        if isinstance(node, ast.Import):
            names |= {tuple(alias.name.split(".")) for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            module = tuple((node.module or "").split("."))
            names |= {(*module, alias.name) if (*module, alias.name) in MODULES else module for alias in node.names}
    return {name[1:] for name in names if name[0] == "bristle" and len(name) > 1}


def room(where: tuple[str, ...]) -> str | None:
    """The folder that must not know its neighbours: a question, or a stage of identification; None where there is no such rule."""
    folder = where[1] if len(where) > 1 else ""
    return folder if where[0] == "questions" or (where[0] == "identification" and folder in STAGES) else None


def test_imports_and_prints() -> None:
    """A file imports nothing from a floor above its own, and no import is relative."""
    found: list[tuple[str, object]] = []
    for path, of_file in nodes().items():
        floor = place(path)[0]
        relative = [node for node in of_file if isinstance(node, ast.ImportFrom) and node.level > 0]
        above = {where[0] for where in imported(path)} - {*BELOW.get(floor, set()), *GROUND, floor, "__version__"}
        if relative or (floor not in ENTRANCES and above):
            found.append((path.relative_to(SOURCE).as_posix(), above or "a relative import"))
    assert found == []
    # each folder and module of the package is on the list, so that none escapes it; no two floors stand on each other
    assert {place(path)[0] for path in FILES} == {*BELOW, *ENTRANCES}
    assert set(TopologicalSorter(BELOW).static_order()) == set(BELOW)
    # no file but terminal.py calls print, and by the floors none but cli.py knows that one
    prints = [
        path.name
        for path, of_file in nodes().items()
        for node in of_file
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
    ]
    assert set(prints) == {"terminal.py"}
    # no question imports another, nor does static, presliding or dynamic identification
    found = []
    for path in FILES:
        own = room(place(path))
        others = {room(where) for where in imported(path) if where[0] == place(path)[0]}
        if own is not None and not others <= {own, None}:
            found.append((path.relative_to(SOURCE).as_posix(), others - {own, None}))
    assert found == []
    # where a question has a report.py only that, sections and figures import what draws; nobody imports the report
    found = []
    for path in FILES:
        names = imported(path)
        if (path.parent / "report.py").exists() and path.stem.split("_")[-1] not in DRAWING:
            drawing = {("page", "page"), ("page", "report"), ("page", "style"), (*place(path)[:2], "figures")} & names
            found += (
                [(path.relative_to(SOURCE).as_posix(), drawing)] if drawing and place(path)[0] == "questions" else []
            )
        found += [(path.name, name) for name in names if name[:1] == ("questions",) and name[-1] == "report"]
    assert found == []


def test_levels_have_reasons_and_readers() -> None:
    """Each level has its unit and reason and is read where it applies, so that it can be changed; no module takes a private name of another."""
    levels = SOURCE / "estimation" / "levels.py"
    lines = levels.read_text(encoding="utf-8").splitlines()
    assigned = [node for node in trees()[levels].body if isinstance(node, ast.Assign)]
    names = {x.id: node.lineno for node in assigned for x in ast.walk(node.targets[0]) if isinstance(x, ast.Name)}
    read, private, bound = set[str](), set[str](), list[str]()
    for path, of_file in nodes().items():
        for node in of_file:
            if isinstance(node, ast.ImportFrom):
                taken = {alias.name for alias in node.names}
                bound += [
                    f"{path.stem}: {x}" for x in taken & names.keys() if node.module == "bristle.estimation.levels"
                ]
                private |= {f"{path.stem}: {x}" for x in taken if re.fullmatch("_[A-Z_]+", x)}
            elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "levels":
                read.add(node.attr)
        at_import: list[ast.AST] = [x for x in of_file if isinstance(x, ast.arguments)]
        bodies = [trees()[path].body, *(x.body for x in of_file if isinstance(x, ast.ClassDef))]
        at_import += [x for body in bodies for x in body if isinstance(x, ast.Assign | ast.AnnAssign)]
        bound += [
            f"{path.stem}: {x}"
            for node in at_import
            for x in re.findall(r"(?<!lambda: )levels\.([A-Z_]+)", ast.unparse(node))
        ]
    assert (private, bound) == (set(), [])
    assert [x for x, line in names.items() if x not in read or not re.search(r"  # \w.{9,}", lines[line - 1])] == []


def test_few_tests_are_slow(pytestconfig: pytest.Config) -> None:
    """At most 5 % of all tests are left to .ci/run, and CONTRIBUTING.md lists their files and no other."""
    slow, every = pytestconfig.stash[SLOW]
    if [Path(x).resolve() for x in pytestconfig.args] == [ROOT / "tests"]:  # where all were collected
        assert slow <= 0.05 * every
    files = {p.relative_to(ROOT / "tests").as_posix() for p in (ROOT / "tests").rglob("test_*.py")}
    marked = {x for x in files if re.search(r"mark\.slow\b", (ROOT / "tests" / x).read_text(encoding="utf-8"))}
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("Slow tests")[2]
    assert set(re.findall(r"`([\w/]+\.py)`", text)) == marked


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_one_version() -> None:
    """The package, the newest entry of the changelog and the citation name the same version."""
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest is not None
    assert newest[1] == bristle.__version__
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["version"] == bristle.__version__
    # `test-all` brings the tests and every extra that only some tests need, so that nothing has a reason to skip
    extras = PROJECT["project"]["optional-dependencies"]
    (everything,) = extras["test-all"]
    named = set(re.fullmatch(r"bristle\[(.+)\]", everything)[1].split(","))  # type: ignore[index]  # it matches, or the test fails
    packages = {requirement for name in named for requirement in extras[name]}
    optional = set(extras) - {"test", "test-all", "lint", "release", "benchmark"}
    assert {requirement for name in optional for requirement in extras[name]} <= packages

"""The house: imports run down only, no question or stage knows another, one name means one thing, and only the CLI prints."""

import ast
from collections import Counter
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "bristle"
GROUND = {"arrays", "diagnostics", "errors", "progress", "workers"}
"""What every floor stands on; it imports nothing of ours."""
CORE = {"model", "estimation", "data", "control", "identification", "simulation"}
BELOW = {
    **{name: set[str]() for name in GROUND},
    "model": set[str](),
    "estimation": set[str](),
    "data": {"model", "estimation"},
    "control": {"model", "estimation"},
    "identification": {"model", "estimation", "data", "control"},
    "simulation": {"model", "estimation", "data", "control", "identification"},
    "page": {"model"},
    "questions": {*CORE, "page"},
    "api": {*CORE, "page", "questions"},
    "mujoco": {*CORE, "page", "questions", "api"},
    "terminal": set[str](),
    "options": {"page"},
    "cli": {*CORE, "page", "questions", "api", "terminal", "options"},
}
"""Each floor, and those that it may import from, beside itself and the ground. The kit of pages knows no result, least squares no friction."""
STAGES = {"static", "presliding", "dynamic"}
"""Folders of identification that only `identify.py` puts together."""
ENTRANCES = {"__init__", "__main__"}
"""Modules of the package itself: they may offer what any floor has."""
FILES = sorted(SOURCE.rglob("*.py"))
MODULES = {path.relative_to(SOURCE.parent).with_suffix("").parts for path in FILES}


def place(path: Path) -> tuple[str, ...]:
    """Where a file stands in the package: its floor, perhaps a folder of it, and its name."""
    return path.relative_to(SOURCE).with_suffix("").parts


def imported(tree: ast.Module) -> set[tuple[str, ...]]:
    """The places of the package that a file imports, at its top or inside a function."""
    names = set()
    for node in ast.walk(tree):
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


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_imports_run_down_only(path: Path) -> None:
    """A file imports nothing from a floor above its own, and no import is relative."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level > 0]
    floor = place(path)[0]
    if floor not in ENTRANCES:
        assert {where[0] for where in imported(tree)} <= {*BELOW[floor], *GROUND, floor, "__version__"}


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_neighbours_do_not_know_each_other(path: Path) -> None:
    """No question imports another, nor does static, presliding or dynamic identification."""
    own = room(place(path))
    others = {
        room(where) for where in imported(ast.parse(path.read_text(encoding="utf-8"))) if where[0] == place(path)[0]
    }
    assert own is None or others <= {own, None}


@pytest.mark.parametrize(
    "folder", sorted({path.parent for path in FILES if place(path)[0] == "questions"}), ids=lambda p: p.name
)
def test_a_question_computes_before_it_draws(folder: Path) -> None:
    """Inside a question, computation imports neither tables nor figures nor page, tables no figures, figures no page.

    Methods of a class may, when they are called: a result prints, tabulates and writes itself by the tables and the page of its own question.
    """
    order = ("tables", "figures", "page")
    for path in folder.glob("*.py"):
        floor = next(
            (k + 1 for k, name in enumerate(order) if path.stem.endswith(name)), 0 if "section" not in path.stem else 3
        )
        tree = ast.parse(path.read_text(encoding="utf-8"))
        tree.body = [node for node in tree.body if not isinstance(node, ast.ClassDef)]
        known = {where[2] for where in imported(tree) if where[:2] == place(path)[:2] and len(where) > 2}
        above = {name for name in known if any(name.endswith(x) for x in order[floor:])}
        assert not above, path


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_only_the_cli_prints(path: Path) -> None:
    """No file but terminal.py calls print, and by the floors none but cli.py knows that one."""
    calls = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]
    assert path.name == "terminal.py" or not [c for c in calls if isinstance(c.func, ast.Name) and c.func.id == "print"]


def test_no_class_name_stands_twice() -> None:
    """A class's name means one class in the whole package, nested ones included."""
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in FILES]
    names = Counter(node.name for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
    assert not [name for name, count in names.items() if count > 1]


@pytest.mark.parametrize("folder", sorted({path.parent for path in FILES}), ids=lambda p: str(p.relative_to(SOURCE)))
def test_no_public_function_name_stands_twice_in_a_folder(folder: Path) -> None:
    """A public function's name means one module-level function of its folder; a command of cli.py is named as what it calls."""
    names = Counter(
        node.name
        for path in folder.glob("*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and not is_command(node)
    )
    assert not [name for name, count in names.items() if count > 1]


def is_command(function: ast.FunctionDef) -> bool:
    """Whether a function is decorated by `app.command()`, as the commands of cli.py are."""
    return any(ast.unparse(decorator) == "app.command()" for decorator in function.decorator_list)


def test_every_part_has_a_floor() -> None:
    """Each folder and module of the package is on the list, so that none escapes it; no two floors stand on each other."""
    assert {place(path)[0] for path in FILES} == {*BELOW, *ENTRANCES}
    assert set(TopologicalSorter(BELOW).static_order()) == set(BELOW)

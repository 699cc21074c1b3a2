"""The house: imports run down only, and only the CLI prints."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "bristle"
FLOORS = (
    "errors",
    "progress",
    "model",
    "data",
    "control",
    "identification",
    "bench",
    "edro",
    "compensation",
    "analysis",
    "report",
    "api",
    "cli",
)
"""From the ground up: each imports from itself and from those below. So data knows no controller, and identification no report."""
ENTRANCES = ("__init__", "__main__")
"""Modules of the package itself: they may offer what any floor has."""
FILES = sorted(SOURCE.rglob("*.py"))


def part(path: Path) -> str:
    """The folder or module directly under the package that a file belongs to."""
    return path.relative_to(SOURCE).with_suffix("").parts[0]


def imported(tree: ast.Module) -> set[str]:
    """The parts of the package that a file imports, at its top or inside a function."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name.split(".")[1] for name in names if name.startswith("bristle.")}


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_imports_run_down_only(path: Path) -> None:
    """A file imports nothing from a floor above its own; no import is relative."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level > 0]
    if part(path) in ENTRANCES:
        return
    above = set(FLOORS[FLOORS.index(part(path)) + 1 :])
    assert not imported(tree) & above


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_only_the_cli_prints(path: Path) -> None:
    """No file but cli.py calls print."""
    calls = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]
    assert path.name == "cli.py" or not [c for c in calls if isinstance(c.func, ast.Name) and c.func.id == "print"]


def test_every_part_has_a_floor() -> None:
    """Each folder and module of the package is on the list, so that none escapes it."""
    assert {part(path) for path in FILES} <= {*FLOORS, *ENTRANCES}

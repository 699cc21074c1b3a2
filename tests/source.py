"""The package as it is written, for tests that read it."""

import ast
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "src" / "bristle"
FILES = sorted(SOURCE.rglob("*.py"))


@cache
def trees() -> dict[Path, ast.Module]:
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in FILES}


@cache
def nodes() -> dict[Path, tuple[ast.AST, ...]]:
    return {path: (*ast.walk(tree),) for path, tree in trees().items()}

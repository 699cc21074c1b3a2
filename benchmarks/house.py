"""Size of the house, and how far one log travels through it, beside an earlier revision.

    python benchmarks/house.py [REVISION]

Counts lines, code, files, the longest file and function, private helpers of under four lines that are called once, and, while `bristle identify`
runs on one CSV of points, the files that run a function and the package's classes that are instantiated. None of it is a limit; a test would make it
a goal.
"""

import ast
import io
import json
import subprocess
import sys
import tempfile
import tokenize
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[1]
_TRACED = """
import json, sys, types
from pathlib import Path
source = str(Path(sys.argv[1]) / "src" / "bristle")
sys.path.insert(0, str(Path(sys.argv[1]) / "src"))
files, classes = set(), set()
def seen(frame, event, argument):
    name = frame.f_code.co_filename
    if event == "call" and name.startswith(source):
        if frame.f_code.co_name == "<module>":
            return
        files.add(name)
        own = frame.f_locals.get("self")
        if frame.f_code.co_name in ("__init__", "__post_init__") and own is not None:
            classes.add(type(own).__qualname__)
import bristle
import bristle.api
sys.setprofile(seen)
bristle.identify(sys.argv[2]).to_json()
sys.setprofile(None)
print(json.dumps([len(files), len(classes)]))
"""
_EXPERIMENT = """
joint: {name: wrist}
signals: {velocity: {column: v, unit: rad/s}, torque: {column: tau, unit: N*m}}
runs: [{files: points.csv, experiment: points}]
"""


def main() -> None:
    """Print the table: this tree, and the revision's where one is named."""
    trees = {"now": counted(ROOT)}
    with tempfile.TemporaryDirectory() as folder:
        if len(sys.argv) > 1:
            place = Path(folder) / "then"
            _git("worktree", "add", "--detach", str(place), sys.argv[1])
            try:
                trees[sys.argv[1]] = counted(place)
            finally:
                _git("worktree", "remove", "--force", str(place))
    width = max(map(len, trees["now"]))
    print(" " * width, *(f"{name:>40}" for name in trees))
    for what in trees["now"]:
        print(f"{what:<{width}}", *(f"{tree[what]:>40}" for tree in trees.values()))


def counted(root: Path) -> dict[str, str]:
    """Every figure of a checkout, in words."""
    texts = {path: path.read_text(encoding="utf-8") for path in sorted((root / "src").rglob("*.py"))}
    functions = [
        (_code(text, node), f"{path.stem}.{node.name}")
        for path, text in texts.items()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef)
    ]
    longest = max((text.count("\n"), path.name) for path, text in texts.items())
    passed, made = _flow(root)
    return {
        "lines": str(sum(text.count("\n") for text in texts.values())),
        "lines of code": str(sum(_code(text) for text in texts.values())),
        "files": str(len(texts)),
        "longest file": f"{longest[1]} {longest[0]}",
        "longest function, code": f"{max(functions)[1]} {max(functions)[0]}",
        "files on the way of one CSV": str(passed),
        "classes with an __init__ made on it": str(made),
        "short helpers called once": str(_short_helpers(texts.values())),
    }


def _code(text: str, node: ast.FunctionDef | None = None) -> int:
    """Lines that hold code: no blank ones, comments or docstrings; of one function or of all."""
    tree = ast.parse(text)
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in {
            tokenize.COMMENT,
            tokenize.NL,
            tokenize.NEWLINE,
            tokenize.INDENT,
            tokenize.DEDENT,
            tokenize.ENDMARKER,
        }:
            lines |= set(range(token.start[0], token.end[0] + 1))
    for part in ast.walk(tree):
        if isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant) and isinstance(part.value.value, str):
            lines -= set(range(part.lineno, (part.end_lineno or part.lineno) + 1))
    return len(lines) if node is None else len(lines & set(range(node.lineno, (node.end_lineno or node.lineno) + 1)))


def _short_helpers(texts: Iterable[str]) -> int:
    """Private module-level functions of under four lines, docstring apart, that are named once besides."""
    found, names = [], Counter[str]()
    for text in texts:
        tree = ast.parse(text)
        names.update(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
        found += [
            node.name
            for node in tree.body
            if isinstance(node, ast.FunctionDef) and node.name.startswith("_") and _code(text, node) < 4
        ]
    return sum(names[name] == 1 for name in found)


def _flow(root: Path) -> tuple[int, int]:
    """Files that run a function, and classes made, while `bristle identify` runs on one CSV of points."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        speeds = [s * 0.015 * 1.4**k for k in range(12) for s in (1, -1)]
        torques = [(0.0194 + 0.0055 * 2.718 ** -((v / 0.072) ** 2)) * (1 if v > 0 else -1) + 0.0394 * v for v in speeds]
        rows = "".join(
            f"{v!r},{t * (1 + 1e-3 * (k % 3 - 1))!r}\n" for k, (v, t) in enumerate(zip(speeds, torques, strict=True))
        )
        (place / "points.csv").write_text(f"v,tau\n{rows}", encoding="utf-8")
        (place / "e.yaml").write_text(_EXPERIMENT, encoding="utf-8")
        (place / "traced.py").write_text(_TRACED, encoding="utf-8")
        command = [sys.executable, str(place / "traced.py"), str(root), str(place / "e.yaml")]
        ran = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603  # our own command
    passed, made = json.loads(ran.stdout)
    return int(passed), int(made)


def _git(*arguments: str) -> None:
    subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True)  # noqa: S603, S607  # git of the path


if __name__ == "__main__":
    main()

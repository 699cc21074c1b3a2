"""The report of the embedded joints beside that of an older commit: whole commands, in turns, in one sitting.

python benchmarks/report.py [COMMIT], in a clone that has the commit.
"""

import compileall
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter

ROOT = Path(__file__).parent.parent
OLD, TURNS = "8d30783", 3
"""Commit before the pages, and how often each writes its report."""


def written(tree: Path, folder: Path) -> float:
    """Seconds that `bristle report` of a tree takes, into a new folder."""
    began = perf_counter()
    subprocess.run(  # noqa: S603  # our own command
        [sys.executable, "-m", "bristle", "report", "-o", folder],
        env={**os.environ, "PYTHONPATH": str(tree / "src")}, check=True, capture_output=True, cwd=folder.parent,
    )  # fmt: skip  # a call
    return perf_counter() - began


def main() -> None:
    """Print each turn, and the medians' ratio."""
    commit = sys.argv[1] if len(sys.argv) > 1 else OLD
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tree = folder / "old"
        subprocess.run(["git", "-C", ROOT, "worktree", "add", "-q", "--detach", tree, commit], check=True)  # noqa: S603, S607  # git
        try:
            for source in (tree, ROOT):  # as an installer does
                compileall.compile_dir(source / "src", quiet=1)
            times: dict[str, list[float]] = {commit: [], "now": []}
            print(f"{'turn':>4}  {commit:>9} s  {'now':>9} s")
            for turn in range(TURNS):
                for which, source in ((commit, tree), ("now", ROOT)):
                    times[which].append(written(source, folder / f"{which}{turn}"))
                print(f"{turn + 1:>4}  {times[commit][-1]:>11.1f}  {times['now'][-1]:>11.1f}", flush=True)
            old, new = median(times[commit]), median(times["now"])
            print(f"median {old:.1f} s and {new:.1f} s: {new / old:.3f} of the time, on {os.cpu_count()} cores")
        finally:
            subprocess.run(["git", "-C", ROOT, "worktree", "remove", "--force", tree], check=True)  # noqa: S603, S607  # git


if __name__ == "__main__":
    main()

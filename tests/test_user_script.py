"""The script of a user, which mypy checks with the rest of tests/."""

import ast
from pathlib import Path

import pytest

import bristle

from . import user_script

CALLS = {
    "fit", "find_segments", "fit_presliding", "fit_dynamic", "simulate", "friction", "compensator", "step", "identify", "read_results", "plan",
    "validate", "sensitivity", "adapt", "compare", "inspect", "report", "draft", "complete", "explore", "export",
    "register_law", "fleet", "report_of",
}  # fmt: skip  # a list of words


@pytest.mark.slow
@pytest.mark.usefixtures("few_motions")
def test_the_script_makes_every_call_and_runs() -> None:
    """Every call that `bristle` offers stands in it, and it ends well; its types are checked where mypy runs."""
    tree = ast.parse(Path(user_script.__file__).read_text(encoding="utf-8"))
    made = {
        node.func.attr for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
    }
    assert made >= CALLS
    assert {name for name in bristle.__all__ if name[0].islower()} <= CALLS
    user_script.main()

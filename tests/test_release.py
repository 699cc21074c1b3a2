"""What a release says of itself: one version everywhere, and what the wheel must hold."""

import re
import tomllib
from pathlib import Path

import yaml

import bristle

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_one_version() -> None:
    """The package, the newest entry of the changelog and the citation name the same version."""
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest is not None
    assert newest[1] == bristle.__version__
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["version"] == bristle.__version__


def test_the_extra_with_everything_has_every_format() -> None:
    """`test-all` brings the tests and every extra that only some tests need, so that nothing has a reason to skip."""
    extras = PROJECT["project"]["optional-dependencies"]
    (everything,) = extras["test-all"]
    named = set(re.fullmatch(r"bristle\[(.+)\]", everything)[1].split(","))  # type: ignore[index]  # it matches, or the test fails
    packages = {requirement for name in named for requirement in extras[name]}
    optional = set(extras) - {"test", "test-all", "lint", "release", "benchmark"}
    assert {requirement for name in optional for requirement in extras[name]} <= packages


def test_the_package_index_is_told_what_it_needs() -> None:
    """Summary, licence, versions of Python from the first that is asked for, and a README in Markdown whose figures and links stand."""
    project = PROJECT["project"]
    assert project["readme"] == "README.md"
    first = project["requires-python"].removeprefix(">=")
    assert f"Programming Language :: Python :: {first}" in project["classifiers"]
    assert not [c for c in project["classifiers"] if c.startswith("License ::")], (
        "the licence is an expression, PEP 639"
    )
    assert len(project["description"]) < 512

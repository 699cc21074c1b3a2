"""The examples in the docstrings of what `bristle` offers."""

import doctest

import pytest

import bristle
from bristle import api

EXAMPLES = sorted(name for name in bristle.__all__ if callable(getattr(bristle, name)) and name[0].islower())


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs(name: str) -> None:
    """It prints what it says."""
    found = doctest.DocTestFinder(recurse=False).find(getattr(bristle, name), name, globs={}, module=api)
    ran = [doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test) for test in found]
    assert sum(result.attempted for result in ran) > 1
    assert not any(result.failed for result in ran)

"""Nothing in the package decides by a sentence."""

import pytest

import bristle
from bristle.simulation import edro

from .sameness import held, without_sentences


def test_no_sentence_decides_on_the_embedded_joints(monkeypatch: pytest.MonkeyPatch) -> None:
    """With every template replaced by its kind's name, the embedded joints come out the same in every number, kind and severity; so does --strict."""
    experiments = edro.experiments()
    first = bristle.identify(*experiments)
    worded = [str(warning) for warning in first.warnings]
    without_sentences(monkeypatch)
    second = bristle.identify(*experiments)
    assert held(second.joints) == held(first.joints)
    assert [d.kind for d in first.serious] == [d.kind for d in second.serious]
    assert worded != [str(warning) for warning in second.warnings]

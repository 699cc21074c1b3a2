"""Nothing in the package decides by a sentence."""

import pytest

import bristle
from bristle.data.experiment.load import load_experiment
from bristle.simulation import edro
from bristle.simulation.joint_loop import of_experiment, of_paper

from .sameness import held, without_sentences


def test_no_sentence_decides_on_the_embedded_joints(monkeypatch: pytest.MonkeyPatch) -> None:
    """With every template replaced by its kind's name, the embedded joints come out the same in every number, kind and severity; so does --strict.

    The notes on their files, the advice on models and the assumptions of their loops are among them.
    """
    experiments = edro.experiments()
    gripper = load_experiment(experiments[0])
    first = bristle.identify(*experiments)
    worded = [str(warning) for warning in first.warnings]
    loops = held((*of_paper(first.joints), of_experiment(gripper, first.joints[0])))
    without_sentences(monkeypatch)
    second = bristle.identify(*experiments)
    assert held(second.joints) == held(first.joints)
    assert held((*of_paper(second.joints), of_experiment(gripper, second.joints[0]))) == loops
    assert [d.kind for d in first.serious] == [d.kind for d in second.serious]
    assert worded != [str(warning) for warning in second.warnings]

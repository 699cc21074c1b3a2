"""Nothing in the package decides by a sentence."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import bristle
from bristle.api import Results
from bristle.data.experiment.load import load_experiment
from bristle.findings import Finding
from bristle.identification.results import Joint
from bristle.questions.compensation.replay import replays
from bristle.questions.joint_report.next_measurements import next_measurements
from bristle.questions.joint_report.sentences import choice
from bristle.questions.sensitivity.study import findings, sobol_sentences
from bristle.simulation import edro
from bristle.simulation.joint_loop import of_experiment, of_paper

from .sameness import held, without_sentences


def scarce(joint: Joint) -> Joint:
    """As if little had been measured: one direction, no run held out, open intervals, and moving runs that show nothing."""
    fit, moving = joint.static["+"], joint.tracking
    assert moving is not None
    open_ = {name: replace(e, standard_error=e.value, interval=(0.0, np.inf)) for name, e in fit.parameters.items()}
    unseen = {name: replace(e, value=None) for name, e in moving.parameters.items()}
    return replace(
        joint,
        static={"+": replace(fit, parameters=open_, hold_out=())},
        tracking=replace(moving, parameters=unseen, hold_out=()),
        joint_fit=None,
    )


def advised(joints: tuple[Joint, ...]) -> Iterator[Finding]:
    """What to measure next, and which sigma_0 to use."""
    for joint in (*joints, *map(scarce, joints)):
        yield from next_measurements(joint)
        yield from map(choice, joint.presliding.fits.values() if joint.presliding else ())


def found(results: Results) -> Iterator[Finding]:
    """What is said of the first joint's sensitivity, Sobol indices included, and of the adaptation on its runs."""
    joint, measured = results.joints[0], results.measured[0]
    study = bristle.sensitivity(results, joint=joint.name, samples=32)
    assert study.sobol is not None
    yield from (*findings(study), *sobol_sentences(study.sobol, study.kind))
    yield from (x.verdict for x in replays(of_experiment(measured.experiment, joint), joint, measured))


@pytest.mark.slow
def test_no_sentence_decides_on_the_embedded_joints(monkeypatch: pytest.MonkeyPatch) -> None:
    """With every template replaced by its kind's name, two joints come out the same in every number, kind and severity; so does --strict.

    The notes on their files, the advice on models and on what to measure next, the assumptions of their loops, and what is found of sensitivity and
    adaptation are among them.
    """
    experiments = edro.experiments()[::3]
    gripper = load_experiment(experiments[0])
    first = bristle.identify(*experiments)
    worded = [str(warning) for warning in first.warnings]
    loops = held((*of_paper(first.joints), of_experiment(gripper, first.joints[0])))
    said = (*advised(first.joints), *found(first))
    kinds = {x.code for x in said}
    before = held(said)
    without_sentences(monkeypatch)
    second = bristle.identify(*experiments)
    assert held(second.joints) == held(first.joints)
    assert held((*of_paper(second.joints), of_experiment(gripper, second.joints[0]))) == loops
    assert held((*advised(second.joints), *found(second))) == before
    assert {"unlimited-below", "alpha-2-wide", "bristle-open", "hold-back", "claim-on-map", "sobol-indices"} < kinds
    assert [d.code for d in first.serious] == [d.code for d in second.serious]
    assert worded != [str(warning) for warning in second.warnings]

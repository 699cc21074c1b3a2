import json
from functools import partial
from pathlib import Path

import pytest

import bristle
from bristle import changed_levels, read_results
from bristle.data.experiment.signals import Cleaning
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.workers import called, sharing

from ..conftest import run, speeds, write


def test_a_changed_level_is_read_everywhere_and_told(tmp_path: Path) -> None:
    """Inside alone, in other processes and by the command line; results name it, and data that no test finds significant are noise."""
    every, other = dict(vars(levels)), {"SIGNIFICANCE": 1e-300, "LARGEST_BEND": {"revolute": 1, "prismatic": 1.0}}
    with changed_levels(**other), sharing(2, begin=partial(levels.put, levels.changed())) as share:
        assert list(share(called, [levels.changed])) == [other]
    assert vars(levels) == every
    with changed_levels(GAP=50.0):  # a default of the experiment file
        assert Cleaning().gap == 50.0
    assert Cleaning().gap == levels.GAP

    path, results = write(tmp_path, speeds()), tmp_path / "results.json"
    ran = run("--level", "BIC_GAIN=6", "identify", path, "-o", results)
    assert read_results(results).joint().settings["levels"] == "BIC_GAIN 6 (default 10)"
    assert "BIC_GAIN 6 (default 10)" in ran.words
    assert "levels" not in bristle.identify(path).joint().settings
    assert "has nothing to do with the motion" in run("--level", "SIGNIFICANCE=1e-300", "identify", path).err


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("BIC_GIAN=6", "level: got 'BIC_GIAN'; expected a name in bristle/estimation/levels.py, such as BIC_GAIN"),
        ("CONFIDENCE=0.9", "level: got 'CONFIDENCE'; expected a name in bristle/estimation/levels.py"),
        ("BIC_GAIN", "--level: got 'BIC_GAIN'; expected NAME=VALUE, such as BIC_GAIN=6"),
        ("BIC_GAIN=six", "--level: got 'BIC_GAIN=six'; expected NAME=VALUE, such as BIC_GAIN=6"),
        ("BIC_GAIN=NaN", "level BIC_GAIN: got nan; expected a value in the form of 10.0"),
        ("FEW=2.5", "level FEW: got 2.5; expected a value in the form of 8"),
        ("FEW=true", "level FEW: got True; expected a value in the form of 8"),
        ("KNOTS=[3]", "level KNOTS: got [3]; expected a value in the form of (3, 6)"),
        ('LARGEST_BEND={"revolute": 1}', "level LARGEST_BEND: got {'revolute': 1}; expected a value in the form of"),
    ],
)
def test_a_level_of_no_such_name_or_form_is_refused(given: str, said: str) -> None:
    """In one sentence that names what was got, and what a level is."""
    ran = run("--level", given, "identify")
    assert (ran.code, ran.out) == (2, "")
    assert said in ran.err
    name, _, value = given.partition("=")
    if value and value != "six":
        with pytest.raises(InputError), changed_levels(**{name: json.loads(value)}):
            pass

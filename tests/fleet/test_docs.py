"""docs/fleet.md lists the columns of the dataset and of every table of the findings, and no others."""

import re
from pathlib import Path

import numpy as np

from bristle.questions.fleet.dataset import COLUMNS
from bristle.questions.fleet.findings import findings
from bristle.simulation.fleet import FleetDesign, fleet_estimates, fleet_truth

DOC = (Path(__file__).parents[2] / "docs" / "fleet.md").read_text(encoding="utf-8")


def row_of(table: str) -> str:
    """What the document says of a table's columns."""
    (found,) = re.findall(rf"^\| `{table}` \|[^|]*\|(.*)\|$", DOC, re.MULTILINE)
    return str(found)


def test_columns_of_the_dataset() -> None:
    """The document's table has every column of the dataset, in its order."""
    section = DOC[DOC.index("## The dataset") : DOC.index("## What it tells")]
    named = [
        name for first in re.findall(r"^\|([^|]*)\|", section, re.MULTILINE) for name in re.findall(r"`(\w+)`", first)
    ]
    assert sorted(named) == sorted(COLUMNS)


def test_columns_of_the_tables() -> None:
    """The document names the columns of every table of findings."""
    rng, design = np.random.default_rng(0), FleetDesign(robots=6, joints=1, sessions=5)
    found = findings(fleet_estimates(design, fleet_truth(design, rng), rng))
    names = ("joints", "changes", "types", "units", "quality", "warned", "failures", "series")
    told = {table: set(re.findall(r"`(\w+)`", row_of(table))) for table in names}
    assert told == {table: set(getattr(found, table).columns) for table in names}

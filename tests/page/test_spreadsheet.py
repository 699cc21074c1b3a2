import csv
import io
from pathlib import Path

import pandas as pd
import pytest

from bristle.page.columns import to_csv

SOURCE = Path(__file__).parents[2] / "src" / "bristle"
FORMULAS = [
    '=HYPERLINK("http://x")',
    "+1+cmd|' /C calc'!A0",
    "-2+3",
    "@SUM(1)",
    "\t=1",
    "\r=1",
    "\n=1",
    "--",
    "+-",
    "=",
    "-x",
]
PLAIN = ["+", "-", "-1.5", "+2", "-1e-5", "-.5", "wrist", "a=b", "'=1", "a\n=1", "", "α₀ (−)"]


def cells(frame: pd.DataFrame) -> list[list[str]]:
    """The rows that another program reads, its header first."""
    return list(csv.reader(io.StringIO(to_csv(frame), newline="")))


@pytest.mark.parametrize("dtype", [object, "str", "category"])
def test_no_text_is_a_formula(dtype: str) -> None:
    """A text, header included, that a spreadsheet would run gets an apostrophe; directions, numbers and other texts stay as they are."""
    frame = pd.DataFrame({"=1": pd.Series(FORMULAS + PLAIN, dtype=dtype)})
    assert cells(frame)[1:] == [["'" + x.replace("\r", "\n")] for x in FORMULAS] + [[x] for x in PLAIN]
    assert cells(frame)[0] == ["'=1"]


def test_numbers_stay() -> None:
    """Numbers, among texts too, what is missing, and truth values are written as pandas writes them.

    A text with line ends of any kind stays one cell; of two columns of one name both are written.
    """
    frame = pd.DataFrame({"x": [-1.5, float("nan"), float("-inf")], "y": [-2, "=1", None], "z": [True, False, True]})
    assert cells(frame)[1:] == [["-1.5", "-2", "True"], ["", "'=1", "False"], ["-inf", "", "True"]]
    assert cells(pd.DataFrame({"x": ["a\r=1", "a\r\n=1"]})) == [["x"], ["a\n=1"], ["a\n=1"]]
    frame = pd.DataFrame([["=a", -1.0], ["b", 2.0]], columns=["x", "x"])
    assert cells(frame) == [["x", "x"], ["'=a", "-1.0"], ["b", "2.0"]]


def test_csv_is_written_in_one_place() -> None:
    """No other file of the package calls a writer of CSV, so that none forgets the formulas."""
    writers = (".to_csv(", "csv.writer", "savetxt")
    lines = [(p.name, line) for p in SOURCE.rglob("*.py") for line in p.read_text(encoding="utf-8").splitlines()]
    code = [(name, line) for name, line in lines if not line.strip().startswith(">>>")]  # examples are a user's
    found = {name for name, line in code if any(x in line for x in writers)}
    assert sorted(found) == ["columns.py"]

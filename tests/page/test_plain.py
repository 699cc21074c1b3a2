"""Plain text for a terminal of 80 columns: no line is longer, and no number, interval or word is broken."""

import re

from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.page.plain import WIDTH, columns, interval, pair, wrapped

values = st.floats(-1e7, 1e7, allow_nan=False)
errors = st.floats(1e-9, 1e5)
NUMBERS = st.one_of(
    st.builds(lambda x, e: f"{pair(x, e)} N*m*s/rad", values, errors),
    st.builds(lambda low, width: f"{interval((low, low + width))}", values, errors),
    st.builds(lambda x: f"{x:.3g} %", values),
    st.builds(lambda x: f"= {x:.4g} rad/s", values),
)
WORDS = st.text("abcdefgh(),.", min_size=1, max_size=12)


@given(parts=st.lists(NUMBERS | WORDS, min_size=1, max_size=40), indent=st.integers(0, 8))
@settings(deadline=None, max_examples=200)
def test_no_number_is_broken(parts: list[str], indent: int) -> None:
    """Every number stands in one line with its error and unit, no line is longer than 80, and no word is lost."""
    line = " " * indent + " ".join(parts)
    lines = list(wrapped([line]))
    assert max(map(len, lines)) <= WIDTH
    assert " ".join(lines).split() == line.split()
    for number in (part for part in parts if re.search(r"\d", part)):
        assert any(number in one for one in lines)
    assert list(wrapped(lines)) == lines


@given(
    rows=st.lists(st.lists(NUMBERS | WORDS, min_size=1, max_size=7), min_size=1, max_size=8), indent=st.integers(0, 6)
)
@settings(deadline=None, max_examples=100)
def test_no_cell_of_a_table_is_broken(rows: list[list[str]], indent: int) -> None:
    """Each cell stands whole in a line of at most 80, in order."""
    lines = list(columns(rows, indent))
    assert max(map(len, lines)) <= WIDTH
    for row in rows:
        assert all(any(cell in line for line in lines) for cell in row)
    assert " ".join(lines).split() == " ".join(cell for row in rows for cell in row).split()


def test_columns_stand_under_one_another_and_a_long_word_stays_whole() -> None:
    """A column begins at the same place in each row; a path that is longer than a line is not broken."""
    assert list(columns([("a", "bb"), ("ccc", "d")])) == ["  a    bb", "  ccc  d"]
    path = "/".join(["folder"] * 20)
    assert path in list(wrapped([f"Report: {path}"]))[-1]


def test_a_number_has_two_digits_of_its_error() -> None:
    """Value and standard error end at the second digit of the error."""
    written: dict[tuple[float | None, float | None], str] = {
        (0.0194612, 0.0000984): "0.019461 +/- 0.000098",
        (6.2263, 0.0411): "6.226 +/- 0.041",
        (7.5587, 0.0998): "7.56 +/- 0.10",
        (12345.6, 678.0): "12350 +/- 680",
        (1234567.0, 890.0): "(1.23457 +/- 0.00089)e+06",
        (1.9462e-6, 2.1e-8): "(1.946 +/- 0.021)e-06",
        (0.0, 0.0998): "0.00 +/- 0.10",
        (0.3, float("inf")): "0.3",
        (None, None): "none",
        (0.0178, None): "0.0178",
    }
    assert {key: pair(*key) for key in written} == written

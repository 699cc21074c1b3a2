import math
import re

from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.findings import CAUTION, NOTE, Finding
from bristle.page.plain import WIDTH, columns, interval, pair, typed, wrapped
from bristle.page.said import by_code, entries, entries_linked, flagged, warned
from bristle.page.wording import in_percent, in_print, in_symbols, number

from ..conftest import run

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
@settings(max_examples=200)
def test_no_number_is_broken(parts: list[str], indent: int) -> None:
    """Every number stands in one line with its error and unit, no line is longer than 80, and no word is lost."""
    line = " " * indent + " ".join(parts)
    lines = list(wrapped([line]))
    assert max(map(len, lines)) <= WIDTH
    assert " ".join(lines).split() == line.split()
    for part in filter(re.compile(r"\d").search, parts):
        assert any(part in one for one in lines)
    assert list(wrapped(lines)) == lines


@given(
    rows=st.lists(st.lists(NUMBERS | WORDS, min_size=1, max_size=7), min_size=1, max_size=8), indent=st.integers(0, 6)
)
@settings(max_examples=100)
def test_no_cell_of_a_table_is_broken(rows: list[list[str]], indent: int) -> None:
    """Each cell stands whole in a line of at most 80, in order."""
    lines = list(columns(rows, indent))
    assert max(map(len, lines)) <= WIDTH
    for row in rows:
        assert all(any(cell in line for line in lines) for cell in row)
    assert " ".join(lines).split() == " ".join(cell for row in rows for cell in row).split()


def test_columns_codes_and_symbols_in_print() -> None:
    """A column begins at the same place in each row; a path that is longer than a line is not broken."""
    assert list(columns([("a", "bb"), ("ccc", "d")])) == ["  a    bb", "  ccc  d"]
    path = "/".join(["folder"] * 20)
    assert path in list(wrapped([f"Report: {path}"]))[-1]
    # value and standard error end at the second digit of the error
    written: dict[tuple[float | None, float | None], str] = {
        (0.0194612, 0.0000984): "0.019461 +/- 0.000098", (6.2263, 0.0411): "6.226 +/- 0.041",
        (7.5587, 0.0998): "7.56 +/- 0.10", (12345.6, 678.0): "12350 +/- 680",
        (1234567.0, 890.0): "(1.23457 +/- 0.00089)e+06", (1.9462e-6, 2.1e-8): "(1.946 +/- 0.021)e-06",
        (0.0, 0.0998): "0.00 +/- 0.10", (0.3, float("inf")): "0.3", (None, None): "none", (0.0178, None): "0.0178",
    }  # fmt: skip  # a list of values
    assert {key: pair(*key) for key in written} == written
    # small letters, digits and single hyphens; as it was printed, or as an older results file has it
    for code, x in entries().items():
        assert set(code) <= set("abcdefghijklmnopqrstuvwxyz0123456789-"), code
        assert "--" not in code
        assert by_code(code) is by_code(code.upper().replace("-", "_")) is by_code(f"[{code}]") is x
    # `bristle explain` prints the paragraph of a code, why it has its severity and what to do
    x, ran = by_code("drift-in-order"), run("explain", "DRIFT_IN_ORDER")
    assert ran.code == 0
    assert all(text in ran.words for text in (x.meaning, x.reason, x.advice))
    # it ends with 2 and one sentence, which names those that are near
    for code, near in {"drift-in-oder": "drift-in-order", "lacks": "lacks-a-term", "?": ""}.items():
        ran = run("explain", code)
        assert (ran.code, ran.out, len(ran.said)) == (2, "", 1)
        assert near in ran.err
    # a finding ends with a link to its code, a note only where notes are listed; each code linked has one entry, the critical ones first
    caution, note = Finding("single-run", CAUTION, "1 of 4 <b>."), Finding("correlated", NOTE, "They are.")
    assert (flagged(note), caution.flagged, note.flagged) == (str(note), f"{caution} [single-run]", str(note))
    assert "href" not in flagged("a text of somebody's") + warned("<b>")
    text = f'{warned(caution)} {flagged(caution)} {warned(note)} <a href="#warning-static-too-few"> <a href="#warning-none">'
    assert [x["code"] for x in entries_linked(text)] == ["static-too-few", "single-run", "correlated"]
    assert "<b>" not in warned(caution) + warned("<b>")
    # a page shows alpha_0 as its symbol and N*m/rad as N·m/rad; the terminal has neither
    told = "No sigma_0 can be given; it is at least 12.5 N*m/rad."
    assert in_print(told) == "No σ₀ can be given; it is at least 12.5 N·m/rad."
    assert typed(in_print(told)) == told
    # each LuGre parameter, with the sign of its direction where one ends it, and nothing else, is written as the paper does
    symbols = {
        "alpha_0+, sigma_1- and v_s.": "α₀ (+), σ₁ (−) and vₛ.",
        "alpha_0 + alpha_1 - sigma_0": "α₀ + α₁ - σ₀",
        "1.4 times v_s in direction -: plan.minimum_velocity": "1.4 times vₛ in direction -: plan.minimum_velocity",
        "alpha_01, av_s, alpha_0+1": "alpha_01, av_s, α₀+1",
    }
    assert {text: in_symbols(text) for text in symbols} == symbols
    # of numbers with more digits than are shown the last are zeros; very large and very small ones have an exponent
    shown = {(456.7, 2): "460", (123456.0, 4): "123500", (-1234.5, 3): "-1230", (2e6, 2): "2e+06", (1e-5, 2): "1e-05"}
    assert {x: number(*x) for x in shown} == shown
    # two digits, never an exponent where it is large, and a dash where there is no number
    percents = {0.8312: "83 %", 12.34: "1200 %", 0.00071: "0.071 %", 0.0: "0 %", -0.031: "-3.1 %", math.nan: "– %"}
    assert {share: in_percent(share) for share in percents} == percents

"""Names, units and numbers as a reader meets them."""

import math

from bristle.findings import CAUTION, Finding
from bristle.page.wording import in_percent, in_print, in_symbols, number


def test_a_diagnostic_in_print_has_symbols_and_units_in_print() -> None:
    """A page shows alpha_0 as its symbol and N*m/rad as N·m/rad; the terminal's sentence has neither."""
    made = Finding("sigma-0-at-least", CAUTION, "No sigma_0 can be given; it is at least 12.5 N*m/rad.")
    assert str(made) == "No sigma_0 can be given; it is at least 12.5 N*m/rad."
    assert in_print(made) == "No σ₀ can be given; it is at least 12.5 N·m/rad."


def test_parameters_of_a_sentence_become_symbols() -> None:
    """Each LuGre parameter, with the sign of its direction where one ends it, and nothing else, is written as the paper does."""
    written = {
        "alpha_0+, sigma_1- and v_s.": "α₀ (+), σ₁ (−) and vₛ.",
        "alpha_0 + alpha_1 - sigma_0": "α₀ + α₁ - σ₀",
        "1.4 times v_s in direction -: plan.minimum_velocity": "1.4 times vₛ in direction -: plan.minimum_velocity",
        "alpha_01, av_s, alpha_0+1": "alpha_01, av_s, α₀+1",
    }
    assert {text: in_symbols(text) for text in written} == written


def test_a_number_below_a_million_has_no_exponent() -> None:
    """Of numbers with more digits than are shown the last are zeros; very large and very small ones have one."""
    shown = {
        (456.7, 2): "460",
        (2000.0, 2): "2000",
        (123456.0, 4): "123500",
        (-1234.5, 3): "-1230",
        (2e6, 2): "2e+06",
        (1e-5, 2): "1e-05",
    }
    assert {x: number(*x) for x in shown} == shown


def test_a_share_in_percent_has_two_digits() -> None:
    """Two digits, never an exponent where it is large, and a dash where there is no number."""
    written = {
        0.8312: "83 %", 0.997: "100 %", 12.34: "1200 %", 0.00071: "0.071 %", 0.0: "0 %", -0.031: "-3.1 %", math.nan: "– %",
    }  # fmt: skip  # a table
    assert {share: in_percent(share) for share in written} == written

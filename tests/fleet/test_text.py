"""What the terminal shows of a fleet, and how changes, probabilities and times are written."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd

from bristle.questions.fleet.findings import Findings
from bristle.questions.fleet.notes import headline
from bristle.questions.fleet.report import report
from bristle.questions.fleet.tables import change, day, estimate, probability, totals

from .plausible import HOSTILE, plausible


def text(found: Findings) -> str:
    """What the command prints."""
    return report(found).text()


def test_the_text_of_a_small_fleet() -> None:
    """Headline, changed joints, values outside, data quality, failures and notes, in this order, each with its numbers."""
    found = plausible(units=3, joints=2, sessions=6)
    joints = found.joints.copy()
    joints[["unit", "joint"]] = [[f"r{k}", "J1"] for k in range(6)]
    units = found.units[found.units["unit"] != HOSTILE].assign(joint="J1", type="T1")
    failures = found.failures.assign(unit="r0", joint="J1")
    first = headline(joints.assign(percent=15.0), 0.05)
    warned = found.warned.assign(unit="r0", joint="J1")
    told = replace(found, joints=joints, headline=first, units=units, failures=failures, warned=warned)
    lines = text(told).splitlines()
    assert lines[:2] == [
        "2 of 6 joints changed, at a false discovery rate of 5 %; the clearest: r0 J1, alpha_0- by +15 % since 2026-04-27; "
        "1 other changed as well.",
        "SIMULATED data.",
    ]
    assert lines[2] == "Joints that changed (2), with 95 % interval and adjusted p:"
    row = found.joints.iloc[0]
    size = change(row["percent"], row["percent_lower"], row["percent_upper"])
    named = f"  r0 J1  alpha_0{row['direction']}  {size} %"
    assert lines[3] == f"{named}  since 2026-04-27  p {probability(row['adjusted_p'])}"
    assert [line for line in lines if line.startswith("      new")] == ["      new warnings: clipped torque-drifts"]
    (at,) = [k for k, line in enumerate(lines) if line.startswith("Values outside their type (2)")]
    assert all("N*m" in line and "% from type" in line and "+/-" in line for line in lines[at + 1 : at + 3])
    assert lines[at + 3].startswith("Data quality, percent of 30 joint-sessions: ")
    assert "too-short" not in lines[at + 3]
    assert lines[at + 4] == "Warnings that began and stayed (1):"
    assert lines[at + 5].endswith("clipped  since 2026-01-05  in 2 of 3 sessions")
    assert lines[at + 6] == (
        "3 sessions failed or left out; the first: r0 J1 of 2026-01-05: <i>file 0</i>: ends in line 812; log it again"
    )
    assert lines[at + 7].endswith("a failing sensor is not wear. [warned-since]")
    assert lines[at + 8 :] == ["What a code in brackets means: bristle explain CODE"]


def test_lists_are_cut_with_their_counts() -> None:
    """Of many joints 20 are listed, of many values outside 10, and the counts are those of all."""
    lines = text(plausible(units=60, joints=9)).splitlines()
    assert "Joints that changed (108, the first 20), with 95 % interval and adjusted p:" in lines
    assert "Values outside their type (154, the first 10), with adjusted p:" in lines
    assert sum(" since 2026-" in line for line in lines[2:]) == 20 + 1  # and where a warning began


def test_names_have_no_control_characters_and_are_short() -> None:
    """Whatever a unit is called, a line has no control character, and the name takes 24 columns at most."""
    found = plausible(units=1, joints=1)
    joints = found.joints.assign(unit="a\x1b[31m\n" + 50 * "b", joint="J\t1")
    lines = text(replace(found, joints=joints)).splitlines()
    assert all(line.isprintable() for line in lines)
    assert not any(26 * "b" in line for line in lines[2:])


def test_a_change_has_its_sign_and_interval() -> None:
    """A change is rounded as its interval, to the second digit of a quarter of its width; an open interval is left out."""
    cases = (
        ((15.234, 12.1, 18.3), "+15.2 [12.1, 18.3]"),
        ((-0.4, -2.2, 1.4), "-0.40 [-2.20, 1.40]"),
        ((250.3, 100.0, 400.0), "+250 [100, 400]"),
        ((12.0, -math.inf, math.inf), "+12"),
        ((math.nan, 0.0, 1.0), "–"),
    )
    assert [change(*given) for given, _ in cases] == [wanted for _, wanted in cases]
    assert [estimate(*given) for given, _ in cases] == [wanted.removeprefix("+") for _, wanted in cases]


def test_probabilities_and_days() -> None:
    """Two digits; below 1e-30 no more than that; a dash where there is none."""
    assert [probability(p) for p in (0.04321, 1e-40, math.nan, 1.0)] == ["0.043", "< 1e-30", "–", "1"]
    assert (day(pd.Timestamp("2026-05-04 23:59")), day(pd.NaT)) == ("2026-05-04", "–")


def test_totals_count_every_period_once() -> None:
    """A code's percent is of the joint-sessions of all periods, also of those in which it does not occur."""
    quality = pd.DataFrame(
        {
            "period": pd.to_datetime(["2026-01-01", "2026-01-01", "2026-02-01"]), "code": ["gaps", "clipped", "clipped"],
            "severity": "caution", "joint_sessions": [3, 1, 4], "of": [10, 10, 30], "percent": [30.0, 10.0, 13.3],
        }
    )  # fmt: skip  # a table
    whole = totals(quality)
    assert list(whole["code"]) == ["clipped", "gaps"]
    assert np.allclose(whole["percent"], [12.5, 7.5])

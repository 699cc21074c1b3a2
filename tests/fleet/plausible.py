"""Findings made up with numbers: a fleet as large as one likes, without any fit or test."""

from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from bristle.findings import CAUTION, NOTE, Finding
from bristle.questions.fleet.findings import Findings, headline

HOSTILE = "</script><img src=x onerror=\"document.title='run'\"><!-- {{ 7*7 }} \\u003c"
"""A unit's name that ends a script, loads an image and opens a comment."""
EXOTIC = "Zelle „Süd“ 'α' & <b>№ 7</b> 手首"  # a joint's name with quotes and letters of other scripts
BEGIN = pd.Timestamp("2026-01-05 08:00")
UNITS = {"alpha_0": "N*m", "alpha_1": "N*m", "alpha_2": "N*m*s/rad", "v_s": "rad/s"}


def plausible(
    units: int = 6,
    joints: int = 2,
    sessions: int = 8,
    parameters: tuple[str, ...] = ("alpha_0", "alpha_2"),
    failed: int = 3,
    seed: int = 1,
) -> Findings:
    """A fleet of units of as many joints each, every fifth joint of which changed; the first unit and its first joint have hostile names."""
    rng = np.random.default_rng(seed)
    names = [HOSTILE, *(f"robot-{k + 1:03d}" for k in range(1, units))]
    own = [EXOTIC, *(f"J{k + 1}" for k in range(1, joints))]
    keys = pd.DataFrame(list(product(names, own)), columns=["unit", "joint"])
    quantities = pd.DataFrame(list(product(parameters, "+-")), columns=["parameter", "direction"])
    blocks = keys.assign(number=range(len(keys))).merge(quantities, how="cross")
    blocks = blocks.assign(type=blocks["joint"], value_unit=blocks["parameter"].map(UNITS))
    changes = _changes(blocks, sessions, rng)
    changed = changes["changed"]
    table = _joints(changes, sessions)
    said = (
        f"{table['changed'].sum()} of {len(table)} joints changed, at a false discovery rate of 5 %; "
        f"the clearest: {HOSTILE} {EXOTIC}, alpha_0+ by +15 % since 2026-03-02."
    )
    warned = (HOSTILE, EXOTIC, "clipped", "caution", BEGIN, 2, 3)
    return Findings(
        headline=Finding("fleet-changed", NOTE, said),
        notes=(Finding("warned-since", CAUTION, "Look at their logs first; a failing sensor is not wear."),),
        joints=table, changes=changes.drop(columns="number"), series=_series(changes.assign(changed=changed), sessions, rng),
        types=_types(changes, sessions, rng), units=_units(changes, sessions, rng), quality=_quality(sessions, len(keys), rng),
        warned=pd.DataFrame([warned], columns=["unit", "joint", "code", "severity", "since", "sessions", "of"]),
        failures=_failures(keys, failed), rate=0.05, baseline=3, simulated=True,
    )  # fmt: skip  # a list of values


def empty() -> Findings:
    """Findings of a fleet of which nothing was found: every table has its columns and no row."""
    some = plausible()
    tables = {
        name: getattr(some, name).iloc[:0]
        for name in ("joints", "changes", "series", "types", "units", "quality", "warned", "failures")
    }
    said = headline(tables["joints"], 0.05)
    return Findings(headline=said, notes=(), rate=0.05, baseline=3, simulated=False, **tables)


def when(sessions: int) -> pd.DatetimeIndex:
    return pd.date_range(BEGIN, periods=sessions, freq="28D", unit="us")


def _changes(blocks: pd.DataFrame, sessions: int, rng: np.random.Generator) -> pd.DataFrame:
    n, at = len(blocks), min(4, sessions - 1)
    worn = (blocks["number"] % 5 == 0) & (blocks["parameter"] == "alpha_0")
    size = np.where(worn, 15.0, 1.5) + rng.normal(0, 1, n)
    before = 0.02 * np.exp(0.1 * rng.standard_normal(n))
    p = np.where(worn, 1e-9 * rng.random(n), 0.02 + 0.98 * rng.random(n))
    columns: dict[str, Any] = {
        "sessions": sessions, "before": before, "after": before * (1 + size / 100), "percent": size, "percent_lower": size - 3.0,
        "percent_upper": size + 3.1, "since": when(sessions)[at], "sessions_after": sessions - at, "z": size / 1.5, "p": p, "changed": worn,
    }  # fmt: skip  # a table
    return blocks.assign(**columns)


def _joints(changes: pd.DataFrame, sessions: int) -> pd.DataFrame:
    first = changes.sort_values(["p", "number"], kind="stable").drop_duplicates("number")
    table = first.assign(
        rank=np.arange(1, len(first) + 1), adjusted_p=np.minimum(first["p"] * len(first), 1.0),
        new_warnings=np.where(first["number"] == 0, "clipped torque-drifts", ""), outside=first["number"] % 7 == 2,
        first=when(sessions)[0], latest=when(sessions)[-1], file=[f"logs/{k:04d} ü.yaml" for k in first["number"]], untested="",
    )  # fmt: skip  # a list of values
    names = (
        "rank", "unit", "joint", "type", "sessions", "changed", "adjusted_p", "parameter", "direction", "percent", "percent_lower",
        "percent_upper", "since", "sessions_after", "new_warnings", "outside", "first", "latest", "file", "untested",
    )  # fmt: skip  # a row
    return table[list(names)].reset_index(drop=True)


def _series(changes: pd.DataFrame, sessions: int, rng: np.random.Generator) -> pd.DataFrame:
    rows = changes.loc[changes.index.repeat(sessions)].reset_index(drop=True)
    session = np.tile(when(sessions), len(changes))
    level = np.where(rows["changed"] & (session >= rows["since"]), rows["after"], rows["before"])
    value = level * np.exp(0.02 * rng.standard_normal(len(rows)))
    columns: dict[str, Any] = {
        "session": session, "value": value, "lower": 0.98 * value, "upper": 1.02 * value, "adjusted": value * 1.004,
        "limit_low": 0.93 * rows["before"], "limit_high": 1.07 * rows["before"],
    }  # fmt: skip  # a table
    names = ["unit", "joint", "parameter", "direction", "session", "value", "lower", "upper", "value_unit", "adjusted"]
    return rows.assign(**columns)[[*names, "limit_low", "limit_high"]]


def _types(changes: pd.DataFrame, sessions: int, rng: np.random.Generator) -> pd.DataFrame:
    rows = changes.drop_duplicates(["type", "parameter", "direction"])[["type", "parameter", "direction", "value_unit"]]
    nan, n = float("nan"), len(rows)
    columns: dict[str, Any] = {
        "joints": 6, "sessions": 6 * sessions, "mean": 0.02, "mean_lower": 0.0195, "mean_upper": 0.0206,
        "spread_percent": 10.0, "spread_lower": 8.0, "spread_upper": 13.0, "scatter_percent": 3.0, "scatter_lower": 2.7, "scatter_upper": 3.4,
        "temperature_percent": -1.0 + 0.05 * rng.standard_normal(n), "temperature_lower": -1.2, "temperature_upper": -0.8,
        "load_percent": nan, "load_lower": nan, "load_upper": nan, "shift_percent": np.where(np.arange(n) == 0, 10.4, nan), "shift_p": 1e-6,
    }  # fmt: skip  # a table
    return rows.assign(**columns).reset_index(drop=True)


def _units(changes: pd.DataFrame, sessions: int, rng: np.random.Generator) -> pd.DataFrame:
    rows, n = changes[["unit", "joint", "type", "parameter", "direction", "value_unit"]], len(changes)
    value = changes["before"].to_numpy(float)
    z = np.log(value / 0.02) / 0.1
    outside = (changes["number"] % 7 == 2) & (changes["parameter"] == "alpha_0")
    columns: dict[str, Any] = {
        "sessions": sessions, "value": value, "standard_error": 0.01 * value, "percent": 100 * (value / 0.02 - 1), "z": np.where(outside, 6.0, z),
        "adjusted_p": np.where(outside, 1e-7, 0.05 + 0.9 * rng.random(n)), "outside": outside, "shrunken": 0.02 + 0.97 * (value - 0.02),
        "shrunken_error": 0.0098 * value, "borrowed_percent": 3.0,
    }  # fmt: skip  # a table
    return rows.assign(**columns).reset_index(drop=True)


def _quality(sessions: int, of: int, rng: np.random.Generator) -> pd.DataFrame:
    rows = []
    codes = (("clipped", "caution"), ("failed", "critical"), ("torque-drifts", "caution"), ("too-short", "note"))
    for period in when(sessions).to_period("M").unique().start_time:
        for code, severity in codes:
            count = int(rng.integers(0, of + 1))
            rows.append((period, code, severity, count, of, 100 * count / of))
    return pd.DataFrame(rows, columns=["period", "code", "severity", "joint_sessions", "of", "percent"])


def _failures(keys: pd.DataFrame, failed: int) -> pd.DataFrame:
    rows = keys.iloc[np.arange(failed) % len(keys)]
    return pd.DataFrame(
        {
            "unit": rows["unit"].to_numpy(), "joint": rows["joint"].to_numpy(), "session": BEGIN, "file": "=cut <off>.csv",
            "failure": [f"<i>file {k}</i>: ends in line 812; log it again" for k in range(failed)],
        }
    )  # fmt: skip  # a table

"""Quality of a fleet's data over time: warnings per period, and warnings that began."""

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pandas as pd

from bristle.estimation import levels
from bristle.page.said import entries
from bristle.questions.fleet.quantities import Roster

FAILED = "failed"  # the code of a session that was not identified
_COUNT = ("caution", "critical")  # severities of warnings that concern the data
_PERIODS = ((31, "D"), (366, "W-SUN"), (np.inf, "M"))  # most days covered by sessions, and the period
_COLUMNS = {
    "period": "datetime64[us]", "code": "str", "severity": "str", "joint_sessions": "int64", "of": "int64", "percent": "float64",
}  # fmt: skip  # columns of the quality over time, and their types


def severity(code: str) -> str:
    """The severity of a code; caution if it has no entry."""
    if code == FAILED:
        return "critical"
    return entries()[code].severity if code in entries() else "caution"


def codes_of(frame: pd.DataFrame, *whose: str) -> pd.DataFrame:
    """Warnings of each joint session, once each: session, code, and the columns `whose` (default: unit and joint)."""
    kept = [*(whose or ("unit", "joint")), "session"]
    said = frame["warnings"].astype(object).map({x: str(x).split() for x in frame["warnings"].dropna().unique()})
    warned = frame[kept].assign(code=said)[said.notna()].explode("code").dropna(subset="code").astype({"code": "str"})
    failed = frame[frame["failure"].notna()][kept].assign(code=FAILED)
    return pd.concat([warned, failed]).drop_duplicates()


def quality(frame: pd.DataFrame) -> pd.DataFrame:
    """Joint sessions with each code in each period: period, code, severity, joint_sessions, of, percent."""
    every = frame[["unit", "joint", "session"]].drop_duplicates()
    every, found = every[every["session"].notna()], codes_of(frame)
    if every.empty:
        return pd.DataFrame(columns=list(_COLUMNS)).astype(_COLUMNS)
    days = (every["session"].max() - every["session"].min()).days
    rule = next(name for most, name in _PERIODS if days <= most)
    of = every.groupby(every["session"].dt.to_period(rule).dt.start_time).size()
    found = found[found["session"].notna()].assign(period=lambda x: x["session"].dt.to_period(rule).dt.start_time)
    every_one = pd.MultiIndex.from_product([of.index, sorted(found["code"].unique())], names=["period", "code"])
    count = found.groupby(["period", "code"]).size().reindex(every_one, fill_value=0)
    counts = count.rename("joint_sessions").reset_index()
    counts["severity"] = counts["code"].map(severity)
    counts["of"] = counts["period"].map(of)
    counts["percent"] = 100 * counts["joint_sessions"] / counts["of"]
    return counts.sort_values(["period", "code"], ignore_index=True)[list(_COLUMNS)].astype(_COLUMNS)


def failures(frame: pd.DataFrame) -> pd.DataFrame:
    """Sessions without a result: unit, joint, session, file, failure."""
    columns = ["unit", "joint", "session", "file", "failure"]
    return frame.loc[frame["failure"].notna(), columns].drop_duplicates(ignore_index=True)


def warned(frame: pd.DataFrame, people: Roster) -> pd.DataFrame:
    """Warnings that a joint did not have at first since its last baseline, and then in most of its sessions.

    Columns: unit, joint, code, severity, since, sessions with it, `of` all since then; by number of the joint. Those that
    other joints have as often are left out: 5 % over all that began, Bonferroni.
    """
    whose = ["number", "session"]
    every = pd.DataFrame({"number": people.joint, "session": frame["session"]}).drop_duplicates().sort_values(whose)
    every["place"] = every.groupby("number").cumcount()
    of_joint = every.groupby("number").size()
    told = codes_of(frame.assign(number=people.joint), "number")
    told = told[told["code"].map(severity).isin(_COUNT)].merge(every, on=whose)
    by = told.groupby(["number", "code"])
    rows = by.agg(sessions=("place", "size"), before=("place", "min"), since=("session", "min")).reset_index()
    own = of_joint.reindex(rows["number"]).to_numpy(float)
    rows["of"] = own - rows["before"]
    of_code = told["code"].value_counts().reindex(rows["code"]).to_numpy(float)
    rate = (of_code - rows["sessions"] + 0.5) / (len(every) - own + 1)
    chance = rate ** rows["sessions"] * (1 - rate).clip(lower=0) ** rows["before"]
    now = people.table["now"].to_numpy(bool)[rows["number"]]
    began = (rows["before"] > 0) & (rows["sessions"] > rows["of"] / 2) & now
    rows = rows[began & (chance * began.sum() < levels.NAMED)].set_index("number")
    rows = rows.join(people.table[["unit", "joint"]]).assign(severity=lambda x: x["code"].map(severity))
    order, columns = ["severity", "since", "unit", "joint", "code"], ["unit", "joint", "code", "severity", "since"]
    ranked: pd.DataFrame = rows.sort_values(order, ascending=[False, True, True, True, True])
    return ranked[[*columns, "sessions", "of"]]


def most_common(codes: Iterator[str]) -> tuple[str, ...]:
    """The three most frequent codes."""
    return tuple(code for code, _ in Counter(codes).most_common(3))

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

from bristle.errors import InputError
from bristle.questions.fleet.dataset import COLUMNS, schema_of
from bristle.questions.fleet.findings import Findings, findings
from bristle.questions.fleet.report import report
from simulated_fleet import FleetDesign, FleetTruth, fleet_estimates, fleet_truth

if TYPE_CHECKING:
    import pyarrow as pa

SMALL = FleetDesign(robots=60, joints=2)
Plain = tuple[pd.DataFrame, FleetTruth, Findings]  # a dataset, what is behind it, and what is found of it


def fleet(design: FleetDesign, seed: int = 0) -> tuple[pd.DataFrame, FleetTruth]:
    rng = np.random.default_rng(seed)
    truth = fleet_truth(design, rng)
    return fleet_estimates(design, truth, rng), truth


def accused(found: Findings) -> set[tuple[str, str]]:
    rows = found.joints[found.joints["changed"]]
    return set(zip(rows["unit"], rows["joint"], strict=True))


def worn(truth: FleetTruth) -> set[tuple[str, str]]:
    return {(f"robot-{r + 1:03d}", f"J{j + 1}") for r, j in zip(*np.nonzero(truth.worn), strict=True)}


def kinds(found: Findings) -> set[str]:
    return {x.code for x in found.notes}


def joined(*frames: pd.DataFrame) -> pd.DataFrame:
    """Frames one below the other, whatever the types of columns that hold nothing in one of them."""
    rows = pd.concat([frame.astype(object) for frame in frames], ignore_index=True).infer_objects()
    return rows.astype({"session": frames[0]["session"].dtype})


@pytest.fixture(scope="module")
def plain() -> Plain:
    """A fleet of 120 joints of which some wear."""
    frame, truth = fleet(SMALL)
    return frame, truth, findings(frame)


@pytest.mark.slow
def test_what_wears_is_named_and_little_else() -> None:
    """Over six fleets of 200 robots: of a change of 15 % at least 75 % are found, and 6 % of the named, joints or parameters, are false."""
    said = right = wrong = tests = 0
    total = 0
    for seed in range(6):
        frame, truth = fleet(FleetDesign(), seed)
        found = findings(frame)
        right += len(accused(found) & worn(truth))
        said += len(accused(found))
        total += len(worn(truth))
        named = found.changes[found.changes["changed"]]
        pairs = zip(named["unit"], named["joint"], named["parameter"], strict=True)
        wrong += sum((unit, joint) not in worn(truth) or name != "alpha_0" for unit, joint, name in pairs)
        tests += len(named)
    assert right / total > 0.75
    assert (said - right) / said < 0.06
    assert wrong / tests < 0.06
    # sessions that scatter by errors of few points, and no more: an error that is small by chance makes no joint accused, nor a scatter
    for freedom in (3.0, 8.0):
        accusations = 0
        for seed in range(12):
            frame, _ = fleet(FleetDesign(12, 2, 9, worn=0.0, scatter=0.0, errors=(0.005, 0.005), freedom=freedom), seed)
            found = findings(frame)
            accusations += found.changed > 0
            assert found.types["scatter_percent"].median() < 0.2
        assert accusations <= 2, freedom


def test_steps_are_placed_and_little_data_borrows(plain: Plain) -> None:
    """Of the joints that are found the step is at the worn session in most cases, and its interval mostly holds 15 %."""
    _, truth, found = plain
    hits = found.joints[[pair in worn(truth) for pair in zip(found.joints["unit"], found.joints["joint"], strict=True)]]
    hits = hits[hits["changed"]]
    robot, joint = hits["unit"].str[-3:].astype(int) - 1, hits["joint"].str[1:].astype(int) - 1
    since = truth.session[robot, truth.since[robot, joint]]
    assert len(hits) >= 3
    assert (hits["since"].to_numpy() == since).mean() >= 0.75
    assert ((hits["percent_lower"] < 15) & (hits["percent_upper"] > 15)).mean() >= 0.8
    assert set(hits["parameter"]) == {"alpha_0"}
    # shuffled rows give the same tables, but for the order of the series
    frame, _, found = plain
    again = findings(frame.sample(frac=1.0, random_state=1).reset_index(drop=True))
    for name in ("joints", "changes", "types", "units", "quality"):
        pd.testing.assert_frame_equal(getattr(found, name), getattr(again, name), rtol=1e-6)
    assert found.headline == again.headline
    # where sessions since the step have a warning that those before had not, the joint and a note name it; old warnings are not named
    frame, truth, found = plain
    unit, joint = min(accused(found) & worn(truth))
    own = (frame["unit"] == unit) & (frame["joint"] == joint)
    row = found.joints[(found.joints["unit"] == unit) & (found.joints["joint"] == joint)].iloc[0]
    late = own & (frame["session"] >= row["since"])
    said = np.where(late, "few-counts coarse-velocity", np.where(own, "few-counts", ""))
    again = findings(frame.assign(warnings=pd.Categorical(said)))
    row = again.joints[(again.joints["unit"] == unit) & (again.joints["joint"] == joint)].iloc[0]
    assert row["new_warnings"] == "coarse-velocity"
    (note,) = [x for x in again.notes if x.code == "warned-since"]
    assert "coarse-velocity" in str(note)
    assert set(again.quality["code"]) == {"few-counts", "coarse-velocity"}
    assert (again.quality["percent"] == 100 * again.quality["joint_sessions"] / again.quality["of"]).all()
    # a joint with one session is drawn to its type's mean more than those with eight, with a smaller error
    frame, _, _ = plain
    first = frame.loc[frame["unit"] == "robot-005", "session"].min()
    few = findings(frame[(frame["unit"] != "robot-005") | (frame["session"] == first)].reset_index(drop=True))
    rows = few.units[few.units["parameter"] == "alpha_0"]
    one, rest = rows[rows["unit"] == "robot-005"], rows[rows["unit"] != "robot-005"]
    assert (one["sessions"] == 1).all()
    assert one["borrowed_percent"].min() > rest["borrowed_percent"].median()
    both = one.merge(few.types[["type", "parameter", "direction", "mean"]], on=["type", "parameter", "direction"])
    ends = np.sort(both[["mean", "value"]].to_numpy(float), axis=1)
    assert ((ends[:, 0] <= both["shrunken"]) & (both["shrunken"] <= ends[:, 1])).all()
    assert (both["shrunken_error"] < both["standard_error"]).all()
    # a robot with 60 % more friction in all sessions is outside and has not changed; its own value is drawn in by little
    frame, _ = fleet(SMALL._replace(worn=0.0), 4)
    high = (frame["unit"] == "robot-007") & (frame["joint"] == "J1") & (frame["parameter"] == "alpha_0")
    for name in ("value", "standard_error", "lower", "upper"):
        frame[name] = frame[name].where(~high, 1.6 * frame[name])
    found = findings(frame)
    out = found.units[found.units["outside"]]
    assert set(zip(out["unit"], out["joint"], out["parameter"], strict=True)) == {("robot-007", "J1", "alpha_0")}
    assert set(found.joints.loc[found.joints["outside"], "unit"]) == {"robot-007"}
    assert accused(found) == set()
    assert (out["borrowed_percent"] < 5).all()


def test_temperature_is_taken_off_where_it_is_logged_and_may_be_missing() -> None:
    """With 10 K of swing and 1 %/K: the coefficient is in its interval for most parameters, and 0 is for v_s; no common shift is left."""
    frame, truth = fleet(FleetDesign(robots=100, joints=3, swing=10.0), 1)
    found = findings(frame)
    friction = found.types[found.types["parameter"].str.startswith("alpha")]
    inside = (friction["temperature_lower"] < 1.0) & (friction["temperature_upper"] > 1.0)
    assert inside.mean() > 0.8
    v_s = found.types[found.types["parameter"] == "v_s"]
    assert ((v_s["temperature_lower"] < 0) & (v_s["temperature_upper"] > 0)).all()
    assert "common-shift" not in kinds(found)
    assert len(accused(found) & worn(truth)) / len(worn(truth)) > 0.7
    assert len(accused(found) - worn(truth)) <= 0.07 * len(accused(found)) + 1
    # the same without wear, temperature not logged: the shift is named for every friction parameter, with its size, and no joint is accused
    frame, _ = fleet(FleetDesign(robots=100, joints=3, swing=10.0, worn=0.0), 2)
    found = findings(frame.assign(temperature=np.nan))
    shifts = [x for x in found.notes if x.code == "common-shift"]
    assert {x.numbers["type"] for x in shifts} == {"J1", "J2", "J3"}
    assert all(set(x.numbers["names"]) == {f"alpha_{k}{d}" for k in "012" for d in "+-"} for x in shifts)
    assert not any(x.numbers["temperature_logged"] for x in shifts)
    assert all(3 < abs(x.numbers["percent"]) < 15 for x in shifts)
    assert accused(found) == set()
    assert found.headline.code == "fleet-unchanged"
    # where a tenth of the sessions have no temperature their values count less, and what wears is still found
    frame, truth = fleet(FleetDesign(robots=100, joints=2, swing=10.0), 3)
    gaps = frame.assign(temperature=frame["temperature"].where(frame["session"].dt.day % 10 != 0))
    found = findings(gaps)
    assert gaps["temperature"].isna().mean() > 0.03
    assert len(accused(found) & worn(truth)) > 0.6 * len(worn(truth))
    assert len(accused(found) - worn(truth)) <= 2


def test_what_cannot_be_tested_says_why() -> None:
    """Two sessions a joint are too few for three of a baseline: nothing is tested, and that is said; nothing at all gives empty tables."""
    frame, _ = fleet(SMALL._replace(sessions=2))
    found = findings(frame)
    assert found.headline.code == "fleet-untested"
    assert "joints-untested" in kinds(found)
    assert (found.joints["untested"] != "").all()
    said = ["no such file", "no such file", "bad"]
    failed = frame.iloc[:3].assign(value=np.nan, failure=said, direction=None, parameter=None)
    none = findings(failed)
    assert none.headline.code == "fleet-untested"
    assert len(none.failures) == 2
    assert none.units.empty
    assert (none.quality["code"] == "failed").all()
    # of an offset about zero there is no percent, and it is left out; about -1 of either sign it is told in parts of its type's median
    frame, _ = fleet(SMALL._replace(worn=0.0), 5)
    base = frame["parameter"].astype(str)
    mirrored = frame.assign(value=np.where(base == "alpha_1", -frame["value"], frame["value"]))
    found = findings(mirrored)
    row = found.types[(found.types["parameter"] == "alpha_1") & (found.types["direction"] == "+")].iloc[0]
    assert row["mean"] < 0
    assert 5 < row["spread_percent"] < 15
    about = frame.assign(value=np.where(base == "alpha_1", 1e-9, frame["value"]))
    about.loc[about.index[base == "alpha_1"][::2], "value"] = -1e-9
    assert "alpha_1" not in set(findings(about).types["parameter"])
    # others are refused in a sentence, as is a baseline of no session
    frame, _ = fleet(SMALL._replace(robots=2))
    with pytest.raises(InputError, match="rate: got 0; expected"):
        findings(frame, rate=0.0)
    with pytest.raises(InputError, match="baseline: got 0; expected 1 to 10000 sessions"):
        findings(frame, baseline=0)


def test_values_that_are_not_to_be_used_are_left_out(plain: Plain) -> None:
    """Critical values, other fits, other units of a value and sessions left out do not move the findings of the others, and each is said."""
    frame, _, found = plain
    odd = frame[frame["unit"] == "robot-003"]
    wrong = odd.assign(value=3 * odd["value"])
    strange = [
        wrong.assign(unit="robot-901", severity="critical"),
        wrong.assign(unit="robot-902", value_unit="N"),
        wrong.assign(unit="robot-903", left_out="its clock went back"),
    ]
    again = findings(joined(frame, *strange))
    assert {"values-critical", "mixed-value-units", "sessions-left-out"} <= kinds(again)
    assert accused(again) == accused(found)
    pd.testing.assert_frame_equal(again.types, found.types)
    one = frame["session"].isin(frame.loc[frame["unit"] == "robot-003", "session"].unique()[-1:])
    other = findings(frame.assign(source=np.where(one & (frame["unit"] == "robot-003"), "joint", "static")))
    assert "of-other-fits" in kinds(other)
    # rows whose unit, joint or session is not known stand among the failures, and leave every joint as it is
    frame, _, found = plain
    rows = frame.iloc[:3].assign(value=np.nan, failure="no such file", parameter=None, direction=None)
    lost = {name: rows.index != k for k, name in enumerate(("unit", "joint", "session"))}
    rows = rows.assign(**{name: rows[name].where(known) for name, known in lost.items()})
    again = findings(joined(frame, rows))
    pd.testing.assert_frame_equal(again.joints, found.joints)
    assert len(again.failures) == 3
    (note,) = [x for x in again.notes if x.code == "sessions-failed"]
    assert note.numbers["failed"] == 3
    # a caution that begins in the fifth session is told with joint, time and count; a note, and a warning from the first on, are not
    frame, _, found = plain
    own = frame[["unit", "joint"]].astype(str).agg(" ".join, axis=1).to_numpy()
    at = np.sort(frame.loc[own == "robot-011 J2", "session"].unique())[4]
    late = (own == "robot-011 J2") & (frame["session"] >= at).to_numpy()
    said = np.where(late, "position-jumps", np.where(own == "robot-012 J1", "few-counts", ""))
    said = np.where((own == "robot-013 J1") & (frame["session"] >= at).to_numpy(), "offset-left-out", said)
    again = findings(frame.assign(warnings=pd.Categorical(said)))
    (row,) = again.warned.to_dict("records")
    assert (row["unit"], row["joint"], row["code"], row["severity"]) == ("robot-011", "J2", "position-jumps", "caution")
    assert row["since"] == at
    assert (row["sessions"], row["of"]) == (4, 4)
    assert accused(again) == accused(found)


def test_a_session_with_the_tag_baseline_begins_its_joint_anew(plain: Plain) -> None:
    """A joint that changed is accused no more once its step is its baseline, of which its sessions are counted; the others are as before."""
    frame, _, found = plain
    row = found.joints.iloc[0]
    own = ((frame["unit"] == row["unit"]) & (frame["joint"] == row["joint"])).to_numpy()
    since = row["since"]
    for at, tags, left in (
        (since, "new grease; Baseline", row["sessions_after"]),
        (since, "baselines", row["sessions"]),
        (since, "no-baseline", row["sessions"]),
        (frame.loc[own, "session"].min(), "baseline", row["sessions"]),
    ):
        marked = np.where(own & (frame["session"] == at).to_numpy(), tags, "")
        again = findings(frame.assign(tags=pd.Categorical(marked)))
        assert ("baselines-begun" in kinds(again)) == (left == row["sessions_after"])
        assert len(again.joints) == len(found.joints)
        new = again.joints.set_index(["unit", "joint"]).loc[(row["unit"], row["joint"])]
        assert new["sessions"] == left
        assert bool(new["changed"]) == (left == row["sessions"])
        assert accused(again) | {(row["unit"], row["joint"])} == accused(found)
        assert len(again.series) == len(found.series)
        pd.testing.assert_series_equal(again.types["joints"], found.types["joints"])
        counts = again.units[(again.units["unit"] == row["unit"]) & (again.units["joint"] == row["joint"])]["sessions"]
        assert counts.max() <= left
    # three marked sessions in a row begin one baseline; what was before it is no change, and a step after it is found against it
    frame, _ = fleet(FleetDesign(robots=60, joints=2, worn=0.0))
    place = frame.groupby("unit", observed=True)["session"].rank("dense")
    frame = frame.assign(tags=pd.Categorical(np.where(place.between(2, 4), "baseline", "")))
    assert findings(frame).joints["sessions"].unique().tolist() == [7]
    hit = (frame["unit"] == "robot-007") & (frame["joint"] == "J1") & (frame["parameter"] == "alpha_0")
    size = np.where(hit & (place > 5), 1.5, 1.0) * np.where(hit & (place < 2), 3.0, 1.0)
    worn = frame.assign(**{name: frame[name] * size for name in ("value", "standard_error", "lower", "upper")})
    found = findings(worn)
    assert accused(found) == {("robot-007", "J1")}
    assert found.joints.iloc[0]["since"] == frame.loc[hit & (place == 6), "session"].iloc[0]
    assert abs(found.joints.iloc[0]["percent"] - 50) < 15
    # a marked session of which no joint is known, its file being gone, begins the joints of its unit and type anew, and no others
    frame, _, found = plain
    row = found.joints.iloc[0]
    own = (frame["unit"] == row["unit"]) & (frame["joint"] == row["joint"])
    gone = frame[own & (frame["session"] == row["since"])].iloc[[0]]
    gone = gone.assign(tags="baseline", failure="no such file", **dict.fromkeys(("joint", "value", "standard_error")))
    for known in (row["type"], None):
        rest = frame[~(own & (frame["session"] == row["since"]))]
        again = findings(joined(rest, gone.assign(type=known))).joints.set_index(["unit", "joint"])
        assert again.loc[(row["unit"], row["joint"]), "sessions"] == row["sessions_after"] - 1
        others = again.loc[row["unit"]].drop(row["joint"])["sessions"]
        assert (others == row["sessions"]).all() == (known is not None)
        assert (again.drop(row["unit"], level=0)["sessions"] == row["sessions"]).all()


def _some_failed(frame: pd.DataFrame) -> pd.DataFrame:
    last = frame["session"] == frame["session"].max()
    nothing = dict.fromkeys(("parameter", "direction", "warnings", "simulated")) | dict.fromkeys(NUMBERS, np.nan)
    failed = frame[last].drop_duplicates(["unit", "joint"]).assign(failure="cut off; log it again", **nothing)
    return joined(frame[~last], failed)


NUMBERS = ("value", "standard_error", "lower", "upper")


FEATURES: Mapping[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "warnings": lambda frame: frame.assign(
        warnings=np.where(frame["session"].dt.month > 6, "clipped torque-drifts", "")
    ),
    "failures": _some_failed,
    "changes": lambda frame: frame.assign(value=frame["value"] * np.where(frame["session"].dt.month > 9, 2.0, 1.0)),
    "temperatures": lambda frame: frame.assign(temperature=20.0 + frame["session"].dt.month),
    "types": lambda frame: frame.assign(type=np.where(frame["unit"].astype(str) < "robot-005", "old", "new")),
}
"""What a fleet may have or lack."""


@pytest.mark.slow
def test_a_fleet_may_lack_anything() -> None:
    """No warning, failure, change, temperature or type, each alone and all together, with many joints or one session: text, page and tables are made.

    The frame has the types of the dataset as it is read, and every table of the findings the types that it has with all of them.
    """
    pytest.importorskip("pyarrow", reason="needs the extra fleet")
    bare, _ = fleet(FleetDesign(robots=8, joints=1, worn=0.0))
    wrong, types = list[str](), dict[str, str]()
    one = bare[bare["unit"] == "robot-001"].groupby("joint", observed=True).head(8)
    alone = [[name] for name in FEATURES]
    for frame, chosen in [*((bare, c) for c in [list(FEATURES), [], *alone]), *((one, c) for c in [[], *alone])]:
        for name in chosen:
            frame = FEATURES[name](frame)  # noqa: PLW2901  # built up
        table = pa_table(frame)
        try:
            found = findings(table.to_pandas())
            made = report(found)
            assert made.text()
            assert made.html()
            for x in (x for page in made.pages for section in page.sections for x in section.drawings):
                x.draw()
            tables = {x: getattr(found, x) for x in ("changes", "types", "units", "quality")}
            got = {f"{x}.{column}": kind.kind for x, made in tables.items() for column, kind in made.dtypes.items()}
            types = types or got
            wrong += [f"{chosen}: {k} is {got[k]}, not {types[k]}" for k in types if got[k] != types[k]]
        except (TypeError, ValueError, KeyError, AttributeError, ArithmeticError) as error:
            wrong.append(f"{chosen} of {len(frame)} rows: {type(error).__name__}: {error}")
    assert not wrong, "\n".join(wrong)


def pa_table(frame: pd.DataFrame) -> "pa.Table":
    import pyarrow as pa

    text = frame.assign(**{x: frame[x].astype(object) for x, holds in COLUMNS.items() if holds == "text"})
    text = text.assign(session=text["session"].astype("datetime64[us]"), simulated=text["simulated"].astype("boolean"))
    return pa.Table.from_pandas(text, schema=schema_of(tuple(COLUMNS), coded=True), preserve_index=False)


DOC = (Path(__file__).parents[2] / "docs" / "fleet.md").read_text(encoding="utf-8")


def test_columns_of_the_dataset() -> None:
    """The document's table has every column of the dataset, in its order."""
    section = DOC[DOC.index("## The dataset") : DOC.index("## What it finds")]
    first = " ".join(re.findall(r"^\|([^|]*)\|", section, re.MULTILINE))
    named = re.findall(r"`(\w+)`", first)
    assert sorted(named) == sorted(COLUMNS)
    # the document names the columns of every table of findings
    found = findings(fleet(FleetDesign(robots=6, joints=1, sessions=5))[0])
    names = ("joints", "changes", "types", "units", "quality", "warned", "failures", "series")
    rows = {x: re.findall(rf"^\| `{x}` \|[^|]*\|(.*)\|$", DOC, re.MULTILINE) for x in names}
    told = {table: set(re.findall(r"`(\w+)`", row)) for table, (row,) in rows.items()}
    assert told == {table: set(getattr(found, table).columns) for table in names}

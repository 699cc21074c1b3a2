"""The joint sessions of a catalog, with failures and sessions that are left out."""

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from bristle.errors import one_line, short, short_list
from bristle.questions.fleet.catalog import CatalogRow
from bristle.questions.fleet.survey import Surveyed

if TYPE_CHECKING:
    import pandas as pd

_IN_ORDER = 0.8  # least share of steps forward in time, between sessions of a joint, of a catalog in order of time
_OLDEST = "2001-01-01"  # clocks that were reset show 1970, 1980 or 2000


class JointSession(NamedTuple):
    """One joint in one session."""

    unit: str
    joint: str
    type: str
    session: object  # a datetime, or None
    temperature: float
    load: float
    tags: str
    file: str
    path: str  # absolute path or URL of the file
    name: str  # of the joint in the file
    key: str  # of its results; empty where it cannot be identified
    failure: str
    left_out: str = ""


def joint_sessions(rows: Iterable[CatalogRow], files: Mapping[str, Surveyed]) -> "pd.DataFrame":
    """A row per joint and session, with the columns of `JointSession`, in the order of the catalog.

    Several rows of one joint and session are one failure. Left out are: sessions of a joint with another type than most
    of its sessions; sessions before 2001, where most are later; and sessions whose clock went back: in a catalog in order
    of time (80 % of the steps between sessions of a joint go forward) of a joint with one step back, the sessions behind
    it that are earlier than those before it.
    """
    import pandas as pd

    whose = ["unit", "joint", "session"]
    frame = pd.DataFrame([x for row in rows for x in _of_row(row, files)], columns=list(JointSession._fields))
    frame["session"] = pd.to_datetime(frame["session"]).astype("datetime64[us]")

    # One failure in place of rows that are of one unit, joint and session.
    good = frame["failure"] == ""
    twice = good & frame[good].duplicated(whose, keep=False).reindex(frame.index, fill_value=False)
    failed = []
    for _, group in frame[twice].groupby(whose, sort=False):
        names = short_list(dict.fromkeys(group["file"]))
        reason = f"{len(group)} rows of the catalog are of this joint and session ({names}); name each session once"
        failed.append(group.iloc[0].to_dict() | {"failure": one_line(reason), "key": ""})
    if failed:
        made = pd.DataFrame(failed, columns=frame.columns).astype(frame.dtypes.to_dict())
        frame = pd.concat([frame[~twice], made], ignore_index=True)

    # Sessions whose joint mostly has another type.
    kept = frame[frame["failure"] == ""]
    types = kept.groupby(whose[:2])["type"].transform("nunique")
    for _, group in kept[types > 1].groupby(whose[:2], sort=False):
        most = set(group["type"].mode())
        first = next(x for x in group["type"] if x in most)
        odd = group.index[group["type"] != first]
        reason = f"but {short(first)} in {len(group) - odd.size} of the {len(group)} sessions of this joint; give it one type"
        frame.loc[odd, "left_out"] = [f"of type {short(other)}, {reason}" for other in group.loc[odd, "type"]]

    # Sessions whose clock was reset, in a catalog most of whose sessions are later.
    kept = frame[(frame["failure"] == "") & (frame["left_out"] == "")]
    early = kept["session"] < pd.Timestamp(_OLDEST)
    if early.mean() < 1 / 2:
        frame.loc[kept.index[early], "left_out"] = [
            f"its time is {at:%Y-%m-%d %H:%M}, that of a clock that was reset; set it right"
            for at in kept.loc[early, "session"]
        ]

    # Sessions whose clock went back.
    kept = frame[(frame["failure"] == "") & (frame["left_out"] == "")]
    by = kept.groupby(whose[:2], sort=False)["session"]
    step, latest = by.diff(), by.cummax()
    back, steps = step < step * 0, int(step.notna().sum())
    if steps and (~back & step.notna()).sum() >= _IN_ORDER * steps:
        once = back.groupby([kept["unit"], kept["joint"]], sort=False).transform("sum") == 1
        early = once & (kept["session"] < latest)
        frame.loc[kept.index[early], "left_out"] = [
            f"its time lies before {at:%Y-%m-%d %H:%M}, of a session above it in the catalog; set the clock right"
            for at in latest[early]
        ]
    return frame


def _of_row(row: CatalogRow, files: Mapping[str, Surveyed]) -> Iterator[JointSession]:
    found = files.get(row.path)
    failure = row.failure or ("" if found is None else found.failure)
    if found is None or failure:
        known = found.joints if found is not None and not row.failure else ()
        own = [row.joint] if row.joint or not known else known
        yield from (_session(row, name, "", failure) for name in own)
    elif not found.robot:
        yield _session(row, found.joints[0], found.key(found.joints[0]), "")
    elif row.joint and row.joint not in found.joints:
        reason = f"joint: got {short(row.joint)}; the file has {short_list(found.joints)}"
        yield _session(row, "", "", reason)
    else:
        yield from (_session(row, name, found.key(name), "") for name in ([row.joint] if row.joint else found.joints))


def _session(row: CatalogRow, name: str, key: str, failure: str) -> JointSession:
    joint = row.joint or name
    own = {"joint": joint, "type": row.type or joint, "name": name, "key": key, "failure": failure}
    return JointSession(**{**row._asdict(), **own})

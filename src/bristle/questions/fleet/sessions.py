"""The joint sessions of a catalog, with those that fail."""

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from bristle.errors import one_line, short, short_list
from bristle.questions.fleet.catalog import CatalogRow
from bristle.questions.fleet.survey import Surveyed

if TYPE_CHECKING:
    import pandas as pd


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
    path: str  # absolute path of the file
    name: str  # of the joint in the file
    key: str  # of its results; empty where it cannot be identified
    failure: str


def joint_sessions(rows: Iterable[CatalogRow], files: Mapping[str, Surveyed]) -> "pd.DataFrame":
    """A row per joint and session, with the columns of `JointSession`, in the order of the catalog.

    Several rows of one joint and session are one failure.
    """
    import pandas as pd

    whose = ["unit", "joint", "session"]
    frame = pd.DataFrame([x for row in rows for x in _of_row(row, files)], columns=list(JointSession._fields))
    frame["session"] = pd.to_datetime(frame["session"]).astype("datetime64[us]")
    good = frame[frame["failure"] == ""]
    for _, group in good[good.duplicated(whose, keep=False)].groupby(whose, sort=False):
        names = short_list(dict.fromkeys(group["file"]))
        reason = f"{len(group)} rows of the catalog are of this joint and session ({names}); name each session once"
        frame.loc[group.index[0], ["failure", "key"]] = [one_line(reason), ""]
        frame = frame.drop(index=group.index[1:])
    return frame.reset_index(drop=True)


def _of_row(row: CatalogRow, files: Mapping[str, Surveyed]) -> Iterator[JointSession]:
    found = Surveyed(row.path, failure=row.failure) if row.failure else files[row.path]
    failure = found.failure
    if not failure and found.robot and row.joint and row.joint not in found.joints:
        failure = f"joint: got {short(row.joint)}; the file has {short_list(found.joints)}"
    names = (row.joint,) if row.joint and (found.robot or not found.joints) else found.joints or ("",)
    for name in names:
        joint = row.joint or name
        own = {"joint": joint, "type": row.type or joint, "name": name, "failure": failure}
        yield JointSession(**{**row._asdict(), **own, "key": "" if failure else found.key(name)})

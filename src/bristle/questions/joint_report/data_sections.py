"""What the page shows of the data: each candidate segment, each file, and the settings in force."""

from collections.abc import Iterator, Mapping

import pandas as pd

from bristle.identification.results import Joint
from bristle.model.parameters import unit
from bristle.page.page import Drawing
from bristle.page.report import Section, Table
from bristle.page.wording import counted, pretty
from bristle.questions.joint_report import tables


def data(joint: Joint, _: Mapping[str, Drawing]) -> list[Section]:
    """All of it."""
    return [*_segments(joint), *_files(joint)]


def _segments(joint: Joint) -> Iterator[Section]:
    """Those that are kept, and those that are rejected but for passing from one speed to another."""
    if not joint.segments:
        moving = "moving data were fitted, not constant-velocity segments"
        why = moving if joint.static else "no run at constant velocity was given"
        yield Section("", text=f"No segments: {why}.", form="part")
        return
    velocity, torque = (f"{name} ({pretty(unit(name, joint.kind))})" for name in ("velocity", "torque"))
    error = f"its standard error ({pretty(unit('torque', joint.kind))})"
    frame = tables.segments([joint]).rename(columns={"velocity": velocity, "torque": torque, "standard_error": error})
    for name in ("reasons", "warnings"):
        frame[name] = pd.Series([getattr(x, name) for x in joint.segments], dtype=object)
    passing = pd.Series([any(reason.code == "transient" for reason in x.reasons) for x in joint.segments], dtype=bool)
    kept = frame[frame["accepted"]].drop(columns=["accepted", "reasons", "stick_slip", "start", "stop"])
    rejected = frame[~frame["accepted"] & ~passing][["file", "where", velocity, torque, "reasons"]]
    told = [f"{len(kept)} segments kept, {len(rejected)} rejected"]
    if passing.any():
        told.append(f"{passing.sum()} changes from one speed to another")
    if frame["stick_slip"].any():
        told.append(f"{frame['stick_slip'].sum()} stick-slip")
    yield Section("", text=f"{'; '.join(told)}.", form="part")
    parts = {"Rejected": (rejected, "Rejected, and what would make them pass"), "Kept": (kept, "Kept")}
    for name, (part, title) in parts.items():
        if len(part):
            yield Section(title, table=Table("segments", f"{name} segments", part=part), form="folded")


def _files(joint: Joint) -> Iterator[Section]:
    rows, dropped = (sum(getattr(x, name) for x in joint.inputs) for name in ("rows", "dropped"))
    yield Section("", text=f"{counted(len(joint.inputs), 'file')}, {rows} rows, {dropped} dropped.", form="part")
    frame = tables.inputs([joint])
    frame["notes"] = pd.Series([x.notes for x in joint.inputs], dtype=object)
    frame["sha256"] = [f"{text[:12]}…" if text else "" for text in frame["sha256"]]
    table = Table("inputs", "Files", part=frame, note="The file has the whole of sha256.")
    yield Section("Files and what was done with them", table=table, form="folded")
    if joint.settings:
        yield Section("Settings in force", facts=tuple(joint.settings.items()), form="folded")

import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bristle.data.columns import Key
from bristle.data.experiment.draft import DraftedRun, Told, draft_experiment
from bristle.data.experiment.load import load_experiment, read_runs
from bristle.data.ros.bag import open_bag
from bristle.data.ros.read import bag_columns, joint_states, topics_of
from bristle.data.text_table import RawTable, read_table
from bristle.errors import InputError

from ..bags import FORMATS, START, Message, held, number, plain_loop, state, wrench, write_bag
from .experiments import assert_refused

pytest.importorskip("rosbags", reason="the extra `ros` is not installed")

_QUICK = settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
_STAMP = Key("/joint_states.header.stamp")
_NAMES = ("shoulder", "elbow", "wrist")


def _read(bag: Path, *columns: str) -> RawTable:
    return read_table(bag, [Key(column) for column in columns])


def _refusal(bag: Path, *columns: str) -> str:
    with pytest.raises(InputError) as caught:
        _read(bag, *columns)
    return str(caught.value)


def _states(count: int, seed: int = 0) -> list[Message]:
    rng = np.random.default_rng(seed)
    return [state(START + 10**6 * k, _NAMES, *rng.standard_normal((3, 3)).tolist()) for k in range(count)]


@pytest.mark.parametrize(("form", "count"), [("sqlite3", 300), ("mcap", 9000), ("bag", 300)])
def test_a_bag_is_read_as_its_messages_are(tmp_path: Path, form: str, count: int) -> None:
    """Positions, velocities, efforts and stamps of joint states are those that rosbags deserialises, bit by bit, however many are read at once."""
    bag = write_bag(tmp_path, form, _states(count))
    places = [(field, joint) for joint in _NAMES for field in ("position", "velocity", "effort")]
    table = read_table(bag, [_STAMP, *(Key(f"/joint_states.{field}[{joint}]") for field, joint in places)])
    plain = plain_loop(bag, "/joint_states", lambda message: [held(message, *place) for place in places])
    np.testing.assert_array_equal(np.array(list(table.columns.values())[1:]).T, plain)
    assert table.rows == count
    np.testing.assert_array_equal(table.columns[_STAMP], np.arange(count) * 10**6 / 1e9)
    assert not table.notes


_JOINTS = ("a", "bb", "joint_3", "ellbow\u00fc")


@st.composite
def _odd_states(draw: Any) -> list[Message]:
    """Joint states whose joints come, go and change their order, with arrays that may be empty."""
    messages = []
    for k in range(draw(st.integers(1, 25))):
        names = draw(st.lists(st.sampled_from(_JOINTS), unique=True, max_size=4))
        arrays = [
            draw(st.lists(st.floats(-1e3, 1e3), min_size=n, max_size=n))
            for n in (draw(st.sampled_from([0, len(names)])) for _ in range(3))
        ]
        messages.append(state(START + 10**7 * k, names, *arrays, frame=draw(st.sampled_from(["", "base", "abcdefg"]))))
    return messages


@pytest.mark.parametrize("form", FORMATS)
@_QUICK
@given(messages=_odd_states())
def test_names_in_any_order(tmp_path_factory: Any, form: str, messages: list[Message]) -> None:
    """However joints come and go from message to message, each value is its joint's, and nan where it is not there."""
    bag = write_bag(tmp_path_factory.mktemp("bag"), form, messages)
    places = [(field, joint) for joint in _JOINTS for field in ("position", "effort")]
    plain = plain_loop(bag, "/joint_states", lambda message: [held(message, *place) for place in places])
    keys = [Key(f"{field}[{joint}]") for field, joint in places]
    there = ~np.isnan(plain).all(axis=0)
    found = read_table(bag, [key for key, is_there in zip(keys, there, strict=True) if is_there]).columns
    for key, wanted, is_there in zip(keys, plain.T, there, strict=True):
        if is_there:
            np.testing.assert_array_equal(found[key], wanted)
        else:
            assert re.search("no joint|is empty in all", _refusal(bag, str(key.column)))


@pytest.mark.parametrize("form", FORMATS)
def test_how_a_column_may_be_named(tmp_path: Path, form: str) -> None:
    """With or without the topic, by joint, by number or by index, the same column; any field of another topic."""
    messages = [*_states(20), *(wrench(START + 10**6 * k, 0.5 * k) for k in range(20))]
    bag = write_bag(tmp_path, form, messages)
    wanted = _read(bag, "/joint_states.position[elbow]").columns[Key("/joint_states.position[elbow]")]
    for name in ("position[elbow]", "joint_states.position[elbow]", "position[1]", "/joint_states.position[1]"):
        np.testing.assert_array_equal(_read(bag, name).columns[Key(name)], wanted)
    key = Key("/joint_states.position", 1)
    np.testing.assert_array_equal(read_table(bag, [key]).columns[key], wanted)
    torque = "/wrench.wrench.torque.z"
    np.testing.assert_array_equal(_read(bag, torque).columns[Key(torque)], 0.5 * np.arange(20))
    both = read_table(bag, [Key("position[elbow]"), Key("position[1]")]).columns
    np.testing.assert_array_equal(both[Key("position[elbow]")], both[Key("position[1]")])


def test_joints_named_by_numbers(tmp_path: Path) -> None:
    """Where joints are named by numbers, as servos on a bus are, a number in brackets is a name, and never a place."""
    bag = write_bag(tmp_path, "mcap", [state(START + k, ("2", "1"), (20.0 + k, 10.0 + k)) for k in range(5)])
    assert _read(bag, "position[1]").columns[Key("position[1]")].tolist() == [10, 11, 12, 13, 14]
    assert "is empty in all" in _refusal(bag, "position[0]")


_REFUSED = [
    (["position[ellbow]"], "no joint 'ellbow' in /joint_states; there are: shoulder, elbow, wrist"),
    (["/joint_state.position[elbow]"], "is of no topic of the bag; there are: /joint_states (sensor_msgs/msg/JointState), "),
    (["/joint_states.positions[elbow]"], "no field 'positions' in /joint_states; there are: header, name, position"),
    (["position"], "is an array; say which element"),
    (["header"], "is not a number but a message with stamp, frame_id"),
    (["header.frame_id"], "holds text; name a number"),
    (["name[0]"], "holds text; name a number"),
    (["header.stamp[0]"], "stamp is not an array; leave [0] out"),
    (["position[el[bow]"], "is not a field; expected names with dots between"),
    (["/wrench.wrench.torque[z]"], "torque is not an array"),
    (["effort[elbow]"], "is empty in all 4 messages of /joint_states"),
    (["position[7]"], "is empty in all 4 messages"),
    (["position[elbow]", "/wrench.wrench.torque.z"], "with no stamp; expected one time for all"),
    (["position[elbow]", "/wrench.time", "header.stamp"], "with the times of /wrench, /joint_states; expected one"),
    (["/load.header.stamp"], "no field 'header' in /load; there are: data, or /load.time, when messages were received"),
    (["/quiet.data", "position[elbow]", "header.stamp"], "/quiet: its own time, .*has 0 samples in that of the run"),
    (["x" * 2000], "is not a name"),
]  # fmt: skip  # a table


def test_what_cannot_be_read_is_said(tmp_path: Path) -> None:
    """Each name that means nothing in the bag, or one of two topics, has a sentence with what is there."""
    states = [state(START + k, _NAMES, (1.0, 2.0, 3.0 + k)) for k in range(4)]
    quiet = [number(START - 10**9, 1.0, "/quiet"), number(START - 1, 1.0, "/quiet")]
    bag = write_bag(tmp_path, "mcap", [*states, wrench(START, 1.0), number(START, 1.0), *quiet])
    assert_refused(
        (partial(_read, bag, *columns), re.escape(says).replace(r"\.\*", ".*")) for columns, says in _REFUSED
    )
    pair = [state(START, "ab", (1, 2)), state(START, "ab", (1, 2), topic="/arm/states")]
    both = write_bag(_made(tmp_path / "both"), "sqlite3", pair)
    assert "only a bag with exactly one of joint states allows" in _refusal(both, "position[a]")
    assert _read(both, "/arm/states.position[b]").rows == 1


@pytest.mark.parametrize("form", FORMATS)
def test_other_topics_are_interpolated(tmp_path: Path, form: str) -> None:
    """A line over time, sampled by another topic, is that line at the stamps of the time's topic; nan outside it and in its gap."""
    states = [state(START + 10**7 * k, ("elbow",), (float(k),)) for k in range(100)]
    times = [t for t in 10**6 * np.arange(55, 900, 7) if not 400 < t / 10**6 < 600]
    bag = write_bag(tmp_path, form, [*states, *(wrench(START + int(t), 3e-9 * t) for t in times)])
    torque = "/wrench.wrench.torque.z"
    table = _read(bag, "header.stamp", "position[elbow]", torque)
    time = table.columns[Key("header.stamp")]
    inside = (time >= times[0] / 1e9) & (time <= times[-1] / 1e9) & ~((time > 0.395) & (time < 0.604))
    np.testing.assert_allclose(table.columns[Key(torque)][inside], 3 * time[inside], atol=1e-12)
    assert np.isnan(table.columns[Key(torque)][~inside]).all()
    (note,) = table.notes
    assert str(note) == (
        f"/wrench interpolated linearly at the stamps of /joint_states; {(~inside).sum()} rows outside them, or in gaps "
        "longer than 5 intervals, left empty."
    )


def test_messages_without_a_header_stand_where_they_were_received(tmp_path: Path) -> None:
    """A topic without a header is interpolated from its receive times, which is said; and its time can be asked for."""
    states = [state(START + 10**7 * k, ("elbow",), (float(k),), late=0) for k in range(50)]
    bag = write_bag(
        tmp_path, "mcap", [*states, *(number(START + 10**7 * k + 5 * 10**6, k + 0.5) for k in range(-1, 50))]
    )
    table = _read(bag, "header.stamp", "position[elbow]", "/load.data")
    np.testing.assert_allclose(table.columns[Key("/load.data")], np.arange(50))
    assert "Times of /load are those at which messages were received" in str(table.notes[0])
    alone = _read(bag, "/load.time", "/load.data")
    np.testing.assert_allclose(alone.columns[Key("/load.time")], 0.01 * np.arange(51), atol=1e-15)
    assert alone.rows == 51


def test_stamps_that_were_never_set_are_refused(tmp_path: Path) -> None:
    """Stamps that are all zero are no time; the sentence says to take the receive time, which is then read."""
    # stamps that differ by a nanosecond differ by it when read, though a float of that time could not tell
    bag = write_bag(tmp_path, "mcap", [state(0, ("a",), (float(k),), late=START + 10**7 * k) for k in range(9)])
    assert "are all zero; name the time as /joint_states.time" in _refusal(bag, "header.stamp", "position[a]")
    table = _read(bag, "/joint_states.time", "position[a]")
    np.testing.assert_allclose(np.diff(table.columns[Key("/joint_states.time")]), 0.01)
    late = write_bag(_made(tmp_path / "late"), "sqlite3", [state(START + k, ("a",), (float(k),)) for k in range(100)])
    np.testing.assert_array_equal(_read(late, "header.stamp").columns[Key("header.stamp")], np.arange(100) / 1e9)


def test_compressed_and_split_bags(tmp_path: Path) -> None:
    """A bag with compressed chunks or messages, or of an older version, holds what the plain one does."""
    keys, states, plain = ("header.stamp", "position[wrist]", "effort[shoulder]"), _states(5000), None
    options: dict[str, list[dict[str, Any]]] = {
        "mcap": [{}, {"compression": "storage"}, {"compression": "message"}, {"compression": "file"}],
        "sqlite3": [{"compression": "message"}, {"version": 8}],
        "bag": [{"compression": "lz4"}, {"compression": "bz2"}],
    }
    for form, chosen in options.items():
        for k, option in enumerate(chosen):
            found = _read(write_bag(_made(tmp_path / f"{form}{k}"), form, states, **option), *keys).columns
            plain = plain or found
            for key, column in plain.items():
                np.testing.assert_array_equal(found[key], column)
    # the files that metadata.yaml names follow one another, and rows are in the order in which messages were received
    states = _states(30)
    parts = [write_bag(_made(tmp_path / str(k)), "mcap", states[15 * k : 15 * k + 15]) for k in range(2)]
    bag = _made(tmp_path / "both")
    for k in range(2):
        (bag / f"both_{k}.mcap").write_bytes((parts[k] / "mcap.mcap").read_bytes())
    text = (parts[0] / "metadata.yaml").read_text()
    (bag / "metadata.yaml").write_text(text.replace("- mcap.mcap", "- both_1.mcap\n  - both_0.mcap"))
    whole = _read(write_bag(_made(tmp_path / "whole"), "mcap", states), "position[wrist]")
    np.testing.assert_array_equal(
        _read(bag, "position[wrist]").columns[Key("position[wrist]")], whole.columns[Key("position[wrist]")]
    )


@pytest.mark.parametrize("form", ["sqlite3", "mcap"])
def test_a_storage_file_alone_is_the_bag(tmp_path: Path, form: str) -> None:
    """A single .db3 or .mcap file is read as its folder is, with one digest, and whatever case its suffix is in."""
    bag = write_bag(tmp_path, form, _states(10))
    (file,) = (path for path in bag.iterdir() if path.name != "metadata.yaml")
    copy = tmp_path / f"COPY{file.suffix.upper()}"
    copy.write_bytes(file.read_bytes())
    tables = [_read(path, "header.stamp", "position[elbow]") for path in (bag, file, copy)]
    assert len({table.sha256 for table in tables}) == 1
    assert {tuple(table.columns[Key("position[elbow]")]) for table in tables} == {
        tuple(tables[0].columns[Key("position[elbow]")])
    }


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def test_joints_topics_and_columns_are_listed(tmp_path: Path) -> None:
    """What a bag offers: its topics with their types, its joints in their order, and the names of its columns."""
    bag = write_bag(tmp_path, "bag", [*_states(2), wrench(START, 1.0)])
    assert {name: topic.kind for name, topic in topics_of(open_bag(bag)).items()} == {
        "/joint_states": "sensor_msgs/msg/JointState",
        "/wrench": "geometry_msgs/msg/WrenchStamped",
    }
    assert joint_states(bag) == ("/joint_states", ("shoulder", "elbow", "wrist"))
    assert {"/joint_states.header.stamp", "/joint_states.effort[wrist]", "/wrench.wrench.torque.z"} <= set(
        bag_columns(bag)
    )


@pytest.mark.parametrize("form", FORMATS)
def test_a_bag_of_one_joint_is_drafted_and_read(tmp_path: Path, form: str) -> None:
    """Joint states of one joint are drafted without help, stamps as the time; the draft loads, and reads the folder or file of the bag as it is."""
    t = 0.01 * np.arange(400)
    rows = np.column_stack([np.sin(t), np.cos(t), 2 * np.sign(np.cos(t)) + 0.5 * np.cos(t)]).tolist()
    messages = [state(START + 10**7 * k, ("elbow",), *([x] for x in row)) for k, row in enumerate(rows)]
    bag = write_bag(tmp_path, form, messages)
    draft = draft_experiment([bag], folder=tmp_path)
    assert [line.split(",")[0] for line in draft.signals] == [
        'time: {column: "/joint_states.header.stamp"', 'position: {column: "/joint_states.position[elbow]"',
        'velocity: {column: "/joint_states.velocity[elbow]"', 'torque: {column: "/joint_states.effort[elbow]"',
    ]  # fmt: skip  # a list of lines
    (tmp_path / "e.yaml").write_text(draft.text([DraftedRun("ramp")]), encoding="utf-8")
    (run,) = read_runs(load_experiment(tmp_path / "e.yaml"))
    assert run.record.file == bag.name
    assert run.record.rows == 400
    np.testing.assert_allclose(np.diff(run.record.time), 0.01)


def test_a_draft_of_several_joints_asks_which(tmp_path: Path) -> None:
    """Joint states of several joints are refused with their names; with the columns named, the time is their topic's."""
    bag = write_bag(tmp_path, "mcap", _states(50))
    with pytest.raises(InputError, match=r"joint states of 3 joints: shoulder, elbow, wrist; name the columns of one"):
        draft_experiment([bag])
    told = Told(columns={"position": "position[elbow]", "torque": "/joint_states.effort[elbow]"})
    assert draft_experiment([bag], told).signals[0] == 'time: {column: "/joint_states.header.stamp", unit: "s"}'

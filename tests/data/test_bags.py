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
from bristle.data.ros.bag import topics_of
from bristle.data.ros.read import bag_columns, joint_states
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


def _column(bag: Path, column: str, *others: str) -> list[float]:
    return list(_read(bag, column, *others).columns[Key(column)].tolist())


def _refusal(bag: Path, *columns: str) -> str:
    with pytest.raises(InputError) as caught:
        _read(bag, *columns)
    return str(caught.value)


def _states(count: int, seed: int = 0) -> list[Message]:
    rng = np.random.default_rng(seed)
    return [state(START + 10**6 * k, _NAMES, *rng.standard_normal((3, 3)).tolist()) for k in range(count)]


def test_a_bag_is_read_as_its_messages_are(tmp_path: Path) -> None:
    """Positions, velocities, efforts and stamps of joint states are those that rosbags deserialises, bit by bit, however many are read at once."""
    places = [(field, joint) for joint in _NAMES for field in ("position", "velocity", "effort")]
    for form, count in (("sqlite3", 300), ("mcap", 5000), ("bag", 300)):
        bag = write_bag(tmp_path, form, _states(count))
        table = read_table(bag, [_STAMP, *(Key(f"/joint_states.{field}[{joint}]") for field, joint in places)])
        plain = plain_loop(bag, "/joint_states", lambda message: [held(message, *place) for place in places])
        np.testing.assert_array_equal(np.array(list(table.columns.values())[1:]).T, plain)
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
            assert "is empty in all" in _refusal(bag, str(key.column))


def test_how_a_column_may_be_named(tmp_path: Path) -> None:
    """With or without the topic, by joint, by number or by index, the same column; any field of another topic."""
    for form in FORMATS:
        bag = write_bag(tmp_path, form, [*_states(20), *(wrench(START + 10**6 * k, 0.5 * k) for k in range(20))])
        wanted = _column(bag, "/joint_states.position[elbow]")
        for name in ("position[elbow]", "joint_states.position[elbow]", "position[1]", "/joint_states.position[1]"):
            assert _column(bag, name) == wanted
        key = Key("/joint_states.position", 1)
        assert read_table(bag, [key]).columns[key].tolist() == wanted
        assert _column(bag, "/wrench.wrench.torque.z") == (0.5 * np.arange(20)).tolist()
    # where joints are named by numbers, as servos on a bus are, a number in brackets is a name, and never a place
    (tmp_path / "numbers").mkdir()
    states = [state(START + k, ("2", "1"), (20.0 + k, 10.0 + k)) for k in range(5)]
    bag = write_bag(tmp_path / "numbers", "mcap", states)
    assert _column(bag, "position[1]") == [10, 11, 12, 13, 14]
    assert "is empty in all" in _refusal(bag, "position[0]")


_REFUSED = [
    (["position[ellbow]"], "is empty in all 4 messages of /joint_states; .* (joints: shoulder, elbow, wrist)"),
    (["/joint_state.position[elbow]"], "is of no topic of the bag, .*there are: /joint_states (sensor_msgs/msg/JointState), "),
    (["/joint_states.positions[elbow]"], "no number 'positions[elbow]' in /joint_states; there are: header.stamp, position[], "),
    *(([name], f"no number '{name}' in /joint_states; there are: header.stamp, ") for name in
      ("position", "header", "header.frame_id", "name[0]", "header.stamp[0]", "position.elbow")),
    (["/wrench.wrench.torque[z]"], "no number 'wrench.torque[z]' in /wrench; there are: header.stamp, wrench.force.x"),
    (["effort[elbow]"], "is empty in all 4 messages of /joint_states"),
    (["position[7]"], "is empty in all 4 messages"),
    (["position[elbow]", "/wrench.wrench.torque.z"], "with no time; expected one time for all"),
    (["position[elbow]", "/wrench.time", "header.stamp"], "with the times of /wrench, /joint_states; expected one"),
    (["/load.header.stamp"], "there are: data, time, when messages were received"),
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
    both = write_bag(tmp_path, "sqlite3", pair)
    assert "only a bag with exactly one of joint states allows" in _refusal(both, "position[a]")
    assert _column(both, "/arm/states.position[b]") == [2]
    # stamps that are all zero are no time: the sentence says to take the receive time
    (tmp_path / "zero").mkdir()
    unset = [state(0, ("a",), (float(k),), late=START + 10**7 * k) for k in range(9)]
    bag = write_bag(tmp_path / "zero", "mcap", unset)
    assert "are all zero; name the time as /joint_states.time" in _refusal(bag, "header.stamp", "position[a]")
    np.testing.assert_allclose(np.diff(_column(bag, "/joint_states.time", "position[a]")), 0.01)
    # stamps that differ by a nanosecond differ by it when read, though a float of that time could not tell
    late = write_bag(tmp_path / "zero", "sqlite3", [state(START + k, ("a",), (float(k),)) for k in range(100)])
    np.testing.assert_array_equal(_column(late, "header.stamp"), np.arange(100) / 1e9)


def test_other_topics_are_interpolated(tmp_path: Path) -> None:
    """A line over time, sampled by another topic, is that line at the stamps of the time's topic; nan outside it and in its gap."""
    states = [state(START + 10**7 * k, ("elbow",), (float(k),)) for k in range(100)]
    times = [t for t in 10**6 * np.arange(55, 900, 7) if not 400 < t / 10**6 < 600]
    for form in FORMATS:
        bag = write_bag(tmp_path, form, [*states, *(wrench(START + int(t), 3e-9 * t) for t in times)])
        table = _read(bag, "header.stamp", "position[elbow]", "/wrench.wrench.torque.z")
        time, _, torque = table.columns.values()
        inside = (time >= times[0] / 1e9) & (time <= times[-1] / 1e9) & ~((time > 0.395) & (time < 0.604))
        np.testing.assert_allclose(torque[inside], 3 * time[inside], atol=1e-12)
        assert np.isnan(torque[~inside]).all()
        (note,) = table.notes
        assert (note.code, note.numbers["rows"]) == ("topics-interpolated", (~inside).sum())
    # a topic without a header is interpolated from its receive times, which is said; and its time can be asked for
    states = [state(START + 10**7 * k, ("elbow",), (float(k),), late=0) for k in range(50)]
    loads = [number(START + 10**7 * k + 5 * 10**6, k + 0.5) for k in range(-1, 50)]
    (tmp_path / "load").mkdir()
    bag = write_bag(tmp_path / "load", "mcap", [*states, *loads])
    table = _read(bag, "header.stamp", "position[elbow]", "/load.data")
    np.testing.assert_allclose(table.columns[Key("/load.data")], np.arange(50))
    assert "Times of /load are those at which messages were received" in str(table.notes[0])
    np.testing.assert_allclose(_column(bag, "/load.time", "/load.data"), 0.01 * np.arange(51), atol=1e-15)


def test_compressed_split_and_single_files(tmp_path: Path) -> None:
    """A bag with compressed chunks or messages, or of an older version, holds what the plain one does."""

    def folder(name: str) -> Path:
        (tmp_path / name).mkdir()
        return tmp_path / name

    keys, states, plain = ("header.stamp", "position[wrist]", "effort[shoulder]"), _states(2000), None
    options: dict[str, list[dict[str, Any]]] = {
        "mcap": [{}, {"compression": "storage"}, {"compression": "message"}, {"compression": "file"}],
        "sqlite3": [{"compression": "message"}, {"version": 8}],
        "bag": [{"compression": "lz4"}, {"compression": "bz2"}],
    }
    for form, chosen in options.items():
        for k, option in enumerate(chosen):
            found = _read(write_bag(folder(f"{form}{k}"), form, states, **option), *keys).columns
            plain = plain or found
            for key, column in plain.items():
                np.testing.assert_array_equal(found[key], column)
    # the files that metadata.yaml names follow one another, and rows are in the order in which messages were received
    states = _states(30)
    parts = [write_bag(folder(str(k)), "mcap", states[15 * k : 15 * k + 15]) for k in range(2)]
    bag = folder("both")
    for k in range(2):
        (bag / f"both_{k}.mcap").write_bytes((parts[k] / "mcap.mcap").read_bytes())
    text = (parts[0] / "metadata.yaml").read_text()
    (bag / "metadata.yaml").write_text(text.replace("- mcap.mcap", "- both_1.mcap\n  - both_0.mcap"))
    whole = write_bag(folder("whole"), "mcap", states)
    assert _column(bag, "position[wrist]") == _column(whole, "position[wrist]")
    # a single .db3 or .mcap file is read as its folder is, with one digest, and whatever case its suffix is in
    for form in ("sqlite3", "mcap"):
        bag = write_bag(folder(f"single {form}"), form, _states(10))
        (file,) = (path for path in bag.iterdir() if path.name != "metadata.yaml")
        copy = tmp_path / f"COPY{file.suffix.upper()}"
        copy.write_bytes(file.read_bytes())
        tables = [_read(path, "header.stamp", "position[elbow]") for path in (bag, file, copy)]
        assert len({(table.sha256, *table.columns[Key("position[elbow]")].tolist()) for table in tables}) == 1


def test_what_bags_offer_and_their_drafts(tmp_path: Path) -> None:
    """What a bag offers: its topics with their types, its joints in their order, and the names of its columns."""
    bag = write_bag(tmp_path, "bag", [*_states(2), wrench(START, 1.0)])
    kinds = {"/joint_states": "sensor_msgs/msg/JointState", "/wrench": "geometry_msgs/msg/WrenchStamped"}
    assert {name: topic.kind for name, topic in topics_of(bag).items()} == kinds
    assert joint_states(bag) == ("/joint_states", ("shoulder", "elbow", "wrist"))
    wanted = {"/joint_states.header.stamp", "/joint_states.effort[wrist]", "/wrench.wrench.torque.z"}
    assert wanted <= set(bag_columns(bag))
    # joint states of several joints are refused with their names; with the columns named, the time is their topic's
    with pytest.raises(InputError, match=r"joint states of 3 joints: shoulder, elbow, wrist; name the columns of one"):
        draft_experiment([bag])
    told = Told(columns={"position": "position[elbow]", "torque": "/joint_states.effort[elbow]"})
    assert draft_experiment([bag], told).signals[0] == 'time: {column: "/joint_states.header.stamp", unit: "s"}'
    # those of one joint are drafted without help, stamps as the time; the draft loads, and reads the folder or file of the bag as it is
    t = 0.01 * np.arange(400)
    rows = np.column_stack([np.sin(t), np.cos(t), 2 * np.sign(np.cos(t)) + 0.5 * np.cos(t)]).tolist()
    messages = [state(START + 10**7 * k, ("elbow",), *([x] for x in row)) for k, row in enumerate(rows)]
    (tmp_path / "one").mkdir()
    for form in FORMATS:
        bag = write_bag(tmp_path / "one", form, messages)
        draft = draft_experiment([bag], folder=tmp_path)
        fields = {
            "time": "header.stamp",
            "position": "position[elbow]",
            "velocity": "velocity[elbow]",
            "torque": "effort[elbow]",
        }
        assert [line.split(",")[0] for line in draft.signals] == [
            f'{signal}: {{column: "/joint_states.{field}"' for signal, field in fields.items()
        ]
        (tmp_path / "e.yaml").write_text(draft.text([DraftedRun("ramp")]), encoding="utf-8")
        (run,) = read_runs(load_experiment(tmp_path / "e.yaml"))
        assert (run.record.file, run.record.rows) == (f"one/{bag.name}", 400)
        np.testing.assert_allclose(np.diff(run.record.time), 0.01)

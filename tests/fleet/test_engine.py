import contextlib
import errno
import hashlib
import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest
from tests.conftest import run, tree
from tests.fleet.logs import YAML, log_text, write_catalog, write_fleet_logs, write_session

import bristle
from bristle.api import fleets
from bristle.data.experiment import yaml_file
from bristle.errors import InputError
from bristle.questions.fleet import cluster, dataset, engine, survey, tasks

pytest.importorskip("distributed", reason="needs the extra fleet")
pytest.importorskip("pyarrow", reason="needs the extra fleet")
IDENTIFIED: list[str] = []  # the joints that were identified, in this process
KNOWN: dict[tuple[object, ...], Sequence[tasks.Row]] = {}
"""What was found in files of a content: the same fit is made once for all tests here."""
identified_joint = fleets.identified_joint


def counted(path: Path, joint: str) -> Sequence[tasks.Row]:
    """Identify a joint, unless one of the same content was, and remember that it was asked for."""
    IDENTIFIED.append(joint)
    content = (joint, *((x.name, x.read_bytes()) for x in sorted(path.parent.iterdir()) if x.is_file()))
    if content not in KNOWN:
        KNOWN[content] = identified_joint(path, joint)
    return KNOWN[content]


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the files that are read to survey them, as they are."""
    names: list[str] = []
    read, digest = yaml_file.read_text, hashlib.file_digest

    def counting(path: Path) -> str:
        names.append(path.name)
        return read(path)

    def hashing(file: Any, kind: str) -> Any:
        names.append(Path(file.name).name)
        return digest(file, kind)

    monkeypatch.setattr(survey, "read_text", counting)
    monkeypatch.setattr(hashlib, "file_digest", hashing)
    return names


@pytest.fixture
def ran(client: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Runs the fleet of a catalog; its output is out."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(fleets, "identified_joint", counted)

    def again(catalog: Any = "catalog.csv", output: Any = "out", **options: Any) -> bristle.Fleet:
        """The fleet; what was identified before is forgotten."""
        IDENTIFIED.clear()
        return bristle.fleet(catalog, output, client=client, **options)

    return again


def written() -> dict[str, bytes | None]:
    return tree(Path("out/results"))


def test_only_what_is_new_is_identified(ran: Any, tmp_path: Path, reads: list[str]) -> None:
    """The first run identifies all, the second reads nothing and identifies nothing, a new session of a unit is its two joints alone."""
    catalog, told = write_fleet_logs(tmp_path, units=2, sessions=2), list[tuple[str, int, int]]()
    first = ran(progress=lambda *step: told.append(step))
    assert sorted(IDENTIFIED) == 4 * ["elbow"] + 4 * ["wrist"]
    assert (first.identified, first.unchanged, first.failed) == (8, 0, 0)
    assert tuple(first.frame.columns) == tuple(dataset.COLUMNS)
    pd.testing.assert_frame_equal(first.frame, pd.read_parquet("out/results"))
    assert tree(Path("out/tasks")) == {}
    # whoever asks is told how fast it goes and how long it will take
    last = [what for what, done, total in told if what.startswith("identifying") and done == total == 8]
    assert last[0].endswith("/s, 0:00:00 left")
    before = written()
    reads.clear()
    second = ran()
    assert (IDENTIFIED, reads, second.unchanged, written()) == ([], [], 8, before)
    pd.testing.assert_frame_equal(first.frame, second.frame)
    with catalog.open("a") as file:
        for k, joint in enumerate(("wrist", "elbow")):
            path = write_session(tmp_path / "logs", "r1", joint, "2026-03-01", seed=70 + k)
            file.write(f"{path.relative_to(tmp_path)},r1,2026-03-01,\n")
    third = ran()
    assert sorted(IDENTIFIED) == ["elbow", "wrist"]
    assert sorted(set(reads)) == ["elbow.csv", "elbow.yaml", "wrist.csv", "wrist.yaml"]
    assert (third.identified, third.unchanged) == (2, 8)
    assert "2 joint sessions identified, 8 unchanged, 0 failed" in third.counts
    # while a run writes into a folder another one is refused
    with engine.held(tmp_path / "out"), pytest.raises(InputError, match="another run writes there"):
        ran()


def test_content_counts_and_nothing_else(ran: Any, tmp_path: Path, reads: list[str]) -> None:
    """A file that is touched is hashed, one that is changed identified; a moved fleet and another temperature are neither."""
    # units with the very same files are one task, and have rows each
    catalog = write_fleet_logs(tmp_path, units=1, sessions=2)
    shutil.copytree("logs/r0/2026-01-01", "logs/r9")
    with catalog.open("a") as file:
        file.write("logs/r9/wrist.yaml,r9,2026-01-01,20\n")
    both = ran()
    assert (len(IDENTIFIED), both.identified, both.unchanged) == (4, 4, 0)
    rows = both.frame[(both.frame["joint"] == "wrist") & (both.frame["session"] == "2026-01-01")]
    assert rows[rows["unit"] == "r9"]["value"].tolist() == rows[rows["unit"] == "r0"]["value"].tolist() != []
    log = tmp_path / "logs/r0/2026-01-01/wrist.csv"
    os.utime(log, (1, 1))
    reads.clear()
    ran()
    assert (IDENTIFIED, reads.count("wrist.csv"), reads.count("elbow.csv")) == ([], 1, 0)
    log.write_text(log_text(99))
    assert ran().identified == 1
    reads.clear()
    ran(verify=True)
    assert (IDENTIFIED, reads.count("wrist.csv"), reads.count("elbow.csv")) == ([], 3, 2)
    Path("logs").rename("moved")
    text = catalog.read_text().replace("logs/", "moved/").replace("-01,20", "-01,25")
    catalog.write_text(text)
    assert ran().frame["temperature"].max() == 25
    assert IDENTIFIED == []


def test_what_fails_is_a_row_and_the_rest_is_done(ran: Any, tmp_path: Path) -> None:
    """A corrupt log, a missing one, a missing file, a bad time and a session twice: a row each with its sentence, which names no folder."""
    catalog = write_fleet_logs(tmp_path, units=1, sessions=2)
    (tmp_path / "logs/r0/2026-01-01/wrist.csv").write_text("t,q,T\n" + 200 * "0,x,\x00\n")
    bad = tmp_path / "bad.yaml"
    bad.write_text(YAML.format(joint="wrist", log="none.csv"))
    with catalog.open("a") as file:
        file.write("bad.yaml,r1,2026-01-01,\nnone.yaml,r2,2026-01-01,\nbad.yaml,r3,soon,\n")
        file.write("logs/r0/2026-02-01/elbow.yaml,r0,2026-02-01T00:00,\n")
    found = ran()
    failures = found.frame[found.frame["failure"].notna()]
    said = dict(zip(failures["unit"], failures["failure"], strict=True))
    assert (found.identified, found.failed) == (2, 5)
    assert failures["direction"].isna().all()
    twice, corrupt = failures["failure"].tolist()[:2]
    assert "2 rows of the catalog are of this joint and session" in twice
    assert corrupt.startswith("wrist.csv: ")
    assert "bad.yaml: runs: files 'none.csv' is not a file" in said["r1"]
    assert "none.yaml: no such file" in said["r2"]
    assert "session: got 'soon'" in said["r3"]
    assert not failures["failure"].str.contains(str(tmp_path)).any()
    assert set(found.findings.failures["unit"]) == {"r0", "r1", "r2", "r3"}
    again = ran()
    assert IDENTIFIED == []  # a log that bristle refuses is refused for good
    assert (again.identified, again.unchanged, again.failed) == (0, 2, 5)
    pd.testing.assert_frame_equal(found.frame, again.frame)


def test_what_may_pass_is_a_row_and_tried_again(ran: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A defect, and a log that changes after it was hashed: each is said, and tried again; where nothing is left, the run is refused."""
    write_fleet_logs(tmp_path, units=1, sessions=1)

    def broken(path: Path, joint: str) -> Sequence[tasks.Row]:
        if joint == "elbow":
            raise KeyError("no such thing")
        return counted(path, joint)

    def changing(path: Path, joint: str) -> Sequence[tasks.Row]:
        if joint == "elbow":
            path.with_suffix(".csv").write_text(log_text(1000))
        return counted(path, joint)

    for identify, said in (
        (broken, "a defect of bristle: KeyError: 'no such thing'"),
        (changing, "elbow.yaml: it or a log was changed while the fleet was identified; run again"),
    ):
        monkeypatch.setattr(fleets, "identified_joint", identify)
        found = ran()
        assert found.failed == 1
        assert found.frame["failure"].dropna().tolist() == [said]
        assert found.frame["key"].isna().tolist() == found.frame["failure"].notna().tolist()
    monkeypatch.setattr(fleets, "identified_joint", counted)
    assert (ran().failed, IDENTIFIED) == (0, ["elbow"])
    row = {"file": "logs/r0/2026-01-01/elbow.yaml", "unit": "r0", "session": "2026-01-01"}
    write_catalog(tmp_path / "one.csv", [row])
    monkeypatch.setattr(fleets, "identified_joint", broken)
    none = r"none of 1 joint session could be identified; the first is 'logs/r0.*a defect of bristle"
    with pytest.raises(InputError, match=none):
        ran("one.csv", "other")


def test_a_full_disk_leaves_what_was(ran: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the disk is full the run ends with an OSError that names the file; the dataset is as it was, and a rerun goes on."""
    catalog = write_fleet_logs(tmp_path, units=1, sessions=1)
    ran()
    before = written()
    with catalog.open("a") as file:
        path = write_session(tmp_path / "logs", "r1", "wrist", "2026-03-01", seed=70)
        file.write(f"{path.relative_to(tmp_path)},r1,2026-03-01,\n")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(dataset, "json", SimpleNamespace(dumps=full))
    with pytest.raises(OSError, match="No space left") as stopped:
        ran()
    assert stopped.value.filename == str(tmp_path / "out/tasks/rows.jsonl")
    assert written() == before
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    assert ran().identified == 1


def test_versions_must_agree(ran: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers of another version are refused at the start, and what one that joins later is asked for is tried again; each in one sentence."""
    write_fleet_logs(tmp_path, units=1, sessions=1)
    other = tuple((name, "0.0" if name == "scipy" else found) for name, found in tasks.versions())
    monkeypatch.setattr(engine, "versions", lambda: other)
    said = r"the worker \S+ has scipy .*, and the client 0\.0; install the same versions of bristle, Python"
    with pytest.raises(InputError, match=said):
        ran()
    file = survey.survey("logs/r0/2026-01-01/wrist.yaml")
    late = tasks.identify_task(tasks.FleetTask("key", "wrist", file, other), counted)
    assert re.match(said, late.failure)
    assert (late.rows, IDENTIFIED) == ((), [])


def test_a_robot_file(ran: Any, tmp_path: Path) -> None:
    """A robot's file gives a task a joint; its URDF and logs are inputs of each, and a changed one is identified anew."""
    pytest.importorskip("pinocchio", reason="needs the extra robot")
    source = Path(bristle.__file__).parents[2] / "datasets" / "arm"
    for name in ("arm.urdf", "robot.yaml", "motion.csv", "held_out.csv"):
        shutil.copy(source / name, tmp_path)
    of = {"file": "robot.yaml", "unit": "arm", "session": "2026-01-01"}
    write_catalog(tmp_path / "catalog.csv", [of | {"joint": joint} for joint in ("flange", "hand")])
    found = ran()
    assert (IDENTIFIED, found.failed) == (["flange"], 1)
    (failure,) = found.frame["failure"].dropna()
    assert failure == "joint: got 'hand'; the file has turret, shoulder, elbow, wrist_roll, wrist_pitch, flange"
    assert found.frame["simulated"].dropna().all()
    robot, urdf = survey.survey(str(tmp_path / "robot.yaml")), tmp_path / "arm.urdf"
    assert [one.name for one in robot.inputs] == [".", "arm.urdf", "held_out.csv", "motion.csv"]
    assert robot.key("flange") == found.frame["key"].dropna().iloc[0] != robot.key("elbow")
    urdf.write_text(urdf.read_text() + "\n")
    assert survey.survey(robot.path, robot.inputs).key("flange") != robot.key("flange")


@pytest.mark.usefixtures("ran")
def test_the_command_line(client: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit codes: 0 with a page, 3 with --strict where a joint changed, until it is seen to; the counts of the run are told."""
    monkeypatch.setattr(cluster, "local_client", lambda *_: contextlib.nullcontext(client))
    monkeypatch.setattr("bristle.page.page.render", lambda _: (b"<svg/>", b""))
    write_fleet_logs(tmp_path, units=2, joints=("wrist",), sessions=4)
    done = run("fleet", "catalog.csv")
    assert (done.code, done.err) == (0, "")
    assert "8 joint sessions identified, 0 unchanged, 0 failed" in done.words
    assert done.out.splitlines()[-1] == "Page: reports/catalog-fleet/index.html"
    assert Path("reports/catalog-fleet/index.html").exists()
    for k in range(5, 8):
        write_session(tmp_path / "logs", "r1", "wrist", f"2026-0{k}-01", seed=k, factor=3.0)
    pattern = "logs/{unit}/{session}/{joint}.yaml"
    assert run("fleet", pattern, "-o", "out").code == 0
    worn = run("fleet", pattern, "-o", "out", "--strict")
    assert worn.code == 3
    assert "0 joint sessions identified, 11 unchanged, 0 failed" in worn.words
    told = "1 joint changed (--strict); once a change is seen to, tag the joint's next session baseline"
    assert worn.said == [told]
    logs = sorted(Path("logs").glob("*/*/*.yaml"))
    rows = [{"file": str(x), "unit": x.parts[1], "session": x.parts[2], "joint": x.stem} for x in logs]
    for row in rows:
        row["tags"] = "baseline" if (row["unit"], row["session"]) == ("r1", "2026-05-01") else ""
    write_catalog(tmp_path / "seen_to.csv", rows)
    seen_to = run("fleet", "seen_to.csv", "-o", "out", "--strict")
    assert seen_to.code == 0
    assert "0 joint sessions identified, 11 unchanged, 0 failed" in seen_to.words


def test_a_client_is_checked(client: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is no client is refused, and so are options of a cluster of one's own beside a client."""
    catalog = write_catalog(tmp_path / "c.csv", [{"file": "a.yaml", "unit": "r", "session": "2026-01-01"}])
    with pytest.raises(InputError, match=r"expected a distributed\.Client"):
        bristle.fleet(catalog, client="tcp://127.0.0.1:8786")
    with pytest.raises(InputError, match="workers: is for a cluster of this machine"):
        bristle.fleet(catalog, client=client, workers=2)
    with client.as_current(), pytest.raises(InputError, match="memory: is for"):
        bristle.fleet(catalog, memory="1 GiB")
    # options and paths that cannot be: exit 2 and one sentence, before a cluster is started
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cluster, "_WAIT", 1.0)
    write_catalog(tmp_path / "c.csv", [{"file": "a.yaml", "unit": "r", "session": "2026-01-01"}])
    tcp, tls = ("c.csv", "--scheduler", "tcp://127.0.0.1:1"), ("c.csv", "--scheduler", "tls://127.0.0.1:1")
    keys = ("--tls-cert", "x", "--tls-key", "y", "--tls-ca-file", "z")
    cases = (
        (("none.csv",), "none.csv: no such file"),
        ((*tcp, "--memory", "1 GiB"), "--memory: is for a cluster of this machine"),
        ((*tcp, "--workers", "2"), "--workers: is for a cluster of this machine"),
        (tcp, "no Dask scheduler answers"),
        (("c.csv", "--tls-cert", "x.pem"), "is for a --scheduler"),
        ((*tls, "--tls-cert", "x.pem"), "expected --tls-ca-file, --tls-cert and --tls-key together"),
        (("c.csv", "--scheduler", "nonsense"), "--scheduler: got 'nonsense'"),
        (("c.csv", "--scheduler", "a:1", *keys), "z: no such file"),
        *((("c.csv", "--memory", x), f"memory: got {x!r}; expected") for x in ("lots", "1 B", "-2 GiB")),
        (("c.csv", "--rate", "2"), "rate: got 2"),
        (("c.csv", "-o", "c.csv"), "c.csv"),
        (("c.csv", "-o", ""), "empty path"),
    )
    ended = [(said, run("fleet", *options)) for options, said in cases]
    assert not [(said, ran) for said, ran in ended if ran.code != 2 or len(ran.said) != 1 or said not in ran.err]

import contextlib
import errno
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from tests.conftest import run, tree
from tests.fleet.logs import YAML, log_text, write_catalog, write_fleet_logs, write_session

import bristle
from bristle.api import fleets
from bristle.errors import InputError
from bristle.questions.fleet import cluster, engine, files, survey, tasks
from bristle.questions.fleet.dataset import COLUMNS

pytest.importorskip("distributed", reason="needs the extra fleet")
pytest.importorskip("pyarrow", reason="needs the extra fleet")
IDENTIFIED: list[str] = []  # the joints that were identified, in this process
KNOWN: dict[tuple[object, ...], tasks.Identified] = {}
"""What was found in files of a content: the same fit is made once for all tests here."""
identified_joint = fleets.identified_joint


def counted(path: Path, joint: str) -> tasks.Identified:
    """Identify a joint, unless one of the same content was, and remember that it was asked for."""
    IDENTIFIED.append(joint)
    content = (joint, *((x.name, x.read_bytes()) for x in sorted(path.parent.iterdir()) if x.is_file()))
    if content not in KNOWN:
        KNOWN[content] = identified_joint(path, joint)
    return KNOWN[content]


def broken(path: Path, joint: str) -> tasks.Identified:
    """Fail at one joint as nothing that bristle foresees."""
    if joint == "elbow":
        raise KeyError("no such thing")
    return counted(path, joint)


class Reads:
    """Counts the files that are read, by name."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.names: list[str] = []
        for module, name in ((files, "digest_of"), (survey, "read_text"), (files, "read_bytes")):
            monkeypatch.setattr(module, name, self._counting(getattr(module, name)))

    def _counting(self, read: Any) -> Any:
        def counting(path: Any, *more: Any) -> Any:
            self.names.append(Path(path).name)
            return read(path, *more)

        return counting


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


def dataset(folder: Path = Path("out")) -> dict[str, bytes | None]:
    return tree(folder / "results")


def test_only_what_is_new_is_identified(ran: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first run identifies all, the second reads nothing and identifies nothing, a new session of a unit is its two joints alone."""
    catalog = write_fleet_logs(tmp_path, units=2, sessions=2)
    first = ran()
    assert sorted(IDENTIFIED) == 4 * ["elbow"] + 4 * ["wrist"]
    assert (first.identified, first.unchanged, first.failed) == (8, 0, 0)
    assert tuple(first.frame.columns) == tuple(COLUMNS)
    pd.testing.assert_frame_equal(first.frame, pd.read_parquet("out/results"))
    assert tree(Path("out/tasks")) == {}
    before, reads = dataset(), Reads(monkeypatch)
    second = ran()
    assert (IDENTIFIED, reads.names, second.unchanged, dataset()) == ([], [], 8, before)
    pd.testing.assert_frame_equal(first.frame, second.frame)
    with catalog.open("a") as file:
        for k, joint in enumerate(("wrist", "elbow")):
            path = write_session(tmp_path / "logs", "r1", joint, "2026-03-01", seed=70 + k)
            file.write(f"{path.relative_to(tmp_path)},r1,2026-03-01,\n")
    third = ran()
    assert sorted(IDENTIFIED) == ["elbow", "wrist"]
    assert sorted(set(reads.names)) == ["elbow.csv", "elbow.yaml", "wrist.csv", "wrist.yaml"]
    assert (third.identified, third.unchanged) == (2, 8)
    assert "2 joint sessions identified, 8 unchanged, 0 failed" in third.counts


def test_content_counts_and_nothing_else(ran: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
    reads = Reads(monkeypatch)
    ran()
    assert (IDENTIFIED, reads.names.count("wrist.csv"), reads.names.count("elbow.csv")) == ([], 1, 0)
    log.write_text(log_text(99))
    assert ran().identified == 1
    reads.names.clear()
    ran(verify=True)
    assert (IDENTIFIED, reads.names.count("wrist.csv"), reads.names.count("elbow.csv")) == ([], 3, 2)
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


def test_a_defect_is_a_row_and_tried_again(ran: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is no InputError is said to be a defect, and the next run tries it again; where nothing is left, the run is refused."""
    write_fleet_logs(tmp_path, units=1, sessions=1)
    monkeypatch.setattr(fleets, "identified_joint", broken)
    found = ran()
    assert (found.identified, found.failed) == (1, 1)
    assert found.frame["failure"].dropna().tolist() == ["a defect of bristle: KeyError: 'no such thing'"]
    assert found.frame["key"].isna().tolist() == found.frame["failure"].notna().tolist()
    row = {"file": "logs/r0/2026-01-01/elbow.yaml", "unit": "r0", "session": "2026-01-01"}
    write_catalog(tmp_path / "one.csv", [row])
    none = r"none of 1 joint session could be identified; the first is 'logs/r0.*a defect of bristle"
    with pytest.raises(InputError, match=none):
        ran("one.csv", "other")
    assert not Path("other").exists()
    Path("held").mkdir()
    with pytest.raises(InputError, match="none of 1 joint session could"):
        ran("one.csv", "held")
    assert tree(Path("held")) == {}
    monkeypatch.setattr(fleets, "identified_joint", counted)
    assert (ran().failed, IDENTIFIED) == (0, ["elbow"])


def test_a_log_that_changes_meanwhile_is_tried_again(ran: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Results of a log that was changed after it was hashed are not kept under the old content."""
    write_fleet_logs(tmp_path, units=1, sessions=1)

    def changing(path: Path, joint: str) -> tasks.Identified:
        """Write another log first."""
        if joint == "elbow":
            path.with_suffix(".csv").write_text(log_text(1000))
        return counted(path, joint)

    monkeypatch.setattr(fleets, "identified_joint", changing)
    (failure,) = ran().frame["failure"].dropna()
    assert failure == "elbow.csv: was changed while the fleet was identified; run again"
    monkeypatch.setattr(fleets, "identified_joint", counted)
    assert (ran().failed, IDENTIFIED) == (0, ["elbow"])


def test_what_a_killed_run_left_is_taken_up(ran: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An interrupt on the way leaves the tasks that are finished, and the next run does only the others."""
    write_fleet_logs(tmp_path, units=1, sessions=2)
    expected = ran(output="whole")
    spread, ends = cluster.spread, list[tasks.TaskEnd]()

    def interrupted(*arguments: Any) -> Iterator[Any]:
        """Stop behind the second task."""
        for call, end in spread(*arguments):
            if isinstance(end, tasks.TaskEnd):
                ends.append(end)
                if len(ends) == 3:
                    raise KeyboardInterrupt
            yield call, end

    monkeypatch.setattr(cluster, "spread", interrupted)
    with pytest.raises(KeyboardInterrupt):
        ran()
    monkeypatch.setattr(cluster, "spread", spread)
    assert len(tree(Path("out/tasks"))) >= 2
    found = ran()
    assert found.identified <= 2
    assert found.identified + found.unchanged == 4
    pd.testing.assert_frame_equal(found.frame, expected.frame)
    assert dataset() == dataset(Path("whole"))


def test_a_full_disk_leaves_what_was(ran: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the disk is full the run ends with an OSError that names the file; the dataset is as it was, and a rerun goes on."""
    catalog = write_fleet_logs(tmp_path, units=1, sessions=1)
    ran()
    before = dataset()
    with catalog.open("a") as file:
        path = write_session(tmp_path / "logs", "r1", "wrist", "2026-03-01", seed=70)
        file.write(f"{path.relative_to(tmp_path)},r1,2026-03-01,\n")

    def full(name: str, data: bytes) -> None:
        """Only small files fit."""
        if "/results/" in name or "/tasks/" in name:
            raise OSError(errno.ENOSPC, "No space left on device", name)
        write_whole(name, data)

    write_whole = files.write_whole
    for module in ("files", "dataset"):
        monkeypatch.setattr(f"bristle.questions.fleet.{module}.write_whole", full)
    with pytest.raises(OSError, match="No space left") as stopped:
        ran()
    assert str(stopped.value.filename).startswith(str(tmp_path / "out/tasks/"))
    assert dataset() == before
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    assert ran().identified == 1


def test_a_pattern_and_types(ran: Any, tmp_path: Path) -> None:
    """A pattern of folders is a catalog; its types are the columns' types, and a joint of two types has sessions that are left out."""
    write_fleet_logs(tmp_path, units=1, sessions=2)
    found = ran("logs/{unit}/{session}/{type}.yaml")
    assert found.frame["type"].unique().tolist() == ["elbow", "wrist"]
    assert found.frame["file"].iloc[0] == "logs/r0/2026-01-01/elbow.yaml"
    days = [f"2026-0{k}-01" for k in (1, 2)]
    rows = [{"file": f"logs/r0/{x}/wrist.yaml", "unit": "r0", "session": x, "type": f"t{x[6]}"} for x in days]
    mixed = ran(pd.DataFrame(rows))
    assert IDENTIFIED == []
    assert mixed.frame[mixed.frame["left_out"].notna()]["type"].unique().tolist() == ["t2"]
    said = "of type 't2', but 't1' in 1 of the 2 sessions of this joint; give it one type"
    assert mixed.findings.failures["failure"].tolist() == [said]


def test_one_bad_row_is_a_failure_of_that_row(ran: Any, tmp_path: Path) -> None:
    """A URL of no archive, a load that squares to infinity; a missing value of a nullable column is none."""
    write_fleet_logs(tmp_path, units=1, sessions=2)
    good = [f"logs/r0/2026-0{k}-01/wrist.yaml" for k in (1, 2)]
    (tmp_path / "no.zip").write_text("no archive", encoding="utf-8")
    frame = pd.DataFrame(
        {
            "file": [*good, "zip://x.yaml::no.zip", good[0]], "unit": ["r0", "r0", "r1", "r2"], "session": ["2026-01-01", "2026-02-01"] * 2,
            "temperature": pd.array([20.0, None, 21.0, 22.0], dtype="Float64"), "load": pd.array([1, None, 2, 1e308], dtype="Float64"),
        }
    )  # fmt: skip  # a table
    found = ran(frame)
    said = found.findings.failures.set_index("unit")["failure"]
    assert sorted(said.index) == ["r1", "r2"]
    assert "no.zip" in said["r1"]
    assert said["r2"] == "load: got 1e+308; expected a number between -1e+09 and 1e+09"
    temperatures = found.frame[found.frame["unit"] == "r0"].groupby("session")["temperature"].first()
    assert temperatures.isna().tolist() == [False, True]


def test_what_a_parquet_file_says_of_pandas_is_not_believed(ran: Any, tmp_path: Path) -> None:
    """A catalog with forged metadata of pandas is read for its columns; a part of the dataset may have a column more, but none less."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    write_fleet_logs(tmp_path, units=1, sessions=1)
    table = pa.table({"file": ["logs/r0/2026-01-01/wrist.yaml"], "unit": ["r0"], "session": ["2026-01-01"]})
    forged = {"pandas": '{"columns": 5, "index_columns": [{"kind": "range"}]}'}
    pq.write_table(table.replace_schema_metadata(forged), "c.parquet")
    assert ran("c.parquet").identified == 1
    (part,) = Path("out/results").iterdir()
    own = pq.read_table(part)
    pq.write_table(own.append_column("more", pa.array([1.0] * len(own))), part)
    again = ran("c.parquet")
    assert (again.identified, again.unchanged, list(again.frame)) == (0, 1, list(COLUMNS))
    (part,) = Path("out/results").iterdir()
    pq.write_table(own.drop_columns(["value"]), part)
    with pytest.raises(InputError, match=f"{part.name}: is damaged .*; remove it, and run again"):
        ran("c.parquet")


def test_two_runs_at_once_are_refused(ran: Any, tmp_path: Path) -> None:
    """While a run writes into a folder another one is refused."""
    write_fleet_logs(tmp_path, units=1, sessions=1)
    with engine.held(str(tmp_path / "out")), pytest.raises(InputError, match="another run writes there"):
        ran()


def test_versions_must_agree(ran: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers of another version are refused at the start, and one that joins later stops the run; each in one sentence."""
    write_fleet_logs(tmp_path, units=1, sessions=1)
    other = tuple((name, "0.0" if name == "scipy" else found) for name, found in tasks.versions())
    monkeypatch.setattr(cluster, "versions", lambda: other)
    said = r"the worker \S+ has scipy .*, and the client 0\.0; install the same versions of bristle, Python"
    with pytest.raises(InputError, match=said):
        ran()
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(engine, "versions", lambda: other)
    with pytest.raises(InputError, match="has scipy"):
        ran()


def test_files_in_memory_of_another_machine(ran: Any, tmp_path: Path) -> None:
    """Catalog, logs and output may be URLs of fsspec; a pattern too. Sentences show no temporary folder."""
    fsspec = pytest.importorskip("fsspec", reason="needs the extra fleet")
    memory = fsspec.filesystem("memory")
    write_fleet_logs(tmp_path, units=1, sessions=2)
    local = ran()
    memory.put(str(tmp_path / "logs"), "/fleet/logs", recursive=True)
    memory.put(str(tmp_path / "catalog.csv"), "/fleet/catalog.csv")
    try:
        far = ran("memory://fleet/catalog.csv", "memory://fleet/out")
        pd.testing.assert_frame_equal(local.frame, far.frame)
        assert {Path(x).name for x in memory.ls("/fleet/out/results", detail=False)} == set(dataset())
        assert far.write("memory://fleet/out") == "memory://fleet/out/index.html"
        assert ran("memory://fleet/catalog.csv", "memory://fleet/out").unchanged == 4
        memory.pipe("/fleet/logs/r0/2026-01-01/wrist.csv", b"t,q,T\n1,x,y\n")
        again = ran("memory://fleet/logs/{unit}/{session}/{type}.yaml", "memory://fleet/out")
        (failure,) = again.frame["failure"].dropna().tolist()
        assert failure.startswith("wrist.csv: ")
        assert again.frame["file"].iloc[0] == "memory://fleet/logs/r0/2026-01-01/elbow.yaml"
    finally:
        memory.rm("/fleet", recursive=True)


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
    assert survey.survey(robot.path, robot).key("flange") != robot.key("flange")


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
        (("none.csv",), "none.csv: No such file"),
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


def test_progress_tells_rate_and_time(ran: Any, tmp_path: Path) -> None:
    """Whoever asks is told how fast it goes and how long it will take."""
    write_fleet_logs(tmp_path, units=1, sessions=2)
    told: list[tuple[str, int, int]] = []
    ran(progress=lambda *step: told.append(step))
    last = [what for what, done, total in told if what.startswith("identifying") and done == total == 4]
    assert last[0].endswith("/s, 0:00:00 left")

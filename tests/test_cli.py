import errno
import io
import json
import os
import re
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from bristle import __version__
from bristle.__main__ import _LONGEST, main
from bristle.arrays import Array
from bristle.cli import output_folder
from bristle.data.experiment.load import load_experiment
from bristle.errors import InputError, one_line, reason
from bristle.identification.measured import measure
from bristle.model.rollout import rollout
from bristle.page import output_folder as report_files
from bristle.page.plain import interval
from bristle.page.wording import measured
from bristle.questions.compensation import experiments
from bristle.simulation.edro import TABLE_1

from .conftest import FEW, TRUTH, Ran, experiment, present, run, speeds, table, tree, write
from .pages import page_text

DOCS = Path(__file__).parents[1] / "docs"
Patch = Callable[[pytest.MonkeyPatch], None]
GRIPPER = TABLE_1["gripper rotation"].positive
FOLDER = None  # stands for a folder among the files of a bad input
PIPE = "a pipe"  # stands for a pipe that nobody writes to

GOOD = {"e.yaml": experiment(), "data.csv": table(FEW)}  # a good experiment, which each bad input spoils
IDENTIFY = ("identify", "e.yaml", "-o", "out.json")
INSPECT = ("inspect", "e.yaml", "-o", "out.png")
REPORT = ("report", "e.yaml", "-o", "out")
VALIDATE = ("validate", "e.yaml")
NEW = ("new", "data.csv", "-o", "draft.yaml")
FIT = (REPORT, IDENTIFY, VALIDATE)
READ = (*FIT, INSPECT)
ALL = (*READ, NEW)
PLAN = ("plan", "e.yaml")
ADAPT = ("adapt", "e.yaml", "-o", "out")
MANY = "9" * 20


COLUMNS = {
    "t": "time: {column: t, unit: s}",
    "q": "position: {column: q, unit: rad}",
    "v": "velocity: {column: v, unit: rad/s}",
}
"""Signals of a log, by column."""


def log(kind: str, more: str = "", **columns: Sequence[float] | Array) -> dict[str, str]:
    """An experiment of one run of a kind: a log of t, q or v, and tau; `more` joins the experiment file."""
    signals = "".join(f"  {COLUMNS[name]}\n" for name in columns if name in COLUMNS)
    file = (
        f"joint: {{name: wrist}}\nsignals:\n{signals}  torque: {{column: tau, unit: N*m}}\n"
        f"runs:\n  - {{files: data.csv, experiment: {kind}}}\n{more}"
    )
    rows = ("".join((",".join(f"{x:.9g}" for x in row), "\n")) for row in zip(*columns.values(), strict=True))
    return {"e.yaml": file, "data.csv": f"{','.join(columns)}\n{''.join(rows)}"}


def ramp(time: Sequence[float] | Array, velocity: Sequence[float] | Array) -> dict[str, str]:
    """A ramp experiment; its torque is that of viscous friction."""
    return log("ramp", t=time, v=velocity, tau=0.1 * np.asarray(velocity))


def full_disk(after: int, error: type[BaseException] | None = None) -> Patch:
    """Once `after` files are written, the next is only begun: the disk is full (the system names no file), or another error comes."""

    def patch(monkeypatch: pytest.MonkeyPatch) -> None:
        write_file, count = report_files._write, 0

        def fill(path: Path, data: bytes) -> None:
            nonlocal count
            count += 1
            if count > after:
                path.write_bytes(data[: len(data) // 2])
                raise error() if error else OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            write_file(path, data)

        monkeypatch.setattr(report_files, "_write", fill)

    return patch


def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are not drawn, for that takes seconds: what is tested is where files land."""
    monkeypatch.setattr("bristle.page.page.render", lambda _: (b"<svg/>", b""))


def bad(
    what: str,
    commands: Sequence[Sequence[str]],
    named: str,
    spoilt: Mapping[str, str | None] | None = None,
    *,
    gone: Sequence[str] = (),
    patch: Patch = lambda _: None,
) -> list[tuple[str, dict[str, str | None], Sequence[str], str, Patch]]:
    """One bad input, as it meets each of some commands.

    Args:
        what: it is.
        commands: that it meets.
        named: what the message must name.
        spoilt: text of files, by path, that replace or join the good ones; FOLDER for a folder, PIPE for a pipe.
        gone: good files that are not there.
        patch: what is done to the readers or writers.
    """
    inputs = {name: text for name, text in {**GOOD, **(spoilt or {})}.items() if name not in gone}
    return [(what, inputs, c, named, patch) for c in commands]


def yaml_with(old: str, new: str) -> dict[str, str]:
    assert old in GOOD["e.yaml"]
    return {"e.yaml": GOOD["e.yaml"].replace(old, new)}


STEPS = np.arange(600) / 100
TOSSED = np.random.default_rng(0).standard_normal(STEPS.size)
SLIDING = 0.3 * np.sin(2 * np.pi * 0.5 * STEPS)


def whole_joint(options: str, more: str = "") -> dict[str, str]:
    """An experiment of one moving run that shows all six parameters and the inertia, with adaptation options."""
    t = np.arange(0.0, 8.0, 2e-3)
    lines = ((0.25, 0.3), (0.06, 1.3), (0.04, 3.1), (0.02, 7.0))
    v = np.sum([a * np.sin(2 * np.pi * f * t + k) for k, (a, f) in enumerate(lines)], axis=0)
    tau = rollout(v, 2e-3, GRIPPER).torque + 1.3e-3 * np.gradient(v, t)
    more = more if "fit:" in more else f"fit: {{decimation: 2}}\n{more}"
    return log("tracking", f"adapt: {{{options}}}\n{more}", t=t, v=v, tau=tau)


MADE = {"out/.bristle-manifest": "index.html\n", "out/index.html": "the last report"}
BAD = [
    *bad("missing file", READ, "'data.csv' is not a file", gone=["data.csv"]),
    *bad("empty file", ALL, "data.csv: the file is empty", {"data.csv": ""}),
    *bad("wrong column", READ, "data.csv: no column named 'speed'", yaml_with("column: v", "column: speed")),
    *bad(
        "text among numbers", READ, "data.csv: row 3 of column 'tau' holds 'n.i.'",
        {"data.csv": "v,tau\n" + "0.1,0.2\n" * 2 + "0.1,n.i.\n" + "0.2,0.3\n" * 5},
    ),
    *bad("constant signal", READ, "data.csv: velocity is 0.1", {"data.csv": "v,tau\n0.1,0.2\n0.1,0.3\n0.1,0.4\n"}),
    *bad("no steady segment", FIT, "data.csv", ramp(STEPS, TOSSED)),
    *bad("malformed YAML", READ, "e.yaml: line 2", {"e.yaml": "joint: {name: wrist}\nsignals: ]\n"}),
    *bad("folder as data", ALL, "data.csv: is a folder", {"data.csv": FOLDER}),
    *bad("pipe as experiment", READ, "e.yaml: is a pipe", {"e.yaml": PIPE}),
    *bad("pipe as data", ALL, "data.csv: is a pipe", {"data.csv": PIPE}),
    *bad("control character in the name", READ, r"joint.name: the text 'wri\x1b[2Jst' holds U+001B", yaml_with("wrist", r"wri\e[2Jst")),
    *bad("lone surrogate in a label", READ, r"runs.0.load: the text '\ud800' holds U+D800", yaml_with("points}", r'points, load: "\ud800"}')),
    *bad("torque of another world", READ, "data.csv: torque reaches 1.96e-162 (SI)", yaml_with("tau, unit: N*m", "tau, unit: N*m, scale: 1e-25")
         | {"data.csv": "v,tau\n0.1,1.96e-137\n0.2,1e-137\n"}),
    *bad("steps of no time", READ, "data.csv: time spans 0 s to 3e-19 s in steps of 1e-19 s", ramp([0, 1e-19, 2e-19, 3e-19], [1, 2, 3, 4])),
    *bad("inertia that drowns the torque", FIT, "data.csv: an inertia of 1e+29 takes", whole_joint("", "inertia: 1e29 kg*m**2\n")),
    *bad("output below a file", [("report", "e.yaml", "-o", "data.csv/out")], "data.csv/out", patch=undrawn),
    *bad("draft of an experiment file", [("new", "e.yaml")], "e.yaml: is an experiment file, which is identified as it is; expected logs"),
    *bad("output is a folder", [("identify", "e.yaml", "-o", "out"), ("new", "data.csv", "-o", "out")], "out: is ", {"out": FOLDER}),
    *bad("output is the log", [("identify", "e.yaml", "-o", "data.csv")], "data.csv: is there already"),
    *bad("torque of the wrong sign", FIT, "e.yaml: the torque opposes the velocity", yaml_with("tau, unit: N*m", "tau, unit: N*m, scale: -1")),
    *bad(
        "torque as magnitudes", FIT, "at the 3 points of direction -",
        {"data.csv": "v,tau\n" + "".join(f"{v},{1 + abs(v)}\n" for v in (-3, -2, -1, 1, 2, 3))},
    ),
    *bad("presliding without loading", FIT, "data.csv: the torque never grows slowly from zero",
         log("presliding", t=STEPS, q=SLIDING, tau=0.1 + 0.001 * np.sin(STEPS))),
    *bad("tracking at rest", FIT, "data.csv: velocity is 0", log("tracking", t=STEPS, v=0 * STEPS, tau=0 * STEPS)),
    *bad("marker of no report", [REPORT, ADAPT], "out/.bristle-manifest: is not a list of files", {
        **MADE, "out/.bristle-manifest": "mine\n", "out/mine": "mine"}),
    *bad("output is a pipe", [REPORT, ADAPT], "out: is not a folder; a report needs a folder", {"out": PIPE}),
    *bad("output is a pipe", [IDENTIFY], "out.json: is a pipe; expected a file", {"out.json": PIPE}),
    *bad("output is the page", [(*PLAN, "-o", "next", "--page", "next")], "next: is in the way of the page in next"),
    *bad("argument of many characters", [("fit" * 1000,), ("inspect", "e" * 200 + ".yaml", "x" * 3000)], "..."),
    *bad("full disk", [REPORT], "out: No space left", patch=full_disk(5)),
    *bad("full disk", [IDENTIFY], "out.json: No space left", patch=full_disk(0)),
    *bad("reference that is no number", [ADAPT], "e.yaml: adapt.amplitude", yaml_with("signals:", "adapt: {amplitude: .nan rad}\nsignals:")),
    *bad(
        "period longer than the loop bears", [ADAPT], "the loop diverges with lugre, the gains of its PID and a period of 0.01 s",
        whole_joint("period: 10 ms, gains: {K_p: 100 N*m/rad, K_d: 10 N*m*s/rad}"),
    ),
    *bad(
        "tiny error of the inertia", [IDENTIFY], "expected an error of at least 1e-09 of the inertia",
        whole_joint("", "inertia: 1e-3 +/- 1e-30 kg*m**2\n"),
    ),
    *bad("decimation beyond reason", [IDENTIFY], "fit.decimation: got 100000", whole_joint("", "fit: {decimation: 100000}\n")),
    *bad("many samples", [("sensitivity", "e.yaml", "--samples", str(2**40))], f"samples: got {2**40}; expected a power of two"),
    *(row for option, value, named in (
        ("--repetitions", MANY, f"repetitions: got {MANY}; expected 20 to 100000"), ("--starts", "0", "starts: got 0"),
        ("--noise", "nan", "noise: got nan"), ("--noise", "much", "--noise"), ("-o", "data.csv", "data.csv: is a file"),
    ) for row in bad("validation that cannot be", [(*VALIDATE, option, value)], named)),
    *(row for option, value, named in (
        ("--amplitude", "0.5", "amplitude: got '0.5'; expected a number with its unit"),
        ("--amplitude", "-1 rad", "amplitude: got -1 rad; expected a quantity above 0"),
        ("--frequency", "3 rad/s", "frequency: unit 'rad/s' is not a unit of Hz"),
        ("--frequency", "1e12 Hz", "frequency: got 1e+12 Hz; expected 1e-06 to 10000 Hz"),
        ("--samples", "100", "samples: got 100; expected a power of two"),
    ) for row in bad("motion that cannot be", [("sensitivity", "e.yaml", "-o", "out", option, value)], named)),
    *bad("many workers", [(*REPORT, "--workers", MANY), (*IDENTIFY, "--workers", MANY)], "'--workers'"),
    *(row for options in ("position: [0 rad, 1e5 rad]", "rate: 100 kHz")
      for row in bad("plan that nobody plays", [(*PLAN, "-o", "next.csv", "--velocities", "4")], "a plan within these limits takes ",
                     yaml_with("runs:", f"plan: {{{options}}}\nruns:") | {"data.csv": table(speeds())})),
    *bad("unknown option", [(*c, "--colour") for c in ALL], "--colour"),
    *bad("unknown option", [(*c, "--stric") for c in FIT], "--stric"),
    *bad("option without its value", [("report", "e.yaml", "-o")], "-o"),
    *bad("unknown command", [("fit", "e.yaml")], "'fit'"),
    *bad("missing argument", [("plan",), ("inspect",)], "EXPERIMENT"),
    *bad("argument too many", [("identify", "e.yaml", "data.csv")], "data.csv"),
]  # fmt: skip  # a table


def spoilt(folder: Path, inputs: dict[str, str | None], command: Sequence[str], patch: Patch) -> tuple[Ran, bool]:
    """How a command on these inputs ended, and whether the folder is then as it was."""
    for name, text in inputs.items():
        path = folder / name
        (path if text is FOLDER else path.parent).mkdir(parents=True, exist_ok=True)
        if text is PIPE:
            os.mkfifo(path)
        elif text is not None:
            path.write_text(text, encoding="utf-8")
    before = tree(folder)
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.chdir(folder)
        patch(monkeypatch)
        ran = run(*command)
    return ran, tree(folder) == before


def test_bad_input_gets_one_sentence(tmp_path: Path) -> None:
    """Exit code 2, one sentence that names the file or key at fault, and not a byte on the disk is new, gone or changed."""
    failed = []
    for k, (what, inputs, command, named, patch) in enumerate(BAD):
        (tmp_path / str(k)).mkdir()
        ran, same = spoilt(tmp_path / str(k), inputs, command, patch)
        one = len(ran.said) == 1 and ran.said[0].startswith("bristle: ") and len(ran.said[0]) < 600
        if not (same and one and ran.code == 2 and named in ran.said[0] and "Traceback" not in ran.out + ran.err):
            failed.append((what, command, ran, same))
    assert failed == []


def placed(folder: Path, files: Mapping[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "e.yaml"


def test_units_far_off_are_fitted_without_a_word(tmp_path: Path) -> None:
    """A ramp whose time, velocity or torque is that many times too large or small is fitted, or refused in a sentence; never with a warning."""
    rng = np.random.default_rng(0)
    speed = np.repeat([0.02, 0.05, 0.1, 0.3, 0.5, 0.8, -0.02, -0.05, -0.1, -0.3, -0.5, -0.8], 500)
    speed += 1e-4 * rng.standard_normal(speed.size)
    columns = {"t": np.arange(speed.size) / 100, "v": speed, "tau": 0.2 * np.sign(speed) + 0.1 * speed}
    wrong = []
    for name, factor in product(columns, (1e-18, 1e18)):
        ran = run("identify", placed(tmp_path, log("ramp", **columns | {name: columns[name] * factor})))
        wrong += [] if (ran.code, len(ran.said)) == ((2, 1) if name == "t" else (0, 0)) else [(name, factor, ran)]
    assert wrong == []


def test_strict_ends_with_3_where_a_joint_is_not_to_be_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With --strict that is exit code 3 of every command that fits, and without it 0; the same result is written either way."""
    path = write(tmp_path, FEW)
    monkeypatch.chdir(tmp_path)
    assert run("identify", path, "-o", "free.json").code == 0
    strict = run("identify", path, "-o", "strict.json", "--strict")
    assert strict.code == 3
    assert len(strict.said) == 1
    assert (tmp_path / "strict.json").read_bytes() == (tmp_path / "free.json").read_bytes()
    undrawn(monkeypatch)
    one = write(tmp_path / "one", speeds(both=False))
    assert run("identify", one, "--strict", "--need", "1e-3%").code == 3
    assert run("identify", one, "--need", "none").code == 2
    assert run("report", "wrist.yaml", "--strict").code == 3
    free = (tmp_path / "free.json").read_text(encoding="utf-8").replace('"folder": "."', '"folder": "../.."')
    assert (tmp_path / "reports" / "wrist" / "results.json").read_text(encoding="utf-8") == free


def test_logs_need_no_experiment_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of logs alone, identified as drafted: what `new` and then `identify` say; --save keeps the file; what tells of logs is no word of a file."""
    (tmp_path / "points.csv").write_text(table(FEW), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    told = ("--unit", "velocity=rad/s", "--unit", "torque=N*m")
    assert run("new", "points.csv", *told, "-o", "drafted.yaml").code == 0
    by_file = run("identify", "drafted.yaml")
    alone, saved = run("identify", "points.csv", *told), run("identify", "points.csv", *told, "--save", "saved.yaml")
    assert alone.out == saved.out == by_file.out
    assert alone.said == saved.said != []
    assert "guessed: " in alone.said[0]
    assert (tmp_path / "saved.yaml").read_bytes() == (tmp_path / "drafted.yaml").read_bytes()
    assert run("identify", "points.csv", *told, "--save", "saved.yaml").code == 2
    assert run("report", "points.csv", *told, "-o", "out").code == 0
    assert (tmp_path / "out" / "index.html").exists()
    refused = run("identify", "drafted.yaml", *told)
    assert (refused.code, len(refused.said)) == (2, 1)


def test_identify_writes_the_schema_and_prints_the_fit(tmp_path: Path) -> None:
    """Where nothing is in warning --strict is 0; the JSON satisfies its schema, holds the truth within 5 standard errors, and is printed."""
    ran = run("identify", write(tmp_path, speeds()), "-o", tmp_path / "out.json", "--strict", "--uncertainty")
    assert ran.code == 0
    assert not ran.said
    results = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    schema = json.loads((DOCS / "results.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(results)
    fits = results["joints"]["wrist"]["static"]
    assert list(fits) == ["+", "-"]
    for fit in fits.values():
        assert set(fit["parameters"]) == {"alpha_0", "alpha_1", "alpha_2", "v_s"}
        for name, p in fit["parameters"].items():
            assert abs(p["value"] - getattr(TRUTH, name)) < 5 * p["standard_error"]
            shown = re.escape(measured(p["value"], p["standard_error"]).replace("±", "+/-"))
            assert re.search(rf"{name}{re.escape(fit['direction'])} +{shown} {re.escape(p['unit'])} ", ran.out)
    # with --uncertainty a line per parameter has its three intervals, as page and results.json have them, to the second digit of their error
    for sign, fit in results["joints"]["wrist"]["static"].items():
        for name, ways in fit["uncertainty"].items():
            ends = r"\s+".join(re.escape(interval(ways[way])) for way in ("covariance", "profile", "bootstrap"))
            assert re.search(rf"^ +{name}{re.escape(sign)} +\S+\s+{ends}\s", ran.out, re.MULTILINE)
            assert ways["profile"] == fit["parameters"][name]["interval"]


@pytest.mark.usefixtures("few_studies")
def test_adapt_puts_the_joint_into_the_loop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From one moving run: exit 0, a page with the sections and tables of the compensated joint, its replay, and a sentence on it."""
    for name, value in {"LONG": 4.0, "SETTLE": 1.0, "SHORT": 4.0}.items():
        monkeypatch.setattr(experiments, name, value)
    ran = run("adapt", placed(tmp_path, whole_joint("frequency: 1 Hz")), "-o", tmp_path / "out")
    assert ran.code == 0, ran.err
    assert "wrist, 1 Hz: RMS error" in ran.out
    assert "data.csv, partial law: It changes nothing here" in ran.words
    shown = page_text(tmp_path / "out" / "index.html")
    parts = ("Would adaptation help?", "Friction that drifts", "PID: default", "Learning rates:")
    assert [words for words in parts if words not in shown] == []
    assert (tmp_path / "out" / "tables" / "replay.csv").is_file()


@pytest.mark.parametrize("patch", [None, full_disk(0, KeyboardInterrupt)], ids=["fitting", "writing"])
def test_an_interrupt_is_130(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, patch: Patch | None) -> None:
    """Ctrl-C, while fitting or while writing, ends with 130, one word, no traceback, and nothing half-written."""
    path = write(tmp_path, FEW)
    before = tree(tmp_path)
    if patch:
        patch(monkeypatch)
    else:
        monkeypatch.setattr("bristle.api.identifying.identify_joint", _raiser(KeyboardInterrupt()))
    ran = run("identify", path, "-o", tmp_path / "out.json")
    assert ran.code == 130
    assert ran.said == ["interrupted"]
    assert tree(tmp_path) == before


@pytest.mark.parametrize("of", [RuntimeError, ValueError])
def test_our_own_defect_is_no_bad_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, of: type[Exception]) -> None:
    """Any exception but InputError and OSError leaves `main`, so that Python ends with its traceback and 1."""
    monkeypatch.setattr("bristle.api.identifying.identify_joint", _raiser(of("ours")))
    monkeypatch.setattr(sys, "argv", ["bristle", "identify", str(write(tmp_path, FEW))])
    with pytest.raises(of, match="ours"):
        main()


def _raiser(error: BaseException) -> Callable[..., None]:
    def fail(*_: object, **__: object) -> None:
        raise error

    return fail


def test_inspect_lists_and_draws(tmp_path: Path) -> None:
    """Every point is listed, kept or rejected with its reason, and drawn as what the file's name says."""
    velocity = np.array([0.1, 0.0, 0.2, -0.1])
    path = write(tmp_path, velocity)
    ran = run("inspect", path, "-o", tmp_path / "out.png")
    assert ran.code == 0
    assert not ran.said
    assert len(re.findall(r"^  kept ", ran.out, re.MULTILINE)) == 3
    assert re.search(r"^  rejected line 3: .*\n +At rest", ran.out, re.MULTILINE)
    assert "3 of 4 candidates kept." in ran.out
    assert (tmp_path / "out.png").read_bytes().startswith(b"\x89PNG\r\n")
    assert run("inspect", path, "-o", tmp_path / "out.svg").code == 0
    assert ET.parse(tmp_path / "out.svg").getroot().tag.endswith("}svg")  # noqa: S314  # our own file
    assert run("inspect", path).out == ran.out.rsplit("Figure: ", 1)[0]


def test_new_drafts_a_file_that_loads(tmp_path: Path) -> None:
    """A draft loads and reads as it is, from whatever folder it is written to, and what was assumed is said on stderr."""
    data = tmp_path / "pairs.csv"
    data.write_text(table(FEW).replace("v,tau", "velocity_rad_s,torque_Nm"), encoding="utf-8")
    (tmp_path / "plans").mkdir()
    ran = run("new", data, "-o", tmp_path / "plans" / "draft.yaml")
    assert ran.code == 0
    assert ran.said
    assert all(line.startswith("guessed: ") for line in ran.said)
    (found,) = measure(load_experiment(tmp_path / "plans" / "draft.yaml")).runs
    assert found.record.velocity is not None
    np.testing.assert_array_equal(found.record.velocity, FEW)
    printed = run("new", data)
    (tmp_path / "draft.yaml").write_text(printed.out, encoding="utf-8")
    assert printed.err == ran.err
    assert len(measure(tmp_path / "draft.yaml").runs) == 1


def test_version_and_help(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """`--version` prints the package's version and nothing else."""
    assert run("--version") == Ran(0, f"{__version__}\n", "")
    # escapes stand for what a terminal would obey; a very long sentence keeps its beginning and its end, where it says what to do
    assert one_line(reason(OSError("a\x1b[31m\nb\u202e \udc80")), _LONGEST) == "a\\x1b[31m b\\u202e \\udc80"
    for text in ("x" * 10**6, "x" * 499 + "\x1b" * 100):
        said = one_line(reason(InputError(f"file: {text}; name another")), _LONGEST)
        assert len(said) < 510
        assert re.fullmatch("file: .*; name another", said)
    # without any argument the help is printed, as with --help, and each command shows its own; on 80 columns no summary is cut
    monkeypatch.setenv("COLUMNS", "80")
    alone = run()
    assert alone == run("--help")
    assert alone.code == 0
    shown = re.findall(r"^  ([a-z]+)  +\S.*\.$", alone.out, re.MULTILINE)
    named = "report identify inspect validate adapt compare fleet sensitivity explore export plan new explain"
    assert set(shown) == set(named.split())
    assert not [line for line in alone.out.splitlines() if line.startswith("  ") and line.endswith("...")]
    assert max(map(len, alone.out.splitlines())) <= 80
    for name in shown:
        text = run(name, "--help").out
        assert "Usage: " in text
        assert f"Example: bristle {name}" in text
    # `bristle --help` imports none of the libraries that take seconds
    script = (
        "import sys; from bristle.__main__ import main; sys.argv = ['bristle', '--help']\n"
        "try: main()\n"
        "except SystemExit as stop: print(stop.code, *{name.split('.')[0] for name in sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)  # noqa: S603  # our own script
    code, *modules = done.stdout.splitlines()[-1].split()
    assert code == "0"
    assert "Usage: bristle" in done.stdout
    assert not {"numpy", "casadi", "pandas", "matplotlib", "scipy"} & set(modules)
    # without -o the folder has the name of the experiment file, or, of a results.json, of the folder that it lies in
    monkeypatch.chdir(tmp_path)
    found = [output_folder(None, Path(file), "-adapt") for file in ("wrist.yaml", "june/results.json")]
    assert found == [Path("reports/wrist-adapt"), Path("reports/june-adapt")]


def process(*arguments: object, streams: str = "", **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `bristle` in a process of its own, its standard streams as a shell redirects them, with these variables."""
    line = f"{shlex.join([sys.executable, '-m', 'bristle', *map(str, arguments)])} {streams}"
    known = {**os.environ, **environment}
    return subprocess.run(["/bin/sh", "-c", line], capture_output=True, text=True, env=known, check=False)  # noqa: S603 # our own command


class Shut(io.StringIO):
    """A standard stream that takes nothing."""

    def __init__(self, error: int) -> None:
        super().__init__()
        self.error = error

    def write(self, _: str, /) -> int:
        """Raise the error, as any text does."""
        raise OSError(self.error, os.strerror(self.error))


def test_output_that_nobody_takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full standard output is one sentence and exit code 2, before any file is moved to its place; of a reader that has gone none is said."""
    # then every command that writes does so, with 0
    write(tmp_path, speeds(), stem="e")
    (tmp_path / "data.csv").write_text(table(FEW), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    undrawn(monkeypatch)
    for command in (REPORT, IDENTIFY, INSPECT, NEW, (*VALIDATE, "--repetitions", "20", "--starts", "1", "-o", "sets")):
        before = tree(tmp_path)
        assert not (tmp_path / command[-1]).exists()
        full = run(*command, stdout=Shut(errno.ENOSPC))
        assert (full.code, full.said) == (2, ["bristle: standard output: No space left on device"])
        assert tree(tmp_path) == before
        assert run(*command, stdout=Shut(errno.EPIPE)).code == 0
        assert (tmp_path / command[-1]).exists()


@pytest.mark.slow
def test_streams_of_the_system(tmp_path: Path) -> None:
    """Streams that nobody reads, that are full, or whose encoding lacks a letter: what is to be written is, or 2 and one sentence."""
    # `bristle identify ... | head -0` ends without a word, with 0. A file that takes no byte, as a full disk, is a
    # sentence of every command, help too, and nothing is written. Letters that the terminal's encoding lacks are escaped
    path = write(tmp_path, FEW)
    command = [sys.executable, "-m", "bristle", "identify", str(path), "-o", str(tmp_path / "piped.json")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as piped:  # noqa: S603 # our own command
        present(piped.stdout).close()
        said = present(piped.stderr).read()
        assert (piped.wait(), said) == (0, b"")
    before = tree(tmp_path)
    for arguments in (("identify", path, "-o", tmp_path / "full.json"), ("--help",)):
        ran = process(*arguments, streams="> /dev/full")
        assert (ran.returncode, len(ran.stderr.splitlines())) == (2, 1)
        assert ran.stderr.startswith("bristle: ")
    assert process("fit", streams="2> /dev/full").returncode == 2
    assert tree(tmp_path) == before
    ran = process("identify", tmp_path / "ά.yaml", PYTHONIOENCODING="ascii:strict")
    assert ran.returncode == 2
    assert ran.stderr.startswith("bristle: ")
    assert "\\u03ac.yaml: no such file" in ran.stderr


def test_closed_streams_are_no_defect(tmp_path: Path) -> None:
    """With standard streams closed results are written, and a bad input still ends with 2; the codes are the only word left."""
    ran = process("identify", write(tmp_path, FEW), "-o", tmp_path / "out.json", streams="<&- >&- 2>&-")
    assert (ran.returncode, ran.stderr) == (0, "")
    assert json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["joints"]
    assert process("identify", tmp_path / "none.yaml", streams="<&- >&- 2>&-").returncode == 2

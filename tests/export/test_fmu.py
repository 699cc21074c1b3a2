import ctypes
import math
import platform
import re
import shutil
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from bristle.errors import InputError
from bristle.model.parameters import SIGNED, Lugre
from bristle.page.output_folder import zipped
from bristle.questions.export import fmu
from bristle.questions.export.export import Artefact, Request
from bristle.questions.export.exported import WAYS, ExportedJoint
from bristle.questions.export.fmu import TARGET, base_units, fmu_binary, fmu_variables, longest_step
from bristle.questions.export.loss import rms_percent
from bristle.simulation import edro
from export_checks import check
from export_checks.c import FLAGS
from export_checks.common import NotInstalled
from export_checks.fmu import (
    STEP,
    LoadedFmu,
    communication_points,
    drive_torque,
    fmu_problems,
    installed_fmpy,
    loaded_fmu,
    of_largest,
    python_joint,
    radau_held,
)

from .conftest import HOSTILE, SURROGATE, Handed, run, scaled

try:
    NO_FMPY = not installed_fmpy()
except NotInstalled:
    NO_FMPY = True
HERE = platform.system() == "Linux" and platform.machine() == "x86_64" and shutil.which("cc") is not None
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc, which is not installed")
runs = pytest.mark.skipif(NO_FMPY or not HERE, reason="needs fmpy, a C compiler and linux64; install bristle[fmu]")
needs_fmpy = pytest.mark.skipif(NO_FMPY, reason="needs fmpy, which is not installed; install bristle[fmu]")
ERROR, DISCARD = 3, 2
Exported = Callable[[str], Artefact]


def handed_over(joint: ExportedJoint) -> Artefact:
    return TARGET.write([joint], Request())


def files_of(content: bytes) -> dict[str, bytes]:
    """What is packed."""
    with zipfile.ZipFile(BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.fixture(scope="module")
def exported(handed: Handed) -> Exported:
    """The FMU of a joint of the embedded report; each is compiled once."""
    return cache(lambda of: handed_over(handed(of)))


@pytest.fixture(scope="module")
def wrist(exported: Exported) -> Iterator[LoadedFmu]:
    with loaded_fmu(exported("wrist pitch").content) as found:
        yield found


@runs
def test_check_holds_the_figures(handed: Handed, exported: Exported, wrist: LoadedFmu) -> None:
    """What `export_checks` says: valid; <= 1e-12 off Python; <= 0.01 % off Radau; the sources, built by fmpy, give the same."""
    joint = handed("wrist pitch")
    if shutil.which("make") is None and shutil.which("ninja") is None:
        pytest.skip("fmpy needs make or ninja to build, which are not installed")
    valid, python, radau, sources = check("fmu", exported(joint.name), [joint], Request())
    assert valid == "fmpy validation: no problem"
    assert float(re.findall(r"sliding: (\S+) of", python)[0]) <= 1e-12
    assert float(re.findall(r"Radau: (\S+) %", radau)[0]) <= 0.01
    assert float(re.findall(r"fmpy: (\S+) of", sources)[0]) <= 1e-12
    # over 10 s at 1 ms with presliding and reversals position, velocity and friction are within 1e-12 of the largest
    off = {}
    for name in edro.TABLE_1:
        joint = handed(name)
        torque = drive_torque(joint, communication_points())
        with loaded_fmu(exported(name).content) as found:
            played = found.play(torque)
        true = python_joint(joint, torque, STEP, longest_step(joint))
        pairs = ((getattr(played, x), getattr(true, x)) for x in ("friction", "deflection"))
        beside_it = [np.abs(x - y).max() / np.abs(y).max() for x, y in pairs]
        off[name] = float(np.max([of_largest(played, true), *beside_it]))
        assert np.count_nonzero(np.diff(np.sign(true.velocity))) > 10
    assert {name: x for name, x in off.items() if not x <= 1e-12} == {}
    # each friction parameter, the inertia and the longest step, set at the start, give what Python gives with that value
    joint, failed = handed("wrist pitch"), []
    torque = drive_torque(joint, communication_points()[3000:4000])
    plain, step = wrist.play(torque), longest_step(joint)
    tried: list[tuple[dict[str, float], ExportedJoint, float]] = [({"longest_step": 1e-3}, joint, 1e-3)]
    tried.append(({"inertia": 2 * (joint.inertia or 0)}, scaled(joint, J=2.0), step))
    for row in (x for x in joint.parameters if x.parameter.direction in SIGNED):
        rows = (replace(x, value=1.3 * x.value) if x is row else x for x in joint.parameters)
        own = f"{WAYS[row.parameter.direction]}__{row.parameter.name}"
        tried.append(({own: 1.3 * row.value}, replace(joint, parameters=tuple(rows)), step))
    for values_, other, h in tried:
        found = wrist.play(torque, **values_)
        ends = of_largest(found, python_joint(other, torque, STEP, h)), of_largest(found, plain)
        failed += [(values_, ends)] * (not (ends[0] <= 1e-12 and ends[1] > 1e-9))
    assert failed == []
    assert len(tried) == 14


@pytest.mark.slow
def test_the_default_step_follows_the_continuous_equations(handed: Handed) -> None:
    """Velocity within 0.01 % of SciPy's Radau, the torque held over each millisecond as the FMU holds it, also where the joint is another one."""
    joints = {
        "identified": {}, "stiff": {"sigma_0": 300.0, "sigma_1": 0.3, "J": 0.3}, "peaked": {"v_s": 0.15, "alpha_1": 8.0, "J": 0.1},
        "soft": {"sigma_0": 0.2, "v_s": 4.0, "J": 10.0},
    }  # fmt: skip  # a table
    off = {}
    for name, factors in joints.items():
        joint = scaled(handed("gripper rotation"), **factors)
        torque = drive_torque(joint, communication_points()[3000:3600])
        found = python_joint(joint, torque, STEP, longest_step(joint))
        off[name] = rms_percent(found.velocity, radau_held(joint, torque, STEP))
    assert {name: x for name, x in off.items() if not x <= 0.01} == {}


def test_default_steps_and_units(handed: Handed, monkeypatch: pytest.MonkeyPatch) -> None:
    """1, 2 or 5 times a power of ten, not longer than 1 ms nor a fiftieth of the joint's two times, and more than 0.4 of that."""
    for factor in np.logspace(-6, 4, 40):
        joint = scaled(handed(), J=float(factor))
        longest, J = longest_step(joint), joint.inertia or math.nan
        times = [t for p in joint.pair for t in (math.sqrt(J / p.sigma_0), J * p.v_s / (p.alpha_0 + p.alpha_1))]
        wanted = min(max(min(times) / 50, 1e-6), 1e-3)
        assert f"{longest:.6e}"[0] in "125"
        assert 0.4 * wanted * (1 - 1e-9) <= longest <= wanted * (1 + 1e-9)
    # without an inertia, or with a number out of range: refused, and the sentence says what to do
    joint = handed("wrist pitch")
    for spoilt, why in (
        (
            replace(joint, inertia=None),
            "no inertia is known, and an FMU of a joint needs one; add a tracking run, or give",
        ),
        (replace(joint, inertia=1e-12), "inertia: got 1e-12; the FMU takes 1e-09 to 10000"),
        (scaled(joint, v_s=1e-9), "v_s: got .*; the C code takes"),
    ):
        with pytest.raises(InputError, match=why):
            handed_over(spoilt)
    # exponents of the base units, the radian among them
    assert base_units("N*m*s/rad") == {"kg": 1, "m": 2, "s": -1, "rad": -1}
    assert base_units("kg*m**2") == {"kg": 1, "m": 2}
    # where it is not linux64, nothing is compiled and the artefact says so
    with monkeypatch.context() as patch:
        patch.setattr(fmu, "c_compiler", lambda: None)
        assert handed_over(handed()).holds.endswith("there is no C compiler here; fmpy compile makes the binary")
    monkeypatch.setattr(platform, "machine", lambda: "arm64")
    assert "C sources alone: this machine is not linux64" in handed_over(handed()).holds


def write_sources(content: dict[str, bytes], folder: Path) -> None:
    for file in ("fmu.c", "joint.h"):
        (folder / file).write_text(content[f"sources/{file}"].decode("ascii"), encoding="ascii")


def root_of(content: bytes) -> ET.Element:
    return ET.fromstring(files_of(content)["modelDescription.xml"])  # noqa: S314  # our own


@needs_gcc
def test_no_warning(exported: Exported, tmp_path: Path) -> None:
    """The sources compile without a word under every warning that the C header takes, with a prefix too, and never in single precision."""
    write_sources(files_of(exported("wrist pitch").content), tmp_path)
    for options in ([], ["-DFMI2_FUNCTION_PREFIX=abc_"], ["-DBRISTLE_SINGLE"], ["-Wshadow", "-O0"]):
        done = run(tmp_path, "gcc", *FLAGS, *options, "-c", "fmu.c", "-o", "fmu.o")
        assert (done.returncode, done.stderr) == (0, "")


def values(found: LoadedFmu, slave: Any, *names: str) -> list[float]:
    return list(slave.getReal([found.references[name] for name in names]))


def refused(call: Any, *arguments: Any, status: int = ERROR) -> None:
    with pytest.raises(Exception, match=rf"failed with status {status}"):
        call(*arguments)


@runs
def test_it_begins_at_its_start_values(wrist: LoadedFmu, handed: Handed) -> None:
    """Outputs are there before the first step: position and velocity as set, no deflection, and the friction of that velocity."""
    p = handed("wrist pitch").pair.positive
    slave = wrist.begin(wrist.instance(), start_position=0.4, start_velocity=0.3)
    assert values(wrist, slave, "position", "velocity", "z") == [0.4, 0.3, 0.0]
    (friction,) = values(wrist, slave, "friction")
    assert friction == pytest.approx((p.sigma_1 + p.alpha_2) * 0.3, rel=1e-12)
    slave.doStep(0.0, STEP)
    assert values(wrist, slave, "position")[0] > 0.4
    slave.reset()
    assert values(wrist, slave, "position", "velocity", "start_position") == [0.0, 0.0, 0.0]
    slave.freeInstance()
    # set while stepping, it changes the friction at once and nothing else; start values cannot be set any more
    slave = wrist.begin(wrist.instance(), start_velocity=0.3)
    names = ["position", "velocity", "z", "friction"]
    *before, old = values(wrist, slave, *names)
    slave.setReal([wrist.references["positive.alpha_2"]], [1.0])
    *after, new = values(wrist, slave, *names)
    assert (after, new > old + 0.5 * 0.3) == (before, True)
    refused(slave.setReal, [wrist.references["start_position"]], [1.0])
    slave.freeInstance()
    # no step goes past the stop time, and a hundred steps of 0.01 s go up to 1 s; the time is known
    slave = wrist.instance()
    slave.setupExperiment(startTime=0.0, stopTime=1.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    for t in np.cumsum([0.0, *[0.01] * 99]).tolist():
        slave.doStep(t, 0.01)
    refused(slave.doStep, t + 0.01, 0.01)
    value = ctypes.c_double()
    slave.fmi2GetRealStatus(slave.component, 2, ctypes.byref(value))
    assert value.value == pytest.approx(1.0, abs=1e-12)
    slave.freeInstance()


@runs
def test_instances_share_nothing(wrist: LoadedFmu, handed: Handed) -> None:
    """Two instances, stepped in turn with other torques and parameters, and four in threads, move as each does alone."""
    torque = drive_torque(handed("wrist pitch"), communication_points()[3000:3600])

    def stepped(slave: Any, first: int, last: int, sign: int = 1) -> list[list[float]]:
        rows = []
        for k in range(first, last):
            slave.setReal([0], [sign * torque[k]])
            slave.doStep(k * STEP, STEP)
            rows.append(values(wrist, slave, "position", "velocity", "z", "friction"))
        return rows

    alone = [wrist.play(torque), wrist.play(-torque, inertia=0.02)]
    slaves = [wrist.begin(wrist.instance("a")), wrist.begin(wrist.instance("b"), inertia=0.02)]
    ends = [
        [stepped(slave, k, k + 1, sign)[0] for slave, sign in zip(slaves, (1, -1), strict=True)] for k in range(600)
    ]
    assert [x[:2] for x in ends[-1]] == [[x.position[-1], x.velocity[-1]] for x in alone]
    slaves = [wrist.instance() for _ in range(4)]  # here: fmpy changes the directory of the process while it loads one
    with ThreadPoolExecutor(4) as pool:
        ran = pool.map(lambda slave, J: wrist.play(torque, slave=slave, inertia=J), slaves, (0.01, 0.02, 0.01, 0.02))
        first, second, third, _ = (x.velocity for x in ran)
    assert np.array_equal(first, third)
    assert np.array_equal(second, wrist.play(torque, inertia=0.02).velocity)
    # saved, stepped on, set again, also by way of bytes and in another instance: the same steps once more
    slave, other = wrist.begin(wrist.instance()), wrist.instance("other")
    stepped(slave, 0, 100)
    saved = slave.getFMUstate()
    kept = slave.serializeFMUstate(saved)
    on = stepped(slave, 100, 300)
    slave.setFMUstate(saved)
    assert stepped(slave, 100, 300) == on
    read = other.deSerializeFMUstate(kept)
    other.setFMUstate(read)
    assert stepped(other, 100, 300) == on
    for one, state in ((slave, saved), (other, read)):
        one.freeFMUstate(state)
        assert state.value is None
        one.freeInstance()


@runs
def test_a_bad_call_leaves_all_as_it_was(
    wrist: LoadedFmu, capsys: pytest.CaptureFixture[str], exported: Exported
) -> None:
    """Values, times and calls that cannot be taken return fmi2Error, one sentence each to the logger, and change no value; stepping goes on."""
    r, nan, inf = wrist.references, math.nan, math.inf
    slave = wrist.begin(wrist.instance())
    slave.setReal([r["torque"]], [0.2])
    slave.doStep(0.0, 0.01)
    everything = [*wrist.references]
    before = values(wrist, slave, *everything)
    bad: list[tuple[Any, ...]] = [
        *((slave.doStep, 0.01, h) for h in (0.0, -0.01, nan, inf, 1e12)),
        *((slave.doStep, t, 0.01) for t in (0.0, 0.0099, 0.02, nan)),
        *((slave.setReal, [r["torque"]], [x]) for x in (nan, -inf, 1e7)),
        *((slave.setReal, [r[name]], [-1.0]) for name in ("negative.sigma_0", "inertia", "longest_step")),
        (slave.setReal, [r["torque"], r["inertia"]], [0.3, nan]),
        (slave.setReal, [r["velocity"]], [1.0]),
        (slave.setReal, [99], [1.0]),
        (slave.getReal, [99]),
        (slave.getInteger, [0]),
        (slave.setString, [0], ["x"]),
        (slave.getDirectionalDerivative, [r["velocity"]], [r["torque"]], [1.0]),
        (slave.enterInitializationMode,),
        (slave.setFMUstate, None),
    ]
    for call, *arguments in bad:
        refused(call, *arguments)
        assert values(wrist, slave, *everything) == before
    told = capsys.readouterr().out.splitlines()
    assert sum(line.startswith("[ERROR] fmi2") for line in told) == len(told) == len(bad)
    slave.doStep(0.01, 0.01)
    slave.terminate()
    refused(slave.doStep, 0.02, 0.01)
    slave.freeInstance()
    # bytes of another length, of another FMU, or with a parameter that is no number make no state
    slave = wrist.begin(wrist.instance())
    saved = slave.getFMUstate()
    kept = slave.serializeFMUstate(saved)
    slave.freeFMUstate(saved)
    refused(slave.deSerializeFMUstate, kept[:-1])
    refused(slave.deSerializeFMUstate, b"\0" * len(kept))
    refused(slave.deSerializeFMUstate, kept[:48] + b"\xff" * 8 + kept[56:])
    with loaded_fmu(exported("elbow pitch").content) as elbow:
        other = elbow.begin(elbow.instance())
        refused(other.deSerializeFMUstate, kept)
        other.freeInstance()
    slave.freeInstance()
    assert capsys.readouterr().out.count("these bytes are no state of this FMU") == 3
    # another GUID, and model exchange, give no instance and a sentence
    slave = wrist.instance()
    for kind, guid in ((1, b"{0}"), (0, wrist.description.guid.encode())):
        assert not slave.fmi2Instantiate(b"x", kind, guid, b"", ctypes.byref(slave.callbacks), 0, 0)
    assert capsys.readouterr().out.count("[ERROR] fmi2Instantiate") == 2
    slave.freeInstance()


@runs
def test_a_motion_that_is_not_finite_is_discarded(exported: Exported, capsys: pytest.CaptureFixture[str]) -> None:
    """A step whose end is out of all bounds returns fmi2Discard and leaves the joint where it was."""
    content = files_of(exported("wrist pitch").content)
    low = content["sources/fmu.c"].replace(b"#define BR_LARGEST 1e30", b"#define BR_LARGEST 1e0")
    binary = fmu_binary({**content, "sources/fmu.c": low}, "x")
    assert isinstance(binary, bytes)
    (name,) = [name for name in content if name.startswith("binaries/")]
    with loaded_fmu(zipped({**content, name: binary})) as found:
        slave = found.begin(found.instance())
        slave.setReal([0], [1.0])
        refused(slave.doStep, 0.0, 0.5, status=DISCARD)
        assert values(found, slave, "position", "velocity", "z", "friction") == [0.0, 0.0, 0.0, 0.0]
        slave.doStep(0.0, 1e-4)
        slave.freeInstance()
    assert "[DISCARD] fmi2DoStep: the motion from 0 s on is not finite" in capsys.readouterr().out


@pytest.mark.slow
@needs_gcc
def test_hostile_names_stay_harmless(handed: Handed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """C compiles without a warning, in plain ASCII; XML is read, and fmpy takes it; file and model have plain names."""
    monkeypatch.setattr(
        fmu, "c_compiler", lambda: None
    )  # sources alone: a name reaches no more than comments, texts and identifiers
    for name in (*HOSTILE, SURROGATE):
        artefact = handed_over(handed("wrist pitch", name=name))
        content = files_of(artefact.content)
        assert re.fullmatch(r"[a-z0-9_]{1,60}\.fmu", artefact.name), name
        root = root_of(artefact.content)
        assert re.fullmatch(r"[a-z][a-z0-9_]{0,80}", root.attrib["modelName"]), name
        assert root.attrib["description"].endswith(
            "joint and LuGre friction, torque in, identified from SIMULATED data"
        )
        write_sources(content, tmp_path)
        done = run(tmp_path, "gcc", *FLAGS, "-fsyntax-only", "fmu.c")
        assert (name, done.returncode, done.stderr) == (name, 0, "")
        if not NO_FMPY:
            assert (name, fmu_problems(artefact.content)) == (name, [])


def test_what_was_identified_is_what_starts(
    handed: Handed, exported: Exported, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The start values are those of the joint, to the last digit, and every variable has its range in the description."""
    joint = handed("wrist pitch")
    variables = fmu_variables(joint)
    starts = {v.name: v.start for v in variables}
    for direction, p in zip(("positive", "negative"), joint.pair, strict=True):
        assert [starts[f"{direction}.{name}"] for name in Lugre._fields] == [*p]
    assert starts["inertia"] == joint.inertia
    written = {v.attrib["name"]: v[0].attrib for v in root_of(exported(joint.name).content).iter("ScalarVariable")}
    assert written.keys() == starts.keys()
    for v in (v for v in variables if v.start is not None):
        assert [float(written[v.name][x]) for x in ("start", "min", "max")] == [v.start, v.low, v.high]
    # the same bytes in another folder with another temporary one; no time, path or build id of this machine; the token tells joints apart
    first = exported(joint.name).content
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert handed_over(joint).content == first
    with zipfile.ZipFile(BytesIO(first)) as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
    assert not re.search(rb"bristle-[a-z0-9_]{8}|/tmp|/home|/work|/root", b"".join(files_of(first).values()))
    other = handed_over(scaled(joint, J=1.001))
    tokens = [root_of(x).attrib["guid"] for x in (first, other.content)]
    assert tokens[0] != tokens[1]
    assert all(re.fullmatch(r"\{[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\}", token) for token in tokens)


@needs_fmpy
def test_a_joint_that_slides_has_its_units(handed: Handed) -> None:
    """N and m, defined; the description is valid."""
    artefact = handed_over(handed("wrist pitch", kind="prismatic"))
    assert fmu_problems(artefact.content) == []
    units = {v.attrib["name"]: v[0].attrib["unit"] for v in root_of(artefact.content).iter("ScalarVariable")}
    expected = {"torque": "N", "position": "m", "velocity": "m/s", "inertia": "kg", "positive.sigma_0": "N/m"}
    assert expected.items() <= units.items()

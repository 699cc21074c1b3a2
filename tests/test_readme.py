import contextlib
import doctest
import io
import json
import os
import re
import shlex
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import typer.main

import bristle
from bristle import api, cli
from bristle.model.functions import steady_torque_function
from bristle.model.laws import registry
from bristle.model.motor import voltage
from bristle.model.parameters import Motor
from bristle.model.vectorize import evaluate
from bristle.page.said import entries
from bristle.simulation.bench import steady_points
from bristle.simulation.edro import TABLE_1

from .conftest import TRUTH, run, speeds, write

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
DOCS = Path(__file__).parents[1] / "docs"
PAGES = [*(DOCS.parent / name for name in ("README.md", "CHANGELOG.md")), *sorted(DOCS.glob("*.md"))]
MOTOR = Motor(0.35, 2.1, 0.0, 0.0)  # of the logs here: N*m/A and ohm
EXPERIMENT = """
joint: {name: wrist, kind: revolute}
motor: {torque_constant: 0.35 N*m/A, resistance: 2.1 ohm}
signals:
  time:     {column: t, unit: s}
  position: {column: q, unit: deg}
  voltage:  {column: u, unit: V}
runs:
  - {files: "velocity_*.csv", experiment: ramp}
"""
SPEEDS = np.geomspace(0.02, 0.8, 12)  # of the logs, rad/s


def blocks(language: str, text: str = README) -> list[str]:
    """The code blocks in a language, README's if no other text's."""
    found = re.findall(rf"^( *)```{language}\n(.*?)^\1```$", text, re.MULTILINE | re.DOTALL)
    return [textwrap.dedent(text) for _, text in found]


def commands() -> list[list[str]]:
    """Every `bristle ...` that README shows, in its text and in its shell blocks, as arguments."""
    inline = re.findall(r"`bristle ([^`]+)`", README)
    shell = re.findall(r"(?:\bbin/|^)bristle\b(.*)$", "\n".join(blocks("sh")), re.MULTILINE)
    return [shlex.split(command, comments=True) for command in (*inline, *shell)]


def executed(code: str, page: str, **names: Any) -> tuple[dict[str, Any], str]:
    """The names that Python of a page leaves, run as a user would, and what it prints."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(compile(code, page, "exec"), names)  # noqa: S102  # our own docs
    return names, out.getvalue()


@pytest.mark.usefixtures("few_motions")
def test_python_does_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """README's Python on a file runs as it stands: it prints the table, whose parameters are those behind the logs, and writes the report."""
    # of an experiment file and a log for each speed, back and forth
    monkeypatch.chdir(tmp_path)
    Path("wrist.yaml").write_text(EXPERIMENT, encoding="utf-8")
    rng = np.random.default_rng(0)
    for speed in (0.1, *SPEEDS.tolist()):
        v = np.repeat([speed, -speed], 300)
        (torque,) = steady_points(TRUTH, v, 1e-4, rng, 1)
        columns = {"t": np.arange(v.size) / 100, "q": np.degrees(np.cumsum(v) / 100), "u": voltage(torque, v, MOTOR)}
        pd.DataFrame(columns).to_csv(f"velocity_{speed:.4g}.csv", index=False)
    _, code = blocks("python")
    names, said = executed(code, "README.md", bristle=bristle)
    results = names["results"]
    frame = results.to_frame()
    assert said.startswith(f"{results}\nwrist: measure ")
    assert set(zip(frame["joint"], frame["direction"], strict=True)) == {("wrist", "+"), ("wrist", "-")}
    for _, row in frame.iterrows():
        assert row["value"] == pytest.approx(getattr(TRUTH, row["parameter"]), rel=0.1)
    (folder,) = re.findall(r'results\.write\("(.+?)"\)', code)
    assert (tmp_path / folder / "index.html").is_file()
    assert results.to_json(folder) == (tmp_path / folder / "results.json").read_text(encoding="utf-8")
    assert list(json.loads(results.to_json())["joints"]) == ["wrist"]


def test_two_arrays_give_what_is_shown() -> None:
    """README's Python on two arrays prints what stands below it: of 24 speeds each way, SIMULATED with 10 mN m of noise, seed 0."""
    code, _ = blocks("python")
    v = np.geomspace(0.02, 1.2, 24)
    velocity = np.concatenate([v, -v])
    level = 0.83 + 0.31 * np.exp(-((velocity / 0.09) ** 2))
    noise = 0.01 * np.random.default_rng(0).standard_normal(velocity.size)
    torque = np.sign(velocity) * level + 0.52 * velocity + noise
    assert [executed(code, "README.md", velocity=velocity, torque=torque)[1]] == blocks("text")
    # the real-time loops of docs/compensation.md run as they stand: at 0.1 rad/s the torque is the gripper's steady friction (9). Under
    # load it is a tenth of what the gear carries, 0.07 N*m, more
    codes = blocks("python", (DOCS / "compensation.md").read_text(encoding="utf-8"))
    p = TABLE_1["gripper rotation"].positive
    (steady,) = evaluate(steady_torque_function(), 0.1, *p[:4])
    for code, more in zip(codes, (0.0, 0.007), strict=True):
        names, _ = executed(code, "compensation.md")
        assert names["torque"] == pytest.approx(float(steady) + more, rel=1e-3)
    # the code of docs/arrays.md runs as it stands, and finds what it simulates: friction, and the bristle within its interval
    (code,) = blocks("python", (DOCS / "arrays.md").read_text(encoding="utf-8"))
    names, said = executed(code, "arrays.md")
    fit, dynamic, truth = names["fit"], names["dynamic"], names["truth"]
    for name, value in fit.params.items():
        assert value == pytest.approx(getattr(truth, name), abs=4 * fit.stderr[name])
    low, high = dynamic.conf_int().loc["sigma_0"]
    assert low < truth.sigma_0 < high
    assert "alpha_0" in said


def test_the_tutorial_leads_to_a_compensator(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """docs/tutorial.md runs as it stands, its first part in twenty lines: arrays and files find the truth within five standard errors."""
    text = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    code, (experiment,) = blocks("python", text), blocks("yaml", text)
    assert len(code[0].strip().splitlines()) <= 20
    (tmp_path / "wrist.yaml").write_text(experiment, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names, said = executed("\n".join(code), "tutorial.md")
    truth, results = names["truth"]._asdict(), names["results"].to_frame()
    of_arrays = names["dyn"].to_frame()
    for name, true in truth.items():
        assert of_arrays.value[name] == pytest.approx(true, abs=5 * of_arrays.standard_error[name])
        for row in results[results.parameter == name].itertuples():
            assert row.value == pytest.approx(true, abs=5 * row.standard_error)
    assert len(names["added"]) == 1000
    assert ": measure " in said


def runnable(page: Path) -> list[str]:
    """The Python of a page, without what it declares as not to be run."""
    return blocks(
        "python",
        re.sub(r"<!-- not run: .+ -->\n```python\n.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S),
    )


RUN_ABOVE = {"README.md", "arrays.md", "compensation.md", "tutorial.md"}  # pages whose code has a test of its own here
RUN_HERE = [page for page in PAGES if page.name not in RUN_ABOVE and runnable(page)]


@pytest.mark.parametrize("page", RUN_HERE, ids=lambda page: page.name)
def test_the_python_of_a_page_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Block after block, as one script, in a folder with the embedded experiments (`elbow.yaml`, say) and their logs, it runs as it stands."""
    for file in (DOCS.parent / "datasets" / "edro").iterdir():
        if file.suffix in {".yaml", ".csv"}:
            (tmp_path / file.name).write_bytes(file.read_bytes())
    monkeypatch.chdir(tmp_path)
    for kept in ("_PARTS", "_COMPETE"):  # a page may register a law
        monkeypatch.setattr(registry, kept, getattr(registry, kept).copy())
    assert "nan" not in executed("\n".join(runnable(page)), page.name)[1]


def test_a_line_of_shell_is_enough(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """README's line of shell ends in a first line as it shows one."""
    t = np.arange(6000) / 500
    v = 0.5 * np.cos(2 * t) + 0.4 * np.cos(5.1 * t + 1)
    torque = bristle.simulate(v, 1 / 500, TRUTH) + 0.002 * np.gradient(v, t)
    current = (torque + 1e-4 * np.random.default_rng(0).standard_normal(t.size)) / 0.35
    log = pd.DataFrame({"t": t, "q": np.degrees(np.cumsum(v) / 500), "current": current})
    log.to_csv(tmp_path / "log.csv", index=False)
    monkeypatch.chdir(tmp_path)
    first = next(c for c in commands() if c[0] == "identify" and "--unit" in c)
    ran = run(*first)
    assert ran.code == 0
    assert re.match(
        r"log \(revolute\): use\. Friction known to \+/- [\d.]+ % \(95 %\) from [\d.]+ to [\d.]+ rad/s, "
        r"ASSUMED torque_constant 0\.35 N\*m/A exact; ",
        ran.words,
    )
    assert 'guessed: current: column "current"' in ran.err


def test_commands_exist() -> None:
    """Each command that README or a shell block of a page shows is one, with these options; of README with these arguments."""
    root: Any = typer.main.get_command(cli.app)
    shell = "\n".join(x for page in sorted(DOCS.glob("*.md")) for x in blocks("sh", page.read_text(encoding="utf-8")))
    lines = re.findall(r"^bristle (.*)$", shell.replace("\\\n", " "), re.MULTILINE)
    wrong = []
    for k, (name, *arguments) in enumerate([*commands(), *(shlex.split(line, comments=True) for line in lines)]):
        context = root.commands[name].make_context(name, arguments)
        values = [v for x in context.params.values() for v in (x if isinstance(x, list) else [x])]
        plain = {a for a in arguments if not a.startswith("-")}
        if context.args or (k < len(commands()) and not plain <= set(map(str, values))):
            wrong.append((name, *arguments))
    assert wrong == []
    # README leaves no command out, and the way that commands are found in it misses none
    assert {command[0] for command in commands()} == set(root.commands)
    # no line of prose is longer than 120 characters, and each relative link names a file, and a heading of it
    astray = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        prose = re.sub(r"^ *```.*?^ *```$", "", text, flags=re.MULTILINE | re.DOTALL).splitlines()
        astray += [line for line in prose if len(line) > 120 and not re.match(r" *(\||!\[)", line)]
        for link in re.findall(r"\]\((?!https?:)([^)]+)\)", text):
            name, _, heading = link.partition("#")
            target = page.parent / name if name else page
            if not target.exists() or (heading and heading not in headings(target)):
                astray.append(f"{page.name}: {link}")
    assert astray == []


def headings(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them: words in lower case, blanks as hyphens."""
    titles = re.findall(r"^#+ +(.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


ROOT = Path(__file__).parents[1]
SOURCE = f"{ROOT / 'src' / 'bristle'}/"
TOUR = (ROOT / "docs" / "tour.md").read_text(encoding="utf-8")


CALLS = """
import json, sys
import bristle

called, source = {}, sys.argv[2]

def note(frame, event, _):
    code = frame.f_code
    if event == "call" and code.co_filename.startswith(source):
        called.setdefault((code.co_filename.removeprefix(source), code.co_name))

sys.setprofile(note)
found = bristle.identify(sys.argv[1])
sys.setprofile(None)
print(json.dumps([*called, found.joints[0].static["+"].parameters["alpha_0"].value]))
"""
"""Prints each function of bristle that an identification calls, in the order of first calls, and then alpha_0."""


def test_the_tour_is_the_way_of_one_csv(tmp_path: Path) -> None:
    """Every step is called for one CSV of points, and the first calls come in the order of the page."""
    steps = re.findall(r"^\d+\. `(\S+\.py)` `(\w+)`", TOUR, re.MULTILINE)
    every = re.findall(r"`(\S+\.py)`\s+`(\w+)`", TOUR)
    # in a process of its own: what ran before in this one is no matter
    command = [sys.executable, "-c", CALLS, str(write(tmp_path, speeds())), SOURCE]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    answer = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)  # noqa: S603  # our own script
    *calls, last = json.loads(answer.stdout)
    called = dict.fromkeys((file, name) for file, name in calls)
    assert set(every) - called.keys() == set()
    assert [step for step in called if step in steps] == steps
    assert len(steps) > 10
    assert last > 0
    # files and folders named in passing exist too
    named = set(re.findall(r"`((?:\w+/)+(?:\w+\.py)?|\w+\.py)`", TOUR))
    assert len(named) > 10
    roots = (Path(SOURCE), ROOT)
    assert {name for name in named if not any((root / name).exists() for root in roots)} == set()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built by the one command, where every warning is an error, a link to no place too."""
    for needed in ("sphinx", "myst_parser", "furo"):
        pytest.importorskip(needed, reason="needs the extra docs")
    folder = tmp_path_factory.mktemp("site")
    folders = ("-d", str(folder / "read"), "docs", str(folder / "html"))
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", *folders]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)  # noqa: S603  # our own command
    assert (built.returncode, built.stderr) == (0, "")
    return folder / "html"


def test_the_site_is_whole(site: Path) -> None:
    """Every public name, command and code of a warning has its entry, and nothing is loaded from elsewhere."""
    from sphinx.util.inventory import InventoryFile

    found: Any = InventoryFile.loads((site / "objects.inv").read_bytes(), uri="")
    python = {name for domain, names in found.data.items() if domain.startswith("py:") for name in names}
    assert {f"bristle.{name}" for name in bristle.__all__} <= python
    pages = {path.stem: path.read_text(encoding="utf-8") for path in site.glob("*.html")}
    assert [code for code in entries() if f"<strong>{code}</strong>" not in pages["warnings"]] == []
    root: Any = typer.main.get_command(cli.app)
    assert [name for name in root.commands if f'id="bristle-{name}"' not in pages["commands"]] == []
    loads = r"""<(?:img|script|iframe|source|link rel="stylesheet")[^>]* (?:src|href)="(?:https?:)?//[^"]*"""
    assert [found for text in pages.values() for found in re.findall(loads, text)] == []
    styles = "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.css"))
    assert not re.findall(r"url\(\s*[\"']?(?:https?:)?//|@import", styles)


EXAMPLES = sorted(name for name in bristle.__all__ if callable(getattr(bristle, name)) and name[0].islower())

POINTS = """v [rad/s],tau [Nm]
-1,-0.059
-0.3,-0.0312
-0.08,-0.0241
-0.02,-0.0252
0.02,0.0251
0.08,0.0241
0.3,0.0312
1,0.059
"""
WRIST = """joint: {name: points}
signals:
  velocity: {column: "v [rad/s]", unit: rad/s}
  torque: {column: "tau [Nm]", unit: N*m}
runs: [{files: points.csv, experiment: points}]
fit: {directions: symmetric}
"""


@pytest.mark.usefixtures("few_motions", "few_studies")
@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It prints what it says."""
    if name == "fleet":
        pytest.importorskip("distributed", reason="needs the extra fleet")
    (tmp_path / "points.csv").write_text(POINTS, encoding="utf-8")
    (tmp_path / "wrist.yaml").write_text(WRIST, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registry, "_PARTS", registry._PARTS.copy())
    found = doctest.DocTestFinder(recurse=False).find(getattr(bristle, name), name, globs={}, module=api)
    ran = [doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test) for test in found]
    assert sum(result.attempted for result in ran) > 1
    assert not any(result.failed for result in ran)

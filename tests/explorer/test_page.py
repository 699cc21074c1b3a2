import base64
import hashlib
import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

import bristle
from bristle.identification.known_joint import known_joint
from bristle.questions.explorer.page import Explorer

from ..conftest import experiment, speeds, table
from .conftest import HOSTILE, HOSTILE_FILE, Explored


class Read(HTMLParser):
    """The elements of a page with their attributes, and the text of each script."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.scripts: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag == "script":
            self.scripts.append("")

    def handle_data(self, data: str) -> None:
        if self.cdata_elem == "script":
            self.scripts[-1] += data


def known_of(page: Explorer) -> Any:
    return json.loads(Read(page.html).scripts[0])["known"]


def test_the_page_is_small_and_loads_nothing(edro: Explored) -> None:
    """Under 3 MB with four joints; no element names anything to fetch, styles neither."""
    # the policy allows the page's own scripts alone, and a worker of their text, which stands once
    html = edro.page.html
    assert len(html.encode()) < 3e6
    read = Read(html)
    for tag, given in read.elements:
        assert not {"src", "srcset", "data", "action", "background"} & given.keys(), tag
        assert not given.get("href", "data:,").startswith(("http", "//")), tag
        assert not [name for name in given if name.startswith("on")], tag
    style = html[html.index("<style>") : html.index("</style>")]
    assert "url(" not in style
    assert "@import" not in style
    (policy,) = [
        given["content"] for tag, given in read.elements if given.get("http-equiv") == "Content-Security-Policy"
    ]
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "; worker-src blob:; " in policy
    assert html.count("function steadyTorque(") == html.count("async function map(") == 1
    digests = re.findall(r"'sha256-([^']+)'", policy)
    assert digests == [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in read.scripts[1:]]
    # values, intervals, truth, points, costs and thresholds in the page are those of the results, to the last digit
    results, page = edro
    for joint, told in zip(results.joints, known_of(page)["joints"], strict=True):
        assert (told["name"], told["simulated"]) == (joint.name, True)
        known = known_joint(joint)
        use, stages = told["sets"]
        for d in known.directions:
            for name, value in known.values(d).items():
                row, e = use["values"][d][name], known.estimate(name, d)
                assert row["value"] == value
                assert e is not None
                assert row["interval"] == list(e.interval or ())
            assert told["truth"][d] == joint.truth[d]._asdict()
        for fit in told["static"]:
            own = joint.static[fit["direction"]]
            assert fit["velocity"] == own.velocity.tolist()
            assert fit["torque"] == own.torque.tolist()
            assert (fit["rms"], fit["relative_error"]) == (own.rms, own.relative_error)
            assert own.profile is not None
            assert (fit["least"], fit["threshold"]) == (own.profile.best_cost, own.profile.threshold)
            law = own.values()
            assert law is not None
            assert {n: stages["values"][fit["direction"]][n]["value"] for n in law._fields} == law._asdict()
        assert joint.moving is not None
        assert told["moving"]["velocity"] == joint.moving.velocity.tolist()
        assert told["moving"]["residuals"] == joint.moving.residuals.tolist()


@pytest.mark.slow
def test_bytes_repeat(hostile: Explored, tmp_path: Path) -> None:
    """A second call in one process gives the same bytes, and so does another process from the results file."""
    first = hostile.page.html
    assert bristle.explore(hostile.results).html == first
    path = tmp_path / "results.json"
    path.write_text(hostile.results.to_json(tmp_path), encoding="utf-8")
    code = "import bristle, sys; sys.stdout.buffer.write(bristle.explore(sys.argv[1]).html.encode())"
    seed = {**os.environ, "PYTHONHASHSEED": "7"}
    ran = subprocess.run([sys.executable, "-c", code, str(path)], env=seed, capture_output=True, check=True)  # noqa: S603  # ours
    assert ran.stdout == first.encode()


def test_hostile_names_stay_text(hostile: Explored, tmp_path: Path) -> None:
    """A name that ends a script and loads an image is found in the page's JSON alone, where no character of it can begin a tag."""
    page = hostile.page
    read = Read(page.html)
    assert not [tag for tag, _ in read.elements if tag == "img"]
    assert page.html.count("</script") == len(read.scripts)
    assert not re.search("[<>&]", read.scripts[0])
    (told,) = known_of(page)["joints"]
    assert told["name"] == HOSTILE
    assert all(HOSTILE_FILE in place for fit in told["static"] for place in fit["place"])
    assert page.write(tmp_path / "explore.html").read_bytes() == page.html.encode()
    # what the points do not show is called assumed; without a bristle the sentence stands where the loop would
    (told,) = known_of(hostile.page)["joints"]
    (use,) = told["sets"]
    assert {
        row["source"] for d in ("+", "-") for name, row in use["values"][d].items() if name.startswith("sigma")
    } == {"assumed"}
    assert "nothing is known of the bristle stiffness" in told["loop"]
    assert (told["moving"], told["presliding"], told["loops"], told["truth"]) == (None, {}, [], None)


def test_points_that_were_not_fitted_are_told_apart(tmp_path: Path) -> None:
    """A stray is named among the strays of its fit, which has no other point less; points of a held-out run stand apart."""
    lines = table(speeds()).splitlines()
    v, torque = map(float, lines[5].split(","))
    lines[5] = f"{v!r},{1.2 * torque!r}"
    (tmp_path / "wrist.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (tmp_path / "held.csv").write_text(table(speeds()[:3]), encoding="utf-8")
    text = experiment(data="wrist.csv") + "  - {files: held.csv, experiment: points, hold_out: true}\n"
    (tmp_path / "wrist.yaml").write_text(text, encoding="utf-8")
    (told,) = known_of(bristle.explore(tmp_path / "wrist.yaml"))["joints"]
    fits = {fit["direction"]: fit for fit in told["static"]}
    assert [(x["velocity"], x["place"]) for x in fits["+"]["strays"]] == [(v, "wrist.csv line 6")]
    assert fits["-"]["strays"] == []
    assert [(x["velocity"], x["place"]) for x in told["other_points"]] == [
        (x, f"held.csv line {k}") for k, x in enumerate(speeds()[:3].tolist(), 2)
    ]
    assert sorted(x for fit in fits.values() for x in fit["velocity"]) == sorted(x for x in speeds().tolist() if x != v)
    # joints of which no law is known are refused in a sentence
    (tmp_path / "wrist.csv").write_text("v,tau\n0.1,0.02\n-0.1,-0.02\n", encoding="utf-8")
    (tmp_path / "wrist.yaml").write_text(experiment(data="wrist.csv"), encoding="utf-8")
    with pytest.raises(bristle.InputError, match="nothing is known of the friction over velocity"):
        bristle.explore(tmp_path / "wrist.yaml")

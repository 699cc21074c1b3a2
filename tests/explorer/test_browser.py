import io
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import bristle
from bristle.identification.known_joint import known_joint
from bristle.model.parameters import Direction
from bristle.simulation.edro import TABLE_1

from ..conftest import experiment, present, speeds, table
from ..pages import opened
from .conftest import HOSTILE, Explored

VIEWS = ("friction", "presliding", "response", "compensation", "identifiability", "values")
PARAMETERS = ("alpha_0", "alpha_1", "alpha_2", "v_s", "sigma_0", "sigma_1")
DRAWN = {
    "friction": ("now+", "residuals+"),
    "presliding": ("loading.now", "hysteresis.now"),
    "response": ("deflection.now", "torque.now", "error.now"),
    "compensation": ("theta_1", "theta_2", "loop_error.adaptive", "loop_torque.now"),
    "identifiability": ("unlikely", "profile.now"),
}
"""Sources of each view that follow the sliders."""
ENDS = """async ([view, sources, names]) => {
  const pending = document.documentElement.dataset, moved = new Set(), bad = [], p = explorer.state.values["+"];
  const columns = (name) => Object.entries(explorer.named(name).data).map(([k, x]) => [k, [...x]]);
  const before = Object.fromEntries(sources.map((name) => [name, String(columns(name))]));
  for (const name of names) {
    const own = p[name];
    for (const end of [explorer.atFraction(name, 0), explorer.atFraction(name, 1), own]) {
      p[name] = end;
      explorer.views[view].draw();
      while (pending.pending || explorer.element("figure-map").ariaBusy === "true") await new Promise((done) => setTimeout(done, 5));
      for (const source of sources) {
        const drawn = columns(source), numbers = drawn.filter(([k]) => !["colour", "ink", "place"].includes(k));
        if (String(drawn) !== before[source]) moved.add(source);
        if (!numbers.every(([, x]) => x.every(Number.isFinite))) bad.push([view, name, end, source]);
      }
    }
  }
  return [[...moved], bad];
}"""
"""Moves the value of each slider to either end of it: which sources follow, and where one of them holds what is no number."""
WATCH = """() => {
  window.seen = { said: [] };
  const said = explorer.element("map-said");
  new MutationObserver(() => seen.said.push(said.textContent)).observe(said, { childList: true });
  costs.map = () => seen.said.push("computed by the page itself");
  const post = Worker.prototype.postMessage;
  Worker.prototype.postMessage = function (asked) { post.call(this, asked && { ...asked, n: seen.n || asked.n }); };
}"""
"""Notes what is said of the cost map; forbids the page to compute a map itself.

With `seen.n` the worker computes maps of so many cells each way, which take long.
"""
MOVES = """async (count) => {
  const slider = explorer.element("slider-alpha_2"), drawn = document.documentElement.dataset, times = [];
  for (let k = 0; k < count; k++) {
    await new Promise((done) => setTimeout(done, 60));
    const before = drawn.drawn, busy = explorer.element("figure-map").ariaBusy, t = performance.now();
    slider.value = Number(slider.value) + 5;
    slider.dispatchEvent(new Event("input"));
    while (drawn.drawn === before) await new Promise(requestAnimationFrame);
    times.push([busy, performance.now() - t]);
  }
  return times;
}"""
"""Moves a slider so many times: whether a map was being computed then, and the ms until the page is drawn."""
MAP = """["unlikely", "active"].map((name) => JSON.stringify(explorer.named(name).data))"""
"""The cells of a map with their colours, and the hatched ones."""
NO_WORKERS = {
    "there are none": "window.Worker = undefined",
    "none may be made": "window.Worker = class { constructor() { throw new Error('not here'); } }",
    "its script is refused": "window.Worker = class { constructor() { setTimeout(() => this.onerror()); } postMessage() {} }",
}
"""Scripts that run before the page's own."""
UNNAMED = """[...document.querySelectorAll("input, select, button, meter, progress")]
  .filter((x) => !(x.labels && x.labels.length) && !x.ariaLabel && !x.textContent).map((x) => x.id)"""
"""Controls without a name for a reader who does not see them."""


@pytest.fixture(scope="module")
def file(edro: Explored, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return edro.page.write(tmp_path_factory.mktemp("page") / "explore.html")


class Tab:
    """A page that is open, and what went wrong in it."""

    def __init__(self, chromium: Any, file: Path, fragment: str = "", **given: Any) -> None:
        self.page, self.wrong = opened(chromium, file, fragment, **given)
        self.page.wait_for_selector("html[data-ready]", state="attached")
        self.settled()

    def settled(self) -> None:
        self.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        self.page.wait_for_selector("#figure-map:not([aria-busy=true])", state="attached")
        self.page.wait_for_selector("html:not([data-pending])", state="attached")

    def state(self) -> Any:
        return self.page.evaluate("explorer.state")

    def show(self, view: str) -> None:
        self.page.click(f"#tab-{view}")
        self.settled()
        assert [v for v in VIEWS if self.page.is_visible(f"#view-{v}")] == [view]

    def set(self, name: str, position: int) -> None:
        script = "([id, x]) => { const s = explorer.element(id); s.value = x; s.dispatchEvent(new Event('input')); }"
        self.page.evaluate(script, [f"slider-{name}", position])
        self.settled()


@pytest.fixture
def tab(chromium: Any, file: Path) -> Iterator[Tab]:
    """The page, open; afterwards nothing has gone wrong in it, and nothing was asked of a network."""
    one = Tab(chromium, file)
    yield one
    assert not one.wrong
    one.page.close()


def rows(tab: Tab) -> dict[str, tuple[float, float]]:
    """Cost and relative error of each fit of constant velocities, by direction."""
    script = "[...document.querySelectorAll('#costs tr')].map((x) => [x.dataset.direction, [+x.dataset.cost, +x.dataset.error]])"
    return {d: (cost, error) for d, (cost, error) in tab.page.evaluate(script)}


def test_it_opens_on_the_joint_of_the_results(chromium: Any, tmp_path: Path) -> None:
    """A report's links open the page on their joint: its name and its own values in the sliders, on the first screen of a desk and of a phone."""
    for name, stronger in (("shoulder", 1.0), ("elbow", 1.5)):
        v, torque = np.loadtxt(io.StringIO(table(speeds())), delimiter=",", skiprows=1).T
        pd.DataFrame({"v": v, "tau": stronger * torque}).to_csv(tmp_path / f"{name}.csv", index=False)
        (tmp_path / f"{name}.yaml").write_text(experiment(joint=name, data=f"{name}.csv"), encoding="utf-8")
    results = bristle.identify(tmp_path / "shoulder.yaml", tmp_path / "elbow.yaml")
    page = bristle.explore(results)
    assert not [name for name in TABLE_1 if name in page.html]
    folder = results.write(tmp_path / "report", explored=page).parent
    links = re.findall(r'href="explore\.html(#[^"]*)"', (folder / "index.html").read_text(encoding="utf-8"))
    for joint, link, width, least in zip(results.joints, links, (1280, 390), (6, 4), strict=True):
        tab = Tab(chromium, folder / "explore.html", link, width=width)
        assert tab.page.inner_text("#shown-joint") == joint.name
        assert tab.page.title().startswith(joint.name)
        bottoms = [tab.page.query_selector(f"#slider-{name}").bounding_box()["y"] for name in PARAMETERS]
        assert sum(y < 900 for y in bottoms) >= least
        for name, value in known_joint(joint).values(Direction.POSITIVE).items():
            assert float(tab.page.input_value(f"#entry-{name}")) == pytest.approx(value, rel=1e-5)
        assert not tab.wrong


def test_every_slider_tab_and_button(tab: Tab) -> None:
    """Each slider moves by its key what it should, entries and reset bring values back, a refit lowers the cost, tabs follow the arrows."""
    page = tab.page
    start = tab.state()["values"]
    for name in PARAMETERS:
        page.focus(f"#slider-{name}")
        page.keyboard.press("ArrowRight")
        tab.settled()
        now = tab.state()["values"]
        assert now["+"][name] > start["+"][name]
        assert now["-"] == start["-"]
        assert float(page.input_value(f"#entry-{name}")) == pytest.approx(now["+"][name], rel=1e-5)
    moved = rows(tab)
    page.click("#refit")
    tab.settled()
    assert rows(tab)["+"][0] < moved["+"][0]
    assert rows(tab)["-"] == moved["-"]
    page.fill("#entry-v_s", "0.05")
    page.keyboard.press("Tab")
    tab.settled()
    assert tab.state()["values"]["+"]["v_s"] == 0.05
    page.click("#to-truth")
    tab.settled()
    assert tab.state()["values"]["+"]["v_s"] == 0.072
    page.click("#reset")
    tab.settled()
    assert tab.state()["values"] == start
    visible = """[...explorer.named("log").renderers, ...explorer.named("curve").renderers]
      .filter((r) => r.data_source.name === "now-").map((r) => r.visible)"""
    for shown in (False, True):
        page.click("[data-key='now-']")
        assert page.evaluate(visible) == [shown, shown]
    page.focus("#tab-friction")
    for view in (*VIEWS[1:], VIEWS[0]):
        page.keyboard.press("ArrowRight")
        tab.settled()
        assert page.get_attribute(f"#tab-{view}", "aria-selected") == "true"
        assert page.is_visible(f"#view-{view}")
        for box in page.query_selector_all(f"#view-{view} .figure"):
            assert min(box.bounding_box().values()) >= 0
            assert box.bounding_box()["height"] > 100
            assert len(box.get_attribute("aria-label")) > 10
    page.select_option("#direction", "-")
    tab.set("alpha_0", 900)
    now = tab.state()["values"]
    assert now["+"] == start["+"]
    assert now["-"]["alpha_0"] > start["-"]["alpha_0"]
    page.select_option("#joint", "3")
    tab.settled()
    assert page.inner_text("#shown-joint") == "base rotation"
    assert page.is_visible("#simulated")
    assert page.is_visible("#passivity")
    assert tab.page.evaluate(UNNAMED) == []


def test_each_view_follows_its_sliders_and_entries(tab: Tab) -> None:
    """A slider changes what its views draw; at both ends of each slider no view draws what is no number; each entry of a view redraws it."""
    for view, sources in DRAWN.items():
        tab.show(view)
        if view == "compensation":
            tab.page.fill("#loop-duration", "2")
            tab.settled()
        moved, bad = tab.page.evaluate(ENDS, [view, sources, PARAMETERS])
        assert set(moved) == set(sources)
        assert bad == []
        tab.page.click("#reset")
        tab.settled()
        for field in tab.page.query_selector_all(f"#view-{view} [data-option]:not(:disabled)"):
            count = tab.page.evaluate("document.documentElement.dataset.drawn")
            if field.get_attribute("type") == "checkbox":
                field.click()
            elif field.get_attribute("type") == "number":
                field.fill(str(0.9 * float(field.input_value())) if float(field.input_value()) > 1 else "1")
            else:
                field.select_option(index=field.evaluate("(x) => [...x.options].filter((o) => !o.disabled).length - 1"))
            tab.settled()
            assert tab.page.evaluate("document.documentElement.dataset.drawn") != count, field.get_attribute("id")


def test_numbers_are_those_of_results(tab: Tab, edro: Explored) -> None:
    """At the identified values each fit's cost and relative error are those of results.json to 4 digits, for static fits and moving runs."""
    for k, joint in enumerate(edro.results.joints):
        tab.page.select_option("#joint", str(k))
        tab.show("response")
        relative = float(tab.page.get_attribute("#response-said", "data-relative"))
        assert relative == pytest.approx(present(joint.moving).relative_error, rel=5e-5)
        tab.page.select_option("#set", "1")
        tab.show("friction")
        told = {d: (present(fit.profile).best_cost, fit.relative_error) for d, fit in joint.static.items()}
        found = rows(tab)
        assert found == {d: pytest.approx(told[d], rel=5e-5) for d in found}
    # each law of view 4 begins with its own rates; a loop that diverges is said
    tab.page.select_option("#joint", "0")
    tab.show("compensation")
    assert tab.page.locator("#loop-rows tr").count() == 4
    rates = tab.page.evaluate("explorer.joint().loop[0].options.gamma")
    assert rates["partial-theta"] != rates["partial"]
    for law in ("partial-theta", "partial"):
        tab.page.select_option("#law", law)
        assert [float(tab.page.input_value(f"#gamma-{k}")) for k in (0, 1)] == rates[law]
    tab.page.fill("#gain-p", "1e9")
    tab.settled()
    assert "diverges" in tab.page.inner_text("#loop-rows")


def test_cost_maps_are_made_beside_the_page(tab: Tab) -> None:
    """A worker computes each map; its progress is shown and said; meanwhile the page answers a slider within 200 ms."""
    page = tab.page
    tab.show("identifiability")
    (worker,) = page.workers
    page.evaluate(WATCH)
    page.select_option("#map-data", "run")
    tab.settled()
    *announced, said = page.evaluate("seen.said")
    assert announced
    assert all(re.fullmatch(r"Computing the cost map: (0|25|50|75) %\.", words) for words in announced)
    assert "of 289 cells" in said
    assert not page.is_visible("#map-progress")
    page.evaluate("[seen.n, seen.said] = [200, []]")
    page.select_option("#map-x", "alpha_0")
    moves = page.evaluate(MOVES, 6)
    assert [busy for busy, _ in moves] == ["true"] * 6
    assert min(ms for _, ms in moves) < 200
    # another axis, joint, direction or view cancels the map
    for field, value in (("map-y", "sigma_0"), ("direction", "-"), ("joint", "1")):
        page.select_option(f"#{field}", value)
        page.wait_for_selector("#figure-map[aria-busy=true]", state="attached")
        page.wait_for_selector("#map-progress", state="visible")
    page.click("#tab-values")
    assert page.get_attribute("#figure-map", "aria-busy") == "false"
    assert all(words.startswith("Computing") for words in page.evaluate("seen.said"))
    page.evaluate("seen.n = 0")
    tab.show("identifiability")
    page.select_option("#map-x", "sigma_0")
    tab.settled()
    assert page.inner_text("#map-said") == "Choose two different parameters."
    assert page.workers == [worker]


def maps(tab: Tab) -> list[list[str]]:
    """The cost maps of the fourth joint, of its points and of its run."""
    tab.page.select_option("#joint", "3")
    tab.show("identifiability")
    found = []
    for data in ("points", "run"):
        tab.page.select_option("#map-data", data)
        tab.settled()
        found.append(tab.page.evaluate(MAP))
    return found


def test_a_page_without_a_worker_draws_the_same_map(tab: Tab, chromium: Any, file: Path) -> None:
    """Where no worker can be made, for whatever reason, the page computes the map in slices, to the same numbers."""
    expected, wrong = maps(tab), list[str]()
    assert min(len(cells) for cells, _ in expected) > 1e4
    for why, before in NO_WORKERS.items():
        alone = Tab(chromium, file, before=before)
        if maps(alone) != expected or alone.page.workers or alone.wrong:
            wrong.append(f"{why}: {alone.page.workers}, {alone.wrong}")
    assert not wrong, "\n".join(wrong)
    # values, joint, direction and view come back from a copied link; numbers that are none or too large are left or clamped, words are left
    tab.page.select_option("#joint", "1")
    tab.page.select_option("#direction", "-")
    tab.set("sigma_0", 700)
    tab.show("values")
    tab.page.click("#copy-json")
    tab.page.click("#copy-yaml")
    tab.page.click("#copy-link")
    tab.page.wait_for_function("explorer.element('status').textContent.length > 0")
    link = tab.page.input_value("#as-link")
    assert json.loads(tab.page.inner_text("#as-json"))["values"] == tab.state()["values"]
    again = Tab(chromium, file, "#" + link.partition("#")[2])
    assert again.state() == tab.state()
    assert not again.wrong
    bad = "#joint=1e99&set=-3&direction=<b>&view=__proto__&values%2B=NaN 1e400 -5 <img> 1e300&motion=<i>&duration=1e9&gain-p=x"
    wild = Tab(chromium, file, bad)
    state, bounds = wild.state(), wild.page.evaluate("explorer.joint().ranges")
    assert (state["joint"], state["set"], state["direction"], state["view"]) == (3, 0, "+", "friction")
    for name, x in state["values"]["+"].items():
        assert 0 <= x <= 1000 * bounds[name]["high"]
    assert float(wild.page.input_value("#duration")) == 100
    assert not wild.page.query_selector("b, img")
    assert not wild.wrong


def test_hostile_names_run_nothing(chromium: Any, hostile: Explored, tmp_path: Path) -> None:
    """Names that are HTML stay text through every view and under the pointer, on a phone's width too, which nothing overflows."""
    tab = Tab(chromium, hostile.page.write(tmp_path / "explore.html"), width=390)
    title = tab.page.title()
    assert tab.page.inner_text("#shown-joint") == HOSTILE
    for view in VIEWS:
        tab.show(view)
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= 390
    tab.show("friction")
    box = tab.page.query_selector("#figure-log").bounding_box()
    tab.page.mouse.wheel(0, box["y"] - 100)
    tab.settled()
    point = tab.page.evaluate(
        """() => {
          const view = Bokeh.index.get_by_id(explorer.named("log").id), frame = view.frame, d = explorer.named("points+").data;
          const box = view.el.getBoundingClientRect();
          return [box.x + frame.x_scale.compute(d.speed[10]), box.y + frame.y_scale.compute(d.size[10])];
        }"""
    )
    tab.page.mouse.move(*point)
    tab.page.wait_for_timeout(200)
    script = """() => {
      const found = [], walk = (root) => { for (const x of root.querySelectorAll("*")) { found.push(x); if (x.shadowRoot) walk(x.shadowRoot); } };
      walk(document);
      return [found.filter((x) => x.tagName === "IMG").length, found.some((x) => x.textContent.includes("<img src=x onerror=document"))];
    }"""
    assert tab.page.evaluate(script) == [0, True]
    assert tab.page.title() == title
    assert not tab.wrong

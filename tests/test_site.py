"""The site of the documentation: it builds without a warning and without a network, and has an entry for all that it must."""

import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest
import typer.main

import bristle
from bristle import cli
from bristle.page.said import entries

pytest.importorskip("sphinx", reason="needs the extra docs")
pytest.importorskip("myst_parser", reason="needs the extra docs")
pytest.importorskip("furo", reason="needs the extra docs")

ROOT = Path(__file__).parents[1]
LOADS = {"img": "src", "script": "src", "link": "href", "iframe": "src", "source": "src"}
"""Elements that make a browser fetch something, with the attribute that names it."""


class Page(HTMLParser):
    """What a page links to, what it loads, and the anchors that it has."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.anchors = {""}
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep its links and its anchor."""
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag in LOADS and LOADS[tag] in given:
            self.loads.append(given[LOADS[tag]])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built by the one command, where every warning is an error."""
    folder = tmp_path_factory.mktemp("site")
    folders = ("-d", str(folder / "read"), "docs", str(folder / "html"))
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", *folders]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)  # noqa: S603  # our own command
    assert (built.returncode, built.stderr) == (0, "")
    return folder / "html"


def inventory(site: Path) -> Iterator[str]:
    """The names of Python that other documentation can link to."""
    from sphinx.util.inventory import InventoryFile

    found: Any = InventoryFile.loads((site / "objects.inv").read_bytes(), uri="")
    for domain, names in found.data.items():
        yield from names if domain.startswith("py:") else ()


def test_the_site_is_whole(site: Path) -> None:
    """Every public name, command and code of a warning has its entry, links lead to anchors that are there, and nothing is loaded from elsewhere."""
    assert {f"bristle.{name}" for name in bristle.__all__} <= set(inventory(site))
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in site.glob("*.html")}
    assert {
        code for code in entries() if f"<strong>{code}</strong>" not in (site / "warnings.html").read_text("utf-8")
    } == set()
    root: Any = typer.main.get_command(cli.app)
    assert {f"bristle-{name}" for name in root.commands} <= pages[site / "commands.html"].anchors
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            target = path.parent / unquote(parts.path) if parts.path else path
            if not parts.scheme:
                assert target.exists(), (path.name, link)
                assert (
                    target.suffix != ".html" or target not in pages or unquote(parts.fragment) in pages[target].anchors
                ), (path.name, link)
        assert not [source for source in page.loads if urlsplit(source).netloc]
    styles = "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.css"))
    assert not re.findall(r"url\(\s*[\"']?(?:https?:)?//|@import", styles)

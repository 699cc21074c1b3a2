"""What tests of a fleet's page read of it: its elements, scripts and tables, and what its script is told."""

import base64
import json
from html.parser import HTMLParser
from typing import Any

import numpy as np


class Parsed(HTMLParser):
    """The elements of a page with their attributes, the text of each script, and the rows of each table by its id."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.scripts: list[str] = []
        self.tables: dict[str, list[list[str]]] = {}
        self.rows: list[list[str]] = []
        self.in_cell = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep it."""
        given = {name: value or "" for name, value in attrs}
        self.elements.append((tag, given))
        if tag == "script":
            self.scripts.append("")
        elif tag == "table":
            self.rows = self.tables.setdefault(given["id"], [])
        elif tag == "tr":
            self.rows.append([])
        elif tag in {"td", "th"}:
            self.rows[-1].append("")
            self.in_cell = True

    def handle_endtag(self, tag: str) -> None:
        """A cell ends."""
        self.in_cell = self.in_cell and tag not in {"td", "th"}

    def handle_data(self, data: str) -> None:
        """Keep what a script or a cell holds."""
        if self.cdata_elem == "script":
            self.scripts[-1] += data
        elif self.in_cell:
            self.rows[-1][-1] += data


def told(page: bytes) -> Any:
    """What the page's script is told."""
    return json.loads(Parsed(page.decode()).scripts[0])


def unpacked(packed: dict[str, Any]) -> list[Any]:
    """A packed column."""
    numbers = np.frombuffer(base64.b64decode(packed["data"]), dtype=f"<{packed['as']}")
    words = packed.get("words")
    return numbers.tolist() if words is None else [words[k] for k in numbers]

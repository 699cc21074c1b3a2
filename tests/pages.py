"""What tests read of written pages: their text without the one script that is bristle's own, which every page has once."""

import html
import re
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path

SCRIPT = (
    f"<script>\n{(files('bristle.page') / 'templates' / 'tables.js').read_text(encoding='utf-8').rstrip()}\n</script>"
)


def page_text(path: Path) -> str:
    """A page without our script; whatever other script there is stays."""
    text = path.read_text(encoding="utf-8")
    assert text.count(SCRIPT) == 1
    return text.replace(SCRIPT, "")


class Elements(HTMLParser):
    """The elements of a page, their attributes, and its text."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.attributes: set[str] = set()
        self.ids: list[str] = []
        self.text = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes |= {name for name, _ in attrs}
        self.ids += [value or "" for name, value in attrs if name == "id"]

    def handle_data(self, data: str) -> None:
        self.text += data

    @property
    def runs(self) -> set[str]:
        """What in it could run or load something: scripts, frames, links to styles, and attributes that take an event."""
        return self.tags & {"script", "iframe", "link"} | {name for name in self.attributes if name.startswith("on")}


def report_text(folder: Path) -> str:
    """All pages of a report that are read, one after another, index.html first; the explorer, which has scripts of its own, is not among them."""
    read = [path for path in folder.glob("*.html") if path.stem != "explore"]
    return "".join(page_text(path) for path in sorted(read, key=lambda p: (p.stem != "index", p.stem)))


def findings(page: str) -> list[str]:
    """What each figure's caption begins with: its first sentence, as it is read, after its number and the note on simulated data."""
    captions = re.findall(r"<figcaption[^>]*>(.*?)</figcaption>", page, flags=re.DOTALL)
    read = [" ".join(html.unescape(re.sub(r"<[^>]*>", "", caption)).split()) for caption in captions]
    return [
        re.sub(r"^Figure \d+(?: \(the paper's [^)]*\))?\. (?:SIMULATED(?: data)?\. )?(.*?\.)(?: .*)?$", r"\1", caption)
        for caption in read
    ]


def assert_tables_are_named(folder: Path) -> None:
    """Each table of the page in a folder has a caption with its name and a link to a file that is there."""
    page = page_text(folder / "index.html")
    captions = re.findall(r'<caption>(.+?) <a class="get" href="(tables/\w+\.csv)" download>', page)
    assert len(captions) == page.count("<table") > 0
    assert all((folder / link).is_file() for _, link in captions)

"""What tests read of written pages: their text without the one script that is bristle's own, which every page has once."""

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


def report_text(folder: Path) -> str:
    """All pages of a report that are read, one after another, index.html first; the explorer, which has scripts of its own, is not among them."""
    read = [path for path in folder.glob("*.html") if path.stem != "explore"]
    return "".join(page_text(path) for path in sorted(read, key=lambda p: (p.stem != "index", p.stem)))

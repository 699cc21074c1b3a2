"""The words of docs/style.md: what its table replaces stands in no template, sentence, document, and not in the report that ships."""

import html
import re
from collections.abc import Mapping
from pathlib import Path

import pytest

from bristle.diagnostics import ADVICE, OWN_ADVICE, REASONS, Kind

ROOT = Path(__file__).parents[1]
STYLE = ROOT / "docs" / "style.md"
REPORT = ROOT / "reports" / "edro"


def replaced() -> list[str]:
    """What stands in code in the left column of the table."""
    rows = re.findall(r"^\|(.+?)\|.+\|$", STYLE.read_text(encoding="utf-8"), re.MULTILINE)
    return [phrase for left in rows for phrase in re.findall(r"`(.+?)`", left)]


PHRASES = re.compile(
    "|".join(rf"(?<![\w-]){re.escape(x)}" + r"(?![\w-])" * x[-1].isalnum() for x in replaced()), re.IGNORECASE
)


def broken(text: str) -> list[str]:
    """The phrases that a text holds, wherever its lines end."""
    return PHRASES.findall(re.sub(r"\s+", " ", text))


def visible(page: str) -> str:
    """The text of a page or of a template: no tags, styles and scripts, and nothing that the template computes."""
    text = re.sub(r"<(style|script)\b.*?</\1>|\{\{.*?\}\}|\{%.*?%\}|\{#.*?#\}", " ", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"<[^>]*>", " ", text))


TEXTS: Mapping[str, str] = {
    **{
        str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
        for path in (
            *(path for path in (ROOT / "docs").glob("*.md") if path != STYLE),
            *ROOT.glob("*.md"),
            *(ROOT / "datasets").rglob("README.md"),
        )
    },
    **{f"Kind.{kind.name}": kind.template for kind in Kind},
    "reasons and advice": "\n".join([*REASONS, *ADVICE.values(), *OWN_ADVICE]),
    **{
        str(path.relative_to(ROOT)): visible(path.read_text(encoding="utf-8"))
        for path in (*(ROOT / "src").rglob("templates/*.html"), *REPORT.rglob("*.html"))
    },
}


def test_the_style_guide_names_what_it_replaces() -> None:
    """The table has phrases, and the search finds each of them in a sentence, broken between lines too."""
    assert len(replaced()) > 30
    for phrase in replaced():
        assert broken(f"Here {phrase}".replace(" ", "\n"))


@pytest.mark.parametrize("where", [name for name in TEXTS if not name.startswith("Kind.")])
def test_words(where: str) -> None:
    """None of the phrases occurs."""
    assert broken(TEXTS[where]) == []


def test_words_of_every_sentence() -> None:
    """None of the phrases occurs in a sentence about a fit."""
    assert {name: found for name, text in TEXTS.items() if name.startswith("Kind.") and (found := broken(text))} == {}

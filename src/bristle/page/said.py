"""Findings in a report: their entries in docs/warnings.md, and findings, links and verdicts as parts of a line."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import NamedTuple

from markupsafe import Markup, escape

from bristle.errors import InputError, short
from bristle.findings import Finding, Severity
from bristle.page.wording import direction, in_print


class Entry(NamedTuple):
    """The explanation of a code."""

    code: str
    severity: str  # several where it depends on what was found
    meaning: str  # empty where the finding itself says all
    reason: str  # why it has its severity
    advice: str  # what to do about those of this reason


@cache
def entries() -> Mapping[str, Entry]:
    """All entries by code, as in docs/warnings.md: under `### Critical: reason` advice, then `**code**: meaning` each."""
    here = Path(__file__).resolve()
    places = here.parents[1] / "warnings.md", here.parents[3] / "docs" / "warnings.md"  # installed; in a checkout
    text = next(place for place in places if place.is_file()).read_text(encoding="utf-8")
    found = {}
    for part in text.split("\n### ")[1:]:
        title, advice, *paragraphs = (" ".join(x.split()) for x in part.strip().split("\n\n"))
        severity, _, reason = title.partition(": ")
        for paragraph in paragraphs:
            codes, _, meaning = paragraph.partition("**: ")
            for code in re.findall(r"\*\*([a-z0-9-]+)", codes):
                found[code] = Entry(code, severity.lower(), meaning, reason, advice)
    return found


def by_code(code: str) -> Entry:
    """The entry of a code, in any case, with hyphens or underscores. Raises InputError where there is none."""
    asked, known = code.strip().strip("[]").lower().replace("_", "-"), entries()
    if asked not in known:
        near = get_close_matches(asked, known, n=3)
        parts = [other for other in known if len(asked) > 2 and asked in other][:3]
        hint = ", ".join(dict.fromkeys([*near, *parts])) or "a code in brackets, as lacks-a-term"
        raise InputError(f"{short(code)}: no warning has this code; expected {'one like ' * bool(near or parts)}{hint}")
    return known[asked]


def explanation(x: Entry) -> Iterator[str]:
    """The entry as text, line by line."""
    yield f"{x.code} ({x.severity})"
    if x.meaning:
        yield f"  what it says: {x.meaning}"
    yield f"  why {x.severity}: {x.reason}"
    yield f"  what to do: {x.advice}"


_ANCHOR = "warning-"
_LINKED = re.compile(rf'href="#{_ANCHOR}([a-z0-9-]+)"')


def warned(said: object) -> Markup:
    """A finding on a page: its message, then its code as a link to its entry; other text as it is."""
    if not isinstance(said, Finding):
        return escape(said)
    link = Markup('{} <a class="code" href="#{}{}">{}</a>')
    return link.format(in_print(said), _ANCHOR, said.code, said.code)


def flagged(said: object) -> Markup:
    """`warned`, without a link where it is a note."""
    return escape(in_print(said)) if isinstance(said, Finding) and said.severity is Severity.NOTE else warned(said)


def entries_linked(page: str) -> list[dict[str, object]]:
    """The entries that a page links to, for its template, the critical ones first."""
    codes, found = set(_LINKED.findall(page)), []
    for x in (x for x in entries().values() if x.code in codes):
        texts = {"meaning": in_print(x.meaning), "advice": x.advice}
        marked = {k: Markup(re.sub(r"`(.+?)`", r"<code>\1</code>", str(escape(t)))) for k, t in texts.items()}  # noqa: S704  # escaped
        found.append({**x._asdict(), "id": f"{_ANCHOR}{x.code}", **marked})
    return found


@dataclass(frozen=True, slots=True)
class Link:
    """A link to a page of the report, or to a place in it."""

    text: str
    href: str  # relative; never a user's text


@dataclass(frozen=True, slots=True)
class Mark:
    """A verdict in a word, as `use` or `do not use`."""

    word: str
    good: bool


Said = str | Finding | Link | Mark  # a part of a line


def said(parts: Said | tuple[Said, ...]) -> Markup:
    """A line as HTML: its parts, one after another."""
    if isinstance(parts, Link):
        return Markup('<a href="{}">{}</a>').format(parts.href, parts.text)
    if isinstance(parts, Mark):
        return Markup('<span class="mark {}">{}</span>.').format("good" if parts.good else "bad", parts.word)
    if isinstance(parts, tuple):
        return Markup(" ").join([said(part) for part in parts])
    return flagged(parts)


def told(parts: Said | tuple[Said, ...]) -> str:
    """A line as text."""
    match parts:
        case tuple():
            return " ".join(map(told, parts))
        case Link():
            return parts.text
        case Mark():
            return f"{parts.word}."
        case Finding():
            return parts.flagged
        case _:
            return parts


def with_places(findings: Iterable[Finding], word: Callable[[str], str] = direction) -> list[tuple[str, Finding]]:
    """Each finding once, after all its subjects, each part by `word`; empty where that is the whole."""
    found: dict[str, tuple[Finding, list[str]]] = {}
    for x in findings:
        found.setdefault(str(x), (x, []))[1].append(" ".join(map(word, x.subject)))
    return [(", ".join(filter(None, dict.fromkeys(places))), x) for x, places in found.values()]

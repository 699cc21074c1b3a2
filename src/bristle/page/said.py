"""What a report says in a line: text, a finding, a link, a verdict; and findings as a list, with what each is about."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from markupsafe import Markup

from bristle.findings import Finding
from bristle.page.entries import flagged
from bristle.page.wording import direction


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


def with_places(findings: Iterable[Finding], word: Callable[[str], str] = direction) -> list[tuple[str, Finding]]:
    """Each finding once, after all that it is about, each part of it by `word`: nothing where that is the whole."""
    found: dict[str, tuple[Finding, list[str]]] = {}
    for x in findings:
        found.setdefault(str(x), (x, []))[1].append(" ".join(map(word, x.subject)))
    return [(", ".join(filter(None, dict.fromkeys(places))), x) for x, places in found.values()]

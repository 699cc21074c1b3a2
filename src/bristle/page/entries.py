"""What a kind of warning means, why it has its severity and what to do: one entry, for the terminal, a page and docs/warnings.md."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from string import Formatter

from markupsafe import Markup, escape

from bristle.diagnostics import ADVICE, OWN_ADVICE, REASONS, Diagnostic, Kind, Severity
from bristle.errors import InputError, short
from bristle.page.wording import in_print

Mark = Callable[[str], str]
"""How the name of a number stands in a sentence that is about no joint yet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """Of one kind."""

    code: str
    severity: Severity
    parts: tuple[tuple[str, str], ...]
    """Of its sentence: text, and the name of the number that follows it, or nothing at the end."""
    reason: str
    """Why it has its severity."""
    advice: str
    """What to do about this kind, or in general about those of its reason."""
    own: bool
    """Whether the advice is about this kind."""

    def meaning(self, mark: Mark, plain: Mark = str) -> str:
        """Its sentence, with the name of each number as `mark` has it, and the text between them as `plain` has it."""
        return "".join(plain(text) + (mark(name) if name else "") for text, name in self.parts)


_REASON_OF = {Kind[name]: reason for reason, names in REASONS.items() for name in names.split()}
_ADVICE_OF = {Kind[name]: advice for advice, names in OWN_ADVICE.items() for name in names.split()}
_ENDINGS = {"e": "(s)", "d": " in direction + or -", "b": " (+ or -)", "w": "would help", "u": ""}
"""What stands for a number that only turns a word, or gives a unit."""


def entry(kind: Kind) -> Entry:
    """What there is to know of a kind."""
    reason = _REASON_OF[kind]
    return Entry(
        code=kind.code, severity=kind.severity, parts=tuple(_parts(kind.template)), reason=reason,
        advice=_ADVICE_OF.get(kind, ADVICE[reason]), own=kind in _ADVICE_OF,
    )  # fmt: skip  # a list of values


def _parts(template: str) -> Iterator[tuple[str, str]]:
    for text, name, _, conversion in Formatter().parse(template):
        ending = _ENDINGS.get(conversion or "")
        space = " " * bool(name and ending is None and re.search(r"[\w.)]$", text))
        yield text + (ending or "") + space, (name or "").replace("_", " ") if ending is None else ""


def by_code(code: str) -> Kind:
    """The kind of a code, in any case, with hyphens or as results.json has it. InputError where there is none, with those that are near."""
    kinds = {kind.code: kind for kind in Kind}
    asked = code.strip().strip("[]").lower().replace("_", "-")
    if asked not in kinds:
        near = get_close_matches(asked, kinds, n=3)
        parts = [known for known in kinds if len(asked) > 2 and asked in known][:3]
        hint = ", ".join(dict.fromkeys([*near, *parts])) or "a code in brackets, as lacks-a-term"
        raise InputError(f"{short(code)}: no warning has this code; expected {'one like ' * bool(near or parts)}{hint}")
    return kinds[asked]


def explanation(kind: Kind) -> Iterator[str]:
    """The entry as text, line by line."""
    x = entry(kind)
    yield f"{x.code} ({x.severity})"
    yield f"  what it says: {x.meaning('<{}>'.format)}"
    yield f"  why {x.severity}: {x.reason}"
    yield f"  what to do{' in general' * (not x.own)}: {x.advice}"


_ANCHOR = "warning-"
_LINKED = re.compile(rf'href="#{_ANCHOR}([a-z0-9-]+)"')


def warned(said: object) -> Markup:
    """A diagnostic as a page has it: its sentence, then its code as a link to its entry; other text as it is."""
    if not isinstance(said, Diagnostic):
        return escape(said)
    link = Markup('{} <a class="code" href="#{}{}">{}</a>')
    return link.format(in_print(said), _ANCHOR, said.kind.code, said.kind.code)


def flagged(said: object) -> Markup:
    """The same, without a link where it is a note."""
    return escape(in_print(said)) if isinstance(said, Diagnostic) and said.severity is Severity.NOTE else warned(said)


def entries_linked(page: str) -> list[dict[str, object]]:
    """What a page's template names of each entry that the page links to, by severity."""
    codes = set(_LINKED.findall(page))
    found = [entry(kind) for severity in Severity for kind in Kind if kind.severity is severity and kind.code in codes]
    return [
        {
            "id": f"{_ANCHOR}{x.code}", "code": x.code, "severity": str(x.severity), "reason": x.reason, "own": x.own,
            "meaning": Markup(x.meaning(lambda name: f"<i>{escape(name)}</i>", lambda text: str(escape(in_print(text))))),  # noqa: S704  # escaped
            "advice": Markup(re.sub(r"`(.+?)`", r"<code>\1</code>", str(escape(x.advice)))),  # noqa: S704  # escaped, and our own
        }
        for x in found
    ]  # fmt: skip  # a table

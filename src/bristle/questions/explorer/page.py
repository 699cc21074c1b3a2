"""The explorer's page: one HTML file with Bokeh, the physics and everything known of the joints in it; it loads nothing.

The controls are the browser's own, which have labels and keys; Bokeh draws the figures. No text of a user meets Bokeh or
HTML: it lies in one block of JSON and is set as text. A policy in the page forbids every connection, and every script but
the page's own, by their digests. Cost maps are computed by a worker, which is made of the text of some of these scripts.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from markupsafe import Markup

from bristle import __version__
from bristle.identification.results import Joint
from bristle.model.laws.parts import Law
from bristle.model.parameters import fields_of, least_of
from bristle.page.output_folder import write_bytes
from bristle.page.page import digest, encoded, html
from bristle.page.wording import PARAMETERS, symbol
from bristle.questions.explorer.data import explored
from bristle.questions.explorer.engine import script
from bristle.questions.explorer.figures import PANELS, PAPER, figures, key
from bristle.simulation.joint_loop import JointLoop

_HERE = Path(__file__).parent
_SCRIPTS = ("costs", "app", "friction", "presliding", "response", "compensation", "identifiability", "values", "start")
"""The page's own, in this order."""
_VIEWS = {
    "friction": "Friction curve",
    "presliding": "Presliding",
    "response": "Time response",
    "compensation": "Compensation",
    "identifiability": "Identifiability",
    "values": "Values",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Explorer:
    """The page of some joints."""

    joints: tuple[str, ...]
    """Their names."""
    html: str
    """The whole page."""

    def write(self, path: Path | str) -> Path:
        """Write the page as one file; an older file is never replaced.

        Raises InputError where it cannot be written, or another file is there.
        """
        write_bytes(Path(path), encoded(self.html))
        return Path(path)

    def __repr__(self) -> str:
        """In a line: whose it is, not the page."""
        return f"Explorer({', '.join(map(repr, self.joints))}: {len(self.html)} characters)"


def explorer(joints: Sequence[Joint], loops: Mapping[str, JointLoop | str]) -> Explorer:
    """The page of some joints; arguments and what is raised as of `data.explored`. Equal arguments give equal bytes."""
    known = explored(joints, loops)
    document, roots = _document()
    laws = tuple(dict.fromkeys((*(x.law for x in joints), *(p.law for x in joints for p in x.truth.values()))))
    words = _words(laws)
    symbols = {name: symbol(name) for law in laws for name in fields_of(law)}
    settings = {"parameters": [*words], "symbols": symbols, "paper": PAPER}
    data = {"known": known, "settings": settings, "document": document, "roots": roots}
    scripts = {
        "bokeh": _bokeh(),
        "bristle": script([loop for loop in loops.values() if isinstance(loop, JointLoop)], laws),
        **{name: (_HERE / f"{name}.js").read_text(encoding="utf-8") for name in _SCRIPTS},
    }
    scripts = {name: f"\n{text.strip()}\n" for name, text in scripts.items()}
    page = html(
        "bristle.questions.explorer",
        "explore.html",
        {
            "data": Markup(_json(data)),  # noqa: S704  # in which no character can end the block
            "scripts": {name: Markup(text) for name, text in scripts.items()},  # noqa: S704  # our own, and Bokeh's
            "policy": _policy(scripts.values()),
            "views": _VIEWS,
            "panels": {view: [panel.name for panel in panels] for view, panels in PANELS.items()},
            "parameters": words,
            "signed": [name for name in words if least_of(name) < 0],
            "key": key(),
            "version": __version__,
        },
    )
    return Explorer(joints=tuple(joint["name"] for joint in known["joints"]), html=page)


def _json(data: Any) -> str:
    """JSON that may stand in a script element: no tag can begin in it, and none of its characters ends a line of JavaScript."""
    text = json.dumps(_finite(data), ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _finite(part: Any) -> Any:
    """A part of the data in which null stands for what is no finite number."""
    if isinstance(part, dict):
        return {key: _finite(x) for key, x in part.items()}
    if isinstance(part, list | tuple):
        return [_finite(x) for x in part]
    return None if isinstance(part, float) and not isfinite(part) else part


def _policy(scripts: Iterable[str]) -> str:
    """The content security policy: nothing is fetched, and no script runs but these, and a worker that one of them makes."""
    allowed = " ".join(map(digest, scripts))
    return (
        f"default-src 'none'; script-src {allowed}; worker-src blob:; style-src 'unsafe-inline'; img-src data: blob:; font-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _bokeh() -> str:
    """Bokeh's core as text; widgets, tables and mathematics are not needed."""
    from bokeh.resources import Resources

    return "\n".join(Resources(mode="inline", components=["bokeh"], minified=True).js_raw)


def _words(laws: Iterable[Law]) -> dict[str, str]:
    """What each parameter that has a slider is, by name: those of every law, then what some have beside them."""
    words = dict(PARAMETERS)
    for law in laws:
        words |= {own.name: f"{law.peak.title} peak" for own in law.peak.own}
        words |= {term.coefficient.name: f"of {term.title}" for term in law.terms}
    return words


def _document() -> tuple[dict[str, Any], dict[str, str]]:
    """The Bokeh document as JSON, its models numbered from 1, and the id of each figure by its name."""
    from bokeh.document import Document

    document = Document()
    names = [panel.name for panels in PANELS.values() for panel in panels]
    with document.models.freeze():  # else every model is looked through anew at each
        for plots in figures().values():
            for plot in plots:
                document.add_root(plot)
    numbers: dict[str, str] = {}
    written = _numbered(document.to_json(deferred=False), numbers)
    ids = [root["id"] for root in written["roots"]]
    return written, dict(zip(names, ids, strict=True))


def _numbered(part: Any, numbers: dict[str, str]) -> Any:
    """A part of a document in which each model's id is its number in the order of writing: Bokeh counts on in a process."""
    if isinstance(part, list):
        return [_numbered(x, numbers) for x in part]
    if not isinstance(part, dict):
        return part
    own = part.get("id")
    if isinstance(own, str):
        numbers.setdefault(own, f"p{len(numbers) + 1}")
    return {key: numbers[x] if key == "id" and isinstance(x, str) else _numbered(x, numbers) for key, x in part.items()}

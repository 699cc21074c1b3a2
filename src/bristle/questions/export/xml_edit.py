"""An XML file edited at its bytes: what an edit does not concern stays as it was, down to blanks, quotes, comments and line ends.

Expat parses it and tells where elements begin and end; only the inside of one start tag, which Expat found sound, is searched here.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from xml.parsers import expat
from xml.sax.saxutils import escape

from bristle.errors import InputError, one_line, short, short_list

MAX_BYTES = 2**23
"""Largest file, bytes."""
MAX_ELEMENTS = 200_000
"""Most elements of a file, comments included."""
MAX_DEPTH = 200
"""Deepest nesting."""
_ATTRIBUTE = re.compile(rb"""\s+([^\s=/>]+)\s*=\s*("[^"]*"|'[^']*')""")
_TAG_END = re.compile(rb"\s*(/?)>")
_NAME = re.compile(rb"<[^\s/>]+")
_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML 1.0 cannot hold, not even as a reference."""
_ATTRIBUTE_NAME = re.compile(r"[A-Za-z_][\w.:-]*", re.ASCII)


@dataclass(slots=True, kw_only=True, eq=False)
class XmlElement:
    """An element as it stands in a file; two are the same only where they are one place of one file."""

    tag: str
    """As it is written, with its prefix."""
    attributes: Mapping[str, str]
    """Names as they are written; references resolved."""
    children: list["XmlElement"] = field(default_factory=list)
    comments: list["XmlElement"] = field(default_factory=list)
    """Those right within it, as elements without a tag, whose attribute `text` is what they say."""
    line: int
    """On which it begins, from 1."""
    start: int
    """Byte of its `<`."""
    opened: int = 0
    """Byte after its start tag."""
    closing: int = 0
    """Byte of its end tag; `opened` where it closes itself."""
    end: int = 0
    """Byte after it."""

    def find_all(self, tag: str | None = None) -> Iterator["XmlElement"]:
        """The elements of a tag, or all, depth first, in the order of the file: itself and those within."""
        if tag in (None, self.tag):
            yield self
        for child in self.children:
            yield from child.find_all(tag)


@dataclass(slots=True, kw_only=True)
class XmlDocument:
    """A file with its elements, and the edits that were asked for."""

    content: bytes
    """As it was read."""
    what: str
    """How the file is called in sentences."""
    root: XmlElement
    _attributes: dict[XmlElement, dict[str, str]] = field(default_factory=dict)
    _inserted: dict[XmlElement, list[str]] = field(default_factory=dict)
    _replaced: dict[XmlElement, str] = field(default_factory=dict)

    @classmethod
    def read(cls, content: bytes, what: str) -> "XmlDocument":
        """A file of UTF-8, with or without a byte order mark.

        Raises InputError, one sentence with file and line, where it is not well-formed, declares a document type or an entity, is encoded otherwise,
        has more than 8 MB or 200000 elements, or is nested deeper than 200.
        """
        if len(content) > MAX_BYTES:
            raise InputError(f"{what}: has more than {MAX_BYTES} bytes; expected a model without meshes")
        try:
            text = content.decode("utf-8")
        except UnicodeDecodeError as error:
            line = content.count(b"\n", 0, error.start) + 1
            raise InputError(f"{what}, line {line}: is not encoded as UTF-8; save it so") from error
        if "\0" in text:
            line = text[: text.index("\0")].count("\n") + 1
            raise InputError(f"{what}, line {line}: holds NUL; expected XML in UTF-8")
        return cls(content=content, what=what, root=_ElementReader(content, what).root())

    def set_attributes(self, element: XmlElement, values: Mapping[str, str]) -> None:
        """Add attributes, or replace their values; others stay. Raises ValueError where a name is no ASCII name of an attribute."""
        if odd := [name for name in values if not _ATTRIBUTE_NAME.fullmatch(name)]:
            raise ValueError(f"{odd[0]!r} is no name of an attribute")
        self._attributes.setdefault(element, {}).update(values)

    def insert_last(self, parent: XmlElement, text: str) -> None:
        """Insert elements or comments as the last children, indented as the file is; lines of the text end with a line feed.

        Raises InputError where the text is not well-formed by itself.
        """
        _check_fragment(text)
        self._inserted.setdefault(parent, []).append(text)

    def annotate(self, parent: XmlElement, text: str) -> None:
        """Insert a comment as the last child, in the place of an older one that begins with the same two words."""
        words = text.split(maxsplit=2)[:2]
        for old in parent.comments:
            if old.attributes["text"].split(maxsplit=2)[:2] == words:
                return self.replace(old, comment(text))
        return self.insert_last(parent, comment(text))

    def replace(self, element: XmlElement, text: str) -> None:
        """Put a text, elements or comments, in the place of an element or a comment. Raises InputError where it is not well-formed by itself."""
        _check_fragment(text)
        self._replaced[element] = text

    def written(self) -> bytes:
        """The file with the edits.

        Raises ValueError where an edit lies within an element that is replaced, and InputError where the file is not what `read` takes, as too long.
        """
        out, at = [], 0
        splices = []  # of each edit from where, to where, and what stands there afterwards
        for element, text in self._replaced.items():
            splices.append((element.start, element.end, self._laid_out(text, self._indent(element) or b"")))
        for element, values in self._attributes.items():
            spans, last = _attribute_spans(self.content, element.start)
            written = {name: attribute(value).encode("utf-8") for name, value in values.items()}
            splices += [(*spans[name], new) for name, new in written.items() if name in spans]
            missing = (b" " + name.encode("ascii") + b"=" + new for name, new in written.items() if name not in spans)
            splices.append((last, last, b"".join(missing)))
        splices += [self._insertion(parent, texts) for parent, texts in self._inserted.items()]
        for start, end, new in sorted(splices, key=lambda splice: splice[:2]):
            if start < at:
                raise ValueError(f"{self.what}: an edit at byte {start} lies within another")
            out += [self.content[at:start], new]
            at = end
        result = b"".join((*out, self.content[at:]))
        type(self).read(result, self.what)
        return result

    def _insertion(self, parent: XmlElement, texts: list[str]) -> tuple[int, int, bytes]:
        own = self._indent(parent)
        inside = self.content[parent.opened : parent.closing]
        body = inside.rstrip(b" \t\r\n")
        empty = parent.opened == parent.closing
        if own is None if empty else b"\n" not in inside[len(body) :]:  # all on one line
            new = b"".join(self._laid_out(text, b"") for text in texts)
        else:
            # as its last child that is the first on its line is indented; else one step further than itself
            known = (found for child in reversed(parent.children) if (found := self._indent(child)) is not None)
            indent = next(known, None)
            indent = (own or b"") + self._step if indent is None else indent
            new = b"".join(self._newline + indent + self._laid_out(text, indent) for text in texts)
            new += self._newline + (own or b"") if empty else b""
        if parent.closing < parent.end:
            at = parent.opened + len(body)
            return at, at, new
        tag = _NAME.match(self.content, parent.start)
        assert tag is not None  # noqa: S101  # Expat found an element there
        return parent.opened - 2, parent.opened, b">" + new + b"</" + tag[0][1:] + b">"

    def _indent(self, element: XmlElement) -> bytes | None:
        """The blanks before an element that is the first on its line; None where it is not."""
        line = self.content[self.content.rfind(b"\n", 0, element.start) + 1 : element.start]
        line = line.removeprefix(b"\xef\xbb\xbf")
        return None if line.strip(b" \t") else line

    @property
    def _step(self) -> bytes:
        """By which the file indents: that of the first child which is further in than its parent; else two blanks."""
        for element in self.root.find_all():
            own = self._indent(element)
            for child in element.children[:1]:
                found = self._indent(child)
                if own is not None and found is not None and found.startswith(own) and found != own:
                    return found[len(own) :]
        return b"  "

    @property
    def _newline(self) -> bytes:
        first = self.content.find(b"\n")
        return b"\r\n" if first > 0 and self.content[first - 1 : first] == b"\r" else b"\n"

    def _laid_out(self, text: str, indent: bytes) -> bytes:
        """A text whose second and later lines are indented, and end as those of the file."""
        return (self._newline + indent).join(text.encode("utf-8").split(b"\n"))


def model_read(into: bytes | None, name: str, kind: str, root: str) -> XmlDocument:
    """The model to merge into, a URDF, say. Raises InputError as `XmlDocument.read`, and where its root is another."""
    document = XmlDocument.read(into or b"", name or "into")
    if (tag := document.root.tag) != root:
        article = "a" if kind == "URDF" else "an"
        raise InputError(
            f"{document.what}: its root is <{one_line(tag, 40)}>; expected {article} {kind}, whose root is <{root}>"
        )
    return document


def joint_named(what: str, joints: Sequence[XmlElement], name: str, remedy: str = "") -> tuple[XmlElement, str]:
    """The one of a file's joints that has the name, and how a sentence about it begins.

    Raises InputError where none has it, opening the list of names with a remedy, or two.
    """
    found = [x for x in joints if x.attributes.get("name") == name]
    if not found:
        names = short_list(short(known) for x in joints if (known := x.attributes.get("name")))
        raise InputError(f"{what}: has no joint {short(name)}; {remedy}its joints are {names}")
    if len(found) > 1:
        lines = " and ".join(str(x.line) for x in found[:2])
        raise InputError(f"{what}: has joint {short(name)} twice, in lines {lines}; expected a file that has it once")
    return found[0], f"{what}, line {found[0].line}: joint {short(name)}"


def attribute(value: str) -> str:
    """A value as an attribute has it, quoted; what XML cannot hold becomes U+FFFD, and what does not print a reference."""
    text = escape(_NO_XML.sub("\N{REPLACEMENT CHARACTER}", value), {'"': "&quot;"})
    return '"' + "".join(c if c.isprintable() else f"&#x{ord(c):X};" for c in text) + '"'


def as_read(name: str) -> str:
    """A name as a reader of XML has it once it is written: what XML cannot hold is replaced."""
    return XmlDocument.read(f"<_ n={attribute(name)}/>".encode(), "a name").root.attributes["n"]


def comment(text: str) -> str:
    """A text as a comment, whatever it holds: no two hyphens in a row, and what does not print, but a line feed, as Python escapes it."""
    shown = "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)
    return f"<!-- {re.sub('-(?=-)', '- ', shown)} -->"


def _check_fragment(text: str) -> None:
    XmlDocument.read(f"<_>{text}</_>".encode(), "what is inserted")


def _attribute_spans(content: bytes, start: int) -> tuple[dict[str, tuple[int, int]], int]:
    """Where the value of each attribute stands, with its quotes, in the start tag at a byte; and where the last one ends."""
    name = _NAME.match(content, start)
    assert name is not None  # noqa: S101  # Expat found an element there
    at, spans = name.end(), {}
    while found := _ATTRIBUTE.match(content, at):
        spans[found[1].decode("utf-8")] = found.span(2)
        at = found.end()
    return spans, at


class _ElementReader:
    """Reads the elements of one file."""

    def __init__(self, content: bytes, what: str) -> None:
        self._content = content
        self._what = what
        self._stack = [XmlElement(tag="", attributes={}, line=0, start=0)]
        self._count = 0
        self._parser: Any = expat.ParserCreate("UTF-8")
        self._parser.StartElementHandler = self._begin
        self._parser.EndElementHandler = self._end
        self._parser.CommentHandler = self._commented
        self._parser.XmlDeclHandler = self._declared
        self._parser.StartDoctypeDeclHandler = self._refuse_doctype
        self._parser.EntityDeclHandler = self._refuse_doctype

    def root(self) -> XmlElement:
        """The outermost element. Raises InputError where the file is not as `XmlDocument.read` takes it."""
        try:
            self._parser.Parse(self._content, True)
        except expat.ExpatError as error:
            why = expat.ErrorString(error.code)
            raise self._error(error.lineno, f"is not well-formed XML ({why}); expected XML in UTF-8") from error
        return self._stack[0].children[0]

    def _error(self, line: int, why: str) -> InputError:
        return InputError(f"{self._what}, line {line}: {why}")

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        element = self._new(tag, attributes)
        if len(self._stack) > MAX_DEPTH:
            raise self._error(element.line, f"nests elements deeper than {MAX_DEPTH}; expected a model")
        self._stack[-1].children.append(element)
        self._stack.append(element)

    def _new(self, tag: str, attributes: dict[str, str]) -> XmlElement:
        """One more, which begins here."""
        line = self._parser.CurrentLineNumber
        self._count += 1
        if self._count > MAX_ELEMENTS:
            raise self._error(line, f"has more than {MAX_ELEMENTS} elements; expected a model without meshes")
        return XmlElement(tag=tag, attributes=attributes, line=line, start=self._parser.CurrentByteIndex)

    def _end(self, _tag: str) -> None:
        done = self._stack.pop()
        _, last = _attribute_spans(self._content, done.start)
        tag_end = _TAG_END.match(self._content, last)
        assert tag_end is not None  # noqa: S101  # Expat found it sound
        done.opened = done.closing = done.end = tag_end.end()
        if not tag_end[1]:
            done.closing = self._parser.CurrentByteIndex
            done.end = self._content.index(b">", done.closing) + 1

    def _commented(self, text: str) -> None:
        found = self._new("", {"text": text})
        found.opened = found.closing = found.end = self._content.index(b"-->", found.start + 4) + 3
        self._stack[-1].comments.append(found)

    def _declared(self, _version: str, encoding: str | None, _standalone: int) -> None:
        if encoding is not None and encoding.upper() not in {"UTF-8", "UTF8"}:
            raise self._error(1, f"declares the encoding {short(encoding)}; expected UTF-8: save it so")

    def _refuse_doctype(self, *_: Any) -> None:
        line = self._parser.CurrentLineNumber
        raise self._error(line, "declares a document type or an entity; expected plain XML: take the declaration out")

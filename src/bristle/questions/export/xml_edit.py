"""Edits of an XML file that keep all other bytes. Expat finds where elements begin and end."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NoReturn
from xml.parsers import expat
from xml.sax.saxutils import escape

from bristle.errors import InputError, one_line, short, short_list

MAX_BYTES = 2**23  # largest file, bytes
MAX_ELEMENTS = 200_000  # most elements of a file, comments included
MAX_DEPTH = 200  # deepest nesting
_ATTRIBUTE = re.compile(rb"""\s+([^\s=/>]+)\s*=\s*("[^"]*"|'[^']*')""")
_START_TAG = re.compile(rb"""<[^\s/>]+((?:\s+[^\s=/>]+\s*=\s*(?:"[^"]*"|'[^']*'))*)\s*(/?)>""")
_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # not allowed in XML 1.0


@dataclass(slots=True, kw_only=True, eq=False)
class XmlElement:
    """An element at its place in a file."""

    tag: str  # with its prefix
    attributes: Mapping[str, str]  # references resolved
    children: list["XmlElement"] = field(default_factory=list)
    comments: list["XmlElement"] = field(default_factory=list)  # as elements without a tag, with the attribute `text`
    line: int  # first line, from 1
    start: int  # byte of its `<`
    told: int = 0  # byte after its last attribute
    opened: int = 0  # byte after its start tag
    closing: int = 0  # byte of its end tag; `opened` where it closes itself
    end: int = 0  # byte after it

    def find_all(self, tag: str = "") -> Iterator["XmlElement"]:
        """Itself and the elements within, with this tag or all, in the order of the file."""
        if tag in ("", self.tag):
            yield self
        for child in self.children:
            yield from child.find_all(tag)


@dataclass(slots=True, kw_only=True)
class XmlDocument:
    """A file with its elements and edits."""

    content: bytes
    what: str  # name of the file in messages
    root: XmlElement
    _attributes: dict[XmlElement, dict[str, str]] = field(default_factory=dict)
    _inserted: dict[XmlElement, list[str]] = field(default_factory=dict)
    _replaced: dict[XmlElement, str] = field(default_factory=dict)

    @classmethod
    def read(cls, content: bytes, what: str) -> "XmlDocument":
        """A file in UTF-8, with or without a byte order mark.

        Raises InputError with file and line where it is not well-formed, not UTF-8, too large or too deep, or declares a
        document type or an entity.
        """
        if len(content) > MAX_BYTES:
            raise InputError(f"{what}: has more than {MAX_BYTES} bytes; expected a model without meshes")
        try:
            content.decode("utf-8")
        except UnicodeDecodeError as error:
            line = content.count(b"\n", 0, error.start) + 1
            raise InputError(f"{what}, line {line}: is not encoded as UTF-8; save it so") from error
        if (at := content.find(0)) >= 0:
            raise InputError(f"{what}, line {content.count(10, 0, at) + 1}: holds NUL; expected XML in UTF-8")
        return cls(content=content, what=what, root=_root(content, what))

    def set_attributes(self, element: XmlElement, values: Mapping[str, str]) -> None:
        """Add attributes with ASCII names, or replace their values."""
        self._attributes.setdefault(element, {}).update(values)

    def insert_last(self, parent: XmlElement, text: str) -> None:
        """Insert elements or comments as the last children, indented as the file is. Raises InputError as `replace`."""
        _check_fragment(text)
        self._inserted.setdefault(parent, []).append(text)

    def annotate(self, parent: XmlElement, text: str) -> None:
        """Insert a comment as the last child, or replace one that begins with the same two words."""
        words = text.split(maxsplit=2)[:2]
        for old in parent.comments:
            if old.attributes["text"].split(maxsplit=2)[:2] == words:
                return self.replace(old, comment(text))
        return self.insert_last(parent, comment(text))

    def replace(self, element: XmlElement, text: str) -> None:
        """Replace an element or a comment by a text. Raises InputError where it is not well-formed."""
        _check_fragment(text)
        self._replaced[element] = text

    def written(self) -> bytes:
        """The edited file. Raises ValueError where an edit lies within another, and InputError as `read`."""
        out, at = [], 0
        splices = []  # start, end and new content of each edit
        for element, text in self._replaced.items():
            splices.append((element.start, element.end, self._laid_out(text, self._indent(element) or b"")))
        for element, values in self._attributes.items():
            each = _ATTRIBUTE.finditer(self.content, element.start, element.told)
            found = {x[1].decode("utf-8"): x.span(2) for x in each}
            written = {name: attribute(value).encode("utf-8") for name, value in values.items()}
            splices += [(*found[name], new) for name, new in written.items() if name in found]
            missing = (b" " + name.encode("ascii") + b"=" + new for name, new in written.items() if name not in found)
            splices.append((element.told, element.told, b"".join(missing)))
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
            # Indented as its last child that begins a line; else one step further than itself.
            known = (found for child in reversed(parent.children) if (found := self._indent(child)) is not None)
            indent = next(known, None)
            indent = (own or b"") + self._step if indent is None else indent
            new = b"".join(self._newline + indent + self._laid_out(text, indent) for text in texts)
            new += self._newline + (own or b"") if empty else b""
        if parent.closing < parent.end:
            at = parent.opened + len(body)
            return at, at, new
        return parent.opened - 2, parent.opened, b">" + new + b"</" + parent.tag.encode("utf-8") + b">"

    def _indent(self, element: XmlElement) -> bytes | None:
        """The blanks before an element that begins a line, else None."""
        line = self.content[self.content.rfind(b"\n", 0, element.start) + 1 : element.start]
        line = line.removeprefix(b"\xef\xbb\xbf")
        return None if line.strip(b" \t") else line

    @property
    def _step(self) -> bytes:
        """Indentation of the first child that is further in than its parent; else two blanks."""
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
        """A text with indented lines and the line ends of the file."""
        return (self._newline + indent).join(text.encode("utf-8").split(b"\n"))


def model_read(into: bytes | None, name: str, kind: str, root: str) -> XmlDocument:
    """The model to merge into. Raises InputError as `XmlDocument.read`, and where its root is another."""
    document = XmlDocument.read(into or b"", name or "into")
    if (tag := document.root.tag) != root:
        article = "a" if kind == "URDF" else "an"
        raise InputError(
            f"{document.what}: its root is <{one_line(tag, 40)}>; expected {article} {kind}, whose root is <{root}>"
        )
    return document


def joint_named(what: str, joints: Sequence[XmlElement], name: str, remedy: str = "") -> tuple[XmlElement, str]:
    """The joint of a name, and the beginning of a sentence about it. Raises InputError where none or two have it."""
    found = [x for x in joints if x.attributes.get("name") == name]
    if not found:
        names = short_list(short(known) for x in joints if (known := x.attributes.get("name")))
        raise InputError(f"{what}: has no joint {short(name)}; {remedy}its joints are {names}")
    if len(found) > 1:
        lines = " and ".join(str(x.line) for x in found[:2])
        raise InputError(f"{what}: has joint {short(name)} twice, in lines {lines}; expected a file that has it once")
    return found[0], f"{what}, line {found[0].line}: joint {short(name)}"


def attribute(value: str) -> str:
    """A value as a quoted attribute; characters that XML cannot hold become U+FFFD, unprintable ones references."""
    text = escape(_NO_XML.sub("\N{REPLACEMENT CHARACTER}", value), {'"': "&quot;"})
    return '"' + "".join(c if c.isprintable() else f"&#x{ord(c):X};" for c in text) + '"'


def comment(text: str) -> str:
    """A text as a comment, without double hyphens, and with unprintable characters but line feeds escaped."""
    shown = "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)
    return f"<!-- {re.sub('-(?=-)', '- ', shown)} -->"


def _check_fragment(text: str) -> None:
    XmlDocument.read(f"<_>{text}</_>".encode(), "what is inserted")


def _root(content: bytes, what: str) -> XmlElement:
    """The root element of a file. Raises InputError as `XmlDocument.read`."""
    parser: Any = expat.ParserCreate("UTF-8")
    stack, count = [XmlElement(tag="", attributes={}, line=0, start=0)], 0

    def refuse(why: str, line: int) -> NoReturn:
        raise InputError(f"{what}, line {line}: {why}")

    def new(tag: str, attributes: dict[str, str]) -> XmlElement:
        nonlocal count
        count += 1
        if count > MAX_ELEMENTS:
            refuse(f"has more than {MAX_ELEMENTS} elements; expected a model without meshes", parser.CurrentLineNumber)
        return XmlElement(tag=tag, attributes=attributes, line=parser.CurrentLineNumber, start=parser.CurrentByteIndex)

    def begin(tag: str, attributes: dict[str, str]) -> None:
        element = new(tag, attributes)
        if len(stack) > MAX_DEPTH:
            refuse(f"nests elements deeper than {MAX_DEPTH}; expected a model", element.line)
        stack[-1].children.append(element)
        stack.append(element)

    def end(_tag: str) -> None:
        done = stack.pop()
        tag = _START_TAG.match(content, done.start)
        assert tag is not None  # noqa: S101  # Expat found it sound
        done.told, done.opened = tag.end(1), tag.end()
        done.closing = done.end = done.opened
        if not tag[2]:
            done.closing = parser.CurrentByteIndex
            done.end = content.index(b">", done.closing) + 1

    def commented(text: str) -> None:
        found = new("", {"text": text})
        found.opened = found.closing = found.end = content.index(b"-->", found.start + 4) + 3
        stack[-1].comments.append(found)

    def declared(_version: str, encoding: str | None, _standalone: int) -> None:
        if encoding is not None and encoding.upper() not in {"UTF-8", "UTF8"}:
            refuse(f"declares the encoding {short(encoding)}; expected UTF-8: save it so", 1)

    def doctype(*_: Any) -> None:
        why = "declares a document type or an entity; expected plain XML: take the declaration out"
        refuse(why, parser.CurrentLineNumber)

    parser.StartElementHandler, parser.EndElementHandler, parser.CommentHandler = begin, end, commented
    parser.XmlDeclHandler, parser.StartDoctypeDeclHandler, parser.EntityDeclHandler = declared, doctype, doctype
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        refuse(f"is not well-formed XML ({expat.ErrorString(error.code)}); expected XML in UTF-8", error.lineno)
    return stack[0].children[0]

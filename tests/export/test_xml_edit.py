import re
from xml.etree import ElementTree as Xml

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bristle.errors import InputError
from bristle.questions.export.xml_edit import XmlDocument, attribute, comment

NAMES = st.sampled_from(["a", "joint", "x-1", "é", "drake:b", "_9.z"])
BLANKS = st.sampled_from(["", " ", "\n", "\r\n", "\n\t", "\n    ", "\r\n  ", "\t"])
TEXT = st.text(st.characters(codec="utf-8", categories=("L", "N", "P", "S", "Zs")), max_size=6)
SAFE = TEXT.map(lambda x: re.sub("[<&>]", "", x))


@st.composite
def starts(draw: st.DrawFn) -> tuple[str, str]:
    """A tag, and what stands in its start tag: odd quotes, blanks and line ends."""
    tag = draw(NAMES)
    out = tag
    for name in draw(st.lists(st.sampled_from(["name", "q", "ü", "v.w"]), unique=True, max_size=3)):
        quote = draw(st.sampled_from("'\""))
        value = draw(SAFE).replace(quote, "").replace("\n", "") + draw(st.sampled_from(["", "&lt;", "/>", "&#10;"]))
        space, equals = draw(st.sampled_from([" ", "\t", "  "])), draw(st.sampled_from(["=", " = "]))
        out += f"{space}{name}{equals}{quote}{value}{quote}"
    return tag, out + draw(st.sampled_from(["", " "]))


@st.composite
def wrapped(draw: st.DrawFn, inner: st.SearchStrategy[str]) -> str:
    """An element with children."""
    tag, start = draw(starts())
    body = "".join(f"{draw(BLANKS)}{x}" for x in draw(st.lists(inner, max_size=4)))
    return f"<{start}>{body}{draw(BLANKS)}</{tag}{draw(st.sampled_from(['', ' ']))}>"


LEAVES = st.one_of(
    starts().map(lambda x: f"<{x[1]}/>"),
    SAFE.map(lambda x: f"<![CDATA[<joint {x.replace(']', '')}]]>"),
    SAFE.map(lambda x: f"<!-- <b> & {x.replace('-', '')} -->"),
    st.just("<?pi <x/> ?>"),
    SAFE.map(lambda x: x.replace("]", "")),
)
ROOTS = st.builds(
    lambda mark, head, root, tail: (mark + head + root + tail).encode(),
    st.sampled_from(["", "\ufeff"]),
    st.sampled_from(["", '<?xml version="1.0"?>\n', "<?xml version='1.0' encoding='utf-8'?>\r\n", "<!-- a -->\n"]),
    wrapped(st.recursive(LEAVES, wrapped, max_leaves=12)) | starts().map(lambda x: f"<{x[1]}/>"),
    st.sampled_from(["", "\n", "\n<!-- end -->\n"]),
)


def tree(content: bytes) -> Xml.Element:
    """The elements as another parser has them; prefixes need no declaration here."""
    return Xml.fromstring(content.replace(b"drake:", b"drake_"))  # noqa: S314  # made here


def blank(element: Xml.Element) -> object:
    """What an element holds, blanks at the ends of its texts apart."""
    texts = tuple((x or "").strip() for x in (element.text, *(x.tail for x in element)))
    return element.tag, element.attrib, texts, tuple(map(blank, element))


def kept(old: bytes, new: bytes) -> int:
    """Bytes that both begin and end with."""
    begin = _alike(old, new)
    return begin + _alike(old[begin:][::-1], new[begin:][::-1])


def _alike(old: bytes, new: bytes) -> int:
    pairs = enumerate(zip(old, new, strict=False))
    return next((k for k, (x, y) in pairs if x != y), min(len(old), len(new)))


@given(ROOTS, st.data())
def test_an_inserted_element_is_the_last_child_and_nothing_else_changes(content: bytes, data: st.DataObject) -> None:
    """The tree is the old one with the new child; all bytes are kept, but for the slash of a parent that closed itself."""
    document = XmlDocument.read(content, "f")
    k = data.draw(st.integers(0, len(list(document.root.find_all())) - 1))
    parent = list(document.root.find_all())[k]
    document.insert_last(parent, '<new v="1"/>')
    result = document.written()
    assert kept(content, result) >= len(content) - (2 if parent.closing == parent.end else 0)
    expected = tree(content)
    Xml.SubElement(list(expected.iter())[k], "new", v="1")
    assert blank(tree(result)) == blank(expected)
    # what stands before and after an element stands there still
    document = XmlDocument.read(content, "f")
    element = data.draw(st.sampled_from(list(document.root.find_all())))
    document.replace(element, "<new/>")
    assert document.written() == content[: element.start] + b"<new/>" + content[element.end :]


@given(ROOTS, st.data(), st.sampled_from(["name", "q", "fresh"]), TEXT)
def test_only_the_attributes_that_are_set_change(content: bytes, data: st.DataObject, name: str, value: str) -> None:
    """The tree is the old one with that value; all bytes are kept, but for the value that it replaces; without edits all are."""
    document = XmlDocument.read(content, "f")
    assert document.written() == content
    assert [x.attributes for x in document.root.find_all()] == [x.attrib for x in tree(content).iter()]
    k = data.draw(st.integers(0, len(list(document.root.find_all())) - 1))
    element = list(document.root.find_all())[k]
    document.set_attributes(element, {name: value})
    result = document.written()
    old = element.attributes.get(name)
    longest = 0 if old is None else 2 + 6 * len(old.encode())
    assert kept(content, result) >= len(content) - longest
    expected = tree(content)
    list(expected.iter())[k].set(name, value)
    assert blank(tree(result)) == blank(expected)


@given(st.text(max_size=60))
def test_any_text_makes_a_sound_attribute_and_a_sound_comment(text: str) -> None:
    """An attribute gives the text back, but for what XML cannot hold; a comment holds no element, whatever the text."""
    read = Xml.fromstring(f"<x n={attribute(text)}/>").get("n")  # noqa: S314  # made here
    assert read == re.sub("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "\ufffd", text)
    assert attribute(text).replace(" ", "").isprintable()
    assert len(Xml.fromstring(f"<x>{comment(text)}</x>")) == 0  # noqa: S314  # made here
    assert all(c.isprintable() or c == "\n" for c in comment(text))


def test_edits_follow_the_file_if_it_is_one() -> None:
    """Indentation and line ends of what is inserted are the file's own, and a parent that closed itself is opened."""
    content = b'<?xml version="1.0"?>\r\n<a>\r\n\t<b x = \'1\' y="2" />\r\n\t<c>\r\n\t</c>\r\n</a>\r\n'
    document = XmlDocument.read(content, "f")
    b, c = document.root.children
    document.insert_last(b, "<n>\n</n>")
    document.insert_last(c, "<n/>")
    document.insert_last(document.root, "<n/>")
    document.insert_last(document.root, "<m/>")
    document.set_attributes(b, {"x": "3", "z": '"'})
    assert document.written() == (
        b'<?xml version="1.0"?>\r\n<a>\r\n\t<b x = "3" y="2" z="&quot;" >\r\n\t\t<n>\r\n\t\t</n>\r\n\t</b>\r\n\t<c>\r\n\t\t<n/>\r\n'
        b"\t</c>\r\n\t<n/>\r\n\t<m/>\r\n</a>\r\n"
    )
    # the second comment of the same two first words stands in the place of the first one; any other of the user stays
    document = XmlDocument.read(b"<a>\n  <!-- ours: mine -->\n</a>", "f")
    document.annotate(document.root, "ours: value 1")
    once = document.written()
    document = XmlDocument.read(once, "f")
    document.annotate(document.root, "ours: value 2")
    both = b"<a>\n  <!-- ours: mine -->\n  <!-- ours: value 2 -->\n</a>"
    assert document.written() == once.replace(b"value 1", b"value 2") == both
    # document types, entities, other encodings and endless files are refused by line; the deepest nesting is read, in order
    failed = []
    for why, content in SPOILT.items():
        with pytest.raises(InputError) as error:
            XmlDocument.read(content, "f")
        failed += [(why, str(error.value))] * (not str(error.value).startswith(why))
    assert failed == []
    deep = XmlDocument.read(b"\n".join([b"<a>"] * 200) + b"</a>" * 200, "f").root
    assert [x.line for x in deep.find_all("a")] == [*range(1, 201)]
    # no text breaks out of its place, and no edit lies in what another replaces
    document = XmlDocument.read(b"<a><b/></a>", "f")
    for text in ("</a><a>", "<!-- ", "<!DOCTYPE x>", "<x>"):
        with pytest.raises(InputError):
            document.insert_last(document.root, text)
    document.replace(document.root, "<c/>")
    document.set_attributes(document.root.children[0], {"x": "1"})
    with pytest.raises(ValueError, match="lies within another"):
        document.written()


SPOILT = {
    "f, line 1: declares a document type": b'<!DOCTYPE a [<!ENTITY x "y">]>\n<a>&x;</a>',
    "f, line 2: declares a document type": b'<?xml version="1.0"?>\n<!DOCTYPE a SYSTEM "file:///etc/passwd"><a/>',
    "f, line 1: declares the encoding 'latin-1'; expected UTF-8": b'<?xml version="1.0" encoding="latin-1"?><a/>',
    "f, line 1: is not encoded as UTF-8": "<a/>".encode("utf-16"),
    "f, line 1: holds NUL": "<a/>".encode("utf-16-le"),
    "f, line 2: is not encoded as UTF-8": b"<a>\n\xff</a>",
    "f, line 2: is not well-formed XML (mismatched tag)": b"<a>\n<b></a>",
    "f, line 1: is not well-formed XML (undefined entity)": b"<a>&nbsp;</a>",
    "f, line 1: is not well-formed XML (no element found)": b"",
    "f, line 1: nests elements deeper than 200": b"<a>" * 201 + b"</a>" * 201,
    "f, line 1: has more than 200000 elements": b"<a>" + b"<b/>" * 200_000 + b"</a>",
    "f: has more than 8388608 bytes": b" " * (2**23 + 1),
}

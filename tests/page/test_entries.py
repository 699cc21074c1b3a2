"""What a code means: one paragraph, for the terminal and for pages."""

from bristle.findings import CAUTION, NOTE, Finding
from bristle.page.entries import by_code, entries, entries_linked, explanation, flagged, warned

from ..conftest import run


def test_a_code_is_found_in_any_form() -> None:
    """Small letters, digits and single hyphens; as it was printed, or as an older results file has it."""
    for code, x in entries().items():
        assert set(code) <= set("abcdefghijklmnopqrstuvwxyz0123456789-"), code
        assert "--" not in code
        assert by_code(code) is by_code(code.upper().replace("-", "_")) is by_code(f"[{code}]") is x


def test_the_command_explains() -> None:
    """`bristle explain` prints the paragraph of a code, why it has its severity and what to do."""
    x = by_code("strays-matter")
    ran = run("explain", "STRAYS_MATTER")
    assert (ran.code, ran.words) == (0, " ".join(" ".join(explanation(x)).split()))
    assert all(text in ran.words for text in (x.meaning, x.reason, x.advice))


def test_an_unknown_code_is_bad_input() -> None:
    """It ends with 2 and one sentence, which names those that are near."""
    for code, near in {"stray-matters": "strays-matter", "lacks": "lacks-a-term", "?": ""}.items():
        ran = run("explain", code)
        assert (ran.code, ran.out, len(ran.said)) == (2, "", 1)
        assert near in ran.err


def test_a_page_has_the_entries_that_it_links_to() -> None:
    """A finding ends with a link to its code, a note only where notes are listed; each code linked has one entry, the critical ones first."""
    caution, note = Finding("single-run", CAUTION, "1 of 4 <b>."), Finding("correlated", NOTE, "They are.")
    assert flagged(note) == str(note)
    assert "href" not in flagged("a text of somebody's") + warned("<b>")
    text = f'{warned(caution)} {flagged(caution)} {warned(note)} <a href="#warning-static-too-few"> <a href="#warning-none">'
    assert [x["code"] for x in entries_linked(text)] == ["static-too-few", "single-run", "correlated"]
    assert "<b>" not in warned(caution) + warned("<b>")


def test_the_terminal_names_the_code() -> None:
    """A message is followed by its code in brackets; of a note only where that is asked for."""
    caution, note = Finding("single-run", CAUTION, "1 of 4."), Finding("correlated", NOTE, "They are.")
    assert (caution.flagged, note.flagged, note.coded) == (
        "1 of 4. [single-run]",
        "They are.",
        "They are. [correlated]",
    )

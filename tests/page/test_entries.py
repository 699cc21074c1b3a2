"""What a kind of warning means: one entry, by its code, for the terminal and for pages."""

import pytest

from bristle.diagnostics import ADVICE, OWN_ADVICE, REASONS, Kind, Severity
from bristle.errors import InputError
from bristle.page.entries import by_code, entries_linked, entry, explanation, flagged, warned

from ..conftest import run

CODES = [kind.code for kind in Kind]


def test_codes_tell_kinds_apart() -> None:
    """Each kind has a code of its own, in small letters, digits and single hyphens, by which it is found."""
    assert len(set(CODES)) == len(Kind)
    assert all(set(code) <= set("abcdefghijklmnopqrstuvwxyz0123456789-") and "--" not in code for code in CODES)
    for kind in Kind:
        assert by_code(kind.code) is by_code(kind.name) is by_code(f"[{kind.code}]") is kind


def test_every_reason_has_advice() -> None:
    """What to do is said for each reason, in sentences; where a warning is critical or a caution it is something to do."""
    assert set(ADVICE) == set(REASONS)
    for text in (*ADVICE.values(), *OWN_ADVICE):
        assert text.strip("`")[0].isalpha()
        assert text.endswith(".")
        assert text.count("`") % 2 == 0
    own = [name for names in OWN_ADVICE.values() for name in names.split()]
    assert len(set(own)) == len(own)
    assert set(own) <= set(Kind.__members__)
    idle = {reason for reason, text in ADVICE.items() if text.startswith("Nothing")}
    assert all(Kind[name].severity is Severity.NOTE for reason in idle for name in REASONS[reason].split())


def test_an_entry_is_readable() -> None:
    """It has a sentence without braces or conversions, the severity, why and what to do, in one printable line each."""
    found = []
    for kind in Kind:
        lines = list(explanation(kind))
        printable = all(line.isprintable() and not set("{}") & set(line) for line in lines)
        whole = len(lines) == 4 and lines[0] == f"{kind.code} ({kind.severity})" and entry(kind).reason in lines[2]
        if not (printable and whole):
            found.append(kind.name)
    assert found == []


def test_the_command_explains() -> None:
    """`bristle explain` prints the entry of a code, in whichever form it was met."""
    for code in ("strays-matter", "STRAYS_MATTER", "[strays-matter]"):
        ran = run("explain", code)
        assert (ran.code, ran.words) == (0, " ".join(" ".join(explanation(Kind.STRAYS_MATTER)).split()))


@pytest.mark.parametrize(("code", "near"), [("stray-matters", "strays-matter"), ("lacks", "lacks-a-term"), ("?", "")])
def test_an_unknown_code_is_bad_input(code: str, near: str) -> None:
    """It ends with 2 and one sentence, which names those that are near."""
    ran = run("explain", code)
    assert (ran.code, ran.out, len(ran.said)) == (2, "", 1)
    assert near in ran.err
    with pytest.raises(InputError):
        by_code(code)


def test_a_page_has_the_entries_that_it_links_to() -> None:
    """A warning ends with a link to its code, a note only where notes are listed; each code linked has one entry, the critical ones first."""
    caution, note, critical = (
        Kind.FEW_STARTS(reached=1, starts=4),
        Kind.CORRELATED(lag_one=0.6, widened=2.0),
        Kind.STATIC_TOO_FEW,
    )
    assert flagged(note) == str(note)
    assert "href" not in flagged("a text of somebody's") + warned("<b>")
    text = f'{warned(caution)} {flagged(caution)} {warned(note)} <a href="#warning-{critical.code}"> <a href="#warning-none-such">'
    assert [x["code"] for x in entries_linked(text)] == [critical.code, "few-starts", "correlated"]
    assert "<b>" not in warned(Kind.UNKNOWN(text="<b>"))


def test_the_terminal_names_the_code() -> None:
    """A sentence is followed by its code in brackets; of a note only where that is asked for."""
    assert Kind.SINGLE_RUN().coded == f"{Kind.SINGLE_RUN()} [single-run]"
    assert Kind.FEW_STARTS(reached=1, starts=4).flagged.endswith(" [few-starts]")
    assert "[" not in Kind.EDGES(edges=3).flagged

"""The one exception that says a user's input cannot be used."""

LONGEST = 450
"""Characters of a sentence; what is longer loses its middle."""


class InputError(ValueError):
    """Bad input, in one sentence: what was got, what was expected, what to do.

    The command line ends with 2 at this and at an OSError; any other exception, a ValueError too, is a defect of bristle's own.
    Whatever is quoted, the sentence is one line of at most `LONGEST` characters that can be shown in a terminal.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(_cut(_printable(sentence)))


def _cut(text: str) -> str:
    """Beginning and end of a long text: they say what was got and what to do."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST * 2 // 3]} ... {text[5 - LONGEST // 3 :]}"


def _printable(text: str) -> str:
    """The text with each control character as Python writes it, and each blank as a space."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else " " if c.isspace() else ascii(c)[1:-1] for c in text)

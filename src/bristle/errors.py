"""The one exception that says a user's input cannot be used."""


class InputError(ValueError):
    """Bad input, in one sentence: what was got, what was expected, what to do.

    The command line ends with 2 at this and at an OSError; any other exception, a ValueError too, is a defect of bristle's own.
    """

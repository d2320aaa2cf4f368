"""Errors with a message for the user."""


def on_one_line(text: object, longest: int = 2000) -> str:
    """Return a text on one line that a terminal can print: no control characters, cut if long."""
    line = " ".join(str(text).split())
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line)
    return shown if len(shown) <= longest else shown[:longest] + "..."


class UserError(Exception):
    """The user's input is wrong; the message, one line, names place and cure (exit code 2)."""

    def __init__(self, message: str) -> None:
        super().__init__(on_one_line(message))


class StudyError(Exception):
    """The study itself failed, e.g. too many failed runs (exit code 1)."""

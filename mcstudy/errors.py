"""Errors that a user can cure."""


class UserError(Exception):
    """The user's input is wrong; the message, one line, names place and cure (exit code 2)."""

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.split()))


class StudyError(Exception):
    """The study itself failed, e.g. too many failed runs (exit code 1)."""

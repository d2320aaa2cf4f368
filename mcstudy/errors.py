"""Errors that a user can cure."""


class UserError(Exception):
    """The user's input is wrong; the message names the place and the cure (exit code 2)."""


class StudyError(Exception):
    """The study itself failed, e.g. too many failed runs (exit code 1)."""

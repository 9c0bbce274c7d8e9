"""Errors of user input; each message is a sentence for the user."""

from __future__ import annotations


class InputError(ValueError):
    """User input is wrong; the message is a sentence that names it, its value and what is allowed."""


class DesignError(InputError):
    """A design value that is missing, unknown, of the wrong kind or out of range; the message says
    which and why.
    """

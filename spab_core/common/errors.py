"""Errors in what a person gave, told in one sentence without a traceback."""

from __future__ import annotations


class InputError(ValueError):
    """An input is wrong; the message is a sentence that names it and says what is allowed."""


class DesignError(InputError):
    """A value of a design is missing, unknown, of the wrong kind or out of range."""

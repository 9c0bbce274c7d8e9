"""Errors in user input, told in one sentence without a traceback."""

from __future__ import annotations


class InputError(ValueError):
    """An input is wrong; the message names the field, its value and what is allowed."""


class DesignError(InputError):
    """A value of a design is missing, unknown, of the wrong kind or out of range."""

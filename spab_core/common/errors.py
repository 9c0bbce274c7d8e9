"""What a person typed or gave is wrong: the root of all errors that are told in a sentence."""

from __future__ import annotations


class InputError(ValueError):
    """Something a person gave is wrong; the message is a sentence that says what, and what is
    allowed.
    """


class DesignError(InputError):
    """A design value that is missing, unknown, of the wrong kind or out of range; the message says
    which and why.
    """

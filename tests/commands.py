"""The command line, called in this process."""

import json

from spab_core.cli.main import main


def answer(capsys, *argv):
    assert main([*argv, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def refused(capsys, *argv):
    """The message of a refused command: exit code 2, one line on stderr, nothing on stdout."""
    try:
        code = main(list(argv))
    except SystemExit as stop:
        code = stop.code
    out = capsys.readouterr()
    assert code == 2
    assert out.out == ""
    assert out.err.count("\n") == 1 and "Traceback" not in out.err
    return out.err

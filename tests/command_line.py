"""Commands of `pe` run in this process: exit code, stdout and stderr of each."""

import json

import pytest

from pe_runtime.cli import main


def run(capsys, *arguments):
    """Exit code, stdout and stderr of one command."""
    with pytest.raises(SystemExit) as stop:
        main([str(each) for each in arguments])
    said = capsys.readouterr()
    return stop.value.code or 0, said.out, said.err


def result(capsys, *arguments):
    """What a command that succeeds says as JSON, with nothing on stderr."""
    code, out, err = run(capsys, *arguments, "--json")
    assert (code, err) == (0, "")
    return json.loads(out)

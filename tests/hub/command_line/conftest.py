"""The command line in this process."""

import sys

import pytest

from hub.command_line.app import main


@pytest.fixture
def trocar(monkeypatch, capsys):
    """Run `trocar ...` and return exit code, stdout and stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["trocar", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            main()
        out, err = capsys.readouterr()
        return left.value.code or 0, out, err

    return run

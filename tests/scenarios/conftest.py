"""Scripted sessions of the scenarios in this repository, played in this process."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rise_engine.cli import main
from tests.scenarios.played import Played, command

Play = Callable[..., Played]
_PLAYED: dict[tuple[str, ...], Played] = {}
"""Sessions that were played already: the same arguments give the same session (test_processes.py)."""


@pytest.fixture
def play(capfdbinary: pytest.CaptureFixture[bytes]) -> Play:
    """Plays a scenario's scripted session in this process."""

    def play(name: str, *more: str) -> Played:
        if (name, *more) in _PLAYED:
            return _PLAYED[name, *more]
        with pytest.raises(SystemExit) as ended:
            main(command(name, *more))
        output, errors = capfdbinary.readouterr()
        assert (ended.value.code or 0, errors) == (0, b"")
        return _PLAYED.setdefault((name, *more), Played(output))

    return play

from __future__ import annotations

from collections.abc import Callable

import pytest
from tests.scenarios.played import Played, command

from rise_engine.cli import main

Play = Callable[..., Played]


@pytest.fixture
def play(capfdbinary: pytest.CaptureFixture[bytes]) -> Play:
    """Plays a scenario's scripted session in this process."""

    def play(name: str, *more: str) -> Played:
        with pytest.raises(SystemExit) as exit:
            main(command(name, *more))
        output, errors = capfdbinary.readouterr()
        assert (exit.value.code or 0, errors) == (0, b"")
        return Played(output)

    return play

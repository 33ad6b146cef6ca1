"""What is in the way of a session, with the exit status and sentences for a person."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rise_engine.base.errors import RiseError
from rise_engine.run.server.spawn import EngineRefused
from rise_engine.session.folder import describe_session


class ServeRefused(RiseError):
    """Nothing is served."""

    def __init__(
        self,
        code: int,
        *lines: str,
        unfinished: Sequence[Path] = (),
        others: Sequence[Path] = (),
        socket: str = "",
    ) -> None:
        super().__init__(*lines)
        self.report = EngineRefused(code, list(lines), _describe_all(unfinished), _describe_all(others), socket)


def _describe_all(folders: Sequence[Path]) -> list[tuple[str, str]]:
    return [(str(folder), describe_session(folder)) for folder in folders]

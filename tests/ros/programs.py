"""Programs that tests start on the wire, and what they write."""

from __future__ import annotations

import re
import signal
import subprocess
from pathlib import Path

import pytest

from tests.patience import PATIENCE
from tests.ros.contract.peers import environment
from tests.ros.session_node_bench import until


class Program:
    """A process, and what it has written."""

    def __init__(self, log: Path, *command: str, **more: str) -> None:
        """`more`: of its environment, beside what keeps it on this machine."""
        self.log = log
        with log.open("wb") as file:
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                env={**environment(), **more},
            )

    def said(self) -> str:
        return self.log.read_text("utf-8", "replace")

    async def says(self, pattern: str) -> None:
        try:
            await until(lambda: re.search(pattern, self.said()) or self.process.poll() is not None, PATIENCE)
        except TimeoutError:
            pytest.fail(f"{self.log.stem} did not say {pattern!r}:\n{self.said()}")
        assert re.search(pattern, self.said()), f"{self.log.stem} has ended:\n{self.said()}"

    def end(self, number: signal.Signals = signal.SIGINT) -> int:
        self.process.send_signal(number)
        return self.process.wait(PATIENCE)

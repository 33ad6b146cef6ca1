"""Programs that tests start on the wire, and what they write."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.forked import STDOUT, Forked
from tests.patience import PATIENCE
from tests.ros.contract.peers import environment
from tests.ros.session_node_bench import until

LOADS = ("rise_adapters.ros2.transport.dds", "rise_adapters.ros2.bridge")
"""What programs on DDS need, loaded before they are there."""


class Program:
    """A process, and what it has written."""

    def __init__(self, log: Path, *command: str, **more: str) -> None:
        """`more`: of its environment, beside what keeps it on this machine. A module of this Python is a fork."""
        self.log = log
        env = {**environment(), **more}
        self.process: Forked | subprocess.Popen[bytes]
        with log.open("wb") as file:
            match command:
                case (sys.executable, "-m", module, *rest):
                    name = "" if module == "rise_engine" else module
                    self.process = Forked(*rest, module=name, loads=LOADS, stdout=file, stderr=STDOUT, env=env)
                case _:
                    self.process = subprocess.Popen(
                        command, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT, env=env
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

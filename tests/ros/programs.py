"""Programs that tests start on the wire, and what they write."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

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


class Lab:
    """A study in a folder, and sessions of it and robots, each in a process of its own."""

    def __init__(self, folder: Path, ros: str = "dds") -> None:
        self.folder, self.ros = folder, ros
        self.programs: list[Program] = []

    def write(self, files: dict[str, str]) -> None:
        for name, text in files.items():
            path = self.folder / "study" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, "utf-8")

    def start(self, name: str, *command: str) -> Program:
        sessions = str(self.folder / "sessions")
        program = Program(self.folder / f"{name}.log", sys.executable, "-m", *command, RISE_SESSIONS=sessions)
        self.programs.append(program)
        return program

    async def serve(self, name: str, *options: str) -> Program:
        session = self.start(name, "rise_engine", "serve", str(self.folder / "study"), "--ros", self.ros, *options)
        await session.says("serving study")
        return session

    def records(self, kind: str = "") -> list[dict[str, Any]]:
        """What the journal has, of one kind or of all."""
        (journal,) = (self.folder / "sessions").glob("*/journal.jsonl")
        lines = [json.loads(line) for line in journal.read_bytes().splitlines(keepends=True) if line.endswith(b"\n")]
        return [line for line in lines if "kind" in line and kind in ("", line["kind"])]

    def close(self) -> None:
        for program in self.programs:
            if program.process.poll() is None:
                program.process.kill()
                program.process.wait()

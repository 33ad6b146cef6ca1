"""`rise-engine` as real processes, and scenario folders for them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import threading
from pathlib import Path
from types import TracebackType
from typing import Any

from tests.forked import ENGINE as ENGINE
from tests.forked import Forked, run_engine
from tests.patience import PATIENCE

FAST = ("--speed", "max", "--json")

GREET = """<Dialog name="Greet">
  <Speech><actionID>1</actionID><message>Hello, {name|stranger}!</message></Speech>
  <LookAt><actionID>2</actionID><waitForActions>1</waitForActions>
    <pointx>1</pointx><pointy>0</pointy><pointz>1</pointz><duration>1000</duration></LookAt>
  <Speech><actionID>3</actionID><waitForActions>1</waitForActions><message>How are you?</message></Speech>
</Dialog>"""
CHAT = """<Dialog name="Chat">
  <Variants><actionID>1</actionID>
    <Speech><message>One.</message></Speech><Speech><message>Number two.</message></Speech>
    <Speech><message>Number three it is.</message></Speech><Speech><message>And this is number four.</message></Speech>
  </Variants>
</Dialog>"""
RULES = """<InteractionRules>
<InteractionRule name="Wait for it" initial="Waiting">
  <State id="Waiting"><transition eventTopic="/go" target="Going"/></State>
  <State id="Going"><onEntry><function startCommunicationRobotAct="Greet"/></onEntry>
    <transition eventTopic="/Greet_succeeded" target="Done"/></State>
  <State id="Done"/>
</InteractionRule>
<InteractionRule name="Clock" initial="Tick">
  <State id="Tick"><transition after="10s" target="Tick"/></State>
</InteractionRule>
<InteractionRule name="Circle" initial="Round">
  <State id="Round"><onEntry><function startCommunicationRobotAct="Nothing"/></onEntry>
    <transition eventTopic="/Nothing_end" target="Round"/></State>
</InteractionRule>
</InteractionRules>"""
NOTHING = '<Dialog name="Nothing"><Wait><actionID>1</actionID><duration>0.001</duration></Wait></Dialog>'


def folder(path: Path, toml: str = "", memory: dict[str, Any] | None = None, **acts: str) -> Path:
    """A scenario folder with the acts Greet, Chat and Nothing, the rules above, and further acts."""
    (path / "acts").mkdir(parents=True)
    (path / "rules").mkdir()
    for name, text in {"greet": GREET, "chat": CHAT, "nothing": NOTHING, **acts}.items():
        (path / "acts" / f"{name}.xml").write_text(text, "utf-8")
    (path / "rules" / "rules.xml").write_text(RULES, "utf-8")
    start = {"name": "Anna"} if memory is None else memory
    (path / "memory.json").write_text(json.dumps({"WorkingMemory": [start]}), "utf-8")
    (path / "scenario.toml").write_text(toml + '\n[keys]\ng = { event = "/go" }\n', "utf-8")
    return path


def engine(*arguments: object, stdin: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run to the end."""
    return run_engine(*arguments, stdin=stdin)


def task(function: str, behavior: object = "", **more: object) -> str:
    """A line of a task file."""
    return json.dumps({"function_type": function, "domain_task_behavior": behavior, **more})


def act(name: str, **more: object) -> str:
    """A line of a task file that starts an act."""
    return task("startCommunicationRobotAct", name, **more)


def records(output: str) -> list[dict[str, Any]]:
    """Every line is a record, numbered without gaps."""
    found = [json.loads(line) for line in output.splitlines()]
    assert [record["seq"] for record in found] == list(range(1, len(found) + 1))
    return found


class Live:
    """A process that runs while the test talks to it."""

    def __init__(self, *arguments: object) -> None:
        self.process = Forked(*arguments, stdin=subprocess.PIPE, env={**os.environ, "PYTHONUNBUFFERED": "1"})
        self.records: list[dict[str, Any]] = []

    def __enter__(self) -> Live:
        self._limit = threading.Timer(
            PATIENCE, self.process.kill
        )  # a process that hangs fails its test, not the whole run
        self._limit.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._limit.cancel()
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(PATIENCE)
        for pipe in (self.process.stdin, self.process.stdout, self.process.stderr):
            if pipe is not None and not pipe.closed:
                pipe.close()

    def write(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def end_input(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()

    def until(self, kind: str, **fields: Any) -> dict[str, Any]:
        """Read on to the next record of that kind with these fields."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            record: dict[str, Any] = json.loads(line)
            self.records.append(record)
            if record["kind"] == kind and all(record[name] == value for name, value in fields.items()):
                return record
        raise AssertionError(f"the output ended without {kind} {fields}: {self.records[-3:]}")

    def signal(self, which: signal.Signals = signal.SIGINT) -> None:
        self.process.send_signal(which)

    def rest(self) -> int:
        """Read to the end and give the exit status."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.records.append(json.loads(line))
        return self.process.wait(PATIENCE)

    def errors(self) -> str:
        assert self.process.stderr is not None
        return self.process.stderr.read()

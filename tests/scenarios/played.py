"""A scripted session of a scenario in this repository, played to its end, and what can be read off its record."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from itertools import groupby
from pathlib import Path
from typing import Any

from rise_engine.kernel.records import ENDINGS, FINAL
from tests.forked import run_engine

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def command(name: str, *more: str, script: Path | None = None) -> list[str]:
    """The command line of a scripted session, as the scenario's README gives it."""
    folder = SCENARIOS / name
    tasks = str(script or folder / "session.jsonl")
    return ["run", str(folder), "--tasks", tasks, "--speed", "max", "--seed", "1", "--json", *more]


def process(arguments: list[str], **environment: str) -> subprocess.CompletedProcess[bytes]:
    """`rise-engine` as a process of its own; with an environment, one that has started with it."""
    if not environment:
        done = run_engine(*arguments)
        return subprocess.CompletedProcess(arguments, done.returncode, done.stdout.encode(), done.stderr.encode())
    return subprocess.run(
        [Path(sys.executable).with_name("rise-engine"), *arguments],
        capture_output=True,
        stdin=subprocess.DEVNULL,
        env={**os.environ, **environment},
        timeout=60,
        check=False,
    )


class Played:
    """The records of one session, as JSON objects."""

    def __init__(self, output: bytes) -> None:
        self.records: list[dict[str, Any]] = [json.loads(line) for line in output.splitlines()]

    def of(self, kind: str, **fields: Any) -> list[dict[str, Any]]:
        """The records of one kind whose fields have these values, in order."""
        return [
            record
            for record in self.records
            if record["kind"] == kind and all(record.get(name) == value for name, value in fields.items())
        ]

    def acts(self, without: str = "") -> list[str]:
        """The acts that were begun, in order."""
        started = self.of("task", function="startCommunicationRobotAct", status="ACTIVE")
        return [record["behavior"] for record in started if record["behavior"] != without]

    def said(self) -> list[str]:
        return [record["parameters"]["message"] for record in self.of("action", type="Speech", status="started")]

    def actions(self, act: str, status: str = "started") -> list[str]:
        """`id type` of an act's actions with that status, in order."""
        return [f"{record['action']} {record['type']}" for record in self.of("action", act=act, status=status)]

    def states(self, rule: str) -> list[str]:
        """The states that a rule went through, in order; one that it stayed in or entered anew counts once."""
        return [
            state for state, _ in groupby(record["state"] for record in self.of("rule", name=rule, status="entered"))
        ]

    def values(self, key: str) -> list[Any]:
        return [record["value"] for record in self.of("memory", key=key)]

    def unhandled(self) -> list[str]:
        return [record["topic"] for record in self.of("event", taken_by=None)]

    def time_of(self, kind: str, **fields: Any) -> float:
        """When the first such record was made."""
        return float(self.of(kind, **fields)[0]["t"])

    def timeless(self) -> list[dict[str, Any]]:
        """The records without what must differ between two runs: the wall clock."""
        return [{name: value for name, value in record.items() if name != "wall"} for record in self.records]

    def check_sound(self) -> None:
        """What holds for every session (semantics.md 1, semantics.md 11)."""
        assert [record["seq"] for record in self.records] == list(range(1, len(self.records) + 1))
        times = [record["t"] for record in self.records]
        assert times == sorted(times)
        assert self.records[0]["kind"] == "session"
        assert self.records[0]["status"] == "started"
        assert self.records[-1]["status"] == "ended"

        actions = Counter((record["task"], record["action"]) for record in self.of("action"))
        endings = Counter(
            (record["task"], record["action"]) for record in self.of("action") if record["status"] in ENDINGS
        )
        assert endings == dict.fromkeys(actions, 1), "every action has exactly one ending record"
        tasks = {record["id"] for record in self.of("task")}
        finals = Counter(record["id"] for record in self.of("task") if record["status"] in FINAL)
        assert finals == dict.fromkeys(tasks, 1), "every task ends in exactly one way"

        blocking: set[int] = set()
        for record in self.of("task", function="startCommunicationRobotAct", calling_type="Blocking"):
            if record["status"] == "ACTIVE":
                blocking.add(record["id"])
            else:
                blocking.discard(record["id"])
            assert len(blocking) <= 1, "never two Blocking acts at once"

        assert [record for record in self.of("condition") if record["error"]] == []
        assert self.of("task", status="REJECTED") == []
        assert self.of("task", status="ABORTED") == []
        assert self.of("note") == []

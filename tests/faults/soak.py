"""Kills engines at random moments and looks whether anything that was acknowledged is lost.

    python -m tests.faults.soak --kills 5000      (./dev soak)

Each engine is a real process (forked from this one, so that starting it takes milliseconds) that serves a real socket
and writes a real journal. It is killed with SIGKILL while a client sends tasks, while it starts, or while it recovers;
then the journal must read, hold every input that was acknowledged and every record that was seen, and replay
identically; and mostly another engine goes on with the session, and is killed in its turn.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import select
import shutil
import signal
import socket
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from rise_engine.base import exit_status
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import ENDINGS, ActionRecord
from rise_engine.run.protocol import messages
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.process import serve
from rise_engine.run.server.spawn import EngineRefused, EngineStarted, StartOutcome, StartupProgress
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_format import InputLine
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.replay import compare_replay
from tests.patience import PATIENCE

ROOT = Path(__file__).parents[2]
SCENARIOS = [ROOT / "scenarios" / "lablinking", ROOT / "scenarios" / "greeting", ROOT / "tests/tui/data/demo"]


class Mistake(AssertionError):
    """Something was lost, doubled or false."""


class Child:
    """An engine's process."""

    def __init__(self, order: SessionOptions) -> None:
        ready, say = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            code = 70
            try:
                os.close(ready)
                signal.signal(signal.SIGINT, signal.SIG_IGN)
                code = serve(order, lambda message: _write_outcome(say, message))
            finally:
                os._exit(code)
        os.close(say)
        self._ready = ready

    def outcome(self) -> StartOutcome:
        """Wait until it serves."""
        text = b""
        while not text.endswith(b"\n"):
            if not select.select([self._ready], [], [], PATIENCE)[0]:
                raise Mistake("the engine said nothing")
            chunk = os.read(self._ready, 65_536)
            if not chunk:
                raise Mistake("the engine ended before it served")
            text += chunk
        return msgspec.json.decode(text, type=EngineStarted | EngineRefused)  # type: ignore[no-any-return]

    def kill(self) -> None:
        os.kill(self.pid, signal.SIGKILL)
        self.wait()

    def end(self) -> int:
        os.kill(self.pid, signal.SIGTERM)
        return self.wait()

    def wait(self) -> int:
        _, status = os.waitpid(self.pid, 0)
        os.close(self._ready)
        return os.waitstatus_to_exitcode(status)


def _write_outcome(descriptor: int, message: StartupProgress | StartOutcome) -> None:
    if isinstance(message, StartupProgress):
        return
    os.write(descriptor, msgspec.json.encode(message) + b"\n")
    os.close(descriptor)


class SoakConnection:
    """A client that only remembers: what it sent, what was acknowledged, which records it saw."""

    def __init__(self, path: Path) -> None:
        self.sent: dict[int, Submit] = {}
        self.acknowledged: dict[int, Any] = {}
        self.seen: dict[int, dict[str, Any]] = {}
        self._rest = b""
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.connect(str(path))
        self._put(messages.AttachMessage(version=messages.VERSION, name="soak", role="node"))

    def send(self, task: Submit) -> None:
        number = len(self.sent) + 1
        task = msgspec.structs.replace(task, ref=f"{os.getpid()}-{id(self)}-{number}")
        self.sent[number] = task
        self._put(messages.SendMessage(id=number, message=task))

    def _put(self, message: Any) -> None:
        with suppress(OSError):  # it was killed already
            self._socket.sendall(msgspec.json.encode(message) + b"\n")

    def read(self, seconds: float) -> bool:
        """Take in what arrives within that time. False when the engine has gone."""
        if not select.select([self._socket], [], [], seconds)[0]:
            return True
        try:
            data = self._socket.recv(1 << 20)
        except OSError:
            return False
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            message = json.loads(line)
            if message["type"] == "reply":
                self.acknowledged[message["id"]] = message
            elif message["type"] == "records":
                for record in message["records"]:
                    self.seen[record["seq"]] = record
        return bool(data)

    def drain(self) -> None:
        """Whatever had reached this process before the engine was killed."""
        while self.read(0.0) and select.select([self._socket], [], [], 0.0)[0]:
            pass
        while self.read(0.2):
            pass
        self._socket.close()


def random_task(dice: random.Random, scenario: Scenario) -> Submit:
    acts, rules, topics = list(scenario.acts), list(scenario.rules), sorted(scenario.topics)
    match dice.choices(range(8), [5, 4, 6, 4, 2, 2, 1, 2])[0]:
        case 0:
            what = ("startCommunicationRobotAct", dice.choice(acts))
        case 1:
            what = ("startInteractionRule", dice.choice(rules))
        case 2:
            what = ("raiseEventTopic", "/" + dice.choice(topics))
        case 3:
            key = dice.choice(list(scenario.memory) or ["x"])
            what = ("assignValue", json.dumps({key: dice.choice([True, 0, 1.5, "ü\n", [1, {"a": None}]])}))
        case 4:
            what = ("stopCommunicationRobotAct", dice.choice(acts))
        case 5:
            what = ("stopInteractionRule", dice.choice(rules))
        case 6:
            what = ("stopAll", "")
        case _:
            what = ("releaseStop", "")
    calling = dice.choice(["", "", "None", "Blocking"]) if what[0] == "startCommunicationRobotAct" else ""
    return Submit(function=what[0], behavior=what[1], calling_type=calling)


class Soak:
    """One run."""

    def __init__(self, seed: int, scratch: Path) -> None:
        self.dice = random.Random(seed)
        self.scratch = scratch
        os.environ["RISE_SESSIONS"] = str(scratch / "sessions")
        os.environ["RISE_RUNTIME"] = str(scratch / "run")
        self.scenarios = {folder: load(folder).scenario for folder in SCENARIOS}
        self.counts: Counter[str] = Counter()

    def run(self, kills: int, seconds: float = float("inf")) -> None:
        until = time.monotonic() + seconds
        while self.counts["kills"] < kills and time.monotonic() < until:
            self.session()

    def session(self) -> None:
        """One session, killed and recovered until it is ended or left."""
        dice = self.dice
        folder = dice.choice(SCENARIOS)
        scenario = self.scenarios[folder]
        assert scenario is not None
        faults = tuple(dice.sample(["*=slow:3", "Speech=fail@2", "Speech=hang@1", "vanish@3-5"], dice.randint(0, 1)))
        order = SessionOptions(
            str(folder), seed=dice.randrange(1000), speed=30.0, faults=faults, socket_name="soak", unfinished="new"
        )
        self.counts["sessions"] += 1
        where: Path | None = None
        for _ in range(dice.randint(1, 8)):
            if where is not None:
                order = msgspec.structs.replace(order, unfinished=str(where))
            child = Child(order)
            if dice.random() < 0.15:  # while it starts, or recovers
                time.sleep(dice.random() * 0.03)
                child.kill()
                self.counts["kills"] += 1
                self.counts["killed while starting"] += 1
                if where is not None:
                    self.check(where, None)
                continue
            outcome = child.outcome()
            if isinstance(outcome, EngineRefused):
                child.wait()
                if any(said in " ".join(outcome.lines) for said in ("nothing happened in this session", "is empty")):
                    self.counts["nothing to recover"] += 1
                    return
                raise Mistake(f"an engine refused: {outcome}")
            self.counts["recoveries"] += where is not None
            where = Path(outcome.folder)
            connection = SoakConnection(self.scratch / "run" / "soak.sock")
            wanted, most = dice.randint(0, 40), dice.randint(1, 60)
            while len(connection.acknowledged) < wanted and len(connection.sent) < most:
                for _ in range(dice.randint(1, 5)):
                    connection.send(random_task(dice, scenario))
                if not connection.read(dice.random() * 0.01):
                    raise Mistake("the engine ended by itself")
            time.sleep(dice.random() * 0.004)
            if dice.random() < 0.1:
                code = child.end()
                connection.drain()
                if code not in (exit_status.OK, exit_status.STILL_RUNNING):  # an injected fault may hang
                    raise Mistake(f"the engine ended with {code} instead of 0")
                self.counts["ended in order"] += 1
                self.check(where, connection, ended=True)
                return
            child.kill()
            connection.drain()
            self.counts["kills"] += 1
            self.check(where, connection)

    def check(self, where: Path, connection: SoakConnection | None, *, ended: bool = False) -> None:
        """The journal reads, holds what was acknowledged and seen, and replays identically."""
        if (where / JOURNAL).stat().st_size == 0:  # killed before anything was durable: so nothing may have gone out
            if connection is not None:
                accepted = [reply for reply in connection.acknowledged.values() if reply["accepted"]]
                if accepted or connection.seen:  # what is refused at once waits for no disk
                    raise Mistake(f"{where}: {accepted or connection.seen} went out, and nothing was recorded")
            self.counts["killed before the first line"] += 1
            return
        contents = read_journal(where / JOURNAL)
        self.counts["torn"] += bool(contents.torn)
        if contents.damaged or contents.gaps:
            raise Mistake(f"{where}: damaged {contents.damaged} {contents.gaps}")
        if contents.ended is not ended:
            raise Mistake(f"{where}: ended is {contents.ended}")
        comparison = compare_replay(where)
        if not comparison.identical:
            raise Mistake(f"{where}: {comparison}")
        self.counts["inputs"] += comparison.inputs
        if connection is not None:
            self.compare_with(where, contents, connection)
        if ended:
            _one_ending_each(where, contents)

    def compare_with(self, where: Path, contents: Any, connection: SoakConnection) -> None:
        inputs = (found.input for _, _, found in contents.lines() if isinstance(found, InputLine))
        kept = {each.ref for each in inputs if isinstance(each, Submit)}
        for number, reply in connection.acknowledged.items():
            self.counts["acknowledged"] += 1
            if reply.get("accepted") and connection.sent[number].ref not in kept:
                raise Mistake(f"{where}: {connection.sent[number]} was acknowledged and is not in the journal")
        records = {record.seq: record for record in contents.read_records()}
        for seq, seen in connection.seen.items():
            self.counts["records seen"] += 1
            if seq not in records or msgspec.to_builtins(records[seq])["kind"] != seen["kind"]:
                raise Mistake(f"{where}: record {seq} was seen and is not in the journal: {seen}")


def _one_ending_each(where: Path, contents: Any) -> None:
    states: dict[str, list[str]] = {}
    for record in contents.read_records():
        if isinstance(record, ActionRecord):
            states.setdefault(f"{record.task}/{record.action}", []).append(record.status)
    for action, statuses in states.items():
        if sum(status in ENDINGS for status in statuses) != 1:
            raise Mistake(f"{where}: action {action} has {statuses}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=5_000)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--keep", action="store_true", help="keep the sessions' folders")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else random.SystemRandom().randrange(10**6)
    print(f"seed {seed}", flush=True)
    scratch = Path(tempfile.mkdtemp(prefix="soak-", dir="/tmp"))
    (scratch / "run").mkdir(0o700)
    began = time.monotonic()
    soak = Soak(seed, scratch)
    try:
        soak.run(options.kills)
    except Mistake as mistake:
        print(f"MISTAKE (seed {seed}, kept in {scratch}): {mistake}", flush=True)
        return 1
    finally:
        took = time.monotonic() - began
        print(", ".join(f"{name} {number}" for name, number in sorted(soak.counts.items())), f"in {took:.0f} s")
    if not options.keep:
        shutil.rmtree(scratch)
    return 0


if __name__ == "__main__":
    sys.exit(main())

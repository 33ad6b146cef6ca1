"""Plays a random study to the kernel and to the interpreter, and says where they differ first."""

from __future__ import annotations

import json
from random import Random
from typing import Any
from unittest.mock import patch

import msgspec

from rise_engine.kernel import Kernel
from rise_engine.kernel import rules as kernel_rules
from rise_engine.kernel import scheduler as kernel_scheduler
from rise_engine.kernel.commands import (
    CancelAction,
    CancelOpenGoals,
    CancelTimer,
    Command,
    ReleaseOpenGoals,
    SetTimer,
    StartAction,
    StopRobot,
)
from rise_engine.kernel.inputs import (
    ActionReport,
    AnyInput,
    CheckReport,
    ControlChanged,
    EstopReport,
    Note,
    OutcomeReport,
    RecordingReport,
    RobotChanged,
    SessionEnded,
    SessionRecovered,
    SessionStarted,
    StopReport,
    Submit,
    SyncMark,
    TimerElapsed,
)
from rise_engine.kernel.records import ENDINGS, AnyRecord, OpenGoal
from rise_engine.scenario.model import Scenario

from .interpreter import Interpreter
from .session import Row
from .studies import ACTS, ASSIGNMENTS, OWN, RULES, SETTING, Author

MOVES = 30
"""How many a study has."""


STARTS = (
    '{"rule": "R", "state": "s1"}',
    '{"rule": "R", "state": "s2", "enter": false}',
    '{"rule": "R", "state": "s3", "enter": false}',
    '{"rule": "R", "enter": false}',
    '{"rule": "R", "state": "nowhere"}',
    '{"rule": "R"',
    '{"rule": "R", "more": 1}',
)
KEPT = (
    '{"event": "/e0", "keep": "2s"}',
    '{"event": "e0", "keep": "500ms"}',
    '{"event": "/e0", "keep": "1min"}',
    '{"event": "/nothing", "keep": "1s"}',
    '{"event": "/e0"}',
    '{"event": "/e0", "keep": "soon"}',
)


REPORTS: tuple[AnyInput, ...] = (
    CheckReport(id="lights", text="on", result="skipped", value="dark", reason="day", source="wizard:w"),
    OutcomeReport(status="aborted", reason="fire", source="wizard:w"),
    RecordingReport(name="camera", status="stalled", path="/a", bytes=5, reason="full", source="node:c"),
    SyncMark(number=1, medium="sound", text="first", source="node:c"),
)


class Disagreement(AssertionError):
    """Kernel and interpreter put out different things."""


def from_kernel(record: AnyRecord) -> Row:
    """A record of the kernel as far as the text promises it."""
    row = msgspec.json.decode(msgspec.json.encode(record))
    del row["seq"], row["wall"]
    return promised(row)


def promised(row: Row) -> Row:
    """Without what the text leaves to the program: the words of reasons and remarks (but not whether there are any)."""
    row = dict(row)
    for name in ("reason", "error"):
        if name in row:
            row[name] = bool(row[name])
    if row["kind"] == "note":
        del row["text"]
    return row


def difference(study: int, skipped: frozenset[int] = frozenset(), moves: int = MOVES) -> str:
    """What kernel and interpreter do differently in one study, without some of its moves; empty: nothing."""
    play = Play(study)
    play.skipped = skipped
    try:
        play.run(moves)
    except Disagreement as found:
        return str(found)
    return ""


def shortest_difference(study: int) -> str:
    """The difference with as few moves as will show it."""
    skipped: frozenset[int] = frozenset()
    found = difference(study)
    for move in range(MOVES - 1, -1, -1) if found else ():
        shorter = difference(study, skipped | {move})
        if shorter:
            found, skipped = shorter, skipped | {move}
    left = MOVES - len(skipped)
    return f"{found}\n({left} of {MOVES} moves; again: python -m tests.reference --study {study})" if found else ""


class Play:
    """One study, played to both."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.random = Random(seed)
        self.scenario = self.study()
        self.kernel = Kernel(self.scenario, seed)
        self.interpreter = Interpreter(self.scenario, seed)
        self.t = 0.0
        self.goals: dict[str, None] = {}
        self.timers: dict[int, float] = {}
        self.inputs: list[Any] = []
        self.tasks = 0
        self.skipped: frozenset[int] = frozenset()
        """Moves that are left out."""
        self.seen: set[str] = set()
        """Kinds of records, with their status."""

    def study(self) -> Scenario:
        """What is played."""
        return Author(self.random).study()

    def run(self, moves: int = MOVES) -> None:
        """Play so many random moves; raises Disagreement.

        In nearly all studies who goes round in circles is stopped after 60 steps instead of 1,000: both sides count in
        the same way, and what follows is seen more often and sooner.
        """
        steps, in_vain, acts = (1000, 100, 1000) if self.seed % 50 == 0 else (60, 5, 8)
        with (
            patch.multiple(kernel_rules, STEP_LIMIT=steps, MAX_VAIN_SEARCHES=in_vain),
            patch.object(kernel_scheduler, "MAX_ACTS", acts),
        ):
            circles = self.interpreter.session.rules.circles
            circles.most_steps, circles.most_in_vain = steps, in_vain
            self.interpreter.session.scheduler.most_acts = acts
            self._run(moves)

    def _run(self, moves: int) -> None:
        self.do(self.start())
        if self.random.random() < 0.8:
            self.do(RobotChanged(status="connected"))
        for name in RULES[: self.random.randrange(4)]:
            self.submit("startInteractionRule", name)
        for number in range(moves):
            self.random = Random(f"{self.seed} {number}")  # each move is drawn by itself, so that any can be left out
            if number not in self.skipped:
                self.move()
        self.end()

    def end(self) -> None:
        """What comes after the moves."""
        self.do(SessionEnded(reason="over"))

    def start(self) -> SessionStarted:
        """What the session is told, sometimes of a study."""
        random = self.random
        values = {"k0": True, "k1": 7, "person.a": "x", "new": [1], "session": 3, "items": 0}
        memory = {key: value for key, value in values.items() if random.random() < 0.2}
        known = SessionStarted(participant="P1", condition="A", factors={"voice": "low"}, memory=memory)
        if random.random() < 0.5:
            return known
        part: dict[str, Any] = {"slot": random.choice([None, 4]), "run": 2, "attempt": 1, "purpose": "pilot"}
        return msgspec.structs.replace(known, study="s", study_hash="3f", **part)

    def do(self, input: AnyInput) -> None:
        """One input to both."""
        input = msgspec.structs.replace(input, t=self.t)
        self.inputs.append(input)
        records, commands = self.ask_kernel(input)
        if isinstance(input, TimerElapsed):
            rows, orders = self.interpreter.let_time_run_out(self.t)
        else:
            rows, orders = self.interpreter.take(input)
        self.compare("records", [from_kernel(record) for record in records], [promised(row) for row in rows])
        self.compare("commands", self.carry_out(commands), orders)
        self.compare("times that run", sorted(self.timers.values()), self.interpreter.due)
        for row in rows:
            self.seen.add(f"{row['kind']} {row['status']}" if row.get("status") else row["kind"])
            self.seen |= {row["kind"], str(row.get("trigger"))}
        for record in records:
            if record.__class__.__name__ == "ActionRecord" and record.status in ENDINGS:
                self.goals.pop(f"{record.task}/{record.action}", None)
            elif record.__class__.__name__ == "TaskRecord":
                self.tasks = max(self.tasks, record.id)

    def ask_kernel(self, input: AnyInput) -> tuple[list[AnyRecord], list[Command]]:
        """What the kernel puts out."""
        return self.kernel.handle(input)

    def compare(self, what: str, kernel: list[Any], text: list[Any]) -> None:
        if kernel == text:
            return
        at = next(
            (n for n, (one, other) in enumerate(zip(kernel, text, strict=False)) if one != other),
            min(len(kernel), len(text)),
        )
        shown = [f"study {self.seed}, input {len(self.inputs)}: {self.inputs[-1]}", f"{what} differ at {at}:"]
        shown += [f"    {row}" for row in kernel[max(0, at - 4) : at]]
        shown += [f"  kernel      {row}" for row in kernel[at : at + 3]]
        shown += [f"  interpreter {row}" for row in text[at : at + 3]]
        raise Disagreement("\n".join(shown))

    def carry_out(self, commands: list[Command]) -> list[tuple[Any, ...]]:
        """The commands to the robot; those about timers are carried out here."""
        orders: list[tuple[Any, ...]] = []
        for command in commands:
            match command:
                case StartAction():
                    self.goals[command.action] = None
                    orders.append(("start", command.action, command.type, command.parameters, command.expected))
                case CancelAction():
                    orders.append(("cancel", command.action))
                case CancelOpenGoals():
                    orders.append(("cancelOpenGoals", command.part))
                case ReleaseOpenGoals():
                    orders.append(("releaseOpenGoals", command.part))
                case StopRobot():
                    orders.append(("stop robot",))
                case SetTimer():
                    self.timers[command.timer] = command.at
                case CancelTimer():
                    del self.timers[command.timer]
        return orders

    # --- moves ---

    def submit(self, function: str, behavior: str = "", calling_type: str = "") -> None:
        random = self.random
        source = random.choice(["wizard:w", "wizard:w", "wizard:v", "ros:camera", "file"])
        pressed = round(self.t + random.choice([-0.3, 0.2]), 6) if random.random() < 0.3 else None
        ref = "x" if random.random() < 0.1 else None
        if not calling_type and random.random() < 0.03:
            calling_type = random.choice(["Blocking", "nonsense"])
        self.do(
            Submit(
                function=function, behavior=behavior, calling_type=calling_type, source=source, pressed=pressed, ref=ref
            )
        )

    def move(self) -> None:
        random, pick = self.random, self.random.choice
        task = str(random.randint(max(0, self.tasks - 12), self.tasks + 1))
        match random.choices(range(20), weights=[10, 6, 10, 7, 14, 3, 2, 2, 1, 2, 3, 3, 2, 2, 3, 2, 2, 14, 5, 2])[0]:
            case 0:
                kind = pick(["", "", "None", "Blocking", "Interrupt", "nonsense"])
                self.submit("startCommunicationRobotAct", pick([*ACTS, *ACTS, "Nobody"]), kind)
            case 1:
                if random.random() < 0.3:
                    self.submit("startInteractionRule", pick(STARTS).replace("R", pick(RULES)))
                else:
                    self.submit("startInteractionRule", pick([*RULES, *RULES, "Nobody"]))
            case 2 if random.random() < 0.3:
                self.submit("raiseEventTopic", pick(KEPT).replace("e0", pick(OWN)))
            case 2:
                self.submit("raiseEventTopic", pick(["/", ""]) + pick([*OWN, *OWN, "A0_end", "nothing"]))
            case 3:
                self.submit(
                    "assignValue",
                    pick([*ASSIGNMENTS, *SETTING, "x =", '{"k0": true, "k1": 3}', '{"person.a": 1, "person.b": 2}']),
                )
            case 4:
                self.report()
            case 5:
                self.submit("cancelTask", pick([task, task, "x"]))
            case 6:
                self.submit("moveTask", pick([f"{task} 0", f"{task} {random.randint(0, 3)}", "1"]))
            case 7:
                self.submit("stopAll")
                if pick([True, False, False]):
                    self.do(StopReport(confirmed=("x",), unconfirmed=pick([(), ("y",)])))
            case 8 if random.random() < 0.6:
                self.do(EstopReport(source=pick(["estop:/a", "estop:/b"]), pressed=pick([True, False])))
            case 8:
                self.do(StopReport(confirmed=("late",)))
            case 9:
                status = pick(["lost", "connected", "degraded"])
                open = pick(
                    [(), (), (OpenGoal("x/y", "1/a", "Speech", "it refused to stop", holds=pick([True, False])),)]
                )
                self.do(RobotChanged(status=status, detail=pick(["", "cable"]), open=open))
            case 10:
                self.submit("markCue", pick(["", "asks"]))
            case 11:
                self.submit("nextFiller")
            case 12:
                self.submit("undoCue")
            case 13:
                mark = pick(["wrong", "late", "early", "double", "none", "bad"])
                self.submit("markMistake", pick([f"{task} {mark}", f"{task} {mark}", task]))
            case 14:
                self.submit("say", pick(["Hello", "Please {wait}", "", " yes "]), pick(["", "Interrupt", "None"]))
            case 15:
                if pick([True, False, False]):
                    self.submit(pick(["cancelOpenGoals", "releaseOpenGoals"]), pick(["", "x/y", "x/z"]))
                answer = pick(["goOn", "goOn", "repeatAct", "stopRuleOfAct"])
                self.submit(answer, pick([task, task, pick(ACTS), "x"]))
            case 16:
                self.submit("stopCommunicationRobotAct", pick(ACTS))
            case 17:
                self.wait()
            case 18 if random.random() < 0.6:
                self.submit("stepBack", self.step_back())
            case 18:
                self.submit("stopInteractionRule", pick(RULES))
            case _:
                self.rarely()
        if self.kernel.stop.latched and random.random() < 0.5:
            self.submit("releaseStop", self.release())
        if self.kernel.core.waits_for_wizard and random.random() < 0.1:
            self.do(ControlChanged(status="taken", by="wizard:w", holder="wizard:w"))

    def release(self) -> str:
        """What is to become of the rules that a stop has ended; mostly of those that it has."""
        pick = self.random.choice
        if pick([True, False]):
            return ""
        names = [each.rule.name for each in self.interpreter.session.going_on.stopped] or ["R0"]
        words: dict[str, str | int] = {
            name: pick(["enter", "wait", "wait", "leave"]) for name in names if pick([True, True, False])
        }
        if pick([True, False]):  # the last stop, or one before it
            words["stop"] = self.kernel.stop.count - pick([0, 0, 0, 1])
        return pick([json.dumps(words)] * 8 + ['{"Nobody": "enter"}', '{"R0": "go"}', "x"])

    def step_back(self) -> str:
        """A rule, and perhaps what is taken back with the step."""
        pick = self.random.choice
        session = self.interpreter.session
        running = [run for run in session.rules.stack if len(session.going_on.pasts[run]) > 1]
        rule, keys = pick(RULES), ["k0"]
        if running and pick([True, True, True, False]):
            run = pick(running)
            before, now = session.going_on.pasts[run][-2][1], session.memory.values
            changed = [key for key in (*before, *now) if before.get(key) != now.get(key) and key != "session"]
            rule, keys = run.name, [key for key in dict.fromkeys(changed) if pick([True, False])]
        asked = {"rule": rule, "take_back": keys, "enter": pick([True, False]), "stop_acts": pick([True, False])}
        return pick([rule, json.dumps({"rule": rule}), json.dumps(asked), json.dumps(asked), "{"])

    def rarely(self) -> None:
        match self.random.randrange(8):
            case 0:
                self.do(Note(text="a remark", source="wizard:w"))
            case 1:
                self.do(ControlChanged(status="asked", by="wizard:v", holder="wizard:w"))
            case 2:
                self.submit("deleteValue", self.random.choice(["k0", "k1", "name", "person", "nothing", "session"]))
            case 3:
                self.submit(
                    "assignValue",
                    self.random.choice(["session.cue = true", "session = 1", "pause = '1s'", "pause = 0.2"]),
                )
            case 4 | 5:
                downtime, waits = self.random.choice([None, 3.5]), self.random.random() < 0.4
                self.do(SessionRecovered(reason="gone", downtime=downtime, waits_for_wizard=waits))
            case 6:
                self.do(self.random.choice(REPORTS))
            case _:
                self.submit("nonsense", "x")

    def report(self) -> None:
        goals = list(self.goals)
        goal = self.random.choice(goals) if goals else "1/0"
        if self.random.random() < 0.05:
            goal = self.random.choice(["x", f"{self.tasks}/0", "99/1"])
        status: Any = self.random.choice(
            ["accepted", "accepted", "succeeded", "succeeded", "succeeded", "failed", "canceled", "timed-out", "lost"]
        )
        aborted = status == "failed" and self.random.random() < 0.3
        self.do(ActionReport(action=goal, status=status, reason=self.random.choice(["", "why"]), aborted=aborted))

    def wait(self) -> None:
        """Let time pass; what is due on the way comes, now and then late, or not all of one moment."""
        pick = self.random.choice
        if self.timers and pick([True, False]):
            self.t = max(self.t, min(self.timers.values()))
            for _ in range(pick([0, 1, 1, 2])):
                if self.timers and min(self.timers.values()) <= self.t:
                    self.elapse()
            return
        self.pass_time(pick([0.05, 1.0, 2.0, 20.0]))

    def pass_time(self, seconds: float, most: int = 100) -> None:
        """Let so many seconds pass; what is due on the way comes in time, but at most so much of it."""
        until = round(self.t + seconds, 6)
        for _ in range(most):
            if not self.timers or min(self.timers.values()) > until:
                break
            self.t = max(self.t, min(self.timers.values()))
            self.elapse()
        self.t = until

    def elapse(self) -> None:
        timer, _ = min(self.timers.items(), key=lambda item: (item[1], item[0]))
        del self.timers[timer]
        self.do(TimerElapsed(timer=timer))

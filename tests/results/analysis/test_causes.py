"""Whose doing it is: the tables, beside a second reading of the record by the text of docs/reference/exports.md."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import msgspec
import pytest

from rise_engine.kernel.records import AnyRecord, TaskRecord, TimingRecord
from rise_engine.results.analysis.acts import ActCollector
from rise_engine.results.analysis.model import PlayedAct, actor_of
from rise_engine.scenario.reading.action_declarations import core_actions
from tests.chance import seeds
from tests.reference.comparison import Play

Row = dict[str, Any]
ENGINE_ACTIONS = {name for name, spec in core_actions().items() if spec.engine}
SAYS_ONLY = ("markMistake", "goOn", "repeatAct", "stopRuleOfAct")


class Reading:
    """What a record says of its acts and keys, by the text alone."""

    def __init__(self, rows: list[Row]) -> None:
        self.tasks: dict[int, Row] = {}
        self.timings: dict[int, Row] = {}
        self.cue_of: dict[int, float] = {}
        self.fillers: set[int] = set()
        self.marks: dict[int, str] = {}
        self.started: dict[int, float] = {}
        self.repeated: dict[int, int] = {}
        self.actions: dict[int, set[str]] = defaultdict(set)
        self.confirmed: dict[int, set[str]] = defaultdict(set)
        cues: list[float] = []
        for row in rows:
            match row["kind"]:
                case "task":
                    self.tasks.setdefault(row["id"], row)
                    if row["status"] == "ACTIVE":
                        self.started.setdefault(row["id"], row["t"])
                case "timing":
                    self.timings[row["task"]] = row
                case "cue" if row["status"] == "marked":
                    cues.append(row["t"] if row["key_at"] is None else row["key_at"])
                case "cue" if row["status"] in ("answered", "filled") and cues:
                    if row["status"] == "answered":
                        self.cue_of[row["task"]] = cues[-1]
                    else:
                        self.fillers.add(row["task"])
                        self.cue_of.setdefault(row["task"], cues[-1])
                case "mistake":
                    self.marks[row["task"]] = row["mark"]
                case "failure" if row["status"] == "repeated":
                    self.repeated[row["task"]] = row["by"]
                case "action":
                    which = self.confirmed if row["status"] in ("accepted", "succeeded") else self.actions
                    which[row["task"]].add(row["sent_as"] or row["type"])
        self.marks = {task: mark for task, mark in self.marks.items() if mark != "none"}
        self.acts = [id for id, row in self.tasks.items() if row["function"] in ("startCommunicationRobotAct", "say")]
        for task in [each for each in self.cue_of if each not in self.fillers]:
            answer = next((each for each in self.attempts(task) if self.is_heard(each)), task)
            self.cue_of[answer] = self.cue_of.pop(task)

    def attempts(self, task: int) -> list[int]:
        """A task and its repetitions, up to one that began to answer another cue."""
        again = self.repeated.get(task)
        return [task] if again is None or again in self.cue_of else [task, *self.attempts(again)]

    def is_heard(self, task: int) -> bool:
        """Whether the robot confirmed its voice or, if it does not speak, anything of it."""
        confirmed = self.confirmed[task] - ENGINE_ACTIONS
        return "Speech" in confirmed if "Speech" in self.actions[task] | confirmed else bool(confirmed)

    def chain(self, task: int) -> list[int]:
        """From what began it to the act."""
        chain = [task]
        while (cause := self.tasks[chain[0]]["cause"]) is not None:
            assert cause < chain[0]
            chain.insert(0, cause)
        return chain

    def is_wizards(self, task: int) -> bool:
        source: str = self.tasks[task]["source"]
        return source.startswith("wizard:") and source != "wizard:command-line"

    def by(self, task: int) -> str:
        first = self.tasks[self.chain(task)[0]]
        return f"rule:{first['via'][0]}" if first["via"] else str(first["source"])

    def via(self, task: int) -> list[str]:
        rules: list[str] = []
        first, *others = self.chain(task)
        if before := self.tasks[first]["via"]:
            rules += [*before[1:], self.tasks[first]["source"].removeprefix("rule:")]
        for each in others:
            rules += self.tasks[each]["via"]
            kind, _, name = self.tasks[each]["source"].partition(":")
            rules += [name] if kind == "rule" else []
        return [rule for at, rule in enumerate(rules) if rule not in rules[:at]]

    def key_at(self, task: int) -> float | None:
        chain = self.chain(task)
        if self.tasks[chain[0]]["function"] == "markCue":
            return None
        if self.tasks[chain[0]]["key_at"] is not None:
            return float(self.tasks[chain[0]]["key_at"])
        return self.tasks[chain[0]]["t"] if len(chain) > 1 and self.is_wizards(chain[0]) else None

    def keys(self) -> list[int]:
        return [
            id
            for id, row in self.tasks.items()
            if self.is_wizards(id)
            and row["status"] != "REJECTED"
            and row["function"] not in SAYS_ONLY
            and row["cause"] is None
        ]

    def mark(self, act: int) -> str | None:
        if act in self.marks:
            return self.marks[act]
        key = self.chain(act)[0]
        if key in self.acts or next(each for each in self.acts if self.chain(each)[0] == key) != act:
            return None
        return self.marks.get(key)

    def key_mark(self, key: int) -> str | None:
        about = [key, *(act for act in self.acts if self.chain(act)[0] == key)]
        return next((self.marks[each] for each in about if each in self.marks), None)

    def latencies(self, act: int) -> dict[str, float | None]:
        """The parts; those of the robot only of an act that has ended."""
        cue, key = self.cue_of.get(act), self.key_at(act)
        timing, task = self.timings.get(act), self.tasks[act]
        accepted = timing["accepted_at"] if timing is not None else task["t"]
        started = self.started.get(act)
        early = cue is not None and (accepted if key is None else key) < cue
        told: dict[str, float | None] = {"wizard_s": None, "way_s": None, "rules_s": None, "queue_s": None}
        if not early:
            told["wizard_s"] = minus(key, cue)
            chain = self.chain(act)
            taken = self.tasks[chain[0]]["t"]
            told["way_s"] = minus(taken, key) if key is not None else None
            told["rules_s"] = minus(accepted, cue if key is None else taken)
        told["queue_s"] = minus(started, cue if early else accepted)
        if timing is not None:
            told["robot_s"] = minus(timing["robot_at"], started)
            told["voice_s"] = minus(timing["voice_at"], timing["robot_at"])
        return {**told, "before_cue": early}


def minus(later: float | None, earlier: float | None) -> float | None:
    return None if later is None or earlier is None else round(later - earlier, 6)


def tell(act: PlayedAct) -> Row:
    return {
        "by": act.by,
        "via": list(act.via),
        "key_at": act.key_at,
        "mark": act.mark,
        "filler": act.filler,
        "wizard_s": act.wizard_s,
        "way_s": act.way_s,
        "rules_s": act.rules_s,
        "queue_s": act.queue_s,
        "before_cue": act.before_cue,
    }


def compare(records: list[AnyRecord]) -> tuple[int, int]:
    """Assert that both readings agree; how many acts there are, and how many of them wizards caused through rules."""
    collector = ActCollector(None)
    for record in records:
        collector.add(record)
    told, keys = collector.acts(), collector.keys()
    text = Reading([msgspec.to_builtins(record) for record in records])
    assert {act.task for act in told} == set(text.acts)
    for act in told:
        expected = {
            "by": text.by(act.task),
            "via": text.via(act.task),
            "key_at": text.key_at(act.task),
            "mark": text.mark(act.task),
            "filler": act.task in text.fillers,
            **text.latencies(act.task),
        }
        of_robot = {"robot_s": act.robot_s, "voice_s": act.voice_s} if act.task in text.timings else {}
        assert tell(act) | of_robot == expected, act
    assert [(key.task, key.mark) for key in keys] == [(key, text.key_mark(key)) for key in sorted(text.keys())]
    through = sum(actor_of(act.source) == "rule" and act.actor == "wizard" for act in told)
    return len(told), through


def records_of(study: int) -> list[AnyRecord]:
    """A random session of a random study, as the kernel records it."""
    play, records = Play(study), list[AnyRecord]()
    handle = play.kernel.handle

    def keep(input: Any) -> Any:
        found = handle(input)
        records.extend(found[0])
        return found

    play.kernel.handle = keep  # type: ignore[method-assign]
    play.run()
    return records


@pytest.mark.search
def test_random_sessions_are_read_as_the_text_says() -> None:
    acts = through = 0
    for study in seeds(120):
        found = compare(records_of(study))
        acts, through = acts + found[0], through + found[1]
    assert acts > 1000 and through > 100


# --- by hand ----------------------------------------------------------------------------------------------------------


def task(id: int, t: float, behavior: str = "A", source: str = "wizard:anna", **more: Any) -> TaskRecord:
    function = more.pop("function", "startCommunicationRobotAct")
    return TaskRecord(id, t, "", id, function, behavior, "Blocking", source, "SUCCEEDED", **more)


def timing(id: int, key_at: float | None) -> TimingRecord:
    return TimingRecord(90 + id, 9.0, "", id, "A", "SUCCEEDED", None, key_at, 1.0, 1.0, 1.1, 2.0)


@pytest.mark.parametrize(
    ("records", "by", "via", "key_at"),
    [
        ([task(9, 1.0)], "wizard:anna", (), None),
        ([task(9, 1.0), timing(9, 0.9)], "wizard:anna", (), 0.9),
        ([task(9, 1.0, source="rule:R")], "rule:R", (), None),
        ([task(9, 1.0, source="rule:R", via=("P", "Q"))], "rule:P", ("Q", "R"), None),
        (
            [task(1, 1.0, "/x", function="raiseEventTopic"), task(9, 1.0, source="rule:R", cause=1, via=("Q",))],
            *("wizard:anna", ("Q", "R"), 1.0),
        ),
        (
            [
                task(1, 1.0, "/x", function="raiseEventTopic", key_at=0.95),
                task(2, 1.0, source="rule:R", cause=1),
                timing(2, 0.95),
                task(9, 4.0, source="rule:R", cause=2),
            ],
            *("wizard:anna", ("R",), 0.95),
        ),
        (
            [task(1, 1.0, "", function="markCue"), task(9, 1.0, source="rule:R", cause=1), timing(9, 0.95)],
            *("wizard:anna", ("R",), None),
        ),
        (
            [task(1, 1.0, "/x", "ros:/eye", function="raiseEventTopic"), task(9, 1.0, source="rule:R", cause=1)],
            *("ros:/eye", ("R",), None),
        ),
        ([task(9, 1.0, source="rule:R", cause=17)], "rule:R", (), None),  # what led to it cannot be read
    ],
)
def test_the_way_back(records: list[AnyRecord], by: str, via: tuple[str, ...], key_at: float | None) -> None:
    collector = ActCollector(None)
    for record in records:
        collector.add(record)
    act = next(each for each in collector.acts() if each.task == 9)
    assert (act.by, act.via, act.key_at) == (by, via, key_at)

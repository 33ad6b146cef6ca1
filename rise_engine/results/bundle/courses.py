"""Compares two courses of a session, as recorded and with another robot, and describes the differences.

The requests of people and programs are the same in both, at the same times. The reactions of rules and the actions of
the robot may differ.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from statistics import median

from msgspec import Struct, field
from msgspec.structs import replace

from rise_engine.kernel.inputs import (
    ActionReport,
    AnyInput,
    RobotChanged,
    SessionEnded,
    SessionRecovered,
    SessionStarted,
    StopReport,
    Submit,
    TimerElapsed,
)
from rise_engine.kernel.records import ENGINE, AnyRecord, SessionRecord, TaskRecord
from rise_engine.results.analysis.acts import ActCollector
from rise_engine.results.analysis.course import PhaseCollector
from rise_engine.results.analysis.model import Phase, PlayedAct
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_format import InputLine
from rise_engine.session.journal_reader import read_journal

_ROBOT_INPUTS = (ActionReport, TimerElapsed, RobotChanged, StopReport, SessionRecovered)
"""Inputs that come from the robot and its timing, which another robot replaces."""
_NAMES_TASK = frozenset({"cancelTask", "moveTask", "markMistake", "goOn", "repeatAct", "stopRuleOfAct"})
"""Functions whose behaviour begins with the number of a task."""
NOTICEABLE_SECONDS = 0.1
"""Minimum difference in seconds of an act's duration that is reported."""
TaskName = tuple[str, str, str, int]
"""Source, function, behaviour and a running number: identifies a task whatever its number."""


class RecordedSession(Struct):
    """The part of a session that is repeated with another robot, and its original course."""

    started: SessionStarted
    inputs: list[AnyInput]
    """The inputs of people and programs in their order, at the times `t`."""
    end: float
    """The time of its end."""
    records: list[AnyRecord]
    seed: int = 0


class TaskNames:
    """A table that identifies the tasks of a session by their content instead of their numbers."""

    def __init__(self) -> None:
        self._names: dict[int, TaskName] = {}
        self._ids: dict[TaskName, int] = {}
        self._counts: dict[tuple[str, str, str], int] = {}

    def add(self, record: AnyRecord) -> None:
        if isinstance(record, TaskRecord) and record.id not in self._names:
            what = (record.source, record.function, record.behavior)
            self._counts[what] = self._counts.get(what, 0) + 1
            name = (*what, self._counts[what])
            self._names[record.id] = name
            self._ids[name] = record.id

    def translate(self, task: Submit, there: TaskNames) -> Submit:
        """Adapt a task that names another task, which may have another number in the other course.

        :param there: the tasks of the other course.
        """
        number, blank, rest = task.behavior.partition(" ")
        if task.function not in _NAMES_TASK or not number.isdigit():
            return task
        name = self._names.get(int(number))
        found = there._ids.get(name) if name is not None else None
        return task if found is None else replace(task, behavior=f"{found}{blank}{rest}")


class CourseComparison(Struct):
    """The differences between two courses of a session."""

    acts: int = 0
    """The number of recorded acts that ended before the session did, with both robots."""
    same: int = 0
    """The number of acts with the same end."""
    acts_differ: list[str] = field(default_factory=list)
    rules_differ: list[str] = field(default_factory=list)
    rules_same: list[str] = field(default_factory=list)
    """Rules with the same states."""
    longer: list[float] = field(default_factory=list)
    """The additional seconds of each act with the same end, without differences below NOTICEABLE_SECONDS."""

    @property
    def identical(self) -> bool:
        """Whether all acts had the same end and all rules the same states. Times may differ."""
        return not self.acts_differ and not self.rules_differ

    @property
    def median_longer(self) -> float:
        """Seconds. 0: no act took noticeably longer or shorter."""
        return round(median(self.longer), 3) if self.longer else 0.0


def read_recorded(folder: Path, seed: int) -> RecordedSession:
    """Read the part of a session that can be repeated. Raises SessionError."""
    contents = read_journal(folder / JOURNAL)
    recorded = RecordedSession(SessionStarted(), [], contents.seconds, [], seed)
    for _, _, line in contents.lines():
        if not isinstance(line, InputLine):
            continue
        if isinstance(line.input, SessionStarted):
            recorded.started = line.input
        elif isinstance(line.input, SessionEnded):
            recorded.end = line.input.t
        elif not isinstance(line.input, _ROBOT_INPUTS):
            recorded.inputs.append(line.input)
    recorded.records = list(contents.read_records())
    return recorded


def compare_courses(
    before: Iterable[AnyRecord], after: Iterable[AnyRecord], scenario: Scenario, other: Scenario
) -> CourseComparison:
    """Compare two courses.

    :param before: the records of the session.
    :param after: the records with the other robot.
    :param scenario: the session's scenario, with its robot.
    :param other: the same scenario with the other robot.
    """
    old_acts, old_phases = _course(before, scenario)
    new_acts, new_phases = _course(after, other)
    comparison = CourseComparison()
    played = dict(_numbered(new_acts))
    for key, act in _numbered(old_acts):
        found = played.pop(key, None)
        if _is_running(act) or (found is not None and _is_running(found)):
            continue  # the session ended while it ran
        comparison.acts += 1
        difference = "was not played" if found is None else _difference(act, found)
        if found is None or difference:
            comparison.acts_differ.append(f"{_act_name(key)}, at {act.accepted_at:.1f} s: {difference}")
            continue
        comparison.same += 1
        longer = _length(found) - _length(act)
        if abs(longer) >= NOTICEABLE_SECONDS:
            comparison.longer.append(round(longer, 3))
    for key, act in played.items():
        if _is_running(act):
            continue
        comparison.acts_differ.append(f"{_act_name(key)}, at {act.accepted_at:.1f} s: was not played before")
    for rule in sorted({*old_phases, *new_phases}):
        difference = _phase_difference(old_phases.get(rule, []), new_phases.get(rule, []))
        if difference:
            comparison.rules_differ.append(f"{rule}: {difference}")
        else:
            comparison.rules_same.append(rule)
    return comparison


def _course(records: Iterable[AnyRecord], scenario: Scenario) -> tuple[tuple[PlayedAct, ...], dict[str, list[Phase]]]:
    acts, phases = ActCollector(scenario), PhaseCollector()
    end = 0.0
    for record in records:
        if _is_end(record):
            break
        acts.add(record)
        phases.add(record)
        end = record.t
    by_rule: dict[str, list[Phase]] = {}
    for phase in phases.phases(end):
        by_rule.setdefault(phase.rule, []).append(phase)
    return acts.acts(), by_rule


def _is_end(record: AnyRecord) -> bool:
    """Whether the session ends here. The engine stops the robot first, so ends of acts after this have no meaning."""
    if isinstance(record, TaskRecord):
        return record.function == "stopAll" and record.source == ENGINE
    return isinstance(record, SessionRecord) and record.status == "ended"


def _is_running(act: PlayedAct) -> bool:
    return act.ended_at is None and act.status != "REJECTED"


def _numbered(acts: Iterable[PlayedAct]) -> Iterator[tuple[tuple[str, str, int], PlayedAct]]:
    """Give each act with its name, its source and its running number among equal ones."""
    counts: dict[tuple[str, str], int] = {}
    for act in acts:
        what = (act.act, act.source)
        counts[what] = counts.get(what, 0) + 1
        yield (*what, counts[what]), act


def _act_name(key: tuple[str, str, int]) -> str:
    act, source, number = key
    return f"{act} of {source}" + (f" (number {number})" if number > 1 else "")


def _difference(before: PlayedAct, after: PlayedAct) -> str:
    if before.status != after.status:
        return f"{after.status}, not {before.status}" + (f" ({after.reason})" if after.reason else "")
    new = {part.action: part for part in after.parts}
    for part in before.parts:
        found = new.get(part.action)
        if found is None:
            return f"its action {part.action} ({part.type}) was not done"
        if found.type != part.type:
            return f"its action {part.action} was {found.type}, not {part.type}"
        if found.status != part.status:
            return f"its action {part.action} ({part.type}) {found.status}, not {part.status}"
    if further := [part.action for part in after.parts if part.action not in {each.action for each in before.parts}]:
        return f"its action {further[0]} was not done before"
    return ""


def _length(act: PlayedAct) -> float:
    if act.started_at is None or act.ended_at is None:
        return 0.0
    return act.ended_at - act.started_at


def _phase_difference(before: list[Phase], after: list[Phase]) -> str:
    """Return where a rule first enters a different state, as a sentence, or an empty text."""
    for number in range(max(len(before), len(after))):
        old = before[number] if number < len(before) else None
        new = after[number] if number < len(after) else None
        if old is None and new is not None:
            return f"comes into {new.state} at {new.start:.1f} s, and did not before"
        if new is None and old is not None:
            return f"does not come into {old.state}, as it did at {old.start:.1f} s"
        if old is not None and new is not None and old.state != new.state:
            return f"comes into {new.state} at {new.start:.1f} s, not into {old.state} at {old.start:.1f} s"
    return ""

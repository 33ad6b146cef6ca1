"""Random days: sessions begin, are killed between any two writes, go on, are given up and judged; people are excluded
and withdraw.

The real preparation runs in this process; a kill is an exception that nothing but this test catches, raised before,
within or after a write. What must hold is worked out from the files alone (`invariants.check_day`), and how everybody
stands is compared with a model of a few lines.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from rise_engine.base.errors import StudyError
from rise_engine.base.files import Disk
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import AnyInput, OutcomeReport, SessionEnded, SessionRecovered
from rise_engine.kernel.records import OutcomeStatus
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server import preparation, study_session
from rise_engine.run.server.preparation import ServeRefused, SessionPreparation
from rise_engine.session import folder as folders
from rise_engine.session.journal import Journal
from rise_engine.session.journal_format import encode_header, encode_input, encode_record, join_step
from rise_engine.study import judge, state, study_log
from rise_engine.study.judge import exclude_participant, judge_session
from rise_engine.study.state import OpenStudy, read_state
from rise_engine.study.withdrawal import withdraw
from tests.chance import examples

from .invariants import check_day
from .studies import HEAD, write_study

NAMES = [f"P{number:02}" for number in range(1, 5)]
PEOPLE = HEAD + "".join(f"{name},2026-11-01,,\n" for name in NAMES)
OUTCOMES: list[OutcomeStatus] = ["complete", "complete", "aborted", "excluded"]
PHASES = [Phase.explicit, Phase.reuse, Phase.generate]
"""Without making a day that failed shorter: that would take many minutes, and a day is read from its first step on."""
KILLS = st.one_of(st.none(), st.integers(0, 15))
"""After how many steps of writing a program is killed; None: not at all."""


class Killed(BaseException):
    """The program is gone, here and now."""


class Killer:
    """Lets what writes be killed, at a step that is chosen."""

    def __init__(self) -> None:
        self.left: int | None = None
        self.patch = pytest.MonkeyPatch()
        self._wrap(folders, "_make_folder")
        self._wrap(folders, "write_info")
        for module in (study_session, judge, state):
            self._wrap(module, "mark_abandoned")
        self._wrap(study_log.LockedLog, "append")
        self._wrap(study_log.LockedLog, "rewrite")
        self.patch.setattr(preparation, "Journal", self._journal)

        class TornDisk(Disk):
            def write(disk, descriptor: int, data: bytes, offset: int) -> None:  # noqa: N805
                half = len(data) // 2
                super().write(descriptor, data[:half], offset)
                self.step()
                super().write(descriptor, data[half:], offset + half)

        self.patch.setattr(study_log, "Disk", TornDisk)

    def step(self) -> None:
        if self.left is not None:
            self.left -= 1
            if self.left < 0:
                raise Killed

    def _wrap(self, where: Any, name: str) -> None:
        before: Callable[..., Any] = getattr(where, name)

        def wrapped(*arguments: Any, **named: Any) -> Any:
            self.step()
            result = before(*arguments, **named)
            self.step()
            return result

        self.patch.setattr(where, name, wrapped)

    def _journal(self, *arguments: Any, **named: Any) -> Journal:
        self.step()
        journal = Journal(*arguments, **named)
        try:
            self.step()
        except Killed:
            journal.close()
            raise
        return journal


class Person:
    """What the model knows of a participant."""

    def __init__(self) -> None:
        self.outcomes: dict[int, list[str]] = {1: [], 2: []}
        """Of each run, its judged sessions."""
        self.open = ""
        """running, unfinished or to-judge: the session that is not judged."""
        self.run = 0
        """Of the open session."""
        self.excluded = False
        self.withdrawn = False

    @property
    def is_out(self) -> bool:
        return self.excluded or self.withdrawn

    @property
    def next_run(self) -> int | None:
        return next((run for run, outcomes in self.outcomes.items() if "complete" not in outcomes), None)

    @property
    def state(self) -> str:
        if self.withdrawn:
            return "withdrawn"
        if self.excluded:
            return "excluded"
        if self.open:
            return self.open
        if self.next_run is None:
            return "complete"
        last = [outcomes[-1] for outcomes in self.outcomes.values() if outcomes]
        return "waiting" if not last else "aborted" if last[-1] == "aborted" else "to-go-on"

    def judge(self, status: str) -> None:
        self.outcomes[self.run].append(status)
        self.open = ""
        self.excluded = self.excluded or status == "excluded"


class RunningSession:
    """An engine without a loop: its inputs go through a kernel and into the journal."""

    def __init__(self, prepared: SessionPreparation, journal: Journal) -> None:
        self.prepared, self.journal = prepared, journal
        self.inputs = 0
        recovered = prepared.recovered
        if recovered is None:
            journal.append(encode_header("rise-tui test"))
            self.kernel = Kernel(prepared.scenario, prepared.seed)
            self.take(prepared.started)
        else:
            if recovered.unwritten_lines:
                journal.append(recovered.unwritten_lines)
            self.kernel, self.inputs = recovered.kernel, recovered.inputs
            self.take(SessionRecovered(reason="its engine had gone"))

    def take(self, input: AnyInput) -> None:
        self.inputs += 1
        records, _ = self.kernel.handle(input)
        self.journal.append(join_step(encode_input(self.inputs, input), map(encode_record, records)))

    def close(self) -> None:
        self.journal.close()
        self.prepared.close()


class StudyDay(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.root = Path(tempfile.mkdtemp(prefix="day-", dir="/tmp"))
        self.folder = self.root / "study"
        self.before = {name: os.environ.get(name) for name in ("RISE_RUNTIME", "RISE_SESSIONS")}
        os.environ["RISE_RUNTIME"], os.environ["RISE_SESSIONS"] = str(self.root / "run"), str(self.root / "other")
        self.killer = Killer()
        self.people = {name: Person() for name in NAMES}
        self.running: RunningSession | None = None
        self.who = ""

    @initialize()
    def plan(self) -> None:
        write_study(self.folder, people=PEOPLE)

    def teardown(self) -> None:
        if self.running is not None:
            self.running.close()
        self.killer.patch.undo()
        for name, value in self.before.items():
            os.environ.pop(name) if value is None else os.environ.__setitem__(name, value)
        shutil.rmtree(self.root)

    # --- what happens on a day ---

    @precondition(lambda self: self.running is None)
    @rule(which=st.integers(0, 100), how=st.sampled_from(["ask", "new", "recover"]), kill=KILLS)
    def begin(self, which: int, how: str, kill: int | None) -> None:
        # Mostly somebody who is already in the middle of the study, sometimes anybody.
        begun = [name for name, person in self.people.items() if person.state in ("unfinished", "to-go-on", "aborted")]
        name = (begun or NAMES)[which % len(begun or NAMES)] if which < 80 else NAMES[which % len(NAMES)]
        person = self.people[name]
        before = person.state
        options = SessionOptions("", study=str(self.folder), participant=name, unfinished=how)
        recovers = before == "unfinished" and how == "recover"
        possible = before in ("waiting", "to-go-on", "aborted") or (before == "unfinished" and how != "ask")
        gives_up = before == "unfinished" and how == "new"
        prepared: SessionPreparation | None = None
        self.killer.left = kill
        try:
            prepared = SessionPreparation(options, lambda message: None)
            journal = prepared.open_journal(lambda: None, lambda: 0.0)
        except ServeRefused:
            assert not possible
            return
        except Killed:
            if prepared is not None:
                prepared.close()
            if gives_up and not self._is_open(name):
                person.judge("aborted")
            return
        finally:
            self.killer.left = None
        assert possible
        if gives_up:
            person.judge("aborted")
        if not recovers:
            person.run = person.next_run or 0
        assert (prepared.recovered is not None) == recovers
        assert recovers or prepared.started.run == person.run
        person.open, self.who = "running", name
        self.running = RunningSession(prepared, journal)

    def _is_open(self, name: str) -> bool:
        """Whether somebody has a session that nobody has judged."""
        sessions = [each.entry for each in read_state(self.folder).sessions if each.entry.participant == name]
        return any(each.outcome is None for each in sessions)

    @precondition(lambda self: self.running is not None)
    @rule(status=st.one_of(st.none(), st.sampled_from(OUTCOMES)))
    def kill_engine(self, status: OutcomeStatus | None) -> None:
        assert self.running is not None
        if status is not None:  # it was killed between the outcome and the end
            self.running.take(OutcomeReport(status=status, reason="so it was", source="wizard:anna"))
        self.running.close()
        self.running, self.people[self.who].open = None, "unfinished"
        if status is not None:
            self.people[self.who].judge(status)

    @precondition(lambda self: self.running is not None)
    @rule(status=st.one_of(st.none(), st.sampled_from(OUTCOMES)), kill=KILLS)
    def end(self, status: OutcomeStatus | None, kill: int | None) -> None:
        assert self.running is not None
        running, person = self.running, self.people[self.who]
        if status is not None:
            running.take(OutcomeReport(status=status, reason="so it was", source="wizard:anna"))
        running.take(SessionEnded(reason="done"))
        running.close()
        self.running = None
        self.killer.left = kill
        with suppress(Killed):
            assert running.prepared.study is not None
            running.prepared.study.note_ended()
        self.killer.left = None
        person.open = "to-judge"
        if status is not None:
            person.judge(status)

    @rule(name=st.sampled_from(NAMES), status=st.sampled_from(OUTCOMES), kill=KILLS)
    def judge(self, name: str, status: OutcomeStatus, kill: int | None) -> None:
        person = self.people[name]
        if person.open not in ("unfinished", "to-judge") or person.withdrawn:
            return  # corrections are a matter of test_judge
        self.killer.left = kill
        try:
            with OpenStudy(self.folder) as open:
                judge_session(open, name, status, "said afterwards")
            written = True
        except Killed:
            self.killer.left = None
            written = not self._is_open(name)
        finally:
            self.killer.left = None
        if written:
            person.judge(status)

    @precondition(lambda self: sum(person.is_out for person in self.people.values()) < 2)
    @rule(name=st.sampled_from(NAMES), kill=KILLS)
    def exclude(self, name: str, kill: int | None) -> None:
        person = self.people[name]
        self.killer.left = kill
        try:
            with OpenStudy(self.folder) as open:
                exclude_participant(open, name, "did not fit")
            person.excluded = True
        except StudyError:
            assert person.is_out or person.open == "running"
        except Killed:
            self.killer.left = None
            person.excluded = person.excluded or read_state(self.folder).state_of(name) == "excluded"
        finally:
            self.killer.left = None

    @precondition(lambda self: sum(person.is_out for person in self.people.values()) < 2)
    @rule(name=st.sampled_from(NAMES), kill=KILLS)
    def withdraw(self, name: str, kill: int | None) -> None:
        person = self.people[name]
        self.killer.left = kill
        try:
            withdraw(self.folder, name)
        except StudyError:
            assert person.open == "running"
            return
        except Killed:
            self.killer.left = None
            withdraw(self.folder, name)  # as somebody does who was interrupted
        finally:
            self.killer.left = None
        person.withdrawn = True

    # --- what always holds ---

    @invariant()
    def holds(self) -> None:
        if not (self.folder / "plan.csv").exists():
            return
        check_day(self.folder)
        standing = read_state(self.folder).standing
        assert {each.participant: each.state for each in standing.participants} == {
            name: person.state for name, person in self.people.items()
        }
        held = [each.slot for each in standing.participants if each.slot is not None]
        assert len(held) == len(set(held))


StudyDay.TestCase.settings = settings(max_examples=examples(25), stateful_step_count=20, phases=PHASES)
test_random_days = pytest.mark.slow(StudyDay.TestCase)

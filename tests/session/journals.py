"""Sessions on disk, made without an engine: a kernel is driven by hand, and what went in and out is written down."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from rise_engine.kernel.inputs import ActionReport, AnyInput, Note, SessionEnded, SessionStarted, TimerElapsed
from rise_engine.kernel.records import AnyRecord
from rise_engine.kernel.view import SessionView
from rise_engine.scenario.loader import load
from rise_engine.session import folder as folders
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_format import encode_header, encode_input, encode_record, with_checksum
from rise_engine.session.recovery import RecoveredSession
from tests.kernel.harness import Session, dialog, gaze, pause, speech, write

ACTS = (
    dialog("Greet", speech(1, "Hello, {name|stranger}!"), gaze(2, "1"), speech(3, "How are you?", "1"))
    + dialog("Wait", pause(1, 500))
    + dialog("Late", speech(1, "At last"))
)
RULES = """<InteractionRule name="Table" initial="Idle">
  <State id="Idle"><transition eventTopic="/go" cond="count &lt; 5 and not nobody" target="Busy"/></State>
  <State id="Busy"><onEntry><function assignValue="count = count + 1"/>
      <function startCommunicationRobotAct="Wait"/></onEntry>
    <transition after="10s" target="Idle"/></State>
</InteractionRule>"""
MEMORY = {"name": "Anna", "count": 0, "list": [1, {"deep": None}]}
TOML = 'title = "Sample study"\n'


class Recording(Session):
    """Drives a kernel and keeps the steps."""

    def __init__(self, scenario: Any, seed: int = 7, started: SessionStarted | None = None) -> None:
        self.steps: list[tuple[AnyInput, list[AnyRecord]]] = []
        super().__init__(scenario, seed, started=started)

    def do(self, input: AnyInput) -> list[AnyRecord]:
        records = super().do(input)
        for record in records:
            record.wall = f"2026-11-21T14:{int(self.t) // 60:02}:{self.t % 60:06.3f}+01:00"
        self.steps.append((replace(input, t=self.t), records))
        return records


def play(session: Recording) -> None:
    """Something of everything, up to the middle of it."""
    session.rule("Table")
    session.act("Greet")
    session.wait(0.25)
    session.report("2/1", "accepted")
    session.report("2/1")
    session.report("2/2", "failed", "the neck is stuck")
    session.event("/go")
    session.assign('name = "Özge; \\"line\\", 1"')
    session.do(Note(text='first line\nsecond, "line"\r\n=1+1', source="wizard:w"))
    session.do(ActionReport(action="nothing/1", status="succeeded"))  # an input without a record
    session.wait(12.5)
    session.act("Late")
    session.event("/go")


class Made:
    """A session's folder."""

    def __init__(
        self, root: Path, *, ended: bool = False, toml: str = TOML, started: SessionStarted | None = None
    ) -> None:
        study = write(root / "study", acts=ACTS, rules=RULES, memory=MEMORY, toml=toml)
        self.study = study
        loaded = load(study)
        assert loaded.scenario is not None, loaded.diagnostics
        self.scenario = loaded.scenario
        self.session = Recording(self.scenario, started=started)
        play(self.session)
        if ended:
            self.session.submit("stopAll")
            self.session.confirm_stop("body")
            self.session.do(SessionEnded(reason="over"))
        self.folder = folders.create_session(
            root / "sessions",
            self.scenario,
            loaded.files,
            seed=7,
            faults=(),
            begun=started,
            versions={"rise-tui": "0.2.0", "python": "3.11"},
        )
        self.journal = self.folder / JOURNAL
        self.write_session()

    def write_session(self) -> None:
        """The journal of everything that has happened."""
        self.lines = [encode_header("rise-tui 0.2.0")]
        self.step_lines: list[int] = []
        """Index in `lines` of each input."""
        for n, (fact, records) in enumerate(self.session.steps, 1):
            self.step_lines.append(len(self.lines))
            self.lines += [encode_input(n, fact), *(with_checksum(encode_record(record)) for record in records)]
        self.whole = b"".join(self.lines)
        self.write(self.whole)

    def write(self, data: bytes) -> None:
        self.journal.write_bytes(data)

    @property
    def records(self) -> list[AnyRecord]:
        return self.session.records

    def replayed(self, steps: int) -> Session:
        """The session as it was after so many steps, in memory only."""
        session = Session(self.scenario, 7)
        for fact, _ in self.session.steps[1:steps]:
            session.t = fact.t
            if isinstance(fact, TimerElapsed):
                session.timers.pop(fact.timer, None)
            session.do(fact)
        return session


def kept(made: Made) -> dict[str, bytes]:
    """What a repair has put beside the journal."""
    return {
        path.name: path.read_bytes()
        for path in sorted(made.folder.iterdir())
        if path.name.startswith(("journal.torn", "journal.damaged", "journal.jsonl."))
    }


def clean(made: Made) -> None:
    for name in kept(made):
        (made.folder / name).unlink()


def unlabelled(journal: bytes) -> list[bytes]:
    """Inputs, then records (a record that stands before its input is right too), without what nobody can make again:
    `wall`, and the check sum of that."""
    lines = re.sub(rb'"wall":"[^"]*"|"crc":"[^"]*"', b"", journal).splitlines()
    return sorted(lines, key=lambda line: line.startswith(b'{"kind"'))


def step_of(made: Made, index: int) -> int:
    """The number of the step that line `index` (from 0) belongs to."""
    return sum(start <= index for start in made.step_lines)


def assert_is(made: Made, found: RecoveredSession, steps: int) -> None:
    """`found` is the session as it was after so many steps, and its journal with `lines` is what was written then."""
    fresh = made.replayed(steps)
    assert found.inputs == steps
    assert found.kernel.snapshot() == fresh.kernel.snapshot()
    assert found.timers == fresh.timers
    view = SessionView()
    for _, records in made.session.steps[:steps]:
        for record in records:
            view.apply(record)
    assert found.view.session is not None and view.session is not None
    assert replace(found.view, session=replace(found.view.session, wall=view.session.wall)) == view
    end = made.step_lines[steps] if steps < len(made.step_lines) else len(made.lines)
    assert found.size == made.journal.stat().st_size
    assert unlabelled(made.journal.read_bytes() + found.unwritten_lines) == unlabelled(b"".join(made.lines[:end]))

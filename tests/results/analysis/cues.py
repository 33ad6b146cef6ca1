"""Sessions with cues, on disk, made without an engine: who did what and when is written down in a few words."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import (
    ActionReport,
    ControlChanged,
    Note,
    OutcomeReport,
    SessionEnded,
    SessionStarted,
    Submit,
    SyncMark,
)
from rise_engine.kernel.records import CueRecord, TaskRecord
from rise_engine.scenario.loader import load
from rise_engine.session import folder as folders
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_format import encode_header, encode_input, encode_record, with_checksum
from rise_engine.session.shadow import ShadowCue, ShadowEnd, ShadowKey, ShadowLine, ShadowMark, ShadowPlay, ShadowWriter
from tests.kernel.harness import dialog, speech, write
from tests.session.journals import Recording

ACTS = "".join(dialog(name, speech(1, text)) for name, text in {
    "Praise": "Well done!",
    "Repeat": "Once more, please.",
    "Hint": "Look at the fork.",
    "Hm": "Hm.",
    "Well": "Well.",
}.items())  # fmt: skip
RULES = """<InteractionRule name="Task" initial="Idle">
  <State id="Idle"><transition eventTopic="/next" target="Busy"/></State>
  <State id="Busy"><onEntry><function startCommunicationRobotAct="Hint"/></onEntry>
    <transition eventTopic="/next" target="Idle"/></State>
</InteractionRule>"""
TOML = """title = "Table setting"
[keys]
p = { act = "Praise" }
r = { act = "Repeat" }
i = { act = "Hint" }
n = { event = "/next" }
k = { set = "mood = 'good'" }
[act.Hm]
filler = true
[act.Well]
filler = true
[act.Hint]
hold = true
"""
ACT, EVENT, SET = "startCommunicationRobotAct", "raiseEventTopic", "assignValue"
FUNCTIONS = {"act": ACT, "event": EVENT, "set": SET, "say": "say", "cue": "markCue", "undo": "undoCue"}

Intent = tuple[float, str, str]
"""When, what (act, event, set, say, cue, undo, mark, note, sync, stop), and which."""
CUES: Sequence[Intent] = (
    (1.0, "cue", ""), (2.2, "act", "Praise"),
    (10.0, "cue", ""), (10.4, "act", "Hm"), (11.5, "act", "Repeat"),
    (20.0, "cue", ""), (21.0, "event", "/next"),
    (30.0, "cue", ""),
    (40.0, "cue", ""), (40.9, "say", "It is yours, Maria."), (43.0, "mark", "late"), (44.0, "note", "too late"),
)  # fmt: skip
"""Five cues: an act, a filler and an act, an event, nothing, free speech that is marked late."""


def make_session(
    root: Path,
    deeds: Iterable[Intent] = CUES,
    *,
    wizard: str = "anna",
    participant: str = "P01",
    condition: str = "",
    seconds: float = 50.0,
    started: SessionStarted | None = None,
    sessions: Path | None = None,
) -> Path:
    """A session's folder, in which `wizard` did all this; the robot confirms in 0.1 s and speaks for 1 s."""
    study = root / "scenario"
    if not study.exists():
        write(study, acts=ACTS, rules=RULES, memory={"mood": ""}, toml=TOML)
    loaded = load(study)
    assert loaded.scenario is not None, loaded.diagnostics
    session = Recording(loaded.scenario)
    session.steps.clear()
    session.records.clear()
    session.kernel = Kernel(loaded.scenario, 7)
    begun = started or SessionStarted(participant=participant, condition=condition)
    session.do(begun)
    source = f"wizard:{wizard}"
    session.do(ControlChanged(status="taken", by=source, holder=source))
    session.submit("startInteractionRule", "Task", source=source)
    due: list[tuple[float, int, Any]] = [(deed[0], number, deed) for number, deed in enumerate(deeds)]
    number = len(due)
    heapq.heapify(due)
    while due:
        at, _, what = heapq.heappop(due)
        session.wait(at - session.t)
        if isinstance(what, ActionReport):
            session.do(what)
        else:
            _do(session, what, source)
        for goal in set(session.goals) - {each[2].action for each in due if isinstance(each[2], ActionReport)}:
            for later, status in ((0.1, "accepted"), (1.1, "succeeded")):
                number += 1
                report = ActionReport(action=goal, status=status)  # type: ignore[arg-type]
                heapq.heappush(due, (round(session.t + later, 6), number, report))
    session.wait(max(0.0, seconds - session.t))
    session.do(OutcomeReport(status="complete", source=source))
    session.do(SessionEnded(reason="over"))
    folder = folders.create_session(
        sessions or root / "sessions",
        loaded.scenario,
        loaded.files,
        seed=7,
        faults=(),
        versions={"rise-tui": "0.2.0", "python": "3.11"},
        begun=begun,
        wizard=wizard,
    )
    lines = [encode_header("rise-tui 0.2.0")]
    for n, (fact, records) in enumerate(session.steps, 1):
        lines += [encode_input(n, fact), *(with_checksum(encode_record(record)) for record in records)]
    (folder / JOURNAL).write_bytes(b"".join(lines))
    return folder


def _do(session: Recording, deed: Intent, source: str) -> None:
    at, what, which = deed
    if what in FUNCTIONS:
        pressed = round(at - 0.02, 6)  # the key, 20 ms before the engine has it
        session.do(Submit(function=FUNCTIONS[what], behavior=which, source=source, pressed=pressed))
    elif what == "mark":
        last = max(each.id for each in session.records if isinstance(each, TaskRecord))
        session.submit("markMistake", f"{last} {which}", source=source)
    elif what == "note":
        session.do(Note(text=which, source=source))
    elif what == "sync":
        session.do(SyncMark(number=int(which), medium="sound", source="engine"))
    else:
        session.submit(what, which, source=source)


def cue_numbers(folder: Path) -> list[int]:
    """`seq` of each cue of a session, in order."""
    from rise_engine.session.journal_reader import read_journal

    records = read_journal(folder / JOURNAL).read_records()
    return [each.seq for each in records if isinstance(each, CueRecord) and each.status == "marked"]


Answer = tuple[float, str, str] | None
"""Seconds after the cue, what and which; None: nothing."""


def add_shadow(
    folder: Path,
    wizard: str,
    answers: Sequence[Answer],
    *,
    times: Sequence[float] = (1.0, 10.0, 20.0, 30.0, 40.0),
    marks: Sequence[tuple[int, str]] = (),
    complete: bool = True,
    speed: float = 1.0,
) -> Path:
    """What another wizard would have done about each cue."""
    writer = ShadowWriter.begin(folder, wizard, speed=speed)
    lines: list[ShadowLine] = [ShadowPlay(0.0)]
    for at, cue, answer in zip(times, cue_numbers(folder), answers, strict=False):
        lines.append(ShadowCue(at, cue))
        if answer is not None:
            later, what, which = answer
            lines.append(ShadowKey(t=at + later, function=FUNCTIONS[what], behavior=which, cue=cue))
    lines += [ShadowMark(49.0, task, mark) for task, mark in marks]  # type: ignore[arg-type]
    lines += [ShadowEnd(50.0)] if complete else []
    for line in lines:
        writer.append(line)
    writer.close()
    return writer.path

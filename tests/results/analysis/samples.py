"""Real sessions and a real study for tests, made by the engine itself in virtual time: milliseconds each.

    folder = play_session(tmp_path)                     # one session of everything, with its end
    study = make_study(tmp_path / "study")              # three participants, two runs each (made once, then copied)

What happens in a session (`everything`): cues that are answered, bridged by fillers, undone, or left open; an act
that begins with a look before it speaks; acts that wait in the queue and acts that overlap; a failure that is repeated;
a refused act; marks; a stop and its release; a rule that is stopped, stepped back, and that has states of 0 s; notes,
free speech and a private memory key; checks, a recording, marks for recordings, an outcome.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta, timezone
from functools import cache
from pathlib import Path
from typing import TypeAlias

from msgspec.structs import replace

from rise_engine.cli.study.planning import explore_study
from rise_engine.kernel.inputs import (
    AnyInput,
    CheckReport,
    ControlChanged,
    Note,
    OutcomeReport,
    RecordingReport,
    SessionStarted,
    Submit,
    SyncMark,
)
from rise_engine.kernel.records import OutcomeStatus
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.run.engine.drivers import make_robot
from rise_engine.run.engine.engine import Engine
from rise_engine.scenario.loader import load
from rise_engine.session.folder import JOURNAL, create_session, read_info, write_info
from rise_engine.session.journal_format import encode_header
from rise_engine.session.recovery import recover
from rise_engine.study.begin import BeginRequest, plan_session
from rise_engine.study.planning import plan_study
from rise_engine.study.review import review_study
from rise_engine.study.state import OpenStudy, read_state
from rise_engine.study.study_toml import load_study
from tests.study import studies

Script: TypeAlias = Sequence[tuple[float, AnyInput]]
"""What comes from outside, and when (session seconds)."""

BEGAN = datetime(2024, 11, 23, 9, 30, 0, tzinfo=timezone(timedelta(hours=1)))
WIZARD = "wizard:anna"
VERSIONS = {"rise-tui": "0.0.0", "python": "3.11"}

SCENARIO = """language = "en"
title = "Tea"
robot = "generic"
private = ["person_name"]

[trials]
state = "Visit/*"
columns = ["visits", "person_name"]

[act.Hm]
filler = true
calling_type = "None"

[act.Think]
filler = true
calling_type = "None"

[act.Nod]
calling_type = "None"

[act.Point]
on_failure = "repeat:1"
"""
ACTS = """<Dialogs>
  <Dialog name="Greet"><Speech><actionID>1</actionID><message>Hello, {person_name|stranger}!</message></Speech>
    <LookAt><actionID>2</actionID><pointx>1</pointx><pointy>0</pointy><pointz>0.5</pointz></LookAt></Dialog>
  <Dialog name="Answer"><LookAt><actionID>1</actionID><pointx>1</pointx><pointy>0</pointy><pointz>0</pointz></LookAt>
    <Speech><actionID>2</actionID><waitForActions>1</waitForActions>
      <message>That is a very good question, let us have a look at it.</message></Speech></Dialog>
  <Dialog name="Ask"><Speech><actionID>1</actionID><message>Would you like some tea?</message></Speech>
    <Wait><actionID>2</actionID><waitForActions>1</waitForActions><duration>500</duration></Wait></Dialog>
  <Dialog name="Thanks"><Speech><actionID>1</actionID><message>Thank you for coming, goodbye.</message></Speech>
  </Dialog>
  <Dialog name="Hm"><Speech><actionID>1</actionID><message>Hm.</message></Speech></Dialog>
  <Dialog name="Think"><Emotion><actionID>1</actionID><value>happy</value></Emotion></Dialog>
  <Dialog name="Nod"><Animation><actionID>1</actionID><value>nod</value></Animation></Dialog>
  <Dialog name="Point"><PointAt><actionID>1</actionID><pointx>1</pointx><pointy>0</pointy><pointz>0</pointz></PointAt>
  </Dialog>
</Dialogs>"""
RULES = """<InteractionRules>
  <InteractionRule name="Visit" initial="Start">
    <State id="Start"><onEntry><function assignValue="visits = visits + 1"/></onEntry>
      <transition cond="visits &gt; 0" target="Welcome"/></State>
    <State id="Welcome"><onEntry><function startCommunicationRobotAct="Greet"/></onEntry>
      <transition eventTopic="/Greet_end" target="Talk"/></State>
    <State id="Talk"><transition eventTopic="/tea" target="Tea"/></State>
    <State id="Tea"><onEntry><function startCommunicationRobotAct="Ask"/></onEntry>
      <transition eventTopic="/bye" target="End"/></State>
    <State id="End"/>
  </InteractionRule>
  <InteractionRule name="Lamp" initial="Off">
    <State id="Off"><transition after="20s" target="On"/></State>
    <State id="On"><transition eventTopic="/off" target="Off"/></State>
  </InteractionRule>
</InteractionRules>"""
MEMORY = '{"WorkingMemory": [{"person_name": "", "visits": 0, "hesitation": false, "noise": 0}]}'
DESIGN = studies.DESIGN.replace("n = 4\n", "n = 3\n")
PEOPLE = "participant,consent_study,status,comment\n" + "".join(
    f"P0{number},2026-11-0{number},,\n" for number in range(1, 5)
)


def task(
    function: str, behavior: str = "", *, source: str = WIZARD, pressed: float | None = None, calling: str = ""
) -> Submit:
    """A DomainTask. `pressed`: when its key was pressed, in session seconds."""
    return Submit(function=function, behavior=behavior, source=source, pressed=pressed, calling_type=calling)


def act(
    name: str, at: float, *, reaction: float = 0.02, source: str = WIZARD, calling: str = ""
) -> tuple[float, Submit]:
    """An act that the engine takes at `at`, of a key that was pressed `reaction` seconds before."""
    pressed = round(at - reaction, 6) if source.startswith("wizard:") else None
    return at, task("startCommunicationRobotAct", name, source=source, pressed=pressed, calling=calling)


def everything(*, slower: float = 0.0, outcome: OutcomeStatus | None = "complete", reason: str = "") -> Script:
    """A bit of everything, within two minutes.

    :param slower: seconds by which the wizard answers later.
    :param outcome: what is said at the end; None: nothing.
    :param reason: why.
    """
    said = [(118.0, OutcomeReport(status=outcome, reason=reason, source=WIZARD))] if outcome is not None else []
    return [
        (0.0, CheckReport(id="lamp", text="The lamp is on", result="passed", source=WIZARD)),
        (0.0, CheckReport(id="disk", text="free space", result="skipped", reason="in a hurry", source=WIZARD)),
        (0.0, ControlChanged(status="taken", by=WIZARD, holder=WIZARD)),
        (0.1, RecordingReport(name="camera", status="started", path="/data/camera.mkv", source="recorders")),
        (0.2, SyncMark(number=1, medium="sound", text="start", source="recorders")),
        (0.4, task("assignValue", 'person_name = "Zelda Quux"')),
        (0.5, task("startInteractionRule", "Lamp", source="rule-starter")),
        (1.0, task("startInteractionRule", "Visit", pressed=0.95)),
        # A cue, a filler, an answer that looks before it speaks.
        (10.0, task("markCue", "asks something", pressed=9.97)),
        act("Hm", 11.0),
        act("Answer", 12.5 + slower),
        # A cue that is answered at once, and one that was none.
        (24.0, task("markCue", pressed=24.0)),
        act("Nod", 24.8 + slower),
        (28.0, task("markCue")),
        (28.9, task("undoCue")),
        # Queued behind another act; overlapping; a refused one; a failure that is repeated.
        act("Ask", 30.0),
        act("Thanks", 30.4),
        act("Nod", 30.6),
        act("Nodd", 38.0),
        act("Point", 40.0),
        # A cue whose filler has no voice and whose answer comes from a program; a wrong act, and one that was late.
        (46.0, task("markCue")),
        act("Think", 46.8),
        act("Ask", 49.0 + slower, source="ros:/chooser"),
        (52.0, task("markMistake", "7 late")),
        (52.5, task("markMistake", "8 wrong")),
        (53.0, task("markMistake", "8 none")),
        (54.0, Note(text="Zelda looks away", source=WIZARD)),
        (55.0, task("raiseEventTopic", "/tea")),
        (58.2, task("stepBack", "Visit")),
        (64.0, task("say", "Zelda, shall we go on?", pressed=63.9)),
        (68.0, task("raiseEventTopic", "/nobody", source="ros:/chooser")),
        # Stopped by the wizard while it speaks; then everything stopped, and released with the rule where it was.
        act("Answer", 70.0),
        (72.5, task("stopCommunicationRobotAct", "Answer")),
        act("Greet", 80.0),
        (80.6, task("stopAll", pressed=80.55)),
        (84.0, task("releaseStop", '{"Visit": "wait"}')),
        (86.0, task("raiseEventTopic", "/off")),
        (90.0, task("markCue")),
        (117.0, SyncMark(number=2, medium="sound", text="end", source="recorders")),
        (
            117.5,
            RecordingReport(name="camera", status="stopped", path="/data/camera.mkv", bytes=9_000, source="recorders"),
        ),
        *said,
    ]


def short(*, outcome: OutcomeStatus | None = None, reason: str = "") -> Script:
    """A greeting, a cue and its answer."""
    said = [(19.0, OutcomeReport(status=outcome, reason=reason, source=WIZARD))] if outcome is not None else []
    return [act("Greet", 1.0), (8.0, task("markCue")), act("Thanks", 9.0), *said]


# --- one session ------------------------------------------------------------------------------------------------------


def write_scenario(folder: Path) -> Path:
    """The scenario that all samples play; its folder."""
    for name, text in (("acts/all.xml", ACTS), ("rules/all.xml", RULES), ("memory.json", MEMORY)):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, "utf-8")
    (folder / "scenario.toml").write_text(SCENARIO, "utf-8")
    return folder


def play_session(
    root: Path,
    script: Script | None = None,
    *,
    scenario: Path | None = None,
    started: SessionStarted | None = None,
    mode: str = "real",
    began: datetime = BEGAN,
    seed: int = 7,
    until: float = 120.0,
    ends: bool = True,
    faults: tuple[str, ...] = ("PointAt=fail@1",),
    language: str = "",
) -> Path:
    """Play a session and keep it; its folder.

    :param root: where sessions lie.
    :param script: what comes from outside; `everything` without.
    :param scenario: the scenario's folder; the sample one, made beside `root`, without.
    :param started: the first input, for participant, condition and study.
    :param mode: what session.toml says; the robot is the simulated one in any case.
    :param began: when.
    :param seed: of the session.
    :param until: session seconds when it is ended.
    :param ends: False: the engine vanishes then.
    :param faults: what the simulated robot does wrong.
    :param language: in which it speaks; empty: that of its acts.
    """
    if scenario is None:
        scenario = root.parent / "scenario"
        if not scenario.exists():
            write_scenario(scenario)
    loaded = load(scenario, mode=mode, language=language or None)
    assert loaded.scenario is not None, loaded.diagnostics
    first = started or SessionStarted(participant="P01")
    root.mkdir(parents=True, exist_ok=True)
    made = create_session(
        root,
        loaded.scenario,
        loaded.files,
        seed=seed,
        faults=first.injected_faults,
        begun=first,
        language=language,
        wizard="anna",
        versions=VERSIONS,
    )
    stamp = made.name[:17]
    folder = made.rename(_free(made.with_name(made.name.replace(stamp, f"{began:%Y-%m-%d_%H%M%S}", 1))))
    write_info(folder / "session.toml", replace(read_info(folder), started=began.isoformat(timespec="milliseconds")))
    journal = _FileJournal(folder / JOURNAL)
    journal.append(encode_header("rise-tui test"))
    clock = _LabClock(began)
    robot = make_robot(loaded.scenario.robot, "debug", clock, seed, faults)
    engine = Engine(loaded.scenario, robot, clock, seed, started=first, journal=journal)  # type: ignore[arg-type]
    _play(engine, clock, journal, script if script is not None else everything(), until, ends, engine.start)
    return folder


def recovered_session(
    root: Path,
    *,
    at: float = 26.0,
    away: float = 95.0,
    noted: float | None = None,
    script: Script | None = None,
    **more: object,
) -> Path:
    """A session whose engine vanished at `at` (while an act ran) and was gone for `away` seconds; its folder. `noted`:
    the session time that the engine noted last, after its last record."""
    script = everything() if script is None else script
    folder = play_session(root, [each for each in script if each[0] < at], until=at, ends=False, **more)  # type: ignore[arg-type]
    if noted is not None:
        (folder / "clock").write_text(f"{noted}")
    found = recover(folder)
    journal = _FileJournal(folder / JOURNAL)
    if found.unwritten_lines:
        journal.append(found.unwritten_lines)
    began = datetime.fromisoformat(read_info(folder).started)
    clock = _LabClock(began + timedelta(seconds=away), found.t)
    robot = make_robot(found.scenario.robot, "debug", clock, found.info.seed, ("PointAt=fail@1",))
    engine = Engine(
        found.scenario,
        robot,
        clock,
        found.info.seed,
        journal=journal,  # type: ignore[arg-type]
        recovered=found,
    )
    later = [each for each in script if each[0] >= at]
    _play(engine, clock, journal, later, 120.0, True, engine.resume)
    return folder


def torn_session(root: Path, **more: object) -> Path:
    """A session whose machine lost its power while a line was written; its folder."""
    folder = play_session(root, until=60.0, ends=False, **more)  # type: ignore[arg-type]
    data = (folder / JOURNAL).read_bytes()
    (folder / JOURNAL).write_bytes(data[:-30])
    return folder


# --- a study ----------------------------------------------------------------------------------------------------------


def make_study(folder: Path) -> Path:
    """A study of three participants with two complete runs each, eight sessions in all: P02's first one was aborted
    and came again, and before all of them there was a pilot. P04 has not come. Returns its folder.

    :param folder: where it is to lie; it must not exist.
    """
    shutil.copytree(_made_study(), folder, symlinks=True)
    return folder


def sessions_of(study: Path) -> list[Path]:
    """The session folders of a study, in the order in which they began."""
    return sorted((study / "sessions").iterdir())


@cache
def _made_study() -> Path:
    """Once in a process; deleted with the process's other temporary folders, at its end."""
    _KEPT.append(tempfile.TemporaryDirectory(prefix="rise-sample-study-"))
    folder = Path(_KEPT[-1].name) / "study"
    folder.mkdir()
    write_scenario(folder / "scenario")
    (folder / "study.toml").write_text(DESIGN, "utf-8")
    (folder / "participants.csv").write_text(PEOPLE, "utf-8")
    loaded = load_study(folder)
    assert loaded.study is not None, loaded.diagnostics
    plan_study(loaded.study, loaded.scenarios)
    runs = iter(range(20))

    def run(request: BeginRequest, script: Script, until: float = 120.0) -> None:
        number = next(runs)
        with OpenStudy(folder) as open:
            plan = plan_session(open.state, request)
            first = plan.first_input(open.state.study)
        play_session(
            folder / "sessions",
            script,
            scenario=Path(plan.run.scenario),
            started=first,
            began=BEGAN + timedelta(hours=number),
            seed=plan.seed,
            until=until,
        )
        with OpenStudy(folder):
            """Writes what the folders say into the log."""

    run(BeginRequest("P01", purpose="pilot", mode="real", run=1), short(), 20.0)
    run(BeginRequest("P01"), everything())
    run(BeginRequest("P01"), everything(slower=0.4))
    run(BeginRequest("P02"), short(outcome="aborted", reason="Zelda felt sick"), 20.0)
    run(BeginRequest("P02"), everything(slower=0.8))
    run(BeginRequest("P02"), everything(slower=0.2))
    run(BeginRequest("P03"), everything(slower=1.1))
    run(BeginRequest("P03"), everything(slower=0.6))
    assert read_state(folder).standing.complete == 3
    explore_study(review_study(folder))  # kept, so that no `study check` explores it again
    return folder


_KEPT: list[tempfile.TemporaryDirectory[str]] = []


# --- the world --------------------------------------------------------------------------------------------------------


class _LabClock(VirtualClock):
    """Virtual time whose labels are those of a day in the laboratory."""

    def __init__(self, began: datetime, start: float = 0.0) -> None:
        super().__init__()
        self._began = began
        self._now = start

    def wall_label(self, t: float) -> str:
        return (self._began + timedelta(seconds=t)).isoformat(timespec="milliseconds")


class _FileJournal:
    """As `rise_engine.session.journal.Journal`, without its thread: what is handed over is in the file at once."""

    def __init__(self, path: Path) -> None:
        self.error, self.lag, self.durable, self.fresh = "", 0.0, 0, False
        self._file = path.open("ab")
        path.chmod(0o600)

    def append(self, lines: bytes) -> int:
        self._file.write(lines)
        self.durable += 1
        self.fresh = True
        return self.durable

    def close(self) -> None:
        self._file.close()


def _play(
    engine: Engine,
    clock: VirtualClock,
    journal: _FileJournal,
    script: Script,
    until: float,
    ends: bool,
    begin: Callable[[], None],
) -> None:
    """Let a session run to its end, or until its engine vanishes."""

    def flush() -> None:
        while journal.fresh:
            journal.fresh = False
            engine.flush_durable()

    def give(fact: AnyInput) -> None:
        engine.accept(fact)

    for at, fact in script:
        clock.call_at(at, lambda fact=fact: give(fact))  # type: ignore[misc]
    begin()
    flush()
    gone = False

    def end() -> None:
        nonlocal gone
        gone = True
        if ends:
            engine.end("the sample is over")

    clock.call_at(until, end)
    while not engine.ended and (ends or not gone) and clock.advance():
        flush()
    flush()
    assert engine.ended or not ends
    journal.close()


def _free(path: Path) -> Path:
    number = 2
    found = path
    while found.exists():
        found = path.with_name(f"{path.name}-{number}")
        number += 1
    return found

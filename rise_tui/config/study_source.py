"""A study as the console sees it: the contents of its folder, what would run, and how to run it.

The console knows no file of a study and no engine's process. `rise_tui.cli.study_folder` knows them; tests pass in
others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias

from msgspec import Struct

from rise_engine.checks import CheckContext, CheckOutcome, PendingCheck
from rise_engine.kernel.inputs import CheckReport
from rise_engine.results.report.document import Document
from rise_engine.run.protocol.client import Client
from rise_engine.scenario.model import KeyBinding
from rise_engine.study.model import OutcomeStatus, PlannedRun, Purpose, SessionEntry, Study, StudyCheck, StudyStanding

ReportProgress: TypeAlias = Callable[[str], object]
"""Receives a sentence, on any thread."""


class StudyNow(Struct, frozen=True):
    """A study's folder at one moment."""

    study: Study | None = None
    standing: StudyStanding | None = None
    """None when the study does not load: nothing can start."""
    problems: tuple[str, ...] = ()
    """What is wrong with it, one diagnostic each."""
    after: tuple[PendingCheck, ...] = ()
    """The checks after a session."""


class SessionRequest(Struct, frozen=True):
    """A session that somebody may want to begin."""

    participant: str
    purpose: Purpose = "counted"
    condition: str = ""
    """Another condition than the participant's, for a rehearsal; empty: theirs."""
    run: int = 0
    """Which run; 0: the next."""


class SessionPreview(Struct, frozen=True):
    """What would run if a session began now."""

    request: SessionRequest
    run: PlannedRun
    slot: int | None
    """The row of the plan that it holds or takes; None: it takes none."""
    attempt: int
    runs: int
    title: str
    """The scenario's."""
    mode: str
    robot: str
    """In words for a person."""
    recorded: str
    """The folder in which the session's own folder is created."""
    context: CheckContext
    """What the checks are made for."""
    checks: tuple[PendingCheck, ...] = ()
    """The checks before the session; none in debug mode."""
    keys: dict[str, KeyBinding] = {}
    """Of the scenario."""
    recorders: str = ""
    """What else records the session: `camera (obs), bag (rosbag2)`; empty: nothing."""
    language: str = ""
    """The participant's language in the study; empty: the study does not say."""
    warning: str = ""
    """A sentence that somebody else is next; empty: it is this participant's turn."""
    simulated: bool = False
    """Whether no robot moves, in any mode."""
    warnings: tuple[str, ...] = ()
    """Sentences about the robot, such as what F9 cannot stop."""
    unrecorded: str = ""
    """Why the study's recorders do not record all of it, as a sentence; empty: they do, or there are none."""


class StartedSession(Struct, frozen=True):
    """A running session."""

    client: Client
    notice: str = ""
    """The notice about it."""
    wizard: str = ""
    """The wizard's name, if returning to a session revealed it; empty: unchanged."""


class StudySource(Protocol):
    """One study. Every method except `check` may block, and runs off the console's loop."""

    folder: str
    """Absolute."""

    def load(self) -> StudyNow:
        """The study now. Never raises: the result contains what is wrong."""

    def fingerprint(self) -> object:
        """A value that changes when anything that `load` reads changes."""

    def plan(self, request: SessionRequest, wizard: str) -> SessionPreview:
        """What would run. Raises StudyError with the reason when nothing can."""

    async def check(self, check: StudyCheck, context: CheckContext) -> CheckOutcome:
        """Examine something, or run a program. A check that needs an answer returns a question. Never raises."""

    def note_check(self, check: StudyCheck, context: CheckContext, report: CheckReport) -> None:
        """Write down the result of a check, even if no session begins after it. Raises StudyError."""

    def start(
        self, plan: SessionPreview, checks: Sequence[CheckReport], wizard: str, report: ReportProgress
    ) -> StartedSession:
        """Begin the session. Raises StudyError; then nothing has started."""

    def attach(self, entry: SessionEntry, wizard: str) -> StartedSession:
        """Attach to a running session. Raises StudyError."""

    def recover(self, entry: SessionEntry, wizard: str, report: ReportProgress) -> StartedSession:
        """Continue a session that did not end. Raises StudyError."""

    def report(self, folder: str) -> Document:
        """The report of a session, by the name of its folder, for the wizard. A blinded study shows its conditions'
        labels. This may take a second. Raises StudyError."""

    def judge(self, entry: SessionEntry, status: OutcomeStatus, reason: str, wizard: str) -> None:
        """Write down how a session counts that has ended, or that nobody continues. Raises StudyError."""

"""A study as the console sees it: what stands in its folder, what would run, and what makes it run.

The console knows no file of a study and no engine's process; `rise_tui.cli.study_folder` does, and tests give others.
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
"""Gets a sentence, on any thread."""


class StudyNow(Struct, frozen=True):
    """A study's folder at one moment."""

    study: Study | None = None
    standing: StudyStanding | None = None
    """None when it does not load: nothing can be started."""
    problems: tuple[str, ...] = ()
    """What is wrong with it, a finding each."""
    after: tuple[PendingCheck, ...] = ()
    """The checks after a session."""


class SessionRequest(Struct, frozen=True):
    """A session that somebody may want to begin."""

    participant: str
    purpose: Purpose = "counted"
    condition: str = ""
    """For a rehearsal of another condition than the participant's; empty: theirs."""
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
    """As it reads to a person."""
    recorded: str
    """The folder in which the session's own folder is made."""
    context: CheckContext
    """What the checks are made for."""
    checks: tuple[PendingCheck, ...] = ()
    """Those before it; in debug mode none is made."""
    keys: dict[str, KeyBinding] = {}
    """Of the scenario."""
    recorders: str = ""
    """What records it besides: `camera (obs), bag (rosbag2)`; empty: nothing does."""
    language: str = ""
    """The participant's, as the study says it; empty: it does not."""
    warning: str = ""
    """That somebody else is next, as a sentence; empty: it is their turn."""
    unrecorded: str = ""
    """Why what the study has does not record it, or not all of it, as a sentence; empty: it does, or there is none."""


class StartedSession(Struct, frozen=True):
    """A session that runs now."""

    client: Client
    notice: str = ""
    """What there is to say about it."""
    wizard: str = ""
    """Who sits here, where that was found out by going back to a session; empty: as before."""


class StudySource(Protocol):
    """One study. Every method but `check` may block, and is called beside the console's loop."""

    folder: str
    """Absolute."""

    def load(self) -> StudyNow:
        """The study as it is now. Never raises: what is wrong is in it."""

    def fingerprint(self) -> object:
        """Something that is another as soon as what `load` reads has changed."""

    def plan(self, request: SessionRequest, wizard: str) -> SessionPreview:
        """What would run. Raises StudyError with what is in the way."""

    async def check(self, check: StudyCheck, context: CheckContext) -> CheckOutcome:
        """Look at something, or run a program; what asks somebody comes back as a question. Never raises."""

    def note_check(self, check: StudyCheck, context: CheckContext, report: CheckReport) -> None:
        """Write down what came of a check, also when no session begins after it. Raises StudyError."""

    def start(
        self, plan: SessionPreview, checks: Sequence[CheckReport], wizard: str, report: ReportProgress
    ) -> StartedSession:
        """Begin it. Raises StudyError, and then nothing has been started."""

    def attach(self, entry: SessionEntry, wizard: str) -> StartedSession:
        """To a session that runs. Raises StudyError."""

    def recover(self, entry: SessionEntry, wizard: str, report: ReportProgress) -> StartedSession:
        """Go on with a session that did not end. Raises StudyError."""

    def report(self, folder: str) -> Document:
        """What happened in a session, by the name of its folder, as the wizard may read it: a blinded study's
        conditions by their labels. It may take a second. Raises StudyError."""

    def judge(self, entry: SessionEntry, status: OutcomeStatus, reason: str, wizard: str) -> None:
        """Write down how a session that has ended, or that nobody goes on with, is to count. Raises StudyError."""

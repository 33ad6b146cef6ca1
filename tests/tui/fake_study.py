"""A study that does what a test says: remembers what it was asked, and gives prepared sessions."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from threading import Event
from typing import Any

from msgspec.structs import replace

from rise_engine.base.errors import StudyError
from rise_engine.checks.outcome import CheckContext, CheckOutcome
from rise_engine.kernel.inputs import CheckReport
from rise_engine.kernel.records import SessionRecord
from rise_engine.results.report.document import Document, Paragraph, Section
from rise_engine.scenario.model import KeyBinding
from rise_engine.study.checks import PendingCheck
from rise_engine.study.model import (
    AssignmentSettings,
    CellStanding,
    Factor,
    Level,
    OutcomeStatus,
    ParticipantStanding,
    PlannedRun,
    SessionEntry,
    Study,
    StudyCheck,
    StudyStanding,
)
from rise_tui.config.launch import (
    ReportProgress,
    SessionPreview,
    SessionRequest,
    StartedSession,
    StudyNow,
)
from tests.tui.fake import DEMO, FakeClient, demo

CHECKS = (
    StudyCheck("consent", auto="consent"),
    StudyCheck("lights", ask="The lamp behind the robot is on"),
    StudyCheck("door", ask="The door is closed"),
    StudyCheck("disk", auto="disk", minimum="20 GB"),
    StudyCheck("tracker", run=("./check-tracker.sh",)),
    StudyCheck("debrief", when="after", ask="The participant was debriefed"),
)
VALUES = {"consent": "study 2026-11-20, recording 2026-11-20", "disk": "34.1 GB free", "tracker": "60 Hz, 2 eyes"}


def pending(when: str, checks: Sequence[StudyCheck] = CHECKS) -> tuple[PendingCheck, ...]:
    return tuple(PendingCheck(check) for check in checks if check.when == when)


def study(**changes: Any) -> Study:
    """Two factors, one within: everybody has two runs."""
    usual = Study(
        folder="/home/lab/lablinking",
        title="LabLinking: hesitation and noise",
        id="lablinking",
        seed=20261122,
        n=24,
        scenario="scenario",
        mode="real",
        factors=(
            Factor("hesitation", "between", (Level("yes", label="A"), Level("no", label="B"))),
            Factor("noise", "within", (Level("quiet"), Level("loud"))),
        ),
        assignment=AssignmentSettings(strata=("language",)),
        strata={"language": ("de", "en")},
        consent=("study", "recording"),
        checks=CHECKS,
    )
    return replace(usual, **changes)


def entry(participant: str, run: int = 1, **changes: Any) -> SessionEntry:
    usual = SessionEntry(
        participant,
        run,
        1,
        "counted",
        f"2026-11-21_141503_{participant}_lablinking_real",
        "2026-11-21T14:15:03.000+01:00",
        "ended",
        "complete",
        seconds=1450.0,
        condition="yes+quiet" if run == 1 else "yes+loud",
        slot=1,
    )
    return replace(usual, **changes)


def person(number: int, state: str, *, sessions: Sequence[SessionEntry] = (), **changes: Any) -> ParticipantStanding:
    begins = state in ("waiting", "to-go-on", "aborted")
    usual: dict[str, Any] = {
        "strata": {"language": "de" if number % 2 else "en"},
        "slot": number if sessions else None,
        "next_run": (1 + len([each for each in sessions if each.outcome == "complete"])) if begins else None,
        "runs": 2,
        "sessions": tuple(sessions),
    }
    return ParticipantStanding(f"P{number:02}", state, **{**usual, **changes})  # type: ignore[arg-type]


def standing(**changes: Any) -> StudyStanding:
    """In the middle of a study: every state once."""
    people = (
        person(1, "complete", sessions=(entry("P01"), entry("P01", 2))),
        person(2, "complete", sessions=(entry("P02"), entry("P02", 2))),
        person(3, "excluded", why="fire alarm in the middle", sessions=(entry("P03", outcome="excluded"),)),
        person(4, "withdrawn"),
        person(
            5,
            "unfinished",
            why="run 1 of 2026-11-21 14:15",
            sessions=(entry("P05", status="unfinished", outcome=None, seconds=872.0),),
        ),
        person(6, "to-judge", why="run 1 ended without outcome", sessions=(entry("P06", outcome=None),)),
        person(7, "to-go-on", sessions=(entry("P07"),)),
        person(8, "aborted", why="the robot was lost", sessions=(entry("P08", outcome="aborted"),), next_attempt=2),
        person(9, "no-consent", why="consent_recording of participants.csv has no date"),
        person(10, "waiting"),
    )
    cells = tuple(
        CellStanding({"language": language}, condition, complete, open, 6)
        for language, condition, complete, open in (
            ("de", "yes", 1, 1),
            ("de", "no", 0, 0),
            ("en", "yes", 1, 1),
            ("en", "no", 0, 1),
        )
    )
    usual = StudyStanding(people, cells, 2, 24, next="P07", due=("Media of P01 are due to be deleted.",))
    return replace(usual, **changes)


class FakeStudy:
    """Implements `rise_tui.config.launch.StudySource`."""

    folder = "/home/lab/lablinking"

    def __init__(self, load: StudyNow | None = None, client: FakeClient | None = None) -> None:
        self.now = load or StudyNow(study(), standing(), after=pending("after"))
        self.client = client
        """Of the session that is started; None: a new one each time."""
        self.version = 0
        self.loads = 0
        self.results: dict[str, str] = {}
        """By check: why it fails."""
        self.recorders = self.unrecorded = ""
        """As in SessionPreview."""
        self.refusal = ""
        """Why nothing can be begun."""
        self.held: Event | None = None
        """While it is not set, no session comes up."""
        self.keys: dict[str, KeyBinding] = {}
        """Of the scenario."""
        self.planned: list[SessionRequest] = []
        self.checked: list[str] = []
        self.at_once = self.most_at_once = 0
        """How many checks look by themselves at one time."""
        self.noted: list[tuple[str, str]] = []
        self.started: list[tuple[SessionRequest, tuple[CheckReport, ...], str]] = []
        self.attached: list[SessionEntry] = []
        self.recovered: list[SessionEntry] = []
        self.language, self.warning = "", ""
        self.simulated, self.warnings = False, tuple[str, ...]()
        self.judged: list[tuple[SessionEntry, OutcomeStatus, str, str]] = []
        self.clients: list[FakeClient] = []
        self.reported: list[str] = []
        """Sessions whose report was made."""
        self.report_held: Event | None = None
        """While it is not set, no report is made."""
        self.report_refusal = ""

    def change(self, **changes: Any) -> None:
        """The study's files say something else."""
        self.now = replace(self.now, **changes)
        self.version += 1

    # --- StudySource ---

    def load(self) -> StudyNow:
        self.loads += 1
        return self.now

    def fingerprint(self) -> object:
        return self.version

    def plan(self, request: SessionRequest, wizard: str) -> SessionPreview:
        self.planned.append(request)
        if self.refusal:
            raise StudyError(self.refusal)
        assert self.now.study is not None
        mode = "debug" if request.purpose == "debug" else self.now.study.mode
        run = PlannedRun(7, 2, {"hesitation": "yes", "noise": "loud"}, "yes+loud", {"hesitation": True}, DEMO, 99)
        if request.condition:
            run = replace(run, condition=request.condition)
        return SessionPreview(
            request,
            run,
            slot=7 if request.purpose == "counted" else None,
            attempt=1,
            runs=2,
            title="LabLinking: setting the table",
            mode=mode,
            robot="pepper",
            recorded="/home/lab/lablinking/sessions",
            context=CheckContext(self.now.study, request.participant, DEMO, mode, request.purpose, wizard=wizard),
            checks=() if mode == "debug" else pending("before", self.now.study.checks),
            keys=self.keys,
            recorders=self.recorders,
            language=self.language,
            warning=self.warning,
            unrecorded=self.unrecorded,
            simulated=self.simulated,
            warnings=self.warnings,
        )

    async def check(self, check: StudyCheck, context: CheckContext) -> CheckOutcome:
        self.checked.append(check.id)
        if check.ask:
            return CheckOutcome(check.id, check.ask, "asked", question=check.ask)
        self.at_once += 1
        self.most_at_once = max(self.most_at_once, self.at_once)
        await asyncio.sleep(0.01)
        self.at_once -= 1
        reason = self.results.get(check.id, "")
        value = "" if reason else VALUES.get(check.id, "")
        return CheckOutcome(check.id, check.auto, "failed" if reason else "passed", value, reason)

    def note_check(self, check: StudyCheck, context: CheckContext, report: CheckReport) -> None:
        self.noted.append((report.id, report.result))

    def start(
        self, plan: SessionPreview, checks: Sequence[CheckReport], wizard: str, report: ReportProgress
    ) -> StartedSession:
        self.started.append((plan.request, tuple(checks), wizard))
        report("its robot is being connected")
        if self.held is not None:
            self.held.wait(60)
        if self.refusal:
            raise StudyError(self.refusal)
        return StartedSession(self.session(plan.request.participant, plan.run, plan.request.purpose), "it has begun")

    def session(self, participant: str, run: PlannedRun, purpose: str) -> FakeClient:
        """A session of this study that runs."""
        client = self.client or FakeClient(demo(), folder=f"{self.folder}/sessions/2026_{participant}")
        fields: Mapping[str, Any] = {"slot": run.slot, "run": run.run, "attempt": 1, "purpose": purpose}
        client.emit(
            SessionRecord(
                0,
                0.0,
                "",
                status="started",
                participant=participant,
                condition=run.condition,
                study="lablinking",
                factors=run.factors,
                **fields,
            )
        )
        self.clients.append(client)
        return client

    def attach(self, entry: SessionEntry, wizard: str) -> StartedSession:
        self.attached.append(entry)
        run = PlannedRun(7, entry.run, {}, entry.condition, {}, DEMO, 1)
        return StartedSession(self.session(entry.participant, run, entry.purpose), wizard=wizard or "anna")

    def recover(self, entry: SessionEntry, wizard: str, report: ReportProgress) -> StartedSession:
        self.recovered.append(entry)
        run = PlannedRun(7, entry.run, {}, entry.condition, {}, DEMO, 1)
        return StartedSession(self.session(entry.participant, run, entry.purpose), "the session goes on")

    def report(self, folder: str) -> Document:
        self.reported.append(folder)
        if self.report_held is not None:
            self.report_held.wait(60)
        if self.report_refusal:
            raise StudyError(self.report_refusal)
        lines = tuple(Paragraph(f"line {number} of {folder}") for number in range(40))
        sections = (Section("Checks", lines), Section("Acts", lines))
        return Document(title=folder, kind="Session report", sections=sections)

    def judge(self, entry: SessionEntry, status: OutcomeStatus, reason: str, wizard: str) -> None:
        if self.refusal:
            raise StudyError(self.refusal)
        self.judged.append((entry, status, reason, wizard))

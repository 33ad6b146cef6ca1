"""The data of a study: the design that people write, the plan made from it, and the study's progress.

Nothing here reads or writes files, which are described in `docs/reference/study.md`.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.kernel.records import CheckResult as CheckResult
from rise_engine.kernel.records import OutcomeStatus as OutcomeStatus
from rise_engine.kernel.records import Purpose as Purpose
from rise_engine.scenario.model import Json, Mode

FactorKind: TypeAlias = Literal["between", "within"]
BetweenMethod: TypeAlias = Literal["blocks", "minimise", "random", "list"]
WithinMethod: TypeAlias = Literal["williams", "latin", "all", "fixed", "random"]
LANGUAGE = "language"
"""A factor, stratum or column of this name determines the language that the robot speaks."""


class Level(Struct, frozen=True):
    """One level of a factor: what the robot does."""

    name: str
    memory: dict[str, Json] = {}
    """Memory values that it sets before the session."""
    scenario: str = ""
    """The scenario's folder, relative to the study's. Empty: the study's own scenario."""
    label: str = ""
    """The name on screens while the study is blinded. Empty: the name itself."""
    description: str = ""
    """A description for readers of the data. Empty: there is none."""


class Factor(Struct, frozen=True):
    """A variable that the experimenter varies."""

    name: str
    kind: FactorKind
    """between: each participant has one level. within: each participant has all levels, each in its own session (a
    run)."""
    levels: tuple[Level, ...]


class AssignmentSettings(Struct, frozen=True):
    """How participants get their levels and orders (`[assignment]`)."""

    between: BetweenMethod = "blocks"
    block: tuple[int, ...] = (1,)
    """Sizes of the permuted blocks as multiples of the number of cells, drawn by the seed."""
    strata: tuple[str, ...] = ()
    """Columns of participants.csv; blocks are made separately for each of their values."""
    within: WithinMethod = "williams"
    spare: float = 0.25
    """Rows of the plan beyond `n`, as a fraction of `n`."""
    hidden: bool = False
    """Whether screens show the condition only from the start of the session."""


class StudyCheck(Struct, frozen=True):
    """A check before or after each session (`[[check]]`), with exactly one of ask, auto, run."""

    id: str
    when: Literal["before", "after"] = "before"
    ask: str = ""
    """A sentence that a person confirms."""
    auto: str = ""
    """A check that the program makes: one of `rise_engine.study.checks.AUTOMATIC`."""
    run: tuple[str, ...] = ()
    """A program with arguments, run in the study's folder. Exit status 0: passed; its first line is the value."""
    minimum: str = ""
    """For `disk`: the free space required, `20 GB`."""
    valid: float | None = None
    """Seconds for which a passed check stays valid (`every = "30 d"`). None: it is made for each session."""
    blocks: bool = True
    """Whether a failure blocks the session, unless a person skips the check with a reason."""
    limit: float | None = None
    """Maximum seconds that it may take (`limit = "2min"`). None: its kind's default (`rise_engine.checks.runner`)."""


class RecorderSettings(Struct, frozen=True):
    """One recorder (`camera = { by = "ffmpeg", ... }` in `[recording]`)."""

    name: str
    driver: str
    """The kind of recorder: `by`, by default the recorder's name."""
    options: dict[str, Json] = {}
    stalled_after: float | None = None
    """Seconds without growth after which the recorder counts as stalled. None: its driver's default."""


class MarkerSettings(Struct, frozen=True):
    """What is sent to LSL while the session runs (`lsl` in `[recording]`)."""

    scope: Literal["machine", "link", "site"] = "machine"
    """The part of the network that receives the markers."""
    payload: Literal["short", "json"] = "short"


class SyncSettings(Struct, frozen=True):
    """Sync marks in recordings (`sync` in `[recording]`)."""

    start: bool = True
    end: bool = True
    medium: Literal["sound", "flash"] = "sound"
    play: tuple[str, ...] = ()
    """The program that plays the sound, with `{file}`. Empty: one of the usual programs of this computer."""


class RecordingSettings(Struct, frozen=True):
    """The recorders of the study's sessions (`[recording]`)."""

    recorders: tuple[RecorderSettings, ...] = ()
    markers: MarkerSettings | None = None
    """None: nothing is sent to LSL."""
    sync: SyncSettings | None = None
    """None: there are no marks."""
    folder: str = ""
    """Absolute parent folder for recorders that name their own file. Empty: the session's own folder."""
    consent: str = "recording"
    """The consent that a participant must have given: `recording` is the column consent_recording."""


class ItemDescription(Struct, frozen=True):
    """The description of a questionnaire's column in study.toml."""

    about: str = ""
    levels: dict[str, str] = {}
    """Every possible value with its meaning. Empty: any value is allowed."""


class QuestionnaireSettings(Struct, frozen=True):
    """A questionnaire that participants fill in outside this program (`[questionnaire.NAME]`)."""

    name: str
    file: str
    """Relative to the study's folder."""
    key: str = "participant"
    """The column with the participant."""
    run: str = ""
    """The column with the run after which it was asked. Empty: it is asked once."""
    columns: dict[str, ItemDescription] = {}
    leave_out: tuple[str, ...] = ()
    """Columns that no export contains."""
    about: str = ""
    """Its description, as in a paper."""


class Study(Struct, frozen=True):
    """A checked study.toml."""

    folder: str
    """Absolute."""
    title: str
    id: str
    """Letters and digits."""
    seed: int
    n: int
    """The number of complete participants wanted."""
    scenario: str
    """The scenario's folder, relative to the study's."""
    mode: Mode
    factors: tuple[Factor, ...] = ()
    """In the order of the file."""
    assignment: AssignmentSettings = AssignmentSettings()
    strata: dict[str, tuple[str, ...]] = {}
    """The values of each stratum, by column."""
    consent: tuple[str, ...] = ()
    """The consents that are required: `study` is the column consent_study."""
    checks: tuple[StudyCheck, ...] = ()
    columns: tuple[str, ...] = ()
    """Further columns of participants.csv."""
    descriptions: dict[str, str] = {}
    """Their descriptions, where study.toml has them."""
    wizards: dict[str, str] = {}
    """The code of each wizard in exports."""
    retention: dict[str, float] = {}
    """Days after which `media` and `sessions` are due to be deleted."""
    robot: str = ""
    """A robot other than the scenario's. Empty: the scenario's."""
    recording: RecordingSettings = RecordingSettings()
    report: dict[str, str] = {}
    """Statements for the reporting sheet, by the name of the item (`[report]`)."""
    questionnaires: tuple[QuestionnaireSettings, ...] = ()
    hash: str = ""
    """SHA-256 of the parts of study.toml that affect sessions (`rise_engine.study.plan.content_hash`)."""
    design_hash: str = ""
    """SHA-256 of the parts that the plan depends on. It must not change once there is a plan."""


class Participant(Struct, frozen=True):
    """A row of participants.csv."""

    participant: str
    strata: dict[str, str] = {}
    consent: dict[str, str] = {}
    """The ISO date of each consent. Empty: not yet given."""
    status: str = ""
    """`invited`, `excluded` or empty, as written by people."""
    comment: str = ""
    line: int = 0
    columns: dict[str, str] = {}
    """Values of the further columns that study.toml names (`[participants] columns`)."""


class Slot(Struct, frozen=True):
    """A row of plan.csv: the assignment of one participant."""

    slot: int
    """1, 2, 3, ... over all strata."""
    strata: dict[str, str]
    """Empty where the plan has none."""
    levels: dict[str, str]
    """The level of each between factor. Empty with `minimise`, where it is drawn when the slot is taken."""
    order: tuple[str, ...]
    """The runs: within levels joined by `+`. One empty text if there is no within factor."""
    seed: int


class PlannedRun(Struct, frozen=True):
    """One planned session of a participant."""

    slot: int
    run: int
    """1, 2, ... in the order of the slot."""
    factors: dict[str, str]
    """The level of each factor, between and within."""
    condition: str
    """The levels' names joined by `+`, in the order of the factors. Empty if the study has none."""
    memory: dict[str, Json]
    scenario: str
    """Absolute folder."""
    seed: int
    """The session's seed, from the study's seed, the slot and the run."""


class SessionEntry(Struct, frozen=True):
    """A session of the study, as far as it is known."""

    participant: str
    run: int
    attempt: int
    """1 for the first session of this run, 2 for the next one after an abort."""
    purpose: Purpose
    folder: str
    """The name of its folder in the study's sessions."""
    started: str
    """ISO 8601."""
    status: Literal["running", "unfinished", "ended"]
    """unfinished: its engine has gone, and it was neither continued nor given up."""
    outcome: OutcomeStatus | None = None
    earlier_outcomes: tuple[OutcomeStatus, ...] = ()
    """Earlier outcomes in their order, if a later judgement changed them."""
    reason: str = ""
    seconds: float = 0.0
    """Session time of its last record."""
    condition: str = ""
    slot: int | None = None
    run_as: str = ""
    """The participant under whom it was run, if the log has reassigned it. `withdrawn`: they have withdrawn."""
    reassigned: str = ""
    """The reason for reassigning it. Empty: it was not reassigned."""


ParticipantState: TypeAlias = Literal[
    "waiting",
    "no-consent",
    "running",
    "unfinished",
    "to-judge",
    "to-go-on",
    "aborted",
    "complete",
    "excluded",
    "withdrawn",
]
"""A participant's progress. waiting: for the first session; no-consent: as waiting, but it cannot begin; running: now;
unfinished: a session did not end; to-judge: a session ended without outcome; to-go-on: further runs follow; aborted:
the last session was aborted and may be repeated; complete: all runs."""


class ParticipantStanding(Struct, frozen=True):
    """The progress of one participant."""

    participant: str
    state: ParticipantState
    why: str = ""
    """What blocks them, or why they no longer count, in a sentence."""
    strata: dict[str, str] = {}
    slot: int | None = None
    next_run: int | None = None
    """The run that would begin now. None: there is none."""
    next_attempt: int = 1
    runs: int = 1
    sessions: tuple[SessionEntry, ...] = ()
    """Counted sessions in their order."""


class CellStanding(Struct, frozen=True):
    """The progress of one cell of the plan."""

    strata: dict[str, str]
    condition: str
    """The condition from the between factors."""
    complete: int
    open: int
    """Participants who hold one of its slots and are not complete."""
    planned: int
    """Rows within the first `n`. 0: cells are drawn, or the sizes of strata are unknown."""


class StudyStanding(Struct, frozen=True):
    """The study's progress: the plan compared with what happened."""

    participants: tuple[ParticipantStanding, ...]
    """In the order of participants.csv, then those who are not in it (`unlisted`)."""
    cells: tuple[CellStanding, ...]
    complete: int
    wanted: int
    next: str = ""
    """The first participant who can begin. Empty: nobody."""
    unlisted: tuple[str, ...] = ()
    """Participants of the log who are not in participants.csv and have not withdrawn."""
    rehearsals: tuple[SessionEntry, ...] = ()
    """Sessions that do not count."""
    due: tuple[str, ...] = ()
    """Sentences about data due for deletion and other open tasks."""

"""A study as data: the design that people write, the plan that is made of it, and how the study stands.

Nothing here reads or writes; the files are those of `docs/reference/study.md`.
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


class Level(Struct, frozen=True):
    """One level of a factor: what the robot does in it."""

    name: str
    memory: dict[str, Json] = {}
    """Memory values that it sets before anything runs."""
    scenario: str = ""
    """Folder of the scenario that it runs, relative to the study's; empty: the study's own."""
    label: str = ""
    """What screens show instead of the name while the study is blinded; empty: the name."""
    description: str = ""
    """What it is, in words for readers of the data; empty: not said."""


class Factor(Struct, frozen=True):
    """Something that is varied."""

    name: str
    kind: FactorKind
    """between: one level for each participant. within: every participant has every level; each is a run, a session of
    its own."""
    levels: tuple[Level, ...]


class AssignmentSettings(Struct, frozen=True):
    """How participants come to their levels (`[assignment]`)."""

    between: BetweenMethod = "blocks"
    block: tuple[int, ...] = (1,)
    """Sizes of the permuted blocks, in multiples of the number of cells; drawn by the seed."""
    strata: tuple[str, ...] = ()
    """Columns of participants.csv within whose values the blocks are made."""
    within: WithinMethod = "williams"
    spare: float = 0.25
    """Rows of the plan beyond `n`, as a part of it."""
    hidden: bool = False
    """Screens show the condition only when the session begins."""


class StudyCheck(Struct, frozen=True):
    """Something that is looked at before or after each session (`[[check]]`); exactly one of ask, auto, run."""

    id: str
    when: Literal["before", "after"] = "before"
    ask: str = ""
    """A sentence that somebody confirms."""
    auto: str = ""
    """What the program itself looks at: one of `rise_engine.study.check_tables.AUTOMATIC`."""
    run: tuple[str, ...] = ()
    """A program and its arguments, run in the study's folder: exit status 0 is passed, its first line the value."""
    minimum: str = ""
    """For `disk`: the space that must be free, `20 GB`."""
    valid: float | None = None
    """Seconds that a passed check stays good (`every = "30 d"`); None: it is made for each session."""
    blocks: bool = True
    """Whether the session cannot begin when it failed, unless somebody skips it with a reason."""
    limit: float | None = None
    """Seconds that it may take (`limit = "2min"`); None: as usual for its kind (`rise_engine.checks.limit_seconds`)."""


class RecorderSettings(Struct, frozen=True):
    """One recorder (`camera = { by = "ffmpeg", ... }` in `[recording]`)."""

    name: str
    driver: str
    """Which recorder it is; the name, where `by` is not given."""
    options: dict[str, Json] = {}
    stalled_after: float | None = None
    """Seconds without growth after which it counts as stalled; None: as its driver says."""


class MarkerSettings(Struct, frozen=True):
    """What goes to LSL while the session runs (`lsl` in `[recording]`)."""

    scope: Literal["machine", "link", "site"] = "machine"
    """How far it can be seen."""
    payload: Literal["short", "json"] = "short"


class SyncSettings(Struct, frozen=True):
    """Marks that recordings show (`sync` in `[recording]`)."""

    start: bool = True
    end: bool = True
    medium: Literal["sound", "flash"] = "sound"
    play: tuple[str, ...] = ()
    """The program that plays the sound, with `{file}`; empty: one of those that are usual here."""


class RecordingSettings(Struct, frozen=True):
    """`[recording]`: what records a session of the study."""

    recorders: tuple[RecorderSettings, ...] = ()
    markers: MarkerSettings | None = None
    """None: nothing goes to LSL."""
    sync: SyncSettings | None = None
    """None: no marks."""
    folder: str = ""
    """Where recorders that name their file themselves put it, absolute: a folder for each session is made in there.
    Empty: into the session's own folder."""
    consent: str = "recording"
    """What a participant must have consented to before anything records them: `recording` is the column
    consent_recording."""


class ItemDescription(Struct, frozen=True):
    """What study.toml says of a column of a questionnaire."""

    about: str = ""
    levels: dict[str, str] = {}
    """Every value that it can have, and what each means; empty: any."""


class QuestionnaireSettings(Struct, frozen=True):
    """A questionnaire that participants fill in elsewhere (`[questionnaire.NAME]`)."""

    name: str
    file: str
    """From the study's folder on."""
    key: str = "participant"
    """The column that names the participant."""
    run: str = ""
    """The column that says after which run it was asked; empty: it is asked once."""
    columns: dict[str, ItemDescription] = {}
    leave_out: tuple[str, ...] = ()
    """Columns that no export tells."""
    about: str = ""
    """What it is, as a paper would name it."""


class Study(Struct, frozen=True):
    """A checked study.toml."""

    folder: str
    """Absolute."""
    title: str
    id: str
    """Letters and digits."""
    seed: int
    n: int
    """Complete participants that are wanted."""
    scenario: str
    """The scenario's folder, relative to the study's."""
    mode: Mode
    factors: tuple[Factor, ...] = ()
    """In the order of the file."""
    assignment: AssignmentSettings = AssignmentSettings()
    strata: dict[str, tuple[str, ...]] = {}
    """The values of each stratum, by column."""
    consent: tuple[str, ...] = ()
    """What must be consented to: `study` is the column consent_study."""
    checks: tuple[StudyCheck, ...] = ()
    columns: tuple[str, ...] = ()
    """Further columns of participants.csv."""
    descriptions: dict[str, str] = {}
    """What each of these holds, in words, where study.toml says it."""
    wizards: dict[str, str] = {}
    """What exports call each wizard."""
    retention: dict[str, float] = {}
    """Days after which `media` and `sessions` are due to be deleted."""
    robot: str = ""
    """Another robot than the scenario's; empty: the scenario's."""
    recording: RecordingSettings = RecordingSettings()
    report: dict[str, str] = {}
    """What people must say for the reporting sheet, by the name of its item (`[report]`)."""
    questionnaires: tuple[QuestionnaireSettings, ...] = ()
    hash: str = ""
    """SHA-256 of what study.toml says about sessions (`rise_engine.study.design.content_hash`)."""
    design_hash: str = ""
    """SHA-256 of what the plan is made of: it must not change once there is a plan."""


class Participant(Struct, frozen=True):
    """A row of participants.csv."""

    participant: str
    strata: dict[str, str] = {}
    consent: dict[str, str] = {}
    """ISO date by what was consented to; empty: not yet."""
    status: str = ""
    """`invited`, `excluded` or empty, as people wrote it."""
    comment: str = ""
    line: int = 0
    columns: dict[str, str] = {}
    """Values of the further columns that study.toml names (`[participants] columns`)."""


class Slot(Struct, frozen=True):
    """A row of plan.csv: what one participant gets."""

    slot: int
    """1, 2, 3, ... over all strata."""
    strata: dict[str, str]
    """Empty where the plan has none."""
    levels: dict[str, str]
    """The level of each between factor; empty with `minimise`, where it is drawn when the slot is taken."""
    order: tuple[str, ...]
    """What the runs are, the levels of the within factors joined by `+`; one empty text where there is none."""
    seed: int


class PlannedRun(Struct, frozen=True):
    """One session of a participant, as the plan has it."""

    slot: int
    run: int
    """1, 2, ... in the slot's order."""
    factors: dict[str, str]
    """The level of every factor, between and within."""
    condition: str
    """The levels' names joined by `+`, in the order of the factors; empty where the study has none."""
    memory: dict[str, Json]
    scenario: str
    """Absolute folder."""
    seed: int
    """Of the session: drawn from the study's seed, the slot and the run."""


class SessionEntry(Struct, frozen=True):
    """A session of the study, as far as it is known."""

    participant: str
    run: int
    attempt: int
    """1 for the first session of this run, 2 for the next one after an abort."""
    purpose: Purpose
    folder: str
    """Its folder's name in the study's sessions."""
    started: str
    """ISO 8601."""
    status: Literal["running", "unfinished", "ended"]
    """unfinished: its engine has gone, and nobody has gone on with it or given it up."""
    outcome: OutcomeStatus | None = None
    reason: str = ""
    seconds: float = 0.0
    """Session time of its last record."""
    condition: str = ""
    slot: int | None = None
    reassigned: str = ""
    """Under whom it was run and why it was reassigned, in a sentence; empty: it was not."""


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
"""How somebody stands: waiting for the first session; no-consent: as waiting, but it could not begin; running now;
unfinished: a session did not end; to-judge: a session ended without outcome; to-go-on: further runs are to come;
aborted: the last one was, and may be run again; complete: every run."""


class ParticipantStanding(Struct, frozen=True):
    """How one participant stands."""

    participant: str
    state: ParticipantState
    why: str = ""
    """What hinders them, in a sentence, or why they are out."""
    strata: dict[str, str] = {}
    slot: int | None = None
    next_run: int | None = None
    """The run that would begin now; None: none."""
    next_attempt: int = 1
    runs: int = 1
    sessions: tuple[SessionEntry, ...] = ()
    """Counted ones, in their order."""


class CellStanding(Struct, frozen=True):
    """How many of a cell of the plan are done."""

    strata: dict[str, str]
    condition: str
    """Of the between factors."""
    complete: int
    open: int
    """Participants who hold a slot in it and are not complete."""
    planned: int
    """Rows within the first `n`; 0 where cells are drawn, and where nobody knows how many of each stratum come."""


class StudyStanding(Struct, frozen=True):
    """How the study stands: the plan against what happened."""

    participants: tuple[ParticipantStanding, ...]
    """In the order of participants.csv."""
    cells: tuple[CellStanding, ...]
    complete: int
    wanted: int
    next: str = ""
    """Who is next: the first who can begin; empty: nobody."""
    rehearsals: tuple[SessionEntry, ...] = ()
    """Sessions that do not count."""
    due: tuple[str, ...] = ()
    """What is due to be deleted, and other things that somebody must do, in sentences."""

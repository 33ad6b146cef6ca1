"""A checked scenario as plain, immutable values.

The words are the paper's (section 4.2): a CommunicationRobotAct (here `Act`) is a graph of BehaviorActions (`Action`),
an InteractionRule (`Rule`) is a state machine, the WorkingMemory is a JSON object. Nothing here depends on time, robot,
screen or file system; `rise_engine.scenario.loader.load` builds these values from a folder.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cached_property
from typing import Any, Literal, TypeAlias

from msgspec import Struct, field

from rise_engine.base.text import pluralize
from rise_engine.expression import Assignment, Expression
from rise_engine.scenario.explore_settings import ExploreSettings, StudyProperty, TrialSettings
from rise_engine.scenario.source_location import SourceLocation as SourceLocation
from rise_engine.scenario.source_location import TemplateLocation as TemplateLocation
from rise_engine.scenario.speech.template import Template

Json: TypeAlias = Any
"""A JSON value: null, boolean, integer, number, string, array or object."""

Mode: TypeAlias = Literal["debug", "real"]
CallingType: TypeAlias = Literal["None", "Blocking"]
ActOutcome: TypeAlias = Literal["succeeded", "failed", "stopped"]
"""How an act ends (semantics.md 6.1)."""
ParameterType: TypeAlias = Literal["text", "number", "integer", "boolean", "name"]


# --- actions: what robots can do ------------------------------------------------------------------------------------


class Parameter(Struct, frozen=True):
    """One parameter of an action, as declared by the engine's core actions, a robot profile or a scenario."""

    name: str
    type: ParameterType
    unit: str = ""
    """For people and adapters: `m`, `rad`, `ms`, or empty."""
    default: Json = None
    """The robot's value if the author omits the parameter; null: the robot chooses."""
    required: bool = False
    minimum: float | None = None
    maximum: float | None = None
    codes: dict[str, int] = field(default_factory=dict)
    """For `name` parameters: the known names with RISE's number for each. Authors may write either."""
    names: tuple[str, ...] = ()
    """For `name` parameters: further names without a number (a robot's own animations)."""
    help: str = ""
    place: bool = False
    """For `name` parameters: whether the places of the robot and the study are also valid names."""
    spoken: bool = False
    """For `text` parameters: whether people hear or read it, so that it must be translated."""


class ActionSpec(Struct, frozen=True):
    """An action that a CRA can contain, declared as data (semantics.md 2.1)."""

    name: str
    parameters: dict[str, Parameter]
    channels: tuple[str, ...] = ()
    """The robot's channels that it occupies: speech, gaze, face, ... Acts with a common one can conflict."""
    engine: bool = False
    """True for `Wait`, which runs in the engine and never reaches the robot."""
    supported: bool = True
    """False if the scenario's robot cannot perform it."""
    substitute: str | None = None
    """The action that this robot performs instead (a head without hands points with its gaze)."""
    seconds: float = 2.0
    """Seconds of one execution if its parameters do not determine them (see `expected_seconds`)."""
    limit: float | None = None
    """Seconds after which a running action counts as timed out; null: derived from its expected duration."""
    ssml: bool = False
    """Whether its `message` may be SSML; otherwise the robot gets only the words."""
    carrier: dict[str, Json] = field(default_factory=dict)
    """Settings for the adapter (for ROS: action name, type and field mapping). The engine ignores them."""
    help: str = ""


SIMULATED = "simulated"
"""The driver that moves no robot."""


class RobotProfile(Struct, frozen=True):
    """A robot as data: its actions, and the driver that connects to it."""

    name: str
    title: str
    driver: str
    actions: dict[str, ActionSpec]
    """All actions of a scenario with this robot by name, including the unsupported ones, marked as such."""
    options: dict[str, Json] = field(default_factory=dict)
    """Settings for the driver only."""
    places: dict[str, dict[str, float | str]] = field(default_factory=dict)
    """The properties of each place that an action can name: `x`, `y`, `yaw`, `frame`, ..."""


# --- CRA ------------------------------------------------------------------------------------------------------------


class ActionCall(Struct, frozen=True):
    """One action with its parameters, as written. Memory values are filled in when it starts."""

    type: str
    parameters: dict[str, Template]


class Action(Struct, frozen=True):
    """A node of an act's graph. It starts when all actions in `wait_for` have ended."""

    id: str
    calls: tuple[ActionCall, ...]
    """One call, or several for `<Variants>`, of which each start picks one."""
    wait_for: tuple[str, ...] = ()
    continue_on_failure: bool = False
    location: SourceLocation = field(default=SourceLocation(""), name="place")


class Act(Struct, frozen=True, dict=True):
    """A CommunicationRobotAct (paper, section 4.2.1)."""

    name: str
    actions: tuple[Action, ...]
    """In file order, which only breaks ties."""
    channels: frozenset[str] = frozenset()
    """All channels that its actions occupy on the scenario's robot."""
    location: SourceLocation = field(default=SourceLocation(""), name="place")

    @cached_property
    def successors(self) -> dict[str, list[Action]]:
        """The actions that wait for an action, by its id, in file order."""
        found: dict[str, list[Action]] = {}
        for action in self.actions:
            for id in dict.fromkeys(action.wait_for):
                found.setdefault(id, []).append(action)
        return found


# --- IR -------------------------------------------------------------------------------------------------------------

FunctionName: TypeAlias = Literal[
    "startCommunicationRobotAct",
    "stopCommunicationRobotAct",
    "startInteractionRule",
    "stopInteractionRule",
    "raiseEventTopic",
    "assignValue",
]


class Function(Struct, frozen=True, tag="function"):
    """One call in a rule: a DomainTask that the rule submits."""

    name: FunctionName
    argument: str
    """As written; event topics keep their slash."""
    assignment: Assignment | None = None
    """Only for `assignValue`."""
    location: SourceLocation = field(default=SourceLocation(""), name="place")
    state: str | None = None
    """Only for `startInteractionRule`: the state in which the rule begins; null: its initial state."""
    enter: bool = True
    """Only for `startInteractionRule`: False if the rule waits there without running `onEntry`."""
    keep: float | None = None
    """Only for `raiseEventTopic`: seconds for which the event is kept if no rule waits for it."""

    @property
    def behavior(self) -> str:
        """The behaviour of the task that it submits."""
        if self.keep is not None:
            return event_behavior(self.argument, self.keep)
        return rule_start_behavior(self.argument, self.state, self.enter)


class Branch(Struct, frozen=True):
    """An arm of an `if`. The last one may have no condition (`else`)."""

    condition: Expression | None
    block: tuple[Statement, ...]


class If(Struct, frozen=True, tag="if"):
    """Runs the first branch whose condition holds."""

    branches: tuple[Branch, ...]
    location: SourceLocation = field(default=SourceLocation(""), name="place")


class OneOf(Struct, frozen=True, tag="oneOf"):
    """Runs one of its children, picked by the session's seeded random source."""

    choices: tuple[Statement, ...]
    location: SourceLocation = field(default=SourceLocation(""), name="place")


Statement: TypeAlias = Function | If | OneOf
Block: TypeAlias = tuple[Statement, ...]


class Delay(Struct, frozen=True):
    """The time of an `after`: fixed seconds, or the value of an expression."""

    text: str
    """As written: `8s`, `{pause}`, `{patience}ms`."""
    seconds: float | None = None
    expression: Expression | None = None
    """Used instead of the seconds."""
    unit: float | None = None
    """Seconds per unit of the expression's number; null: it is a number of seconds, or a text such as `2s`."""


ALWAYS = "true"
"""The condition of a transition that waits for nothing."""


class Transition(Struct, frozen=True):
    """A transition. At most one of `event`, `ended` and `after` is set; if none is, the condition alone triggers it."""

    event: str | None = None
    """The topic without its leading slash."""
    condition: Expression | None = None
    after: Delay | None = None
    """Minimum time of the rule in the state, or of `held`."""
    target: str | None = None
    """The next state; null: the functions run without leaving the state."""
    block: Block = ()
    location: SourceLocation = field(default=SourceLocation(""), name="place")
    ended: str | None = None
    """The act whose end it waits for: the latest one of that name that this rule has started."""
    outcomes: tuple[ActOutcome, ...] = ()
    """With `ended`, the awaited outcomes; empty: any."""
    held: Expression | None = None
    """With `after`, the condition that must hold during that time (`while`)."""

    @property
    def is_eventless(self) -> bool:
        """Whether its condition alone triggers it."""
        return self.event is None and self.ended is None and self.after is None

    @property
    def expressions(self) -> list[Expression]:
        """Its condition, its held condition and its computed time, if it has them."""
        delay = self.after.expression if self.after is not None else None
        return [each for each in (self.condition, self.held, delay) if each is not None]


class State(Struct, frozen=True):
    """A state of a rule. Without transitions, it ends the rule after `on_entry`."""

    id: str
    on_entry: Block = ()
    on_exit: Block = ()
    transitions: tuple[Transition, ...] = ()
    location: SourceLocation = field(default=SourceLocation(""), name="place")

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Its blocks: on entry, on exit, and of each transition."""
        return (self.on_entry, self.on_exit, *(transition.block for transition in self.transitions))


class Rule(Struct, frozen=True):
    """An InteractionRule (paper, section 4.2.2)."""

    name: str
    initial: str
    states: dict[str, State]
    priority: float = 0
    """A larger priority starts the rule nearer the top of the stack."""
    location: SourceLocation = field(default=SourceLocation(""), name="place")

    @property
    def functions(self) -> Iterator[Function]:
        """All functions in it."""
        return (each for state in self.states.values() for block in state.blocks for each in functions_in(block))


# --- the whole ------------------------------------------------------------------------------------------------------


class TranslatedColumn(Struct, frozen=True):
    """A column of a table in another language, `text.de` beside `text`."""

    values: list[Json]
    """One for each row; null: not translated."""
    location: SourceLocation = field(default=SourceLocation(""), name="place")
    """The place of the first missing value, or else of the column's name."""


class Table(Struct, frozen=True, dict=True):
    """A table of `tables/`: read-only memory (docs/reference/scenario.md)."""

    name: str
    """Its key in the memory."""
    columns: tuple[str, ...]
    rows: list[list[Json]]
    """The values of each row, in the order of the columns."""
    location: SourceLocation = field(default=SourceLocation(""), name="place")
    translations: dict[str, dict[str, TranslatedColumn]] = {}
    """By language and translated column; empty in a scenario, which has one language."""

    def in_language(self, language: str) -> Table:
        """The table for a session in this language, with its translations."""
        if not self.translations:
            return self
        given = self.translations.get(language, {})
        columns = [given[column].values if column in given else [None] * len(self.rows) for column in self.columns]
        rows = [
            [value if other is None else other for value, other in zip(row, others, strict=True)]
            for row, others in zip(self.rows, zip(*columns, strict=True), strict=True)
        ]
        return Table(self.name, self.columns, rows, self.location)

    @cached_property
    def records(self) -> list[dict[str, Json]]:
        """The rows for expressions: one object each. Never change them."""
        return [dict(zip(self.columns, row, strict=True)) for row in self.rows]

    @property
    def size_text(self) -> str:
        """Its size, for people and for records."""
        return f"{pluralize(len(self.rows), 'row')} x {pluralize(len(self.columns), 'column')}"


class KeyBinding(Struct, frozen=True):
    """A key of the scenario and the DomainTask that it submits."""

    key: str
    """In Textual's spelling: `1`, `n`, `full_stop`, `f2`."""
    label: str
    """As written in `scenario.toml`: `.`"""
    function: FunctionName
    behavior: str
    location: SourceLocation = field(default=SourceLocation(""), name="place")
    title: str = ""
    """Its meaning in the study, in the author's words (`label = "not understood"`); empty: none."""
    state: str | None = None
    """For a key that starts a rule: the state in which the rule begins; null: its initial state."""
    enter: bool = True
    """For a key that starts a rule: False if the rule waits there without running `onEntry`."""
    keep: float | None = None
    """For a key that raises an event: seconds for which the event is kept if no rule waits for it."""

    @property
    def task_behavior(self) -> str:
        """The behaviour of the task that it submits; `behavior` is the name in it."""
        if self.keep is not None:
            return event_behavior(self.behavior, self.keep)
        return rule_start_behavior(self.behavior, self.state, self.enter)


class ActSettings(Struct, frozen=True):
    """Settings of one act for the console and the scheduler (`[act.NAME]` in scenario.toml)."""

    hold: bool = False
    debounce: float = 0.5
    """Seconds within which a second press of its key counts as the same press."""
    filler: bool = False
    answers: bool = True
    """Whether it answers the participant's cue; a filler never does."""
    calling_type: CallingType = "Blocking"
    """Used if the request does not set a calling type."""
    on_failure: str = ""
    """The reaction to its failure, as in `Scenario.on_failure`; empty: the scenario's."""


class FailurePolicy(Struct, frozen=True):
    """The reaction to the failure of an act (`on_failure` in scenario.toml)."""

    kind: Literal["go_on", "ask", "repeat"]
    times: int = 0
    """Maximum number of repetitions."""


def parse_failure_policy(text: str) -> FailurePolicy:
    """`go_on`, `ask`, or `repeat:2`. Raises ValueError for anything else."""
    if text in ("go_on", "ask"):
        return FailurePolicy(text)  # type: ignore[arg-type]
    word, _, number = text.partition(":")
    if word == "repeat" and number.isascii() and number.isdigit() and 1 <= int(number[:3]) <= MAX_REPEATS:
        return FailurePolicy("repeat", int(number[:3]))
    raise ValueError(text)


MAX_REPEATS = 10
"""Maximum number of automatic repetitions of a failed act."""


class FillerSettings(Struct, frozen=True):
    """When a filler is needed after the participant's cue (`[fillers]` in scenario.toml)."""

    offer_after: float = 1.5
    """Seconds after which the console offers the next one; 0: never."""
    auto_after: float | None = None
    """Seconds after which the engine starts the next one itself, if nothing else is running; null: never."""


class LexiconTable(Struct, frozen=True):
    """The pronunciation of words of one language (a table of lexicon.toml)."""

    language: str
    """A BCP 47 tag; `en` applies to texts in `en-GB` too."""
    robot: str
    """The only robot that uses it; empty: all robots."""
    words: dict[str, str]
    """The text for the robot, by word in Unicode's normal form C with single blanks."""


class Condition(Struct, frozen=True):
    """A condition of the study (`[conditions.NAME]` in scenario.toml)."""

    memory: dict[str, Json] = field(default_factory=dict)
    """Whole memory keys with the values at a session's start, instead of the start values."""
    label: str = ""
    """Its name on screens; empty: the name."""
    label_only: bool = False
    """Whether it sets nothing on purpose, because the difference is outside the robot."""
    location: SourceLocation = field(default=SourceLocation(""), name="place")


class Scenario(Struct, frozen=True):
    """A checked scenario, complete and immutable, as built by `load`. Its parts are found by name.

    >>> from rise_engine.scenario.loader import load
    >>> scenario = load("scenarios/greeting").scenario
    >>> scenario.robot.name, scenario.mode
    ('floka', 'debug')
    >>> scenario.acts["R_Nod"].actions[0].calls[0].type
    'Animation'
    """

    title: str
    folder: str
    """Absolute path of the folder that it was read from."""
    mode: Mode
    robot: RobotProfile
    acts: dict[str, Act]
    rules: dict[str, Rule]
    memory: dict[str, Json]
    """The start values, in file order."""
    keys: dict[str, KeyBinding] = field(default_factory=dict)
    """By Textual key name."""
    act_settings: dict[str, ActSettings] = field(default_factory=dict)
    fillers: FillerSettings = FillerSettings()
    cue_keep: float | None = None
    """Seconds for which the participant's cue is kept if no rule waits for it; null: not at all (`[cue]`)."""
    study: dict[str, Json] = field(default_factory=dict)
    """`participants` and `conditions` from `[study]`."""
    conditions: dict[str, Condition] = field(default_factory=dict)
    """By name, in the order of `[study] conditions`, or else of the file. Names without a table, as in scenarios of
    earlier versions, are omitted."""
    private: frozenset[str] = frozenset()
    """Whole memory keys with personal values, which are removed from data for others."""
    language: str = ""
    """The language of its texts (BCP 47): that of the acts or of the chosen translation; empty: not set."""
    lexicon: tuple[LexiconTable, ...] = ()
    may_release: tuple[str, ...] = ()
    """Programs that may release a stop without control: full names of ROS nodes, names of programs on the link."""
    tables: dict[str, Table] = field(default_factory=dict)
    """Read-only memory, by key."""
    paths: dict[str, str] = field(default_factory=dict)
    """The places from which `acts`, `rules` and `memory` were read, relative to the folder."""
    on_failure: str = "go_on"
    """The reaction to the failure of an act: `go_on`, `ask` or `repeat:2`. Acts may have their own setting."""
    known_keys: frozenset[str] = frozenset()
    """Memory keys that the start values or the scenario can set."""
    keys_read: frozenset[str] = frozenset()
    """Memory keys that the scenario reads, up to their first dot."""
    reads_session: bool = False
    """Whether it reads the engine's values under `session` (semantics.md 7.2)."""
    factors_read: frozenset[str] = frozenset()
    """Factors of a study that the scenario reads: `pace` for `session.factors.pace`."""
    topics: frozenset[str] = frozenset()
    """Event topics (without slash) that some transition waits for."""
    hash: str = ""
    """SHA-256 of all files in a fixed order, and of the requested language. Scenarios with the same hash are the same
    study."""
    languages: tuple[str, ...] = ()
    """The languages of its translations."""
    says_language: bool = False
    """Whether `language` was requested; then the robot gets it with each action that speaks."""
    explore: ExploreSettings = ExploreSettings()
    """The settings of `rise-engine explore`. Sessions use neither these nor the properties."""
    properties: tuple[StudyProperty, ...] = ()
    """The properties of the study, in file order."""
    trials: TrialSettings | None = None
    """The definition of a trial; None: scenario.toml has none. Exports use it, sessions do not."""

    @property
    def table_memory(self) -> dict[str, Json]:
        """The tables in the form of memory, by key."""
        return {name: table.records for name, table in self.tables.items()}

    def settings_of(self, act: str) -> ActSettings:
        """The settings of an act, by default those of `ActSettings`; never raises."""
        return self.act_settings.get(act, _DEFAULT_SETTINGS)

    def failure_policy(self, act: str) -> FailurePolicy:
        """The reaction to a failure of this act."""
        return parse_failure_policy(self.settings_of(act).on_failure or self.on_failure)


_DEFAULT_SETTINGS = ActSettings()


SESSION = "session"
"""The memory key for the engine's values about the session (semantics.md 7.2)."""
SESSION_STATES = ("speaking", "cue", "stopped")
"""The parts of it that change while a session runs."""

CUE_TOPICS = ("cue", "cue_undone")
"""The events at the end of the participant's turn, and when the mark is undone (semantics.md 4.2)."""


def statements_in(block: Block) -> Iterator[Statement]:
    """Yield all statements of a block, including those in branches and choices, in the order of the file."""
    pending = [*reversed(block)]
    while pending:
        statement = pending.pop()
        yield statement
        if isinstance(statement, If):
            for branch in reversed(statement.branches):
                pending += reversed(branch.block)
        elif isinstance(statement, OneOf):
            pending += reversed(statement.choices)


def functions_in(block: Block) -> Iterator[Function]:
    """Yield all functions of a block, including those in branches and choices, in the order of the file."""
    return (each for each in statements_in(block) if isinstance(each, Function))


def conditions_in(block: Block) -> Iterator[Expression]:
    """Yield the conditions of all branches of a block, in the order of the file."""
    ifs = (each for each in statements_in(block) if isinstance(each, If))
    return (branch.condition for each in ifs for branch in each.branches if branch.condition is not None)


def rule_start_behavior(rule: str, state: str | None, enter: bool) -> str:
    """The behaviour of a task that starts a rule: the rule's name, or JSON with state and `enter` if needed."""
    if state is None and enter:
        return rule
    parts: dict[str, Json] = {"rule": rule} | ({} if state is None else {"state": state})
    return json.dumps(parts if enter else {**parts, "enter": False}, ensure_ascii=False)


def event_behavior(event: str, keep: float) -> str:
    """The behaviour of a task that raises an event and keeps it for this many seconds."""
    return json.dumps({"event": event, "keep": f"{keep:g}s"}, ensure_ascii=False)


def result_topics(rule: Rule) -> Iterator[tuple[str, str]]:
    """Yield the states that end a rule, each with the event that reports it (semantics.md 6.1)."""
    return ((state.id, f"{rule.name}_{state.id}") for state in rule.states.values() if not state.transitions)


def normal_topic(topic: str) -> str:
    """A topic without its leading slash: `/A_end` and `A_end` are one topic (semantics.md 6.1)."""
    return topic.strip().removeprefix("/")

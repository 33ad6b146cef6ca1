"""The facts of a session's report, counted from its data: waiting times, acts, rules, mistakes, faults. No drawings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise

from msgspec import Struct

from rise_engine.kernel.records import (
    ENGINE,
    ActionStatus,
    ControlRecord,
    FailureRecord,
    Mark,
    RobotRecord,
    RuleRecord,
    StopRecord,
)
from rise_engine.results.analysis.course import interruption_between, seconds_without_engine
from rise_engine.results.analysis.model import (
    ActorKind,
    Cue,
    Interruption,
    InterruptionKind,
    Phase,
    PlayedAct,
    SessionData,
)
from rise_engine.results.analysis.statistics import Share, Summary, share_over, summarise


class Band(Struct, frozen=True):
    """A range of latencies, from the previous band up to a limit."""

    limit: float
    """Seconds. Infinite for the last band."""
    name: str
    """`up to 1 s`."""
    short: str
    """The name in a drawing: `1 s`."""
    known: str
    """The known facts about it."""


class Source(Struct, frozen=True):
    """A publication behind the bands."""

    citation: str
    doi: str = ""
    """Empty: it has none."""
    found: str = ""
    """Its finding in our words."""


BANDS = (
    Band(
        0.25,
        "up to 0.25 s",
        "0.25",
        "between people, the gap between turns is about 0.2 s in every language studied",
    ),
    Band(
        1.0,
        "up to 1 s",
        "1",
        "people like answers of a robot best up to 1 s, without a difference below it; between people, an answer after "
        "about 0.6 s sounds less willing",
    ),
    Band(
        2.0,
        "up to 2 s",
        "2",
        "a robot should react within 2 s; people like a longer wait less, unless a filler fills it",
    ),
    Band(4.0, "up to 4 s", "4", "a wait that people notice; a filler makes it seem shorter"),
    Band(float("inf"), "above 4 s", "", "one small study found it less fluent, not significantly"),
)

SOURCES = (
    Source(
        "Stivers et al. 2009, PNAS 106(26), 10587–10592",
        "10.1073/pnas.0903616106",
        "in ten languages, each mean gap is within 0.25 s of the overall mean",
    ),
    Source(
        "Levinson & Torreira 2015, Frontiers in Psychology 6:731",
        "10.3389/fpsyg.2015.00731",
        "gaps of about 0.2 s, although planning a word takes more than 0.6 s",
    ),
    Source(
        "Templeton et al. 2022, PNAS 119(4), e2116915119",
        "10.1073/pnas.2116915119",
        "answers within 0.25 s go with feeling connected",
    ),
    Source(
        "Roberts, Margutti & Takano 2011, Discourse Processes 48(5), 331–354",
        "10.1080/0163853X.2011.558002",
        "after 0.6 s and 1.2 s speakers are rated less willing, in English, Italian and Japanese",
    ),
    Source(
        "Kendrick & Torreira 2015, Discourse Processes 52(4), 255–289",
        "10.1080/0163853X.2014.955997",
        "most late answers are not the hoped-for ones",
    ),
    Source(
        "Shiwa et al. 2008, HRI, 153–160; 2009, International Journal of Social Robotics 1, 141–155",
        "",
        "best liked at 1 s; a robot should react within 2 s; a filler moderates the wait",
    ),
    Source(
        "Stedtler et al. 2024, HRI companion, 1013–1017",
        "",
        "waits of 4 s and 10 s lowered the fluency that people perceived, not significantly (17 people)",
    ),
    Source(
        "Thesis, Utrecht University, handle 20.500.12932/18293",
        "",
        "with fillers a robot seemed faster and livelier to children, and the wizard was calmer",
    ),
)

CAVEATS = (
    "A person marks each cue with a key. Their own delay is unknown and part of every latency.",
    "The robot confirms an action before people hear or see it. The first sound comes later.",
    "Measure it in a recording.",
    "The bands come from speech, between people and with few robots, in Japanese, English and other European samples.",
    "They give orientation and test nothing.",
)


def band_of(seconds: float) -> int:
    """Return the index of a latency's band. A band includes its limit.

    >>> [band_of(each) for each in (0.25, 0.26, 1.0, 60.0)]
    [0, 1, 1, 4]
    """
    return next(at for at, band in enumerate(BANDS) if seconds <= band.limit)


BIN = 0.25
"""The width of a histogram's bin in seconds."""
LAST_BIN = 6.0
"""The start of the last bin in seconds; it counts all larger values."""
LIMITS = (1.0, 2.0)
"""Limits in seconds; reports show the shares above them."""


class LatencyPart(Struct, frozen=True):
    """One part of a latency."""

    name: str
    about: str
    """Its start and end."""
    values: tuple[float, ...]

    @property
    def summary(self) -> Summary | None:
        return summarise(self.values)

    def over(self, limit: float) -> Share:
        """Return the share above that many seconds."""
        return share_over(self.values, limit)


class LatencyFacts(Struct, frozen=True):
    """The latencies of acts that answered a cue, and separately those of fillers."""

    parts: tuple[LatencyPart, ...]
    """wizard, way, rules (no key: without a key), queue, robot, voice. Only of answers; their sum is the response."""
    response: LatencyPart
    to_filler: LatencyPart
    """Seconds from the cue to the first filler."""
    after_filler: LatencyPart
    """Seconds from the cue to the answer (`PlayedAct.answer_s`), for cues with a filler."""
    without_filler: LatencyPart
    """The same for cues without a filler."""
    in_bands: tuple[int, ...]
    """The number of responses in each of `rise_engine.results.report.session_facts.BANDS`."""
    before_cue: int
    """Answers that were requested before their cue. No latency includes them."""
    interrupted: dict[InterruptionKind, int]
    """Other answers whose wait was interrupted, by interruption. No latency includes them."""


def latencies(acts: Iterable[PlayedAct], cues: Iterable[Cue] = ()) -> LatencyFacts:
    """Compute the numbers of answers and fillers.

    :param acts: all acts of one or several sessions; those that answered no cue are ignored.
    :param cues: the cues of the same sessions.
    """
    acts = list(acts)
    found = answers(acts)
    omitted = [act for act in acts if act.answer_s is None and not act.filler and act.response_s is not None]
    marked = [cue for cue in cues if cue.undone_at is None]
    waits = [(cue, cue.answer_s) for cue in marked]
    parts = (
        _part("wizard", "cue to key", [act.wizard_s for act in found]),
        _part("way", "key to engine", [act.way_s for act in found]),
        _part("rules", "engine to request", [act.rules_s for act in found if act.key_at is not None]),
        _part("no key", "cue to request", [act.rules_s for act in found if act.key_at is None]),
        _part("queue", "request to turn", [act.queue_s for act in found]),
        _part("robot", "turn to confirmation", [act.robot_s for act in found]),
        _part("voice", "confirmation to voice", [act.voice_s for act in found if act.speaks]),
    )
    response = _part("response", "cue to answer", [act.response_s for act in found])
    counts = [band_of(value) for value in response.values]
    return LatencyFacts(
        parts=parts,
        response=response,
        to_filler=_part(
            "filler", "cue to filler", [round(cue.filled_at - cue.at, 6) for cue in marked if cue.filled_at is not None]
        ),
        after_filler=_part(
            "with a filler", "cue to answer", [wait for cue, wait in waits if cue.filled_at is not None]
        ),
        without_filler=_part("without", "cue to answer", [wait for cue, wait in waits if cue.filled_at is None]),
        in_bands=tuple(counts.count(at) for at in range(len(BANDS))),
        before_cue=sum(act.before_cue for act in omitted),
        interrupted=dict(
            Counter(act.response_interrupted for act in omitted if act.response_interrupted and not act.before_cue)
        ),
    )


def answers(acts: Iterable[PlayedAct]) -> list[PlayedAct]:
    """Return the acts that answered a cue at a known time (`PlayedAct.answer_s`)."""
    return [act for act in acts if act.answer_s is not None]


def histogram(values: Iterable[float]) -> list[int]:
    """Count the values in each bin of `BIN` seconds up to `LAST_BIN`, and beyond it in the last bin.

    A bin includes its lower limit but not its upper one.
    """
    counts = [0] * (round(LAST_BIN / BIN) + 1)
    for value in values:
        counts[min(max(0, int(value / BIN)), len(counts) - 1)] += 1
    return counts


def _part(name: str, about: str, values: Sequence[float | None]) -> LatencyPart:
    return LatencyPart(name, about, tuple(value for value in values if value is not None))


MARKS: tuple[Mark, ...] = ("wrong", "late", "early", "double")
FREE_SPEECH = "say"
_NOT_DONE: tuple[ActionStatus, ...] = ("failed", "timed-out", "lost")


class ActFacts(Struct, frozen=True):
    """All requests of one act."""

    name: str
    begun: int
    """How often its turn came."""
    by: dict[ActorKind, int]
    """How often each kind of actor caused it."""
    statuses: dict[str, int]
    """The final statuses of its requests."""
    length: Summary | None
    """Seconds from its turn to its end, for uninterrupted requests that succeeded."""
    response: Summary | None
    """Seconds from a cue, for requests that answered one."""
    marks: dict[str, int]
    """The mistakes that wizards marked on them."""
    fillers: int = 0


class StateFacts(Struct, frozen=True):
    """How often and how long a rule was in a state."""

    rule: str
    state: str
    visits: int
    seconds: float
    """The sum of all visits in session time."""
    each: Summary | None
    """The visits without an interruption."""
    stepped_back: int = 0
    outage_s: float = 0.0
    """Seconds without an engine during the visits, in which session time stood still."""


class MistakeFacts(Struct, frozen=True):
    """Mistakes, as marked by wizards and as shown by the record."""

    marks: dict[str, int]
    """All marks by kind of mistake."""
    marked: Share
    """The share of wizards' keys that were marked, or whose acts were."""
    rejected: int
    """Acts that were requested and rejected."""
    canceled: int
    """Acts that were stopped before their end."""
    actions_failed: dict[str, int]
    """Actions by kind of failure: failed, timed-out, lost."""
    aborted: int
    """Acts that failed."""
    failures: int
    """Failed acts that needed a person's decision."""
    rules_faulted: int
    stops: int
    robot_lost: int
    robot_degraded: int
    """How often a connected robot degraded to partial answers."""
    control_changes: int
    """How often control passed from one person to another."""


class SessionFigures(Struct, frozen=True):
    """All counts of one session."""

    latency: LatencyFacts
    by_source: tuple[LatencyPart, ...]
    """Responses by actor, the most frequent first."""
    acts: tuple[ActFacts, ...]
    states: tuple[StateFacts, ...]
    mistakes: MistakeFacts
    actors: dict[ActorKind, int]
    """Acts whose turn came, by actor."""
    cues: int
    """The number of cues that were not undone."""
    answered: int
    free_speech_share: Share
    """The share of the robot's speech that a wizard typed."""


def session_figures(data: SessionData) -> SessionFigures:
    """Count everything in a session.

    :param data: one session at any level, because the counts do not depend on texts.
    """
    begun = [act for act in data.acts if act.started_at is not None]
    actors = Counter(act.actor for act in begun)
    cues = [cue for cue in data.cues if cue.undone_at is None]
    spoken = [act for act in begun if act.speaks]
    return SessionFigures(
        latency=latencies(data.acts, data.cues),
        by_source=_by_source(data.acts),
        acts=tuple(_act_facts(data.acts, data.interruptions)),
        states=tuple(_state_facts(data)),
        mistakes=_mistakes(data, begun),
        actors=dict(actors.most_common()),
        cues=len(cues),
        answered=sum(cue.answered_at is not None for cue in cues),
        free_speech_share=Share(sum(act.act == FREE_SPEECH for act in spoken), len(spoken)),
    )


def _by_source(acts: Iterable[PlayedAct]) -> tuple[LatencyPart, ...]:
    found: dict[str, list[float]] = {}
    for act in answers(acts):
        if act.response_s is not None:
            found.setdefault(act.by, []).append(act.response_s)
    named = sorted(found, key=lambda source: (-len(found[source]), source))
    return tuple(LatencyPart(source, "cue to answer", tuple(found[source])) for source in named)


def _act_facts(acts: Iterable[PlayedAct], interruptions: Sequence[Interruption]) -> Iterable[ActFacts]:
    by_name: dict[str, list[PlayedAct]] = {}
    for act in acts:
        by_name.setdefault(act.act, []).append(act)
    for name in sorted(by_name, key=lambda each: (-len(by_name[each]), each)):
        asked = by_name[name]
        begun = [act for act in asked if act.started_at is not None]
        lengths = [
            round(act.ended_at - act.started_at, 6)
            for act in begun
            if act.started_at is not None and act.ended_at is not None and act.status == "SUCCEEDED"
            if interruption_between(interruptions, act.started_at, act.ended_at) is None
        ]
        yield ActFacts(
            name=name,
            begun=len(begun),
            by=dict(Counter(act.actor for act in asked).most_common()),
            statuses=dict(Counter(act.status for act in asked).most_common()),
            length=summarise(lengths),
            response=summarise([act.response_s for act in answers(asked) if act.response_s is not None]),
            marks=dict(Counter(act.mark for act in asked if act.mark is not None)),
            fillers=sum(act.filler for act in begun),
        )


def _state_facts(data: SessionData) -> Iterable[StateFacts]:
    found: dict[tuple[str, str], list[Phase]] = {}
    for phase in data.phases:
        found.setdefault((phase.rule, phase.state), []).append(phase)
    rules = list(dict.fromkeys(rule for rule, _ in found))
    for (rule, state), visits in sorted(found.items(), key=lambda each: rules.index(each[0][0])):
        lengths = [round(phase.end - phase.start, 6) for phase in visits]
        away = [seconds_without_engine(data.outages, phase.start, phase.end) for phase in visits]
        cut = [interruption_between(data.interruptions, phase.start, phase.end) for phase in visits]
        whole = [length for length, kind in zip(lengths, cut, strict=True) if kind is None]
        back = sum(phase.stepped_back for phase in visits)
        outage = round(sum(each or 0.0 for each in away), 6)
        yield StateFacts(rule, state, len(visits), round(sum(lengths), 6), summarise(whole), back, outage)


_MISTAKE_RECORDS = (ControlRecord, FailureRecord, RobotRecord, RuleRecord, StopRecord)


def _mistakes(data: SessionData, begun: list[PlayedAct]) -> MistakeFacts:
    marks = Counter(point.name for point in data.points if point.kind == "mistake")
    actions = Counter(part.status for act in data.acts for part in act.parts)
    records = [
        record for record in data.records if isinstance(record, _MISTAKE_RECORDS)
    ]  # one pass that keeps few records
    holders = [each.holder.partition("#")[0] for each in records if isinstance(each, ControlRecord) and each.holder]
    links = ["connected", *(record.status for record in records if isinstance(record, RobotRecord))]
    return MistakeFacts(
        marks={mark: marks[mark] for mark in MARKS if marks[mark]},
        marked=Share(sum(key.mark is not None for key in data.keys), len(data.keys)),
        rejected=sum(act.status == "REJECTED" for act in data.acts),
        canceled=sum(act.status == "CANCELED" for act in begun),
        actions_failed={name: actions[name] for name in _NOT_DONE if actions[name]},
        aborted=sum(act.status == "ABORTED" for act in begun),
        failures=sum(isinstance(record, FailureRecord) and record.status == "asked" for record in records),
        rules_faulted=sum(isinstance(record, RuleRecord) and record.status == "faulted" for record in records),
        # The engine's own stop at the end of a session does not count.
        stops=sum(
            isinstance(record, StopRecord) and record.status == "requested" and record.source != ENGINE
            for record in records
        ),
        robot_lost=sum(now == "lost" != before for before, now in pairwise(links)),
        robot_degraded=sum((before, now) == ("connected", "degraded") for before, now in pairwise(links)),
        control_changes=sum(now != before for before, now in pairwise(holders)),
    )

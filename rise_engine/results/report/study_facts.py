"""The facts of a study's report, counted from its sessions. Only one session is in memory; one row of each is kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import takewhile

from msgspec import Struct

from rise_engine.results.analysis.model import ActorKind, SessionData, SessionFacts
from rise_engine.results.analysis.statistics import Share, Summary, summarise
from rise_engine.results.analysis.trials import NoNumber, trials_of
from rise_engine.results.report.session_facts import (
    BANDS,
    LatencyFacts,
    LatencyPart,
    SessionFigures,
    latencies,
    session_figures,
)
from rise_engine.study.checks import asks_debriefing, check_text
from rise_engine.study.model import Study, StudyCheck
from rise_engine.study.study_scenarios import scenario_of


class WizardPart(Struct, frozen=True):
    """The part of one wizard in one session."""

    wizard: str
    """As in the record: `wizard:anna`."""
    keys: int
    """The number of their requests."""
    marked: int
    """The number of keys that were marked as mistakes, or whose acts were."""
    reactions: tuple[float, ...]
    """Seconds from cue to key of their answers, also through rules."""


class SessionRow(Struct, frozen=True):
    """The facts kept of one session."""

    facts: SessionFacts
    figures: SessionFigures
    wizards: tuple[WizardPart, ...]
    checks: dict[str, str]
    """The checks' results by id."""
    acts_used: tuple[str, ...]
    channels: tuple[str, ...]
    """The robot's channels that it used."""
    problems: tuple[str, ...]
    measure: str = ""
    """The dependent variable of its trials. Empty: its scenario does not define trials."""
    trials: tuple[float | None, ...] = ()
    """Its value in each trial."""
    omitted: tuple[tuple[int, NoNumber], ...] = ()
    """The numbers of trials without a value, with the reason."""

    @property
    def is_complete(self) -> bool:
        """Whether it counts and is complete."""
        return self.facts.purpose == "counted" and self.facts.outcome == "complete"

    @property
    def responses(self) -> tuple[float, ...]:
        return self.figures.latency.response.values


class CheckCounts(Struct, frozen=True):
    """The results of one check over the complete sessions."""

    id: str
    passed: int
    failed: int
    skipped: int
    missing: int
    """The number of sessions without a record of it."""


class WizardCourse(Struct, frozen=True):
    """One wizard over the sessions in which they acted."""

    wizard: str
    sessions: tuple[SessionRow, ...]
    """Complete sessions in their order."""
    rehearsals: tuple[SessionRow, ...]
    """Rehearsals before the first session that counts, even if that one was aborted."""

    def part_in(self, row: SessionRow) -> WizardPart:
        """Return their part in one of their sessions."""
        return next(part for part in row.wizards if part.wizard == self.wizard)

    @property
    def marked(self) -> Share:
        """The share of their keys in complete sessions that were marked as mistakes."""
        parts = [self.part_in(row) for row in self.sessions]
        return Share(sum(part.marked for part in parts), sum(part.keys for part in parts))

    @property
    def reactions(self) -> Summary | None:
        """Seconds from cue to key over all complete sessions."""
        return summarise(value for row in self.sessions for value in self.part_in(row).reactions)


class StudyFigures(Struct, frozen=True):
    """All counts of a study's sessions."""

    rows: tuple[SessionRow, ...]
    """All readable sessions, in the order of their starts."""

    @property
    def complete(self) -> tuple[SessionRow, ...]:
        return tuple(row for row in self.rows if row.is_complete)

    @property
    def counted_modes(self) -> tuple[str, ...]:
        """The modes of the sessions that count, from their journals."""
        return tuple(dict.fromkeys(row.facts.mode for row in self.rows if row.facts.purpose == "counted"))

    @property
    def rehearsals(self) -> tuple[SessionRow, ...]:
        return tuple(row for row in self.rows if row.facts.purpose != "counted")

    @property
    def latency(self) -> LatencyFacts:
        """The latencies of all complete sessions together."""
        return pool([row.figures.latency for row in self.complete])

    @property
    def actors(self) -> dict[ActorKind, int]:
        """The number of acts that began in complete sessions, by actor."""
        counts: Counter[ActorKind] = Counter()
        for row in self.complete:
            counts.update(row.figures.actors)
        return dict(counts.most_common())

    @property
    def marked(self) -> Share:
        """The share of wizards' keys in complete sessions that were marked as mistakes."""
        found = [row.figures.mistakes.marked for row in self.complete]
        return Share(sum(each.count for each in found), sum(each.n for each in found))

    @property
    def marks(self) -> dict[str, int]:
        """The marks in complete sessions by kind."""
        counts: Counter[str] = Counter()
        for row in self.complete:
            counts.update(row.figures.mistakes.marks)
        return dict(counts)

    @property
    def free_speech_share(self) -> Share:
        found = [row.figures.free_speech_share for row in self.complete]
        return Share(sum(each.count for each in found), sum(each.n for each in found))

    def conditions(self) -> dict[str, tuple[SessionRow, ...]]:
        """Return the complete sessions by condition, in the order of the names."""
        names = sorted({row.facts.condition for row in self.complete})
        return {name: tuple(row for row in self.complete if row.facts.condition == name) for name in names}

    def wizards(self) -> tuple[WizardCourse, ...]:
        """Return the wizards of complete sessions, those with the most sessions first."""
        courses = []
        for name in dict.fromkeys(part.wizard for row in self.complete for part in row.wizards):
            sessions = tuple(row for row in self.complete if any(part.wizard == name for part in row.wizards))
            acted = [row for row in self.rows if any(part.wizard == name for part in row.wizards)]
            before = takewhile(lambda row: row.facts.purpose != "counted", acted)
            courses.append(WizardCourse(name, sessions, tuple(before)))
        return tuple(sorted(courses, key=lambda each: (-len(each.sessions), each.wizard)))

    def checks(self, expected: Iterable[str] = ()) -> tuple[CheckCounts, ...]:
        """Count the results of each check in the complete sessions.

        :param expected: the ids of the study's checks in their order; others follow.
        """
        rows = self.complete
        ids = dict.fromkeys([*expected, *(name for row in rows for name in row.checks)])
        counts = []
        for name in ids:
            found = Counter(row.checks.get(name, "missing") for row in rows)
            counts.append(CheckCounts(name, found["passed"], found["failed"], found["skipped"], found["missing"]))
        return tuple(counts)

    def debriefed(self, checks: Iterable[StudyCheck] = ()) -> Share | None:
        """Return the share of complete sessions with a debriefing. None: no check asks for it.

        :param checks: the study's checks.
        """
        rows = self.complete
        ids = {check.id for check in checks if asks_debriefing(check.id, check_text(check))}
        ids |= {name for row in rows for name in row.checks if asks_debriefing(name)}
        passed = sum(any(row.checks.get(name) == "passed" for name in ids) for row in rows)
        return Share(passed, len(rows)) if ids else None

    def scenario_hashes(self) -> dict[str, str]:
        """Return the hashes of the scenarios in complete sessions, in their order, each with its language."""
        return {each: row.facts.language for row in self.complete for each in hashes_of(row.facts)}

    def scenario_versions(self, study: Study) -> int:
        """Count the versions of the scenario with the most versions in complete sessions. A scenario in several
        languages is one version, and so are the scenarios of two levels.

        :param study: the study, which assigns scenarios to levels.
        """
        versions: dict[tuple[str, str], set[str]] = {}
        for row in self.complete:
            facts = row.facts
            versions.setdefault((facts.language, scenario_of(study, facts.factors)), set()).update(hashes_of(facts))
        return max(map(len, versions.values()), default=0)


def hashes_of(facts: SessionFacts) -> tuple[str, ...]:
    """Return the hashes of the scenario that a session ran, one for each version of its files."""
    return (facts.scenario_hash, *facts.changed_to)


def session_row(data: SessionData, checked: Mapping[str, str] | None = None) -> SessionRow:
    """Collect the facts of a session that are kept.

    :param data: the session at the report's level.
    :param checked: results of checks after the session from the study's log, by id.
    """
    settings = data.scenario.trials if data.scenario is not None else None
    trials = trials_of(data)
    parts = []
    for name in dict.fromkeys(key.source for key in data.keys):
        keys = [key for key in data.keys if key.source == name]
        reactions = [act.wizard_s for act in data.acts if act.by == name and act.answer_s is not None]
        marked = sum(key.mark is not None for key in keys)
        parts.append(WizardPart(name, len(keys), marked, tuple(each for each in reactions if each is not None)))
    channels = dict.fromkeys(channel for act in data.acts for part in act.parts for channel in part.channels)
    return SessionRow(
        facts=data.facts,
        figures=session_figures(data),
        wizards=tuple(parts),
        checks={**{check.id: check.result for check in data.checks}, **(checked or {})},
        acts_used=tuple(dict.fromkeys(act.act for act in data.acts if act.started_at is not None)),
        channels=tuple(channels),
        problems=data.problems,
        measure=settings.measure if settings is not None else "",
        trials=tuple(trial.number(settings.measure) for trial in trials) if settings is not None else (),
        omitted=tuple(
            (number, why)
            for number, trial in enumerate(trials, 1)
            if settings is not None and (why := trial.why_no_number(settings.measure)) is not None
        ),
    )


def study_figures(
    sessions: Iterable[SessionData], checked: Mapping[str, Mapping[str, str]] | None = None
) -> StudyFigures:
    """Count the facts of a study.

    :param sessions: its sessions in the order of their starts, including rehearsals; none is kept.
    :param checked: results of checks after sessions from the study's log, by the sessions' folder names.
    """
    checked = checked or {}
    return StudyFigures(tuple(session_row(data, checked.get(data.folder.name)) for data in sessions))


def pool(found: Sequence[LatencyFacts]) -> LatencyFacts:
    """Pool the latencies of several sessions."""
    every = [latencies(()), *found]  # names the parts even without a session
    return LatencyFacts(
        parts=tuple(map(_join, zip(*(facts.parts for facts in every), strict=True))),
        response=_join([facts.response for facts in every]),
        to_filler=_join([facts.to_filler for facts in every]),
        after_filler=_join([facts.after_filler for facts in every]),
        without_filler=_join([facts.without_filler for facts in every]),
        in_bands=tuple(sum(facts.in_bands[at] for facts in found) for at in range(len(BANDS))),
        before_cue=sum(facts.before_cue for facts in found),
        interrupted=dict(sum((Counter(facts.interrupted) for facts in found), Counter())),
    )


def _join(parts: Sequence[LatencyPart]) -> LatencyPart:
    return LatencyPart(parts[0].name, parts[0].about, tuple(value for part in parts for value in part.values))

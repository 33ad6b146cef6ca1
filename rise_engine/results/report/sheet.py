"""The reporting sheet of a study: what a paper on a study with a wizard should report.

The items paraphrase the guidelines in Riek 2012 (doi 10.5898/JHRI.1.1.Riek). Compare them with the paper's own table
before you claim to follow it. Facts from the record are filled in. People write the rest in `[report]` of study.toml;
the sheet lists missing entries.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from msgspec import Struct

from rise_engine.base.text import clean, pluralize
from rise_engine.results.analysis.statistics import Share, summarise
from rise_engine.results.report.document import (
    actor_shares,
    interval_text,
    length_text,
    marks_text,
    number_text,
    per_hundred,
    share_text,
    source_name,
)
from rise_engine.results.report.study_facts import SessionRow, StudyFigures, WizardCourse
from rise_engine.results.report.trials_section import omitted_answers
from rise_engine.study.model import Study, StudyStanding
from rise_engine.study.publishing import REPORT_ITEMS
from rise_engine.study.traces import Withdrawn

ORIGIN = (
    "The items paraphrase the reporting guidelines in Riek 2012, Journal of Human-Robot Interaction 1(1), "
    "119\u2013136, doi 10.5898/JHRI.1.1.Riek. Compare them with the paper's own table. The record fills in what it "
    "knows. The rest comes from [report] of study.toml."
)
UNANSWERED = "still to say"
NONE_WITHDRAWN = Withdrawn()


class SheetItem(Struct, frozen=True):
    """One item of the sheet."""

    part: str
    """Robot, Participants, Wizard, General."""
    title: str
    known: tuple[str, ...] = ()
    """Sentences from the record."""
    asked: tuple[str, ...] = ()
    """The names of the questions to people, in `[report]`."""
    answers: tuple[str, ...] = ()
    """Their answers in the same order. Empty: no answer."""

    @property
    def missing(self) -> tuple[str, ...]:
        """The names of the questions without an answer."""
        return tuple(name for name, text in zip(self.asked, self.answers, strict=True) if not text)


def reporting_sheet(
    study: Study,
    standing: StudyStanding,
    figures: StudyFigures,
    withdrawn: Withdrawn = NONE_WITHDRAWN,
    omitted: Mapping[str, int] | None = None,
) -> list[SheetItem]:
    """Make the whole sheet.

    :param study: the checked design with people's answers.
    :param standing: its progress.
    :param figures: the figures of its sessions.
    :param withdrawn: the number of withdrawn participants.
    :param omitted: the number of rehearsals missing in these figures, by their purpose.
    """
    wizards, omitted = figures.wizards(), omitted or {}

    def item(part: str, title: str, known: Iterable[str] = (), *asked: str) -> SheetItem:
        return SheetItem(
            part, title, tuple(filter(None, known)), asked, tuple(study.report.get(each, "") for each in asked)
        )

    return [
        item("Robot", "How many and which", [_robots(figures), _injected(figures)], "robot_make"),
        item("Robot", "What it did by itself", _autonomy(figures), "autonomy"),
        item("Robot", "What it could do", _abilities(figures)),
        item("Robot", "What was expected of it", (), "robot_hypotheses"),
        item("Participants", "How many", _counts_text(standing, withdrawn)),
        item("Participants", "Who they were", _strata(study, standing), "demographics"),
        item("Participants", "How they were found and thanked", (), "recruitment", "compensation"),
        item("Participants", "What they were told", _debriefed(study, figures), "instructions"),
        item("Participants", "What was expected of them", (), "hypotheses", "preregistration"),
        item("Participants", "What they expected", (), "expectations"),
        item("Participants", "Whether they believed in the robot", (), "convincing"),
        item("Wizard", "How many", _wizards(wizards), "wizard_role"),
        item("Wizard", "Who they were", (), "wizard_demographics"),
        item("Wizard", "What they knew", _blinding_sentences(study), "wizard_knew"),
        item("Wizard", "What they could do", _production(figures), "wizard_rules"),
        item("Wizard", "What they perceived", (), "wizard_perceived"),
        item("Wizard", "Their errors", _errors(figures), "wizard_errors"),
        item("Wizard", "Their training", _training(wizards, omitted), "wizard_training"),
        item("General", "Where", (), "place"),
        item("General", "The environment and its control", [*_checks(study, figures), *_speed(figures)], "environment"),
        item("General", "The scenario", _scenario(figures), "story"),
        item("General", "Whether it was made in several steps", _steps(study, figures, omitted), "iterations"),
        item("General", "What the wizard means for the conclusions", (), "limits"),
    ]


def begun_text(standing: StudyStanding, withdrawn: Withdrawn) -> str:
    """Return how many participants began a session, including those who withdrew later."""
    people = [each for each in standing.participants if each.state != "withdrawn"]
    begun = sum(bool(each.sessions) for each in people) + withdrawn.begun
    verb = "has" if withdrawn.begun == 1 else "have"
    return f"{begun} ({withdrawn.begun} of them {verb} withdrawn since)" if withdrawn.begun else str(begun)


def speed_text(figures: StudyFigures) -> str:
    """Return the speeds of complete sessions, if any did not run in real time."""
    rows = figures.complete
    counts = Counter(row.facts.speed for row in rows if row.facts.speed != 1.0)
    of = pluralize(len(rows), "complete session")
    return ", ".join(f"{speed:g} times real time in {count} of {of}" for speed, count in counts.items())


def debriefed_text(share: Share) -> str:
    """Return after how many complete sessions a debriefing is recorded."""
    if not share.n:
        return "No session is complete yet, so no debriefing is recorded."
    return f"A debriefing is recorded after {share_text(share.count, share.n)} complete sessions."


def omitted_text(omitted: Mapping[str, int]) -> str:
    """Return the numbers of omitted rehearsals.

    >>> omitted_text({"pilot": 2, "training": 1})
    '2 pilot sessions, 1 training session'
    """
    return ", ".join(pluralize(count, f"{purpose} session") for purpose, count in omitted.items())


def unanswered_questions(sheet: Iterable[SheetItem]) -> list[str]:
    """Return the names of all questions in `[report]` without an answer."""
    return [name for item in sheet for name in item.missing]


def question_of(name: str) -> str:
    """Return the question of an item of `[report]`."""
    return next(item.question for item in REPORT_ITEMS if item.name == name)


def sheet_markdown(study: Study, sheet: Sequence[SheetItem]) -> str:
    """Write the sheet as Markdown for a paper's appendix.

    :param study: its study.
    :param sheet: from `reporting_sheet`.
    """
    lines = [f"# {_plain(study.title)}: reporting sheet", "", _plain(ORIGIN), ""]
    missing = unanswered_questions(sheet)
    if missing:
        lines += [f"**{pluralize(len(missing), 'item')} still to say**, in `[report]` of study.toml:", ""]
        lines += [f"- `{name}`: {question_of(name)}" for name in missing]
        lines.append("")
    part = ""
    for item in sheet:
        if item.part != part:
            part = item.part
            lines += [f"## {part}", ""]
        lines += [f"### {item.title}", ""]
        lines += [_plain(sentence) for sentence in item.known]
        for name, text in zip(item.asked, item.answers, strict=True):
            lines.append(_plain(text) if text else f"*{UNANSWERED}*: {question_of(name)} (`{name}`)")
        lines.append("")
    return "\n".join(lines)


def _plain(text: str) -> str:
    """Escape a text for Markdown."""
    flat = " ".join(clean(text, keep="\n\t").split()).replace("&", "&amp;").replace("<", "&lt;")
    for sign in "\\`*_>[]#|":
        flat = flat.replace(sign, f"\\{sign}")
    return flat


# --- what the record knows ------------------------------------------------------------------------------------------


def _robots(figures: StudyFigures) -> str:
    robots = Counter(
        f"{row.facts.robot or 'unnamed'}{' (simulated: no robot moved)' if row.facts.is_simulated else ''}"
        for row in figures.complete
    )
    text = ", ".join(f"{robot} in {pluralize(number, 'session')}" for robot, number in robots.items())
    return f"{text}." if text else ""


def _injected(figures: StudyFigures) -> str:
    """Return the faults that simulated robots were told to inject."""
    found = [row.facts.injected_faults for row in figures.complete if row.facts.injected_faults]
    faults = dict.fromkeys(fault for faults in found for fault in faults)
    return f"Faults were injected in {pluralize(len(found), 'session')}: {', '.join(faults)}." if found else ""


def _autonomy(figures: StudyFigures) -> list[str]:
    shares = actor_shares(figures.actors)
    return [f"Acts that began: {', '.join(shares)}."] if shares else []


def _abilities(figures: StudyFigures) -> list[str]:
    acts = dict.fromkeys(act for row in figures.complete for act in row.acts_used)
    channels = dict.fromkeys(channel for row in figures.complete for channel in row.channels)
    known = [f"{pluralize(len(acts), 'act')} used: {', '.join(acts)}."] if acts else []
    return [*known, f"Channels used: {', '.join(channels)}."] if channels else known


def _counts_text(standing: StudyStanding, withdrawn: Withdrawn) -> list[str]:
    states = Counter(each.state for each in standing.participants)
    listed = len(standing.participants) - len(standing.unlisted)
    text = (
        f"{listed} listed now, {begun_text(standing, withdrawn)} began, {standing.complete} of "
        f"{standing.wanted} wanted complete"
    )
    text += f", {states['excluded']} excluded, {max(withdrawn.count, states['withdrawn'])} withdrawn."
    moved = sum(bool(each.run_as) for person in standing.participants for each in person.sessions)
    if moved:
        text += f" Run under another participant and reassigned: {pluralize(moved, 'session')}."
    cells = [
        f"{' '.join((*cell.strata.values(), cell.condition))}".strip() + f": {cell.complete} complete"
        for cell in standing.cells
        if cell.condition or cell.strata
    ]
    return [text, f"Cells: {'; '.join(cells)}."] if cells else [text]


def _strata(study: Study, standing: StudyStanding) -> list[str]:
    complete = [each for each in standing.participants if each.state == "complete"]
    known = []
    for column in study.strata:
        counts = Counter(each.strata.get(column, "") for each in complete)
        known.append(
            f"{column}, of those who are complete: {', '.join(f'{value} {n}' for value, n in counts.items())}."
        )
    return known if complete else []


def _debriefed(study: Study, figures: StudyFigures) -> list[str]:
    share = figures.debriefed(study.checks)
    if share is None:
        return ["No check asks whether participants were debriefed."]
    return [debriefed_text(share)]


def _wizards(wizards: Iterable[WizardCourse]) -> list[str]:
    names = [f"{source_name(each.wizard)} in {pluralize(len(each.sessions), 'session')}" for each in wizards]
    return [f"{pluralize(len(names), 'wizard')}: {', '.join(names)}."] if names else []


def _blinding_sentences(study: Study) -> list[str]:
    hidden = "were hidden until a session began" if study.assignment.hidden else "could be seen before a session began"
    labelled = any(level.label for factor in study.factors for level in factor.levels)
    return [f"Conditions {hidden}{', and were shown by labels' if labelled else ''}."] if study.factors else []


def _production(figures: StudyFigures) -> list[str]:
    spoken = figures.free_speech_share
    known = [f"Wizards typed {share_text(spoken.count, spoken.n)} spoken acts freely."] if spoken.n else []
    fillers = sum(act.fillers for row in figures.complete for act in row.figures.acts)
    summary = figures.latency.response.summary
    known += [f"{pluralize(fillers, 'filler')} bridged a wait."] if fillers else []
    if summary is not None:
        known.append(
            f"Participants waited {number_text(summary.median)} s for an answer (median of {summary.n}; middle half "
            f"{number_text(summary.lower)} to {number_text(summary.upper)} s)."
        )
    if omitted := omitted_answers(figures.latency):
        known.append(omitted)
    return known


def _errors(figures: StudyFigures) -> list[str]:
    marked, rows = figures.marked, figures.complete
    if not marked.n:
        return []
    refused = sum(row.figures.mistakes.rejected for row in rows)
    stops = sum(row.figures.mistakes.stops for row in rows)
    kinds = f" ({marks_text(figures.marks)})" if figures.marks else ""
    return [
        f"Wizards marked {share_text(marked.count, marked.n)} of their keys as mistakes{kinds}.",
        f"Mistakes per 100 keys: {per_hundred(marked)} {interval_text(marked)}.",
        f"Found in the record: {pluralize(refused, 'act')} refused, {pluralize(stops, 'stop')}.",
    ]


def _training(wizards: Iterable[WizardCourse], omitted: Mapping[str, int]) -> list[str]:
    known = []
    if omitted:
        known.append(f"Not in this bundle, so not counted here: {omitted_text(omitted)}.")
    for each in wizards:
        rows = each.rehearsals
        name = source_name(each.wizard)
        if not rows:
            if not omitted:
                known.append(f"{name}: no session on record before the first that counted.")
            continue
        seconds = sum(row.facts.duration for row in rows)
        text = f"{name}: {pluralize(len(rows), 'session')} before the first that counted, {length_text(seconds)} in all"
        first, last = (_performance_text(each, row) for row in (rows[0], rows[-1]))
        known.append(f"{text}; {first}." if len(rows) == 1 else f"{text}; first {first}; last {last}.")
    return known


def _performance_text(course: WizardCourse, row: SessionRow) -> str:
    """Describe a wizard's performance in one session: cue to key, and mistakes."""
    part = course.part_in(row)
    summary = summarise(part.reactions)
    waited = f"cue to key {number_text(summary.median)} s (median of {summary.n})" if summary else "no cue answered"
    return f"{waited}, {pluralize(part.marked, 'mistake')} in {pluralize(part.keys, 'key')}"


def _checks(study: Study, figures: StudyFigures) -> list[str]:
    counts = figures.checks(check.id for check in study.checks)
    parts = [
        f"{each.id} passed {each.passed}, skipped {each.skipped}, failed {each.failed}, no record {each.missing}"
        for each in counts
    ]
    return [f"Checks in {pluralize(len(figures.complete), 'complete session')}: {'; '.join(parts)}."] if parts else []


def _scenario(figures: StudyFigures) -> list[str]:
    titles = dict.fromkeys(row.facts.title for row in figures.complete)
    lengths = sorted(row.facts.duration for row in figures.complete)
    if not lengths:
        return []
    return [
        f"{', '.join(titles)}; sessions lasted from {length_text(lengths[0])} to {length_text(lengths[-1])}. "
        f"SHA-256 of the scenarios: {_hashes_text(figures.scenario_hashes())}."
    ]


def _hashes_text(hashes: Mapping[str, str]) -> str:
    """Return the first 16 digits of each hash; a scenario in several languages has one for each."""
    several = len(set(hashes.values())) > 1
    return ", ".join(f"{each[:16]} ({language})" if several else each[:16] for each, language in hashes.items())


def _speed(figures: StudyFigures) -> list[str]:
    text = speed_text(figures)
    return [f"Speed of session time, in which all durations are: {text}."] if text else []


def _steps(study: Study, figures: StudyFigures, omitted: Mapping[str, int]) -> list[str]:
    pilots = sum(row.facts.purpose == "pilot" for row in figures.rows) + omitted.get("pilot", 0)
    versions = figures.scenario_versions(study)
    if not versions:
        return []
    return [
        f"{pluralize(pilots, 'pilot session')}; complete sessions ran {pluralize(versions, 'version')} of the scenario."
    ]

"""The report of a study as a document: progress, conditions, wizards, checks, the reporting sheet."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.text import pluralize
from rise_engine.privacy.levels import ExportLevel, count_words
from rise_engine.results.analysis.statistics import Summary, summarise
from rise_engine.results.report.charts import CourseOfSessions, DotRow, dot_plot, drift_figure
from rise_engine.results.report.document import (
    Block,
    Document,
    Facts,
    Paragraph,
    ReportTable,
    Section,
    clock_text,
    interval_text,
    length_text,
    marks_text,
    number_text,
    per_hundred,
    seconds_text,
    share_text,
    source_name,
)
from rise_engine.results.report.session_report import LEVEL_WORDS, colophon, problem_paragraphs
from rise_engine.results.report.sheet import (
    ORIGIN,
    UNANSWERED,
    SheetItem,
    begun_text,
    debriefed_text,
    omitted_text,
    question_of,
    reporting_sheet,
    speed_text,
    unanswered_questions,
)
from rise_engine.results.report.study_facts import SessionRow, StudyFigures, WizardCourse
from rise_engine.results.report.trials_section import (
    TrialRow,
    latency_section,
    trial_rows,
    trials_section,
    trials_summary,
)
from rise_engine.study.model import LANGUAGE, Study, StudyStanding
from rise_engine.study.plan import factors_of
from rise_engine.study.traces import Withdrawn

NO_CONDITION = "no condition"
HIDDEN = (
    "This study hides its conditions and is not complete. The cells and their results would show which condition comes "
    "next, so the report leaves them out. rise-engine report --conditions shows them."
)


class StudyReportInput(Struct, frozen=True):
    """The contents of a study's report."""

    study: Study
    standing: StudyStanding
    figures: StudyFigures
    level: ExportLevel = "full"
    shows_conditions: bool = True
    """Whether conditions are shown. A study that hides them should not show them until it is complete."""
    withdrawn: Withdrawn = Withdrawn()
    problems: tuple[str, ...] = ()
    """Sentences about unreadable parts."""
    omitted: dict[str, int] = {}
    """For a bundle's report: the number of omitted rehearsals, by their purpose."""

    @property
    def trials(self) -> list[TrialRow]:
        """Rows by condition if conditions may be shown, else one row for all."""
        if self.shows_conditions:
            return trial_rows(self.figures.conditions().items())
        return trial_rows([("", self.figures.complete)])

    @property
    def sheet(self) -> list[SheetItem]:
        if self.shows_conditions:
            return reporting_sheet(self.study, self.standing, self.figures, self.withdrawn, self.omitted)
        without_cells = replace(self.standing, cells=())
        return reporting_sheet(self.study, without_cells, self.figures, self.withdrawn, self.omitted)


def study_report(given: StudyReportInput) -> Document:
    """Make the report of a study.

    :param given: its design, its progress, and the figures of its sessions.
    """
    study, figures = given.study, given.figures
    sections = (
        trials_section(given.trials, declared=not figures.rows or any(row.measure for row in figures.rows)),
        Section("Plan and participants", tuple(_plan(given))),
        Section("Conditions", tuple(_conditions(given))),
        latency_section(figures.latency, ()),
        Section("Wizards", tuple(_wizards(given))),
        Section("Checks", tuple(_checks(given))),
        Section("Sessions", tuple(_sessions(given))),
        Section("Reporting sheet", tuple(_sheet(given))),
    )
    return Document(
        title=study.title,
        kind="Study report",
        banner=_banner(given),
        summary=_summary(given),
        facts=tuple(_head(given)),
        sections=tuple(section for section in sections if section.blocks),
        colophon=colophon(f"the study {study.id}", given.level),
    )


def _summary(given: StudyReportInput) -> str:
    standing, figures = given.standing, given.figures
    text = f"{standing.complete} of {standing.wanted} participants are complete."
    sessions = len(figures.complete)
    text += f" The study has {pluralize(sessions, 'complete session')}." if sessions else ""
    medians = [summary.median for row in figures.complete if (summary := summarise(row.responses)) is not None]
    over = summarise(medians)
    if over is not None:
        middle = f"{number_text(over.lower)}\u2013{seconds_text(over.upper)}"
        text += (
            f" The median response of a session is {seconds_text(over.median)} "
            f"(median of {pluralize(len(medians), 'session')}, middle half {middle})."
        )
    text = f"{trials_summary(given.trials)} {text}".lstrip()
    if missing := len(unanswered_questions(given.sheet)):
        text += f" {pluralize(missing, 'item')} of the reporting sheet {'is' if missing == 1 else 'are'} still to say."
    return text


def _banner(given: StudyReportInput) -> str:
    if given.study.mode == "debug" and not given.figures.counted_modes:
        return "DEBUG: study.toml says that the robot is simulated. No session counts."
    simulated = sum(row.facts.is_simulated for row in given.figures.complete)
    if not simulated:
        return ""
    return f"SIMULATED: the robot was simulated in {pluralize(simulated, 'complete session')}. No robot moved there."


def _assignment(study: Study) -> str:
    """Describe the assignment of cells and orders, for the study's kinds of factors."""
    named = {"between": study.assignment.between, "within": f"orders {study.assignment.within}"}
    return ", ".join(words for kind, words in named.items() if factors_of(study, kind))


def _head(given: StudyReportInput) -> Iterable[tuple[str, str]]:
    study = given.study
    factors = "; ".join(
        f"{factor.name} ({factor.kind}): {', '.join(level.name for level in factor.levels)}" for factor in study.factors
    )
    versions = {f"{name} {value}" for row in given.figures.rows for name, value in row.facts.versions.items()}
    rows = [
        ("Study", study.id),
        ("Wanted", pluralize(study.n, "complete participant")),
        ("Factors", factors),
        ("Assignment", _assignment(study)),
        ("Strata", ", ".join(study.assignment.strata)),
        ("Conditions hidden", "yes" if study.assignment.hidden else "no"),
        ("Mode", ", ".join(given.figures.counted_modes) or study.mode),
        (
            "Robot driver",
            ", ".join(dict.fromkeys(row.facts.driver for row in given.figures.complete if row.facts.driver)),
        ),
        ("Speed", speed_text(given.figures)),
        ("Seed", str(study.seed)),
        ("Versions", ", ".join(sorted(versions))),
        ("study.toml, SHA-256", study.hash[:16]),
        ("Level", LEVEL_WORDS[given.level]),
    ]
    return ((name, value) for name, value in rows if value)


# --- plan and participants ------------------------------------------------------------------------------------------


def _plan(given: StudyReportInput) -> Iterable[Block]:
    yield from problem_paragraphs(given.problems, given.level)
    standing, study, modes = given.standing, given.study, given.figures.counted_modes
    if modes and set(modes) != {study.mode}:
        text = f"Sessions that count ran in mode {' and '.join(modes)}. study.toml now says {study.mode}."
        yield Paragraph(text, "warning")
    yield Facts(tuple(_flow(standing, given.withdrawn)))
    if given.omitted:
        yield Paragraph(f"Not in this bundle: {omitted_text(given.omitted)}.", "note")
    if out := tuple(_excluded_rows(standing, given.level)):
        yield ReportTable(
            caption="Excluded participants, and sessions that were aborted, judged again or reassigned, with reasons",
            head=("participant", "what", "reason"),
            rows=out,
        )
    if not given.shows_conditions:
        yield Paragraph(HIDDEN, "note")
    elif standing.cells:
        yield _cells(standing)


def _flow(standing: StudyStanding, withdrawn: Withdrawn) -> Iterable[tuple[str, str]]:
    """Count the participants at each stage."""
    people = standing.participants
    states = Counter(each.state for each in people)
    yield "Listed in participants.csv", str(len(people) - len(standing.unlisted))
    yield "Without consent so far", str(states["no-consent"])
    yield "Began a session", begun_text(standing, withdrawn)
    yield "Complete", f"{standing.complete} of {standing.wanted} wanted"
    yield (
        "Between runs, running, or to judge",
        str(states["to-go-on"] + states["running"] + states["unfinished"] + states["to-judge"]),
    )
    yield "Broken off, may come again", str(states["aborted"])
    yield "Excluded", str(states["excluded"])
    yield "Withdrawn", str(max(withdrawn.count, states["withdrawn"]))
    counts = Counter(entry.purpose for entry in standing.rehearsals)
    yield "Rehearsals", ", ".join(f"{number} {purpose}" for purpose, number in counts.items()) or "none"


def _excluded_rows(standing: StudyStanding, level: ExportLevel) -> Iterable[tuple[str, str, str]]:
    """List excluded participants, all aborted sessions (even if repeated), and changed or reassigned ones."""
    for each in standing.participants:
        if each.state == "withdrawn":
            continue  # restored from a backup
        if each.state == "excluded":
            yield each.participant, "excluded", _reason(each.why, level)
        for session in each.sessions:
            which = f"run {session.run}, attempt {session.attempt}"
            if session.outcome == "aborted" or session.earlier_outcomes:
                was = f" (was {', then '.join(session.earlier_outcomes)})" if session.earlier_outcomes else ""
                yield each.participant, f"{which} {session.outcome}{was}", _reason(session.reason, level)
            if session.run_as:
                yield each.participant, f"{which} run as {session.run_as}", _reason(session.reassigned, level)


def _reason(why: str, level: ExportLevel) -> str:
    """Show typed reasons only at the level full. Texts that a bundle's log has already counted stay."""
    return why if level == "full" or not why else count_words("free text", why)


def _cells(standing: StudyStanding) -> ReportTable:
    strata = list(dict.fromkeys(column for cell in standing.cells for column in cell.strata))
    return ReportTable(
        caption="The plan and what happened: participants in each cell of the between factors",
        head=(*strata, "cell", "complete", "open", "planned"),
        rows=tuple(
            (
                *(cell.strata.get(column, "") for column in strata),
                cell.condition or NO_CONDITION,
                str(cell.complete),
                str(cell.open),
                str(cell.planned) if cell.planned else "",
            )
            for cell in standing.cells
        ),
        numbers=frozenset(range(len(strata) + 1, len(strata) + 4)),
        note=f"Planned: the first {standing.wanted} rows of the plan. It is empty where cells are drawn."
        if any(cell.planned for cell in standing.cells)
        else "",
    )


# --- conditions -----------------------------------------------------------------------------------------------------


def _conditions(given: StudyReportInput) -> Iterable[Block]:
    found = given.figures.conditions()
    if not given.shows_conditions or not found or list(found) == [""]:
        return
    rows = [
        DotRow(
            name or NO_CONDITION,
            tuple(summary.median for row in sessions if (summary := summarise(row.responses)) is not None),
            tuple(_dot_words(row) for row in sessions if row.responses),
            note=_count_words(sessions),
        )
        for name, sessions in found.items()
    ]
    yield dot_plot(
        "Response by condition",
        rows,
        "Each dot is the median response of one complete session. The line is the median of these. The bar is their "
        "middle half. The shades are the reference bands in the section Latency.",
    )
    table = []
    for name, sessions in found.items():
        over = summarise([s.median for row in sessions if (s := summarise(row.responses)) is not None])
        marked = sum(row.figures.mistakes.marked.count for row in sessions)
        keys = sum(row.figures.mistakes.marked.n for row in sessions)
        table.append(
            (
                name or NO_CONDITION,
                str(len(sessions)),
                str(len({row.facts.participant for row in sessions})),
                str(sum(len(row.responses) for row in sessions)),
                *_summary_cells(over),
                _median_length(sessions),
                share_text(marked, keys),
            )
        )
    yield ReportTable(
        caption="Complete sessions by condition: medians of the sessions' median responses in seconds",
        head=("condition", "sessions", "people", "answers", "median", "middle half", "length", "keys marked"),
        rows=tuple(table),
        numbers=frozenset({1, 2, 3, 4, 5, 6}),
        note="Sessions of one participant are not independent. So this is a description and not a test.",
    )


def _dot_words(row: SessionRow) -> str:
    summary = summarise(row.responses)
    middle = seconds_text(summary.median) if summary is not None else ""
    return f"{row.facts.participant}, run {row.facts.run}: median {middle} of {pluralize(len(row.responses), 'answer')}"


def _count_words(sessions: Sequence[SessionRow]) -> str:
    answered = sum(len(row.responses) for row in sessions)
    timed = sum(bool(row.responses) for row in sessions)
    which = f", {timed} with timed answers" if timed < len(sessions) else ""
    return f"{pluralize(len(sessions), 'session')}{which}, {pluralize(answered, 'answer')}"


def _summary_cells(summary: Summary | None) -> tuple[str, str]:
    if summary is None:
        return "", ""
    return number_text(summary.median), f"{number_text(summary.lower)}\u2013{number_text(summary.upper)}"


def _median_length(sessions: Sequence[SessionRow]) -> str:
    summary = summarise(row.facts.duration for row in sessions)
    return clock_text(summary.median) if summary is not None else ""


# --- wizards --------------------------------------------------------------------------------------------------------


def _wizards(given: StudyReportInput) -> Iterable[Block]:
    courses = given.figures.wizards()
    if not courses:
        yield Paragraph("No wizard acted in a complete session.")
        return
    if any(course.reactions is not None for course in courses):
        yield drift_figure(
            "From cue to key, session by session",
            [_course(course) for course in courses],
            "Each dot is the median time from cue to key in one complete session, with its middle half. Sessions are "
            "in their order. If a line rises or falls, the wizard or the conditions may have changed.",
        )
    yield ReportTable(
        caption="Wizards in complete sessions. Cue to key is in seconds. Per 100: mistakes marked per 100 keys, with "
        "the 95\u00a0% interval. Rehearsals: their sessions before the first one that counted",
        head=("wizard", "sessions", "keys", "cue to key", "middle half", "first, last", "per 100", "rehearsals"),
        rows=tuple(_wizard_row(course, "left out" if given.omitted else "none") for course in courses),
        numbers=frozenset({1, 2, 3, 4}),
    )


def _course(course: WizardCourse) -> CourseOfSessions:
    summaries = tuple(summarise(course.part_in(row).reactions) for row in course.sessions)
    hovers = tuple(
        f"{row.facts.participant}, run {row.facts.run}: {seconds_text(each.median) if each else 'no answer'}"
        for row, each in zip(course.sessions, summaries, strict=True)
    )
    return CourseOfSessions(source_name(course.wizard), summaries, hovers)


def _wizard_row(course: WizardCourse, without: str) -> tuple[str, ...]:
    medians = [
        number_text(summary.median)
        for row in course.sessions
        if (summary := summarise(course.part_in(row).reactions)) is not None
    ]
    marked = course.marked
    seconds = sum(row.facts.duration for row in course.rehearsals)
    before = f"{len(course.rehearsals)}, {length_text(seconds)}" if course.rehearsals else without
    return (
        source_name(course.wizard),
        str(len(course.sessions)),
        str(marked.n),
        *_summary_cells(course.reactions),
        f"{medians[0]}, {medians[-1]}" if len(medians) > 1 else "",
        f"{per_hundred(marked)} {interval_text(marked)}".strip(),
        before,
    )


# --- checks, sessions -----------------------------------------------------------------------------------------------


def _checks(given: StudyReportInput) -> Iterable[Block]:
    named = [check.id for check in given.study.checks]
    counts = given.figures.checks(named)
    debriefed = given.figures.debriefed(given.study.checks)
    if debriefed is not None:
        yield Paragraph(debriefed_text(debriefed))
    if counts:
        yield ReportTable(
            caption=f"Results of each check in {pluralize(len(given.figures.complete), 'complete session')}",
            head=("check", "passed", "skipped", "failed", "no record"),
            rows=tuple(
                (each.id, str(each.passed), str(each.skipped), str(each.failed), str(each.missing)) for each in counts
            ),
            numbers=frozenset({1, 2, 3, 4}),
            marked=frozenset(at for at, each in enumerate(counts) if each.skipped or each.failed),
            note="No record: nobody answered it in that session. For example, an earlier answer was still valid.",
        )
    else:
        yield Paragraph("The study has no checks.")


def _sessions(given: StudyReportInput) -> Iterable[Block]:
    rows = given.figures.rows
    if not rows:
        yield Paragraph("No session has been recorded.")
        return
    versions = given.figures.scenario_versions(given.study)
    if versions > 1:
        yield Paragraph(f"Complete sessions ran {versions} different versions of the scenario.", "warning")
    if changed := [row for row in given.figures.complete if row.facts.changed_keys]:
        sessions = pluralize(len(changed), "complete session")
        yield Paragraph(f"A wizard changed what the condition had set in {sessions}: see *went wrong*.", "warning")
    if heard := list(_other_languages(given)):
        yield Paragraph(f"Complete sessions in another language than the study says: {'; '.join(heard)}.", "warning")
    table = []
    for row in rows:
        facts, found = row.facts, row.figures
        summary = summarise(row.responses)
        skipped = [name for name, result in row.checks.items() if result == "skipped"]
        outcome = facts.outcome or ("" if facts.purpose != "counted" else "not said")
        table.append(
            (
                facts.participant,
                f"{facts.run}{f', attempt {facts.attempt}' if facts.attempt > 1 else ''}" if facts.run else "",
                facts.condition if given.shows_conditions else "",
                outcome if facts.purpose == "counted" else facts.purpose,
                clock_text(facts.duration),
                str(found.cues),
                number_text(summary.median) if summary is not None else "",
                marks_text(found.mistakes.marks),
                str(found.mistakes.stops or ""),
                _problems_text(row),
                ", ".join(skipped),
            )
        )
    yield ReportTable(
        caption="Every session, in the order in which they began. The response is the session's median, in seconds",
        head=(
            "who",
            "run",
            "condition",
            "outcome",
            "length",
            "cues",
            "response",
            "marked",
            "stops",
            "went wrong",
            "skipped",
        ),
        rows=tuple(table),
        numbers=frozenset({4, 5, 6, 8}),
        marked=frozenset(at for at, row in enumerate(rows) if row.facts.outcome in ("aborted", "excluded")),
    )


def _other_languages(given: StudyReportInput) -> Iterable[str]:
    """List complete sessions whose robot did not speak the language of their factor or stratum."""
    strata = {each.participant: each.strata for each in given.standing.participants}
    for row in given.figures.complete:
        facts = row.facts
        factors = facts.factors if given.shows_conditions else {}
        wanted = {**strata.get(facts.participant, {}), **factors}.get(LANGUAGE, "")
        if wanted and facts.language and wanted != facts.language:
            run = f" run {facts.run}" if facts.run else ""
            yield f"{facts.participant}{run} ({wanted}) heard {facts.language}"


def _problems_text(row: SessionRow) -> str:
    """Describe problems in the record that no wizard marked."""
    facts, found = row.facts, row.figures.mistakes
    unanswered = row.figures.cues - row.figures.answered
    away = seconds_text(facts.downtime) if facts.downtime is not None else "an unknown time"
    parts = [
        f"run as {facts.run_as}" if facts.run_as else "",
        f"{pluralize(unanswered, 'cue')} not answered" if unanswered else "",
        f"{pluralize(found.aborted, 'act')} failed" if found.aborted else "",
        f"{pluralize(found.rules_faulted, 'rule')} faulted" if found.rules_faulted else "",
        f"robot lost {pluralize(found.robot_lost, 'time')}" if found.robot_lost else "",
        f"robot partly lost {pluralize(found.robot_degraded, 'time')}" if found.robot_degraded else "",
        f"recovered {pluralize(facts.recoveries, 'time')}" if facts.recoveries else "",
        f"{away} without a running engine" if facts.downtime != 0.0 else "",
        f"faults injected: {'; '.join(facts.injected_faults)}" if facts.injected_faults else "",
        f"condition changed by hand: {', '.join(facts.changed_keys)}" if facts.changed_keys else "",
        f"went on with changed files {pluralize(len(facts.changed_to), 'time')}" if facts.changed_to else "",
    ]
    return ", ".join(filter(None, parts))


# --- the reporting sheet --------------------------------------------------------------------------------------------


def _sheet(given: StudyReportInput) -> Iterable[Block]:
    sheet = given.sheet
    yield Paragraph(ORIGIN, "note")
    missing = unanswered_questions(sheet)
    if missing:
        yield Paragraph(
            f"{pluralize(len(missing), 'item')} still to say, in [report] of study.toml: {', '.join(missing)}.",
            "warning",
        )
    for part in dict.fromkeys(item.part for item in sheet):
        yield ReportTable(
            caption=part,
            head=("item", "from the record", "said by people"),
            rows=tuple(
                (item.title, " ".join(item.known), " ".join(_answers(item))) for item in sheet if item.part == part
            ),
        )


def _answers(item: SheetItem) -> Iterable[str]:
    for name, text in zip(item.asked, item.answers, strict=True):
        yield text if text else f"({UNANSWERED}: {question_of(name)})"

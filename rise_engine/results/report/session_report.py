"""The report of a session as a document: the scenario, the course, waiting times, faults."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import PurePath

from rise_engine import __version__
from rise_engine.base.text import pluralize
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.model import CueState, Point, SessionData, SessionFacts
from rise_engine.results.report.course import course_figure
from rise_engine.results.report.document import (
    ACTOR_NAMES,
    Block,
    Document,
    Facts,
    Paragraph,
    ReportTable,
    Section,
    actor_shares,
    cause_text,
    clock_text,
    interval_text,
    length_text,
    marks_text,
    moment_text,
    number_text,
    per_hundred,
    seconds_text,
    share_text,
    source_name,
    with_interruption,
)
from rise_engine.results.report.session_facts import MARKS, SessionFigures, session_figures
from rise_engine.results.report.trials_section import latency_section
from rise_engine.session.media import MediaFile

_CUE_TEXTS: dict[CueState, str] = {
    "answered": "",
    "unheard": "answer not heard",
    "undone": "taken back",
    "open": "not answered",
}
LEVEL_WORDS = {
    "full": "full: everything, as it was recorded. Only for those who ran the study",
    "shared": "shared: for other researchers; no dates, no notes, no names",
    "public": "public: for everybody; no dates, no notes, no names, no free speech",
}


def session_report(data: SessionData, replay: str = "") -> Document:
    """Make the report of a session.

    :param data: the session at the report's level.
    :param replay: whether it replays identically, in words; empty: not checked.
    """
    facts, figures = data.facts, session_figures(data)
    sections = (
        Section("Checks", tuple(_checks(data))),
        Section("Course", tuple(_course(data))),
        latency_section(figures.latency, figures.by_source),
        Section("Acts", tuple(_acts(figures))),
        Section("Rules", tuple(_rules(data, figures))),
        Section("Mistakes, faults and repairs", tuple(_mistakes(data, figures))),
        Section("Notes", tuple(_notes(data))),
        Section("Recordings", tuple(_recordings(data))),
        Section("In order", tuple(_in_order(data))),
    )
    return Document(
        title=report_title(facts),
        kind="Session report",
        banner=_banner(facts),
        summary=_summary(facts, figures),
        facts=tuple(_head(data, replay)),
        sections=tuple(section for section in sections if section.blocks),
        colophon=colophon(facts.session, data.level),
    )


def report_title(facts: SessionFacts) -> str:
    """Return the title: `P07, run 2, yes+loud`, or the scenario's title for a session without a study."""
    run = f"run {facts.run}" if facts.run else ""
    named = ", ".join(filter(None, (facts.participant, run, facts.condition)))
    return named or facts.title or facts.session


def colophon(what: str, level: str) -> str:
    """Return the text at the end of every report."""
    return (
        f"Made by rise-tui {__version__} from the record of {what}, at the level {level}. Quartiles and percentiles "
        "follow definition 7 of Hyndman and Fan (1996), as in R and NumPy. Intervals of shares are Wilson's, "
        "95\u00a0%. This file fetches nothing and runs no script."
    )


def problem_paragraphs(problems: Sequence[str], level: ExportLevel) -> Iterable[Paragraph]:
    """Report unreadable parts. The sentences contain files, dates and folders, so only the level full shows them."""
    if level == "full":
        yield from (Paragraph(problem, "warning") for problem in problems)
    elif problems:
        text = f"{pluralize(len(problems), 'thing')} could not be read and"
        yield Paragraph(f"{text} {'is' if len(problems) == 1 else 'are'} missing here.", "warning")


def _banner(facts: SessionFacts) -> str:
    sentences = []
    if facts.mode == "debug":
        sentences.append("DEBUG: the robot was simulated. These are not data of a participant.")
    elif facts.is_simulated:
        sentences.append("SIMULATED: the mode was real, but no robot moved. These are not data of a participant.")
    if facts.purpose in ("pilot", "training"):
        sentences.append(f"{facts.purpose.upper()}: this session does not count.")
    if not facts.ended:
        sentences.append("The record has no end: the session runs, or its engine went away.")
    return " ".join(sentences)


def _summary(facts: SessionFacts, figures: SessionFigures) -> str:
    sentences = [f"{length_text(facts.duration).capitalize()}, in which {pluralize(_begun(figures), 'act')} began."]
    response = figures.latency.response
    if figures.answered:
        median = "but no answer has a time that counts"
        if (summary := response.summary) is not None:
            timed = len(response.values)
            which = "them" if timed == figures.answered else f"the {timed} with a time that counts"
            middle = f"{number_text(summary.lower)}\u2013{seconds_text(summary.upper)}"
            median = f"half of {which} within {seconds_text(summary.median)} (middle half {middle})"
        sentences.append(f"The robot answered {figures.answered} of {pluralize(figures.cues, 'cue')}, {median}.")
    elif figures.cues:
        sentences.append(f"The robot answered none of {pluralize(figures.cues, 'cue')}.")
    mistakes = figures.mistakes
    if marks := sum(mistakes.marks.values()):
        sentences.append(f"Wizards marked {pluralize(marks, 'mistake')}.")
    if mistakes.stops:
        times = "once" if mistakes.stops == 1 else f"{mistakes.stops} times"
        sentences.append(f"Somebody stopped everything {times}.")
    return " ".join(sentences)


def _begun(figures: SessionFigures) -> int:
    return sum(figures.actors.values())


def _head(data: SessionData, replay: str) -> Iterable[tuple[str, str]]:
    facts = data.facts
    versions = ", ".join(f"{name} {version}" for name, version in facts.versions.items())
    outcome = facts.outcome or ("not said" if facts.purpose == "counted" else "")
    reason = f": {facts.outcome_reason}" if facts.outcome_reason else ""
    attempt = f", attempt {facts.attempt}" if facts.attempt > 1 else ""
    away = f"{length_text(facts.downtime)} in all" if facts.downtime is not None else "an unknown time"
    gone = f", without a running engine for {away}" if facts.downtime != 0.0 else ""
    recovered = f", recovered {pluralize(facts.recoveries, 'time')}" if facts.recoveries else ""
    rows = [
        ("Participant", facts.participant),
        ("Reassigned", f"run as {facts.run_as}; study.jsonl says why" if facts.run_as else ""),
        ("Condition", facts.condition),
        ("Factors", ", ".join(f"{name} {level}" for name, level in facts.factors.items())),
        ("Study", facts.study),
        ("Slot and run", f"slot {facts.slot}, run {facts.run}{attempt}" if facts.slot else ""),
        ("Outcome", f"{outcome}{reason}" if outcome else ""),
        ("Purpose", facts.purpose),
        ("Mode", f"{facts.mode}, simulated robot" if facts.is_simulated else facts.mode),
        ("Injected faults", "; ".join(facts.injected_faults)),
        ("Robot", facts.robot),
        ("Scenario", facts.title),
        ("Begun", moment_text(facts.started)),
        ("Length", f"{length_text(facts.duration)}{recovered}{gone}"),
        ("Speed", f"{facts.speed:g} times real time" if facts.speed != 1.0 else ""),
        ("Wizards", ", ".join(dict.fromkeys(source_name(key.source) for key in data.keys))),
        ("Replay", replay),
        ("Seed", str(facts.seed)),
        ("Versions", versions),
        ("Scenario, SHA-256", ", then ".join(each[:16] for each in (facts.scenario_hash, *facts.changed_to))),
        ("Changed files", "; ".join(_changed_files(data))),
        ("Study, SHA-256", facts.study_hash[:16]),
        ("Session", facts.session),
        ("Level", LEVEL_WORDS[data.level]),
    ]
    return ((name, value) for name, value in rows if value)


def _changed_files(data: SessionData) -> Iterable[str]:
    """Report when the session continued with changed files, who did this, and the changes."""
    for point in data.points:
        if point.kind == "scenario":
            yield f"{clock_text(point.at)} by {source_name(point.source)}: {point.value}"


# --- checks ---------------------------------------------------------------------------------------------------------


def _checks(data: SessionData) -> Iterable[Block]:
    skipped = [check.id for check in data.checks if check.result == "skipped"]
    failed = [check.id for check in data.checks if check.result == "failed"]
    if skipped or failed:
        sentences = [f"Skipped: {', '.join(skipped)}."] * bool(skipped) + [f"Failed: {', '.join(failed)}."] * bool(
            failed
        )
        yield Paragraph(" ".join(sentences), "warning")
    yield from problem_paragraphs(data.problems, data.level)
    if changed := data.facts.changed_keys:
        keys = ", ".join(f"{key} from {clock_text(at)} on" for key, at in changed.items())
        yield Paragraph(f"A wizard changed what the condition had set: {keys}.", "warning")
    if data.checks:
        yield ReportTable(
            caption="Checks before and after the session",
            head=("check", "result", "what it checks", "found", "reason", "by"),
            rows=tuple(
                (check.id, check.result, check.text, check.value, check.reason, source_name(check.source))
                for check in data.checks
            ),
            marked=frozenset(at for at, check in enumerate(data.checks) if check.result != "passed"),
        )
    else:
        yield Paragraph("No checks are on record for this session.")


# --- course, acts, rules ---------------------------------------------------------------------------------------------


def _course(data: SessionData) -> Iterable[Block]:
    figure = course_figure(data)
    yield figure if figure is not None else Paragraph("Nothing happened in it.")


def _acts(figures: SessionFigures) -> Iterable[Block]:
    if not figures.acts:
        yield Paragraph("No act was asked for.")
        return
    shares = actor_shares(figures.actors)
    if shares:
        spoken = figures.free_speech_share
        freely = f" Wizards typed {share_text(spoken.count, spoken.n)} spoken acts freely." if spoken.n else ""
        yield Paragraph(f"These caused the acts that began: {', '.join(shares)}.{freely}")
    rows = []
    for act in figures.acts:
        ended = ", ".join(f"{number} {status}" for status, number in act.statuses.items() if status != "SUCCEEDED")
        caused = ", ".join(f"{ACTOR_NAMES[actor]} {number}" for actor, number in act.by.items())
        fillers = f", {act.fillers} as filler" if act.fillers else ""
        rows.append(
            (
                act.name,
                str(act.begun),
                caused + fillers,
                number_text(act.length.median) if act.length else "",
                number_text(act.response.median) if act.response else "",
                str(act.response.n) if act.response else "",
                marks_text(act.marks),
                ended,
            )
        )
    yield ReportTable(
        caption="Acts, the most frequent first. Times are medians in seconds. Only acts that answered a cue have a "
        "response",
        head=("act", "begun", "caused by", "length", "response", "n", "marked", "not succeeded"),
        rows=tuple(rows),
        numbers=frozenset({1, 3, 4, 5}),
    )


def _rules(data: SessionData, figures: SessionFigures) -> Iterable[Block]:
    if not figures.states:
        yield Paragraph("No rule ran.")
        return
    whole = data.facts.duration or 1.0
    rows, before = [], ""
    for state in figures.states:
        notes = [f"{state.stepped_back} by stepping back"] if state.stepped_back else []
        notes += [f"and {length_text(state.outage_s)} without an engine"] if state.outage_s else []
        rows.append(
            (
                state.rule if state.rule != before else "",
                state.state,
                str(state.visits),
                length_text(state.seconds),
                f"{100 * state.seconds / whole:.0f}",
                number_text(state.each.median, 1) if state.each else "",
                ", ".join(notes),
            )
        )
        before = state.rule
    yield ReportTable(
        caption="Phases: the visits of each rule to a state, their total time, its share of the session, and the "
        "median visit in seconds. Times are session time. The median leaves out visits with an outage, a standstill "
        "or a stop",
        head=("rule", "state", "visits", "in all", "%", "median", "note"),
        rows=tuple(rows),
        numbers=frozenset({2, 3, 4, 5}),
    )


# --- what went wrong ------------------------------------------------------------------------------------------------


def _mistakes(data: SessionData, figures: SessionFigures) -> Iterable[Block]:
    found = figures.mistakes
    marks = ", ".join(f"{number} {mark}" for mark, number in found.marks.items()) or "none"
    actions = ", ".join(f"{number} {status}" for status, number in found.actions_failed.items()) or "none"
    yield Facts(
        (
            ("Keys of wizards marked as mistakes", share_text(found.marked.count, found.marked.n)),
            (
                "Per 100 keys of wizards, 95\u00a0% interval",
                f"{per_hundred(found.marked)} {interval_text(found.marked)}".strip(),
            ),
            (f"Marks ({', '.join(MARKS)})", marks),
            ("Acts that were refused", str(found.rejected)),
            ("Acts that were broken off", str(found.canceled)),
            ("Acts that failed", str(found.aborted)),
            ("Actions of the robot that failed", actions),
            ("Rules ended by a fault", str(found.rules_faulted)),
            ("Stops", str(found.stops)),
            ("Robot lost", str(found.robot_lost)),
            ("Robot partly lost", str(found.robot_degraded)),
            ("Outages of the engine", _outages(data)),
            ("Standstills of the engine", _standstills(data)),
            ("Control changed hands", str(found.control_changes)),
            ("Repairs", _repairs(data)),
        )
    )
    moments = [
        point
        for point in data.points
        if point.kind in ("mistake", "fault", "stop", "robot", "recovery") and point.name != "connected"
    ]
    if moments:
        yield ReportTable(
            caption="When",
            head=("at", "what", "about", "details", "by"),
            rows=tuple(
                (
                    clock_text(each.at),
                    each.kind,
                    each.name,
                    _point_text(each),
                    source_name(each.source),
                )
                for each in moments
            ),
            numbers=frozenset({0}),
        )
    if found.failures:
        yield Paragraph(f"{pluralize(found.failures, 'failed act')} waited for somebody to decide.", "note")


def _outages(data: SessionData) -> str:
    number, away = sum(each.kind == "outage" for each in data.interruptions), data.facts.downtime
    if not number:
        return "none"
    times = pluralize(number, "outage")
    return (
        f"{times}, {length_text(away)} in all by the wall clock" if away is not None else f"{times}, of unknown length"
    )


def _standstills(data: SessionData) -> str:
    found = [each.seconds for each in data.interruptions if each.kind == "standstill"]
    return f"{pluralize(len(found), 'standstill')}, {length_text(sum(found))} in all" if found else "none"


def _point_text(point: Point) -> str:
    if point.outage_s is None or point.kind == "note":
        return point.value
    return f"no engine for {length_text(point.outage_s)}; session time stood still"


def _repairs(data: SessionData) -> str:
    repairs = data.repairs
    counts = (
        (repairs.repeated, f"{repairs.repeated} repeated"),
        (repairs.stepped_back, f"{repairs.stepped_back} stepped back"),
        (repairs.cues_undone, f"{pluralize(repairs.cues_undone, 'cue')} taken back"),
        (repairs.canceled, f"{pluralize(repairs.canceled, 'act')} stopped by a wizard"),
    )
    return ", ".join(what for number, what in counts if number) or "none"


def _notes(data: SessionData) -> Iterable[Block]:
    notes = [point for point in data.points if point.kind == "note"]
    if notes:
        yield ReportTable(
            caption=f"{pluralize(len(notes), 'note')}, as the level shows them",
            head=("at", "note", "by"),
            rows=tuple((clock_text(each.at), each.value, source_name(each.source)) for each in notes),
            numbers=frozenset({0}),
        )


# --- recordings -----------------------------------------------------------------------------------------------------


def _recordings(data: SessionData) -> Iterable[Block]:
    if data.recordings:
        yield ReportTable(
            caption="Recorders, with their last status",
            head=("recorder", "status", "file", "MB", "reason"),
            rows=tuple(
                (each.name, each.status, each.path, _megabytes(each.bytes), each.reason) for each in data.recordings
            ),
            numbers=frozenset({3}),
            marked=frozenset(at for at, each in enumerate(data.recordings) if each.status in ("stalled", "failed")),
        )
    if data.media:
        yield ReportTable(
            caption="Files on the session's clock: media time = offset + rate \u00d7 session time",
            head=("file", "kind", "length", "offset in s", "drift in ppm", "aligned by", "marks found"),
            rows=tuple(
                (
                    PurePath(each.path).name,
                    each.kind,
                    length_text(each.duration) if each.duration is not None else "",
                    number_text(each.offset, 3),
                    _drift_text(each),
                    each.aligned_by or "not aligned",
                    ", ".join(str(mark.number) for mark in each.marks),
                )
                for each in data.media
            ),
            numbers=frozenset({2, 3, 4}),
            marked=frozenset(at for at, each in enumerate(data.media) if not each.aligned_by),
        )
    if data.syncs:
        marks = ", ".join(f"{each.number} at {seconds_text(each.t)} ({each.medium})" for each in data.syncs)
        yield Paragraph(f"Marks for recordings: {marks}.")
    if not data.recordings and not data.media and not data.syncs:
        yield Paragraph("No recordings are on record.")


def _drift_text(file: MediaFile) -> str:
    if file.offset is None or len(file.marks) < 2:
        return ""
    within = file.drift_within_ppm
    drift = number_text(file.drift_ppm, 1)
    return drift if within is None else f"{drift} \u00b1 {number_text(within, 0)}"


def _megabytes(size: int | None) -> str:
    return "" if size is None else number_text(size / 1e6, 1)


# --- everything in order --------------------------------------------------------------------------------------------


def _in_order(data: SessionData) -> Iterable[Block]:
    """List everything in order, for looking things up and for readers who cannot see the course."""
    rows: list[tuple[float, tuple[str, ...]]] = []
    for act in data.acts:
        texts = "; ".join(part.text for part in act.parts if part.text)
        waits = with_interruption(number_text(act.response_s), act.response_outage_s, act.response_interrupted)
        waits = waits if not act.filler else ""
        when = act.started_at if act.started_at is not None else act.accepted_at
        rows.append((when, (act.act, cause_text(act.by, act.via), act.status, waits, texts)))
    for cue in data.cues:
        rows.append((cue.at, ("cue", source_name(cue.source), _CUE_TEXTS[cue.state], "", cue.text)))
    for phase in data.phases:
        rows.append((phase.start, (f"{phase.rule}: {phase.state}", source_name(phase.source), "", "", phase.trigger)))
    recoveries = [point for point in data.points if point.kind == "recovery"]
    rows += [(each.at, ("recovery", source_name(each.source), "", "", _point_text(each))) for each in recoveries]
    rows.sort(key=lambda each: each[0])
    if rows:
        yield ReportTable(
            caption=f"Everything in order: {len(rows)} acts, cues, phases and recoveries",
            head=("at", "what", "by", "status", "response", "details"),
            rows=tuple((clock_text(at), *row) for at, row in rows),
            numbers=frozenset({0, 4}),
            folded=True,
            page_only=True,
        )

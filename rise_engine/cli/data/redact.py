"""`rise-engine redact`: the removal of words from a session."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import click

from rise_engine.base.exit_status import OK, PARTIAL, USAGE
from rise_engine.base.files import lines_with
from rise_engine.base.json_codec import encode
from rise_engine.base.text import name_some, pluralize
from rise_engine.base.words import Words, parse_replacement
from rise_engine.cli.options import HERE, JSON, SESSION
from rise_engine.cli.terminal import print_lines, refusing, show
from rise_engine.privacy.redaction import RedactionReport, redact
from rise_engine.privacy.suggestions import NameSuggestion, suggest_words
from rise_engine.study.study_log import LOG_FILE, LockedLog, LogEntry, StudyLogError
from rise_engine.study.traces import (
    PARTICIPANTS_FILE,
    STUDY_FILE,
    owner_of,
    questionnaire_files,
    study_of_session,
)


@click.command("redact")
@SESSION
@click.option("--replace", "replacements", metavar="WORD=NAME", multiple=True, help="Replace WORD by NAME. Repeatable.")
@click.option("--suggest", is_flag=True, help="List words that could be names, and change nothing.")
@click.option("--whole-words", is_flag=True, help="Keep a word that is only part of a longer one.")
@click.option("--match-case", is_flag=True, help="Remove a word only with the same upper and lower case.")
@click.option("--try", "try_only", is_flag=True, help="Show what would be done, and change nothing.")
@click.option("--by", metavar="NAME", default="", help="Record in session.toml who does it. Default: no name.")
@HERE
@JSON
def redact_session(
    session: Path,
    replacements: tuple[str, ...],
    suggest: bool,
    whole_words: bool,
    match_case: bool,
    try_only: bool,
    by: str,
    here: bool,
    as_json: bool,
) -> int:
    """Remove words from the record of SESSION permanently. The session still replays.

    SESSION is a session's folder, or its name in the sessions folder ($RISE_SESSIONS, or ~/rise-sessions).

    \b
      rise-engine redact SESSION --suggest
      rise-engine redact SESSION --replace Maria=NAME1 --replace "Anna Berg=NAME2"

    It removes a word from the inputs and the records of the journal and from session.toml, in upper and lower case and
    also within longer words. It refuses, and changes nothing, if the words decide what happened: the session would not
    replay then. Nothing of the old journal is kept. Words of the scenario itself stay, and are listed.

    In a study, it also removes the words from the entries about this session or its participant in study.jsonl. Earlier
    exports are listed and stay unchanged.

    Exit status: 0 done; 1 refused, the words are still somewhere, or there are older exports; 2 wrong usage.
    """
    with refusing(USAGE):
        if suggest:
            found = suggest_words(session)
            show(_suggestion_lines(found), found, as_json=as_json)
            return OK
        words = Words(map(parse_replacement, replacements), whole_words=whole_words, match_case=match_case)
    exports: list[str] = []

    def redact_exports(report: RedactionReport) -> None:
        exports.extend(redact_in_study(session, report, words, try_only=try_only))

    report = redact(session, words, by=by, here=here, try_only=try_only, before=redact_exports)
    show(_report_lines(report, try_only=try_only, whole_words=whole_words), report, as_json=as_json)
    if try_only:
        return OK
    if exports and not as_json:
        print_lines("exports that were made before may still hold the words, delete them or make them again:")
        print_lines(*(f"  {each}" for each in exports))
    return PARTIAL if report.remains or exports else OK


def _report_lines(report: RedactionReport, *, try_only: bool, whole_words: bool) -> list[str]:
    if not report.changed:
        lines = ["nothing was changed: the words are in nothing that people said or typed"]
    elif try_only:
        lines = [
            f"would change {pluralize(report.lines, 'line')} of the journal, and it would replay; nothing was done"
        ]
    else:
        lines = [f"changed {pluralize(report.lines, 'line')} of the journal, and it replays: identical"]
    if report.info_lines and not try_only:
        lines.append(f"changed {pluralize(report.info_lines, 'line')} of session.toml")
    if report.shadow_lines and not try_only:
        lines.append(f"changed {pluralize(report.shadow_lines, 'line')} of what second wizards did (shadow)")
    if report.coded_files and not try_only:
        lines.append(f"changed {pluralize(report.coded_files, 'annotation file')}")
    if report.log_lines:
        would = "would change" if try_only else "changed"
        lines.append(f"{would} {pluralize(report.log_lines, 'line')} of the study's log ({LOG_FILE})")
    if report.longer_words:
        longer = ", ".join(f"{word} ({count})" for word, count in list(report.longer_words.items())[:12])
        hint = "left within longer words" if whole_words else "within longer words, too"
        lines.append(f"{hint}: {longer}")
    lines += [f"erased {name}, which a recovery had kept of the old journal" for name in report.erased]
    if report.remains:
        lines.append("the words are still in:")
        lines += [f"  {each}" for each in report.remains]
    return lines


def redact_in_study(folder: Path, report: RedactionReport, words: Words, *, try_only: bool = False) -> list[str]:
    """Remove the words from people's texts about a session or its participant in its study's log, and log this.

    This precedes the change of the session, so that the log has it even if the command is killed in between.

    :param folder: the session's folder.
    :param report: the session's report, to which changes and remains are added.
    :param words: the words to remove.
    :param try_only: whether to change nothing.
    :return: the exports from before the session's last redaction that still exist.
    """
    study = study_of_session(folder)
    if study is None:
        return []
    name, participant = folder.resolve().name, owner_of(folder)

    def is_about(entry: LogEntry) -> bool:
        """Whether an entry is about the session, or about its participant and no session."""
        of_sessions = {entry.get("session"), entry.get("folder")} - {None}
        return name in of_sessions or (
            not of_sessions and participant != "" and entry.get("participant") == participant
        )

    try:
        with LockedLog(study) as log:
            before = log.entries()
            after = [each.with_written(words.replace, sources=True) if is_about(each) else each for each in before]
            report.log_lines = sum(one != other for one, other in zip(before, after, strict=True))
            others = [each.line for each in after if words.find(encode([*each.fields.values()]).decode())]
            report.remains += _find_in_people_files(study, words)
            if others:
                lines = f"line{'s' if len(others) > 1 else ''} {name_some(others)}"
                report.remains.append(f"{LOG_FILE}, {lines}: about another session, or a path or a name that stays")
            if try_only:
                return []
            if report.log_lines:
                log.rewrite(after)
            if report.changed:
                log.append("redacted", session=name, lines=report.lines)
            return _older_exports(study, name, log.entries())
    except (StudyLogError, OSError) as error:
        report.remains.append(f"{LOG_FILE}, which could not be changed: {error}")
        return []


def _find_in_people_files(study: Path, words: Words) -> list[str]:
    """List where the words are in files of the study that only people write."""
    found = []
    for name in (STUDY_FILE, PARTICIPANTS_FILE, *sorted(questionnaire_files(study))):
        with suppress(OSError):
            if lines := lines_with(study / name, words.find):
                found.append(f"{name}, line{'s' if len(lines) > 1 else ''} {name_some(lines)}: take them out yourself")
    return found


def _older_exports(study: Path, session: str, log: Sequence[LogEntry]) -> list[str]:
    """List the existing exports of a session from before its last redaction."""
    found: dict[str, Path] = {}
    older: list[str] = []
    for each in log:
        if each.kind == "exported" and session in (each.get("sessions") or []):
            found[str(each.get("path"))] = study / str(each.get("path"))
        elif each.kind == "redacted" and each.get("session") == session:
            older += found
            found.clear()
    return [path for path in dict.fromkeys(older) if path not in found and os.path.lexists(study / path)]


def _suggestion_lines(found: Sequence[NameSuggestion]) -> list[str]:
    if not found:
        return ["no word was found that could be a name; look through the notes all the same"]
    width = min(30, max(len(each.word) for each in found))
    lines = [f"{each.word:{width}}  {each.count:>3}  {each.why}" for each in found]
    return [*lines, "", "Only people know which of them are names: rise-engine redact SESSION --replace WORD=NAME1"]

"""The checks of a study (`[[check]]` in study.toml): which are pending, which can be skipped, and which are due."""

from __future__ import annotations

import os
import re
import shlex
import shutil
from collections.abc import Iterable, Sequence
from contextlib import suppress
from datetime import datetime, timedelta
from pathlib import Path
from typing import Literal

from msgspec import Struct

from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.base.text import clean, escape_surrogates
from rise_engine.scenario.files.toml_files import TomlTable
from rise_engine.scenario.settings import names_in
from rise_engine.study.model import Purpose, SessionEntry, Study, StudyCheck
from rise_engine.study.settings import STUDY_TABLES
from rise_engine.study.study_log import LogEntry

_QUANTITY = re.compile(r"\s*(\d+(?:\.\d+)?)\s*([A-Za-z]+)\s*\Z", re.ASCII)
DAY = 86_400.0
"""Seconds."""
TIME_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": DAY, "w": 7 * DAY, "y": 365.25 * DAY}
SIZE_UNITS = {"kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}
_SIZES = {name.casefold(): factor for name, factor in SIZE_UNITS.items()}


def parse_length(text: str) -> float | None:
    """Return the seconds of a written duration. None: it is not a duration.

    >>> parse_length("30 d"), parse_length("90min"), parse_length("a while")
    (2592000.0, 5400.0, None)
    """
    found = _QUANTITY.match(text)
    if found is None or found.group(2) not in TIME_UNITS:
        return None
    return float(found.group(1)) * TIME_UNITS[found.group(2)]


def parse_size(text: str) -> int | None:
    """Return the bytes of a written size. None: it is not a size.

    >>> parse_size("20 GB"), parse_size("1.5gb"), parse_size("much")
    (20000000000, 1500000000, None)
    """
    found = _QUANTITY.match(text)
    if found is None or found.group(2).casefold() not in _SIZES:
        return None
    return round(float(found.group(1)) * _SIZES[found.group(2).casefold()])


def program_problem(arguments: Sequence[str], folder: str | Path) -> str:
    """Return a sentence why a study's program cannot be started. Empty: no reason is known.

    :param arguments: the check's `run`.
    :param folder: the study's folder.
    """
    if not arguments or not arguments[0]:
        return "`run` names no program"
    name, folder = arguments[0], Path(folder)
    if any("\0" in argument for argument in arguments):
        return "a program and its arguments cannot have a NUL in them"
    if "/" not in name:
        if shutil.which(name) is not None:
            return ""
        if (folder / name).is_file():
            return f"{name} is in the study's folder, and is not a program of this computer: write ./{name}"
        return f"there is no program {name} on this computer"
    path = folder / name
    if not path.exists():
        near = did_you_mean(path.name, _names_in(path.parent), limit=0)
        return f"there is no program {name} in the study's folder{near}"
    if not path.is_file():
        return f"{name} is a folder, not a program"
    if not os.access(path, os.X_OK):
        return f"{name} may not be executed: chmod +x {escape_surrogates(str(path))}"
    return _interpreter_problem(name, path)


def _names_in(folder: Path) -> list[str]:
    with suppress(OSError):
        return sorted(each.name for each in folder.iterdir())
    return []


def _interpreter_problem(name: str, path: Path) -> str:
    """Return what is wrong with a script's first line. Empty: nothing, or it is not a script."""
    try:
        with path.open("rb") as file:
            head = file.read(256)
    except OSError as error:
        return f"{name} cannot be read: {error.strerror or error}"
    if not head:
        return f"{name} is empty"
    first, end, _ = head.partition(b"\n")
    if not first.startswith(b"#!"):
        return ""
    if end and first.endswith(b"\r"):
        return f"{name} has line ends of Windows, which hide its interpreter: save it with line ends of Unix"
    words = first[2:].split()
    interpreter = words[0].decode("utf-8", "replace") if words else ""
    if not interpreter or not Path(interpreter).exists():
        return f"the first line of {name} names an interpreter that is not there: {clean(interpreter) or 'none'}"
    return ""


AUTOMATIC: dict[str, str] = {
    "robot": "the robot answers and offers every action that the scenario uses",
    "disk": "there is room for the session",
    "clock": "this computer's clock is right",
    "sound": "the robot says a word, and somebody hears it",
    "consent": "the participant has consented",
    "participant": "the participant may take part now",
    "scenario": "the scenario is the one that the plan was made with",
    "wizard": "the wizard has given a name",
    "recorder": "everything that records the session records, and its files grow",
    "replay": "the last session replays identically",
    "explored": "in this condition and language, exploring found nothing that gets stuck or fails",
}
"""What each automatic check confirms, in words for screens and records."""
PARTICIPANT_CHECKS = frozenset({"consent", "participant"})
"""Checks of one participant. They say nothing about the next one, so `every` does not apply, and they cannot be skipped
in a session that counts."""


_KEYS = tuple(names_in(STUDY_TABLES, "check.*"))
_KINDS = ("ask", "auto", "run")
_ID = re.compile(r"[A-Za-z][A-Za-z0-9_-]*\Z")
_LONGEST_LIMIT = 3600.0
"""Seconds."""
_FORM = 'a check has exactly one of ask = "...", auto = "..." and run = ["..."]'


def read_checks(study: TomlTable, folder: Path) -> tuple[StudyCheck, ...]:
    """Read all checks of a study in their order.

    :param study: the whole study.toml.
    :param folder: the study's folder, which has its own programs.
    """
    listed = study.values.get("check", [])
    if not isinstance(listed, list) or not all(isinstance(each, dict) for each in listed):
        study.report_key("wrong-type", "each check is a table of its own: [[check]], with two brackets", "check")
        return ()
    checks: list[StudyCheck] = []
    for number, values in enumerate(listed):
        table = TomlTable(study.file, ("check", str(number)), values, study.diagnostics)
        check = _read_check(table)
        if check.run and (problem := program_problem(check.run, folder)):
            study.diagnostics.warning("no-program", table.value_location("run"), problem)
        if check.id and any(each.id == check.id for each in checks):
            table.report_value("duplicate-name", "id", f"another check is called `{check.id}`")
        checks.append(check)
    return tuple(checks)


def _read_check(table: TomlTable) -> StudyCheck:
    table.report_unknown_keys(_KEYS)
    given = [kind for kind in _KINDS if kind in table.values]
    misspelt = any(did_you_mean(key, _KINDS, limit=0) for key in table.values if key not in _KEYS)
    if len(given) != 1 and not (misspelt and not given):
        table.report_key("check-form", _FORM)
    auto = _read_auto(table)
    when = table.read("when", str, "before", form=': "before" or "after" the session')
    if when not in ("before", "after"):
        table.report_value("wrong-value", "when", f'`when` is "before" or "after" the session, not `{when}`')
    ask = table.read("ask", str, "", form=': a sentence that somebody confirms: ask = "The lamp is on"').strip()
    if "ask" in table.values and isinstance(table.values["ask"], str) and not ask:
        table.report_value("missing-value", "ask", "`ask` is empty; write a sentence that somebody confirms")
    return StudyCheck(
        id=_read_id(table),
        when="after" if when == "after" else "before",
        ask=ask,
        auto=auto,
        run=_read_run(table),
        minimum=_read_minimum(table, auto),
        valid=_read_every(table, auto),
        blocks=table.read("blocks", bool, True),
        limit=_read_limit(table),
    )


def _read_id(table: TomlTable) -> str:
    identity: str = table.read("id", str, "", form=': id = "lights"')
    if "id" not in table.values:
        if not any(did_you_mean(key, ("id",), limit=0) for key in table.values if key not in _KEYS):
            table.report_key("missing-value", 'this check has no `id`; write id = "..."')
    elif isinstance(table.values["id"], str) and not _ID.match(identity):
        message = f"an `id` has letters, digits, `_` and `-`, and begins with a letter, not `{identity}`"
        table.report_value("bad-name", "id", message)
    return identity


def _read_auto(table: TomlTable) -> str:
    auto: str = table.read("auto", str, "", form=': auto = "robot"')
    if "auto" in table.values and isinstance(table.values["auto"], str) and auto not in AUTOMATIC:
        near = did_you_mean(auto, AUTOMATIC, limit=0) or f"; there are {in_backquotes(AUTOMATIC)}"
        table.report_value("unknown-name", "auto", f"there is no automatic check `{auto}`{near}")
        return ""
    return auto


def _read_run(table: TomlTable) -> tuple[str, ...]:
    if isinstance(table.values.get("run"), str):
        table.report_value("wrong-type", "run", '`run` is a program and its arguments: run = ["./check.sh", "fast"]')
        return ()
    run = table.read_texts("run", ())
    if "run" in table.values and table.values["run"] == []:
        table.report_value("missing-value", "run", "`run` is empty; name a program")
    return run


def _read_minimum(table: TomlTable, auto: str) -> str:
    text: str = table.read("min", str, "", form=': min = "20 GB"')
    if "min" in table.values and auto != "disk" and (auto or "auto" not in table.values):
        table.report_key("check-form", '`min` says how much room there must be; it goes with auto = "disk"', "min")
    elif text and parse_size(text) is None:
        table.report_value("wrong-value", "min", f"`{text}` is not a size; write 20 GB or 500 MB")
    return text


def _read_every(table: TomlTable, auto: str) -> float | None:
    text = table.read("every", str, None, form=': every = "30 d"')
    if text is None:
        return None
    seconds = parse_length(text)
    if seconds is None or seconds <= 0:
        table.report_value("wrong-value", "every", f"`{text}` is not a length of time; write 8 h, 30 d or 1 y")
        return None
    if auto in PARTICIPANT_CHECKS:
        message = f'`every` does not go with auto = "{auto}": that one participant passed says nothing about the next'
        table.report_key("check-form", message, "every")
        return None
    return seconds


def _read_limit(table: TomlTable) -> float | None:
    text = table.read("limit", str, None, form=': limit = "2 min"')
    if text is None:
        return None
    seconds = parse_length(text)
    if seconds is None or not 0 < seconds <= _LONGEST_LIMIT:
        table.report_value(
            "wrong-value", "limit", f"`{text}` is not a limit of a check; write 30 s or 2 min, up to 1 h"
        )
        return None
    if "ask" in table.values:
        table.report_key("check-form", "`limit` goes with auto and run: a person may take their time", "limit")
        return None
    return seconds


# --- what is still to be made -----------------------------------------------------------------------------------------


_DEBRIEF = "debrief"


class PendingCheck(Struct, frozen=True):
    """A check before or after a session, and whether it must be made."""

    check: StudyCheck
    good_since: str = ""
    """When it passed (ISO 8601), if this result is still valid (`every`). Empty: it must be made."""
    value: str = ""
    """The earlier result's value."""


def check_text(check: StudyCheck) -> str:
    """Return a check in words: its sentence, what the program checks, or the command."""
    if check.ask:
        return check.ask
    return AUTOMATIC.get(check.auto, check.auto) if check.auto else shlex.join(check.run)


def pending_checks(
    study: Study, when: Literal["before", "after"], earlier: Sequence[LogEntry], now: datetime
) -> tuple[PendingCheck, ...]:
    """Return the checks before or after a session in the file's order, with those that are still valid.

    :param study: the study with the checks.
    :param when: before or after the session.
    :param earlier: the entries of study.jsonl in their order.
    :param now: a time with a time zone.
    """
    return tuple(reuse_result(check, earlier, now) for check in study.checks if check.when == when)


def reuse_result(check: StudyCheck, earlier: Sequence[LogEntry], now: datetime) -> PendingCheck:
    """Decide whether an earlier result of a check is still valid: the check has `every`, passed last within that time,
    and had the same text. Later skips do not matter, failures do. Checks of one participant never stay valid.

    :return: the check, with `good_since` if it is.
    """
    made = (
        entry
        for entry in reversed(earlier)
        if entry.kind == "checked" and entry.get("id") == check.id and entry.get("result") != "skipped"
    )
    last = next(made, None) if check.valid is not None and check.auto not in PARTICIPANT_CHECKS else None
    if check.valid is None or last is None or last.get("result") != "passed" or last.get("text") != check_text(check):
        return PendingCheck(check)
    try:
        age = now - datetime.fromisoformat(last.at)
    except (ValueError, TypeError):  # not a time, or one without a zone, in an edited file
        return PendingCheck(check)
    if not timedelta(0) <= age <= timedelta(seconds=check.valid):
        return PendingCheck(check)
    return PendingCheck(check, last.at, str(last.get("value", "")))


def skip_problem(check: StudyCheck, purpose: Purpose, reason: str) -> str:
    """Return a sentence why a check cannot be skipped with this reason. Empty: it can."""
    if check.auto in PARTICIPANT_CHECKS and purpose == "counted":
        what = "consent" if check.auto == "consent" else "whether the participant may take part"
        return f"{check.id}: {what} cannot be skipped in a session that counts"
    if not reason.strip():
        return f"{check.id}: give a reason for skipping a check"
    return ""


def due_after_checks(study: Study, sessions: Iterable[SessionEntry], entries: Iterable[LogEntry]) -> list[str]:
    """List checks not made after counted sessions, one sentence each. They are only reminders: no data is lost."""
    after = [check for check in study.checks if check.when == "after"]
    made = made_after(entries)
    return [
        f"{session.participant}, run {session.run}{attempt_text(session)}: not confirmed: “{check_text(check)}” "
        f"(check {check.id})"
        for session in sessions
        if session.status == "ended" and session.purpose == "counted"
        for check in after
        if (session.folder, check.id) not in made
    ]


def asks_debriefing(id: str, text: str = "") -> bool:
    """Whether a check confirms a debriefing: its id or its sentence contains that word.

    >>> asks_debriefing("participant-debriefed"), asks_debriefing("end", "Debriefing is done"), asks_debriefing("lamp")
    (True, True, False)
    """
    return any(_DEBRIEF in each.casefold() for each in (id, text))


def checks_after(entries: Iterable[LogEntry]) -> dict[str, dict[str, str]]:
    """Return the results of checks after each session: by the session's folder, then by id. The last one counts."""
    found: dict[str, dict[str, str]] = {}
    for entry in entries:
        if entry.kind == "checked" and entry.get("when") == "after":
            found.setdefault(str(entry.get("session")), {})[str(entry.get("id"))] = str(entry.get("result"))
    return found


def attempt_text(session: SessionEntry) -> str:
    """Return `, attempt 2`, or an empty text for the first attempt."""
    return f", attempt {session.attempt}" if session.attempt > 1 else ""


def made_after(entries: Iterable[LogEntry]) -> frozenset[tuple[str, str]]:
    """Return the checks after sessions that have not failed: the session's folder and the check's id."""
    return frozenset(
        (session, id)
        for session, results in checks_after(entries).items()
        for id, result in results.items()
        if result != "failed"
    )

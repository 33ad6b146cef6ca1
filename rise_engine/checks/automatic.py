"""Automatic checks without a robot: disk, clock, consent, participant, scenario, wizard (`auto`).

Each function takes what it needs and returns a `Finding`. Those that read files or run programs block.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import date, datetime
from pathlib import Path

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.checks.outcome import Finding
from rise_engine.scenario.loader import load
from rise_engine.study.checks import parse_size
from rise_engine.study.model import Participant, ParticipantStanding, SessionEntry, Study
from rise_engine.study.planning import last_planned
from rise_engine.study.study_log import LogEntry
from rise_engine.study.study_scenarios import scenario_folder

DEFAULT_SPACE = 1_000_000_000
"""Bytes that must be free if `min` does not set a number."""
TIMEDATECTL_SECONDS = 5.0
GENERIC_NAMES = frozenset(
    {
        *("admin", "administrator", "debian", "docker", "experimenter", "guest", "lab", "laptop", "nao", "nobody"),
        *("operator", "pc", "pepper", "pi", "raspberry", "robot", "ros", "root", "student", "test", "tester", "ubuntu"),
        *("unknown", "user", "vagrant", "wizard"),
    }
)
"""Logins of machines, roles and shared accounts, which do not identify a person."""


def check_disk(sessions: Path, minimum: str) -> Finding:
    """Check that the disk of the sessions has room and is writable.

    :param sessions: the folder of the study's sessions, which may not exist yet.
    :param minimum: the value of `min`; empty: DEFAULT_SPACE.
    """
    wanted = parse_size(minimum) if minimum else DEFAULT_SPACE
    if wanted is None:
        return Finding(False, reason=f"`min` is not a size: {minimum}")
    folder = sessions
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    try:
        free = shutil.disk_usage(folder).free
    except OSError as error:
        return Finding(False, reason=f"the disk of {folder} does not answer: {error.strerror or error}")
    value = f"{size_text(free)} free"
    if not os.access(folder, os.W_OK | os.X_OK):
        return Finding(False, value, f"{folder} may not be written")
    if free < wanted:
        return Finding(False, value, f"{size_text(wanted)} must be free in {folder}")
    return Finding(True, value)


def check_clock(
    now: datetime, log: Sequence[LogEntry], sessions: Sequence[SessionEntry], synchronised: bool | None
) -> Finding:
    """Check this computer's clock for errors that it can detect.

    :param now: its time, with its zone.
    :param log: the entries of study.jsonl: none of them can be later than now.
    :param sessions: the study's sessions.
    :param synchronised: whether a time server sets it; None: unknown.
    """
    moments = [moment for text in (*(each.at for each in log), *(each.started for each in sessions))
               if (moment := _moment(text)) is not None]  # fmt: skip
    last = max(moments, default=None)
    shown = f"{now:%Y-%m-%d %H:%M %Z}".rstrip()
    if last is not None and now < last:
        before = f"{last.astimezone(now.tzinfo):%Y-%m-%d %H:%M}"
        return Finding(False, shown, f"that is before what was last recorded in this study ({before}); set the clock")
    if synchronised is False:
        return Finding(False, shown, "no time server has set the clock; connect to one, or set it by hand")
    known = "set by a time server" if synchronised else "whether a time server sets it is not known here"
    return Finding(True, f"{shown}, {known}")


def is_clock_synchronised() -> bool | None:
    """Return the answer of `timedatectl` if there is one (blocking, for TIMEDATECTL_SECONDS at most); None: unknown."""
    try:
        found = subprocess.run(
            ["timedatectl", "show", "--property=NTPSynchronized", "--value"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=TIMEDATECTL_SECONDS,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return {b"yes": True, b"no": False}.get(found.stdout.strip())


def check_consent(needed: Sequence[str], participant: Participant | None, name: str, today: date) -> Finding:
    """Check that every necessary consent has a date that is not in the future.

    :param needed: the names in `[consent] needed`.
    :param participant: the row of participants.csv; None: there is none.
    :param name: the participant's name, for the reason.
    :param today: the local date.
    """
    if participant is None:
        return Finding(False, reason=f"{name or 'nobody'} is not in participants.csv, so nothing is known of consent")
    problems: list[str] = []
    for what in needed:
        text = participant.consent.get(what, "")
        if not text:
            problems.append(f"consent_{what} has no date")
            continue
        given = None
        with suppress(ValueError):
            given = date.fromisoformat(text)
        if given is None:
            problems.append(f"consent_{what} is {text!r}, which is not a date such as {today}")
        elif given > today:
            problems.append(f"consent_{what} is {text}, which is still to come")
    if problems:
        line = f" (line {participant.line})" if participant.line else ""
        return Finding(False, reason=f"{name}: {'; '.join(problems)}; see participants.csv{line}")
    dates = ", ".join(f"{what} {participant.consent[what]}" for what in needed)
    return Finding(True, dates or "the study asks for no consent")


def check_participant(
    name: str, listed: Sequence[Participant], standing: ParticipantStanding | None, run: int
) -> Finding:
    """Check whether a participant may take part now.

    :param name: the participant.
    :param listed: participants.csv.
    :param standing: the participant's state in the study.
    :param run: the run that will begin; 0: their next one.
    """
    names = [each.participant for each in listed]
    if name not in names or standing is None:
        if not name:
            return Finding(False, reason="no participant is named")
        return Finding(False, reason=f"there is no participant {name} in participants.csv{did_you_mean(name, names)}")
    why = f": {standing.why}" if standing.why else ""
    match standing.state:
        case "excluded":
            return Finding(False, reason=f"{name} is excluded{why}")
        case "withdrawn":
            return Finding(False, reason=f"{name} has withdrawn")
        case "complete":
            last = f", last on {standing.sessions[-1].started[:10]}" if standing.sessions else ""
            return Finding(False, reason=f"{name} has done everything{last}")
        case "running" | "unfinished":
            return Finding(False, reason=f"a session of {name} is {standing.state}{why}")
        case "to-judge":
            return Finding(False, reason=f"the last session of {name} has no outcome yet: complete, aborted, excluded")
    done = [each.run for each in standing.sessions if each.outcome == "complete"]
    if run in done:
        return Finding(False, reason=f"{name} has done run {run} before")
    if standing.next_run is None:
        return Finding(False, reason=f"there is no run for {name}{why}")
    attempt = f", attempt {standing.next_attempt}" if standing.next_attempt > 1 else ""
    return Finding(True, f"{name}, run {standing.next_run} of {standing.runs}{attempt}")


def check_scenario(folder: Path, study: Study, log: Sequence[LogEntry]) -> Finding:
    """Check that the scenario has not changed since the plan was made (blocking: reads the scenario).

    :param folder: the folder of the scenario that will run.
    :param study: the study with the plan.
    :param log: the entries of study.jsonl; the last `planned` counts, with `scenarios`: hashes by folder.
    """
    planned = last_planned(log)
    if planned is None:
        return Finding(False, reason="there is no plan yet: rise-engine study plan")
    hashes = dict(planned.get("scenarios") or {})
    where = os.path.normpath(folder)
    name = next(
        (each for each in hashes if scenario_folder(study, each) == where), os.path.relpath(where, study.folder)
    )
    known = hashes.get(name)
    loaded = load(folder, robot=study.robot or None)  # like the plan, with the study's robot
    if loaded.scenario is None:
        return Finding(False, reason=f"the scenario `{name}` has errors: {loaded.errors[0]}")
    made = planned.at[:10]
    if not isinstance(known, str):
        return Finding(
            False,
            reason=f"the plan of {made} does not know the scenario `{name}`; make it again "
            "(rise-engine study plan --again REASON)",
        )
    if loaded.scenario.hash != known:
        changed = f"the scenario `{name}`, or the robot that it runs on, was changed since the plan of {made}"
        meant = "put it back as it was, or confirm the change (rise-engine study plan --again REASON)"
        return Finding(False, reason=f"{changed}; {meant}")
    return Finding(True, f"`{name}` is as it was on {made}")


def check_wizard(name: str, wizards: Mapping[str, str]) -> Finding:
    """Check that the record will name the wizard.

    :param name: the name that the console gives.
    :param wizards: the table `[wizards]`, by name; if it exists, it lists all wizards.
    """
    if not name.strip():
        return Finding(False, reason="the wizard has given no name (--wizard NAME)")
    if wizards:
        if name in wizards:
            return Finding(True, name)
        return Finding(False, name, f"not in the table [wizards] of study.toml{did_you_mean(name, wizards)}")
    if name.lower() in GENERIC_NAMES:
        who = "this is an account or a role, and does not say who it is"
        return Finding(False, name, f"{who}; --wizard NAME, or add it to [wizards] in study.toml")
    return Finding(True, name)


def size_text(size: float) -> str:
    """Format a number of bytes.

    >>> size_text(34_123_000_000), size_text(999)
    ('34.1 GB', '999 bytes')
    """
    if size < 1000:
        return f"{size:g} bytes"
    for unit in ("kB", "MB", "GB"):
        size /= 1000
        if size < 999.95:
            return f"{size:.1f} {unit}"
    return f"{size / 1000:.1f} TB"


def _moment(text: str) -> datetime | None:
    with suppress(ValueError):
        moment = datetime.fromisoformat(text)
        return moment if moment.tzinfo is not None else None
    return None

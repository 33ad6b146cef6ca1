"""A BORIS project (`.boris`): an observation for each session, and an ethogram of everything that happened.

The format is BORIS project 7.0, JSON, which BORIS 8 and 9 open. Events with a duration are state events with two rows
(begin, end); all others are point events. Rows of one behaviour, subject and modifier begin and end in turn, so
overlaps go to a behaviour `NAME 2`. Acts are behaviours of the robot, with the requester as modifier. Spoken words are
in the comment. Coding keys stay free for the coder.

Observations are written one by one and the ethogram last, so that studies of hundreds of sessions fit in memory.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from msgspec import Struct, field

from rise_engine.results.analysis.model import SessionData
from rise_engine.results.export.format import ExportContext, ExportFormat, started_text
from rise_engine.results.export.media_clock import (
    Annotation,
    MediaClock,
    TierSpan,
    lay_out,
    one_line,
    recording_clock,
    warn_of_lost,
)
from rise_engine.results.export.spans import ACT_TIERS, CUE, FILLERS, RULE, spans_of
from rise_engine.session.coded_formats import CLOCK, OWN_CATEGORIES, OWN_PROJECT
from rise_engine.session.media import MediaFile

PLAYERS = 8
"""Maximum number of files that BORIS plays side by side."""
NO_DATE = "1970-01-01T00:00:00"
WAITS = "waits for an answer"
ACTS, ROBOT, RULES, SESSION = OWN_CATEGORIES
"""The categories of behaviours."""
CATEGORIES = {
    ACTS: "What the robot did as one thing, and who asked for it",
    ROBOT: "What each part of the robot did",
    RULES: "In which state each rule was",
    SESSION: "Cues, events, notes, mistakes, stops",
}
SUBJECTS = {
    "robot": "The robot",
    "wizard": "The person who runs the session",
    "participant": "The person who takes part",
    "session": "The study itself",
}
ACT_MODIFIERS = {"asked by": ["wizard", "rule", "program", "engine"], "used as": ["act", "filler"]}
"""The modifiers of every act; BORIS writes their values as `wizard|act`."""
STATE, POINT = "State event", "Point event"


class _Behavior(Struct):
    code: str
    category: str
    lasts: bool


class _Ethogram(Struct):
    """The behaviours of all observations, each with its own code."""

    behaviors: dict[tuple[str, str, bool, int], _Behavior] = field(default_factory=dict)
    codes: set[str] = field(default_factory=set)
    variables: dict[str, str] = field(default_factory=dict)
    """Independent variables with their descriptions."""

    def code(self, category: str, name: str, lasts: bool, lane: int) -> str:
        """Return the code of a behaviour: always the same for the same arguments, and unique."""
        key = (category, name, lasts, lane)
        if (found := self.behaviors.get(key)) is None:
            wanted = name if lane == 0 else f"{name} {lane + 1}"
            free = _candidates(wanted, category)
            code = next(each for each in free if each not in self.codes)
            self.codes.add(code)
            found = self.behaviors[key] = _Behavior(code, category, lasts)
        return found.code


def write_boris(out: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    """Write a project with all sessions to `out`, a path that does not exist."""
    ethogram = _Ethogram()
    study = context.study
    head = {
        "time_format": "hh:mm:ss",
        "project_name": (study.title or study.id) if study is not None else "rise-tui",
        "project_description": OWN_PROJECT,
        "project_format_version": "7.0",
    }
    with out.open("x", encoding="ascii", newline="\n") as file:  # BORIS reads the file in the computer's encoding
        file.write(json.dumps(head)[:-1] + ', "observations": {')
        names: set[str] = set()
        dates: set[str] = set()
        for data in sessions:
            wanted = one_line(data.facts.session) or "session"
            name = next(each for each in _candidates(wanted, "") if each not in names)
            observation = _observation(data, ethogram, context)
            file.write(",\n" if names else "\n")
            file.write(f"{json.dumps(name)}: {json.dumps(observation)}")
            names.add(name)
            dates.add(observation["date"])
        tail = {"project_date": max(dates, default=NO_DATE), **_configuration(ethogram)}
        file.write("}," + json.dumps(tail)[1:] + "\n")


def _observation(data: SessionData, ethogram: _Ethogram, context: ExportContext) -> dict[str, Any]:
    warnings = context.warnings
    clock = recording_clock(data, warnings, first="video", fits=_can_play)
    unfit = [each for each in data.media if each.kind in ("video", "audio") and not _can_play(each)]
    warnings += [
        f"{data.facts.session}: {each.path} is not in the BORIS project, because its length or its frames per second "
        "are not known; `rise-engine media add` finds them where ffprobe is installed"
        for each in unfit
        if each.offset is not None
    ]
    found = lay_out(spans_of(data), clock, data.facts.duration, group=_group)
    warn_of_lost(data, found.lost, warnings)
    rows = [row for tier in found.tiers for each in tier.annotations for row in _rows(each, tier.lane, ethogram)]
    rows.sort(key=lambda row: row[:3])  # as BORIS does when it opens the file
    files, info = _media(clock)
    return {
        "date": _date(data.facts.started),
        "description": f"{data.facts.title}\n{CLOCK}: {clock.as_coded().text()}",
        "type": "MEDIA" if files else "LIVE",
        "time offset": 0.0,
        "observation time interval": [0, 0],
        "independent_variables": _variables(data, context.factors, ethogram),
        "visualize_spectrogram": False,
        "visualize_waveform": False,
        "close_behaviors_between_videos": False,
        "scan_sampling_time": 0,
        "start_from_current_time": False,
        "start_from_current_epoch_time": False,
        "file": files,
        "media_info": info,
        "events": rows,
    }


def _can_play(file: MediaFile) -> bool:
    """Whether BORIS can play the files: it needs the duration of each, and the frames per second of a video."""
    return file.duration is not None and (file.kind == "audio" or bool(file.fps))


def _media(clock: MediaClock) -> tuple[dict[str, list[str]], dict[str, dict[str, Any]]]:
    files: dict[str, list[str]] = {}
    info: dict[str, dict[str, Any]] = {
        "length": {},
        "fps": {},
        "hasVideo": {},
        "hasAudio": {},
        "offset": {},
        "display": {},
    }
    for player, linked in enumerate(clock.linked[:PLAYERS], 1):
        path = str(linked.path).encode("utf-8", "replace").decode()
        files[str(player)] = [path]
        info["length"][path] = round(linked.file.duration or 0.0, 3)
        info["fps"][path] = linked.file.fps or 0.0
        info["hasVideo"][path] = linked.file.kind == "video"
        info["hasAudio"][path] = True
        if player == 1:
            info["display"][path] = "Nothing"  # no spectrogram; BORIS would add this and then offer to save
        info["offset"][str(player)] = round(0.0 - linked.origin, 3)  # its start in the time of the first file
    return files, info if files else {}


# --- events -----------------------------------------------------------------------------------------------------------


def _category(span: TierSpan) -> str:
    if span.tier in ACT_TIERS or span.tier == FILLERS:
        return ACTS
    if span.actor == "robot":
        return ROBOT
    return RULES if span.tier.startswith(RULE) else SESSION


def _modifiers(span: TierSpan) -> str:
    if _category(span) != ACTS:
        return ""
    return f"{span.asked_by}|{'filler' if span.tier == FILLERS else 'act'}"


def _group(span: TierSpan) -> str:
    return f"{_category(span)}: {_lasts(span)}: {_code(span)}: {_modifiers(span)}"


def _lasts(span: TierSpan) -> bool:
    return span.end is not None and not (span.tier == CUE and span.code != CUE)


def _code(span: TierSpan) -> str:
    return one_line(span.code.replace("|", "/")) or "?"


def _rows(annotation: Annotation, lane: int, ethogram: _Ethogram) -> Iterator[list[Any]]:
    """Give `[seconds, subject, code, modifiers, comment]`, once for a point event, twice for a state event."""
    span = annotation.span
    category, code = _category(span), _code(span)
    subject = "robot" if category == ACTS else span.actor
    start, comment = annotation.start / 1000, annotation.text if annotation.text != code else ""
    if span.tier == CUE:
        yield [start, subject, ethogram.code(category, code, False, 0), "", comment]
        if not _lasts(span):
            return
        code, comment = WAITS, ""
    if not _lasts(span):
        yield [start, subject, ethogram.code(category, code, False, 0), "", comment]
        return
    end = annotation.start + 1 if annotation.moment else annotation.end
    code, modifiers = ethogram.code(category, code, True, lane), _modifiers(span)
    yield [start, subject, code, modifiers, comment]
    yield [end / 1000, subject, code, modifiers, ""]


# --- once in a project ------------------------------------------------------------------------------------------------


def _configuration(ethogram: _Ethogram) -> dict[str, Any]:
    sets = {
        str(number): {"name": name, "description": "", "type": 0, "ask at stop": False, "values": values}
        for number, (name, values) in enumerate(ACT_MODIFIERS.items())
    }
    behaviors = sorted(ethogram.behaviors.values(), key=lambda each: (list(CATEGORIES).index(each.category), each.code))
    return {
        "subjects_conf": {
            str(number): {"key": "", "name": name, "description": about}
            for number, (name, about) in enumerate(SUBJECTS.items())
        },
        "behaviors_conf": {
            str(number): {
                "type": STATE if each.lasts else POINT,
                "key": "",
                "code": each.code,
                "description": "",
                "color": "",
                "category": each.category,
                "modifiers": sets if each.category == ACTS else {},
                "excluded": "",
                "coding map": "",
            }
            for number, each in enumerate(behaviors)
        },
        "behavioral_categories": list(CATEGORIES),
        "behavioral_categories_config": {
            str(number): {"name": name, "color": ""} for number, name in enumerate(CATEGORIES)
        },
        "independent_variables": {
            str(number): {
                "label": label,
                "description": about,
                "type": "text",
                "default value": "",
                "possible values": "",
            }
            for number, (label, about) in enumerate(ethogram.variables.items())
        },
        "coding_map": {},
        "behaviors_coding_map": [],
        "converters": {},
    }


def _variables(data: SessionData, factors: Iterable[str], ethogram: _Ethogram) -> dict[str, str]:
    facts = data.facts
    labelled = {
        "participant": (facts.participant, "The participant, by a pseudonym"),
        "condition": (facts.condition, "The levels of the session together"),
        "mode": (facts.mode, "debug: the robot was simulated"),
        "outcome": (facts.outcome or "", "How the session counts"),
        "study": (facts.study, "The study's id"),
        "run": (str(facts.run or ""), "Which of the participant's runs"),
        "attempt": (str(facts.attempt or ""), "The number of the session among those of that run"),
    }
    for name in dict.fromkeys([*factors, *facts.factors]):  # all observations have all of them
        level = facts.factors.get(name, "")
        label = next(each for each in _candidates(one_line(name) or "factor", "factor") if each not in labelled)
        labelled[label] = (level if isinstance(level, str) else json.dumps(level), "A factor of the study")
    ethogram.variables |= {label: about for label, (_, about) in labelled.items()}
    return {label: one_line(value) for label, (value, _) in labelled.items()}


def _candidates(name: str, category: str) -> Iterator[str]:
    """Give names to choose from until one is free."""
    name = one_line(name)
    yield name
    if category:
        name = f"{name} ({category})"
        yield name
    number = 2
    while True:
        yield f"{name} {number}"
        number += 1


def _date(started: str) -> str:
    """Return the local time without a zone, as in BORIS."""
    return started_text(started, lambda at: at.replace(tzinfo=None).isoformat(timespec="seconds")) or NO_DATE


FORMAT = ExportFormat(
    name="boris",
    about="BORIS: a project with an observation for each session, over the recordings that belong to it",
    shape="file",
    suffix=".boris",
    write=write_boris,
)

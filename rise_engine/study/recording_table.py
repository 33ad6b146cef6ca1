"""Reader of `[recording]` in study.toml (docs/reference/study.md), and the decision whether to record a session."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.nearest_name import did_you_mean, in_backquotes, nearest_name
from rise_engine.base.plugins import find_plugin, installed_plugins
from rise_engine.ports.recorder import Recorder, RecorderError, RecorderOpener
from rise_engine.scenario.files.toml_files import TomlTable
from rise_engine.scenario.model import Json
from rise_engine.scenario.settings import names_in
from rise_engine.study.checks import parse_length
from rise_engine.study.model import (
    MarkerSettings,
    Participant,
    Purpose,
    RecorderSettings,
    RecordingSettings,
    Study,
    SyncSettings,
)
from rise_engine.study.settings import STUDY_TABLES

RECORDERS = "rise.recorders"


def recorder_drivers() -> tuple[str, ...]:
    """Return the installed recorder drivers, which `by` can name, in alphabetical order."""
    return tuple(sorted(installed_plugins(RECORDERS).names))


def open_recorder(driver: str, name: str, options: Mapping[str, Json]) -> Recorder:
    """Create a recorder, which then only checks its options.

    :param driver: the name as in `by`.
    :param name: the recorder's name.
    :param options: from study.toml.
    :raises RecorderError: it is not installed, cannot be loaded, or rejects an option (one line for each).
    """
    entry = find_plugin(RECORDERS, driver)
    if entry is None:
        raise RecorderError(
            f"there is no recorder {driver!r} here; there are {', '.join(recorder_drivers()) or 'none'}"
        )
    try:
        opener = cast(RecorderOpener, entry.load())
    except Exception as error:  # a plugin's code runs on import
        raise RecorderError(f"the recorder {driver!r} ({entry.value}) cannot be loaded: {error}") from error
    return opener(name, options)


_OWN_KEYS = tuple(names_in(STUDY_TABLES, "recording"))
_COMMON_OPTIONS = tuple(names_in(STUDY_TABLES, "recording.*"))
SHORTEST_STALL, LONGEST_STALL = 3.0, 3600.0
"""Seconds."""
_RESERVED_NAMES = frozenset({"lsl", "marks", "recorders"})
"""Names that records already use for other sources of failures."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,39}\Z")
_CONSENT = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
_OPTION = re.compile(r"`([^`]+)`")
_SCOPES: tuple[Literal["machine", "link", "site"], ...] = ("machine", "link", "site")
_PAYLOADS: tuple[Literal["short", "json"], ...] = ("short", "json")
_MEDIA: tuple[Literal["sound", "flash"], ...] = ("sound", "flash")
_Choice = TypeVar("_Choice", bound=str)


def read_recording(study: TomlTable, folder: Path) -> RecordingSettings:
    """Read the recorders of a session. study.toml may have none.

    :param study: the whole study.toml.
    :param folder: the study's folder; the setting `folder` is relative to it.
    """
    table = study.section("recording")
    recorders = [found for key in table.values if key not in _OWN_KEYS and (found := _read_recorder(table, key))]
    place: str = table.read("folder", str, "", form=': folder = "/data/videos"').strip()
    consent: str = table.read("consent", str, "recording", form=': consent = "recording"')
    if not _CONSENT.match(consent):
        message = f"a consent has a name of letters, digits and `_`, not `{consent}`"
        table.report_value("bad-name", "consent", message)
        consent = "recording"
    return RecordingSettings(
        recorders=tuple(recorders),
        markers=_read_markers(table),
        sync=_read_sync(table),
        folder=str(folder / Path(place).expanduser()) if place else "",
        consent=consent.removeprefix("consent_"),
    )


def _read_recorder(table: TomlTable, name: str) -> RecorderSettings | None:
    values = table.values[name]
    if not isinstance(values, dict):
        form = f'a recorder is a table: {name} = {{ by = "ffmpeg", ... }}'
        near = did_you_mean(name, _OWN_KEYS, limit=0)
        table.report_key("unknown-key" if near else "wrong-type", f"unknown key `{name}`{near}" if near else form, name)
        return None
    if not _NAME.match(name):
        message = f"a recorder has a name of letters, digits, `_` and `-`, beginning with a letter, not `{name}`"
        table.report_key("bad-name", message, name)
    elif name in _RESERVED_NAMES:
        table.report_key("bad-name", f"records call something else `{name}`; take another name", name)
    settings = TomlTable(table.file, (*table.path, name), values, table.diagnostics)
    driver = settings.read("by", str, name, form=': by = "ffmpeg"')
    options = {key: value for key, value in values.items() if key not in _COMMON_OPTIONS}
    if driver not in recorder_drivers():
        _report_driver(table, settings, driver)
    else:
        _report_options(settings, driver, name, options)
    return RecorderSettings(name, driver, options, _read_stalled(settings))


def _read_stalled(settings: TomlTable) -> float | None:
    text = settings.read("stalled", str, "", form=': stalled = "10 s"')
    seconds = parse_length(text) if text else None
    if text and (seconds is None or not SHORTEST_STALL <= seconds <= LONGEST_STALL):
        message = f"`{text}` is not a time without growth after which it counts as stalled; write 10 s, from 3 s to 1 h"
        settings.report_value("wrong-value", "stalled", message)
        return None
    return seconds


def _report_driver(table: TomlTable, settings: TomlTable, driver: str) -> None:
    """Report an unknown driver: an error if it looks misspelt, else a warning, as it may be installed elsewhere."""
    known = recorder_drivers()
    if "by" not in settings.values:
        if nearest_name(driver, _OWN_KEYS):
            table.report_key("unknown-key", f"unknown key `{driver}`{did_you_mean(driver, _OWN_KEYS)}", driver)
            return
        near = did_you_mean(driver, known, limit=0) or f': {driver} = {{ by = "..." }}, one of {in_backquotes(known)}'
        table.report_key("missing-value", f"`{driver}` needs `by`, the kind of its recorder{near}", driver)
    elif nearest_name(driver, known):
        settings.report_value("unknown-name", "by", f"there is no recorder `{driver}`{did_you_mean(driver, known)}")
    else:
        message = f"there is no recorder `{driver}` on this computer; there are {in_backquotes(known)}"
        table.diagnostics.warning("no-recorder", settings.value_location("by"), message)


def _report_options(settings: TomlTable, driver: str, name: str, options: dict[str, Any]) -> None:
    """Report the driver's errors, one line each, at the option with which the line begins."""
    try:
        open_recorder(driver, name, options)
    except RecorderError as error:
        for line in str(error).splitlines():
            option = _OPTION.match(line)
            if option is not None and option.group(1) in options:
                settings.report_value("recorder-option", option.group(1), line)
            else:
                settings.report_key("recorder-option", line)


def _read_markers(table: TomlTable) -> MarkerSettings | None:
    value = table.values.get("lsl", False)
    if isinstance(value, bool):
        return MarkerSettings() if value else None
    if not isinstance(value, dict):
        table.report_value("wrong-type", "lsl", '`lsl` is true or false, or a table: lsl = { scope = "machine" }')
        return None
    settings = table.section("lsl", names_in(STUDY_TABLES, "recording.lsl"))
    scope = read_choice(settings, "scope", _SCOPES, "machine")
    return MarkerSettings(scope, read_choice(settings, "payload", _PAYLOADS, "short"))


def _read_sync(table: TomlTable) -> SyncSettings | None:
    value = table.values.get("sync", False)
    if isinstance(value, bool):
        return SyncSettings() if value else None
    if not isinstance(value, dict):
        table.report_value("wrong-type", "sync", '`sync` is true or false, or a table: sync = { medium = "sound" }')
        return None
    settings = table.section("sync", names_in(STUDY_TABLES, "recording.sync"))
    medium = read_choice(settings, "medium", _MEDIA, "sound")
    play = settings.read_texts("play", ())
    if play and not any("{file}" in each for each in play):
        message = '`play` is a program that plays a sound, with {file} for it: play = ["aplay", "{file}"]'
        settings.report_value("wrong-value", "play", message)
    elif play and medium == "flash":
        settings.report_key("wrong-value", '`play` plays a sound; it goes with medium = "sound"', "play")
    return SyncSettings(
        start=settings.read("start", bool, True),
        end=settings.read("end", bool, True),
        medium=medium,
        play=play,
    )


def read_choice(table: TomlTable, key: str, known: tuple[_Choice, ...], usual: _Choice) -> _Choice:
    """Read a value that must be one of a few words."""
    value: Any = table.read(key, str, usual)
    found = next((each for each in known if each == value), None)
    if found is None:
        near = did_you_mean(value, known, limit=0)
        table.report_value("wrong-value", key, f"`{key}` is one of {in_backquotes(known)}, not `{value}`{near}")
    return found or usual


# --- whether a session is recorded ------------------------------------------------------------------------------------

RECORDED: frozenset[Purpose] = frozenset({"counted", "pilot"})
"""Purposes of sessions that are recorded by default: those with a person."""


class RecordingDecision(Struct, frozen=True):
    """The recorders of a session, as decided before it begins."""

    settings: RecordingSettings
    """What runs: all of `[recording]` in study.toml, or a part of it."""
    remark: str = ""
    """Why only a part runs, in a sentence for people and the record. Empty: all of it runs."""


def decide_recording(
    study: Study, participants: Sequence[Participant], name: str, purpose: Purpose, asked: bool | None = None
) -> RecordingDecision:
    """Decide before a session begins what records it.

    Markers on LSL contain only the course of the session, so they need no consent. All recorders do.

    :param study: the session's study.
    :param participants: from participants.csv.
    :param name: the participant; empty: nobody takes part.
    :param purpose: the purpose of the session.
    :param asked: whether it was requested (`--record`) or refused (`--no-record`); None: the purpose's default.
    """
    settings = study.recording
    nothing = RecordingSettings(folder=settings.folder, consent=settings.consent)
    if not is_recording(settings):
        return RecordingDecision(nothing)
    if asked is False:
        return RecordingDecision(nothing, "nothing is recorded: somebody said so (--no-record)")
    if asked is None and purpose not in RECORDED:
        how = "a session in debug mode" if purpose == "debug" else f"a {purpose} session"
        return RecordingDecision(nothing, f"nothing is recorded: this is {how} (--record records it)")
    if (problem := recording_consent_problem(study, participants, name)) and (settings.recorders or settings.sync):
        kept = replace(nothing, markers=settings.markers)
        return RecordingDecision(kept, f"nothing is recorded: {problem}")
    return RecordingDecision(settings)


def is_recording(settings: RecordingSettings) -> bool:
    """Whether anything is recorded or sent with these settings."""
    return bool(settings.recorders) or settings.markers is not None or settings.sync is not None


def recording_consent_problem(study: Study, participants: Sequence[Participant], name: str) -> str:
    """Return a sentence why a participant may not be recorded. Empty: they may, or there is no participant."""
    if not name:
        return ""
    found = next((each for each in participants if each.participant == name), None)
    if found is None:
        return f"{name} is not in participants.csv, so nothing is known of consent"
    column = study.recording.consent
    if found.consent.get(column):
        return ""
    return f"{name} has not consented to it (consent_{column} of participants.csv has no date)"


def recorders_text(settings: RecordingSettings) -> str:
    """List the recorders for screens: `camera (ffmpeg), bag (rosbag2), markers on LSL`. Empty: there are none."""
    words = [each.name if each.name == each.driver else f"{each.name} ({each.driver})" for each in settings.recorders]
    if settings.markers is not None:
        words.append("markers on LSL")
    return ", ".join(words)


def recording_lines(decision: RecordingDecision) -> list[str]:
    """Return the lines to show before the session begins. Empty: the study has no recording."""
    text = recorders_text(decision.settings)
    return [*([f"recorded by {text}"] if text else []), *([decision.remark] if decision.remark else [])]

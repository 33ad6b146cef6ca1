"""Reading `[recording]` of study.toml: what records a session (docs/reference/study.md)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from rise_engine.base.nearest_name import did_you_mean, in_backquotes, nearest_name
from rise_engine.ports.recorder import RecorderError
from rise_engine.scenario.toml_files import TomlTable
from rise_engine.study.model import MarkerSettings, RecorderSettings, RecordingSettings, SyncSettings
from rise_engine.study.quantities import parse_length
from rise_engine.study.recorder_drivers import open_recorder, recorder_drivers

_OWN_KEYS = ("lsl", "sync", "folder", "consent")
_COMMON_OPTIONS = ("by", "stalled")
SHORTEST_STALL, LONGEST_STALL = 3.0, 3600.0
"""Seconds."""
_TAKEN = frozenset({"lsl", "marks", "recorders"})
"""What records call other things that can fail."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,39}\Z")
_CONSENT = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
_OPTION = re.compile(r"`([^`]+)`")
_SCOPES = ("machine", "link", "site")
_PAYLOADS = ("short", "json")
_MEDIA = ("sound", "flash")


def read_recording(study: TomlTable, folder: Path) -> RecordingSettings:
    """What records a session; nothing where study.toml does not say.

    :param study: the whole study.toml.
    :param folder: the study's, to which `folder` is relative.
    """
    table = study.section("recording")
    recorders = [found for key in table.values if key not in _OWN_KEYS and (found := _read_recorder(table, key))]
    place: str = table.read("folder", str, "", form=': folder = "/data/videos"').strip()
    consent: str = table.read("consent", str, "recording", form=': consent = "recording"')
    if not _CONSENT.match(consent):
        message = f"what is consented to is called with letters, digits and `_`, not `{consent}`"
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
        message = f"a recorder is called with letters, digits, `_` and `-`, beginning with a letter, not `{name}`"
        table.report_key("bad-name", message, name)
    elif name in _TAKEN:
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
        message = f"`{text}` is no time without growth after which it counts as stalled; write 10 s, from 3 s to 1 h"
        settings.report_value("wrong-value", "stalled", message)
        return None
    return seconds


def _report_driver(table: TomlTable, settings: TomlTable, driver: str) -> None:
    """One that is nearly right is misspelt; another one may be installed where the sessions run."""
    known = recorder_drivers()
    if "by" not in settings.values:
        if nearest_name(driver, _OWN_KEYS):
            table.report_key("unknown-key", f"unknown key `{driver}`{did_you_mean(driver, _OWN_KEYS)}", driver)
            return
        near = did_you_mean(driver, known, limit=0) or f': {driver} = {{ by = "..." }}, one of {in_backquotes(known)}'
        table.report_key("missing-value", f"`{driver}` does not say by what it records{near}", driver)
    elif nearest_name(driver, known):
        settings.report_value("unknown-name", "by", f"there is no recorder `{driver}`{did_you_mean(driver, known)}")
    else:
        message = f"there is no recorder `{driver}` on this computer; there are {in_backquotes(known)}"
        table.diagnostics.warning("no-recorder", settings.value_location("by"), message)


def _report_options(settings: TomlTable, driver: str, name: str, options: dict[str, Any]) -> None:
    """What the driver finds: a line for each finding, which stands where the option does that it begins with."""
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
    settings = table.section("lsl", ("scope", "payload"))
    scope, payload = _choose(settings, "scope", _SCOPES), _choose(settings, "payload", _PAYLOADS)
    return MarkerSettings(
        scope="link" if scope == "link" else "site" if scope == "site" else "machine",
        payload="json" if payload == "json" else "short",
    )


def _read_sync(table: TomlTable) -> SyncSettings | None:
    value = table.values.get("sync", False)
    if isinstance(value, bool):
        return SyncSettings() if value else None
    if not isinstance(value, dict):
        table.report_value("wrong-type", "sync", '`sync` is true or false, or a table: sync = { medium = "sound" }')
        return None
    settings = table.section("sync", ("start", "end", "medium", "play"))
    medium = _choose(settings, "medium", _MEDIA)
    play = settings.read_texts("play", ())
    if play and not any("{file}" in each for each in play):
        message = '`play` is a program that plays a sound, with {file} for it: play = ["aplay", "{file}"]'
        settings.report_value("wrong-value", "play", message)
    elif play and medium == "flash":
        settings.report_key("wrong-value", '`play` plays a sound; it goes with medium = "sound"', "play")
    return SyncSettings(
        start=settings.read("start", bool, True),
        end=settings.read("end", bool, True),
        medium="flash" if medium == "flash" else "sound",
        play=play,
    )


def _choose(table: TomlTable, key: str, known: tuple[str, ...]) -> str:
    value = table.read(key, str, known[0])
    if value not in known:
        near = did_you_mean(value, known, limit=0)
        table.report_value("wrong-value", key, f"`{key}` is one of {in_backquotes(known)}, not `{value}`{near}")
    return str(value)

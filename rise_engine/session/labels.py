"""A session's labels: its participant, condition, scenario and settings. The first record of its journal has them.

`session.toml` and a study's `study.jsonl` repeat them. Readers compare these with the record (`label_differences`). A
difference is an error, so that a session cannot be relabelled.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime, timedelta
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec

from rise_engine.base.errors import SessionError
from rise_engine.base.json_codec import JsonError, decode
from rise_engine.base.text import escape_surrogates
from rise_engine.kernel.records import IDENTITY, Record, SessionRecord
from rise_engine.session.journal_format import JOURNAL, LineError, read_line

_LABELS = (
    *IDENTITY,
    *("mode", "robot", "seed", "scenario", "scenario_hash", "injected_faults", "speed", "language"),
)
"""The labels among the fields of a session's record."""
_CALLED = {"scenario": "title", "injected_faults": "faults"}
"""The names of labels in other files, where they differ."""


class RelabelledError(SessionError):
    """A file contradicts a session's journal. The text names both values and the remedy."""


def read_labels(journal: Path) -> dict[str, Any] | None:
    """Read the first record of a session's journal. An older journal has fewer fields.

    :param journal: the file.
    :return: the record's fields; None when there is no readable one.
    """
    try:
        with journal.open("rb") as file:
            for line in file:
                if line.startswith(b'{"kind":"session"') and (fields := _read_fields(line)) is not None:
                    return dict(fields)
    except OSError:
        pass
    return None


@lru_cache(maxsize=1024)  # readers of a study ask for the labels of each session many times
def _read_fields(line: bytes) -> dict[str, Any] | None:
    try:
        record = read_line(line.rstrip(b"\n"))
        fields = decode(line.decode())
    except (LineError, JsonError, UnicodeDecodeError):
        return None
    return fields if isinstance(record, SessionRecord) and isinstance(fields, dict) else None


def moment_of_zero(wall: str, t: float, speed: float) -> str:
    """Return the date and time of day of session time 0, ISO 8601 with milliseconds; empty: unknown.

    The engine reads the clock a little later, and this delay is subtracted.

    :param wall: the `wall` of the session's first record.
    :param t: its session time in seconds.
    :param speed: session seconds in a second of the wall clock.
    """
    try:
        return (datetime.fromisoformat(wall) - timedelta(seconds=t / speed)).isoformat(timespec="milliseconds")
    except (ValueError, OverflowError):
        return ""


def downtime_by_clock(before: Record, after: Record, speed: float) -> float | None:
    """Return the seconds between two records during which session time stood still, by their wall clock.

    :param before: the last record of one engine.
    :param after: the first record of the next one.
    :param speed: session seconds in a second of the wall clock.
    :return: None: there are no dates.
    """
    try:
        passed = datetime.fromisoformat(after.wall) - datetime.fromisoformat(before.wall)
    except (ValueError, TypeError):  # a text is empty, or one of them has no zone
        return None
    return passed.total_seconds() - (after.t - before.t) / speed


CLOCK_TOLERANCE = 2.0
"""Maximum difference in seconds of two times of day of one moment."""


def moment_differences(labels: Mapping[str, Any] | None, values: Mapping[str, Any], file: str) -> Iterator[str]:
    """Report if another file has a different time of the start (`started`). Some seconds are no difference.

    `started` was taken after session time 0 and before the first record, whose `t` is the delay.

    :param labels: from `read_labels`.
    :param values: the other file's values.
    :param file: the other file's name.
    """
    if labels is None or not labels.get("wall") or not values.get("started"):
        return
    wall, started = str(labels["wall"]), str(values["started"])
    zero = moment_of_zero(wall, labels["t"], labels.get("speed") or values.get("speed") or 1.0)
    try:
        began, first, zero_moment = map(datetime.fromisoformat, (started, wall, zero))
        early, late = (zero_moment - began).total_seconds(), (began - first).total_seconds()
    except (ValueError, TypeError):
        return
    if max(early, late) > CLOCK_TOLERANCE:
        yield f"{file} says started = {_as_text(started)}, but the first record of {JOURNAL} is of {wall}"


def label_differences(labels: Mapping[str, Any] | None, values: Mapping[str, Any], file: str) -> list[str]:
    """List the differences of another file from a session's journal, in sentences with both values.

    :param labels: from `read_labels`; labels missing in an older journal are not compared.
    :param values: the other file's values; missing labels are not compared.
    :param file: the other file's name.

    >>> label_differences({"condition": "calm", "slot": None}, {"condition": "lively", "slot": 0}, "session.toml")
    ['session.toml says condition = "lively", but journal.jsonl says condition = "calm"']
    """
    return [
        f"{file} says {name} = {_as_text(values[name])}, but {JOURNAL} says {name} = {_as_text(recorded)}"
        for name, recorded in labels_for(labels, values).items()
        if (recorded or None) != (_plain(values[name]) or None) and not _is_same_language(name, recorded, values[name])
    ]


def _is_same_language(name: str, recorded: Any, values: Any) -> bool:
    """Whether both are the same language tag, apart from capital letters."""
    return name == "language" and str(recorded).lower() == str(values).lower()


def labels_for(labels: Mapping[str, Any] | None, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the journal's labels under the names of another file.

    :param labels: from `read_labels`.
    :param values: the other file's values.
    """
    if labels is None:
        return {}
    by_name = {_CALLED.get(label, label): label for label in _LABELS if label in labels}
    if not (labels.get("language") and values.get("language")):  # without a requested language, session.toml has none
        by_name.pop("language", None)
    return {name: labels[label] for name, label in by_name.items() if name in values}


def refuse_differences(folder: Path, differences: Iterable[str]) -> None:
    """Refuse to read a session if two files contradict each other.

    :param folder: the session's folder.
    :param differences: from `label_differences`.
    :raises RelabelledError: there is a difference.
    """
    if found := list(differences):
        raise RelabelledError(
            f"{folder.name} was given another label: {'; '.join(found)}. The journal counts. Put the other "
            "file back as it was, or take both from your backup"
        )


def _plain(value: Any) -> Any:
    """Return a value as it is in a journal."""
    if isinstance(value, str):
        return escape_surrogates(value)
    return list(value) if isinstance(value, tuple) else value


def _as_text(value: Any) -> str:
    try:
        return msgspec.json.encode(value).decode()
    except UnicodeEncodeError:
        return ascii(value)


_PSEUDONYM = re.compile(r"[A-Za-z0-9]+")


def pseudonym_problem(participant: str) -> str:
    """Return why a real session cannot have this name; empty: it can. An empty name is allowed.

    >>> pseudonym_problem("P07")
    ''
    """
    if not participant or _PSEUDONYM.fullmatch(participant):
        return ""
    return (
        f"{participant!r} is not a pseudonym: letters without accents and digits only, such as P07. The record, "
        "the folder's name and every export contain it, so in real mode it must not be anybody's name; keep the list "
        "of names elsewhere"
    )

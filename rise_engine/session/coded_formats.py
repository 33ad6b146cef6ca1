"""Readers of annotation files that people give back: ELAN's `.eaf`, BORIS projects, and event tables from BORIS.

Tiers and behaviours that `rise-engine export` wrote into a file are skipped. Its clock, which relates its time to the
session's, is read.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from pathlib import PurePath
from typing import Any

import msgspec
from lxml import etree
from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.nearest_name import did_you_mean

OWN_ANNOTATOR, OWN_TYPE = "rise-tui", "rise"
"""Annotator and linguistic type of the ELAN tiers that this program wrote."""
OWN_PROJECT = "Made by rise-tui from what the sessions recorded."
"""The description of the BORIS projects that this program wrote."""
OWN_CATEGORIES = ("acts", "robot", "rules", "session")
"""The categories of the behaviours that this program writes for BORIS."""
CLOCK, SESSION = "rise time", "rise session"
"""The names under which an exported file gives its clock and its session."""
SUFFIXES = (".eaf", ".boris", ".csv", ".tsv")
_NUMBER = r"(-?\d+(?:\.\d+)?)"
_CLOCK_TEXT = re.compile(rf"annotation seconds = {_NUMBER} \+ {_NUMBER} \* session seconds")
_GAP_TEXT = re.compile(rf"{_NUMBER} s more from session second {_NUMBER} on")
_ROUNDING = 1e-5
"""Maximum difference in seconds of two computations of a duration."""
_BORIS_STATE = "state event"


class CodedClock(Struct, frozen=True):
    """The relation of times: annotation time = shift + rate * (session time + the gaps before it), in seconds."""

    shift: float = 0.0
    rate: float = 1.0
    gaps: tuple[tuple[float, float], ...] = ()
    """Session times without an engine, each with its length."""

    def to_session(self, at: float) -> float:
        """Return the session time of an annotation time. Times within a gap become the start of the gap."""
        passed, away = (at - self.shift) / self.rate, 0.0
        for begin, seconds in self.gaps:
            if passed < begin + away:
                break
            if passed < begin + away + seconds:
                return round(begin, 6)
            away += seconds
        return round(passed - away, 6)

    def span_to_session(self, span: CodedSpan) -> CodedSpan:
        """Return an annotation in session seconds."""
        begin, end = self.to_session(span.begin), self.to_session(span.end)
        outage = round((span.end - span.begin) / self.rate - (end - begin), 6)
        return replace(span, begin=begin, end=end, outage=outage if outage > _ROUNDING else 0.0)

    def text(self) -> str:
        """Return the clock as a file states it."""
        gaps = (f"; {seconds:.6f} s more from session second {at:.6f} on" for at, seconds in self.gaps)
        return f"annotation seconds = {self.shift:.6f} + {self.rate:.9f} * session seconds" + "".join(gaps)


class CodedSpan(Struct, frozen=True):
    """One annotation, in annotation seconds."""

    tier: str
    annotator: str
    begin: float
    end: float
    value: str
    modifiers: str = ""
    comment: str = ""
    outage: float = 0.0
    """Seconds of it without an engine; only known in session seconds."""


class CodedDocument(Struct):
    """The contents of an annotation file."""

    spans: list[CodedSpan]
    tiers: list[str]
    """The tiers of people, also empty ones."""
    clock: CodedClock | None = None
    """The relation of its time to the session's; None: not in the file."""
    session: str = ""
    """The session's name; empty: not in the file."""
    media: tuple[tuple[str, float], ...] = ()
    """The names of the annotated recordings, and the recording's own seconds at annotation time 0."""
    problems: list[str] = []
    """Sentences about unreadable parts."""


def read_coded_document(name: str, data: bytes, observation: str = "", session: str = "") -> CodedDocument:
    """Read an annotation file.

    :param name: the file's name; its suffix gives the format.
    :param data: the file's contents.
    :param observation: the observation to read from a BORIS file; empty: the session's, or the only one.
    :param session: the session's name.
    :raises SessionError: it cannot be read.
    """
    match PurePath(name).suffix.lower():
        case ".eaf":
            return _read_eaf(name, data)
        case ".boris":
            return _read_project(name, data, observation, session)
        case ".csv" | ".tsv":
            return _read_table(name, data, observation, session)
    raise SessionError(f"{name} is not an annotation file: it ends in {', '.join(SUFFIXES)}")


def replace_words(name: str, data: bytes, replace: Callable[[str], str]) -> bytes:
    """Replace texts of people in an annotation file. A file that cannot be read stays unchanged.

    :param name: the file's name.
    :param data: the file's contents.
    :param replace: maps an old text to a new one.
    """
    try:
        match PurePath(name).suffix.lower():
            case ".eaf":
                root = _parse_xml(name, data)
                for element in root.iter(etree.Element):
                    element.text = replace(element.text) if element.text else element.text
                    for key, value in element.attrib.items():
                        element.set(str(key), replace(str(value)))
                changed: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
            case ".boris":
                changed = msgspec.json.encode(_replaced(msgspec.json.decode(data), replace))
            case _:
                changed = replace(_decode(name, data)).encode()
    except (SessionError, msgspec.DecodeError):
        return data
    return changed if replace(data.decode("utf-8", "replace")) != data.decode("utf-8", "replace") else data


def _replaced(value: Any, replace: Callable[[str], str]) -> Any:
    if isinstance(value, dict):
        return {key: _replaced(each, replace) for key, each in value.items()}
    if isinstance(value, list):
        return [_replaced(each, replace) for each in value]
    return replace(value) if isinstance(value, str) else value


# --- ELAN -------------------------------------------------------------------------------------------------------------


def _parse_xml(name: str, data: bytes) -> etree._Element:
    parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True, remove_comments=True)
    try:
        return etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        raise SessionError(f"{name}:{error.lineno or 1}: this is not XML: {error.msg}") from None


def _read_eaf(name: str, data: bytes) -> CodedDocument:
    root = _parse_xml(name, data)
    if root.tag != "ANNOTATION_DOCUMENT":
        raise SessionError(
            f"{name}:1: this is not a file of ELAN: it begins with <{root.tag}>, not <ANNOTATION_DOCUMENT>"
        )
    header = root.find("HEADER")
    unit = 1.0 if header is None or header.get("TIME_UNITS", "milliseconds") == "milliseconds" else None
    if unit is None:
        raise SessionError(f"{name}: its times are in {header.get('TIME_UNITS')}, not in milliseconds")  # type: ignore[union-attr]
    properties = {each.get("NAME", ""): (each.text or "").strip() for each in root.iter("PROPERTY")}
    document = CodedDocument([], [], parse_clock(properties.get(CLOCK, "")), properties.get(SESSION, ""), problems=[])
    document.media = tuple(
        (PurePath(each.get("RELATIVE_MEDIA_URL") or each.get("MEDIA_URL") or "").name, _origin(each))
        for each in root.iter("MEDIA_DESCRIPTOR")
    )
    slots = {each.get("TIME_SLOT_ID"): each.get("TIME_VALUE") for each in root.iter("TIME_SLOT")}
    times = {key: int(value) / 1000 for key, value in slots.items() if key and value and value.isdigit()}
    placed: dict[str, tuple[float, float]] = {}
    waiting: list[tuple[etree._Element, str, str]] = []
    for tier in root.iter("TIER"):
        _place_unaligned(tier, times)
        if tier.get("ANNOTATOR") == OWN_ANNOTATOR and tier.get("LINGUISTIC_TYPE_REF") == OWN_TYPE:
            _read_tier(name, tier, times, placed, CodedDocument([], []), waiting)
            continue
        document.tiers.append(tier.get("TIER_ID", ""))
        _read_tier(name, tier, times, placed, document, waiting)
    _read_dependents(name, waiting, placed, document)
    document.spans.sort(key=lambda each: (each.begin, document.tiers.index(each.tier)))
    return document


def _origin(descriptor: etree._Element) -> float:
    text = descriptor.get("TIME_ORIGIN", "0")
    return int(text) / 1000 if text.isdigit() else 0.0


def _place_unaligned(tier: etree._Element, times: dict[str, float]) -> None:
    """Give times to ELAN's subdivisions: equal distances between the slots that have a time."""
    order: list[str] = []
    for each in tier.iter("ALIGNABLE_ANNOTATION"):
        for slot in (each.get("TIME_SLOT_REF1", ""), each.get("TIME_SLOT_REF2", "")):
            if not order or order[-1] != slot:
                order.append(slot)
    known = [at for at, slot in enumerate(order) if slot in times]
    for left, right in pairwise(known):
        begin, end = times[order[left]], times[order[right]]
        for at in range(left + 1, right):
            times[order[at]] = begin + (end - begin) * (at - left) / (right - left)


def _read_tier(
    name: str,
    tier: etree._Element,
    times: dict[str, float],
    placed: dict[str, tuple[float, float]],
    document: CodedDocument,
    waiting: list[tuple[etree._Element, str, str]],
) -> None:
    called, annotator = tier.get("TIER_ID", ""), tier.get("ANNOTATOR", "")
    for each in tier.iter("ALIGNABLE_ANNOTATION"):
        begin, end = (times.get(each.get(key, "")) for key in ("TIME_SLOT_REF1", "TIME_SLOT_REF2"))
        if begin is None or end is None or end < begin:
            document.problems.append(
                f"{name}:{each.sourceline}: an annotation of the tier {called!r} has no time, or ends before it begins"
            )
            continue
        placed[each.get("ANNOTATION_ID", "")] = (begin, end)
        document.spans.append(CodedSpan(called, annotator, begin, end, _value(each)))
    waiting += [(each, called, annotator) for each in tier.iter("REF_ANNOTATION")]


def _read_dependents(
    name: str,
    waiting: list[tuple[etree._Element, str, str]],
    placed: dict[str, tuple[float, float]],
    document: CodedDocument,
) -> None:
    """Give annotations without times those of their parent annotation, at any depth."""
    while waiting:
        later = []
        for each, tier, annotator in waiting:
            if (times := placed.get(each.get("ANNOTATION_REF", ""))) is None:
                later.append((each, tier, annotator))
                continue
            placed[each.get("ANNOTATION_ID", "")] = times
            if tier in document.tiers:
                document.spans.append(CodedSpan(tier, annotator, *times, _value(each)))
        if len(later) == len(waiting):
            for each, tier, _ in later:
                document.problems.append(
                    f"{name}:{each.sourceline}: an annotation of the tier {tier!r} belongs to none that has a time"
                )
            return
        waiting = later


def _value(annotation: etree._Element) -> str:
    return " ".join((annotation.findtext("ANNOTATION_VALUE") or "").split())


def parse_clock(text: str) -> CodedClock | None:
    """Read the clock from a file's text (`CodedClock.text`). None: there is none.

    >>> parse_clock(CodedClock(-1.5, 1.00005, ((12.0, 3.25),)).text())
    CodedClock(shift=-1.5, rate=1.00005, gaps=((12.0, 3.25),))
    """
    if (found := _CLOCK_TEXT.search(" ".join(text.split()))) is None:
        return None
    gaps = tuple((float(at), float(seconds)) for seconds, at in _GAP_TEXT.findall(" ".join(text.split())))
    return CodedClock(float(found[1]), float(found[2]), gaps)


# --- BORIS ------------------------------------------------------------------------------------------------------------


def _read_project(name: str, data: bytes, observation: str, session: str) -> CodedDocument:
    try:
        project = msgspec.json.decode(data)
        observations = project["observations"]
        ethogram = {each["code"]: each for each in project["behaviors_conf"].values()}
        found = observations[_observation(name, list(observations), observation, session)]
        is_own = OWN_PROJECT in str(project.get("project_description", ""))
        document = CodedDocument([], [], parse_clock(str(found.get("description", ""))), problems=[])
        files = found.get("file") or {}
        document.media = tuple((PurePath(paths[0].replace("\\", "/")).name, 0.0) for paths in files.values() if paths)
        offset = float(found.get("time offset") or 0)
        rows = []
        for at, subject, code, modifiers, comment, *_ in found["events"]:
            behavior = ethogram.get(code, {})
            if is_own and behavior.get("category") in OWN_CATEGORIES:
                continue
            kind = "" if _BORIS_STATE in str(behavior.get("type", "")).lower() else "POINT"
            rows.append((float(at) - offset, str(subject), str(code), str(modifiers), str(comment), kind))
    except (msgspec.DecodeError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise SessionError(f"{name}: this is not a project of BORIS that can be read: {error!r}") from None
    _pair(name, rows, document)
    return document


def _observation(name: str, known: list[str], wanted: str, session: str) -> str:
    """Choose the session's observation in a file. Raises SessionError."""
    for each in filter(None, (wanted, session)):
        if each in known:
            return each
    if not wanted and len(known) == 1:
        return known[0]
    near = did_you_mean(wanted or session, known, limit=0)
    raise SessionError(
        f"{name} has no observation {wanted or session!r}; it has {', '.join(known) or 'none'}{near}. Say which one is "
        "the session's: --observation NAME"
    )


def _pair(name: str, rows: Iterable[tuple[float, str, str, str, str, str]], document: CodedDocument) -> None:
    """Pair the starts and ends of states. They alternate for each subject, behaviour and modifiers."""
    begun: dict[tuple[str, str, str], tuple[float, str]] = {}
    for at, subject, code, modifiers, comment, kind in sorted(rows, key=lambda row: row[0]):
        tier = f"{subject}: {code}" if subject else code
        modifiers = "" if modifiers in ("None", "nan") else modifiers
        key = (subject, code, modifiers)
        if kind == "POINT":
            document.spans.append(CodedSpan(tier, "", at, at, code, modifiers, comment))
        elif key in begun and kind != "START":
            begin, comments = begun.pop(key)
            comments = "; ".join(filter(None, (comments, comment)))
            document.spans.append(CodedSpan(tier, "", begin, at, code, modifiers, comments))
        else:
            begun[key] = (at, comment)
        if tier not in document.tiers:
            document.tiers.append(tier)
    for (subject, code, _), (at, _) in begun.items():
        document.problems.append(f"{name}: {code!r} of {subject or 'nobody'} begins at {at:.3f} s and never ends")
    document.spans.sort(key=lambda each: each.begin)


def _decode(name: str, data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise SessionError(
            f"{name}:{line}: this is not UTF-8; export it from BORIS again, or save it as UTF-8"
        ) from None


def _read_table(name: str, data: bytes, observation: str, session: str) -> CodedDocument:
    """Read *Export events > Tabular events* or *Aggregated events* of BORIS: commas or tabs, one event a row."""
    text = _decode(name, data)
    lines = csv.reader(io.StringIO(text, newline=""), delimiter="\t" if "\t" in text.partition("\n")[0] else ",")
    header: list[str] = []
    rows: list[tuple[int, dict[str, str]]] = []
    for cells in lines:
        if not header and {"Behavior", "Subject"} <= set(cells):
            header = cells
        elif header and any(cells):
            rows.append((lines.line_num, dict(zip(header, cells, strict=False))))
    if not header or not ({"Time", "Start (s)"} & set(header)):
        raise SessionError(
            f"{name}: this is not a table of BORIS events: one row has to be Subject, Behavior and Time, or Start (s)"
        )
    known = list(dict.fromkeys(row["Observation id"] for _, row in rows if "Observation id" in row))
    if known:
        chosen = _observation(name, known, observation, session)
        rows = [(line, row) for line, row in rows if row["Observation id"] == chosen]
    described = next((row.get("Description", "") for _, row in rows), "")
    clock = parse_clock(described)
    document = CodedDocument([], [], clock, problems=[])
    names = dict.fromkeys(_media_names(row) for _, row in rows)
    document.media = tuple((each, 0.0) for each in names if each)
    kept = [each for each in rows if clock is None or each[1].get("Behavioral category") not in OWN_CATEGORIES]
    if "Start (s)" in header:
        for line, row in kept:
            begin, end = (_seconds(name, line, row, column) for column in ("Start (s)", "Stop (s)"))
            subject, code = _subject(row), row["Behavior"]
            tier = f"{subject}: {code}" if subject else code
            comment = "; ".join(filter(None, (row.get("Comment start", ""), row.get("Comment stop", ""))))
            document.spans.append(CodedSpan(tier, "", begin, end, code, _modifiers(row), comment))
            document.tiers += [tier] if tier not in document.tiers else []
        document.spans.sort(key=lambda each: each.begin)
        return document
    events = [
        (
            _seconds(name, line, row, "Time"),
            _subject(row),
            row["Behavior"],
            _modifiers(row),
            row.get("Comment", ""),
            (row.get("Status") or row.get("Behavior type") or "").strip().upper(),
        )
        for line, row in kept
    ]
    _pair(name, events, document)
    return document


def _subject(row: dict[str, str]) -> str:
    return "" if row["Subject"] in ("No focal subject", "nan") else row["Subject"]


def _modifiers(row: dict[str, str]) -> str:
    modifiers = [value for column, value in row.items() if column.startswith("Modifier") and value not in ("", "None")]
    return "|".join(modifiers)


def _media_names(row: dict[str, str]) -> str:
    path = row.get("Media file name") or row.get("Media file path") or ""
    return PurePath(path.replace("\\", "/").removeprefix("player #1:")).name


def _seconds(name: str, line: int, row: dict[str, str], column: str) -> float:
    text = row.get(column, "")
    try:
        return float(text)
    except ValueError:
        raise SessionError(f"{name}:{line}: {column!r} is a number of seconds, not {text!r}") from None


def tiers_taken(document: CodedDocument, wanted: Iterable[str]) -> Iterator[str]:
    """Yield the named tiers, or all tiers if none are named. Raises SessionError for an unknown name."""
    for each in wanted:
        if each not in document.tiers:
            near = did_you_mean(each, document.tiers, limit=0)
            listed = ", ".join(document.tiers) or "none"
            raise SessionError(f"the file has no tier {each!r}{near or '.'} Its tiers of yours are: {listed}")
        yield each
    if not wanted:
        yield from document.tiers

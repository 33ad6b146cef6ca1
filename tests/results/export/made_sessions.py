"""Sessions that nobody ran, for what a real one rarely has: anything may overlap, last no time, or have any name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from rise_engine.results.analysis.model import ActPart, Cue, Phase, PlayedAct, Point, SessionData, SessionFacts
from rise_engine.session.media import FoundMark, MediaFile

HARD_TEXTS = (
    "",
    " ",
    "\t\n",
    'she said "yes" & <no>',
    "a\tb\r\nc",
    "\x00\x1b[2J\x7f\ufffe\uffff",
    "half a \ud83d character",
    "😀 ü ß → 中文 שלום",
    "]]>",
    "a|b,c(d)`~",
    "xmin = 0",
    "R_Do_It",
    "note",
    "note 2",
    "\u2028line\u2029",
)
MARKS = (
    FoundMark(number=1, session_at=1.0, media_at=1.0, strength=9.0),
    FoundMark(number=2, session_at=3000.0, media_at=3000.15, strength=9.0),
)


def session(folder: Path = Path("/nowhere"), **parts: Any) -> SessionData:
    """A session; what is not said is empty, and it lasts as long as what is in it, or 60 s."""
    facts = {"session": "2024-11-23_093000_P01_tea_real", "participant": "P01", "mode": "real", "duration": 60.0}
    facts |= {"started": "2024-11-23T09:30:00.000+01:00", "title": "Tea", **parts.pop("facts", {})}
    return SessionData(facts=SessionFacts(**facts), level="full", folder=folder, records=(), **parts)


def act(start: float, end: float, name: str = "R_Hello", **more: Any) -> PlayedAct:
    asked = {"task": 1, "act": name, "source": "wizard:anna", "actor": "wizard", "filler": False, "cue_at": None}
    done = {"status": "SUCCEEDED", "accepted_at": start, "started_at": start, "robot_at": start, "ended_at": end}
    made = asked | done | {"key_at": None, "voice_at": None} | more
    return PlayedAct(**({"by": made["source"]} | made))


def point(at: float, kind: Any = "note", name: str = "note", value: str = "hm", **more: Any) -> Point:
    return Point(at=at, kind=kind, name=name, value=value, **more)


def phase(start: float, end: float, state: str, rule: str = "Talk", **more: Any) -> Phase:
    return Phase(rule=rule, state=state, start=start, end=end, trigger="start", **more)


def video(path: str = "room.mp4", **more: Any) -> MediaFile:
    return MediaFile(**{"path": path, "kind": "video", "offset": 4.2, "duration": 90.0, "fps": 25.0} | more)


texts = st.one_of(st.sampled_from(HARD_TEXTS), st.text(st.characters(), max_size=12))
times = st.one_of(st.integers(0, 40).map(lambda n: n / 20), st.floats(0, 4000), st.floats(0, 0.003))
lengths = st.one_of(st.just(0.0), st.floats(0, 0.002), st.floats(0, 500))


@st.composite
def acts(draw: st.DrawFn) -> PlayedAct:
    accepted = draw(times)
    begun = draw(st.none() | lengths.map(lambda wait: accepted + wait))
    heard = None if begun is None else draw(st.none() | st.just(begun + draw(lengths)))
    ended = draw(st.none() | st.just(max(accepted, begun or 0, heard or 0) + draw(lengths)))
    channels = st.lists(st.sampled_from(["speech", "gaze", "eyes", "arms"]), max_size=2, unique=True).map(tuple)
    parts = [
        ActPart(
            action="1",
            type=draw(st.sampled_from(["Speech", "Wait", "LookAt"])),
            channels=draw(channels),
            parameters={},
            text=draw(texts),
            accepted_at=draw(st.none() | st.just(heard)),
            ended_at=draw(st.none() | st.just(heard + draw(lengths))),
            status=draw(st.sampled_from(["succeeded", "failed", "accepted"])),
            started_at=begun,
        )
        for _ in range(draw(st.integers(0, 2)) if heard is not None else 0)
    ]
    return act(
        accepted,
        0.0,
        draw(texts),
        actor=draw(st.sampled_from(["wizard", "rule", "program", "engine"])),
        status=draw(st.sampled_from(["SUCCEEDED", "ABORTED", "CANCELED", "REJECTED", "ACTIVE"])),
        filler=draw(st.booleans()),
        reason=draw(texts),
        started_at=begun,
        robot_at=heard,
        ended_at=ended,
        parts=tuple(parts),
    )


@st.composite
def cues(draw: st.DrawFn) -> Cue:
    at = draw(times)
    later = st.none() | lengths.map(lambda length: at + length)
    return Cue(at=at, source="wizard:anna", text=draw(texts), answered_at=draw(later), undone_at=draw(later))


@st.composite
def phases(draw: st.DrawFn) -> tuple[Phase, ...]:
    """Runs of rules: one state after the other, also of no length."""
    found = []
    for rule in draw(st.lists(texts, max_size=3)):
        at = draw(times)
        states = draw(st.lists(st.tuples(texts, lengths, st.sampled_from(["", "", "ended", "stopped"])), max_size=5))
        for state, length, ended_by in states:
            found.append(phase(at, at + length, state, rule, ended_by=ended_by))
            at += length
    return tuple(sorted(found, key=lambda each: each.start))


@st.composite
def points(draw: st.DrawFn) -> Point:
    kinds = ["note", "mistake", "stop", "sync", "event", "memory", "control", "robot", "fault", "check"]
    kind = draw(st.sampled_from(kinds))
    names = {
        "stop": st.sampled_from(["requested", "latched", "released"]),
        "robot": st.sampled_from(["lost", "connected"]),
    }
    source = draw(st.sampled_from(["wizard:anna", "engine", "rule:Talk", "node:ears"]))
    return point(draw(times), kind, draw(names.get(kind, texts)), draw(texts), source=source)


@st.composite
def recordings(draw: st.DrawFn) -> MediaFile:
    return video(
        draw(st.sampled_from(["room.mp4", "a b/ü & 'x'.mkv", "voice.wav", "bag", "/abs/two.mov", "bad\udcff.mp4"])),
        kind=draw(st.sampled_from(["video", "audio", "bag"])),
        offset=draw(st.none() | st.floats(-600, 600)),
        rate=draw(st.sampled_from([1.0, 1.00005, 0.9999, 1.01])),
        duration=draw(st.none() | st.floats(0.1, 5000)),
        fps=draw(st.none() | st.just(25.0)),
        marks=draw(st.sampled_from([(), MARKS])),
        aligned_by=draw(st.sampled_from(["", "marks", "given", "start"])),
    )


@st.composite
def sessions(draw: st.DrawFn, *, media: bool = True) -> SessionData:
    def several(of: st.SearchStrategy[Any], limit: int) -> tuple[Any, ...]:
        return tuple(draw(st.lists(of, max_size=limit)))

    zones = ["", "2024-11-23T09:30:00.000+01:00", "2026-06-01T09:30:00+05:30", "1890-01-01T00:00:00+00:53:28", "soon"]
    started = draw(st.sampled_from([*zones, "2026-01-01T23:59:59-09:30", "2026-01-01T00:00:00+23:59"]))
    factors = draw(
        st.dictionaries(st.sampled_from(["hesitation", "condition", "a|b"]), st.sampled_from(["yes", 2, None]))
    )
    return session(
        Path("/nowhere/sessions/one"),
        facts={"session": draw(texts), "started": started, "duration": draw(times), "factors": factors},
        acts=several(acts(), 6),
        cues=several(cues(), 4),
        phases=draw(phases()),
        points=tuple(sorted(several(points(), 8), key=lambda each: each.at)),
        media=several(recordings(), 3) if media else (),
    )

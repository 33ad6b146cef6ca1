"""The status line: everything where there is room, and what must never give way where there is little."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest
from msgspec.structs import replace
from textual.geometry import Region

from rise_engine.kernel.records import CueRecord, MemoryRecord, RobotRecord, SessionRecord
from rise_engine.run.protocol.client import Heartbeat, JournalStatus, UnrecordedStop
from rise_engine.scenario.model import Condition
from rise_tui.model.status import session_title, status_line
from rise_tui.model.store import Store
from rise_tui.rendering.text import line_width, plain_text
from rise_tui.widgets.bars import StatusLine
from tests.tui.conftest import console
from tests.tui.fake import FakeClient, demo

WIDTHS = (60, 80, 100, 120, 200)


def made(client: FakeClient | None = None, participant: str = "P07", condition: str = "hesitation") -> Store:
    client = client or FakeClient(demo())
    started = SessionRecord(0, 0.0, "", status="started", participant=participant, condition=condition)
    client.emit(started, at=0.0)
    return Store(client.attach_reply(), "anna", client.now)


def text(store: Store, width: int) -> str:
    line = status_line(store, width)
    assert line_width(line) == width
    return plain_text(line)


def late_cue(store: Store) -> None:
    store.view.apply(CueRecord(99, store.now() - 2.2, "", status="marked", source="wizard:anna"))


def locked(store: Store) -> None:
    store.input_mode = "LOCKED"


def old(store: Store) -> None:
    store.heartbeat = Heartbeat(store.now() - 4.5)


def lost(store: Store) -> None:
    store.view.apply(RobotRecord(99, 80.0, "", status="lost", detail="no answer"))


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("changes", [(), (late_cue,), (late_cue, locked, old), (lost, old), (late_cue, lost, locked)])
def test_mode_link_and_armed_state_never_give_way(width: int, changes: tuple[Callable[[Store], None], ...]) -> None:
    store = made()
    for change in changes:
        change(store)
    shown = text(store, width)
    assert "DEBUG" in shown and "pepper" in shown
    assert ("✗ lost" if lost in changes else "● ") in shown
    assert (" LOCKED " if locked in changes else " LIVE ") in shown
    assert ("cue 2.2 s" in shown) is (late_cue in changes)
    assert ("4.5 s" in shown) is (old in changes)


@pytest.mark.parametrize(
    ("width", "there", "gone"),
    [
        (200, ("P07 · hesitation  Demo study ", "pepper (sim) ● connected", "● REC", "00:01:23", "wizard anna"), ()),
        (120, ("P07 · hesitation  Demo study ", "pepper (sim) ● connected", "● REC", "00:01:23", "wizard anna"), ()),
        (100, ("P07 · hesitation  Demo study ", "pepper (sim) ● connected", "● REC", "00:01:23", "anna"), ()),
        (80, ("P07 · hesitation  Demo study ", "pepper ● ok", "● REC", "00:01:23", "anna"), ("(sim)",)),
        (60, ("P07 · hesitation", "pepper ● ok", "REC", "00:01:23"), ("Demo study", "anna")),
    ],
)
def test_what_gives_way_and_what_stays(width: int, there: tuple[str, ...], gone: tuple[str, ...]) -> None:
    shown = text(made(), width)
    assert all(piece in shown for piece in there) and not any(piece in shown for piece in gone), shown


@pytest.mark.parametrize("width", [70, 80, 90, 100, 120, 160])
@pytest.mark.parametrize("title", ["Demo", "LabLinking: setting the table"])
def test_no_blanks_are_kept_while_something_is_cut(width: int, title: str) -> None:
    """At 80x24 the condition had vanished beside 15 blank columns."""
    store = made(FakeClient(replace(demo(), title=title)))
    shown = text(store, width)
    assert shown.startswith(" P07 · hesitation ")
    blanks = max(map(len, re.findall(" +", shown)))
    cut = title not in shown or "wizard" not in shown or "connected" not in shown or "(sim)" not in shown
    assert not cut or blanks < 14, shown
    assert title in shown or blanks <= 9, shown  # fewer than MIN_TITLE, in which a title would say nothing


@pytest.mark.parametrize("width", [60, 70, 80, 100, 120, 200])
def test_the_condition_is_there_whatever_else_is_to_be_said(width: int) -> None:
    store = made(condition="no hesitation")
    late_cue(store)
    assert ("P07 · no hesitation" in text(store, width)) is (width >= 80)
    assert "P07" in text(store, width) and "cue 2.2 s" in text(store, width)


@pytest.mark.parametrize("width", WIDTHS)
def test_a_condition_that_was_changed_by_hand_says_so_whatever_else_is_to_be_said(width: int) -> None:
    store = made(condition="no hesitation")
    for source in ("condition", "wizard:anna"):
        store.view.apply(MemoryRecord(99, 0.0, "", "quiet", source, None, source))
    late_cue(store)
    assert "≠ changed" in session_title(store)
    assert ("≠ changed" if width >= 80 else "≠") in text(store, width)
    assert "P07" in text(store, width) and "cue 2.2 s" in text(store, width)
    store.view.session = replace(store.view.session, participant="Participant0123", condition=12 * "hesitation ")
    assert ("≠ changed" if width >= 80 else "≠") in text(store, width)


@pytest.mark.parametrize(
    ("participant", "condition", "widths"),
    [
        ("P07", "no hesitation", (80, 100, 120, 200)),
        ("P07", "hesitation+negation+slow", (100, 120, 200)),
        ("Participant0123", "hesitation with filler", (100, 120, 200)),
        ("", "hesitation with filler", (80, 100, 120, 200)),
    ],
)
def test_long_names_are_whole_where_there_is_room(participant: str, condition: str, widths: tuple[int, ...]) -> None:
    whole = " · ".join(filter(None, (participant, condition)))
    for width in WIDTHS[1:]:
        store = made(participant=participant, condition=condition)
        shown = text(store, width)
        assert (f" {whole} " in shown) is (width in widths), shown
        late_cue(store)
        assert (f" {whole} " in text(store, width)) is (width in widths), "also while a cue is counted"


def test_names_that_begin_alike_stay_apart() -> None:
    """Both keep a part of the room, and what differs is mostly at their ends."""
    names = ["hesitation with filler and gaze 1", "hesitation with filler and gaze 2"]
    shown = [text(made(participant="Participant0123", condition=name), 80) for name in names]
    assert shown[0] != shown[1] and all("0123 · hesi" in each for each in shown)
    assert "P07 · hesitatio…nd gaze 1 " in text(made(condition=names[0]), 80), "what P07 leaves is the condition's"


def test_the_condition_is_shown_by_its_label() -> None:
    conditions = {"hesitation": Condition({"hesitation": True}, label="blue"), "calm": Condition(label_only=True)}
    for condition, shown in (("hesitation", "blue"), ("calm", "calm"), ("gone", "gone")):
        store = made(FakeClient(replace(demo(), conditions=conditions)), condition=condition)
        assert text(store, 120).startswith(f" P07 · {shown}  Demo study ")
        assert session_title(store) == f"P07 · {shown} · Demo study"


@pytest.mark.parametrize(("width", "stopped"), [(80, False), (100, True), (120, True), (200, True)])
def test_who_watches_sees_that_it_is_stopped_before_room_is_kept_for_a_cue(width: int, stopped: bool) -> None:
    """In a narrow window the red bar says it alone."""
    client = FakeClient(demo(), you="observer:ben", role="observer")
    client.stop("latched", ("speech",))
    shown = text(made(client), width)
    assert "WATCHING · anna" in shown and ("STOPPED" in shown) is stopped
    assert "P07" in shown


@pytest.mark.parametrize("role", ["wizard", "observer"])
def test_whose_console_it_was_when_the_session_has_ended(role: str) -> None:
    store = made(FakeClient(demo(), you=f"{role}:ben", role=role))  # type: ignore[arg-type]
    store.gone_reason, store.ended_in_order = "ended by wizard:anna", True
    assert text(store, 200).endswith(f" ENDED   {role} ben ")


def test_a_long_title_is_cut_and_the_participant_stays() -> None:
    store = made(FakeClient(replace(demo(), title="LabLinking: setting the table")))
    assert text(store, 120).startswith(" P07 · hesitation  LabLinking: setting the table ")
    assert text(store, 80).startswith(" P07 · hesitation  LabLink") and "…" in text(store, 80)


@pytest.mark.parametrize(
    ("seen", "shown"),
    [(None, ""), (0.0, " <2 s"), (1.9, " <2 s"), (2.0, " 2.0 s"), (9.94, " 9.9 s"), (75.0, " 1:15")],
)
def test_the_age_of_the_robots_last_sign_of_life(seen: float | None, shown: str) -> None:
    """While all is well the line does not change with it: an idle console costs its clock and nothing else."""
    store = made()
    store.heartbeat = Heartbeat(None if seen is None else store.now() - seen)
    assert f"● connected{shown}  ● REC" in text(store, 200)


def test_an_old_sign_of_life_is_amber_although_the_link_says_connected() -> None:
    store = made()
    store.heartbeat = Heartbeat(store.now() - 3.5)
    assert [role for piece, role in status_line(store, 120) if "connected" in piece] == ["wait"]


def test_whether_it_is_recorded() -> None:
    assert "○ NO REC" in text(made(FakeClient(demo(), folder="")), 120)
    store = made()
    store.journal_status = JournalStatus(trouble="the disk is full")
    assert "✗ NOT REC" in text(store, 80) and " PAUSED " in text(store, 80) and "LIVE" not in text(store, 80)
    store.journal_status = JournalStatus(behind=3.2)
    assert "disk 3 s behind" in text(store, 80)
    store.journal_status = JournalStatus(behind=3.2, stop=UnrecordedStop("wizard:bob"))
    assert " STOPPED " in text(store, 80) and "LIVE" not in text(store, 80)


def test_nobody_was_named() -> None:
    assert text(made(participant="", condition=""), 200).startswith(" Demo study  ")
    assert " hesitation  Demo study" in text(made(participant="", condition="hesitation"), 200)


async def test_a_pulse_reaches_the_line_with_the_clock() -> None:
    client = FakeClient(demo())
    async with console(client=client) as it:
        client.pulse(client.time - 5)
        await it.until(lambda: "connected 5.0 s" in it.bars.status_line.text)


async def test_a_second_repaints_the_status_line_once() -> None:
    async with console() as it:
        await it.until(lambda: "LIVE" in it.bars.status_line.text)
        painted: list[tuple[int, int]] = []
        refresh = it.bars.status_line.refresh

        def watched(*regions: Region, **options: Any) -> StatusLine:
            painted.extend((region.x, region.width) for region in regions)
            refresh(*regions, **options)
            return it.bars.status_line

        it.bars.status_line.refresh = watched  # type: ignore[method-assign]
        it.client.time += 1
        await it.until(lambda: painted)
        assert painted == [(0, it.bars.status_line.size.width)]
        assert "00:01" in it.bars.status_line.text


def test_a_robot_that_has_just_come_back_was_just_heard_of() -> None:
    store = made()
    store.heartbeat = Heartbeat(store.now() - 42)
    assert "● connected 42.0 s" in text(store, 200)
    store.apply([RobotRecord(98, store.now() - 3, "", "lost", "unplugged")])
    assert "✗ lost 42.0 s" in text(store, 200)
    store.apply([RobotRecord(99, store.now(), "", "connected", "")])
    assert "● connected <2 s" in text(store, 200)


@pytest.mark.parametrize("width", WIDTHS[1:])
@pytest.mark.parametrize("holder", ["wizard:anna", "wizard:ben"])
def test_whether_it_is_recorded_is_never_cut(width: int, holder: str) -> None:
    for options in ({"holder": holder}, {"holder": holder, "role": "observer", "you": "observer:bob"}):
        store = made(FakeClient(demo(), **options))  # type: ignore[arg-type]
        assert "REC" in text(store, width)
        late_cue(store)
        assert "REC" in text(store, width)


def test_what_a_gone_engine_said_about_the_robot_is_not_shown_as_true() -> None:
    store = made()
    assert "connected" in text(store, 120)
    store.gone_reason = "the engine has gone"
    assert "● connected" not in text(store, 120) and "○ not known" in text(store, 120)

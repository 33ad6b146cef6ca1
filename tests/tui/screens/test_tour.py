"""The tour: five boxes, for a wizard's first run, that disturb nobody."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from textual.geometry import Region, Size

from rise_tui.config.preferences import PREFERENCES_NAME, Preferences, load_saved, state_folder
from rise_tui.console.layout import UiState
from rise_tui.model.store import Store
from rise_tui.rendering.text import line_width, plain_text
from rise_tui.screens.tour import STEPS, TourScreen, box_lines, is_tour_due, place_box
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo

SIZES = [(80, 24), (120, 40), (200, 50)]


def a_store(change: Callable[[FakeClient], object] = lambda client: None, t: float = 3.0, **more: object) -> Store:
    client = FakeClient(demo(), **more)  # type: ignore[arg-type]
    client.time = t
    change(client)
    return Store(client.attach_reply(), "anna", client.now)


def test_it_is_offered_to_a_wizard_in_a_session_that_has_just_begun() -> None:
    assert is_tour_due(a_store()) and is_tour_due(a_store(t=59.9))


@pytest.mark.parametrize(
    "store",
    [
        a_store(t=61.0),
        a_store(lambda client: client.act("Greet")),
        a_store(lambda client: client.stop("latched")),
        a_store(you="observer:ben", role="observer"),
        a_store(you="wizard:ben"),
        a_store(you="observer:replay", role="observer", replay=True),
    ],
    ids=["late", "a task", "stopped", "observer", "without control", "replay"],
)
def test_it_is_not_offered(store: Store) -> None:
    assert not is_tour_due(store)


def test_it_has_five_steps_that_name_the_keys() -> None:
    said = " ".join(step.text for step in STEPS)
    assert len(STEPS) == 5 and "{" not in said
    for key in ("space", "ctrl+x", "F7", "F9", "ctrl+r", "F3", "ctrl+d", "?", ":", "ctrl+c"):
        assert key in said, key


@pytest.mark.parametrize("width", [40, 60])
def test_a_box_is_framed_and_loses_no_word(width: int) -> None:
    for number, step in enumerate(STEPS, 1):
        lines = box_lines(step, number, width)
        assert {line_width(line) for line in lines} == {width}
        said = " ".join(" ".join(plain_text(line).strip("│╭╮╰╯─ ") for line in lines).split())
        assert " ".join(step.text.split()) in said and f"{number} of 5" in said
        assert "esc" in said or number == 5


@pytest.mark.parametrize(
    ("part", "arrow"),
    [
        (Region(0, 0, 120, 1), "▲"),
        (Region(0, 39, 120, 1), "▼"),
        (Region(0, 1, 52, 30), "◄"),
        (Region(90, 1, 30, 30), "►"),
        (Region(10, 4, 100, 20), "▲"),
    ],
)
def test_a_box_stands_beside_what_it_points_at_and_within_the_room(part: Region, arrow: str) -> None:
    room, size = Region(0, 1, 120, 36), Size(60, 11)
    at, pointer, shown = place_box(part, size, room)
    assert shown == arrow
    for place in (Region(*at, *size), Region(*pointer, 3, 1)):
        assert room.contains_region(place)
    assert not Region(*at, *size).contains_point(pointer)


async def started(it: Console) -> TourScreen:
    it.screen.action_do("tour")
    screen = await it.shows(TourScreen)
    await it.until(lambda: "1 of 5" in screen.text)
    return screen


@pytest.mark.slow
async def test_enter_and_right_go_on_left_goes_back_and_the_last_one_ends_it() -> None:
    async with console(size=(80, 24)) as it:
        for size in SIZES:
            await it.pilot.resize_terminal(*size)
            screen = await started(it)
            for number, key in ((2, "enter"), (3, "right"), (2, "left"), (3, "enter"), (4, "enter"), (5, "right")):
                await it.press(key)
                await it.until(lambda number=number, screen=screen: f"{number} of 5" in screen.text)  # type: ignore[misc]
                await it.until(lambda screen=screen: screen._box.region.height == len(screen._box.lines))  # type: ignore[misc]
                assert Region(0, 0, *size).contains_region(screen._box.region)
                assert not it.bars.status_line.region.overlaps(screen._box.region)
            await it.press("enter")
            await it.back()
            assert it.client.sent == [] and it.pane("acts").row_view.has_focus
        seen: list[bool] = []
        it.screen.open_tour(lambda: seen.append(True))
        await it.shows(TourScreen)
        assert seen == []
        await it.press("escape")
        await it.until(lambda: seen == [True], "it is seen once it has ended, however that was")


async def test_keys_trigger_nothing_stop_works_and_the_alarm_is_not_covered() -> None:
    async with console(size=(80, 24)) as it:
        screen = await started(it)
        await it.press("g", "m", "n", "space", "comma", "colon", "left")
        assert it.client.sent == [] and "1 of 5" in screen.text
        await it.press("f9")
        await it.sent("stopAll", "")
        it.client.stop("latched", ("pepper/speech",))
        await it.until(lambda: it.bars.alarm_bar.display and it.bars.alarm_bar.region.height == 3)
        await it.until(lambda: not screen._box.region.overlaps(it.bars.alarm_bar.region))
        await it.press("escape")
        await it.back()
        assert it.client.asked() == [("stopAll", "")]


@pytest.mark.slow
async def test_a_first_run_is_offered_the_tour_once_and_only_where_something_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    for options, age, offered in (
        ({"fresh": True}, 2.0, False),
        ({"keeps_changes": False}, 2.0, False),
        ({}, 83.0, False),  # at the wrong moment: it stays open for the next time
        ({}, 2.0, True),
        ({}, 2.0, False),
    ):
        client = FakeClient(demo())
        client.time = age
        preferences, _ = load_saved(state_folder() / PREFERENCES_NAME, Preferences)
        async with console(client=client, ui_state=UiState(preferences, **options)) as it:
            if offered:
                await it.shows(TourScreen)
                await it.press("escape")
                await it.until(lambda: load_saved(state_folder() / PREFERENCES_NAME, Preferences)[0].tour)
            await it.pilot.pause(0.1)
            assert it.app.screen is it.screen

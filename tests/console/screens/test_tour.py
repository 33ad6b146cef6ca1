"""The tour: five boxes, for a wizard's first run, that disturb nobody."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from textual.geometry import Region, Size

from rise_tui.config.paths import PREFERENCES_NAME, state_folder
from rise_tui.config.preferences import Preferences, load_saved
from rise_tui.console.ui_state import UiState
from rise_tui.model.store import Store
from rise_tui.rendering.text import line_width, plain_text
from rise_tui.screens.tour import STEPS, TourScreen, box_lines, is_tour_due, place_box
from tests.console.conftest import Console, console
from tests.console.fake import FakeClient, demo

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
    for key in ("space", "ctrl+x", "ctrl+n", "F9", "ctrl+r", "F3", "ctrl+d", "?", ":", "ctrl+c"):
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
    await it.until(lambda: isinstance(it.app.screen, TourScreen))
    screen = it.app.screen
    assert isinstance(screen, TourScreen)
    await it.until(lambda: "1 of 5" in screen.text)
    return screen


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES)
async def test_enter_and_right_go_on_left_goes_back_and_the_last_one_ends_it(size: tuple[int, int]) -> None:
    async with console(size=size) as it:
        screen = await started(it)
        for number, key in ((2, "enter"), (3, "right"), (2, "left"), (3, "enter"), (4, "enter"), (5, "right")):
            await it.press(key)
            await it.until(lambda number=number: f"{number} of 5" in screen.text)  # type: ignore[misc]
            await it.until(lambda: screen._box.region.height == len(screen._box.lines))
            assert Region(0, 0, *size).contains_region(screen._box.region)
            assert not it.bars.status_line.region.overlaps(screen._box.region)
        await it.press("enter")
        await it.until(lambda: it.app.screen is it.screen)
        assert it.client.sent == [] and it.pane("acts").row_view.has_focus


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
        await it.until(lambda: it.app.screen is it.screen)
        assert it.client.asked() == [("stopAll", "")]


async def test_it_is_seen_once_it_has_ended_however_that_was() -> None:
    async with console() as it:
        seen: list[bool] = []
        it.screen.open_tour(lambda: seen.append(True))
        await it.until(lambda: isinstance(it.app.screen, TourScreen))
        assert seen == []
        await it.press("escape")
        await it.until(lambda: seen == [True])


async def test_an_offer_at_the_wrong_moment_shows_nothing_and_stays_open_for_the_next_time() -> None:
    async with console() as it:  # its session is 83 s old
        seen: list[bool] = []
        it.screen.offer_tour(lambda: seen.append(True))
        await it.pilot.pause(0.1)
        assert it.app.screen is it.screen and seen == []


async def test_a_first_run_is_offered_the_tour_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    for run in ("first", "second"):
        client = FakeClient(demo())
        client.time = 2.0
        preferences, _ = load_saved(state_folder() / PREFERENCES_NAME, Preferences)
        async with console(client=client, ui_state=UiState(preferences)) as it:
            if run == "first":
                await it.until(lambda: isinstance(it.app.screen, TourScreen))
                await it.press("escape")
                await it.until(lambda: load_saved(state_folder() / PREFERENCES_NAME, Preferences)[0].tour)
            await it.pilot.pause(0.1)
            assert it.app.screen is it.screen


@pytest.mark.parametrize("options", [{"fresh": True}, {"keeps_changes": False}])
async def test_no_tour_where_nothing_is_restored_or_kept(
    options: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    client = FakeClient(demo())
    client.time = 2.0
    async with console(client=client, ui_state=UiState(Preferences(), **options)) as it:
        await it.pilot.pause(0.1)
        assert it.app.screen is it.screen

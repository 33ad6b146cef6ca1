"""Where lists and panes stand: by the size of the terminal, as they were left, and without jumping."""

from __future__ import annotations

import pytest

from rise_engine.kernel.records import MemoryRecord
from rise_tui.console.layout import Layout, layout_for
from rise_tui.model.store import Store
from rise_tui.panes.pane import Pane
from rise_tui.rendering.text import line_width, plain_text
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.too_small import TooSmallScreen, is_too_small, too_small_lines
from tests.console.conftest import Console, console
from tests.console.fake import FakeClient, demo


@pytest.mark.parametrize(
    ("size", "layout"),
    [
        *(((70, 20), "one"), ((79, 60), "one"), ((120, 23), "one"), ((80, 24), "two"), ((100, 30), "two")),
        *(
            ((120, 40), "two"),
            ((200, 29), "two"),
            ((179, 50), "two"),
            ((180, 40), "all"),
            ((200, 50), "all"),
            ((300, 90), "all"),
        ),
    ],
)
def test_the_layout_by_size(size: tuple[int, int], layout: str) -> None:
    assert layout_for(*size) == layout and not is_too_small(*size)


@pytest.mark.parametrize("size", [(69, 24), (80, 19), (60, 20), (20, 5)])
def test_too_small(size: tuple[int, int]) -> None:
    assert is_too_small(*size)


async def test_the_layout_is_given_as_plain_words_and_restored() -> None:
    async with console(size=(80, 24)) as it:
        it.screen.pane_layout.focus_pane("scheduler")
        it.screen.pane_layout.focus_pane("memory")
        state = it.screen.pane_layout.layout_state()
        assert state == {"upper": "memory", "lower": "scheduler", "front": "memory", "focus": "memory"}
    async with console(size=(120, 40)) as it:
        it.screen.pane_layout.restore_state(state)
        await it.until(lambda: it.pane("memory").row_view.has_focus)
        assert {pane.SCOPE for pane in it.screen.pane_layout.visible_panes()} == {
            "acts",
            "rules",
            "memory",
            "scheduler",
        }
        assert it.screen.pane_layout.layout_state() == state


async def test_what_nobody_sees_yet_is_made_after_the_first_frame() -> None:
    async with console(size=(80, 24)) as it:
        await it.until(lambda: all(pane.row_view.is_mounted for pane in it.screen.pane_layout.panes.values()))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["act", "memory", "scheduler", "log"])
async def test_who_is_quicker_than_that_sees_the_pane_all_the_same(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Layout, "_mount_hidden", lambda self: None)
    async with console(size=(70, 20)) as it:
        panes = it.screen.pane_layout
        assert [pane.SCOPE for pane in panes.panes.values() if pane.children] == ["acts", "rules", "rule"]
        panes.focus_pane(name)
        await it.until(lambda: it.pane(name).row_view.has_focus)
        assert {pane.SCOPE for pane in panes.visible_panes()} == {"acts", "rules", name}
        await it.until(lambda: it.pane(name).row_view.size.height > 0)
        assert len(it.pane(name).children) > 1
        made: list[str] = []
        monkeypatch.setattr(Pane, "_contents", lambda self: made.append(self.SCOPE) or iter(()))
        panes.focus_pane("rule")
        panes.focus_pane(name)
        assert made == []


@pytest.mark.parametrize("state", [{}, {"upper": "log", "lower": "acts", "front": "nothing", "focus": "?"}])
async def test_a_state_that_makes_no_sense_changes_nothing(state: dict[str, str]) -> None:
    async with console(size=(120, 40)) as it:
        before = it.screen.pane_layout.layout_state()
        it.screen.pane_layout.restore_state(state)
        assert it.screen.pane_layout.layout_state() == before
        assert it.pane("acts").row_view.has_focus


async def test_shift_tab_goes_the_other_way_round() -> None:
    async with console(size=(80, 24)) as it:
        await it.press("tab", "tab")
        assert it.pane("act").row_view.has_focus
        seen = []
        for _ in range(3):
            await it.press("shift+tab")
            pane = it.screen.pane_layout.focused_pane()
            assert pane is not None
            seen.append(pane.SCOPE)
        assert seen == ["rule", "scheduler", "log"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["acts", "rules", "rule", "act", "memory", "log", "scheduler"])
async def test_any_list_or_pane_can_be_zoomed_says_so_and_esc_goes_back(name: str) -> None:
    async with console(size=(80, 24)) as it:
        it.screen.pane_layout.focus_pane(name)
        before = {pane.SCOPE for pane in it.screen.pane_layout.visible_panes()}
        await it.press("f4")
        await it.until(lambda: it.pane(name).region.width == 80)
        assert [pane.SCOPE for pane in it.screen.pane_layout.visible_panes()] == [name]
        await it.until(lambda: "ZOOMED, ESC GOES BACK" in it.pane(name).title.text)
        await it.press("escape")
        await it.until(lambda: {pane.SCOPE for pane in it.screen.pane_layout.visible_panes()} == before)
        assert "ZOOMED" not in it.pane(name).title.text and it.pane(name).row_view.has_focus


@pytest.mark.slow
@pytest.mark.parametrize("size", [(80, 24), (120, 40), (200, 50)])
async def test_nothing_moves_when_what_panes_show_changes(size: tuple[int, int]) -> None:
    async with console(size=size) as it:
        before = {name: pane.region for name, pane in it.screen.pane_layout.panes.items()}
        it.client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
        for number in range(60):
            it.client.task("raiseEventTopic", f"/topic{number}", "SUCCEEDED")
            it.client.emit(MemoryRecord(0, 0.0, "", f"key{number}", number, None, "file", created=True))
        it.client.act("Greet")
        await it.until(lambda: "► running" in it.row("acts", "Greet"))
        await it.until(lambda: len(it.screen.session.store.log.all) > 60)
        await it.pilot.pause(0.1)
        assert {name: pane.region for name, pane in it.screen.pane_layout.panes.items()} == before


@pytest.mark.parametrize("size", [(80, 24), (120, 40), (200, 50)])
async def test_every_cell_beside_the_bars_belongs_to_a_pane(size: tuple[int, int]) -> None:
    async with console(size=size) as it:
        room = it.screen.pane_layout.region
        taken = sum(pane.region.area for pane in it.screen.pane_layout.visible_panes())
        borders = 2 * room.height
        assert room.area - borders <= taken <= room.area


# --- small windows --------------------------------------------------------------------------------------------------


def sentences(width: int, height: int, *, stopped: bool = False) -> list[str]:
    from textual.geometry import Size

    client = FakeClient(demo())
    if stopped:
        client.stop("latched", ("pepper/speech",))
    store = Store(client.attach_reply(), "anna", client.now)
    lines = too_small_lines(Size(width, height), store)
    assert all(line_width(line) <= width for line in lines) and len(lines) <= height
    return [plain_text(line) for line in lines]


def test_a_small_window_says_what_is_needed() -> None:
    said = " ".join(sentences(60, 20))
    assert "This window has 60 x 20 cells; the console needs 70 x 20." in said
    assert "F9 stops everything, ctrl+c leaves. No other key does anything here." in said
    assert "The session goes on." in said


def test_a_stop_is_seen_there_too() -> None:
    assert "STOPPED" in sentences(60, 20, stopped=True)[0]
    assert "STOPPED" in sentences(20, 3, stopped=True)[0]


async def shrunk(it: Console) -> TooSmallScreen:
    await it.pilot.resize_terminal(60, 20)
    await it.until(lambda: isinstance(it.app.screen, TooSmallScreen))
    screen = it.app.screen
    assert isinstance(screen, TooSmallScreen)
    await it.until(lambda: "60 x 20" in screen.lines.text)
    return screen


async def test_in_a_small_window_stopping_works_and_nothing_else() -> None:
    async with console(size=(80, 24)) as it:
        await shrunk(it)
        await it.press("g", "m", "enter", "colon", "question_mark", "escape")
        assert it.client.sent == [] and isinstance(it.app.screen, TooSmallScreen)
        await it.press("f9")
        await it.sent("stopAll", "")
        await it.pilot.resize_terminal(80, 24)
        await it.until(lambda: it.app.screen is it.screen)
        assert it.pane("acts").row_view.has_focus


async def test_a_console_that_begins_in_a_small_window_says_so_at_once() -> None:
    async with console(size=(50, 10)) as it:
        await it.until(lambda: isinstance(it.app.screen, TooSmallScreen))


@pytest.mark.slow
async def test_a_window_that_grows_below_a_question_leaves_the_question() -> None:
    async with console(size=(80, 24)) as it:
        await shrunk(it)
        await it.press("ctrl+c")
        await it.until(lambda: isinstance(it.app.screen, Dialog))
        await it.pilot.resize_terminal(80, 24)
        await it.pilot.pause(0.1)
        assert isinstance(it.app.screen, Dialog)
        await it.press("escape")
        await it.until(lambda: it.app.screen is it.screen)

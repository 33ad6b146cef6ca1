"""Where lists and panes stand: by the size of the terminal, as they were left, and without jumping."""

from __future__ import annotations

import pytest

from rise_engine.kernel.records import MemoryRecord
from rise_tui.console.layout import Layout, layout_for
from rise_tui.model.store import Store
from rise_tui.panes.pane import Pane
from rise_tui.rendering.text import line_width, plain_text
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.tour import TooSmallScreen, is_too_small, too_small_lines
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo


@pytest.mark.parametrize(
    ("size", "layout"),
    [
        *(((50, 15), "column"), ((60, 20), "column"), ((69, 24), "column")),
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


@pytest.mark.parametrize("size", [(49, 24), (80, 14), (40, 12), (20, 5)])
def test_too_small(size: tuple[int, int]) -> None:
    assert is_too_small(*size)


def visible(it: Console) -> set[str]:
    return {pane.SCOPE for pane in it.screen.pane_layout.visible_panes()}


@pytest.mark.slow
async def test_the_layout_is_given_as_plain_words_and_restored() -> None:
    async with console(size=(80, 24)) as it:
        await it.until(lambda: all(pane.row_view.is_mounted for pane in it.screen.pane_layout.panes.values()))
        await it.press("tab", "tab")
        assert it.pane("act").row_view.has_focus
        seen = []
        for _ in range(3):
            await it.press("shift+tab")
            pane = it.screen.pane_layout.focused_pane()
            assert pane is not None
            seen.append(pane.SCOPE)
        assert seen == ["rule", "scheduler", "log"]
        await it.focus("scheduler")
        await it.focus("memory")
        state = it.screen.pane_layout.layout_state()
        assert state == {"upper": "memory", "lower": "scheduler", "front": "memory", "focus": "memory"}
    async with console(size=(120, 40)) as it:
        before = it.screen.pane_layout.layout_state()
        for nonsense in ({}, {"upper": "log", "lower": "acts", "front": "nothing", "focus": "?"}):
            it.screen.pane_layout.restore_state(nonsense)
            assert it.screen.pane_layout.layout_state() == before and it.pane("acts").row_view.has_focus
        it.screen.pane_layout.restore_state(state)
        await it.until(lambda: it.pane("memory").row_view.has_focus)
        assert visible(it) == {"acts", "rules", "memory", "scheduler"}
        assert it.screen.pane_layout.layout_state() == state


@pytest.mark.slow
async def test_who_is_quicker_than_what_is_made_after_the_first_frame_sees_the_pane_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Layout, "_mount_hidden", lambda self: None)
    async with console(size=(70, 20)) as it:
        panes, names = it.screen.pane_layout, ("act", "memory", "scheduler", "log")
        assert [pane.SCOPE for pane in panes.panes.values() if pane.children] == ["acts", "rules", "rule"]
        for name in names:
            panes.focus_pane(name)
            await it.until(lambda name=name: it.pane(name).row_view.has_focus)  # type: ignore[misc]
            assert visible(it) == {"acts", "rules", name}
            await it.until(lambda name=name: it.pane(name).row_view.size.height > 0)  # type: ignore[misc]
            assert len(it.pane(name).children) > 1
        made: list[str] = []
        monkeypatch.setattr(Pane, "_contents", lambda self: made.append(self.SCOPE) or iter(()))
        for name in ("rule", *names):
            panes.focus_pane(name)
        assert made == []


@pytest.mark.slow
async def test_any_list_or_pane_can_be_zoomed_says_so_and_esc_goes_back() -> None:
    async with console(size=(80, 24)) as it:
        for name in ("acts", "rules", "rule", "act", "memory", "log", "scheduler"):
            await it.focus(name)
            before = visible(it)
            await it.press("f4")
            await it.until(lambda name=name: it.pane(name).region.width == 80)  # type: ignore[misc]
            assert visible(it) == {name}
            await it.until(lambda name=name: "ZOOMED, ESC GOES BACK" in it.pane(name).title.text)  # type: ignore[misc]
            await it.press("escape")
            await it.until(lambda before=before: visible(it) == before)  # type: ignore[misc]
            assert "ZOOMED" not in it.pane(name).title.text and it.pane(name).row_view.has_focus


@pytest.mark.slow
async def test_nothing_moves_when_what_panes_show_changes_and_every_cell_belongs_to_a_pane() -> None:
    async with console(size=(80, 24)) as it:
        for size in ((80, 24), (120, 40), (200, 50)):
            await it.pilot.resize_terminal(*size)
            await it.pilot.pause(0.1)
            room = it.screen.pane_layout.region
            taken = sum(pane.region.area for pane in it.screen.pane_layout.visible_panes())
            borders = 2 * room.height
            assert room.area - borders <= taken <= room.area
            before = {name: pane.region for name, pane in it.screen.pane_layout.panes.items()}
            it.client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
            for number in range(60):
                it.client.task("raiseEventTopic", f"/topic{number}", "SUCCEEDED")
                it.client.emit(MemoryRecord(0, 0.0, "", f"key{size}{number}", number, None, "file", created=True))
            task = it.client.act("Greet")
            await it.until(lambda: "► running" in it.row("acts", "Greet"))
            await it.until(lambda: len(it.screen.session.store.log.all) > 60)
            await it.pilot.pause(0.1)
            assert {name: pane.region for name, pane in it.screen.pane_layout.panes.items()} == before
            it.client.end_task(task, "Greet")
            it.client.rule("Main", "stopped", None)


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
    said = " ".join(sentences(40, 12))
    assert "This window has 40 x 12 cells; the console needs 50 x 15." in said
    assert "F9 stops everything, ctrl+c leaves. No other key works here." in said
    assert "The session goes on." in said


def test_a_stop_is_seen_there_too() -> None:
    assert "STOPPED" in sentences(40, 12, stopped=True)[0]
    assert "STOPPED" in sentences(20, 3, stopped=True)[0]


async def test_a_narrow_window_shows_one_list_or_pane_at_a_time_and_keys_work() -> None:
    async with console(size=(60, 20)) as it:
        assert visible(it) == {"acts"} and "rules" in it.pane("acts").title.text
        await it.press("f2")
        await it.until(lambda: visible(it) == {"rules"})
        await it.press("tab")
        await it.until(lambda: visible(it) == {"rule"})
        await it.press("g")
        await it.sent("startCommunicationRobotAct", "Greet")
        await it.press("ctrl+t", *"hi", "enter")
        await it.sent("say", "hi")
        await it.pilot.resize_terminal(80, 24)
        await it.until(lambda: visible(it) == {"acts", "rules", "rule", "log"})
        await it.pilot.resize_terminal(60, 20)
        await it.until(lambda: visible(it) == {"rule"})


@pytest.mark.slow
async def test_in_a_small_window_stopping_works_and_nothing_else() -> None:
    async with console(size=(40, 12), ready="") as it:
        screen = await it.shows(TooSmallScreen)  # also when it begins so
        await it.until(lambda: "40 x 12" in screen.lines.text)
        await it.press("g", "m", "enter", "colon", "question_mark", "escape")
        assert it.client.sent == [] and it.app.screen is screen
        await it.press("f9")
        await it.sent("stopAll", "")
        await it.pilot.resize_terminal(80, 24)
        await it.back()
        assert it.pane("acts").row_view.has_focus
        await it.pilot.resize_terminal(40, 12)
        await it.shows(TooSmallScreen)
        await it.press("ctrl+c")
        await it.shows(Dialog)
        await it.pilot.resize_terminal(80, 24)
        await it.pilot.pause(0.1)
        assert isinstance(it.app.screen, Dialog), "a window that grows below a question leaves the question"
        await it.press("escape")
        await it.back()

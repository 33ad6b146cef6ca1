"""The palette: anything that can be done, by a few letters of its name."""

from __future__ import annotations

import pytest

from rise_tui.actions import ACTIONS
from rise_tui.model.control import KeyAction
from rise_tui.model.store import Store
from rise_tui.rendering import themes
from rise_tui.screens.dialog import TitledBox
from rise_tui.screens.palette import Palette, PaletteCommand, palette_commands, search_commands, theme_commands
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo


def a_store(client: FakeClient | None = None) -> Store:
    client = client or FakeClient(demo())
    return Store(client.attach_reply(), "anna", client.now)


def all_commands(store: Store, ran: list[object] | None = None) -> list[PaletteCommand]:
    into: list[object] = [] if ran is None else ran
    return [*palette_commands(store, "rule", into.append, into.append), *theme_commands(into.append)]


def titles(typed: str, store: Store | None = None) -> list[str]:
    return [hit.command.title for hit in search_commands(all_commands(store or a_store()), typed)]


def test_it_has_every_action_act_rule_and_theme() -> None:
    store = a_store()
    made = all_commands(store)
    named = [(command.title, command.kind) for command in made]
    assert len(named) == len(set(named))
    here = {action.title for action in ACTIONS if action.id != "palette" and action.scope not in ("study", "edit")}
    assert here <= {command.title for command in made}
    assert {command.title for command in made if command.kind == "act"} == set(store.scenario.acts)
    assert {command.title for command in made if command.kind == "rule"} == set(store.scenario.rules)
    assert [command.theme for command in made if command.kind == "theme"] == [theme.name for theme in themes.THEMES]


def test_the_focused_panes_actions_come_first() -> None:
    assert all_commands(a_store())[0].kind == "here"
    assert titles("")[0] == "Raise the event"


def test_what_a_running_rule_waits_for_is_offered_as_an_event_and_raised() -> None:
    client = FakeClient(demo())
    client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
    ran: list[object] = []
    events = [command for command in all_commands(a_store(client), ran) if command.kind == "event"]
    assert [command.title for command in events] == ["next"]  # the condition of `repeat` does not hold
    assert events[0].key == "n"
    events[0].run()
    assert ran == [KeyAction("raiseEventTopic", "next")]
    others = [command for command in all_commands(a_store()) if command.kind in ("event", "set")]
    assert [(command.title, command.key) for command in others] == [("next", "n"), ("understood", "u")]
    assert "no running rule waits for it now" in others[0].help and others[1].help == "understood = true"


def test_the_end_of_an_act_that_a_rule_waits_for_is_no_event_of_the_wizards() -> None:
    client = FakeClient(demo())
    client.rule("Main", "started", "greeting")
    store = a_store(client)
    assert "Greet_end" in store.expected_inputs().events
    made = all_commands(store)
    assert [command.title for command in made if command.kind == "event"] == ["next"]  # the key's own
    assert "waits for it" in next(command.help for command in made if command.title == "Greet")


@pytest.mark.parametrize(
    ("typed", "first"),
    [
        ("greet", "Greet"),
        ("prs", "Praise"),
        ("act praise", "Praise"),
        ("rule main", "Main"),
        ("zoom", "Zoom"),
        ("stop ev", "Stop everything"),
        ("theme light", "light"),
        ("release", "Release the stop, or a part"),
    ],
)
def test_a_few_letters_find_it(typed: str, first: str) -> None:
    assert titles(typed)[0] == first


def test_titles_come_before_words_of_the_help() -> None:
    hits = titles("lock")
    assert hits[0] == "Lock the keys"
    assert "Filter" not in titles("zzzz")


def test_half_an_expression_hides_nothing() -> None:
    assert len(titles("/(")) == len(titles(""))


def test_what_cannot_be_done_is_there_with_the_reason() -> None:
    client = FakeClient(demo())
    client.stop("latched")
    greet = next(command for command in all_commands(a_store(client)) if command.title == "Greet")
    assert greet.blocked_text.startswith("STOPPED")


def test_a_hold_act_stays_one_and_keeps_its_debounce() -> None:
    ran: list[object] = []
    next(command for command in all_commands(a_store(), ran) if command.title == "Goodbye").run()
    assert isinstance(ran[0], KeyAction) and ran[0].hold


# --- on the screen --------------------------------------------------------------------------------------------------


async def opened(it: Console, typed: str = "", key: str = "colon") -> Palette:
    await it.press(key)
    screen = await it.shows(Palette)
    await it.until(lambda: screen.list.text)
    await it.press(*typed)
    return screen


async def closed(it: Console) -> None:
    await it.press("escape")
    await it.back()


@pytest.mark.slow
async def test_enter_does_what_the_cursor_is_on_or_says_why_not() -> None:
    async with console(size=(80, 24)) as it:
        for size, key in (((80, 24), "colon"), ((120, 40), "colon"), ((200, 50), "colon")):
            await it.pilot.resize_terminal(*size)
            await it.pilot.pause(0.6)
            screen = await opened(it, "praise", key)
            assert screen.list.region.right <= size[0] and screen.list.region.bottom <= size[1]
            await it.press("enter")
            await it.until(lambda screen=screen: screen.current is not None and screen.current.title == "Praise")  # type: ignore[misc]
            assert it.client.asked() == [] and "enter again: Praise" in str(screen.query_one(TitledBox).border_subtitle)
            await it.press("enter")
            await it.sent("startCommunicationRobotAct", "Praise")
            await it.back()
            it.client.sent.clear()
        screen = await opened(it)
        await it.press("down", "down", "up", "pagedown", "pageup", "down")
        assert screen.list.cursor == 1
        await it.press("z", "o")  # a letter brings it back to the first
        assert screen.list.cursor == 0 and screen.current is not None and screen.current.title == "Zoom"
        await closed(it)
        screen = await opened(it, "qqqq")
        assert "nothing found" in screen.list.text
        await it.press("enter")
        assert it.app.screen is screen
        await closed(it)
        await opened(it, "g")
        await closed(it)
        assert it.client.sent == [] and it.pane("acts").row_view.has_focus, "letters start nothing"
        it.client.stop("latched")
        await it.until(lambda: it.screen.session.store.key_state == "STOPPED")
        screen = await opened(it, "praise")
        assert "not now: STOPPED" in screen.list.text
        await it.press("enter", "enter")
        await it.until(lambda: "Praise: not now, STOPPED" in it.notice)
        assert it.client.sent == []
        screen = await opened(it, "leave")
        await it.until(lambda: screen.current is not None and screen.current.title == "Leave")
        await it.press("enter")
        await it.until(lambda: it.app.screen.has_class("-quit"))


@pytest.mark.slow
async def test_moving_over_a_theme_shows_it_enter_takes_it_and_esc_brings_back_the_one_before() -> None:
    async with console() as it:
        before = it.app.theme
        screen = await opened(it, "theme light")
        await it.until(lambda: it.app.theme == "rise-light")
        await it.press(*["backspace"] * 11)
        await it.until(lambda: it.app.theme == before)
        await it.press(*"light")
        await it.until(lambda: it.app.theme == "rise-light" and screen.current is not None)
        await closed(it)
        await it.until(lambda: it.app.theme == before)
        it.screen.action_do("theme")
        screen = await it.shows(Palette)
        await it.until(lambda: screen.current is not None)
        assert {command.kind for command in screen._commands} == {"theme"}
        seen = set()
        for _ in themes.THEMES:
            await it.until(lambda: screen.current is not None and it.app.theme == screen.current.theme)
            seen.add(it.app.theme)
            await it.press("down")
        assert seen == {theme.name for theme in themes.THEMES}
        await it.press("enter")
        await it.back()
        await it.pilot.pause(0.1)
        assert it.app.theme == themes.THEMES[-1].name

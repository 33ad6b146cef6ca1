"""Every key, twice, fast and slowly, on every screen and in every state: what is sent is what the screen said before.

A search (`./dev soak --search`) presses all keys in all states; `./dev test` some keys in a quarter of them.
"""

from __future__ import annotations

import string
from collections.abc import Awaitable, Callable
from contextlib import suppress
from itertools import product
from typing import NamedTuple

import pytest
from textual.widgets import Button, Input

from rise_engine.kernel.records import FailureRecord
from rise_tui.console.input import CHANGE_SECONDS
from rise_tui.model.control import action_of_key
from rise_tui.model.resumption import start_summary
from rise_tui.rendering.text import plain_text
from rise_tui.screens.palette import Palette
from rise_tui.widgets.lines import RowView
from tests.chance import SEARCH, some
from tests.tui.conftest import Console, NoConsole, console
from tests.tui.fake import FakeClient, demo

pytestmark = pytest.mark.slow

MEANT = ("enter", "backspace", "delete", "p", "b", "comma", "w")
"""Keys that start, stop or answer something somewhere."""
EVERY = (
    *string.ascii_letters,
    *string.digits,
    *("enter", "space", "backspace", "delete", "tab", "shift+tab", "insert", "left", "right", "up", "down", "home"),
    *("end", "pageup", "pagedown", "full_stop", "comma", "slash", "colon", "semicolon", "question_mark", "minus"),
    *("exclamation_mark", "underscore", "plus", "f2", "f3", "f4", "f7", "f8", "f9"),
    *(f"ctrl+{letter}" for letter in "deghjklnoprtuvwxy"),
)
KEYS = EVERY if SEARCH else MEANT


async def nothing(it: Console) -> None:
    """The console as it opens, with the acts in front."""
    await it.focus("acts")


def pane(name: str) -> Callable[[Console], Awaitable[None]]:
    async def opened(it: Console) -> None:
        await it.focus(name)

    return opened


def action(name: str) -> Callable[[Console], Awaitable[None]]:
    async def opened(it: Console) -> None:
        it.screen.action_do(name)
        await it.pilot.pause()

    return opened


async def memory_editor(it: Console) -> None:
    await it.focus("memory")
    it.screen.pane_layout.panes["memory"].carry_out("memory.edit")
    await it.pilot.pause()


SCREENS: dict[str, Callable[[Console], Awaitable[None]]] = {
    "acts": nothing,
    **{name: pane(name) for name in ("rules", "rule", "act", "memory", "log", "scheduler")},
    **{
        name: action(name)
        for name in ("help", "palette", "settings", "say", "note", "mistake", "filter", "jump", "quit")
    },
    "memory editor": memory_editor,
}


def running(client: FakeClient) -> None:
    client.act("Greet")


def failed(client: FakeClient) -> None:
    task = client.act("Praise", "ABORTED", reason="the robot cannot")
    client.emit(FailureRecord(0, 0.0, "", task, "Praise", "asked", "engine", reason="the robot cannot"))


def waiting_rule(client: FakeClient) -> None:
    client.rule("Main", "started", "greeting", trigger="start")


STATES: dict[str, Callable[[FakeClient], None]] = {
    "idle": lambda client: None,
    "running": running,
    "failed": failed,
    "a rule waits": waiting_rule,
    "stopped": lambda client: client.stop("latched", ("pepper/speech",)),
}


class Before(NamedTuple):
    """What a wizard could read before a key."""

    on_top: bool
    """Whether nothing covers the console, and no field takes letters."""
    in_palette: bool
    texts: str
    """All that is near the cursor, the hints and the notice."""
    said: str
    """What Enter would start, as the notice says."""


def look(it: Console) -> Before:
    top, focused = it.app.screen, it.app.focused
    store = it.screen.store
    texts = [it.notice, it.bars.key_hints.text, it.bars.key_strip.text, it.bars.mistake_line.text]
    rows = top.list if isinstance(top, Palette) else focused if isinstance(focused, RowView) else None
    if rows is not None and 0 <= rows.cursor < rows.count:
        texts.append(plain_text(rows.row_at(rows.cursor).line))
    if isinstance(focused, Input):
        texts.append(focused.value)
    if isinstance(focused, Button):
        texts.append(str(focused.label))
    said = start_summary(store, store.armed) if store.armed is not None else ""
    assert not said or (store.notice is not None and said in store.notice.text), "what is armed is named"
    return Before(top is it.screen and not isinstance(focused, Input), isinstance(top, Palette), "\n".join(texts), said)


def why_sent(it: Console, key: str, before: Before, sent: tuple[str, str]) -> str:
    """What on the screen announced it; empty: nothing did."""
    scenario, (function, behavior) = it.client.scenario, sent
    binding = scenario.keys.get(key)
    if before.on_top and binding is not None:
        meant = action_of_key(scenario, binding)
        if (meant.function, meant.behavior) == sent:
            return "a key of the study"
    if key == "enter" and before.said:
        return "the notice"
    fixed = {
        "stopAll": ("f9", "ctrl+g"),
        "markCue": ("space",),
        "nextFiller": ("comma",),
        "undoCue": ("underscore",),
        "repeatAct": ("ctrl+e",),
        "goOn": ("ctrl+k",),
        "releaseStop": ("ctrl+r",),
        "markMistake": ("exclamation_mark", *"wledu", "enter"),
    }
    if key in fixed.get(function, ()):
        return "a key of the console"
    named = behavior.strip("/") or function
    if function == "cancelTask" and key in ("backspace", "delete", "enter"):
        named = it.screen.store.view.tasks[int(behavior)].behavior
    starts_unarmed = function.startswith("start") and not before.in_palette
    if key in ("backspace", "delete", "enter", "ctrl+j") and named in before.texts and not starts_unarmed:
        return "the row, the hint or the field"
    if function in ("assignValue", "deleteValue") and key in ("enter", "delete", "ctrl+u"):
        return "the memory's editor"
    return ""


async def close_all(it: Console, opened: Callable[[Console], Awaitable[None]]) -> None:
    """Bring the screen back that is tried, with nothing armed."""
    for _ in range(6):
        with suppress(NoConsole):
            if it.app.screen is it.screen and not isinstance(it.app.focused, Input) and it.screen.store.armed is None:
                break
        await it.pilot.press("escape")
        await it.pilot.pause(0.05)
    if it.screen.store.input_mode == "LOCKED":
        await it.pilot.press("f7")
    if it.screen.store.input_mode == "SAFE":
        await it.pilot.press("ctrl+x")
    await it.pilot.pause(2 * CHANGE_SECONDS)
    await opened(it)


@pytest.mark.parametrize("pause", [0.02, 1.2], ids=["fast", "slow"])
@pytest.mark.parametrize(("screen", "state"), some(product(SCREENS, STATES), every=4))
async def test_what_is_sent_is_what_the_screen_said(screen: str, state: str, pause: float) -> None:
    opened = SCREENS[screen]
    unannounced = []
    async with console((120, 40), FakeClient(demo())) as it:
        STATES[state](it.client)
        await it.pilot.pause(0.3)
        for key in KEYS:
            if screen == "quit" and key in ("d", "enter", "space"):  # these detach
                continue
            await close_all(it, opened)
            for press in (1, 2):
                before, count = look(it), len(it.client.sent)
                await it.pilot.press(key)
                await it.pilot.pause(pause)
                for function, behavior in it.client.asked()[count:]:
                    if not why_sent(it, key, before, (function, behavior)):
                        unannounced.append(f"{key}, press {press}: {function} {behavior}\n{before.texts}")
    assert not unannounced, "\n\n".join(unannounced)

"""Help: made from the registry, found by any word, and entries stay whole."""

from __future__ import annotations

import pytest

from rise_tui.actions import ACTIONS, BY_ID, KEY_SCOPES
from rise_tui.key_labels import key_label, key_name, use_own_keys
from rise_tui.model.filtering import Filter
from rise_tui.model.store import Store
from rise_tui.rendering.text import line_width, plain_text
from rise_tui.screens.help import (
    HelpEntry,
    HelpScreen,
    concepts,
    help_entries,
    help_rows,
    screen_help_entries,
    searched_text,
)
from tests.tui.conftest import console
from tests.tui.fake import FakeClient, demo


def a_store() -> Store:
    client = FakeClient(demo())
    return Store(client.attach_reply(), "anna", client.now)


def found(entries_: list[HelpEntry], typed: str) -> list[HelpEntry]:
    return [entry for entry in entries_ if Filter(typed).matches(searched_text(entry))]


def test_every_action_is_there_once_with_all_its_keys() -> None:
    in_session = [entry for entry in help_entries(a_store(), "memory") if entry.title]
    between_sessions = [entry for entry in screen_help_entries("study") if entry.title]
    in_editor = [entry for entry in screen_help_entries("edit") if entry.title]
    for action in ACTIONS:
        all_of_them = {"study": between_sessions, "edit": in_editor}.get(action.scope, in_session)
        title = dict(KEY_SCOPES)[action.scope]
        own = [each for each in all_of_them if each.title == action.title and each.group in (title, f"Here: {title}")]
        assert len(own) == 1, action.id
        assert all(key_label(key) in own[0].keys for key in action.keys), action.id
        assert action.help in own[0].text


def test_the_focused_panes_actions_come_first() -> None:
    groups = list(dict.fromkeys(entry.group for entry in help_entries(a_store(), "rule")))
    assert groups[:4] == ["Here: Rule", "Always", "Console", "How it works"]
    assert "Rule" not in groups


def test_what_cannot_be_used_says_why() -> None:
    store = a_store()
    release = next(entry for entry in help_entries(store) if entry.title == BY_ID["release"].title)
    assert release.is_blocked and release.text.endswith("Not now: nothing is stopped or held.")
    store.gone_reason = "killed"
    greet = next(entry for entry in help_entries(store) if entry.title == "act Greet")
    assert greet.is_blocked and "Not now: the engine has gone: killed." in greet.text


def test_the_ideas_are_explained_with_the_keys_that_they_have() -> None:
    said = dict(concepts())
    words = {"^X", "LIVE", "SAFE", "LOCKED", "STOPPED", "sent", "hold", "cue", "filler", "mistake", "control"}
    words |= {"next", "NOT SAID"}
    assert set(said) == words
    for word, id in (("SAFE", "safe"), ("LOCKED", "lock"), ("cue", "cue"), ("mistake", "mistake")):
        assert key_name(id) in said[word]


def test_a_users_own_keys_are_shown() -> None:
    use_own_keys({"cue": ("f5",)})
    try:
        assert "Press F5 when" in dict(concepts())["cue"]
        assert next(entry for entry in help_entries(a_store()) if entry.title == BY_ID["cue"].title).keys == "F5"
    finally:
        use_own_keys({})


def test_an_entry_of_several_lines_is_found_whole_by_a_word_in_its_last_one() -> None:
    every = list(help_entries(a_store()))
    only = found(every, "early double goes on only")
    assert [entry.keys for entry in only] == ["mistake"]
    lines = [plain_text(row.line) for row in help_rows(only, 70)]
    assert lines[0].strip() == "How it works" and len(lines) > 2
    assert "mistake" in lines[1] and "record changes" in " ".join(lines[2:])


@pytest.mark.parametrize("width", [60, 76, 98])
def test_no_line_is_wider_than_the_list_and_nothing_is_lost(width: int) -> None:
    every = list(help_entries(a_store(), "log"))
    made = help_rows(every, width)
    assert all(line_width(row.line) <= width for row in made)
    shown = " ".join(" ".join(plain_text(row.line) for row in made).split())
    for entry in every:
        for word in entry.text.split():
            assert word in shown


def test_nothing_found_says_so() -> None:
    assert "nothing found" in plain_text(help_rows([], 80)[0].line)


# --- on the screen --------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_it_opens_searches_scrolls_and_closes() -> None:
    async with console(size=(80, 24)) as it:
        for size in ((80, 24), (120, 40)):
            await it.pilot.resize_terminal(*size)
            await it.focus("memory")
            await it.press("question_mark")
            screen = await it.shows(HelpScreen)
            await it.until(lambda screen=screen: "Stop everything" in screen.list.text)  # type: ignore[misc]
            assert "act Greet" in screen.list.text
            assert screen.list.text.splitlines()[0].strip() == "Here: Memory"
            assert screen.list.region.right <= size[0] and screen.list.region.bottom <= size[1]
            await it.press("pagedown", "down")
            assert screen.list.scroll_offset.y > 1
            await it.press("slash", "left_parenthesis")  # half a regular expression
            assert "Stop everything" in screen.list.text
            await it.press("backspace", "backspace", *"zoom")
            await it.until(lambda screen=screen: "Gives the focused list" in screen.list.text)  # type: ignore[misc]
            assert "Stop everything" not in screen.list.text and screen.list.scroll_offset.y == 0
            await it.press("escape")
            assert it.app.screen is it.screen and it.client.sent == []

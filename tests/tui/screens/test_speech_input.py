"""Free speech: typed, completed, shown as it will be said, sent, and kept when it was not taken."""

from __future__ import annotations

from time import monotonic
from typing import Any

import pytest
from textual import events
from textual.widgets import Input

from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import SessionView
from rise_tui.model.speech import (
    FilledSpeech,
    SpeechHistory,
    complete_speech,
    fill_speech,
    scenario_sentences,
    speech_effect,
)
from rise_tui.widgets.speech_input import SpeechField
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo

# --- pure -----------------------------------------------------------------------------------------------------------


def test_the_sentences_of_a_scenario() -> None:
    assert scenario_sentences(demo()) == (
        "Hello {person|you}!", "Please put the fork to the {side}.", "Well done.", "Goodbye!", "Hm.",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("typed", "going_on"),
    [
        ("", ""),
        (" ", ""),
        ("Ple", "Please put the fork to the {side}."),
        ("ple", "please put the fork to the {side}."),  # as typed, then as written
        ("Well", "Well, that is it."),  # said before goes before the scenario
        ("Well d", "Well done."),
        ("Well done.", ""),
        ("Nothing", ""),
        ("To the {s", "To the {side}"),
        ("To the {", "To the {side}"),
        ("To the {x", ""),
        ("To the {side}", ""),
    ],
)
def test_how_a_sentence_may_go_on(typed: str, going_on: str) -> None:
    sentences = ["Well, that was it.", "Well, that is it."]
    assert complete_speech(typed, sentences, scenario_sentences(demo()), {"task", "side"}) == going_on


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("Hello", FilledSpeech("Hello")),
        ("  Hello ", FilledSpeech("Hello")),
        ("{n} of {list}", FilledSpeech("4 of [1, 2]")),
        ("{nobody|you}", FilledSpeech("you")),
        ("{{n}}", FilledSpeech("{n}")),
        ("{n", FilledSpeech(problem="a `{` without its `}`; write `{{` for the character itself")),
        (
            "{nobody}!",
            FilledSpeech(problem="nobody has no value in the memory; write {nobody|something} or set it"),
        ),
        ("{empty}", FilledSpeech("")),
    ],
)
def test_what_will_be_said(typed: str, expected: FilledSpeech) -> None:
    assert fill_speech(typed, {"n": 4.0, "list": [1, 2], "empty": " "}) == expected


def test_the_history_goes_back_and_forth_and_keeps_the_draft() -> None:
    history = SpeechHistory(["one", "two", "one"])
    assert history.sentences == ["two", "one"]
    assert history.earlier("draft") == "one"
    assert history.earlier("one") == "two"
    assert history.earlier("two") == "two"
    assert history.later("two") == "one"
    assert history.later("one") == "draft"
    assert history.later("draft") == "draft"
    assert SpeechHistory().earlier("draft") == "draft"


def task(id: int, act: str, calling_type: str = "Blocking", function: str = "startCommunicationRobotAct") -> TaskView:
    return TaskView(id, function, act, calling_type, "wizard:anna", "ACTIVE", "", 0.0)


@pytest.mark.parametrize(
    ("running", "waiting", "expected"),
    [
        ([], [], ("", "")),
        ([task(1, "Greet")], [], ("waits for Greet", "interrupts Greet")),
        ([task(1, "Greet")], [task(2, "Praise")], ("waits for Greet and 1 more", "interrupts Greet")),
        ([], [task(2, "Praise")], ("waits for Praise", "")),
        ([task(1, "Filler", "None")], [], ("interrupts Filler", "interrupts Filler")),
        ([task(1, "Filler", "None")], [task(2, "Praise")], ("waits for Praise", "interrupts Filler")),
        ([task(1, "Hello", "Blocking", "say")], [], ("waits for “Hello”", "interrupts “Hello”")),
    ],
)
def test_what_speaking_now_would_do(running: list[TaskView], waiting: list[TaskView], expected: Any) -> None:
    view = SessionView(tasks={each.id: each for each in (*running, *waiting)})
    view.running, view.waiting = [each.id for each in running], [each.id for each in waiting]
    assert speech_effect(demo(), view) == expected


# --- on the screen --------------------------------------------------------------------------------------------------


def preview(it: Console) -> str:
    return it.bars.speech_input.preview.text


def shown(it: Console) -> str:
    return it.bars.speech_input.shown.text


def sentences(client: FakeClient) -> list[tuple[str, str]]:
    return [(message.behavior, message.calling_type) for message in client.sent if message.function == "say"]


@pytest.mark.slow
async def test_what_is_shown_is_said_in_its_turn_or_at_once() -> None:
    async with console(size=(80, 24)) as it:
        line = it.bars.speech_input
        assert "say > ctrl+t to type" in shown(it) and line.size.height == 1
        for key, calling_type in (("enter", "Blocking"), ("ctrl+j", "Interrupt")):
            await it.press("ctrl+t", *"To the ", "left_curly_bracket", *"si", "tab")
            await it.until(lambda: "will say  “To the left”" in preview(it))
            assert line.field.value == "To the {side}" and line.size.height == 2
            before = it.client.now()
            await it.press(key)
            await it.sent("say", "To the left")
            assert sentences(it.client) == [("To the left", calling_type)]
            assert it.client.sent[-1].pressed == pytest.approx(before, abs=0.5)
            await it.until(lambda: it.pane("acts").row_view.has_focus)
            assert not line.is_open
            it.client.sent.clear()
        await it.press("ctrl+t", *"Hello ", "left_curly_bracket", *"nobody", "right_curly_bracket")
        await it.until(lambda: "cannot be said: nobody has no value" in preview(it))
        await it.press("enter", "ctrl+j")
        await it.pilot.pause(0.1)
        assert it.client.asked() == [] and line.is_open
        line.field.value = ""
        await it.press(*"gmnp", "space", "comma", "exclamation_mark")
        await it.pilot.pause(0.1)
        assert it.client.asked() == [] and line.field.value == "gmnp ,!", "letters in the field start nothing"
        for key in ("a", "b", "enter"):
            it.screen.input.observe_key(key, monotonic(), typing=True, together=True)
        line.field.value = "ab"
        line.submit(at_once=False)
        await it.until(lambda: "too fast to be typed" in it.notice)
        assert it.client.asked() == [] and line.field.value == "ab", "a pasted line end says nothing"
        await it.pilot.pause(1)
        await it.press("escape", "ctrl+x")
        await it.until(lambda: it.screen.session.store.input_mode == "SAFE")
        await it.press("ctrl+t", "enter")
        await it.until(lambda: "not said: SAFE" in it.notice)
        assert sentences(it.client) == [] and line.field.value == "ab"


@pytest.mark.slow
async def test_it_is_sent_until_the_engine_answers_and_then_what_the_robot_does() -> None:
    client = FakeClient(demo())
    client.answers = False
    async with console(client=client, size=(80, 24)) as it:
        await it.press("ctrl+t", *"Hi", "enter")
        await it.until(lambda: "↑ sent  “Hi”" in shown(it))
        id = client.task("say", "Hi", "PENDING", ref=client.sent[0].ref)
        await it.until(lambda: "○ waiting  “Hi”" in shown(it))
        client.task_record(id, "say", "Hi", "ACTIVE")
        client.time += 1.2
        await it.until(lambda: "► running 1.2 s  “Hi”" in shown(it))
        client.task_record(id, "say", "Hi", "SUCCEEDED")
        await it.until(lambda: "✓ said  “Hi”" in shown(it))
        client.time += 6
        await it.until(lambda: "ctrl+t to type" in shown(it))
        client.answer()
        await it.pilot.pause()
        client.reject = "the robot cannot speak"
        await it.press("ctrl+t", *"Hi", "enter")
        await it.until(lambda: "say Hi was rejected: the robot cannot speak" in it.notice)
        await it.until(lambda: "Hi   not said; ctrl+t shows it again" in shown(it))
        await it.press("ctrl+t")
        assert it.bars.speech_input.field.value == "Hi", "what was rejected is still there"
        await it.press("escape", "f2", "ctrl+t", "end", *" Ada", "escape")
        await it.until(lambda: "Hi Ada   not said" in shown(it))
        await it.press("ctrl+t", *"Bye", "escape")
        await it.until(lambda: "Bye   not said" in shown(it), "what is typed replaces what was kept")
        assert it.pane("rules").row_view.has_focus, "where the focus was before"


@pytest.mark.slow
async def test_earlier_speech_also_that_of_another_console_and_what_both_keys_do() -> None:
    client = FakeClient(demo())
    client.task("say", "Once upon a time", "SUCCEEDED", source="wizard:ben")
    async with console(client=client) as it:
        await it.press("ctrl+t", *"Hi", "enter")
        await it.sent("say", "Hi")
        await it.press("ctrl+t", "x", "up")
        field = it.bars.speech_input.field
        assert field.value == "Hi"
        await it.press("up")
        assert field.value == "Once upon a time"
        await it.press("down", "down")
        assert field.value == "x"
        await it.press("backspace", *"Onc")
        await it.press("tab")
        assert field.value == "Once upon a time"
        client.task_record(2, "say", "Hi", "SUCCEEDED")
        long, title = client.task("say", "A" * 60, "ACTIVE"), it.pane("acts").title
        await it.until(lambda: "► “AAAA" in title.text and " s" in title.text, "what is said now stands over the acts")
        client.task_record(long, "say", "A" * 60, "SUCCEEDED")
        it.client.act("Greet")
        await it.until(lambda: "enter waits for Greet  ^J interrupts it" in it.bars.key_hints.text)
        assert "F9/^G STOP" in it.bars.key_hints.text
        it.client.act("Praise", "PENDING")
        await it.until(lambda: "enter waits for Greet and 1 more  ^J interrupts Greet" in it.bars.key_hints.text)


async def press_at_once(it: Console, *keys: str) -> None:
    """Nothing waits between these keys, but they were pressed one after the other."""
    at = monotonic()
    for number, key in enumerate(keys):
        event = events.Key(key, key if len(key) == 1 else None)
        event.time = at + 0.05 * number
        it.app.post_message(event)
    await it.pilot.pause(0.3)


@pytest.mark.slow
async def test_a_busy_console_starts_nothing_that_was_meant_for_a_line() -> None:
    async with console() as it:
        focused: list[object] = []

        def taken() -> bool:
            done = it.screen.handle_key_first(events.Key("ctrl+t", None))
            focused.append(it.screen.focused)
            return done

        await it.until(taken)
        assert isinstance(focused[-1], SpeechField), "the very next key goes into the field"
        await it.press("g", "m")
        assert it.bars.speech_input.field.value == "gm" and it.client.asked() == []
        it.bars.speech_input.field.value = ""
        await it.press("escape")
        it.client.act("Greet", source="wizard:anna")
        await it.until(lambda: "running" in it.row("acts", "Greet"))
        for key in ("ctrl+t", "ctrl+o"):
            for before in ((), ("b",), ("exclamation_mark",)):  # at rest, armed, marking
                await it.pilot.pause(5)
                await press_at_once(it, *before, key, "p", "m")
                assert {function for function, _ in it.client.asked()} <= {"markMistake"}, (key, before)
                field = it.screen.focused
                assert isinstance(field, Input) and field.value == "pm"
                field.value = ""
                await it.press("escape")
        it.client.sent.clear()
        await it.pilot.pause(5)
        await press_at_once(it, "exclamation_mark", "l")
        assert {function for function, _ in it.client.asked()} == {"markMistake"}
        it.client.sent.clear()
        await it.pilot.pause(5)
        for key in ("f", "exclamation_mark", "colon", "space", "g", "enter"):  # pasted
            it.app.post_message(events.Key(key, {"exclamation_mark": "!", "colon": ":", "space": " "}.get(key, key)))
        await it.until(lambda: "several keys at once" in it.notice)
        await it.pilot.pause(0.2)
        assert it.client.asked() == [] and it.app.screen is it.screen and not it.bars.mistake_line.is_open

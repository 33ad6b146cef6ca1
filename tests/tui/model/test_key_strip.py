"""The strip of the study's own keys: all kinds, awaited ones first, in the author's words, and nothing jumps."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.author.drawing.study_keys import StudyKeys, key_title
from rise_engine.kernel.records import MemoryRecord
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import KeyBinding, Scenario
from rise_tui.model.key_strip import key_strip_height, key_strip_lines
from rise_tui.model.store import Store
from rise_tui.rendering.text import line_width, plain_text
from rise_tui.screens.help import HelpScreen
from tests.tui.conftest import console
from tests.tui.fake import FakeClient, demo

SCENARIOS = Path(__file__).parents[3] / "scenarios"


def scenario(name: str) -> Scenario:
    found = load(str(SCENARIOS / name)).scenario
    assert found is not None
    return found


def store_of(of: Scenario, client: FakeClient | None = None) -> Store:
    client = client or FakeClient(of)
    return Store(client.attach_reply(), "anna", client.now)


def shown(store: Store, width: int = 80, rows: int = 2) -> list[str]:
    found = key_strip_lines(store, width, rows)
    assert len(found.lines) == rows and all(line_width(line) <= width for line in found.lines)
    for key, line, start, end in found.pieces:
        if key is not None:
            assert plain_text(found.lines[line])[start:end].split()[0].lstrip("◇►↑").startswith(key.label)
    return [plain_text(line).rstrip() for line in found.lines]


@pytest.mark.parametrize(
    ("function", "behavior", "label", "title"),
    [
        ("raiseEventTopic", "/not_understood", "", "not understood"),
        ("raiseEventTopic", "/gaze/robot", "", "gaze robot"),
        ("raiseEventTopic", "/understood", "got it", "got it"),
        ("assignValue", "understood = true", "", "understood"),
        ("assignValue", "understood = false", "", "not understood"),
        ("assignValue", "mood = 'good'", "", "mood good"),
        ("assignValue", "marks[0] = true", "", "marks[0]"),
        ("assignValue", "marks[i] = 'late'", "", "marks[i] = 'late'"),
        ("assignValue", "person_y = 0.5", "", "person y 0.5"),
        ("assignValue", "n = n + 1", "", "n = n + 1"),
        ("startInteractionRule", "Next", "", "Next"),
        ("startCommunicationRobotAct", "R_Task1_Intro", "", "Task1 Intro"),
        ("startCommunicationRobotAct", "R_", "", "R_"),
        ("stopCommunicationRobotAct", "R_Hum", "", "stop Hum"),
    ],
)
def test_what_a_key_is_called(function: str, behavior: str, label: str, title: str) -> None:
    assert key_title(KeyBinding("x", "x", function, behavior, title=label)) == title  # type: ignore[arg-type]


def test_keys_that_a_rule_may_wait_for_lead_then_events_values_and_rules_then_acts_in_the_order_of_the_file() -> None:
    keys = StudyKeys(demo())
    assert [key.label for key in keys.answer_keys] == ["n", "a"]
    assert [key.label for key in keys.other_keys] == ["m", "u"]
    assert [key.label for key in keys.act_keys] == ["g", "p", "b", "."]
    line = " n next  a Again  m Main  u understood  g Greet  p Praise  b Goodbye  . Filler"
    assert shown(store_of(demo()), 200, 1) == [line]


def test_a_rule_that_only_answers_itself_is_not_waited_for() -> None:
    """LabLinking's main rule raises events that choose its own first state."""
    assert [key.label for key in StudyKeys(scenario("lablinking")).answer_keys] == ["n", "r"]


def test_awaited_keys_are_marked_and_come_first_and_the_others_do_not_move() -> None:
    client = FakeClient(demo())
    for key, value in (("task", 4), ("understood", True)):
        client.emit(MemoryRecord(0, 0.0, "", key, value, None, "wizard:anna"))
    before = shown(store_of(demo(), client))[0]
    client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
    after = shown(store_of(demo(), client))[0]
    assert after.startswith("◇n next ◇a Again ►m Main")
    assert before.replace(" ", "") == after.replace(" ", "").replace("◇", "").replace("►", "")
    assert before.index("m Main") == after.index("m Main")


def test_of_several_answers_the_awaited_ones_come_first() -> None:
    client = FakeClient(scenario("greeting"))
    client.rule("Greeting", "entered", "Nobody", previous="Start", trigger="not person_near", transition=1)
    nobody = shown(store_of(client.scenario, client), 120)
    assert [piece.split()[0] for piece in nobody[0].split("◇")[1:]] == ["x", "a"]
    client.emit(MemoryRecord(0, 0.0, "", "person_near", True, False, "wizard:anna"))
    client.rule("Greeting", "entered", "Visitor is here", previous="Visitor comes", trigger="x", transition=1)
    here = shown(store_of(client.scenario, client), 120)
    assert here[0].startswith("◇w goes away")
    first = client.scenario.keys["1"].title
    assert nobody[0].find(first) == here[0].find(first) and nobody[1].find(first) == here[1].find(first)


def test_an_act_that_a_rule_waits_for_and_that_does_not_run_comes_first_too() -> None:
    client = FakeClient(demo())
    client.rule("Main", "started", "greeting", trigger="start")
    assert shown(store_of(demo(), client))[0].startswith("◇g Greet ")
    client.act("Greet")
    assert shown(store_of(demo(), client))[0].startswith(" n next ")


def test_what_cannot_be_used_is_dimmed_and_what_there_is_no_room_for_is_counted() -> None:
    store = store_of(scenario("lablinking"))
    lines = shown(store)
    assert lines[1].endswith(" more ?")
    left = int(lines[1].split("+")[1].split()[0])
    keys = [piece for piece in key_strip_lines(store, 80, 2).pieces if piece.key is not None]
    assert len(keys) + left == len(store.scenario.keys)
    store.input_mode = "SAFE"
    off = {role for text, role in key_strip_lines(store, 80, 2).lines[0] if text.strip() and "understood" not in text}
    assert (
        "key" not in {role for text, role in key_strip_lines(store, 80, 2).lines[0] if text == "n"} and "muted" in off
    )


@pytest.mark.parametrize("name", ["lablinking", "lab_opening"])
@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 40), (200, 50)])
def test_every_key_that_starts_no_act_is_there_at_every_size(name: str, width: int, height: int) -> None:
    of = scenario(name)
    store = store_of(of)
    rows = key_strip_height(of, store.study_keys, width, height)
    there = {piece.key.key for piece in key_strip_lines(store, width, rows).pieces if piece.key is not None}
    wanted = {key.key for key in of.keys.values() if key.function != "startCommunicationRobotAct"}
    assert rows <= 2 and len(wanted - there) <= (4 if (name, width) == ("lab_opening", 80) else 0)


def test_a_scenario_without_keys_has_no_strip() -> None:
    from msgspec.structs import replace

    of = replace(demo(), keys={})
    assert key_strip_height(of, StudyKeys(of), 80, 24) == 0 and key_strip_lines(store_of(of), 80, 0).pieces == ()


async def test_a_key_in_the_strip_can_be_clicked_and_the_rest_opens_help() -> None:
    async with console(size=(70, 24)) as it:
        bar = it.bars.key_strip
        x = bar.text.index("n next")
        await it.pilot.click(bar, offset=(x, 0))
        await it.sent("raiseEventTopic", "/next")
        await it.press("ctrl+x")
        await it.pilot.click(bar, offset=(x, 0))
        await it.until(lambda: "SAFE" in it.notice)
        assert it.client.asked().count(("raiseEventTopic", "/next")) == 1
        lines = bar.text.splitlines()
        y = next(at for at, line in enumerate(lines) if "more ?" in line)
        await it.pilot.click(bar, offset=(lines[y].index("more"), y))
        await it.until(lambda: isinstance(it.app.screen, HelpScreen))

"""Why a rule stays where it stands, in words: what is waited for, what is true of it, and what the wizard can do."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace
from rich.cells import cell_len

from rise_engine.author.drawing.rule_text import split_condition
from rise_engine.expression import Expression
from rise_engine.kernel.records import CountdownRecord, KeptRecord, MemoryRecord
from rise_engine.scenario.model import Delay, KeyBinding, Rule, Scenario, State, Table, Transition
from rise_tui.model.store import Store
from rise_tui.model.wait_explanations import READABLE, WaitExplanations
from rise_tui.rendering.text import plain_text
from tests.tui.fake import FakeClient, demo


def way(
    event: str | None = None, condition: str = "", *, after: float | None = None, target: str | None = "b"
) -> Transition:
    return Transition(
        event,
        Expression.parse(condition) if condition else None,
        after=Delay("", after) if after is not None else None,
        target=target,
    )


def scene(*ways: Transition, **rules: Rule) -> Scenario:
    """The demo with one rule that stands in `a`, further rules by name, and a key that sets `understood`."""
    own = Rule("R", "a", {"a": State("a", transitions=ways), "b": State("b")})
    keys = {
        **demo().keys,
        "u": KeyBinding("u", "u", "assignValue", "understood = true"),
        "x": KeyBinding("x", "x", "assignValue", "understood = false"),
    }
    return replace(demo(), rules={"R": own, **rules}, keys=keys)


class Scene:
    def __init__(self, scenario: Scenario) -> None:
        self.client = FakeClient(scenario)
        self.client.rule("R", "entered", "a", previous=None, trigger="start")

    def set(self, key: str, value: Any) -> None:
        self.client.emit(MemoryRecord(0, 0.0, "", key, value, None, "wizard:anna"))

    @property
    def store(self) -> Store:
        return Store(self.client.attach_reply(), "anna", self.client.now)

    def said(self, width: int = 90) -> list[str]:
        store = self.store
        rule = store.scenario.rules["R"]
        rows = WaitExplanations(store).rows(rule, rule.states["a"], store.rule("R"), width)
        assert all(cell_len(plain_text(row.line)) <= width for row in rows)
        return [" ".join(plain_text(row.line).split()) for row in rows]

    def counts(self) -> bool:
        store = self.store
        return WaitExplanations(store).changes_with_time(store.scenario.rules["R"].states["a"])


# --- parts ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "joint", "parts"),
    [
        ("task = 4", "", ["task = 4"]),
        ("task = 4 and understood", "and", ["task = 4", "understood"]),
        ("task = 4 && understood && not tired", "and", ["task = 4", "understood", "not tired"]),
        ("a or b and c", "or", ["a", "b and c"]),
        ("(a or b) and c", "and", ["(a or b)", "c"]),
        ("((a and b))", "and", ["a", "b"]),
        ('name = "this and that" and (x > 1 or y)', "and", ['name = "this and that"', "(x > 1 or y)"]),
        ("a xor b", "", ["a xor b"]),
        ("not (a and b)", "", ["not (a and b)"]),
        ("android or oracle", "or", ["android", "oracle"]),
        ("(a and b) and c", "and", None),
        ("defined(list[a and b]) and c", "and", ["defined(list[a and b])", "c"]),
        ("defined(list[(a or b)][a or b]) or c", "or", ["defined(list[(a or b)][a or b])", "c"]),
    ],
)
def test_a_condition_in_its_parts(text: str, joint: str, parts: list[str] | None) -> None:
    whole = Expression.parse(text)
    found = split_condition(whole)
    assert found.joint == joint
    if parts is not None:
        assert [part.text for part in found.parts] == parts
    for a in (False, True):
        for b in (False, True):
            for c in (False, True):
                memory = {"a": a, "b": b, "c": c, "task": 4, "name": "", "x": 1, "y": a, "understood": b, "tired": c}
                truths = [part.as_condition(memory) for part in found.parts]
                joined = any(truths) if joint == "or" else all(truths)
                assert joined == whole.as_condition(memory)


# --- what is waited for ---------------------------------------------------------------------------------------------


def test_an_event_with_its_key_and_its_target() -> None:
    it = Scene(scene(way("next")))
    assert it.said() == ["waits for event next you: n → b"]
    assert it.said(24) == ["waits for even… you: n", "→ b"], "the key is not lost"
    assert not it.counts()
    assert Scene(scene(way("nobody_knows", target=None))).said() == ["waits for event nobody_knows stays"]


def test_a_condition_part_by_part_with_the_key_that_would_make_it_true() -> None:
    it = Scene(scene(way("next", "task = 4 and understood")))
    it.set("task", 2)
    it.set("understood", False)
    assert it.said() == [
        "waits for event next you: n not now → b",
        "if task = 4 task is 2 false",
        "and understood you: u false",
    ]
    it.set("understood", True)
    assert it.said()[2] == "and understood true"
    it.set("task", 4)
    assert it.said()[0] == "waits for event next you: n → b"
    assert it.said()[1] == "if task = 4 task is 4 true"


def test_a_part_of_a_value_with_the_keys_that_would_make_it_right() -> None:
    scenario = scene(way(None, "items[task].id = 2 and marks[0] and length(items) > 9"))
    keys = {**scenario.keys, "m": KeyBinding("m", "m", "assignValue", "marks[0] = true")}
    table = Table("items", ("id", "text"), [[number, "x"] for number in range(1, 31)])
    it = Scene(replace(scenario, keys=keys, tables={"items": table}))
    it.set("task", 0)
    it.set("marks", [False])
    assert it.said() == [
        "waits for its condition alone → b",
        "if items[task].id = 2 items[task].id is 1, task is 0 false",
        "and marks[0] marks[0] is false you: m false",
        "and length(items) > 9 items is a list of 30 true",
    ]
    it.set("task", 99)
    said = it.said()
    assert said[1] == "if items[task].id = 2 task is 99 error"
    assert said[2].startswith("missing-part: `items` has the entries 0 to 29, and no 99")


def test_a_condition_that_cannot_be_evaluated_says_so() -> None:
    it = Scene(scene(way("next", "task > 4")))
    it.set("task", "two")
    said = it.said()
    assert "not now" in said[0] and said[1] == "if task > 4 task is two error"
    assert said[2].startswith("cannot order the text")


def test_in_little_room_values_have_a_row_of_their_own() -> None:
    it = Scene(scene(way("next", "a_long_name_of_a_key = 4")))
    it.set("a_long_name_of_a_key", 2)
    assert it.said(40)[-2:] == ["if a_long_name_of_a_key = 4 false", "a_long_name_of_a_key is 2"]


def test_the_two_ends_of_a_row_stay_near_each_other() -> None:
    it = Scene(scene(way("next", "task = 4")))
    store = it.store
    rule = store.scenario.rules["R"]
    rows = WaitExplanations(store).rows(rule, rule.states["a"], store.rule("R"), 200)
    assert max(cell_len(plain_text(row.line)) for row in rows) == READABLE


def test_the_result_of_a_rule_is_told_as_what_it_is() -> None:
    task = Rule("Task", "Doing", {"Doing": State("Doing", transitions=(way("next"),)), "Done": State("Done")})
    it = Scene(scene(way("Task_Done"), Task=task))
    assert it.said() == ["waits for the rule Task to end in Done · ready → b"]
    keys = {**it.store.scenario.keys, "t": KeyBinding("t", "t", "startInteractionRule", "Task")}
    it = Scene(replace(scene(way("Task_Done"), Task=task), keys=keys))
    assert it.said() == ["waits for the rule Task to end in Done · ready you: t → b"]
    it.client.rule("Task", "entered", "Doing", previous=None, trigger="start")
    assert it.said()[0].startswith("waits for the rule Task to end in Done ► running → b")
    assert Scene(scene(way("Task_Doing"), Task=task)).said()[0].startswith("waits for event Task_Doing"), "no end"
    assert Scene(scene(way("Task_end"), Task=task)).said()[0].startswith("waits for Task to end ·")


def test_time_counts_down() -> None:
    it = Scene(scene(way(after=90.0)))
    assert it.counts()
    assert it.said() == ["waits for 90 s to pass 1:30 left → b"]
    it.client.time += 61.5
    assert it.said() == ["waits for 90 s to pass 29 s left → b"]
    it.client.time += 29
    assert it.said() == ["waits for 90 s to pass the time is up → b"]


def test_what_holds_a_time_up() -> None:
    quiet = Transition(after=Delay("8s", 8.0), held=Expression.parse("not talks and not cue"), target="b")
    it = Scene(scene(quiet))
    it.set("talks", True)
    it.set("cue", False)
    assert it.said() == [
        "waits for its condition to hold for 8 s held up: talks is true → b",
        "while not talks talks is true false",
        "and not cue cue is false true",
    ]
    it.set("talks", False)
    it.client.emit(CountdownRecord(0, 0.0, "", "R", "a", 0, "began", 8.0))
    it.client.time += 3
    assert it.said()[0] == "waits for its condition to hold for 8 s 5 s left → b" and it.counts()
    it.client.emit(CountdownRecord(0, 0.0, "", "R", "a", 0, "broken"))
    assert "held up" in it.said()[0]


def test_a_computed_time() -> None:
    it = Scene(scene(Transition(after=Delay("{pause}", None, Expression.parse("pause")), target="b")))
    it.client.emit(CountdownRecord(0, 0.0, "", "R", "a", 0, "began", 2.5))
    it.client.time += 1
    assert it.said() == ["waits for {pause} to pass 2 s left → b"]
    it.client.rule("R", "entered", "a", previous="a", trigger="x")
    it.client.emit(CountdownRecord(0, 0.0, "", "R", "a", 0, "failed", None, "`{pause}` is null, which is not a time"))
    assert it.said() == ["waits for {pause} to pass never: `{pause}` is null, which is not a time → b"]


def test_what_is_kept() -> None:
    it = Scene(
        replace(scene(way("next")), keys={"u": KeyBinding("u", "u", "raiseEventTopic", "/understood", keep=2.0)})
    )
    it.client.emit(KeptRecord(0, 0.0, "", 5, "/understood", "kept", 2.0))
    it.client.time += 0.5

    def kept() -> list[str]:
        return [" ".join(plain_text(row.line).split()) for row in WaitExplanations(it.store).kept_rows(80)]

    assert kept() == ["kept understood 2 s you: u undoes"]
    it.client.emit(KeptRecord(0, 0.0, "", 5, "/understood", "taken", rule="R"))
    assert kept() == []


def test_what_the_awaited_act_does() -> None:
    it = Scene(scene(way("Greet_end")))
    assert it.said() == ["waits for Greet to end · ready you: g → b"] and not it.counts()
    it.client.act("Greet")
    it.client.time += 1.5
    assert it.said()[0].startswith("waits for Greet to end ► running 1.5 of ") and "you:" not in it.said()[0]
    assert it.counts()
    narrow = it.said(34)
    assert narrow[0] == "waits for Greet to end" and narrow[1].startswith("→ b ► running 1.5 of "), "nothing is lost"


# --- who else takes it ----------------------------------------------------------------------------------------------


def test_a_rule_higher_on_the_stack_takes_the_event_first() -> None:
    other = Rule("Top", "t", {"t": State("t", transitions=(way("next", "task = 4"),))})
    it = Scene(scene(way("next"), Top=other))
    it.set("task", 4)
    assert len(it.said()) == 1, "it does not run"
    it.client.rule("Top", "entered", "t", previous=None, trigger="start")
    assert it.said()[1] == "rule Top takes this event first: it is higher on the stack"
    it.set("task", 2)
    assert len(it.said()) == 1, "its condition does not hold"
    it.set("task", 4)
    it.client.rule("R", "entered", "a", previous="b", trigger="x")
    assert len(it.said()) == 1, "it is lower now"


def test_a_way_above_takes_the_event_first() -> None:
    it = Scene(scene(way("next", "task = 4"), way("next", target="a")))
    it.set("task", 2)
    assert "the transition above takes this event first" not in it.said()
    it.set("task", 4)
    assert it.said()[-1] == "the transition above takes this event first"


def test_the_end() -> None:
    assert Scene(scene()).said() == ["no transition: the rule ends here"]

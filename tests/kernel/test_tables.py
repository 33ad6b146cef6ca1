"""Tables and parts of values while a session runs: records, watchers, endings, snapshots (semantics.md 7.3, 8.4)."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.kernel.records import ActionRecord, ConditionRecord, MemoryRecord, NoteRecord
from rise_engine.kernel.rng import Rng

from .harness import Session, dialog, read, speech, view_of, write
from .test_rules import do, on, put, rule, state

ITEMS = "id,text,condition\n1,one,A\n2,two,B\n3,,A\n"
MEMORY: dict[str, Any] = {"i": 0, "n": 0, "scores": {}, "order": [2, 1, 0], "marks": [{"done": False}, {"done": False}]}


def session(tmp_path: Path, rules: str = "", acts: str = "", tables: dict[str, str] | None = None) -> Session:
    folder = write(tmp_path, rules=rules, acts=acts, memory=MEMORY, tables=tables or {"items": ITEMS})
    return Session(read(folder))


def waiting(condition: str, way: str = "") -> str:
    """A rule that leaves its first state as soon as a condition holds."""
    return rule("R", state("a", "", f'<transition cond="{condition}" target="b"/>{way}'), state("b", "", on("/x", "a")))


def conditions(s: Session) -> list[tuple[dict[str, Any], bool, str]]:
    return [(each.values, each.result, each.error) for each in s.records if isinstance(each, ConditionRecord)]


def test_a_table_is_memory_without_a_record(tmp_path: Path) -> None:
    s = session(tmp_path)
    assert s.memory["items"][1] == {"id": 2, "text": "two", "condition": "B"}
    assert "items" not in {each.key for each in s.records if isinstance(each, MemoryRecord)}
    view = view_of(s)
    assert set(view.memory) == set(MEMORY)


RECORDED = {
    "items[i].condition = 'A'": ({"i": 0, "items[i].condition": "A"}, True),
    "length(items) = 3": ({"items": "3 rows x 3 columns"}, True),
    "items[order[i]].id = 3": ({"i": 0, "items[order[i]].id": 3, "order[i]": 2}, True),
    "items[i + 1] = items[1]": ({"i": 0, "items[1]": {"id": 2, "text": "two", "condition": "B"}}, True),
    "items.1.text = 'two'": ({"items.1.text": "two"}, True),
    "i > 5 and items[i].id = 1": ({"i": 0}, False),
    "items[i].text and order[i] = n": ({"i": 0, "items[i].text": "one", "n": 0, "order[i]": 2}, False),
    "marks[i] = items[i].id": ({"i": 0, "items[i].id": 1, "marks[i]": {"done": False}}, False),
    "not defined(items[i + 9])": ({"i": 0, "items[i + 9]": None}, True),
    "order contains 2": ({"order": [2, 1, 0]}, True),
}


@pytest.mark.parametrize(("text", "expected"), RECORDED.items())
def test_a_condition_records_what_it_has_read(tmp_path: Path, text: str, expected: tuple[dict[str, Any], bool]) -> None:
    s = session(tmp_path, waiting(text.replace(">", "&gt;")))
    s.rule("R")
    values, result, error = conditions(s)[0]
    wanted, holds = expected
    if "items[i + 1]" in text:
        wanted = {"i": 0, "items[1]": wanted["items[1]"], "items[i + 1]": wanted["items[1]"]}
    assert (values, result, error) == (wanted, holds, "")
    assert list(values) == sorted(values)


def test_what_is_missing_makes_a_condition_false_and_is_recorded(tmp_path: Path) -> None:
    s = session(tmp_path, waiting("items[i].id = 1 and items[i + 7].id = 1"))
    s.rule("R")
    assert s.states == {"R": "a"}
    assert conditions(s) == [
        (
            {"i": 0, "items[i + 7].id": None, "items[i].id": 1},
            False,
            "missing-part: `items` has the entries 0 to 2, and no 7 (in `items[i].id = 1 and items[i + 7].id = 1`)",
        )
    ]


def test_what_the_engine_keeps_is_read_by_index_too(tmp_path: Path) -> None:
    s = session(tmp_path, waiting("session['speaking']"), dialog("Say", speech(1)))
    s.rule("R")
    s.act("Say")
    assert s.states == {"R": "b"} and conditions(s)[-1] == ({"session['speaking']": True}, True, "")
    s.finish_all()
    s.event("/x")
    assert conditions(s)[-1] == ({"session['speaking']": False}, False, "")
    assert s.assign("session['speaking'] = true").status == "REJECTED"


def test_a_part_that_is_not_there_ends_an_assignment(tmp_path: Path) -> None:
    s = session(tmp_path, rule("R", state("a", put("n = items[i + 7].id") + put("n = 5"), on("/x", "a"))))
    s.rule("R")
    reason = "missing-part: `items` has the entries 0 to 2, and no 7 (in `items[i + 7].id`)"
    assert f"task assign n = items[i + 7].id ABORTED ({reason})" in s.lines("task")
    assert s.memory["n"] == 0, "the rest of the block is skipped"
    assert s.assign("marks[2].done = true").status == "ABORTED"
    assert s.assign("nobody[0] = 1").reason == "missing-part: the memory has no `nobody` (in `nobody[0]`)"


def test_a_key_that_is_not_there_is_told_once_and_with_its_own_assignment(tmp_path: Path) -> None:
    s = session(tmp_path, waiting("defined(nothing[0]) or items[nobody].id = 1 or i = 5"))
    s.assign("n = items[noone].id")
    assert s.lines("note") == ["note the memory has no value for 'noone', which `n = items[noone].id` reads"]
    s.rule("R")
    first = next(each for each in s.records if isinstance(each, ConditionRecord))
    assert first.missing == ("nobody",) and first.values == {
        "i": 0, "items[nobody].id": None, "nobody": None, "nothing[0]": None,
    }  # fmt: skip


def test_a_text_says_the_part_of_the_moment(tmp_path: Path) -> None:
    acts = dialog("Say", speech(1, "{items[i].id}: {items[i].text}")) + dialog(
        "Or", speech(1, "{items[i].text|nothing}")
    )
    s = session(tmp_path, acts=acts)

    def said(act: str) -> list[tuple[str, Any, str]]:
        before = len(s.records)
        s.act(act)
        s.finish_all()
        new = (each for each in s.records[before:] if isinstance(each, ActionRecord))
        return [(each.status, each.parameters["message"], each.reason) for each in new]

    assert said("Say") == [("started", "1: one", ""), ("succeeded", "1: one", "")]
    s.assign("i = 1")
    assert said("Say")[0] == ("started", "2: two", "")
    s.assign("i = 2")
    assert said("Say")[0][::2] == ("failed", "the memory has no value for 'items[i].text'"), "an empty cell"
    assert said("Or")[0] == ("started", "nothing", "")
    s.assign("i = 3")
    missing = "missing-part: `items` has the entries 0 to 2, and no 3 (in `items[i].id`)"
    assert said("Say")[0][::2] == ("failed", missing)
    assert said("Or")[0] == ("started", "nothing", "")
    s.assign("i = 'x'")
    assert said("Or")[0] == ("started", "nothing", "")


@pytest.mark.parametrize(
    "change", ["items = 1", "items[0].text = 'x'", "items.0.text = 'x'", '{"n": 1, "items": []}', '{"items.new": 1}']
)
@pytest.mark.parametrize("source", ["wizard:anna", "ros:camera", "file"])
def test_nobody_changes_a_table(tmp_path: Path, change: str, source: str) -> None:
    s = session(tmp_path)
    before = s.memory["items"]
    task = s.submit("assignValue", change, source=source)
    assert (task.status, task.reason) == ("REJECTED", "`items` is a table of the scenario, which nothing changes")
    assert s.submit("deleteValue", "items", source=source).status == "REJECTED"
    assert s.memory["items"] is before and s.memory["n"] == 0


def test_a_copy_of_a_row_is_memory_like_any_other(tmp_path: Path) -> None:
    s = session(tmp_path)
    assert s.assign("row = items[1]").status == "SUCCEEDED"
    assert s.assign("row.text = 'changed'").status == "SUCCEEDED"
    assert s.memory["row"]["text"] == "changed" and s.memory["items"][1]["text"] == "two"


def test_what_comes_of_a_table_has_its_limit(tmp_path: Path) -> None:
    s = session(tmp_path, tables={"items": ITEMS, "long": "a\n" + f"{'x' * 5_000}\n" * 30})
    assert s.assign("copy = items").status == "SUCCEEDED"
    task = s.assign("copy = long")
    assert task.status == "ABORTED" and "bytes as JSON; at most 100,000 are allowed here" in task.reason
    assert s.assign("copy = shuffle(long)").status == "ABORTED"
    assert s.assign("n = length(long)").status == "SUCCEEDED" and s.memory["n"] == 30


def test_orders_come_from_the_chance_of_the_session(tmp_path: Path) -> None:
    s = session(tmp_path)
    s.assign("order = shuffle(range(length(items)))")
    s.assign("some = sample(items, 2)")
    rng = Rng(1)
    expected = [0, 1, 2]
    for last in (2, 1):
        other = rng.integer_below(last + 1)
        expected[last], expected[other] = expected[other], expected[last]
    assert s.memory["order"] == expected
    rng.integer_below(3), rng.integer_below(2)
    assert s.kernel.core.rng.state == rng.state
    s.assign("conditions = latin(order, 4)")
    assert Counter(s.memory["conditions"]) == Counter(expected) and s.kernel.core.rng.state == rng.state


def test_a_snapshot_has_big_lists_and_no_tables(tmp_path: Path) -> None:
    s = session(tmp_path, waiting("items[order[0]].id = 100"))
    s.rule("R")
    s.assign("many = shuffle(range(10000))")
    s.assign("marks[0].done = many")
    snapshot = s.kernel.snapshot()
    assert "items" not in snapshot.memory and len(snapshot.memory["many"]) == 10_000
    restored = Session(s.scenario, kernel=Kernel.restore(s.scenario, snapshot))
    assert restored.memory == s.memory
    for each in (s, restored):
        each.t = s.t
        each.lines()
        each.assign("some = sample(many, 20)")
        each.assign("order[0] = 1")
    assert restored.records == s.records[-len(restored.records) :] and len(restored.records) > 4
    assert restored.kernel.core.rng.state == s.kernel.core.rng.state


def test_a_study_of_twelve_sentences_needs_one_state(tmp_path: Path) -> None:
    """What it is for: an order by chance, each sentence once, as it stands in a table."""
    table = "id,text\n" + "".join(f"{n},Sentence {n}\n" for n in range(1, 13))
    rules = rule(
        "Study",
        state(
            "begin",
            put("order = shuffle(range(length(items)))") + put("i = 0"),
            '<transition cond="true" target="say"/>',
        ),
        state(
            "say",
            do("startCommunicationRobotAct", "Item"),
            '<transition ended="Item" cond="i &lt; length(items) - 1" target="say">'
            + put("i = i + 1")
            + "</transition>"
            '<transition ended="Item" target="end"/>',
        ),
        state("end"),
        initial="begin",
    )
    s = session(tmp_path, rules, dialog("Item", speech(1, "{items[order[i]].text}")), {"items": table})
    s.rule("Study")
    s.finish_all()
    started = [each for each in s.records if isinstance(each, ActionRecord) and each.status == "started"]
    said = [each.parameters["message"] for each in started]
    assert sorted(said) == sorted(f"Sentence {n}" for n in range(1, 13)) and said != sorted(said)
    assert s.states == {} and not any(isinstance(each, NoteRecord) for each in s.records)


def test_a_scenario_without_tables_starts_as_ever(tmp_path: Path) -> None:
    folder = write(tmp_path, memory={"n": 1})
    kernel = Kernel(read(folder), 1)
    records, _ = kernel.handle(SessionStarted())
    assert [type(each).__name__ for each in records] == ["SessionRecord", "MemoryRecord"]
    assert kernel.snapshot().memory == {"n": 1}

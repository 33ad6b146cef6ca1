"""Whoever floods is stopped, nobody else (semantics.md 6.4)."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.kernel import rules as kernel_rules
from rise_engine.kernel.records import EventRecord, RuleRecord
from rise_engine.kernel.rule_stack import STEP_LIMIT
from rise_engine.scenario.model import Function, RobotProfile, Rule, Scenario, State, Transition
from tests.chance import examples
from tests.kernel.harness import Session, dialog, pause
from tests.kernel.test_rules import do, on, put, rule, session, state

COUNT = put("n = n + 1")


def stays(topic: str, *functions: str) -> str:
    """A transition that stays in its state and does something."""
    return f'<transition eventTopic="{topic}">{"".join(functions)}</transition>'


def raises(*topics: str) -> str:
    return "".join(do("raiseEventTopic", topic) for topic in topics)


def faulted(s: Session) -> list[str]:
    return [r.name for r in s.records if isinstance(r, RuleRecord) and r.status == "faulted"]


def taken(s: Session, name: str) -> int:
    return sum(isinstance(r, EventRecord) and r.taken_by == name for r in s.records)


def play(tmp_path: Path, rules: dict[str, str], start: str = "flood") -> Session:
    """`rules` by name: the ways of their one state. All are started, `start` last, and get the event `go`."""
    texts = [rule(name, state("a", ways=ways)) for name, ways in rules.items()]
    s = session(tmp_path, "".join(texts), dialog("Nothing", pause(1, 0)), {"n": 0, "k": 0})
    for name in [*(name for name in rules if name != start), start]:
        s.rule(name)
    s.event("go")
    assert not s.kernel.core.events, "the go came to its end"
    return s


def test_who_only_counts_a_flood_is_untouched(tmp_path: Path) -> None:
    """A5 of the trials: the counter took two steps for each of the flood's, and was stopped in its place."""
    s = play(tmp_path, {"flood": stays("go", raises("beat", "go", "beat")), "counter": stays("beat", COUNT)})
    assert faulted(s) == ["flood"]
    assert s.states == {"counter": "a"}
    assert s.memory["n"] == 2 * taken(s, "flood") > STEP_LIMIT - 2
    reason = next(line for line in s.lines() if line.startswith("task rule flood ABORTED"))
    assert "each of which led to the next" in reason and "events that they raise themselves" in reason


def test_a_counter_with_steps_of_its_own_is_untouched(tmp_path: Path) -> None:
    """Each beat leads it through three states by conditions and events of its own; its circles all come to an end."""
    states = (
        state("a", ways=on("beat", "b")),
        state("b", ways='<transition cond="true" target="c"/>'),
        state("c", raises("own"), ways=on("own", "a")),
    )
    flood = rule("flood", state("a", ways=stays("go", raises("beat", "go"))))
    s = session(tmp_path, rule("counter", *states) + flood)
    s.rule("counter")
    s.rule("flood")
    s.event("go")
    assert faulted(s) == ["flood"]
    assert s.states == {"counter": "a"}


def test_who_answers_a_flood_with_more_is_untouched(tmp_path: Path) -> None:
    """The echo raises more than the flood does, but nothing that it raises leads back to it."""
    rules = {
        "flood": stays("go", raises("beat", "go")),
        "echo": stays("beat", raises("c", "c", "c")),
        "last": stays("c", COUNT),
    }
    s = play(tmp_path, rules)
    assert faulted(s) == ["flood"]
    assert set(s.states) == {"echo", "last"}
    assert s.memory["n"] == 3 * taken(s, "echo")


def test_who_watches_a_key_that_floods_is_untouched(tmp_path: Path) -> None:
    watcher = rule(
        "watcher",
        state("a", ways='<transition cond="k = 1" target="b"/>'),
        state("b", ways='<transition cond="k = 0" target="a"/>'),
    )
    flood = rule("flood", state("a", ways=stays("go", put("k = 1 - k"), raises("go"))))
    s = session(tmp_path, watcher + flood, memory={"k": 0})
    s.rule("watcher")
    s.rule("flood")
    s.event("go")
    assert faulted(s) == ["flood"]
    assert set(s.states) == {"watcher"}


def test_who_is_started_by_a_flood_is_untouched(tmp_path: Path) -> None:
    """The flood starts a rule that ends at once, waits for that end, and starts it again."""
    flood = rule("flood", state("a", do("startInteractionRule", "short"), on("short_end", "a")))
    short = rule("short", state("a", put("n = n + 1")))
    s = session(tmp_path, flood + short, memory={"n": 0})
    s.rule("flood")
    assert faulted(s) == ["flood"]
    assert sum(isinstance(r, RuleRecord) and r.status == "started" and r.name == "short" for r in s.records) > 400


def test_two_that_flood_each_other(tmp_path: Path) -> None:
    """Who was first in the circle is stopped; the other one is then in no circle any more."""
    s = play(tmp_path, {"flood": stays("go", raises("back")), "second": stays("back", raises("go"))})
    assert faulted(s) == ["flood"]
    assert s.states == {"second": "a"}
    reason = next(line for line in s.lines() if line.startswith("task rule flood ABORTED"))
    assert "it and second lead to each other" in reason


def test_a_ring_is_broken_once(tmp_path: Path) -> None:
    ring = {f"r{n}": stays(f"t{n}", raises(f"t{(n + 1) % 5}")) for n in range(5)}
    s = play(tmp_path, {**ring, "flood": stays("go", raises("t2"))})
    assert faulted(s) == ["r2"], "the first in the circle, and not who only gave the push"
    assert set(s.states) == {"r0", "r1", "r3", "r4", "flood"}


def test_a_flood_that_doubles_is_stopped_before_it_fills_the_memory(tmp_path: Path) -> None:
    s = play(tmp_path, {"flood": stays("go", raises("go", "go", "beat")), "counter": stays("beat", COUNT)})
    assert faulted(s) == ["flood"]
    assert taken(s, "flood") <= STEP_LIMIT + 1
    assert s.states == {"counter": "a"}


def test_many_events_at_once_are_no_flood(tmp_path: Path) -> None:
    """3,000 events that come of one press of a key lead to nothing further."""
    rules = {"flood": stays("go", *[raises("beat") for _ in range(3 * STEP_LIMIT)]), "counter": stays("beat", COUNT)}
    s = play(tmp_path, rules)
    assert faulted(s) == []
    assert s.memory["n"] == 3 * STEP_LIMIT


@pytest.mark.parametrize(
    "way",
    [stays("beat", COUNT), on("beat", "a"), f'<transition eventTopic="beat" target="a">{COUNT}</transition>'],
    ids=["stays", "enters", "enters after functions"],
)
def test_who_goes_on_is_counted_from_one_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str) -> None:
    looks = []
    find = kernel_rules.find_runaway_rule
    monkeypatch.setattr(kernel_rules, "find_runaway_rule", lambda *given: looks.append(given) or find(*given))
    flood = stays("go", *[raises("beat") for _ in range(2 * STEP_LIMIT)])
    s = play(tmp_path, {"flood": flood, "counter": way})
    assert faulted(s) == []
    assert len(looks) == 1, "the step after the first thousand is the first of the next"


def test_who_starts_a_flood_again_does_not_go_on_for_ever(tmp_path: Path) -> None:
    rules = {
        "flood": stays("go", raises("go")),
        "nurse": stays("flood_end", do("startInteractionRule", "flood"), raises("go")),
    }
    s = play(tmp_path, rules)
    assert faulted(s) == ["flood"]
    assert s.states == {"nurse": "a"}
    rejected = next(line for line in s.lines() if line.startswith("task rule flood REJECTED"))
    assert "was just stopped as part of a loop" in rejected
    s.event("flood_end")
    assert faulted(s) == ["flood", "flood"], "it could start again with the next input"


def test_the_next_day_counts_anew(tmp_path: Path) -> None:
    s = play(tmp_path, {"flood": stays("go", raises("beat")), "counter": stays("beat", COUNT)})
    for _ in range(2 * STEP_LIMIT):
        s.event("go")
    assert faulted(s) == []


# --- any circles ----------------------------------------------------------------------------------------------------

TOPICS = 5
# For each rule and each topic: what it raises when it takes that; None: it does not wait for it.
TABLES = st.lists(
    st.lists(st.none() | st.lists(st.integers(0, TOPICS - 1), max_size=2), min_size=TOPICS, max_size=TOPICS),
    min_size=1,
    max_size=5,
)


def scenario(table: list[list[list[int] | None]]) -> Scenario:
    rules = {}
    for number, row in enumerate(table):
        ways = tuple(
            Transition(
                f"t{topic}", None, None, None, tuple(Function("raiseEventTopic", f"/t{each}") for each in raised)
            )
            for topic, raised in enumerate(row)
            if raised is not None
        )
        ways += (Transition("never", None, None, "a"),)  # it has a way, so it does not end by itself
        rules[f"r{number}"] = Rule(f"r{number}", "a", {"a": State("a", (), (), ways)})
    topics = frozenset({*(f"t{n}" for n in range(TOPICS)), "never"})
    return Scenario("t", "/", "debug", RobotProfile("n", "n", "n", {}), {}, rules, {}, topics=topics)


def in_circles(table: list[list[list[int] | None]]) -> set[str]:
    """The rules from whose events a way leads back to them, whoever takes them."""
    ways: dict[int, set[int]] = {}
    for number, row in enumerate(table):
        raised = {each for told in row if told is not None for each in told}
        ways[number] = {other for other, row in enumerate(table) for topic in raised if row[topic] is not None}
    found = set()
    for number in ways:
        reached, pending = set(), list(ways[number])
        while pending:
            at = pending.pop()
            if at not in reached:
                reached.add(at)
                pending += ways[at]
        if number in reached:
            found.add(f"r{number}")
    return found


@pytest.mark.slow
@settings(max_examples=examples(150))
@given(TABLES, st.integers(0, TOPICS - 1))
def test_only_who_is_in_a_circle_is_stopped(table: list[list[list[int] | None]], first: int) -> None:
    """Whatever the rules raise: the go ends, and a rule from which no way leads back to itself is never stopped."""
    s = Session(scenario(table))
    for number in range(len(table)):
        s.rule(f"r{number}")
    s.event(f"t{first}")
    assert not s.kernel.core.events
    assert set(faulted(s)) <= in_circles(table)
    assert set(s.states) == {f"r{number}" for number in range(len(table))} - set(faulted(s))
    again = Session(scenario(table))
    for number in range(len(table)):
        again.rule(f"r{number}")
    again.event(f"t{first}")
    assert again.records == s.records, "the same, whenever it is played"


@pytest.mark.parametrize("rules", [2, 7, 30])
def test_the_work_of_a_flood_grows_with_its_rules_only(rules: int) -> None:
    """A ring of n rules is stopped after about n times the steps that one rule has."""
    ring = {}
    for n in range(rules):
        function = Function("raiseEventTopic", f"x{(n + 1) % rules}")
        ring[f"r{n}"] = Rule(f"r{n}", "a", {"a": State("a", (), (), (Transition(f"x{n}", block=(function,)),))})
    topics = frozenset(f"x{n}" for n in range(rules))
    made = Scenario("t", "/", "debug", RobotProfile("n", "n", "n", {}), {}, ring, {}, topics=topics)
    s = Session(made)
    for name in ring:
        s.rule(name)
    s.event("x0")
    assert faulted(s) == ["r0"]
    assert sum(isinstance(r, EventRecord) for r in s.records) <= rules * (STEP_LIMIT + 2)


def test_rules_that_double_what_comes_are_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing goes round: each of forty rules answers an event with two for the next one. That is a trillion steps."""
    monkeypatch.setattr(kernel_rules, "MAX_VAIN_SEARCHES", 5)  # twenty times fewer records for the same
    rules = {f"r{at}": stays(f"e{at}", raises(f"e{at + 1}", f"e{at + 1}")) for at in range(40)}
    s = play(tmp_path, {**rules, "flood": stays("go", raises("e0")), "calm": stays("other", COUNT)})
    stopped = faulted(s)
    assert stopped and set(s.states) == {*rules, "flood", "calm"} - set(stopped)
    assert {"flood", "calm"} <= set(s.states)
    assert len(s.records) < 500_000


def test_many_events_of_one_press_that_come_to_an_end_stop_nobody(tmp_path: Path) -> None:
    """Ten rules that double: a thousand steps and more, and then it is over."""
    rules = {f"r{at}": stays(f"e{at}", raises(f"e{at + 1}", f"e{at + 1}")) for at in range(12)}
    s = play(tmp_path, {**rules, "flood": stays("go", raises("e0")), "counter": stays("e12", COUNT)})
    assert faulted(s) == []
    assert s.memory["n"] == 2**12

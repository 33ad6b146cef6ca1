"""IRs: run to completion, events, guards, timers, the stack, livelock; the end of an act of its own, results of rules,
and ways out that states share (semantics.md 5, semantics.md 6)."""

from __future__ import annotations

from pathlib import Path

import pytest

from .harness import Session, dialog, read, speech, write

LISTING_2 = """<InteractionRule name = "Interaction Loop" initial = "State 1" priority = "1">
  <State id = "State 1">
    <onEntry><function startCommunicationRobotAct = "R_Greeting" /></onEntry>
    <transition eventTopic = "/R_Greeting_end" target = "State 2"/>
  </State>
  <State id = "State 2">
    <onEntry>
      <!--Checking if the value in the WM is true-->
      <if cond = "H_interaction_detected">
        <function startCommunicationRobotAct = "R_ResponseToUser" />
      <else>
        <!--Raising the event topic to switch into State 3-->
        <function raiseEventTopic = "/H_no_interaction"/>
      </else>
    </if>
    </onEntry>
    <transition eventTopic = "/H_no_interaction" target = "State 3"/>
    <transition eventTopic = "/R_ResponseToUser_end" target = "State 4"/>
  </State>
  <State id = "State 3">
    <onEntry><function startCommunicationRobotAct = "R_RequestInteraction" /></onEntry>
    <transition eventTopic = "/R_RequestInteraction_end" target = "State 2"/>
  </State>
  <State id = "State 4">
    <onEntry>
      <function assignValue = "interaction_finished = true" />
      <function startCommunicationRobotAct = "R_Goodbye" />
    </onEntry>
  </State>
</InteractionRule>"""

FOUR_ACTS = "".join(
    dialog(name, speech(1)) for name in ("R_Greeting", "R_ResponseToUser", "R_RequestInteraction", "R_Goodbye")
)


def session(
    tmp_path: Path, rules: str, acts: str = "", memory: dict[str, object] | None = None, seed: int = 1
) -> Session:
    return Session(read(write(tmp_path, rules=rules, acts=acts, memory=memory)), seed)


def rule(name: str, *states: str, initial: str = "a", priority: float = 1) -> str:
    return (
        f'<InteractionRule name="{name}" initial="{initial}" priority="{priority}">{"".join(states)}</InteractionRule>'
    )


def state(id: str, entry: str = "", ways: str = "", leave: str = "") -> str:
    entry = f"<onEntry>{entry}</onEntry>" if entry else ""
    leave = f"<onExit>{leave}</onExit>" if leave else ""
    return f'<State id="{id}">{entry}{leave}{ways}</State>'


def on(topic: str, target: str, more: str = "") -> str:
    return f'<transition eventTopic="{topic}" target="{target}" {more}/>'


def do(function: str, argument: str) -> str:
    return f'<function {function}="{argument}"/>'


def put(text: str) -> str:
    return do("assignValue", text)


def test_listing_2_cycles_until_somebody_interacts(tmp_path: Path) -> None:
    s = session(tmp_path, LISTING_2, FOUR_ACTS, {"H_interaction_detected": False, "interaction_finished": False})
    s.rule("Interaction Loop")
    assert s.states == {"Interaction Loop": "State 1"}
    s.report("2/1")
    assert s.states == {"Interaction Loop": "State 3"}, "State 2 raises the event that leaves it"
    s.report(next(iter(s.goals)))
    assert s.states == {"Interaction Loop": "State 3"}
    s.assign('{"H_interaction_detected": true}')
    s.report(next(iter(s.goals)))
    assert s.states == {"Interaction Loop": "State 2"}
    s.report(next(iter(s.goals)))
    assert s.states == {}
    assert s.memory["interaction_finished"] is True
    assert [goal.parameters["message"] for goal in s.goals.values()] == ["Hello"], "the goodbye outlives the rule"
    assert "rule Interaction Loop ended State 4" in s.lines()


def test_one_pass_of_listing_2_in_records(tmp_path: Path) -> None:
    s = session(tmp_path, LISTING_2, FOUR_ACTS, {"H_interaction_detected": False})
    s.rule("Interaction Loop")
    s.lines()
    s.report("2/1")
    assert s.lines() == [
        "action R_Greeting/1 succeeded",
        "task act R_Greeting SUCCEEDED",
        "event /R_Greeting_end -> Interaction Loop",
        "rule Interaction Loop entered State 2 from State 1 on /R_Greeting_end",
        'condition Interaction Loop H_interaction_detected {"H_interaction_detected": false} False',
        "task raise /H_no_interaction SUCCEEDED",
        "event /H_no_interaction -> Interaction Loop",
        "rule Interaction Loop entered State 3 from State 2 on /H_no_interaction",
        "task act R_RequestInteraction PENDING",
        "task act R_RequestInteraction ACTIVE",
        "action R_RequestInteraction/1 started",
    ]


def test_events_raised_by_functions_wait_for_them_and_keep_their_order(tmp_path: Path) -> None:
    """Raised first, taken first, and only when the functions are through (W3C SCXML test 144 in our words)."""
    entry = do("raiseEventTopic", "one") + do("raiseEventTopic", "two") + put("seen = 1")
    s = session(
        tmp_path,
        rule(
            "R",
            state("a", entry, on("two", "wrong") + on("one", "b")),
            state("b", ways=on("two", "c")),
            state("c"),
            state("wrong"),
        ),
    )
    s.rule("R")
    lines = s.lines("memory", "event", "rule")
    assert lines.index("memory seen null -> 1") < lines.index("event /one -> R")
    assert lines[-1] == "rule R ended c"


def test_an_error_skips_the_rest_of_its_block_only(tmp_path: Path) -> None:
    entry = f"""<if cond="true">{put("y = name + 1")}{put("in_if = true")}</if>{put("after_if = true")}"""
    s = session(
        tmp_path,
        rule("R", state("a", entry, on("e", "b"), leave=put("left = true")), state("b", put("arrived = true"))),
        memory={"name": "Ada", "y": 0},
    )
    s.rule("R")
    assert "in_if" not in s.memory
    assert "after_if" not in s.memory, "the whole onEntry is one block"
    assert any("ABORTED" in line for line in s.lines("task"))
    s.event("e")
    assert s.memory["left"] is True
    assert s.memory["arrived"] is True


# --- the stack ---


def waiting(name: str, priority: float = 1) -> str:
    return rule(name, state("a", ways=on("e", "b")), state("b", ways=on("e", "a")), priority=priority)


def test_the_highest_rule_takes_the_event_and_moves_to_the_top(tmp_path: Path) -> None:
    rules = waiting("one") + waiting("two") + rule("other", state("a", ways=on("f", "a")), priority=0)
    s = session(tmp_path, rules)
    for name in ("one", "two", "other"):
        s.rule(name)
    assert s.stack == ["two", "one", "other"]
    s.event("e")
    assert s.states == {"one": "a", "two": "b", "other": "a"}
    s.event("f")
    assert s.stack == ["other", "two", "one"], "the most recent is the most relevant"
    s.event("e")
    assert s.states["two"] == "a"


def test_a_moved_rule_has_the_highest_priority_but_no_higher(tmp_path: Path) -> None:
    rules = waiting("a1", 1) + rule("mid", state("a", ways=on("m", "a")), priority=3) + waiting("top", 9)
    s = session(tmp_path, rules)
    s.rule("a1")
    s.rule("mid")
    s.event("e")  # a1 takes it and is level with mid, on top of it
    assert s.stack == ["a1", "mid"]
    s.rule("top")
    assert s.stack == ["top", "a1", "mid"]


def test_two_thousand_rules_deep(tmp_path: Path) -> None:
    n = 2_000
    rules = "".join(
        rule(f"r{i}", state("a", do("startInteractionRule", f"r{i + 1}"), on("e", "a"))) for i in range(n)
    ) + rule(f"r{n}", state("a", ways=on("e", "a")))
    s = session(tmp_path, rules)
    s.rule("r0")
    assert len(s.stack) == n + 1
    assert s.stack[0] == f"r{n}"


# --- starting and stopping ---


def test_starting_a_running_rule_is_rejected(tmp_path: Path) -> None:
    s = session(tmp_path, waiting("R"))
    assert s.rule("R").status == "PENDING"
    second = s.rule("R")
    assert (second.status, second.reason) == ("REJECTED", "rule 'R' is already running")


# --- extensions ---


def test_after_is_taken_when_its_time_has_passed(tmp_path: Path) -> None:
    ways = '<transition after="2s" target="b"/>' + on("e", "a")
    s = session(tmp_path, rule("R", state("a", ways=ways), state("b", ways=on("e", "a"))))
    s.rule("R")
    s.wait(1.9)
    assert s.states == {"R": "a"}
    s.event("e")  # entering again starts the time again
    s.wait(1.9)
    assert s.states == {"R": "a"}
    s.wait(0.1)
    assert s.states == {"R": "b"}
    assert not s.timers


@pytest.mark.parametrize(("written", "seconds"), [("250ms", 0.25), ("2s", 2), ("1.5 s", 1.5), ("1min", 60)])
def test_units_of_after(tmp_path: Path, written: str, seconds: float) -> None:
    s = session(tmp_path, rule("R", state("a", ways=f'<transition after="{written}" target="b"/>'), state("b")))
    s.rule("R")
    assert list(s.timers.values()) == [seconds]


def test_a_condition_without_event_is_taken_as_soon_as_it_becomes_true(tmp_path: Path) -> None:
    s = session(
        tmp_path,
        rule("R", state("a", ways='<transition cond="x &gt; 3" target="b"/>'), state("b", ways=on("e", "a"))),
        memory={"x": 1, "y": 0},
    )
    s.rule("R")
    s.lines()
    s.assign("y = 9")
    assert s.lines("condition") == [], "it does not read y"
    s.assign("x = 4")
    assert s.states == {"R": "b"}
    s.event("e")
    assert s.states == {"R": "b"}, "on entry it is checked too"


def test_one_of_picks_by_the_seed(tmp_path: Path) -> None:
    entry = "<oneOf>" + "".join(put(f"x = {n}") for n in range(5)) + "</oneOf>"
    scenario = read(write(tmp_path, rules=rule("R", state("a", entry)), memory={"x": 0}))

    def run(seed: int) -> list[object]:
        s = Session(scenario, seed)
        values = []
        for _ in range(20):
            s.rule("R")
            values.append(s.memory["x"])
        return values

    assert run(1) == run(1)
    assert run(1) != run(2)
    assert set(run(1)) <= {0, 1, 2, 3, 4}
    assert len(set(run(1))) > 2


# --- livelock ---

RUNAWAY = rule(
    "runaway",
    state("a", do("raiseEventTopic", "ping"), on("ping", "b")),
    state("b", do("raiseEventTopic", "pong"), on("pong", "a")),
)


def test_a_rule_that_raises_events_to_itself_for_ever_is_faulted_alone(tmp_path: Path) -> None:
    s = session(tmp_path, RUNAWAY + waiting("calm"))
    s.rule("calm")
    s.rule("runaway")
    assert s.states == {"calm": "a"}
    lines = s.lines("rule", "task")
    assert any(line.startswith("rule runaway faulted") for line in lines)
    assert any(line.startswith("task rule runaway ABORTED (took 1000 steps") for line in lines)
    assert sum(line.startswith("rule runaway entered") for line in lines) == 1_000, "the budget is what it says it is"
    s.event("e")
    assert s.states == {"calm": "b"}


def test_rules_that_restart_each_other_are_stopped(tmp_path: Path) -> None:
    def restarts(name: str, other: str) -> str:
        again = do("stopInteractionRule", other) + do("startInteractionRule", other) + do("raiseEventTopic", "e")
        return rule(name, state("a", ways=f'<transition eventTopic="e">{again}</transition>'))

    s = session(tmp_path, restarts("one", "two") + restarts("two", "one") + waiting("calm"))
    for name in ("calm", "one", "two"):
        s.rule(name)
    s.event("e")
    assert any("faulted" in line for line in s.lines("rule"))
    assert "calm" in s.states
    s.event("e")
    assert s.rule("one").status in ("PENDING", "REJECTED"), "another day it may start again"


def test_a_loop_of_timers_of_the_same_moment_is_stopped(tmp_path: Path) -> None:
    act = rule("R", state("a", do("startCommunicationRobotAct", "A"), on("A_end", "a")))
    wait = "<Wait><actionID>1</actionID><duration>0.0001</duration></Wait>"
    s = session(tmp_path, act + waiting("calm"), dialog("A", wait))
    s.rule("calm")
    s.rule("R")
    s.wait(0)
    assert s.states == {"calm": "a"}


# --- the acts that a rule has started itself ---

ACTS = dialog("A", speech(1))


def start(act: str) -> str:
    return do("startCommunicationRobotAct", act)


def ended(act: str, target: str, outcome: str = "", more: str = "") -> str:
    outcome = f' outcome="{outcome}"' if outcome else ""
    return f'<transition ended="{act}"{outcome} target="{target}" {more}/>'


def test_of_two_of_one_name_the_last_one_counts(tmp_path: Path) -> None:
    again = rule(
        "R", state("a", start("A"), ended("A", "b") + '<transition after="1s">' + start("A") + "</transition>")
    )
    s = session(tmp_path, again.replace("</InteractionRule>", state("b") + "</InteractionRule>"), ACTS)
    s.rule("R")
    s.wait(1)
    first, *_ = s.goals
    s.report(first)
    assert s.states == {"R": "a"}
    s.finish_all()
    assert s.states == {}


@pytest.mark.parametrize(
    ("how", "taken"), [("succeeded", "good"), ("failed", "bad"), ("lost", "bad"), ("canceled", "stopped")]
)
def test_the_outcome_says_which_way(tmp_path: Path, how: str, taken: str) -> None:
    ways = ended("A", "bad", "failed") + ended("A", "stopped", "stopped") + ended("A", "good", "succeeded")
    rules = rule(
        "R", state("a", start("A"), ways), *(state(each, "", on("/x", "a")) for each in ("good", "bad", "stopped"))
    )
    s = session(tmp_path, rules, ACTS)
    s.rule("R")
    (goal,) = s.goals
    if how == "canceled":
        s.submit("stopCommunicationRobotAct", "A")
    s.report(goal, how)
    assert s.states == {"R": taken}
    assert f"ended A {'succeeded' if taken == 'good' else 'failed' if taken == 'bad' else 'stopped'}" in {
        record.topic for record in s.records if hasattr(record, "topic")
    }


# --- results ---


def test_a_rule_that_ends_says_where(tmp_path: Path) -> None:
    asks = rule("Ask", state("a", "", on("/yes", "agreed") + on("/no", "refused")), state("agreed"), state("refused"))
    main = rule(
        "Main",
        state("a", do("startInteractionRule", "Ask"), on("/Ask_agreed", "b") + on("/Ask_end", "c")),
        state("b", "", on("/x", "a")),
        state("c", "", on("/x", "a")),
    )
    s = session(tmp_path, asks + main)
    s.rule("Main")
    s.event("yes")
    assert s.states == {"Main": "b"}
    s.event("x")
    s.event("no")
    assert s.states == {"Main": "c"}
    s.event("x")
    s.submit("stopInteractionRule", "Ask")
    assert s.states == {"Main": "c"}


def test_a_state_that_tells_its_result_by_hand_tells_it_once(tmp_path: Path) -> None:
    asks = rule("Ask", state("a", "", on("/yes", "agreed")), state("agreed", do("raiseEventTopic", "/Ask_agreed")))
    s = session(tmp_path, asks + rule("W", state("a", "", on("/Ask_agreed", "a"))))
    s.rule("W")
    s.rule("Ask")
    s.event("yes")
    assert [record.topic for record in s.records if hasattr(record, "topic")] == ["/yes", "/Ask_agreed"]


# --- shared ways out ---


def shared(states: str, *ways: str) -> str:
    return f'<transitions in="{states}">{"".join(ways)}</transitions>'


def test_states_share_ways_out_after_their_own(tmp_path: Path) -> None:
    rules = rule(
        "R",
        shared("a | b", on("/stop", "end"), on("/next", "end")),
        state("a", "", on("/next", "b")),
        state("b"),
        state("end", "", on("/again", "a")),
    )
    s = session(tmp_path, rules)
    s.rule("R")
    s.event("next")
    assert s.states == {"R": "b"}, "its own way comes first, and the state that has only shared ones does not end"
    s.event("next")
    assert s.states == {"R": "end"}
    for event in ("again", "stop"):
        s.event(event)
    assert s.states == {"R": "end"}

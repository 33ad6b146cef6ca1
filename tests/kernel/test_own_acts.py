"""The end of the act that a rule has started itself, a rule's result, and ways out that states share (semantics.md 5.3,
semantics.md 6.1)."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.kernel import Kernel

from .harness import Session, dialog, pause, speech
from .test_rules import do, on, rule, session, state

ACTS = dialog("A", speech(1)) + dialog("B", speech(1)) + dialog("Short", pause(1, 0))


def start(act: str) -> str:
    return do("startCommunicationRobotAct", act)


def ended(act: str, target: str, outcome: str = "", more: str = "") -> str:
    outcome = f' outcome="{outcome}"' if outcome else ""
    return f'<transition ended="{act}"{outcome} target="{target}" {more}/>'


WAITS = rule("R", state("a", start("A"), ended("A", "b")), state("b", "", on("/on", "a")))


def test_only_the_end_of_its_own_act_counts(tmp_path: Path) -> None:
    s = session(tmp_path, WAITS, ACTS)
    by_hand = s.act("A")
    s.rule("R")
    s.report(f"{by_hand.id}/1")
    assert s.states == {"R": "a"}, "the wizard's own one has ended, and the rule's has only begun"
    s.finish_all()
    assert s.states == {"R": "b"}


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


def test_of_several_that_fit_the_first_in_the_file_is_taken(tmp_path: Path) -> None:
    ways = ended("A", "guarded", "failed | stopped", 'cond="0"') + ended("A", "any") + ended("A", "late", "failed")
    rules = rule(
        "R", state("a", start("A"), ways), *(state(each, "", on("/x", "a")) for each in ("guarded", "any", "late"))
    )
    s = session(tmp_path, rules, ACTS)
    s.rule("R")
    s.report(next(iter(s.goals)), "failed")
    assert s.states == {"R": "any"}


def test_it_comes_before_the_events_that_all_may_take(tmp_path: Path) -> None:
    rules = rule("R", state("a", start("A"), on("/A_end", "other") + ended("A", "own")), state("own"), state("other"))
    s = session(tmp_path, rules + rule("S", state("a", "", on("/A_end", "b")), state("b")), ACTS)
    s.rule("S")
    s.rule("R")
    s.finish_all()
    assert [record.state for record in s.records if getattr(record, "status", "") == "ended"] == ["own", "b"]


def test_an_act_that_is_over_at_once(tmp_path: Path) -> None:
    s = session(tmp_path, rule("R", state("a", start("Short"), ended("Short", "b")), state("b")), ACTS)
    s.rule("R")
    assert s.states == {}


def test_a_rule_that_begins_anew_has_started_nothing(tmp_path: Path) -> None:
    rules = rule("R", state("a", "", on("/go", "b")), state("b", "", ended("A", "c") + on("/act", "d")), state("c"))
    rules = rules.replace("</InteractionRule>", state("d", start("A"), on("/x", "b")) + "</InteractionRule>")
    s = session(tmp_path, rules, ACTS)
    s.rule("R")
    s.event("go")
    s.event("act")
    s.submit("stopInteractionRule", "R")
    s.rule("R")
    s.event("go")
    s.finish_all()
    assert s.states == {"R": "b"}


def test_a_kernel_that_goes_on_from_a_snapshot_knows_whose_act_it_is(tmp_path: Path) -> None:
    s = session(tmp_path, WAITS, ACTS)
    s.rule("R")
    later = Session(s.scenario, kernel=Kernel.restore(s.scenario, s.kernel.snapshot()))
    later.goals, later.timers = dict(s.goals), dict(s.timers)
    later.finish_all()
    assert later.states == {"R": "b"}


# --- results ----------------------------------------------------------------------------------------------------------


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


# --- shared ways out --------------------------------------------------------------------------------------------------


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

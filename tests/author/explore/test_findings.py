"""What exploring says of studies whose faults are known, and of those that are shipped."""

from __future__ import annotations

import shutil
from pathlib import Path
from threading import Event

import pytest
from msgspec.structs import replace

from rise_engine.author.explore import exploration
from rise_engine.author.explore.exploration import Exploration, bounds_of, explore, main_rule, sessions_of
from rise_engine.author.explore.moves import Bounds
from rise_engine.author.explore.situation_graph import Explored
from rise_engine.author.explore.space import Space
from rise_engine.author.explore.stepper import Stepper
from tests.author.explore.exploring import STUDIES, loaded, of_kind, quickly_explored, shipped
from tests.chance import searched

FAULTY = "tests/author/explore/studies"


def with_tables(study: str, tables: str, folder: Path, faults: int = 0) -> Exploration:
    """A faulty study explored with something more in its scenario.toml."""
    copy = folder / study
    shutil.copytree(STUDIES / study, copy)
    toml = copy / "scenario.toml"
    toml.write_text(f"{toml.read_text()}\n{tables}\n")
    scenario = loaded(copy)
    return explore(scenario, replace(bounds_of(scenario), stop=False, lost=False, faults=faults))


# --- the five faults of the versions that were shipped before, and that they are gone ---


def test_a_line_that_grows_is_found_and_is_gone() -> None:
    before = of_kind(quickly_explored(f"{FAULTY}/greeting", faults=0), "line-grows")
    assert "R_Notice can wait in the queue any number of times" in before[0].text
    assert before[0].path is not None
    assert len(before[0].path.steps) <= 6
    now = of_kind(quickly_explored("scenarios/greeting", faults=0), "line-grows")
    assert not any(finding.act == "R_Notice" for finding in now)


GREETED = """
[eventually]
"a greeting is followed by the introduction" = { after = "in('Greeting', 'Greet')", then = "runs('R_Introduction')" }
"""


def test_a_visitor_who_is_never_greeted_is_found(tmp_path: Path) -> None:
    broken = of_kind(with_tables("greeting", GREETED, tmp_path, faults=1), "eventually")
    assert len(broken) == 1
    assert broken[0].path is not None
    assert [step.move.how for step in broken[0].path.steps if step.move.is_mishap] == ["failed"]


ONE_GAZE = """
[always]
"one gaze at a time" = "not (runs('R_LookAhead') and runs('R_Thinking'))"
"""


def test_two_gazes_at_once_are_found_and_are_gone(tmp_path: Path) -> None:
    before = of_kind(quickly_explored(f"{FAULTY}/lab_opening", faults=0), "two-at-once")
    assert any("R_LookAhead and R_Thinking can run at once, and both use gaze" in finding.text for finding in before)
    assert of_kind(with_tables("lab_opening", ONE_GAZE, tmp_path), "always")
    now = of_kind(quickly_explored("scenarios/lab_opening", faults=0), "two-at-once")
    assert not any("R_LookAhead" in finding.text for finding in now)


def test_a_guest_who_is_not_noticed_is_found_and_is_gone() -> None:
    assert quickly_explored(f"{FAULTY}/lab_opening", faults=0).keys["Default pose"]["g"] == "never"
    assert quickly_explored("scenarios/lab_opening", faults=0).keys["Default pose"]["g"] == "always"


TRIES = """
[explore]
tries = { task = [2.5, "two"] }
"""


def test_a_value_that_leads_nowhere_is_found_and_leads_somewhere_now(tmp_path: Path) -> None:
    stuck_situations = of_kind(with_tables("lablinking", TRIES, tmp_path), "dead-end")
    assert [finding.state for finding in stuck_situations] == ["Start"]
    assert stuck_situations[0].path is not None
    assert [step.move.kind for step in stuck_situations[0].path.steps] == ["try", "key"]
    tries = Bounds(stop=False, lost=False, faults=0, tries={"task": (2.5, "two")})
    assert not of_kind(explore(shipped("lablinking"), tries), "dead-end")


@pytest.mark.parametrize(
    ("name", "bounds"),
    [
        ("greeting", {"faults": 0}),
        ("lab_opening", {}),
        ("lablinking", {}),
        pytest.param("greeting", {}, marks=searched),
        pytest.param("negation", {}, marks=searched),
    ],
)
def test_in_shipped_studies_nothing_gets_stuck_and_the_end_can_be_reached(name: str, bounds: dict[str, int]) -> None:
    exploration = quickly_explored(f"scenarios/{name}", **bounds)
    assert exploration.is_complete
    assert not [finding.text for finding in exploration.findings if finding.level == "problem"]
    assert exploration.facts[0].startswith("From ")


# --- the quiz, with faults of our own ---


def test_the_quiz() -> None:
    exploration = quickly_explored(f"{FAULTY}/quiz")
    texts = {finding.kind: finding.text for finding in exploration.findings}
    assert texts["dead-end"].startswith("Praise can get stuck in Praise: no key, event or time")
    assert texts["idle-key"].startswith("the key h (one more hint) never does anything")
    assert "Quiz never comes to Hint" in texts["never-entered"]
    assert exploration.count("problem") == 1


def test_a_property_that_holds_is_said(tmp_path: Path) -> None:
    table = '[reachable]\n"praise" = "runs(\'R_Praise\')"\n[always]\n"no hint" = "not runs(\'R_Hint\')"'
    exploration = with_tables("quiz", table, tmp_path)
    assert [sentence for sentence in exploration.facts if "holds" in sentence] == [
        '"no hint" ([always]) holds in all of them.'
    ]
    assert of_kind(exploration, "reachable")[0].text.startswith('"praise": ')


# --- bounds, and what is said of them ---


def test_what_was_not_looked_at_is_said() -> None:
    sentences = quickly_explored("scenarios/lab_opening").scope
    assert sentences[0].startswith("Looked at all 1,845 situations with these 12 keys, at most 1 waiting act")
    wanted = "one more act could wait. What follows from that was not explored."
    assert any(wanted in sentence for sentence in sentences)


def test_broken_off_it_says_so_and_calls_nothing_stuck() -> None:
    bounds = Bounds(stop=False, lost=False, situations=50)
    exploration = explore(shipped("greeting"), bounds)
    assert not exploration.is_complete
    assert any(sentence.startswith("Exploring stopped early") for sentence in exploration.scope)
    assert not exploration.count("problem")


def test_several_cores_find_the_same() -> None:
    bounds = Bounds(stop=False, lost=False, faults=0)
    alone, together = explore(shipped("lablinking"), bounds), explore(shipped("lablinking"), bounds, cores=2)
    assert together.situations == alone.situations
    assert {finding.text for finding in together.findings} == {finding.text for finding in alone.findings}


def _never_done(portion: object) -> None:
    Event().wait(60)


def test_whoever_has_had_enough_waits_for_no_core(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exploration, "_follow", _never_done)
    scenario = shipped("greeting")
    space = Space(Stepper(scenario, Bounds(), sessions_of(scenario), main_rule(scenario)))
    space.begin()
    said = iter([True, True, False])
    exploration.explore_on_cores(space, 2, lambda: next(said))
    assert not space.complete and list(space.pending) == space.beginnings, "nobody has looked at any"


def test_one_core_asks_before_each_situation_whether_to_go_on() -> None:
    exploration = explore(shipped("greeting"), go_on=lambda space: len(space.situations) < 3)
    assert not exploration.is_complete and exploration.situations < 30


def test_acts_that_nothing_tells_apart_are_taken_for_one() -> None:
    scenario = shipped("lablinking")
    stepper = Stepper(scenario, Bounds(keys="all"), sessions_of(scenario), main_rule(scenario))
    alike = stepper.moves.alike
    assert len(set(alike.values())) < len(alike)
    assert not any(name.startswith("R_Task") for name in alike)


def test_any_pace_finds_at_least_what_a_pace_finds() -> None:
    found = {}
    for pace in (None, (0.5, 3.0)):
        scenario = shipped("lablinking")
        bounds = Bounds(stop=False, lost=False, faults=0, pace=pace)
        space = Space(Stepper(scenario, bounds, sessions_of(scenario), main_rule(scenario)))
        space.begin()
        space.explore()
        found[pace] = set(Explored(space).facts("transition"))
    assert found[None] >= found[0.5, 3.0]


def test_a_busy_machine_explores_as_much_in_a_few_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """What counts is the processor's time: an hour of others' work between two looks at the clock changes nothing."""
    scenario = loaded(STUDIES / "quiz")
    hours = iter(range(0, 3_600_000_000, 3_600))
    monkeypatch.setattr("time.monotonic", lambda: next(hours))
    assert exploration.explore_quickly(scenario).is_complete

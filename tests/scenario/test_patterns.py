"""The pattern library: each pattern is played headless along every way that the participant and the robot can take."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from rise_engine.kernel.inputs import ActionReport
from rise_engine.kernel.records import RuleRecord, TaskRecord
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario, functions_in
from rise_engine.scenario.reading.element_templates import LIBRARY
from tests.kernel.harness import Session, dialog, speech
from tests.scenario.folders import folder

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "patterns.md"
OUTCOMES = {
    "ActionRequest": {"Done", "Cancelled", "Failed"},
    "Goodbye": {"Parted", "Failed"},
    "Greeting": {"Answered", "Unanswered", "Failed"},
    "InformationRequest": {"Known", "Unanswered", "Unconfirmed", "Failed"},
    "Interruption": {"Said", "Abandoned", "Failed"},
    "Offer": {"Done", "Declined", "Unanswered", "Failed"},
    "Repair": {"Understood", "Unanswered", "Failed"},
    "Reprompt": {"Answered", "Unanswered", "Failed"},
    "Suggestion": {"Accepted", "Declined", "Unanswered", "Failed"},
}
"""By pattern, the states in which it ends."""
STEPS = 9
"""Of the participant and the robot, after which nothing new is found in any pattern."""
PATIENCE = 30
"""Seconds, longer than any pattern waits for something."""


@cache
def parameters(pattern: str) -> dict[str, bool]:
    """A pattern's parameters, and whether each must be given."""
    text = (LIBRARY / f"{pattern}.xml").read_text("utf-8")
    return {name: not rest for name, rest in re.findall(r'<parameter name="(\w+)"( default="[^"]*")?/>', text)}


@cache
def example(pattern: str) -> Scenario:
    """A scenario that uses a pattern: every act says one thing, and every event is called as its parameter."""
    text = (LIBRARY / f"{pattern}.xml").read_text("utf-8")
    given = {"name": "P"}
    for parameter, required in parameters(pattern).items():
        if required and parameter != "name":
            is_event = re.search(rf'eventTopic="\$\{{{parameter}\}}"', text)
            given[parameter] = f"/{parameter}" if is_event else f"R_{parameter}"
    acts = "".join(dialog(name, speech(1)) for name in given.values() if name.startswith("R_"))
    arguments = " ".join(f'{name}="{value}"' for name, value in given.items())
    with TemporaryDirectory() as where:
        made = folder(
            Path(where),
            {
                "acts/a.xml": f"<Dialogs>{acts}</Dialogs>",
                "rules/r.xml": f'<InteractionRules><use template="{pattern}" {arguments}/></InteractionRules>',
            },
        )
        result = load(made)
        assert [each.code for each in result.diagnostics if each.code != "unraised-event"] == [], result.diagnostics
        assert result.scenario is not None
        return result.scenario


def events(scenario: Scenario) -> list[str]:
    """What the participant can do."""
    return sorted(
        {way.event for state in scenario.rules["P"].states.values() for way in state.transitions if way.event}
    )


def play(scenario: Scenario, way: tuple[str, ...]) -> Session:
    """A session of the pattern, along a way of what the participant and the robot do."""
    session = Session(scenario)
    session.rule("P")
    for step in way:
        take(session, step)
    return session


def take(session: Session, step: str) -> None:
    if step.startswith("/"):
        session.event(step)
    elif step == "silence":
        for _ in range(PATIENCE):
            before = state(session)
            session.wait(1)
            if state(session) != before:
                break
    elif session.goals:
        session.do(ActionReport(action=next(iter(session.goals)), status=step))  # type: ignore[arg-type]
    for goal in session.cancels:  # the robot stops what it is told to stop
        if goal in session.goals:
            session.report(goal, "canceled")


def state(session: Session) -> str:
    """Where the rule is, or in which state it has ended."""
    return [each for each in session.records if isinstance(each, RuleRecord) and each.name == "P"][-1].state


def ways(scenario: Scenario) -> Iterator[tuple[str, ...]]:
    """One shortest way to each state, and on each transition, of the pattern: all that can happen, state by state."""
    steps = (*(f"/{event}" for event in events(scenario)), "succeeded", "failed", "silence")
    seen: set[tuple[str, bool]] = set()
    rest: list[tuple[str, ...]] = [()]
    while rest:
        way = rest.pop(0)
        session = play(scenario, way)
        here = (state(session), bool(session.goals))
        yield way
        if here in seen or "P" not in session.states:
            continue
        seen.add(here)
        rest += [(*way, step) for step in steps if step != "failed" or session.goals]


@pytest.mark.parametrize("pattern", OUTCOMES)
def test_every_outcome_is_reached(pattern: str) -> None:
    scenario = example(pattern)
    ended, entered = set(), set()
    for way in ways(scenario):
        session = play(scenario, way)
        entered.add(state(session))
        if "P" not in session.states:
            ended.add(state(session))
        rejected = [each for each in session.records if isinstance(each, TaskRecord) and each.status == "REJECTED"]
        assert rejected == [], "nothing is stopped that does not run"
    assert ended == OUTCOMES[pattern]
    assert entered == set(scenario.rules["P"].states), "and every state"


@pytest.mark.parametrize("pattern", OUTCOMES)
@pytest.mark.parametrize("robot", ["succeeded", "failed"])
def test_it_ends_from_every_state_when_the_participant_says_nothing(pattern: str, robot: str) -> None:
    scenario = example(pattern)
    for way in ways(scenario):
        session = play(scenario, way)
        for _ in range(STEPS):
            while session.goals:
                take(session, robot)
            take(session, "silence")
        assert session.states == {}, f"after {way}"


@pytest.mark.parametrize("pattern", OUTCOMES)
def test_an_act_by_hand_does_not_move_it_on(pattern: str) -> None:
    """Whatever the wizard starts beside it, and however that ends."""
    scenario = example(pattern)
    for way in ways(scenario):
        session = play(scenario, way)
        before = state(session)
        tasks = [session.act(name, "None").id for name in scenario.acts]
        for goal in [goal for goal in session.goals if int(goal.split("/")[0]) in tasks]:
            session.report(goal, "failed")
        assert state(session) == before, f"after {way}"


def test_what_the_wizard_has_the_robot_say_begins_the_wait_anew() -> None:
    scenario = example("Reprompt")
    session = play(scenario, ())
    session.wait(7)
    session.act("R_last_prompt")
    session.wait(0.5)
    session.finish_all()
    session.wait(7.5)
    assert state(session) == "Listen"
    session.wait(0.5)
    assert state(session) == "Prompt"


@pytest.mark.parametrize("pattern", OUTCOMES)
def test_every_start_of_an_act_deals_with_its_failure(pattern: str) -> None:
    for each in example(pattern).rules["P"].states.values():
        for function in functions_in(each.on_entry):
            if function.name == "startCommunicationRobotAct":
                ends = [way for way in each.transitions if way.ended == function.argument]
                assert ends and not ends[-1].outcomes


def test_the_library_is_what_the_page_describes() -> None:
    names = {path.stem for path in LIBRARY.glob("*.xml")}
    assert names == {*OUTCOMES, "SayThen"}
    sections = re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    assert {name for name, _ in sections} >= names
    for name, text in sections:
        if name in names:
            every = {"name", "priority"} if name in OUTCOMES else set()
            assert every | set(re.findall(r"^- `(\w+)`", text, re.MULTILINE)) == set(parameters(name)), name
        if name in OUTCOMES:
            drawn = set(re.findall(r"\[([A-Z][\w ]*)\]", text))
            assert drawn == set(example(name).rules["P"].states), name


def test_the_examples_of_the_page_are_right(tmp_path: Path) -> None:
    text = PAGE.read_text("utf-8")
    acts = re.findall(r"\"(R_\w+)\"", text)
    body = "\n".join(re.findall(r"```xml\n(<use .*?)```", text, re.DOTALL))
    files: dict[str, str | bytes] = {
        "acts/a.xml": "<Dialogs>" + "".join(dialog(name, speech(1)) for name in dict.fromkeys(acts)) + "</Dialogs>",
        "rules/r.xml": f"<InteractionRules>{body}</InteractionRules>",
    }
    result = load(folder(tmp_path, files))
    assert [str(each) for each in result.errors] == []
    assert result.scenario is not None and len(result.scenario.rules) == len(OUTCOMES)
    assert "patterns/Greeting.xml" in result.files, "a session keeps what it used of the library"
    again = load(folder(tmp_path / "kept", dict(result.files)))
    assert again.scenario is not None and again.scenario.hash == result.scenario.hash


def test_a_template_of_the_scenario_comes_before_the_library(tmp_path: Path) -> None:
    mine = '<InteractionRule name="Mine" initial="S"><State id="S"/></InteractionRule>'
    own = f'<Template name="Goodbye">{mine}</Template><use template="Goodbye"/>'
    result = load(folder(tmp_path / "own", {"rules/r.xml": f"<InteractionRules>{own}</InteractionRules>"}))
    assert result.scenario is not None and list(result.scenario.rules) == ["Mine"]
    wrong = '<InteractionRules><use template="Godbye"/></InteractionRules>'
    near = load(folder(tmp_path / "near", {"rules/r.xml": wrong}))
    assert "did you mean `Goodbye`?" in near.diagnostics[0].message

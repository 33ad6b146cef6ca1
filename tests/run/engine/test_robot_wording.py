"""What the robot is given to say, and what stands in the record (semantics.md 2.5)."""

from __future__ import annotations

import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import ActionRecord, AnyRecord
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.run.engine.drivers import make_robot
from rise_engine.run.engine.engine import Engine
from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.model import Action, ActionSpec, LexiconTable, Parameter, Scenario
from rise_engine.scenario.reading.lexicon import Pronunciation, RobotWording, words_for
from rise_engine.scenario.speech.ssml import literal_ssml, plain_words
from tests.run.engine.samples import act, call, profile, scenario, speech, start

WORDS = {
    "Rise": "rize",
    "rise up": "get up",
    "e.g.": "for example",
    "Dr": "doctor",
    "Dr. Who": "the doctor",
    "%": " percent",
}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Rise", "rize"),
        ("This is Rise.", "This is rize."),
        ("Rise's and Rise-like", "rize's and rize-like"),
        ("RISE rise", "RISE rise"),  # an entry with a capital is for this way of writing
        ("Enterprise Riser _Rise Rise2 préRise", "Enterprise Riser _Rise Rise2 préRise"),
        ("Rise up, RISE UP, and rise \n up", "get up, get up, and get up"),  # in small letters: for any
        ("Rise upon", "rize upon"),
        ("Dr. Who and Dr. Jekyll", "the doctor and doctor. Jekyll"),  # the longest first
        ("e.g.this, E.g. that; ie.g.", "for examplethis, for example that; ie.g."),
        ("50% of 5 %", "50 percent of 5  percent"),
        ("", ""),
        ("nothing  to\tsay", "nothing  to\tsay"),  # untouched
    ],
)
def test_whole_words_and_the_longest_first(text: str, said: str) -> None:
    assert Pronunciation(WORDS).apply(text) == said


@pytest.mark.parametrize(
    ("words", "text", "said"),
    [
        ({"rise": "a", "Rise": "b"}, "rise Rise RISE", "a b a"),
        ({"grün": "gruen"}, "Gru\u0308n, GRÜN", "gruen, gruen"),
        ({"u": "you"}, "Gru\u0308n u", "Gr\u00fcn you"),  # what is sent has been made one form
        ({"東京": "とうきょう"}, "東京都へ", "とうきょう都へ"),  # no blanks between words
        ({"क": "ka"}, "काम क", "काम ka"),  # a vowel sign belongs to its letter
        ({"a": "b", "b": "c"}, "a b", "b c"),  # what was put in stays
        ({"ß": "ss"}, "ß SS", "ss SS"),
        ({"i\u0307": "x"}, "\u0130 i", "\u0130 i"),
        ({}, "Rise", "Rise"),
    ],
)
def test_writing_of_all_kinds(words: dict[str, str], text: str, said: str) -> None:
    assert Pronunciation(words).apply(text) == said


TEXT = st.text("abAB .-", max_size=30)
WORD = st.text("abAB-", min_size=1, max_size=3)


@given(st.dictionaries(WORD, WORD, max_size=6), TEXT)
def test_it_replaces_what_a_pattern_would(words: dict[str, str], text: str) -> None:
    def pattern(word: str) -> str:
        start, end = r"(?<!\w)" * word[0].isalnum(), r"(?!\w)" * word[-1].isalnum()
        return f"{start}{f'(?i:{re.escape(word)})' if word == word.lower() else re.escape(word)}{end}"

    entries = sorted(words, key=lambda word: (-len(word), word == word.lower(), word))
    said = re.sub(
        "|".join(f"({pattern(word)})" for word in entries) or r"(?!)",
        lambda match: words[entries[(match.lastindex or 0) - 1]],
        re.sub(r"\s+", " ", text),
    )
    assert re.sub(r"\s+", " ", Pronunciation(words).apply(text)) == said


def test_which_words_hold() -> None:
    lexicon = (
        LexiconTable("en", "pepper", {"a": "pepper, en"}),
        LexiconTable("en-GB", "", {"a": "all, en-GB", "b": "all, en-GB"}),
        LexiconTable("en", "", {"a": "all, en", "b": "all, en", "c": "all, en"}),
        LexiconTable("en", "nao", {"c": "nao, en"}),
        LexiconTable("de", "", {"c": "all, de"}),
    )
    assert words_for(lexicon, "en", "pepper") == {"a": "pepper, en", "b": "all, en", "c": "all, en"}
    assert words_for(lexicon, "EN-gb", "pepper") == {"a": "pepper, en", "b": "all, en-GB", "c": "all, en"}
    assert words_for(lexicon, "en-GB", "floka") == {"a": "all, en-GB", "b": "all, en-GB", "c": "all, en"}
    assert words_for(lexicon, "enx", "nao") == words_for(lexicon, "", "nao") == {}


# --- in a session ---------------------------------------------------------------------------------------------------


class Listening:
    """A robot that does what another one does, and keeps what it was given."""

    def __init__(self, robot: Any) -> None:
        self.robot = robot
        self.goals: list[StartAction] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.robot, name)

    def start(self, goal: StartAction) -> None:
        self.goals.append(goal)
        self.robot.start(goal)


def play(which: Scenario, *tasks: Submit) -> tuple[list[StartAction], list[ActionRecord]]:
    """What the robot was given, and what the record has of its actions."""
    clock, records = VirtualClock(), list[AnyRecord]()
    robot = Listening(make_robot(which.robot, "debug", clock, 1))
    engine = Engine(which, robot, clock, 1, sinks=[records.append])
    engine.start()
    for task in tasks:
        engine.accept(task)
    while not engine.idle and clock.advance():
        pass
    return robot.goals, [record for record in records if isinstance(record, ActionRecord)]


def study(*actions: Action, language: str = "en") -> Scenario:
    tables = (LexiconTable("en", "", {"Rise": "rize"}), LexiconTable("de", "", {"Rise": "Reis"}))
    return replace(scenario(act("Greet", *actions)), language=language, lexicon=tables)


def test_the_robot_gets_the_word_as_it_says_it_and_the_record_keeps_the_text() -> None:
    goals, records = play(study(speech("1", "This is Rise.")), start("Greet"), Submit(function="say", behavior="Rise!"))
    assert [goal.parameters for goal in goals] == [{"message": "This is rize."}, {"message": "rize!"}]
    assert {record.parameters["message"] for record in records} == {"This is Rise.", "Rise!"}
    spec = profile().actions["Speech"]
    assert [goal.expected for goal in goals] == [
        expected_seconds(spec, {"message": text}) for text in ("This is Rise.", "Rise!")
    ]


def test_memory_values_are_said_so_too() -> None:
    which = replace(study(speech("1", "Hello {name}!")), memory={"name": "Rise"})
    goals, records = play(which, start("Greet"))
    assert goals[0].parameters == {"message": "Hello rize!"} and records[0].parameters == {"message": "Hello Rise!"}


def test_an_action_may_be_in_another_language() -> None:
    german = Action("1", (call("Speech", message="Rise", language="de-AT"),))
    goals, _ = play(study(german), start("Greet"))
    assert goals[0].parameters == {"message": "Reis", "language": "de-AT"}
    goals, _ = play(study(speech("1", "Rise"), language=""), start("Greet"))
    assert goals[0].parameters == {"message": "Rise"}


def test_a_record_without_lexicon_is_the_same_record() -> None:
    with_words, without = study(speech("1", "Rise")), replace(study(speech("1", "Rise")), lexicon=())
    assert play(with_words, start("Greet"))[1] == play(without, start("Greet"))[1]


@pytest.mark.parametrize(
    ("type", "channels", "parameter"),
    [("ShowText", ("tablet",), "message"), ("Play", ("speech",), "file")],
)
def test_what_is_not_said_is_left_alone(type: str, channels: tuple[str, ...], parameter: str) -> None:
    spec = ActionSpec(type, {parameter: Parameter(parameter, "text")}, channels)
    which = study(speech("1"))
    which = replace(which, robot=replace(which.robot, actions={**which.robot.actions, type: spec}))
    for action, parameters in ((type, {parameter: "Rise"}), ("Speech", {"message": "nothing of that"}), ("No", {})):
        assert RobotWording(which).parameters_for_robot(action, parameters) is parameters


# --- SSML -----------------------------------------------------------------------------------------------------------

SSML = '<speak>Rise <break time="2s"/><emphasis>is {name}</emphasis></speak>'
FILLED = '<speak>Rise <break time="2s"/><emphasis>is A &amp; B</emphasis></speak>'


def reads_ssml(which: Scenario, takes: bool) -> Scenario:
    actions = {name: replace(spec, ssml=takes) for name, spec in which.robot.actions.items()}
    return replace(which, robot=replace(which.robot, actions=actions), memory={"name": "A & B"})


def test_a_robot_that_takes_ssml_gets_it_with_the_lexicon_between_the_tags() -> None:
    goals, records = play(reads_ssml(study(speech("1", SSML)), True), start("Greet"))
    assert goals[0].parameters == {"message": FILLED.replace("Rise", "rize")}
    assert records[0].parameters == {"message": FILLED}
    words = expected_seconds(profile().actions["Speech"], {"message": "Rise is A & B"})
    assert goals[0].expected == pytest.approx(words + 2.0)


def test_a_robot_that_takes_none_gets_the_words() -> None:
    goals, records = play(reads_ssml(study(speech("1", SSML)), False), start("Greet"))
    assert goals[0].parameters == {"message": "rize is A & B"} and records[0].parameters == {"message": FILLED}
    assert goals[0].expected == expected_seconds(profile().actions["Speech"], {"message": "Rise is A & B"})


def test_a_part_in_another_language_is_said_in_it() -> None:
    german = speech("1", '<speak>Rise <lang xml:lang="de">Rise</lang> <lang xml:lang="it">Rise</lang></speak>')
    goals, _ = play(reads_ssml(study(german), True), start("Greet"))
    assert goals[0].parameters == {
        "message": '<speak>rize <lang xml:lang="de">Reis</lang> <lang xml:lang="it">Rise</lang></speak>'
    }


@pytest.mark.parametrize("typed", ["<speak>Rise</speak>", "<speak>a & b", "<speak/>"])
@pytest.mark.parametrize("takes", [True, False])
def test_what_a_wizard_types_is_no_markup(typed: str, takes: bool) -> None:
    which = replace(reads_ssml(study(speech("1")), takes), lexicon=())
    goals, records = play(which, Submit(function="say", behavior=typed))
    assert goals[0].parameters == {"message": literal_ssml(typed) if takes else typed}
    assert plain_words(records[0].parameters["message"]) == typed
    assert goals[0].expected == expected_seconds(profile().actions["Speech"], {"message": literal_ssml(typed)})


@pytest.mark.parametrize(
    ("value", "takes", "given"),
    [
        ("<speak>a & b", False, "<speak>a & b"),
        ("<speak>a & b", True, "<speak>&lt;speak&gt;a &amp; b</speak>"),
        ("<speak>a <s>b</s></speak>", True, "<speak>a <s>b</s></speak>"),
        ("<speak>a <s>b</s></speak>", False, "a b"),
        ("a & b", True, "a & b"),
    ],
)
def test_a_message_from_the_memory_is_never_half_markup(value: str, takes: bool, given: str) -> None:
    which = replace(reads_ssml(study(speech("1", "{text}")), takes), memory={"text": value})
    goals, records = play(which, start("Greet"))
    assert goals[0].parameters == {"message": given} and records[0].parameters == {"message": value}


def test_what_is_shown_on_a_tablet_has_no_tags_and_no_other_words() -> None:
    spec = ActionSpec("Show", {"message": Parameter("message", "text")}, ("tablet",))
    which = study(speech("1"))
    which = replace(which, robot=replace(which.robot, actions={**which.robot.actions, "Show": spec}))
    parameters = RobotWording(which).parameters_for_robot("Show", {"message": "<speak>Rise <s/></speak>"})
    assert parameters == {"message": "Rise"}

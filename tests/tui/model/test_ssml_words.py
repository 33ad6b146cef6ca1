"""Where the robot's words stand on the screen, they stand without markup."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_engine.author.drawing.act_graph import estimate_call_seconds
from rise_engine.kernel.record_words import parameters_text
from rise_engine.scenario.model import Function, LexiconTable, Scenario, State, Transition
from rise_tui.key_labels import key_name
from rise_tui.model.act_text import ActText, shown_act
from rise_tui.model.failures import unspoken_texts
from rise_tui.model.log_text import task_rows
from rise_tui.model.resumption import entry_lines
from rise_tui.model.speech import longest_sentence, remaining_sentences, scenario_sentences
from rise_tui.model.speech_band import speech_band_lines
from rise_tui.model.store import Store
from rise_tui.rendering.text import plain_text
from tests.scenario.folders import loaded
from tests.tui.fake import FakeClient

SSML = '<speak>Hello <break time="3s"/><emphasis>{name}</emphasis>!</speak>'
SENT = '<speak>Hello <break time="3s"/><emphasis>A &amp; B</emphasis>!</speak>'
HEARD = "Hello A & B!"
ACTS = (
    f'<Dialog name="Greet"><Speech><actionID>1</actionID><message>{SSML}</message></Speech>'
    f"<Speech><actionID>2</actionID><waitForActions>1</waitForActions><message>{SSML}</message></Speech></Dialog>"
)


@pytest.fixture
def study(tmp_path: Path) -> Scenario:
    scenario = loaded(tmp_path, {"acts/a.xml": ACTS, "memory.json": '{"name": "A & B"}'}).scenario
    assert scenario is not None
    return scenario


def store_of(client: FakeClient) -> Store:
    return Store(client.attach_reply(), "anna", client.now)


def greeting(study: Scenario) -> tuple[FakeClient, int]:
    client = FakeClient(study)
    task = client.act("Greet")
    for status in ("started", "accepted"):
        client.action(task, "Greet", "1", "Speech", status, message=SENT)
    return client, task


def test_what_the_robot_says_and_what_comes_next(study: Scenario) -> None:
    client, _ = greeting(study)
    store = store_of(client)
    assert store.current_sentence().text == HEARD
    assert remaining_sentences(study, store.view, store.memory) == [HEARD]
    assert longest_sentence(study, {"name": "Ada"}) == "Hello Ada!"
    assert longest_sentence(study, {}) == "Hello {name}!"
    assert HEARD in plain_text(speech_band_lines(store, 80, 2, key_name)[0])


def test_the_act_pane_has_the_words_and_tells_of_the_markup_where_there_is_room_for_it(study: Scenario) -> None:
    client, _ = greeting(study)
    store = store_of(client)
    shown, text = shown_act(store), ActText(store)
    assert shown is not None
    rows = [plain_text(row.line) for row in text.rows(shown, 100)]
    assert sum(HEARD in row for row in rows) == 2 and not any("<" in row for row in rows)
    begun = " ".join(" ".join(plain_text(line).split()) for line in text.details(shown, "1", 200))
    assert f"message {HEARD}" in begun and f"the robot is given: {SENT}" in begun
    coming = " ".join(" ".join(plain_text(line).split()) for line in text.details(shown, "2", 200))
    assert f"message {HEARD}" in coming and f"written: {SSML}" in coming


def test_the_act_pane_tells_in_which_words_the_robot_is_given_it(study: Scenario) -> None:
    takes_none = {name: replace(spec, ssml=False) for name, spec in study.robot.actions.items()}
    plain = replace(study, robot=replace(study.robot, actions=takes_none))
    lexicon = (LexiconTable("en", "", {"Hello": "Helloh"}),)
    for scenario, given in (
        (plain, ""),
        (replace(plain, lexicon=lexicon), ""),  # nobody says that it is English
        (replace(plain, lexicon=lexicon, language="en"), "the robot is given: Helloh A & B!"),
        (replace(study, lexicon=lexicon, language="en"), f"the robot is given: {SENT.replace('Hello', 'Helloh')}"),
    ):
        client, _ = greeting(scenario)
        store = store_of(client)
        shown = shown_act(store)
        assert shown is not None
        for id in ("1", "2"):
            lines = (" ".join(plain_text(line).split()) for line in ActText(store).details(shown, id, 200))
            assert [line for line in lines if line.startswith("the robot is given")] == ([given] if given else [])


def test_the_details_of_a_task(study: Scenario) -> None:
    client, task = greeting(study)
    store = store_of(client)
    rows = task_rows(store.view.tasks[task], store.now(), 80)
    assert f"message {HEARD}" in [" ".join(plain_text(row.line).split()) for row in rows]


def test_what_a_failed_act_did_not_say(study: Scenario) -> None:
    client, task = greeting(study)
    client.time += 1
    client.action(task, "Greet", "1", "Speech", "failed", message=SENT)
    client.end_task(task, "Greet", "ABORTED", "it went wrong")
    store = store_of(client)
    assert [each.text for each in unspoken_texts(study, store.view.tasks[task], store.memory)] == [HEARD, HEARD]
    assert [each.text for each in unspoken_texts(study, store.view.tasks[task], {})] == [HEARD, "Hello {name}!"]


def test_what_a_state_would_say_at_once(study: Scenario) -> None:
    greet = Function("startCommunicationRobotAct", "Greet")
    state = State("S", (greet,), transitions=(Transition("next"),))
    assert entry_lines(study, state, study.memory, 80) == [f"says “{HEARD}” “{HEARD}”"]


def test_the_say_line_offers_words(study: Scenario) -> None:
    assert scenario_sentences(study) == ("Hello {name}!",)


def test_a_transcript_is_what_was_heard() -> None:
    assert parameters_text({"message": SENT}, in_ms=True) == f'"{HEARD}"'
    assert parameters_text({"message": "a < b"}, in_ms=True) == '"a < b"'
    assert parameters_text({"message": 5}, in_ms=True) == "5"


def test_breaks_count_where_they_are_made(study: Scenario) -> None:
    call = study.acts["Greet"].actions[0].calls[0]
    seconds = estimate_call_seconds(study, call, study.memory)
    assert seconds is not None and seconds == pytest.approx(3.3 + len(HEARD) / 14)

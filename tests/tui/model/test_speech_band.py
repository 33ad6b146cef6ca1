"""The band below the top line: what the robot says, what it did not say, and what comes next. By the records alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from rise_engine.kernel.records import CueRecord, MemoryRecord, SessionRecord
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import FillerSettings, Scenario
from rise_tui.key_labels import key_name
from rise_tui.model.speech_band import sentence_height, speech_band_lines
from rise_tui.model.store import Store
from rise_tui.rendering.text import TextRole, line_width, plain_text
from tests.scenario.folders import act, folder, rule
from tests.tui.conftest import console
from tests.tui.fake import FakeClient, demo

SIZES = ((80, 24), (120, 40), (200, 50))
SCENARIOS = Path(__file__).parents[3] / "scenarios"


def scenario(name: str) -> Scenario:
    found = load(str(SCENARIOS / name)).scenario
    assert found is not None
    return found


class Played:
    """A store that follows a client."""

    def __init__(self, of: Scenario | None = None) -> None:
        self.client = FakeClient(of or demo())
        self.client.time = 100.0
        self.store = Store(self.client.attach_reply(), "anna", self.client.now)
        emit = self.client.emit

        def emitted(*records: Any, at: float | None = None) -> None:
            emit(*records, at=at)
            self.store.apply(records)

        self.client.emit = emitted  # type: ignore[method-assign]

    def lines(self, width: int = 80, rows: int = 2) -> list[str]:
        made = speech_band_lines(self.store, width, rows, key_name)
        assert len(made) == rows + 1 and all(line_width(line) <= width for line in made)
        return [plain_text(line).rstrip() for line in made]

    @property
    def first(self) -> str:
        return self.lines()[0]

    @property
    def next(self) -> str:
        return self.lines()[-1]

    def roles(self) -> set[TextRole]:
        return {role for text, role in speech_band_lines(self.store, 80, 2, key_name)[0] if text.strip()}

    def greet(self) -> int:
        """Greet says its first sentence."""
        task = self.client.act("Greet", source="rule:Main")
        self.client.action(task, "Greet", "1", "Speech", "started", message="Hello Ada!")
        self.client.action(task, "Greet", "1", "Speech", "accepted", message="Hello Ada!")
        return task


# --- the sentence ---------------------------------------------------------------------------------------------------


def test_a_sentence_that_was_sent_is_not_yet_said() -> None:
    it = Played()
    task = it.client.act("Greet")
    it.client.action(task, "Greet", "1", "Speech", "started", message="Hello Ada!")
    assert it.first.startswith(" ↑ “Hello Ada!”") and it.first.endswith(" sent")
    it.client.action(task, "Greet", "1", "Speech", "accepted", message="Hello Ada!")
    assert it.first.startswith(" ► “Hello Ada!”") and it.first.endswith(" s left")


def test_what_is_left_counts_down_and_then_over() -> None:
    it = Played()
    it.greet()
    left = float(it.first.split()[-3])
    it.client.time += 0.5
    assert float(it.first.split()[-3]) == pytest.approx(left - 0.5, abs=0.11)
    it.client.time += 30
    assert it.first.endswith(" s over")


def test_a_sentence_counts_from_the_moment_at_which_the_robot_takes_it() -> None:
    it = Played()
    task = it.client.act("Greet")
    it.client.action(task, "Greet", "1", "Speech", "started", message="Hello Ada!")
    it.client.time += 5  # the robot was busy
    it.client.action(task, "Greet", "1", "Speech", "accepted", message="Hello Ada!")
    assert it.first.endswith(" s left")
    it.client.time += 3
    it.client.action(task, "Greet", "1", "Speech", "succeeded", message="Hello Ada!")
    it.client.end_task(task, "Greet")
    it.greet()
    assert it.first.endswith(" 3.0 s left"), "that is how long it takes to say it"


def test_a_sentence_that_was_said_before_is_estimated_by_how_long_it_took() -> None:
    it = Played()
    task = it.greet()
    it.client.time += 7.5
    it.client.action(task, "Greet", "1", "Speech", "succeeded", message="Hello Ada!")
    it.client.end_task(task, "Greet")
    it.greet()
    assert it.first.endswith(" 7.5 s left")


def test_this_robots_pace_counts_for_other_sentences_too() -> None:
    it = Played()
    it.greet()
    usual = it.store.current_sentence().seconds
    assert usual is not None
    other = Played()
    task = other.client.act("Praise")
    other.client.action(task, "Praise", "1", "Speech", "started", message="Hello Bob!")  # as long as the other
    other.client.time += 2 * usual
    other.client.action(task, "Praise", "1", "Speech", "succeeded", message="Hello Bob!")
    other.client.end_task(task, "Praise")
    other.greet()
    slow = other.store.current_sentence().seconds
    assert slow == pytest.approx(2 * usual)


def test_when_it_is_silent_the_last_sentence_stays_with_its_age() -> None:
    it = Played()
    assert it.first == " · the robot has said nothing yet"
    task = it.greet()
    it.client.action(task, "Greet", "1", "Speech", "succeeded", message="Hello Ada!")
    it.client.end_task(task, "Greet")
    it.client.time += 12
    assert it.first.startswith(" ✓ “Hello Ada!”") and it.first.endswith("said 12 s ago")
    assert it.roles() == {"muted"}


@pytest.mark.parametrize(
    ("status", "shown"),
    [
        ("failed", "✗ NOT FINISHED: “Hello Ada!”"),
        ("canceled", "✗ NOT FINISHED: “Hello Ada!”"),
        ("timed-out", "✗ PERHAPS NOT SAID: “Hello Ada!”"),
        ("lost", "✗ PERHAPS NOT SAID: “Hello Ada!”"),
    ],
)
def test_what_was_not_said_stays_in_the_colour_of_faults_until_the_next_sentence(status: str, shown: str) -> None:
    it = Played()
    task = it.greet()
    it.client.time += 0.7
    it.client.action(task, "Greet", "1", "Speech", status, message="Hello Ada!")
    it.client.action(task, "Greet", "4", "Speech", "skipped", message="Please put the fork to the {side}.")
    it.client.end_task(task, "Greet", "ABORTED", "the robot has no voice")
    it.client.time += 100
    assert it.first.startswith(f" {shown} and 1 more") and it.first.endswith("after 0.7 s")
    assert it.roles() == {"fault"}
    praise = it.client.act("Praise")
    it.client.action(praise, "Praise", "1", "Speech", "accepted", message="Well done.")
    assert it.first.startswith(" ► “Well done.”")


def test_a_sentence_that_was_never_begun_was_not_said_at_all() -> None:
    it = Played()
    task = it.client.act("Greet")
    it.client.action(task, "Greet", "1", "Speech", "skipped", message="Hello Ada!")
    it.client.end_task(task, "Greet", "ABORTED", "action 2 (Animation) failed")
    assert it.first.startswith(" ✗ NOT SAID: “Hello Ada!”")


def test_the_sentence_is_never_cut_and_what_does_not_fit_is_a_window_around_what_is_being_said() -> None:
    it = Played()
    words = " ".join(f"word{number}" for number in range(100))
    task = it.client.task("say", words)
    it.client.action(task, "say", "say", "Speech", "accepted", message=words)
    begin = " ".join(it.lines(rows=3))
    assert "word0 " in begin and " …" in begin and "word99" not in begin
    seconds = it.store.current_sentence().seconds
    assert seconds is not None
    it.client.time += seconds * 0.5
    middle = " ".join(it.lines(rows=3))
    assert "word50" in middle and "word0 " not in middle and "word99" not in middle
    it.client.time += seconds * 0.49
    assert "word99”" in " ".join(it.lines(rows=3))


@pytest.mark.parametrize("name", ["lablinking", "greeting", "lab_opening"])
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_every_sentence_of_the_shipped_studies_is_shown_whole_at_every_size(name: str, width: int, height: int) -> None:
    of = scenario(name)
    rows = sentence_height(of, of.memory, width, height)
    assert rows <= (4 if height >= 30 else 3)
    for each in of.acts.values():
        for action in each.actions:
            for call in action.calls:
                if call.type != "Speech":
                    continue
                it = Played(of)
                text = call.parameters["message"].text
                task = it.client.act(each.name)
                it.client.action(task, each.name, action.id, "Speech", "accepted", message=text)
                shown = " ".join(" ".join(it.lines(width, rows)[:rows]).replace(it.first[-14:], " ").split())
                assert all(word in shown for word in f"“{text.strip()}”".split()), (text, shown)


def test_the_sentences_that_follow_in_the_act_are_told() -> None:
    it = Played()
    it.greet()
    assert it.lines()[1] == "   then  “Please put the fork to the left.”"
    assert it.lines(rows=1)[-1].startswith(" next  “Please put the fork to the left.”")


def test_an_action_with_another_name_that_speaks_is_what_the_robot_says(tmp_path: Path) -> None:
    """A study's own, or a robot's of another make: what counts is that it uses the voice."""
    own = '[actions.Whisper]\nchannels = ["speech"]\nparameters.words = { type = "text", required = true }\n'
    body = "<Whisper><actionID>1</actionID><words>Come closer.</words></Whisper>"
    files: dict[str, str | bytes] = {"scenario.toml": own, "acts/a.xml": act(body)}
    found = load(str(folder(tmp_path, files))).scenario
    assert found is not None
    it = Played(found)
    task = it.client.act("A")
    assert it.lines()[-1].startswith(" next  “Come closer.”") or "“Come closer.”" in it.lines()[1]
    it.client.action(task, "A", "1", "Whisper", "accepted", words="Come closer.")
    assert it.first.startswith(" ► “Come closer.”")


def test_who_sees_only_the_last_known_state_is_not_told_that_it_is_said() -> None:
    it = Played()
    it.greet()
    it.store.gone_reason = "killed"
    assert it.first.endswith("not known") and it.next == " next  nothing: the engine has gone"


def test_a_console_that_attaches_late_knows_what_was_said_last() -> None:
    it = Played()
    task = it.greet()
    it.client.action(task, "Greet", "1", "Speech", "failed", message="Hello Ada!")
    it.client.end_task(task, "Greet", "ABORTED", "no voice")
    late = Store(it.client.attach_reply(), "ben", it.client.now)
    assert late.current_sentence() == it.store.current_sentence() and late.current_sentence().kind == "unsaid"


# --- what comes next ------------------------------------------------------------------------------------------------


def test_nothing_comes_when_no_rule_runs_and_the_first_key_of_a_rule_is_named() -> None:
    assert Played().next == " next  nothing scheduled; no rule running  ·  you: m Main"


def test_what_a_rule_does_when_the_act_ends_and_what_it_waits_for_then() -> None:
    it = Played()
    it.client.rule("Main", "started", "greeting", trigger="start")
    it.client.act("Greet", source="rule:Main")
    assert it.lines(120)[-1].endswith("→ waiting  ·  then you: n next")


def test_a_timer_that_runs_is_told_with_its_time_and_so_are_the_keys() -> None:
    it = Played()
    it.client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
    it.client.time += 596
    assert it.next == " next  in 4.0 s: → over, and Main ends  ·  or you: n next"


def test_a_task_that_waits_its_turn_comes_before_what_a_rule_starts_then() -> None:
    it = Played()
    it.client.rule("Main", "started", "greeting", trigger="start")
    it.client.act("Greet", source="rule:Main")
    it.client.act("Praise", "PENDING")
    assert it.lines(160)[-1].endswith("Praise (waits)  ·  → waiting")


def test_a_key_whose_condition_does_not_hold_is_not_offered() -> None:
    it = Played()
    it.client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
    assert "repeat" not in it.next and "a Again" not in it.next
    for key, value in (("task", 4), ("understood", True)):
        it.client.emit(MemoryRecord(0, 0.0, "", key, value, None, "wizard:anna"))
    assert "n next  a Again" in it.next


def test_nothing_comes_while_it_is_stopped_and_nobody_presses_keys_elsewhere() -> None:
    it = Played()
    it.client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
    it.client.stop("latched")
    assert it.next == " next  nothing until the stop is released: ctrl+r"
    it.client.stop("released")
    it.client.control_record("taken", "wizard:ben", "wizard:ben")
    assert "or key: n next" in it.next


def test_a_filler_that_would_come_by_itself_is_told() -> None:
    it = Played(replace(demo(), fillers=FillerSettings(1.5, 4.0)))
    it.client.emit(CueRecord(0, 0.0, "", status="marked", source="wizard:anna"))
    it.client.time += 1
    assert it.next.startswith(" next  in 3.0 s: Filler")


def test_what_only_a_condition_decides_is_said_to_be_perhaps(tmp_path: Path) -> None:
    speech = "<Speech><actionID>1</actionID><message>Hello</message></Speech>"
    body = (
        '<State id="S"><transition after="5s" cond="n = 1" target="T"/>'
        '<transition eventTopic="/go" target="T"/></State>'
        '<State id="T"><onEntry><if cond="n = 1"><function startCommunicationRobotAct="A"/></if>'
        '<function startCommunicationRobotAct="B"/></onEntry><transition eventTopic="/B_end" target="S"/></State>'
    )
    files = {
        "acts/a.xml": f"<Dialogs>{act(speech)}{act(speech, 'B')}</Dialogs>",
        "rules/r.xml": rule(body),
        "memory.json": '{"n": 1}',
    }
    found = load(str(folder(tmp_path, files))).scenario  # type: ignore[arg-type]
    assert found is not None
    it = Played(found)
    it.client.rule("R", "started", "S", trigger="start")
    assert it.next == " next  in 5.0 s: if n = 1: → T: B, perhaps A"
    it.client.time += 7
    assert it.next == " next  waits for event go"  # the condition did not hold when the time was up


def test_the_session_is_over() -> None:
    it = Played()
    it.client.emit(SessionRecord(0, 0.0, "", status="ended", reason="by anna"))
    it.store.gone_reason, it.store.ended_in_order = "ended by anna", True
    assert it.next == " next  nothing: the session is over"


# --- on the screen --------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES)
async def test_it_stands_below_the_top_line_with_a_height_that_never_changes(size: tuple[int, int]) -> None:
    async with console(size=size) as it:
        region = it.bars.speech_band.region
        assert region.y == 1 and region.height == len(it.bars.speech_band.lines)
        it.client.rule("Main", "started", "greeting", trigger="start")
        task = it.client.act("Greet", source="rule:Main")
        it.client.action(task, "Greet", "1", "Speech", "accepted", message="Hello Ada! " * 30)
        await it.until(lambda: "► “Hello Ada!" in it.bars.speech_band.text)
        assert it.bars.speech_band.region == region
        await it.until(lambda: "→ waiting" in it.bars.speech_band.text)

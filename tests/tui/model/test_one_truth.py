"""Whatever happens in a session, no part of the screen contradicts another."""

from __future__ import annotations

from collections.abc import Callable

from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.kernel.records import FailureRecord, RobotRecord
from rise_tui.key_labels import key_name
from rise_tui.model.key_strip import key_strip_lines
from rise_tui.model.speech_band import speech_band_lines
from rise_tui.model.status import status_line
from rise_tui.model.store import Store
from rise_tui.panes.start_lists import ActsPane, RulesPane
from rise_tui.rendering.text import plain_text
from tests.chance import examples
from tests.tui.fake import FakeClient, demo

ACTS = ("Greet", "Praise", "Goodbye")


class Story:
    """A session of which a test draws what happens."""

    def __init__(self) -> None:
        self.client = FakeClient(demo())
        self.gone = ""
        self.running: dict[str, int] = {}

    def start(self, act: str) -> None:
        if act not in self.running:
            self.running[act] = self.client.act(act)
            self.client.action(self.running[act], act, "1", "Speech", "accepted", message=f"words of {act}")

    def end(self, act: str) -> None:
        if act in self.running:
            task = self.running.pop(act)
            self.client.action(task, act, "1", "Speech", "succeeded", message=f"words of {act}")
            self.client.end_task(task, act)

    def fail(self, act: str) -> None:
        if act in self.running:
            task = self.running.pop(act)
            self.client.action(task, act, "1", "Speech", "failed", message=f"words of {act}")
            self.client.end_task(task, act, "ABORTED", "the robot cannot")
            self.client.emit(FailureRecord(0, 0.0, "", task, act, "asked", "engine", reason="the robot cannot"))

    def rule(self, status: str) -> None:
        self.client.rule("Main", status, "greeting", trigger="start" if status == "started" else None)

    def stop(self, act: str) -> None:
        for running, task in self.running.items():
            self.client.end_task(task, running, "CANCELED", "stop-all")
        self.running.clear()
        self.client.stop("latched", ("pepper/speech",))

    def release(self, act: str) -> None:
        self.client.stop("released")

    def lose(self, act: str) -> None:
        self.client.emit(RobotRecord(0, 0.0, "", status="lost", detail="no answer"))

    def find(self, act: str) -> None:
        self.client.emit(RobotRecord(0, 0.0, "", status="connected"))

    def wait(self, act: str) -> None:
        self.client.time += 1.3

    def store(self) -> Store:
        """What a console knows that attaches now."""
        store = Store(self.client.attach_reply(), "anna", self.client.now)
        store.gone_reason = self.gone
        return store


MOVES: dict[str, Callable[[Story, str], None]] = {
    **{name: getattr(Story, name) for name in ("start", "end", "fail", "stop", "release", "lose", "find", "wait")},
    "the rule begins": lambda story, act: story.rule("started"),
    "the rule ends": lambda story, act: story.rule("ended"),
    "the engine goes": lambda story, act: setattr(story, "gone", "the engine has gone"),
}


def rows_of(pane: ActsPane | RulesPane) -> dict[str, str]:
    return {row.id: plain_text(row.line) for row in pane.make_rows(90)}


@settings(max_examples=examples(300))
@given(st.lists(st.tuples(st.sampled_from(sorted(MOVES)), st.sampled_from(ACTS)), max_size=14))
def test_no_part_of_the_screen_contradicts_another(moves: list[tuple[str, str]]) -> None:
    story = Story()
    for move, act in moves:
        MOVES[move](story, act)
    store = story.store()
    view = store.view
    status = plain_text(status_line(store, 120))
    *sentence, upcoming = [plain_text(line) for line in speech_band_lines(store, 120, 3, key_name)]
    strip = "\n".join(plain_text(line) for line in key_strip_lines(store, 200, 2).lines)
    acts, rules = rows_of(ActsPane(store)), rows_of(RulesPane(store))

    running = {view.tasks[id].behavior for id in view.running}
    for name, row in acts.items():
        key = store.key_of("startCommunicationRobotAct", name)
        assert ("► running" in row) is (name in running), "the list says what runs"
        assert key is not None and (f"►{key.label} " in strip) is (name in running), "the keys say the same"
    for name, row in rules.items():
        assert ("► running" in row) is store.rule(name).running

    robot = view.robot.status if view.robot is not None else ""
    assert ("● connected" in status) is (robot == "connected" and not store.gone_reason)
    assert ("✗ lost" in status) is (robot == "lost" and not store.gone_reason)
    assert (" LIVE " in status) is not bool(store.gone_reason or view.stop.latched)
    assert ("STOPPED" in status) is (view.stop.latched and not store.gone_reason)

    if store.gone_reason:
        assert "nothing: the engine has gone" in upcoming and "left" not in sentence[0]
    elif view.stop.latched:
        assert "nothing until the stop is released" in upcoming
    elif view.questions:
        assert " next  waits for you" in upcoming and "failed" in upcoming
    else:
        assert "failed" not in upcoming
    if running and not store.gone_reason:
        assert sentence[0].startswith(" ► “words of"), "what is said is what runs"
    else:
        assert "━" not in sentence[0], "no time passes for a sentence that nobody says"

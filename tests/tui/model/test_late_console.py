"""A console that attaches late shows what the first one shows: what became of events, and which rows matter."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

from rise_engine.author.trial.trial import SOURCE, Trial
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.view import SessionView
from rise_engine.run.protocol.messages import (
    TasksMessage,
    decode_server_message,
    encode_line,
    with_tasks,
    without_tasks,
)
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import event_behavior
from rise_tui.model.log_rows import task_of
from rise_tui.model.states import task_state
from rise_tui.model.store import Store
from tests.tui.fake import FakeClient

RULES = """<InteractionRules>
  <InteractionRule name="Talk" initial="wait">
    <State id="wait"><transition eventTopic="/yes" target="wait"/></State>
  </InteractionRule>
  <InteractionRule name="Ask" initial="ask">
    <State id="ask"><onEntry><function raiseEventTopic="/maybe"/><function raiseEventTopic="/yes"/></onEntry>
      <transition after="5s" target="again"/></State>
    <State id="again"><onEntry><function raiseEventTopic="/maybe"/></onEntry>
      <transition eventTopic="/cue" target="again"/></State>
  </InteractionRule>
</InteractionRules>"""


def played(tmp_path: Path) -> Trial:
    """Events of keys, of a rule that a key has just started and of one that runs by itself; kept ones, and cues."""
    (tmp_path / "rules").mkdir()
    (tmp_path / "rules" / "all.xml").write_text(RULES, "utf-8")
    (tmp_path / "memory.json").write_text('{"WorkingMemory": [{}]}', "utf-8")
    (tmp_path / "scenario.toml").write_text('title = "Late"\nrobot = "generic"\n', "utf-8")
    loaded = load(tmp_path)
    assert loaded.scenario is not None, loaded.diagnostics
    trial = Trial(loaded.scenario)
    trial.raise_event("/yes")
    trial.start_rule("Talk")
    trial.raise_event("/yes")
    trial.raise_event("/no")
    for event in ("/later", "/yes"):
        kept = event_behavior(event, 2.0)
        trial.submit(Submit(function="raiseEventTopic", behavior=kept, source=SOURCE))
    trial.mark_cue()
    trial.start_rule("Ask")
    trial.pass_time(6.0)
    trial.mark_cue()
    return trial


def shown(store: Store) -> list[tuple[str, str]]:
    """The rows of the log that are no rule's own, each with its state."""
    tasks = [store.view.tasks[task] for task in map(task_of, store.log.main) if task is not None]
    return [(task.behavior, task_state(task).word) for task in tasks]


def test_late_and_live_consoles_agree(tmp_path: Path) -> None:
    trial = played(tmp_path)
    client = FakeClient(trial.scenario, holder=None)
    client._view = SessionView()
    live = Store(client.attach_reply(), "anna", client.now)
    view = SessionView()
    steps = {step.first_record - 1 for step in trial.steps} | {len(trial.records)}
    for record in trial.records:
        live.apply([deepcopy(record)])
        view.apply(record)
        if record.seq in steps:
            sent = decode_server_message(encode_line(TasksMessage([*view.tasks.values()])))
            assert isinstance(sent, TasksMessage)
            client._view = with_tasks(without_tasks(view), sent.tasks)
            late = Store(client.attach_reply(), "ben", client.now)
            assert shown(late) == shown(live) and late.view == live.view
    assert shown(live) == [
        ("/yes", "not taken"),
        ("Talk", "running"),
        ("/yes", "done"),
        ("/no", "not taken"),
        ("/later", "not taken"),
        ("/yes", "done"),
        ("", "not taken"),
        ("Ask", "running"),
        ("/maybe", "not taken"),
        ("", "done"),
    ]

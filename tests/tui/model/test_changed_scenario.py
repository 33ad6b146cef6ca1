"""A console that attaches anew to a session that has taken over changed files shows what is so now."""

from __future__ import annotations

from msgspec.structs import replace

from rise_engine.kernel.view import SessionView
from rise_engine.run.protocol.client import AttachReply
from rise_engine.scenario.loader import load
from rise_tui.model.store import Store
from tests.sources import ROOT


def test_keys_words_and_acts_are_those_of_the_files_that_were_taken_over() -> None:
    scenario = load(ROOT / "scenarios/lablinking").scenario
    assert scenario is not None
    reply = AttachReply(scenario, "debug", scenario.robot.name, 1, SessionView(), you="wizard:anna")
    store = Store(reply, "anna", lambda: 0.0)
    keys = {name: each for name, each in scenario.keys.items() if each.label != "t"}
    wording = store.wording
    store.reattach(replace(store.attach_reply))
    assert store.wording is wording  # the same files: nothing is made again
    changed = replace(scenario, hash="0" * 64, keys=keys)
    store.reattach(replace(store.attach_reply, scenario=changed))
    assert store.scenario is changed and store.wording is not wording
    assert (
        store.study_keys.scenario is changed
        and store.study_keys.key_of("startInteractionRule", "Table setting") is None
    )

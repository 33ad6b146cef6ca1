"""Keys and cues that come to nothing when somebody is early, and keys that are notes."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.author.explore.exploration import explore
from rise_engine.author.explore.moves import Bounds
from tests.author.explore.exploring import of_kind
from tests.kernel.harness import dialog, read, speech, write

RULE = """<InteractionRule name="Ask" initial="Asks">
<State id="Asks"><onEntry><function startCommunicationRobotAct="R_Ask"/></onEntry>
  <transition ended="R_Ask" target="Listens"/></State>
<State id="Listens"><transition eventTopic="/{event}" target="Done"/><transition after="5s" target="Asks"/></State>
<State id="Done"/>
</InteractionRule>"""
BEGIN = '[keys]\nb = { rule = "Ask" }\n'


def lost(folder: Path, event: str, toml: str) -> list[tuple[str, str, str]]:
    scenario = read(write(folder, acts=dialog("R_Ask", speech(1)), rules=RULE.format(event=event), toml=toml))
    found = explore(scenario, Bounds(faults=0))
    return [(each.kind, each.level, each.text) for kind in ("lost-key", "lost-cue") for each in of_kind(found, kind)]


EARLY = "is lost when it comes a moment too early: while Ask is in Asks, no rule waits for"
KEEP_CUE = 'keep = "3s" under [cue] in scenario.toml keeps it'


@pytest.mark.parametrize(
    ("event", "toml", "expected"),
    [
        (
            "yes",
            f'{BEGIN}y = {{ event = "/yes", label = "says yes" }}',
            [("lost-key", "remark", f'the key y (says yes) {EARLY} /yes yet; keep = "3s" at the key keeps it')],
        ),
        ("yes", f'{BEGIN}y = {{ event = "/yes", keep = "2s" }}', []),
        ("yes", BEGIN, []),
        ("cue", BEGIN, [("lost-cue", "warning", f"the participant's cue {EARLY} /cue yet; {KEEP_CUE}")]),
        ("cue", f'{BEGIN}[cue]\nkeep = "2s"', []),
    ],
    ids=["a key", "a kept key", "no key", "a cue", "a kept cue"],
)
def test_what_is_lost_is_told_once(tmp_path: Path, event: str, toml: str, expected: list[tuple[str, str, str]]) -> None:
    assert lost(tmp_path, event, toml) == expected


def test_a_key_that_is_a_note_is_not_idle(tmp_path: Path) -> None:
    """The mood and the laugh are read by nothing; what is waited for is read, where no rule ever comes."""
    keys = 'm = { set = "mood = \'bored\'" }\nl = { event = "/laughs" }\ny = { event = "/yes" }\n'
    keys += 'w = { set = "waited = true" }\nh = { event = "/never" }\n'
    nowhere = '<State id="Nowhere"><transition eventTopic="/never" cond="waited"/></State>'
    rules = RULE.format(event="yes").replace("</Inter", f"{nowhere}</Inter")
    acts = dialog("R_Ask", speech(1))
    scenario = read(write(tmp_path, acts=acts, rules=rules, toml=BEGIN + keys, memory={"waited": False, "mood": ""}))
    idle = of_kind(explore(scenario, Bounds(faults=0)), "idle-key")
    assert {each.key for each in idle} == {"h"}

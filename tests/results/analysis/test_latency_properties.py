"""Whatever a wizard does in whatever order: no time is negative, parts add up, and a cue has one answer at most."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.kernel.inputs import Submit
from rise_engine.results.analysis.reading import read_session
from tests.chance import examples

from .samples import WIZARD, play_session, task

DEEDS = st.sampled_from(
    [
        *(("markCue", ""), ("markCue", ""), ("undoCue", ""), ("nextFiller", ""), ("say", "Hello there")),
        *(("startCommunicationRobotAct", name) for name in ("Answer", "Ask", "Thanks", "Nod", "Hm", "Point")),
        *(("stopCommunicationRobotAct", "Answer"), ("stopAll", ""), ("releaseStop", "")),
    ]
)


@st.composite
def scripts(draw: st.DrawFn) -> list[tuple[float, Submit]]:
    at, script = 0.5, []
    for _ in range(draw(st.integers(1, 14))):
        at = round(at + draw(st.sampled_from([0.0, 0.01, 0.4, 1.5, 4.0])), 3)
        function, behavior = draw(DEEDS)
        early = draw(st.sampled_from([None, 0.0, 0.05, 3.0, -0.2]))  # two clocks never agree quite
        calling = draw(st.sampled_from(["", "Interrupt"])) if function in ("startCommunicationRobotAct", "say") else ""
        source = draw(st.sampled_from([WIZARD, WIZARD, "ros:/chooser"]))
        pressed = None if early is None or source != WIZARD else max(0.0, at - early)
        script.append((at, task(function, behavior, source=source, pressed=pressed, calling=calling)))
    return script


@settings(max_examples=examples(30))
@given(script=scripts(), ends=st.booleans())
def test_times_of_acts_and_cues(script: list[tuple[float, Submit]], ends: bool) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = play_session(Path(name) / "sessions", script, until=script[-1][0] + 2.0, ends=ends)
        data = read_session(folder)
    for act in data.acts:
        parts = [act.wizard_s, act.way_s, act.rules_s, act.queue_s, act.robot_s, act.voice_s]
        assert all(each is None or each >= 0 for each in parts), act
        if act.response_s is not None:
            heard = parts if act.speaks else parts[:5]
            assert act.response_s == pytest.approx(sum(each or 0.0 for each in heard), abs=1e-5), act
            assert act.response_s >= 0
        if act.cue_at is not None:
            assert act.started_at is not None and act.started_at >= act.cue_at
    answered = [act.cue for act in data.acts if act.cue is not None and not act.filler]
    assert all(act.cue_at == data.cues[act.cue - 1].at for act in data.acts if act.cue is not None)
    assert len(answered) == len(set(answered)) <= len(data.cues)
    for cue in data.cues:
        times = [each for each in (cue.filled_at, cue.answered_at, cue.undone_at) if each is not None]
        assert all(each >= cue.at for each in times), cue
        assert cue.task is None or cue.undone_at is None, cue

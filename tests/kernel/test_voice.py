"""When an act is heard, whether it only bridged the time, and who asked for it: the rest of `timing`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import ActionReport
from rise_engine.kernel.records import TimingRecord

from .harness import Session, dialog, gaze, pause, read, speech, view_of, write
from .test_wizard_marks import of

ROBOT = """title = "Bob"
driver = "simulated"
[actions.Speech]
substitute = "Say"
[actions.Say]
channels = ["speech"]
seconds = 1
[actions.Say.parameters]
message = { type = "text", required = true }
[actions.Announce]
substitute = "Blink"
channels = ["speech"]
[actions.Announce.parameters]
message = { type = "text", required = true }
[actions.Blink]
channels = ["lights"]
seconds = 1
[actions.LookAt]
channels = ["gaze"]
seconds = 1
"""
ACTS = (
    dialog("Look then say", gaze(1), pause(2, 500), speech(3, wait="1,2"))
    + dialog("Two", speech(1), speech(2, wait="1"))
    + dialog("Look", gaze(1))
    + dialog("Never", gaze(1), speech(2, "Hello, {nobody}", wait="1"))
    + dialog("Hm", speech(1, "Hm."))
    + dialog("Try", speech(1, more="<onFailure>continue</onFailure>"), speech(2, wait="1"))
    + dialog("Blinks", "<Announce><actionID>1</actionID><message>Hello</message></Announce>")
)
TOML = '[act.Hm]\nfiller = true\ncalling_type = "None"\n'
BOB = 'title = "t"\nrobot = "bob"\n'


def session(folder: Path, *, robot: str = "") -> Session:
    acts = ACTS if robot else ACTS.replace("Announce", "Speech")
    where = write(folder, acts=acts, toml=(BOB if robot else "") + TOML)
    if robot:
        (where / "robots").mkdir()
        (where / "robots" / "bob.toml").write_text(robot, "utf-8")
    s = Session(read(where))
    s.robot("connected")
    return s


def timing(s: Session) -> TimingRecord:
    return of(s, TimingRecord)[-1]  # type: ignore[no-any-return]


VOICES: list[tuple[str, str, list[tuple[float, str, str]], tuple[float | None, float | None]]] = [
    # the act; at which time (after it was asked for) the robot says what about which action; robot_at, voice_at
    ("a look comes first", "Look then say", [(0.2, "1", "accepted"), (1.0, "1", "succeeded"), (1.3, "3", "accepted"),
     (2.0, "3", "succeeded")], (0.2, 1.3)),
    ("a robot that never says accepted", "Look then say", [(1.0, "1", "succeeded"), (2.5, "3", "succeeded")],
     (1.0, 2.5)),
    ("the first sentence counts", "Two", [(0.1, "1", "accepted"), (1.0, "1", "succeeded"), (1.1, "2", "accepted"),
     (2.0, "2", "succeeded")], (0.1, 0.1)),
    ("an act that says nothing", "Look", [(0.1, "1", "accepted"), (1.0, "1", "succeeded")], (0.1, None)),
    ("words that cannot be made", "Never", [(0.1, "1", "accepted"), (1.0, "1", "succeeded")], (0.1, None)),
    ("it fails before the robot takes it", "Two", [(0.4, "1", "failed")], (None, None)),
    ("a failure that does not matter, then a voice", "Try", [(0.4, "1", "failed"), (0.9, "2", "accepted"),
     (1.4, "2", "succeeded")], (0.9, 0.9)),
    ("lost after it was heard", "Two", [(0.3, "1", "accepted"), (0.9, "1", "lost")], (0.3, 0.3)),
]  # fmt: skip


@pytest.mark.parametrize(("act", "reports", "expected"), [row[1:] for row in VOICES], ids=[row[0] for row in VOICES])
def test_when_an_act_is_heard(
    tmp_path: Path, act: str, reports: list[tuple[float, str, Any]], expected: tuple[float | None, float | None]
) -> None:
    s = session(tmp_path)
    s.t = 10.0
    task = s.act(act).id
    for after, action, status in reports:
        s.wait(10.0 + after - s.t)
        s.report(f"{task}/{action}", status)
    s.wait(30.0)
    last = timing(s)
    found = tuple(None if at is None else round(at - 10.0, 6) for at in (last.robot_at, last.voice_at))
    assert (last.task, found) == (task, expected)
    assert view_of(s).tasks[task].voice_at == last.voice_at


def test_a_substitute_is_heard_if_it_takes_the_voice(tmp_path: Path) -> None:
    s = session(tmp_path, robot=ROBOT)
    s.act("Hm")
    s.t = 0.5
    s.report("1/1", "accepted")
    s.t = 1.0
    s.report("1/1")
    assert (timing(s).robot_at, timing(s).voice_at) == (0.5, 0.5)
    s.act("Blinks")
    s.report("2/1", "accepted")
    s.report("2/1")
    assert (timing(s).robot_at, timing(s).voice_at) == (1.0, None), "what blinks instead is not heard"


def test_a_filler_in_a_cue_is_one_and_the_answer_is_none(tmp_path: Path) -> None:
    s = session(tmp_path)
    s.submit("markCue")
    s.act("Hm")
    s.report("2/1", "accepted")
    s.act("Two")  # it needs the filler's voice
    s.report("2/1", "canceled")
    assert (timing(s).act, timing(s).filler, timing(s).status) == ("Hm", True, "CANCELED")
    assert timing(s).cue_at == 0.0, "without the mark it would count as an answer"
    s.finish_all()
    assert (timing(s).act, timing(s).filler) == ("Two", False)
    assert [view_of(s).tasks[id].filler for id in (2, 3)] == [True, False]


def test_what_was_heard_outlives_the_engine(tmp_path: Path) -> None:
    s = session(tmp_path)
    s.submit("markCue")
    s.act("Hm")
    s.t = 0.5
    s.report("2/1", "accepted")
    again = Session(s.scenario, kernel=Kernel.restore(s.scenario, s.kernel.snapshot()))
    again.timers, again.t = dict(s.timers), 3.0
    again.do(ActionReport(action="2/1", status="succeeded"))
    assert (timing(again).voice_at, timing(again).filler) == (0.5, True)

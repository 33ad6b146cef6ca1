"""The guard: what an edit does not say may not change."""

from __future__ import annotations

import pytest

from rise_engine.author.edit.edits import (
    AddState,
    AnyEdit,
    CallForm,
    Rename,
    SetCall,
    SetInitial,
    SetParameter,
    SetSetting,
    SetStartValue,
    SetTransition,
    SetUseParameter,
    StatementAddress,
    TransitionForm,
)
from tests.author.edit.guard import BeyondTheEdit, changed_paths, check_guard, differences
from tests.author.edit.samples import state_of, study_state

WAY = TransitionForm(event="W_close", target="Closed")


def check(edit: AnyEdit, *replaced: tuple[str, str, str]) -> None:
    """The guard on a study in which something was replaced by hand."""
    before = study_state("greeting")
    files = dict(before.files)
    for file, old, new in replaced:
        assert old.encode() in files[file]
        files[file] = files[file].replace(old.encode(), new.encode(), 1)
    check_guard([edit], before, state_of(files, "greeting"))


SIGNALS, GREETING = "acts/signals.xml", "rules/greeting.xml"


@pytest.mark.parametrize(
    ("edit", "right", "beyond", "named"),
    [
        (
            SetParameter("R_Smile", "1", "duration", "100"),
            (SIGNALS, "<duration>2000<", "<duration>100<"),
            (SIGNALS, "<duration>600<", "<duration>60<"),
            "act R_Notice, actions, 1, calls, 0, parameters, duration",
        ),
        (
            SetTransition("Greeting", "Nobody", 1, WAY, TransitionForm(event="W_shut", target="Closed")),
            (GREETING, "/W_close", "/W_shut"),
            (GREETING, 'cond="person_near" target="Visitor comes"', 'cond="not person_near" target="Visitor comes"'),
            "rule Greeting, states, Start, transitions, 0, condition",
        ),
        (
            SetCall(StatementAddress("Greeting", "Start", "onEntry", 0, (0,)), CallForm("stopInteractionRule", "Gaze")),
            (GREETING, 'startInteractionRule="Gaze"', 'stopInteractionRule="Gaze"'),
            (GREETING, 'startCommunicationRobotAct="R_Nod"', 'startCommunicationRobotAct="R_Smile"'),
            "rule Greeting, states, Visitor is here, transitions, 1, block",
        ),
        (
            AddState("Greeting", "New"),
            (GREETING, '<State id="Nobody">', '<State id="New"/><State id="Nobody">'),
            (GREETING, 'initial="Start"', 'initial="Nobody"'),
            "rule Greeting, initial",
        ),
        (
            SetInitial("Greeting", "Nobody"),
            (GREETING, 'initial="Start"', 'initial="Nobody"'),
            (GREETING, ' priority="1"', ""),
            "rule Greeting, priority",
        ),
        (
            SetUseParameter(GREETING, 47, "SayThen", "act", "R_Smile"),
            (GREETING, 'act="R_Greeting"', 'act="R_Smile"'),
            (SIGNALS, "<value>surprised</value>", "<value>sad</value>"),
            "act R_Notice",
        ),
        (
            SetStartValue("person_near", True),
            ("memory.json", '"person_near"', '"person_near"'),
            ("scenario.toml", 'title = "', 'title = "A '),
            "settings title",
        ),
        (
            SetSetting(("title",), "A"),
            ("scenario.toml", 'title = "', 'title = "A '),
            (SIGNALS, "<duration>600<", "<duration>60<"),
            "act R_Notice",
        ),
    ],
)
def test_what_was_not_said_is_refused(
    edit: AnyEdit, right: tuple[str, str, str], beyond: tuple[str, str, str], named: str
) -> None:
    check(edit, right)
    with pytest.raises(BeyondTheEdit, match="would also change") as caught:
        check(edit, right, beyond)
    assert named in str(caught.value)


def test_layout_and_comments_mean_nothing() -> None:
    edit = SetParameter("R_Smile", "1", "duration", "2000")
    check(
        edit, (SIGNALS, "<Dialogs>", "<Dialogs><!-- new -->\r\n\r\n"), (SIGNALS, "<duration>600<", "<duration> 600 <")
    )


def test_a_name_may_change_everywhere_and_nothing_else() -> None:
    rename = Rename("act", "R_Smile", "R_Grin")
    everywhere = [(file, "R_Smile", "R_Grin") for file in (SIGNALS, GREETING, "scenario.toml", "scenario.toml")]
    check(rename, *everywhere)
    with pytest.raises(BeyondTheEdit, match="what acts do would change"):
        check(rename, *everywhere, (SIGNALS, "600", "60"))
    with pytest.raises(BeyondTheEdit, match="settings would change"):
        check(rename, *everywhere[:3])


def test_it_looks_also_when_something_is_wrong() -> None:
    edit = SetParameter("R_Smile", "1", "duration", "x")
    check(edit, (SIGNALS, "<duration>2000<", "<duration>x<"))
    with pytest.raises(BeyondTheEdit):
        check(edit, (SIGNALS, "<duration>2000<", "<duration>x<"), (SIGNALS, "<duration>600<", "<duration>60<"))


def test_the_same_study_in_another_spelling_is_the_same() -> None:
    for spelling in ("crlf", "comments", "cdata", "one_line", "ragged"):
        assert list(changed_paths(study_state("lablinking"), study_state("lablinking", spelling))) == []


def test_differences_are_named_as_deep_as_they_lie() -> None:
    one = {"a": [1, {"b": 2, "c": [1]}], "d": 1}
    other = {"a": [1, {"b": 3, "c": [1, 2]}], "e": 1}
    assert list(differences(one, other)) == [("a", 1, "b"), ("a", 1, "c"), ("d",), ("e",)]
    assert list(differences({"a": 1}, {"a": True})) == [("a",)]

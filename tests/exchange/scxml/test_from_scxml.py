"""`rise-engine convert from-scxml`: rules in a study, exactly what the chart means, or nothing."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import Result

from rise_engine.scenario.loader import load
from tests.commands import typed
from tests.exchange.scxml.chart_words import chart, element, entry, final, on, parallel, put, send, state, throw
from tests.exchange.scxml.importing import converted, session_of
from tests.kernel.harness import Session

CALL = element("param", name="behavior", expr="'R_Hello'")
VISIT = chart(
    state("alone", on("near", "greet")),
    state(
        "together",
        element("onexit", element("cancel", sendid="patience")),
        on("left", "alone"),
        state(
            "greet",
            entry(element("send", CALL, type="x-rise", event="startCommunicationRobotAct"), put("met", "met + 1")),
            on("R_Hello_end", "pass", cond="met >= 2"),
            on("R_Hello_end", "wait"),
        ),
        state("wait", entry(send("bored", id="patience", delay="20s")), on("bored", "greet")),
    ),
    data={"met": "0"},
    name="Visit",
)


def run(folder: Path, text: str, *options: str, file: str = "visit.scxml") -> Result:
    path = folder / file
    path.write_text(text, encoding="utf-8")
    return typed("convert", "from-scxml", path, "--into", folder / "study", *options)


def add(folder: Path, name: str, text: str) -> None:
    path = folder / "study" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A folder beside which a study lies, with an act and a rule."""
    act = "<Speech><actionID>1</actionID><message>Hello</message></Speech>"
    add(tmp_path, "scenario.toml", '[keys]\nb = { rule = "Visit", label = "begin" }\n')
    add(tmp_path, "acts/a.xml", f'<Dialogs><Dialog name="R_Hello">{act}</Dialog></Dialogs>')
    add(tmp_path, "memory.json", "{}")
    return tmp_path


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_into_a_study(study: Path) -> None:
    ran = run(study, VISIT)
    assert ran.exit_code == 0, ran.output
    assert "states with states inside are gone: together" in ran.output
    text = (study / "study/rules/visit.xml").read_text()
    assert text.startswith("<!--\n  made from visit.scxml: change the chart and convert it again, not this file\n")
    assert "/bored is sent after 20s, by the rule Visit sends bored" in text
    loaded = load(study / "study")
    assert loaded.scenario is not None
    assert {each.code for each in loaded.diagnostics} == {"unraised-event", "unnoticed-failure"}
    session = Session(loaded.scenario)
    session.rule("Visit")
    session.event("/near")
    session.finish_all()
    assert session.states["Visit"] == "wait"
    session.wait(20)
    assert session.states["Visit"] == "greet"
    session.finish_all()
    assert session.states == {}


def test_what_was_cancelled_is_not_sent(study: Path) -> None:
    run(study, VISIT)
    scenario = load(study / "study").scenario
    assert scenario is not None
    session = Session(scenario)
    session.rule("Visit")
    session.event("/near")
    session.finish_all()
    session.event("/left")
    assert session.states == {"Visit": "alone"}


def test_a_second_time_it_is_made_anew(study: Path) -> None:
    assert run(study, VISIT).exit_code == 0
    assert run(study, VISIT.replace("20s", "30s")).exit_code == 0
    assert 'after="30s"' in (study / "study/rules/visit.xml").read_text()


def test_a_file_of_somebody_is_left_alone(study: Path) -> None:
    add(study, "rules/visit.xml", "<InteractionRules/>")
    before = files(study / "study")
    ran = run(study, VISIT)
    assert ran.exit_code == 2
    assert "was not made from a chart; choose another --name" in ran.output
    assert files(study / "study") == before


def test_a_new_study_has_keys(tmp_path: Path) -> None:
    ran = run(tmp_path, chart(state("a", on("go", "pass"), on("stop", "fail"))), "--name", "My rule")
    assert ran.exit_code == 0, ran.output
    loaded = load(tmp_path / "study")
    assert not loaded.diagnostics
    assert loaded.scenario is not None
    assert {key: binding.behavior for key, binding in loaded.scenario.keys.items()} == {
        "b": "My rule",
        "1": "/go",
        "2": "/stop",
    }
    assert (tmp_path / "study/rules/my_rule.xml").exists()


def test_all_that_is_refused_is_said_with_its_place_and_nothing_is_written(tmp_path: Path) -> None:
    text = '<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0">\n'
    text += '  <state id="a">\n    <invoke type="scxml"/>\n    <transition cond="_event.data == 1" target="nobody"/>\n'
    text += "  </state>\n</scxml>\n"
    ran = run(tmp_path, text)
    assert ran.exit_code == 1
    assert ran.output.splitlines() == [
        "visit.scxml:3:5: error invoke: `<invoke>` starts another program, and ends it with the state; a rule can "
        "start another rule, but does not own it",
        "visit.scxml:4:23: error payload: events of rules carry nothing, so there is no `_event.data`; set a variable "
        "before the event",
        "visit.scxml:4:49: error chart: there is no state `nobody`; known: `a`",
        "nothing was written",
    ]
    assert not (tmp_path / "study").exists()


def test_acts_of_a_new_study_say_their_names(tmp_path: Path) -> None:
    ran = run(tmp_path, VISIT)
    assert ran.exit_code == 0, ran.output
    assert "to be written: R_Hello in acts/acts.xml; until then each says its name" in ran.output
    scenario = load(tmp_path / "study").scenario
    assert scenario is not None
    assert list(scenario.acts) == ["R_Hello"]
    assert [binding.behavior for binding in scenario.keys.values()] == ["Visit", "/near", "/left"]


def test_findings_of_all_kinds_come_together(tmp_path: Path) -> None:
    """What is seen while reading does not hide what is seen while flattening, and makes no findings of its own."""
    ran = run(
        tmp_path,
        chart(
            state("a", entry(put("n", "_event.data"), put("m", "m % 2")), on("x", "b", cond="k == '1'")),
            state("b", on("y", "", put("n", "n + 1"), cond="n > 2")),
            data={"n": "1", "m": "1", "k": "1"},
        ),
    )
    codes = [line.split()[2].rstrip(":") for line in ran.output.splitlines() if " error " in line]
    assert codes == ["payload", "expression", "expression"]


def test_an_act_that_there_is_not(study: Path) -> None:
    before = files(study / "study")
    ran = run(study, VISIT.replace("R_Hello'", "R_Helo'"))
    assert ran.exit_code == 1
    assert "there is no act `R_Helo`; did you mean `R_Hello`?" in ran.output
    assert files(study / "study") == before


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        (
            "rules/other.xml",
            '<InteractionRule name="O" initial="A"><State id="A"><transition eventTopic="/x" target="A">'
            '<function assignValue="met = 1"/></transition></State></InteractionRule>',
            "`met` is a variable of the chart; nothing else may set it",
        ),
        (
            "rules/other.xml",
            '<InteractionRule name="O" initial="A"><State id="A"><transition eventTopic="/inside" target="A"/></State>'
            "</InteractionRule>",
            "`/inside` is for the chart itself, which raises it; this rule would take it away",
        ),
        ("tables/met.csv", "a,b\n1,2\n", "`met` is a table, and nothing can change it"),
    ],
)
def test_what_the_study_would_take_part_in(study: Path, name: str, text: str, said: str) -> None:
    add(study, name, text)
    before = files(study / "study")
    ran = run(study, VISIT.replace('<state id="wait">', f'<state id="wait">{entry(throw("inside"))}{on("inside")}'))
    assert ran.exit_code == 1
    assert said in ran.output
    assert files(study / "study") == before


def test_events_that_are_only_for_the_chart(study: Path) -> None:
    """A ticker: what it sends has come when it comes, so that it can be sent again."""
    ticker = chart(state("a", entry(send("tick", delay="1s")), on("tick", "a")), name="Visit")
    assert run(study, ticker).exit_code == 0
    add(study, "scenario.toml", '[keys]\nt = { event = "/tick", label = "tick" }\n')
    ran = run(study, ticker)
    assert ran.exit_code == 1
    assert "scenario.toml:2:" in ran.output
    assert "`/tick` is sent by the chart itself; a key cannot send it, too" in ran.output


def test_usage(tmp_path: Path) -> None:
    ran = typed("convert", "from-scxml", tmp_path / "no.scxml", "--into", tmp_path / "study")
    assert ran.exit_code == 2
    assert "there is no file" in ran.output
    (tmp_path / "study").write_text("")
    assert "is not a folder" in run(tmp_path, VISIT).output


def test_events_of_a_star(tmp_path: Path) -> None:
    """What `*` means is only what is named: by the chart, or by the caller."""
    text = chart(state("a", on("*", "b")), state("b"))
    assert run(tmp_path, text).exit_code == 0
    made = converted(text, outside=("hello", "x.y"))
    for event in ("/hello", "/x.y"):
        session = session_of(made, tmp_path)
        session.rule(made.name)
        session.event(event)
        assert session.states == {made.name: "b"}


def test_a_chart_that_waits_for_ever_does_not_end(tmp_path: Path) -> None:
    made = converted(chart(state("a", on("x", "b")), state("b")))
    session = session_of(made, tmp_path)
    session.rule(made.name)
    session.event("/x")
    assert session.states == {made.name: "b"}


def test_nothing_of_an_earlier_run_comes_late(tmp_path: Path) -> None:
    """A rule that is stopped leaves what it was to send behind; started anew, it does not get it."""
    made = converted(chart(state("a", on("go", "b"), on("late", "fail")), state("b", entry(send("late", delay="5s")))))
    session = session_of(made, tmp_path)
    session.rule(made.name)
    session.event("/go")
    session.submit("stopInteractionRule", made.name)
    session.wait(1)
    session.rule(made.name)
    session.wait(10)
    assert session.states == {made.name: "a"}


def test_a_chart_that_ends_leaves_nothing_behind(tmp_path: Path) -> None:
    made = converted(
        chart(parallel("p", state("l", entry(send("x", delay="5s")), on("x")), state("r", on("y", "pass"))))
    )
    session = session_of(made, tmp_path)
    session.rule(made.name)
    session.event("/y")
    assert session.states == {}
    assert not session.timers


def test_what_an_editor_adds_is_passed_over() -> None:
    text = chart(
        '<qt:editorinfo xmlns:qt="http://www.qt.io/2015/02/scxml-ext" geometry="1;2"/>',
        state("a", '<qt:editorinfo geometry="3"/>', on("x", "f", '<qt:editorinfo endTargetFactors="0.5"/>')),
        final("f"),
    ).replace("<scxml ", '<scxml xmlns:qt="http://www.qt.io/2015/02/scxml-ext" ', 1)
    assert [state.id for state in converted(text).states] == ["a", "f"]

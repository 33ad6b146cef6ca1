"""A scenario that is checked again and again while it is edited: each time what `load` finds in the same files."""

from __future__ import annotations

import re
from pathlib import Path
from random import Random

import pytest

from rise_engine.scenario.checker import ScenarioChecker
from rise_engine.scenario.files import source_files
from rise_engine.scenario.loader import load
from tests.chance import examples
from tests.scenario.folders import SPEECH, act, folder, found, in_state, rule
from tests.scenario.test_held_files import SCENARIOS, STUDIES, content, outcome

_WORDS = re.compile(rb"[\w$]+")


def broken(data: bytes, random: Random) -> bytes:
    """The content of a file after something that happens to it in an editor."""
    words = list(_WORDS.finditer(data))
    lines = data.splitlines(keepends=True)
    if not words:
        return b"{}"
    match random.randrange(6):
        case 0:  # two names change places
            a, b = sorted((random.choice(words), random.choice(words)), key=lambda word: word.start())
            return data if a == b else data[: a.start()] + b[0] + data[a.end() : b.start()] + a[0] + data[b.end() :]
        case 1:  # a letter is lost
            at = random.choice(words).start()
            return data[:at] + data[at + 1 :]
        case 2:  # a line is lost
            at = random.randrange(len(lines))
            return b"".join((*lines[:at], *lines[at + 1 :]))
        case 3:  # some lines stand twice
            at = random.randrange(len(lines))
            return b"".join((*lines[: at + 4], *lines[at:]))
        case 4:  # everything moves
            return b"\n" + data if data.startswith((b"<", b"{")) else b"# first\n" + data
        case _:  # half of it is typed
            return data[: random.randrange(len(data))]


@pytest.mark.search
@pytest.mark.slow
@pytest.mark.parametrize("name", STUDIES)
def test_each_check_finds_what_reading_all_files_finds(name: str, tmp_path: Path) -> None:
    """Through many changes of files, some undone, some files taken away, the memory of all that is kept."""
    random = Random(name)
    whole = content(SCENARIOS / name)
    checker = ScenarioChecker(tmp_path / name)
    history: list[dict[str, bytes | None]] = [dict(whole)]
    for step in range(examples(40)):
        if random.random() < 0.4:
            held = random.choice(history)
        else:
            held = dict(random.choice((history[0], history[-1])))
            file = random.choice(sorted(whole))
            held[file] = None if random.random() < 0.1 else broken(held.get(file) or whole[file], random)
        history.append(held)
        assert outcome(checker.check(held)) == outcome(load(tmp_path / name, held=held)), step


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_without_change_is_found_to_be_the_same(name: str) -> None:
    checker = ScenarioChecker(SCENARIOS / name)
    expected = outcome(load(SCENARIOS / name))
    assert [outcome(checker.check({})) for _ in range(3)] == [expected] * 3


def test_only_the_file_that_was_edited_is_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Acts and rules of other files are the very objects of the check before."""
    folder(tmp_path, {"acts/a.xml": act(SPEECH), "acts/b.xml": act(SPEECH, "B"), "rules/r.xml": in_state("")})
    checker = ScenarioChecker(tmp_path)
    before = checker.check({}).draft
    after = checker.check({"acts/a.xml": act(SPEECH.replace("Hello", "Hi")).encode()}).draft
    assert after.acts["B"] is before.acts["B"] and after.rules["R"] is before.rules["R"]
    assert after.acts["A"] != before.acts["A"]


def test_a_template_that_was_edited_changes_what_comes_of_it_elsewhere(tmp_path: Path) -> None:
    say = '<Template name="Say"><parameter name="text"/>{}</Template>'
    wave = f'<Dialogs>{act(SPEECH, "W")}<Template name="Wave">{SPEECH}</Template></Dialogs>'
    folder(
        tmp_path,
        {
            "acts/a.xml": act('<use template="Say" text="x"/>'),
            "acts/b.xml": act('<use template="Wave"/>', "B"),
            "acts/t.xml": f"<Dialogs>{say.format(SPEECH.replace('Hello', '${text}'))}</Dialogs>",
            "acts/w.xml": wave,
        },
    )
    checker = ScenarioChecker(tmp_path)
    before = checker.check({}).draft.acts
    changed = f"<Dialogs>{say.format(SPEECH.replace('Hello', 'say ${text}'))}</Dialogs>".encode()
    after = checker.check({"acts/t.xml": changed}).draft.acts
    assert after["A"].actions[0].calls[0].parameters["message"].text == "say x"
    assert after["B"] is before["B"]


def test_a_definition_elsewhere_is_seen(tmp_path: Path) -> None:
    """Two of one name; the end of an act that another rule starts; a table that a memory key is called like."""
    folder(
        tmp_path,
        {
            "acts/a.xml": act(SPEECH),
            "memory.json": '{"items": 1}',
            "rules/r.xml": rule('<State id="S"><transition ended="A" target="S"/></State>'),
        },
    )
    checker = ScenarioChecker(tmp_path)
    assert found(checker.check({})) == ["rules/r.xml:2:15 unreachable-transition"]
    assert found(checker.check({"acts/a.xml": None})) == ["rules/r.xml:2:34 unknown-act"]
    assert found(checker.check({"acts/b.xml": act(SPEECH).encode()})) == [
        "acts/b.xml:1:15 duplicate-name",
        "rules/r.xml:2:15 unreachable-transition",
    ]
    assert "memory.json:1:2 duplicate-key" in found(checker.check({"tables/items.csv": b"a\n1\n"}))


def test_another_robot_is_asked_for_each_action(tmp_path: Path) -> None:
    folder(tmp_path, {"acts/a.xml": act("<Wink><actionID>1</actionID></Wink>"), "robots/r.toml": "[actions.Speech]"})
    checker = ScenarioChecker(tmp_path, robot="r")
    assert found(checker.check({})) == ["acts/a.xml:2:1 unknown-action"]
    assert found(checker.check({"robots/r.toml": b"[actions.Wink]\n"})) == []
    assert found(checker.check({"scenario.toml": b"[actions.Wink]\n"})) == []
    assert found(checker.check({})) == ["acts/a.xml:2:1 unknown-action"]
    assert checker.check({}).robot.name == "r"


def test_what_is_not_held_is_read_from_the_disk_each_time(tmp_path: Path) -> None:
    folder(tmp_path, {"acts/a.xml": act(SPEECH)})
    checker = ScenarioChecker(tmp_path)
    assert found(checker.check({})) == []
    folder(tmp_path, {"acts/a.xml": "<Dialogs/>", "acts/b.xml": "x"})
    assert found(checker.check({})) == ["acts/b.xml:1:1 not-well-formed"]


def test_what_is_not_needed_is_forgotten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source_files, "_MAX_EXPRESSIONS", 10)
    checker = ScenarioChecker(folder(tmp_path, {"rules/r.xml": in_state("")}))
    for n in range(100):
        held = {"rules/r.xml": in_state(f'<function assignValue="n = {n}"/>').encode()}
        assert found(checker.check(held)) == []
    kept = checker._memo
    assert len(kept._kept) < 200 and len(kept.assignments) <= 10


def test_errors_leave_what_could_be_read(tmp_path: Path) -> None:
    folder(tmp_path, {"acts/a.xml": act(SPEECH), "acts/b.xml": "<Dialogs>", "scenario.toml": 'robot = "nobody"\n'})
    result = load(tmp_path)
    assert result.scenario is None and list(result.draft.acts) == ["A"] and result.robot.name == "generic"

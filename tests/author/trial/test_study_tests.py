"""Tests of a study: kept from a trial, read with everything that is wrong, and played."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from rise_engine.author.trial.study_test import read_study_test
from rise_engine.author.trial.study_test_run import is_same_value, path_of_test, play_test, text_of_test
from rise_engine.author.trial.trial import Trial
from rise_engine.base.errors import FileError
from rise_engine.cli import main
from rise_engine.run.protocol.task_file import read_task_file
from tests.commands import typed

from .test_trial import key, loaded_scenario, make_guide


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return make_guide(tmp_path / "guide")


def kept_trial(folder: Path) -> Trial:
    """A trial with everything that can be done in one."""
    scenario = loaded_scenario(folder)
    trial = Trial(scenario, seed=3, memory={"name": "Bea"})
    trial.press(key(scenario, "t"))
    trial.press(key(scenario, "t"))  # runs already: refused
    trial.press(key(scenario, "y"))
    trial.raise_event("go")
    trial.go_on()
    trial.pass_time(2)
    trial.set_value("tries = 9")
    trial.go_on()
    return trial


def lines_of(text: str) -> list[dict[str, object]]:
    return [json.loads(line) for line in text.splitlines()]


def test_a_kept_trial_passes_and_says_what_came(folder: Path) -> None:
    text = text_of_test(kept_trial(folder), "the first hello")
    outcome = play_test(loaded_scenario(folder), read_study_test(text.encode(), "kept.jsonl", loaded_scenario(folder)))
    assert outcome.passed and outcome.steps == 8, outcome.failures
    lines = lines_of(text)
    assert lines[0] == {"test": "the first hello", "seed": 3, "memory": {"name": "Bea"}}
    assert {"key": "t"} in lines and {"go_on": True} in lines and {"wait": 2} in lines
    assert {"expect": {"refused": True}} in lines
    assert {"expect": {"rules": {"Guide": "Talking"}, "memory": {"tries": 1}, "starts": ["R_Hello"]}} in lines
    assert {"expect": {"rules": {"Guide": None}}} in lines


def test_a_longer_sentence_changes_no_outcome_and_another_target_does(folder: Path) -> None:
    text = text_of_test(kept_trial(folder), "the first hello").encode()
    acts = folder / "acts/acts.xml"
    acts.write_text(acts.read_text().replace("Hello there", "A very long and slow good morning to you over there"))
    longer = loaded_scenario(folder)
    assert play_test(longer, read_study_test(text, "kept.jsonl", longer)).passed
    rules = folder / "rules/rules.xml"
    rules.write_text(rules.read_text().replace('cond="tries = 9" target="Done"', 'cond="tries = 9" target="Waiting"'))
    other = loaded_scenario(folder)
    (failure,) = play_test(other, read_study_test(text, "kept.jsonl", other)).failures
    assert failure.text == "rule Guide should not run, and it is in `Waiting`"
    assert lines_of(text.decode())[failure.line - 1] == {"expect": {"rules": {"Guide": None}}}


def test_every_kind_of_expectation_that_fails_says_what_came(folder: Path) -> None:
    scenario = loaded_scenario(folder)
    text = "\n".join(
        [
            '{"key": "g", "at": 1.5}',
            '{"expect": {"rules": {"Guide": "Waiting"}, "memory": {"tries": 1, "nothing": null}, "events": ["/stop"]}}',
            '{"function_type": "startCommunicationRobotAct", "domain_task_behavior": "R_Hello"}',
            '{"expect": {"starts": [], "says": ["Hello there, Bea!"]}}',
            '{"expect": {"says": ["Hello there, Ada!"], "refused": true}}',
            '{"function_type": "stopInteractionRule", "domain_task_behavior": "Guide"}',
            '{"key": "g", "at": 0.5}',
        ]
    )
    outcome = play_test(scenario, read_study_test(text.encode(), "t.jsonl", scenario))
    assert [(failure.line, failure.text) for failure in outcome.failures] == [
        (2, "rule Guide should be in `Waiting`, and it does not run"),
        (2, "tries should be 1, and it is 0"),
        (2, "nothing should be null, and it is not set"),
        (2, "the event /stop should be raised, and raised is go"),
        (4, "`starts` should be nothing, and it is R_Hello"),
        (4, "`says` should be Hello there, Bea!, and it is Hello there, Ada!"),
        (5, "it should be refused, and it was not"),
        (6, "it was refused: rule 'Guide' is not running"),
        (7, "`at` is 0.5 s, and 1.7 s have passed already"),
    ]


def test_everything_that_is_wrong_with_a_test_is_told_at_once(folder: Path) -> None:
    text = "\n".join(
        [
            '{"test": "", "seed": "x", "condition": "quick", "memory": []}',
            '{"expect": {"refused": true}}',
            '{"kye": "t"}',
            '{"key": "q"}',
            '{"go_on": 1}',
            '{"wait": -1, "at": 3}',
            '{"expect": {"ruels": {}, "memory": 3, "refused": "no", "starts": ["R_Helo"], "says": "x"}}',
            '{"expect": {"rules": {"Giude": "Waiting", "Guide": "Wating"}}}',
            '{"key": "t", "go_on": true}',
            '{"key": "t", "key": "g"}',
            "[1]",
            '{"key": ',
            '{"function_type": "raiseEvent"}',
            "# a remark",
            '{"test": "again"}',
        ]
    )
    with pytest.raises(FileError) as caught:
        read_study_test(text.encode() + b"\n\xff", "tests/t.jsonl", loaded_scenario(folder))
    told = str(caught.value).splitlines()
    lines = [int(line.split(":")[1]) for line in told]
    assert set(lines) == set(range(1, 17)) - {14} and lines == sorted(lines)
    for sentence in (
        "2: error: an `expect` follows a line that does something",
        "3: error: a line has one of",
        "did you mean `key`?",
        "4: error: the study has no key `q`; it has t, g, y",
        "7: error: unknown expectation `ruels`; did you mean `rules`?",
        "7: error: there is no act `R_Helo`; did you mean `R_Hello`?",
        "8: error: there is no rule `Giude`; did you mean `Guide`?",
        "8: error: there is no state `Wating`; did you mean `Waiting`? (rule `Guide`)",
        "9: error: this line has `key` and `go_on`",
    ):
        assert sentence in str(caught.value)


def test_a_file_for_a_test_is_never_one_that_is_there(folder: Path) -> None:
    first = path_of_test(folder, "The first: hello!")
    assert first == folder / "tests/the_first_hello.jsonl"
    first.parent.mkdir()
    first.touch()
    assert path_of_test(folder, "the first hello").name == "the_first_hello_2.jsonl"
    assert path_of_test(folder, "///").name == "test.jsonl"


def test_the_command_plays_them_all_and_says_what_failed(folder: Path) -> None:
    (folder / "tests").mkdir()
    text = text_of_test(kept_trial(folder), "the first hello")
    (folder / "tests/good.jsonl").write_text(text)
    (folder / "tests/wrong.jsonl").write_text(text.replace('"tries": 1', '"tries": 2'))
    (folder / "tests/broken.jsonl").write_text("{")
    runner = CliRunner()
    done = runner.invoke(main, ["test", str(folder)])
    assert done.exit_code == 1
    assert "ok    tests/good.jsonl: the first hello (8 steps, " in done.output
    assert "tests/wrong.jsonl:9: after 0.3 s: tries should be 2, and it is 1" in done.output
    assert "FAIL  tests/broken.jsonl: it cannot be read" in done.output and "1 of 3 tests passed" in done.output
    alone = runner.invoke(main, ["test", str(folder), "tests/good.jsonl", "--json"])
    assert alone.exit_code == 0 and json.loads(alone.output)["passed"]
    assert runner.invoke(main, ["test", str(folder), "tests/none.jsonl"]).exit_code == 2


def test_no_tests_are_no_success(folder: Path) -> None:
    done = typed("test", folder)
    assert done.exit_code == 2 and "there are no tests" in done.output


def test_a_task_file_says_that_a_test_is_none() -> None:
    with pytest.raises(FileError, match="`go_on` belongs to a test of a study, which `rise-engine test DIR` runs"):
        read_task_file(b'{"go_on": true}', "kept.jsonl")


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [(1, 1.0, True), (1, True, False), ([1, {"a": 2}], [1.0, {"a": 2}], True), ({"a": 1}, {"b": 1}, False)],
)
def test_which_values_are_the_same(one: object, other: object, same: bool) -> None:
    assert is_same_value(one, other) is same

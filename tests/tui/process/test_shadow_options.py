"""`rise-tui --shadow`: what goes together, who judges, and what becomes of one that was left."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from click.testing import CliRunner
from msgspec.structs import replace

from rise_engine.cli.terminal import Refused
from rise_engine.session.shadow import ShadowPlay, ShadowWriter
from rise_tui.cli.command_line import CommandLine
from rise_tui.cli.main import main
from rise_tui.cli.open_console import make_shadow
from tests.results.analysis.cues import CUES, add_shadow, make_session


class Person:
    """Somebody at a plain terminal."""

    def __init__(self, answer: str | None = None) -> None:
        self.answer = answer
        self.asked: list[str] = []

    @property
    def interactive(self) -> bool:
        return self.answer is not None

    def print_line(self, line: str) -> None:
        raise AssertionError(line)

    def read_answer(self, question: str) -> str | None:
        self.asked.append(question)
        return self.answer


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return make_session(tmp_path, [(0.5, "sync", "1"), *CUES])


def lines_of(options: CommandLine, person: Person | None = None) -> Sequence[str]:
    with pytest.raises(Refused) as refused:
        make_shadow(options, person or Person())
    return [str(refused.value.exit_code), *refused.value.lines]


def test_who_judges_is_asked_and_never_guessed(folder: Path) -> None:
    options = CommandLine(shadow=str(folder))
    person = Person(" ben ")
    client, wizard = make_shadow(options, person)
    assert wizard == "ben" and client.now() == 0 and person.asked
    assert not (folder / "shadow").exists()
    for nobody in (Person(""), Person(None)):
        code, said = lines_of(options, nobody)
        assert code == "2" and "--wizard NAME" in said
    assert make_shadow(replace(options, wizard="carl"), Person("ben"))[1] == "carl"


def test_where_it_begins(folder: Path) -> None:
    options = CommandLine(shadow=str(folder), wizard="ben")
    assert make_shadow(replace(options, at="12.5"), Person())[0].now() == 12.5
    assert make_shadow(replace(options, at="mark"), Person())[0].now() == 0.5
    code, said = lines_of(replace(options, at="mark9"))
    assert code == "2" and "it has mark1" in said


def test_one_that_was_left_is_gone_on_with_or_begun_anew_as_somebody_says(folder: Path) -> None:
    options = CommandLine(shadow=str(folder), wizard="ben")
    assert "has left no shadow" in lines_of(replace(options, recover=True))[1]
    writer = ShadowWriter.begin(folder, "ben")
    writer.append(ShadowPlay(0.0))
    writer.append(ShadowPlay(14.0))
    writer.close()
    code, said, todo = lines_of(options)
    assert code == "4" and "goes as far as 00:00:14" in said and "1.jsonl" in said
    assert todo.startswith("--recover goes on with it; --new")
    assert make_shadow(replace(options, recover=True), Person())[0].now() == 14.0
    assert make_shadow(replace(options, new=True), Person())[0].now() == 0
    assert make_shadow(replace(options, wizard="carl"), Person())[0].now() == 0


def test_one_that_went_to_the_end_does_not_keep_anybody_from_another(folder: Path) -> None:
    add_shadow(folder, "ben", [None] * 5)
    assert make_shadow(CommandLine(shadow=str(folder), wizard="ben"), Person())[1] == "ben"


def test_a_session_that_is_none_is_named(tmp_path: Path) -> None:
    code, said = lines_of(CommandLine(shadow=str(tmp_path), wizard="ben"))
    assert code == "2" and "is not a session" in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--shadow", "x", "--replay", "y"), "say either --replay or --shadow"),
        (("--shadow", "x", "--config", "y"), "say either --config or --shadow"),
        (("--shadow", "x", "--observe"), "--observe does not go with it"),
        (("--at", "3"), "--at is for --shadow"),
        (("--replay", "x", "--at", "3"), "--at is for --shadow"),
        (("--shadow", "x", "--recover", "--at", "3"), "--recover goes on where the shadow stopped"),
        (("--shadow", "x", "--recover", "--speed", "2"), "--recover goes on where the shadow stopped"),
        (("--shadow", "x", "--new", "--recover"), "use either --new or --recover"),
        (("--shadow", "x", "--participant", "P01"), "use --participant only with --config DIR"),
        (("--speed", "2"), "--speed is for --replay and --shadow"),
        (("--new",), "use --new only with --config DIR"),
    ],
)
def test_what_does_not_go_together(arguments: tuple[str, ...], said: str) -> None:
    result = CliRunner().invoke(main, list(arguments))
    assert result.exit_code == 2
    assert said in " ".join(result.output.split())

"""Who sits here: asked once, found again, and never a login in a real session."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_tui.cli.command_line import CommandLine
from rise_tui.cli.start import QUESTION, last_wizard, name_wizard
from rise_tui.config.preferences import Preferences, load_saved
from rise_tui.console.layout import UiState, save_all


class Person:
    """Implements `Prompter`: answers, and remembers what was asked."""

    def __init__(self, answer: str | None = None, interactive: bool = True) -> None:
        self.answer, self.interactive = answer, interactive
        self.asked: list[str] = []

    def print_line(self, line: str) -> None:
        raise AssertionError(line)

    def read_answer(self, question: str) -> str | None:
        self.asked.append(question)
        return self.answer


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path / "rise-tui" / "console.json"


def real() -> bool:
    return True


def debug() -> bool:
    return False


def test_what_the_command_line_says_is_not_asked() -> None:
    person = Person("ben")
    assert name_wizard(CommandLine(wizard="anna"), real, person) == (CommandLine(wizard="anna"), "")
    assert person.asked == []


def test_before_the_first_real_session_it_is_asked_and_a_name_that_nobody_gives_is_none() -> None:
    person = Person(" anna ")
    assert name_wizard(CommandLine(), real, person) == (CommandLine(wizard="anna"), "")
    assert person.asked == [QUESTION]
    for answer in ("", None):
        assert name_wizard(CommandLine(), real, Person(answer)) == (CommandLine(), "")
    assert name_wizard(CommandLine(), real, Person("anna", interactive=False)) == (CommandLine(), "")


def test_in_debug_mode_nobody_is_asked() -> None:
    person = Person("anna")
    assert name_wizard(CommandLine(), debug, person) == (CommandLine(), "") and person.asked == []


def test_the_name_is_found_again_and_said(state: Path) -> None:
    save_all(UiState(Preferences(theme="light")).save_wizard_name("anna"))
    assert load_saved(state, Preferences)[0].wizard == "anna"
    person = Person("ben")
    for is_real in (real, debug):
        found, remark = name_wizard(CommandLine(), is_real, person)
        assert found.wizard == "anna" and "you are anna, as last time" in remark
    assert person.asked == []
    assert last_wizard(replace(CommandLine(), fresh=True)) == ""


def test_who_only_watches_leaves_no_name(state: Path) -> None:
    save_all(UiState(Preferences(), keeps_changes=False).save_wizard_name("anna"))
    assert not state.exists()
    assert UiState(Preferences(wizard="anna")).save_wizard_name("anna") == []

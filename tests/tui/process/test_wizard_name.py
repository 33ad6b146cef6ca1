"""What the record calls whoever sits at a console: their login in debug mode, nobody's name in a real session."""

from __future__ import annotations

import pytest

from rise_engine.run.protocol.messages import SessionSummary
from rise_engine.run.protocol.registry import RegistryError
from rise_tui.cli import open_console
from rise_tui.cli.command_line import CommandLine, login_name
from rise_tui.cli.open_console import wizard_name


def summary(mode: str, wizard: str) -> SessionSummary:
    return SessionSummary(
        version=2,
        title="Sample",
        mode=mode,
        robot="generic",
        seed=1,
        scenario_folder="/s",
        scenario_hash="0",
        folder="/f",
        t=0.0,
        seq=0,
        busy=False,
        stopped=False,
        control=None,
        clients=[],
        wizard=wizard,
    )


LOGIN = login_name()


@pytest.mark.parametrize(
    ("mode", "before", "given", "observe", "name"),
    [
        ("debug", "", None, False, LOGIN),
        ("debug", "bea", None, False, "bea"),
        ("debug", "", None, True, LOGIN),
        ("real", "", None, False, "wizard"),
        ("real", "wizard", None, False, "wizard"),
        ("real", "bea", None, False, "bea"),
        ("real", "bea", None, True, "observer"),
        ("real", "", LOGIN, False, LOGIN),
        ("real", "", "W1", False, "W1"),
    ],
)
def test_who_somebody_is(
    monkeypatch: pytest.MonkeyPatch, mode: str, before: str, given: str | None, observe: bool, name: str
) -> None:
    monkeypatch.setattr(open_console, "ask_summary", lambda session: summary(mode, before))
    found, remark = wizard_name(CommandLine(wizard=given, observe=observe), "s")
    assert found == name
    if mode == "real" and given is None and before != "bea":
        assert remark == "the record calls you wizard; to be named in it: rise-tui --wizard NAME"


def test_a_session_that_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(session: str) -> SessionSummary:
        raise RegistryError("gone")

    monkeypatch.setattr(open_console, "ask_summary", gone)
    assert wizard_name(CommandLine(), "s") == (LOGIN, "")

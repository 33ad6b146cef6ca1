"""Which session is meant, and what becomes of one that did not end."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from rise_engine.cli.terminal import Refused
from rise_engine.run.protocol.messages import VERSION, SessionSummary
from rise_tui.cli.command_line import CommandLine, check_matches, choose_recovery
from rise_tui.cli.main import main
from tests.tui.fake import DEMO
from tests.tui.terminals import environment_of, run_rise_tui


def about(**given: Any) -> SessionSummary:
    usual: dict[str, Any] = {
        "version": VERSION,
        "title": "LabLinking",
        "mode": "debug",
        "robot": "pepper",
        "seed": 1,
        "scenario_folder": "",
        "scenario_hash": "",
        "folder": "",
        "t": 872.0,
        "seq": 1,
        "busy": False,
        "stopped": False,
        "control": "wizard:anna",
        "clients": ["wizard:anna"],
    }
    return SessionSummary(**{**usual, **given})


@dataclass
class Typist:
    """Somebody who types these answers, and then nothing more."""

    answers: list[str] = field(default_factory=list)
    interactive: bool = True
    said: list[str] = field(default_factory=list)
    questions: int = 0

    def print_line(self, line: str) -> None:
        self.said.append(line)

    def read_answer(self, question: str) -> str | None:
        self.questions += 1
        return self.answers.pop(0) if self.answers else None


ONE = [("/s/2026-11-21_141503_demo_debug", "Demo (debug, pepper), begun 2026-11-21 14:15")]
TWO = [*ONE, ("/s/2026-11-20_090000_demo_debug", "Demo (debug, pepper), begun 2026-11-20 09:00")]


def test_a_session_that_runs_is_attached_to_only_when_it_is_the_one_that_was_meant() -> None:
    check_matches("a", about(), CommandLine())
    check_matches("a", about(), CommandLine(robot="pepper", mode="debug"))
    own = CommandLine(participant="P07", condition="calm")
    check_matches("a", about(participant="P07", condition="calm"), own)
    check_matches("a", None, CommandLine(robot="floka", mode="real", participant="P08"))
    for wanted, said in (
        ({"robot": "floka"}, "with --robot pepper and not floka"),
        ({"mode": "real"}, "with --mode debug and not real"),
        ({"participant": "P08"}, "running already, without --participant; for the other one"),
        ({"condition": "loud"}, "running already, without --condition"),
        ({"new": True}, "to begin a new session"),
        ({"sets": ("a=1",), "places": ("acts=x",)}, "--set and --place can only be set for a new session"),
    ):
        with pytest.raises(Refused, match=said):
            check_matches("a", about(), CommandLine(**wanted))  # type: ignore[arg-type]
    with pytest.raises(Refused, match="with --participant P07 and not P08"):
        check_matches("a", about(participant="P07"), CommandLine(participant="P08"))


def test_an_unfinished_session_is_recovered_only_on_purpose() -> None:
    typist = Typist(["", "y", "r"])
    assert choose_recovery(ONE, typist) == ONE[0][0]
    assert typist.questions == 3
    said = "\n".join(typist.said)
    assert "counts as lost: nothing is repeated to the participant by itself" in " ".join(said.split())
    assert ONE[0][0] in said and ONE[0][1] in said


def test_a_new_session_or_none() -> None:
    assert choose_recovery(ONE, Typist(["n"])) == "new"
    for answers, code in ((["q"], 0), ([], 2)):
        with pytest.raises(Refused) as nothing:
            choose_recovery(ONE, Typist(answers))
        assert nothing.value.exit_code == code


@pytest.mark.parametrize(("answer", "which"), [("r", 0), ("r1", 0), ("r 2", 1), ("2", 1)])
def test_of_several_unfinished_sessions_the_latest_or_any_other(answer: str, which: int) -> None:
    typist = Typist(["r3", answer])
    assert choose_recovery(TWO, typist) == TWO[which][0]
    assert typist.said[0].startswith("2 earlier sessions")


def test_another_participant_s_session_is_named_and_never_chosen() -> None:
    for answers, chosen in ((["r", "r1", "1", "n"], "new"), (["r"], None)):
        typist = Typist(answers)
        if chosen is None:
            with pytest.raises(Refused):
                choose_recovery([], typist, ONE, "P08")
        else:
            assert choose_recovery([], typist, ONE, "P08") == chosen
        said = " ".join("\n".join(typist.said).split())
        assert ONE[0][1] in said and "not of P08" in said and "begin a new session for P08" in said
        assert "not offered again" not in said
        assert "--participant ID --recover" in said and not any(line.startswith("  r ") for line in typist.said)


def test_of_one_s_own_and_others_only_the_own_is_recovered() -> None:
    typist = Typist(["2", "r"])
    assert choose_recovery(ONE, typist, TWO[1:], "P07") == ONE[0][0]
    assert TWO[1][1] in "\n".join(typist.said)


def test_what_is_asked_fits_on_the_narrowest_terminal() -> None:
    sentence = "LabLinking: setting the table (debug, pepper), participant P07, condition no hesitation, begun " * 2
    typist = Typist(["n"])
    choose_recovery([("/s/a", sentence), ("/s/b", sentence)], typist, [("/s/c", sentence)], "P08, condition hesitation")
    assert max(map(len, typist.said)) < 80


def test_without_a_terminal_the_options_are_named() -> None:
    with pytest.raises(Refused, match="--recover to continue it, or --new") as nothing:
        choose_recovery(ONE, Typist(interactive=False))
    assert nothing.value.exit_code == 2


def test_nothing_that_a_title_contains_reaches_the_terminal_as_it_is() -> None:
    choose_recovery([("/s/\x1bx", "\x9b31m")], typist := Typist(["n"]))
    assert not any("\x1b" in line or "\x9b" in line for line in typist.said)


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--mode", "debug"), "use --mode only with --config DIR"),
        (("--new",), "use --new only with"),
        (("--config", "x", "--new", "--recover"), "use either --new or --recover"),
        (("--config", "x", "--replay", "y"), "say either --config or --replay"),
        (("--config", "x", "--speed", "2"), "--speed is for --replay"),
    ],
)
def test_wrong_usage(arguments: tuple[str, ...], said: str) -> None:
    done = CliRunner().invoke(main, list(arguments))
    assert done.exit_code == 2 and said in done.output


def run(*arguments: str, home: Path) -> subprocess.CompletedProcess[str]:
    home.mkdir(exist_ok=True)
    return run_rise_tui(*arguments, env=environment_of(str(home)))


def test_alone_without_a_session(tmp_path: Path) -> None:
    done = run(home=tmp_path / "h")
    assert done.returncode == 2 and "start one with: rise-tui --config DIR" in done.stderr


def test_without_a_terminal_no_session_is_started(tmp_path: Path) -> None:
    done = run("--config", DEMO, home=tmp_path / "h")
    assert done.returncode == 2 and "rise-engine serve" in done.stderr
    assert not (tmp_path / "h" / "sessions").exists()


def test_a_replay_of_nothing(tmp_path: Path) -> None:
    done = run("--replay", "nowhere", home=tmp_path / "h")
    assert done.returncode == 2 and "there is no session `nowhere`" in done.stderr

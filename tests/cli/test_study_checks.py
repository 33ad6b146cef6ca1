"""The checks of a study on the command line: what it asks, what it takes, and what it refuses, all at once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rise_engine.cli.study.checks import CheckOptions, gather_check_reports
from rise_engine.cli.terminal import Refused
from rise_engine.kernel.inputs import CheckReport
from rise_engine.study.model import StudyCheck
from rise_engine.study.study_log import LockedLog, StudyLogError, read_log
from tests.checks.samples import NOW, TerminalOfTest, context, results, script, study

pytestmark = pytest.mark.slow

LAMP = StudyCheck("lamp", ask="The lamp is on")
DOOR = StudyCheck("door", ask="The door is shut", blocks=False)
WIZARD = StudyCheck("wizard", auto="wizard")
SPACE = StudyCheck("space", auto="disk", minimum="900 TB")
DEBRIEF = StudyCheck("debrief", ask="Participant was debriefed", when="after")
CHECKS = (LAMP, DOOR, WIZARD, SPACE, DEBRIEF)


def gather(
    folder: Path, *checks: StudyCheck, terminal: TerminalOfTest, when: Any = "before", **more: Any
) -> tuple[CheckReport, ...]:
    options = CheckOptions(more.pop("confirmed", ()), more.pop("skipped", ()))
    return gather_check_reports(context(study(folder, *(checks or CHECKS)), **more), options, when, terminal)


def refused(folder: Path, *checks: StudyCheck, **more: Any) -> list[str]:
    with pytest.raises(Refused) as error:
        gather(folder, *checks, **more)
    return [line.removeprefix("error: ") for line in error.value.lines if line.startswith("error: ")]


def logged(folder: Path) -> list[tuple[str, str]]:
    return [(entry.get("id"), entry.get("result")) for entry in read_log(folder)]


# --- without a terminal ---------------------------------------------------------------------------------------------


def test_everything_that_is_missing_is_said_at_once_with_the_options_for_it(tmp_path: Path) -> None:
    terminal = TerminalOfTest(answers=False)
    lines = refused(tmp_path, terminal=terminal, wizard="root")
    assert lines == [
        "lamp: not confirmed: “The lamp is on”",
        "wizard: root: this is an account or a role, and does not say who it is; --wizard NAME, or add it to [wizards] "
        "in study.toml",
        lines[2],
    ]
    assert lines[2].startswith("space: ") and "free: 900.0 TB must be free in " in lines[2]
    assert not terminal.asked
    assert "warning  door: not confirmed: “The door is shut”" in terminal.lines
    assert logged(tmp_path) == [("wizard", "failed"), ("space", "failed")]


def test_options_say_what_is_done_and_what_is_left_out(tmp_path: Path) -> None:
    terminal = TerminalOfTest(answers=False)
    reports = gather(
        tmp_path, terminal=terminal, confirmed=("lamp", "door"), skipped=("space=a pilot in  the hall=way",)
    )
    assert results(reports) == {"lamp": "passed", "door": "passed", "wizard": "passed", "space": "skipped"}
    by_id = {report.id: report for report in reports}
    assert (by_id["lamp"].source, by_id["wizard"].source) == ("wizard:anna", "engine")
    assert (by_id["space"].reason, by_id["space"].source) == ("a pilot in the hall=way", "wizard:anna")
    assert logged(tmp_path) == list(results(reports).items())
    assert terminal.lines[-1] == "skipped  space: a pilot in the hall=way"


def test_options_that_cannot_be_meant_are_said_at_once_before_anything_is_looked_at(tmp_path: Path) -> None:
    consent = StudyCheck("agreed", auto="consent")
    lines = refused(
        tmp_path,
        *CHECKS,
        consent,
        terminal=TerminalOfTest(),
        confirmed=("lmap", "wizard", "debrief", "lamp"),
        skipped=("space", "door= ", "agreed=he said yes", "lamp=broken"),
    )
    assert lines == [
        "--skip-check space: say why: --skip-check 'space=the reason'",
        "--skip-check door: say why: --skip-check 'door=the reason'",
        "--skip-check agreed: consent cannot be skipped in a session that counts",
        "--confirm lmap: the study has no such check; did you mean `lamp`?",
        "--confirm wizard: the program checks this itself (the wizard has given a name)",
        "--confirm debrief: this check is made after a session (Participant was debriefed)",
        "lamp is both confirmed and skipped: use one of them",
    ]
    assert logged(tmp_path) == []


def test_what_cannot_be_skipped_is_not_proposed_to_be(tmp_path: Path) -> None:
    (line,) = refused(tmp_path, StudyCheck("agreed", auto="consent"), terminal=TerminalOfTest(answers=False))
    assert line.startswith("agreed: ")
    with pytest.raises(Refused) as error:
        gather(
            tmp_path,
            StudyCheck("agreed", auto="consent"),
            LAMP,
            WIZARD,
            terminal=TerminalOfTest(answers=False),
            wizard="",
        )
    assert error.value.lines[-2:] == [
        "when it is true, use --confirm lamp",
        "to skip what you cannot fix now, use --skip-check wizard=REASON",
    ]


def test_a_session_that_does_not_count_is_not_held_up(tmp_path: Path) -> None:
    terminal = TerminalOfTest(answers=False)
    reports = gather(tmp_path, terminal=terminal, purpose="training", wizard="root")
    assert results(reports) == {"wizard": "failed", "space": "failed"}
    assert "warning  lamp: not confirmed: “The lamp is on”" in terminal.lines


def test_in_debug_nothing_is_looked_at(tmp_path: Path) -> None:
    terminal = TerminalOfTest()
    assert gather(tmp_path, terminal=terminal, purpose="debug", mode="debug") == ()
    assert (terminal.lines, logged(tmp_path)) == ([], [])


def test_what_is_still_good_is_not_looked_at_again(tmp_path: Path) -> None:
    name = script(tmp_path, "calibrate.sh", "echo made >> made", "echo 0.4 degrees")
    check = StudyCheck("camera", run=(name,), valid=86_400.0)
    for _ in range(2):
        (report,) = gather(tmp_path, check, terminal=TerminalOfTest(answers=False))
    assert (report.result, report.value) == ("passed", "good since 2026-11-22 10:00: 0.4 degrees")
    assert (tmp_path / "made").read_text() == "made\n"
    assert logged(tmp_path) == [("camera", "passed")]


def test_a_log_that_cannot_be_written_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "study.jsonl").write_text("no entry\n")
    with pytest.raises(StudyLogError, match=r"study\.jsonl:1: this line is not JSON"):
        gather(tmp_path, WIZARD, terminal=TerminalOfTest(answers=False))


# --- on a terminal --------------------------------------------------------------------------------------------------


def test_somebody_answers(tmp_path: Path) -> None:
    terminal = TerminalOfTest("what?", "y dimmed  to 40 %", "n it squeaks")
    reports = gather(tmp_path, LAMP, DOOR, terminal=terminal)
    assert [(report.id, report.result, report.value, report.reason) for report in reports] == [
        ("lamp", "passed", "dimmed to 40 %", ""),
        ("door", "failed", "", "it squeaks"),
    ]
    question = "?        lamp: The lamp is on [y/n, and a word about it]"
    assert terminal.asked[:2] == [question, question]
    assert terminal.lines == ["ok       lamp: dimmed to 40 %", "warning  door: it squeaks"]


def test_what_failed_is_looked_at_again_or_skipped_and_all_of_it_is_kept(tmp_path: Path) -> None:
    terminal = TerminalOfTest("n", "a", "n", "s", "s  lamp  is on order ")
    (report,) = gather(tmp_path, LAMP, terminal=terminal)
    assert (report.result, report.reason, report.value) == (
        "skipped", "lamp is on order", "failed before: somebody answered no",
    )  # fmt: skip
    assert logged(tmp_path) == [("lamp", "failed"), ("lamp", "failed"), ("lamp", "skipped")]
    assert terminal.asked[1] == "         a: look again, s REASON: skip it, q: leave it for now"


def test_whoever_leaves_it_begins_nothing_and_the_failure_is_kept(tmp_path: Path) -> None:
    for typed in (("n bulb", "q"), ("n bulb",)):  # the second one closes the terminal
        assert refused(tmp_path, LAMP, terminal=TerminalOfTest(*typed)) == ["lamp: bulb"]
    assert logged(tmp_path) == [("lamp", "failed")] * 2
    assert refused(tmp_path, LAMP, terminal=TerminalOfTest()) == ["lamp: nobody answered"]


def test_consent_is_not_skipped_on_a_terminal_either(tmp_path: Path) -> None:
    terminal = TerminalOfTest("s he said yes", "q")
    assert len(refused(tmp_path, StudyCheck("agreed", auto="consent"), terminal=terminal)) == 1
    assert terminal.asked == ["         a: look again, q: leave it for now"] * 2


def test_a_program_is_mended_and_looked_at_again(tmp_path: Path) -> None:
    name = script(tmp_path, "tracker.sh", "echo no tracker", "exit 1")

    class Mending(TerminalOfTest):
        def ask(self, question: str) -> str:
            script(tmp_path, "tracker.sh", "echo tracker found")
            return super().ask(question)

    terminal = Mending("a")
    (report,) = gather(tmp_path, StudyCheck("tracker", run=(name,)), terminal=terminal)
    assert (report.result, report.value) == ("passed", "tracker found")
    assert terminal.lines == [
        "         tracker: ./tracker.sh ...",
        "FAILED   tracker: no tracker: ./tracker.sh ended with exit status 1",
        "         tracker: ./tracker.sh ...",
        "ok       tracker: tracker found",
    ]


# --- after a session ------------------------------------------------------------------------------------------------


def test_after_a_session_nothing_is_refused(tmp_path: Path) -> None:
    terminal = TerminalOfTest(answers=False)
    assert gather(tmp_path, terminal=terminal, when="after", session="2026_P07") == ()
    assert terminal.lines == ["warning  debrief: not confirmed: “Participant was debriefed”"]
    (report,) = gather(tmp_path, terminal=terminal, when="after", session="2026_P07", confirmed=("debrief",))
    assert report.result == "passed"
    (entry,) = read_log(tmp_path)
    assert (entry.get("when"), entry.get("session")) == ("after", "2026_P07")
    assert terminal.lines[-1] == "ok       debrief: Participant was debriefed"


def test_the_log_of_others_is_no_hindrance(tmp_path: Path) -> None:
    with LockedLog(tmp_path, lambda: NOW) as log:
        log.append("taken", slot=1, participant="P07")
    assert results(gather(tmp_path, WIZARD, terminal=TerminalOfTest())) == {"wizard": "passed"}

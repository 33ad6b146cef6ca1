"""A study of a receptionist as a new user makes and runs it, and what its report says, beside the journals.

Eight participants, polite or direct, in two orders and two languages, with a failure, a recovery, a withdrawal and one
who sat in another one's place. The numbers that are expected here come from the journals' lines alone.
"""

from __future__ import annotations

import json
import statistics
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest

from rise_engine.kernel.inputs import OutcomeReport
from rise_engine.results.report.document import Facts, Paragraph, ReportTable
from rise_engine.results.report.making import make_study_report
from rise_engine.study.begin import BeginRequest, plan_session
from rise_engine.study.state import OpenStudy
from tests.commands import run
from tests.results.analysis.samples import BEGAN, WIZARD, Script, play_session, recovered_session, sessions_of, task

SCENARIO = Path(__file__).with_name("reception")
NEW = (
    *("--yes", "--title", "Reception", "--id", "recep", "--scenario", SCENARIO, "--n", "8", "--seed", "3"),
    *("--factor", "wording=between", "--factor", "seq=between", "--stratum", "language=de,en"),
    *("--level", 'wording.polite=wording = "polite"', "--level", 'wording.direct=wording = "direct"'),
    *("--level", "seq.AB=order = [0, 1, 2, 3]", "--level", "seq.BA=order = [3, 2, 1, 0]"),
    *("--auto", "-", "--ask-after", "The participant was debriefed"),
)
FAULT = ("Speech=fail@2",)


def talk(*cues: float, beside: Script = (), outcome: Any = "complete", reason: str = "", until: float = 60.0) -> Script:
    """A conversation: its four cues, and what else the wizard does."""
    script = [(0.5, task("startInteractionRule", "Talk", pressed=0.45))]
    script += [(at, task("markCue", pressed=round(at - 0.05, 3))) for at in cues]
    said = OutcomeReport(status=outcome, reason=reason, source=WIZARD)
    return sorted([*script, *beside, (until - 1, said)], key=lambda each: each[0])


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    study = tmp_path_factory.mktemp("day") / "reception"
    run("study", "new", study, *NEW)
    people = [f"P{n:02},{'de' if n % 2 else 'en'},2026-11-01,," for n in range(1, 11)]
    people.insert(0, "participant,language,consent_study,status,comment")
    (study / "participants.csv").write_text("\n".join([*people, ""]), "utf-8")
    run("study", "plan", study)

    def play(who: str, script: Script, *, recover_at: float | None = None, faults: tuple[str, ...] = ()) -> Path:
        with OpenStudy(study) as open:
            plan = plan_session(open.state, BeginRequest(who))
            first = plan.first_input(open.state.study)
        more: dict[str, Any] = {
            "scenario": Path(plan.run.scenario),
            "started": first,
            "began": BEGAN + timedelta(hours=len(list((study / "sessions").glob("*")))),
            "seed": plan.seed,
            "language": plan.language,
        }
        if recover_at is None:
            made = play_session(study / "sessions", script, until=60.0, faults=faults, **more)
        else:
            made = recovered_session(
                study / "sessions", script=script, at=recover_at, away=20.0, noted=recover_at, faults=faults, **more
            )
        with OpenStudy(study):
            """Writes what the folder says into the log."""
        return made

    def key(at: float, topic: str) -> Script:
        return [(at, task("raiseEventTopic", topic, pressed=at - 0.1))]

    play("P01", talk(7, 14, 21, 28))
    play("P02", talk(7, 14, 34, 41, beside=[*key(12, "/laughs"), (13, task("markMistake", "4 late", pressed=12.9))]))
    play("P03", talk(7, 20, 27, 34, beside=key(13, "/asks_back")))
    play("P04", talk(6, outcome="aborted", reason="the robot stood still"), faults=FAULT)
    play("P04", talk(7, 15, 22, 29))
    play("P05", talk(7, 14, 30, 37), recover_at=11.5)
    play("P06", talk(7, 13.5, 20, 27))
    moved = play("P08", talk(8, 16, 24, 32))
    run("study", "reassign", study, moved.name, "P10", "--reason", "P10 sat there")
    play("P07", talk(7, 14, 24, 31, beside=key(20, "/refuses")))
    said = run("study", "withdraw", study, "P06", "--yes", status=1)
    assert "participants.csv, line 7: delete the line yourself" in said
    listed = (study / "participants.csv").read_text("utf-8").splitlines(keepends=True)
    (study / "participants.csv").write_text("".join(each for each in listed if not each.startswith("P06")), "utf-8")
    return study


# --- the journals' lines ----------------------------------------------------------------------------------------------


def lines(folder: Path) -> list[dict[str, Any]]:
    found = map(json.loads, (folder / "journal.jsonl").read_text("utf-8").splitlines())
    return [each for each in found if "seq" in each]


def waits(folder: Path) -> Iterator[float]:
    """From the end of each question to the cue after it, where the session had an engine all that time."""
    asked: int | None = None
    ended: float | None = None
    for each in lines(folder):
        match each["kind"], each.get("status"):
            case "rule", "entered" if each["state"] == "Ask":
                asked, ended = None, None
            case "action", "accepted" if each["act"] == "R_Ask" and asked is None:
                asked = each["task"]
            case "action", "succeeded" if each["task"] == asked:
                ended = each["t"]
            case "session", "recovered":
                asked, ended = -1, None
            case "cue", "marked" if ended is not None:
                yield (each["t"] if each["key_at"] is None else each["key_at"]) - ended
                ended = None


def complete(study: Path) -> list[Path]:
    """The complete sessions, by the last outcome in each journal."""
    found = []
    for folder in sessions_of(study):
        said = [each["status"] for each in lines(folder) if each["kind"] == "outcome"]
        found += [folder] if said[-1] == "complete" else []
    return found


def wizard_keys(folder: Path) -> int:
    about = ("markMistake", "goOn", "repeatAct", "stopRuleOfAct")
    tasks = {each["id"]: each for each in reversed(lines(folder)) if each["kind"] == "task"}
    keys = [each for each in tasks.values() if each["source"].startswith("wizard:") and each["cause"] is None]
    return sum(each["function"] not in about and each["status"] != "REJECTED" for each in keys)


# --- the report -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def told(study: Path) -> str:
    """Everything that the report says, a row of a table on one line."""
    document = make_study_report(study, conditions=True).document
    said = [document.summary, document.banner, *map(" ".join, document.facts)]
    for section in document.sections:
        for block in section.blocks:
            match block:
                case Paragraph():
                    said.append(block.text)
                case Facts():
                    said += map(" ".join, block.rows)
                case ReportTable():
                    said += [block.caption, *map(" ".join, block.rows), block.note]
    return "\n".join(said).replace("\u00a0", " ")


def test_the_dependent_variable_is_its_first_number(study: Path, told: str) -> None:
    by_condition: dict[str, list[float]] = {}
    for folder in complete(study):
        by_condition.setdefault(lines(folder)[0]["condition"], []).extend(waits(folder))
    assert sum(map(len, by_condition.values())) >= 20
    median = {
        name: f"{statistics.median(values):.2f} s in {name} (n {len(values)}" for name, values in by_condition.items()
    }
    first = told[told.index("Median participant_s of trials: ") :]
    assert [name for name in median if median[name] not in first] == []


def test_what_happened_to_whom(study: Path, told: str) -> None:
    finished = complete(study)
    assert f"{len(finished)} of 8 participants are complete. The study has {len(finished)} complete sessions." in told
    assert "Listed in participants.csv 9" in told and "Withdrawn 1" in told
    assert "Began a session 8 (1 of them has withdrawn since)" in told
    assert "P06" not in told, "who has withdrawn is in no sentence"
    assert "run 1, attempt 1 aborted the robot stood still" in told
    assert "recovered 1 time, 20.00 s without a running engine" in told
    assert f"A debriefing is recorded after 0 of {len(finished)} (0 %) complete sessions." in told
    assert "Not measured because the engine was away: P05, trial 2." in told


def test_who_did_what(study: Path, told: str) -> None:
    keys = sum(map(wizard_keys, complete(study)))
    assert f"anna {len(complete(study))} {keys} " in told
    begun = [each for folder in complete(study) for each in lines(folder) if each.get("status") == "ACTIVE"]
    acts = [each["behavior"] for each in begun if each.get("function") == "startCommunicationRobotAct"]
    prompts = acts.count("R_Prompt")  # all else descends from the wizard's keys and cues
    assert prompts == 2 and f"wizard {len(acts) - prompts} of {len(acts)} " in told
    assert f"rule by itself {prompts} of {len(acts)} " in told
    assert "No wizard acted" not in told


def test_the_study_is_proved_and_can_be_run_again(study: Path, tmp_path: Path) -> None:
    said = run("study", "check", "--sessions", study)
    assert "8 of 8 sessions proved" in said and "except the participant of 1 reassigned session" in said
    run("study", "bundle", study, "-o", tmp_path / "bundle")
    said = run("reproduce", tmp_path / "bundle")
    assert "8 of 8 sessions identical" in said and "is the program that runs here, byte for byte" in said

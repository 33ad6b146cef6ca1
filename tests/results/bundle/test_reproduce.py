"""`rise-engine reproduce`: what is found in bundles that somebody has changed, and on other robots."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from rise_engine import __version__
from rise_engine.base.errors import FileError
from rise_engine.cli.data.reproduce import compare_on_robot, load_for_robot, run_on_robot
from rise_engine.kernel.records import TaskRecord
from rise_engine.results.bundle.about import BundleOptions, read_about
from rise_engine.results.bundle.courses import read_recorded
from rise_engine.results.bundle.crate import fingerprint, manifest_text
from rise_engine.results.bundle.derived import (
    DerivedCheck,
    InputsCheck,
    check_inputs,
    compare_derived,
    sessions_in_order,
)
from rise_engine.results.bundle.making import make_bundle
from rise_engine.results.export.format import ExportError
from rise_engine.scenario.loader import load
from rise_engine.session.journal_format import encode_record, read_line, with_checksum
from rise_engine.study.proof import prove_sessions
from rise_engine.study.state import read_state
from rise_engine.study.traces import MANIFEST_FILE
from tests.commands import typed
from tests.results.analysis.samples import act, make_study, play_session, sessions_of, task, write_scenario

LOOK = """<InteractionRule name="Look" initial="Start">
  <State id="Start"><onEntry><function startCommunicationRobotAct="Smile"/></onEntry>
    <transition eventTopic="/Smile_end" target="Seen"/><transition after="500ms" target="Late"/></State>
  <State id="Seen"/><State id="Late"/></InteractionRule>"""
SMILE = (
    """<Dialogs><Dialog name="Smile"><Emotion><actionID>1</actionID><value>happy</value></Emotion></Dialog></Dialogs>"""
)
QUICK = """title = "Quick"
driver = "simulated"

[actions.Speech]
[actions.LookAt]
[actions.PointAt]
[actions.Animation]
names = ["*"]
[actions.Emotion]
seconds = 0.1
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bundle of a study that had two sessions."""
    root = tmp_path_factory.mktemp("reproduce")
    study = make_study(root / "study")
    kept = sessions_of(study)[1:3]
    log = (study / "study.jsonl").read_text("utf-8").splitlines(keepends=True)
    for other in set(sessions_of(study)) - set(kept):
        shutil.rmtree(other)
        log = [line for line in log if other.name not in line]
    (study / "study.jsonl").write_text("".join(log), "utf-8")
    make_bundle(read_state(study), kept, root / "bundle", BundleOptions())
    return root / "bundle"


@pytest.fixture
def bundle(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "bundle"))


def run(*arguments: object) -> tuple[int, str, str]:
    result = typed("reproduce", *arguments)
    return result.exit_code, result.stdout, result.stderr


def first_session(bundle: Path) -> Path:
    return min((bundle / "sessions").iterdir())


def test_a_whole_bundle(bundle: Path) -> None:
    status, said, errors = run(bundle)
    assert (status, errors) == (0, "")
    assert said.splitlines()[0].startswith("whole: ")
    assert said.count(": identical (") == 2
    status, said, _ = run(bundle, "--json")
    document = json.loads(said)
    assert (status, document["as_it_was"], document["whole"]) == (0, True, True)
    assert [each["identical"] for each in document["sessions"]] == [True, True]


def test_a_bundle_that_somebody_changed(bundle: Path) -> None:
    for name, more in (
        ("participants.csv", "P99,1900-01-01,,\n"),
        ("extra.txt", "extra"),
        (MANIFEST_FILE, "nonsense\n"),
    ):
        with (bundle / name).open("a", encoding="utf-8") as file:
            file.write(more)
    (bundle / "LICENSE").unlink()
    status, said, _ = run(bundle)
    assert status == 1
    for told in ("changed: participants.csv", "missing: LICENSE", "not part of the bundle: extra.txt"):
        assert told in said
    assert "is not the check sum of a file" in said
    assert "2 of 2 sessions identical" in said
    assert "not as it was made" in said


def test_a_record_that_somebody_changed_is_found_also_with_new_check_sums(bundle: Path) -> None:
    """Check sums are no proof against somebody who makes them again; the replay is."""
    journal = first_session(bundle) / "journal.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    at, record = next(
        (number, found)
        for number, line in enumerate(lines)
        if isinstance(found := read_line(line.rstrip(b"\n")), TaskRecord) and found.status == "SUCCEEDED"
    )
    record.status = "ABORTED"
    lines[at] = with_checksum(encode_record(record))
    journal.write_bytes(b"".join(lines))
    (bundle / MANIFEST_FILE).write_text(manifest_text(bundle), "utf-8")
    status, said, _ = run(bundle)
    assert status == 1
    assert "whole: " in said
    assert f"different: journal.jsonl:{at + 1}: record {record.seq}" in said
    assert '`status` is "ABORTED", but the replay gives "SUCCEEDED"' in said
    assert "1 of 2 sessions identical" in said
    assert "try again" not in said
    _of_another_version(bundle)
    said = run(bundle)[1]
    assert "it was made with rise-tui 9.9, and this is" in said
    assert "install the one in program/, and try again" in said


def _of_another_version(bundle: Path) -> None:
    about = bundle / "bundle.json"
    about.write_text(about.read_text("utf-8").replace(f'"program": "{__version__}"', '"program": "9.9"'), "utf-8")


# --- somebody who makes the check sums again --------------------------------------------------------------------------


def _replace(name: str, old: str, new: str) -> Callable[[Path], None]:
    def change(bundle: Path) -> None:
        text = (bundle / name).read_text("utf-8")
        assert old in text
        (bundle / name).write_text(text.replace(old, new, 1), "utf-8")

    return change


FOLLOWS = {
    "tables/acts.csv": (",Greet,", ",Great,", 'line 2, column act: the bundle has "Great", the new one "Greet"'),
    "tables/datapackage.json": ("seconds", "hours", "line "),
    "bids/README.md": ("2 sessions", "9 sessions", "line 3: "),
    "report/report.html": ("complete", "splendid", "line "),
    "report/sheet.md": ("How many", "How few", "line "),
}


def test_what_somebody_changed_is_named_also_with_new_check_sums(bundle: Path) -> None:
    for name, (old, new, _) in FOLLOWS.items():
        _replace(name, old, new)(bundle)
    (bundle / MANIFEST_FILE).write_text(manifest_text(bundle), "utf-8")
    status, said, _ = run(bundle)
    assert status == 1
    assert "whole: " in said
    for name, (_, _, told) in FOLLOWS.items():
        assert f"different: {name}: {told}" in said
    assert "2 of 2 sessions identical" in said


PEOPLE = {
    "who was excluded": (_replace("participants.csv", "P01,1900-01-01,", "P01,1900-01-01,excluded"), "report/sheet.md"),
    "a column more": (_replace("participants.csv", "status", "status,mood"), "participants.csv"),
}


@pytest.mark.parametrize("case", PEOPLE)
def test_what_follows_from_participants_and_the_log(bundle: Path, case: str) -> None:
    change, told = PEOPLE[case]
    change(bundle)
    try:
        found = [str(each) for each in compare(bundle).differences]
    except FileError as error:
        found = [str(error)]
    assert any(told in each and ("participants.csv" in each or case == "how a session ended") for each in found), found


INPUTS = {
    "the design": (_replace("study.toml", "n = 3", "n = 4"), "study.toml: no session was run with it"),
    "a word of an act": (_replace("scenario/acts/all.xml", "Hello", "Hullo"), "scenario/acts/all.xml: no session ran"),
    "a start value": (_replace("scenario/memory.json", '"visits": 0', '"visits": 3'), "scenario/memory.json: no"),
    "an act more": (
        lambda bundle: (bundle / "scenario" / "acts" / "z.xml").write_text("<Dialogs/>"),
        "scenario/acts/z",
    ),
}


@pytest.mark.parametrize("case", INPUTS)
def test_what_sessions_were_run_from_is_what_they_say(bundle: Path, case: str) -> None:
    change, told = INPUTS[case]
    assert inputs(bundle).problems == []
    change(bundle)
    (problem,) = inputs(bundle).problems
    assert told in problem


LATER = {
    "the title": (
        _replace("study.toml", 'title = "Hesitation"', 'title = "Tea"'),
        "study.toml: no session was run with",
    ),
    "a corrected word": (_replace("scenario/acts/all.xml", "Hello", "Hullo"), "scenario/: no session ran"),
    "files that a session took over": (_replace("scenario/acts/all.xml", "Hello", "Hullo"), ""),
}


@pytest.mark.parametrize("case", LATER)
def test_what_may_be_changed_after_the_last_session_is_no_difference(bundle: Path, case: str) -> None:
    change, told = LATER[case]
    change(bundle)
    if case == "a corrected word":  # as `rise-engine study plan --again` writes it
        state = read_state(bundle)
        loaded = load(bundle / "scenario", robot=state.study.robot or None, mode=state.study.mode)
        (planned,) = (each for each in state.log if each.kind == "planned")
        assert loaded.scenario is not None
        _replace("study.jsonl", planned.get("scenarios")["scenario"], loaded.scenario.hash)(bundle)
    elif case.startswith("files"):
        shutil.copytree(bundle / "scenario", first_session(bundle) / "scenario.2")
    found = inputs(bundle)
    assert found.problems == []
    assert any(each.startswith(told) for each in found.open) if told else "1 of 2 sessions" in str(found.proved)


def test_the_plan_is_the_one_that_the_log_names(whole: Path, tmp_path: Path) -> None:
    study = Path(shutil.copytree(whole.parent / "study", tmp_path / "study"))
    assert any(each.startswith("plan.csv is the plan") for each in inputs(study).proved)
    plan = study / "plan.csv"
    header, first, second, *others = plan.read_text("utf-8").splitlines()
    rows = [f"1,{second.partition(',')[2]}", f"2,{first.partition(',')[2]}"]
    plan.write_text("\n".join([header, *rows, *others, ""]), "utf-8")
    assert [each.partition(":")[0] for each in inputs(study).problems] == ["plan.csv"]


def test_sessions_are_those_of_the_log(bundle: Path) -> None:
    first, last = sorted((bundle / "sessions").iterdir())
    log = (bundle / "study.jsonl").read_text("utf-8").splitlines(keepends=True)
    kept = [line for line in log if f'"folder":"{first.name}"' not in line]
    (bundle / "study.jsonl").write_text("".join(kept), "utf-8")
    shutil.rmtree(last)
    found = {each.name: each.problems for each in prove_sessions(bundle, read_state(bundle), absent={})}
    assert found[last.name] == ("study.jsonl names this session, and its folder is not there",)
    assert "study.jsonl does not name this session" not in found[first.name], "its outcome does"
    (bundle / "study.jsonl").write_text("".join(line for line in log if first.name not in line), "utf-8")
    found = {each.name: each.problems for each in prove_sessions(bundle, read_state(bundle), absent={last.name: "x"})}
    assert found == {first.name: ("study.jsonl does not name this session",)}


def inputs(root: Path) -> InputsCheck:
    state = read_state(root)
    return check_inputs(root, state, sessions_in_order(root, state))


def test_what_it_proves_and_what_not(bundle: Path) -> None:
    status, said, _ = run(bundle)
    assert status == 0
    proves, not_proved = said.split("This proves:")[1].split("This does not prove:")
    for each in (
        "2 sessions: every record follows",
        "study.toml is what it was in 2 sessions",
        "scenario/ is the scenario of 2 sessions",
        "tables, BIDS and the report follow",
    ):
        assert each in proves
    assert fingerprint(bundle) in not_proved
    assert "participants.csv, questionnaires, coded.json" in not_proved


def test_what_people_may_write_later_changes_no_session(bundle: Path) -> None:
    """Authors and a licence are named when a study is published; its report tells of them, so it is made again."""
    with (bundle / "study.toml").open("a", encoding="utf-8") as file:
        file.write('\n[report]\nstory = "Tea"\n')
    found = inputs(bundle)
    assert (found.problems, len(found.proved)) == ([], 3)
    assert any(each.file == "report/sheet.md" for each in compare(bundle).differences)


def compare(bundle: Path, *, same_version: bool = True) -> DerivedCheck:
    return compare_derived(bundle, read_about(bundle), same_version=same_version)


def test_a_bundle_of_another_version_is_compared_as_far_as_both_know_it(bundle: Path) -> None:
    """Another version has a column more, and says other things in the report."""
    table = bundle / "tables" / "acts.csv"
    rows = table.read_text("utf-8").splitlines()
    table.write_text("\n".join([f"{row},{n or 'new'}" for n, row in enumerate(rows)]) + "\n", "utf-8")
    _replace("report/report.html", "complete", "whole")(bundle)
    same = compare(bundle)
    assert [each.file for each in same.differences] == ["report/report.html", "tables/acts.csv"]
    assert "its columns differ (new)" in str(same.differences[1])
    other = compare(bundle, same_version=False)
    assert (other.differences, other.not_compared) == ([], ["report/report.html"])
    _replace("tables/acts.csv", ",Greet,", ",Great,")(bundle)
    assert [each.file for each in compare(bundle, same_version=False).differences] == ["tables/acts.csv"]


def test_a_session_that_cannot_be_replayed(bundle: Path) -> None:
    shutil.rmtree(first_session(bundle) / "scenario")
    status, said, _ = run(bundle)
    assert status == 1
    assert "not proved" in said


def test_no_bundle(tmp_path: Path) -> None:
    assert run(tmp_path)[0] == 2
    assert run(tmp_path / "gone.zip")[0] == 2


# --- other robots ---------------------------------------------------------------------------------------------------


def test_the_same_robot_without_its_fault(bundle: Path) -> None:
    """In the sample, pointing fails once and is repeated; a robot without that fault does it the first time."""
    status, said, _ = run(bundle, "--robot", "generic")
    assert status == 1
    assert "2 of 2 sessions identical" in said
    assert "14 of 16 acts end as before" in said
    assert "Point of wizard:W1, at 40.0 s: SUCCEEDED, not ABORTED" in said
    assert "Point of wizard:W1 (number 2), at 43.0 s: was not played" in said
    assert "the same way: Lamp, Visit" in said
    document = json.loads(run(bundle, "--robot", "generic", "--json")[1])
    assert document["on_robot"][0]["acts"] == 16
    assert document["on_robot"][0]["same"] == 14


def test_without_a_fault_the_same_robot_does_the_same(tmp_path: Path) -> None:
    script = [
        (1.0, task("startInteractionRule", "Visit")),
        act("Answer", 20.0),
        act("Nod", 21.0),
        (21.5, task("cancelTask", "3")),
        (22.0, task("markMistake", "4 wrong")),
    ]
    folder = play_session(tmp_path / "sessions", script, until=40.0)
    comparison = compare_on_robot(folder, "generic")
    assert comparison.identical
    assert (comparison.same, comparison.longer) == (comparison.acts, [])
    recorded = read_recorded(folder, 7)
    again = list(run_on_robot(recorded, load_for_robot(folder, "generic")))
    kinds = [(each.seq, type(each).__name__, each.t) for each in again[: len(recorded.records) - 1]]
    assert kinds == [(each.seq, type(each).__name__, each.t) for each in recorded.records[:-1]]


def test_what_the_end_of_the_session_stops_is_no_other_way(tmp_path: Path) -> None:
    """The robot smiles when the session ends; the other robot has smiled by then."""
    scenario = write_scenario(tmp_path / "scenario")
    (scenario / "rules" / "look.xml").write_text(LOOK.replace("500ms", "5s"), "utf-8")
    (scenario / "acts" / "smile.xml").write_text(SMILE, "utf-8")
    script = [act("Nod", 1.0), act("Smile", 18.0)]
    folder = play_session(tmp_path / "sessions", script, scenario=scenario, until=18.5)
    (folder / "scenario" / "robots").mkdir(exist_ok=True)
    (folder / "scenario" / "robots" / "quick.toml").write_text(QUICK, "utf-8")
    comparison = compare_on_robot(folder, "quick")
    assert (comparison.acts_differ, comparison.rules_differ, comparison.acts) == ([], [], 1)


def test_tasks_about_tasks_find_theirs_although_numbers_differ(tmp_path: Path) -> None:
    """On the other robot, an act is not repeated after a failure, so every later task has another number."""
    script = [act("Point", 1.0), act("Answer", 20.0), (20.5, task("cancelTask", "3")), act("Nod", 30.0)]
    folder = play_session(tmp_path / "sessions", script, until=50.0)
    recorded = read_recorded(folder, 7)
    answer = next(each.id for each in recorded.records if isinstance(each, TaskRecord) and each.behavior == "Answer")
    assert answer == 3  # the second one is the repetition
    records = run_on_robot(recorded, load_for_robot(folder, "generic"))
    states = {each.behavior: each.status for each in records if isinstance(each, TaskRecord)}
    assert states["Answer"] == "CANCELED"
    assert states["Nod"] == "SUCCEEDED"


def test_a_robot_that_goes_another_way(tmp_path: Path) -> None:
    """A rule waits half a second for the end of a smile, which on another robot has ended by then."""
    scenario = write_scenario(tmp_path / "scenario")
    (scenario / "rules" / "look.xml").write_text(LOOK, "utf-8")
    (scenario / "acts" / "smile.xml").write_text(SMILE, "utf-8")
    script = [(1.0, task("startInteractionRule", "Look")), act("Thanks", 8.0)]
    folder = play_session(tmp_path / "sessions", script, scenario=scenario, until=20.0)
    (folder / "scenario" / "robots").mkdir(exist_ok=True)
    (folder / "scenario" / "robots" / "quick.toml").write_text(QUICK, "utf-8")
    comparison = compare_on_robot(folder, "quick")
    (difference,) = comparison.rules_differ
    assert re.fullmatch(r"Look: comes into Seen at 1\.\d s, not into Late at 1\.5 s", difference)
    assert (comparison.same, comparison.acts, comparison.identical) == (2, 2, False)
    assert comparison.median_longer < -0.3


def test_a_robot_that_does_not_fit_the_scenario(bundle: Path, tmp_path: Path) -> None:
    status, _, errors = run(bundle, "--robot", "napo")
    assert status == 2
    assert "did you mean `nao`?" in errors
    folder = play_session(tmp_path / "sessions", [act("Nod", 1.0)], until=9.0)
    with pytest.raises(ExportError, match="cannot be run on the robot 'nao'"):
        compare_on_robot(folder, "nao")


def test_a_participant_who_is_not_listed_any_more_is_named(bundle: Path) -> None:
    lines = (bundle / "participants.csv").read_text("utf-8").splitlines(keepends=True)
    (bundle / "participants.csv").write_text("".join(each for each in lines if not each.startswith("P01")), "utf-8")
    assert "participants.csv: it has no row for P01, whose session is here" in inputs(bundle).problems


def test_another_program_in_the_bundle_is_not_said_to_be_this_one(bundle: Path) -> None:
    (wheel,) = (bundle / "program").glob("*.whl")
    said = f"program/{wheel.name} is the program that runs here, byte for byte"
    assert f"- {said}" in run(bundle)[1]
    wheel.write_bytes(bytes(wheel.stat().st_size))
    (bundle / MANIFEST_FILE).write_text(manifest_text(bundle), "utf-8")
    status, told, _ = run(bundle)
    assert status == 0 and said not in told
    assert f"- that program/{wheel.name} is the program that ran the sessions: another one runs here" in told

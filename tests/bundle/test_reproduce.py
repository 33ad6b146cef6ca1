"""`rise-engine reproduce`: what is found in bundles that somebody has changed, and on other robots."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from rise_engine import __version__
from rise_engine.bundle.courses import read_recorded
from rise_engine.bundle.making import BundleOptions, make_bundle
from rise_engine.bundle.manifest import manifest_text
from rise_engine.cli.other_robot import CannotRun, compare_on_robot, load_for_robot, run_on_robot
from rise_engine.cli.reproduce import reproduce
from rise_engine.kernel.records import TaskRecord
from rise_engine.session.journal_format import encode_record, read_line, with_checksum
from rise_engine.study.state import read_state
from rise_engine.study.traces import MANIFEST_FILE

from ..analysis.samples import act, make_study, play_session, sessions_of, task, write_scenario

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
    result = CliRunner().invoke(reproduce, [str(each) for each in arguments])
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


def _change(bundle: Path) -> None:
    with (bundle / "participants.csv").open("a", encoding="utf-8") as file:
        file.write("P99,1900-01-01,,\n")


def _remove(bundle: Path) -> None:
    (bundle / "LICENSE").unlink()


def _add(bundle: Path) -> None:
    (bundle / "extra.txt").write_text("extra", "utf-8")


def _spoil_manifest(bundle: Path) -> None:
    with (bundle / MANIFEST_FILE).open("a", encoding="utf-8") as file:
        file.write("nonsense\n")


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (_change, "changed: participants.csv"),
        (_remove, "missing: LICENSE"),
        (_add, "not of the bundle: extra.txt"),
        (_spoil_manifest, "is no check sum of a file"),
    ],
)
def test_a_bundle_that_somebody_changed(bundle: Path, damage: Callable[[Path], None], told: str) -> None:
    damage(bundle)
    status, said, _ = run(bundle)
    assert status == 1
    assert told in said
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
    assert "try that version" not in said
    environment = bundle / "environment.txt"
    environment.write_text(environment.read_text("utf-8").replace(f"rise-tui=={__version__}", "rise-tui==9.9"), "utf-8")
    assert "it was made with rise-tui 9.9, and this is" in run(bundle)[1]


def test_a_session_that_cannot_be_replayed(bundle: Path) -> None:
    shutil.rmtree(first_session(bundle) / "scenario")
    status, said, _ = run(bundle)
    assert status == 1
    assert "cannot be replayed" in said


def test_no_bundle(tmp_path: Path) -> None:
    assert run(tmp_path)[0] == 2
    assert run(tmp_path / "gone.zip")[0] == 2


# --- other robots ---------------------------------------------------------------------------------------------------


def test_the_same_robot_without_its_fault(bundle: Path) -> None:
    """In the sample, pointing fails once and is repeated; a robot without that fault does it the first time."""
    status, said, _ = run(bundle, "--robot", "generic")
    assert status == 1
    assert "2 of 2 sessions identical" in said
    assert "14 of 16 acts end as they had" in said
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
    with pytest.raises(CannotRun, match="cannot be run on the robot 'nao'"):
        compare_on_robot(folder, "nao")

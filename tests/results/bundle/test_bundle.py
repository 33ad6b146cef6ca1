"""Bundles: what is in them, what is not, and that they come out again."""

from __future__ import annotations

import csv
import json
import shutil
import zipfile
from pathlib import Path
from types import SimpleNamespace

import pytest

from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.bundle import crate as bundle_files
from rise_engine.results.bundle.about import BundleOptions
from rise_engine.results.bundle.contents import log_text, participants_text, study_text
from rise_engine.results.bundle.crate import opened_bundle
from rise_engine.results.bundle.derived import check_bundle
from rise_engine.results.bundle.making import BundleReport, make_bundle
from rise_engine.results.export.format import ExportError
from rise_engine.study.proof import prove_sessions
from rise_engine.study.state import OpenStudy, read_state
from rise_engine.study.study_log import LogEntry, read_log
from rise_engine.study.study_toml import load_study
from rise_engine.study.withdrawal import withdraw
from tests.commands import typed
from tests.results.analysis.samples import make_study, play_session, sessions_of, task, write_scenario
from tests.results.export.test_bids import VALIDATOR, validate, with_validator

SECRETS = ("zelda", "quux", "anna", "felt sick", "looks away", "hurry", "asks something", "/data/", "2024-11-23")


FOLDER = "2024-11-23_100000_P01_x_real"


def bundle_of(
    study: Path, out: Path, level: ExportLevel = "shared", folders: list[Path] | None = None, license: str = ""
) -> BundleReport:
    """The bundle of all sessions but the pilot."""
    if folders is None:
        folders = [each for each in sessions_of(study) if not each.name.endswith("_pilot")]
    return make_bundle(read_state(study), folders, out, BundleOptions(level, license=license))


def run(*arguments: object) -> tuple[int, str, str]:
    result = typed(*arguments)
    return result.exit_code, result.stdout, result.stderr


def texts_in(root: Path) -> str:
    files = (path for path in sorted(root.rglob("*")) if path.is_file() and path.suffix != ".whl")
    return "".join(path.read_text("utf-8") for path in files).casefold()


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three participants with two runs each; one wizard is named in study.toml."""
    folder = make_study(tmp_path_factory.mktemp("bundle") / "study")
    with (folder / "study.toml").open("a", encoding="utf-8") as file:
        file.write('\n[wizards]\nanna = "Observer"\n')
    return folder


@pytest.fixture(scope="module")
def report(study: Path) -> BundleReport:
    """Of a bundle at level shared."""
    return bundle_of(study, study.parent / "bundle", license="CC-BY-4.0")


@pytest.fixture(scope="module")
def bundle(study: Path, report: BundleReport) -> Path:
    return study.parent / "bundle"


# --- what is in it --------------------------------------------------------------------------------------------------


def test_everything_that_others_need_is_in_it(bundle: Path) -> None:
    names = {path.name for path in bundle.iterdir()}
    assert names >= {
        *(
            "study.toml",
            "participants.csv",
            "plan.csv",
            "study.jsonl",
            "scenario",
            "sessions",
            "bids",
            "tables",
            "report",
        ),
        *("LICENSE", "README.md", "environment.txt", "ro-crate-metadata.json", "manifest-sha256.txt"),
    }
    assert len(list((bundle / "sessions").iterdir())) == 7
    assert "https://creativecommons.org/licenses/by/4.0/" in (bundle / "LICENSE").read_text("utf-8")
    environment = (bundle / "environment.txt").read_text("utf-8")
    assert "\nmsgspec==" in environment
    assert "pytest" not in environment
    assert load_study(bundle).study is not None
    assert [path for path in (bundle, *bundle.rglob("*")) if path.stat().st_mode & 0o077] == []


def test_nothing_private_is_in_it(study: Path, bundle: Path) -> None:
    assert all(secret in texts_in(study) for secret in SECRETS)
    text = texts_in(bundle)
    assert [secret for secret in SECRETS if secret in text] == []
    assert [name for name in bundle.rglob("*") if "2024-11" in name.name] == []
    assert "wizard:observer" in text


def test_at_level_public_there_is_no_free_speech_either(study: Path, bundle: Path, tmp_path: Path) -> None:
    report = bundle_of(study, tmp_path / "public", "public", sessions_of(study)[1:3])
    assert "shall we go on" in texts_in(bundle)
    assert "shall we go on" not in texts_in(tmp_path / "public")
    assert all(each.proved for each in prove_sessions(tmp_path / "public", None))
    assert not any("said freely" in each for each in report.to_check)


def test_at_level_full_everything_is_as_it_was(study: Path, tmp_path: Path) -> None:
    report = bundle_of(study, tmp_path / "full", "full", sessions_of(study)[1:3])
    folder = sessions_of(study)[1]
    for name in ("journal.jsonl", "session.toml", "scenario/acts/all.xml"):
        assert (tmp_path / "full" / "sessions" / folder.name / name).read_bytes() == (folder / name).read_bytes()
    assert (tmp_path / "full" / "study.toml").read_bytes() == (study / "study.toml").read_bytes()
    assert any("do not publish it" in each for each in report.to_check)


def test_the_exports_tell_of_the_sessions_that_are_in_it(bundle: Path) -> None:
    names = {path.name for path in (bundle / "sessions").iterdir()}
    with (bundle / "tables" / "sessions.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["session"] for row in rows} == names
    assert {row["outcome"] for row in rows} == {"complete", "aborted"}


@with_validator
@pytest.mark.slow
def test_the_bids_data_set_of_real_sessions_is_valid(bundle: Path) -> None:
    assert VALIDATOR.exists()
    status, errors, findings = validate(bundle / "bids")
    assert (status, errors) == (0, set())
    missing = {each.get("subCode") for each in findings}
    assert missing <= {"HEDVersion", "CogAtlasID", "CogPOID", "License", "Authors", None}, findings


def test_an_export_of_the_bundle_is_the_export_of_the_study(study: Path, bundle: Path, tmp_path: Path) -> None:
    """Whoever has the bundle can make every other format, and finds the same in it."""
    for name, folder in (("a", study), ("b", bundle)):
        status, _, errors = run("export", folder, "--format", "bids", "--level", "shared", "-o", tmp_path / name)
        assert status == 0, errors
    first, second = (sorted((tmp_path / name).rglob("*_beh.tsv")) for name in "ab")
    assert [path.name for path in first] == [path.name for path in second]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert check_bundle(bundle).whole  # an export is noted in studies, and not in bundles


def test_what_is_said_of_it(report: BundleReport, bundle: Path) -> None:
    assert any(line.startswith("sessions/: 7 sessions of 3 participants") for line in report.contents)
    assert any("1 participant of participants.csv who has no session" in line for line in report.omitted)
    told = "\n".join(report.to_check)
    assert "6 sentences that wizards said freely" in told
    assert "words that could be names: Nodd" in told
    readme = (bundle / "README.md").read_text("utf-8")
    assert all(f"- {line}" in readme for line in (*report.contents, *report.omitted))


def test_the_study_knows_of_it_before_it_is_there(study: Path, bundle: Path) -> None:
    entry = next(each for each in read_log(study) if each.kind == "exported" and each.get("path") == str(bundle))
    assert (entry.get("format"), entry.get("level")) == ("bundle", "shared")
    assert entry.get("participants") == ["P01", "P02", "P03"]
    assert not any(each.kind == "exported" for each in read_log(bundle))


def test_a_bundle_can_be_looked_at_as_the_study_could(study: Path, bundle: Path) -> None:
    before, after = read_state(study), read_state(bundle)
    assert after.standing.complete == before.standing.complete == 3
    assert [each.entry.outcome for each in after.sessions] == [
        each.entry.outcome for each in before.sessions if each.entry.purpose == "counted"
    ]
    assert after.problems == ()


def test_a_withdrawal_erases_the_bundle(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    for out in (study / "bundle", tmp_path / "elsewhere"):
        bundle_of(study, out, folders=sessions_of(study)[1:4])
    report = withdraw(study, "P01")
    assert not (study / "bundle").exists()
    assert report.make_again == [f"{study / 'bundle'} (with P02, P03)"]
    assert (tmp_path / "elsewhere").exists()
    assert any(f"{tmp_path / 'elsewhere'} was exported with their data" in sentence for sentence in report.unreached)


@pytest.mark.parametrize("earlier", [False, True], ids=["", "written again by an earlier version"])
@pytest.mark.parametrize("level", ["public", "full"])
def test_no_bundle_names_a_session_of_somebody_who_has_withdrawn_and_whose_session_came_back(
    tmp_path: Path, level: ExportLevel, earlier: bool
) -> None:
    study = make_study(tmp_path / "study")
    theirs = sessions_of(study)[1]
    shutil.copytree(theirs, tmp_path / "backup")
    withdraw(study, "P01")
    shutil.copytree(tmp_path / "backup", theirs)
    kept = (study / "study.jsonl").read_bytes()
    about = '"at":"2024-11-24T10:00:00","participant":"P01","slot":1'
    begun = f'{{"kind":"session",{about},"purpose":"counted","run":1,"attempt":1,"folder":"{theirs.name}'
    lines = f'{{"kind":"taken",{about}}}\n{begun}"}}\n{begun}_gone"}}\n'
    if earlier:
        (study / "study.jsonl").write_bytes(kept + lines.encode())
    status, said, _ = run("study", "bundle", study, "-o", tmp_path / "bundle", "--level", level)
    assert status == 0
    assert "1 session, because the participant has withdrawn" in (tmp_path / "bundle" / "README.md").read_text("utf-8")
    assert "p01" not in texts_in(tmp_path / "bundle")
    assert list((tmp_path / "bundle").rglob("*P01*")) == []
    assert f"{theirs.name} is not in the export: its participant has withdrawn" in said.partition("look at this")[2]
    with OpenStudy(study):
        assert kept in (study / "study.jsonl").read_bytes()
    assert earlier or "P01" not in (study / "study.jsonl").read_text("utf-8"), "the next session writes nothing of them"
    withdraw(study, "P01")
    assert "P01" not in (study / "study.jsonl").read_text("utf-8") and not theirs.exists()


@pytest.mark.parametrize("level", ["shared", "full"])
def test_sessions_that_are_left_out_have_the_names_of_the_level(tmp_path: Path, level: ExportLevel) -> None:
    study = make_study(tmp_path / "study")
    _, unreadable, moved, copied, gone, *_ = sessions_of(study)
    (unreadable / "session.toml").write_text("")
    moved.rename(tmp_path / "moved")
    shutil.copytree(copied, study / "sessions" / "2024-12-24 P02 again")
    shutil.rmtree(gone / "scenario")
    status, said, _ = run("study", "bundle", study, "-o", tmp_path / "bundle", "--level", level)
    readme = (tmp_path / "bundle" / "README.md").read_text("utf-8")
    assert status == 0
    cut = (lambda name: name) if level == "full" else (lambda name: name[18:])
    assert f"- session {cut(unreadable.name)}, because it cannot be read\n" in readme
    assert f"- session {cut(moved.name)}, because it is not in the study's sessions any more\n" in readme
    assert "- a folder, because it is a copy of another session\n" in readme
    assert str(tmp_path) not in readme
    assert ("2024-1" in readme) == (level == "full")
    assert f"{unreadable.name} is not in the export: it cannot be read: {unreadable}" in said, "for the study's people"


def test_the_plan_is_left_out_while_somebody_is_to_come(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    folders = sessions_of(study)[1:2]
    toml = study / "study.toml"
    toml.write_text(toml.read_text("utf-8").replace("n = 3", "n = 4"), "utf-8")
    report = bundle_of(study, tmp_path / "bundle", folders=folders)
    assert not (tmp_path / "bundle" / "plan.csv").exists()
    assert any("what the next participants get" in line for line in report.omitted)
    assert any("LICENSE: nothing says" in line for line in report.to_check)


def test_a_session_that_cannot_be_shared_is_left_out_with_a_sentence(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    first, second = sessions_of(study)[1:3]
    journal = first / "journal.jsonl"
    journal.write_bytes(journal.read_bytes()[:-40])  # torn: nobody can prove what it is
    report = bundle_of(study, tmp_path / "bundle", folders=[first, second])
    assert [path.name for path in (tmp_path / "bundle" / "sessions").iterdir()] == ["P01_hesitation_real_run2"]
    assert report.sessions == 1
    assert any("P01_hesitation_real_run1 itself, because its journal is damaged" in each for each in report.omitted)
    actions = json.loads((tmp_path / "bundle" / "ro-crate-metadata.json").read_text("utf-8"))["@graph"]
    assert sum(each["@type"] == "CreateAction" for each in actions) == 2


def test_an_archive_names_the_session_that_cannot_be_run_again(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    first, second = sessions_of(study)[1:3]
    journal = first / "journal.jsonl"
    journal.write_bytes(journal.read_bytes().replace(b"hurry", b"hurra", 1))
    report = bundle_of(study, tmp_path / "bundle", "full", [first, second])
    assert any(line.startswith("sessions/: 2 sessions of 1 participant, 1 of which can be") for line in report.contents)
    told = [each for each in report.to_check if first.name in each]
    assert len(told) == 1 and "reproduce will report it too" in told[0], report.to_check


def test_answers_of_somebody_without_a_session_are_named(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    with (study / "study.toml").open("a", encoding="utf-8") as file:
        file.write('\n[questionnaire.after]\nfile = "after.csv"\n')
    (study / "after.csv").write_text("participant,q1\nP01,1\nP02,2\nP09,3\n", "utf-8")
    report = bundle_of(study, tmp_path / "bundle", folders=sessions_of(study)[1:3])
    assert [each for each in report.omitted if each.startswith("after.csv")] == [
        "after.csv, line 4: left out, because participants.csv does not have the participant; `rise-engine study "
        "check` says more",
        "after.csv, line 3: left out, because there is no session of this participant and run in it",
    ]


def test_shadows_are_in_an_archive_and_nowhere_else(study: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(study, tmp_path / "study"))
    session = sessions_of(folder)[1]
    (session / "shadow").mkdir()
    (session / "shadow" / "1.jsonl").write_text("{}\n", "utf-8")
    report = bundle_of(folder, tmp_path / "shared", folders=[session])
    assert any(
        each.startswith("1 shadow of P01_hesitation_real_run1: they hold what second wizards")
        for each in report.omitted
    )
    assert not list((tmp_path / "shared").rglob("shadow"))
    bundle_of(folder, tmp_path / "full", "full", folders=[session])
    assert (tmp_path / "full" / "sessions" / session.name / "shadow" / "1.jsonl").is_file()


def test_nothing_is_written_over_and_nothing_is_left(study: Path, tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    with pytest.raises(ExportError, match="is there already"):
        bundle_of(study, tmp_path / "there")
    with pytest.raises(ExportError, match="no session to put"):
        bundle_of(study, tmp_path / "new", folders=[])
    with pytest.raises(ExportError, match="no folder"):
        bundle_of(study, tmp_path / "nowhere" / "new")
    assert [path.name for path in tmp_path.iterdir()] == ["there"]


def test_who_publishes_stands_in_study_toml(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    with (study / "study.toml").open("a", encoding="utf-8") as file:
        file.write(
            '\n[report]\nauthors = "Doe, J. (0000-0002-1825-0097); Roe, M."\nethics = "No. 7"\n'
            'funding = "DFG"\nlicense = "CC0-1.0"\ninstitution = "A lab"\n'
        )
    report = bundle_of(study, tmp_path / "bundle", folders=sessions_of(study)[1:2])
    assert not any("LICENSE" in each or "dataset_description" in each for each in report.to_check)
    crate = json.loads((tmp_path / "bundle" / "ro-crate-metadata.json").read_text("utf-8"))["@graph"]
    people = [each["name"] for each in crate if each["@type"] == "Person"]
    assert people == ["Doe, J.", "Roe, M."]
    assert crate[1]["license"] == {"@id": "https://creativecommons.org/publicdomain/zero/1.0/"}
    assert crate[1]["author"] == [{"@id": "https://orcid.org/0000-0002-1825-0097"}, {"@id": "#author-2"}]
    assert crate[1]["funder"] == {"@id": "#funder"} and "Ethics: No. 7" in crate[1]["description"]
    described = json.loads((tmp_path / "bundle" / "bids" / "dataset_description.json").read_text("utf-8"))
    assert (described["Authors"], described["License"]) == (["Doe, J.", "Roe, M."], "CC0-1.0")
    assert (described["EthicsApprovals"], described["Funding"]) == (["No. 7"], ["DFG"])
    package = json.loads((tmp_path / "bundle" / "tables" / "datapackage.json").read_text("utf-8"))
    assert package["licenses"] == [{"name": "CC0-1.0", "path": "https://creativecommons.org/publicdomain/zero/1.0/"}]
    assert [each["title"] for each in package["contributors"]] == ["Doe, J.", "Roe, M."]
    assert package["contributors"][0]["path"] == "https://orcid.org/0000-0002-1825-0097"
    assert (package["ethics"], package["funding"]) == ("No. 7", "DFG")
    task = json.loads((tmp_path / "bundle" / "bids" / "task-hesitation_events.json").read_text("utf-8"))
    assert task["InstitutionName"] == "A lab"


# --- its study's files ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "written",
    [
        '[wizards]\nanna = "W1"\n\n[strata]\na = ["b"]\n',
        'wizards = { anna = "W1" }\n[strata]\na = ["b"]\n',
        'wizards.anna = "W1"\n[strata]\na = ["b"]\n',
        '[strata]\na = ["b"]\n  [wizards]  # who\nanna = "W1"\nben = "W2"\n',
    ],
)
def test_the_names_of_wizards_leave_study_toml(written: str) -> None:
    text = study_text(f'title = "T"\n{written}', {"anna": "W1"}, "shared")
    assert "anna" not in text
    assert '"W1" = "W1"' in text
    assert 'a = ["b"]' in text
    assert study_text(f'title = "T"\n{written}', {"anna": "W1"}, "full") == f'title = "T"\n{written}'


def test_wizards_that_cannot_be_taken_out() -> None:
    with pytest.raises(ExportError, match="as a table of its own"):
        study_text('"wizards" = { anna = "W1" }\n', {"anna": "W1"}, "shared")


def test_participants_have_no_comments_no_dates_and_no_age_above_89(tmp_path: Path) -> None:
    folder = make_study(tmp_path / "study")
    toml = folder / "study.toml"
    toml.write_text(toml.read_text("utf-8") + '\n[participants]\ncolumns = ["age"]\n', "utf-8")
    people = "participant,consent_study,status,comment,age\nP01,2026-11-01,,was late,93\nP02,,excluded,,20\n"
    (folder / "participants.csv").write_text(people, "utf-8")
    study, found = load_study(folder).study, read_state(folder).participants
    assert study is not None
    shared = participants_text(study, found, "shared").splitlines()
    assert shared == ["participant,consent_study,status,age", "P01,1900-01-01,,89", "P02,,excluded,20"]
    assert participants_text(study, found, "public").splitlines()[1] == "P01,1900-01-01,,89"
    assert participants_text(study, found, "full").splitlines()[1] == "P01,2026-11-01,,93"


def test_the_log_has_no_salts_dates_names_and_no_words_of_people() -> None:
    log = [
        LogEntry("withdrawn", "2024-11-23T10:00:00", {"slot": 1, "salt": "s3cret", "hash": "abc"}, 1),
        LogEntry("excluded", "2024-11-23T10:00:00", {"reason": "Zelda was ill", "source": "wizard:anna"}, 2),
        LogEntry("exported", "2024-11-23T10:00:00", {"path": "/home/anna/out"}, 3),
        LogEntry("session", "2024-11-23", {"folder": FOLDER, "started": "2024-11-23", "purpose": "counted"}, 4),
        LogEntry("outcome", "2024-11-23", {"session": "2024-11-23_110000_P02_x_real", "source": "observer:ben"}, 5),
    ]
    checks = [
        {"id": "who", "text": "the wizard has given a name", "value": "anna", "reason": "", "source": "engine"},
        {"id": "clock", "text": "x", "value": "2024-11-23 10:00 UTC", "reason": "", "source": "engine"},
        {"id": "lamp", "text": "The lamp is on", "value": "", "reason": "Zelda forgot it", "source": "wizard:anna"},
    ]
    log[3].fields["checks"] = checks
    log += [LogEntry("checked", "2024-11-23", {**checks[0], "value": "benedikt"}, 7)]
    pilot = LogEntry("session", "2024-11-23", {"folder": "2024-11-23_090000_P01_x_real_pilot", "purpose": "pilot"}, 6)
    told = log_text([*log, pilot], {FOLDER: "P01_x_real_run1"}, {"anna": "W1"}, "shared")
    assert not any(word in told for word in ("s3cret", "2024", "anna", "ben", "Zelda", "forgot", "/home"))
    assert [json.loads(line)["kind"] for line in told.splitlines()] == [
        *("withdrawn", "excluded", "session", "outcome", "checked")
    ]
    assert "[date]" in told and '"value":"W1"' in told and '"value":"W"' in told
    assert '"folder":"P01_x_real_run1"' in told
    assert '"session":"P02_x_real"' in told
    full = log_text(log, {}, {}, "full")
    assert "Zelda" in full
    assert "s3cret" not in full


# --- zip files ------------------------------------------------------------------------------------------------------


def test_the_log_has_nothing_of_exports() -> None:
    who = {"path": "tables", "sessions": [FOLDER], "participants": ["P01"]}
    log = [LogEntry(kind, "2024-11-23T10:00:00", who, 1) for kind in ("exported", "written")]
    assert log_text(log, {}, {}, "shared") == ""


def test_a_zip_file_is_the_same_bundle(study: Path, tmp_path: Path) -> None:
    folders = sessions_of(study)[1:2]
    bundle_of(study, tmp_path / "bundle", folders=folders)
    bundle_of(study, tmp_path / "bundle.zip", folders=folders)
    with opened_bundle(tmp_path / "bundle.zip") as root:
        assert check_bundle(root).whole
        assert all(each.proved for each in prove_sessions(root, None))
        names = {path.relative_to(root) for path in root.rglob("*")}
    assert not root.exists()
    assert names == {path.relative_to(tmp_path / "bundle") for path in (tmp_path / "bundle").rglob("*")}
    with zipfile.ZipFile(tmp_path / "bundle.zip") as archive:
        assert {entry.date_time[0] for entry in archive.infolist()} == {1980}
    assert (tmp_path / "bundle.zip").stat().st_mode & 0o077 == 0


def _zip(path: Path, *entries: tuple[str, int, int]) -> None:
    """Of zeros: names, sizes, modes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, size, mode in entries:
            entry = zipfile.ZipInfo(name)
            entry.external_attr, entry.compress_type = mode << 16, zipfile.ZIP_DEFLATED
            file.writestr(entry, bytes(size))


HARMFUL = {
    "outside": ([("../evil", 1, 0o100644)], "outside of it, or be hidden: `../evil`"),
    "absolute": ([("/evil", 1, 0o100644)], "`/evil`"),
    "through a folder": ([("a/../../evil", 1, 0o100644)], "`a/../../evil`"),
    "of Windows": ([("a\\..\\evil", 1, 0o100644)], "outside of it"),
    "hidden": ([("sessions/.git/config", 1, 0o100644)], "`sessions/.git/config`"),
    "a link": ([("link", 9, 0o120777)], "links, or no files: `link`"),
    "a pipe": ([("pipe", 0, 0o010644)], "links, or no files: `pipe`"),
    "a device": ([("zero", 0, 0o020644)], "links, or no files: `zero`"),
    "a bomb": ([("big", 2_000_000, 0o100644)], "MB and would become 2.0 MB: more than any bundle"),
    "small bombs": ([(f"{number}", 500_000, 0o100644) for number in range(3)], "would become 1.5 MB"),
    "no room": ([("big", 90_000, 0o100644)], "needs 0.1 MB to be unpacked, and the disk has 0.0 MB left"),
    "too many": ([(f"{number}", 0, 0o100644) for number in range(5)], "holds 5 files, and a bundle has at most 4"),
    "all at once": ([("../x", 1, 0o100644), ("link", 1, 0o120777), (".envrc", 1, 0)], "`../x`, `.envrc`"),
}


@pytest.mark.parametrize("case", HARMFUL)
def test_a_zip_file_that_would_do_harm_is_not_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str
) -> None:
    entries, said = HARMFUL[case]
    _zip(tmp_path / "x.zip", *entries)
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    monkeypatch.setattr(bundle_files, "SMALL_BYTES", 100_000)
    monkeypatch.setattr(bundle_files, "MAX_FILES", 4)
    if case == "no room":
        monkeypatch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=1_000))
    with pytest.raises(ExportError) as refused, opened_bundle(tmp_path / "x.zip"):
        pass
    assert said in str(refused.value)
    assert len(str(refused.value).splitlines()) == (2 if case == "all at once" else 1)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["tmp", "x.zip"]


def test_what_a_killed_program_has_unpacked_is_cleared_by_the_next_one(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    bundle_of(study, tmp_path / "bundle.zip", folders=sessions_of(study)[1:2])
    with opened_bundle(tmp_path / "bundle.zip") as root:
        assert root.stat().st_mode & 0o077 == 0
        shutil.copytree(root, killed := temporary / f"{root.name}-killed")  # nobody has it locked
        with opened_bundle(tmp_path / "bundle.zip") as other:
            assert not killed.exists()
            assert check_bundle(root).whole and check_bundle(other).whole, "both are in use"
    assert list(temporary.iterdir()) == []


def test_what_is_no_bundle(tmp_path: Path) -> None:
    (tmp_path / "x.zip").write_bytes(b"no zip")
    with pytest.raises(ExportError, match="not a zip file"), opened_bundle(tmp_path / "x.zip"):
        pass
    with pytest.raises(ExportError, match="there is no"), opened_bundle(tmp_path / "gone"):
        pass
    with pytest.raises(ExportError, match="no ro-crate-metadata"):
        check_bundle(tmp_path)
    (tmp_path / "report.html").symlink_to("/etc/passwd")
    with pytest.raises(ExportError, match=r"these in it are links: `report\.html`"), opened_bundle(tmp_path):
        pass


# --- a command line, and a scenario that words decide ---------------------------------------------------------------


def test_bundle_and_reproduce_on_the_command_line(study: Path, tmp_path: Path) -> None:
    out = tmp_path / "bundle.zip"
    status, said, errors = run("study", "bundle", study, "-o", out)
    assert (status, errors) == (0, "")
    assert "look at this before anybody else gets it:" in said
    assert "1 pilot" in said
    status, said, errors = run("reproduce", out)
    assert (status, errors) == (0, "")
    assert "7 of 7 sessions identical" in said
    assert run("study", "bundle", tmp_path, "-o", tmp_path / "x")[0] == 2
    status, _, errors = run("study", "bundle", study, "-o", out)
    assert (status, "is there already" in errors) == (1, True)


def test_words_that_decide_leave_the_session_out(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    scenario = write_scenario(tmp_path / "steered")
    rule = """<InteractionRule name="Named" initial="Start">
      <State id="Start"><transition cond="person_name == 'Zelda'" target="Known"/></State><State id="Known"/>
    </InteractionRule>"""
    (scenario / "rules" / "named.xml").write_text(rule, "utf-8")
    script = [(1.0, task("startInteractionRule", "Named")), (2.0, task("assignValue", 'person_name = "Zelda"'))]
    steered = play_session(tmp_path / "sessions", script, scenario=scenario, until=9.0)
    report = bundle_of(study, tmp_path / "bundle", folders=[sessions_of(study)[1], steered])
    assert report.sessions == 1
    assert any("decided what happened" in each for each in report.omitted)
    assert "zelda" not in texts_in(tmp_path / "bundle" / "sessions")

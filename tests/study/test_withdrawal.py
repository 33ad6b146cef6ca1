"""`rise-engine study withdraw`: whoever withdraws is nowhere any more, and their slot is free."""

from __future__ import annotations

import os
import shutil
from datetime import date, timedelta
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from rise_engine.base.errors import StudyError
from rise_engine.base.files import fingerprint, tree_hash
from rise_engine.base.words import Words, parse_replacement
from rise_engine.cli.data.redact import redact_in_study
from rise_engine.kernel.inputs import OutcomeReport, RecordingReport, SessionStarted
from rise_engine.privacy.redaction import RedactionReport
from rise_engine.results.export.format import ExportError
from rise_engine.results.export.writing import new_export
from rise_engine.session.lock import JournalLock
from rise_engine.session.media import MEDIA_FILE, MediaFile, register_media
from rise_engine.session.unfinished_files import private_folder
from rise_engine.study.proof import prove_sessions
from rise_engine.study.review import review_study
from rise_engine.study.state import OpenStudy, due_retention, read_state
from rise_engine.study.study_log import LOG_FILE, SET_ASIDE_FILE, LockedLog, LogEntry, StudyLogError, read_log
from rise_engine.study.traces import WORK_FOLDER, find_names, is_withdrawn, owner_of, without_salts
from rise_engine.study.withdrawal import plan_withdrawal, withdraw
from rise_engine.study.withdrawal_work import Erasing, WithdrawalPlan
from tests.commands import typed
from tests.forked import Forked
from tests.kills import every_kill
from tests.results.analysis.samples import make_study

from .studies import DESIGN, ENDED, session_folder, write_journal, write_study

ID = "hesitation"


def began(participant: str, slot: int, run: int = 1) -> SessionStarted:
    return SessionStarted(
        participant=participant, study=ID, slot=slot, run=run, attempt=1, purpose="counted", condition="yes+quiet"
    )


def session(study: Path, participant: str, slot: int, recording: str = "", run: int = 1) -> Path:
    path = session_folder(study, began(participant, slot, run))
    report = RecordingReport(t=1.0, name="camera", status="stopped", path=recording)
    if recording:
        register_media(path, MediaFile(path=recording, kind="video", fingerprint=fingerprint(Path(recording))))
    inputs = [
        began(participant, slot, run),
        report,
        OutcomeReport(t=50.0, status="complete", reason="", source="wizard:w"),
    ]
    write_journal(path, *inputs, ENDED)
    (path / "scenario").mkdir()
    (path / "scenario" / "note.txt").write_text(f"about {participant}")
    return path


class Folder:
    """A study of three participants, P01 in two sessions, everything that could name them."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.study = root / "study"
        self.videos = root / "videos"
        self.videos.mkdir()
        write_study(self.study)
        for name in ("one", "two", "both"):
            (self.videos / name).write_bytes(b"film" * 100)
        bag = self.videos / "bag"
        bag.mkdir()
        (bag / "metadata.yaml").write_text("bag")
        (bag / "0.mcap").write_bytes(b"mcap")
        self.sessions = [
            session(self.study, "P01", 1, str(self.videos / "one")),
            session(self.study, "P01", 1, str(bag), 2),
            session(self.study, "P02", 2, str(self.videos / "two")),
            session(self.study, "P03", 3, str(self.videos / "both")),
            session(self.study, "P01", 1, str(self.videos / "both"), 3),
        ]
        with OpenStudy(self.study):
            pass  # what the folders say is in the log now
        with LockedLog(self.study) as log:
            log.append("excluded", participant="P03", reason="took the place of P01, not of P011")
            log.append("checked", participant="P02", checks=[{"id": "lamp", "reason": "as with P01"}])
            for name, who in (("p01.csv", ["P01"]), ("all.csv", ["P01", "P02"]), ("p02.csv", ["P02"])):
                (self.study / name).write_text(f"rows of {who}" if name != "p02.csv" else "rows")
                log.append("exported", path=name, participants=who, sessions=[], level="full")
                log.append("written", path=name, participants=who, sessions=[], sha256=tree_hash(self.study / name))
            (self.study / "in.csv").write_text("P01,1")
            log.append("exported", path="in.csv", participants=["P01"], sessions=[self.sessions[0].name])
            log.append("written", path="in.csv", participants=["P01"], sha256=tree_hash(self.study / "in.csv"))
        (self.study / SET_ASIDE_FILE).write_text('{"kind":"taken","participant":"P01"')

    def texts(self) -> dict[str, str]:
        return {
            str(path.relative_to(self.study)): path.read_text("utf-8", "replace")
            for path in sorted(self.study.rglob("*"))
            if path.is_file()
        }


@pytest.fixture
def made(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


def assert_gone(made: Folder) -> None:
    """Nothing names them any more but participants.csv, which is people's."""
    for name, text in made.texts().items():
        if name != "participants.csv":
            assert "P01" not in text.replace("P011", "") and "P01" not in name, name
    assert not list(made.study.rglob("*P01*"))
    assert not (made.study / WORK_FOLDER).exists()
    for gone in ("videos/one", "videos/bag", "study/p01.csv", "study/all.csv"):
        assert not (made.root / gone).exists(), gone
    for stays in ("videos/two", "videos/both", "study/p02.csv"):
        assert (made.root / stays).exists(), stays
    log = read_log(made.study)
    assert is_withdrawn("P01", log) and not is_withdrawn("P02", log)
    assert [each.get("slot") for each in log if each.kind == "withdrawn"] == [1]
    taken = [each for each in log if each.kind == "taken" and each.get("slot") == 1]
    assert len(taken) == 1 and is_withdrawn(taken[0].get("participant"), log)


def test_nothing_is_left_but_a_salted_hash(made: Folder) -> None:
    report = withdraw(made.study, "P01")
    assert_gone(made)
    assert len(report.erased) == 3 + 2 + 3
    assert report.make_again == [f"{made.study / 'all.csv'} (with P02)"]
    assert report.remains == [
        "participants.csv, line 2: delete the line yourself, because nothing but people writes in this file"
    ]
    assert report.unreached == [f"{made.videos / 'both'} records P03, too: cut them out of it"]
    assert any("backups" in each for each in report.beyond)
    assert (made.study / LOG_FILE).stat().st_mode & 0o777 == 0o600


def test_the_moment_at_which_they_came_is_not_kept(made: Folder) -> None:
    """Of the line that their slot was taken, the day stays; the lines of others have their moments."""
    moments = {each.at for each in read_log(made.study) if each.get("participant") == "P01"}
    others = [each.at for each in read_log(made.study) if each.kind == "taken" and each.get("participant") != "P01"]
    withdraw(made.study, "P01")
    log = read_log(made.study)
    (taken,) = (each for each in log if each.kind == "taken" and str(each.get("participant")).startswith("withdrawn:"))
    assert taken.at in {moment[:10] for moment in moments} and len(taken.at) == 10
    assert others == [each.at for each in log if each.kind == "taken" and each is not taken]
    assert read_state(made.study).standing.participants


def test_the_others_are_as_they_were(made: Folder) -> None:
    before = [each for each in read_log(made.study) if each.get("participant") in ("P02", "P03")]
    withdraw(made.study, "P01")
    log = read_log(made.study)
    after = [each for each in log if each.get("participant") in ("P02", "P03")]
    assert [(each.kind, each.at) for each in after] == [(each.kind, each.at) for each in before]
    reason = next(str(each.get("reason")) for each in after if each.kind == "excluded")
    assert reason.startswith("took the place of withdrawn:") and reason.endswith("not of P011")
    assert [path.is_dir() for path in made.sessions] == [False, False, True, True, False]


def test_the_slot_is_free_and_they_cannot_begin_again(made: Folder) -> None:
    withdraw(made.study, "P01")
    state = read_state(made.study)
    standing = {each.participant: each for each in state.standing.participants}
    assert standing["P01"].state == "withdrawn" and standing["P01"].slot is None
    assert not any("withdrawn" in each for each in state.standing.due), state.standing.due
    assert state.places.free_row(state.plan, {}) == next(row for row in state.plan if row.slot == 1)
    with OpenStudy(made.study):
        pass  # reconciling writes nothing about them
    assert_gone(made)


def test_a_second_time_there_is_nothing_to_do(made: Folder) -> None:
    withdraw(made.study, "P01")
    before = (made.study / LOG_FILE).read_bytes()
    report = withdraw(made.study, "P01")
    assert report.erased == [] and (made.study / LOG_FILE).read_bytes() == before


@pytest.mark.parametrize("as_link", [False, True])
def test_a_session_that_comes_back_is_told_and_counts_nowhere(made: Folder, tmp_path: Path, as_link: bool) -> None:
    theirs = made.sessions[0]
    shutil.copytree(theirs, tmp_path / "backup")
    withdraw(made.study, "P01")
    if as_link:
        theirs.symlink_to(tmp_path / "backup")
    else:
        shutil.copytree(tmp_path / "backup", theirs)
    told = "it is of a participant who has withdrawn, and is there again: "
    told += f"erase their data in {tmp_path / 'backup'}, and this link" if as_link else "`rise-engine study withdraw"
    state = read_state(made.study)
    assert any(each.startswith(f"{theirs.name}: {told}") for each in state.standing.due)
    assert theirs.name not in {each.name for each in state.sessions}
    (found,) = (each for each in review_study(made.study).diagnostics if each.code == "returned-session")
    assert (found.severity, found.location.file) == ("error", f"sessions/{theirs.name}")
    assert found.message.startswith(told)
    proofs = {each.name: each for each in prove_sessions(made.study, state)}
    assert proofs[theirs.name].problems[0].startswith(told)
    with OpenStudy(made.study):
        assert "P01" not in (made.study / LOG_FILE).read_text("utf-8").replace("P011", "")
    report = withdraw(made.study, "P01")
    assert [each for each in report.unreached if f"{theirs} is a link to" in each] != [] or not as_link
    assert theirs.exists() == as_link
    assert (f"the name of sessions/{theirs.name}: erase it, or give it another name" in report.remains) == as_link


def test_a_session_of_another_study_is_not_erased(made: Folder, tmp_path: Path) -> None:
    path = session_folder(made.study, replace(began("P01", 1), study="other"))
    write_journal(path, replace(began("P01", 1), study="other"), ENDED)
    (unreached,) = (each for each in withdraw(made.study, "P01").unreached if path.name in each)
    assert unreached.startswith(f"session {path.name} is of the study other, where this pseudonym may be somebody else")
    assert path.is_dir()
    assert not read_state(made.study).returned


def test_somebody_without_a_session(made: Folder) -> None:
    withdraw(made.study, "P05")
    log = read_log(made.study)
    assert is_withdrawn("P05", log) and [each.get("slot") for each in log if each.kind == "withdrawn"] == [None]


def test_somebody_unknown_is_refused(made: Folder) -> None:
    before = made.texts()
    with pytest.raises(StudyError, match="knows no participant 'P99'"):
        withdraw(made.study, "P99")
    assert made.texts() == before


def test_while_a_session_runs_nothing_is_done(made: Folder) -> None:
    before = made.texts()
    lock = JournalLock(made.sessions[1] / "journal.jsonl")
    with pytest.raises(StudyError, match=r"is running: .* Nothing was erased"):
        withdraw(made.study, "P01")
    lock.release()
    assert made.texts() == before


def test_sessions_that_cannot_be_read_are_theirs_by_their_name(made: Folder) -> None:
    broken = made.study / "sessions" / "2026-11-22_101112_P01_sample_real"
    broken.mkdir()
    (broken / "journal.jsonl").write_text("garbage about P01")
    withdraw(made.study, "P01")
    assert_gone(made)


def test_a_damaged_log_is_no_reason_to_guess(made: Folder) -> None:
    with (made.study / LOG_FILE).open("a") as file:
        file.write("no entry\n")
    with pytest.raises(StudyLogError, match="not JSON"):
        withdraw(made.study, "P01")
    assert made.sessions[0].exists()


def test_what_others_wrote_about_them_is_told(made: Folder) -> None:
    (made.study / "diary.md").write_text("fine\nP01 was late\n")
    (made.sessions[2] / "scenario" / "note.txt").write_text("like P01")
    report = withdraw(made.study, "P01")
    assert any(each.startswith("diary.md, line 2: take it out yourself") for each in report.remains)
    assert any("rise-engine redact" in each and made.sessions[2].name in each for each in report.remains)


def test_a_pseudonym_of_digits_changes_no_text_of_others(tmp_path: Path) -> None:
    study = tmp_path / "study"
    write_study(study, people="participant,consent_study,status,comment\n22,2026-11-01,,\nP02,2026-11-01,,\n")
    session(study, "22", 1)
    session(study, "P02", 2)
    with OpenStudy(study):
        pass
    before = [each for each in read_log(study) if each.get("participant") == "P02"]
    withdraw(study, "22")
    log = read_log(study)
    assert [each.fields for each in log if each.get("participant") == "P02"] == [each.fields for each in before]
    assert is_withdrawn("22", log) and withdraw(study, "22").erased == []


def test_salts_can_be_left_out(made: Folder) -> None:
    withdraw(made.study, "P01")
    entry = next(each for each in without_salts(read_log(made.study)) if each.kind == "withdrawn")
    assert set(entry.fields) == {"slot", "hash"}


@pytest.mark.slow
def test_killed_at_any_touch_of_the_disk(tmp_path: Path) -> None:
    """No slot is given twice meanwhile, and the next time everything is gone."""
    kept, place = tmp_path / "kept", tmp_path / "place"
    place.mkdir()
    made = Folder(place)
    shutil.copytree(place, kept)

    def again() -> None:
        shutil.rmtree(place)
        shutil.copytree(kept, place)

    touches = []
    for touch in every_kill(place, again, lambda disk: withdraw(made.study, "P01", disk)):
        touches.append(touch)
        with OpenStudy(made.study) as open:  # another program looks, and writes what it finds missing
            held = open.state.places.slots
            assert held.get("P02") == 2 and held.get("P01") in (1, None)
        withdraw(made.study, "P01")
        assert_gone(made)
    assert touches[-1] > 60


@pytest.fixture
def interrupted(made: Folder, monkeypatch: pytest.MonkeyPatch) -> Folder:
    """The log is rewritten, and nothing is erased yet."""

    def stop(erasing: Erasing) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Erasing, "run", stop)
        withdraw(made.study, "P01")
    return made


INTERRUPTED = "a withdrawal was interrupted: their data are still in .withdrawing/1; `rise-engine study withdraw STUDY"


def test_whoever_reads_the_study_says_that_a_withdrawal_was_interrupted(interrupted: Folder, tmp_path: Path) -> None:
    study = interrupted.study
    status = typed("study", "status", study)
    assert status.exit_code == 1 and INTERRUPTED in status.output.partition("to do")[2]
    assert f"warning: {INTERRUPTED}" in typed("study", "next", study).output
    check = typed("study", "check", study)
    assert check.exit_code == 1 and f"error interrupted-withdrawal: {INTERRUPTED}" in check.output
    bundle = typed("study", "bundle", study, "-o", tmp_path / "bundle")
    assert bundle.exit_code == 1 and INTERRUPTED in bundle.output
    with OpenStudy(study) as open:
        assert open.state.standing.due[0].startswith(INTERRUPTED)
    report = typed("report", study)
    assert report.exit_code == 1 and "!! a withdrawal was interrupted" in report.output
    export = typed("export", study, "--format", "tables", "-o", tmp_path / "tables")
    assert export.exit_code == 2 and INTERRUPTED in export.output and not (tmp_path / "tables").exists()
    theirs = study / ".withdrawing" / "1" / interrupted.sessions[0].name
    export = typed("export", theirs, "--format", "csv")
    assert export.exit_code == 2 and "its participant withdraws" in export.output


def test_a_withdrawal_says_that_another_one_was_interrupted(interrupted: Folder) -> None:
    assert any(each.startswith(INTERRUPTED) for each in withdraw(interrupted.study, "P02").unreached)
    report = withdraw(interrupted.study, "P01")
    assert not any(INTERRUPTED in each for each in report.unreached)
    assert typed("study", "status", interrupted.study).exit_code == 0
    assert "interrupted" not in typed("study", "check", interrupted.study).output


def test_a_withdrawal_that_goes_on_erases_no_other_file_in_the_place_of_a_recording(interrupted: Folder) -> None:
    film, bag = interrupted.videos / "one", interrupted.videos / "bag"
    film.write_bytes(b"mlif" * 100)  # another film of the same size
    report = withdraw(interrupted.study, "P01")
    assert film.exists() and not bag.exists()
    assert any(f"{film} was changed since it was written" in each for each in report.unreached)


@pytest.mark.parametrize("done", [False, True])
def test_what_a_killed_export_left_outside_the_study_is_named(made: Folder, tmp_path: Path, done: bool) -> None:
    out, gone = tmp_path / "out.zip", tmp_path / "gone.csv"
    left = tmp_path / ".out.zip.unfinished-a1b2c3d4"
    left.mkdir()
    (left / "rows.csv").write_text("P01")
    out.write_text("P01") if done else None
    with LockedLog(made.study) as log:
        for path in (out, gone):
            log.append("exported", path=str(path), participants=["P01"], sessions=[], level="full")
    unreached = withdraw(made.study, "P01").unreached
    where = (
        f"{out} and {left} was exported with their data" if done else f"{left} was exported with their data to {out}"
    )
    assert f"{where}, and is outside the study's folder: erase it yourself" in unreached
    assert f"{gone} was exported with their data, and is not there any more: erase it where it is now" in unreached


# --- the command ---


def test_the_next_who_withdraws_is_told_of_the_exports_that_are_still_somewhere(made: Folder, tmp_path: Path) -> None:
    (tmp_path / "tables").write_text("rows of P01 and P02")
    who = {"participants": ["P01", "P02"], "sessions": [each.name for each in made.sessions[:3]]}
    with LockedLog(made.study) as log:
        log.append("exported", path=str(tmp_path / "tables"), **who)
        for name in ("changed", "moved"):
            (made.study / name).write_text("rows")
            log.append("exported", path=name, **who)
            log.append("written", path=name, sha256=tree_hash(made.study / name), **who)
    (made.study / "changed").write_text("other rows")
    (made.study / "moved").rename(tmp_path / "moved")
    outside = (
        f"{tmp_path / 'tables'} was exported with their data, and is outside the study's folder: erase it yourself"
    )
    changed = f"{made.study / 'changed'} was changed since it was written: erase their data in it"
    moved = f"{made.study / 'moved'} was exported with their data and is not there: erase it where it is now"
    assert set(withdraw(made.study, "P01").unreached) >= {outside, changed, moved}
    assert_gone(made)
    kept = [each for each in read_log(made.study) if each.kind in ("exported", "written")]
    assert {str(each.get("path")) for each in kept} == {str(tmp_path / "tables"), "changed", "moved", "p02.csv"}
    assert {name for each in kept for name in each.get("sessions")} == {made.sessions[2].name}
    again = withdraw(made.study, "P01")
    assert set(again.unreached) == {outside, changed} and not again.erased, "moved ones were told once"
    redacted = redact_in_study(made.sessions[2], RedactionReport(lines=1), Words([parse_replacement("xx=yy")]))
    assert len(redacted) == 2
    assert set(withdraw(made.study, "P02").unreached) >= {outside, changed, moved}
    (tmp_path / "tables").unlink()
    (made.study / "changed").unlink()
    assert withdraw(made.study, "P02").unreached == withdraw(made.study, "P01").unreached == []


def test_the_command(made: Folder) -> None:
    result = typed("study", "withdraw", made.study, "P01")
    assert result.exit_code == 2 and "without a terminal, use --yes" in result.output
    assert made.sessions[0].exists()
    result = typed("study", "withdraw", made.study, "P01", "--yes")
    assert result.exit_code == 1, result.output
    assert "all.csv, which also holds P02" in result.output
    assert "erased; their slot is free" in result.output
    assert "delete the line yourself" in result.output and "backups" in result.output
    people = made.study / "participants.csv"
    people.write_text("".join(line for line in people.read_text().splitlines(True) if "P01" not in line))
    assert typed("study", "withdraw", made.study, "P01", "--yes").exit_code == 0
    assert typed("study", "withdraw", made.study, "P99", "--yes").exit_code == 1
    assert typed("study", "withdraw", made.root, "P01", "--yes").exit_code == 2


def test_a_slot_that_another_has_got_is_not_said_to_be_free(made: Folder) -> None:
    with LockedLog(made.study) as log:
        log.append("excluded", participant="P01", reason="left")
        log.append("taken", participant="P04", slot=1)
    output = typed("study", "withdraw", made.study, "P01", "--yes").output
    assert "erased; slot 1, which they had, stays with P04" in output


@pytest.mark.pty
@pytest.mark.slow
@pytest.mark.parametrize(("typed", "code"), [("P01", 1), ("P02", 1), ("", 1)])
def test_somebody_types_the_pseudonym(made: Folder, typed: str, code: int) -> None:
    ours, theirs = os.openpty()
    process = Forked("study", "withdraw", made.study, "P01", stdin=theirs)
    os.close(theirs)
    os.write(ours, f"{typed}\n".encode())
    out, err = process.communicate(timeout=60)
    os.close(ours)
    assert process.returncode == code, (out, err)
    assert "type the pseudonym" in out
    if typed == "P01":
        assert_gone(made)
    else:
        assert "that is another pseudonym; nothing was erased" in err and made.sessions[0].exists()


def test_in_a_copy_of_a_study_the_original_keeps_its_exports(made: Folder, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for name in ("one.csv", "two.csv", "three.csv", "four.csv"):
        (elsewhere / name).write_text("P01")
    (made.study / "linked").symlink_to(elsewhere)
    outside = [str(elsewhere / "one.csv"), "../elsewhere/two.csv", "linked/three.csv", str(made.study / "p01.csv")]
    with LockedLog(made.study) as log:
        for path in outside:
            log.append("exported", path=path, participants=["P01"], sessions=[])
        for path in (".", "..", str(tmp_path), "in.csv/.."):
            log.append("exported", path=path, participants=["P01"], sessions=[], folder=True)
    copy = tmp_path / "copy"
    shutil.copytree(made.study, copy, symlinks=True)
    listed = WithdrawalPlan("P01", exports={str(elsewhere / "four.csv"): []}, export_folders=[str(elsewhere)])
    (copy / WORK_FOLDER / "1").mkdir(parents=True)  # an interrupted run came along with the copy
    (copy / WORK_FOLDER / "1" / "list.json").write_bytes(msgspec.json.encode(listed))
    before = made.texts()

    report = withdraw(copy, "P01")

    assert made.texts() == before
    assert sorted(path.name for path in elsewhere.iterdir()) == ["four.csv", "one.csv", "three.csv", "two.csv"]
    assert not any((copy / name).exists() for name in ("p01.csv", "all.csv", "in.csv"))
    told = [sentence for sentence in report.unreached if "outside the study's folder: erase it yourself" in sentence]
    assert len(told) == 4 + 4 + 1
    assert not (copy / WORK_FOLDER).exists()


def test_a_line_that_calls_a_session_of_theirs_somebody_elses_export_goes_with_it(made: Folder) -> None:
    with LockedLog(made.study) as log:
        for path in (f"sessions/{made.sessions[0].name}", f"scenario/../sessions/{made.sessions[1].name}"):
            log.append("exported", path=path, participants=["P02"], sessions=[], folder=True)
            log.append("written", path=path, participants=["P02"], sha256="0")
    withdraw(made.study, "P01")
    assert not any(each.name in (made.study / LOG_FILE).read_text() for each in made.sessions[:2])
    assert [each.get("path") for each in read_log(made.study) if each.kind == "exported"] == ["p02.csv"]


def test_an_export_is_listed_before_it_is_written(made: Folder) -> None:
    out = made.root / "again.csv"
    result = typed("export", made.sessions[2], "--format", "csv", "-o", out)
    assert out.exists(), result.output
    entry = [each for each in read_log(made.study) if each.kind == "exported"][-1]
    assert entry.fields == {
        "path": str(out),
        "format": "csv",
        "level": "full",
        "sessions": [made.sessions[2].name],
        "participants": ["P02"],
    }
    plan = plan_withdrawal(made.study, "P02")
    assert list(plan.exports) == ["all.csv", "p02.csv"]
    assert [each for each in plan.unreachable if str(out) in each] == [
        f"{out} was exported with their data, and is outside the study's folder: erase it yourself"
    ]
    result = typed("export", made.sessions[2], "--format", "csv", "-o", out)
    assert result.exit_code == 2
    assert len([each for each in read_log(made.study) if each.kind == "exported"]) == 5


@pytest.mark.parametrize("form", ["bids", "tables"])
def test_an_export_of_any_form_and_of_everything_is_erased(tmp_path: Path, form: str) -> None:
    """A BIDS export of all that there is has copies of the scenario, which are a part of it."""
    study = make_study(tmp_path / "study")
    out = study / "export"
    result = typed("export", study, "--format", form, "--level", "full", "-o", out)
    assert result.exit_code == 0, result.output
    assert form != "bids" or any(out.rglob("scenario.toml"))
    report = withdraw(study, "P01")
    assert not out.exists() and not [each for each in report.unreached if str(out) in each]


def test_what_is_exported_just_now_is_told_and_the_rest_is_erased(made: Folder) -> None:
    with private_folder(made.study / "p01.csv") as being_written:
        (being_written / "p01.csv").write_text("rows of P01")
        report = withdraw(made.study, "P01")
        assert being_written.exists() and (being_written / "p01.csv").exists()
    told = [sentence for sentence in report.unreached if "is being written just now" in sentence]
    assert len(told) == 1 and str(being_written) in told[0]
    assert_gone(made)


def test_an_export_that_is_overtaken_by_a_withdrawal_is_not_kept(made: Folder) -> None:
    out = made.study / "late.csv"
    with pytest.raises(ExportError, match="make it again"), new_export(out, made.sessions[:1], "csv", "full") as export:
        export.here.write_text("rows of P01")
        withdraw(made.study, "P01")
    assert not out.exists()
    assert_gone(made)


def test_an_export_of_what_was_read_before_a_withdrawal_is_refused(made: Folder) -> None:
    withdraw(made.study, "P01")
    with (
        pytest.raises(ExportError, match="make it again"),
        new_export(made.study / "late.html", made.sessions[:1], "report", "full"),
    ):
        raise AssertionError
    assert_gone(made)


def test_redacting_a_session_takes_the_words_out_of_the_studys_log(made: Folder) -> None:
    path = made.sessions[2]
    with LockedLog(made.study) as log:
        log.append("outcome", session=path.name, status="complete", reason="Zelda was tired")
        log.append("checked", session=path.name, checks=[{"id": "lamp", "reason": "Zelda saw it", "result": "skipped"}])
        log.append("excluded", participant=owner_of(path), slot=None, reason="Zelda is under age")
        log.append("excluded", participant="P99", slot=None, reason="as Zelda before")
    words = Words([parse_replacement("Zelda=NAME1")])

    people = made.study / "participants.csv"
    people.write_text(people.read_text("utf-8").replace("P02,2026-11-03,,", "P02,2026-11-03,,zelda came late"), "utf-8")

    report = RedactionReport(lines=3)
    exports = redact_in_study(path, report, words)

    assert report.log_lines == 3 and exports == []
    entries = read_log(made.study)
    assert entries[-1].fields == {"session": path.name, "lines": 3} and entries[-1].kind == "redacted"
    text = (made.study / LOG_FILE).read_text()
    assert text.count("NAME1") == 3 and text.count("Zelda") == 1
    assert report.remains == [
        "participants.csv, line 3: take them out yourself",
        f"{LOG_FILE}, line {len(entries) - 1}: about another session, or a path or a name that stays",
    ]


def test_redacting_a_session_takes_the_wizards_name_out_of_the_studys_log(made: Folder) -> None:
    path = made.sessions[2]
    kept = {"wizard:NAME1", "engine", "command-line"}
    design = made.study / "study.toml"
    design.write_text(design.read_text("utf-8") + '\n[wizards]\nzelda = "W1"\n', "utf-8")
    with LockedLog(made.study) as log:
        for source in ("wizard:zelda", "engine", "command-line"):
            log.append("outcome", session=path.name, status="complete", reason="", source=source)
        log.append("checked", session=path.name, checks=[{"id": "lamp", "result": "passed", "source": "wizard:Zelda"}])
        log.append("outcome", session=made.sessions[3].name, status="complete", reason="", source="wizard:Zelda")
        log.append("exported", path="/home/zelda/tables", participants=["P02"], sessions=[path.name])
    report = RedactionReport(lines=3)
    redact_in_study(path, report, Words([parse_replacement("Zelda=NAME1")]))
    entries = read_log(made.study)
    assert report.log_lines == 2
    assert kept <= {each.get("source") for each in entries if each.get("session") == path.name}
    assert [each["source"] for entry in entries for each in entry.get("checks") or () if "source" in each] == [
        "wizard:NAME1"
    ]
    line = len(design.read_text("utf-8").splitlines())
    assert report.remains == [
        f"study.toml, line {line}: take them out yourself",
        f"{LOG_FILE}, lines {len(entries) - 2}, {len(entries) - 1}: about another session, or a path or a name that "
        "stays",
    ]
    judged = LogEntry("outcome", "", {"source": "wizard:anna"}, 1)
    assert judged.with_written(str.upper, sources=True).get("source") == "wizard:ANNA", "not what the program wrote"


# --- what media.json names ---


def test_what_was_added_later_is_erased_too(made: Folder, tmp_path: Path) -> None:
    own, shared, others = (tmp_path / name for name in ("own.mp4", "day.mp4", "p02.mp4"))
    for path in (own, shared, others):
        path.write_bytes(b"film" * 100)
    first, _, second, *_ = made.sessions
    inside = second / "room.wav"
    inside.write_bytes(b"sound")
    register_media(first, MediaFile(path=str(own), kind="video", fingerprint=fingerprint(own)))
    register_media(second, MediaFile(path=str(others), kind="video"))
    for session_of in (first, second):
        register_media(session_of, MediaFile(path=str(shared), kind="video"))
    for session_of in (first, second):
        register_media(session_of, MediaFile(path=str(inside), kind="audio"))
    plan = plan_withdrawal(made.study, "P01")
    assert str(own) in plan.recordings and not {str(shared), str(others), str(inside)} & {*plan.recordings}
    assert {f"{path} records P02, too: cut them out of it" for path in (shared, inside)} <= {*plan.unreachable}
    withdraw(made.study, "P01")
    assert not own.exists() and shared.exists() and others.exists() and inside.exists()


def test_a_list_that_cannot_be_read_is_told(made: Folder) -> None:
    (made.sessions[0] / MEDIA_FILE).write_text("[{")
    plan = plan_withdrawal(made.study, "P01")
    named = f"the recordings that media.json of {made.sessions[0].name} named: "
    assert any(each.startswith(named) and "has an error" in each for each in plan.unreachable)


def test_their_name_in_somebody_elses_list_is_found(made: Folder) -> None:
    register_media(made.sessions[2], MediaFile(path="/data/P01-and-P02.mp4", kind="video"))
    said = [each for each in find_names(made.study, "P01") if MEDIA_FILE in each]
    name = made.sessions[2].name
    lines = (made.sessions[2] / MEDIA_FILE).read_text().splitlines()
    (line,) = (number for number, each in enumerate(lines, 1) if "P01" in each)
    assert said == [
        f"sessions/{name}/media.json, line {line}: give that file a name without it, then rise-engine media remove "
        f"{name} and media add"
    ]


def test_recordings_are_due_wherever_they_lie(made: Folder, tmp_path: Path) -> None:
    inside = made.sessions[2] / "room.wav"
    inside.write_bytes(b"sound")
    register_media(made.sessions[2], MediaFile(path=str(inside), kind="audio"))
    found = due(made, 31, media=30)
    assert found[0].startswith("5 recordings kept longer than 30 days")


# --- retention ---


def due(made: Folder, days: int, **retention: float) -> list[str]:
    lines = "".join(f'{name} = "{value} d"\n' for name, value in retention.items())
    (made.study / "study.toml").write_text(DESIGN + f"\n[retention]\n{lines}", "utf-8")
    state = read_state(made.study)
    began = date.fromisoformat(state.sessions[0].entry.started[:10])
    return due_retention(state.study, state.sessions, began + timedelta(days=days))


def test_what_is_due_to_be_deleted(made: Folder) -> None:
    assert due(made, 1000) == []
    assert due(made, 29, media=30, sessions=30) == []
    found = due(made, 31, media=30, sessions=3650)
    assert len(found) == 1 and found[0].startswith("4 recordings kept longer than 30 days, delete: ")
    assert str(made.videos / "one") in found[0] and found[0].endswith("and 1 more")
    found = due(made, 3651, media=30, sessions=3650)
    assert len(found) == 2 and found[1].startswith("5 sessions kept longer than 3650 days")
    withdraw(made.study, "P01")
    assert due(made, 31, media=30)[0].startswith("2 recordings")


def test_the_status_says_what_is_due(made: Folder) -> None:
    info = made.sessions[2] / "session.toml"
    lines = [
        'started = "2001-01-01T10:00:00+00:00"' if "started" in line else line for line in info.read_text().split("\n")
    ]
    info.write_text("\n".join(lines))
    (made.study / "study.toml").write_text(DESIGN + '\n[retention]\nmedia = "10 y"\n', "utf-8")
    assert any(f"{made.videos / 'two'} of 2001-01-01" in each for each in read_state(made.study).standing.due)

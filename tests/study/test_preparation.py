"""What is written when a session of a study begins, in which order, and what a kill in between leaves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rise_engine.kernel.inputs import CheckReport
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server import preparation
from rise_engine.run.server.preparation import ServeRefused, SessionPreparation
from rise_engine.session.folder import read_info
from rise_engine.session.journal import Journal
from rise_engine.session.journal_format import encode_header, encode_input
from rise_engine.study.state import read_state
from rise_engine.study.study_log import LockedLog

from .invariants import check_day, log_lines
from .studies import DESIGN, write_study

LAMP = '\n[[check]]\nid = "lamp"\nask = "The lamp is on"\n'
LIT = CheckReport(id="lamp", text="The lamp is on", result="passed", source="wizard:anna")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RISE_SESSIONS", str(tmp_path / "others"))
    write_study(tmp_path / "study", DESIGN + LAMP)
    return tmp_path / "study"


def options(folder: Path, participant: str = "P01", **more: Any) -> SessionOptions:
    return SessionOptions("", study=str(folder), participant=participant, **{"checks": (LIT,), **more})


def begin(folder: Path, **more: Any) -> Path:
    """A session in which nothing happens but its start, and whose engine goes away; its folder."""
    prepared = SessionPreparation(options(folder, **more), lambda message: None)
    journal = prepared.open_journal(lambda: None, lambda: 0.0)
    journal.append(encode_header("rise-tui test") + encode_input(1, prepared.started))
    assert journal.close()
    prepared.close()
    return prepared.folder


def test_the_row_is_taken_before_there_is_a_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Gone(BaseException):
        pass

    def fail(*arguments: Any, **named: Any) -> Path:
        assert [line["kind"] for line in log_lines(folder)] == ["planned", "taken"]
        raise Gone

    prepared = SessionPreparation(options(folder), lambda message: None)
    with monkeypatch.context() as patch, pytest.raises(Gone):
        patch.setattr(preparation, "create_session", fail)
        prepared.open_journal(lambda: None, lambda: 0.0)
    prepared.close()
    standing = read_state(folder).standing.participants[0]
    assert (standing.state, standing.slot, standing.next_attempt) == ("waiting", 1, 1)
    assert read_info(begin(folder)).slot == 1
    assert [line["kind"] for line in log_lines(folder)] == ["planned", "taken", "session"]


def test_a_journal_that_cannot_be_made_leaves_no_session(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: Any, **named: Any) -> Journal:
        raise OSError(28, "No space left on device")

    prepared = SessionPreparation(options(folder), lambda message: None)
    with monkeypatch.context() as patch, pytest.raises(ServeRefused, match="No space left"):
        patch.setattr(preparation, "Journal", fail)
        prepared.open_journal(lambda: None, lambda: 0.0)
    prepared.close()
    assert read_state(folder).sessions == ()
    path = begin(folder)
    assert (read_info(path).attempt, len(list((folder / "sessions").iterdir()))) == (1, 2)
    check_day(folder)


def test_a_study_that_changes_while_a_session_is_prepared(folder: Path) -> None:
    prepared = SessionPreparation(options(folder), lambda message: None)
    with LockedLog(folder) as log:
        log.append("taken", slot=1, participant="P02")
    with pytest.raises(ServeRefused, match="the study changed while the session was prepared"):
        prepared.open_journal(lambda: None, lambda: 0.0)
    prepared.close()
    assert not list((folder / "sessions").glob("*"))
    assert read_info(begin(folder)).slot == 2


def test_checks_that_a_killed_engine_did_not_record_are_recorded_by_the_next_one(folder: Path) -> None:
    path = begin(folder)
    (entry,) = [line for line in log_lines(folder) if line["kind"] == "session"]
    assert entry["checks"][0]["id"] == "lamp" and entry["folder"] == path.name
    prepared = SessionPreparation(options(folder, unfinished="recover", checks=()), lambda message: None)
    assert prepared.recovered is not None and prepared.study is not None
    assert prepared.study.unrecorded_checks(path, prepared.recovered.view) == [LIT]
    prepared.close()


def test_the_plan_says_mode_robot_and_seed(folder: Path) -> None:
    path = begin(folder)
    info = read_info(path)
    assert (info.mode, info.robot, info.purpose) == ("real", "generic", "counted")
    assert info.condition == f"{info.factors['hesitation']}+{info.factors['noise']}"
    other = begin(folder, participant="P02")
    assert read_info(other).seed != info.seed
    with pytest.raises(ServeRefused, match="has the plan's seed"):
        SessionPreparation(options(folder, participant="P03", seed=5), lambda message: None)


def test_a_session_elsewhere_in_the_study_is_not_theirs(folder: Path, tmp_path: Path) -> None:
    path = begin(folder)
    with pytest.raises(ServeRefused, match="is the session of P01, not of P02"):
        SessionPreparation(options(folder, "P02", unfinished=str(path)), lambda message: None)
    with pytest.raises(ServeRefused, match="there is no session"):
        SessionPreparation(options(folder, unfinished="yesterday"), lambda message: None)
    elsewhere = tmp_path / "copy"
    path.rename(elsewhere)
    with pytest.raises(ServeRefused, match="is not a session of the study hesitation"):
        SessionPreparation(options(folder, unfinished=str(elsewhere)), lambda message: None)

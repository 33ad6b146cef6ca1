"""What an engine keeps of the one before it."""

from __future__ import annotations

from errno import ENOSPC
from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_engine.run.protocol.registry import SessionLock
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.preparation import ServeRefused, SessionPreparation
from rise_engine.session.journal_format import encode_header, encode_input
from tests.cli.processes import folder


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("RISE_SESSIONS", str(tmp_path / "sessions"))
    return str(folder(tmp_path / "study"))


def begun(study: str, *, older: bool = False) -> SessionPreparation:
    """A session whose engine has gone."""
    prepared = SessionPreparation(SessionOptions(study, seed=7), print)
    journal = prepared.open_journal(lambda: None, lambda: 0.0)
    started = replace(prepared.started, goals="") if older else prepared.started
    journal.append(encode_header("rise-tui test") + encode_input(1, started))
    assert journal.close()
    prepared.close()
    return prepared


@pytest.mark.parametrize("older", [False, True])
def test_the_ids_of_goals_are_made_of_a_text_in_the_journal(tmp_path: Path, study: str, older: bool) -> None:
    prepared = begun(study, older=older)
    renamed = prepared.folder.rename(tmp_path / "sessions" / "renamed")
    again = SessionPreparation(SessionOptions(study, unfinished=str(renamed)), print)
    again.close()
    assert again.session_id == ("renamed 7" if older else prepared.session_id)


def test_a_runtime_folder_without_space_is_told(study: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(lock: SessionLock, folder: Path) -> None:
        raise OSError(ENOSPC, "No space left on device")

    left = begun(study).folder
    monkeypatch.setattr(SessionLock, "write_folder", fails)
    with pytest.raises(ServeRefused) as refused:
        SessionPreparation(SessionOptions(study, unfinished=str(left)), print)
    assert refused.value.report.lines == [f"{left.name} cannot be recovered: [Errno 28] No space left on device"]

"""What an engine keeps of the one before it."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.preparation import SessionPreparation
from rise_engine.session.journal_format import encode_header, encode_input
from tests.cli.processes import folder


@pytest.mark.parametrize("older", [False, True])
def test_the_ids_of_goals_are_made_of_a_text_in_the_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, older: bool
) -> None:
    monkeypatch.setenv("RISE_SESSIONS", str(tmp_path / "sessions"))
    study = str(folder(tmp_path / "study"))
    prepared = SessionPreparation(SessionOptions(study, seed=7), print)
    journal = prepared.open_journal(lambda: None, lambda: 0.0)
    started = replace(prepared.started, goals="") if older else prepared.started
    journal.append(encode_header("rise-tui test") + encode_input(1, started))
    assert journal.close()
    prepared.close()
    renamed = prepared.folder.rename(tmp_path / "sessions" / "renamed")
    again = SessionPreparation(SessionOptions(study, unfinished=str(renamed)), print)
    again.close()
    assert again.session_id == ("renamed 7" if older else prepared.session_id)

"""What a session's folder says about itself to whoever may go on with it."""

from __future__ import annotations

import re
from pathlib import Path

from rise_engine.kernel.inputs import SessionStarted
from rise_engine.scenario.loader import load
from rise_engine.session.folder import JOURNAL, create_session, describe_session, read_info

from .journals import ACTS, TOML, write


def test_it_names_participant_condition_and_wizard(tmp_path: Path) -> None:
    loaded = load(write(tmp_path / "study", acts=ACTS, toml=TOML))
    assert loaded.scenario is not None
    folder = create_session(
        tmp_path / "sessions",
        loaded.scenario,
        loaded.files,
        seed=1,
        faults=(),
        versions={},
        wizard='anna "A"',
        begun=SessionStarted(participant="P07", condition="B"),
    )
    (folder / JOURNAL).touch()
    info = read_info(folder)
    assert (info.participant, info.condition, info.wizard) == ("P07", "B", 'anna "A"')
    sentence = describe_session(folder)
    assert ", participant P07, condition B, begun 20" in sentence
    assert re.search(r'by anna "A", ran \d+ s, last record ', sentence)


def test_nobody_is_named_who_was_not(tmp_path: Path) -> None:
    loaded = load(write(tmp_path / "study", acts=ACTS, toml=TOML))
    assert loaded.scenario is not None
    folder = create_session(tmp_path / "sessions", loaded.scenario, loaded.files, seed=1, faults=(), versions={})
    (folder / JOURNAL).touch()
    assert describe_session(folder).startswith("Sample study (debug, generic), begun 20")
    text = (folder / "session.toml").read_text("utf-8").replace('wizard = ""\n', "")
    (folder / "session.toml").write_text(text, "utf-8")
    assert read_info(folder).wizard == "", "as older versions wrote it"

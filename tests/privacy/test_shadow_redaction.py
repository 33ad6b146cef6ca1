"""Words that leave a session leave what second wizards did in it, too."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.base.errors import SessionError
from rise_engine.base.words import Words, parse_replacement
from rise_engine.privacy.redaction import redact
from rise_engine.session.replay import compare_replay
from rise_engine.session.shadow import ShadowKey, ShadowNote, ShadowWriter, read_shadow
from tests.results.analysis.cues import ACT, make_session


def words(*pairs: str) -> Words:
    return Words([parse_replacement(pair) for pair in pairs])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return make_session(tmp_path, [(1.0, "cue", ""), (2.0, "act", "Praise")])


def make_shadow(folder: Path) -> ShadowWriter:
    writer = ShadowWriter.begin(folder, "Maria")
    writer.append(ShadowKey(t=2.0, function="say", behavior="Well done, Maria!", cue=1))
    writer.append(ShadowKey(t=3.0, function=ACT, behavior="Praise", cue=1))
    writer.append(ShadowKey(t=4.0, function=ACT, behavior="Maria", cue=1))
    writer.append(ShadowNote(5.0, "maria laughs"))
    return writer


def test_what_was_typed_goes_and_what_the_scenario_calls_its_acts_stays(folder: Path) -> None:
    writer = make_shadow(folder)
    writer.close()
    report = redact(folder, words("Maria=NAME1"), by="W1")
    found = read_shadow(writer.path)
    assert found.header.wizard == "NAME1"
    assert [getattr(line, "behavior", getattr(line, "text", "")) for line in found.lines] == [
        *("Well done, NAME1!", "Praise", "Maria", "NAME1 laughs")
    ]
    assert (report.lines, report.shadow_lines) == (0, 3)
    assert report.remains == ["shadow/1.jsonl, line 4: the scenario's own words, or a line that cannot be read"]
    assert writer.path.stat().st_mode & 0o777 == 0o600
    assert [path.name for path in (folder / "shadow").iterdir()] == ["1.jsonl"]
    assert not list(folder.glob("*.redacting"))
    assert compare_replay(folder).identical
    assert "redacted = [" in (folder / "session.toml").read_text()


def test_trying_changes_nothing(folder: Path) -> None:
    writer = make_shadow(folder)
    writer.close()
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert redact(folder, words("Maria=NAME1"), try_only=True).shadow_lines == 3
    after = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and path in before}
    assert after == before


def test_while_somebody_judges_nothing_is_changed(folder: Path) -> None:
    writer = make_shadow(folder)
    before = writer.path.read_bytes()
    with pytest.raises(SessionError, match="is being written by a console: leave that first"):
        redact(folder, words("Maria=NAME1"))
    assert writer.path.read_bytes() == before
    writer.close()

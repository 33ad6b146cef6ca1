"""What a session's folder says about itself to whoever may go on with it; sessions in a condition, also those of when a
condition was a name alone."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from rise_engine.cli import main
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.kernel.records import MemoryRecord
from rise_engine.scenario.loader import load
from rise_engine.session.folder import JOURNAL, create_session, describe_session, read_info
from rise_engine.session.recovery import recover

from .journals import ACTS, TOML, Made, write


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


BARE = '[study]\nconditions = ["calm", "loud"]\n'
TABLES = '[conditions.calm]\nmemory = { name = "you" }\n[conditions.loud]\nmemory = { name = "YOU" }\n'


@pytest.mark.parametrize(
    ("toml", "memory"), [(TABLES, {"name": "YOU"}), (BARE, {})], ids=["with tables", "a name alone"]
)
def test_it_is_replayed_and_recovered_as_it_was(tmp_path: Path, toml: str, memory: dict[str, str]) -> None:
    started = SessionStarted(condition="loud", memory=memory)
    made = Made(tmp_path / "ended", ended=True, toml=TOML + toml, started=started)
    shutil.rmtree(made.study)  # what it was then lies beside its journal
    result = CliRunner().invoke(main, ["replay", str(made.folder)])
    assert result.exit_code == 0 and result.output.startswith("identical"), result.output
    exported = CliRunner().invoke(main, ["export", str(made.folder), "--format", "csv"])
    assert exported.exit_code == 0 and "loud" in exported.output
    written = [(r.value, r.source) for r in made.records if isinstance(r, MemoryRecord) and r.key == "name"]
    assert written[:2] == [("Anna", "file"), ("YOU", "condition")] if memory else written[0] == ("Anna", "file")

    left = Made(tmp_path / "left", ended=False, toml=TOML + toml, started=started)
    found = recover(left.folder)
    assert found.kernel.snapshot() == left.session.kernel.snapshot()
    assert found.view.session is not None and found.view.session.condition == "loud"

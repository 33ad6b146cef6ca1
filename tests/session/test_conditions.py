"""Sessions in a condition on disk: replayed and recovered, also those of when a condition was a name alone."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from rise_engine.cli import main
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.kernel.records import MemoryRecord
from rise_engine.session.recovery import recover

from .journals import TOML, Made

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

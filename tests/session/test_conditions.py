"""Sessions in a condition on disk: replayed and recovered, also those of when a condition was a name alone."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from rise_engine.cli import main
from rise_engine.kernel.inputs import AnyInput, SessionStarted
from rise_engine.kernel.records import AnyRecord, MemoryRecord
from rise_engine.session.recovery import recover

from .journals import TOML, Made, Recording

BARE = '[study]\nconditions = ["calm", "loud"]\n'
TABLES = '[conditions.calm]\nmemory = { name = "you" }\n[conditions.loud]\nmemory = { name = "YOU" }\n'


def made_in(monkeypatch: pytest.MonkeyPatch, root: Path, started: SessionStarted, toml: str, *, ended: bool) -> Made:
    """A session that began in this way."""

    def do(self: Recording, input: AnyInput) -> list[AnyRecord]:
        return plain(self, started if isinstance(input, SessionStarted) else input)

    plain = Recording.do
    with monkeypatch.context() as patched:
        patched.setattr(Recording, "do", do)
        return Made(root, ended=ended, toml=TOML + toml)


@pytest.mark.parametrize(
    ("toml", "memory"), [(TABLES, {"name": "YOU"}), (BARE, {})], ids=["with tables", "a name alone"]
)
def test_it_is_replayed_and_recovered_as_it_was(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, toml: str, memory: dict[str, str]
) -> None:
    started = SessionStarted(condition="loud", memory=memory)
    made = made_in(monkeypatch, tmp_path / "ended", started, toml, ended=True)
    shutil.rmtree(made.study)  # what it was then lies beside its journal
    result = CliRunner().invoke(main, ["replay", str(made.folder)])
    assert result.exit_code == 0 and result.output.startswith("identical"), result.output
    exported = CliRunner().invoke(main, ["export", str(made.folder), "--format", "csv"])
    assert exported.exit_code == 0 and "loud" in exported.output
    written = [(r.value, r.source) for r in made.records if isinstance(r, MemoryRecord) and r.key == "name"]
    assert written[:2] == [("Anna", "file"), ("YOU", "condition")] if memory else written[0] == ("Anna", "file")

    left = made_in(monkeypatch, tmp_path / "left", started, toml, ended=False)
    found = recover(left.folder)
    assert found.kernel.snapshot() == left.session.kernel.snapshot()
    assert found.view.session is not None and found.view.session.condition == "loud"

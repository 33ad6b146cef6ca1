"""What a real session leaves on the disk: for its owner alone, whatever the umask, and without logins and computers."""

from __future__ import annotations

import getpass
import os
import platform
import re
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from rise_engine.session.folder import mark_abandoned, read_info
from rise_engine.session.lock import HOLDER_FILE
from rise_engine.study.study_log import read_log
from tests.cli.processes import engine, folder
from tests.study.studies import DESIGN, write_study

from .test_serve import Serving, root

pytestmark = pytest.mark.slow
__all__ = ["root"]


@pytest.fixture
def open_umask() -> Iterator[None]:
    before = os.umask(0)
    yield
    os.umask(before)


def open_to_others(*roots: Path, but: frozenset[Path] = frozenset()) -> list[str]:
    """Every file and folder in and below these that others than the owner may look at."""
    paths = [path for each in roots for path in (each, *each.rglob("*"))]
    modes = {path: stat.S_IMODE(path.lstat().st_mode) for path in paths if path not in but and not path.is_symlink()}
    return [f"{path} {mode:o}" for path, mode in modes.items() if mode & 0o077]


def serve_once(*arguments: object) -> None:
    serving = Serving(*arguments)
    assert "serving" in serving.report, serving.report
    assert serving.end() == 0


def test_a_session_is_for_its_owner_alone(root: Path, open_umask: None) -> None:
    study = folder(root / "scenario")
    serve_once(study, "--mode", "real", "--robot", "generic", "--participant", "P07", "--act", "Greet")
    sessions = root / "sessions"
    (session,) = sessions.iterdir()
    out = root / "out.csv"
    assert engine("export", session, "--format", "csv", "-o", out).returncode == 0
    assert engine("redact", session, "--replace", "P07=P99").returncode == 1, "the folder's name still has it"
    assert open_to_others(sessions, out) == []


def test_a_study_is_for_its_owner_alone(root: Path, open_umask: None) -> None:
    study = root / "study"
    write_study(study, DESIGN, plan=False)
    people = frozenset({study, *study.rglob("*")})  # what people write is theirs to protect
    assert engine("study", "plan", study).returncode == 0
    serve_once("--study", study, "--participant", "P01", "--robot", "generic")
    (session,) = (study / "sessions").iterdir()
    out = study / "out.jsonl"
    assert engine("export", session, "--format", "jsonl", "--level", "shared", "-o", out).returncode == 0
    assert [each.kind for each in read_log(study)[-2:]] == ["exported", "written"]
    assert {"plan.csv", "study.jsonl", "out.jsonl"} <= {path.name for path in study.iterdir()}
    assert open_to_others(study, but=people) == []
    withdrawn = engine("study", "withdraw", study, "P01", "--yes")
    assert withdrawn.returncode == 1 and "participants.csv, line 2" in withdrawn.stdout, withdrawn
    assert not session.exists() and not out.exists()
    assert open_to_others(study, but=people) == []


def test_a_real_session_names_no_login_and_no_computer(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = root / "home" / "someone"
    study = folder(home / "scenario")
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("LOGNAME", "someone")
    serve_once(study, "--mode", "real", "--robot", "generic", "--participant", "P07")
    (session,) = (root / "sessions").iterdir()
    text = "".join(path.read_text("utf-8") for path in session.rglob("*") if path.is_file())
    words = set(re.findall(r"[\w.-]+", text))
    assert not {"someone", platform.node()} & words
    assert not (session / HOLDER_FILE).exists()
    info = read_info(session)
    assert info.scenario_folder == str(study) and set(info.machine) == {"system"}
    serve_once(study, "--mode", "debug", "--new")
    (other,) = set((root / "sessions").iterdir()) - {session}
    assert read_info(other).machine["user"] == getpass.getuser()


def test_who_had_an_abandoned_session_is_forgotten(root: Path) -> None:
    study = folder(root / "scenario")
    serving = Serving(study, "--mode", "real", "--robot", "generic")
    assert "serving" in serving.report, serving.report
    (session,) = (root / "sessions").iterdir()
    mark_abandoned(session)
    assert (session / HOLDER_FILE).exists(), "somebody has it"
    (session / "abandoned").unlink()
    serving.process.kill()
    assert serving.wait() == -9
    assert (session / HOLDER_FILE).exists()
    mark_abandoned(session)
    assert not (session / HOLDER_FILE).exists()


@pytest.mark.parametrize("name", ["Anna Müller", "anna@example.org", "P-07", "P07 ", "Ä"])
def test_only_pseudonyms_take_part_in_real_sessions(root: Path, name: str) -> None:
    study = folder(root / "scenario")
    refused = engine("serve", study, "--mode", "real", "--robot", "generic", "--participant", name)
    assert refused.returncode == 2 and "is not a pseudonym" in refused.stderr
    assert not (root / "sessions").exists() or not list((root / "sessions").iterdir())
    serve_once(study, "--mode", "debug", "--participant", name)

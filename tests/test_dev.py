"""`./dev` on machines that lack something: it says what to install and ends, and leaves nothing half-made behind."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TOOLS = ("sh", "dirname", "cksum", "cat", "uname", "tail", "grep", "rm", "printf")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout with a blank in its name, on a machine with nothing but a shell's usual tools (see `bin`)."""
    folder = tmp_path / "a checkout"
    (folder / "bin").mkdir(parents=True)
    for name in ("dev", "pyproject.toml"):
        shutil.copy(ROOT / name, folder / name)
    for tool in TOOLS:
        if (found := shutil.which(tool)) is not None:
            (folder / "bin" / tool).symlink_to(found)
    install(folder, "apt-get", "exit 1")
    return folder


def install(checkout: Path, name: str, script: str) -> None:
    file = checkout / "bin" / name
    file.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    file.chmod(0o755)


def dev(checkout: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [checkout / "dev", *arguments],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        env={"PATH": str(checkout / "bin"), "HOME": os.environ.get("HOME", "/")},
        timeout=60,
        check=False,
    )


def test_no_python(checkout: Path) -> None:
    result = dev(checkout, "setup")
    assert result.returncode == 1
    assert "needs Python 3.11 or newer; no Python was found" in result.stderr
    assert "sudo apt install python3 python3-venv" in result.stderr


def test_a_python_that_is_too_old(checkout: Path) -> None:
    install(checkout, "python3", 'case "$*" in *version_info*) echo "3.10 0" ;; *) exit 1 ;; esac')
    result = dev(checkout, "run")
    assert result.returncode == 1
    assert "the newest found here is Python 3.10" in result.stderr
    assert "sudo apt install python3.11 python3.11-venv" in result.stderr


def test_a_python_without_ensurepip(checkout: Path) -> None:
    install(checkout, "python3", 'case "$*" in *ensurepip*) exit 1 ;; *version_info*) echo "3.12 1" ;; esac')
    result = dev(checkout, "test")
    assert result.returncode == 1
    assert "its module ensurepip is missing" in result.stderr
    assert "sudo apt install python3.12-venv" in result.stderr
    assert not (checkout / ".venv").exists()


def test_a_newer_python_without_ensurepip_does_not_hide_an_older_one_that_has_it(checkout: Path) -> None:
    install(checkout, "python3.13", 'case "$*" in *ensurepip*) exit 1 ;; *version_info*) echo "3.13 1" ;; esac')
    install(
        checkout, "python3.11", 'case "$*" in *version_info*) echo "3.11 1" ;; *--clear*) echo made >&2; exit 1 ;; esac'
    )
    result = dev(checkout, "setup")
    assert result.returncode == 1
    assert "made" in result.stderr
    assert "The environment could not be made" in result.stderr


def test_a_complete_environment_is_left_alone(checkout: Path) -> None:
    """A second `./dev run` starts at once: with a fitting stamp nothing is made and pip is not called."""
    programs = checkout / ".venv" / "bin"
    programs.mkdir(parents=True)
    (programs / "python").write_text('#!/bin/sh\ncase "$*" in *pip*) exit 1 ;; esac\necho 3.12.3\n')
    (programs / "rise-tui").write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    for file in programs.iterdir():
        file.chmod(0o755)
    checksum = subprocess.run(
        ["cksum"], input=(ROOT / "pyproject.toml").read_bytes(), capture_output=True, check=True
    ).stdout.decode()
    stamp = checkout / ".venv" / ".dev-stamp"
    stamp.write_text(f"{checksum.strip()} 3.12.3 {checkout}\ncore\n", encoding="utf-8")
    result = dev(checkout, "run")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines() == ["--config", f"{checkout}/scenarios/lablinking", "--mode", "debug"]
    assert dev(checkout, "run", "--config", "a b").stdout.splitlines() == ["--config", "a b"]


@pytest.mark.parametrize(("arguments", "status"), [(["help"], 0), ([], 2), (["tset"], 2)])
def test_usage(checkout: Path, arguments: list[str], status: int) -> None:
    result = dev(checkout, *arguments)
    assert result.returncode == status
    assert "Usage: ./dev COMMAND" in result.stdout + result.stderr


def test_the_scripts_are_plain_shell() -> None:
    for script in ("dev", ".ci/run"):
        assert (ROOT / script).read_text(encoding="utf-8").startswith("#!/bin/sh\n")
        assert os.access(ROOT / script, os.X_OK)
        subprocess.run(["sh", "-n", ROOT / script], check=True)

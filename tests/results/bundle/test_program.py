"""The program in a bundle: a wheel that pip takes, with every module, and what says where it comes from."""

from __future__ import annotations

import base64
import hashlib
import io
import re
import zipfile
from configparser import ConfigParser
from email.parser import HeaderParser
from pathlib import Path

import pytest
import rise_adapters
import rise_exchange

import rise_engine
import rise_tui
from rise_engine.results.bundle import contents
from rise_engine.results.bundle.about import PYTHON
from rise_engine.results.bundle.contents import Wheel, environment_text, program_wheel, wheel_in, write_program


@pytest.fixture(scope="module")
def wheel() -> Wheel:
    found = program_wheel()
    assert isinstance(found, Wheel), found
    return found


def test_it_is_a_wheel(wheel: Wheel) -> None:
    """https://packaging.python.org/en/latest/specifications/binary-distribution-format/"""
    name, version, *tags = wheel.name.removesuffix(".whl").split("-")
    assert (name, tags) == ("rise_tui", ["py3", "none", "any"])
    with zipfile.ZipFile(io.BytesIO(wheel.data)) as archive:
        assert archive.testzip() is None
        names = archive.namelist()
        assert len(names) == len(set(names))
        info = f"{name}-{version}.dist-info"
        recorded = {}
        for line in archive.read(f"{info}/RECORD").decode().splitlines():
            path, digest, size = line.rsplit(",", 2)
            recorded[path] = (digest, size)
        assert recorded.keys() == set(names)
        for path, (digest, size) in recorded.items():
            data = archive.read(path)
            if path != f"{info}/RECORD":
                found = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
                assert (digest, size) == (f"sha256={found}", str(len(data)))
        about = HeaderParser().parsestr(archive.read(f"{info}/WHEEL").decode())
        assert (about["Wheel-Version"], about["Root-Is-Purelib"], about["Tag"]) == ("1.0", "true", "py3-none-any")
        metadata = HeaderParser().parsestr(archive.read(f"{info}/METADATA").decode())
        assert (metadata["Name"], metadata["Version"]) == ("rise-tui", version)
        assert metadata["Requires-Python"] == f">={'.'.join(map(str, PYTHON))}"
        entries = ConfigParser(delimiters=("=",))
        entries.read_string(archive.read(f"{info}/entry_points.txt").decode())
        for section in entries.sections():
            for target in entries[section].values():
                module = target.partition(":")[0].replace(".", "/")
                assert f"{module}.py" in names or f"{module}/__init__.py" in names, target


def test_every_module_is_in_it(wheel: Wheel) -> None:
    with zipfile.ZipFile(io.BytesIO(wheel.data)) as archive:
        names = set(archive.namelist())
    for package in (rise_engine, rise_tui, rise_adapters, rise_exchange):
        (folder,) = map(Path, package.__path__)
        modules = {f"{package.__name__}/{path.relative_to(folder).as_posix()}" for path in folder.rglob("*.py")}
        assert len(modules) > 30
        assert modules <= names
    assert "rise_engine/studies/lablinking/scenario.toml" in names
    assert not any(name.endswith(".pyc") or "/." in name for name in names)


def test_it_lies_in_the_bundle_with_the_versions_of_what_it_needs(wheel: Wheel, tmp_path: Path) -> None:
    assert write_program(tmp_path) == ""
    assert wheel_in(tmp_path) == f"program/{wheel.name}"
    pinned = (tmp_path / "program" / "requirements.txt").read_text("utf-8").splitlines()
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==\S+", line) for line in pinned)
    assert {"msgspec", "lxml", "textual"} <= {line.partition("==")[0] for line in pinned}
    assert hashlib.sha256(wheel.data).hexdigest() in environment_text({})


def test_where_it_cannot_be_made_the_bundle_says_which_one_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(contents, "program_wheel", lambda: "rise-tui was not installed by pip here")
    assert write_program(tmp_path) == "rise-tui was not installed by pip here"
    assert (wheel_in(tmp_path), list(tmp_path.iterdir())) == ("", [])
    text = environment_text({"rise-tui": {"0.1.0"}})
    assert f"rise-tui=={rise_engine.__version__}" in text
    assert "program/" not in text

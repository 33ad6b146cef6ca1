"""A scenario read from memory: as if what is held had been saved."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.files.tree import FileTree, UnreadableError
from rise_engine.scenario.loader import LoadResult, load
from tests.chance import SEARCH
from tests.scenario.folders import SPEECH, act, folder, found

SCENARIOS = Path("scenarios")
STUDIES = ("greeting", "lab_opening", "lablinking", "negation")


def content(path: Path) -> dict[str, bytes]:
    """Every file of a folder, by its name within it."""
    return {each.relative_to(path).as_posix(): each.read_bytes() for each in path.rglob("*") if each.is_file()}


def outcome(result: LoadResult) -> tuple[object, ...]:
    scenario = result.scenario
    return (
        [str(each) for each in result.diagnostics],
        [str(each) for each in result.suppressed],
        scenario and (scenario.hash, scenario.acts, scenario.rules, scenario.memory, scenario.tables, scenario.robot),
    )


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_that_lies_in_memory_alone_is_the_one_on_the_disk(name: str, tmp_path: Path) -> None:
    held = content(SCENARIOS / name)
    assert outcome(load(tmp_path / name, held=held)) == outcome(load(SCENARIOS / name))
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("name", STUDIES if SEARCH else STUDIES[:1])
def test_what_is_held_is_read_as_if_it_had_been_saved(name: str, tmp_path: Path) -> None:
    """One file after the other is cut in the middle, taken away, and made anew."""
    study = tmp_path / name
    shutil.copytree(SCENARIOS / name, study)
    for file, data in content(study).items():
        for changed in (data[: len(data) // 2], None, b""):
            from_memory = load(study, held={file: changed})
            if changed is None:
                (study / file).unlink()
            else:
                (study / file).write_bytes(changed)
            assert outcome(from_memory) == outcome(load(study)), (file, changed)
            (study / file).write_bytes(data)


def test_of_a_file_that_is_held_the_disk_is_not_asked(tmp_path: Path) -> None:
    folder(tmp_path, {"acts/b.xml": act(SPEECH, "B")})
    os.mkfifo(tmp_path / "acts/a.xml")
    (tmp_path / "acts/c.xml").symlink_to("nowhere")
    (tmp_path / "memory.json").mkdir()
    held = {"acts/a.xml": act(SPEECH).encode(), "acts/c.xml": act(SPEECH, "C").encode(), "memory.json": b'{"x": 1}'}
    result = load(tmp_path, held=held)
    assert found(result) == [] and list(result.scenario.acts) == ["A", "B", "C"]
    assert result.scenario.memory == {"x": 1}


def test_new_files_and_folders(tmp_path: Path) -> None:
    folder(tmp_path, {"acts/a.xml": act(SPEECH)})
    held = {
        "acts/0.xml": act("<Wave><actionID>1</actionID></Wave>", "W").encode(),
        "robots/own.toml": b"[actions.Wave]\n[actions.Speech]\n",
        "scenario.toml": b'robot = "own"\n',
        "tables/items.csv": b"text\nx\n",
        "./acts/../memory.json": b'{"x": 1}',
    }
    result = load(tmp_path, held=held)
    assert list(result.scenario.acts) == ["W", "A"] and result.scenario.robot.name == "own"
    assert "items" in result.scenario.tables and result.scenario.memory == {"x": 1}
    assert sorted(result.files) == [
        *("acts/0.xml", "acts/a.xml", "memory.json", "robots/own.toml", "scenario.toml", "tables/items.csv")
    ]
    assert [path.name for path in tmp_path.iterdir()] == ["acts"]


def test_findings_in_what_is_held(tmp_path: Path) -> None:
    folder(tmp_path, {"acts/a.xml": act(SPEECH)})
    held = {"acts/b.xml": b"<Dialogs>\n<Dialg/></Dialogs>", "memory.json": b"\xff", "rules/r.xml/deeper": b""}
    assert found(load(tmp_path, held=held)) == [
        "acts/b.xml:2:1 unknown-element",
        "memory.json:1:1 encoding",
        "rules/r.xml:1:1 unreadable",
    ]
    assert found(load(tmp_path, held={"acts/a.xml": b" " * 10_000_001})) == ["acts/a.xml:1:1 too-large"]


def test_a_tree_in_memory(tmp_path: Path) -> None:
    folder(tmp_path, {"on/disk.txt": "d", "on/gone.txt": ""})
    tree = FileTree(tmp_path, {"on/gone.txt": None, "new/deep/file": b"f"})
    assert tree.names(tmp_path) == ["new", "on"] and tree.names(tmp_path / "on") == ["disk.txt"]
    assert tree.is_folder(tmp_path / "new/deep") and not tree.is_folder(tmp_path / "on/gone.txt")
    assert tree.is_file(tmp_path / "on/disk.txt") and not tree.is_file(tmp_path / "new")
    assert tree.read(tmp_path / "on/../on/disk.txt", 1) == b"d"
    for path in ("on/gone.txt", "new", "nowhere"):
        with pytest.raises(UnreadableError):
            tree.read(tmp_path / path, 100)
    with pytest.raises(FileNotFoundError):
        tree.names(tmp_path / "nowhere")


# --- places ----------------------------------------------------------------------------------------------------------


def test_every_place_in_a_file_has_its_bytes() -> None:
    text = "ä\r\n\r😀x\n\n<é/>"
    for data in (text.encode(), text.encode("utf-8-sig")):
        source = SourceFile("a.xml", data, text)
        mark = len(data) - len(text.encode())
        for offset in range(len(text) + 1):
            place = source.location(offset)
            assert source.offset(place.line, place.column) == offset
            assert source.byte_offset(place.line, place.column) == mark + len(text[:offset].encode())
        assert [source.line_text(number) for number in (1, 2, 4)] == ["ä", "\r😀x", "<é/>"]
    latin = SourceFile("tables/a.csv", "ä;x".encode("cp1252"), "ä;x", "cp1252")
    assert latin.byte_offset(1, 3) == 2

"""Kills saves: `python -m tests.author.edit.kill_saves FOLDER KILLS`. Prints what was found after each, as JSON.

A process of its own, for it forks: a child saves, and kills itself before its n-th call of the system.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path

from rise_engine.author.edit.edits import ReplaceFile, SetParameter, SetSetting, SetStartValue
from rise_engine.author.edit.plan import Files
from rise_engine.author.edit.study_folder import finish_interrupted, read_study_files
from rise_engine.author.edit.workspace import Workspace
from rise_engine.scenario.loader import load

_CALLS = ("open", "os.rename", "os.remove", "os.mkdir", "os.chmod")
EDITS = (
    SetParameter("R_Introduction", "1", "message", "I am Floka."),
    SetParameter("R_LookAhead", "1", "duration", "1500"),
    SetStartValue("person_y", 0.25),
    SetSetting(("title",), "Greeting everybody"),
    ReplaceFile("tests/new.jsonl", '{"at": 1, "command": "end"}\n'),
    ReplaceFile("session.jsonl", None),
)


def _save_and_die(workspace: Workspace, call: int) -> None:
    left = call

    def count(event: str, _args: object) -> None:
        nonlocal left
        if event in _CALLS:
            left -= 1
            if left == 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(count)
    workspace.save()
    os._exit(0)


def _restore(folder: Path, files: Files) -> None:
    for name in read_study_files(folder).keys() - files.keys():
        (folder / name).unlink()
    for name, data in files.items():
        if not (folder / name).is_file() or (folder / name).read_bytes() != data:
            (folder / name).write_bytes(data)
    if (folder / "tests").is_dir():
        (folder / "tests").rmdir()


def _on_disk(folder: Path) -> tuple[Files, list[str]]:
    """The files, without following a note; and all hidden ones."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths if path.name[0] != "."}
    return files, [path.name for path in paths if path.name[0] == "."]


def main(folder: Path, kills: int) -> None:
    """Kill saves at one call after the other, from the first on again when one has come to its end."""
    workspace = Workspace(folder)
    old = workspace.saved
    workspace.apply(*EDITS)
    new = workspace.files
    titles = {"old": load(folder, held=old).scenario, "new": load(folder, held=new).scenario}
    hashes = {which: scenario.hash for which, scenario in titles.items() if scenario is not None}
    found, call = [], 0
    while len(found) < kills:
        call += 1
        child = os.fork()
        if child == 0:
            _save_and_die(workspace, call)
        if not os.WIFSIGNALED(os.waitpid(child, 0)[1]):
            call = 0
            _restore(folder, old)
            workspace._keep_draft()  # the child has taken it away
            continue
        drafted = workspace.draft is not None
        read = read_study_files(folder)
        loaded = load(folder).scenario
        finish_interrupted(folder)
        finished, hidden = _on_disk(folder)
        found.append(
            {
                "call": call,
                "read": "old" if read == old else "new" if read == new else "mixed",
                "loaded": next((which for which in hashes if loaded and loaded.hash == hashes[which]), "mixed"),
                "finished": "old" if finished == old else "new" if finished == new else "mixed",
                "hidden": hidden,
                "drafted": drafted,
            }
        )
        _restore(folder, old)
        if not drafted:  # the child has come so far that it took it away
            workspace._keep_draft()
    workspace.close()
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))

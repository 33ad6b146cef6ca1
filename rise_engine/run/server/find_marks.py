"""The search for marks in a session's recordings after its end, in a background process.

It does the same as `rise-engine media add --find-marks` for each file of a recorder, with the lowest priority. A file
without marks does not change media.json.

`python -m rise_engine.run.server.find_marks FOLDER` is that process.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from rise_engine.base.errors import RiseError
from rise_engine.kernel.view import SessionView
from rise_engine.session.media import media_path, read_media

_LOG = logging.getLogger(__name__)
FILE_SECONDS = 900.0
"""Time limit for one file. An hour of sound takes some seconds; a film of 50 GB must be read once."""
_WITH_SOUND = frozenset({"video", "audio"})


def find_marks_later(folder: Path, view: SessionView) -> bool:
    """Start the search if there can be marks; return whether it was started. Never raises.

    :param folder: that of a session that has ended.
    :param view: its last state.
    """
    try:
        if view.sync is None or view.sync.medium != "sound" or find_spec("numpy") is None or not unaligned(folder):
            return False
        process = subprocess.Popen(
            [sys.executable, "-m", "rise_engine.run.server.find_marks", str(folder)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        process.returncode = 0  # detached: no warning that it still runs
    except (OSError, RiseError) as error:
        _LOG.warning("marks were not looked for: %s", error)
        return False
    return True


def unaligned(folder: Path) -> list[tuple[str, Path]]:
    """Return a session's recordings for which only the start is known, with their recorder's name.

    :param folder: the session's.
    :raises RiseError: media.json cannot be read.
    """
    return [
        (file.name, path)
        for file in read_media(folder)
        if file.name and file.kind in _WITH_SOUND and file.aligned_by == "start"
        if (path := media_path(folder, file)).is_file()
    ]


def main(folder: Path) -> None:
    """Search for marks in each file.

    :param folder: the session's.
    """
    os.nice(19)
    for name, path in unaligned(folder):
        command = [sys.executable, "-m", "rise_engine", "media", "add", "--find-marks", "--name", name, "--json"]
        try:
            subprocess.run(
                [*command, "--", str(folder), str(path)], stdin=subprocess.DEVNULL, check=False, timeout=FILE_SECONDS
            )
        except subprocess.TimeoutExpired:
            _LOG.warning("marks in %s were not found within %g s", path, FILE_SECONDS)


if __name__ == "__main__":
    main(Path(sys.argv[1]))

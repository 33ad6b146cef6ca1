"""LabLinking in the middle of a translation: one German text is missing, one is of an earlier text."""

from __future__ import annotations

import shutil
from pathlib import Path

LABLINKING = Path(__file__).parents[3] / "scenarios" / "lablinking"
STALE, MISSING = "R_Praise/2/1", "R_Praise/2/4"


def copy_lablinking(folder: Path) -> Path:
    """Into this folder, which is made."""
    shutil.copytree(LABLINKING, folder)
    replace(folder / "acts" / "feedback.xml", "<message>Very good!<", "<message>Very well done!<")
    german = folder / "texts" / "de.toml"
    lines = german.read_text("utf-8").splitlines(keepends=True)
    german.write_text("".join(line for line in lines if not line.startswith('"2/4"')), "utf-8")
    return folder


def replace(file: Path, old: str, new: str) -> None:
    """Once; it must be there."""
    text = file.read_text("utf-8")
    assert text.count(old) == 1, (file, old, text.count(old))
    file.write_text(text.replace(old, new), "utf-8")

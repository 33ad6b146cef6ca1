"""The present memory as the scenario's start values: the file `memory.json`. No widget here; blocks, not for a loop."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from rise_engine.scenario.layout import DEFAULT_PLACES
from rise_engine.scenario.memory import LIST_KEY
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.shipped import is_shipped
from rise_tui.text import value_text


class NotWritable(Exception):
    """The start values cannot be written; the message says why, for a person."""


def file_of(scenario: Scenario) -> Path:
    """Where the start values stand. Raises NotWritable."""
    folder = Path(scenario.folder)
    if not scenario.folder or not folder.is_dir():
        raise NotWritable(f"the scenario's folder is not on this computer: {scenario.folder or 'none'}")
    if name := is_shipped(folder):
        raise NotWritable(
            f"this study comes with the program and stays as it is; copy it: rise-engine new DIR --from {name}"
        )
    path = folder / (scenario.paths.get("memory") or DEFAULT_PLACES["memory"])
    if path.exists() and not path.is_file():
        raise NotWritable(f"{path} is not a file")
    if not os.access(path.parent, os.W_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise NotWritable(f"{path} cannot be written: no permission")
    return path


def text_of(memory: Mapping[str, Any]) -> str:
    """The file's text, in RISE's form."""
    entries = [f"  {json.dumps({key: value}, ensure_ascii=False)}" for key, value in memory.items()]
    return f'{{"{LIST_KEY}":\n[\n' + ",\n".join(entries) + "\n]\n}\n"


def changes(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """What later sessions will begin with that this one did not, a key in each line."""
    said = []
    for key in (*before, *(key for key in now if key not in before)):
        if key not in now:
            said.append(f"{key}: {value_text(before[key])} → (no such key)")
        elif key not in before:
            said.append(f"{key}: (new) → {value_text(now[key])}")
        elif json.dumps(before[key]) != json.dumps(now[key]):
            said.append(f"{key}: {value_text(before[key])} → {value_text(now[key])}")
    return said


def write(path: Path, memory: Mapping[str, Any]) -> None:
    """Replace the file as a whole, or leave it as it was. Raises NotWritable."""
    fresh = ""
    try:
        handle, fresh = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text_of(memory))
            file.flush()
            os.fsync(file.fileno())
        with suppress(OSError):
            Path(fresh).chmod(path.stat().st_mode & 0o777 if path.exists() else 0o644)
        Path(fresh).replace(path)
    except (OSError, UnicodeError) as error:
        if fresh:
            Path(fresh).unlink(missing_ok=True)
        raise NotWritable(f"{path}: {getattr(error, 'strerror', None) or error}") from error

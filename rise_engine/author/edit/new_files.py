"""Whole files, as an editor, an import or a person has written them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import PurePosixPath

from rise_engine.author.edit.edits import Edit, ReplaceFile
from rise_engine.author.edit.plan import EditRefused, Plan
from rise_engine.author.edit.study_state import StudyState
from rise_engine.scenario.source_files import MAX_BYTES

_BOM = b"\xef\xbb\xbf"
_SHOWN = 90
"""Characters of a line that a sentence shows."""


def plan_replace_file(edit: ReplaceFile, study: StudyState) -> Plan:
    """A file gets other content, or is made, or goes. A byte order mark that it had stays."""
    file = str(PurePosixPath(edit.file))
    old = study.files.get(file)
    if edit.text is None:
        if old is None:
            raise EditRefused(f"there is no file `{file}`")
        return Plan(written={file: None}, says=(f"{file} goes",))
    try:
        data = edit.text.encode()
    except UnicodeEncodeError:
        raise EditRefused(f"the text for {file} holds half a character and cannot be written") from None
    if len(data) > MAX_BYTES:
        raise EditRefused(f"{file} would be larger than {MAX_BYTES // 1_000_000} MB, and could not be read")
    if old is not None and old.startswith(_BOM) and not data.startswith(_BOM):
        data = _BOM + data
    if data == old:
        return Plan()
    return Plan(written={file: data}, says=(f"{file} is made" if old is None else _what_differs(file, old, edit.text),))


def _what_differs(file: str, old: bytes, new: str) -> str:
    """In words; of a single line, what it is and was."""
    before, after = (text.removeprefix("\ufeff").splitlines() for text in (old.decode(errors="replace"), new))
    changed = [number for number, (one, other) in enumerate(zip(before, after, strict=False)) if one != other]
    if len(changed) != 1 or len(before) != len(after):
        return f"{file} is written anew"
    was, is_now = (_short(" ".join(lines[changed[0]].split())) for lines in (before, after))
    return f"{file}, line {changed[0] + 1}, is “{is_now}” (was “{was}”)"


def _short(text: str) -> str:
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"


PLANNERS: Mapping[type[Edit], Callable[..., Plan]] = {ReplaceFile: plan_replace_file}

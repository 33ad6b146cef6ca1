"""Whole files, as an editor, an import or a person has written them."""

from __future__ import annotations

import posixpath
from collections.abc import Callable, Mapping

from rise_engine.edit.edits import Edit, ReplaceFile
from rise_engine.edit.plan import EditRefused, Plan
from rise_engine.edit.study_state import StudyState
from rise_engine.scenario.source_files import MAX_BYTES

_BOM = b"\xef\xbb\xbf"


def plan_replace_file(edit: ReplaceFile, study: StudyState) -> Plan:
    """A file gets other content, or is made, or goes. A byte order mark that it had stays."""
    file = posixpath.normpath(edit.file)
    if not edit.file or file.startswith(("../", "/")) or file in ("..", ".") or "\\" in file or "\0" in file:
        raise EditRefused(f"`{edit.file}` is no file in the folder of the study")
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
    return Plan(written={file: data}, says=(f"{file} is made" if old is None else f"{file} is written anew",))


PLANNERS: Mapping[type[Edit], Callable[..., Plan]] = {ReplaceFile: plan_replace_file}

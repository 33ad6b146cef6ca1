"""The command `edit`: makes the changes in a JSON file, all together or not at all."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

import click
import msgspec

from rise_engine.author.edit.edits import AnyEdit, Edit
from rise_engine.author.edit.plan import EditRefused, Files
from rise_engine.author.edit.workspace import Change, Refusal, Workspace, diff_of
from rise_engine.base.exit_status import OK, REFUSED, USAGE
from rise_engine.base.json_codec import JsonError, decode
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.cli.options import JSON, SCENARIO
from rise_engine.cli.terminal import Refused, exit_with_usage, print_lines, print_notes, reason_of, write_json
from rise_engine.scenario.files.study_paths import STUDY_FILE
from rise_engine.scenario.loader import LoadResult

_LARGEST = 10_000_000


@click.command()
@SCENARIO
@click.argument("edits", metavar="EDITS.json")
@click.option("--dry-run", is_flag=True, help="Show what would change, and write nothing.")
@click.option(
    "--allow-programs",
    is_flag=True,
    help="Also write edits after which the study starts other programs than before: checks and recorders.",
)
@JSON
def edit(folder: str, edits: str, dry_run: bool, allow_programs: bool, as_json: bool) -> int:
    """Make the changes in EDITS.json in the study in DIR: all of them, or none. `-` reads them from standard input.

    EDITS.json is a list of edits (docs/reference/edits.md). Each edit works on the result of the ones before it.
    Nothing is written if an edit cannot be made, or if the study would then have errors.

    Exit status: 0; 1 refused; 2 no such folder, or EDITS.json cannot be read.
    """
    wanted = read_edits(_read(edits), edits)
    workspace = Workspace(Path(folder))
    try:
        return _make(workspace, wanted, edits, dry_run=dry_run, allow_programs=allow_programs, as_json=as_json)
    finally:
        workspace.close()


def read_edits(text: str, name: str) -> list[AnyEdit]:
    """Read a file's edits, a list or a single one. Ends the command if it is not JSON or an edit is invalid.

    :param text: the file's content.
    :param name: its name in messages.
    """
    try:
        values = decode(text)
    except JsonError as error:
        line = text.count("\n", 0, error.offset) + 1
        column = error.offset - (text.rfind("\n", 0, error.offset) + 1) + 1
        exit_with_usage(f"{name}:{line}:{column}: {error}")
    if not isinstance(values, list):
        values = [values]
    found: list[AnyEdit] = []
    problems: list[str] = []
    for number, value in enumerate(values, 1):
        made = _read_edit(value)
        if isinstance(made, str):
            problems.append(f"{name}: edit {number}: {made}")
        else:
            found.append(made)
    if problems:
        raise Refused(*problems, status=USAGE)
    return found


def kinds_of_edits() -> dict[str, type[Edit]]:
    """Return all edits, by their names in JSON."""
    return {str(each.__struct_config__.tag): each for each in AnyEdit.__args__}


def _read_edit(value: Any) -> AnyEdit | str:
    """Parse an edit, or return its error."""
    kinds = kinds_of_edits()
    if not isinstance(value, dict) or not isinstance(value.get("edit"), str):
        return 'an edit is an object such as {"edit": "set_start_value", "key": "score", "value": 0}'
    kind = kinds.get(value["edit"])
    if kind is None:
        return f"there is no edit `{value['edit']}`{did_you_mean(value['edit'], kinds)}"
    fields = [field.encode_name for field in msgspec.structs.fields(kind)]
    unknown = [key for key in value if key not in ("edit", *fields)]
    if unknown:
        near = did_you_mean(unknown[0], fields)
        return f"`{value['edit']}` has no field `{unknown[0]}`{near} (it has: {', '.join(fields)})"
    try:
        made: AnyEdit = msgspec.convert(value, AnyEdit)
    except msgspec.ValidationError as error:
        return f"`{value['edit']}`: {error}"
    return made


def _read(name: str) -> str:
    """Read the text of a file. Ends the command if it cannot be read."""
    try:
        data = sys.stdin.buffer.read(_LARGEST + 1) if name == "-" else _read_file(Path(name))
    except OSError as error:
        exit_with_usage(f"{name}: {reason_of(error)}")
    if len(data) > _LARGEST:
        exit_with_usage(f"{name} is larger than {_LARGEST // 1_000_000} MB")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        exit_with_usage(f"{name} is not UTF-8 text; save it as that")


def _read_file(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_LARGEST + 1)


def _make(
    workspace: Workspace, edits: list[AnyEdit], name: str, *, dry_run: bool, allow_programs: bool, as_json: bool
) -> int:
    """Make the edits, and return the exit status."""
    before = workspace.files
    state, change, refused = workspace.preview_edits(*edits)
    written: tuple[str, ...] = ()
    programs = [] if allow_programs else sorted(set(_started_programs(state.files)) - set(_started_programs(before)))
    problem = (
        f"the study would then start {'; '.join(programs)}. Read them, and add --allow-programs to allow them"
        if programs
        else ""
    )
    if not refused and not state.checked.errors and not problem and not dry_run:
        try:
            workspace.apply(*edits)
            written = workspace.save().files
        except EditRefused as error:
            workspace.undo()
            problem = str(error)
    is_refused = bool(refused or state.checked.errors or problem)
    if as_json:
        write_json(_document(change, refused, state.checked, before, state.files, written=written, problem=problem))
    elif not is_refused and dry_run:
        print(diff_of(before, state.files), end="")
    elif not is_refused:
        print_lines(*change.says or ("there was nothing to change",))
    if not as_json:
        print_notes(*_notes(change, refused, state.checked, name, problem))
    return REFUSED if is_refused else OK


def _started_programs(files: Files) -> Iterator[str]:
    """List in words the programs that a study's files make this computer start: those of checks, and recorders."""
    for name, data in files.items():
        if PurePosixPath(name).name != STUDY_FILE:
            continue
        try:
            study = tomllib.loads(data.decode("utf-8-sig"))
        except (ValueError, RecursionError):  # its errors are reported, and nothing is started
            continue
        checks, recording = study.get("check"), study.get("recording")
        for check in checks if isinstance(checks, list) else ():
            if isinstance(check, dict) and check.get("run"):
                yield f"a program, by the check {check.get('id')}: {check['run']}"
        for recorder, settings in recording.items() if isinstance(recording, dict) else ():
            if isinstance(settings, dict):
                yield f"a recorder, {recorder}: {settings}"


def _notes(change: Change, refused: tuple[Refusal, ...], checked: LoadResult, name: str, problem: str) -> list[object]:
    """List the problems, or else the remarks."""
    problems = [f"{name}: edit {each.edit + 1}: {each.why}" for each in refused] or checked.errors
    if problem:
        return [*problems, f"error: {problem}"]
    return [*problems, "nothing was written"] if problems else [*change.noticed]


def _document(
    change: Change,
    refused: tuple[Refusal, ...],
    checked: LoadResult,
    before: Files,
    after: Files,
    *,
    written: tuple[str, ...],
    problem: str,
) -> dict[str, Any]:
    findings = [
        {"code": each.code, "severity": each.severity, "place": str(each.location), "message": each.message}
        for each in checked.diagnostics
    ]
    return {
        "says": change.says,
        "noticed": change.noticed,
        "refused": [{"edit": each.edit + 1, "why": each.why} for each in refused],
        "findings": findings,
        "problem": problem,
        "diff": diff_of(before, after),
        "written": written,
    }

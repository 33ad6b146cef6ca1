"""The commands that change a study's files or search them: fmt, rename, uses."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import click

from rise_engine.author.edit.edits import NameKind, Rename
from rise_engine.author.edit.formatting import lay_out
from rise_engine.author.edit.plan import EditRefused, Files, Plan, StudyState, apply_plan
from rise_engine.author.edit.planning import plan
from rise_engine.author.edit.study_folder import (
    read_study_above,
    read_study_files,
    refuse_shipped,
    sets_key,
    write_files,
)
from rise_engine.author.edit.workspace import Workspace, diff_of
from rise_engine.base.exit_status import OK, REFUSED
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.text import pluralize
from rise_engine.cli.options import DIFF, JSON, SCENARIO, without_file
from rise_engine.cli.scenario.loading import sound_scenario
from rise_engine.cli.terminal import Refused, print_lines, print_notes, show, write_json
from rise_engine.scenario.files.study_paths import SCENARIO_FILE
from rise_engine.scenario.loader import LoadResult, load
from rise_engine.scenario.model import normal_topic

_KIND = click.argument("kind", type=click.Choice(get_args(NameKind)))


@click.command()
@SCENARIO
@_KIND
@click.argument("name")
@JSON
def uses(folder: str, kind: NameKind, name: str, as_json: bool) -> int:
    """Find where NAME is used in the scenario in DIR: first its definition, then everything that names it.

    A state is RULE/STATE, an action ACT/ID, an event has its slash or not. Exit status: 0; 1 if there is no such name;
    2 if there is no such folder.
    """
    loaded = load(folder)
    found = loaded.uses.of(kind, normal_topic(name) if kind == "event" else name)
    rows = [
        {
            "file": use.location.file,
            "line": use.location.line,
            "column": use.location.column,
            "defines": use.defines,
            "where": use.where,
        }
        for use in found
    ]
    lines = []
    for use in found:
        at, what = use.location, " (defines it)" if use.defines else ""
        lines.append(f"{at.file}:{at.line}:{at.column}: {use.where or kind}{what}")
    show(lines, {"kind": kind, "name": name, "uses": rows}, as_json=as_json)
    if not found and not as_json:
        what = {"key": "memory key"}.get(kind, kind)
        print_notes(f"there is no {what} `{name}`{did_you_mean(name, loaded.uses.names(kind))}")
    if kind == "key" and (above := sets_key(read_study_above(without_file(folder, SCENARIO_FILE)), name)):
        print_notes(f"{above}, too")
    if loaded.draft.unreadable_parts and not as_json:
        print_notes("a file cannot be read (rise-engine check says which); there may be more")
    return OK if found else REFUSED


@click.command()
@SCENARIO
@_KIND
@click.argument("old")
@click.argument("new")
@DIFF
@JSON
def rename(folder: str, kind: NameKind, old: str, new: str, as_diff: bool, as_json: bool) -> None:
    """Rename an act, rule, state, event, memory key or action everywhere in the study in DIR.

    A state is RULE/STATE, an action ACT/ID; NEW is the new name alone. Comments with the old name are listed and stay
    unchanged. Nothing is written if the name is taken, or the study has errors. Exit status: 0; 1 refused; 2 wrong
    usage.
    """
    path = without_file(folder, SCENARIO_FILE)
    loaded = load(path)
    try:
        sound_scenario(loaded)
    except Refused as refused:
        raise refused.with_hint("fix these errors first: they hide where names are used") from None
    try:
        files = read_study_files(path)
        state = StudyState(files, loaded, path, read_study_above(path))
        edit = Rename(kind, old, new)
        planned = plan(edit, state)
        after = apply_plan(files, planned)
        _check_after(state, after)
        if not as_diff:
            _write(path, files, after)
    except EditRefused as error:
        if as_json:
            write_json({"refused": str(error)})
        raise
    _print_plan(planned, files, after, as_diff=as_diff, as_json=as_json)


@click.command()
@SCENARIO
@click.option("--check", "check_only", is_flag=True, help="Write nothing, and exit with 1 if a file would change.")
@DIFF
def fmt(folder: str, check_only: bool, as_diff: bool) -> int:
    """Format the files of the study in DIR: indentation, blanks, empty lines.

    The content stays the same, and so do comments. A file that cannot be read stays unchanged and is named. Exit
    status: 0; 1 if a file could not be formatted, or would change with --check; 2 if there is no such folder.
    """
    path = without_file(folder, SCENARIO_FILE)
    files = read_study_files(path)
    layout = lay_out(files)
    after = {**files, **layout.changed}
    before, now = load(path), load(path, held=after)
    if _findings(before) != _findings(now):
        raise EditRefused("the layout would change what `rise-engine check` finds; nothing was written")
    if layout.changed and not check_only and not as_diff:
        _write(path, files, after)
    if as_diff:
        print(diff_of(files, after), end="")
    else:
        done = "would change" if check_only else "formatted"
        usual = f"{pluralize(layout.files, 'file')}, all in the usual layout"
        print_lines(*[f"{name}: {done}" for name in layout.changed] or [usual])
    print_notes(*(f"{name} stays as it is: {problem}" for name, problem in layout.problems.items()))
    return REFUSED if layout.problems or (check_only and layout.changed) else OK


def _check_after(before: StudyState, after: Files) -> None:
    """Check the study after a change. :raises EditRefused: it would have errors."""
    held = {name: data for name, data in after.items() if data != before.files.get(name)}
    loaded = load(before.folder, held=held)
    if loaded.errors:
        raise EditRefused(f"the study would have errors then, first: {loaded.errors[0]}; nothing was written")


def _findings(loaded: LoadResult) -> list[tuple[str, str, str]]:
    """Return the diagnostics without their lines, for a comparison."""
    found = [*loaded.diagnostics, *(each.diagnostic for each in loaded.suppressed)]
    return sorted((each.severity, each.code, each.location.file) for each in found)


def _print_plan(planned: Plan, before: Files, after: Files, *, as_diff: bool, as_json: bool) -> None:
    if as_json:
        files = sorted(name for name in after if after[name] != before.get(name))
        write_json({"says": planned.says, "noticed": planned.noticed, "files": files, "written": not as_diff})
        return
    if as_diff:
        print(diff_of(before, after), end="")
    else:
        print_lines(*planned.says)
    print_notes(*planned.noticed)


def _write(path: Path, before: Files, after: Files) -> None:
    """Write all or nothing, while no editor has the study open. A draft of the editor stays unchanged.

    :raises EditRefused: an editor has it open, or it cannot be written.
    """
    refuse_shipped(path)
    workspace = Workspace(path)
    try:
        if workspace.read_only:
            raise EditRefused(workspace.read_only)
        write_files(path, before, after)
    finally:
        workspace.close()

"""`rise-engine convert from-bml`: blocks of BML 1.0 as acts of a scenario."""

from __future__ import annotations

import re
import sys
from pathlib import Path, PurePosixPath

import click
from msgspec import Struct

from rise_engine.bml.act_files import act_file_text, calling_type_setting
from rise_engine.bml.findings import FORM, ConversionFindings
from rise_engine.bml.names import BmlNames
from rise_engine.bml.reading import ReadAct, read_act
from rise_engine.cli.arguments import exit_with_usage, resolve_scenario
from rise_engine.cli.check import print_findings
from rise_engine.cli.convert_bml import NAMES, STRICT, read_names_option, read_source, refuse, tell_findings
from rise_engine.edit.plan import EditRefused
from rise_engine.edit.saving import write_files
from rise_engine.exit_status import NOT_WRITTEN, REFUSED
from rise_engine.scenario.file_names import DEFAULT_PATHS, SCENARIO_FILE
from rise_engine.scenario.loader import LoadResult, load
from rise_engine.text import clean, pluralize

_NOT_IN_NAME = re.compile(r"[^\w-]")


class _NewAct(Struct, frozen=True):
    """An act that is to be written."""

    read: ReadAct
    origin: str
    """The file of BML."""
    name: str
    """Of its own file, relative to the scenario's folder."""


@click.command("from-bml")
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path())
@click.option("--into", "folder", metavar="DIR", required=True, type=click.Path(), help="A scenario, or a new folder.")
@NAMES
@STRICT
def from_bml(files: tuple[str, ...], folder: str, names_file: str | None, strict: bool) -> None:
    """Make acts of blocks of BML 1.0, and put each into a file of its own in the scenario DIR.

    \b
      rise-engine convert from-bml greet.xml --into DIR --names lab.toml

    An act keeps all times exactly, or it is not made: what BML says and an act cannot is refused, with the sentence
    that says why. What else an act has nothing for (marks in sentences, prosody) is listed as lost. All of this is said
    before anything is written; with an error, nothing is.

    Exit status: 0; 1 refused; 2 wrong usage; 74 it cannot be written.
    """
    path = Path(folder)
    is_new = not path.exists()
    if not is_new and not (path.is_dir() and not any(path.iterdir())):
        path = Path(resolve_scenario(folder))
        path = path.parent if path.is_file() else path
    loaded = load(path, held={SCENARIO_FILE: b""} if is_new else None)
    if loaded.scenario is None:
        print_findings(loaded)
        sys.exit(REFUSED)
    findings = ConversionFindings()
    acts = _read_acts(files, path, loaded, read_names_option(names_file, loaded.robot, findings), findings)
    tell_findings(findings, strict=strict)
    after = _files(path, acts)
    checked = load(path, held=after)
    if checked.scenario is None:  # what BML says cannot stand in this scenario
        print_findings(checked)
        refuse("nothing was written")
    before = {name: data for name in after if (data := _content(path / name)) is not None}
    try:
        path.mkdir(parents=True, exist_ok=True)
        write_files(path, before, after)
    except EditRefused as error:
        refuse(f"error: {error}")
    except OSError as error:
        click.echo(f"error: {folder} cannot be written: {error.strerror or error}", err=True)
        sys.exit(NOT_WRITTEN)
    for act in acts:
        actions = pluralize(len(act.read.act.actions), "action")
        click.echo(clean(f"{path / act.name}: {act.read.act.name}, {actions}, from {act.origin}"))


def _read_acts(
    files: tuple[str, ...], folder: Path, loaded: LoadResult, names: BmlNames, findings: ConversionFindings
) -> list[_NewAct]:
    """The acts of all files. One that the scenario has already, and a file that is there already, are findings."""
    assert loaded.scenario is not None
    known = dict.fromkeys(loaded.scenario.acts, "in the scenario")
    acts_path = PurePosixPath(loaded.scenario.paths.get("acts") or DEFAULT_PATHS["acts"])
    if not _is_folder(folder / acts_path):
        exit_with_usage(
            f"the acts of {folder} do not lie in a folder of it ({acts_path}); put the new ones there yourself"
        )
    found: list[_NewAct] = []
    for file in files:
        source = read_source(file, findings)
        read = read_act(source, names, findings) if source is not None else None
        if read is None:
            continue
        name = read.act.name
        if name in known:
            message = f"there is an act `{name}` {known[name]} already; give the block another id"
            findings.diagnostics.error(FORM, read.act.location, message)
            continue
        known[name] = f"in {file}"
        new = (acts_path / f"{_NOT_IN_NAME.sub('_', name)}.xml").as_posix()
        if (folder / new).exists() or any(each.name == new for each in found):
            message = f"there is a file {new} already; give the block another id"
            findings.diagnostics.error(FORM, read.act.location, message)
            continue
        found.append(_NewAct(read, file, new))
    return found


def _is_folder(path: Path) -> bool:
    return path.is_dir() or not path.exists()


def _files(folder: Path, acts: list[_NewAct]) -> dict[str, bytes]:
    """The files of the acts, and scenario.toml with the calling types that are not the usual one."""
    after = {act.name: act_file_text(act.read.act, Path(act.origin).name).encode() for act in acts}
    settings = "".join(calling_type_setting(act.read.act.name) for act in acts if act.read.calling_type == "None")
    if settings:
        written = _content(folder / SCENARIO_FILE) or b""
        gap = b"" if not written or written.endswith(b"\n") else b"\n"
        after[SCENARIO_FILE] = written + gap + settings.encode()
    return after


def _content(path: Path) -> bytes | None:
    return path.read_bytes() if path.is_file() else None

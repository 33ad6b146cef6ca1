"""`rise-engine convert to-bml` and `from-bml`: acts as blocks of BML 1.0, and back."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath

import click
from msgspec import Struct

from rise_engine.author.edit.study_folder import write_files
from rise_engine.base.text import pluralize
from rise_engine.cli.options import SCENARIO, STRICT, resolve_scenario, without_file
from rise_engine.cli.scenario.loading import load_scenario, sound_scenario
from rise_engine.cli.terminal import Refused, exit_with_usage, not_written, print_lines, print_notes, write_xml
from rise_engine.run.protocol.task_file import unknown_name_sentence
from rise_engine.scenario.files.source_files import FileReader, SourceFile
from rise_engine.scenario.files.study_paths import DEFAULT_PATHS, SCENARIO_FILE
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import ActSettings, RobotProfile, Scenario
from rise_exchange.bml.names import FORM, BmlNames, ConversionFindings, read_names
from rise_exchange.bml.reading import ReadAct, read_act
from rise_exchange.bml.writing import act_file_text, calling_type_setting, write_act

_NOT_IN_NAME = re.compile(r"[^\w-]")
_NOT_IN_FILE_NAME = re.compile(r"[^\w.-]")
_NAMES = click.option(
    "--names",
    "names_file",
    metavar="FILE",
    type=click.Path(),
    help="Read from a TOML file where targets are, and what lexemes of [head], [gesture], [posture] and [face] mean.",
)

# --- to BML ---------------------------------------------------------------------------------------------------------


@click.command("to-bml")
@SCENARIO
@click.option("--act", "acts", metavar="NAME", multiple=True, help="Convert this act. Repeatable. Default: all acts.")
@click.option(
    "-o",
    "--output",
    metavar="FILE|FOLDER",
    type=click.Path(),
    help="Write to a new file, for one act, or to a new folder.",
)
@_NAMES
@STRICT
def to_bml(folder: str, acts: tuple[str, ...], output: str | None, names_file: str | None, strict: bool) -> None:
    """Write acts of the scenario in DIR as blocks of BML 1.0, one per file.

    \b
      rise-engine convert to-bml DIR --act R_Greeting
      rise-engine convert to-bml DIR -o FOLDER --names lab.toml

    It first lists what other programs that read BML will not do of an act, with file, line and column. `from-bml`
    restores all of it. Existing files are never overwritten.

    Exit status: 0; 1 the scenario has errors, or something is lost and --strict; 2 wrong usage; 74 it cannot be
    written.
    """
    scenario = load_scenario(folder)
    if unknown := [name for name in acts if name not in scenario.acts]:
        exit_with_usage(f"--act: {unknown_name_sentence('act', unknown[0], list(scenario.acts))}")
    wanted = list(dict.fromkeys(acts)) or list(scenario.acts)
    if output is None and len(wanted) != 1:
        exit_with_usage(f"a file of BML has one block, and these are {pluralize(len(wanted), 'act')}; add -o FOLDER")
    findings = ConversionFindings()
    names = _read_names_option(names_file, scenario.robot, findings)
    blocks = {
        name: write_act(
            scenario.acts[name],
            scenario.act_settings.get(name, ActSettings()).calling_type,
            scenario.memory,
            names,
            findings,
        )
        for name in wanted
    }
    _print_findings(findings, strict=strict)
    if output is None:
        write_xml(blocks[wanted[0]].rstrip("\n"))
        return
    is_file = len(wanted) == 1 and Path(output).suffix in (".xml", ".bml")
    _save({Path(output) if is_file else Path(output, _file_name(name)): text for name, text in blocks.items()})
    print_lines(f"{output}: {pluralize(len(blocks), 'block')} of BML 1.0")


def _file_name(act: str) -> str:
    return f"{_NOT_IN_FILE_NAME.sub('_', act).lstrip('.')}.bml.xml"


def _save(files: dict[Path, str]) -> None:
    """Write new files, all of them or none. Ends the command if they exist already, or cannot be written."""
    there = [path for path in files if path.exists()]
    if there:
        exit_with_usage(f"there is a file {there[0]} already; name a new one")
    made: list[Path] = []
    try:
        for path, text in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("x", encoding="utf-8", newline="") as file:
                made.append(path)
                file.write(text)
    except OSError as error:
        for path in made:
            path.unlink(missing_ok=True)
        raise not_written(error.filename or path, error) from None


# --- from BML -------------------------------------------------------------------------------------------------------


class _NewAct(Struct, frozen=True):
    """An act to write."""

    read: ReadAct
    origin: str
    """The BML file."""
    name: str
    """The name of its own file, relative to the scenario's folder."""


@click.command("from-bml")
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path())
@click.option(
    "--into",
    "folder",
    metavar="DIR",
    required=True,
    type=click.Path(),
    help="Write into this scenario, or a new folder.",
)
@_NAMES
@STRICT
def from_bml(files: tuple[str, ...], folder: str, names_file: str | None, strict: bool) -> None:
    """Make acts from blocks of BML 1.0, each in a file of its own in the scenario DIR.

    \b
      rise-engine convert from-bml greet.xml --into DIR --names lab.toml

    An act keeps all times exactly, or it is not made: what an act cannot do is refused, with the reason. What else acts
    do not have (marks in sentences, prosody) is listed as lost. You see all of this before anything is written; after
    an error, nothing is.

    Exit status: 0; 1 refused; 2 wrong usage; 74 it cannot be written.
    """
    path = Path(folder)
    is_new = not path.exists()
    if not is_new and not (path.is_dir() and not any(path.iterdir())):
        path = without_file(resolve_scenario(folder), SCENARIO_FILE)
    scenario = sound_scenario(load(path, held={SCENARIO_FILE: b""} if is_new else None))
    findings = ConversionFindings()
    names = _read_names_option(names_file, scenario.robot, findings)
    acts = _read_acts(files, path, scenario, names, findings)
    _print_findings(findings, strict=strict)
    after = _files(path, acts)
    try:
        sound_scenario(load(path, held=after))  # otherwise the act does not fit this scenario
    except Refused as refused:
        raise refused.with_hint("nothing was written") from None
    before = {name: data for name in after if (data := _content(path / name)) is not None}
    try:
        path.mkdir(parents=True, exist_ok=True)
        write_files(path, before, after)
    except OSError as error:
        raise not_written(folder, error) from None
    for act in acts:
        actions = pluralize(len(act.read.act.actions), "action")
        print_lines(f"{path / act.name}: {act.read.act.name}, {actions}, from {act.origin}")


def _read_acts(
    files: tuple[str, ...], folder: Path, scenario: Scenario, names: BmlNames, findings: ConversionFindings
) -> list[_NewAct]:
    """Read the acts of all files. An act or a file that already exists is a diagnostic."""
    known = dict.fromkeys(scenario.acts, "in the scenario")
    acts_path = PurePosixPath(scenario.paths.get("acts") or DEFAULT_PATHS["acts"])
    if (folder / acts_path).exists() and not (folder / acts_path).is_dir():
        exit_with_usage(
            f"the acts of {folder} do not lie in a folder of it ({acts_path}); put the new ones there yourself"
        )
    found: list[_NewAct] = []
    for file in files:
        source = _read_source(file, findings)
        read = read_act(source, names, findings) if source is not None else None
        if read is None:
            continue
        name = read.act.name
        new = (acts_path / f"{_NOT_IN_NAME.sub('_', name)}.xml").as_posix()
        problem = ""
        if name in known:
            problem = f"there is an act `{name}` {known[name]} already"
        elif (folder / new).exists() or any(each.name == new for each in found):
            problem = f"there is a file {new} already"
        known.setdefault(name, f"in {file}")
        if problem:
            findings.diagnostics.error(FORM, read.act.location, f"{problem}; give the block another id")
        else:
            found.append(_NewAct(read, file, new))
    return found


def _files(folder: Path, acts: list[_NewAct]) -> dict[str, bytes]:
    """Return the files of the acts, and scenario.toml with the calling types that differ from the usual one."""
    after = {act.name: act_file_text(act.read.act, Path(act.origin).name).encode() for act in acts}
    settings = "".join(calling_type_setting(act.read.act.name) for act in acts if act.read.calling_type == "None")
    if settings:
        written = _content(folder / SCENARIO_FILE) or b""
        gap = b"" if not written or written.endswith(b"\n") else b"\n"
        after[SCENARIO_FILE] = written + gap + settings.encode()
    return after


def _content(path: Path) -> bytes | None:
    return path.read_bytes() if path.is_file() else None


# --- both -----------------------------------------------------------------------------------------------------------


def _read_source(file: str, findings: ConversionFindings) -> SourceFile | None:
    """Read a file from the command line; None after a diagnostic."""
    return FileReader(Path(), findings.diagnostics).read(Path(file))


def _read_names_option(file: str | None, robot: RobotProfile, findings: ConversionFindings) -> BmlNames:
    """Return the names of `--names`; without it, BML's usual ones and the robot's own."""
    source = _read_source(file, findings) if file is not None else None
    return BmlNames(robot) if source is None else read_names(source, robot, findings.diagnostics)


def _print_findings(findings: ConversionFindings, *, strict: bool) -> None:
    """Report why the conversion is refused and what it loses. Ends the command if it is refused."""
    found = [*findings.diagnostics.sorted(), *findings.losses]
    errors, losses = findings.diagnostics.errors, len(findings.losses)
    lost = f"{pluralize(losses, 'thing')} lost"
    if errors:
        raise Refused(findings=found, hints=[f"{pluralize(errors, 'error')}; nothing was written"])
    if losses and strict:
        raise Refused(findings=found, hints=[f"{lost}, and --strict allows none; nothing was written"])
    print_notes(*found, *[lost] * bool(losses))

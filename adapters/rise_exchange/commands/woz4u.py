"""`rise-engine import woz4u`: a configuration of WoZ4U as a scenario folder."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

import click

from rise_engine.base.errors import ExchangeError, StudyError
from rise_engine.cli.terminal import Refused, exit_with_usage, not_written, print_lines, reason_of
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.study_paths import why_not_read
from rise_engine.scenario.loader import load
from rise_engine.scenario.shipped_studies import write_new_folder
from rise_exchange.woz4u.woz4u_file import read_woz4u
from rise_exchange.woz4u.woz4u_study import ImportedStudy, make_study

_LARGEST = 10_000_000


@click.command("woz4u")
@click.argument("file", metavar="FILE.yaml", type=click.Path())
@click.option(
    "-o", "--output", metavar="DIR", required=True, type=click.Path(), help="Write into this new or empty folder."
)
@click.option("--title", metavar="TEXT", help="Set the study's title. Default: the name of FILE.")
def woz4u(file: str, output: str, title: str | None) -> None:
    """Make a scenario in DIR from a WoZ4U configuration: an act for each button, with a key.

    It lists the key of each button, and what it could not take over. README.md in DIR lists them, too.

    Exit status: 0; 1 the configuration has errors, and nothing was made; 2 wrong usage, or no such file; 74 DIR cannot
    be written.
    """
    path, folder = Path(file), Path(output)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        exit_with_usage(f"{output} is not empty; name a new folder")
    diagnostics = Diagnostics()
    try:
        read = read_woz4u(_read(path), path.name, diagnostics)
    except ExchangeError as error:
        exit_with_usage(str(error))
    if diagnostics.errors:
        raise Refused(findings=diagnostics.sorted())
    pepper = load(folder, held={"scenario.toml": b'robot = "pepper"'}).robot
    study = make_study(title or path.stem, read, pepper, lambda name: _read_text_file(path.parent, name))
    loaded = load(folder, held={name: text.encode() for name, text in study.files.items()})
    if loaded.scenario is None:  # an item's text is not valid
        raise Refused(findings=loaded.errors)
    _write(folder, study)
    print_lines(*study.says, "", "Not imported, or to be checked:", *(f"- {each}" for each in study.omitted))
    print_lines("", f"{output}: check it with rise-engine check {quote(output)}")


def _read(path: Path) -> str:
    """Read the file. :raises ExchangeError: it cannot be read."""
    try:
        if path.stat().st_size > _LARGEST:
            raise ExchangeError(f"{path} is larger than {_LARGEST // 1_000_000} MB")
        return path.read_text("utf-8-sig")
    except OSError as error:
        raise ExchangeError(f"{path} cannot be read: {reason_of(error)}") from None
    except UnicodeDecodeError:
        raise ExchangeError(f"{path} is not UTF-8; save it as that") from None


def _read_text_file(folder: Path, name: str) -> str | None:
    """A text file beside the configuration, never one outside its folder."""
    path = folder / name
    if why_not_read(folder, name) or not path.is_file() or path.stat().st_size > _LARGEST:
        return None
    try:
        return path.read_text("utf-8-sig")
    except (OSError, UnicodeDecodeError):
        return None


def _write(folder: Path, study: ImportedStudy) -> None:
    """Write the whole folder or nothing. Ends the program if it cannot be written."""
    try:
        write_new_folder(folder, study.files)
    except StudyError as error:
        raise Refused(f"{error}; nothing was written") from None
    except OSError as error:
        raise not_written(folder, error) from None

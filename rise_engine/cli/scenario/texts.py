"""`rise-engine texts`: a study's texts as one table for authors and translators (docs/how-to/translate.md)."""

from __future__ import annotations

from pathlib import Path

import click

from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.workspace import Workspace
from rise_engine.author.texts.importing import TextImport, import_table, summary
from rise_engine.author.texts.table import (
    EntryFilter,
    ReadTable,
    TextTable,
    make_table,
    read_csv,
    read_po,
    read_xlsx,
    write_csv,
    write_po,
    write_xlsx,
)
from rise_engine.base.errors import ExchangeError
from rise_engine.base.exit_status import OK, REFUSED, USAGE
from rise_engine.base.text import pluralize
from rise_engine.cli.options import SCENARIO
from rise_engine.cli.scenario.loading import sound_scenario
from rise_engine.cli.terminal import (
    Refused,
    exit_with_usage,
    not_written,
    print_lines,
    print_notes,
    reason_of,
    refusing,
    write_bytes,
)
from rise_engine.scenario.loader import LoadResult, load
from rise_engine.scenario.reading.translations import LanguageTexts
from rise_engine.scenario.speech.languages import language_problem

_KINDS = (".csv", ".xlsx", ".po")
_LARGEST = 50_000_000


def _check_languages(_context: click.Context, _option: click.Parameter, tags: tuple[str, ...]) -> tuple[str, ...]:
    for tag in tags:
        if problem := language_problem(tag):
            raise click.BadParameter(problem)
    return tags


LANGUAGES = click.option(
    "--language",
    "languages",
    metavar="TAG",
    multiple=True,
    callback=_check_languages,
    help="Choose a language, even a new one: de, pt-BR. Repeatable. Default: all languages.",
)


@click.group("texts")
def texts() -> None:
    """Export what a study says as one table, for spreadsheets and translators, and import it again."""


@texts.command("export", short_help="Write every text as one table.")
@SCENARIO
@click.option(
    "-o", "--output", metavar="FILE", type=click.Path(), help="Write a new .csv, .xlsx or .po file. Default: print CSV."
)
@LANGUAGES
@click.option(
    "--only", type=click.Choice(["missing", "stale"]), help="Export only texts with a missing or stale translation."
)
@refusing(USAGE)
def export(folder: str, output: str | None, languages: tuple[str, ...], only: EntryFilter | None) -> None:
    """Write every text of the scenario in DIR as one table, one row per text, with its translations.

    For Excel, choose .xlsx, where every cell is a text. A .po file has one language, for the tools of gettext. `texts
    import` reads the changed table. Existing files are never overwritten.

    Exit status: 0; 1 the scenario has errors; 2 wrong usage; 74 the file cannot be written.
    """
    table = make_table(_load(folder), languages, only)
    data = _write_table(table, Path(output).suffix.lower() if output is not None else ".csv")
    if output is None:
        write_bytes(data.removeprefix(b"\xef\xbb\xbf"))
        return
    try:
        with Path(output).open("xb") as file:
            file.write(data)
    except FileExistsError:
        exit_with_usage(f"there is a file {output} already; name a new one")
    except OSError as error:
        raise not_written(output, error) from None
    print_lines(f"{output}: {pluralize(len(table.rows), 'text')}{_languages_text(table)}")


@texts.command("import", short_help="Import the changes of such a table.")
@SCENARIO
@click.argument("file", metavar="FILE", type=click.Path())
@LANGUAGES
@click.option("--dry-run", is_flag=True, help="Show what would change, and write nothing.")
@click.option("--new", is_flag=True, help="Make an act of each row without an id, named by its cell `act`.")
def import_(folder: str, file: str, languages: tuple[str, ...], dry_run: bool, new: bool) -> int:
    """Import the changes of a table that `texts export` made from the scenario in DIR: texts and translations.

    Rows are found by their id. Their order and other columns do not matter. If a row's text has since changed in the
    study, that row is refused, and all others are imported.

    Exit status: 0; 1 something was refused, or the study would have errors; 2 wrong usage, or no such table.
    """
    with refusing(USAGE, of=ExchangeError, where=file):
        table = _read_table(Path(file), languages)
        with refusing(USAGE, of=EditRefused):
            workspace = Workspace(Path(folder))
        try:
            sound_scenario(workspace.checked)
            if workspace.draft is not None:
                message = "an editor has left changes in this study that are not saved"
                raise EditRefused(f"{message}; open it (rise-tui edit {folder}), and save them or give them up")
            found = import_table(table, workspace.checked, languages, new=new)
            end = _apply(workspace, found, dry_run=dry_run)
        except EditRefused as error:
            raise Refused(f"{error}; nothing was changed") from None
        finally:
            workspace.close()
    print_notes(*found.refused, *found.noticed)
    print_lines(f"{summary(found)}{end}")
    return REFUSED if found.refused else OK


def _apply(workspace: Workspace, found: TextImport, *, dry_run: bool) -> str:
    """Make the edits and save them; return the end of the summary.

    :raises EditRefused: they cannot be made, or saved.
    """
    if not found.edits:
        return ": there is nothing to change"
    change = workspace.apply(*found.edits)
    saved: tuple[str, ...] = ()
    try:
        saved = () if dry_run else workspace.save().files
    finally:
        difference = workspace.diff()
        if not saved:  # leave no draft of it either
            workspace.undo()
    print_lines(*change.says)
    if dry_run:
        print(difference)
        return "; nothing was written (--dry-run)"
    return f": {', '.join(saved)}"


@texts.command("check", short_help="Report texts without a current translation.")
@SCENARIO
@LANGUAGES
def check(folder: str, languages: tuple[str, ...]) -> int:
    """Report which texts of the scenario in DIR are not translated, and which have changed since their translation.

    Exit status: 0 everything is translated; 1 a translation is missing or older than its text; 2 wrong usage.
    """
    loaded = _load(folder)
    known = {tag.lower(): found for tag, found in loaded.translations.items()}
    chosen = [known.get(tag.lower()) or LanguageTexts(tag, "") for tag in languages] or list(known.values())
    if not chosen:
        print_lines(
            f"{pluralize(len(loaded.texts), 'text')}, and no translations (`rise-engine texts export` begins one)"
        )
    status, number = OK, len(loaded.texts) + len(loaded.table_texts)
    for found in chosen:
        cells = [text for text in loaded.table_texts if not text.translation(found.language)]
        uttered, stale = found.missing(loaded.texts), found.stale(loaded.texts)
        missing = len(uttered) + len(cells)
        translated = sum(text.id in found.texts for text in loaded.texts) + len(loaded.table_texts) - len(cells)
        status = REFUSED if missing or stale else status
        more = [f"{len(stale)} changed since"] * bool(stale) + [f"{missing} missing"] * bool(missing)
        print_lines(
            ", ".join([f"{found.language}: {translated} of {number} texts translated", *more]),
            *(f"  missing  {text.id:<24} {text.text}" for text in uttered),
            *(f"  missing  {text.id:<24} {text.text}" for text in cells),
            *(f"  changed  {text.id:<24} {text.text}  (was: {found.texts[text.id].of})" for text in stale),
        )
    return status


def _load(folder: str) -> LoadResult:
    """Load a scenario without errors."""
    loaded = load(folder)
    sound_scenario(loaded)
    return loaded


def _write_table(table: TextTable, kind: str) -> bytes:
    _check_kind(kind)
    return {".csv": write_csv, ".xlsx": write_xlsx, ".po": write_po}[kind](table)


def _read_table(path: Path, languages: tuple[str, ...]) -> ReadTable:
    kind = path.suffix.lower()
    _check_kind(kind)
    try:
        if path.stat().st_size > _LARGEST:
            raise ExchangeError(f"this file is larger than {_LARGEST // 1_000_000} MB")
        data = path.read_bytes()
    except OSError as error:
        raise ExchangeError(f"it cannot be read: {reason_of(error)}") from None
    if kind == ".xlsx":
        return read_xlsx(data)
    return read_csv(data) if kind == ".csv" else read_po(data, languages[0] if len(languages) == 1 else "")


def _check_kind(kind: str) -> None:
    if kind not in _KINDS:
        raise ExchangeError("a table of texts is a .csv, an .xlsx or a .po file")


def _languages_text(table: TextTable) -> str:
    into = f", into {', '.join(table.languages)}" if table.languages else ""
    return f" in {table.language}{into}" if table.language else into

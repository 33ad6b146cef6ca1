"""`rise-tui info`, for a bug report: versions, terminal, paths, sessions. It shows no environment and no names."""

from __future__ import annotations

import locale
import os
import platform
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import click

from rise_engine.run.protocol.registry import RegistryError, ask_all_summaries, runtime_folder
from rise_engine.session.folder import sessions_folder
from rise_tui.cli.command_line import KEYS
from rise_tui.config.display import DisplayOptions, choose_theme, detect_colors
from rise_tui.config.key_file import read_keys
from rise_tui.config.preferences import (
    PREFERENCES_NAME,
    Preferences,
    abbreviate_home,
    config_folder,
    key_file_path,
    load_saved,
    state_folder,
)
from rise_tui.rendering.text import clean, format_age

PACKAGES = ("rise-tui", "textual", "rich", "click", "msgspec", "lxml", "cyclonedds")


@click.command()
@KEYS
def info(keys: str | None) -> None:
    """Print what a bug report needs: versions, terminal, paths, sessions. It contains no secrets."""
    for line in report_lines(keys):
        click.echo(line)


def report_lines(keys: str | None) -> Iterator[str]:
    """The report. `keys`: the key file, as for the console."""
    for title, rows in (
        ("versions", _versions()),
        ("terminal", _terminal()),
        ("paths", _paths()),
        ("keys", _keys(keys)),
        ("sessions", _sessions()),
    ):
        yield title
        for name, value in rows:
            yield f"  {name:<16}{clean(value)}".rstrip()


Rows = Iterator[tuple[str, str]]


def _versions() -> Rows:
    for package in PACKAGES:
        try:
            yield package, version(package)
        except PackageNotFoundError:
            yield package, "not installed"
    yield "python", f"{platform.python_version()} ({platform.python_implementation()})"
    yield "system", platform.platform()


def _terminal() -> Rows:
    environment = os.environ
    for name in ("TERM", "COLORTERM", "TERM_PROGRAM"):
        yield name, environment.get(name) or "not set"
    for name, variable in (("tmux", "TMUX"), ("screen", "STY"), ("ssh", "SSH_CONNECTION"), ("NO_COLOR", "NO_COLOR")):
        yield name, "yes" if environment.get(variable) else "no"
    yield "a terminal", "yes" if sys.stdin.isatty() and sys.stdout.isatty() else "no"
    try:
        columns, rows = os.get_terminal_size(sys.__stdout__.fileno() if sys.__stdout__ is not None else 1)
        yield "size", f"{columns} columns, {rows} rows"
    except (OSError, ValueError):
        yield "size", "unknown: the output is not a terminal"
    found = detect_colors(DisplayOptions(), environment)
    yield "colours", f"{found.system}, because {found.why}"
    yield (
        "theme",
        choose_theme(DisplayOptions(), found, load_saved(state_folder() / PREFERENCES_NAME, Preferences)[0].theme),
    )
    language, encoding = locale.getlocale()
    yield "locale", f"{language or 'C'}, {encoding or 'no encoding'}"
    unicode = (sys.stdout.encoding or "").lower().replace("-", "") == "utf8"
    yield "UTF-8", "yes" if unicode else f"no: {sys.stdout.encoding}"


def _paths() -> Rows:
    for name, path in (
        ("key file", config_folder()),
        ("layout, theme", state_folder()),
        ("records", sessions_folder()),
    ):
        yield name, _path_text(path)
    try:
        yield "sockets", _path_text(runtime_folder())
    except RegistryError as error:
        yield "sockets", f"cannot be used: {error}"


def _path_text(path: Path) -> str:
    state = "" if path.exists() else "  (not there)"
    return f"{abbreviate_home(str(path))}{state}"


def _keys(keys: str | None) -> Rows:
    path = key_file_path(keys)
    if path is None:
        yield "key file", "none: the usual keys"
        return
    found = read_keys(path)
    yield "key file", abbreviate_home(str(path))
    yield "other keys", ", ".join(found.keys) or "none"
    for finding in found.problems:
        yield "wrong", abbreviate_home(str(finding))


def _sessions() -> Rows:
    try:
        found = ask_all_summaries()
    except RegistryError as error:
        yield "none", str(error)
        return
    if not found:
        yield "none", "no session is running"
    for name, summary in found.items():
        if summary is None:
            yield name, "does not answer"
            continue
        facts = [summary.mode.upper(), summary.robot, f"for {format_age(summary.t)}", f"{summary.seq} records"]
        facts += [f"{len(summary.clients)} attached"] + ["stopped"] * summary.stopped
        facts += [f"paused: {summary.trouble}"] if summary.trouble else []
        yield name, ", ".join(facts)

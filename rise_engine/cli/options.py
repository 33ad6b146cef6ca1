"""Arguments and options that several commands share, including those of `rise-tui`."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import click

from rise_engine.base.exit_status import USAGE
from rise_engine.cli.terminal import exit_with_usage, refusing
from rise_engine.ports.bridge import ROS_TRANSPORTS
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, STUDY_FILE
from rise_engine.scenario.shipped_studies import resolve_study, shipped_hint

Command = TypeVar("Command", bound=Callable[..., Any])

# --- arguments --------------------------------------------------------------------------------------------------------


def resolve_scenario(folder: str) -> str:
    """Return the path of a scenario: a folder, its scenario.toml, or a shipped study. Ends the command if none."""
    folder = resolve_study(folder)
    path = Path(folder)
    if is_study(path) and not (path / SCENARIO_FILE).exists():
        exit_with_usage(f"{folder} is a study, not a scenario: its commands are those of `rise-engine study`")
    if path.is_dir() or (path.is_file() and path.name == SCENARIO_FILE):
        return folder
    if path.exists():
        exit_with_usage(f"{folder} is not a scenario: give a folder, or the path of its {SCENARIO_FILE}")
    return exit_with_usage(f"there is no folder {folder}{shipped_hint()}")


def resolve_study_folder(folder: str) -> Path:
    """Return the folder of a study, given as itself or as its study.toml. Ends the command if it is not a study."""
    path = without_file(folder, STUDY_FILE)
    if is_study(path):
        return path
    if path.is_dir():
        problem = f"there is no {STUDY_FILE} in {'this folder' if folder == '.' else folder}"
    else:
        problem = f"there is no folder {folder}"
    return exit_with_usage(f"{problem}; `rise-engine study new DIR` makes a study")


def is_study(path: Path) -> bool:
    """Return whether a folder is a study's."""
    return (path / STUDY_FILE).is_file()


def without_file(named: str | Path, file: str) -> Path:
    """Return the folder, also if a file in it was given."""
    path = Path(named)
    return path.parent if path.name == file else path


def _resolve_session(session: str) -> Path:
    from rise_engine.session.folder import find_session  # rarely needed

    with refusing(USAGE):
        return find_session(session)


def _named_argument(name: str, resolve: Callable[[str], Any], **about: Any) -> Callable[[Command], Command]:
    """Make an argument with a name; the command gets the result of `resolve`.

    `resolve` ends the command before anything else if the name is unknown.
    """

    def add(command: Command) -> Command:
        @wraps(command)
        def resolved(**arguments: Any) -> Any:
            value = arguments[name]
            return command(**{**arguments, name: value if value is None else resolve(value)})

        return cast(Command, click.argument(name, type=click.Path(), **about)(resolved))

    return add


FOLDER_OR_NONE = click.argument("folder", metavar="[DIR]", type=click.Path(), required=False)
SCENARIO = _named_argument("folder", resolve_scenario, metavar="DIR")
SCENARIO_OR_NONE = _named_argument("folder", resolve_scenario, metavar="[DIR]", required=False)
STUDY = _named_argument("study", resolve_study_folder, metavar="STUDY")
STUDY_OR_HERE = _named_argument("study", resolve_study_folder, metavar="STUDY", default=".")
SESSION = _named_argument("session", _resolve_session)
STUDIES_OR_SESSIONS = click.argument("named", metavar="STUDY|SESSION...", type=click.Path(), nargs=-1, required=True)

# --- options of many commands -----------------------------------------------------------------------------------------

ROBOT = click.option("--robot", metavar="NAME", help="Use this robot instead of the scenario's.")
MODE = click.option("--mode", type=click.Choice(["debug", "real"]), help="Use this mode instead of the scenario's.")
JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of lines.")
DIFF = click.option("--diff", "as_diff", is_flag=True, help="Print the changes as diff -u does, and write nothing.")
STRICT = click.option("--strict", is_flag=True, help="Write nothing if anything would be lost.")
LANGUAGE = click.option(
    "--language", metavar="TAG", default="", help="Let the robot speak this language (texts/TAG.toml)."
)
HERE = click.option(
    "--here", is_flag=True, help="Proceed even if another computer had the session last and may still run it."
)
PRIVATE = click.option(
    "--private", metavar="KEY", multiple=True, help="Treat this memory key as private, too. Repeatable."
)
ALL_SESSIONS = click.option(
    "--all", "all_sessions", is_flag=True, help="Include the sessions of a study that do not count or did not end."
)

# --- options of a session ---------------------------------------------------------------------------------------------

SEED = click.option(
    "--seed", type=click.IntRange(min=0), help="Set the seed of all random choices. Default: a new one."
)
SETTINGS = click.option(
    "--set",
    "settings",
    metavar="KEY=JSON",
    multiple=True,
    help="Set a memory value before the session begins. Repeatable.",
)
PLACES = click.option(
    "--place",
    "paths",
    metavar="KIND=PATH",
    multiple=True,
    help="Read acts, rules or memory from another PATH in the scenario's folder (memory=pilot.json). Repeatable.",
)
NEW = click.option("--new", is_flag=True, help="Begin a new session, even if an earlier one did not end.")
RECOVER = click.option("--recover", is_flag=True, help="Continue the latest session that did not end, if there is one.")
ROS = click.option(
    "--ros",
    type=click.Choice(ROS_TRANSPORTS),
    default="auto",
    show_default=True,
    help="Choose how to reach ROS 2. auto: as the robot needs it.",
)
FAULTS = click.option(
    "--fault", "faults", metavar="SPEC", multiple=True, help="Let the simulated robot fail in this way. Repeatable."
)
SESSION_OPTIONS = (
    ROBOT,
    MODE,
    click.option("--participant", metavar="ID", default="", help="Name this participant in the records."),
    click.option(
        "--condition", metavar="NAME", default="", help="Use this condition of the scenario, with its memory values."
    ),
    LANGUAGE,
    click.option(
        "--allow-untranslated",
        is_flag=True,
        help="With --language: say texts without a translation as the acts have them.",
    ),
    ROS,
)
"""Options of a session: `robot`, `mode`, `participant`, `condition`, `language`, `allow_untranslated`, `ros`.

`rise-tui` has the same options.
"""
BEGIN_OPTIONS = (
    SETTINGS,
    click.option("--rule", "rules", metavar="NAME", multiple=True, help="Start an interaction rule. Repeatable."),
    click.option("--act", "acts", metavar="NAME", multiple=True, help="Start an act. Repeatable."),
)
"""Options of a session's beginning: `settings`, `rules`, `acts`."""
STUDY_OPTIONS = (
    click.option(
        "--study",
        metavar="STUDY",
        type=click.Path(),
        help="Run a session of this study instead of DIR, for --participant.",
    ),
    click.option(
        "--run",
        "run_number",
        metavar="N",
        type=click.IntRange(min=1),
        help="Choose one of the participant's runs. Default: the next.",
    ),
)
"""Options for a session of a study: `study`, `run_number`."""
CHECK_OPTIONS = (
    click.option(
        "--confirm",
        "confirmed",
        metavar="ID",
        multiple=True,
        help="Confirm this check of the study. Repeatable.",
    ),
    click.option(
        "--skip-check",
        "skipped",
        metavar="ID=REASON",
        multiple=True,
        help="Skip this check of the study. The record keeps the reason. Repeatable.",
    ),
)
"""Answers to a study's checks: `confirmed`, `skipped`."""


def options(*several: Callable[[Command], Command]) -> Callable[[Command], Command]:
    """Make a decorator that adds these options in this order."""

    def add(command: Command) -> Command:
        for option in reversed(several):
            command = option(command)
        return command

    return add


def number(
    option: str, wanted: str, most: float, *, above: float | None = None, word: str = ""
) -> Callable[[str], float | None]:
    """Make the type of an option that is a number from 0 on, or a word that becomes None.

    :param option: its name.
    :param wanted: the requirement in words.
    :param most: the maximum.
    :param above: the number must be larger than this; None: it may be 0.
    :param word: the word that is allowed instead.
    """

    def parse(text: str) -> float | None:
        if word and text == word:
            return None
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not 0 <= value <= most or (above is not None and value <= above):
            exit_with_usage(f"{option} {text}: this must be {wanted}")
        return value

    return parse

"""Options that several commands have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from rise_engine.ports.bridge import ROS_TRANSPORTS

Command = TypeVar("Command", bound=Callable[..., Any])

FOLDER = click.argument("folder", metavar="DIR", type=click.Path())
FOLDER_OR_NONE = click.argument("folder", metavar="[DIR]", type=click.Path(), required=False)
SESSION = click.argument("session", type=click.Path())
ROBOT = click.option("--robot", metavar="NAME", help="Another robot profile than the scenario's.")
MODE = click.option("--mode", type=click.Choice(["debug", "real"]), help="Another mode than the scenario's.")
JSON = click.option("--json", "as_json", is_flag=True, help="One JSON document instead of lines.")
ROS = click.option(
    "--ros",
    type=click.Choice(ROS_TRANSPORTS),
    default="auto",
    show_default=True,
    help="How ROS 2 is spoken. auto: as the robot needs it.",
)
LANGUAGE = click.option(
    "--language", metavar="TAG", default="", help="What is said is said in this language (texts/TAG.toml)."
)
UNTRANSLATED = click.option(
    "--allow-untranslated", is_flag=True, help="With --language: what is not translated is said as the acts have it."
)
_BEGIN = (
    click.option("--set", "settings", metavar="KEY=JSON", multiple=True, help="Set a memory value first. Repeatable."),
    click.option("--rule", "rules", metavar="NAME", multiple=True, help="Start an interaction rule. Repeatable."),
    click.option("--act", "acts", metavar="NAME", multiple=True, help="Start an act. Repeatable."),
)
_STUDY_OPTIONS = (
    click.option(
        "--study",
        metavar="STUDY",
        type=click.Path(),
        help="A session of this study, in the place of DIR (--participant).",
    ),
    click.option(
        "--run",
        "run_number",
        metavar="N",
        type=click.IntRange(min=1),
        help="Which of the participant's runs; else the next.",
    ),
)
_SESSION_OPTIONS = (
    ROBOT,
    MODE,
    click.option("--participant", metavar="ID", default="", help="Who takes part; stands in the record."),
    click.option(
        "--condition", metavar="NAME", default="", help="One of the scenario's conditions: sets what that says."
    ),
    LANGUAGE,
    UNTRANSLATED,
    ROS,
    click.option(
        "--fault", "faults", metavar="SPEC", multiple=True, help="What the simulated robot does wrong. Repeatable."
    ),
)


def begin_options(command: Command) -> Command:
    """What a session begins with: `settings`, `rules`, `acts`."""
    return _add_options(command, _BEGIN)


def session_options(command: Command) -> Command:
    """How a session runs: `robot`, `mode`, `participant`, `condition`, `language`, `allow_untranslated`, `ros`,
    `faults`."""
    return _add_options(command, _SESSION_OPTIONS)


def study_options(command: Command) -> Command:
    """Which session of a study: `study`, `run_number`."""
    return _add_options(command, _STUDY_OPTIONS)


def _add_options(command: Command, options: tuple[Callable[[Command], Command], ...]) -> Command:
    for option in reversed(options):
        command = option(command)
    return command

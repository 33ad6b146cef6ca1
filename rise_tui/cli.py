"""`rise-tui`: find or start a session, and open a console on it."""

from __future__ import annotations

import gc
import os
import sys
from contextlib import suppress
from getpass import getuser
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rise_engine.bridge import Transport
    from rise_engine.link.client import Client, Role
    from rise_tui.launch import Launcher
    from rise_tui.settings import Settings

REFUSED, USAGE = 1, 2
"""Exit statuses."""


def _wizard() -> str:
    try:
        return getuser()
    except (KeyError, OSError):
        return "wizard"


class _Terminal:
    """Implements `rise_tui.choose.Terminal` on the plain terminal."""

    @property
    def interactive(self) -> bool:
        return sys.stdin.isatty() and sys.stdout.isatty()

    def say(self, line: str) -> None:
        click.echo(line)

    def ask(self, question: str) -> str | None:
        try:
            return str(click.prompt(question, default="", show_default=False, prompt_suffix=" "))
        except click.Abort:
            click.echo("")
            return None


class _Program(click.Command):
    """What stands after `--ros-args` is not for us but for the session's connection to ROS."""

    def main(self, args: Sequence[str] | None = None, *rest: Any, **more: Any) -> Any:
        from rise_engine.arguments import split_ros_args

        ours, theirs = split_ros_args(sys.argv[1:] if args is None else args)
        return super().main(ours, *rest, obj=theirs, **more)


@click.command(cls=_Program, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--config", "folder", metavar="DIR", help="The scenario: a folder, or its scenario.toml.")
@click.option("--robot", metavar="NAME", help="Another robot than the scenario names.")
@click.option("--mode", type=click.Choice(["debug", "real"]), help="Another mode than the scenario's.")
@click.option(
    "--ros",
    type=click.Choice(["auto", "rclpy", "dds", "off"]),
    help="How ROS 2 is spoken; without it, as the robot needs it.",
)
@click.option("--seed", type=click.IntRange(min=0), help="Of the session's chance; without it, a new one each time.")
@click.option("--new", is_flag=True, help="Begin a new session, also when an earlier one did not end.")
@click.option("--recover", is_flag=True, help="Go on with the latest session that did not end, if there is one.")
@click.option("--observe", is_flag=True, help="Only watch: stop everything and add notes, but never take control.")
@click.option("--wizard", metavar="NAME", default=_wizard, help="Who sits at the console; stands in every record.")
@click.option("--theme", type=click.Choice(["dark", "light", "contrast"]), default="dark", show_default=True)
@click.option("--replay", "replay", metavar="SESSION", help="Watch a recorded session: its folder, or its name.")
@click.option("--speed", type=click.FloatRange(0.01, 1000), default=1.0, help="Of a replay; 2 is twice as fast.")
@click.version_option(package_name="rise-tui")
def main(
    folder: str | None,
    robot: str | None,
    mode: str | None,
    ros: Transport | None,
    seed: int | None,
    new: bool,
    recover: bool,
    observe: bool,
    wizard: str,
    theme: str,
    replay: str | None,
    speed: float,
) -> None:
    """Run a study from this terminal.

    With --config a session of that scenario starts in the background, or the one that runs is attached to. Without, the
    running session is attached to; of several you are asked which. A session goes on when its console goes.

    F9 or ctrl+g stops everything, on every screen. ? shows all keys. ctrl+c leaves.
    """
    from rise_engine.bridge import Wire
    from rise_tui.settings import NothingChosenError, Settings

    gc.disable()  # until the console is painted: nothing of what starting makes is garbage
    _check_usage(folder, robot, mode, ros, seed, new, recover, replay, speed)
    who: str = wizard.strip() or "wizard"
    role: Role = "observer" if observe else "wizard"
    try:
        if replay is not None:
            _replay(replay, speed, theme)
        elif folder is None:
            _attach(who, role, theme)
        else:
            settings = Settings(folder, robot, mode, wire=Wire(ros or "auto", click.get_current_context().obj or ()))
            _run(settings, seed, "new" if new else "recover" if recover else "ask", who, role, theme)
    except NothingChosenError as nothing:
        for line in nothing.lines:
            click.echo(line, err=True)
        sys.exit(nothing.code)


def _check_usage(
    folder: str | None,
    robot: str | None,
    mode: str | None,
    ros: str | None,
    seed: int | None,
    new: bool,
    recover: bool,
    replay: str | None,
    speed: float,
) -> None:
    starting = {
        "--robot": robot,
        "--mode": mode,
        "--ros": ros,
        "--seed": seed,
        "--new": new or None,
        "--recover": recover or None,
    }
    given = [name for name, value in starting.items() if value is not None]
    if folder is None and given:
        raise click.UsageError(f"{', '.join(given)} say how a session starts: name its scenario with --config DIR")
    if new and recover:
        raise click.UsageError("say either --new or --recover")
    if folder is not None and replay is not None:
        raise click.UsageError("say either --config or --replay")
    if replay is None and speed != 1.0:
        raise click.UsageError("--speed is for --replay")


def _need_terminal(also: str = "") -> None:
    if not _Terminal().interactive:
        click.echo("the console needs a terminal; `rise-engine run` and `rise-engine serve` need none", err=True)
        if also:
            click.echo(also, err=True)
        sys.exit(USAGE)


def _attach(who: str, role: Role, theme: str) -> None:
    """To a session that runs already."""
    from rise_engine.link.places import PlaceError, abouts
    from rise_tui import choose

    try:
        name = choose.session(abouts(), _Terminal())
    except PlaceError as error:
        _nothing(str(error))
    _need_terminal()
    _open_on(name, None, who, role, theme)


def _run(settings: Settings, seed: int | None, recover: str, who: str, role: Role, theme: str) -> None:
    """A session of a scenario: the one that runs, an earlier one recovered, or a new one."""
    from rise_engine.link.places import PlaceError, running, session_name
    from rise_tui.settings import nothing_in, options, scenario_place

    if problem := nothing_in(settings):
        _refuse([problem], settings.folder)
    name = session_name(scenario_place(settings))
    try:
        if name in running():
            _join(name, settings, recover, who, role, theme)
    except PlaceError as error:
        _nothing(str(error))
    if role == "observer":
        _nothing(f"no session of {settings.folder} is running, and --observe starts none")
    if recover == "ask" and not _Terminal().interactive:
        from rise_engine.session.folder import unfinished
        from rise_tui.choose import WITHOUT_TERMINAL

        _need_terminal(WITHOUT_TERMINAL if unfinished(str(Path(scenario_place(settings)).absolute())) else "")
    _need_terminal()

    from rise_engine.link.spawn import Refused, Starting, start_engine

    wanted = options(settings, seed, recover)
    starting = Starting(wanted)
    # Its process takes as long to come up as the console takes to be imported: both at once.
    _prepare_textual()
    import rise_tui.app  # noqa: F401
    from rise_tui.launch_process import RUNNING

    found = starting.wait()
    if isinstance(found, Refused) and found.unfinished:
        from msgspec.structs import replace

        from rise_tui import choose

        found = start_engine(replace(wanted, unfinished=choose.recovery(found.unfinished, _Terminal())))
    if isinstance(found, Refused) and found.code == RUNNING:  # somebody else has just started it
        _open_on(name, None, who, role, theme)
    if isinstance(found, Refused):
        _refuse(found.lines, settings.folder, found.code)
    _open_on(found.name, settings, who, role, theme, told="; ".join(found.lines))


def _join(name: str, settings: Settings, recover: str, who: str, role: Role, theme: str) -> NoReturn:
    """The session of the scenario that runs already, if it is what was asked for."""
    from rise_engine.link.places import about
    from rise_tui import choose

    choose.same(name, about(name), robot=settings.robot, mode=settings.mode, new=recover == "new")
    _need_terminal()
    _open_on(name, None, who, role, theme)


def _nothing(reason: str) -> NoReturn:
    from rise_tui.settings import NothingChosenError

    raise NothingChosenError(USAGE, reason)


def _prepare_textual() -> None:
    os.environ.setdefault("TEXTUAL_ANIMATIONS", "none")  # read when Textual is imported


def _refuse(lines: list[str], folder: str, code: int = REFUSED) -> NoReturn:
    for line in lines:
        click.echo(line)
    click.echo(f"{folder} was refused: nothing was started", err=True)
    sys.exit(code)


def _open_on(name: str, settings: Settings | None, who: str, role: Role, theme: str, *, told: str = "") -> NoReturn:
    from rise_engine.link.socket_client import SocketClient
    from rise_tui.launch_process import process_launcher

    _open(SocketClient(name, who, role), settings, process_launcher(who, role), who, theme, told)


def _replay(session: str, speed: float, theme: str) -> None:
    from rise_engine.link.replay_client import ReplayClient
    from rise_engine.session.folder import SessionError
    from rise_engine.session.reports import find_session
    from rise_tui.launch_process import process_launcher
    from rise_tui.settings import expanded

    try:
        path = find_session(str(expanded(session)))
    except SessionError as error:
        _nothing(str(error))
    _need_terminal()
    _open(ReplayClient(path, speed), None, process_launcher("wizard", "wizard"), "replay", theme, "")


def _open(client: Client, settings: Settings | None, launcher: Launcher, who: str, theme: str, told: str) -> NoReturn:
    _prepare_textual()
    from rise_tui.app import ConsoleApp

    app = ConsoleApp(None, settings, wizard=who, theme=theme, launcher=launcher, client=client, told=told)
    app.run()
    if app.last_words and not app.terminal_gone:
        with suppress(OSError):  # it may have gone just now
            click.echo(app.last_words, err=True)
    sys.exit(app.return_code or 0)


if __name__ == "__main__":
    main()

"""Finds or starts the session that the command line asks for, and opens a console on it."""

from __future__ import annotations

import gc
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click
from msgspec import Struct
from msgspec.structs import replace

from rise_engine.bridge import Transport, Wire
from rise_engine.exit_status import ALREADY_RUNNING, REFUSED, USAGE
from rise_engine.kernel.inputs import Submit
from rise_tui.start.display import Display, prepare_textual, settled, theme
from rise_tui.start.settings import NothingChosenError, Settings

if TYPE_CHECKING:
    from rise_engine.link.client import Client, Role
    from rise_tui.start.keymap import KeyFile
    from rise_tui.start.launch import Launcher


class Asked(Struct, frozen=True, kw_only=True):
    """What the command line says, by the names of its options."""

    folder: str | None = None
    robot: str | None = None
    mode: str | None = None
    ros: Transport | None = None
    ros_args: tuple[str, ...] = ()
    seed: int | None = None
    participant: str | None = None
    condition: str | None = None
    sets: tuple[str, ...] = ()
    """Memory values to begin with, as they were written: `KEY=JSON`."""
    places: tuple[str, ...] = ()
    """Where acts, rules and memory are read, as it was written: `KIND=PATH`."""
    new: bool = False
    recover: bool = False
    here: bool = False
    session: str | None = None
    observe: bool = False
    wizard: str | None = None
    """None: nobody said; see `who`."""
    replay: str | None = None
    speed: float = 1.0
    display: Display = Display()
    keys: str | None = None
    fresh: bool = False
    web: int | None = None
    in_browser: bool = False
    """This is the console of one browser (`rise_tui.web.seat`)."""

    @property
    def role(self) -> Role:
        return "observer" if self.observe else "wizard"

    @property
    def unfinished(self) -> str:
        """What to do about an earlier session that did not end."""
        return "new" if self.new else "recover" if self.recover else "ask"

    @property
    def begins(self) -> list[str]:
        """The options that were given and mean nothing to a session that runs."""
        return ["--set"] * bool(self.sets) + ["--place"] * bool(self.places)

    @property
    def settings(self) -> Settings:
        from rise_engine.cli.arguments import places_of

        return Settings(
            self.folder or "",
            self.robot,
            self.mode,
            places=places_of(self.places),
            wire=Wire(self.ros or "auto", self.ros_args),
            participant=self.participant or "",
            condition=self.condition or "",
        )


class PlainTerminal:
    """Implements `rise_tui.start.choose.Terminal` on the plain terminal."""

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


def login_name() -> str:
    from getpass import getuser

    try:
        return getuser()
    except (KeyError, OSError):
        return "wizard"


def who(asked: Asked, session: str) -> tuple[str, str]:
    """The name of whoever sits here, and what there is to say about it.

    A wizard who comes back to a session and says no name is who this user's console was before: sessions belong to one
    user of the machine, and whoever held control last is who has lost a console.
    """
    if asked.wizard is not None or asked.observe:
        return asked.wizard or login_name(), ""
    from rise_engine.link.places import PlaceError, about
    from rise_tui.text import clean

    try:
        found = about(session)
    except PlaceError:  # attaching says it
        found = None
    login = login_name()
    if found is None or found.wizard in ("", login):
        return login, ""
    return found.wizard, f"you are {clean(found.wizard)}, as before; if you are not: rise-tui --wizard NAME"


class ProgressLine:
    """How far an engine is that is still coming up: one line of the terminal, which is written over."""

    def __init__(self) -> None:
        self._told = False

    def tell(self, sentence: str) -> None:
        from rise_engine.text import clean

        self._told = True
        click.echo(f"\r\x1b[2K{clean(sentence)}", nl=False)

    def clear(self) -> None:
        if self._told:
            click.echo("\r\x1b[2K", nl=False)


def start(asked: Asked) -> NoReturn:
    """Do what is asked; ends the process with its exit status."""
    try:
        keys = _keys(asked)
        if asked.web is not None:
            _serve(asked)
        asked = replace(asked, display=settled(asked.display, os.environ))
        if asked.replay is not None:
            _replay(asked, keys)
        elif asked.folder is None:
            _attach(asked, keys)
        else:
            _run(asked, keys)
    except NothingChosenError as nothing:
        for line in nothing.lines:
            click.echo(line, err=True)
        sys.exit(nothing.code)


def _nothing(reason: str) -> NoReturn:
    raise NothingChosenError(USAGE, reason)


def _keys(asked: Asked) -> KeyFile | None:
    """The user's key file; None when there is none, which needs nothing imported."""
    from rise_tui.start.paths import key_file

    path = key_file(asked.keys)
    if path is None:
        return None
    from rise_tui.start.keyfile import read_keys
    from rise_tui.start.keymap import refusal

    keys = read_keys(path)
    if keys.findings:
        raise NothingChosenError(USAGE, *map(str, keys.findings), refusal(path))
    return keys


def _need_terminal(also: str = "") -> None:
    if not PlainTerminal().interactive:
        click.echo("the console needs a terminal; `rise-engine run` and `rise-engine serve` need none", err=True)
        if also:
            click.echo(also, err=True)
        sys.exit(USAGE)


def _left_over() -> list[str]:
    from rise_engine.link.leftover import as_lines, left_over  # which reads records: needed only when nothing runs

    return as_lines(left_over({}))


def running_session(asked: Asked) -> str:
    """The name of the running session that is meant. Raises NothingChosenError."""
    from rise_engine.link.elsewhere import everywhere
    from rise_engine.link.places import PlaceError, find, running, session_name
    from rise_tui.start import choose
    from rise_tui.start.settings import scenario_place

    try:
        if asked.session is not None:
            return find(asked.session)
        if asked.folder is None:
            return choose.session(everywhere(), PlainTerminal(), _left_over)
        name = session_name(scenario_place(asked.settings))
        if name in running():
            return name
        if elsewhere := _reached_elsewhere(asked.settings):
            return elsewhere
    except PlaceError as error:
        _nothing(str(error))
    _nothing(f"no session of {asked.folder} is running")


def _reached_elsewhere(settings: Settings) -> str:
    """The socket of the scenario's session when it runs with another runtime folder; empty when none does."""
    from rise_engine.session.folder import running_folders
    from rise_tui.start.settings import scenario_place

    holders = running_folders(str(Path(scenario_place(settings)).absolute())).values()
    return next((holder.socket for holder in holders if holder is not None and holder.is_here), "")


def _serve(asked: Asked) -> NoReturn:
    """Consoles for browsers, until somebody ends this process."""
    gc.enable()  # which starting had done without
    name = running_session(asked)
    try:
        from rise_tui.web.server import WebError, serve
    except ImportError as error:
        _nothing(f"--web needs more than is installed ({error.name}): pip install 'rise-tui[web]'")
    try:
        serve(name, asked)
    except WebError as error:
        _nothing(str(error))
    sys.exit(0)


def _attach(asked: Asked, keys: KeyFile | None) -> NoReturn:
    """To a session that runs already."""
    name = running_session(asked)
    _need_terminal()
    _open_on(name, None, asked, keys)


def _run(asked: Asked, keys: KeyFile | None) -> NoReturn:
    """A session of a scenario: the one that runs, an earlier one recovered, or a new one."""
    from rise_engine.link.places import PlaceError, running, session_name
    from rise_tui.start.settings import nothing_in, options, scenario_place

    settings = asked.settings
    if problem := nothing_in(settings):
        _refuse([problem], settings.folder)
    name = session_name(scenario_place(settings))
    try:
        if name in running():
            _join(name, asked, keys)
    except PlaceError as error:
        _nothing(str(error))
    if asked.observe:
        if elsewhere := _reached_elsewhere(settings):
            _join(elsewhere, asked, keys)
        _nothing(f"no session of {settings.folder} is running, and --observe starts none")
    if asked.unfinished == "ask" and not PlainTerminal().interactive:
        from rise_engine.session.folder import unfinished
        from rise_tui.start.choose import WITHOUT_TERMINAL

        _need_terminal(WITHOUT_TERMINAL if unfinished(str(Path(scenario_place(settings)).absolute())) else "")
    _need_terminal()
    if keys is not None:
        _check_clashes(settings, keys)

    from rise_engine.link.spawn import Refused, Starting, start_engine

    wanted = options(settings, asked.seed, asked.unfinished)
    wanted = replace(wanted, wizard=asked.wizard or login_name(), here=asked.here, first=_first(asked))
    starting = Starting(wanted)
    # Its process takes as long to come up as the console takes to be imported: both at once.
    prepare_textual(asked.display)
    import rise_tui.app  # noqa: F401
    from rise_tui.start.launch import told_of

    progress = ProgressLine()
    found = starting.wait(progress.tell)
    progress.clear()
    if isinstance(found, Refused) and (found.unfinished or found.others):
        from rise_engine.session.folder import whose
        from rise_tui.start import choose

        named = whose(settings.participant, settings.condition)
        chosen = choose.recovery(found.unfinished, PlainTerminal(), found.others, named)
        found = start_engine(replace(wanted, unfinished=chosen), progress.tell)
        progress.clear()
    if isinstance(found, Refused) and found.code == ALREADY_RUNNING and (found.socket or name in running()):
        _join(found.socket or name, asked, keys)  # somebody else has just started it, or elsewhere
    if isinstance(found, Refused):
        _refuse(found.lines, settings.folder, found.code)
    unused = (
        f"; {' and '.join(asked.begins)}: not used, it goes on as it was" if found.recovered and asked.begins else ""
    )
    _open_on(found.name, settings, asked, keys, told=told_of(found) + unused)


def _first(asked: Asked) -> tuple[Submit, ...]:
    """What a new session begins with. Raises NothingChosenError."""
    if not asked.sets:
        return ()
    from rise_engine.cli.arguments import UnusableError, assignments

    try:
        return tuple(
            Submit(function="assignValue", behavior=behavior, source="wizard:command-line")
            for behavior in assignments(asked.sets)
        )
    except UnusableError as error:
        raise NothingChosenError(USAGE, *str(error).splitlines()) from None


def _check_clashes(settings: Settings, keys: KeyFile) -> None:
    """Before an engine is started for a console that would then refuse to open."""
    from rise_tui.start.keymap import refusal
    from rise_tui.start.launch import Refused, prepare

    prepared = prepare(settings)
    if not isinstance(prepared, Refused) and (clashes := keys.clashes(prepared.keys)):
        raise NothingChosenError(USAGE, *map(str, clashes), refusal(keys.path))


def _join(name: str, asked: Asked, keys: KeyFile | None) -> NoReturn:
    """The session of the scenario that runs already, if it is what was asked for."""
    from rise_engine.link.places import about
    from rise_tui.start import choose

    choose.same(
        name,
        about(name),
        new=asked.new,
        robot=asked.robot,
        mode=asked.mode,
        participant=asked.participant,
        condition=asked.condition,
        begins=asked.begins,
    )
    _need_terminal()
    _open_on(name, None, asked, keys)


def _refuse(lines: list[str], folder: str, code: int = REFUSED) -> NoReturn:
    for line in lines:
        click.echo(line)
    click.echo(f"{folder} was refused: nothing was started", err=True)
    sys.exit(code)


def _open_on(name: str, settings: Settings | None, asked: Asked, keys: KeyFile | None, *, told: str = "") -> NoReturn:
    from rise_engine.link.socket_client import SocketClient
    from rise_tui.start.launch_process import process_launcher

    name_here, said = who(asked, name)
    client = SocketClient(name, name_here, asked.role, resync=True)
    if told and said:
        said = said.partition(",")[0]  # a line of 80 cells has no room for more
    told = "; ".join(filter(None, (told, said)))
    _open(client, settings, process_launcher(name_here, asked.role), name_here, asked, keys, told)


def _replay(asked: Asked, keys: KeyFile | None) -> NoReturn:
    from rise_engine.link.replay_client import ReplayClient
    from rise_engine.session.folder import SessionError, find_session
    from rise_tui.start.launch_process import process_launcher
    from rise_tui.start.settings import expanded

    try:
        path = find_session(str(expanded(asked.replay or "")))
    except SessionError as error:
        _nothing(str(error))
    _need_terminal()
    _open(ReplayClient(path, asked.speed), None, process_launcher("wizard", "wizard"), "replay", asked, keys, "")


def _open(
    client: Client,
    settings: Settings | None,
    launcher: Launcher,
    who: str,
    asked: Asked,
    keys: KeyFile | None,
    told: str,
) -> NoReturn:
    found = prepare_textual(asked.display)
    from rise_tui.app import ConsoleApp
    from rise_tui.start.keeper import Keeper
    from rise_tui.start.paths import CONSOLE, state_folder
    from rise_tui.start.preferences import Preferences, load

    kept, said = (Preferences(), "") if asked.fresh else load(state_folder() / CONSOLE, Preferences)
    app = ConsoleApp(
        None,
        settings,
        wizard=who,
        theme=theme(asked.display, found, kept.theme),
        launcher=launcher,
        client=client,
        told=told,
        keys=keys,
        in_browser=asked.in_browser,
        keeper=Keeper(kept, fresh=asked.fresh, said=said, keeps=not asked.observe and asked.replay is None),
    )
    app.run(mouse=asked.display.mouse)
    if app.last_words and not app.terminal_gone:
        with suppress(OSError):  # it may have gone just now
            click.echo(app.last_words, err=True)
    sys.exit(app.return_code or 0)

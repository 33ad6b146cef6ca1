"""Settings: where the scenario is, which robot, which mode. Applying starts a new session."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace
from textual import events, on
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widgets import Button, Input, Label, Static
from textual.worker import Worker

from rise_engine.scenario.model import Scenario
from rise_tui.quiet import QuietModal
from rise_tui.screens.dialog import Answer, Dialog
from rise_tui.start.launch import Launcher, Refused, Shown, robots, shown
from rise_tui.start.settings import Settings, expanded
from rise_tui.widgets.editor import Field

PLACES = ("acts", "rules", "memory")
MODES = ("debug", "real")


class Choice(Horizontal):
    """One of a few words; left, right and space choose."""

    DEFAULT_CSS = """
    Choice {
        height: 1; width: 1fr;
        Button { min-width: 5; margin: 0 1 0 0; background: $surface; color: $rise-muted; }
        Button.-chosen { background: $rise-cursor; color: $foreground; text-style: bold; }
        Button:focus { text-style: bold reverse; }
    }
    """

    def __init__(self, words: tuple[str, ...], chosen: str, *, id: str) -> None:
        super().__init__(id=id)
        self._words = words
        self.value = chosen

    def compose(self) -> ComposeResult:
        for word in self._words:
            yield Button(self._label(word), name=word, compact=True, classes="-chosen" if word == self.value else "")

    def _label(self, word: str) -> str:
        return f"{'●' if word == self.value else '○'} {word}"

    def offer(self, words: Sequence[str], chosen: str) -> None:
        """Other words."""
        if (tuple(words), chosen) != (self._words, self.value):
            self._words, self.value = tuple(words), chosen
            self.refresh(recompose=True)

    @on(Button.Pressed)
    def _chosen(self, event: Button.Pressed) -> None:
        event.stop()
        self.value = event.button.name or ""
        for button in self.query(Button):
            button.label = self._label(button.name or "")
            button.set_class(button.name == self.value, "-chosen")


class SettingsScreen(QuietModal[tuple[Scenario, Settings] | None]):
    """Answers with a scenario that loads, once the wizard has confirmed to start anew with it."""

    DEFAULT_CSS = """
    SettingsScreen {
        align: center middle; background: transparent;
        #box { width: 78; max-width: 100%; height: auto; max-height: 100%; margin: 4 0 1 0; padding: 0 1;
               background: $panel; border: round $primary; border-title-style: bold; }
        .row { height: 1; }
        Label { width: 10; color: $rise-muted; }
        Field, Field:focus { background: $surface; width: 1fr; }
        Field:focus { background: $rise-cursor; }
        #findings { height: auto; max-height: 8; margin: 1 0 0 0; }
        #findings Static { width: auto; }
        #buttons { height: 1; margin: 1 0 0 0; align-horizontal: right; }
        #buttons Button { margin: 0 0 0 2; min-width: 12; }
    }
    """

    def __init__(self, settings: Settings, scenario: Scenario, mode: str, robot: str, launcher: Launcher) -> None:
        super().__init__()
        self._settings, self._scenario, self._launcher = settings, scenario, launcher
        names = robots(settings.folder)
        places = {place: settings.places.get(place) or scenario.paths.get(place, "") for place in PLACES}
        self._first = Shown(names if robot in names else [*names, robot], robot, mode, places)
        """What runs now."""
        self._shown = self._first
        """What the fields said before anybody changed them, for the folder that is in its field."""
        self._read = settings.folder
        """The folder for which the fields were filled in."""
        self._apply_next = False
        self._asked = settings
        self.findings = Static("", markup=False)

    def compose(self) -> ComposeResult:
        box = Vertical(id="box")
        box.border_title = " Settings "
        box.border_subtitle = " applying ends this session and starts a new one · esc leaves "
        with box:
            yield from self._row("folder", Field(self._settings.folder, id="folder", select_on_focus=False))
            for place in PLACES:
                yield from self._row(place, Field(self._first.places[place], id=place, select_on_focus=False))
            yield from self._row("robot", Choice(tuple(self._first.robots), self._first.robot, id="robot"))
            yield from self._row("mode", Choice(MODES, self._first.mode, id="mode"))
            with VerticalScroll(id="findings", can_focus=False):
                yield self.findings
            with Horizontal(id="buttons"):
                yield Button("Leave (esc)", id="leave", compact=True)
                yield Button("Apply", id="apply", compact=True)

    def _row(self, label: str, widget: Field | Choice) -> ComposeResult:
        with Horizontal(classes="row"):
            yield Label(label)
            yield widget

    @property
    def _folder(self) -> str:
        return self.query_one("#folder", Field).value.strip()

    def _is_first(self, folder: str) -> bool:
        return bool(folder) and expanded(folder) == expanded(self._settings.folder)

    def chosen(self) -> Settings:
        """What the fields say: exactly what is shown runs. Places as the scenario has them stay the scenario's."""
        folder = self._folder
        places = {place: self.query_one(f"#{place}", Field).value.strip() for place in PLACES}
        before = self._settings.places if self._is_first(folder) else {}
        places = {
            place: value for place, value in places.items() if value != self._shown.places[place] or place in before
        }
        return replace(
            self._settings,
            folder=str(expanded(folder)),
            robot=self.query_one("#robot", Choice).value,
            mode=self.query_one("#mode", Choice).value,
            places={place: value for place, value in places.items() if value},
        )

    @on(Input.Changed, "#folder")
    def _folder_changed(self) -> None:
        folder = self._folder
        self._apply_next = False
        if folder != self._read:
            self.run_worker(lambda: (folder, self._say(folder)), thread=True, exclusive=True, group="say", name="say")

    def _say(self, folder: str) -> Shown | None:
        return self._first if self._is_first(folder) else shown(folder)

    def _show(self, folder: str, found: Shown | None) -> None:
        """Another scenario has its own places, robot and mode."""
        if folder != self._folder:
            return  # it has changed again
        self._read = folder
        if found is not None:
            self._shown = found
            for place in PLACES:
                self.query_one(f"#{place}", Field).value = found.places[place]
            self.query_one("#robot", Choice).offer(found.robots, found.robot)
            self.query_one("#mode", Choice).offer(MODES, found.mode)
        if self._apply_next:
            self._apply()

    @on(Input.Submitted)
    def _entered(self, event: Input.Submitted) -> None:
        event.stop()
        self.query_one("#apply", Button).focus()

    @on(Button.Pressed, "#leave")
    def _leave(self) -> None:
        self.dismiss(None)

    @on(Button.Pressed, "#apply")
    def _apply(self) -> None:
        folder = self._folder
        if not folder:
            self.findings.update("refused; nothing has changed:\nname a folder")
            return
        self._apply_next = folder != self._read  # then it is being read: first shown, then applied
        self.findings.update("reading …")
        if not self._apply_next:
            settings = self._asked = self.chosen()
            self.run_worker(lambda: self._launcher.prepare(settings), thread=True, exclusive=True, name="prepare")

    def on_worker_state_changed(self, event: Worker.StateChanged) -> None:
        if event.worker.name not in ("prepare", "say") or not event.worker.is_finished:
            return
        event.stop()
        result = event.worker.result
        if isinstance(result, tuple):
            self._show(*result)
        elif isinstance(result, Refused):
            self.findings.update("\n".join(["refused; nothing has changed:", *result.lines]))
        elif isinstance(result, Scenario):
            self.findings.update("")
            self._confirm(result, self._asked)

    def _confirm(self, scenario: Scenario, settings: Settings) -> None:
        said = [
            "The running session is stopped and ended, and a new one starts:",
            f"{scenario.title} · {scenario.mode.upper()} · robot {scenario.robot.title or scenario.robot.name}",
        ]
        dialog = Dialog("Start a new session?", said, Answer("s", "Start anew"))

        def answered(yes: str | None) -> None:
            if yes:
                self.dismiss((scenario, settings))

        self.app.push_screen(dialog, answered)

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            event.stop()
            self.dismiss(None)
        elif event.key in ("up", "down"):
            event.stop()
            self.focus_next() if event.key == "down" else self.focus_previous()
        elif event.key in ("left", "right") and isinstance(self.focused, Button):
            event.stop()
            self.focus_next() if event.key == "right" else self.focus_previous()

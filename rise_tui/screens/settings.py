"""Settings (F8): where the scenario is, which robot, which mode. Applying starts a new session."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widgets import Button, Input, Label, Static
from textual.worker import Worker

from rise_engine.scenario.model import Scenario
from rise_tui.launch import Launcher, Refused, Settings, robots
from rise_tui.quiet import QuietModal
from rise_tui.screens.dialog import Dialog
from rise_tui.widgets.editor import Field

PLACES = ("acts", "rules", "memory")


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
        self._mode, self._robot = mode, robot
        self.findings = Static("", markup=False)

    def compose(self) -> ComposeResult:
        names = robots(self._settings.folder)
        if self._robot not in names:
            names.append(self._robot)
        box = Vertical(id="box")
        box.border_title = " Settings "
        box.border_subtitle = " applying ends this session and starts a new one · esc leaves "
        with box:
            yield from self._row("folder", Field(self._settings.folder, id="folder", select_on_focus=False))
            for place in PLACES:
                value = self._settings.places.get(place) or self._scenario.paths.get(place, "")
                yield from self._row(place, Field(value, id=place, select_on_focus=False))
            yield from self._row("robot", Choice(tuple(names), self._robot, id="robot"))
            yield from self._row("mode", Choice(("debug", "real"), self._mode, id="mode"))
            with VerticalScroll(id="findings", can_focus=False):
                yield self.findings
            with Horizontal(id="buttons"):
                yield Button("Leave (esc)", id="leave", compact=True)
                yield Button("Apply", id="apply", compact=True)

    def _row(self, label: str, widget: Field | Choice) -> ComposeResult:
        with Horizontal(classes="row"):
            yield Label(label)
            yield widget

    def chosen(self) -> Settings:
        """What the fields say; what is as the scenario has it stays the scenario's."""
        folder = self.query_one("#folder", Field).value.strip()
        places = {place: self.query_one(f"#{place}", Field).value.strip() for place in PLACES}
        same = Path(folder).expanduser() == Path(self._settings.folder).expanduser()
        if not same:  # another scenario has its own places and its own robot, unless they were changed here
            places = {place: value for place, value in places.items() if value != self._scenario.paths.get(place)}
        robot = self.query_one("#robot", Choice).value
        return replace(
            self._settings,
            folder=str(Path(folder).expanduser()),
            robot=robot if same or robot != self._robot else None,
            mode=self.query_one("#mode", Choice).value,
            places={place: value for place, value in places.items() if value},
        )

    @on(Input.Submitted)
    def _entered(self, event: Input.Submitted) -> None:
        event.stop()
        self.query_one("#apply", Button).focus()

    @on(Button.Pressed, "#leave")
    def _leave(self) -> None:
        self.dismiss(None)

    @on(Button.Pressed, "#apply")
    def _apply(self) -> None:
        settings = self.chosen()
        self.findings.update("reading …")
        self.run_worker(lambda: self._launcher.prepare(settings), thread=True, exclusive=True, name="prepare")

    def on_worker_state_changed(self, event: Worker.StateChanged) -> None:
        if event.worker.name != "prepare" or not event.worker.is_finished:
            return
        event.stop()
        prepared = event.worker.result
        if isinstance(prepared, Refused):
            self.findings.update("\n".join(["refused; nothing has changed:", *prepared.lines]))
        elif isinstance(prepared, Scenario):
            self.findings.update("")
            self._confirm(prepared, self.chosen())

    def _confirm(self, scenario: Scenario, settings: Settings) -> None:
        said = [
            "The running session is stopped and ended, and a new one starts:",
            f"{scenario.title} · {scenario.mode.upper()} · robot {scenario.robot.title or scenario.robot.name}",
        ]
        dialog = Dialog("Start a new session?", said, yes="Start anew", key="s")

        def answered(yes: bool | None) -> None:
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

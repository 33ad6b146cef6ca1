"""Settings: scenario, robot, mode and participant. Only applying has an effect: a new session."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import ClassVar

from msgspec.structs import replace
from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, VerticalScroll
from textual.widgets import Button, Input, Static

from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.protocol.session_start import start_problems
from rise_engine.scenario.model import Condition, Scenario
from rise_engine.scenario.reading.conditions import condition_label, condition_sentence
from rise_tui.config.launch import Launcher, ScenarioProblems, ScenarioSummary, list_robots, read_summary
from rise_tui.config.preferences import expand_home
from rise_tui.model.status import participant_text
from rise_tui.model.store import Store
from rise_tui.rendering.text import clean
from rise_tui.screens.dialog import FormDialog, TitledBox
from rise_tui.screens.session_forms import end_session_dialog
from rise_tui.widgets.fields import ChoiceField, TextField

PATH_KINDS = ("acts", "rules", "memory")
MODES = ("debug", "real")


def condition_labels(conditions: Mapping[str, Condition]) -> dict[str, str]:
    """The labels for the choice of a condition, by name; the first is none."""
    none = "none" if conditions else "none: scenario.toml has no [conditions.NAME]"
    return {"": none} | {name: condition.label or name for name, condition in conditions.items()}


class SettingsScreen(FormDialog[tuple[Scenario, SessionOptions] | None]):
    """The result: a valid scenario, after the wizard has confirmed a new session with it."""

    DEFAULT_CSS = """
    SettingsScreen {
        #box { width: 78; max-width: 100%; max-height: 100%; margin: 1 0 1 0; }
        #report { height: auto; max-height: 9; margin: 1 0 0 0; }
        #report Static { width: 100%; height: auto; }
        #buttons { height: 1; margin: 1 0 0 0; align-horizontal: right; }
        #buttons Button { margin: 0 0 0 2; min-width: 12; }
    }
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "dismiss(None)", show=False),
        Binding("left,up", "app.focus_previous", show=False),
        Binding("right,down", "app.focus_next", show=False),
    ]

    def __init__(self, settings: SessionOptions, store: Store, launcher: Launcher) -> None:
        super().__init__()
        scenario, mode, robot = store.attach_reply.scenario, store.attach_reply.mode, store.attach_reply.robot
        self._settings, self._store, self._launcher = settings, store, launcher
        names = list_robots(settings.folder)
        paths = {kind: settings.paths.get(kind) or scenario.paths.get(kind, "") for kind in PATH_KINDS}
        robots = names if robot in names else [*names, robot]
        self._current = ScenarioSummary(robots, robot, mode, paths, store.scenario.conditions)
        """The present session."""
        self._in_file = self._current
        """The first values of the fields, for the folder in its field."""
        self._folder_read = settings.folder
        """The folder whose values fill the fields."""
        self._apply_next = False
        self.changes, self.findings = Static("", markup=False), Static("", markup=False)

    def compose(self) -> ComposeResult:
        with TitledBox("Settings", "tab: next · ← →: choose · esc cancel"):
            yield from self.row("folder", TextField(self._settings.folder, id="folder", select_on_focus=False))
            for kind in PATH_KINDS:
                yield from self.row(kind, TextField(self._current.paths[kind], id=kind, select_on_focus=False))
            yield from self.row("robot", ChoiceField(tuple(self._current.robots), self._current.robot, id="robot"))
            yield from self.row("mode", ChoiceField(MODES, self._current.mode, id="mode"))
            # These two begin empty: the values of the last session would be wrong in a new one.
            hint = "the next participant; may be empty"
            yield from self.row("participant", TextField(placeholder=hint, id="participant", select_on_focus=False))
            labels = condition_labels(self._current.conditions)
            yield from self.row("condition", ChoiceField(tuple(labels), "", id="condition", labels=labels))
            with VerticalScroll(id="report", can_focus=False):
                yield self.changes
                yield self.findings
            with Horizontal(id="buttons"):
                yield Button("Cancel (esc)", id="leave", compact=True)
                yield Button("Apply", id="apply", compact=True)

    def on_mount(self) -> None:
        self._show_changes()

    @on(Input.Changed)
    @on(ChoiceField.Changed)
    def _show_changes(self) -> None:
        """Show the effect of applying, until it is applied."""
        chosen = self.chosen_options()
        lines = [f"  {what}: {before or '-'} → {after or '-'}" for what, before, after in self._differences(chosen)]
        of = participant_text(self._store)
        ends = f"Applying ends the session{f' of {of}' if of else ''} and starts a new one"
        begins = f"for {self._participant_text(chosen)}; its memory begins with the start values"
        condition = self._in_file.conditions.get(chosen.condition)
        begins += "." if condition is None else f", and the condition {clean(condition_sentence(condition))}."
        head = "No changes yet." if not lines else "Not applied yet:"
        self.changes.update("\n".join([head, *lines, f"{ends} {begins}"]))

    def _participant_text(self, chosen: SessionOptions) -> str:
        conditions = self._in_file.conditions
        condition = condition_labels(conditions).get(chosen.condition, "") if chosen.condition else ""
        return clean(" · ".join(filter(None, (chosen.participant, condition))) or "nobody named")

    def _differences(self, chosen: SessionOptions) -> list[tuple[str, str, str]]:
        """The chosen differences from now: name, now, then."""
        pairs = [("folder", self._settings.folder, self._folder)]
        if self._is_running_folder(self._folder):
            pairs = []
        fields = {kind: self.query_one(f"#{kind}", TextField).value.strip() for kind in PATH_KINDS}
        pairs += [(kind, self._current.paths[kind], fields[kind]) for kind in PATH_KINDS]
        pairs += [("robot", self._current.robot, chosen.robot or ""), ("mode", self._current.mode, chosen.mode or "")]
        return [(what, clean(before), clean(after)) for what, before, after in pairs if before != after]

    @property
    def _folder(self) -> str:
        return self.query_one("#folder", TextField).value.strip()

    def _is_running_folder(self, folder: str) -> bool:
        return bool(folder) and expand_home(folder) == expand_home(self._settings.folder)

    def chosen_options(self) -> SessionOptions:
        """The options from the fields: exactly the shown ones run. The scenario's own paths stay the scenario's."""
        folder = self._folder
        paths = {kind: self.query_one(f"#{kind}", TextField).value.strip() for kind in PATH_KINDS}
        before = self._settings.paths if self._is_running_folder(folder) else {}
        paths = {kind: value for kind, value in paths.items() if value != self._in_file.paths[kind] or kind in before}
        return replace(
            self._settings,
            folder=str(expand_home(folder)),
            robot=self.query_one("#robot", ChoiceField).value,
            mode=self.query_one("#mode", ChoiceField).value,
            paths={kind: value for kind, value in paths.items() if value},
            participant=self.query_one("#participant", TextField).value.strip(),
            condition=self.query_one("#condition", ChoiceField).value,
            seed=None,
        )

    @on(Input.Changed, "#folder")
    def _folder_changed(self) -> None:
        self._apply_next = False
        if self._folder != self._folder_read:
            self._fill_fields(self._folder)

    @work(exclusive=True, group="fields")
    async def _fill_fields(self, folder: str) -> None:
        """Fill the fields with another scenario's paths, robot and mode."""
        running = self._is_running_folder(folder)
        found = self._current if running else await asyncio.to_thread(read_summary, folder)
        if folder != self._folder:
            return  # it has changed again
        self._folder_read = folder
        if found is not None:
            self._in_file = found
            for kind in PATH_KINDS:
                self.query_one(f"#{kind}", TextField).value = found.paths[kind]
            self.query_one("#robot", ChoiceField).set_words(found.robots, found.robot)
            self.query_one("#mode", ChoiceField).set_words(MODES, found.mode)
            labels = condition_labels(found.conditions)
            self.query_one("#condition", ChoiceField).set_words(tuple(labels), "", labels)
        if self._apply_next:
            self._apply()

    @on(Input.Submitted)
    def _focus_apply(self, event: Input.Submitted) -> None:
        event.stop()
        self.query_one("#apply", Button).focus()

    @on(Button.Pressed, "#leave")
    def _dismiss_unchanged(self) -> None:
        self.dismiss(None)

    @on(Button.Pressed, "#apply")
    def _apply(self) -> None:
        folder = self._folder
        if not folder:
            self.findings.update("refused; nothing has changed:\nenter a folder")
            return
        self._apply_next = folder != self._folder_read  # it is being read: show it, then apply it
        self.findings.update("reading …")
        if not self._apply_next:
            self._load(self.chosen_options())

    @work(exclusive=True, group="load")
    async def _load(self, settings: SessionOptions) -> None:
        """Show what is wrong with the scenario, or ask for confirmation."""
        found = await asyncio.to_thread(self._launcher.load_scenario, settings)
        if isinstance(found, ScenarioProblems):
            self.findings.update("\n".join(["refused; nothing has changed:", *found.lines]))
        elif problems := start_problems(found, settings):
            self.findings.update(clean("\n".join(["refused; nothing has changed:", *problems])))
        else:
            self.findings.update("")
            self._confirm(found, settings)

    def _confirm(self, scenario: Scenario, settings: SessionOptions) -> None:
        condition = condition_label(scenario, settings.condition)
        who = " · ".join(filter(None, (settings.participant, condition))) or "nobody named"
        robot = scenario.robot.title or scenario.robot.name
        then = f"Then a new one starts for {who}: {scenario.title} · {scenario.mode.upper()} · robot {robot}"
        question = end_session_dialog(self._store, clean(then))

        def dismiss_if_confirmed(yes: bool | None) -> None:
            if yes:
                self.dismiss((scenario, settings))

        self.app.push_screen(question, dismiss_if_confirmed)

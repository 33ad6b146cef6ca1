"""A page of the editor without its frame, on a study in memory that takes any edit it is given."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from textual.app import ComposeResult
from textual.pilot import Pilot
from textual.widget import Widget

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.outline import Outline
from rise_engine.scenario.diagnostics import Diagnostic
from rise_tui.actions import bindings_in
from rise_tui.editor.model.study_names import StudyNames
from rise_tui.editor.rule_editor import RuleEditor
from rise_tui.rendering import themes
from rise_tui.rendering.terminal_app import TerminalApp
from tests.tui.editor.small_study import FILES, outline_of, small_study


class StudyInMemory:
    """Notes the edits; `refusal`: what is answered to them."""

    def __init__(self, files: Mapping[str, bytes] = FILES, findings: Sequence[Diagnostic] = ()) -> None:
        self.files, self.findings = dict(files), list(findings)
        self.edits: list[tuple[AnyEdit, ...]] = []
        self.refusal = ""
        self.said: list[str] = []

    @property
    def draft(self) -> StudyInMemory:
        return self

    @property
    def outline(self) -> Outline:
        return outline_of(self.files)

    @property
    def names(self) -> StudyNames:
        return small_study(self.files)

    def make(self, *edits: AnyEdit, then: Callable[[], None] | None = None) -> None:
        if edits and self.refusal:
            self.said.append(self.refusal)
            return
        if edits:
            self.edits.append(edits)
        if then is not None:
            then()

    def preview(self, edits: Callable[[], tuple[AnyEdit, ...]], say: Callable[..., None]) -> None:
        """Nothing is ever wrong in memory."""


class PageApp(TerminalApp):
    """Shows one page, and nothing around it but the keys of the editor."""

    CSS = themes.CSS
    BINDINGS = bindings_in("edit")

    def __init__(self, page: Widget) -> None:
        super().__init__()
        self._page = page

    def get_theme_variable_defaults(self) -> dict[str, str]:
        return themes.DARK.variables

    def compose(self) -> ComposeResult:
        yield self._page

    async def show(self, page: Widget) -> None:
        """Another page instead of the one before."""
        before, self._page = self._page, page
        await before.remove()
        await self.mount(page)

    def action_do(self, action: str) -> None:
        """What the frame does with an action of the editor."""
        page = self._page
        if isinstance(page, RuleEditor) and not page.is_typing:
            if action == "edit.other":
                (page.parts if page.graph.has_focus else page.graph).focus()
            elif (call := page.calls.get(action)) is not None:
                call()

    def on_mount(self) -> None:
        for known in themes.THEMES:
            self.register_theme(known)
        self.theme = themes.full_name(themes.DEFAULT)


async def settle(pilot: Pilot[Any]) -> None:
    """Until what a key asked for has been done."""
    await pilot.pause()
    await pilot.app.workers.wait_for_complete()
    await pilot.pause()

"""The list of what is wrong: enter goes there, tab shows what can be done about it, or how a session comes to it."""

from __future__ import annotations

from collections.abc import Sequence

from textual import on
from textual.app import App

from rise_engine.author.edit.remedies import Remedy
from rise_engine.base.text import clean
from rise_engine.scenario.diagnostics import Diagnostic
from rise_tui.editor.chooser import Chooser
from rise_tui.editor.model.explored import ExploredPlace, explored_rows, find_explored
from rise_tui.editor.model.fields import FieldChoice
from rise_tui.editor.model.study_rows import find_at
from rise_tui.editor.page import EditFrame
from rise_tui.screens.detail import DetailScreen
from rise_tui.widgets.row_list import RowView

_MEND = "mend "
"""Before the number of a finding about which something is to be done."""

_TITLE_WIDTH = 70
"""Characters of a finding that stand over what can be done about it, at 80 columns."""


class FindingChooser(Chooser):
    """One of the findings. The result is its number, with `_MEND` before it for what can be done about it, or how a
    session comes to it."""

    def __init__(self, title: str, choices: Sequence[FieldChoice], tab: Sequence[str], *, now: str = "") -> None:
        """`tab`: what that key leads to, for each of them; empty: nowhere."""
        super().__init__(title, choices, now=now)
        self._tab = dict(zip((choice.value for choice in choices), tab, strict=True))
        self._keys = self._keys_line("")

    def draw(self) -> None:
        super().draw()
        self._show_keys()

    @on(RowView.CursorMoved)
    def _show_keys(self) -> None:
        self.query_one("#box").border_subtitle = f" {self._keys_line(self._tab.get(self.list.current_id, ''))} "

    def _keys_line(self, tab: str) -> str:
        return " · ".join(["type to filter", "enter goes there", *([f"tab {tab}"] if tab else []), "esc closes"])

    def carry_out_key(self, key: str) -> bool:
        if key != "tab":
            return super().carry_out_key(key)
        if self._tab.get(self.list.current_id):
            self.dismiss(_MEND + self.list.current_id)
        return True


class RemedyChooser(Chooser):
    """One of the remedies of a finding, which are sentences."""

    def _title_width(self, width: int) -> int:
        return max(10, width - 4)


def choose_finding(frame: EditFrame, app: App[object], *, now: str = "") -> None:
    """Show all that is wrong. The page of the one that is chosen opens, or what can be done about it.

    `now`: on which of them the cursor begins.
    """
    draft, explored = frame.study.draft, frame.explored
    findings = draft.findings
    if not findings and not explored.findings:
        frame.say("nothing is wrong: no errors and no warnings")
        return

    def take(chosen: str | None) -> None:
        if chosen is None:
            return
        number, asks_more = int(chosen.removeprefix(_MEND)), chosen.startswith(_MEND)
        if number >= len(findings):
            finding = explored.findings[number - len(findings)]
            if asks_more:
                _show_way(frame, app, finding, str(number))
            else:
                _go_to_explored(frame, finding)
        elif asks_more:
            app.run_worker(_show_remedies(frame, app, findings[number]))
        else:
            _go_to(frame, findings[number])

    word = explored.word(draft)
    choices = [_choice(number, each) for number, each in enumerate(findings)]
    choices += [_explored_choice(number, each, word) for number, each in enumerate(explored.findings, len(findings))]
    tab = ["what can be done"] * len(findings)
    tab += ["step by step" if each.way else "" for each in explored.findings]
    title = " · ".join(filter(None, ("What is wrong", explored.seen(draft))))
    app.push_screen(FindingChooser(title, choices, tab, now=now), take)


def _choice(number: int, finding: Diagnostic) -> FieldChoice:
    mark = "✗" if finding.severity == "error" else "▲"
    where = f"{mark} {finding.location.file}:{finding.location.line}"
    return FieldChoice(str(number), where, clean(finding.message))


def _explored_choice(number: int, finding: ExploredPlace, word: str) -> FieldChoice:
    where = f"{finding.mark} {finding.file}:{finding.line}" if finding.file else finding.mark
    return FieldChoice(str(number), where, f"{word}: {clean(finding.text)}")


def _go_to_explored(frame: EditFrame, finding: ExploredPlace) -> None:
    found = find_explored(frame.study.draft, finding)
    if found is None:
        frame.say(clean(finding.text), "wait")
    else:
        frame.open_page(*found)


def _show_way(frame: EditFrame, app: App[object], finding: ExploredPlace, now: str) -> None:
    """How a session comes to what was found; then the list again, at the same place."""
    title = f"{frame.explored.word(frame.study.draft)}: {finding.file}:{finding.line}"
    way = DetailScreen(title, lambda width: explored_rows(finding, width))
    app.push_screen(way, lambda _: choose_finding(frame, app, now=now))


def _go_to(frame: EditFrame, finding: Diagnostic) -> None:
    found = find_at(frame.study.draft, finding.location.file, finding.location.line)
    if found is None:
        frame.say(clean(str(finding)), "wait")
    else:
        frame.open_page(*found)


async def _show_remedies(frame: EditFrame, app: App[object], finding: Diagnostic) -> None:
    found = await frame.study.remedies(finding)
    if not found:
        frame.say(f"only you can say what is right here: {clean(finding.message)}", "wait")
        return

    def take(chosen: str | None) -> None:
        if chosen is not None:
            frame.make(found[int(chosen)].edit)

    choices = [_remedy_choice(number, each) for number, each in enumerate(found)]
    app.push_screen(RemedyChooser(_title_of(finding), choices), take)


def _title_of(finding: Diagnostic) -> str:
    text = clean(finding.message)
    return text if len(text) <= _TITLE_WIDTH else f"{text[: _TITLE_WIDTH - 1]}…"


def _remedy_choice(number: int, remedy: Remedy) -> FieldChoice:
    return FieldChoice(str(number), clean(remedy.title), "")

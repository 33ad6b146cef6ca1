"""The list of what is wrong: enter goes there, tab shows what can be done about it."""

from __future__ import annotations

from collections.abc import Sequence

from textual.app import App

from rise_engine.edit.remedies import Remedy
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.text import clean
from rise_tui.editing.chooser import Chooser
from rise_tui.editing.model.explored import ExploredPlace
from rise_tui.editing.model.fields import FieldChoice
from rise_tui.editing.model.study_rows import find_at
from rise_tui.editing.page import EditFrame

_MEND = "mend "
"""Before the number of a finding about which something is to be done."""

_TITLE_WIDTH = 70
"""Characters of a finding that stand over what can be done about it, at 80 columns."""


class FindingChooser(Chooser):
    """One of the findings. The result is its number, with `_MEND` before it for what can be done about it."""

    def __init__(self, choices: Sequence[FieldChoice]) -> None:
        super().__init__("What is wrong", choices)
        self._keys = "type to filter · enter goes there · tab what can be done, or how it comes · esc closes"

    def carry_out_key(self, key: str) -> bool:
        if key != "tab":
            return super().carry_out_key(key)
        if self.list.current_id:
            self.dismiss(_MEND + self.list.current_id)
        return True


class WayList(Chooser):
    """How a session comes to what exploring has found, a sentence for each step. There is nothing to choose."""

    def __init__(self, title: str, steps: Sequence[FieldChoice]) -> None:
        super().__init__(title, steps)
        self._keys = "the way there, step by step · esc closes"

    def _title_width(self, width: int) -> int:
        return max(10, width - 4)


class RemedyChooser(Chooser):
    """One of the remedies of a finding, which are sentences."""

    def _title_width(self, width: int) -> int:
        return max(10, width - 4)


def choose_finding(frame: EditFrame, app: App[object]) -> None:
    """Show all that is wrong. The page of the one that is chosen opens, or what can be done about it."""
    findings, explored = frame.study.draft.findings, frame.explored.findings
    if not findings and not explored:
        frame.say("nothing is wrong: no errors and no warnings")
        return

    def take(chosen: str | None) -> None:
        if chosen is None:
            return
        number = int(chosen.removeprefix(_MEND))
        if number >= len(findings):
            _open_explored(frame, app, explored[number - len(findings)], show_way=chosen.startswith(_MEND))
            return
        finding = findings[number]
        if chosen.startswith(_MEND):
            app.run_worker(_show_remedies(frame, app, finding))
        else:
            _go_to(frame, finding)

    choices = [_choice(number, each) for number, each in enumerate(findings)]
    choices += [_explored_choice(number, each) for number, each in enumerate(explored, len(findings))]
    app.push_screen(FindingChooser(choices), take)


def _choice(number: int, finding: Diagnostic) -> FieldChoice:
    mark = "✗" if finding.severity == "error" else "▲"
    where = f"{mark} {finding.location.file}:{finding.location.line}"
    return FieldChoice(str(number), where, clean(finding.message))


def _explored_choice(number: int, finding: ExploredPlace) -> FieldChoice:
    where = f"{finding.mark} {finding.file}:{finding.line}" if finding.file else finding.mark
    return FieldChoice(str(number), where, f"explored: {clean(finding.text)}")


def _open_explored(frame: EditFrame, app: App[object], finding: ExploredPlace, *, show_way: bool) -> None:
    """Go to what exploring has found something about, or show the way there."""
    if show_way and finding.way:
        steps = [FieldChoice(str(at), f"{at}. {clean(step)}", "") for at, step in enumerate(finding.way, 1)]
        app.push_screen(WayList(clean(finding.text)[:_TITLE_WIDTH], steps))
        return
    found = find_at(frame.study.draft, finding.file, finding.line) if finding.file else None
    if found is None or show_way:
        frame.say(clean(finding.text), "wait")
    else:
        frame.open_page(*found)


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
    message = clean(finding.message)
    return message if len(message) <= _TITLE_WIDTH else f"{message[: _TITLE_WIDTH - 1]}…"


def _remedy_choice(number: int, remedy: Remedy) -> FieldChoice:
    return FieldChoice(str(number), clean(remedy.title), "")

"""The list of everything that is wrong: enter goes there, tab shows the remedies, or the steps that lead there."""

from __future__ import annotations

from textual.app import App

from rise_engine.base.text import clean
from rise_engine.scenario.diagnostics import Diagnostic
from rise_tui.editor.model.explored import ExploredPlace, explored_rows, find_explored
from rise_tui.editor.model.fields import FieldChoice
from rise_tui.editor.model.study_rows import find_at
from rise_tui.editor.page import EditFrame
from rise_tui.editor.pick_list import Picked, PickList
from rise_tui.rendering.text import shorten
from rise_tui.screens.detail import DetailScreen

_TITLE_WIDTH = 70
"""Characters of a finding in the title of its remedies, at 80 columns."""


def choose_finding(frame: EditFrame, app: App[object], *, now: str = "") -> None:
    """List everything that is wrong. The page of the chosen one opens, or its remedies.

    :param now: the number of the one on which the cursor begins.
    """
    draft, explored = frame.study.draft, frame.explored
    findings = draft.findings
    if not findings and not explored.findings:
        frame.say("nothing is wrong: no errors and no warnings")
        return

    def take(picked: Picked | None) -> None:
        if picked is None:
            return
        number = int(picked.value)
        if number >= len(findings):
            finding = explored.findings[number - len(findings)]
            if picked.is_tab:
                _show_steps(frame, app, finding, picked.value)
            else:
                _go_to(frame, find_explored(draft, finding), finding.text)
        elif picked.is_tab:
            _show_remedies(frame, app, findings[number])
        else:
            where = findings[number].location
            _go_to(frame, find_at(draft, where.file, where.line), str(findings[number]))

    word = explored.word(draft)
    choices = [_choice(number, each) for number, each in enumerate(findings)]
    choices += [_explored_choice(number, each, word) for number, each in enumerate(explored.findings, len(findings))]
    tab = ["what can be done"] * len(findings)
    tab += ["step by step" if each.way else "" for each in explored.findings]
    title = " · ".join(filter(None, ("What is wrong", explored.seen(draft))))
    keys = {choice.value: word for choice, word in zip(choices, tab, strict=True)}
    app.push_screen(PickList(title, choices, now=now, enter="goes there", tab=keys), take)


def _choice(number: int, finding: Diagnostic) -> FieldChoice:
    mark = "✗" if finding.severity == "error" else "▲"
    where = f"{mark} {finding.location.file}:{finding.location.line}"
    return FieldChoice(str(number), where, clean(finding.message))


def _explored_choice(number: int, finding: ExploredPlace, word: str) -> FieldChoice:
    where = f"{finding.mark} {finding.file}:{finding.line}" if finding.file else finding.mark
    return FieldChoice(str(number), where, f"{word}: {clean(finding.text)}")


def _go_to(frame: EditFrame, page: tuple[str, str] | None, text: str) -> None:
    """Open the page of a finding; without one, say its text."""
    if page is None:
        frame.say(clean(text), "wait")
    else:
        frame.open_page(*page)


def _show_steps(frame: EditFrame, app: App[object], finding: ExploredPlace, now: str) -> None:
    """Show the steps of a session that lead to a finding; then the list again, at the same place."""
    title = f"{frame.explored.word(frame.study.draft)}: {finding.file}:{finding.line}"
    steps = DetailScreen(title, lambda width: explored_rows(finding, width))
    app.push_screen(steps, lambda _: choose_finding(frame, app, now=now))


def _show_remedies(frame: EditFrame, app: App[object], finding: Diagnostic) -> None:
    found = frame.study.remedies(finding)
    text = clean(finding.message)
    if not found:
        frame.say(f"only you can say what is right here: {text}", "wait")
        return

    def take(picked: Picked | None) -> None:
        if picked is not None:
            frame.make(found[int(picked.value)].edit)

    choices = [FieldChoice(str(number), clean(each.title)) for number, each in enumerate(found)]
    app.push_screen(PickList(shorten(text, _TITLE_WIDTH), choices), take)

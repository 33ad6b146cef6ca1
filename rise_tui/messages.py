"""Requests of panes to the screen that contains them."""

from __future__ import annotations

from dataclasses import dataclass

from textual.message import Message

from rise_tui.model.control import KeyAction


@dataclass
class SubmitTask(Message):
    """Send a task to the engine immediately."""

    function: str
    behavior: str


@dataclass
class RequestStart(Message):
    """Start something by Enter on a row or by a click, as carefully as by a key of the scenario."""

    action: KeyAction


@dataclass
class RunAction(Message):
    """Carry out an action of the registry, because a hint was clicked."""

    action: str


@dataclass
class FocusPane(Message):
    """Bring a pane to the front, because its tab was clicked."""

    pane: str


@dataclass
class ShowNotice(Message):
    """Show the wizard a notice."""

    text: str


@dataclass
class ShowSelection(Message):
    """Show another act or rule in its pane, because the wizard has selected it."""

    pane: str
    name: str


@dataclass
class AskToStart(Message):
    """Ask whether to start a rule in one of its states, and show what that would do."""

    rule: str
    state: str


@dataclass
class AskToStepBack(Message):
    """Ask whether a rule should go back one step."""

    rule: str

"""What panes ask of the screen that holds them."""

from __future__ import annotations

from dataclasses import dataclass

from textual.message import Message

from rise_tui.model.key_action import KeyAction


@dataclass
class SubmitTask(Message):
    """Give a task to the engine, at once."""

    function: str
    behavior: str


@dataclass
class RequestStart(Message):
    """Start something, by Enter on a row or a click: with the same care as by a key of the scenario."""

    action: KeyAction


@dataclass
class RunAction(Message):
    """Carry out an action of the registry: a hint was clicked."""

    action: str


@dataclass
class FocusPane(Message):
    """Bring a pane to the front: its tab was clicked."""

    pane: str


@dataclass
class ShowNotice(Message):
    """Tell the wizard something."""

    text: str


@dataclass
class ShowSelection(Message):
    """Show another act or rule in its pane: the wizard has selected it."""

    pane: str
    name: str


@dataclass
class AskToStart(Message):
    """Ask whether a rule is to start in one of its states, and with what that would do."""

    rule: str
    state: str


@dataclass
class AskToStepBack(Message):
    """Ask whether a rule is to go a step back."""

    rule: str

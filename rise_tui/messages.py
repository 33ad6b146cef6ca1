"""What panes ask of the screen that holds them."""

from __future__ import annotations

from textual.message import Message

from rise_tui.model.key_action import KeyAction


class SubmitTask(Message):
    """A task for the engine, at once."""

    def __init__(self, function: str, behavior: str) -> None:
        super().__init__()
        self.function = function
        self.behavior = behavior


class RequestStart(Message):
    """A start by Enter on a row: subject to the same care as a key of the scenario."""

    def __init__(self, action: KeyAction) -> None:
        super().__init__()
        self.action = action


class RunAction(Message):
    """A hint was clicked."""

    def __init__(self, action: str) -> None:
        super().__init__()
        self.action = action


class FocusPane(Message):
    """A tab was clicked."""

    def __init__(self, pane: str) -> None:
        super().__init__()
        self.pane = pane


class ShowNotice(Message):
    """Something to say to the wizard."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.text = text


class ShowSelection(Message):
    """The wizard selected another act or rule."""

    def __init__(self, pane: str, name: str) -> None:
        super().__init__()
        self.pane = pane
        self.name = name

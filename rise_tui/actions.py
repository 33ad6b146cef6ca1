"""The one home of every action (law 6): bindings, hints, help and palette are all made from this table."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Literal, TypeAlias

from msgspec import Struct
from textual.binding import Binding

from rise_tui.store import Store

Place: TypeAlias = Literal["everywhere", "console", "acts", "rules", "memory", "act", "rule", "scheduler", "log"]
"""Where an action's keys work: on every screen, on the console, or while that pane has the focus."""

PLACES: tuple[tuple[Place, str], ...] = (
    ("everywhere", "Always"),
    ("console", "Console"),
    ("acts", "Acts"),
    ("rules", "Rules"),
    ("memory", "Memory"),
    ("act", "Act"),
    ("rule", "Rule"),
    ("scheduler", "Scheduler"),
    ("log", "Task log"),
)

KEY_LABELS = {
    "question_mark": "?",
    "slash": "/",
    "colon": ":",
    "delete": "del",
    "insert": "ins",
    "escape": "esc",
    "backspace": "bksp",
    "shift+up": "⇧↑",
    "shift+down": "⇧↓",
    "full_stop": ".",
    "comma": ",",
    "space": "space",
}

SWALLOWED = frozenset(
    {"ctrl+h", "ctrl+i", "ctrl+m", "ctrl+left_square_bracket", "ctrl+space", "ctrl+at"}
    | {f"ctrl+{digit}" for digit in range(10)}
    | {f"alt+{digit}" for digit in range(10)}
    | {"ctrl+enter", "shift+enter", "alt+enter", "ctrl+a", "ctrl+b", "ctrl+s", "ctrl+z", "ctrl+q", "f1", "f10", "f11"}
)
"""Keys that terminals, multiplexers or editors take or confuse; nothing here may be bound to one."""


def available(store: Store) -> str:
    return ""


class Action(Struct, frozen=True):
    """Something that the wizard can do with the console."""

    id: str
    title: str
    keys: tuple[str, ...]
    """In Textual's spelling; the first is the one that is shown."""
    place: Place
    help: str
    hint: str = ""
    """One or two words for the hint line; empty: not shown there."""
    unavailable: Callable[[Store], str] = available
    """Why it cannot be used now, or empty."""

    @property
    def key_label(self) -> str:
        return key_label(self.keys[0]) if self.keys else ""

    @property
    def all_keys(self) -> str:
        return "  ".join(key_label(key) for key in self.keys)


def key_label(key: str) -> str:
    """A key as it is printed: `F9`, `^G`, `?`."""
    if key in KEY_LABELS:
        return KEY_LABELS[key]
    if key.startswith("ctrl+"):
        return f"^{key[5:].upper()}"
    return key.upper() if key.startswith("f") and key[1:].isdigit() else key


def _stoppable(store: Store) -> str:
    """Stopping needs no control, and is tried even when the connection is cut."""
    return store.gone and store.unavailable()


def _acting(store: Store) -> str:
    return store.cannot_act()


def _telling(store: Store) -> str:
    return store.cannot_tell()


def _controllable(store: Store) -> str:
    """Any wizard can do something about control; an observer never."""
    return store.cannot_tell() or ("this console only watches (--observe)" if store.hello.role == "observer" else "")


def _live(store: Store) -> str:
    return store.cannot_start()


def _releasable(store: Store) -> str:
    return store.cannot_act() or ("" if store.state == "STOPPED" else "nothing is stopped")


def _some(what: str, found: Callable[[Store], object]) -> Callable[[Store], str]:
    return lambda store: store.cannot_act() or ("" if found(store) else what)


_memory = _some("the memory is empty", lambda store: store.view.memory)
_queue = _some("nothing runs or waits", lambda store: store.view.running or store.view.waiting)
_waiting = _some("fewer than two tasks wait", lambda store: len(store.view.waiting) > 1)
_acts = _some("no act runs or waits", lambda store: store.view.running or store.view.waiting)
_rules = _some("no rule runs", lambda store: store.view.stack())

ACTIONS: tuple[Action, ...] = (
    Action("stop", "Stop everything", ("f9", "ctrl+g"), "everywhere",
           "Stops the robot, all acts and all rules at once, without asking, and stays stopped until it is released.",
           "STOP", _stoppable),
    Action("quit", "Leave", ("ctrl+c",), "everywhere",
           "Asks first: detach, and the session goes on without this console; or end it, and the robot is stopped."),
    Action("control", "Control: take, ask, give", ("f8", "ctrl+y"), "console",
           "Who of several consoles may act: take control, ask for it, give it to who asks, or release it.",
           "control", _controllable),
    Action("note", "Add a note", ("ctrl+o",), "console",
           "A remark for the record, with the time and your name. Those who only watch can add notes too.",
           "note", _telling),
    Action("palette", "Command palette", ("colon", "ctrl+p"), "console",
           "Find any command, act or rule by name.", "command"),
    Action("help", "Help and keys", ("question_mark",), "console",
           "Every key, and what it does. Type to search.", "help"),
    Action("lists", "Acts / rules", ("f2", "ctrl+l"), "console",
           "Goes to the list of acts; pressed again, to the list of rules.", "lists"),
    Action("next-pane", "Next pane", ("f3", "tab"), "console",
           "Goes through memory, act, rule, scheduler and log.", "pane"),
    Action("zoom", "Zoom", ("f4", "ctrl+j"), "console",
           "Gives the focused list or pane the whole screen; again: back.", "zoom"),
    Action("filter", "Filter", ("slash",), "console",
           "Shows only rows with this text, in the focused list. Esc clears it.", "find"),
    Action("settings", "Settings", (), "console",
           "Paths, robot and mode. Applying them ends this session and starts a new one, after asking.", "", _acting),
    Action("release", "Release the stop", ("ctrl+r",), "console",
           "After a stop: shows who confirmed it and who did not, and asks before anything can start again.",
           "release", _releasable),
    Action("theme", "Next theme", (), "console", "Dark, light, high contrast."),
    Action("acts.start", "Start the act", ("enter",), "acts", "Starts the selected act.", "start", _live),
    Action("acts.stop", "Stop the act", ("delete", "backspace"), "acts",
           "Stops the selected act, running or waiting.", "stop", _acts),
    Action("rules.start", "Start the rule", ("enter",), "rules", "Starts the selected rule.", "start", _live),
    Action("rules.stop", "Stop the rule", ("delete", "backspace"), "rules",
           "Stops the selected rule; acts that it started go on.", "stop", _rules),
    Action("memory.edit", "Change the value", ("enter",), "memory",
           "Edits the selected value in its place. The type is detected while you type: JSON has its own type, "
           "anything else is a string; \"5\" in quotes is a string too.", "edit", _memory),
    Action("memory.add", "Add a key", ("insert",), "memory",
           "Adds a key; right after a deletion it offers what was deleted.", "add", _acting),
    Action("memory.delete", "Delete the key", ("delete", "backspace"), "memory",
           "Deletes the selected key; `add` brings it back.", "delete", _memory),
    Action("rule.raise", "Raise the event", ("enter",), "rule",
           "Raises the event that the selected transition waits for.", "raise event", _live),
    Action("scheduler.cancel", "Cancel the task", ("delete", "backspace"), "scheduler",
           "Cancels the selected task, running or waiting.", "cancel", _queue),
    Action("scheduler.earlier", "Move the task earlier", ("shift+up",), "scheduler",
           "Moves the selected waiting task one place towards the front.", "earlier", _waiting),
    Action("scheduler.later", "Move the task later", ("shift+down",), "scheduler",
           "Moves the selected waiting task one place towards the end.", "later", _waiting),
    Action("log.follow", "Follow the newest task", ("end",), "log",
           "Goes to the end and stays there. Scrolling up pauses; the title counts what is new.", "follow"),
)  # fmt: skip

BY_ID = {action.id: action for action in ACTIONS}


def at(place: Place) -> Iterator[Action]:
    return (action for action in ACTIONS if action.place == place)


def bindings(place: Place) -> list[Binding | tuple[str, str] | tuple[str, str, str]]:
    """The key bindings of one place, as Textual takes them; each has its action's id, so that it can be remapped."""
    return [
        Binding(",".join(action.keys), f"do('{action.id}')", action.title, id=action.id, priority=place == "everywhere")
        for action in at(place)
        if action.keys
    ]

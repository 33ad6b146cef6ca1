"""The table of all console actions (console.md 6.1). Bindings, hints, help and palette are all made from it.

`key_labels` puts keys and reasons into words.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Literal, TypeAlias

from msgspec import Struct
from textual.binding import Binding

from rise_engine.kernel.records import stopper_words
from rise_engine.kernel.speech import why_not_speak
from rise_engine.kernel.wizard_marks import filler_acts
from rise_tui.model.control import BlockedReason, Intent
from rise_tui.model.store import Store

KeyScope: TypeAlias = Literal[
    "everywhere", "console", "acts", "rules", "memory", "act", "rule", "scheduler", "log", "study", "edit"
]
"""Where an action's keys work: on every screen, on the console, in one focused pane or list, on the screen of a study
(no session runs), or in the editor (no key starts anything)."""

KEY_SCOPES: tuple[tuple[KeyScope, str], ...] = (
    ("everywhere", "Always"),
    ("console", "Console"),
    ("acts", "Acts"),
    ("rules", "Rules"),
    ("memory", "Memory"),
    ("act", "Act"),
    ("rule", "Rule"),
    ("scheduler", "Scheduler"),
    ("log", "Task log"),
    ("study", "Screen of a study"),
    ("edit", "Editor"),
)

SHADOW_REASON = "this is the shadow of a finished session"
Obstacle: TypeAlias = BlockedReason | str | None
"""What blocks an action: a reason of the model, a sentence, or nothing (None or empty)."""


def never_blocked(store: Store) -> Obstacle:
    return None


class ConsoleAction(Struct, frozen=True):
    """An action of the wizard on the console."""

    id: str
    title: str
    keys: tuple[str, ...]
    """In Textual's spelling. Screens show the first."""
    scope: KeyScope
    help: str
    hint: str = ""
    """One or two words for the hint line; empty: not shown there."""
    obstacle: Callable[[Store], Obstacle] = never_blocked
    """Why the action cannot be used now. `key_labels.why_unavailable` makes the sentence."""


# Obstacles, named by what an action needs.


def _stoppable(store: Store) -> Obstacle:
    """Stopping needs no control, and is tried even when the connection is cut."""
    return store.blocked_reason("reach") if store.gone_reason else None


def _cancellable(store: Store) -> Obstacle:
    """Asking the robot again to stop needs no control either."""
    return store.blocked_reason("reach") or (None if store.open_goals else "the robot has finished everything")


def _own_console(store: Store) -> Obstacle:
    """Blocks actions that concern only this console and have no meaning in a replay."""
    return _stoppable(store) or ("this is a replay" if store.attach_reply.replay else None)


def _logged(store: Store) -> Obstacle:
    return None if store.log.all else "there is no row yet"


def _blocks(
    intent: Intent, find: Callable[[Store], object] = lambda store: True, missing: str = ""
) -> Callable[[Store], Obstacle]:
    """Make an obstacle: what blocks this intent, or the sentence `missing` if `find` finds nothing."""
    return lambda store: store.blocked_reason(intent) or (None if find(store) else missing)


_change, _remark, _start = _blocks("change"), _blocks("remark"), _blocks("start")
_controllable = _blocks(
    "remark", lambda store: store.attach_reply.role != "observer", "this console only watches (--observe)"
)
_fillable = _blocks("start", lambda store: filler_acts(store.scenario), "this scenario has no filler")
_markable = _blocks("remark", lambda store: store.view.tasks, "nothing has been started yet")
_cue_open = _blocks(
    "change", lambda store: store.view.cue is not None and store.view.cue.answered is None, "no cue is open"
)
_failed = _blocks("change", lambda store: store.view.failed or store.view.questions, "no act has failed")
_asked = _blocks("change", lambda store: store.view.questions, "the study is not asking about a failed act")
_savable_values = _blocks("change", lambda store: store.scenario.folder, "this session's scenario has no folder")
_memory = _blocks("change", lambda store: store.view.memory, "the memory is empty")
_queue = _blocks("change", lambda store: store.view.running or store.view.waiting, "nothing is running or waiting")
_running = _blocks("change", lambda store: store.view.running, "no act is running")
_waiting = _blocks("change", lambda store: len(store.view.waiting) > 1, "fewer than two tasks wait")
_acts = _blocks("change", lambda store: store.view.running or store.view.waiting, "no act is running or waiting")
_undo = _blocks("change", lambda store: store.undo_stack, "nothing to undo")
_rules = _blocks("change", lambda store: store.view.running_rules(), "no rule is running")


def _releasable(store: Store) -> Obstacle:
    """An emergency stop is released where it was pressed."""
    if blocked := store.blocked_reason("change"):
        return blocked
    if store.key_state != "STOPPED":
        return None if store.open_goals else "nothing is stopped or held"
    held_by = store.view.stop.held_by
    return f"{stopper_words(held_by[0])} has not been let go" if held_by else None


def _shadowed(store: Store) -> Obstacle:
    return None if store.attach_reply.shadow else "this is not a shadow of a session (rise-tui --shadow)"


def _configurable(store: Store) -> Obstacle:
    if store.attach_reply.shadow:
        return SHADOW_REASON
    of_study = "the study decides what runs; start the next session on its screen"
    return _change(store) or (of_study if store.is_of_study else None)


def _taking_over(store: Store) -> Obstacle:
    return SHADOW_REASON if store.attach_reply.shadow else _change(store)


def _start_values(store: Store) -> Obstacle:
    return SHADOW_REASON if store.attach_reply.shadow else _savable_values(store)


def _between_sessions(store: Store) -> Obstacle:
    """Actions of a study's screen have no meaning in a session."""
    return "this works on the screen of a study, between two sessions"


def _in_editor(store: Store) -> Obstacle:
    """Actions that change a study's files have no meaning while a session runs."""
    return "this works in the editor (command `Edit this study`)"


def _editable(store: Store) -> Obstacle:
    """Blocks editing in a shadow, in a replay and in a scenario without a folder."""
    if store.attach_reply.shadow:
        return SHADOW_REASON
    return _own_console(store) or (None if store.scenario.folder else "the scenario has no folder")


def _sayable(store: Store) -> Obstacle:
    return _change(store) or why_not_speak(store.scenario)


def _repeatable(store: Store) -> Obstacle:
    return _failed(store) or _start(store)


def _steppable(store: Store) -> Obstacle:
    return _rules(store) or _start(store)


def _passable(store: Store) -> Obstacle:
    """Going on needs the right to start, because waiting rules then continue."""
    return _failed(store) or (_start(store) if store.view.questions else None)


ACTIONS: tuple[ConsoleAction, ...] = (
    ConsoleAction("stop", "Stop everything", ("f9", "ctrl+g"), "everywhere",
           "Stops the robot, all acts and all rules at once, without asking. Nothing starts until it is released.",
           "STOP", _stoppable),
    ConsoleAction("stop-running", "Stop what runs now", ("backspace",), "console",
           "Stops the act that began last, or what is being said; the next press stops the one before it. Rules and "
           "waiting acts go on.", "stop", _running),
    ConsoleAction("quit", "Leave", ("ctrl+c",), "everywhere",
           "Asks first: detach, and the session goes on without this console; or end it, and the robot stops. "
           "When the engine has gone: start it again and continue the session."),
    ConsoleAction("cue", "Mark the participant's cue", ("space",), "console",
           "Marks the end of the participant's turn. The time from here to the next act is counted and recorded.",
           "cue", _change),
    ConsoleAction("undo-cue", "Take back the cue", ("underscore",), "console",
           "The participant is still speaking: the last cue does not count.", "", _cue_open),
    ConsoleAction("filler", "Say the next filler", ("comma",), "console",
           "Starts the next of the scenario's fillers, in turn, to bridge the time until you have an answer.",
           "filler", _fillable),
    ConsoleAction("say", "Say something", ("ctrl+t",), "console",
           "A line in which you type what the robot says, with a preview. Enter queues it.", "say", _sayable),
    ConsoleAction("mistake", "Mark a mistake", ("exclamation_mark",), "console",
           "Marks what you did last, whatever it was, as wrong, late, early or double. Only the record changes.",
           "mistake", _markable),
    ConsoleAction("repeat", "Repeat the failed act", ("ctrl+e",), "console",
           "When an act has failed: starts the whole act again. The red bar shows what was not said.", "", _repeatable),
    ConsoleAction("go-on", "Go on without the failed act", ("ctrl+k",), "console",
           "Closes the red bar: you have seen that the act failed, and go on. If the study asks about it, its rules "
           "learn that the act has failed.", "", _passable),
    ConsoleAction("stop-rule", "Stop the failed act's rule", (), "console",
           "When the study asks about a failed act: stops the rule that started it.", "",
           _asked),
    ConsoleAction("safe", "LIVE or SAFE", ("ctrl+x",), "console",
           "SAFE: look around without starting anything from this console. Again: LIVE, keys start acts and rules.",
           "safe", _own_console),
    ConsoleAction("lock", "Lock the keys", ("f7", "ctrl+underscore"), "everywhere",
           "LOCKED: every key is ignored except stopping, leaving and this one. Again: SAFE.",
           "lock", _own_console),
    ConsoleAction("control", "Control: take, ask, give", ("f8", "ctrl+y"), "console",
           "Decides which of several consoles may act: take control, ask for it, give it away or release it.",
           "control", _controllable),
    ConsoleAction("pause", "Shadow: pause or resume", (), "console",
           "While the cues of a recorded session are played to you (rise-tui --shadow): pauses or resumes it. "
           "The key for control does the same then.", "", _shadowed),
    ConsoleAction("note", "Add a note", ("ctrl+o",), "console",
           "A remark for the record, with the time and your name. Those who only watch can add notes too.",
           "note", _remark),
    ConsoleAction("palette", "Command palette", ("colon",), "console",
           "Find any command, act or rule by name.", "command"),
    ConsoleAction("help", "Help and keys", ("question_mark",), "console",
           "Every key, and what it does. Type to search.", "help"),
    ConsoleAction("lists", "Acts / rules", ("f2", "ctrl+l"), "console",
           "Goes to the list of acts; pressed again, to the list of rules.", "lists"),
    ConsoleAction("next-pane", "Next pane", ("f3", "tab"), "console",
           "Goes through rule, act, memory, log and scheduler.", "pane"),
    ConsoleAction("previous-pane", "Previous pane", ("shift+tab",), "console",
           "Goes through the panes the other way round."),
    ConsoleAction("jump", "Jump", ("ctrl+d",), "console",
           "Shows a letter on every list, pane and tab; that letter goes there.", "jump"),
    ConsoleAction("zoom", "Zoom", ("f4", "ctrl+j"), "console",
           "Gives the focused list or pane the whole screen. Pressed again, it goes back.", "zoom"),
    ConsoleAction("filter", "Filter", ("slash",), "console",
           "Shows only rows with this text, in the focused list. Esc clears it.", "find"),
    ConsoleAction("settings", "Settings", (), "console",
           "Paths, robot and mode. Applying them ends this session and starts a new one, after asking.", "",
           _configurable),
    ConsoleAction("take-over", "Use changed files", (), "console",
           "The session goes on with the files of its study as they are saved now. This works while the robot does "
           "nothing and the present states of the rules still exist. It is recorded.", "",
           _taking_over),
    ConsoleAction("cancel-open", "Stop what still runs", ("ctrl+w",), "console",
           "When the robot may still be doing an action that has ended: asks it once more to stop.", "",
           _cancellable),
    ConsoleAction("release", "Release the stop, or a part", ("ctrl+r",), "console",
           "After a stop: shows who confirmed it and who did not, and asks before anything can start again. When a "
           "part of the robot is held: asks whether it may be used again.",
           "release", _releasable),
    ConsoleAction("theme", "Choose a theme", (), "console",
           "Shows each theme while you move over it; esc keeps the one you had."),
    ConsoleAction("edit-study", "Edit this study", (), "console",
           "Opens the editor of acts, rules, memory and keys. A running session does not change: what is saved "
           "applies to the next one.", "", _editable),
    ConsoleAction("tour", "Tour of the console", (), "console",
           "The console in five steps. The session goes on meanwhile, and the stop key works.", "", _own_console),
    ConsoleAction("redraw", "Redraw the screen", (), "console",
           "For when another program has written over the console."),
    ConsoleAction("acts.start", "Start the act", ("enter",), "acts",
           "Shows what the selected act would say or do; enter again starts it.", "start", _start),
    ConsoleAction("acts.stop", "Stop the act", ("delete",), "acts",
           "Stops the selected act, running or waiting.", "stop", _acts),
    ConsoleAction("rules.start", "Start the rule", ("enter",), "rules",
           "Shows what the selected rule would do first; enter again starts it.", "start", _start),
    ConsoleAction("rules.stop", "Stop the rule", ("delete",), "rules",
           "Stops the selected rule; acts that it started go on.", "stop", _rules),
    ConsoleAction("memory.edit", "Change the value", ("enter",), "memory",
           "Edits the selected value in its place. The type is detected while you type: JSON has its own type, "
           "anything else is a string; \"5\" in quotes is a string too.", "edit", _memory),
    ConsoleAction("memory.add", "Add a key", ("insert",), "memory",
           "Adds a key; right after a deletion it offers what was deleted.", "add", _change),
    ConsoleAction("memory.delete", "Delete the key", ("delete",), "memory",
           "Deletes the selected key, or the selected part of a value; undo brings it back.", "delete", _memory),
    ConsoleAction("memory.undo", "Undo the last change", ("ctrl+u",), "memory",
           "Takes back the last change of the memory by this console, then the one before it. When somebody else has "
           "changed the value since, it asks first.", "undo", _undo),
    ConsoleAction("memory.unfold", "Unfold, or show in full", ("right",), "memory",
           "Shows the parts of an object or an array as rows of their own; any other value in full.", "unfold"),
    ConsoleAction("memory.fold", "Fold", ("left",), "memory", "Puts the parts of an object or an array away again."),
    ConsoleAction("memory.save", "Save as start values", (), "memory",
           "Writes the memory as it is now into the scenario's memory file, after asking. Later sessions begin with "
           "it.", "", _start_values),
    ConsoleAction("rule.raise", "Raise the event", ("enter",), "rule",
           "Raises the event that the selected transition waits for. On a state below: asks whether to start the "
           "rule there.", "raise event", _start),
    ConsoleAction("rule.back", "One step back", ("left",), "rule",
           "Asks whether the rule shown should go back to its previous state, and which memory changes since then to "
           "take back.", "step back", _steppable),
    ConsoleAction("scheduler.cancel", "Cancel the task", ("delete",), "scheduler",
           "Cancels the selected task, running or waiting.", "cancel", _queue),
    ConsoleAction("scheduler.earlier", "Move the task earlier", ("shift+up",), "scheduler",
           "Moves the selected waiting task one place towards the front.", "earlier", _waiting),
    ConsoleAction("scheduler.later", "Move the task later", ("shift+down",), "scheduler",
           "Moves the selected waiting task one place towards the end.", "later", _waiting),
    ConsoleAction("scheduler.front", "Move the task to the front", ("left",), "scheduler",
           "Moves the selected waiting task before all others; it starts next.", "to front", _waiting),
    ConsoleAction("scheduler.details", "Everything about the task", ("enter",), "scheduler",
           "Times, source, parameters and outcome of the selected task.", "details"),
    ConsoleAction("log.details", "Everything about the task", ("enter",), "log",
           "Times, source, parameters and outcome of the selected task; letters there copy, save and go to a time.",
           "details", _logged),
    ConsoleAction("log.follow", "Follow the newest task", ("end",), "log",
           "Goes to the end and stays there. Scrolling up pauses; the title counts what is new.", "follow"),
    ConsoleAction("log.unfold", "Show rule events", ("right",), "log",
           "By default the log shows what people and the robot did. This shows the rules' own events, values and rules "
           "too. Later sessions keep this setting.", "rule events"),
    ConsoleAction("log.fold", "Hide rule events", ("left",), "log",
           "Only what people and the robot did: tasks of wizards and programs, acts, failures, notes."),
    ConsoleAction("log.time", "Go to a time", (), "log",
           "Goes to the row nearest to a time of the session: 14:32, -30s (before now), now.", "", _logged),
    ConsoleAction("log.copy", "Copy the row", (), "log",
           "Puts the selected row on the clipboard of your terminal, also through SSH.", "", _logged),
    ConsoleAction("log.copy-all", "Copy all rows shown", (), "log",
           "Puts the rows that the filter leaves, or all, on the clipboard of your terminal, as a table.", "", _logged),
    ConsoleAction("log.save", "Save the rows shown", (), "log",
           "Writes the rows that the filter leaves, or all, to a file in the session's folder, or where its name says: "
           "a table (.tsv) or JSON lines (.jsonl).", "", _logged),
    ConsoleAction("study.open", "Open the participant", ("enter",), "study",
           "Shows the next session of the selected participant and runs its checks. Opens a session that is running, "
           "recovers one that did not end, or asks for a missing outcome.",
           "open", _between_sessions),
    ConsoleAction("study.rehearse", "Rehearse", ("r",), "study",
           "A session that takes no slot and never counts: debug (simulated robot), training or pilot.",
           "rehearse", _between_sessions),
    ConsoleAction("study.report", "Read the report", ("v",), "study",
           "What happened in the selected participant's last session that ended: how long they waited, acts, mistakes, "
           "notes. It is shown after each session, too.", "report", _between_sessions),
    ConsoleAction("study.outcome", "Correct the outcome", ("o",), "study",
           "Changes the outcome of the selected participant's last session, with a reason. The study log keeps both; "
           "the last one counts.", "outcome", _between_sessions),
    ConsoleAction("study.people", "Edit participants and design", ("p",), "study",
           "Opens participants.csv as a table, and study.toml as settings. Lines that you do not change stay as they "
           "are.", "edit", _between_sessions),
    ConsoleAction("study.wizard", "Say who you are", ("w",), "study",
           "The name that every record of the sessions that you begin shows.", "name", _between_sessions),
    ConsoleAction("study.reload", "Read the study again", ("ctrl+r",), "study",
           "Reads the study's files now. They are also read whenever one of them changes.", "read again",
           _between_sessions),
    ConsoleAction("edit.open", "Open, or change", ("enter",), "edit",
           "Opens what is under the cursor; in a form, changes the value: a text in its place, a name by choosing.",
           "open", _in_editor),
    ConsoleAction("edit.add", "Add", ("a", "insert"), "edit",
           "Adds an act, action, key, row or language, after the one under the cursor if order matters.", "add",
           _in_editor),
    ConsoleAction("edit.remove", "Remove", ("delete", "backspace"), "edit",
           "Removes what is under the cursor; undo brings it back.", "remove", _in_editor),
    ConsoleAction("edit.rename", "Rename", ("r",), "edit",
           "Renames what is under the cursor everywhere: in acts, rules, keys, settings and tests.",
           "rename", _in_editor),
    ConsoleAction("edit.copy", "Copy", ("c",), "edit",
           "Copies the act or rule under the cursor, under a new name.", "copy", _in_editor),
    ConsoleAction("edit.waits", "Waits for", ("w",), "edit",
           "Chooses which actions have to end before the action under the cursor begins.", "waits for", _in_editor),
    ConsoleAction("edit.wording", "Another wording", ("v",), "edit",
           "Adds a wording to the text under the cursor; chance picks one each time.", "wording",
           _in_editor),
    ConsoleAction("edit.uses", "Used by", ("u",), "edit",
           "Lists the places that name what is under the cursor. In an act: what its text says in each condition and "
           "language, and for each row of a table.", "used by", _in_editor),
    ConsoleAction("edit.new-state", "A new state", ("n",), "edit",
           "In a rule: adds a state after the one under the cursor. On the page of tables: adds a table.",
           "new state", _in_editor),
    ConsoleAction("edit.first", "The rule begins here", ("i",), "edit",
           "In a rule: it begins in the state under the cursor.", "begins here", _in_editor),
    ConsoleAction("edit.only-if", "Do it only if", ("o",), "edit",
           "In a rule: the function under the cursor is done only if something is true at that moment.", "only if",
           _in_editor),
    ConsoleAction("edit.otherwise", "Otherwise", ("l",), "edit",
           "In a rule: adds what happens when the condition at the cursor is not true.", "otherwise",
           _in_editor),
    ConsoleAction("edit.chance", "One of several, by chance", ("b",), "edit",
           "In a rule: the function under the cursor becomes one of several; chance picks one each time.",
           "by chance", _in_editor),
    ConsoleAction("edit.behind", "Add after the block", ("A",), "edit",
           "In a rule: adds a function after the condition or the choice at the cursor.", "", _in_editor),
    ConsoleAction("edit.earlier", "Earlier", ("left_square_bracket",), "edit",
           "Moves the transition or function under the cursor up. The rule tries its transitions in order.",
           "earlier", _in_editor),
    ConsoleAction("edit.later", "Later", ("right_square_bracket",), "edit",
           "Moves the transition or function under the cursor down.", "later", _in_editor),
    ConsoleAction("edit.try", "Try it", ("t",), "edit",
           "Plays the rule from the state under the cursor on a virtual clock: no robot, no record; esc leads back.",
           "try", _in_editor),
    ConsoleAction("edit.only", "Only what lacks something", ("m",), "edit",
           "In texts: shows only those whose translation is missing or older than the text; once more, all.",
           "only ✗ ▲", _in_editor),
    ConsoleAction("edit.still-right", "Still right", ("s",), "edit",
           "In texts: the translation under the cursor is still right, although its text has changed.",
           "still right", _in_editor),
    ConsoleAction("edit.language", "Choose a language", ("L",), "edit",
           "In texts: shows the progress of each language, switches to another one, and adds one.",
           "languages", _in_editor),
    ConsoleAction("edit.go", "Jump to the act", ("j",), "edit",
           "In texts: opens the act that says the text under the cursor; esc leads back.", "its act", _in_editor),
    ConsoleAction("edit.file", "Open in your editor", ("e",), "edit",
           "Opens the file at this line in the editor that $VISUAL or $EDITOR names, and reads it again afterwards.",
           "editor", _in_editor),
    ConsoleAction("edit.findings", "What is wrong", ("f",), "edit",
           "All errors and warnings; enter goes to one.", "findings", _in_editor),
    ConsoleAction("edit.undo", "Undo a change of the files", ("ctrl+u",), "edit",
           "Takes back the last change, then the one before it, also when it has been saved.", "undo", _in_editor),
    ConsoleAction("edit.redo", "Make the change again", ("ctrl+r",), "edit",
           "Makes the last undone change again.", "redo", _in_editor),
    ConsoleAction("edit.save", "Save the study", ("ctrl+o",), "edit",
           "Shows in words and line by line what changes in the files, and writes them, all or none. Refused while "
           "there is an error.", "save", _in_editor),
    ConsoleAction("edit.other", "The other part of the page", ("tab", "f3"), "edit",
           "Goes from a list to the form below it, and back; in texts, from the original to its translation.", "",
           _in_editor),
    ConsoleAction("edit.pages", "To the list of the study", ("f2", "ctrl+l"), "edit",
           "Goes back to the list of acts, rules, memory, keys and settings.", "list", _in_editor),
    ConsoleAction("edit.leave", "Back", ("escape",), "edit",
           "Leaves the form, then the page, then the editor. What is not saved stays as a draft.", "back", _in_editor),
)  # fmt: skip

BY_ID = {action.id: action for action in ACTIONS}
AT_ONCE = frozenset(
    (
        *("stop", "stop-running", "cue", "undo-cue", "filler", "mistake", "repeat", "go-on", "stop-rule"),
        *("cancel-open", "take-over", "pause", "acts.start", "acts.stop", "rules.start", "rules.stop"),
        *("memory.delete", "memory.undo", "rule.raise"),
        *("scheduler.cancel", "scheduler.earlier", "scheduler.later", "scheduler.front"),
    )
)
"""Actions that change the session or the robot without a further question."""
EDITOR_ACTIONS = ("palette", "help", "filter", "theme", "redraw")
"""Actions of the console that also work in the editor."""
STUDY_SCREEN_ACTIONS = (*EDITOR_ACTIONS, "edit-study")
"""Actions of the console that also work on the screen of a study."""


def actions_in(scope: KeyScope) -> Iterator[ConsoleAction]:
    return (action for action in ACTIONS if action.scope == scope)


def bindings_in(scope: KeyScope) -> list[Binding | tuple[str, str] | tuple[str, str, str]]:
    """Return the key bindings of one scope, for Textual. Each has its action's id, so that a key file can remap it."""
    return [
        Binding(
            textual_keys(action.id, action.keys),
            f"do('{action.id}')",
            action.title,
            id=action.id,
            priority=scope == "everywhere",
        )
        for action in actions_in(scope)
    ]


def bindings_of(*ids: str) -> list[Binding | tuple[str, str] | tuple[str, str, str]]:
    """Return the key bindings of single actions, for a screen that has some of another scope."""
    return [Binding(textual_keys(id, BY_ID[id].keys), f"do('{id}')", BY_ID[id].title, id=id) for id in ids]


def textual_keys(id: str, keys: Iterable[str]) -> str:
    """Return the keys of an action, for Textual; without keys a placeholder, because Textual remaps only bound keys."""
    return ",".join(keys) or f"no-key-of-{id}"

"""Acts that failed and that nobody has answered yet: which, why, and what was not said. Pure; knows no screen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from rise_engine.scenario.model import Act, Action, Scenario
from rise_engine.scenario.template import MissingValue, Slot, Template
from rise_engine.view import ActionView, TaskView
from rise_tui.model.act_text import speech
from rise_tui.model.blocked import KeyNames, blocked_text
from rise_tui.model.control import short
from rise_tui.model.deeds import act_words
from rise_tui.model.graph import levels
from rise_tui.model.spoken import message_of, words_of
from rise_tui.model.store import Store
from rise_tui.text import Line, Span, crop, spread, width_of, wrap

LABEL = 15
"""Cells before what was not said."""
REASON_LINES = 2
WIDE = 60
"""Cells from which on there is room to say where the rest is."""


class Unsaid(NamedTuple):
    """A text that the robot was to say and did not say to its end, as far as it reported."""

    text: str
    begun: bool
    """It was sent to the robot, which may have said a part of it."""
    ways: int = 1
    """Of so many formulations one would have been picked; this is the first."""


def unanswered(store: Store) -> list[TaskView]:
    """Failed acts that are neither done after all nor answered, the one that failed first first."""
    return [store.view.tasks[id] for id in store.view.failed if id in store.view.tasks]


def unsaid(scenario: Scenario, task: TaskView, memory: Mapping[str, Any]) -> list[Unsaid]:
    """What a failed act was to say and did not, in the order in which it would have come."""
    act = speech(task.behavior) if task.function == "say" else scenario.acts.get(task.behavior)
    if act is None:
        return []
    return [found for action in _in_order(act) if (found := _unsaid(scenario, action, task, memory)) is not None]


def speaks(scenario: Scenario, task: TaskView) -> bool:
    """Whether the act was to say anything at all."""
    act = speech(task.behavior) if task.function == "say" else scenario.acts.get(task.behavior)
    return act is not None and any(
        message_of(scenario, call) is not None for action in act.actions for call in action.calls
    )


def _in_order(act: Act) -> list[Action]:
    return [act.actions[at] for level in levels(act) for at in level]


def _unsaid(scenario: Scenario, action: Action, task: TaskView, memory: Mapping[str, Any]) -> Unsaid | None:
    done = task.actions.get(action.id)
    if done is not None and done.status == "succeeded":
        return None
    if done is not None and _was_sent(done):
        words = words_of(scenario, done)
        return Unsaid(words, begun=True) if words is not None else None
    said = next((said for call in action.calls if (said := message_of(scenario, call)) is not None), None)
    return Unsaid(_filled(said, memory), begun=False, ways=len(action.calls)) if said is not None else None


def _was_sent(done: ActionView) -> bool:
    """What fails in the moment in which it begins was never sent: the robot was not there, or a value was missing."""
    return done.status != "skipped" and done.ended != done.since


def _filled(template: Template, memory: Mapping[str, Any]) -> str:
    """With the memory's values as they are now; what has none stays as it is written."""
    pieces = []
    for part in template.parts:
        if isinstance(part, Slot):
            alone = Template("", (part,))
            try:
                pieces.append(alone.fill(memory))
            except (MissingValue, OverflowError, RecursionError):
                pieces.append(f"{{{part.key}}}")
        else:
            pieces.append(part)
    return "".join(pieces)


# --- the bar ---------------------------------------------------------------------------------------------------------


def lines(store: Store, width: int, most: int, key_name: KeyNames) -> list[Line]:
    """What the bar shows of the first failure, in at most `most` lines; none when there is none."""
    failed = unanswered(store)
    if not failed or store.gone:
        return []
    task = failed[0]
    which = f"  {len(failed) - 1} more " if len(failed) > 1 else " "
    head: Line = ((" ✗ ACT FAILED ", "alarm"), (f"  {act_words(task.function, task.behavior)}", "strong"))
    shown: list[Line] = [spread(head, ((which, "fault"),), width)]
    reasons = wrap(task.reason or "the robot gave no reason", max(20, width - 4))
    if len(reasons) > REASON_LINES:
        reasons = [*reasons[: REASON_LINES - 1], " ".join(reasons[REASON_LINES - 1 :])]
    shown += [crop(((f"   {reason}", "fault"),), width) for reason in reasons]
    texts = list(_texts(store, task, width))
    room = max(1, most - len(shown) - 1)
    if len(texts) > room:
        texts = [*texts[: room - 1], _cut(texts[room - 1], width)]
    return [*shown, *texts, _keys(store, task, width, key_name)]


def _cut(line: Line, width: int) -> Line:
    """A line after which others have no room: it says so, and where they are."""
    tail: Span = ("…  all of it: act pane" if width >= WIDE else "…", "muted")
    return (*crop(line, width - width_of((tail,)) - 1), (" ", "plain"), tail)


def _texts(store: Store, task: TaskView, width: int) -> Iterator[Line]:
    """Word for word, each over as many lines as it needs."""
    scenario = store.scenario
    found = unsaid(scenario, task, store.memory)
    if not found:
        said = "all of its words were said" if speaks(scenario, task) else "it has no words to say"
        yield ((f"   {said}", "plain"),)
    for text, begun, ways in found:
        label = "perhaps begun" if begun else "not said"
        label = f"one of {ways}" if ways > 1 else label
        for at, piece in enumerate(wrap(f"“{text}”", max(10, width - LABEL - 2))):
            yield (f"   {label if at == 0 else '':<{LABEL - 3}}", "wait"), (f" {piece}", "strong")


def _keys(store: Store, task: TaskView, width: int, key_name: KeyNames) -> Line:
    """What can be done about it; for who has no control, who can."""
    if store.hello.replay:
        return (("   this is a replay: it was so then", "plain"),)
    if store.cut is not None:
        return (("   the connection is cut", "plain"),)
    if not store.has_control:
        who = f"{short(store.view.control)} has control and decides" if store.view.control else "nobody has control"
        return crop(((f"   {who}: repeat it, or go on without it", "plain"),), width)
    go_on: tuple[Span, ...] = ((f"   {key_name('go-on')}", "key"), (" go on without it", "plain"))
    if why := _comes_again(store, task):
        return crop((("   ► ", "accent"), (why, "strong"), *go_on), width)
    repeat: tuple[Span, ...] = ((f"   {key_name('repeat')}", "key"), (" repeat the whole act", "plain"))
    if reason := blocked_text(store.blocked_reason("start"), key_name):
        room = width - width_of(go_on)
        return (*crop(((f"   not now: {reason}", "wait"),), room), *go_on)
    return crop((*repeat, *go_on), width)


def _comes_again(store: Store, task: TaskView) -> str:
    """Whether it has been started again, and has not ended."""
    same = [
        store.view.tasks[id]
        for id in (*store.view.running, *store.view.waiting)
        if (store.view.tasks[id].function, store.view.tasks[id].behavior) == (task.function, task.behavior)
    ]
    if any(each.status == "ACTIVE" for each in same):
        return "it runs again"
    if same:
        return "it waits to run again"
    return "sent again" if store.is_sent((task.function,), task.behavior) else ""

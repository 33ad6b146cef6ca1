"""Faults: failed acts, texts that were not spoken, and mistakes that a wizard marks. Pure, without a screen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import ceil
from string import ascii_letters, digits
from typing import Any, NamedTuple

from rise_engine.author.drawing.act_graph import actions_in_order
from rise_engine.kernel.task_view import ActionView, TaskView
from rise_engine.kernel.wizard_marks import UNMARKABLE
from rise_engine.scenario.model import Action, KeyBinding, Scenario
from rise_tui.model.act_text import act_of_speech
from rise_tui.model.control import KeyNames, blocked_text
from rise_tui.model.notice import act_label, completion_message, short_name, task_label
from rise_tui.model.speech import action_texts, message_of, words_of
from rise_tui.model.store import Store
from rise_tui.rendering.text import StyledLine, StyledSpan, align_at_both_ends, crop, line_width, quoted, wrap

LABEL = 15
"""Cells before an unspoken text."""
REASON_LINES = 2
WIDE = 60
"""Minimum cells for naming the place of the rest."""


class UnspokenText(NamedTuple):
    """A text that the robot did not finish, as far as it reported."""

    text: str
    begun: bool
    """Whether it was sent to the robot, which may have spoken part of it."""
    variants: int = 1
    """The number of possible wordings, one of which would have been picked. This is the first."""


def unanswered_failures(store: Store) -> list[TaskView]:
    """Failed acts that were neither repeated nor answered, the oldest first. Before them are those that the study waits
    for."""
    view = store.view
    return [view.tasks[id] for id in (*view.questions, *view.failed) if id in view.tasks]


def is_question(store: Store, task: TaskView) -> bool:
    """Whether the study waits for an answer about this failure."""
    return task.id in store.view.questions


def rule_of_question(store: Store, task: TaskView) -> str:
    """The running rule that started an act, which the wizard may stop as an answer; empty: none."""
    name = task.source.removeprefix("rule:")
    return name if task.source.startswith("rule:") and store.rule(name).running else ""


def unspoken_texts(scenario: Scenario, task: TaskView, memory: Mapping[str, Any]) -> list[UnspokenText]:
    """The unspoken texts of a failed act, in its planned order."""
    actions = _actions_in_order(scenario, task)
    return [unspoken for action in actions if (unspoken := _find_unspoken(scenario, action, task, memory)) is not None]


def has_speech(scenario: Scenario, task: TaskView) -> bool:
    """Whether the act has speech."""
    calls = (call for action in _actions_in_order(scenario, task) for call in action.calls)
    return any(message_of(scenario, call) is not None for call in calls)


def _actions_in_order(scenario: Scenario, task: TaskView) -> list[Action]:
    """The actions of a task's act, each after those that it waits for; none for an act that is not in the scenario."""
    act = act_of_speech(task.behavior) if task.function == "say" else scenario.acts.get(task.behavior)
    return actions_in_order(act) if act is not None else []


def _find_unspoken(
    scenario: Scenario, action: Action, task: TaskView, memory: Mapping[str, Any]
) -> UnspokenText | None:
    begun = task.actions.get(action.id)
    if begun is not None and begun.status == "succeeded":
        return None
    if begun is not None and _was_sent(begun):
        words = words_of(scenario, begun)
        return UnspokenText(words, begun=True) if words is not None else None
    texts = action_texts(scenario, action, memory)
    return UnspokenText(texts[0], begun=False, variants=len(texts)) if texts else None


def _was_sent(begun: ActionView) -> bool:
    """Whether the action reached the robot. One that failed at its start did not: the robot or a value was missing."""
    return begun.status != "skipped" and begun.ended != begun.since


# --- the bar ---------------------------------------------------------------------------------------------------------


def failure_lines(store: Store, width: int, most: int, key_name: KeyNames) -> list[StyledLine]:
    """The bar's text about the first failure, in at most `most` lines; empty without a failure."""
    failed = unanswered_failures(store)
    if not failed or store.gone_reason:
        return []
    task = failed[0]
    others = f"  {len(failed) - 1} more " if len(failed) > 1 else " "
    head: StyledLine = ((" ✗ ACT FAILED ", "alarm"), (f"  {act_label(task.function, task.behavior)}", "strong"))
    if is_question(store, task):
        head = (*head, (f"  {_wait_text(store, task)}", "wait"))
    shown: list[StyledLine] = [align_at_both_ends(head, ((others, "fault"),), width)]
    reasons = wrap(task.reason or "the robot gave no reason", max(20, width - 4))
    if len(reasons) > REASON_LINES:
        reasons = [*reasons[: REASON_LINES - 1], " ".join(reasons[REASON_LINES - 1 :])]
    shown += [crop(((f"   {reason}", "fault"),), width) for reason in reasons]
    texts = list(_unspoken_lines(store, task, width))
    room = max(1, most - len(shown) - 1)
    if len(texts) > room:
        texts = [*texts[: room - 1], _mark_cut(texts[room - 1], width)]
    return [*shown, *texts, _keys_line(store, task, width, key_name)]


def _wait_text(store: Store, task: TaskView) -> str:
    """What a question waits for, other than an answer."""
    if task.id not in store.view.repeats:
        return "the study waits for your answer"
    at = store.view.repeats[task.id]
    if at is None:
        return "repeated when the robot is back"
    return f"repeated in {max(0, ceil(at - store.now()))} s" if not store.attach_reply.replay else "repeated"


def _mark_cut(line: StyledLine, width: int) -> StyledLine:
    """A line before hidden ones, with the place of the rest."""
    tail: StyledSpan = ("…  in full: act pane" if width >= WIDE else "…", "muted")
    return (*crop(line, width - line_width((tail,)) - 1), (" ", "plain"), tail)


def _unspoken_lines(store: Store, task: TaskView, width: int) -> Iterator[StyledLine]:
    """The unspoken texts, word for word, each on the lines that it needs."""
    scenario = store.scenario
    unspoken = unspoken_texts(scenario, task, store.memory)
    if not unspoken:
        remark = "all of its words were said" if has_speech(scenario, task) else "it has nothing to say"
        yield ((f"   {remark}", "plain"),)
    for text, begun, variants in unspoken:
        label = "perhaps begun" if begun else "not said"
        label = f"one of {variants}" if variants > 1 else label
        for at, piece in enumerate(wrap(quoted(text), max(10, width - LABEL - 2))):
            yield (f"   {label if at == 0 else '':<{LABEL - 3}}", "wait"), (f" {piece}", "strong")


def _keys_line(store: Store, task: TaskView, width: int, key_name: KeyNames) -> StyledLine:
    """The remedies for the failure or, without control, the person who has them."""
    if store.attach_reply.replay:
        return (("   this is a replay: it shows what happened then", "plain"),)
    if store.cut_since is not None:
        return (("   the connection is cut", "plain"),)
    question = is_question(store, task)
    if not store.has_control:
        who = (
            f"{short_name(store.view.control)} has control and decides" if store.view.control else "nobody has control"
        )
        return crop(((f"   {who}: repeat it, or go on without it", "plain"),), width)
    go_on: tuple[StyledSpan, ...] = ((f"   {key_name('go-on')}", "key"), (" go on without it", "plain"))
    words = " repeat the whole act"
    if question and rule_of_question(store, task):
        stop: StyledSpan = (f"   {key_name('stop-rule')}", "key")
        go_on, words = (go_on[0], (" go on", "plain"), stop), " repeat it"
    if not question and (why := _restart_text(store, task)):
        return crop((("   ► ", "accent"), (why, "strong"), *go_on), width)
    repeat: tuple[StyledSpan, ...] = ((f"   {key_name('repeat')}", "key"), (words, "plain"))
    if reason := blocked_text(store.blocked_reason("start"), key_name):
        room = width - line_width(go_on)
        return (*crop(((f"   not now: {reason}", "wait"),), room), *go_on)
    return crop((*repeat, *go_on), width)


def _restart_text(store: Store, task: TaskView) -> str:
    """A sentence if the act was started again and has not ended; otherwise empty."""
    restarted = (task.function, task.behavior)
    if any((each.function, each.behavior) == restarted for each in store.running_tasks):
        return "it runs again"
    if any((each.function, each.behavior) == restarted for each in store.waiting_tasks):
        return "it waits to run again"
    return "sent again" if store.is_sent((task.function,), task.behavior) else ""


ACTS = frozenset({"startCommunicationRobotAct", "say"})
CUES = frozenset({"markCue", "undoCue"})


class MistakeMark(NamedTuple):
    key: str
    mark: str
    """The engine's name for it."""
    word: str


_MARK_WORDS = {"wrong": "wrong", "late": "late", "early": "early", "double": "double", "none": "undo"}


def mistake_marks(scenario: Scenario) -> tuple[MistakeMark, ...]:
    """The answers to a mark, each with a letter of its word or a digit that is no key of the study."""
    free = {*ascii_letters, *digits} - scenario.keys.keys()
    marks = []
    for mark, word in _MARK_WORDS.items():
        key = next((letter for letter in (*word, *word.upper(), *digits) if letter in free), "")
        free -= {key}
        marks.append(MistakeMark(key, mark, word))
    return tuple(marks)


def newest_markable(tasks: dict[int, TaskView], me: str | None) -> TaskView | None:
    """This wizard's last action of any kind, or else the act that a rule started last.

    Tasks of other people and programs, rejected tasks and marks do not count. `me` None: any wizard, for the judge of a
    session that is over. Then cues do not count either, because their results are judged.
    """
    by_rule: TaskView | None = None
    for id in reversed(tasks):
        task = tasks[id]
        if task.status == "REJECTED" or task.function in UNMARKABLE or (me is None and task.function in CUES):
            continue
        if task.source == me or (me is None and task.source.startswith("wizard:")):
            return task
        if by_rule is None and task.source.startswith("rule:") and task.function in ACTS:
            by_rule = task
    return by_rule


def markable_name(task: TaskView, key: KeyBinding | None) -> str:
    """A task's name: the act, the words of speech, or else the key with the author's label or its function."""
    if task.function in ACTS:
        return act_label(task.function, task.behavior)
    words = completion_message(task.function, task.behavior) or task_label(task.function, task.behavior)
    return f"{key.label}: {key.title or words}" if key is not None else words

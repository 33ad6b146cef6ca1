"""A trial run in rows: the rule's state, its transitions, the keys and memory values, the events so far. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rise_engine.author.trial.trial import Trial, TrialStep
from rise_engine.author.trial.trial_history import HistoryKind, HistoryLine
from rise_engine.author.trial.trial_state import (
    ConditionReading,
    KeyChoice,
    RunningRule,
    TransitionOption,
    events_to_raise,
    key_choices,
    relevant_memory,
    running_acts,
    running_rules,
)
from rise_engine.kernel.record_words import trigger_text
from rise_engine.scenario.model import KeyBinding, Scenario
from rise_tui.editor.model.study_names import short_value
from rise_tui.rendering.text import ListRow, StyledLine, StyledSpan, TextRole, align_at_both_ends, crop, fit, wrap

GO_ON = "go"
"""The id of the row that lets time pass. Others: `way:RULE:NUMBER`, `key:NAME`, `event:TOPIC`, `set:KEY`."""
KIND_ROLES: dict[HistoryKind, TextRole] = {
    "done": "strong", "state": "accent", "event": "plain", "memory": "plain", "condition": "muted", "act": "plain",
    "says": "plain", "note": "muted", "problem": "fault",
}  # fmt: skip
MAX_LINES = 400
"""Maximum number of lines of past events. Older ones are only counted."""


def clock_text(seconds: float) -> str:
    """Virtual time: `00:52`, `1:02:07`."""
    whole = int(seconds)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02}:{whole % 60:02}" if hours else f"{minutes:02}:{whole % 60:02}"


def find_running_rule(trial: Trial, rule: str) -> RunningRule | None:
    """The state of the rule or, if it does not run, of the rule that gets events first."""
    running = running_rules(trial)
    return next((each for each in running if each.name == rule), running[0] if running else None)


def head_lines(trial: Trial, rule: str, width: int) -> tuple[StyledLine, StyledLine]:
    """The title, the virtual time, and the state of the rule."""
    time: StyledLine = (("virtual time ", "muted"), (f"{clock_text(trial.now)} ", "strong"))
    first = align_at_both_ends(((" TRY IT", "accent"), ("   no robot, no record", "muted")), time, width)
    running = find_running_rule(trial, rule)
    if running is None:
        return first, crop(((f" {rule}", "strong"), ("  does not run", "muted")), width)
    came = f"   from {running.previous}" if running.previous else ""
    where: StyledLine = ((f" {running.name}", "strong"), ("  in ", "muted"), (running.state, "accent"))
    return first, crop((*where, (f"{came}{trigger_text(running.trigger)}", "muted")), width)


def trial_rows(trial: Trial, rule: str, width: int) -> list[ListRow]:
    """The rows for Enter, with the information that the author needs, in at most `width` cells."""
    running = find_running_rule(trial, rule)
    rows = [ListRow(GO_ON, crop(_go_on_line(trial), width))]
    rows += _running_rows(trial, width)
    if running is not None:
        rows.append(_heading("TRANSITIONS" if running.transitions else "TRANSITIONS   none: the rule ends here"))
        for transition in running.transitions:
            rows += _transition_rows(transition, width)
    keys = key_choices(trial)
    rows += _rows_to_do(trial, [key for key in keys if key.is_awaited], width)
    name = running.name if running is not None else rule
    if name in trial.scenario.rules:
        rows += _memory_rows(trial, name, width)
    if others := [key for key in keys if not key.is_awaited]:
        rows.append(_heading("OTHER KEYS OF THE STUDY"))
        rows += [_key_row(choice, width) for choice in others]
    return rows


def history_rows(lines: Sequence[HistoryLine], width: int) -> list[ListRow]:
    """The past events, the newest last. A long line takes several rows."""
    rows = []
    omitted = len(lines) - MAX_LINES
    if omitted > 0:
        rows.append(_heading(f"{omitted} earlier lines"))
    before = None
    for number, line in enumerate(lines[-MAX_LINES:]):
        time = clock_text(line.t)
        lead = f" {time if time != before else '':>5} "
        key = f"key {line.key}  " if line.key else ""
        pieces = wrap(f"{key}{line.text}", max(20, width - len(lead)))
        for at, piece in enumerate(pieces):
            head: StyledSpan = (lead if at == 0 else " " * len(lead), "muted")
            id = f"{number}:{at}"
            rows.append(ListRow(id, (head, (piece, KIND_ROLES[line.kind]))))
        before = time
    return rows


def key_of(scenario: Scenario, key: str) -> KeyBinding | None:
    """The study's key with Textual's name."""
    return scenario.keys.get(key)


def play_again(steps: Sequence[TrialStep], trial: Trial) -> None:
    """Repeat the steps of one trial run in a new one, after the study has changed."""
    for step in steps:
        if step.task is not None:
            trial.submit(step.task, step.key, max(step.at, trial.now))
        elif step.kind == "wait":
            trial.pass_time(step.seconds)
        else:
            trial.go_on()


def begin(trial: Trial, rule: str, state: str = "") -> None:
    """Start the rule with its key, as the study does; directly without a key, or from another state than its first."""
    found = trial.scenario.rules.get(rule)
    if found is None:
        return
    if state and state != found.initial and state in found.states:
        trial.start_rule(rule, state)
        return
    keys = trial.scenario.keys.values()
    key = next((key for key in keys if key.function == "startInteractionRule" and key.task_behavior == rule), None)
    if key is not None:
        trial.press(key)
    else:
        trial.start_rule(rule)


def _go_on_line(trial: Trial) -> StyledLine:
    if trial.next_at is None:
        return ((" nothing happens by itself: it waits for you", "muted"),)
    return ((" let time pass until something waits", "plain"),)


def _running_rows(trial: Trial, width: int) -> Iterator[ListRow]:
    for act in running_acts(trial):
        how_far = "waits its turn" if act.waits else f"{act.seconds:.1f} of {act.expected:.1f} s"
        says = f"   says “{act.says}”" if act.says else ""
        yield ListRow("", crop(((f"   {act.act}  {how_far}", "plain"), (says, "muted")), width), selectable=False)


def _transition_rows(transition: TransitionOption, width: int) -> Iterator[ListRow]:
    target = f" → {transition.target}" if transition.target is not None else "   stays here"
    doing = ", ".join(f"key {key.label}" for key in transition.keys) or transition.now
    left: StyledLine = ((f"   {transition.index + 1} {transition.label}", "plain"), (target, "muted"))
    id = f"way:{transition.index}:{transition.rule}"
    yield ListRow(id, align_at_both_ends(left, ((f"{doing} ", "key" if transition.keys else "muted"),), width))
    for reading in transition.readings:
        yield ListRow("", crop((("      ", "plain"), *_reading_spans(transition, reading)), width), selectable=False)


def _reading_spans(transition: TransitionOption, reading: ConditionReading) -> list[StyledSpan]:
    """A condition in its parts: `if step < 4 (step is 0) true and not understood (…) true → true`."""
    word = "while " if reading.word == "while" else "now " if transition.trigger == "condition" else "but only if "
    spans: list[StyledSpan] = [(word, "muted")]
    for number, part in enumerate(reading.parts):
        if number:
            spans.append((f" {reading.joint} ", "muted"))
        spans.append((part.text, "plain"))
        if part.values and part.values != part.text:
            spans.append((f" ({part.values})", "muted"))
        spans.append((" ✓" if part.holds else " ✗", "key" if part.holds else "wait"))
    spans.append((f"  → {'true' if reading.holds else 'false'}", "plain"))
    return spans


def _rows_to_do(trial: Trial, keys: list[KeyChoice], width: int) -> Iterator[ListRow]:
    """The events and keys that could make a rule go on."""
    events = events_to_raise(trial)
    if keys or events:
        yield _heading("WHAT YOU CAN DO")
    for topic in events:
        left: StyledLine = ((f"   raise /{topic}", "plain"), ("   no key does", "muted"))
        yield ListRow(f"event:{topic}", crop(left, width))
    yield from (_key_row(choice, width) for choice in keys)


def _key_row(choice: KeyChoice, width: int) -> ListRow:
    role: TextRole = "plain" if choice.is_awaited else "muted"
    title = f"  {choice.title}" if choice.title and choice.title != choice.does else ""
    key: StyledSpan = (f"   {fit(choice.key.label, 4)}", "key" if choice.is_awaited else "muted")
    line = align_at_both_ends((key, (f"{choice.does}{title}", role)), ((f"{choice.now} ", "muted"),), width)
    return ListRow(f"key:{choice.key.key}", line)


def _memory_rows(trial: Trial, rule: str, width: int) -> Iterator[ListRow]:
    lines = relevant_memory(trial, rule)
    if lines:
        yield _heading("MEMORY USED HERE   enter sets a value")
    for line in lines:
        value = short_value(line.value) if line.exists else "not there"
        when = f" {clock_text(line.changed)}" if line.changed else ""
        left: StyledLine = ((f"   {line.key} ", "plain"), (f"= {value}", "strong" if line.exists else "wait"))
        source = f"{line.source}{when} " if line.exists else "never set "
        yield ListRow(f"set:{line.key}", align_at_both_ends(left, ((source, "muted"),), width))


def _heading(text: str) -> ListRow:
    return ListRow("", ((f" {text}", "strong"),), selectable=False)

"""Checks across files: names must exist, and a study should react to failed acts."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from functools import cache

from rise_engine.base.nearest_name import Correction, suggest
from rise_engine.scenario.checking.memory_paths import MemoryPaths, add_session_keys, check_parts, session_problem
from rise_engine.scenario.diagnostics import Diagnostics, unknown_code
from rise_engine.scenario.draft import Mention, ScenarioDraft
from rise_engine.scenario.model import (
    CUE_TOPICS,
    SESSION,
    Act,
    RobotProfile,
    Rule,
    SourceLocation,
    State,
    result_topics,
)
from rise_engine.scenario.reading.act_settings import ActTables
from rise_engine.scenario.reading.conditions import check_conditions
from rise_engine.scenario.reading.explore_tables import check_trials
from rise_engine.scenario.reading.graph import reachable_from

ACT_END_SUFFIXES = ("_succeeded", "_failed", "_stopped", "_end")
"""Events that the engine raises when an act ends (semantics.md 6.1)."""


def check_cross_references(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Check names, events and memory keys across the files of a scenario."""
    unread = draft.unreadable_parts
    _check_foreign_ends(draft, diagnostics)
    if "acts" not in unread:
        _check_names(draft.act_mentions, draft.acts, "act", draft.rules, "rule", diagnostics)
    if "rules" not in unread:
        _check_names(draft.rule_mentions, draft.rules, "rule", draft.acts, "act", diagnostics)
        _check_states(draft, diagnostics)
        _check_reachable(draft, diagnostics)
        check_trials(draft, diagnostics)
    for name, rule in draft.rules.items():
        if name in draft.acts:
            diagnostics.warning(
                "same-name",
                rule.location,
                f"the act in {draft.acts[name].location.file} is called `{name}` too, and the ends of both raise "
                f"the event `{name}_end`",
            )
    if not unread & {"acts", "rules", "settings"}:
        _check_topics(draft, diagnostics)
    add_session_keys(draft, diagnostics)
    if not unread & {"rules", "memory", "tables", "settings"}:
        _check_memory(draft, diagnostics)
        if "acts" not in unread:
            check_parts(draft, diagnostics)
            check_conditions(draft, diagnostics)


def engine_topics(draft: ScenarioDraft) -> set[str]:
    """The topics that the engine raises for the acts and rules of a scenario."""
    topics = {name + ending for name in draft.acts for ending in ACT_END_SUFFIXES}
    topics.update(CUE_TOPICS)
    for name, rule in draft.rules.items():
        topics.add(f"{name}_end")
        topics.update(topic for _, topic in result_topics(rule))
    return topics


def _remember_suggestions(known: Collection[str], otherwise: str = "") -> Callable[[str], Correction]:
    """Return a cached function for the nearest of these names, or else for this end of a message."""
    return cache(lambda name: suggest(name, known, limit=0, otherwise=otherwise))


def _check_names(
    mentions: list[Mention],
    known: Collection[str],
    kind: str,
    others: Collection[str],
    other_kind: str,
    diagnostics: Diagnostics,
) -> None:
    suggest = _remember_suggestions(known)
    for mention in mentions:
        if mention.name in known:
            continue
        message, near = f"there is no {kind} `{mention.name}`", None
        if mention.name in others:
            message += f"; it is the name of a {other_kind}" if other_kind == "rule" else "; it is the name of an act"
        else:
            near = suggest(mention.name)
        diagnostics.error(unknown_code(f"unknown-{kind}", mention.name, known), mention.locate(), message, near)


def _check_foreign_ends(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Warn of transitions that are never taken: their rule does not start the act whose end they wait for."""
    for end in draft.foreign_ends:
        # A missing act already has an error, unless some acts could not be read.
        if end.act in draft.acts or "acts" in draft.unreadable_parts:
            message = (
                f"never taken: this rule does not start `{end.act}` itself; to wait for an act that something "
                f'else starts, write eventTopic="/{end.act}_end"'
            )
            diagnostics.warning("unreachable-transition", end.location, message)


def _check_states(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Report missing states in which a rule should begin, or which a property names."""
    for mention in (*draft.state_mentions, *draft.asked_states):
        rule = draft.rules.get(mention.rule)
        if rule is not None and rule.initial and mention.name not in rule.states:
            near = suggest(mention.name, rule.states, limit=0)
            message = f"the rule `{rule.name}` has no state `{mention.name}`"
            diagnostics.error(unknown_code("unknown-state", mention.name, rule.states), mention.locate(), message, near)


def _check_reachable(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Warn of states that are unreachable from the states in which their rule can begin."""
    starts: dict[str, list[str]] = {}
    for mention in draft.state_mentions:
        starts.setdefault(mention.rule, []).append(mention.name)
    for rule in draft.rules.values():
        if rule.initial not in rule.states:
            continue
        targets = {name: [t.target for t in state.transitions if t.target] for name, state in rule.states.items()}
        reachable = reachable_from("", {**targets, "": [rule.initial, *starts.get(rule.name, ())]})
        for name, state in rule.states.items():
            if name not in reachable:
                message = f"no transition leads to the state `{name}` from `{rule.initial}`"
                diagnostics.warning("unreachable-state", state.location, message)


def _check_topics(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    own = {mention.name for mention in draft.raised_topics}
    by_engine = engine_topics(draft)
    awaited = {mention.name for mention in draft.awaited_topics}
    missing = {m.name for m in draft.act_mentions if m.name not in draft.acts}
    missing.update(m.name for m in draft.rule_mentions if m.name not in draft.rules)
    by_missing = {name + ending for name in missing for ending in ACT_END_SUFFIXES}
    known = own | by_engine
    suggest_topic = _remember_suggestions(known, "; another program must do it")
    for mention in draft.awaited_topics:
        name = mention.name
        if name in own or name in by_engine or name in by_missing:  # missing names already have a diagnostic
            continue
        diagnostics.warning(
            unknown_code("unraised-event", name, known),
            mention.locate(),
            f"nothing in this scenario raises the event `{name}`",
            suggest_topic(name),
        )
    suggest_topic = _remember_suggestions(awaited)
    for mention in draft.raised_topics:
        if mention.name not in awaited:
            diagnostics.warning(
                unknown_code("unheard-event", mention.name, awaited),
                mention.locate(),
                f"no rule waits for the event `{mention.name}`",
                suggest_topic(mention.name),
            )


def _check_memory(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    written = {mention.name for mention in (*draft.key_writes, *draft.part_writes, *draft.condition_values)}
    tables = {name: table.records for name, table in draft.tables.items()}
    own = {SESSION: draft.session_keys} if draft.session_keys else {}
    paths = MemoryPaths({**draft.memory, **own, **tables}, written)
    suggest_key = _remember_suggestions(draft.settable_keys | tables.keys())
    suggest_read = _remember_suggestions(draft.settable_keys | tables.keys(), "; another program must do it")
    is_known, reading_problem = cache(paths.is_known), cache(paths.reading_problem)
    for mention in draft.key_writes:
        if mention.name.partition(".")[0] not in tables and (problem := paths.writing_problem(mention.name)):
            diagnostics.error("unknown-path", mention.locate(), problem)
    for mention in (*draft.key_reads, *draft.property_reads, *draft.bare_words, *draft.bare_keys):
        if mention.name.partition(".")[0] not in tables and (problem := reading_problem(mention.name)):
            diagnostics.error("unknown-path", mention.locate(), session_problem(draft, mention.name) or problem)
    for mention in (
        *(mention for mention in (*draft.key_reads, *draft.property_reads) if not is_known(mention.name)),
        *(key for key in draft.optional_key_reads if not is_known(key.name) or reading_problem(key.name)),
    ):
        diagnostics.warning(
            "unset-key",
            mention.locate(),
            f"nothing in this scenario sets the memory key `{mention.name}`",
            suggest_read(mention.name),
        )
    for mention in draft.bare_words:
        if not is_known(mention.name):
            diagnostics.warning(
                "bare-word",
                mention.locate(),
                f"`{mention.name}` is not a memory key and is taken as a text; write '{mention.name}' in quotation "
                "marks",
                suggest_key(mention.name),
            )
    for mention in draft.bare_keys:
        if not is_known(mention.name):
            diagnostics.error(
                "wrong-type",
                mention.locate(),
                f"{mention.problem}, and nothing in this scenario sets a memory key of that name",
                suggest_key(mention.name),
            )


# --- failures that nothing notices ------------------------------------------------------------------------------------


END = "_end"


def check_failures(
    draft: ScenarioDraft, tables: ActTables, on_failure: str, robot: RobotProfile, diagnostics: Diagnostics
) -> None:
    """Warn once for each rule that waits for `/ACT_end` although nothing handles a failure of that act.

    Only acts count that the rule itself starts and that can fail, except fillers.
    """
    heard = {mention.name for mention in draft.awaited_topics}
    settings = tables.settings_by_act(draft.acts)

    def continues(name: str) -> bool:
        own = settings.get(name)
        if f"{name}_failed" in heard or name not in draft.acts or not _can_fail(draft.acts[name], robot):
            return False
        return own is None or (not own.filler and (own.on_failure or on_failure) == "go_on")

    if on_failure != "go_on" and not any(own.on_failure == "go_on" for own in settings.values()):
        return
    for rule in draft.rules.values():
        found = list(_unanswered_ends(rule))
        acts = list(dict.fromkeys(name for name, _ in found if continues(name)))
        if acts:
            others = f"; the same is true of {len(acts) - 1} more of its acts" if len(acts) > 1 else ""
            diagnostics.warning(
                "unnoticed-failure",
                next(location for name, location in found if name == acts[0]),
                f"`{acts[0]}{END}` is also raised when `{acts[0]}` has failed, and the rule goes on as if it had not: "
                f'wait for `{acts[0]}_succeeded`, or ask the wizard with on_failure = "ask" in scenario.toml{others}',
            )


def _unanswered_ends(rule: Rule) -> Iterator[tuple[str, SourceLocation]]:
    """The acts for whose end a state waits, whatever the outcome, without a transition for their failure."""
    started = _started_acts(rule)
    for state in rule.states.values():
        for transition in state.transitions:
            act = (
                transition.event.removesuffix(END)
                if transition.event is not None and transition.event.endswith(END)
                else ""
            )
            if act in started and not _takes_failure(state, act):
                yield act, transition.location


def _started_acts(rule: Rule) -> set[str]:
    return {each.argument for each in rule.functions if each.name == "startCommunicationRobotAct"}


def _takes_failure(state: State, act: str) -> bool:
    return any(
        transition.ended == act and "failed" in (transition.outcomes or ("failed",)) for transition in state.transitions
    )


def _can_fail(act: Act, robot: RobotProfile) -> bool:
    """Whether a failing action would end the act. The engine's own wait cannot fail."""
    return any(
        not action.continue_on_failure and not _is_engine(call.type, robot)
        for action in act.actions
        for call in action.calls
    )


def _is_engine(action: str, robot: RobotProfile) -> bool:
    spec = robot.actions.get(action)
    return spec is not None and spec.engine

"""Does a study notice that an act has failed? A check over its acts, rules and scenario.toml."""

from __future__ import annotations

from collections.abc import Iterator

from rise_engine.scenario.act_settings import ActTables
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.model import Act, RobotProfile, Rule, SourceLocation, State, functions_in

END = "_end"


def check_failures(
    draft: ScenarioDraft, tables: ActTables, on_failure: str, robot: RobotProfile, diagnostics: Diagnostics
) -> None:
    """Warn, once for each rule, where it waits for `/ACT_end` and nothing deals with a failure of that act.

    Only acts that the rule starts itself and that can fail count, and no fillers.
    """
    heard = {mention.name for mention in draft.awaited_topics}
    settings = tables.settings_by_act(draft.acts)

    def goes_on(name: str) -> bool:
        own = settings.get(name)
        if f"{name}_failed" in heard or name not in draft.acts or not _can_fail(draft.acts[name], robot):
            return False
        return own is None or (not own.filler and (own.on_failure or on_failure) == "go_on")

    if on_failure != "go_on" and not any(own.on_failure == "go_on" for own in settings.values()):
        return
    for rule in draft.rules.values():
        found = list(_unanswered_ends(rule))
        acts = list(dict.fromkeys(name for name, _ in found if goes_on(name)))
        if acts:
            others = f"; so it is with {len(acts) - 1} more of its acts" if len(acts) > 1 else ""
            diagnostics.warning(
                "unnoticed-failure",
                next(location for name, location in found if name == acts[0]),
                f"`{acts[0]}{END}` comes also when `{acts[0]}` has failed, and the rule goes on as if it had not: wait "
                f'for `{acts[0]}_succeeded`, or let somebody be asked, on_failure = "ask" in scenario.toml{others}',
            )


def _unanswered_ends(rule: Rule) -> Iterator[tuple[str, SourceLocation]]:
    """The acts whose end, however it is, a state waits for, where none of its ways is for their failure."""
    started = _started_acts(rule)
    for state in rule.states.values():
        for way in state.transitions:
            act = way.event.removesuffix(END) if way.event is not None and way.event.endswith(END) else ""
            if act in started and not _takes_failure(state, act):
                yield act, way.location


def _started_acts(rule: Rule) -> set[str]:
    blocks = (
        block
        for state in rule.states.values()
        for block in (state.on_entry, state.on_exit, *(way.block for way in state.transitions))
    )
    functions = (function for block in blocks for function in functions_in(block))
    return {function.argument for function in functions if function.name == "startCommunicationRobotAct"}


def _takes_failure(state: State, act: str) -> bool:
    return any(way.ended == act and "failed" in (way.outcomes or ("failed",)) for way in state.transitions)


def _can_fail(act: Act, robot: RobotProfile) -> bool:
    """Whether a failure of any of its actions ends it: the engine's own wait does not fail."""
    return any(
        not action.continue_on_failure and not _is_engine(call.type, robot)
        for action in act.actions
        for call in action.calls
    )


def _is_engine(action: str, robot: RobotProfile) -> bool:
    spec = robot.actions.get(action)
    return spec is not None and spec.engine

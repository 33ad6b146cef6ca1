"""Checks across files: does everything that is named exist, is everything that is waited for ever raised?"""

from __future__ import annotations

from collections.abc import Collection

from rise_engine.nearest_name import did_you_mean
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import Mention, ScenarioDraft
from rise_engine.scenario.memory_paths import MemoryPaths

ACT_END_SUFFIXES = ("_succeeded", "_failed", "_stopped", "_end")
"""Events that the engine raises when an act ends (semantics.md 6.1)."""
RULE_END_SUFFIXES = ("_end",)


MAX_SUGGESTIONS = 50
"""For how many names of one kind a nearest right one is looked for; that is slow, and nobody reads more."""


def check_cross_references(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Compare what the files of a scenario say about each other."""
    unread = draft.unreadable_parts
    if "acts" not in unread:
        _check_names(draft.act_mentions, draft.acts, "act", draft.rules, "rule", diagnostics)
    if "rules" not in unread:
        _check_names(draft.rule_mentions, draft.rules, "rule", draft.acts, "act", diagnostics)
    for name, rule in draft.rules.items():
        if name in draft.acts:
            diagnostics.warning(
                "same-name",
                rule.location,
                f"the act in {draft.acts[name].location.file} is called `{name}` too, and the ends of both raise "
                f"the event `{name}_end`",
            )
    if not unread & {"acts", "rules"}:
        _check_topics(draft, diagnostics)
    if not unread & {"rules", "memory"}:
        _check_memory(draft, diagnostics)


def engine_topics(draft: ScenarioDraft) -> set[str]:
    """The topics that the engine itself raises for the acts and rules of a scenario."""
    topics = {name + ending for name in draft.acts for ending in ACT_END_SUFFIXES}
    topics.update(name + ending for name in draft.rules for ending in RULE_END_SUFFIXES)
    return topics


class _Suggestions:
    """The nearest of some names as the end of a message, remembered, and not looked for without end."""

    def __init__(self, known: Collection[str]) -> None:
        self.known = known
        self.found: dict[str, str] = {}

    def __call__(self, name: str) -> str:
        if name not in self.found and len(self.found) < MAX_SUGGESTIONS:
            self.found[name] = did_you_mean(name, self.known, limit=0)
        return self.found.get(name, "")


def _check_names(
    mentions: list[Mention],
    known: Collection[str],
    kind: str,
    others: Collection[str],
    other_kind: str,
    diagnostics: Diagnostics,
) -> None:
    near = _Suggestions(known)
    for mention in mentions:
        if mention.name in known:
            continue
        if mention.name in others:
            remedy = f"; it is the name of a {other_kind}" if other_kind == "rule" else "; it is the name of an act"
        else:
            remedy = near(mention.name)
        diagnostics.error(f"unknown-{kind}", mention.origin.location, f"there is no {kind} `{mention.name}`{remedy}")


def _check_topics(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    own = {mention.name for mention in draft.raised_topics}
    by_engine = engine_topics(draft)
    awaited = {mention.name for mention in draft.awaited_topics}
    missing = {m.name for m in draft.act_mentions if m.name not in draft.acts}
    missing.update(m.name for m in draft.rule_mentions if m.name not in draft.rules)
    by_missing = {name + ending for name in missing for ending in ACT_END_SUFFIXES}
    near = _Suggestions(own | by_engine)
    for mention in draft.awaited_topics:
        name = mention.name
        if name in own or name in by_engine:
            continue
        if name in by_missing:
            continue  # the missing act is a finding already
        diagnostics.warning(
            "unraised-event",
            mention.origin.location,
            f"nothing in this scenario raises the event `{name}`{near(name) or '; something outside must'}",
        )
    near = _Suggestions(awaited)
    for mention in draft.raised_topics:
        if mention.name not in awaited:
            diagnostics.warning(
                "unheard-event",
                mention.origin.location,
                f"no rule waits for the event `{mention.name}`{near(mention.name)}",
            )


def _check_memory(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    keys = draft.settable_keys
    paths = MemoryPaths(draft.memory, {mention.name for mention in draft.key_writes})
    bare = {id(entry.origin) for entry in draft.bare_keys}
    for entry in draft.bare_keys:
        if not paths.is_known(entry.key):
            diagnostics.error(
                "wrong-type",
                entry.origin.location,
                f"{entry.sentence}, and nothing in this scenario sets a memory key of that name"
                f"{did_you_mean(entry.key, keys, limit=0)}",
            )
    for mention in draft.key_writes:
        problem = paths.writing_problem(mention.name) if "." in mention.name else ""
        if problem:
            diagnostics.error("unknown-path", mention.origin.location, problem)
    seen: dict[str, tuple[bool, str]] = {}
    near = _Suggestions(keys)

    def unset(mention: Mention) -> None:
        diagnostics.warning(
            "unset-key",
            mention.origin.location,
            f"nothing in this scenario sets the memory key `{mention.name}`"
            f"{near(mention.name) or '; something outside must'}",
        )

    def status(name: str) -> tuple[bool, str]:
        found = seen.get(name)
        if found is None:
            known = paths.is_known(name)
            found = seen[name] = known, paths.reading_problem(name) if known else ""
        return found

    for mention in draft.key_reads:
        known, problem = status(mention.name)
        if problem:
            diagnostics.error("unknown-path", mention.origin.location, problem)
        elif not known and id(mention.origin) not in bare:
            unset(mention)
    for mention in draft.optional_key_reads:
        known, problem = status(mention.name)
        if problem or not known:
            unset(mention)
    for mention in draft.bare_words:
        known, problem = status(mention.name)
        if problem:
            diagnostics.error("unknown-path", mention.origin.location, problem)
        elif not known:
            diagnostics.warning(
                "bare-word",
                mention.origin.location,
                f"`{mention.name}` is no memory key and is taken as a text; write '{mention.name}' in quotation marks"
                f"{near(mention.name)}",
            )

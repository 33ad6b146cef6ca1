"""Rename: a name everywhere at once, so that the study does what it did.

Acts, rules, states, events, memory keys and actionIDs are renamed in files of acts and rules, conditions, templates,
keys, settings, start values, task files, `study.toml` and translations; with an act the events of its end. What would
meet another name is refused, and comments that have the old name are listed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from rise_engine.edit.comments import comments_with
from rise_engine.edit.edits import Edit, Rename
from rise_engine.edit.name_places import NamePlace, NamePlaces
from rise_engine.edit.plan import EditRefused, Plan, Splice
from rise_engine.edit.rename_data import Renaming, data_splices
from rise_engine.edit.study_state import StudyState
from rise_engine.nearest_name import did_you_mean
from rise_engine.scenario.cross_references import ACT_END_SUFFIXES, engine_topics
from rise_engine.scenario.memory import is_writable_key
from rise_engine.scenario.model import SESSION, TemplateLocation, normal_topic, result_topics
from rise_engine.scenario.uses import Use, UsedKind, Uses
from rise_engine.text import BLANKS, find_unseen, pluralize

_MOST_SHOWN = 5
_KINDS = {"act": "the act", "rule": "the rule", "state": "the state", "event": "the event", "key": "the memory key"}
_CONSTANTS = ("pi", "e", "r2d", "d2r")


class _Names:
    """What a rename is about: names of a kind as `Uses` has them, and what is written at each of their places."""

    def __init__(self, edit: Rename, study: StudyState) -> None:
        self.edit = edit
        self.uses = study.checked.uses
        self.draft = study.checked.draft
        self.owner, self.old = _owner_and_name(edit, self.uses)
        self.new = normal_topic(edit.new) if edit.kind == "event" else edit.new

    @property
    def what(self) -> str:
        """What is renamed, in words: "the state `Start` of `Main`"."""
        if self.edit.kind == "state":
            return f"the state `{self.old}` of `{self.owner}`"
        if self.edit.kind == "action":
            return f"the action `{self.old}` of `{self.owner}`"
        return f"{_KINDS[self.edit.kind]} `{self.old}`"

    def full(self, name: str) -> str:
        """A name as `Uses` has it."""
        return f"{self.owner}/{name}" if self.owner else name

    def events(self) -> dict[str, str]:
        """Events that are called otherwise then: those that the engine raises for what is renamed."""
        old, new = self.old, self.new
        match self.edit.kind:
            case "event":
                return {old: new}
            case "act":
                return {old + ending: new + ending for ending in ACT_END_SUFFIXES}
            case "rule":
                rule = self.draft.rules.get(old)
                results = [state for state, _ in result_topics(rule)] if rule is not None else []
                return {f"{old}_{ending}": f"{new}_{ending}" for ending in ("end", *results)}
            case "state":
                rule = self.draft.rules.get(self.owner)
                results = [state for state, _ in result_topics(rule)] if rule is not None else []
                return {f"{self.owner}_{old}": f"{self.owner}_{new}"} if old in results else {}
        return {}

    def places(self) -> Iterator[tuple[UsedKind, str, str, str]]:
        """Names of `Uses`, what is written there, and what is to be: kind, name, old, new."""
        if self.edit.kind == "key":
            for name in self.uses.names("key"):
                if name == self.old:
                    yield "key", name, name, self.new
                elif name.startswith(f"{self.old}."):
                    yield "key", name, name, self.new + name[len(self.old) :]
            return
        if self.edit.kind != "event":
            yield self.edit.kind, self.full(self.old), self.old, self.new
        for old, new in self.events().items():
            yield "event", old, old, new


def plan_rename(edit: Rename, study: StudyState) -> Plan:
    """A name everywhere.

    :raises EditRefused: there is no such name, the new one is none or is taken, a file cannot be read, or a place has
        the name put together of several.
    """
    if study.outline.unreadable:
        file, problem = next(iter(study.outline.unreadable.items()))
        raise EditRefused(f"{file} cannot be read ({problem}), so nobody knows what names it has; mend it first")
    names = _Names(edit, study)
    _check_new_name(names)
    _check_collisions(names, study)
    places = NamePlaces(study.files)
    found: dict[NamePlace, tuple[str, str]] = {}
    problems: list[str] = []
    for kind, name, old, new in names.places():
        for use in names.uses.of(kind, name):
            place = places.find(use, old)
            if place is None:
                problems.append(_place_text(use))
            else:
                found[place] = old, new
    if problems:
        where = "; ".join(dict.fromkeys(problems[:_MOST_SHOWN]))
        raise EditRefused(
            f"{names.what} cannot be renamed from here: its name is put together of parts, or comes from a template of "
            f"the program, in {where}; change it there by hand"
        )
    _check_shared(names, found, places)
    splices = [places.splice(place, new) for place, (_, new) in found.items()]
    renaming = Renaming(edit, names.owner, names.old, names.events())
    renaming.new = names.new
    splices += data_splices(study.files, renaming)
    if not splices:
        raise EditRefused(f"{names.what} stands nowhere")
    splices = _in_order(splices)
    files = len({splice.file for splice in splices})
    says = (
        f"{names.what} is called `{names.new}` now, in {pluralize(len(splices), 'place')} of {pluralize(files, 'file')}"
    )
    return Plan(splices=tuple(splices), says=(says,), noticed=tuple(_noticed(names, study, splices)))


def _owner_and_name(edit: Rename, uses: Uses) -> tuple[str, str]:
    """The rule of a state or the act of an action, and the name. :raises EditRefused: there is none of this name."""
    old = normal_topic(edit.old) if edit.kind == "event" else edit.old
    known = uses.names(edit.kind)
    if edit.kind in ("state", "action"):
        owners = uses.names("rule" if edit.kind == "state" else "act")
        for owner in sorted(owners, key=len, reverse=True):
            if old.startswith(f"{owner}/") and old in known:
                return owner, old[len(owner) + 1 :]
        form = "RULE/STATE" if edit.kind == "state" else "ACT/ID"
        what = "state" if edit.kind == "state" else "action"
        raise EditRefused(f"there is no {what} `{edit.old}`; write {form}{did_you_mean(old, known)}")
    if old not in known:
        raise EditRefused(f"there is no {_KINDS[edit.kind][4:]} `{edit.old}`{did_you_mean(old, known)}")
    return "", old


# --- the new name -----------------------------------------------------------------------------------------------------


def _check_new_name(names: _Names) -> None:
    """:raises EditRefused: the new name is none."""
    kind, new = names.edit.kind, names.new
    if not new or new.strip() != new or find_unseen(new) >= 0 or any(each in new for each in BLANKS[1:]):
        raise EditRefused(f"`{new}` is no name: it has characters that can be seen, and no blanks around it")
    if new == names.old:
        raise EditRefused(f"{names.what} is called so already")
    if kind == "key" and (not is_writable_key(new) or new in _CONSTANTS):
        raise EditRefused(f"`{new}` cannot be a memory key: use letters, digits and `_`, and no word of conditions")
    if kind == "key" and "." in new:
        raise EditRefused(f"`{new}` would be a part of `{new.partition('.')[0]}`; a key's new name has no dot")
    if kind == "action" and any(each in new for each in " ,;"):
        raise EditRefused(f"`{new}` is no actionID: it has no blanks, commas and semicolons")


def _check_collisions(names: _Names, study: StudyState) -> None:
    """:raises EditRefused: the new name is another's, or the old one is no name of its own."""
    kind, uses, draft = names.edit.kind, names.uses, names.draft
    if kind == "key":
        _check_key(names)
    elif kind == "event":
        engine = engine_topics(draft)
        if names.old in engine:
            raise EditRefused(f"the engine raises `{names.old}` by itself; rename the act or rule that it is about")
        if names.new in engine:
            raise EditRefused(f"the engine raises `{names.new}` by itself; choose another name")
    if (taken := names.full(names.new)) in uses.names(kind):
        first = uses.of(kind, taken)[0]
        raise EditRefused(f"`{names.new}` is taken: {_place_text(first)}; choose another name")
    for old, new in names.events().items():
        if kind in ("act", "rule") and uses.of("event", new):
            first = uses.of("event", new)[0]
            raise EditRefused(f"the event `{new}` is there already: {_place_text(first)}; choose another name")
        if kind != "event" and old in _topics_of_others(names):
            raise EditRefused(
                f"the event `{old}` is raised for something else, too; give that another name first, or this event "
                "would mean only one of both"
            )
    if kind == "act":
        _check_settings(names, study)


def _topics_of_others(names: _Names) -> set[str]:
    """The events that the engine raises for all acts and rules but the one that is renamed (or whose state is)."""
    draft, name = names.draft, names.old if names.edit.kind != "state" else names.owner
    found = {
        each + ending for each in draft.acts if names.edit.kind != "act" or each != name for ending in ACT_END_SUFFIXES
    }
    for rule in draft.rules.values():
        if names.edit.kind == "act" or rule.name != name:
            found |= {f"{rule.name}_end", *(topic for _, topic in result_topics(rule))}
    return found


def _check_key(names: _Names) -> None:
    old, new, draft = names.old, names.new, names.draft
    head = old.partition(".")[0]
    if head in draft.tables:
        raise EditRefused(f"`{head}` is a table; its name is that of its file, tables/{head}.csv")
    if head == SESSION and draft.session_keys:
        raise EditRefused(f"the engine keeps `{SESSION}` itself; it has no other name")
    if "." in old and old not in draft.memory:
        raise EditRefused(f"`{old}` is a part of `{head}`; rename that, or change the part by hand")
    flat = sorted(key for key in draft.memory if key.startswith(f"{old}."))
    if flat:
        raise EditRefused(f"`{flat[0]}` is a memory key of its own, which begins as `{old}` does; rename it first")
    if new in draft.tables or new == SESSION:
        raise EditRefused(f"`{new}` is taken: {'a table' if new in draft.tables else 'the engine has it'}")
    parts = [key for key in names.uses.names("key") if key.startswith(f"{new}.")]
    if parts:
        raise EditRefused(f"`{parts[0]}` is there already: {_place_text(names.uses.of('key', parts[0])[0])}")


def _check_settings(names: _Names, study: StudyState) -> None:
    """:raises EditRefused: a table for several acts is about this one by its old name, or would be by its new one."""
    tables = study.checked.act_tables
    before = {key: table.name for key, table in tables.find_sources(names.old).items() if table.name != names.old}
    after = {key: table.name for key, table in tables.find_sources(names.new).items()}
    if before != {key: name for key, name in after.items() if key not in _own_settings(tables, names.old)}:
        name = next(iter({**before, **after}.values()))
        is_about = "is" if name in before.values() else "would be"
        raise EditRefused(
            f'[act."{name}"] in scenario.toml {is_about} about `{names.old if is_about == "is" else names.new}` by its '
            f"name, and what it sets would change; choose a name that is like it as the old one is"
        )


def _own_settings(tables: Any, act: str) -> set[str]:
    own = tables.by_name.get(act)
    return set(own.given) if own is not None else set()


def _check_shared(names: _Names, found: dict[NamePlace, tuple[str, str]], places: NamePlaces) -> None:
    """:raises EditRefused: a place in a template gives other acts, rules or states their names, too."""
    kind = names.edit.kind
    if kind in ("key", "event"):
        return
    own = names.full(names.old)
    for name in names.uses.names(kind):
        if name == own or not name.endswith(names.old):
            continue
        for use in names.uses.of(kind, name):
            template = use.location.template
            if isinstance(template, TemplateLocation) and places.find(use, names.old) in found:
                raise EditRefused(
                    f"{names.what} has its name from the template `{template.name}` ({template.file}, line "
                    f"{template.line}), and so has `{name}`; change it there by hand"
                )


# --- what is told -----------------------------------------------------------------------------------------------------


def _place_text(use: Use) -> str:
    return f"{use.location.file}, line {use.location.line}" + (f" ({use.where})" if use.where else "")


def _in_order(splices: list[Splice]) -> list[Splice]:
    """Each place once, in file order."""
    unique = {(splice.file, splice.start, splice.end): splice for splice in splices}
    return [unique[key] for key in sorted(unique)]


def _noticed(names: _Names, study: StudyState, splices: list[Splice]) -> Iterator[str]:
    kind, new = names.edit.kind, names.new
    other = {"act": "rule", "rule": "act"}.get(kind)
    if other is not None and names.uses.of("act" if other == "act" else "rule", new):
        yield f"there is {'an act' if other == 'act' else 'a rule'} `{new}`, too; the ends of both raise `{new}_end`"
    twin = next(
        (
            each
            for each in names.uses.names(kind)
            if each != names.full(names.old) and each.casefold() == names.full(new).casefold()
        ),
        None,
    )
    if twin is not None:
        yield f"`{twin}` differs from `{new}` only in capital letters"
    for event in names.events():
        raised = [use for use in names.uses.of("event", event) if use.defines]
        if kind != "event" and raised:
            yield f"`/{event}` was raised by hand, too ({_place_text(raised[0])}); that is renamed with it"
    yield from comments_with(names.old, study.files, splices)


PLANNERS: dict[type[Edit], Callable[[Any, StudyState], Plan]] = {Rename: plan_rename}

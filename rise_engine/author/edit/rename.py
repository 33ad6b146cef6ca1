"""Renaming: a new name everywhere at once, so that the study behaves as before.

It renames acts, rules, states, events, memory keys and actionIDs in files of acts and rules, conditions, templates,
keys, settings, start values, task files, `study.toml` and translations. An act's new name also renames the events of
its end. A rename that would collide with another name is refused. Comments with the old name are listed.
"""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

from rise_engine.author.edit.edits import Edit, Rename
from rise_engine.author.edit.name_places import NamePlace, NamePlaces, comments_with
from rise_engine.author.edit.plan import EditRefused, Plan, Splice, StudyState
from rise_engine.author.edit.rename_data import Renaming, data_splices
from rise_engine.author.edit.study_folder import sets_key
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.text import BLANKS, find_unseen, pluralize
from rise_engine.scenario.checking.cross_references import ACT_END_SUFFIXES, engine_topics
from rise_engine.scenario.checking.uses import Use, UsedKind, Uses
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.files.study_paths import SCENARIO_FILE
from rise_engine.scenario.files.toml_files import TomlFile, TomlTable
from rise_engine.scenario.files.xml import count_places
from rise_engine.scenario.model import SESSION, TemplateLocation, normal_topic, result_topics
from rise_engine.scenario.reading.act_settings import ActTables, read_act_tables
from rise_engine.scenario.reading.memory import is_writable_key
from rise_engine.syntax.toml import toml_key

_MAX_SHOWN = 5
_KINDS = {"act": "the act", "rule": "the rule", "state": "the state", "event": "the event", "key": "the memory key"}
_CONSTANTS = ("pi", "e", "r2d", "d2r")


class _RenamedName:
    """The subject of a rename: its names in `Uses`, and the new text for each of their places."""

    def __init__(self, edit: Rename, study: StudyState) -> None:
        self.edit = edit
        self.uses = study.checked.uses
        self.draft = study.checked.draft
        self.owner, self.old = _owner_and_name(edit, self.uses)
        self.new = normal_topic(edit.new) if edit.kind == "event" else edit.new

    @property
    def what(self) -> str:
        """The subject in words: "the state `Start` of `Main`"."""
        if self.edit.kind == "state":
            return f"the state `{self.old}` of `{self.owner}`"
        if self.edit.kind == "action":
            return f"the action `{self.old}` of `{self.owner}`"
        return f"{_KINDS[self.edit.kind]} `{self.old}`"

    def full(self, name: str) -> str:
        """Return a name in the form of `Uses`."""
        return f"{self.owner}/{name}" if self.owner else name

    def events(self) -> dict[str, str]:
        """Return the renamed events: those that the engine raises for the subject."""
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

    def places(self) -> Iterator[tuple[UsedKind, str, str]]:
        """Yield the names in `Uses` and their replacements: kind, name, new."""
        if self.edit.kind == "key":
            for name in self.uses.names("key"):
                if name == self.old:
                    yield "key", name, self.new
                elif name.startswith(f"{self.old}."):
                    yield "key", name, self.new + name[len(self.old) :]
            return
        if self.edit.kind != "event":
            yield self.edit.kind, self.full(self.old), self.new
        for old, new in self.events().items():
            yield "event", old, new


def plan_rename(edit: Rename, study: StudyState) -> Plan:
    """Plan a new name everywhere.

    :raises EditRefused: the old name does not exist, the new one is invalid or taken, a file cannot be read, or a place
        builds the name from several pieces.
    """
    if study.outline.unreadable:
        file, problem = next(iter(study.outline.unreadable.items()))
        raise EditRefused(f"{file} cannot be read ({problem}), so the names in it are not known; fix it first")
    names = _RenamedName(edit, study)
    _check_new_name(names)
    if edit.kind == "key" and (above := sets_key(study.above, names.old)):
        raise EditRefused(
            f"{above}, too; change it there by hand first (a plan that was made from it has to fit), "
            "and then rename it here"
        )
    _check_collisions(names, study)
    places = NamePlaces(study.files)
    found: dict[NamePlace, str] = {}
    named: Counter[NamePlace] = Counter()
    problems: list[str] = []
    for kind, name, new in names.places():
        for use in names.uses.of(kind, name):
            place = places.find(use)
            if place is None:
                problems.append(_why_not(use, places))
            else:
                found[place] = new
                named[place] += 1
    problems = list(dict.fromkeys(problems))
    if problems:
        more = f", and in {len(problems) - _MAX_SHOWN} more" if len(problems) > _MAX_SHOWN else ""
        raise EditRefused(
            f"{names.what} cannot be renamed from here; change it by hand: " + "; ".join(problems[:_MAX_SHOWN]) + more
        )
    _check_shared(names, found, places)
    _check_templates(names, named, study)
    splices = [places.splice(place, new) for place, new in found.items()]
    renaming = Renaming(edit.kind, names.owner, names.old, names.new, names.events())
    splices += data_splices(study.files, renaming)
    if not splices:
        raise EditRefused(f"{names.what} is written nowhere")
    splices = _in_order(splices)
    files = len({splice.file for splice in splices})
    says = (
        f"{names.what} is called `{names.new}` now, in {pluralize(len(splices), 'place')} of {pluralize(files, 'file')}"
    )
    return Plan(splices=tuple(splices), says=(says,), noticed=tuple(_rename_notes(names, study, splices)))


def _owner_and_name(edit: Rename, uses: Uses) -> tuple[str, str]:
    """Return a state's rule or an action's act, and the name. :raises EditRefused: the name does not exist."""
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


def _check_new_name(names: _RenamedName) -> None:
    """Check that the new name is valid. :raises EditRefused: it is not."""
    kind, new = names.edit.kind, names.new
    if not new or new.strip() != new or find_unseen(new) >= 0 or any(each in new for each in BLANKS[1:]):
        raise EditRefused(f"`{new}` is not a name: a name has visible characters, and no blanks around it")
    if new == names.old:
        raise EditRefused(f"{names.what} has this name already")
    if kind == "key" and (not is_writable_key(new) or new in _CONSTANTS):
        raise EditRefused(f"`{new}` cannot be a memory key: use letters, digits and `_`, and no word of conditions")
    if kind == "key" and "." in new:
        raise EditRefused(f"`{new}` would be a part of `{new.partition('.')[0]}`; a key's new name has no dot")
    if "${" in new or (kind == "state" and "|" in new):
        raise EditRefused(f"`{new}` is not a name: `${{` and, in states, `|` have a meaning of their own")
    if kind == "action" and any(each in new for each in " ,;"):
        raise EditRefused(f"`{new}` is not an actionID: an actionID has no blanks, commas or semicolons")


def _check_collisions(names: _RenamedName, study: StudyState) -> None:
    """Check for collisions. :raises EditRefused: the new name is taken, or the old one also names something else."""
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
        if kind != "event" and uses.of("event", old) and new in _topics_of_others(names):
            raise EditRefused(
                f"something waits for the event `{old}`; it would be `{new}`, which is raised for something else, too; "
                "choose another name"
            )
        if kind != "event" and old in _topics_of_others(names):
            raise EditRefused(
                f"the event `{old}` is raised for something else, too; give that another name first, or this event "
                "would mean only one of both"
            )
    if kind == "act":
        _check_settings(names, study)


def _topics_of_others(names: _RenamedName) -> set[str]:
    """Return the events that the engine raises for all acts and rules except the renamed one (or its state's rule)."""
    draft, name = names.draft, names.old if names.edit.kind != "state" else names.owner
    found = {
        each + ending for each in draft.acts if names.edit.kind != "act" or each != name for ending in ACT_END_SUFFIXES
    }
    for rule in draft.rules.values():
        if names.edit.kind == "act" or rule.name != name:
            found |= {f"{rule.name}_end", *(topic for _, topic in result_topics(rule))}
    return found


def _check_key(names: _RenamedName) -> None:
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
    text = next((each for each in draft.bare_words if each.name == new), None)
    if text is not None:
        place = text.locate()
        raise EditRefused(
            f"`{new}` is a text in {place.file}, line {place.line}, and would become the key; write it in quotation "
            "marks there first"
        )
    parts = [key for key in names.uses.names("key") if key.startswith(f"{new}.")]
    if parts:
        raise EditRefused(f"`{parts[0]}` is there already: {_place_text(names.uses.of('key', parts[0])[0])}")


def _check_settings(names: _RenamedName, study: StudyState) -> None:
    """:raises EditRefused: a table for several acts applies to this one by its old name, or would by its new one."""
    tables = _act_tables(study)
    before = {key: table.given[key] for key, table in tables.find_sources(names.old).items()}
    own = tables.by_name.get(names.old)
    after = {key: table.given[key] for key, table in tables.find_sources(names.new).items()}
    after |= own.given if own is not None else {}
    if before == after:
        return
    setting = next(key for key in {**before, **after} if before.get(key) != after.get(key))
    act = names.old if setting in before else names.new
    table = tables.find_sources(act)[setting]
    raise EditRefused(
        f"in scenario.toml, {table.header} sets `{setting}` of `{act}` by its name, and the new name would "
        f"change that; choose another name, or write the setting under [act.{toml_key(names.old)}] first"
    )


def _act_tables(study: StudyState) -> ActTables:
    """Read the tables of acts in scenario.toml, even if the study has other errors."""
    text = study.files.get(SCENARIO_FILE, b"").decode("utf-8-sig", "replace")
    try:
        values = tomllib.loads(text)
    except (ValueError, RecursionError):
        values = {}
    table = TomlTable(TomlFile(SourceFile(SCENARIO_FILE, b"", text), values), (), values, Diagnostics())
    return read_act_tables(table.section("act"), ScenarioDraft())


def _check_shared(names: _RenamedName, found: dict[NamePlace, str], places: NamePlaces) -> None:
    """Check places in templates. :raises EditRefused: one also names other acts, rules or states."""
    kind = names.edit.kind
    if kind in ("key", "event"):
        return
    own = names.full(names.old)
    for name in names.uses.names(kind):
        if name == own or not name.endswith(names.old):
            continue
        for use in names.uses.of(kind, name):
            if use.in_template and places.find(use) in found:
                template = use.place
                raise EditRefused(
                    f"{names.what} has its name from a template ({template.file}, line {template.line}), and so has "
                    f"`{name}`; change it there by hand"
                )


def _check_templates(names: _RenamedName, named: Counter[NamePlace], study: StudyState) -> None:
    """Check values of a `<use>`. :raises EditRefused: one is the name, but has another meaning in its template, too.

    :param named: how often each place is the name.
    """
    for file in (*study.checked.parts.acts, *study.checked.parts.rules):
        for place in named if file.brought else ():
            if place.file != file.source.name:
                continue
            use = file.tree.element_at(place.start)
            parameter = use.attribute_at(place.start)
            if parameter is None or count_places(file.brought.get(use, ()), parameter.name) <= named[place]:
                continue
            raise EditRefused(
                f"`{names.old}` cannot be renamed from here: in {place.file}, line {use.line}, `{parameter.name}` is "
                f"something else in the template `{use.attributes['template']}`, too; change it there by hand"
            )


# --- messages ---------------------------------------------------------------------------------------------------------


def _place_text(use: Use) -> str:
    return f"{use.location.file}, line {use.location.line}" + (f" ({use.where})" if use.where else "")


def _why_not(use: Use, places: NamePlaces) -> str:
    """Return why a use's name cannot be changed at its place."""
    template = use.location.template
    if isinstance(template, TemplateLocation):
        if template.file not in places.files:
            return f"{_place_text(use)}: the name is in the template `{template.name}`, which comes with the program"
        return (
            f"{_place_text(use)}: the template `{template.name}` puts the name together ({template.file}, line "
            f"{template.line})"
        )
    return f"{_place_text(use)}: the name is not written there as a whole"


def _in_order(splices: list[Splice]) -> list[Splice]:
    """Sort the splices in file order, each place once."""
    unique = {(splice.file, splice.start, splice.end): splice for splice in splices}
    return [unique[key] for key in sorted(unique)]


def _rename_notes(names: _RenamedName, study: StudyState, splices: list[Splice]) -> Iterator[str]:
    kind, new = names.edit.kind, names.new
    other = {"act": "rule", "rule": "act"}.get(kind)
    if other is not None and names.uses.of("act" if other == "act" else "rule", new):
        yield f"there is {'an act' if other == 'act' else 'a rule'} `{new}`, too; the ends of both raise `{new}_end`"
    own, wanted = names.full(names.old), names.full(new).casefold()
    twin = next((each for each in names.uses.names(kind) if each != own and each.casefold() == wanted), None)
    if twin is not None:
        yield f"`{twin}` differs from `{new}` only in capital letters"
    raised = {mention.name for mention in names.draft.raised_topics}
    for event in names.events():
        if kind != "event" and event in raised:
            yield f"`/{event}` is also raised explicitly; it gets the new name there, too"
    if not names.old.isdecimal():  # an actionID; plain numbers are too common
        yield from comments_with(names.old, study.files, splices)


PLANNERS: dict[type[Edit], Callable[[Any, StudyState], Plan]] = {Rename: plan_rename}

"""An oracle of edits: what a study means may differ only where an edit says, and after a rename only in the name.

The models that the reader of scenarios has made before and after are compared, places in files left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import msgspec

from rise_engine.author.edit import edits as of
from rise_engine.author.edit.edits import Edit
from rise_engine.author.edit.outline import WrittenAct, WrittenRule, WrittenState, WrittenUse
from rise_engine.author.edit.plan import StudyState
from rise_engine.author.edit.states import find_transition
from rise_engine.author.edit.translations import existing_language
from rise_engine.expression import Assignment, Expression
from rise_engine.expression.tokens import escape_text
from rise_engine.scenario.model import normal_topic
from rise_engine.scenario.reading.translations import LanguageTexts

Path: TypeAlias = tuple[str | int, ...]
"""Where in a model something stands: `("acts", "R_Yes", "actions", "2", "wait_for")`."""
_EVERYTHING: tuple[Path, ...] = ((),)
_FAR_REACHING = (("robot",), ("actions",), ("acts",), ("rules",), ("memory",))
"""Settings that say what is read, and what acts may hold."""
_SHOWN = 5
"""Places that are named."""


class BeyondTheEdit(AssertionError):
    """An edit has changed more than it says."""


def check_guard(edits: Sequence[Edit], before: StudyState, after: StudyState) -> None:
    """Look that a study means the same as before, but for what edits say.

    :param before: what the edits were planned on. :param after: what has come of them.
    :raises BeyondTheEdit: something else differs; the message names it.
    """
    if len(edits) == 1 and isinstance(edits[0], of.Rename):
        check_rename(edits[0], model_of(before), model_of(after))
        return
    allowed = [path for edit in edits for path in allowed_paths(edit, before, after)]
    if () in allowed:
        return
    beyond = [path for path in changed_paths(before, after) if not any(_is_within(path, each) for each in allowed)]
    if beyond:
        named = ", ".join(path_in_words(path) for path in beyond[:_SHOWN]) + (", ..." if len(beyond) > _SHOWN else "")
        raise BeyondTheEdit(f"{edits} would also change {named}")


def path_in_words(path: Path) -> str:
    """`act R_Yes, actions, 2`."""
    kind, *rest = path
    singular = {
        "acts": "act",
        "rules": "rule",
        "memory": "memory key",
        "tables": "table",
        "translations": "translation",
    }.get(str(kind), str(kind))
    return ", ".join([" ".join(map(str, (singular, *rest[:1]))), *map(str, rest[1:])])


def _is_within(path: Path, allowed: Path) -> bool:
    return path[: len(allowed)] == allowed


# --- the models ---------------------------------------------------------------------------------------------------

_SETTINGS = (
    "title",
    "mode",
    "keys",
    "act_settings",
    "fillers",
    "cue_keep",
    "study",
    "conditions",
    "private",
    "language",
    "languages",
    "explore",
    "properties",
    "trials",
)


def model_of(study: StudyState) -> dict[str, Any]:
    """What a study means, also when something is wrong with it: for `differences`."""
    checked = study.checked
    draft = checked.draft
    model: dict[str, Any] = {
        "acts": {name: {"actions": {each.id: each for each in act.actions}} for name, act in draft.acts.items()},
        "rules": draft.rules,
        "memory": draft.memory,
        "tables": {name: [table.columns, *table.rows, table.translations] for name, table in draft.tables.items()},
        "translations": _translations(checked.translations),
    }
    if checked.scenario is not None:
        model["settings"] = {name: getattr(checked.scenario, name) for name in _SETTINGS}
    return model


def _translations(languages: Mapping[str, LanguageTexts]) -> dict[str, Any]:
    """What is said in all languages, and of what it is the translation: `de/R_Yes/2/1`."""
    said: dict[str, Any] = {}
    for tag, found in languages.items():
        for act, key in found.keys:
            given = found.texts.get(f"{act}/{key}")
            said[f"{tag}/{act}/{key}"] = (given.template.text, given.of) if given is not None else None
    return said


def changed_paths(before: StudyState, after: StudyState) -> Iterator[Path]:
    """Where two studies differ in what they mean, as deep as can be said."""
    one, other = model_of(before), model_of(after)
    if before.checked.scenario is None or after.checked.scenario is None:
        one.pop("settings", None)
        other.pop("settings", None)
    for path in differences(one, other):
        if path[:2] == ("settings", "act_settings") and not (path[2] in one["acts"] and path[2] in other["acts"]):
            continue  # [act."R_*"] is for acts that come and go
        yield path


def differences(one: Any, other: Any, path: Path = ()) -> Iterator[Path]:
    """The places at which two pieces of data differ; where in files something stands does not matter."""
    if one is other:
        return
    if isinstance(one, dict) and isinstance(other, dict):
        for key in dict.fromkeys((*one, *other)):
            if key not in one or key not in other:
                yield (*path, key)
            elif one[key] is not other[key]:
                yield from differences(one[key], other[key], (*path, key))
    elif isinstance(one, list | tuple) and isinstance(other, list | tuple):
        if len(one) != len(other):
            yield path
            return
        for index, (left, right) in enumerate(zip(one, other, strict=True)):
            if left is not right:
                yield from differences(left, right, (*path, index))
    elif type(one) is not type(other):
        yield path
    elif isinstance(one, Expression | Assignment):
        if one.text != other.text:
            yield path
    elif isinstance(one, msgspec.Struct):
        for name in one.__struct_fields__:
            if name != "location" and getattr(one, name) is not getattr(other, name):
                yield from differences(getattr(one, name), getattr(other, name), (*path, name))
    elif one != other:
        yield path


# --- what an edit may change --------------------------------------------------------------------------------------


def allowed_paths(edit: Edit, before: StudyState, after: StudyState) -> Sequence[Path]:
    """Where the model may differ after an edit; `()`: anywhere."""
    match edit:
        case of.RemoveAct(act=act):
            return [("acts", act), *_of_translations(act, "", before)]
        case of.AddAct(name=name) | of.CopyAct(name=name):
            return [("acts", name)]
        case of.AddAction(act=act):
            return [("acts", act, "actions", edit.id.strip() or _new_action(act, before, after))]
        case of.RemoveAction(act=act, action=action):
            waits = [("acts", act, "actions", each.id, "wait_for") for each in _actions(act, before)]
            return [("acts", act, "actions", action), *waits, *_of_translations(act, action, before)]
        case of.SetActionType(act=act, action=action):
            return [("acts", act, "actions", action), *_of_translations(act, action, before)]
        case of.SetParameter(act=act, action=action):
            parameter = ("acts", act, "actions", action, "calls", edit.variant, "parameters", edit.parameter)
            return [parameter, *(_of_translations(act, action, before) if edit.value is None else ())]
        case of.SetWaits(act=act, action=action):
            return [("acts", act, "actions", action, "wait_for")]
        case of.SetActionFailure(act=act, action=action):
            return [("acts", act, "actions", action, "continue_on_failure")]
        case of.AddVariant(act=act, action=action) | of.RemoveVariant(act=act, action=action):
            return [("acts", act, "actions", action, "calls"), *_of_translations(act, action, before, after)]
        case of.AddRule(name=name) | of.CopyRule(name=name) | of.RemoveRule(rule=name):
            return [("rules", name)]
        case of.SetInitial(rule=rule):
            return [("rules", rule, "initial")]
        case of.SetPriority(rule=rule):
            return [("rules", rule, "priority")]
        case of.AddState(rule=rule, state=state) | of.RemoveState(rule=rule, state=state):
            begins = before.outline.rule(rule)
            waited_for = begins is not None and begins.initial == state.strip()  # without it, the rule begins nowhere
            return [("rules", rule, "states", state.strip()), *([("rules", rule, "initial")] if waited_for else [])]
        case of.AddTransition(rule=rule, state=state):
            return [("rules", rule, "states", state, "transitions")]
        case of.SetTransition() | of.RemoveTransition() | of.MoveTransition():
            return _of_transition(edit, before)
    return _of_statement_or_data(edit, before, after)


def _of_statement_or_data(edit: Edit, before: StudyState, after: StudyState) -> Sequence[Path]:
    match edit:
        case (
            of.AddStatement(at=at) | of.SetCall(at=at) | of.RemoveStatement(at=at) | of.MoveStatement(at=at)
            | of.AddBranch(at=at) | of.SetBranchCondition(at=at)
        ):  # fmt: skip
            return _of_block(at, before)
        case of.SetStartValue(key=key) | of.RemoveStartValue(key=key):
            return [("memory", key)]
        case of.SetSetting() | of.RenameSetting():
            if edit.file != "scenario.toml":
                return [*_of_texts_file(edit.file, edit.path, before, after)]
            if edit.path[:1] in _FAR_REACHING:
                return _EVERYTHING
            translated: list[Path] = [("translations",)] if edit.path[0] == "language" else []
            return [("settings",), ("tables",), *translated]
        case of.SetCell(table=table) | of.AddRow(table=table) | of.RemoveRow(table=table) | of.AddColumn(table=table):
            return [("tables", table)]
        case of.SetUseParameter():
            return [*_of_use(edit, before), *_of_use(edit, after)]
        case of.SetTranslation(language=language, act=act, text=text):
            tag, file = existing_language(before, language)
            first: list[Path] = [] if file in before.files else [("settings", "languages"), ("tables",)]
            return [("translations", f"{tag}/{act}/{text}"), *first]
        case of.AddLanguage():
            return [("settings", "languages"), ("tables",)]  # a column `text.de` is a translation from now on
    return _EVERYTHING  # a name everywhere, a whole file


def _of_texts_file(file: str, path: tuple[str, ...], *studies: StudyState) -> Iterator[Path]:
    """The translations that an entry of `texts/LANG.toml` is, or those of a whole act; other files have none."""
    for study in studies:
        for name in _translations(study.checked.translations):
            language, act, text = name.split("/", 2)
            if file == f"texts/{language}.toml" and path[:2] in ((act,), (act, text)):
                yield "translations", name


def _of_translations(act: str, action: str, *studies: StudyState) -> Iterator[Path]:
    """The translations of an act's texts, which go with them; `action`: of this one alone."""
    for study in studies:
        for tag, found in study.checked.translations.items():
            for name, key in found.keys:
                if name == act and (not action or key.partition("/")[0] == action):
                    yield "translations", f"{tag}/{act}/{key}"


def _actions(act: str, study: StudyState) -> Sequence[Any]:
    found = study.outline.act(act)
    return found.actions if found else ()


def _new_action(act: str, before: StudyState, after: StudyState) -> str:
    """The number that a new action has got."""
    there = {each.id for each in _actions(act, before)}
    return next((each.id for each in _actions(act, after) if each.id not in there), "")


def _state(rule: str, state: str, study: StudyState) -> WrittenState | None:
    found = study.outline.rule(rule)
    return next((each for each in found.states if each.id == state), None) if found else None


def _of_transition(
    edit: of.SetTransition | of.RemoveTransition | of.MoveTransition, study: StudyState
) -> Sequence[Path]:
    """The ways out of a state, and of those that share the way; of one that is set, all but its functions."""
    state = _state(edit.rule, edit.state, study)
    if state is None:
        return []
    index = find_transition(state, edit.index, edit.was)
    way = state.transitions[index]
    base: Path = ("rules", edit.rule, "states")
    if way.shared_by:
        return [(*base, name, "transitions") for name in way.shared_by]
    path = (*base, edit.state, "transitions")
    if isinstance(edit, of.SetTransition):
        fields = ("event", "ended", "outcomes", "after", "held", "condition", "target")
        return [(*path, index, name) for name in fields]
    return [path]


def _of_block(at: of.StatementAddress, study: StudyState) -> Sequence[Path]:
    base: Path = ("rules", at.rule, "states")
    if at.place != "transition":
        return [(*base, at.state, "on_entry" if at.place == "onEntry" else "on_exit")]
    state = _state(at.rule, at.state, study)
    if state is None or not 0 <= at.transition < len(state.transitions):
        return []
    way = state.transitions[at.transition]
    if way.shared_by:
        return [(*base, name, "transitions") for name in way.shared_by]
    return [(*base, at.state, "transitions", at.transition, "block")]


def _of_use(edit: of.SetUseParameter, study: StudyState) -> Iterator[Path]:
    """Whatever comes of a `<use>`, and whatever it stands in."""
    uses = [use for use in study.outline.uses if use.file == edit.file and use.template == edit.template]
    if not uses:
        return
    use = min(uses, key=lambda each: abs(each.line - edit.line))
    for act in study.outline.acts:
        if _holds(act, use):
            yield "acts", act.name
    for rule in study.outline.rules:
        if _holds(rule, use):
            yield "rules", rule.name


def _holds(part: WrittenAct | WrittenRule, use: WrittenUse) -> bool:
    return part.file == use.file and part.holds(use.node.start)


# --- renames ------------------------------------------------------------------------------------------------------

_NAME = "\0"
"""Stands for the name, whichever it is."""


def check_rename(edit: of.Rename, before: Mapping[str, Any], after: Mapping[str, Any]) -> None:
    """Compare the models of a study before and after (`model_of`), the old and the new name taken for the same.

    What acts do, what they say above all, may differ only where a memory key or an actionID stands in it; so may what
    they say in other languages.

    :raises BeyondTheEdit: something else differs.
    """
    owner, _, _ = edit.old.rpartition("/")
    old = edit.old[len(owner) + 1 :] if edit.kind in ("state", "action") else normal_topic(edit.old)
    new = normal_topic(edit.new) if edit.kind == "event" else edit.new
    written = {escape_text(name, quote) for name in (old, new) for quote in ("", "'", '"')}
    longest_first = sorted(written, key=len, reverse=True)

    def either(text: str) -> str:
        for name in longest_first:
            text = text.replace(name, _NAME)
        return text

    for part in before:
        inner = either if part not in ("acts", "translations") or edit.kind in ("key", "action") else _as_it_is
        one, other = before[part], after.get(part)
        if not (isinstance(other, dict) and _is_same_dict(one, other, either, inner)):
            what = {"acts": "what acts do", "rules": "what rules do"}.get(part, part)
            raise BeyondTheEdit(f"`{old}` as `{new}`: {what} would change")


def _as_it_is(text: str) -> str:
    return text


def _is_same_dict(
    one: Mapping[str, Any], other: Mapping[str, Any], outer: Callable[[str], str], inner: Callable[[str], str]
) -> bool:
    """Whether two tables are the same: their keys with the names taken for the same as `outer` does, what is in them as
    `inner` does."""
    if len(one) != len(other):
        return False
    found = {outer(str(key)): value for key, value in other.items()}
    keys = {outer(str(key)): value for key, value in one.items()}
    return keys.keys() == found.keys() and all(_is_same(value, found[key], inner) for key, value in keys.items())


def _is_same(one: Any, other: Any, either: Callable[[str], str]) -> bool:
    """Whether two parts of models are the same; places in files do not matter."""
    if one is other:
        return True
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return _is_same_dict(one, other, either, either)
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(
            _is_same(left, right, either) for left, right in zip(one, other, strict=True)
        )
    if type(one) is not type(other):
        return False
    if isinstance(one, Expression | Assignment):
        return either(one.text) == either(other.text)
    if isinstance(one, msgspec.Struct):
        names = (name for name in one.__struct_fields__ if name != "location")
        return all(_is_same(getattr(one, name), getattr(other, name), either) for name in names)
    if isinstance(one, set | frozenset):
        return set(map(either, map(str, one))) == set(map(either, map(str, other)))
    return bool(either(one) == either(other) if isinstance(one, str) else one == other)

"""Edits of translations, `texts/LANGUAGE.toml` (docs/reference/languages.md), and of their originals."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rise_engine.author.edit.edits import (
    AddLanguage,
    AnyEdit,
    Edit,
    SetParameter,
    SetSetting,
    SetTranslation,
    SetUseParameter,
)
from rise_engine.author.edit.outline import Outline, WrittenValue
from rise_engine.author.edit.plan import EditedText, EditRefused, Plan, Splice, StudyState, file_of
from rise_engine.author.edit.settings import plan_set_setting
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.expression.errors import shorten
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, TEXTS_FOLDER
from rise_engine.scenario.reading.translations import language_file
from rise_engine.scenario.speech.languages import language_problem
from rise_engine.scenario.speech.spoken_texts import SpokenText
from rise_engine.syntax.changes import TextEdit, changed_text, edits_between
from rise_engine.syntax.toml import KeyPath, toml_key, toml_value
from rise_engine.syntax.toml_edits import TomlText, remove_value, rename_keys, set_value

_SHOWN = 60
"""Maximum characters of a text in a sentence."""


def plan_set_translation(edit: SetTranslation, study: StudyState) -> Plan:
    """Plan a translation of the act's present text; without a value, remove it, even if its act no longer exists.

    :raises EditRefused: there is no such text or language, or the file cannot be changed there.
    """
    if problem := language_problem(edit.language):
        raise EditRefused(problem)
    language, name = existing_language(study, edit.language)
    if edit.value is None:
        return _plan_removal(edit, study, name)
    text, value = _find_text(edit, study), " ".join(edit.value.split())
    if not value:
        raise EditRefused(f"the translation of `{text.id}` is empty; to have none, remove it")
    entries = {"text": value, "of": text.text}
    says = f"{text.id} in {language}: “{shorten(value, _SHOWN)}”"
    if name not in study.files:
        content = f"[{toml_key(text.act)}]\n{_pair_text(text.key, entries)}\n"
        return Plan(written={name: content.encode()}, says=(f"{says} (the first in {language})",))
    file = file_of(study.files, name)
    toml = _read(file)
    before = toml.find((text.act, text.key))
    if before is None:
        after, was = changed_text(file.text, [_insertion(toml, text, entries, study.checked.texts)]), " (new)"
    else:
        after, was = _replaced(toml, (text.act, text.key), entries), f" (was “{shorten(_text_of(before), _SHOWN)}”)"
        was = ": it is still right" if _text_of(before) == value else was
    return Plan(splices=_splices(file, after), says=(says + was,))


def plan_add_language(edit: AddLanguage, study: StudyState) -> Plan:
    """Plan a language for translations; the first translation creates its file.

    :raises EditRefused: it is not a language, the study already has it, or it is the acts' language.
    """
    language = edit.language.strip()
    if problem := language_problem(language):
        raise EditRefused(problem)
    checked = study.checked
    own = checked.scenario.language if checked.scenario is not None else ""
    if language.lower() == own.lower():
        raise EditRefused(f"the acts are in `{own}` themselves")
    known = {each.lower(): each for each in checked.translations}
    if language.lower() in known:
        raise EditRefused(f"the study is translated into `{known[language.lower()]}` already")
    also = _also(study)
    plan = plan_set_setting(SetSetting(("languages", "also"), [*also, language]), study)
    return Plan(plan.splices, plan.written, (f"texts can be translated into {language}",), plan.noticed)


def _also(study: StudyState) -> list[str]:
    """Read the present list in `[languages]`; empty if it is unreadable."""
    try:
        table = tomllib.loads(file_of(study.files, SCENARIO_FILE).text).get("languages", {})
    except (EditRefused, ValueError, RecursionError):
        return []
    found = table.get("also", []) if isinstance(table, dict) else []
    return [each for each in found if isinstance(each, str)] if isinstance(found, list) else []


def existing_language(study: StudyState, language: str) -> tuple[str, str]:
    """Return a language in the spelling of its file, and that file, which may not exist yet."""
    for file in study.files:
        if file.lower() == language_file(language).lower():
            return file.rpartition("/")[2].removesuffix(".toml"), file
    return language, language_file(language)


def follow_texts(study: StudyState, moved: Mapping[tuple[str, str], str | None]) -> tuple[Splice, ...]:
    """Update the translations of texts that an edit of an act removes or renumbers.

    :param moved: by act and key of a text (`("R_Yes", "2/1")`), its new key in the act; None: it is removed.
    :raises EditRefused: the form of a file of translations does not allow this.
    """
    found: list[Splice] = []
    for name in sorted(study.files):
        if not (name.startswith(f"{TEXTS_FOLDER}/") and name.endswith(".toml")):
            continue
        file = file_of(study.files, name)
        toml, after = _read(file), file.text
        there = {of: key for of, key in moved.items() if toml.find(of) is not None}
        for of in [of for of, key in there.items() if key is None]:
            after = remove_value(after, of)
        after = rename_keys(after, {of: key for of, key in there.items() if key is not None})
        found += _splices(file, after)
    return tuple(found)


def _plan_removal(edit: SetTranslation, study: StudyState, name: str) -> Plan:
    file = file_of(study.files, name) if name in study.files else None
    before = _read(file).find((edit.act, edit.text)) if file is not None else None
    if file is None or before is None:
        raise EditRefused(f"`{edit.act}/{edit.text}` has no translation into `{edit.language}`")
    was = shorten(_text_of(before), _SHOWN)
    says = f"{edit.act}/{edit.text} has no translation into {edit.language} any more (was “{was}”)"
    return Plan(splices=_splices(file, remove_value(file.text, (edit.act, edit.text))), says=(says,))


def _find_text(edit: SetTranslation, study: StudyState) -> SpokenText:
    texts = study.checked.texts
    found = next((each for each in texts if (each.act, each.key) == (edit.act, edit.text)), None)
    if found is not None:
        return found
    acts = list(dict.fromkeys(each.act for each in texts))
    if edit.act not in acts:
        near = did_you_mean(edit.act, acts, limit=0)
        raise EditRefused(f"there is no act `{edit.act}` that says something{near}")
    keys = [each.key for each in texts if each.act == edit.act]
    raise EditRefused(f"the act `{edit.act}` has no text `{edit.text}`{did_you_mean(edit.text, keys)}")


# --- the text of a file ----------------------------------------------------------------------------------------------


def _read(file: EditedText) -> TomlText:
    """Parse a file of translations. :raises EditRefused: it is not TOML."""
    try:
        return TomlText(file.text)
    except EditRefused as error:
        raise EditRefused(f"{file.name} cannot be read, so it is not changed: {error}") from None


def _splices(file: EditedText, after: str) -> tuple[Splice, ...]:
    """Find the changes of a file. :raises EditRefused: because of its form, it would no longer be TOML."""
    try:
        TomlText(after)
    except EditRefused:
        message = f"{file.name} is written in a way that cannot be changed here; change it with an editor"
        raise EditRefused(message) from None
    return file.splices(edits_between(file.text, after))


def _text_of(translation: Any) -> str:
    """Return the text of a translation; empty for another value."""
    found = translation.get("text") if isinstance(translation, dict) else None
    return " ".join(found.split()) if isinstance(found, str) else ""


def _replaced(toml: TomlText, path: KeyPath, entries: Mapping[str, str]) -> str:
    """Replace the text of an existing translation."""
    whole = toml.entries.get(path)
    if whole is not None and (whole.value.kind != "table" or not whole.value.pairs):
        return changed_text(toml.text, [TextEdit(whole.value.start, whole.value.end, _inline(entries))])
    changed = []
    for name, text in entries.items():
        entry, value = toml.entries.get((*path, name)), toml.find((*path, name))
        if entry is not None and not (isinstance(value, str) and " ".join(value.split()) == text):
            changed.append(TextEdit(entry.value.start, entry.value.end, _quoted(text)))
    after = changed_text(toml.text, changed)
    for name, text in entries.items():
        if toml.find((*path, name)) is None:
            after = set_value(after, (*path, name), text)
    return after


def _insertion(toml: TomlText, text: SpokenText, entries: Mapping[str, str], texts: Sequence[SpokenText]) -> TextEdit:
    """Insert a new translation in the order of the acts."""
    new, line_end = _pair_text(text.key, entries), toml.newline
    section = next((each for each in toml.sections if each.path == (text.act,)), None)
    if section is not None:
        before = _before(text.key, [each.key for each in texts if each.act == text.act])
        pairs = [pair for pair in section.pairs if pair.names and pair.names[0] in before]
        at = toml.line_end(pairs[-1].value.end if pairs else section.header_end)
        return TextEdit(at, at, f"{line_end}{new}")
    head = f"[{toml_key(text.act)}]{line_end}{new}"
    before = _before(text.act, [each.act for each in texts])
    sections = [each for each in toml.sections if each.path and each.path[0] in before]
    if sections:
        at = toml.line_end(sections[-1].end)
        return TextEdit(at, at, f"{line_end * 2}{head}")
    following = next((each for each in toml.sections if each.path), None)
    if following is not None:
        at = toml.line_start(following.start)
        return TextEdit(at, at, f"{head}{line_end * 2}")
    gap = "" if not toml.text or toml.text.endswith("\n") else line_end
    gap += line_end if toml.text.strip() else ""
    return TextEdit(len(toml.text), len(toml.text), f"{gap}{head}{line_end}")


def _before(name: str, names: Sequence[str]) -> set[str]:
    return set(names[: names.index(name)])


def _pair_text(key: str, entries: Mapping[str, str]) -> str:
    return f"{toml_key(key)} = {_inline(entries)}"


def _inline(entries: Mapping[str, str]) -> str:
    return "{ " + ", ".join(f"{name} = {_quoted(text)}" for name, text in entries.items()) + " }"


def _quoted(text: str) -> str:
    """Quote a text for TOML, in single quotation marks if it contains double ones and the form allows it."""
    return toml_value(text, like="'" if '"' in text else "")


PLANNERS: dict[type[Edit], Callable[[Any, StudyState], Plan]] = {
    SetTranslation: plan_set_translation,
    AddLanguage: plan_add_language,
}


# --- translations of changed texts -----------------------------------------------------------------------------------


def follow_act(study: StudyState, act: str, key_of: Callable[[SpokenText], str | None]) -> tuple[Splice, ...]:
    """Update the translations of an act.

    :param key_of: gives the new key of a text; None: it is removed.
    :raises EditRefused: the form of a file of translations does not allow this.
    """
    moved = {(text.act, text.key): key_of(text) for text in study.checked.texts if text.act == act}
    return follow_texts(study, {of: key for of, key in moved.items() if key != of[1]})


def follow_action(
    study: StudyState, act: str, action: str, key_of: Callable[[SpokenText], str | None]
) -> tuple[Splice, ...]:
    """Update the translations of one action of an act."""
    return follow_act(study, act, lambda text: key_of(text) if text.action.id == action else text.key)


# --- originals -------------------------------------------------------------------------------------------------------


def edit_of_original(text: SpokenText, typed: str, outline: Outline) -> AnyEdit:
    """Return the edit that changes the original of a text.

    :raises EditRefused: its form can only be changed in its file.
    """
    act, written = outline.act(text.act), written_original(text, outline)
    if act is None or written is None:
        raise EditRefused("it cannot be found in the files")
    if written.parameter:
        use = next((each for each in outline.uses if each.node is written.node), None)
        if use is not None:
            return SetUseParameter(use.file, use.line, use.template, written.parameter, typed)
    if reason := written.reason or act.reason:
        raise EditRefused(reason)
    return SetParameter(text.act, text.action.id, text.parameter, typed, text.variant)


def written_original(text: SpokenText, outline: Outline) -> WrittenValue | None:
    """Return the written form of a text in its act's file; None: it is not found there."""
    act = outline.act(text.act)
    action = next((each for each in act.actions if each.id == text.action.id), None) if act is not None else None
    if action is None or text.variant >= len(action.calls):
        return None
    return action.calls[text.variant].parameters.get(text.parameter)

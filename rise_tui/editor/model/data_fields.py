"""Memory and keys as fields of a form."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import partial
from typing import Any

from rise_engine.author.edit.edits import AnyEdit, SetSetting, SetStartValue
from rise_engine.author.edit.plan import EditRefused
from rise_engine.base.text import pluralize
from rise_engine.scenario.files.study_paths import SCENARIO_FILE
from rise_tui.editor.model.acts import act_content
from rise_tui.editor.model.draft import StudyDraft
from rise_tui.editor.model.fields import TYPED, EditField, FieldChoice
from rise_tui.rendering.text import format_value, json_type_name, parse_typed_value

KEY_KINDS = ("act", "rule", "event", "set")
"""The functions of a key of the keyboard, in the words of [keys]."""


def memory_fields(draft: StudyDraft) -> list[EditField]:
    """Each key with its start value, its type, and the number of its uses."""
    return [
        EditField(key, key, "text", "" if value == "" else format_value(value), edits=partial(_start_value, key),
                  note=f"{json_type_name(value)}; {_used(draft, key)}")
        for key, value in draft.checked.draft.memory.items()
    ]  # fmt: skip


def _used(draft: StudyDraft, key: str) -> str:
    number = sum(not use.defines for use in draft.uses.of("key", key))
    return f"used in {pluralize(number, 'place')}" if number else "not used"


def _start_value(key: str, text: str | None) -> tuple[AnyEdit, ...]:
    value, _, remark = parse_typed_value(text or "")
    if remark:
        raise EditRefused(remark)
    return (SetStartValue(key, value),)


# --- keys -------------------------------------------------------------------------------------------------------------


def key_choices(draft: StudyDraft) -> list[FieldChoice]:
    """Everything that a key can start or raise, each as `KIND NAME`."""
    outline = draft.outline
    found = [FieldChoice(f"act {act.name}", f"act {act.name}", act_content(act)) for act in outline.acts]
    found += [FieldChoice(f"rule {rule.name}", f"rule {rule.name}", pluralize(len(rule.states), "state"))
              for rule in outline.rules]  # fmt: skip
    waits = {transition.form.event.lstrip("/") for rule in outline.rules for state in rule.states
             for transition in state.transitions if transition.form.event}  # fmt: skip
    ends = {f"{name}_end" for name in (*(act.name for act in outline.acts), *(rule.name for rule in outline.rules))}
    found += [
        FieldChoice(f"event /{event}", f"event /{event}", "a rule waits for it") for event in sorted(waits - ends)
    ]
    return found


def key_fields(draft: StudyDraft) -> list[EditField]:
    """Each key of the keyboard with its function and its label."""
    keys, choices = draft.values_in(SCENARIO_FILE).get("keys", {}), key_choices(draft)
    fields = []
    for key, binding in keys.items() if isinstance(keys, dict) else ():
        entry: Mapping[str, Any] = binding if isinstance(binding, dict) else {}
        kind = next((each for each in KEY_KINDS if each in entry), "")
        text = f"{kind} {entry[kind]}" if kind else ""
        more = {name: value for name, value in entry.items() if name not in (kind, "label")}
        label = entry.get("label", "")
        note = f"“{label}”" if label else ""
        note += "".join(f"  {name} = {json.dumps(value, ensure_ascii=False)}" for name, value in more.items())
        fields.append(
            EditField(key, key, "choice", text, choices=choices, new=TYPED, note=note,
                      reason="" if kind else "no form for this: e opens the file",
                      edits=partial(_key_edits, key, entry))
        )  # fmt: skip
    return fields


def new_key_edits(key: str, text: str) -> tuple[AnyEdit, ...]:
    """Return the edits that give an unused key a function: `act R_Hello`, `set score = 1`.

    :raises EditRefused: a key cannot do this.
    """
    return _key_edits(key, {}, text)


def _key_edits(key: str, entry: Mapping[str, Any], text: str | None) -> tuple[AnyEdit, ...]:
    """Change a key's function. The old label is removed, because it described the old function."""
    if text is None:
        return (SetSetting(("keys", key), None),)
    kind, _, name = text.partition(" ")
    if kind not in KEY_KINDS or not name.strip():
        raise EditRefused(f"write an act, a rule, an event or a value: “act NAME”, “set score = 1”; not “{text}”")
    before = next((each for each in KEY_KINDS if each in entry), "")
    if kind == before:
        return (SetSetting(("keys", key, kind), name.strip()),)
    return (SetSetting(("keys", key), {kind: name.strip()}),)

"""A name in what stands beside a scenario: task files, `study.toml`, translations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from rise_engine.author.edit.plan import EditRefused, Files, Splice
from rise_engine.author.edit.rename_task_files import task_splices
from rise_engine.author.edit.renaming import Renaming
from rise_engine.author.edit.text_edits import EditedText
from rise_engine.expression.key_places import keys_in_slots
from rise_engine.syntax.changes import edits_between
from rise_engine.syntax.toml import KeyPath
from rise_engine.syntax.toml_edits import TomlText, rename_key, set_value

_STUDY = "study.toml"
_TEXTS = "texts/"


def data_splices(files: Files, renaming: Renaming) -> Iterator[Splice]:
    """What changes in task files, study.toml and translations.

    :raises EditRefused: one of these files cannot be read, or the new name cannot stand there.
    """
    for name in sorted(files):
        if name.endswith(".jsonl"):
            yield from task_splices(EditedText(name, files[name]), renaming)
        elif name == _STUDY and renaming.kind == "key":
            yield from _toml_splices(EditedText(name, files[name]), lambda text: _in_study(text, renaming))
        elif name.startswith(_TEXTS) and name.endswith(".toml"):
            change: Callable[[str], str] | None = {
                "act": lambda text: _in_table_names(text, renaming),
                "action": lambda text: _in_text_ids(text, renaming),
                "key": lambda text: _in_texts(text, renaming),
            }.get(renaming.kind)
            if change is not None:
                yield from _toml_splices(EditedText(name, files[name]), change)


# --- TOML files -------------------------------------------------------------------------------------------------------


def _toml_splices(file: EditedText, change: Callable[[str], str]) -> Iterator[Splice]:
    try:
        after = change(file.text)
    except EditRefused as error:
        raise EditRefused(f"{file.name}: {error}") from None
    return iter(file.splices(edits_between(file.text, after)))


def _in_study(text: str, renaming: Renaming) -> str:
    """What levels of factors set."""
    factors = TomlText(text).values.get("factors")
    for factor, values in _tables(factors):
        for level, given in _tables(values.get("levels")):
            for key in _tables_or_none(given.get("memory")):
                new = renaming.key(key)
                if new != key:
                    text = rename_key(text, ("factors", factor, "levels", level, "memory", key), new)
    return text


def _in_table_names(text: str, renaming: Renaming) -> str:
    return rename_key(text, (renaming.old,), renaming.new) if renaming.old in TomlText(text).values else text


def _in_text_ids(text: str, renaming: Renaming) -> str:
    for key in _tables_or_none(TomlText(text).values.get(renaming.owner)):
        if key == renaming.old or key.startswith(f"{renaming.old}/"):
            text = rename_key(text, (renaming.owner, key), renaming.new + key[len(renaming.old) :])
    return text


def _in_texts(text: str, renaming: Renaming) -> str:
    """The slots of translations, and of the texts that they were translated from."""
    toml = TomlText(text)
    changes: list[tuple[KeyPath, str]] = []
    for path in toml.entries:
        found, value = toml.find(path)
        if found and isinstance(value, str):
            renamed = renaming.keys_in(value, keys_in_slots(value))
            if renamed != value:
                changes.append((path, renamed))
    for path, value in changes:
        text = set_value(text, path, value)
    return text


def _tables(values: Any) -> list[tuple[str, dict[str, Any]]]:
    return [(key, each) for key, each in _tables_or_none(values).items() if isinstance(each, dict)]


def _tables_or_none(values: Any) -> dict[str, Any]:
    return values if isinstance(values, dict) else {}

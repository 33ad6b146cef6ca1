"""Choosing the language that texts are shown in, and adding one to a study."""

from __future__ import annotations

from collections.abc import Callable

from rise_engine.author.edit.edits import AddLanguage, AnyEdit, SetSetting
from rise_tui.editor.model.fields import FieldChoice
from rise_tui.editor.model.text_rows import count_texts, languages_of, own_language, text_entries
from rise_tui.editor.page import EditFrame

LANGUAGE_HINT = "Its tag: fr, pt-BR. Another way of speaking to people: de-x-sie."


def choose_language(frame: EditFrame, now: str, show: Callable[[str], None]) -> None:
    """Let a language be chosen, or a new one be added; `show` is called with it."""
    draft = frame.study.draft
    languages = languages_of(draft)
    if not languages:
        ask_for_language(frame, show)
        return
    choices = []
    for language in languages:
        counts = count_texts(text_entries(draft, language))
        help = f"✓ {counts.there}  ▲ {counts.stale} changed since  ✗ {counts.missing} missing"
        choices.append(FieldChoice(language, language, help))

    def take(chosen: str) -> None:
        if chosen in languages:
            show(chosen)
        else:
            _add_language(frame, chosen, show)

    title = f"From {own_language(draft) or 'the acts'} into; another tag adds a language"
    frame.choose(title, choices, take, now=now, new="a new language")


def ask_for_language(frame: EditFrame, show: Callable[[str], None]) -> None:
    """Ask for a new language and add it; `show` is called with it then."""
    frame.ask_text("Another language", "", lambda tag: _add_language(frame, tag, show), hint=LANGUAGE_HINT)


def _add_language(frame: EditFrame, language: str, show: Callable[[str], None]) -> None:
    """With the first one, it is asked in which language the acts are."""

    def make(*edits: AnyEdit) -> None:
        frame.make(*edits, AddLanguage(language), then=lambda: show(language))

    if own_language(frame.study.draft):
        make()
        return
    frame.ask_text(
        "In which language are the acts?", "en", lambda own: make(SetSetting(("language",), own)),
        hint="Its tag: en, de, pt-BR.",
    )  # fmt: skip

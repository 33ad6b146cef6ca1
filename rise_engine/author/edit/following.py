"""Translations go with the texts that they are of: taken out with them, or kept under the number that they get."""

from __future__ import annotations

from collections.abc import Callable

from rise_engine.author.edit.plan import Splice
from rise_engine.author.edit.study_state import StudyState
from rise_engine.author.edit.translations import follow_texts
from rise_engine.scenario.spoken_texts import SpokenText


def follow_act(study: StudyState, act: str, key_of: Callable[[SpokenText], str | None]) -> tuple[Splice, ...]:
    """What becomes of the translations of an act.

    :param key_of: the key that a text of the act has afterwards; None: it goes.
    :raises EditRefused: a file of translations is written so that this cannot be done in it.
    """
    moved = {(text.act, text.key): key_of(text) for text in study.checked.texts if text.act == act}
    return follow_texts(study, {of: key for of, key in moved.items() if key != of[1]})


def follow_action(
    study: StudyState, act: str, action: str, key_of: Callable[[SpokenText], str | None]
) -> tuple[Splice, ...]:
    """The same for one action of an act."""
    return follow_act(study, act, lambda text: key_of(text) if text.action.id == action else text.key)

"""Every text of a scenario's acts that people hear or read, under the id that translations and tables have for it.

A text's id is `ACT/ID`, with the number of its wording behind it where there are several, `R_Praise/2/3`, and with the
parameter where that is not `message`: `R_Sing/1/words` (docs/reference/languages.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msgspec import Struct

from rise_engine.scenario.languages import language_fits
from rise_engine.scenario.model import Act, Action, ActionCall, ActionSpec, RobotProfile
from rise_engine.scenario.spoken import LANGUAGE, MESSAGE, spoken_parameters
from rise_engine.scenario.ssml import plain_words
from rise_engine.scenario.template import Template


class SpokenText(Struct, frozen=True):
    """One text."""

    act: str
    key: str
    """Which text of its act: `2`, `2/3`, `2/3/words`."""
    action: Action
    variant: int
    """Of several wordings, the number of this one, from 0."""
    parameter: str
    template: Template
    is_needed: bool
    """Whether a translation lacks something without it: it has words, and they are in the language of the acts."""

    @property
    def id(self) -> str:
        return f"{self.act}/{self.key}"

    @property
    def text(self) -> str:
        """As it is written, on one line."""
        return self.template.text

    @property
    def call(self) -> ActionCall:
        return self.action.calls[self.variant]


def text_key(action: str, variant: int | None, parameter: str) -> str:
    """Which text of its act.

    :param variant: the number of the wording, from 0; None: there is one alone.
    """
    parts = [action, *([] if variant is None else [str(variant + 1)]), *([] if parameter == MESSAGE else [parameter])]
    return "/".join(parts)


def spoken_texts(acts: Iterable[Act], robot: RobotProfile, language: str = "") -> Iterator[SpokenText]:
    """All texts, in the order of the acts and of the actions in them.

    :param language: the one that the acts are in; empty: it is not known.
    """
    for act in acts:
        for action in act.actions:
            several = len(action.calls) > 1
            for variant, call in enumerate(action.calls):
                spec = robot.actions[call.type]
                for parameter in spoken_parameters(spec):
                    template = call.parameters.get(parameter)
                    if template is None or not template.text:
                        continue
                    key = text_key(action.id, variant if several else None, parameter)
                    needed = _has_words(template) and not _is_in_other_language(call, spec, language)
                    yield SpokenText(act.name, key, action, variant, parameter, template, needed)


def _has_words(template: Template) -> bool:
    """Whether anything but memory values is in a text: a letter or a number, which is another word elsewhere."""
    pieces = (
        part if isinstance(part, str) else f"{part.before}{part.after}{part.fallback or ''}" for part in template.parts
    )
    return any(character.isalnum() for character in plain_words("".join(pieces)))


def _is_in_other_language(call: ActionCall, spec: ActionSpec, language: str) -> bool:
    """Whether the author says that it is in a language of its own, which it keeps in every session."""
    own = own_language(call, spec)
    return own is not None and not (language and (language_fits(language, own) or language_fits(own, language)))


def own_language(call: ActionCall, spec: ActionSpec) -> str | None:
    """The language that the author gives a single action; None: none, or the memory says it."""
    given = call.parameters.get(LANGUAGE) if LANGUAGE in spec.parameters else None
    return (given.constant or "").strip() or None if given is not None else None

"""Which actions say something, and what."""

from __future__ import annotations

from rise_engine.scenario.model import ActionSpec

SPEECH_CHANNEL = "speech"
"""An action that occupies this channel says something."""
MESSAGE = "message"
"""The parameter with what is said."""
LANGUAGE = "language"
"""The parameter with the language that it is in."""


def says_message(spec: ActionSpec) -> bool:
    """Whether an action says its `message` aloud: then the lexicon applies to it, and it can be SSML."""
    message = spec.parameters.get(MESSAGE)
    return message is not None and message.type == "text" and SPEECH_CHANNEL in spec.channels


def spoken_parameters(spec: ActionSpec) -> tuple[str, ...]:
    """The parameters of an action whose texts are translated: those declared `spoken`, and the `message` of whatever
    says one aloud."""
    return tuple(
        name
        for name, parameter in spec.parameters.items()
        if parameter.spoken or (name == MESSAGE and says_message(spec))
    )

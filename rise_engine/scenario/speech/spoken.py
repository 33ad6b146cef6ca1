"""Which actions say something, and in which parameters."""

from __future__ import annotations

from rise_engine.scenario.model import ActionSpec

SPEECH_CHANNEL = "speech"
"""An action on this channel says something."""
MESSAGE = "message"
"""The parameter with the words."""
LANGUAGE = "language"
"""The parameter with their language."""


def says_message(spec: ActionSpec) -> bool:
    """Whether an action says its `message` aloud, so that the lexicon applies to it and it can be SSML."""
    message = spec.parameters.get(MESSAGE)
    return message is not None and message.type == "text" and SPEECH_CHANNEL in spec.channels


def spoken_parameters(spec: ActionSpec) -> tuple[str, ...]:
    """The parameters with texts to translate: those declared `spoken`, and the `message` if it is said aloud."""
    return tuple(
        name
        for name, parameter in spec.parameters.items()
        if parameter.spoken or (name == MESSAGE and says_message(spec))
    )

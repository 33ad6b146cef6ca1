"""The words of BML 1.0: its elements with their attributes, sync points and contents, as a table.

Source: the standard's wiki, "BML 1.0 Standard" (www.mindmakers.org/projects/bml-1-0/wiki), sections on blocks, on
synchronisation and on each behaviour. The reader knows BML by this table, and `rise_exchange.bml.schema` makes the
schema of it. What older drafts had besides, and what is found in files, stands in `DRAFT_ATTRIBUTES` and `MARKS`.
"""

from __future__ import annotations

from msgspec import Struct

NAMESPACE = "http://www.bml-initiative.org/bml/bml-1.0"
"""Of BML 1.0's core."""
EXTENSIONS = "http://www.bml-initiative.org/bml/coreextensions-1.0"
"""Of its core extensions."""
DRAFT_NAMESPACES = ("", "http://www.mindmakers.org/projects/BML")
"""Of files that were written before BML 1.0, and go on being written so."""
OWN_NAMESPACE = "urn:rise:act"
"""Of what acts have and BML has not."""
DESCRIPTION_TYPE = "application/x-rise+xml"
"""The `type` of a `<description>` that holds an action of an act (BML 1.0: additional behaviour descriptions)."""
SSML_TYPE = "application/ssml+xml"
PRIORITY = "1"
"""Of our descriptions: any is better than the core, and there is one."""

COMPOSITIONS = ("MERGE", "APPEND", "REPLACE")
START, END = "start", "end"
_STROKE = ("ready", "strokeStart", "stroke", "strokeEnd", "relax")


class ElementWords(Struct, frozen=True):
    """What an element of BML can have."""

    required: tuple[str, ...] = ()
    """Attributes that it must have."""
    optional: tuple[str, ...] = ()
    """Further attributes, besides sync points and `id`."""
    points: tuple[str, ...] = ()
    """Its sync points between start and end."""
    children: tuple[str, ...] = ()
    text: bool = False
    """Whether it holds text."""


BEHAVIORS: dict[str, ElementWords] = {
    "face": ElementWords((), ("amount", "overshoot"), ("attackPeak", "relax"), ("lexeme",)),
    "faceLexeme": ElementWords(("lexeme",), ("amount", "overshoot"), ("attackPeak", "relax")),
    "faceFacs": ElementWords(("au",), ("side", "amount", "overshoot"), ("attackPeak", "relax")),
    "faceShift": ElementWords((), ("lexeme", "amount", "overshoot"), (), ("lexeme",)),
    "gaze": ElementWords(("target",), ("influence", "offsetAngle", "offsetDirection"), ("ready", "relax")),
    "gazeShift": ElementWords(("target",), ("influence", "offsetAngle", "offsetDirection")),
    "gesture": ElementWords(("lexeme",), ("mode",), _STROKE),
    "pointing": ElementWords(("target",), ("mode",), _STROKE),
    "head": ElementWords(("lexeme",), ("repetition", "amount"), _STROKE),
    "headDirectionShift": ElementWords(("target",)),
    "locomotion": ElementWords(("target",), ("manner",)),
    "posture": ElementWords((), (), ("ready", "relax"), ("stance", "pose")),
    "postureShift": ElementWords((), (), (), ("stance", "pose")),
    "speech": ElementWords((), (), (), ("text",)),
    "wait": ElementWords((), ("duration", "max-wait")),
}
"""The behaviours, each with an `id`, `start` and `end`, and with descriptions in it."""
PARTS: dict[str, ElementWords] = {
    "text": ElementWords(children=("sync",), text=True),
    "lexeme": ElementWords(("lexeme",), ("amount",)),
    "stance": ElementWords(("type",)),
    "pose": ElementWords(("part", "lexeme")),
    "synchronize": ElementWords((), ("ref",), (), ("sync",)),
    "before": ElementWords(("ref",), (), (), ("sync",)),
    "after": ElementWords(("ref",), (), (), ("sync",)),
}
"""What stands in behaviours and constraints; a `<sync>` has an `id` in a text and a `ref` in a constraint."""
BLOCK = ElementWords(("id",), ("characterId", "composition"), (), (*BEHAVIORS, "required", "constraint"))
INNER_POINTS = frozenset(point for words in BEHAVIORS.values() for point in words.points)
"""Sync points that actions do not have."""

DRAFT_ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "bml": ("character",),
    "face": ("type", "side", "au"),
    "gaze": ("type", "modality"),
    "gazeShift": ("type", "modality"),
    "gesture": ("type", "hand"),
    "head": ("type", "repeats"),
    "speech": ("language", "voice", "type", "text"),
}
"""Of files in a draft's namespace: read over, and named as lost."""
MARKS = ("sync", "tm")
"""Points in a text; `tm` in drafts."""
PROSODY = ("pitchaccent", "boundary", "emphasis", "prosody", "rate")
"""What drafts have in a text on how it sounds."""

"""The words of BML 1.0: its elements with their attributes, sync points and contents, as a table.

Source: the standard's wiki, "BML 1.0 Standard" (www.mindmakers.org/projects/bml-1-0/wiki), sections on blocks, on
synchronisation and on each behaviour. The reader and `rise_exchange.bml.schema` use this table. Words of older drafts
and existing files are in `DRAFT_ATTRIBUTES` and `MARKS`.
"""

from __future__ import annotations

from msgspec import Struct

NAMESPACE = "http://www.bml-initiative.org/bml/bml-1.0"
"""The namespace of BML 1.0's core."""
EXTENSIONS = "http://www.bml-initiative.org/bml/coreextensions-1.0"
"""The namespace of its core extensions."""
DRAFT_NAMESPACES = ("", "http://www.mindmakers.org/projects/BML")
"""The namespaces of files from before BML 1.0, and of later files in that style."""
OWN_NAMESPACE = "urn:rise:act"
"""The namespace for parts of acts that BML lacks."""
DESCRIPTION_TYPE = "application/x-rise+xml"
"""The `type` of a `<description>` that contains an action of an act (BML 1.0: additional behaviour descriptions)."""
SSML_TYPE = "application/ssml+xml"
PRIORITY = "1"
"""The priority of our descriptions: any value is higher than the core's."""

COMPOSITIONS = ("MERGE", "APPEND", "REPLACE")
START, END = "start", "end"
_STROKE = ("ready", "strokeStart", "stroke", "strokeEnd", "relax")


class ElementWords(Struct, frozen=True):
    """The attributes and contents of an element of BML."""

    required: tuple[str, ...] = ()
    """Required attributes."""
    optional: tuple[str, ...] = ()
    """Further attributes, except sync points and `id`."""
    points: tuple[str, ...] = ()
    """Its sync points between start and end."""
    children: tuple[str, ...] = ()
    text: bool = False
    """Whether it contains text."""


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
"""The behaviours. Each also has an `id`, `start` and `end`, and may contain descriptions."""
PARTS: dict[str, ElementWords] = {
    "text": ElementWords(children=("sync",), text=True),
    "lexeme": ElementWords(("lexeme",), ("amount",)),
    "stance": ElementWords(("type",)),
    "pose": ElementWords(("part", "lexeme")),
    "synchronize": ElementWords((), ("ref",), (), ("sync",)),
    "before": ElementWords(("ref",), (), (), ("sync",)),
    "after": ElementWords(("ref",), (), (), ("sync",)),
}
"""The parts of behaviours and constraints. A `<sync>` has an `id` in a text and a `ref` in a constraint."""
BLOCK = ElementWords(("id",), ("characterId", "composition"), (), (*BEHAVIORS, "required", "constraint"))
INNER_POINTS = frozenset(point for words in BEHAVIORS.values() for point in words.points)
"""Sync points without a counterpart in actions."""

DRAFT_ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "bml": ("character",),
    "face": ("type", "side", "au"),
    "gaze": ("type", "modality"),
    "gazeShift": ("type", "modality"),
    "gesture": ("type", "hand"),
    "head": ("type", "repeats"),
    "speech": ("language", "voice", "type", "text"),
}
"""Attributes in files of a draft's namespace. They are skipped and reported as lost."""
MARKS = ("sync", "tm")
"""Points in a text; `tm` in drafts."""
PROSODY = ("pitchaccent", "boundary", "emphasis", "prosody", "rate")
"""The elements for intonation in drafts' texts."""

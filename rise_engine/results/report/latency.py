"""How long participants waited for an answer, in its parts: numbers from the acts of a session, or of several."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from msgspec import Struct

from rise_engine.results.analysis.model import Cue, PlayedAct
from rise_engine.results.analysis.statistics import Share, Summary, share_over, summarise
from rise_engine.results.report.bands import BANDS, band_of

BIN = 0.25
"""Seconds of a histogram's bin."""
LAST_BIN = 6.0
"""Seconds from which on values are counted together, as the last bin."""
LIMITS = (1.0, 2.0)
"""Seconds over which shares are told."""


class LatencyPart(Struct, frozen=True):
    """One part of a latency."""

    name: str
    about: str
    """From when to when."""
    values: tuple[float, ...]

    @property
    def summary(self) -> Summary | None:
        return summarise(self.values)

    def over(self, limit: float) -> Share:
        """How many are longer than that many seconds."""
        return share_over(self.values, limit)


class LatencyFacts(Struct, frozen=True):
    """The latencies of the acts that answered a cue, and apart from them those of fillers."""

    parts: tuple[LatencyPart, ...]
    """wizard, way (or, of acts that no key led to, no key), queue, robot, voice: of answers, and those of an act add up
    to its response."""
    response: LatencyPart
    to_filler: LatencyPart
    """From the cue until the first filler."""
    after_filler: LatencyPart
    """From the cue to the answer, of cues that a filler bridged."""
    without_filler: LatencyPart
    """The same, of the others."""
    in_bands: tuple[int, ...]
    """How many responses lie in each of `rise_engine.results.report.bands.BANDS`."""


def latencies(acts: Iterable[PlayedAct], cues: Iterable[Cue] = ()) -> LatencyFacts:
    """The numbers of answers and fillers.

    :param acts: all acts of one session or of several; those that answered no cue are left out.
    :param cues: of the same sessions.
    """
    found = answers(acts)
    marked = [cue for cue in cues if cue.undone_at is None]
    waits = [(cue, round(cue.answered_at - cue.at, 6)) for cue in marked if cue.answered_at is not None]
    parts = (
        _part("wizard", "cue to key", [act.wizard_s for act in found]),
        _part("way", "key to engine", [act.way_s for act in found if act.key_at is not None]),
        _part("no key", "cue to engine", [act.way_s for act in found if act.key_at is None]),
        _part("queue", "engine to turn", [act.queue_s for act in found]),
        _part("robot", "turn to confirmation", [act.robot_s for act in found]),
        _part("voice", "confirmation to voice", [act.voice_s for act in found if act.speaks]),
    )
    response = _part("response", "cue to answer", [act.response_s for act in found])
    counts = [band_of(value) for value in response.values]
    return LatencyFacts(
        parts=parts,
        response=response,
        to_filler=_part(
            "filler", "cue to filler", [round(cue.filled_at - cue.at, 6) for cue in marked if cue.filled_at is not None]
        ),
        after_filler=_part(
            "with a filler", "cue to answer", [wait for cue, wait in waits if cue.filled_at is not None]
        ),
        without_filler=_part("without", "cue to answer", [wait for cue, wait in waits if cue.filled_at is None]),
        in_bands=tuple(counts.count(at) for at in range(len(BANDS))),
    )


def answers(acts: Iterable[PlayedAct]) -> list[PlayedAct]:
    """The acts that answered a cue (`PlayedAct.answer_s`), of which the answer's moment is known."""
    return [act for act in acts if act.answer_s is not None]


def histogram(values: Iterable[float]) -> list[int]:
    """How many values lie in each bin of `BIN` seconds up to `LAST_BIN`, and, as the last one, beyond.

    A bin holds its lower limit and not its upper one.
    """
    counts = [0] * (round(LAST_BIN / BIN) + 1)
    for value in values:
        counts[min(max(0, int(value / BIN)), len(counts) - 1)] += 1
    return counts


def _part(name: str, about: str, values: Sequence[float | None]) -> LatencyPart:
    return LatencyPart(name, about, tuple(value for value in values if value is not None))

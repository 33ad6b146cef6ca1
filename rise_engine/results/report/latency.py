"""The waiting times of participants for answers, in parts: numbers and distributions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from msgspec import Struct

from rise_engine.results.analysis.model import Cue, InterruptionKind, PlayedAct
from rise_engine.results.analysis.statistics import Share, Summary, share_over, summarise


class Band(Struct, frozen=True):
    """A range of latencies, from the band before up to a limit."""

    limit: float
    """Seconds. Infinite for the last band."""
    name: str
    """`up to 1 s`."""
    short: str
    """The name in a drawing: `1 s`."""
    known: str
    """What is known about it."""


class Source(Struct, frozen=True):
    """A publication behind the bands."""

    citation: str
    doi: str = ""
    """Empty: it has none."""
    found: str = ""
    """Its finding in our words."""


BANDS = (
    Band(
        0.25,
        "up to 0.25 s",
        "0.25",
        "between people, the gap between turns is about 0.2 s in every language studied",
    ),
    Band(
        1.0,
        "up to 1 s",
        "1",
        "people like answers of a robot best up to 1 s, without a difference below it; between people, an answer after "
        "about 0.6 s sounds less willing",
    ),
    Band(
        2.0,
        "up to 2 s",
        "2",
        "a robot should react within 2 s; people like a longer wait less, unless a filler fills it",
    ),
    Band(4.0, "up to 4 s", "4", "a wait that people notice; a filler makes it seem shorter"),
    Band(float("inf"), "above 4 s", "", "one small study found it less fluent, not significantly"),
)

SOURCES = (
    Source(
        "Stivers et al. 2009, PNAS 106(26), 10587–10592",
        "10.1073/pnas.0903616106",
        "in ten languages, each mean gap is within 0.25 s of the overall mean",
    ),
    Source(
        "Levinson & Torreira 2015, Frontiers in Psychology 6:731",
        "10.3389/fpsyg.2015.00731",
        "gaps of about 0.2 s, although planning a word takes more than 0.6 s",
    ),
    Source(
        "Templeton et al. 2022, PNAS 119(4), e2116915119",
        "10.1073/pnas.2116915119",
        "answers within 0.25 s go with feeling connected",
    ),
    Source(
        "Roberts, Margutti & Takano 2011, Discourse Processes 48(5), 331–354",
        "10.1080/0163853X.2011.558002",
        "after 0.6 s and 1.2 s speakers are rated less willing, in English, Italian and Japanese",
    ),
    Source(
        "Kendrick & Torreira 2015, Discourse Processes 52(4), 255–289",
        "10.1080/0163853X.2014.955997",
        "most late answers are not the hoped-for ones",
    ),
    Source(
        "Shiwa et al. 2008, HRI, 153–160; 2009, International Journal of Social Robotics 1, 141–155",
        "",
        "best liked at 1 s; a robot should react within 2 s; a filler moderates the wait",
    ),
    Source(
        "Stedtler et al. 2024, HRI companion, 1013–1017",
        "",
        "waits of 4 s and 10 s lowered the fluency that people perceived, not significantly (17 people)",
    ),
    Source(
        "Thesis, Utrecht University, handle 20.500.12932/18293",
        "",
        "with fillers a robot seemed faster and livelier to children, and the wizard was calmer",
    ),
)

CAVEATS = (
    "A person marks each cue with a key. Their own delay is unknown and part of every latency.",
    "The robot confirms an action before people hear or see it. The first sound comes later.",
    "Measure it in a recording.",
    "The bands come from speech, between people and with few robots, in Japanese, English and other European samples.",
    "They give orientation and test nothing.",
)


def band_of(seconds: float) -> int:
    """Return the index of a latency's band. A band includes its limit.

    >>> [band_of(each) for each in (0.25, 0.26, 1.0, 60.0)]
    [0, 1, 1, 4]
    """
    return next(at for at, band in enumerate(BANDS) if seconds <= band.limit)


BIN = 0.25
"""The width of a histogram's bin in seconds."""
LAST_BIN = 6.0
"""The start of the last bin in seconds; it counts all larger values."""
LIMITS = (1.0, 2.0)
"""Limits in seconds; reports give the shares above them."""


class LatencyPart(Struct, frozen=True):
    """One part of a latency."""

    name: str
    about: str
    """Its start and end."""
    values: tuple[float, ...]

    @property
    def summary(self) -> Summary | None:
        return summarise(self.values)

    def over(self, limit: float) -> Share:
        """Return the share above that many seconds."""
        return share_over(self.values, limit)


class LatencyFacts(Struct, frozen=True):
    """The latencies of acts that answered a cue, and separately those of fillers."""

    parts: tuple[LatencyPart, ...]
    """wizard, way, rules (no key: if no key caused the act), queue, robot, voice. Only of answers; an act's parts add
    up to its response."""
    response: LatencyPart
    to_filler: LatencyPart
    """Seconds from the cue to the first filler."""
    after_filler: LatencyPart
    """Seconds from the cue to the answer (`PlayedAct.answer_s`), for cues with a filler."""
    without_filler: LatencyPart
    """The same for cues without a filler."""
    in_bands: tuple[int, ...]
    """The number of responses in each of `rise_engine.results.report.latency.BANDS`."""
    before_cue: int
    """Answers that were requested before their cue. No latency includes them."""
    interrupted: dict[InterruptionKind, int]
    """Other answers whose wait was interrupted, by what. No latency includes them."""


def latencies(acts: Iterable[PlayedAct], cues: Iterable[Cue] = ()) -> LatencyFacts:
    """Compute the numbers of answers and fillers.

    :param acts: all acts of one or several sessions; those that answered no cue are left out.
    :param cues: the cues of the same sessions.
    """
    acts = list(acts)
    found = answers(acts)
    left_out = [act for act in acts if act.answer_s is None and not act.filler and act.response_s is not None]
    marked = [cue for cue in cues if cue.undone_at is None]
    waits = [(cue, cue.answer_s) for cue in marked]
    parts = (
        _part("wizard", "cue to key", [act.wizard_s for act in found]),
        _part("way", "key to engine", [act.way_s for act in found]),
        _part("rules", "engine to request", [act.rules_s for act in found if act.key_at is not None]),
        _part("no key", "cue to request", [act.rules_s for act in found if act.key_at is None]),
        _part("queue", "request to turn", [act.queue_s for act in found]),
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
        before_cue=sum(act.before_cue for act in left_out),
        interrupted=dict(
            Counter(act.response_interrupted for act in left_out if act.response_interrupted and not act.before_cue)
        ),
    )


def answers(acts: Iterable[PlayedAct]) -> list[PlayedAct]:
    """Return the acts that answered a cue at a known time (`PlayedAct.answer_s`)."""
    return [act for act in acts if act.answer_s is not None]


def histogram(values: Iterable[float]) -> list[int]:
    """Count the values in each bin of `BIN` seconds up to `LAST_BIN`, and beyond it in the last bin.

    A bin includes its lower limit but not its upper one.
    """
    counts = [0] * (round(LAST_BIN / BIN) + 1)
    for value in values:
        counts[min(max(0, int(value / BIN)), len(counts) - 1)] += 1
    return counts


def _part(name: str, about: str, values: Sequence[float | None]) -> LatencyPart:
    return LatencyPart(name, about, tuple(value for value in values if value is not None))

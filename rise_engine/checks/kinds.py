"""Explores and plays every kind of session of a study, to find problems in one condition or language.

The results are stored beside the study, so that an unchanged study is explored only once.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from rise_engine import __version__
from rise_engine.author.explore.exploration import QUICK_SECONDS, Exploration, explore, main_rule, quick_bounds
from rise_engine.author.explore.moves import Bounds
from rise_engine.author.explore.playthrough import PlayedThrough, play_through
from rise_engine.author.explore.situation_graph import FindingLevel
from rise_engine.author.explore.space import Space
from rise_engine.base.files import write_whole
from rise_engine.base.json_codec import encode
from rise_engine.base.text import pluralize
from rise_engine.checks.outcome import Finding
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Mode, Scenario
from rise_engine.study.model import Study
from rise_engine.study.participants import SessionKind, session_kinds
from rise_engine.study.review import review_study

KEPT = ".kinds.json"
"""The file of results in the study's folder; hidden, so that it is not published."""
_MAX_KEPT = 200
_KINDS_IN_ALL = frozenset(
    {"never-started", "never-entered", "never-taken", "never-done", "not-met", "idle-key", "failure-alike"}
)
"""Findings that hold only if every kind of session that runs the scenario has them."""
_LEVELS: tuple[FindingLevel, ...] = ("problem", "warning", "remark")
_NAMED = 3
"""Maximum number of kinds of session that a finding names."""


class KindFinding(Struct, frozen=True):
    """A finding in a kind of session."""

    level: FindingLevel
    kind: str
    """Like `ExploreFinding.kind`, or `play-failed`."""
    text: str
    place: str
    """`scenario/rules/quiz.xml:75:3`, relative to the study's folder; empty: there is none."""


class KindExploration(Struct, frozen=True):
    """The results for one kind of session."""

    situations: int
    is_complete: bool
    """Whether all situations within the bounds were explored."""
    is_played: bool
    """Whether it was played until nothing new happened."""
    acts: tuple[str, ...]
    """The acts that began during the playthrough."""
    findings: tuple[KindFinding, ...]


class MergedFinding(Struct, frozen=True):
    """The same finding in one or several kinds of session."""

    finding: KindFinding
    """Its form in the first kind."""
    kinds: tuple[str, ...]
    """The names of these kinds."""
    of: int
    """The number of all kinds."""
    first: tuple[int, int]
    """Its first occurrence: the index of the kind, and the index of the finding in it."""

    @property
    def where(self) -> str:
        """`(in 2 of 8 kinds of session: polite (de), direct (de))`; empty: in all."""
        if len(self.kinds) == self.of:
            return ""
        more = ", ..." if len(self.kinds) > _NAMED else ""
        return f"(in {len(self.kinds)} of {self.of} kinds of session: {', '.join(self.kinds[:_NAMED])}{more})"

    def row(self) -> dict[str, Any]:
        """Return the finding for programs (`--json`)."""
        return {**msgspec.structs.asdict(self.finding), "kinds": self.kinds}


class StudyExploration(Struct, frozen=True):
    """The results for all kinds of session of a study."""

    kinds: tuple[SessionKind, ...]
    explorations: tuple[KindExploration, ...]
    findings: tuple[MergedFinding, ...]
    """Problems first."""
    acts: int
    """The number of acts in the scenarios of these kinds."""

    @property
    def problems(self) -> int:
        return sum(each.finding.level == "problem" for each in self.findings)

    @property
    def sentence(self) -> str:
        """A summary in one line with numbers."""
        conditions = dict.fromkeys(kind.run.condition for kind in self.kinds)
        languages = [*filter(None, dict.fromkeys(kind.language for kind in self.kinds))]
        made_of = [pluralize(len(conditions), "condition")] if len(conditions) > 1 else []
        made_of += [f"in {' and '.join(languages)}"] if languages else []
        what = pluralize(len(self.kinds), "kind") + " of session" + (f" ({', '.join(made_of)})" if made_of else "")
        situations = sum(exploration.situations for exploration in self.explorations)
        begun = {
            (kind.run.scenario, act)
            for kind, exploration in zip(self.kinds, self.explorations, strict=True)
            for act in exploration.acts
        }
        counts = (pluralize(sum(each.finding.level == level for each in self.findings), level) for level in _LEVELS[:2])
        text = f"explored and played {what}: {situations:,} situations, {len(begun)} of {self.acts} acts began; "
        text += ", ".join(counts)
        for what, broken_off in (
            ("exploring", sum(not exploration.is_complete for exploration in self.explorations)),
            ("playing", sum(not exploration.is_played for exploration in self.explorations)),
        ):
            if broken_off:
                text += f"; {what} stopped after {QUICK_SECONDS:g} s in {pluralize(broken_off, 'kind')}"
        if not all(exploration.is_complete for exploration in self.explorations):
            text += ", and `rise-engine explore STUDY` looks at more"
        return text

    def row(self) -> dict[str, Any]:
        """Return the results for programs (`--json`)."""
        return {
            "kinds": [
                {
                    "condition": kind.run.condition,
                    "language": kind.language,
                    "situations": exploration.situations,
                    "complete": exploration.is_complete,
                    "played": exploration.is_played,
                    "acts": exploration.acts,
                }
                for kind, exploration in zip(self.kinds, self.explorations, strict=True)
            ],
            "findings": [each.row() for each in self.findings],
        }


def check_kinds(
    study: Study, kinds: Sequence[SessionKind], say: Callable[[str], None] = lambda sentence: None
) -> StudyExploration:
    """Explore and play each kind of session for a few seconds at most. Unchanged kinds keep their stored results.

    :param study: the study, in whose folder the results are stored.
    :param kinds: from `rise_engine.study.participants`.
    :param say: gets a sentence about each kind that takes time.
    """
    folder = Path(study.folder)
    before = _read_kept(folder)
    kept: dict[str, KindExploration] = {}
    explored: list[tuple[SessionKind, KindExploration]] = []
    acts: set[tuple[str, str]] = set()
    loaded = cache(partial(load_for, study))
    for number, kind in enumerate(kinds, start=1):
        scenario = loaded(kind.run.scenario, kind.language)
        if scenario is None:
            continue  # `study check` reports its errors
        acts.update((kind.run.scenario, act) for act in scenario.acts)
        key = _digest(study, kind, scenario)
        if key not in kept:
            if key not in before:
                say(f"looking at {kind.name or 'the sessions'} ({number} of {len(kinds)})")
            kept[key] = before[key] if key in before else _explore_kind(study, kind, scenario)
        explored.append((kind, kept[key]))
    if kept.keys() - before.keys():
        newest = dict(
            [*kept.items(), *((key, exploration) for key, exploration in before.items() if key not in kept)][:_MAX_KEPT]
        )
        with suppress(OSError):  # results that cannot be stored are computed again
            write_whole(folder / KEPT, encode(_Kept(newest, _sum(newest))))
    found = merge([(kind, exploration.is_complete, exploration.findings) for kind, exploration in explored])
    return StudyExploration(
        tuple(kind for kind, _ in explored), tuple(exploration for _, exploration in explored), tuple(found), len(acts)
    )


def check_explored(study_folder: Path, kind: SessionKind | None, robot: str | None, mode: Mode) -> Finding:
    """Check that nothing gets stuck or fails in a session that will begin (`auto = "explored"`; blocking).

    :param study_folder: where the results are stored.
    :param kind: the session's kind; None: every kind of the study.
    :param robot: a robot instead of the scenario's; None: the scenario's.
    :param mode: the session's mode.
    """
    review = review_study(study_folder)
    if review.study is None or review.errors:
        return Finding(False, reason="the study has errors; `rise-engine study check` says which")
    study = replace(review.study, robot=robot or "", mode=mode)
    kinds = session_kinds(study, review.participants, review.scenarios) if kind is None else (kind,)
    exploration = check_kinds(study, kinds)
    problems = [each.finding.text for each in exploration.findings if each.finding.level == "problem"]
    if not problems:
        return Finding(True, exploration.sentence)
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return Finding(False, exploration.sentence, f"{problems[0]}{more}; `rise-engine explore` shows the way there")


def load_for(study: Study, folder: str, language: str) -> Scenario | None:
    """Load a scenario for a kind of session; None: it has errors."""
    return load(folder, robot=study.robot or None, mode=study.mode, language=language or None).scenario


def explore_kind(
    study: Study,
    kind: SessionKind,
    scenario: Scenario,
    bounds: Bounds,
    *,
    cores: int = 1,
    go_on: Callable[[Space], bool] = lambda space: True,
) -> tuple[Exploration, PlayedThrough]:
    """Explore and play one kind of session; the arguments are those of `explore`."""
    started = kind.first_input(study)
    exploration = explore(scenario, bounds, sessions=[started], cores=cores, go_on=go_on)
    until = time.thread_time() + QUICK_SECONDS
    return exploration, play_through(scenario, started, main_rule(scenario), lambda: time.thread_time() < until)


def findings_of(
    study: Study, kind: SessionKind, exploration: Exploration, played: PlayedThrough
) -> tuple[KindFinding, ...]:
    """Collect the findings of exploring, in their order, and then the failures of the playthrough."""
    prefix = Path(kind.run.scenario)
    prefix = prefix.relative_to(study.folder) if prefix.is_relative_to(study.folder) else prefix
    found = [
        KindFinding(each.level, each.kind, each.text, "" if each.location is None else f"{prefix / str(each.location)}")
        for each in exploration.findings
    ]
    missing_parts = {each.place for each in found if each.kind == "missing-part"}
    for failure in played.failures:
        place = f"{prefix / str(failure.location)}"
        if place not in missing_parts:
            level: FindingLevel = "warning" if failure.by_hand else "problem"
            found.append(KindFinding(level, "play-failed", failure.sentence, place))
    return tuple(found)


def merge(results: Iterable[tuple[SessionKind, bool, Sequence[KindFinding]]]) -> list[MergedFinding]:
    """Merge the findings of all kinds, each once, problems first.

    A finding that something never happens counts only if every completely explored kind with the scenario has it.

    :param results: for each kind, whether it was explored completely, and its findings.
    """
    results = list(results)
    same: dict[tuple[str, str, str], list[tuple[int, int]]] = {}
    for number, (_, _, findings) in enumerate(results):
        for at, finding in enumerate(findings):
            places = same.setdefault((finding.kind, finding.place, _NUMBERS.sub("#", finding.text)), [])
            if not places or places[-1][0] != number:
                places.append((number, at))
    merged: list[MergedFinding] = []
    for (code, _, _), places in same.items():
        first = places[0]
        if code in _KINDS_IN_ALL:
            alike = [
                n
                for n, exploration in enumerate(results)
                if exploration[0].run.scenario == results[first[0]][0].run.scenario
            ]
            if len(places) < len(alike) or not all(results[n][1] for n in alike):
                continue
        names = tuple(results[number][0].name for number, _ in places)
        merged.append(MergedFinding(results[first[0]][2][first[1]], names, len(results), first))
    return sorted(merged, key=lambda each: _LEVELS.index(each.finding.level))


_NUMBERS = re.compile(r"[0-9][0-9,.]*")
"""Numbers of situations, which differ between kinds of session."""


def _explore_kind(study: Study, kind: SessionKind, scenario: Scenario) -> KindExploration:
    until = time.thread_time() + QUICK_SECONDS
    exploration, played = explore_kind(
        study, kind, scenario, quick_bounds(scenario), go_on=lambda space: time.thread_time() < until
    )
    findings = findings_of(study, kind, exploration, played)
    acts = tuple(sorted(played.acts))
    return KindExploration(exploration.situations, exploration.is_complete, played.is_complete, acts, findings)


def _digest(study: Study, kind: SessionKind, scenario: Scenario) -> str:
    """Hash everything that the results depend on."""
    parts = [__version__, scenario.hash, kind.language, kind.run.memory, QUICK_SECONDS, study.id]
    return sha256(encode([*parts, kind.run.factors if scenario.reads_session else None])).hexdigest()


class _Kept(Struct, frozen=True):
    """The contents of `.kinds.json`."""

    looks: dict[str, KindExploration]
    sum: str
    """The checksum of the results, which are ignored if somebody has edited them."""


def _sum(results: Mapping[str, KindExploration]) -> str:
    return sha256(encode(results)).hexdigest()


def _read_kept(folder: Path) -> dict[str, KindExploration]:
    try:
        kept = msgspec.json.decode((folder / KEPT).read_bytes(), type=_Kept)
    except (OSError, msgspec.DecodeError):
        return {}
    return kept.looks if _sum(kept.looks) == kept.sum else {}

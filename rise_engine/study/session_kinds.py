"""The kinds of session of a study: every condition in every language of its participants.

The scenario must have translations into each language.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import product
from pathlib import Path

from msgspec import Struct

from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.base.text import pluralize
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario, SourceLocation
from rise_engine.study.begin import LANGUAGE
from rise_engine.study.model import Participant, PlannedRun, Study
from rise_engine.study.participants import PARTICIPANTS_FILE
from rise_engine.study.plan import planned_run
from rise_engine.study.study_toml import STUDY_FILE


def check_languages(
    study: Study, people: Iterable[Participant], scenarios: Mapping[str, Scenario], diagnostics: Diagnostics
) -> None:
    """Report languages that a scenario lacks, and translations that are incomplete.

    A scenario without any translation that does not say its own language has each. A column `language` may then be one
    like any other, but not a factor or a stratum.

    :param people: the rows of participants.csv.
    :param scenarios: by absolute folder.
    """
    wanted = languages_of(study, people)
    for folder, scenario in scenarios.items():
        known = [*filter(None, (scenario.language, *scenario.languages))]
        for language, location in wanted.items():
            if not scenario.languages and (not scenario.language or location.file != STUDY_FILE):
                continue
            if language not in known:
                near = did_you_mean(language, known, limit=0) or f"; it is in {in_backquotes(known)}"
                message = f"the scenario {Path(folder).name} is not in the language `{language}`{near}"
                diagnostics.error("unknown-language", location, message)
                continue
            errors = load(folder, robot=study.robot or None, mode=study.mode, language=language).errors
            if errors:
                more = f", and {pluralize(len(errors) - 1, 'more error')}" if len(errors) > 1 else ""
                message = f"sessions in `{language}` are refused: {errors[0].message}{more}"
                diagnostics.error("not-translated", location, message)


def languages_of(study: Study, people: Iterable[Participant]) -> dict[str, SourceLocation]:
    """Return every value of the study's `language` (a factor, a stratum or a column of participants), with its first
    place."""
    found: dict[str, SourceLocation] = {}
    for factor in study.factors:
        if factor.name == LANGUAGE:
            found.update((level.name, SourceLocation(STUDY_FILE)) for level in factor.levels)
    for tag in study.strata.get(LANGUAGE, ()):
        found.setdefault(tag, SourceLocation(STUDY_FILE))
    for participant in people:
        tag = {**participant.columns, **participant.strata}.get(LANGUAGE, "").strip()
        if tag and participant.status != "excluded":
            found.setdefault(tag, SourceLocation(PARTICIPANTS_FILE, participant.line))
    return found


class SessionKind(Struct, frozen=True):
    """A group of sessions that begin in the same way."""

    run: PlannedRun
    language: str = ""
    """Empty: as the acts have it."""

    @property
    def name(self) -> str:
        """A name for people: `polite+AB (de)`. Empty where there is only one kind."""
        if self.run.condition and self.language:
            return f"{self.run.condition} ({self.language})"
        return self.run.condition or self.language

    def first_input(self, study: Study) -> SessionStarted:
        """Return the first input of such a session."""
        return SessionStarted(
            condition=self.run.condition,
            factors=dict(self.run.factors),
            study=study.id,
            memory=dict(self.run.memory),
        )


def session_kinds(
    study: Study, people: Iterable[Participant], scenarios: Mapping[str, Scenario]
) -> tuple[SessionKind, ...]:
    """Return every kind of session, in the order of study.toml.

    :param study: the study.
    :param people: from participants.csv, where a further column can give the language.
    :param scenarios: the scenarios without errors, by absolute folder; kinds with other scenarios are left out.
    """
    names = [factor.name for factor in study.factors]
    spoken = list(languages_of(study, people))
    kinds: list[SessionKind] = []
    for levels in product(*([level.name for level in factor.levels] for factor in study.factors)):
        run = planned_run(study, dict(zip(names, levels, strict=True)))
        scenario = scenarios.get(run.scenario)
        if scenario is None:
            continue
        own = [run.factors[LANGUAGE]] if LANGUAGE in run.factors else spoken
        known = [language for language in own if language in (scenario.language, *scenario.languages)]
        kinds += [SessionKind(run, language) for language in known if scenario.languages] or [SessionKind(run)]
    return tuple(kinds)

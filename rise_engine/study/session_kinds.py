"""The kinds of session that a study has: every condition, in every language that a participant can have."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import product

from msgspec import Struct

from rise_engine.kernel.inputs import SessionStarted
from rise_engine.scenario.model import Scenario
from rise_engine.study.begin import LANGUAGE
from rise_engine.study.language_checks import languages_of
from rise_engine.study.model import Participant, PlannedRun, Study
from rise_engine.study.plan import planned_run


class SessionKind(Struct, frozen=True):
    """Sessions that begin alike."""

    run: PlannedRun
    language: str = ""
    """Empty: as the acts have it."""

    @property
    def name(self) -> str:
        """For people: `polite+AB (de)`; empty where there is only one kind."""
        if self.run.condition and self.language:
            return f"{self.run.condition} ({self.language})"
        return self.run.condition or self.language

    def first_input(self, study: Study) -> SessionStarted:
        """What such a session begins with."""
        return SessionStarted(
            condition=self.run.condition,
            factors=dict(self.run.factors),
            study=study.id,
            memory=dict(self.run.memory),
        )


def session_kinds(
    study: Study, people: Iterable[Participant], scenarios: Mapping[str, Scenario]
) -> tuple[SessionKind, ...]:
    """Every kind of session, in the order of study.toml.

    :param study: the study.
    :param people: of participants.csv: a further column can say their language.
    :param scenarios: those without errors, by their absolute folder; a kind of another one is left out.
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

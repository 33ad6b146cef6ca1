"""Whether the sessions of a study can be in the languages that the study says (docs/reference/languages.md)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.base.text import pluralize
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario, SourceLocation
from rise_engine.study.begin import LANGUAGE
from rise_engine.study.model import Participant, Study
from rise_engine.study.participants import PARTICIPANTS_FILE
from rise_engine.study.study_toml import STUDY_FILE


def check_languages(
    study: Study, people: Iterable[Participant], scenarios: Mapping[str, Scenario], diagnostics: Diagnostics
) -> None:
    """Findings for languages that a scenario with translations does not have, and for those that lack something.

    :param people: whoever stands in participants.csv.
    :param scenarios: by their absolute folder.
    """
    wanted = languages_of(study, people)
    for folder, scenario in scenarios.items():
        known = [*filter(None, (scenario.language, *scenario.languages))]
        for language, location in wanted.items() if scenario.languages else ():
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
    """Every value of what the study calls `language`, a factor, a stratum or a column of people, each with the place
    where it stands first."""
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

"""Fillers: short acts that bridge the time until the wizard has an answer (`filler = true` in scenario.toml)."""

from __future__ import annotations

from rise_engine.scenario.model import Scenario


def filler_acts(scenario: Scenario) -> tuple[str, ...]:
    """The scenario's fillers, in the order of its acts."""
    return tuple(name for name in scenario.acts if scenario.settings_of(name).filler)


def next_filler(scenario: Scenario, last: str | None) -> str | None:
    """The filler after the one that was used last, in turn; None when the scenario has none."""
    found = filler_acts(scenario)
    if not found:
        return None
    return found[(found.index(last) + 1) % len(found)] if last in found else found[0]

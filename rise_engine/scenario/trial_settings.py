"""The settings in `[trials]` of scenario.toml: what begins a trial, and the extra columns of trials.csv."""

from __future__ import annotations

import re

from msgspec import Struct

from rise_engine.expression import Expression

TRIAL_KEYS = {
    "state": "entering this state of a rule begins a trial; RULE/STATE where several rules have it, * for any text",
    "key": "a change of this memory key begins a trial",
    "columns": "memory values at the trial's end that are columns of trials.csv",
    "speech": "the event that a program raises when the participant begins to speak",
    "measure": "the dependent variable: a column that is a number (participant_s)",
}
"""The meaning of each entry of `[trials]`, for editors."""
PARTICIPANT = "participant_s"
SPEECH = "speech_s"
MEASURES = (PARTICIPANT, SPEECH, "key_s", "wizard_s", "duration_s", "prompts", "repairs", "failures")
"""Columns of every trial that can be the dependent variable. The declared columns can be it too."""


class TrialSettings(Struct, frozen=True):
    """The settings in `[trials]`: either `state` or `key` is set."""

    state: str = ""
    """`STATE` or `RULE/STATE`, with `*` for any text."""
    key: Expression | None = None
    columns: tuple[Expression, ...] = ()
    """Each is a memory key or a part of a value; its text is the column's name."""
    measure: str = PARTICIPANT
    speech: str = ""
    """The topic, without its slash, of the event at which the participant begins to speak. Empty: none says so."""

    def begins_at(self, rule: str, state: str) -> bool:
        """Whether entering a state begins a trial."""
        return bool(self.state) and fits_state(self.state, rule, state)


def fits_state(written: str, rule: str, state: str) -> bool:
    """Whether `STATE` or `RULE/STATE`, with `*` for any text, names a state of a rule.

    >>> fits_state("Ask", "Quiz", "Ask"), fits_state("Quiz/Task *", "Quiz", "Task 2"), fits_state("Ask", "Quiz", "Asks")
    (True, True, False)
    """
    pattern = ".*".join(map(re.escape, written.split("*")))
    return any(re.fullmatch(pattern, name, re.DOTALL) for name in (state, f"{rule}/{state}"))

"""The table of trials, and the columns that scenarios declare for it."""

from __future__ import annotations

from collections.abc import Iterator

from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.trials import trials_of
from rise_engine.results.export.session_tables import OF_SESSION
from rise_engine.results.export.table_levels import TRIAL_ENDS
from rise_engine.results.export.table_schema import (
    Column,
    Row,
    TableSchema,
    count,
    moment,
    numbering,
    outage_columns,
    seconds,
)
from rise_engine.scenario.trial_settings import PARTICIPANT


def _trial_rows(data: SessionData) -> Iterator[Row]:
    return (Row(data, number, trial) for number, trial in enumerate(trials_of(data), 1))


TRIALS = TableSchema(
    "trials",
    "One row is one trial, as [trials] of the scenario says where each begins.",
    (
        numbering("trial"),
        moment("start", "It began.", required=True),
        moment("end", "It ended.", required=True),
        seconds("duration_s", "From start to end."),
        Column("ended_by", "What ended it.", levels=TRIAL_ENDS, required=True),
        Column("robot_said", "What the act that spoke first in it says. Empty: none did, as in what follows of it."),
        Column("asked_task", "That act: its number in acts.csv.", lambda row: row.of.task, type="integer", minimum=1),
        moment("asked_at", "The robot confirmed its first action that takes the voice. The first sound comes later."),
        moment("asked_end", "Its last action that takes the voice ended; empty: it did not."),
        moment("cue_at", "The first cue from asked_at on, without those that were taken back."),
        seconds(
            PARTICIPANT, "From asked_end to cue_at. Below 0: the cue came while the robot still spoke.", minimum=None
        ),
        moment("key_at", "The wizard's first key from cue_at on; from asked_at on, where there is no cue."),
        Column("wizard_key", "Which key that is in the scenario; empty: none, or one of the console."),
        Column("wizard_asked", "What it asked for: a function and what it was given."),
        seconds("wizard_s", "From cue_at to key_at."),
        seconds("key_s", "From asked_end to key_at. Below 0: it came while the robot still spoke.", minimum=None),
        moment(
            "robot_next_at",
            "The robot's next onset from cue_at on (key_at, where there is no cue), also after the trial: of an act "
            "that speaks its voice, else its first action.",
        ),
        count("prompts", "Further acts that spoke from asked_end to cue_at (else to key_at, else to the end)."),
        count("repairs", "As repairs of sessions.csv, in the trial."),
        Column(
            "events",
            "What wizards raised in it, also by keys that start rules which raise it at once.",
            lambda row: " ; ".join(row.of.events),
        ),
        Column("marks", "Of what was asked for in it: wrong, late, early, double.", lambda row: " ".join(row.of.marks)),
        count("failures", "Acts, rules and expressions that failed in it."),
        *outage_columns("duration_s", "start", "end"),
    ),
    ("session", "trial"),
    _trial_rows,
    OF_SESSION,
)


def declared_column(name: str) -> Column:
    """A column that `[trials]` of a scenario declares.

    :param name: the memory key, or the part of a value.
    """
    taken = name in {column.name for column in TRIALS.columns}
    about = f"The memory's {name} before the moment at which the trial ended; empty: there was none."
    return Column(f"memory_{name}" if taken else name, about, lambda row: row.of.values.get(name), "any")

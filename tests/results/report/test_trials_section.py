"""The dependent variable by condition: the numbers, the dots, and what is said without trials."""

from __future__ import annotations

from msgspec.structs import replace

from rise_engine.results.analysis.model import SessionFacts
from rise_engine.results.analysis.statistics import median_interval
from rise_engine.results.report.document import Figure, Paragraph, ReportTable
from rise_engine.results.report.study_facts import SessionRow
from rise_engine.results.report.trials_section import UNDECLARED, trial_rows, trials_section, trials_summary


def session(participant: str, *trials: float | None, measure: str = "participant_s") -> SessionRow:
    facts = SessionFacts(session=participant, participant=participant)
    figures = None  # the section asks for the trials alone
    return SessionRow(facts, figures, (), {}, (), (), (), measure, trials)  # type: ignore[arg-type]


FAST = session("P01", 1.0, 1.2, None, 1.4, 1.6, 1.8, 2.0, 2.2)
SLOW = session("P02", 3.0, -0.5)


def test_each_trial_is_a_dot_and_its_numbers_are_text() -> None:
    rows = trial_rows([("yes", [FAST]), ("no", [SLOW])])
    figure, table = trials_section(rows, declared=True).blocks
    assert isinstance(figure, Figure) and figure.svg[0].count("<circle") == 9 and figure.text is not None
    assert "P01, trial 4: 1.40" in figure.svg[0], "trials keep their numbers"
    lines = figure.text(80)
    assert lines[0].startswith("yes") and lines[0].endswith("1.60 s") and all(len(line) <= 80 for line in lines[:-1])
    assert isinstance(table, ReportTable)
    assert table.rows[0] == ("yes", "1", "8", "7", "1.60", "1.00\u20132.20", "1.30\u20131.90")
    assert table.rows[1][:6] == ("no", "1", "2", "2", "1.25", "")
    assert (
        trials_summary(rows)
        == "Median participant_s of trials: 1.60 s in yes (n 7, 95 % 1.00\u20132.20), 1.25 s in no (n 2)."
    )


def test_a_trial_in_which_the_engine_was_away_is_named() -> None:
    rows = trial_rows([("yes", [replace(FAST, omitted=((2, "outage"),))]), ("no", [SLOW])])
    table = trials_section(rows, declared=True).blocks[1]
    assert isinstance(table, ReportTable) and "the engine was away: P01, trial 2." in table.note


def test_a_trial_of_several_runs_is_named_with_its_run() -> None:
    second = replace(SLOW, facts=replace(SLOW.facts, participant="P01", run=2), omitted=((2, "outage"),))
    rows = trial_rows([("yes", [replace(FAST, facts=replace(FAST.facts, run=1))]), ("no", [second])])
    figure, table = trials_section(rows, declared=True).blocks
    assert isinstance(table, ReportTable) and "the engine was away: P01, run 2, trial 2." in table.note
    assert isinstance(figure, Figure) and "P01, run 1, trial 4: 1.40" in figure.svg[0]


def test_a_value_that_is_no_number_is_named_where_it_is_left_out() -> None:
    rows = trial_rows([("yes", [replace(FAST, measure="score", omitted=((3, "value"), (4, "stop")))])])
    table = trials_section(rows, declared=True).blocks[1]
    assert isinstance(table, ReportTable) and table.note.endswith(
        " Not measured because everything was stopped: P01, trial 4."
        " Not measured because score is not a number: P01, trial 3."
    )


def test_every_trial_that_was_not_measured_is_named_with_a_reason() -> None:
    whys = ("outage", "stop", "back", "silent", "cut", "end", "cue", "key", "unset", "value")
    omitted = tuple((number, why) for number, why in enumerate(whys, 1))
    rows = trial_rows([("yes", [replace(FAST, trials=(*(None for _ in whys), 1.0), omitted=omitted)])])
    assert rows[0].trials == len(rows[0].values) + len(rows[0].omitted)
    table = trials_section(rows, declared=True).blocks[1]
    assert isinstance(table, ReportTable)
    for number, said in ((3, "stepped back"), (5, "to the end: P01"), (6, "silent: P01"), (7, "no cue: P01")):
        assert said in table.note and table.note.count(f"trial {number}") == 1


def test_a_study_without_trials_is_told_how_to_declare_them() -> None:
    without = replace(FAST, measure="", trials=())
    (told,) = trials_section(trial_rows([("yes", [without])]), declared=False).blocks
    assert isinstance(told, Paragraph) and told.text == UNDECLARED


def test_the_interval_is_that_of_order_statistics() -> None:
    """Of 10, 20 and 100 values the 2nd, 6th and 40th from each end: one further, and a binomial has over 2.5 %."""
    found = {n: median_interval(range(1, n + 1)) for n in (5, 6, 10, 20, 100)}
    assert found == {5: None, 6: (1, 6), 10: (2, 9), 20: (6, 15), 100: (40, 61)}

"""`--format tables`, as frictionless, which we did not write, sees it; and whether its numbers are the record's."""

from __future__ import annotations

import csv
import json
import re
import shutil
import statistics
from pathlib import Path
from typing import Any, get_args

import pytest
from msgspec.structs import replace

from rise_engine.kernel.inputs import SessionStarted, Submit
from rise_engine.kernel.records import (
    ActionStatus,
    CheckResult,
    Mark,
    OutcomeStatus,
    Purpose,
    RecordingStatus,
    TaskStatus,
)
from rise_engine.ports.recorder import MediaKind
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.model import ActorKind, PointKind
from rise_engine.results.analysis.reading import read_session, read_sessions
from rise_engine.results.export import table_schema
from rise_engine.results.export.bids_tables import EVENT_COLUMNS, event_rows
from rise_engine.results.export.course_tables import ACTS, CODED, CUES, PHASES
from rise_engine.results.export.format import ExportError
from rise_engine.results.export.tables import FORMAT, PACKAGE, R_FILE, SPSS_FILE, TABLES
from rise_engine.results.export.trial_tables import WideTable
from rise_engine.results.export.writing import export_context, export_sessions
from rise_engine.session.folder import INFO
from rise_engine.session.media import MEDIA_FILE, AlignedBy
from tests.results.analysis.samples import (
    act,
    make_study,
    play_session,
    recovered_session,
    sessions_of,
    task,
    torn_session,
)

frictionless = pytest.importorskip("frictionless", reason="frictionless is not installed: tables are not validated")


def make_tables(folder: Path, sessions: list[Path], level: ExportLevel = "full") -> Path:
    out = folder / f"tables-{level}"
    export_sessions(FORMAT, out, sessions, export_context(sessions, level))
    return out


def rows(tables: Path, name: str) -> list[dict[str, str]]:
    with (tables / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def findings(tables: Path) -> list[tuple[str, str, str]]:
    """What is wrong: the table, the kind of error, the column."""
    report = frictionless.Package(str(tables / "datapackage.json")).validate()
    said = [str(each.type) for each in report.errors]
    found = [("", each, "") for each in said]
    for each in report.tasks:
        found += [(each.name, error.type, getattr(error, "field_name", "")) for error in each.errors]
    return found


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_study(tmp_path_factory.mktemp("lab") / "study")


@pytest.fixture(scope="module")
def tables(study: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_tables(tmp_path_factory.mktemp("out"), sessions_of(study))


@pytest.fixture(scope="module")
def small(study: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_tables(tmp_path_factory.mktemp("out"), sessions_of(study)[:2])


# --- as others see them ---


@pytest.mark.parametrize(
    ("level", "most", "counts"), [("full", 8, [8, 100, 12]), ("shared", 2, [2, 18, 2]), ("public", 2, [2, 18, 2])]
)
def test_frictionless_accepts_a_study(
    study: Path, tmp_path: Path, level: ExportLevel, most: int, counts: list[int]
) -> None:
    out = make_tables(tmp_path, sessions_of(study)[:most], level)
    assert findings(out) == []
    assert [len(rows(out, name)) for name in ("sessions", "acts", "checks")] == counts


def test_frictionless_accepts_sessions_of_no_study(tmp_path: Path) -> None:
    root = tmp_path / "sessions"
    out = make_tables(tmp_path, [play_session(root), recovered_session(root), torn_session(root)])
    assert findings(out) == []
    assert [row["unreadable"] for row in rows(out, "sessions")] == ["0", "0", "1"]
    assert [row["downtime_s"] for row in rows(out, "sessions")] == ["0", "95", "0"]
    broken = [row for row in rows(out, "phases") if row["outage_s"]]
    assert broken and {row["outage_s"] for row in broken} == {"95"}
    assert all(float(row["wall_s"]) == pytest.approx(float(row["duration_s"]) + 95) for row in broken)
    (recovery,) = [row for row in rows(out, "events") if row["kind"] == "recovery"]
    assert (recovery["name"], recovery["outage_s"], recovery["duration"]) == ("recovered", "95", "0")
    assert any(row["outage_s"] for row in rows(out, "acts"))  # what was under way is lost, after the outage


def test_durations_by_the_wall_clock_know_the_speed(tmp_path: Path) -> None:
    """4 session seconds in a second: 8 s of session time and 95 s without an engine are 97 s."""
    data = read_session(recovered_session(tmp_path / "sessions"))
    fast = replace(data, facts=replace(data.facts, speed=4.0))
    for schema, lasts in ((PHASES, "duration_s"), (ACTS, "response_s"), (CUES, "response_s")):
        columns = {column.name: column for column in schema.columns}
        wall, away = ("response_wall_s", "response_outage_s") if schema is ACTS else ("wall_s", "outage_s")
        told = [{name: columns[name].of(row) for name in (lasts, wall, away)} for row in schema.rows(fast)]
        timed = [row for row in told if row[lasts]]
        assert timed
        for row in timed:
            assert row[wall] == pytest.approx(row[lasts] / 4 + (row[away] or 0.0), abs=1e-6)
    events = [{name: column.of(row) for name, column in EVENT_COLUMNS.items()} for row in event_rows(fast)]
    assert any(event["outage_s"] and event["duration"] for event in events)
    for event in events:
        if event["duration"]:
            assert event["wall_s"] == pytest.approx(event["duration"] / 4 + (event["outage_s"] or 0.0), abs=1e-6)


PARTS = {
    "acts": (
        *(("wizard_s", "cue_at", "key_at", "wait_interrupted"), ("rules_s", "cue_at", "accepted_at", None)),
        *(("queue_s", "accepted_at", "started_at", "wait_interrupted"), ("voice_s", "robot_at", "voice_at", None)),
        ("robot_s", "started_at", "robot_at", "wait_interrupted"),
    ),
    "cues": (("filled_s", "at", "filled_at", "filled_interrupted"),),
    "trials": (
        ("participant_s", "asked_end", "cue_at", "participant_interrupted"),
        *(("wizard_s", "cue_at", "key_at", "wizard_interrupted"), ("key_s", "asked_end", "key_at", None)),
    ),
}
"""Parts of the times in three tables: where each begins and ends, and the column that says what interrupted it."""


def test_every_part_across_an_outage_says_so_and_gives_wall_clock_time(tmp_path: Path) -> None:
    """The engine is away for 20 s while an act waits in the queue, and before a filler, a cue and a key."""
    visit, cue = (1.0, task("startInteractionRule", "Visit")), (9.0, task("markCue"))
    asked = [visit, (3.0, task("raiseEventTopic", "/tea")), cue, act("Thanks", 12.0)]
    root = tmp_path / "sessions"
    plans = [([act("Answer", 10.0), act("Ask", 10.1)], 10.5), ([cue, act("Hm", 11.0)], 10.5)]
    plans += [(asked, 10.5), (asked, 6.0)]
    out = make_tables(tmp_path, [recovered_session(root, at=t, away=20.0, noted=t, script=each) for each, t in plans])
    assert findings(out) == []
    across = set()
    recovered = {row["session"]: float(row["onset"]) for row in rows(out, "events") if row["kind"] == "recovery"}
    for table, parts in PARTS.items():
        for row in rows(out, table):
            for part, start, end, interrupted in parts:
                if row[part] == "" or (part == "rules_s" and row["key_at"]):
                    continue
                begin = "cue_at" if part == "queue_s" and row["before_cue"] == "true" else start
                lost = float(row[begin]) < recovered[row["session"]] <= float(row[end])
                assert row[part.replace("_s", "_wall_s")] == (f"{float(row[part]) + 20:.9g}" if lost else ""), part
                assert not (lost and interrupted) or row[interrupted] == "outage", part
                across |= {(table, part)} if lost else set()
    assert {("acts", "queue_s"), ("cues", "filled_s"), ("trials", "wizard_s"), ("trials", "participant_s")} <= across


def test_a_simulated_robot_is_said_to_be_one_in_any_mode(tmp_path: Path) -> None:
    begun = SessionStarted(participant="P01", injected_faults=("PointAt=fail@1", "Speech=slow"))
    session = play_session(tmp_path / "sessions", [], started=begun, mode="real", until=1.0)
    (row,) = rows(make_tables(tmp_path, [session]), "sessions")
    assert (row["mode"], row["driver"], row["injected_faults"]) == ("real", "simulated", "PointAt=fail@1 ; Speech=slow")


FIRST_TASK = "1"
"""Of the first session's first act."""


WRONG = [
    ("acts", "task", FIRST_TASK, "primary-key", ""),
    ("acts", "status", "DONE", "constraint-error", "status"),
    ("acts", "cue_at", "ten", "type-error", "cue_at"),
    ("acts", "session", "P99_nowhere", "foreign-key", ""),
    ("acts", "act", "", "constraint-error", "act"),
    ("actions", "task", "4711", "foreign-key", ""),
    ("sessions", "scenario_hash", "f" * 63 + "g", "constraint-error", "scenario_hash"),
    ("phases", "factor_noise", "deafening", "constraint-error", "factor_noise"),
]
"""What is written into a cell of a table, each in a row of its own, and the error that it is."""


def test_frictionless_refuses_broken_ones(small: Path, tmp_path: Path) -> None:
    out = tmp_path / "broken"
    shutil.copytree(small, out)
    for table in dict.fromkeys(name for name, *_ in WRONG):
        found = rows(out, table)
        changes = [(changed, value) for name, changed, value, _, _ in WRONG if name == table]
        for row, (changed, value) in zip(found[1:], changes, strict=False):
            row[changed] = value
        with (out / f"{table}.csv").open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, list(found[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(found)
    wrong = findings(out)
    for table, _, _, error, column in WRONG:
        assert (table, error, column) in wrong
        assert (table, "hash-count", "") in wrong or (table, "byte-count", "") in wrong


# --- the numbers ---


def test_every_row_says_whose_it_is(tables: Path) -> None:
    facts = ("participant", "run", "condition", "mode", "purpose", "outcome", "factor_hesitation", "factor_noise")
    sessions = {row["session"]: [row[name] for name in facts] for row in rows(tables, "sessions")}
    assert len(sessions) == 8
    for schema in TABLES:
        for row in rows(tables, schema.name):
            assert [row[name] for name in facts] == sessions[row["session"]]
    told = {tuple(each) for each in sessions.values()}
    assert ("P02", "1", "no+quiet", "real", "counted", "aborted", "no", "quiet") in told
    assert ("P01", "1", "yes+loud", "real", "pilot", "", "yes", "loud") in told


def test_sessions_sum_up_their_acts(tables: Path) -> None:
    acts = rows(tables, "acts")
    for session in rows(tables, "sessions"):
        theirs = [each for each in acts if each["session"] == session["session"]]
        responses = sorted(float(each["response_s"]) for each in theirs if each["response_s"])
        assert len(theirs) == int(session["acts"]) and len(responses) == int(session["responses"])
        assert float(session["response_median_s"]) == pytest.approx(statistics.median(responses))
        assert int(session["responses_over_2s"]) == sum(each > 2 for each in responses)
        assert int(session["mistakes"]) == sum(each["mark"] != "" for each in theirs)
        assert int(session["fillers"]) == sum(each["filler"] == "true" for each in theirs)
        mended = ("acts_repeated", "steps_back", "cues_undone", "acts_stopped")
        assert int(session["repairs"]) == sum(int(session[name]) for name in mended)


def test_parts_of_latencies(tables: Path) -> None:
    acts = [each for each in rows(tables, "acts") if each["session"].startswith("2024-11-23_103000")]
    answer = next(each for each in acts if each["task"] == "8")
    parts = {name: answer[f"{name}_s"] for name in ("wizard", "way", "queue", "robot", "voice", "response")}
    assert parts == {"wizard": "2.51", "way": "0.02", "queue": "0", "robot": "0.02", "voice": "1", "response": "3.55"}
    filler = next(each for each in acts if each["act"] == "Hm")
    assert (filler["filler"], filler["cue"], filler["wizard_s"], filler["response_s"]) == ("true", "1", "1.01", "")
    refused = next(each for each in acts if each["act"] == "Nodd")
    assert (refused["status"], refused["started_at"], refused["ended_at"], refused["queue_s"]) == (
        "REJECTED",
        "",
        "",
        "",
    )


def test_events_are_the_course_of_the_session(tables: Path) -> None:
    events = [each for each in rows(tables, "events") if each["session"].startswith("2024-11-23_103000")]
    onsets = [float(each["onset"]) for each in events]
    assert onsets == sorted(onsets) and [each["event"] for each in events] == [str(n + 1) for n in range(len(events))]
    assert {each["kind"] for each in events} == {*get_args(PointKind), "act", "phase", "cue"} - {"recovery", "scenario"}
    assert all(float(each["onset"]) + float(each["duration"]) <= 120 for each in events)


def test_states_in_which_rules_are_when_a_record_is_torn(tmp_path: Path) -> None:
    out = make_tables(tmp_path, [torn_session(tmp_path / "sessions")])
    lasting = [each for each in rows(out, "phases") if each["end"] == rows(out, "sessions")[0]["duration_s"]]
    assert [each["ended_by"] for each in lasting] == ["", ""]


def test_an_act_in_a_record_without_end(tmp_path: Path) -> None:
    script = [(1.0, task("markCue")), (2.0, task("startCommunicationRobotAct", "Answer", pressed=1.9))]
    out = make_tables(tmp_path, [play_session(tmp_path / "sessions", script, until=3.5, ends=False)])
    assert findings(out) == []
    act = rows(out, "acts")[0]
    assert [act[name] for name in ("status", "cue_at", "accepted_at", "started_at", "robot_at", "voice_at")] == [
        *("ACTIVE", "1", "2", "2", "2.02", "3.02")
    ]
    assert (act["response_s"], act["ended_at"]) == ("2.02", "")


def test_recordings_with_their_files(tmp_path: Path) -> None:
    folder = play_session(tmp_path / "sessions")
    files = [
        {"path": "/data/camera.mkv", "kind": "video", "name": "camera", "bytes": 10, "offset": -3.5, "rate": 1.00005},
        {"path": "late.wav", "kind": "audio", "duration": 60.0},
    ]
    (folder / MEDIA_FILE).write_text(json.dumps(files), "utf-8")
    out = make_tables(tmp_path, [folder])
    told = [
        [row[name] for name in ("name", "status", "kind", "path", "offset_s", "rate")]
        for row in rows(out, "recordings")
    ]
    assert told == [
        ["camera", "stopped", "video", "/data/camera.mkv", "-3.5", "1.00005"],
        ["", "", "audio", "late.wav", "", ""],
    ]
    assert findings(out) == []
    shared = rows(make_tables(tmp_path, [folder], "shared"), "recordings")
    assert [row["path"] for row in shared] == [""]


@pytest.mark.parametrize("level", ["shared", "public"])
def test_shared_tables_name_nobody(study: Path, tmp_path: Path, level: ExportLevel) -> None:
    out = make_tables(tmp_path, sessions_of(study), level)
    text = "".join(path.read_text("utf-8") for path in out.iterdir()).casefold()
    for word in ("zelda", "quux", "anna", "2024-", "mkv", "hurry", "sick", "looks away"):
        assert word not in text, word
    assert "hello, {person_name|stranger}!" in text and "wizard:w1" in text
    assert len({row["session"] for row in rows(out, "sessions")}) == 8


def test_the_same_sessions_give_the_same_bytes(study: Path, tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    first = make_tables(tmp_path / "a", sessions_of(study), "shared")
    second = make_tables(tmp_path / "b", sessions_of(study), "shared")
    assert all((second / path.name).read_bytes() == path.read_bytes() for path in first.iterdir())


def test_texts_of_any_kind_stay_one_cell(tmp_path: Path) -> None:
    said = 'a "b", c\r\nd\t=1+1 ü 🙂'
    script = [(1.0, Submit(function="say", behavior=said, source="wizard:anna"))]
    out = make_tables(tmp_path, [play_session(tmp_path / "sessions", script, until=20)])
    assert rows(out, "acts")[0]["text"] == said
    assert findings(out) == []
    assert b"\r\n" not in (out / "sessions.csv").read_bytes()


# --- what the columns say ---


def test_every_value_that_there_can_be_is_described() -> None:
    pairs: list[tuple[Any, Any]] = [
        (table_schema.STATUS, TaskStatus),
        (table_schema.ACTION_STATUS, ActionStatus),
        (table_schema.ACTORS, ActorKind),
        (table_schema.OUTCOMES, OutcomeStatus),
        (table_schema.PURPOSES, Purpose),
        (table_schema.CHECK_RESULTS, CheckResult),
        (table_schema.RECORDING_STATES, RecordingStatus),
        (table_schema.MEDIA_KINDS, MediaKind),
    ]
    for levels, values in pairs:
        assert {*levels} == {*get_args(values)}
    assert {*table_schema.MARKS} == {*get_args(Mark)} - {"none"}
    assert {*table_schema.ALIGNMENTS} == {*get_args(AlignedBy)} - {""}
    assert {*table_schema.EVENT_KINDS} == {*get_args(PointKind)} | {"act", "phase", "cue"}


def test_every_column_is_described_and_filled(tables: Path) -> None:
    package = json.loads((tables / "datapackage.json").read_text("utf-8"))
    assert [each["path"] for each in package["resources"]] == [schema.file for schema in TABLES]
    for each in package["resources"]:
        names = [field["name"] for field in each["schema"]["fields"]]
        header = (tables / each["path"]).read_text("utf-8").partition("\n")[0]
        assert names == header.split(","), "every column of the file, in its order"
        assert len(names) == len(set(names)) and all(field["description"] for field in each["schema"]["fields"])
        for field in each["schema"]["fields"]:
            timed = field["name"].endswith(("_at", "_s")) or field["name"] in (
                "at",
                "onset",
                "duration",
                "start",
                "begin",
                "end",
                "asked_end",
            )
            assert (field.get("unit") == "s") == timed, field["name"]
    never = {
        *(
            "reason",
            "kind",
            "duration_s",
            "offset_s",
            "rate",
            "aligned_by",
            "within_s",
            "study_hash",
        ),  # of recordings; see above
        *("outcome_reason", "injected_faults", "wizard_key"),
        *("outage_s", "wall_s", "response_outage_s", "response_wall_s"),  # of sessions that were recovered
        *("interrupted", "response_interrupted", "participant_interrupted", "wizard_interrupted"),
        *("wait_interrupted", "filled_interrupted", "way_wall_s", "rules_wall_s", "queue_wall_s", "robot_wall_s"),
        *("voice_wall_s", "filled_wall_s", "participant_wall_s", "wizard_wall_s", "key_wall_s"),
        *("speech_at", "speech_s", "speech_interrupted", "speech_wall_s"),  # nobody has annotated these
        *("run_as", "scenario_changed_to", "changed_keys"),  # of sessions in which these happened
    }
    for schema in TABLES:
        found = rows(tables, schema.name)
        if schema is CODED:
            continue  # nobody has annotated these; tests/results/export/test_coded.py has such tables
        empty = {name for name in found[0] if not any(row[name] for row in found)}
        assert empty <= never | {"value", "reason"}, (schema.name, empty)


def test_factors_of_a_session_without_session_file(study: Path, tmp_path: Path) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(sessions_of(study)[1], folder)
    (folder / INFO).unlink()
    out = make_tables(tmp_path, [folder])
    assert rows(out, "sessions")[0]["factor_noise"] == "loud"


def test_factors_that_the_export_does_not_know_are_refused(study: Path, tmp_path: Path) -> None:
    sessions = sessions_of(study)
    context = export_context([], "full")
    with pytest.raises(ExportError, match="has the factors hesitation, noise"):
        FORMAT.write(tmp_path / "tables", read_sessions(sessions), context)


# --- trials -----------------------------------------------------------------------------------------------------------


def test_a_declared_column_has_the_type_of_its_values(tables: Path) -> None:
    package = json.loads((tables / PACKAGE).read_text("utf-8"))
    (trials,) = [each for each in package["resources"] if each["name"] == "trials"]
    types = {each["name"]: each["type"] for each in trials["schema"]["fields"]}
    assert (types["visits"], types["person_name"]) == ("integer", "string")
    assert '"visits" = "numeric"' in (tables / R_FILE).read_text("utf-8")
    assert re.search(r"visits F16\.0\s+person_name A", (tables / SPSS_FILE).read_text("utf-8"))


def test_wide_has_a_row_for_each_participant(study: Path, tables: Path, tmp_path: Path) -> None:
    sessions = sessions_of(study)
    context = export_context(sessions, "full")
    context.wide = True
    export_sessions(FORMAT, tmp_path / "wide", sessions, context)
    assert findings(tmp_path / "wide") == []
    wide, trials = rows(tmp_path / "wide", "wide"), rows(tables, "trials")
    assert [row["participant"] for row in wide] == ["P01", "P02", "P03"]
    for row in wide:
        theirs = [each for each in trials if each["participant"] == row["participant"]]
        theirs = [each for each in theirs if (each["purpose"], each["outcome"]) == ("counted", "complete")]
        for level in ("quiet", "loud"):
            of_level = [
                "" if each["participant_interrupted"] else each["participant_s"]
                for each in theirs
                if each["factor_noise"] == level
            ]
            told = [value for name, value in row.items() if name.startswith(f"participant_s.{level}.t")]
            assert told[: len(of_level)] == of_level and not any(told[len(of_level) :])
            known = [float(value) for value in of_level if value]
            assert row[f"trials.{level}"] == str(len(of_level))
            assert row[f"participant_s.{level}.measured"] == str(len(known))
            if known:
                assert float(row[f"participant_s.{level}.median"]) == pytest.approx(statistics.median(known), abs=2e-6)
                assert float(row[f"participant_s.{level}.mean"]) == pytest.approx(statistics.fmean(known), abs=2e-6)


def test_wide_has_no_number_of_trials_where_there_was_no_session(study: Path, tmp_path: Path) -> None:
    def is_first_loud(path: Path) -> bool:
        facts = read_session(path).facts
        return facts.participant == "P01" and facts.factors["noise"] == "loud"

    sessions = [each for each in sessions_of(study) if not is_first_loud(each)]
    context = export_context(sessions, "full")
    context.wide = True
    export_sessions(FORMAT, tmp_path / "wide", sessions, context)
    first, second, _ = rows(tmp_path / "wide", "wide")
    assert first["trials.quiet"] != "" and (first["trials.loud"], first["participant_s.loud.measured"]) == ("", "")
    assert second["trials.loud"] != ""
    assert findings(tmp_path / "wide") == []


def test_wide_has_a_block_of_columns_for_each_measure(study: Path) -> None:
    """The measure of [trials] was changed after the first participant: seconds and counts are not in one column."""
    sessions = [data for data in read_sessions(sessions_of(study)) if data.facts.outcome == "complete"]
    wide = WideTable(export_context(sessions_of(study), "full"))
    for data in sessions:
        assert data.scenario is not None and data.scenario.trials is not None
        if data.facts.participant != "P01":
            trials = replace(data.scenario.trials, measure="visits")
            data = replace(data, scenario=replace(data.scenario, trials=trials))
        wide.add(data)
    columns = {column.name: column for column in wide.schema().columns}
    told = [{name: column.of(row) for name, column in columns.items()} for row in wide.rows()]
    first, second = told[:2]
    assert first["participant_s.quiet.measured"] is not None and first["visits.quiet.measured"] is None
    assert second["participant_s.quiet.measured"] is None and second["visits.quiet.median"] == 1
    assert second["trials.quiet"] == second["visits.quiet.measured"] > 0
    assert (columns["participant_s.quiet.median"].unit, columns["visits.quiet.median"].unit) == ("s", "")


def test_wide_of_several_studies_keeps_their_people_apart(study: Path, tmp_path: Path) -> None:
    other = make_study(tmp_path / "other")
    plan = sessions_of(study)
    context = export_context(plan, "full")
    wide = WideTable(context)
    for data in read_sessions(plan):
        wide.add(data)
        wide.add(replace(data, facts=replace(data.facts, study="other")))
    schema = wide.schema()
    assert schema.key == ("study", "participant") and [each.name for each in schema.columns[:2]] == [*schema.key]
    people = [tuple(column.of(row) for column in schema.columns[:2]) for row in wide.rows()]
    assert len(people) == len(set(people)) == 6
    assert export_context([*plan, *sessions_of(other)], "full").study is None

"""Annotations that people give back: files of ELAN and BORIS on the session's clock, beside the robot's speech."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from pympi.Elan import Eaf

from rise_engine.base.errors import SessionError
from rise_engine.base.words import Words, parse_replacement
from rise_engine.kernel.records import ActionStatus
from rise_engine.privacy.levels import LevelFilter
from rise_engine.privacy.redaction import redact
from rise_engine.privacy.sharing import share_session
from rise_engine.results.analysis.model import ActPart, Interruption
from rise_engine.results.analysis.reading import RobotSpeech, coded_annotation, read_session, robot_speech
from rise_engine.results.export.media_clock import session_clock
from rise_engine.session.coded import CODED_FILE, CodedFile, read_coded
from rise_engine.session.coded_formats import CodedClock, CodedSpan, parse_clock, read_coded_document
from rise_engine.session.media import MediaFile, register_media
from tests.commands import run
from tests.results.analysis.samples import play_session, recovered_session

from .made_sessions import act

SPEECH = "participant speech"


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return play_session(tmp_path_factory.mktemp("lab"))


@pytest.fixture
def folder(played: Path, tmp_path: Path) -> Path:
    return shutil.copytree(played, tmp_path / "sessions" / played.name)


def annotated(folder: Path, out: Path, times: list[float]) -> Path:
    """The session's .eaf, with annotations at session times that ELAN's user would have made."""
    run("export", folder, "--format", "eaf", "-o", out)
    to_ms = session_clock(read_session(folder), []).to_ms
    eaf = Eaf(str(out))
    eaf.add_tier(SPEECH, part="P01", ann="anna")
    eaf.add_tier("gaze")
    for number, at in enumerate(times):
        eaf.add_annotation(SPEECH, to_ms(at), to_ms(at) + 500, f"word {number}")
        eaf.add_annotation("gaze", to_ms(at), to_ms(at) + 100, "robot")
    eaf.to_file(str(out))
    return out


TIMES = [2.0, 11.25, 24.0, 40.001, 90.0]
FILM = MediaFile(path="room.mp4", kind="video", duration=200.0, fps=25.0, offset=-1.5, rate=1.00005, aligned_by="given")


@pytest.mark.parametrize("film", [None, FILM], ids=["session time", "a film that begins later and runs fast"])
@pytest.mark.parametrize("outage", [False, True], ids=["whole", "after an outage"])
def test_elan_there_and_back(played: Path, tmp_path: Path, film: MediaFile | None, outage: bool) -> None:
    source = recovered_session(tmp_path / "lab") if outage else played
    folder = shutil.copytree(source, tmp_path / "sessions" / source.name)
    if film is not None:
        register_media(folder, film)
    run("coded", "add", folder, annotated(folder, tmp_path / "P01.eaf", TIMES), "--speech", SPEECH)
    found = [each for each in read_session(folder).coded if each.tier == SPEECH]
    assert [each.value for each in found] == [f"word {number}" for number in range(len(TIMES))]
    for each, at in zip(found, TIMES, strict=True):
        assert each.begin == pytest.approx(at, abs=0.001)
        assert each.end == pytest.approx(at + 0.5, abs=0.0015)
    assert {(each.annotator, each.speech) for each in found} == {("anna", True)}
    assert {each.tier for each in read_session(folder).coded} == {SPEECH, "gaze"}  # and none of the program's own


def test_a_file_of_another_session_is_refused(folder: Path, tmp_path: Path) -> None:
    out = annotated(folder, tmp_path / "P01.eaf", TIMES)
    other = shutil.copytree(folder, folder.with_name("2024-11-24_093000_P02_tea_real"))
    assert f"was made from the session {folder.name}" in run("coded", "add", other, out, status=2)


def test_a_shared_file_is_of_the_session_too(folder: Path, tmp_path: Path) -> None:
    run("export", folder, "--format", "eaf", "-o", tmp_path / "a.eaf", "--level", "shared")
    eaf = Eaf(str(tmp_path / "a.eaf"))
    eaf.add_tier("gaze")
    eaf.to_file(str(tmp_path / "a.eaf"))
    assert "gaze: 0 annotations" in run("coded", "add", folder, tmp_path / "a.eaf")


def test_tiers_by_name_list_and_remove(folder: Path, tmp_path: Path) -> None:
    out = annotated(folder, tmp_path / "P01.eaf", TIMES)
    assert "did you mean `gaze`?" in run("coded", "add", folder, out, "--tier", "gase", status=2)
    assert "not among the tiers" in run("coded", "add", folder, out, "--tier", "gaze", "--speech", SPEECH, status=2)
    run("coded", "add", folder, out)
    assert "replaces the earlier" in run("coded", "add", folder, out, "--tier", "gaze", "--annotator", "ben")
    assert {each.annotator for each in read_session(folder).coded} == {"ben"}
    assert json.loads(run("coded", "list", folder, "--json"))["files"][0]["annotations"] == {"gaze": 5}
    run("coded", "remove", folder, out.name)
    assert read_session(folder).coded == () and "no annotations" in run("coded", "list", folder)
    run("coded", "remove", folder, out.name, status=1)


def test_without_a_clock_somebody_has_to_say_it(folder: Path, tmp_path: Path) -> None:
    eaf = Eaf()
    eaf.add_tier("gaze")
    eaf.add_annotation("gaze", 14040, 15040, "robot")
    eaf.add_linked_file("file:///videos/room.mp4", relpath="./room.mp4", time_origin=2000)
    out = tmp_path / "mine.eaf"
    eaf.to_file(str(out))
    assert "align the recordings that it names first (room.mp4;" in run("coded", "add", folder, out, status=2)
    run("coded", "add", folder, out, "--at", "14.04=12.34")
    assert [each.begin for each in read_session(folder).coded] == [12.34]
    register_media(folder, MediaFile(path="room.mp4", kind="video", offset=1.5))
    run("coded", "add", folder, out)  # media time is annotation time and 2 s
    assert [each.begin for each in read_session(folder).coded] == [14.54]
    assert read_coded(folder)[0].clock_by == "media"


def test_times_that_elan_leaves_out() -> None:
    data = b"""<ANNOTATION_DOCUMENT><HEADER TIME_UNITS="milliseconds"/>
    <TIME_ORDER><TIME_SLOT TIME_SLOT_ID="a" TIME_VALUE="1000"/><TIME_SLOT TIME_SLOT_ID="b"/>
    <TIME_SLOT TIME_SLOT_ID="c" TIME_VALUE="3000"/><TIME_SLOT TIME_SLOT_ID="d"/></TIME_ORDER>
    <TIER TIER_ID="of"><ANNOTATION><REF_ANNOTATION ANNOTATION_ID="3" ANNOTATION_REF="2">
      <ANNOTATION_VALUE>yes</ANNOTATION_VALUE></REF_ANNOTATION></ANNOTATION>
      <ANNOTATION><REF_ANNOTATION ANNOTATION_ID="4" ANNOTATION_REF="9"/></ANNOTATION></TIER>
    <TIER TIER_ID="words">
      <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="1" TIME_SLOT_REF1="a" TIME_SLOT_REF2="b"/></ANNOTATION>
      <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="2" TIME_SLOT_REF1="b" TIME_SLOT_REF2="c"/></ANNOTATION>
      <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="5" TIME_SLOT_REF1="c" TIME_SLOT_REF2="d"/></ANNOTATION></TIER>
    </ANNOTATION_DOCUMENT>"""
    found = read_coded_document("x.eaf", data)
    assert [(each.tier, each.begin, each.end, each.value) for each in found.spans] == [
        ("words", 1.0, 2.0, ""),
        ("of", 2.0, 3.0, "yes"),
        ("words", 2.0, 3.0, ""),
    ]
    without_end, of_nothing = found.problems
    assert without_end.startswith("x.eaf:10: an annotation of the tier 'words' has no time")
    assert of_nothing.startswith("x.eaf:6: an annotation of the tier 'of' belongs to none")


@pytest.mark.parametrize(
    ("name", "data", "told"),
    [
        ("a.eaf", b"<ANNOTATION", "a.eaf:1: this is not XML"),
        ("a.eaf", b"<x/>", "begins with <x>"),
        ("a.eaf", b'<ANNOTATION_DOCUMENT><HEADER TIME_UNITS="NTSC-frames"/></ANNOTATION_DOCUMENT>', "in NTSC-frames"),
        ("a.boris", b"{}", "not a project of BORIS"),
        ("a.csv", b"a,b\n1,2\n", "not a table of BORIS events"),
        ("a.csv", b"Subject,Behavior,Time\nP,nod,soon\n", "a.csv:2: 'Time' is a number of seconds, not 'soon'"),
        ("a.csv", b"Subject,Behavior,Time\nP,n\xfc,1\n", "a.csv:2: this is not UTF-8"),
        ("a.pdf", b"", "it ends in .eaf, .boris, .csv, .tsv"),
    ],
)
def test_what_cannot_be_read_is_told_with_its_place(name: str, data: bytes, told: str) -> None:
    with pytest.raises(SessionError) as error:
        read_coded_document(name, data)
    assert told in str(error.value)


def test_a_project_of_boris_there_and_back(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.boris"
    run("export", folder, "--format", "boris", "-o", out)
    project = json.loads(out.read_text())
    project["behaviors_conf"]["900"] = {"type": "State event", "code": "speaks", "category": ""}
    project["behaviors_conf"]["901"] = {"type": "Point event", "code": "nods", "category": ""}
    events = project["observations"][folder.name]["events"]
    events += [[12.5, "participant", "speaks", "loud", "hm", 0], [13.0, "participant", "speaks", "loud", "", 0]]
    events += [[14.0, "", "nods", "", "", 0], [15.0, "participant", "speaks", "", "", 0]]
    out.write_text(json.dumps(project))
    told = run("coded", "add", folder, out, "--speech", "participant: speaks", status=1)
    assert "'speaks' of participant begins at 15.000 s and never ends" in told
    found = [(each.tier, each.begin, each.end, each.value, each.modifiers) for each in read_session(folder).coded]
    assert found == [("participant: speaks", 12.5, 13.0, "speaks", "loud"), ("nods", 14.0, 14.0, "nods", "")]


CLOCK = "Tea rise time: annotation seconds = 1.000000 + 1.000000000 * session seconds"


@pytest.mark.parametrize(
    "table",
    [
        "Observation id,Description,Subject,Behavior,Behavioral category,Modifier #1,Behavior type,Time,Comment\n"
        f"S,{CLOCK},participant,speaks,,loud,START,3,hm\nS,{CLOCK},robot,Greet,acts,,START,3,\n"
        f"S,{CLOCK},participant,speaks,,loud,STOP,4,\nother,{CLOCK},participant,nods,,,POINT,9,\n",
        "Observation id\tS\t\t\t\n\nTime\tSubject\tBehavior\tModifiers\tComment\tStatus\n"
        "3\tparticipant\tspeaks\tloud\thm\tSTART\n4\tparticipant\tspeaks\tloud\t\tSTOP\n",
        "Observation id,Description,Subject,Behavior,Modifier #1,Behavior type,Start (s),Stop (s),Comment start,"
        f"Comment stop\nS,{CLOCK},participant,speaks,loud,STATE,3,4,hm,\n",
    ],
    ids=["tabular, version 8", "tabular, version 7", "aggregated"],
)
def test_tables_of_boris(table: str) -> None:
    found = read_coded_document("events.tsv", table.encode(), session="S")
    (span,) = found.spans
    assert (span.tier, span.begin, span.end, span.modifiers, span.comment) == (
        "participant: speaks",
        3,
        4,
        "loud",
        "hm",
    )
    assert found.clock == (CodedClock(1.0) if CLOCK in table else None)


def test_which_observation(folder: Path) -> None:
    two = "Observation id,Subject,Behavior,Time,Behavior type\nA,,nods,1,POINT\nB,,nods,2,POINT\n"
    with pytest.raises(SessionError, match="it has A, B"):
        read_coded_document("e.csv", two.encode(), session="S")
    assert [each.begin for each in read_coded_document("e.csv", two.encode(), "B").spans] == [2]


@pytest.mark.parametrize(
    ("at", "expected"),
    [(9.0, 5.0), (14.0, 10.0), (15.0, 10.0), (16.999, 10.0), (17.5, 10.5), (28.0, 20.0), (29.0, 20.0)],
)
def test_time_without_an_engine_is_one_moment(at: float, expected: float) -> None:
    clock = CodedClock(4.0, 1.0, ((10.0, 3.0), (20.0, 2.0)))
    assert clock.to_session(at) == expected
    assert parse_clock(clock.text()) == clock


@pytest.mark.parametrize(
    ("begin", "end", "expected"),
    [
        (13.0, 13.5, (9.0, 9.5, 0.0)),
        (13.0, 15.0, (9.0, 10.0, 1.0)),  # ends in the outage
        (14.5, 16.5, (10.0, 10.0, 2.0)),  # all of it in the outage: no moment
        (16.0, 18.0, (10.0, 11.0, 1.0)),  # begins in it
        (13.0, 27.0, (9.0, 19.999, 3.001)),
        (15.0, 15.0, (10.0, 10.0, 0.0)),  # a moment
    ],
)
def test_an_annotation_across_an_outage_says_so(begin: float, end: float, expected: tuple[float, ...]) -> None:
    clock = CodedClock(4.0, 1.0, ((10.0, 3.0), (19.999, 2.0)))
    found = clock.span_to_session(CodedSpan("s", "", begin, end, "hm"))
    assert (found.begin, found.end, found.outage) == expected
    file = CodedFile(name="a", sha256="", clock=clock, clock_by="given", tiers=("s",), speech=("s",))
    gone = Interruption(kind="outage", at=10.0, until=10.0)
    told = coded_annotation(found, file, LevelFilter("full", None), [], [gone])
    assert (told.outage_s or 0.0, told.robot_overlap_s) == (expected[2], None if expected[2] else 0.0)


def test_after_speech_whose_end_nobody_knows_there_is_no_gap() -> None:
    lost = _speech(10.0, 15.0, "lost")
    (robot,) = robot_speech([act(10, 15, parts=(lost,))], 30.0)
    assert robot == RobotSpeech(10.0, 15.0, known=False)
    file = CodedFile(name="a", sha256="", clock=CodedClock(), clock_by="given", tiers=("s",), speech=("s",))
    span = CodedSpan("s", "", 16.0, 17.0, "hm")
    found = coded_annotation(
        span, file, LevelFilter("full", None), [robot], [Interruption(kind="outage", at=15.0, until=15.0)]
    )
    assert (found.robot_overlap_s, found.gap_s) == (0.0, None)


def _speech(begin: float, end: float | None, status: ActionStatus = "succeeded") -> ActPart:
    known: dict[str, Any] = {"action": "1", "type": "Speech", "parameters": {}, "text": "hm", "status": status}
    return ActPart(channels=("speech",), accepted_at=begin, ended_at=end, **known)


@pytest.mark.parametrize(
    ("begin", "end", "overlap", "gap"),
    [
        (1.0, 1.5, 0.0, None),  # the robot has said nothing yet
        (4.75, 5.5, 0.0, 0.75),
        (3.5, 4.5, 0.5, -0.5),  # into the robot's sentence
        (1.0, 20.0, None, None),  # over everything, also the time without an engine
        (4.0, 6.0, 0.0, 0.0),
        (16.0, 17.0, 0.0, None),  # the session had no engine since
    ],
)
def test_overlap_and_gap(begin: float, end: float, overlap: Any, gap: Any) -> None:
    acts = [act(2, 4, parts=(_speech(2.0, 3.0), _speech(3.0, 4.0))), act(10, 13, parts=(_speech(10.0, 13.0),))]
    robot = robot_speech(acts, 30.0)
    assert robot == [RobotSpeech(2.0, 4.0), RobotSpeech(10.0, 13.0)]
    file = CodedFile(name="a", sha256="", clock=CodedClock(), clock_by="given", tiers=("s",), speech=("s",))
    gone = Interruption(kind="outage", at=15.0, until=15.0)
    found = coded_annotation(CodedSpan("s", "", begin, end, "hm"), file, LevelFilter("full", None), robot, [gone])
    assert (found.robot_overlap_s, found.gap_s) == (overlap, gap)


def test_below_full_what_participants_said_is_counted(folder: Path, tmp_path: Path) -> None:
    run("coded", "add", folder, annotated(folder, tmp_path / "P01.eaf", [2.0]), "--speech", SPEECH)
    told = {each.tier: each for each in read_session(folder, level="shared").coded}
    assert told[SPEECH].value == "[free text, 2 words]" and told["gaze"].value == "robot"
    assert told[SPEECH].annotator == "W1"  # who was the wizard, too, has one name
    assert "anna" not in repr(told)


def test_redaction_takes_words_out_of_annotations(folder: Path, tmp_path: Path) -> None:
    eaf = annotated(folder, tmp_path / "P01.eaf", [2.0])
    eaf.write_text(eaf.read_text().replace("word 0", "Zebulon &amp; I"))
    run("coded", "add", folder, eaf, "--speech", SPEECH)
    report = redact(folder, Words([parse_replacement("Zebulon=NAME1")]))
    assert report.coded_files == 1 and report.remains == []
    assert [each.value for each in read_session(folder).coded if each.speech] == ["NAME1 & I"]
    assert read_session(folder).problems == ()


def test_a_file_that_was_changed_since_is_said(folder: Path, tmp_path: Path) -> None:
    run("coded", "add", folder, annotated(folder, tmp_path / "P01.eaf", [2.0]))
    with (folder / "coded" / "P01.eaf").open("a") as file:
        file.write("\n")
    data = read_session(folder)
    assert data.coded == () and "was changed since it was added" in data.problems[0]
    (folder / CODED_FILE).write_text("{")
    assert "Correct it" in read_session(folder).problems[0]


def test_coded_csv_and_events_of_bids(folder: Path, tmp_path: Path) -> None:
    run("coded", "add", folder, annotated(folder, tmp_path / "P01.eaf", [2.0, 14.0]), "--speech", SPEECH)
    run("export", folder, "--format", "tables", "-o", tmp_path / "tables")
    with (tmp_path / "tables" / "coded.csv").open(newline="") as file:
        found = [each for each in csv.DictReader(file) if each["speech"] == "true"]
    assert [(each["begin"], each["value"], each["annotator"]) for each in found] == [
        ("2", "word 0", "anna"),
        ("14", "word 1", "anna"),
    ]
    assert all(each["robot_overlap_s"] and each["duration_s"] for each in found)
    run("export", folder, "--format", "bids", "-o", tmp_path / "bids")
    (events,) = (tmp_path / "bids").glob("sub-*/beh/*_events.tsv")
    with events.open(newline="") as file:
        rows = [each for each in csv.DictReader(file, delimiter="\t") if each["trial_type"] == "coded"]
    assert {(each["name"], each["actor"]) for each in rows} == {(SPEECH, "coder:anna"), ("gaze", "n/a")}
    assert list((tmp_path / "bids").rglob("coded/P01.eaf")), "the session's own files have it"


def test_a_shared_session_tells_the_same_without_the_file(folder: Path, tmp_path: Path) -> None:
    run("coded", "add", folder, annotated(folder, tmp_path / "P01.eaf", [2.0, 14.0]), "--speech", SPEECH)
    shared = share_session(folder, tmp_path / folder.name, level="shared", wizards={"anna": "W7"})
    before = read_session(folder, level="shared", wizards={"anna": "W7"}).coded
    known = {name: name for name in shared.people.values()}  # as study.toml of a bundle has it
    assert read_session(tmp_path / folder.name, level="shared", wizards=known).coded == before
    assert before[0].annotator == "W7" and "word 0" not in (tmp_path / folder.name / CODED_FILE).read_text()


@pytest.mark.parametrize("format", ["tables", "csv"])
def test_cells_that_a_spreadsheet_would_carry_out(format: str, folder: Path, tmp_path: Path) -> None:
    eaf = annotated(folder, tmp_path / "P01.eaf", [2.0])
    eaf.write_text(eaf.read_text().replace("word 0", '=HYPERLINK("x")'))
    run("coded", "add", folder, eaf)
    plain = run("export", folder, "--format", format, "-o", tmp_path / "plain")
    run("export", folder, "--format", format, "-o", tmp_path / "safe", "--spreadsheet-safe")
    assert "'" not in plain
    for file in (tmp_path / "safe").glob("*.csv") if format == "tables" else [tmp_path / "safe"]:
        with file.open(newline="") as opened:
            cells = [each for row in csv.reader(opened) for each in row]
        assert not [each for each in cells if each[:1] in ("=", "@", "\t", "\r")]
    if format == "tables":
        about = [
            json.loads((tmp_path / name / "datapackage.json").read_text())["description"] for name in ("plain", "safe")
        ]
        assert "--spreadsheet-safe" in about[0] and "begins with an apostrophe" in about[1]
        assert "'=HYPERLINK" in (tmp_path / "safe" / "coded.csv").read_text()


def test_formats_that_are_no_tables_refuse_it(folder: Path) -> None:
    assert "not with eaf" in run("export", folder, "--format", "eaf", "-o", "x", "--spreadsheet-safe", status=2)

"""`rise-engine redact`: the words are gone, and the session replays."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.base.errors import SessionError
from rise_engine.base.files import Disk
from rise_engine.base.words import Words, parse_replacement
from rise_engine.kernel.inputs import ActionReport, Note, SessionEnded, SessionStarted, Submit
from rise_engine.privacy import redaction
from rise_engine.privacy.redaction import NEW_SUFFIX, redact
from rise_engine.privacy.suggestions import suggest_words
from rise_engine.session.folder import INFO, JOURNAL, read_info
from rise_engine.session.journal_format import with_checksum
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.lock import JournalLock, JournalLockedError
from rise_engine.session.replay import compare_replay
from tests.chance import examples
from tests.commands import typed
from tests.kills import every_kill
from tests.session.journals import TOML, Made, Recording

PRIVATE = TOML + 'private = ["name"]\n'


def words(*replacements: str, whole: bool = False) -> Words:
    return Words(map(parse_replacement, replacements), whole_words=whole)


def finish(session: Recording) -> None:
    """The robot does everything that it was given."""
    session.wait(1)
    while session.goals:
        goal = next(iter(session.goals))
        session.report(goal, "accepted")
        session.report(goal)


def type_a_name(session: Recording) -> None:
    """A wizard types a name wherever one can be typed."""
    finish(session)
    session.assign('name = "Zoë Müller"')
    session.submit("say", "Hallo Zoë! Zoës Hund, ZOË")
    finish(session)
    session.submit("markCue", "Zoe\u0308 nods")
    session.do(Note(text='{"who": "Zo\\u00eb"}', source="wizard:w"))
    session.do(Note(text="Frau M&#252;ller", source="wizard:Zoë"))
    session.submit("nothing such", "Zoë")
    session.act("Greet")
    finish(session)


@pytest.fixture
def made(tmp_path: Path) -> Made:
    return made_by(tmp_path)


def made_by(tmp_path: Path, started: SessionStarted | None = None) -> Made:
    made = Made(tmp_path, toml=PRIVATE, started=started)
    type_a_name(made.session)
    made.session.do(SessionEnded(reason="over, says Zoë"))
    made.write_session()
    return made


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "clock"
    }


def assert_gone(folder: Path, *forms: str) -> None:
    for path, data in bytes_of(folder).items():
        if not path.startswith("scenario/"):
            for form in forms:
                assert form.casefold() not in data.decode().casefold(), path


FORMS = ("Zoë", "Zoe\u0308", "Zo\\u00eb", "Müller", "M&#252;ller")


def test_the_words_are_gone_and_the_session_replays(made: Made) -> None:
    before = compare_replay(made.folder)
    report = redact(made.folder, words("Zoë=NAME1", "Müller=NAME2"), by="W1")
    after = compare_replay(made.folder)
    assert after.identical and (after.inputs, after.records) == (before.inputs, before.records)
    assert_gone(made.folder, *FORMS)
    assert report.lines > 10 and report.remains == [] and report.longer_words == {"Zoës": 1}
    text = (made.folder / JOURNAL).read_text("utf-8")
    assert "Hallo NAME1! NAME1s Hund, NAME1" in text and "wizard:NAME1" in text and "Hello, NAME1 NAME2!" in text
    assert '"Anna"' in text, "what the memory began with is the scenario's"
    info = (made.folder / INFO).read_text("utf-8")
    assert f"lines = {report.lines}}}]" in info and 'by = "W1"' in info
    assert read_info(made.folder).seed == 7
    assert sorted(path.name for path in made.folder.iterdir()) == [JOURNAL, "scenario", INFO]
    assert {path.stat().st_mode & 0o777 for path in made.folder.iterdir() if path.is_file()} == {0o600}


def test_lines_that_hold_none_of_the_words_stay_as_they_are(made: Made) -> None:
    before = (made.folder / JOURNAL).read_bytes().splitlines()
    report = redact(made.folder, words("Zoë=NAME1"))
    after = (made.folder / JOURNAL).read_bytes().splitlines()
    assert len(after) == len(before)
    assert sum(one != other for one, other in zip(before, after, strict=True)) == report.lines


def test_once_more_with_another_word(made: Made) -> None:
    redact(made.folder, words("Zoë=NAME1"))
    redact(made.folder, words("NAME1=Q7", "Müller=NAME2"))
    assert compare_replay(made.folder).identical
    assert_gone(made.folder, *FORMS, "NAME1")
    assert (made.folder / INFO).read_text("utf-8").count("lines = ") == 2


def test_session_toml_says_nothing_either(tmp_path: Path) -> None:
    made = made_by(tmp_path, SessionStarted(participant="zoë"))
    path = made.folder / INFO
    path.write_text(path.read_text("utf-8").replace('wizard = ""', 'wizard = "Zoë"'), "utf-8")
    path.write_text(path.read_text("utf-8").replace('participant = "zoë"', 'participant = "zo\\u00eb"'), "utf-8")
    redact(made.folder, words("Zoë=NAME1"))
    info = read_info(made.folder)
    assert (info.wizard, info.participant, info.title) == ("NAME1", "NAME1", "Sample study")


def test_one_that_was_interrupted_between_its_two_files_is_made_again(tmp_path: Path) -> None:
    made = made_by(tmp_path, SessionStarted(participant="zoë"))
    before = (made.folder / INFO).read_bytes()
    redact(made.folder, words("Zoë=NAME1"))
    (made.folder / INFO).write_bytes(before)
    redact(made.folder, words("Zoë=NAME1"))
    assert read_info(made.folder).participant == "NAME1"


def test_what_the_study_knows_a_session_by_stays(tmp_path: Path) -> None:
    made = made_by(tmp_path, SessionStarted(participant="P07", study="s", condition="zoë+loud"))
    before = bytes_of(made.folder)
    with pytest.raises(SessionError, match="the study knows this session by 'P07'"):
        redact(made.folder, words("P07=P99"))
    assert bytes_of(made.folder) == before
    redact(made.folder, words("Zoë=NAME1"))
    assert read_info(made.folder).condition == "zoë+loud" and compare_replay(made.folder).identical


@pytest.mark.parametrize("word", ["Late", "Greet", "Table", "name"])
def test_words_that_decide_what_happens_are_refused_with_the_place(made: Made, word: str) -> None:
    before = bytes_of(made.folder)
    with pytest.raises(SessionError, match=r"journal.jsonl:\d+: without the words .* Nothing was changed"):
        redact(made.folder, words(f"{word}=QQ1"))
    assert bytes_of(made.folder) == before


def test_a_word_that_a_condition_compares_is_refused(tmp_path: Path) -> None:
    made = Made(tmp_path)
    made.session.assign("nobody = true")
    made.session.wait(10)
    made.session.event("/go")
    made.session.do(SessionEnded())
    made.write_session()
    before = bytes_of(made.folder)
    with pytest.raises(SessionError, match="they decide what happened"):
        redact(made.folder, words("nobody=N0"))
    assert bytes_of(made.folder) == before


def test_the_scenarios_own_words_stay_and_are_said(made: Made) -> None:
    made.session.do(Note(text="Anna came late"))
    made.write_session()
    report = redact(made.folder, words("Anna=NAME1"))
    assert compare_replay(made.folder).identical
    assert "NAME1 came late" in (made.folder / JOURNAL).read_text("utf-8")
    assert any("scenario/memory.json, line 1: the scenario's own words" in each for each in report.remains)
    assert any(each.startswith("journal.jsonl, lines ") for each in report.remains)


def test_longer_words_can_be_left(made: Made) -> None:
    made.session.do(Note(text="Graham is late, not Lateran"))
    made.write_session()
    with pytest.raises(SessionError):
        redact(made.folder, words("Lat=NAME1"))
    report = redact(made.folder, words("Lat=NAME1", "Graham=N2", whole=True))
    assert "N2 is late, not Lateran" in (made.folder / JOURNAL).read_text("utf-8")
    assert set(report.longer_words) == {"late", "Lateran", "Late"}


def test_trying_changes_nothing(made: Made) -> None:
    before = bytes_of(made.folder)
    report = redact(made.folder, words("Zoë=NAME1"), try_only=True)
    assert report.lines > 10 and bytes_of(made.folder) == before


def test_running_torn_and_damaged_sessions_are_refused(made: Made) -> None:
    lock = JournalLock(made.folder / JOURNAL)
    with pytest.raises(JournalLockedError):
        redact(made.folder, words("Zoë=NAME1"))
    lock.release()
    whole = made.journal.read_bytes()
    for broken, part in ((whole[:-9], "damaged"), (whole[:200] + b"x" + whole[201:], "damaged")):
        made.write(broken)
        with pytest.raises(SessionError, match=part):
            redact(made.folder, words("Zoë=NAME1"))
        assert made.journal.read_bytes() == broken
    unfinished = Made(made.folder.parent.parent / "other")
    unfinished.write(unfinished.whole[:-9])
    with pytest.raises(SessionError, match="recover the session first"):
        redact(unfinished.folder, words("Zoë=NAME1"))


def test_a_session_that_does_not_replay_as_it_is(made: Made) -> None:
    lines = made.journal.read_bytes().splitlines()
    at = next(index for index, line in enumerate(lines) if b'"timing"' in line)
    body = json.loads(lines[at].rpartition(b',"crc"')[0] + b"}")
    body["ended_at"] += 1
    lines[at] = with_checksum(json.dumps(body, ensure_ascii=False, separators=(",", ":")).encode())[:-1]
    made.write(b"\n".join(lines) + b"\n")
    with pytest.raises(SessionError, match="does not replay unchanged"):
        redact(made.folder, words("Zoë=NAME1"))


def test_what_a_recovery_kept_is_erased(made: Made) -> None:
    for name in ("journal.torn-1", "journal.damaged-2.jsonl"):
        (made.folder / name).write_text("half a line with Zo\\u00eb")
    (made.folder / "journal.torn-2").write_text("nothing of that kind")
    (made.folder / "journal.torn-3").write_text('"text":"P05 aka Zo\\u00')
    report = redact(made.folder, words("Zoë=NAME1"))
    assert report.erased == ["journal.damaged-2.jsonl", "journal.torn-1", "journal.torn-3"]
    assert (made.folder / "journal.torn-2").exists()


def test_a_hard_link_of_a_backup_is_left_and_said(made: Made, tmp_path: Path) -> None:
    os.link(made.journal, tmp_path / "backup")
    before = made.journal.read_bytes()
    report = redact(made.folder, words("Zoë=NAME1"))
    assert (tmp_path / "backup").read_bytes() == before
    assert any("another name elsewhere" in each for each in report.remains)


@pytest.mark.parametrize("call", range(1, 9))
def test_a_disk_that_fails_changes_nothing(made: Made, call: int) -> None:
    class Failing(Disk):
        calls = 0

        def _maybe_fail(self) -> None:
            self.calls += 1
            if self.calls == call:
                raise OSError(28, "No space left on device")

        def write(self, descriptor: int, data: bytes, offset: int) -> None:
            self._maybe_fail()
            super().write(descriptor, data, offset)

        def sync(self, descriptor: int) -> None:
            self._maybe_fail()
            super().sync(descriptor)

    before = bytes_of(made.folder)
    try:
        redact(made.folder, words("Zoë=NAME1"), disk=Failing())
    except SessionError as error:
        assert "the disk is full" in str(error)
        assert bytes_of(made.folder) == before
    else:  # only overwriting what has no name any more may fail
        assert call > 4
        assert_gone(made.folder, "Zoë")
    assert compare_replay(made.folder).identical
    assert not list(made.folder.glob(f"*{NEW_SUFFIX}"))


@pytest.mark.slow
def test_killed_at_any_touch_of_the_disk(made: Made, tmp_path: Path) -> None:
    """The session replays at any moment, and the next time everything is gone."""
    kept = tmp_path / "kept"
    shutil.copytree(made.folder, kept)

    def again() -> None:
        shutil.rmtree(made.folder)
        shutil.copytree(kept, made.folder)
        (made.folder / "journal.torn-1").write_text("Zoë")

    found = words("Zoë=NAME1", "Müller=NAME2")
    touches = []
    for touch in every_kill(made.folder, again, lambda disk: redact(made.folder, found, disk=disk)):
        touches.append(touch)
        assert compare_replay(made.folder).identical
        redact(made.folder, found)
        assert compare_replay(made.folder).identical
        assert_gone(made.folder, *FORMS)
        assert sorted(path.name for path in made.folder.iterdir()) == [JOURNAL, "scenario", INFO]
    assert touches[-1] > 20


NAMES = st.sampled_from(["Zoë", "Jean-Luc", "O'Neil", "Ana María", "Žižek", "李雷", "Weiß", "Q😀", "Bojana"])
GAPS = st.sampled_from(["", " ", "s ", "!", " und ", '", "', "\\n", "\\u0041", "\n", "&", "é", "{", "}"])


@st.composite
def texts(draw: Any) -> str:
    return "".join(f"{draw(GAPS)}{draw(NAMES)}" for _ in range(draw(st.integers(1, 3)))) + draw(GAPS)


@st.composite
def typings(draw: Any) -> list[tuple[str, str]]:
    kinds = st.sampled_from(["say", "note", "assign", "cue", "reject", "nested", "robot"])
    return draw(st.lists(st.tuples(kinds, texts()), min_size=1, max_size=6))


def do(session: Recording, kind: str, text: str) -> None:
    session.wait(0.25)
    match kind:
        case "say":
            session.do(Submit(function="say", behavior=text, source="wizard:w"))
        case "note":
            session.do(Note(text=text, source="wizard:w"))
        case "assign":
            session.do(Submit(function="assignValue", behavior=f"name = {json.dumps(text)}", source="wizard:w"))
        case "cue":
            session.do(Submit(function="markCue", behavior=text, source="wizard:w"))
        case "reject":
            session.do(Submit(function="startCommunicationRobotAct", behavior=f"? {text}", source="wizard:w"))
        case "nested":
            session.do(Note(text=json.dumps(json.dumps({text: [text]})), source="wizard:w"))
        case "robot":
            session.do(ActionReport(action="nothing/1", status="failed", reason=text))


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    yield tmp_path_factory.mktemp("random")


@pytest.mark.slow
@settings(max_examples=examples(40))
@given(typings(), st.lists(NAMES, min_size=1, max_size=3, unique=True))
def test_random_words_in_random_sessions(root: Path, typed: list[tuple[str, str]], names: list[str]) -> None:
    for path in root.iterdir():
        shutil.rmtree(path)
    made = Made(root)
    for kind, text in typed:
        do(made.session, kind, text)
    made.session.do(SessionEnded())
    made.write_session()
    before = bytes_of(made.folder)
    found = words(*(f"{name}=NAME{number}" for number, name in enumerate(names)))
    try:
        report = redact(made.folder, found)
    except SessionError:
        assert bytes_of(made.folder) == before
        raise
    assert compare_replay(made.folder).identical
    assert not any(found.find(line) for line in made.journal.read_text("utf-8").splitlines())
    assert read_journal(made.journal).damaged == {}
    assert report.lines == sum(
        one != other
        for one, other in zip(before[JOURNAL].splitlines(), made.journal.read_bytes().splitlines(), strict=True)
    )


# --- suggestions and the command ---


def test_suggested_words(made: Made) -> None:
    found = {each.word: each.why for each in suggest_words(made.folder)}
    assert list(found)[:1] == ["Zoë Müller"] or "private key name" in next(iter(found.values()))
    assert "private key name" in found["Zoë Müller"]
    assert "begins with a capital" in found["Zoë"] and "Hund" in found
    assert "Hallo" in found and "Hello" not in found


def test_addresses_are_suggested(made: Made) -> None:
    made.session.do(Note(text="write to m.mueller@example.org or 0521 106-00", source="wizard:anna"))
    made.session.do(Note(text="76 GB free since 2026-11-22"))  # of the engine: nobody typed it
    made.write_session()
    found = {each.word for each in suggest_words(made.folder)}
    assert {"m.mueller@example.org", "0521 106-00"} <= found
    assert not {"GB", "2026-11-22"} & found


def test_of_a_film_in_the_folder_only_the_name_is_looked_at(made: Made) -> None:
    (made.folder / "recordings").mkdir()
    film = made.folder / "recordings" / "Zoë.mkv"
    with film.open("wb") as file:
        file.write("Zoë".encode())
        file.truncate(3_000_000_000)  # a hole: read into memory it would be all there
    small = made.folder / "media.json"
    small.write_text('[{"path": "/data/Zoë.mkv", "kind": "video"}]')
    report = redact(made.folder, Words([parse_replacement("Zoë=NAME1")]))
    assert "the name of recordings/Zoë.mkv" in report.remains
    assert any(each.startswith("media.json, line 1") for each in report.remains)


def test_the_command(made: Made) -> None:
    result = typed("redact", made.folder, "--suggest")
    assert result.exit_code == 0 and "Zoë Müller" in result.output
    result = typed("redact", made.folder, "--replace", "Zoë=NAME1", "--try")
    assert result.exit_code == 0 and "nothing was done" in result.output
    result = typed("redact", made.folder, "--replace", "Zoë=NAME1", "--replace", "Müller=NAME2")
    assert result.exit_code == 0 and "it replays: identical" in result.output
    assert "Zoës (1)" in result.output
    result = typed("redact", made.folder, "--replace", "Zoë=NAME1")
    assert result.exit_code == 0 and "nothing was changed" in result.output
    result = typed("redact", made.folder, "--replace", "Late=NAME1")
    assert result.exit_code == 1 and "they decide what happened" in result.output
    assert typed("redact", made.folder).exit_code == 2
    assert typed("redact", made.folder, "--replace", "Z=Q").exit_code == 2
    assert typed("redact", "nowhere", "--replace", "Zoë=Q").exit_code == 2
    document = json.loads(typed("redact", made.folder, "--suggest", "--json").output)
    assert document and set(document[0]) == {"word", "why", "count"}


def test_new_kinds_of_inputs_are_looked_at() -> None:
    """A field of an input that people type into must not be among those that are never replaced."""
    assert not redaction._FIXED_FIELDS & {"behavior", "text", "reason", "value", "detail", "participant", "factors"}

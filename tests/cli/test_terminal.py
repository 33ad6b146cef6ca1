"""What commands write: nothing of a file reaches a terminal raw, and a full disk is a sentence."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from importlib.metadata import EntryPoints
from pathlib import Path

import msgspec
import pytest
from click import Context
from click.testing import CliRunner
from hypothesis import example, given
from hypothesis import strategies as st
from lxml import etree

from rise_engine.base.exit_status import NOT_WRITTEN
from rise_engine.base.text import UNSEEN, character_name, clean, escape_surrogates, find_unseen, restore_surrogates
from rise_engine.cli import program
from rise_engine.cli.session.sessions import print_sessions
from rise_engine.cli.session.transcript import Output
from rise_engine.cli.terminal import CleanStream, Refused, escape_json
from rise_engine.kernel.records import NoteRecord
from rise_engine.run.protocol.messages import VERSION, SessionSummary
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.model import SourceLocation
from tests.cli.processes import engine, folder
from tests.forked import run_engine

FULL = Path("/dev/full")
EVIL = "\x1b]0;owned\x07\x1b[2Jgone\x9b31m\u202eback\u061c\u206a\ufff9\U000e0041\u3164\u115f\r\nerror: not mine"
"""Sets the title of the window, clears the screen, turns the writing round, and begins a line of its own."""
EVERY_COMMAND = (
    ("check", "DIR"),
    ("check", "DIR", "--json"),
    ("eval", "1 + 1"),
    ("eval", "1 + 1", "--json"),
    ("schema", "--kind", "rules"),
    ("schema", "DIR", "--kind", "cra"),
    ("sessions", "--json"),
    ("robots",),
    ("robots", "DIR", "--json"),
    ("doctor", "--ros", "off"),
    ("--help",),
    ("--version",),
)


@pytest.mark.slow
@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full here")
@pytest.mark.parametrize("command", EVERY_COMMAND, ids=" ".join)
def test_a_full_disk_is_a_sentence(tmp_path: Path, command: tuple[str, ...]) -> None:
    study = str(folder(tmp_path / "s"))
    words = [study if word == "DIR" else word for word in command]
    with FULL.open("wb") as full:
        done = run_engine(*words, stdout=full)
    assert (done.returncode, done.stderr) == (
        NOT_WRITTEN,
        "error: standard output cannot be written: the disk is full\n",
    )


@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full here")
def test_standard_error_that_cannot_be_written(tmp_path: Path) -> None:
    study = folder(tmp_path / "s")
    with FULL.open("wb") as full:
        for words, code in ((["check", study], 0), (["check", tmp_path / "nowhere"], 2), (["run", study], 2)):
            words = [*map(str, words), *(["--rule", "none"] if code == 2 and words[0] == "run" else [])]
            done = run_engine(*words, stderr=full)
            assert done.returncode == code


@pytest.fixture
def evil(tmp_path: Path) -> Path:
    """A scenario whose title, names, topics, texts and file names would all play with the terminal."""
    in_xml = EVIL.replace("\x1b", "\x9b").replace("\x07", "").replace("\r\n", " ")
    toml = "title = " + json.dumps(EVIL) + "\n[actions.Dance]\nhelp = " + json.dumps(EVIL) + "\n"
    study = folder(
        tmp_path / f"s{EVIL}"[:60].replace("/", ""),
        toml,
        memory={"name": EVIL, EVIL: 1},
        evil=f'<Dialog name="{in_xml}"><Speech><actionID>1</actionID><message>{in_xml}</message></Speech></Dialog>',
        **{f"x{EVIL}"[:40]: f'<Dialog name="{in_xml}2"><Wait><actionID>1</actionID></Wait></Dialog>'},
    )
    rules = study / "rules" / "rules.xml"
    rules.write_text(rules.read_text("utf-8").replace('"/go"', f'"/go{in_xml}"'), "utf-8")
    return study


def seen(output: str) -> bool:
    return UNSEEN.search(output.replace("\n", "")) is None


@pytest.mark.slow
def test_nothing_of_a_file_reaches_the_terminal_raw(evil: Path) -> None:
    for words in (
        ("check", evil),
        ("check", f"{evil}{EVIL}"),
        ("run", evil, "--act", "Greet", "--speed", "max"),
        ("run", evil, "--rule", EVIL, "--speed", "max"),
        ("robots", evil),
        ("eval", f"'{EVIL}' = a{EVIL}"),
        ("replay", f"/tmp/{EVIL}"),
        ("export", f"/tmp/{EVIL}", "--format", "csv"),
        ("stop", EVIL),
        ("serve", f"/tmp/{EVIL}"),
    ):
        done = engine(*words)
        assert done.stdout + done.stderr and "Traceback" not in done.stderr, words
        assert seen(done.stdout + done.stderr), (words, done.stdout, done.stderr)


def test_a_title_begins_no_line_of_its_own(evil: Path) -> None:
    done = engine("check", evil)
    assert done.returncode == 1
    assert not any(line.startswith("error: not mine") for line in (done.stdout + done.stderr).splitlines())
    ran = engine("run", evil, "--act", "Greet", "--speed", "max")
    assert not any(line.startswith("error: not mine") for line in (ran.stdout + ran.stderr).splitlines())


@pytest.mark.slow
def test_json_keeps_every_character_and_is_safe_to_look_at(evil: Path) -> None:
    for words in (("check", evil, "--json"), ("robots", evil, "--json"), ("eval", f"'{EVIL}'", "--json")):
        done = engine(*words)
        assert seen(done.stdout) and json.loads(done.stdout)
    ran = engine("run", evil, "--act", "Greet", "--speed", "max", "--json")
    records = [json.loads(line) for line in ran.stdout.splitlines()]
    assert not records or (seen(ran.stdout) and any(EVIL in str(record) for record in records))
    schema = engine("schema", evil, "--kind", "cra")
    assert seen(schema.stdout)
    if schema.returncode == 0:
        etree.fromstring(schema.stdout.encode())


def test_running_sessions_are_listed_clean(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    numbers = {"version": VERSION, "seed": 1, "t": 1.0, "seq": 1, "busy": True, "stopped": False, "clients": [EVIL]}
    texts = ("title", "mode", "robot", "scenario_folder", "scenario_hash", "folder", "control", "trouble")
    about = SessionSummary(**numbers, **dict.fromkeys(texts, EVIL))
    monkeypatch.setattr("rise_engine.cli.session.sessions.all_running_sessions", lambda: {"one": about})
    monkeypatch.setattr("rise_engine.cli.session.sessions.unfinished_sessions", lambda found: [])
    print_sessions(as_json=False)
    listed = capsys.readouterr().out
    assert seen(listed) and all(line.startswith(("one", "    ")) for line in listed.splitlines())


def test_the_transcript_of_a_session_is_clean(capsysbinary: pytest.CaptureFixture[bytes]) -> None:
    Output(json=False)(NoteRecord(1, 0.0, "", EVIL, "anna"))
    Output(json=True)(NoteRecord(1, 0.0, "", EVIL, "anna"))
    told_, json_ = capsysbinary.readouterr().out.decode().splitlines()
    assert seen(told_) and "owned" in told_
    assert seen(json_) and json.loads(json_)["text"] == EVIL


def test_a_finding_is_one_clean_line() -> None:
    finding = str(Diagnostic("error", "x", EVIL, SourceLocation(EVIL)))
    assert seen(finding) and "\n" not in finding


# --- the pieces -----------------------------------------------------------------------------------------------------


@pytest.mark.slow
@given(st.text())
@example(EVIL)
@example("\udcff\x00\x7f")
def test_clean(text: str) -> None:
    cleaned = clean(text)
    assert UNSEEN.search(cleaned) is None
    assert clean(cleaned) == cleaned
    if not any("\ud800" <= each <= "\udfff" for each in text):
        assert len(cleaned) == len(text)
    assert clean(text, keep="\n").count("\n") == text.count("\n")


@pytest.mark.parametrize(
    "character",
    [
        *("\x00", "\x07", "\x1b", "\x7f", "\x9b", "\u00ad", "\u034f", "\u061c", "\u115f", "\u1160", "\u180e", "\u200b"),
        *("\u200f", "\u202e", "\u2066", "\u206a", "\u206f", "\u3164", "\uffa0", "\ufff9", "\ufffb", "\U000e0000"),
        "\U000e007f",
    ],
    ids=ascii,
)
def test_what_is_not_seen(character: str) -> None:
    assert clean(f"a{character}b") == "a·b"


@pytest.mark.parametrize("text", ["Grüße, 你好", "❤️ 👍🏽", "e\u0301", "a\u00a0b", "٣ عربى", "�"])
def test_what_is_seen_stays(text: str) -> None:
    assert clean(text) is text


@pytest.mark.slow
@given(st.recursive(st.text() | st.integers(), lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner)))
@example({EVIL: [EVIL, "\U000e0041\n"]})
def test_json_is_the_same_value(value: object) -> None:
    line = escape_json(msgspec.json.format(msgspec.json.encode(value), indent=2))
    assert json.loads(line) == value
    assert seen(line.decode())


@given(st.binary())
def test_paths_that_are_no_text(name: bytes) -> None:
    path = os.fsdecode(name.replace(b"\\", b"/"))
    assert restore_surrogates(escape_surrogates(path)) == path
    escape_surrogates(path).encode()


def test_where_something_strange_stands() -> None:
    assert find_unseen("a \t\r\nb") == -1
    assert find_unseen("ab\u00a0c\u200b") == 2 and find_unseen("ab\u00a0c\u200b", 3) == 4
    assert character_name("\u00a0") == "U+00A0 (NO-BREAK SPACE)" and character_name("\x85") == "U+0085 (NEXT LINE)"


def test_a_stream_that_fails() -> None:
    class Full(io.StringIO):
        def write(self, text: str) -> int:
            raise OSError(28, "No space left on device")

    class Broken(io.StringIO):
        def write(self, text: str) -> int:
            raise BrokenPipeError

    with pytest.raises(Refused, match="the disk is full"):
        CleanStream(Full(), may_fail=False).write("a")
    with pytest.raises(BrokenPipeError):  # it ends the program in its own way
        CleanStream(Broken(), may_fail=False).write("a")
    assert [CleanStream(each, may_fail=True).write("a") for each in (Full(), Broken())] == [1, 1]
    kept = io.StringIO()
    CleanStream(kept, may_fail=False).writelines(["a\x1b[2J\tb\n", "c\n"])
    assert kept.getvalue() == "a·[2J\tb\nc\n"


def test_the_console_has_the_same_definition() -> None:
    code = "from rise_tui.rendering.text import clean; from rise_engine.base import text; assert clean is text.clean"
    assert run_engine(code=code).returncode == 0


# --- help ---


def test_help_names_every_command_in_one_line_each_and_loads_none() -> None:
    done = run_engine("--help")
    lines = {line.split()[0]: line for line in done.stdout.splitlines() if line.startswith("  ") and line.endswith(".")}
    names = [*program.main.list_commands(Context(program.main))]
    assert {*names} <= lines.keys()
    assert all(len(lines[name]) <= 80 and "..." not in lines[name] for name in names)
    for name in names:
        assert program.main.get_command(Context(program.main), name) is not None
    code = "import sys; from rise_engine.cli.program import main; main(['--help'], standalone_mode=False)"
    check = "rise_engine.cli.scenario.check"
    loaded = subprocess.run(
        [
            sys.executable,
            "-c",
            f"{code}; print({{'rise_engine.kernel', '{check}', 'rise_exchange.bml'}} & {{*sys.modules}})",
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    assert loaded.stdout.endswith("set()\n")


def test_help_has_no_empty_section_where_no_package_adds_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a checkout whose environment was made for an earlier state of it."""
    monkeypatch.setattr("rise_engine.cli.program.installed_plugins", lambda group: EntryPoints())
    done = CliRunner().invoke(program.main, ["--help"])
    assert done.exit_code == 0 and "Use results:" in done.output and "Exchange files" not in done.output

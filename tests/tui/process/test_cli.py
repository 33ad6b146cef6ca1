"""The command line of `rise-tui`: options that belong together, what its console is shown on, completions."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path
from shlex import quote
from shutil import rmtree, which

import pytest
from click.testing import CliRunner

from rise_engine.cli.terminal import Refused
from rise_tui.cli import start
from rise_tui.cli.command_line import CommandLine
from rise_tui.cli.main import main
from rise_tui.config.display import DisplayOptions
from tests.tui.fake import DEMO
from tests.tui.scripted import scripted
from tests.tui.terminals import ROOT, environment_of, run_rise_tui, terminal

pytestmark = pytest.mark.slow

MOUSE = re.compile(rb"\x1b\[\?(?:9|100[0-3]|1005|1006|101[56])[hl]")
"""Whatever asks a terminal for the mouse, or takes that back."""


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[CommandLine]:
    """What would have been started."""
    found: list[CommandLine] = []
    monkeypatch.setattr("rise_tui.cli.main.start", found.append)
    return found


def test_what_is_asked_for(asked: list[CommandLine]) -> None:
    line = "--config x --participant P07 --condition b --theme mono --mouse off --fps 5 --keys none --fresh --new"
    done = CliRunner().invoke(main, [*line.split(), "--wizard", " anna ", "--ros-args", "-r", "__ns:=/lab"])
    assert done.exit_code == 0, done.output
    (it,) = asked
    assert (it.folder, it.wizard, it.keys, it.fresh, it.unfinished) == ("x", "anna", "none", True, "new")
    assert it.display == DisplayOptions("mono", "auto", mouse=False, fps=5)
    assert (it.settings.participant, it.settings.condition) == ("P07", "b")
    assert it.settings.ros.arguments == ("-r", "__ns:=/lab")


def test_what_a_session_begins_with(asked: list[CommandLine]) -> None:
    line = ["--config", "x", "--set", "task=2", "--set", "name=Anna", "--place", "memory=pilot.json"]
    assert CliRunner().invoke(main, line).exit_code == 0
    (it,) = asked
    assert it.settings.paths == {"memory": "pilot.json"} and it.wizard is None
    assert it.only_for_new == ["--set", "--place"]
    assert [task.behavior for task in start._first_inputs(it)] == ['{"task": 2}', '{"name": "Anna"}']
    with pytest.raises(Refused, match="--set task: write KEY=JSON"):
        start._first_inputs(CommandLine(sets=("task",)))
    with pytest.raises(Refused):
        _ = CommandLine(places=("memory",)).settings


def test_what_is_usual(asked: list[CommandLine]) -> None:
    assert CliRunner().invoke(main, []).exit_code == 0
    assert asked[0].display == DisplayOptions() and asked[0].role == "wizard"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--config", "x", "--session", "y"), "say either --config or --session"),
        (("--session", "x", "--replay", "y"), "say either --session or --replay"),
        (("--set", "a=1"), "use --set only with --config DIR"),
        (("--place", "memory=b.json"), "use --place only with --config DIR"),
        (("--participant", "P07"), "use --participant only with --config DIR"),
        (("--colors", "mono", "--theme", "light"), "--colors mono leaves no colours for --theme light"),
        (("--colors", "88"), "Invalid value for '--colors'"),
        (("--theme", "pink"), "Invalid value for '--theme'"),
        (("--fps", "0"), "Invalid value for '--fps'"),
        (("--fps", "61"), "Invalid value for '--fps'"),
        (("--mouse", "maybe"), "Invalid value for '--mouse'"),
        (("--theme", "light", "info"), "--theme cannot come before `info`"),
        (("--config", "x", "--new", "keys", "x"), "--config, --new cannot come before `keys`"),
        (("nothing",), "No such command 'nothing'"),
        (("completions", "tcsh"), "Invalid value for '{bash|zsh|fish}'"),
    ],
)
def test_wrong_usage(arguments: tuple[str, ...], said: str) -> None:
    done = CliRunner().invoke(main, list(arguments))
    assert done.exit_code == 2 and said.lower() in done.output.lower(), done.output


def test_the_console_is_imported_only_by_what_opens_one() -> None:
    code = "import sys, rise_tui.cli.main; print([m for m in ('textual', 'rise_tui.actions') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.strip() == "[]"


def test_without_the_mouse_nothing_is_asked_of_the_terminal() -> None:
    home = tempfile.mkdtemp(prefix="rise-", dir="/tmp")
    environment_of(home)
    try:
        with scripted(home):
            for mouse in ("on", "off"):
                with terminal("--mouse", mouse, home=home) as it:
                    sent = b""
                    while b"LIVE" not in it.shown:
                        assert it.read(5.0)
                    sent += it.shown
                    it.press(b"\x03")
                    it.until("Detach (d)")
                    it.press(b"d")
                    assert it.ended() == 0
                    it.read(0.2)
                    sent += it.shown
                    assert bool(MOUSE.search(sent)) is (mouse == "on")
                    on, off = (set(re.findall(rb"\x1b\[\?(10\d\d)" + end, sent)) for end in (b"h", b"l"))
                    assert on <= off, "a mode is left on"
    finally:
        rmtree(home, ignore_errors=True)


def test_a_session_is_chosen_by_its_name_and_info_tells_which_run_and_not_who_takes_part() -> None:
    with terminal("--config", DEMO, "--seed", "1", "--participant", "P07", "--wizard", "anna") as it:
        it.until("LIVE")
        name = next(Path(it.home, "run").glob("*.lock")).stem
        report = info(Path(it.home))
        row = next(line for line in report.splitlines() if name in line)
        assert "DEBUG" in row and "1 attached" in row
        assert "P07" not in report and "anna" not in report
        with terminal("--session", name.rpartition("-")[0], "--observe", home=it.home) as other:
            other.until("WATCHING")
        with terminal("--session", "other", home=it.home) as other:
            assert other.ended() == 2
            other.read(0.2)
            assert f"there are: {name}".encode() in other.shown


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completions(shell: str, tmp_path: Path) -> None:
    done = run_rise_tui("completions", shell)
    assert done.returncode == 0 and "_RISE_TUI_COMPLETE" in done.stdout and done.stderr == ""
    if shell == "bash" and which("bash"):
        script = tmp_path / "completions"
        script.write_text(done.stdout)
        ask = f"PATH={quote(str(Path(sys.executable).parent))}:$PATH; source {quote(str(script))}\n"
        for words in ("rise-tui --the", "rise-tui --theme colo", "rise-tui inf"):
            ask += f"COMP_WORDS=({words}); COMP_CWORD={len(words.split()) - 1}; COMPREPLY=()\n"
            ask += "_rise_tui_completion rise-tui; echo ${COMPREPLY[@]}\n"
        told = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=True, cwd=ROOT)
        assert told.stdout.split() == ["--theme", "colorblind", "colorblind-light", "info"]


# --- info -------------------------------------------------------------------------------------------------------------


def info(home: Path, *arguments: str, **environment: str) -> str:
    own = {**environment_of(str(home)), **environment}
    done = run_rise_tui("info", *arguments, env=own)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    return done.stdout


def value(report: str, name: str) -> str:
    return next(line[18:] for line in report.splitlines() if line.startswith(f"  {name} "))


def test_info_says_what_a_report_needs(tmp_path: Path) -> None:
    report = info(tmp_path, TMUX="/tmp/x,1,0", SSH_CONNECTION="10.1.2.3 4 10.1.2.4 22", NO_COLOR="")
    assert value(report, "textual").startswith("8.") and value(report, "rise-tui") and value(report, "python")
    assert (value(report, "tmux"), value(report, "ssh"), value(report, "screen")) == ("yes", "yes", "no")
    assert value(report, "colours") == "truecolor, because COLORTERM=truecolor"
    assert value(report, "theme") == "dark" and value(report, "UTF-8") == "yes"
    assert value(report, "sockets") == str(tmp_path / "run") and "(not there)" in value(report, "records")
    assert "no session is running" in report and "none: the usual keys" in report
    assert value(info(tmp_path, NO_COLOR="1"), "colours") == "mono, because NO_COLOR is set"


def test_info_tells_nothing_that_is_not_asked_for(tmp_path: Path) -> None:
    secrets = {"API_TOKEN": "s3cret-1", "SSH_CONNECTION": "10.9.8.7 1 10.9.8.6 22", "TMUX": "/tmp/secret-socket,1"}
    report = info(tmp_path, **secrets, HOME=str(tmp_path / "anna"), USER="anna-lab", LOGNAME="anna-lab")
    for secret in ("s3cret", "10.9.8.7", "secret-socket", "anna-lab", str(tmp_path / "anna")):
        assert secret not in report


def test_info_tells_what_is_wrong_with_the_key_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('[keys]\ncoe = "f5"\nzoom = "f5"\n')
    report = info(tmp_path, "--keys", str(path))
    assert "mine.toml:2:1: error unknown-action" in report and value(report, "other keys") == "zoom"


def test_a_start_ends_with_its_status(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(start, "prepare_textual", lambda *_: None)
    monkeypatch.setattr(start, "_attach", lambda *_: start._refuse_start("why"))
    result = CliRunner().invoke(main, ["--keys", "none"])
    assert (result.exit_code, result.stderr) == (2, "why\n")

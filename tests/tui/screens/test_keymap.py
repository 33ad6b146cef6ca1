"""The user's key file: read and checked as a whole, and followed wherever a key is shown or pressed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from rise_tui.actions import ACTIONS, BY_ID
from rise_tui.config.key_file import FIXED, KeyFile, read_keys, textual_keymap
from rise_tui.config.preferences import config_folder, key_file_path
from rise_tui.key_labels import first_key_label, key_label, keys_of, use_own_keys
from rise_tui.screens.help import HelpScreen
from tests.tui.conftest import console
from tests.tui.fake import DEMO, demo
from tests.tui.terminals import terminal


@pytest.fixture(autouse=True)
def usual_keys() -> Iterator[None]:
    yield
    use_own_keys({})


def written(folder: Path, text: str) -> KeyFile:
    path = folder / "keys.toml"
    path.write_text(text, encoding="utf-8")
    return read_keys(path)


def test_one_key_or_several_for_any_action(tmp_path: Path) -> None:
    text = """
    [keys]
    cue = "f5"
    zoom = ["F4", "ctrl+f"]
    theme = "%"
    filler = []
    acts.stop = "delete"
    scheduler.earlier = "shift+up"
    "log.follow" = "ctrl+v"
    """
    keys = written(tmp_path, text)
    assert keys.problems == ()
    assert keys.keys == {
        "cue": ("f5",),
        "zoom": ("f4", "ctrl+f"),
        "theme": ("percent_sign",),
        "filler": (),
        "acts.stop": ("delete",),
        "scheduler.earlier": ("shift+up",),
        "log.follow": ("ctrl+v",),
    }
    assert textual_keymap(keys)["zoom"] == "f4,ctrl+f" and textual_keymap(keys)["filler"] == "no-key-of-filler"


def test_two_actions_can_change_places(tmp_path: Path) -> None:
    keys = written(tmp_path, '[keys]\ncue = "comma"\nfiller = "space"\n')
    assert keys.problems == () and keys.keys == {"cue": ("comma",), "filler": ("space",)}


@pytest.mark.parametrize(
    ("line", "place", "said"),
    [
        ('coe = "f5"', "2:1", "there is no action `coe`; did you mean `cue`?"),
        ('rules.begin = "f5"', "2:7", "there is no action `rules.begin`"),
        ("cue = 5", "2:7", 'a key is a text: cue = "f5"'),
        ('cue = ["f5", 5]', "2:7", "a key is a text"),
        ('cue = "ctrl+h"', "2:7", "terminals send the same for ctrl+h and backspace"),
        ('cue = "ctrl+i"', "2:7", "terminals send the same for ctrl+i and tab"),
        ('cue = "ctrl+b"', "2:7", "tmux takes ctrl+b"),
        ('cue = "f1"', "2:7", "GNOME Terminal opens its help"),
        ('cue = "ctrl+5"', "2:7", "terminals send the digit"),
        ('cue = "alt+x"', "2:7", "macOS types a character with it"),
        ('cue = "shift+up"', "2:7", "not every terminal delivers it"),
        ('cue = "slsh"', "2:7", "`slsh` is not the name of a key; did you mean `slash`?"),
        ('cue = "up"', "2:7", "it moves in lists"),
        ('cue = "ctrl+n"', "2:7", "it moves in lists"),
        ('cue = "escape"', "2:7", "it leaves whatever is open"),
        ('stop = "s"', "2:8", "it works while you type too"),
        ('stop = "enter"', "2:8", "it works while you type too"),
        ("stop = []", "2:8", "`stop` needs a key"),
        ('cue = "f4"', "2:7", "`F4` is given to `cue`, and `zoom` has it too"),
        ('cue = "enter"', "2:7", "has it too"),
        ('stop = "ctrl+u"', "2:8", "has it too"),
        ("cue = f5", "2:7", "this is not TOML"),
        ('cue = "f5"\ncue = "f6"', "3:1", "`cue` is given twice"),
    ],
)
def test_what_is_wrong_and_where(tmp_path: Path, line: str, place: str, said: str) -> None:
    keys = written(tmp_path, f"[keys]\n{line}\n")
    found = [str(finding) for finding in keys.problems]
    assert any(each.startswith(f"{tmp_path}/keys.toml:{place}: error") and said in each for each in found), found


def test_everything_that_is_wrong_is_told_at_once(tmp_path: Path) -> None:
    text = '[key]\ncue = "f5"\n[keys]\ncue = "f5"\nzoom = "f5"\nhelp = "ctrl+m"\nnothing = "f6"\nstop = []\n'
    found = "\n".join(map(str, written(tmp_path, text).problems))
    for said in (
        "no `key` in a key file; did you mean `keys`?",
        "`F5` is given to `cue`",
        "ctrl+m",
        "`nothing`",
        "`stop`",
    ):
        assert said in found
    assert found.count("`F5` is given to") == 1, "the same thing is told twice"


def test_a_pane_may_use_a_key_that_another_pane_uses(tmp_path: Path) -> None:
    assert written(tmp_path, '[keys]\nacts.start = "insert"\n').problems == ()
    assert written(tmp_path, '[keys]\nmemory.edit = "insert"\n').problems != ()


@pytest.mark.parametrize("content", [b"\xff\xfe", b"\x00\x01\x02\x03", b"[keys]\ncue = '\xe4'\n"])
def test_a_file_that_cannot_be_read_is_told(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "keys.toml"
    path.write_bytes(content)
    assert read_keys(path).problems and not read_keys(path).keys
    assert read_keys(tmp_path).problems and read_keys(tmp_path / "none.toml").problems


def test_where_the_file_is_looked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert key_file_path(None) is None
    usual = tmp_path / "rise-tui" / "keys.toml"
    usual.parent.mkdir()
    usual.write_text("")
    assert (
        key_file_path(None) == usual
        and key_file_path("none") is None
        and key_file_path("/a/b.toml") == Path("/a/b.toml")
    )
    monkeypatch.setenv("XDG_CONFIG_HOME", "relative")  # the specification says that this counts as not set
    assert config_folder() == Path.home() / ".config" / "rise-tui"


def test_what_the_scenario_has_too(tmp_path: Path) -> None:
    keys = written(tmp_path, '[keys]\ntheme = "g"\nhelp = "f5"\nzoom = ["f4", "."]\n')
    assert keys.problems == ()
    found = [str(each) for each in keys.clashes(demo().keys)]
    assert len(found) == 2
    assert "keys.toml:2:9: error" in found[0] and "`g` is given to `theme` here" in found[0]
    assert "startCommunicationRobotAct Greet in the scenario (scenario.toml:" in found[0]
    assert "`.` is given to `zoom` here" in found[1]


def test_every_action_can_be_given_a_key_and_keeps_its_own(tmp_path: Path) -> None:
    for action in ACTIONS:
        usual = ", ".join(f'"{key}"' for key in action.keys)
        keys = written(tmp_path, f"[keys]\n{action.id} = [{usual}]\n")
        assert keys.problems == () and keys.keys == {action.id: action.keys}
    assert not set(FIXED) & {key for action in ACTIONS if action.scope == "everywhere" for key in action.keys}


# --- in the console ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_the_console_follows_the_file_and_shows_its_keys(tmp_path: Path) -> None:
    keys = written(tmp_path, '[keys]\nstop = "f12"\nhelp = "f5"\ncue = "%"\ntheme = "f6"\nfiller = []\n')
    async with console(keys=keys) as it:
        hints = it.bars.key_hints.text
        assert "F5 help" in hints and "? help" not in hints
        assert first_key_label(BY_ID["cue"]) == "%" and keys_of(BY_ID["help"]) == ("f5",)
        await it.press("question_mark", "f9", "ctrl+g", "space", "comma")
        assert it.client.sent == [] and it.app.screen is it.screen, "a key that was taken away does something"
        await it.press("percent_sign")
        await it.sent("markCue", "")
        await it.press("f12")
        await it.sent("stopAll", "")
        await it.press("f6")
        await it.until(lambda: it.app.screen is not it.screen)  # an action that had no key
        await it.press("escape", "f5")
        await it.shows(HelpScreen)
    async with console() as it:
        assert "? help" in it.bars.key_hints.text, "the keys of another console are left over"


async def test_a_clash_with_the_scenario_opens_no_console(tmp_path: Path) -> None:
    from rise_tui.console.app import ConsoleApp
    from tests.tui.fake import FakeClient, FakeLauncher

    client = FakeClient(demo())
    keys = written(tmp_path, '[keys]\ntheme = "g"\nhelp = "m"\n')
    app = ConsoleApp(client, wizard="anna", launcher=FakeLauncher(client), keys=keys)
    async with app.run_test() as pilot:
        for _ in range(100):
            if app.return_code is not None:
                break
            await pilot.pause(0.02)
    assert app.return_code == 2 and client.closed == [False], "the session must go on"
    assert app.exit_message.count("error key-twice") == 2 and "--keys none" in app.exit_message


@pytest.mark.pty
def test_a_console_with_a_broken_key_file_does_not_start() -> None:
    with terminal("--config", DEMO, "--keys", "nowhere.toml") as it:
        assert it.ended() == 2 and it.engines() == []
        it.read(0.2)
        assert b"nowhere.toml:1:1" in it.shown and b"--keys none" in it.shown and b"\x1b" not in it.shown


@pytest.mark.pty
def test_a_clash_starts_no_engine_and_the_usual_keys_always_work(tmp_path: Path) -> None:
    path = tmp_path / "keys.toml"
    path.write_text('[keys]\ntheme = "g"\n')
    with terminal("--config", DEMO, "--keys", str(path)) as it:
        assert it.ended() == 2 and it.engines() == []
        with terminal("--config", DEMO, "--keys", "none", "--seed", "1", home=it.home) as usual:
            usual.until("LIVE")
            assert it.engines()
            with terminal("--keys", str(path), home=it.home) as attached:
                assert attached.ended() == 2
                attached.read(0.2)
                assert b"`g` is given to `theme`" in attached.shown


def test_labels_of_keys() -> None:
    labels = {key: key_label(key) for key in ("percent_sign", "full_stop", "f9", "ctrl+g", "space", "n", "N")}
    assert list(labels.values()) == ["%", ".", "F9", "^G", "space", "n", "N"]

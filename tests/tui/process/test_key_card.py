"""The key card: every key of the scenario and of the console, on 80 columns or on A4."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest
from rich.cells import cell_len

from rise_engine.scenario.model import Scenario
from rise_tui.actions import ACTIONS
from rise_tui.cli.key_card import KeyCardEntry, KeyCardSection, html_page, printed_key, sections, text_lines
from rise_tui.key_labels import use_own_keys
from tests.tui.fake import DEMO, demo
from tests.tui.terminals import ROOT, environment_of, run_rise_tui

pytestmark = pytest.mark.slow

SCENARIOS = [DEMO, *(str(path.parent) for path in sorted((ROOT / "scenarios").glob("*/scenario.toml")))]


@pytest.fixture(autouse=True)
def usual_keys() -> Iterator[None]:
    yield
    use_own_keys({})


def run(*arguments: str, home: Path) -> subprocess.CompletedProcess[str]:
    environment = environment_of(str(home))
    return run_rise_tui("keys", *arguments, env=environment)


@pytest.mark.parametrize("folder", SCENARIOS, ids=lambda folder: Path(folder).name)
def test_the_card_has_every_key_and_fits_a_terminal(folder: str, tmp_path: Path) -> None:
    from rise_engine.scenario.loader import load

    done = run(folder, home=tmp_path)
    assert done.returncode == 0 and done.stderr == ""
    scenario = load(folder).scenario
    assert scenario is not None
    printed = done.stdout.splitlines()
    assert max(cell_len(line) for line in printed) <= 80
    for binding in scenario.keys.values():
        row = next(line for line in printed if line.split()[:1] == [printed_key(binding.key)])
        assert binding.behavior[:20] in row
    for action in ACTIONS:
        rows = [line for line in printed if action.title[:23] in line]
        assert any(all(printed_key(key) in row for key in action.keys) for row in rows), action
    for name, settings in scenario.act_settings.items():
        row = next(line for line in printed if f" {name} " in f"{line} " or f"({name})" in line)
        assert ("press twice" in row) is settings.hold and ("filler" in row.removeprefix(name)) >= settings.filler


def test_the_authors_own_words_are_on_the_card_with_what_they_stand_for() -> None:
    card = [line for section in sections(lablinking()) for line in text_lines("x", (section,))]
    assert any(line.split() == ["n", "next", "(Next)"] for line in card)
    assert any(line.split() == ["u", "understood", "(understood", "=", "true)"] for line in card)


def lablinking() -> Scenario:
    from rise_engine.scenario.loader import load

    found = load(str(ROOT / "scenarios" / "lablinking")).scenario
    assert found is not None
    return found


def test_acts_without_a_key_are_on_the_card_too() -> None:
    scenario = demo()
    unbound = scenario.acts.keys() - {binding.behavior for binding in scenario.keys.values()}
    on_card = {entry.title for section in sections(scenario) for entry in section.entries if not entry.keys}
    assert unbound <= on_card


def test_the_users_own_keys_are_printed(tmp_path: Path) -> None:
    folder = tmp_path / "config" / "rise-tui"
    folder.mkdir(parents=True)
    (folder / "keys.toml").write_text('[keys]\ncue = "f5"\ntheme = "%"\n')
    cue = next(line for line in run(DEMO, home=tmp_path).stdout.splitlines() if "Mark the participant" in line)
    assert cue.split()[0] == "f5".upper()
    usual = next(line for line in run("--keys", "none", home=tmp_path).stdout.splitlines() if "Mark the parti" in line)
    assert usual.split()[0] == "space"


@pytest.mark.parametrize(
    ("text", "said"),
    [('[keys]\ncoe = "f5"\n', "did you mean `cue`"), ('[keys]\ntheme = "g"\n', "startCommunicationRobotAct Greet")],
)
def test_a_card_that_would_be_wrong_is_not_printed(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    done = run(DEMO, "--keys", str(path), home=tmp_path)
    assert done.returncode == 1 and done.stdout == "" and said in done.stderr


def test_a_scenario_that_does_not_load(tmp_path: Path) -> None:
    done = run(str(tmp_path), home=tmp_path)
    assert done.returncode == 1 and "there is no scenario" in done.stderr


class Page(HTMLParser):
    """Checks that what is opened is closed, and collects what would be loaded."""

    VOID = ("meta", "br", "link", "img")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text = ""
        self.loaded: list[str] = []
        self.tags: set[str] = set()
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.loaded += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] != ["style"]:
            self.text += data
        else:
            assert "url(" not in data and "@import" not in data


def test_the_page_needs_nothing_else_and_takes_no_markup(tmp_path: Path) -> None:
    evil = '<script>alert("&")</script>'
    made = html_page(evil, (KeyCardSection(evil, (KeyCardEntry(("<", "&"), evil, evil, (evil,)),)),))
    read = Page(made)
    assert read.loaded == [] and "script" not in read.tags and read.text.count(evil) == 6
    assert "size: A4" in made


def test_the_page_is_written_or_printed(tmp_path: Path) -> None:
    file = tmp_path / "card.html"
    done = run(DEMO, "--html", str(file), home=tmp_path)
    assert done.returncode == 0 and done.stdout == ""
    text = file.read_text(encoding="utf-8")
    read = Page(text)
    assert all(action.title in read.text for action in ACTIONS) and "Greet" in read.text and "press twice" in read.text
    assert run(DEMO, "--html", home=tmp_path).stdout == text
    done = run(DEMO, "--html", str(tmp_path / "no" / "card.html"), home=tmp_path)
    assert done.returncode == 1 and "cannot be written" in done.stderr


def test_long_and_wide_names_fit() -> None:
    entries = (
        KeyCardEntry(("ctrl+g", "F9"), "学" * 60),
        KeyCardEntry((), "x" * 200, "word " * 60, ()),
        KeyCardEntry(("n",), "y" * 99),
    )
    made = list(text_lines("学" * 60, (KeyCardSection("Acts", entries),)))
    assert max(cell_len(line) for line in made) <= 80


def test_nothing_that_a_scenario_says_reaches_the_terminal_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text('title = "\\u001b[2Jevil"\n', encoding="utf-8")
    (tmp_path / "acts").mkdir()
    (tmp_path / "acts" / "a.xml").write_text(
        '<CommunicationRobotActs><CommunicationRobotAct name="A"><Speech actionID="1"><text>a</text></Speech>'
        "</CommunicationRobotAct></CommunicationRobotActs>"
    )
    done = run(str(tmp_path), home=tmp_path)
    assert "\x1b" not in done.stdout + done.stderr

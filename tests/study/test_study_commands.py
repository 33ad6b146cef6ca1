"""`rise-engine study new`, `check` and `plan`: what they ask, write and print."""

from __future__ import annotations

import json
import os
import select
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import Result

from rise_engine.checks import kinds
from rise_engine.cli.study import answers
from rise_engine.scenario.loader import load
from rise_engine.scenario.shipped_studies import shipped_studies
from rise_engine.study.model import Study
from rise_engine.study.study_toml import load_study
from tests.commands import typed
from tests.forked import STDOUT, Forked
from tests.study.designs import DESIGN, study_folder

TWO_FACTORS = (
    *("--scenario", "lablinking", "--factor", "hesitation=between", "--level", "hesitation.yes=hesitation = true"),
    *("--level", "hesitation.no=hesitation = false", "--factor", "noise=w", "--level", "noise.quiet="),
    *("--level", "noise.loud=distraction = true, pause_ms = 300", "--stratum", "language=de,en"),
)


@pytest.fixture(autouse=True)
def nothing_is_explored(monkeypatch: pytest.MonkeyPatch) -> None:
    """What exploring and playing finds is in test_kinds.py."""
    monkeypatch.setattr(kinds, "QUICK_SECONDS", 0.0)


def study(*arguments: str) -> Result:
    return typed("study", *arguments)


def loaded(path: Path) -> Study:
    result = load_study(path)
    assert result.study is not None, result.diagnostics
    return result.study


# --- new, by options --------------------------------------------------------------------------------------------------


def test_a_study_by_options(tmp_path: Path) -> None:
    folder = tmp_path / "lamps"
    more = ["--n", "8", "--title", "Lamps", "--id", "L1", "--seed", "5", "--consent", "study,video", "--hidden"]
    more += ("--auto", "disk", "--ask", "The lamp is on", "--ask", "The lamp is on", "--ask-after", "Thanked")
    result = study("new", str(folder), "--yes", *TWO_FACTORS, *more)
    assert result.exit_code == 0, result.output
    made = loaded(folder)
    assert (made.title, made.id, made.n, made.seed, made.mode, made.assignment.hidden) == (
        "Lamps",
        "L1",
        8,
        5,
        "real",
        True,
    )
    assert [(each.name, each.kind, [level.name for level in each.levels]) for each in made.factors] == [
        ("hesitation", "between", ["yes", "no"]),
        ("noise", "within", ["quiet", "loud"]),
    ]
    assert made.factors[1].levels[1].memory == {"distraction": True, "pause_ms": 300}
    assert (made.strata, made.assignment.strata) == ({"language": ("de", "en")}, ("language",))
    assert made.consent == ("study", "video")
    assert [(each.id, each.auto or each.ask, each.when) for each in made.checks] == [
        ("disk", "disk", "before"),
        ("lamp-on", "The lamp is on", "before"),
        ("lamp-on-2", "The lamp is on", "before"),
        ("thanked", "Thanked", "after"),
    ]
    header = (folder / "participants.csv").read_text()
    assert header == "participant,language,consent_study,consent_video,status,comment\n"
    assert "#   language       de or en" in (folder / "study.toml").read_text()
    assert sorted(path.name for path in folder.iterdir()) == [
        ".kinds.json",
        "participants.csv",
        "scenario",
        "study.toml",
    ]
    assert study("check", str(folder)).output.startswith(
        "no errors or warnings (2 factors, 2 cells, 2 runs each, 8 wanted"
    )


def test_nothing_is_asked_after_a_session_when_that_is_said(tmp_path: Path) -> None:
    path = tmp_path / "made"
    assert study("new", str(path), "--scenario", "lablinking", "--ask-after", "-", "--yes").exit_code == 0
    assert not any(check.when == "after" for check in loaded(path).checks)


def test_a_study_of_nothing_but_usual_answers(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "my first study"
    assert study("new", str(folder), "--yes").exit_code == 0
    made = loaded(folder)
    assert (made.title, made.id, made.n, made.factors, made.consent) == (
        "my first study",
        "myfirststudy",
        24,
        (),
        ("study",),
    )
    assert [check.id for check in made.checks] == ["robot", "disk", "scenario", "wizard", "participant-debriefed"]
    assert study("check", str(folder)).exit_code == 0
    assert study("plan", str(folder)).exit_code == 0
    assert study("check", str(folder)).output.endswith(
        "next: write a line for each participant into participants.csv\n"
    )


def test_the_example_line_in_study_toml_is_one(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    assert study("new", str(folder), "--yes", *TWO_FACTORS, "--consent", "study,video").exit_code == 0
    (example,) = [
        line for line in (folder / "study.toml").read_text().splitlines() if line.startswith("# An example of a line")
    ]
    with (folder / "participants.csv").open("a") as file:
        file.write(example.removeprefix("# An example of a line: ") + "\n")
    assert study("check", str(folder)).output.startswith("no errors or warnings")


def test_a_problem_in_one_kind_of_session_is_told_when_the_study_is_made(tmp_path: Path) -> None:
    folder, levels = tmp_path / "s", ("--level", "form.a=form = 'plain'", "--level", "form.b=form = 'plane'")
    made = study("new", str(folder), "--yes", "--scenario", "negation", "--factor", "form=between", *levels)
    assert made.exit_code == 1 and "s was made, with a problem that you must fix." in made.output
    checked = study("check", str(folder))
    assert checked.exit_code == 1 and checked.output.startswith("no errors or warnings in the files (")
    assert "has no column `plane`" in checked.output


def test_levels_that_choose_a_scenario_or_are_done_by_people(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    levels = ("--level", "task.a=scenario greeting", "--level", f"task.b=scenario {shipped_studies()['negation']}")
    room = ("--factor", "room=between", "--level", "room.big=", "--level", "room.small=", "--label-only", "room")
    result = study("new", str(folder), "--yes", "--factor", "task=within", *levels, *room)
    assert result.exit_code == 0, result.output
    assert [level.scenario for level in loaded(folder).factors[0].levels] == ["scenario-a", "scenario-b"]
    assert (folder / "scenario-b" / "scenario.toml").is_file()


def test_it_takes_a_scenario_of_ones_own(tmp_path: Path) -> None:
    study_folder(tmp_path / "other")
    (tmp_path / "other" / "scenario" / ".hidden").write_text("x")
    folder = tmp_path / "s"
    assert study("new", str(folder), "--yes", "--scenario", str(tmp_path / "other" / "scenario")).exit_code == 0
    assert sorted(path.name for path in (folder / "scenario").iterdir()) == ["acts", "memory.json", "scenario.toml"]


WRONG = [
    (["--id", "a b"], "--id a b: letters (a-z) and digits only"),
    (["--n", "0"], "--n 0: a whole number from 1 to 10000"),
    (
        ["--scenario", "greetin"],
        "--scenario greetin: there is no folder greetin, and no scenario of that name comes with",
    ),
    (["--factor", "a=betwixt"], "--factor a=betwixt: between or within"),
    (["--factor", "a=between"], "--factor a=between: two levels or more"),
    (["--factor", "order=between"], "the plan has a column `order` of another meaning"),
    (
        ["--level", "a.b=x = 1"],
        "--level a.b=x = 1: write FACTOR.LEVEL=KEY = VALUE, with --factor FACTOR=between before",
    ),
    (
        ["--factor", "a=between", "--level", "a.x=nam = 1", "--level", "a.y="],
        "--level a.x=nam = 1: the memory has no key",
    ),
    (["--factor", "a=between", "--level", "a.x=", "--level", "a.y="], "in `x`, `y` the robot does the same"),
    (["--factor", "a=between", "--level", "a.x=1", "--level", "a.y="], "--level a.x=1: write KEY = VALUE"),
    (["--stratum", "name=a,b"], "--stratum name=a,b: `name` seems to hold a name"),
    (["--stratum", "language=de"], "--stratum language=de: write a word and its values"),
    (["--consent", "a b"], "--consent a b: words with commas between"),
    (["--ask", ""], "error: --ask: write a word or more"),
    (["--auto", "disc"], "--auto disc: there is no automatic check `disc`; did you mean `disk`?"),
]


@pytest.mark.parametrize(("arguments", "sentence"), WRONG)
def test_options_that_mean_nothing(tmp_path: Path, arguments: list[str], sentence: str) -> None:
    result = study("new", str(tmp_path / "s"), "--yes", *arguments)
    assert result.exit_code == 2
    assert sentence in result.output
    assert list(tmp_path.iterdir()) == []


def test_it_never_writes_into_a_folder_with_something_in_it(tmp_path: Path) -> None:
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "mine").write_text("x")
    (tmp_path / "file").write_text("x")
    for name, sentence in (("s", "is not empty; name a new folder"), ("file", "is not a folder")):
        result = study("new", str(tmp_path / name), "--yes")
        assert (result.exit_code, sentence in result.output) == (1, True)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file", "mine", "s"]


def test_an_empty_folder_is_used(tmp_path: Path) -> None:
    (tmp_path / "s").mkdir()
    assert study("new", str(tmp_path / "s"), "--yes").exit_code == 0
    assert (tmp_path / "s" / "study.toml").is_file()


def test_nothing_half_made_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(source: object, to: object) -> None:
        raise OSError(28, "No space left on device", str(to))

    monkeypatch.setattr("rise_engine.study.new_study.shutil.copyfile", fail)
    result = study("new", str(tmp_path / "s"), "--yes")
    assert (result.exit_code, "cannot be written: the disk is full" in result.output) == (1, True)
    assert list(tmp_path.iterdir()) == []


def test_it_is_not_copied_into_itself(tmp_path: Path) -> None:
    study_folder(tmp_path)
    result = study("new", str(tmp_path / "scenario" / "s"), "--yes", "--scenario", str(tmp_path / "scenario"))
    assert result.exit_code == 1
    assert "which would be copied into it" in result.output


def test_nobody_can_be_asked_without_a_terminal(tmp_path: Path) -> None:
    result = study("new", str(tmp_path / "s"))
    assert result.exit_code == 2
    assert "use --yes, and options for the rest" in result.output


# --- new, by questions ------------------------------------------------------------------------------------------------


class Terminal:
    """`rise-engine study new` in a terminal of 80 columns."""

    def __init__(self, folder: Path) -> None:
        self.descriptor, inner = os.openpty()
        program = "from rise_engine.checks import kinds; kinds.QUICK_SECONDS = 0.0; from rise_engine.cli import main"
        self.process = Forked(
            *("study", "new", folder), code=f"{program}; main()", terminal=True, stdin=inner, stdout=inner,
            stderr=STDOUT,
            env={**os.environ, "COLUMNS": "80", "LINES": "24"},
        )  # fmt: skip
        os.close(inner)
        self.text = ""
        self.answered = 0
        """How far the text is that was there before the question that is to be answered."""

    def answer(self, text: str) -> None:
        """Wait for a question and answer it."""
        while not self.text[self.answered :].endswith(": "):
            self._read()
        asked = len(self.text)
        os.write(self.descriptor, f"{text}\n".encode())
        while "\n" not in self.text[asked:]:
            self._read()
        self.answered = self.text.index("\n", asked) + 1

    def _read(self) -> None:
        readable, _, _ = select.select([self.descriptor], [], [], 60)
        assert readable, self.text
        self.text += os.read(self.descriptor, 65_536).decode().replace("\r\n", "\n")

    def end(self, key: str = "") -> int:
        """Everything until the end; the exit status.

        :param key: pressed again when nothing has come of it for seconds: Python overlooks a ctrl+c that comes right
            before it waits for a line, and a second one would meet the program on its way out.
        """
        wait = 0.0
        try:
            while True:
                while key and not select.select([self.descriptor], [], [], wait)[0]:
                    os.write(self.descriptor, key.encode())
                    wait = 5.0
                self._read()
        except OSError:  # the other side is closed
            pass
        os.close(self.descriptor)
        return self.process.wait()


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    yield Terminal(tmp_path / "lamps")


ANSWERS = [
    *("Lamps and noise", "lamps 1", "lamps1", "lablinkin", "lablinking", "many", "8"),
    *("hesitation", "", "", "", ""),
    *("noise", "w", "quiet, loud", "", "", "n", "quiet, loud", "", "distract = true", "distraction = true"),
    *("room", "", "big, small", "", "", "y", ""),
    *("language de en", "language: de, en", ""),
    *("study, recording", "disk, robt", "disk, robot"),
    *("The lamp is on", "", "", "y"),
]


def test_the_questions(tmp_path: Path, terminal: Terminal) -> None:
    """Asked again with a reason; what is written is what was said; no line is wider than the terminal."""
    for each in ANSWERS:
        terminal.answer(each)
    assert not (tmp_path / "lamps").exists(), "nothing is written before it is confirmed"
    terminal.answer("")
    assert terminal.end() == 0
    made = loaded(tmp_path / "lamps")
    assert (made.title, made.id, made.n, made.assignment.hidden) == ("Lamps and noise", "lamps1", 8, True)
    assert [(each.name, each.kind, [level.memory for level in each.levels]) for each in made.factors] == [
        ("hesitation", "between", [{"hesitation": True}, {"hesitation": False}]),
        ("noise", "within", [{}, {"distraction": True}]),
        ("room", "between", [{}, {}]),
    ]
    assert (made.strata, made.consent) == ({"language": ("de", "en")}, ("study", "recording"))
    assert [each.id for each in made.checks] == ["disk", "robot", "lamp-on", "participant-debriefed"]
    for reason in (
        "-> letters (a-z) and digits only",
        "did you mean `lablinking`?",
        "-> a whole number from 1 to 10000",
        "-> In `quiet`, `loud` the robot does the same.",
        "did you mean\n      `distraction`?",
        "-> write a word and its values",
        "did you mean `robot`?",
        "4 cells (yes+big, yes+small, no+big,\nno+small); 2 sessions each (quiet, loud)",
        "rise-engine study plan",
    ):
        assert reason in terminal.text
    assert [line for line in terminal.text.splitlines() if len(line) > 80 and str(tmp_path) not in line] == []


def test_answers_are_not_lost_by_an_error_that_is_found_at_the_end(tmp_path: Path, terminal: Terminal) -> None:
    """Another scenario of a later factor does not know the key of the first one: that can be mended in study.toml."""
    first = ["", "", "lablinking", "", "hesitation", "", "", "", ""]
    for each in [*first, "task", "", "a, b", "", "scenario greeting", "", "", "-", "-", "", "-", "", ""]:
        terminal.answer(each)
    assert terminal.end() == 1
    assert "in scenario-b: the memory has no key `hesitation`" in terminal.text
    assert "lamps was made, with errors that you must fix." in terminal.text
    assert "levels.b.scenario" in (tmp_path / "lamps" / "study.toml").read_text()


def test_a_script_makes_no_study_with_errors(tmp_path: Path) -> None:
    level = ("--factor", "task=between", "--level", "task.a=", "--level", "task.b=scenario greeting")
    result = study("new", str(tmp_path / "s"), "--yes", *TWO_FACTORS, *level)
    assert (result.exit_code, "the study would have errors" in result.output) == (1, True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("last", ["n", "\x03", "\x04"], ids=["no", "ctrl+c", "ctrl+d"])
def test_broken_off(tmp_path: Path, terminal: Terminal, last: str) -> None:
    for each in ["", "", "", "", "", "", "", "", "", "", ""][: 10 if last == "n" else 4]:
        terminal.answer(each)
    if last == "n":
        terminal.answer("n")
    assert terminal.end("" if last == "n" else last) == (1 if last == "n" else 130)
    assert "Nothing was written." in terminal.text
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "memory"),
    [
        ("hesitation = true", {"hesitation": True}),
        ("pause_ms = 300, hesitation=false", {"pause_ms": 300, "hesitation": False}),
        ("person_name = Ada", {"person_name": "Ada"}),
        ('person_name = "Ada, B."', {"person_name": "Ada, B."}),
        ("person_name = Ada B, task = 2", {"person_name": "Ada B", "task": 2}),
        ("hesitation = yes, distraction = No", {"hesitation": True, "distraction": False}),
        ("-", {}),
        ("", {}),
    ],
)
def test_memory_values_as_people_write_them(text: str, memory: dict[str, object]) -> None:
    scenario = load(shipped_studies()["lablinking"]).scenario
    assert scenario is not None
    assert answers.parse_level("x", text, scenario).memory == memory


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("hesitation = maybe", "`hesitation` is true or false at the start, and this is a text"),
        ("pause_ms = short", "`pause_ms` is a number at the start, and this is a text"),
    ],
)
def test_memory_values_of_another_type(text: str, sentence: str) -> None:
    scenario = load(shipped_studies()["lablinking"]).scenario
    assert scenario is not None
    with pytest.raises(ValueError, match=sentence):
        answers.parse_level("x", text, scenario)


# --- check and plan ---------------------------------------------------------------------------------------------------


def test_check_as_json(tmp_path: Path) -> None:
    study_folder(tmp_path, DESIGN.replace("title", "titel"))
    result = study("check", str(tmp_path), "--json")
    assert result.exit_code == 1
    report = json.loads(result.output)
    assert (report["errors"], report["warnings"], report["not_looked_at"]) == (1, 0, [])
    assert report["findings"][0] == {
        "file": "study.toml",
        "line": 1,
        "column": 1,
        "severity": "error",
        "code": "unknown-key",
        "message": "unknown key `titel`; did you mean `title`?",
    }


def test_check_says_what_is_next(tmp_path: Path) -> None:
    study_folder(tmp_path, participants="participant,language,consent_study\nP01,en,\n")
    assert "8 wanted, 1 in participants.csv, 1 of them without consent)" in study("check", str(tmp_path)).output
    assert study("check", str(tmp_path)).output.endswith(f"next: make the plan   rise-engine study plan {tmp_path}\n")
    assert study("plan", str(tmp_path / "study.toml")).exit_code == 0
    assert study("check", str(tmp_path)).output.endswith(f"next: run it           rise-tui --config {tmp_path}\n")


def test_plan_prints_the_proof(tmp_path: Path) -> None:
    study_folder(tmp_path)
    result = study("plan", str(tmp_path))
    assert result.exit_code == 0
    assert f"\n\nMade {tmp_path}/plan.csv.\n\n" in result.output
    assert "language=de: " in result.output
    assert "every run is equally often at every place" in result.output


def test_nothing_is_planned_with_errors(tmp_path: Path) -> None:
    study_folder(tmp_path, DESIGN.replace("title", "titel"))
    result = study("plan", str(tmp_path))
    assert result.exit_code == 1
    assert "did you mean `title`?" in result.output
    assert not (tmp_path / "plan.csv").exists()
    assert not (tmp_path / "study.jsonl").exists()


def test_again_needs_a_reason_and_a_plan(tmp_path: Path) -> None:
    study_folder(tmp_path)
    assert study("plan", str(tmp_path), "--again", " ").exit_code == 2
    result = study("plan", str(tmp_path), "--again", "more")
    assert (result.exit_code, "there is no plan yet" in result.output) == (1, True)


@pytest.mark.parametrize("command", ["check", "plan"])
def test_no_study(tmp_path: Path, command: str) -> None:
    result = study(command, str(tmp_path))
    assert result.exit_code == 2
    assert f"there is no study.toml in {tmp_path}; `rise-engine study new DIR` makes a study" in result.output
    assert f"there is no folder {tmp_path}/x" in study(command, f"{tmp_path}/x").output


def test_a_study_is_no_scenario(tmp_path: Path) -> None:
    result = typed("check", study_folder(tmp_path))
    assert result.exit_code == 2
    assert "is a study, not a scenario: its commands are those of `rise-engine study`" in result.output


def test_it_says_that_the_scenario_is_a_copy(tmp_path: Path) -> None:
    folder, source = tmp_path / "new", tmp_path / "mine" / "greeting"
    shutil.copytree(Path(__file__).parents[2] / "scenarios" / "greeting", source)
    result = study("new", str(folder), "--yes", "--scenario", str(source))
    assert f"{folder / 'scenario'} is a copy: later changes to {source} have no effect here." in result.output
    text = (folder / "study.toml").read_text("utf-8")
    assert "# scenario is a copy: later changes to greeting have no effect here. Change the copy." in text
    assert str(tmp_path) not in text, "a study is given to others"

"""Writes what this tree prints and makes into a folder, so that two trees can be compared.

    python -m tests.oracles /tmp/before              (in the one tree)
    python -m tests.oracles /tmp/after               (in the other)
    diff -r /tmp/before /tmp/after

With names of parts (`PARTS`) behind the folder, only those are written. Nothing depends on the date, on chance, or on
where anything lies: two runs of one tree write the same bytes.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import click
from click.testing import CliRunner

from rise_engine.cli import main as rise_engine
from rise_engine.results.export.format import format_names
from rise_tui.cli.main import main as rise_tui
from tests.author.edit.samples import NAMES, SCENARIOS, SPELLINGS, study_files
from tests.fuzz.mutations import mutate
from tests.oracles.edits import edits_of
from tests.results.analysis.samples import make_study, play_session, recovered_session, torn_session
from tests.scenario import test_diagnostics as broken
from tests.scenario.folders import SPEECH, act, folder, in_state
from tests.study.designs import DESIGN, study_folder
from tests.study.test_study_toml import WRONG

SEEDS = 80
"""How many files with random mistakes are checked for each shipped study."""
_SPELT = ("lf", "crlf", "ragged")
_TODAY = re.compile(r"\b20(?!24-11-2)\d\d-\d\d-\d\d([T_ ]?[\d:.]{4,}(\+\d\d:\d\d|Z)?)?|\b\d\d:\d\d:\d\d\.\d+")
_UNLIKE = re.compile(r'("(?:uuid|host|hostname|platform|python|version|rise-tui)": )"[^"]*"')


class Oracle:
    """Writes files below one folder."""

    def __init__(self, out: Path, place: Path) -> None:
        """`place`: a folder for what is made on the way."""
        self.out, self.place, self._places = out, place, 0

    def new_place(self) -> Path:
        """A folder that does not exist yet."""
        self._places += 1
        return self.place / f"{self._places}"

    def write(self, name: str, text: str) -> None:
        """A file, without what lies elsewhere each time."""
        path = self.out / name
        path.parent.mkdir(parents=True, exist_ok=True)
        text = re.sub(rf"{re.escape(str(self.place))}/\d+", "PLACE", text).replace(str(SCENARIOS.parent), "TREE")
        path.write_text(_UNLIKE.sub(r'\1"..."', _TODAY.sub("TODAY", text)), "utf-8")

    def run(self, command: click.Command, *arguments: object) -> str:
        """What a command prints, and its exit status."""
        result = CliRunner().invoke(command, [str(each) for each in arguments], prog_name="rise")
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return f"{result.output}\n[exit status {result.exit_code}]\n"


def write_help(oracle: Oracle) -> None:
    """`--help` of every command."""

    def walk(command: click.Command, root: click.Command, path: tuple[str, ...], name: str) -> None:
        oracle.write(f"help/{'-'.join((name, *path))}.txt", oracle.run(root, *path, "--help"))
        if isinstance(command, click.Group):
            context = click.Context(command)
            for each in command.list_commands(context):
                found = command.get_command(context, each)
                assert found is not None
                walk(found, root, (*path, each), name)

    walk(rise_engine, rise_engine, (), "rise-engine")
    walk(rise_tui, rise_tui, (), "rise-tui")


def write_broken(oracle: Oracle) -> None:
    """`rise-engine check` on what the tests know to be broken, and on shipped studies with random mistakes."""
    cases: dict[str, dict[str, str | bytes]] = {}
    for name, (body, _) in broken.ACTS.items():
        cases[f"act {name}"] = {"acts/a.xml": act(body), "memory.json": '{"pause": 5}'}
    for name, (entry, rest, _) in broken.RULES.items():
        rule = in_state(entry, rest)
        cases[f"rule {name}"] = {"acts/a.xml": act(SPEECH), "rules/r.xml": rule, "memory.json": '{"pause": 5}'}
    cases |= {f"file {name}": files for name, (files, _) in broken.FILES.items()}
    for study in NAMES:
        shipped = {file: data for file, data in study_files(study).items() if not file.endswith((".md", ".jsonl"))}
        for seed in range(SEEDS):
            chance = Random(f"{study}/{seed}")
            file = chance.choice(sorted(shipped))
            cases[f"{study} {seed:03}"] = {**shipped, file: mutate(file, shipped[file], chance)}
    for name, files in cases.items():
        place = folder(oracle.new_place(), files)
        place.mkdir(exist_ok=True)
        text = oracle.run(rise_engine, "check", place) + oracle.run(rise_engine, "check", place, "--json")
        oracle.write(f"broken/{name.replace('/', '_')}.txt", text)
        shutil.rmtree(place)
    for name, (old, new, _) in WRONG.items():
        place = study_folder(oracle.new_place(), DESIGN.replace(old, new))
        oracle.write(f"broken/study {name.replace('/', '_')}.txt", oracle.run(rise_engine, "study", "check", place))


def write_formatted(oracle: Oracle) -> None:
    """`rise-engine fmt` of the shipped studies in every spelling, and their rules and acts as pictures."""
    for study in NAMES:
        for spelling in SPELLINGS:
            place = folder(oracle.new_place(), {**study_files(study, spelling)})
            told = oracle.run(rise_engine, "fmt", place)
            texts = {path: path.read_bytes().decode() for path in sorted(place.rglob("*")) if path.is_file()}
            told += "".join(f"=== {path.relative_to(place)}\n{text!r}\n" for path, text in texts.items())
            oracle.write(f"formatted/{study} {spelling}.txt", told)
        for format in ("text", "mermaid", "svg", "dot"):
            told = oracle.run(rise_engine, "graph", SCENARIOS / study, "--format", format)
            oracle.write(f"graph/{study}.{format}", told)


def write_edits(oracle: Oracle) -> None:
    """Every edit of docs/reference/edits.md on the shipped studies, in some spellings."""
    for study in NAMES:
        edits = [*edits_of(SCENARIOS / study)]
        for spelling in _SPELT:
            place = folder(oracle.new_place(), {**study_files(study, spelling)})
            told = []
            for edit in edits:
                wanted = place.parent / "edit.json"
                wanted.write_text(json.dumps(edit), "utf-8")
                told.append(f"##### {json.dumps(edit)}\n{oracle.run(rise_engine, 'edit', place, wanted, '--dry-run')}")
            oracle.write(f"edits/{study} {spelling}.txt", "\n".join(told).replace(str(place.parent), "PLACE"))


def _write_tree(oracle: Oracle, name: str, made: Path) -> None:
    """Every file of an export; of what is no text, its size."""
    for path in [made] if made.is_file() else sorted(made.rglob("*")):
        if path.is_file():
            inner = path.relative_to(made).as_posix() if made.is_dir() else "file"
            try:
                oracle.write(f"{name}/{inner}", path.read_bytes().decode())
            except UnicodeDecodeError:
                oracle.write(f"{name}/{inner}", f"{path.stat().st_size} bytes\n")


def write_exports(oracle: Oracle) -> None:
    """Every export of the sample sessions and of the sample study, and their reports."""
    os.environ["RISE_SESSIONS"] = str(oracle.new_place())
    sessions = {
        "played": play_session(oracle.new_place() / "sessions"),
        "recovered": recovered_session(oracle.new_place() / "sessions", noted=40.0),
        "torn": torn_session(oracle.new_place() / "sessions"),
        "study": make_study(oracle.new_place()),
    }
    for name, session in sessions.items():
        for format in format_names():
            for level in ("full", "shared"):
                made = oracle.new_place()
                oracle.place.mkdir(exist_ok=True)
                told = oracle.run(rise_engine, "export", session, "--format", format, "--level", level, "-o", made)
                oracle.write(f"exports/{name} {format} {level}.txt", told)
                if made.exists() and format != "mcap":  # whose chunks are compressed, and have the time of making
                    _write_tree(oracle, f"exports/{name} {format} {level}", made)
        made = oracle.new_place()
        oracle.write(f"exports/{name} report.txt", oracle.run(rise_engine, "report", session, "-o", made))
        if made.exists():
            _write_tree(oracle, f"exports/{name} report", made)


def write_records(oracle: Oracle) -> None:
    """The records and the transcript of the shipped studies, played with their task files and two seeds."""
    for study in NAMES:
        for seed in (1, 2):
            tasks = SCENARIOS / study / "session.jsonl"
            played = ("run", SCENARIOS / study, "--tasks", tasks, "--speed", "max", "--seed", seed)
            oracle.write(f"records/{study} {seed}.jsonl", oracle.run(rise_engine, *played, "--json"))
            oracle.write(f"records/{study} {seed}.txt", oracle.run(rise_engine, *played))


_WRITERS = (write_help, write_broken, write_formatted, write_edits, write_exports, write_records)
PARTS: dict[str, Callable[[Oracle], None]] = {each.__name__.removeprefix("write_"): each for each in _WRITERS}


def main(arguments: list[str] | None = None) -> None:
    """Write all parts, or those named."""
    parser = argparse.ArgumentParser(prog="python -m tests.oracles", description="Golden outputs of this tree.")
    parser.add_argument("out", type=Path, help="the folder that is written; it must not exist")
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], help="default: all of them")
    asked: Any = parser.parse_args(arguments)
    os.environ |= {"COLUMNS": "100", "TZ": "UTC", "NO_COLOR": "1"}
    with tempfile.TemporaryDirectory(prefix="rise-oracle-") as place:
        os.environ |= {"XDG_STATE_HOME": f"{place}/state", "RISE_RUNTIME": f"{place}/run"}
        oracle = Oracle(asked.out, Path(place))
        for part in asked.parts or PARTS:
            PARTS[part](oracle)


if __name__ == "__main__":
    main()

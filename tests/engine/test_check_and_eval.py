"""`rise-engine check`, `eval`, `schema`, `robots`: what they print, and their exit statuses."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rise_engine.account import clock_text, parameters_text

from .processes import engine, folder

BAD = '<Dialog name="Bad">\n  <Speach><actionID>1</actionID></Speach>\n</Dialog>'


def test_a_clean_scenario(tmp_path: Path) -> None:
    done = engine("check", folder(tmp_path / "s"))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("no findings (3 acts, 3 rules, 1 memory key, robot generic)")


def test_a_scenario_can_be_given_by_its_toml_file(tmp_path: Path) -> None:
    assert engine("check", folder(tmp_path / "s") / "scenario.toml").returncode == 0
    wrong = engine("check", tmp_path / "s" / "memory.json")
    assert wrong.returncode == 2 and "scenario.toml" in wrong.stderr


def test_errors_have_a_place_a_code_and_a_summary(tmp_path: Path) -> None:
    done = engine("check", folder(tmp_path / "s", bad=BAD))
    assert done.returncode == 1
    *findings, summary = done.stdout.splitlines()
    assert any(line.startswith("acts/bad.xml:2:3: error ") and "Speech" in line for line in findings)
    assert summary.startswith("1 error, 0 warnings")


def test_warnings_alone_are_no_error(tmp_path: Path) -> None:
    lonely = '<InteractionRule name="Lonely" initial="A"><State id="A"><transition eventTopic="/never" target="A"/>' \
        "</State></InteractionRule>"  # fmt: skip
    place = folder(tmp_path / "s")
    (place / "rules" / "lonely.xml").write_text(lonely)
    done = engine("check", place)
    assert done.returncode == 0
    assert ": warning " in done.stdout and "0 errors, 1 warning" in done.stdout
    assert engine("run", place, "--speed", "max").returncode == 0


def test_check_as_json(tmp_path: Path) -> None:
    done = engine("check", folder(tmp_path / "s", bad=BAD), "--json")
    assert done.returncode == 1
    document = json.loads(done.stdout)
    assert document["errors"] == 1 and document["warnings"] == 0
    (finding,) = document["findings"]
    assert set(finding) == {"file", "line", "column", "severity", "code", "message"}
    assert (finding["file"], finding["line"], finding["column"]) == ("acts/bad.xml", 2, 3)
    assert json.loads(engine("check", folder(tmp_path / "t"), "--json").stdout) == {
        "errors": 0, "warnings": 0, "findings": [],
    }  # fmt: skip


def test_check_for_another_robot(tmp_path: Path) -> None:
    place = folder(
        tmp_path / "s",
        brows='<Dialog name="Brows"><Animation><actionID>1</actionID><value>eyebrows_raise</value></Animation>'
        "</Dialog>",
    )
    assert engine("check", place, "--robot", "floka").returncode == 0
    assert engine("check", place, "--robot", "pepper").returncode == 1
    unknown = engine("check", place, "--robot", "peper")
    assert unknown.returncode == 1 and "`pepper`" in unknown.stdout


@pytest.mark.parametrize("arguments", [("check",), ("run", "--act", "Greet", "--speed", "max")])
def test_neither_screen_nor_robot_nor_event_loop_is_imported_without_need(
    tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    command, *options = arguments
    program = "import sys\nfrom rise_engine.cli import main\nmain.main(sys.argv[1:], standalone_mode=False)\n"
    watched = "{'asyncio', 'textual', 'rich', 'rclpy', 'rise_tui'}"
    program = f"import atexit, sys\natexit.register(lambda: print({watched} & set(sys.modules)))\n{program}"
    arguments = ("-c", program, command, str(folder(tmp_path / "s")), *options)
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "set()"


# --- eval ---


@pytest.mark.parametrize(
    ("expression", "memory", "lines"),
    [
        ("n > 3 and not done", '{"n": 5}', ["value      true", "read as    (n > 3) and (not done)", "no done"]),
        ("n * 2", '{"n": 21}', ["value      42", "type       integer", "condition  true"]),
        ("name", '{"name": "Anna"}', ['value      "Anna"', "type       string"]),
        ("not n > 3", '{"n": 2}', ["value      true", "differs    RISE reads this as `(not n) > 3`"]),
        ("1 / 0", "{}", ["value      Infinity", "type       number"]),
        ("nobody", "{}", ["value      null", "type       null", "condition  false"]),
    ],
)
def test_eval(expression: str, memory: str, lines: list[str]) -> None:
    done = engine("eval", expression, "--memory", memory)
    assert done.returncode == 0
    for line in lines:
        assert line in done.stdout


def test_eval_marks_the_column_of_a_mistake() -> None:
    done = engine("eval", "n > 3 AND m")
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr.splitlines()[:2] == ["n > 3 AND m", "      ^"]
    assert "`and`" in done.stderr


def test_eval_that_fails_at_run_time() -> None:
    done = engine("eval", "name < 3", "--memory", '{"name": "Anna"}')
    assert done.returncode == 1 and "error:" in done.stderr
    assert "read as    name < 3" in done.stdout


def test_eval_as_json() -> None:
    document = json.loads(engine("eval", "n + m", "--memory", '{"n": 1.5}', "--json").stdout)
    assert (document["value"], document["type"], document["missing"]) == (1.5, "number", ["m"])
    refused = engine("eval", "n >", "--json")
    assert refused.returncode == 1 and json.loads(refused.stdout)["column"] == 4


def test_eval_with_a_memory_file(tmp_path: Path) -> None:
    memory = tmp_path / "memory.json"
    memory.write_text('{"WorkingMemory": [{"n": 1}, {"m": 2}]}')
    for way in (str(memory), f"@{memory}"):
        assert "value      3" in engine("eval", "n + m", "--memory", way).stdout


@pytest.mark.parametrize("memory", ["nowhere.json", "{n: 1}", "[1]", '{"n": 1, "n": 2}', '{"n": NaN}'])
def test_a_memory_that_cannot_be_read(memory: str) -> None:
    done = engine("eval", "n", "--memory", memory)
    assert done.returncode == 2 and "--memory" in done.stderr and "Traceback" not in done.stderr


# --- schema, robots, the rest ---


def test_schemas(tmp_path: Path) -> None:
    from lxml import etree

    place = folder(tmp_path / "s")
    for kind, file in (("cra", "acts/greet.xml"), ("rules", "rules/rules.xml")):
        for arguments in ((), (str(place),)):
            done = engine("schema", *arguments, "--kind", kind)
            schema = etree.RelaxNG(etree.fromstring(done.stdout.encode()))
            schema.assertValid(etree.parse(str(place / file)))
    assert engine("schema", folder(tmp_path / "t", bad=BAD), "--kind", "cra").returncode == 1
    assert engine("schema", "--kind", "cra", "--robot", "peper").returncode == 1


def test_robots() -> None:
    text = engine("robots").stdout
    for name in ("floka", "generic", "nao", "pepper"):
        assert f"\n{name}: " in f"\n{text}"
    assert "PointAt, done as LookAt" in text
    rows = json.loads(engine("robots", "--json").stdout)["robots"]
    assert all(not row["findings"] and row["installed"] for row in rows)


def test_no_reader_is_no_trouble(tmp_path: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [sys.executable, "-m", "rise_engine", "robots"], stdout=write, stderr=subprocess.PIPE, check=False
    )
    os.close(write)
    assert b"Traceback" not in done.stderr


def test_times_and_parameters_in_short() -> None:
    assert [clock_text(t) for t in (0, 3.25, 59.99, 60, 3600, 3661.5)] == [
        "00:00.0", "00:03.2", "00:59.9", "01:00.0", "1:00:00.0", "1:01:01.5",
    ]  # fmt: skip
    assert parameters_text({"message": "Hi", "rate": 0.8}) == '"Hi" rate=0.8'
    assert parameters_text({"pointx": 1, "pointy": 0, "pointz": 2.5, "duration": 100}) == "(1, 0, 2.5) 100 ms"

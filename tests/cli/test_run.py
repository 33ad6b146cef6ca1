"""`rise-engine run`, as a user runs it."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import pytest

from tests.cli.processes import FAST, act, engine, folder, records, task
from tests.forked import run_engine
from tests.run.engine.samples import assert_one_ending_each

pytestmark = pytest.mark.slow

# --- what it prints ---


def test_an_act_from_start_to_end(study: Path) -> None:
    done = engine("run", study, "--act", "Greet", *FAST)
    assert (done.returncode, done.stderr) == (0, "")
    found = records(done.stdout)
    assert found[0]["kind"] == "session" and found[0]["status"] == "started" and found[0]["mode"] == "debug"
    assert found[0]["scenario_hash"] and set(found[0]["versions"]) == {"rise-tui", "python"}
    assert found[-1]["kind"] == "session" and found[-1]["status"] == "ended"
    assert_one_ending_each(found)
    spoken = [
        r["parameters"]["message"]
        for r in found
        if r["kind"] == "action" and r["status"] == "started" and r["type"] == "Speech"
    ]
    assert spoken == ["Hello, Anna!", "How are you?"]
    assert all({"seq", "t", "wall", "kind"} <= set(record) for record in found)


def test_the_transcript(study: Path) -> None:
    done = engine("run", study, "--act", "Greet", "--speed", "max")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert any(line.startswith("00:00.0") and '"Hello, Anna!"' in line and line.endswith("started") for line in lines)
    assert any("Greet" in line and "succeeded, " in line for line in lines)
    assert not any("accepted" in line for line in lines)


def test_the_same_twice_is_the_same_byte_for_byte(study: Path, tmp_path: Path) -> None:
    script = tmp_path / "s.jsonl"
    script.write_text(
        "\n".join([act("Chat", at=n * 1.7) for n in range(8)] + [act("Greet", at=3, calling_type="None")])
    )
    command = ("run", study, "--tasks", script, "--speed", "max", "--json", "--fault", "Speech=slow:1.5@3")
    assert engine(*command, "--seed", 7).stdout == engine(*command, "--seed", 7).stdout
    said = [
        [
            r["parameters"]["message"]
            for r in records(engine(*command, "--seed", seed).stdout)
            if r["kind"] == "action" and r["act"] == "Chat" and r["status"] == "started"
        ]
        for seed in (7, 8, 9, 10)
    ]
    assert len({tuple(each) for each in said}) > 1, "the seed matters"
    for each in said:
        assert all(first != second for first, second in pairwise(each))


def test_real_time_says_the_same_as_virtual_time(study: Path) -> None:
    def what(speed: str) -> list[tuple[str, ...]]:
        done = engine("run", study, "--act", "Greet", "--speed", speed, "--json")
        return [(r["kind"], r.get("status", ""), r.get("action", "")) for r in records(done.stdout)]

    assert sorted(what("20")) == sorted(what("max"))


@pytest.mark.parametrize("speed", ["20", "max"])
def test_tasks_of_one_moment_go_in_the_order_of_their_lines(study: Path, tmp_path: Path, speed: str) -> None:
    script = tmp_path / "s.jsonl"
    topics = [f"/{number}" for number in range(40)]
    script.write_text("".join(task("raiseEventTopic", topic, at=0.1) + "\n" for topic in topics))
    done = engine("run", study, "--tasks", script, "--speed", speed, "--json")
    assert [r["topic"] for r in records(done.stdout) if r["kind"] == "event"] == topics


def test_first_set_then_rules_then_acts_then_tasks(study: Path, tmp_path: Path) -> None:
    script = tmp_path / "s.jsonl"
    script.write_text(
        "# a comment\n\n" + task("raiseEventTopic", "/go", at=2) + "\n" + task("assignValue", "n = 1", at=0) + "\r\n"
    )
    done = engine(
        "run", study, "--act", "Chat", "--rule", "Wait for it", "--set", "name=Ben", "--set", "n=0", "--tasks", script,
        *FAST,
    )  # fmt: skip
    assert done.returncode == 0
    assert "Ben was taken as a text" in done.stderr
    tasks = [(r["t"], r["function"], r["source"]) for r in records(done.stdout) if r["kind"] == "task"]
    order = list(dict.fromkeys((t, function) for t, function, source in tasks if not source.startswith("rule:")))
    assert order[:4] == [
        (0.0, "assignValue"),
        (0.0, "startInteractionRule"),
        (0.0, "startCommunicationRobotAct"),
        (2.0, "raiseEventTopic"),
    ]
    assert [source for t, f, source in tasks if f == "raiseEventTopic"] == ["file"]
    memory = [(r["key"], r["value"]) for r in records(done.stdout) if r["kind"] == "memory"]
    assert memory[-3:] == [("name", "Ben"), ("n", 0), ("n", 1)]
    assert any("Hello, Ben!" in line for line in done.stdout.splitlines())


@pytest.mark.parametrize(
    ("setting", "value"),
    [("n=2", 2), ("n=2.5", 2.5), ('n="it\'s \\"so\\""', 'it\'s "so"'), ("n=null", None), ('n={"a": [1, {"b": true}]}',
     {"a": [1, {"b": True}]}), ("n=", ValueError), ("=2", ValueError), ("n", ValueError), ("n=[1", ValueError),
     ("n=NaN", "NaN"), ("n=Anna Maria", "Anna Maria"), ('n={"a": 1, "a": 2}', ValueError), ("n=01", ValueError)],
)  # fmt: skip
def test_set(study: Path, setting: str, value: object) -> None:
    done = engine("run", study, "--set", setting, *FAST)
    if value is ValueError:
        assert done.returncode == 2 and done.stdout == "" and "--set" in done.stderr
    else:
        assert done.returncode == 0
        assert next(r["value"] for r in reversed(records(done.stdout)) if r["kind"] == "memory") == value


# --- when it ends ---


def test_idle_means_that_waiting_rules_do_not_keep_it_alive(study: Path) -> None:
    done = engine("run", study, "--rule", "Wait for it", *FAST)
    assert done.returncode == 0
    assert records(done.stdout)[-1]["t"] == 0


def test_until_a_time(study: Path) -> None:
    done = engine("run", study, "--rule", "Clock", "--until", "35", *FAST)
    assert done.returncode == 0
    found = records(done.stdout)
    assert found[-1]["t"] == 35 and found[-1]["status"] == "ended"
    assert len([r for r in found if r["kind"] == "rule" and r["trigger"] == "after 10s"]) == 3


def test_the_latest_until(study: Path) -> None:
    done = engine("run", study, "--until", "2592000", *FAST)
    assert (done.returncode, done.stderr) == (0, "")
    assert records(done.stdout)[-1]["wall"] == "1970-01-31T00:00:00.000+00:00"


def test_until_a_time_in_the_middle_of_an_act_stops_the_robot_first(study: Path) -> None:
    found = records(engine("run", study, "--act", "Greet", "--until", "0.5", *FAST).stdout)
    assert_one_ending_each(found)
    assert [r["status"] for r in found if r["kind"] == "stop"] == ["requested", "latched"]
    assert found[-1]["kind"] == "session"


def test_what_would_never_be_idle_ends_with_a_message(study: Path) -> None:
    done = engine("run", study, "--rule", "Clock", *FAST)
    assert done.returncode == 4 and "--until" in done.stderr
    assert records(done.stdout)[-1]["status"] == "ended"


def test_circles_without_any_time_passing_end_with_a_message(study: Path) -> None:
    sooner = "from rise_engine.cli import main; from rise_engine.cli.session import headless_session as session\n"
    sooner += "session.LIVELOCK = 2_000; main()"
    done = run_engine("run", study, "--rule", "Circle", *FAST, "--until", "1", code=sooner)
    assert done.returncode == 4 and "circles" in done.stderr
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert found[-1]["status"] == "ended"
    assert_one_ending_each(found)


# --- exit statuses ---


def test_a_refused_scenario(tmp_path: Path) -> None:
    study = folder(tmp_path / "bad", bad='<Dialog name="Bad"><Speach><actionID>1</actionID></Speach></Dialog>')
    done = engine("run", study, *FAST)
    assert done.returncode == 1 and done.stdout == ""
    assert "acts/bad.xml:1:" in done.stderr and "Speech" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--act", "Gret"), "`Greet`"),
        (("--rule", "Wait for  it"), "`Wait for it`"),
        (("--speed", "0"), "above 0"),
        (("--speed", "fast"), "above 0"),
        (("--until", "-1"), "0 or more"),
        (("--until", "nan"), "0 or more"),
        (("--until", "1e300"), "30 days"),
        (("--until", "2592001"), "30 days"),
        (("--speed", "1e300"), "up to 1000000"),
        (("--seed", "x"), "seed"),
        (("--fault", "Speach=fail"), "'Speech'"),
        (("--fault", "Speech=explode"), "unknown kind"),
        (("--tasks", "nowhere.jsonl"), "nowhere.jsonl"),
        (("--mode", "dry"), "debug"),
        (("--wat",), "--wat"),
    ],
)
def test_wrong_usage_is_refused_before_anything_starts(study: Path, arguments: tuple[str, ...], said: str) -> None:
    done = engine("run", study, *FAST, *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_missing_folder(tmp_path: Path) -> None:
    for command in ("run", "check"):
        done = engine(command, tmp_path / "nowhere")
        assert done.returncode == 2 and "there is no folder" in done.stderr


def test_strict(study: Path, tmp_path: Path) -> None:
    script = tmp_path / "s.jsonl"
    script.write_text(act("Gret"))
    loose = engine("run", study, "--tasks", script, *FAST)
    assert loose.returncode == 0
    assert f"{script}:1: warning" in loose.stderr and "`Greet`" in loose.stderr
    assert [r["status"] for r in records(loose.stdout) if r["kind"] == "task"] == ["REJECTED"]
    assert engine("run", study, "--tasks", script, "--strict", *FAST).returncode == 3
    assert engine("run", study, "--act", "Greet", "--strict", *FAST).returncode == 0
    aborted = engine("run", study, "--act", "Greet", "--strict", "--fault", "Speech=fail", *FAST)
    assert aborted.returncode == 3


# --- faults ---


@pytest.mark.parametrize(
    ("fault", "speed", "ended", "outcome"),
    [
        ("Speech=reject", "max", "failed", "ABORTED"),
        ("Speech=fail@2", "max", "failed", "ABORTED"),
        ("LookAt=slow:4", "max", "succeeded", "SUCCEEDED"),
        ("Speech=hang", "max", "timed-out", "ABORTED"),
        ("Speech=hang", "200", "timed-out", "ABORTED"),
        ("LookAt=hang", "max", "timed-out", "ABORTED"),
        ("vanish@0.5", "max", "lost", "ABORTED"),
        ("vanish@0.5-1", "max", "lost", "ABORTED"),
        ("vanish@0.5-1", "200", "lost", "ABORTED"),
        ("*=fail", "max", "failed", "ABORTED"),
    ],
)
def test_whatever_goes_wrong_every_action_ends_exactly_once(
    study: Path, fault: str, speed: str, ended: str, outcome: str
) -> None:
    done = engine("run", study, "--act", "Greet", "--json", "--speed", speed, "--fault", fault)
    assert done.returncode == 0, done.stderr
    found = records(done.stdout)
    assert_one_ending_each(found)
    assert ended in [r["status"] for r in found if r["kind"] == "action"]
    assert [r["status"] for r in found if r["kind"] == "task"][-1] == outcome


def test_a_hanging_part_does_not_confirm_a_stop(study: Path) -> None:
    found = records(engine("run", study, "--act", "Greet", "--until", "1", "--fault", "Speech=hang", *FAST).stdout)
    latched = next(r for r in found if r["kind"] == "stop" and r["status"] == "latched")
    assert latched["unconfirmed"] == ["generic/speech"] and "generic/gaze" in latched["confirmed"]
    assert_one_ending_each(found)


# --- robots ---


def test_a_new_robot_and_a_new_action_are_files(tmp_path: Path) -> None:
    study = folder(
        tmp_path / "study",
        toml='robot = "trolley"\n[actions.Beep]\nchannels = ["horn"]\nparameters.times = { type = "integer" }\n',
        drive='<Dialog name="Serve"><Drive><actionID>1</actionID><place>table</place></Drive>'
        "<Beep><actionID>2</actionID><waitForActions>1</waitForActions><times>2</times></Beep></Dialog>",
    )
    (study / "robots").mkdir()
    (study / "robots" / "trolley.toml").write_text(
        'title = "Trolley"\n[actions.Speech]\n[actions.LookAt]\n'
        '[actions.Drive]\nchannels = ["base"]\nseconds = 4\n'
        'parameters.place = { type = "name", required = true, names = ["door", "table"] }\n'
    )
    done = engine("run", study, "--act", "Serve", *FAST)
    assert done.returncode == 0, done.stderr
    found = records(done.stdout)
    ended = [
        (r["t"], r["type"], r["parameters"]) for r in found if r["kind"] == "action" and r["status"] == "succeeded"
    ]
    assert ended[0] == (4.0, "Drive", {"place": "table"}) and ended[1][1:] == ("Beep", {"times": 2})
    assert "trolley: Trolley" in engine("robots", study).stdout
    schema = engine("schema", study, "--kind", "cra").stdout
    assert '"Drive"' in schema and '"Beep"' in schema


@pytest.mark.parametrize("robot", ["generic", "floka", "nao", "pepper"])
def test_every_robot_that_comes_with_it_runs(study: Path, robot: str) -> None:
    assert engine("check", study, "--robot", robot).returncode == 0
    done = engine("run", study, "--act", "Greet", "--robot", robot, "--strict", *FAST)
    assert done.returncode == 0
    assert records(done.stdout)[0]["robot"] == robot


def test_a_fault_names_the_action_that_the_robot_is_given(study: Path) -> None:
    """A head points with its gaze."""
    refused = engine("run", study, "--robot", "floka", "--fault", "PointAt=fail", *FAST)
    assert refused.returncode == 2 and "LookAt=fail" in refused.stderr


def test_mode_real(tmp_path: Path) -> None:
    study = folder(tmp_path / "study", toml='mode = "real"\nrobot = "arm"\n')
    (study / "robots").mkdir()
    (study / "robots" / "arm.toml").write_text('driver = "ros7"\n[actions.Speech]\n[actions.LookAt]\n')
    done = engine("run", study, *FAST)
    assert done.returncode == 1 and "'ros7' is not installed" in done.stderr and done.stdout == ""
    assert engine("run", study, "--mode", "debug", "--act", "Greet", *FAST).returncode == 0
    warned = engine("run", study, "--robot", "generic", *FAST)
    assert warned.returncode == 0 and "nothing leaves this machine" in warned.stderr
    found = records(warned.stdout)
    assert found[0]["mode"] == "real"
    assert any(r["kind"] == "note" and "nothing leaves this machine" in r["text"] for r in found)


# --- going on ---


def test_a_task_file_answers_what_is_asked_about_a_failed_act(tmp_path: Path) -> None:
    study = folder(tmp_path / "study", 'on_failure = "ask"')
    script = tmp_path / "tasks.jsonl"
    lines = [task("startInteractionRule", "Wait for it", at=0), task("raiseEventTopic", "/go", at=1)]
    script.write_text("\n".join([*lines, task("repeatAct", "Greet", at=60)]), "utf-8")
    arguments = ("run", study, "--tasks", script, "--speed", "max", "--fault", "Speech=fail@1")
    told = engine(*arguments).stdout
    assert "somebody is asked what to do; answers: repeatAct 3, goOn 3 or stopRuleOfAct 3" in told
    found = records(engine(*arguments, "--json").stdout)
    assert [r["status"] for r in found if r["kind"] == "failure"] == ["asked", "repeated"]
    assert [r["state"] for r in found if r["kind"] == "rule" and r["status"] == "ended"] == ["Done"]


def test_a_task_file_releases_a_stop_and_goes_on_and_a_step_back(tmp_path: Path) -> None:
    study = folder(tmp_path / "study")
    script = tmp_path / "tasks.jsonl"
    lines = [
        task("startInteractionRule", "Wait for it", at=0),
        task("raiseEventTopic", "/go", at=1),
        task("stopAll", at=2),
        task("releaseStop", {"Wait for it": "enter"}, at=10),
        task("stepBack", {"rule": "Wait for it", "enter": False, "stop_acts": True}, at=10.5),
        task("startInteractionRule", {"rule": "Clock", "state": "Tock"}, at=11),
    ]
    script.write_text("\n".join(lines), "utf-8")
    done = engine("run", study, "--tasks", script, *FAST)
    assert "there is no state `Tock`; did you mean `Tick`? (rule `Clock`)" in done.stderr
    entered = [
        (r["state"], r["trigger"]) for r in records(done.stdout) if r["kind"] == "rule" and r["status"] == "entered"
    ]
    assert entered == [
        ("Waiting", "start"),
        ("Going", "/go"),
        ("Going", "resumed"),
        ("Waiting", "stepped back, without onEntry"),
    ]

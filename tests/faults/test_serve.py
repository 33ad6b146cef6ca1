"""`rise-engine serve`, `sessions` and `stop` as a person or systemd uses them: real processes, real signals."""

from __future__ import annotations

import asyncio
import json
import os
import re
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from rise_engine.base.files import is_locked, wait_until
from rise_engine.cli.session.stop import stop
from rise_engine.cli.terminal import Refused
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import Submit
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.protocol.client import EngineGone
from rise_engine.run.protocol.registry import lock_path, session_name, socket_path
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.preparation import SessionPreparation
from rise_engine.run.server.process import serve
from rise_engine.run.server.spawn import EngineRefused, EngineStarted, start_engine
from rise_engine.session.folder import JOURNAL, find_unfinished, read_info
from rise_engine.session.journal_reader import read_journal
from tests.cli.processes import engine, folder
from tests.forked import DEVNULL, Forked, run_engine
from tests.patience import PATIENCE

pytestmark = pytest.mark.slow


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Sessions and sockets of one test; what it leaves running is ended, by its own id."""
    run = Path(tempfile.mkdtemp(prefix="r-", dir="/tmp"))
    monkeypatch.setenv("RISE_RUNTIME", str(run))
    monkeypatch.setenv("RISE_SESSIONS", str(tmp_path / "sessions"))
    yield tmp_path
    for lock in run.glob("*.lock"):
        if is_locked(lock):
            os.kill(int(lock.read_text().split()[0]), signal.SIGKILL)
    shutil.rmtree(run, ignore_errors=True)


class Serving:
    """`rise-engine serve` in the foreground, with what it says until it serves.

    :param code: instead of the program, with the same arguments.
    """

    def __init__(self, *arguments: object, code: str = "") -> None:
        self.process = Forked("serve", *arguments, stdout=DEVNULL, code=code)
        assert self.process.stderr is not None
        self.said: list[str] = []
        while not self.said or (self.said[-1] and "the record is in " not in self.said[-1]):
            self.said.append(self.process.stderr.readline().strip())
        self.report = self.said[-1]

    @property
    def record(self) -> Path:
        return Path(self.report.partition("the record is in ")[2])

    def end(self, number: int = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        return self.wait()

    def wait(self) -> int:
        assert self.process.stderr is not None
        code = self.process.wait(PATIENCE)
        self.process.stderr.close()
        return code


def statuses(record: Path, kind: str) -> list[str]:
    found = [json.loads(line) for line in (record / JOURNAL).read_bytes().splitlines()]
    return [line["status"] for line in found if line.get("kind") == kind]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_stops_the_robot_and_ends_the_session_in_order(root: Path, number: int) -> None:
    it = Serving(folder(root / "study"), "--act", "Greet", "--speed", "0.1")
    assert it.report.startswith("serving study-"), it.report
    wait_for_record(it.record, b'"status":"accepted"')
    assert it.end(number) == 0
    assert statuses(it.record, "stop") == ["requested", "latched"]
    assert statuses(it.record, "session") == ["started", "ended"]
    assert engine("replay", it.record).stdout.startswith("identical")
    assert engine("sessions").stderr.startswith("no session is running")


async def test_a_session_that_ends_releases_no_stop_and_starts_nothing(root: Path) -> None:
    study = folder(root / "study")
    it = Serving(study, "--act", "Greet", "--fault", "Speech=ignore-cancel")
    client = SocketClient(session_name(study), "anna")
    await client.attach()
    wait_for_record(it.record, b'"status":"accepted"')
    it.process.send_signal(signal.SIGTERM)
    wait_for_record(it.record, b'"status":"requested"')
    for function, behavior in (("releaseStop", ""), ("startCommunicationRobotAct", "Greet")):
        reply = await client.send(Submit(function=function, behavior=behavior))
        assert reply.reason == "the session is ending"
    await client.close()
    it.wait()


SOON_STILL = """from rise_engine.cli import main
from rise_engine.run.server import hub
hub.STANDSTILL_SECONDS = 2.0
main()
"""


async def test_a_standstill_of_the_engine_is_in_the_record_and_starts_nothing(root: Path) -> None:
    study = folder(root / "study")
    it = Serving(study, code=SOON_STILL)
    wait_for_record(it.record, b'"kind":"robot"')
    client = SocketClient(session_name(study), "anna")
    await client.attach()
    for _ in range(2):  # at the first one it may not have begun to look
        os.kill(it.process.pid, signal.SIGSTOP)
        asked = asyncio.create_task(client.send(Submit(function="startCommunicationRobotAct", behavior="Greet")))
        await asyncio.sleep(3.0)  # this is the standstill
        os.kill(it.process.pid, signal.SIGCONT)
        reply = await asked
    assert not reply.accepted and reply.reason.endswith("ask again"), reply
    wait_for_record(it.record, b"s: what happened then is recorded late")
    await client.close()
    assert it.end() == 0
    notes = [line for line in (it.record / JOURNAL).read_bytes().splitlines() if b'"kind":"note"' in line]
    assert any(re.search(rb"the engine stood still for ([3-9]|\d\d) s", note) for note in notes)


@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="nothing makes a disk full for another process here")
async def test_a_stop_that_the_disk_refused_outlives_the_engine(root: Path) -> None:
    study = folder(root / "study")
    it = Serving(study, "--act", "Greet", "--speed", "0.1")
    wait_for_record(it.record, b'"status":"accepted"')
    client = SocketClient(session_name(study), "anna")
    await client.attach()
    wait_for_record(it.record, b'"holder":"wizard:anna"')
    size = (it.record / JOURNAL).stat().st_size
    resource.prlimit(it.process.pid, resource.RLIMIT_FSIZE, (size, size))
    asked = asyncio.create_task(client.send(Submit(function="stopAll")))
    kept = socket_path(session_name(study)).with_suffix(".stop")
    assert await asyncio.to_thread(wait_until, kept.exists, PATIENCE)
    it.process.kill()
    it.wait()
    with pytest.raises(EngineGone):
        await asked
    again = Serving(study, "--recover")
    wait_for_record(again.record, b'"status":"latched"')
    assert statuses(again.record, "stop") == ["requested", "latched"]
    assert wait_until(lambda: not kept.exists(), PATIENCE)
    told = '"function":"stopAll","behavior":"","calling_type":"None","source":"wizard:anna","status":"SUCCEEDED"'
    assert told in (again.record / JOURNAL).read_text("utf-8")
    assert again.end() == 0


def wait_for_record(record: Path, what: bytes) -> None:
    """Until the journal holds it; the file system is asked, because nothing else of that process is known here."""
    import time

    deadline = time.monotonic() + PATIENCE
    while what not in (record / JOURNAL).read_bytes():
        assert time.monotonic() < deadline, (record / JOURNAL).read_bytes()
        time.sleep(0.01)


def test_a_lost_terminal_changes_nothing(root: Path) -> None:
    it = Serving(folder(root / "study"))
    it.process.send_signal(signal.SIGHUP)
    it.process.send_signal(signal.SIGHUP)
    assert engine("sessions").stdout.startswith("study-")
    assert it.end() == 0


def test_sessions_are_listed_and_stopped_by_folder_or_name(root: Path) -> None:
    one, two = folder(root / "one"), folder(root / "two")
    first, second = Serving(one), Serving(two, "--name", "other")
    listed = json.loads(engine("sessions", "--json").stdout)
    assert sorted(each["name"] for each in listed) == sorted([session_name(one), "other"])
    result = engine("stop")
    assert (result.returncode, "choose one" in result.stderr) == (1, True)
    assert engine("stop", "others").returncode == 1
    assert engine("stop", one).returncode == 0
    assert first.wait() == 0
    assert engine("stop").returncode == 0, "the only one"
    assert second.wait() == 0


def test_stop_does_not_say_more_than_the_record(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The engine gets no time to end, and has not answered either."""
    it = Serving(folder(root / "study"))
    wait_for_record(it.record, b'"kind":"robot"')
    it.process.send_signal(signal.SIGSTOP)
    kill = os.kill
    monkeypatch.setattr(os, "kill", lambda process, number: kill(process, signal.SIGKILL))
    with pytest.raises(Refused, match="its record has no end: look at the robot") as refused:
        stop.callback(None)  # type: ignore[misc]
    assert refused.value.exit_code == 74 and it.wait() == -signal.SIGKILL


@pytest.mark.parametrize(
    ("during", "status", "sessions"),
    [("_recover", 0, ["started", "recovered", "ended"]), ("_load_scenario", 130, ["started"])],
)
def test_a_signal_before_a_session_goes_on_ends_it_in_order(
    root: Path, monkeypatch: pytest.MonkeyPatch, during: str, status: int, sessions: list[str]
) -> None:
    study = folder(root / "study")
    record = killed(study, "--act", "Greet", "--speed", "0.1")
    prepare = getattr(SessionPreparation, during)

    def signalled(*arguments: Any) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        prepare(*arguments)

    monkeypatch.setattr(SessionPreparation, during, signalled)
    options = SessionOptions(str(study), unfinished="recover" if during == "_recover" else "new")
    assert serve(options, lambda message: None) == status
    assert statuses(record, "session") == sessions and len(list((root / "sessions").iterdir())) == 1
    assert statuses(record, "stop") == (["requested", "latched"] if status == 0 else [])
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def fail(*arguments: object) -> None:
    raise BrokenPipeError("nobody reads")


@pytest.mark.parametrize(("what", "statuses_"), [("report", ["started", "ended"]), ("kernel", [])])
def test_an_engine_that_fails_at_its_beginning_leaves_no_robot(
    root: Path, monkeypatch: pytest.MonkeyPatch, what: str, statuses_: list[str]
) -> None:
    study = folder(root / "study")
    if what == "kernel":
        monkeypatch.setattr(Kernel, "handle", fail)
    assert serve(SessionOptions(str(study)), fail if what == "report" else lambda message: None) == 70
    (record,) = (root / "sessions").iterdir()
    assert statuses(record, "session") == statuses_


def test_one_session_per_folder(root: Path) -> None:
    study = folder(root / "study")
    it = Serving(study)
    result = engine("serve", study)
    assert result.returncode == 3
    assert "is running already" in result.stderr
    assert it.end() == 0


def test_a_scenario_with_errors_is_refused_before_anything_is_made(root: Path) -> None:
    study = folder(root / "study", bad='<Dialog name="Bad"><Speach><actionID>1</actionID></Speach></Dialog>')
    result = engine("serve", study)
    assert result.returncode == 1
    assert "did you mean" in result.stderr
    assert not (root / "sessions").exists()
    wrong = engine("serve", folder(root / "fine"), "--fault", "Speach=fail")
    assert wrong.returncode == 2
    assert "did you mean 'Speech'" in wrong.stderr


def test_after_a_crash_it_asks_and_then_goes_on_or_begins_anew(root: Path) -> None:
    study = folder(root / "study")
    it = Serving(study, "--act", "Greet", "--rule", "Wait for it", "--speed", "0.1", "--seed", "7")
    wait_for_record(it.record, b'"status":"accepted"')
    assert it.end(signal.SIGKILL) == -signal.SIGKILL
    asked = engine("serve", study)
    assert asked.returncode == 4
    assert str(it.record) in asked.stderr and "--recover" in asked.stderr
    more = Serving(study, "--recover")
    assert more.record == it.record
    assert more.end() == 0
    assert statuses(it.record, "session") == ["started", "recovered", "ended"]
    assert statuses(it.record, "action")[:3] == ["started", "accepted", "lost"]
    lines = [json.loads(line) for line in (it.record / JOURNAL).read_bytes().splitlines()]
    at = next(index for index, each in enumerate(lines) if each.get("status") == "recovered")
    before = next(each for each in reversed(lines[:at]) if "wall" in each)
    gap = (datetime.fromisoformat(lines[at]["wall"]) - datetime.fromisoformat(before["wall"])).total_seconds()
    assert 0 < lines[at]["downtime"] <= gap, "by the wall clock, from the last line to the engine that goes on"
    assert lines[at]["t"] - before["t"] < gap, "with --speed 0.1 the session's own time stood nearly still"
    contents = read_journal(it.record / JOURNAL)
    assert contents.ended and not contents.gaps and not contents.damaged
    assert engine("replay", it.record).returncode == 0

    crashed = Serving(study)
    wait_for_record(crashed.record, b'"kind":"robot"')
    crashed.end(signal.SIGKILL)
    new = Serving(study, "--new")
    assert new.record != crashed.record
    assert new.end() == 0
    again = Serving(study)
    assert again.end() == 0, "nobody is asked twice about a session that was left"


ASKED = """<InteractionRule name="Asked" initial="Say"><State id="Say">
  <onEntry><function startCommunicationRobotAct="Chat"/></onEntry>
  <transition ended="Chat" outcome="failed" target="Failed"/></State>
<State id="Failed"><transition eventTopic="/go" target="Say"/></State></InteractionRule>"""


async def submit(session: Path, function: str, behavior: str) -> None:
    """Ask for a task, as a console does."""
    client = SocketClient(session_name(session), "anna")
    await client.attach()
    reply = await client.send(Submit(function=function, behavior=behavior))
    assert reply.accepted, reply.reason
    await client.close()


async def test_what_is_asked_and_where_rules_stood_outlives_crashes(root: Path) -> None:
    """Killed while a failed act waits for an answer, and again between a stop and its release."""
    study = folder(root / "study", toml='on_failure = "ask"')
    (study / "rules" / "asked.xml").write_text(ASKED, "utf-8")
    it = Serving(study, "--rule", "Asked", "--fault", "Speech=fail@1")
    wait_for_record(it.record, b'"status":"asked"')
    it.end(signal.SIGKILL)
    it = Serving(study, "--recover")
    await submit(study, "goOn", "Chat")
    wait_for_record(it.record, b'"state":"Failed"')
    await submit(study, "stopAll", "")
    wait_for_record(it.record, b'"status":"latched"')
    it.end(signal.SIGKILL)
    it = Serving(study, "--recover")
    await submit(study, "releaseStop", '{"Asked": "wait"}')
    wait_for_record(it.record, b'"trigger":"resumed, without onEntry"')
    assert it.end() == 0
    assert [name for name in statuses(it.record, "failure") if name != "asked"] == ["gone-on"]
    assert engine("replay", it.record).returncode == 0


def killed(study: Path, *arguments: object) -> Path:
    """A session that did not end."""
    it = Serving(study, *arguments)
    record = it.record
    wait_for_record(record, b'"kind":"robot"')
    it.end(signal.SIGKILL)
    return record


CONDITIONS = '[conditions.calm]\nmemory = { name = "you" }\n[conditions.loud]\nmemory = { name = "YOU" }\n'


def test_what_a_condition_sets_is_recorded_recovered_and_replayed(root: Path) -> None:
    study = folder(root / "study", CONDITIONS)
    for arguments, sentence in (
        (["--condition", "calmm"], "did you mean `calm`?"),
        (["--condition", "calm", "--set", 'name="Anna"'], "`name` cannot be set together with the condition `calm`"),
        (["--condition", "calm", "--set", 'name="Anna"', "--new"], "which sets it"),
    ):
        refused = engine("serve", study, *arguments)
        assert refused.returncode == 2 and sentence in refused.stderr
    assert not (root / "sessions").exists() or not list((root / "sessions").iterdir()), "nothing was begun"
    record = killed(study, "--participant", "P07", "--condition", "loud")
    again = Serving(study, "--participant", "P07", "--condition", "loud", "--recover")
    assert again.record == record and again.end() == 0
    found = [json.loads(line) for line in (record / JOURNAL).read_bytes().splitlines()]
    written = [(line["value"], line["source"]) for line in found if line.get("kind") == "memory"]
    assert written == [("Anna", "file"), ("YOU", "condition")], "once, and never again"
    assert [line["condition"] for line in found if line.get("kind") == "session"] == ["loud"] * 3
    assert engine("replay", record).stdout.startswith("identical")


def test_no_session_begins_in_a_name_alone(root: Path) -> None:
    """What scenarios of earlier versions list: they load, with a warning, and run without a condition."""
    study = folder(root / "study", '[study]\nconditions = ["calm", "loud"]\n')
    refused = engine("serve", study, "--participant", "P08", "--condition", "loud")
    assert refused.returncode == 2 and "under [conditions.loud] what it sets" in refused.stderr
    assert engine("check", study).returncode == 0
    assert Serving(study, "--participant", "P08").end() == 0


def test_nobody_s_session_goes_on_as_somebody_else_s(root: Path) -> None:
    study = folder(root / "study", CONDITIONS)
    record = killed(study, "--participant", "P07", "--condition", "calm")
    for arguments in (["--participant", "P08", "--recover"], ["--condition", "loud", "--recover"]):
        refused = engine("serve", study, *arguments)
        assert refused.returncode == 4, refused.stderr
        assert "participant P07, condition calm" in refused.stderr and "ran 0 s" in refused.stderr
        assert f"no session of {'P08' if 'P08' in arguments else 'condition loud'} waits" in refused.stderr
        assert "use --new to begin, or name theirs" in refused.stderr
    refused = engine("serve", study, "--participant", "P08", "--session", record)
    assert refused.returncode == 2 and "the session of P07, condition calm, not of P08" in refused.stderr
    asked = engine("serve", study, "--participant", "P08")
    assert asked.returncode == 4 and "use --recover" not in asked.stderr
    started = start_engine(SessionOptions(str(study), participant="P08", unfinished="recover"))
    assert isinstance(started, EngineRefused) and started.unfinished == []
    assert [Path(found) for found, _ in started.others] == [record]
    assert statuses(record, "session") == ["started"], "it was not touched"
    own = killed(study, "--participant", "P08", "--new")
    assert not (record / "abandoned").exists(), "it is P07's to go on with"
    again = Serving(study, "--participant", "P08", "--recover")
    assert again.record == own
    again.end()
    again = Serving(study, "--participant", "P07", "--recover")
    assert again.record == record
    again.end()


def test_a_session_that_did_not_end_is_found_without_knowing_where_it_was(root: Path) -> None:
    study, other = folder(root / "my study"), folder(root / "other")
    crashed = Serving(study)
    wait_for_record(crashed.record, b'"kind":"robot"')
    running = Serving(other, "--name", "apart")
    wait_for_record(running.record, b'"kind":"robot"')
    assert "did not end" not in engine("sessions").stderr, "both run"
    crashed.end(signal.SIGKILL)

    command = f"  rise-tui --config '{study}'\n"
    result = engine("sessions")
    assert result.stdout.startswith("apart") and "A session did not end. To go on with it:\n" + command in result.stderr
    assert "begun 20" in result.stderr.partition(command)[2] and str(other) not in result.stderr
    running.end()
    console = run_engine(module="rise_tui")
    assert console.returncode == 2 and console.stderr.startswith("no session is running; start one with:")
    assert console.stderr.count("rise-tui --config") == 2 and command in console.stderr

    running = Serving(other)
    wait_for_record(running.record, b'"kind":"robot"')
    running.end(signal.SIGKILL)
    result = engine("sessions")
    assert "These sessions did not end. To go on with one of them:\n  rise-tui --config " + str(other) in result.stderr
    assert command in result.stderr, "the latest first, and one of each scenario"
    info = running.record / "session.toml"
    info.write_text(re.sub('title = ".*"', 'title = "yesterday"', info.read_text("utf-8")), "utf-8")
    result = engine("sessions")
    assert result.returncode == 0 and f"{running.record.name} cannot be described: " in result.stderr

    shutil.rmtree(other)
    assert Serving(study, "--new").end() == 0
    assert "did not end" not in engine("sessions").stderr, "nobody is asked again about a session that was left"


def test_the_latest_session_of_a_scenario_is_named_and_none_while_it_runs(root: Path) -> None:
    study = folder(root / "study")
    first = Serving(study)
    wait_for_record(first.record, b'"kind":"robot"')
    first.end(signal.SIGKILL)
    second = Serving(study, "--new", "--robot", "pepper")
    wait_for_record(second.record, b'"kind":"robot"')
    second.end(signal.SIGKILL)
    (first.record / "abandoned").unlink()
    result = engine("sessions").stderr
    assert result.count("begun 20") == 1 and "      study (debug, pepper)" in result, "the latest"
    running = Serving(study, "--session", first.record)
    assert running.record == first.record
    assert "did not end" not in engine("sessions").stderr, "it cannot be recovered now"
    assert running.end() == 0


def test_what_cannot_be_recovered_is_refused_with_a_sentence_and_not_tried_for_ever(root: Path) -> None:
    study = folder(root / "study")
    it = Serving(study, "--act", "Greet")
    wait_for_record(it.record, b'"status":"accepted"')
    it.end(signal.SIGKILL)
    lines = (it.record / JOURNAL).read_bytes().splitlines(keepends=True)
    where = next(n for n, line in enumerate(lines) if b'"input":"submit"' in line)
    lines[where] = lines[where].replace(b"Greet", b"Gruet")
    (it.record / JOURNAL).write_bytes(b"".join(lines))
    result = engine("serve", study, "--recover")
    assert result.returncode == 5
    assert f"line {where + 1} is damaged" in result.stderr and "Traceback" not in result.stderr


def test_an_edited_session_that_did_not_end_keeps_no_other_one_from_beginning(root: Path) -> None:
    study = folder(root / "study")
    record = killed(study, "--seed", "7")
    info = (record / "session.toml").read_text("utf-8")
    (record / "session.toml").write_text(info.replace("seed = 7", "seed = 8"), "utf-8")
    asked = engine("serve", study)
    assert asked.returncode == 4 and str(record) in asked.stderr
    again = engine("serve", study, "--recover")
    assert again.returncode == 5 and "session.toml says seed = 8" in again.stderr
    assert "Traceback" not in asked.stderr + again.stderr
    assert Serving(study, "--new").end() == 0


def test_an_engine_in_the_background_says_that_it_serves_or_why_not(root: Path) -> None:
    study = folder(root / "study")
    started = start_engine(SessionOptions(str(study), seed=3))
    assert isinstance(started, EngineStarted)
    assert started.name == session_name(study)
    assert read_info(Path(started.folder)).seed == 3
    refused = start_engine(SessionOptions(str(study)))
    assert isinstance(refused, EngineRefused) and refused.code == 3
    pid = int(lock_path(socket_path(started.name)).read_text().split()[0])
    assert os.getsid(pid) == pid, "it belongs to no terminal"
    assert engine("stop").returncode == 0
    nowhere = start_engine(SessionOptions(str(root / "nowhere")))
    assert isinstance(nowhere, EngineRefused) and nowhere.code == 1


def test_systemd_is_told(root: Path) -> None:
    path = root / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
        notify.bind(str(path))
        notify.settimeout(PATIENCE)
        environment = {**os.environ, "NOTIFY_SOCKET": str(path)}
        process = Forked("serve", folder(root / "study"), env=environment, stdout=DEVNULL, stderr=DEVNULL)
        assert notify.recv(100) == b"READY=1"
        process.terminate()
        assert notify.recv(100) == b"STOPPING=1"
        assert process.wait(PATIENCE) == 0


def test_the_unit_file_names_options_that_exist() -> None:
    unit = (Path(__file__).parents[2] / "packaging/systemd/rise-engine@.service").read_text("utf-8")
    command = next(line for line in unit.splitlines() if line.startswith("ExecStart="))
    options = [word for word in command.split() if word.startswith("--")]
    known = engine("serve", "--help").stdout
    assert options and all(option in known for option in options)


@pytest.mark.skipif(sys.platform != "linux" or os.getuid() != 0, reason="needs root to become somebody else")
def test_other_users_cannot_connect(root: Path) -> None:
    it = Serving(folder(root / "study"))
    path = next(Path(os.environ["RISE_RUNTIME"]).glob("*.sock"))
    assert path.stat().st_mode & 0o777 == 0o600 and path.parent.stat().st_mode & 0o777 == 0o700
    program = (
        "import os, socket, sys\n"
        "os.setgroups([]); os.setgid(65534); os.setuid(65534)\n"
        "try:\n socket.socket(socket.AF_UNIX).connect(sys.argv[1])\n"
        "except PermissionError: sys.exit(13)\n"
    )
    tried: Any = subprocess.run([sys.executable, "-c", program, str(path)], check=False)
    assert tried.returncode == 13
    assert it.end() == 0


def test_a_folder_whose_name_is_no_text(root: Path) -> None:
    """It was written into the record with a `?`: --recover began a new session, and a console could not start one."""
    studies = []
    for name in (b"l\xe4b", b"l\xf6b"):
        try:
            studies.append(folder(root / os.fsdecode(name)))
        except OSError:
            pytest.skip("this file system has no such names")
    one, other = studies
    first = Serving(one, "--act", "Greet")
    wait_for_record(first.record, b'"status":"accepted"')
    assert read_info(first.record).scenario_folder == str(one)
    first.end(signal.SIGKILL)
    assert find_unfinished(str(one)) == [first.record] and find_unfinished(str(other)) == []
    again = Serving(one, "--recover")
    assert again.record == first.record
    assert again.end() == 0

    started = start_engine(SessionOptions(str(one), unfinished="new"))
    assert isinstance(started, EngineStarted), started
    assert asyncio.run(told_folder(started.name)) == str(one)
    refused = start_engine(SessionOptions(str(one)))
    assert isinstance(refused, EngineRefused)
    listed = engine("sessions")
    assert listed.returncode == 0 and session_name(str(one)) in listed.stdout
    assert engine("stop", one).returncode == 0


async def told_folder(name: str) -> str:
    """Of the scenario, as a console is told."""
    client = SocketClient(name, "anna")
    hello = await client.attach()
    await client.close()
    return hello.scenario.folder


def test_a_session_that_plays_a_task_file_by_itself(root: Path) -> None:
    study = folder(root / "study", CONDITIONS)
    script = root / "way.jsonl"
    script.write_text(
        '{"condition": "loud"}\n{"seed": 7}\n{"fault": "Speech=fail@1"}\n'
        '{"function_type": "startInteractionRule", "domain_task_behavior": "Wait for it", "at": 0.1}\n'
        '{"function_type": "raiseEventTopic", "domain_task_behavior": "/go", "at": 0.2}\n'
    )
    it = Serving(study, "--tasks", script, "--speed", "10")
    wait_for_record(it.record, b"simulated fault")
    assert it.end() == 0
    assert engine("replay", it.record).stdout.startswith("identical")
    found = [json.loads(line) for line in (it.record / JOURNAL).read_bytes().splitlines()]
    started = next(line for line in found if line.get("kind") == "session")
    assert (started["seed"], started["condition"]) == (7, "loud")
    asked = [line["behavior"] for line in found if line.get("kind") == "task" and line["source"] == "file"]
    assert list(dict.fromkeys(asked)) == ["Wait for it", "/go"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--mode", "real"], "add --mode debug"),
        (["--recover"], "--tasks goes with a new session"),
        (["--fault", "Speech=fial"], "Speech=fial"),
    ],
)
def test_what_plays_by_itself_is_a_new_rehearsal(root: Path, arguments: list[str], sentence: str) -> None:
    script = root / "way.jsonl"
    script.write_text('{"function_type": "stopAll", "at": 1}\n')
    refused = engine("serve", folder(root / "study"), "--tasks", script, *arguments)
    assert refused.returncode == 2 and sentence in refused.stderr, refused.stderr
    from_input = engine("serve", root / "study", "--tasks", "-")
    assert from_input.returncode == 2 and "from a file" in from_input.stderr

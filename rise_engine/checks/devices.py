"""Checks in a child process: the robot (its link, the needed actions, its voice), the recorders, the last session.
`main` makes one check, answers and exits."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from datetime import datetime
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.errors import AdapterError, SessionError
from rise_engine.base.files import is_locked
from rise_engine.base.json_codec import encode
from rise_engine.base.text import pluralize, restore_all_surrogates
from rise_engine.checks.kinds import check_explored
from rise_engine.checks.outcome import Finding
from rise_engine.checks.programs import ChildRequest
from rise_engine.kernel.inputs import RobotChanged, Submit
from rise_engine.kernel.records import FINAL, AnyRecord, TaskRecord
from rise_engine.kernel.speech import SPEECH, why_not_speak
from rise_engine.ports.recorder import CALL_SECONDS, Recorder, RecorderError, RecorderStatus, RecordingPlan
from rise_engine.ports.robot import Robot, RobotReport
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.drivers import (
    RobotOptionsError,
    driver_name_for,
    make_robot,
    narrow_profile,
    needed_actions,
    open_bridge,
    profile_findings,
    sent_as,
    unstoppable_actions,
)
from rise_engine.run.engine.engine import Engine
from rise_engine.run.recording.one_recorder import call_within, recording_size
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import SIMULATED, RobotProfile, Scenario
from rise_engine.session.folder import JOURNAL, has_begun, read_info
from rise_engine.session.replay import compare_replay
from rise_engine.session.unfinished_files import erase_folder
from rise_engine.study.labels import refuse_relabelled
from rise_engine.study.model import RecorderSettings, RecordingSettings
from rise_engine.study.recording_table import open_recorder

ANSWER_SECONDS = 30.0
"""Seconds for the robot's answer."""
SETTLE_SECONDS = 1.0
"""Seconds without changes until the link counts as stable: a duplicate program may appear, or a part may go."""
WORD_SECONDS = 40.0
"""Seconds for the end of the word."""
_WORDS = """
    ar مرحبا  cs Ahoj  da Hej  de Hallo  el Γεια  en Hello  es Hola  fi Hei  fr Bonjour  he שלום  hi नमस्ते  it Ciao
    ja こんにちは  ko 안녕하세요  nb Hei  nl Hallo  pl Cześć  pt Olá  ru Здравствуйте  sv Hej  tr Merhaba  zh 你好
"""
WORDS = dict(zip(_WORDS.split()[::2], _WORDS.split()[1::2], strict=True))
"""The word that the robot says, by the scenario's language."""


async def check_robot(request: ChildRequest) -> Finding:
    """Check that the scenario's robot answers and offers every action of the scenario. Sends no action."""
    try:
        scenario = _load(request)
        needed = needed_actions(scenario)
        profile = narrow_profile(scenario.robot, needed)
        found_in_profile = [] if _is_simulated(scenario) else profile_findings(profile)
        if problems := [each.sentence for each in found_in_profile if each.refuses]:
            return Finding(False, reason="; ".join(problems))
        unstoppable = unstoppable_actions(found_in_profile)
        changes = _RobotChanges()
        async with _connected_robot(request, scenario, profile) as (robot, _):
            robot.connect(changes.take)
            found = await changes.wait()
    except AdapterError as error:
        return Finding(False, reason=str(error))
    if found is None:
        return Finding(False, reason=f"{profile.title} did not answer within {ANSWER_SECONDS:g} s")
    if found.status != "connected":
        return Finding(False, reason=found.detail or f"{profile.title} is {found.status}")
    what = found.detail or f"{profile.title} is connected"
    if not _is_simulated(scenario):
        what += f": {pluralize(len(needed), 'action')} offered"
    return Finding(True, f"{what}; F9 cannot stop {', '.join(unstoppable)}" if unstoppable else what)


async def check_sound(request: ChildRequest) -> Finding:
    """Make the robot say a word in a session that is not stored. A person then says whether it was heard."""
    try:
        scenario = _load(request)
        if why := why_not_speak(scenario):
            return Finding(False, reason=why)
        if _is_simulated(scenario):
            return Finding(True, "the robot is simulated: there is nothing to hear")
        word = word_for(scenario.language)
        # Only the voice is needed; another check reports missing parts.
        profile = narrow_profile(scenario.robot, frozenset({sent_as(scenario.robot, SPEECH)}))
        async with _connected_robot(request, scenario, profile) as (robot, clock):
            ended = await _speak_word(replace(scenario, robot=profile), robot, clock, word)
    except AdapterError as error:
        return Finding(False, reason=str(error))
    if ended is None:
        return Finding(False, reason=f"the robot did not come to the end of “{word}” within {WORD_SECONDS:g} s")
    if ended.status != "SUCCEEDED":
        return Finding(False, reason=f"the robot could not say “{word}”: {ended.reason or ended.status}")
    return Finding(True, f"the robot said “{word}”", question=f"The robot said “{word}”, and it was heard")


def word_for(language: str) -> str:
    """Return the word for a scenario's language, by default the English one."""
    return WORDS.get(language.lower().partition("-")[0], WORDS["en"])


def _is_simulated(scenario: Scenario) -> bool:
    return driver_name_for(scenario.robot, scenario.mode) == SIMULATED


def _load(request: ChildRequest) -> Scenario:
    loaded = load(request.scenario, robot=request.robot, mode=request.mode)
    if loaded.scenario is None:
        raise AdapterError(f"the scenario has errors: {loaded.errors[0]}")
    robot = loaded.scenario.robot
    if request.mode == "real" and robot.driver == SIMULATED:
        raise AdapterError(
            f"the robot {robot.name} is only simulated, and the mode is real: no robot would move; "
            "name the real one (`robot` in study.toml or scenario.toml)"
        )
    return loaded.scenario


class _RobotChanges:
    """A robot's reports of its link."""

    def __init__(self) -> None:
        self.last: RobotChanged | None = None
        self._changed = asyncio.Event()

    def take(self, report: RobotReport) -> None:
        if isinstance(report, RobotChanged):
            self.last = report
            self._changed.set()

    async def wait(self) -> RobotChanged | None:
        """Wait until the link is stable for a moment, and return its last report; None: there was none."""
        loop = asyncio.get_running_loop()
        until = loop.time() + ANSWER_SECONDS
        while (remaining := until - loop.time()) > 0:
            self._changed.clear()
            settled = self.last is not None
            try:
                await asyncio.wait_for(self._changed.wait(), SETTLE_SECONDS if settled else remaining)
            except TimeoutError:
                return self.last
        return self.last


@asynccontextmanager
async def _connected_robot(
    request: ChildRequest, scenario: Scenario, profile: RobotProfile
) -> AsyncIterator[tuple[Robot, RealClock]]:
    """Create the robot as a session would, not yet connected, with its clock. Raises AdapterError."""
    clock = RealClock(asyncio.get_running_loop())
    try:
        bridge = await open_bridge(request.ros, profile, scenario.mode)
    except AdapterError as error:
        raise AdapterError("; ".join(error.lines)) from None
    try:
        robot = make_robot(profile, scenario.mode, clock, seed=0, bridge=bridge)
        try:
            yield robot, clock
        finally:
            robot.close()
    except (AdapterError, RobotOptionsError) as error:
        raise AdapterError(str(error)) from None
    finally:
        if bridge is not None:
            await bridge.close()


async def _speak_word(scenario: Scenario, robot: Robot, clock: RealClock, word: str) -> TaskRecord | None:
    """Say the word, and return the last record of its task; None: it did not end."""
    ended: asyncio.Future[TaskRecord] = asyncio.get_running_loop().create_future()

    def take(record: AnyRecord) -> None:
        if isinstance(record, TaskRecord) and record.function == "say" and record.status in FINAL and not ended.done():
            ended.set_result(record)

    engine = Engine(scenario, robot, clock, seed=0, sinks=(take,))
    engine.start()
    engine.accept(Submit(function="say", behavior=word))
    done, _ = await asyncio.wait({ended}, timeout=WORD_SECONDS)
    engine.end_now("the word was said" if done else "the word did not end")
    return ended.result() if done else None


# --- recorders --------------------------------------------------------------------------------------------------------

# Each recorder records for three seconds, and its file must grow. Otherwise a recorder that claims to record but writes
# nothing would be noticed too late.


TEST_SECONDS = 3.0
"""Seconds that each recorder records."""
SAMPLE_SECONDS = 0.5
TEST_SESSION = "check"
"""The session's name in the names of test files."""


class RecorderTrial(Struct, frozen=True):
    """The result of one recorder's test."""

    name: str
    found: str = ""
    problem: str = ""
    remaining: str = ""
    """The path of the test file if it still exists; empty: it was deleted, or there was none."""


async def check_recorders(request: ChildRequest) -> Finding:
    """Check that every recorder of the study records. Test files on this computer are deleted.

    :param request: the request with the recorders.
    """
    settings = request.recording or RecordingSettings()
    if not settings.recorders:
        return Finding(True, "the study has no recorders")
    try:
        folder = Path(mkdtemp(prefix="rise-check-", dir=settings.folder or None))
    except OSError as error:
        return Finding(False, reason=f"there is no place for a test file: {error.strerror or error}")
    try:
        plan = RecordingPlan(TEST_SESSION, folder, task=request.task)
        trials = await asyncio.gather(*(_try(each, plan) for each in settings.recorders))
    finally:
        rmtree(folder, ignore_errors=True)
    found = [f"{each.name}: {each.found}" for each in trials if each.found]
    found += [f"the test file of {each.name} is still at {each.remaining}" for each in trials if each.remaining]
    problems = [f"{each.name}: {each.problem}" for each in trials if each.problem]
    return Finding(not problems, "; ".join(found), "; ".join(problems))


async def _try(settings: RecorderSettings, plan: RecordingPlan) -> RecorderTrial:
    """Test one recorder, and report any failure."""
    name = settings.name
    try:
        recorder = open_recorder(settings.driver, name, settings.options)
    except RecorderError as error:
        return RecorderTrial(name, problem=" ".join(str(error).split()))
    found = problem = path = ""
    grown = 0.0
    try:
        found = await call_within(CALL_SECONDS, recorder.prepare(plan), "what it is")
        try:
            path = await call_within(CALL_SECONDS, recorder.start(), "to start")
            first, last = await _watch(recorder)
        except RecorderError:
            with suppress(RecorderError):  # it may have begun
                path = await call_within(CALL_SECONDS, recorder.stop(), "to stop") or path
            raise
        path = last.path or path
        path = await call_within(CALL_SECONDS, recorder.stop(), "to stop") or path
        grown = await _growth(first, last, path)
    except RecorderError as error:
        problem = str(error)
    finally:
        with suppress(RecorderError):
            await call_within(CALL_SECONDS, recorder.close(), "to let go")
    if not problem and grown <= 0:
        problem = f"it said that it records, and in {TEST_SECONDS:g} s its file did not grow"
    return RecorderTrial(name, found, problem, await asyncio.to_thread(_erase, path))


async def _watch(recorder: Recorder) -> tuple[RecorderStatus, RecorderStatus]:
    """Return its status at the beginning and after TEST_SECONDS."""
    first = last = await call_within(CALL_SECONDS, recorder.status(), "for its state")
    for _ in range(round(TEST_SECONDS / SAMPLE_SECONDS)):
        await asyncio.sleep(SAMPLE_SECONDS)
        last = await call_within(CALL_SECONDS, recorder.status(), "for its state")
        if not last.recording:
            raise RecorderError("it does not record any more")
    return first, last


async def _growth(first: RecorderStatus, last: RecorderStatus, path: str) -> float:
    """Return a recording's growth in bytes or seconds, also after its end. Without a measure, it counts as growing."""
    whole = await asyncio.to_thread(recording_size, path)
    if first.bytes is not None:
        return max(whole or 0, last.bytes or 0) - first.bytes
    if first.seconds is not None:
        return (last.seconds or 0.0) - first.seconds
    return 1.0 if whole is None else whole


def _erase(path: str) -> str:
    """Delete the test file. Returns its path if it still exists; empty: it is gone."""
    if not path:
        return ""
    place = Path(path).expanduser()
    with suppress(OSError):
        if place.is_dir():
            erase_folder(place)
        elif place.exists():
            place.unlink()
        else:
            return path  # on another computer
        return ""
    return path


# --- the main program -------------------------------------------------------------------------------------------------


def check_last_session(sessions: Path) -> Finding:
    """Replay the last session (blocking, long for a long session); a study without sessions passes.

    :param sessions: the study's folder of sessions.
    """
    folder = last_session(sessions)
    if folder is None:
        return Finding(True, "there is no earlier session")
    try:
        refuse_relabelled(folder)
        compared = compare_replay(folder)
    except SessionError as error:
        return Finding(False, folder.name, f"the last session cannot be replayed: {error}")
    if compared.identical:
        return Finding(True, f"{folder.name}: identical, {pluralize(compared.records, 'record')}")
    why = str(compared.difference) if compared.difference is not None else "something in its journal cannot be read"
    return Finding(False, folder.name, f"the last session does not replay identically: {why}")


def last_session(sessions: Path) -> Path | None:
    """Return the session that began last and is not running; None: there is none."""
    found: list[tuple[datetime, Path]] = []
    with suppress(OSError):
        for folder in sessions.iterdir():
            if has_begun(folder) and not is_locked(folder / JOURNAL):
                with suppress(SessionError, ValueError):
                    found.append((datetime.fromisoformat(read_info(folder, compare=False).started), folder))
    return max(found)[1] if found else None


def main() -> None:
    """Handle one request."""
    answer = os.dup(1)
    os.dup2(2, 1)  # output that libraries print must not mix with the answer
    request = msgspec.convert(restore_all_surrogates(msgspec.json.decode(sys.stdin.buffer.read())), ChildRequest)
    finding = _run_check(request)
    os.write(answer, encode(finding))
    os.close(answer)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # does not wait for threads that never end


def _run_check(request: ChildRequest) -> Finding:
    if request.kind == "replay":
        return check_last_session(Path(request.sessions))
    if request.kind == "explored":
        return check_explored(Path(request.study), request.session, request.robot, request.mode)
    if request.kind == "recorder":
        return asyncio.run(check_recorders(request))
    return asyncio.run(check_sound(request) if request.kind == "sound" else check_robot(request))


if __name__ == "__main__":
    main()

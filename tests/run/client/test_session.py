"""The door for programs, and the examples of its documentation, run as they stand."""

from __future__ import annotations

import asyncio
import inspect
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from textwrap import dedent
from typing import get_args

import pytest

from rise_engine.kernel.records import (
    CheckRecord,
    MemoryRecord,
    OutcomeRecord,
    RecordingRecord,
    SessionRecord,
    SyncRecord,
)
from rise_engine.run.client import Session, connect
from rise_engine.run.protocol.client import Client, EngineGone, LinkLost, Rejected
from rise_engine.run.protocol.messages import ClientMessage, ServerMessage, decode_client_message, decode_server_message
from tests.forked import run_engine
from tests.patience import PATIENCE
from tests.run.server.serving import GREETING, ROOT, served

PAGES = [ROOT / "docs" / "how-to" / "drive-a-session-from-a-program.md", ROOT / "docs" / "reference" / "link.md"]


def examples(page: Path) -> list[str]:
    return re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.S)


def docstring_example(documented: object) -> str:
    """The program in a docstring: what is indented, from its first import on."""
    text = inspect.getdoc(documented) or ""
    lines = [line for line in text.splitlines() if line.startswith("    ") or not line]
    return dedent("\n".join(lines[lines.index("    import asyncio") : lines.index("    asyncio.run(main())") + 1]))


PROGRAMS = {f"{page.name} {n}": program for page in PAGES for n, program in enumerate(examples(page))} | {
    documented.__name__: docstring_example(documented) for documented in (connect, Session, Client)
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PROGRAMS)
async def test_the_examples_of_the_documentation_run(scratch: Path, name: str) -> None:
    async with served(scratch, GREETING) as session:
        program = f"import warnings\nwarnings.simplefilter('error')\n{PROGRAMS[name]}"
        done = await asyncio.to_thread(run_engine, code=program)
        assert done.returncode == 0, done.stderr
        assert any(task.source == "node:gaze-tracker" for task in session.hub.view.tasks.values())


def test_the_example_is_one_of_ten_lines() -> None:
    lines = [line for line in examples(PAGES[0])[0].splitlines() if line.strip()]
    assert len(lines) <= 10


def test_the_client_package_loads_no_engine() -> None:
    unwanted = "{'rise_engine.run.engine.engine', 'textual'}"
    code = f"import sys, rise_engine.run.client; assert not {unwanted} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], timeout=60, check=True)


async def test_a_program_drives_a_session(scratch: Path) -> None:
    async with served(scratch, GREETING) as running, connect(running.name, name="test") as session:
        assert session.attach_reply.you == "node:test" and session.scenario.title == running.engine.scenario.title
        records = session.records()
        await session.set("person_name", {"first": "Zoë", "age": 7})
        async for record in records:
            if isinstance(record, MemoryRecord) and record.key == "person_name":
                assert record.value == {"first": "Zoë", "age": 7} and record.source == "node:test"
                break
        assert session.view.memory["person_name"].value == {"first": "Zoë", "age": 7}
        await session.delete("person_name")
        assert "person_name" not in session.view.memory
        await session.start_rule("Greeting")
        assert session.view.rules["Greeting"].running
        await session.set("person_near", True)
        await session.wait_until(lambda view: view.rules["Greeting"].state == "Visitor is here", PATIENCE)
        await session.raise_event("/H_greets")
        await session.wait_until(lambda view: view.acts["R_Greeting"].runs, PATIENCE)
        await session.stop_rule("Greeting")
        task = await session.start("R_Smile")
        assert (await session.wait_for_task(task, PATIENCE)).status == "SUCCEEDED"
        with pytest.raises(Rejected, match="R_Smile"):
            await session.start("R_Smiel")
        with pytest.raises(Rejected, match="neither running nor waiting"):
            await session.stop("R_Smile")
        with pytest.raises(Rejected, match="needs no control"):
            await session.change_control("take")
        with pytest.raises(TimeoutError):
            await session.wait_until(lambda view: False, 0.01)
        await session.add_note("done")
        await session.stop_all()
        await session.wait_until(lambda view: view.stop.status == "latched", PATIENCE)
        with pytest.raises(Rejected, match=r"test may not release a stop: only the wizard who holds .*may_release"):
            await session.release_stop()
        assert session.view.stop.latched and session.now() > 0


async def test_a_program_reports_about_the_session(scratch: Path) -> None:
    async with (
        served(scratch) as running,
        connect(running.name, name="camera") as session,
        connect(running.name, name="bob", role="observer") as observer,
    ):
        records = session.records()
        await session.report_check("lights", "skipped", text="The lamp is on", value="dark", reason="daylight")
        await session.report_recording("camera", "running", path="/a.mkv", bytes=2**40)
        await session.mark_sync(3, "sound", "at the start")
        await session.report_outcome("aborted", "a fire drill")
        kinds = (CheckRecord, RecordingRecord, SyncRecord, OutcomeRecord)
        told = []
        async for record in records:
            if isinstance(record, kinds):
                told.append(record)
                if isinstance(record, OutcomeRecord):
                    break
        assert tuple(map(type, told)) == kinds and {record.source for record in told} == {"node:camera"}
        view = session.view
        assert (view.checks["lights"].result, view.checks["lights"].reason) == ("skipped", "daylight")
        assert (view.recordings["camera"].path, view.recordings["camera"].bytes) == ("/a.mkv", 2**40)
        assert view.sync is not None and (view.sync.number, view.sync.medium) == (3, "sound")
        assert view.outcome is not None and (view.outcome.status, view.outcome.reason) == ("aborted", "a fire drill")
        for asked in (
            observer.report_check("lights", "passed"),
            observer.report_recording("camera", "stopped"),
            observer.mark_sync(4, "flash"),
            observer.report_outcome("complete"),
        ):
            with pytest.raises(Rejected, match="an observer"):
                await asked
        async with connect(running.name, name="late") as late:
            assert late.view == session.view


async def test_a_stop_is_released_by_who_holds_control_and_by_programs_that_the_study_names(scratch: Path) -> None:
    scenario = scratch / "study"
    scenario.mkdir()
    (scenario / "scenario.toml").write_text('[control]\nmay_release = ["watchdog", "/lab/boss"]\n', "utf-8")
    async with (
        served(scratch, scenario) as running,
        connect(running.name, name="watchdog") as watchdog,
        connect(running.name, name="other") as other,
        connect(running.name, name="anna", role="wizard") as anna,
    ):
        for who in (watchdog, anna):
            await other.stop_all()
            await other.wait_until(lambda view: view.stop.status == "latched", PATIENCE)
            with pytest.raises(Rejected, match="only the wizard who holds control may, or watchdog, /lab/boss"):
                await other.release_stop()
            await who.release_stop()
            await other.wait_until(lambda view: not view.stop.latched, PATIENCE)


async def test_a_program_ends_a_session(scratch: Path) -> None:
    async with served(scratch) as running, connect(running.path, name="test") as session:
        running.engine.on_ended(lambda: tasks.append(asyncio.ensure_future(running.server.close())))
        tasks: list[asyncio.Future[None]] = []
        records = session.records()
        await session.end("the test is over")
        assert session.view.ended
        last = [record async for record in records][-1]
        assert isinstance(last, SessionRecord) and last.reason == "the test is over"
        with pytest.raises(EngineGone):
            await session.add_note("too late")
        await asyncio.gather(*tasks)


async def test_a_program_that_is_cut_off_is_told(scratch: Path) -> None:
    async with served(scratch) as running, connect(running.path, name="test", role="observer") as session:
        records = session.records()
        with pytest.raises(Rejected, match="cannot end"):
            await session.end()
        for connection in tuple(running.server.connections):
            connection.abort()
        with pytest.raises(LinkLost):
            await session.wait_until(lambda view: view.ended, PATIENCE)
        with pytest.raises(LinkLost):
            async for _ in records:
                pass
        with pytest.raises(LinkLost):
            await session.add_note("x")


async def test_no_such_session(scratch: Path) -> None:
    assert os.environ["RISE_RUNTIME"] == str(scratch / "run")
    with pytest.raises(EngineGone, match="no session study is running"):
        async with connect("study", name="test"):
            pass


def test_every_message_of_the_protocol_stands_in_the_reference_with_an_example() -> None:
    text = PAGES[1].read_text(encoding="utf-8")
    lines = [line for block in re.findall(r"```json\n(.*?)```", text, re.S) for line in block.splitlines()]
    for union, read in ((ClientMessage, decode_client_message), (ServerMessage, decode_server_message)):
        for message in get_args(union):
            kind = message.__struct_config__.tag
            found = [line for line in lines if line.startswith(f'{{"type":"{kind}"')]
            read_as = [each for line in found for each in [_read(read, line)] if isinstance(each, message)]
            assert read_as, f"{kind} has no example"
            assert f"- `{kind}`: " in text
            example = next(line for line in found if isinstance(_read(read, line), message))
            if union is ServerMessage:
                assert set(json.loads(example)) - {"type"} == set(message.__struct_fields__), kind


def _read(read: Callable[[bytes], object], line: str) -> object:
    try:
        return read(line.encode())
    except ValueError:
        return None

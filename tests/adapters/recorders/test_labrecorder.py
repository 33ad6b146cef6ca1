"""LabRecorder's remote control, with its traps: OK whatever happens, names in lower case, no word how it stands."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from rise_adapters.recorders import labrecorder
from rise_adapters.recorders.labrecorder import LabRecorder

from rise_engine.ports.recorder import RecorderError, RecordingPlan


class LabRecorderProgram:
    """LabRecorder for tests: what it does with each line that it gets."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.answer = b"OK"
        self.writes = True
        self.file: Path | None = None
        self._name = ""

    async def handle(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while line := await reader.readline():
                if not line.endswith(b"\n"):
                    break  # it does nothing without one
                self.take(line.decode().strip())
                if self.answer:
                    writer.write(self.answer)
        finally:
            writer.close()

    def take(self, line: str) -> None:
        self.lines.append(line)
        if found := re.fullmatch(r"filename \{root:([^}]*)\}\{template:([^}]*)\}", line):
            self._name = f"{found[1]}/{found[2].lower()}"  # as it does
        elif line == "start" and self.writes:
            self.file = Path(self._name)
            if self.file.exists():
                self.file.rename(self.file.with_name(f"{self.file.name}_old1"))
            self.file.write_bytes(b"XDF:")


@asynccontextmanager
async def lab(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[tuple[LabRecorderProgram, dict[str, Any]]]:
    monkeypatch.setattr(labrecorder, "UPDATE_SECONDS", 0.0)
    monkeypatch.setattr(labrecorder, "FILE_SECONDS", 0.2)
    program = LabRecorderProgram()
    server = await asyncio.start_server(program.handle, "127.0.0.1", 0)
    try:
        yield program, {"port": server.sockets[0].getsockname()[1]}
    finally:
        server.close()


def plan(folder: Path) -> RecordingPlan:
    return RecordingPlan("2026-11-22_141503_P07_Lab", folder, "P07")


async def test_it_looks_for_streams_gets_a_name_that_stays_and_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with lab(monkeypatch) as (program, options):
        recorder = LabRecorder("eeg", options)
        assert (await recorder.prepare(plan(tmp_path))).startswith("LabRecorder at 127.0.0.1:")
        path = tmp_path / "2026-11-22_141503_p07_lab_eeg.xdf"
        assert await recorder.start() == str(path) and path.exists()
        assert program.lines == ["update", f"filename {{root:{tmp_path}}}{{template:{path.name}}}", "start"]
        assert (await recorder.status()).bytes == 4
        assert await recorder.stop() == str(path) and program.lines[-1] == "stop"
        assert await recorder.stop() == ""


async def test_a_file_that_is_there_is_left_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with lab(monkeypatch) as (_, options):
        for name in ("2026-11-22_141503_p07_lab_eeg.xdf", "2026-11-22_141503_p07_lab_eeg_2.xdf"):
            recorder = LabRecorder("eeg", options)
            await recorder.prepare(plan(tmp_path))
            assert await recorder.start() == str(tmp_path / name)
        assert not list(tmp_path.glob("*_old*"))  # noqa: ASYNC240


async def test_ok_and_no_file_is_found_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with lab(monkeypatch) as (program, options):
        program.writes = False
        recorder = LabRecorder("eeg", options)
        await recorder.prepare(plan(tmp_path))
        with pytest.raises(RecorderError, match="LabRecorder said OK, and there is no"):
            await recorder.start()


async def test_one_that_is_silent_or_something_else_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with lab(monkeypatch) as (program, options):
        program.answer = b""
        monkeypatch.setattr(labrecorder, "ANSWER_SECONDS", 0.2)
        with pytest.raises(RecorderError, match=r"LabRecorder did not answer within 0.2 s \(update\)"):
            await LabRecorder("eeg", options).prepare(plan(tmp_path))
        program.answer = b"HTTP/1.1 400"
        with pytest.raises(RecorderError, match="is not LabRecorder: 'HT'"):
            await LabRecorder("eeg", options).prepare(plan(tmp_path))
    with pytest.raises(RecorderError, match=r"LabRecorder cannot be reached at 127.0.0.1:.*remote control on"):
        await LabRecorder("eeg", options).prepare(plan(tmp_path))


async def test_of_one_on_another_computer_only_its_answer_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with lab(monkeypatch) as (program, options):
        program.writes = False
        recorder = LabRecorder("eeg", {**options, "folder": "C:/data"})
        monkeypatch.setattr(LabRecorder, "_is_here", False)
        await recorder.prepare(plan(tmp_path))
        assert await recorder.start() == "C:/data/2026-11-22_141503_p07_lab_eeg.xdf"
        status = await recorder.status()
        assert status.recording and status.bytes is None
        assert await recorder.stop() == "C:/data/2026-11-22_141503_p07_lab_eeg.xdf"

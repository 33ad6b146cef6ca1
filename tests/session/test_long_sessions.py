"""Sessions of any length: what recovery, replay and export keep in memory does not grow with them.

Measured by what is alive, and by how far one part of the work waits for another; not by seconds.
"""

from __future__ import annotations

import io
import shlex
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from rise_engine.kernel import Kernel
from rise_engine.kernel.records import TaskRecord
from rise_engine.kernel.view import SessionView
from rise_engine.results.analysis.session_records import SessionRecords
from rise_engine.results.export.records import write_records
from rise_engine.run.client.replay import ReplayClient
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.spawn import EngineStarted, start_engine
from rise_engine.session import journal_reader
from rise_engine.session.journal_format import encode_record
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.recovery import recover
from rise_engine.session.replay import Replay, compare_replay
from tests.forked import run_engine

from .journals import Made


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """A session of some five thousand records: each event is one input and two records."""
    it = Made(tmp_path_factory.mktemp("long"))
    for _ in range(2_500):
        it.session.event("/nobody")
    it.write_session()
    return it


def peak(work: Callable[[], object]) -> int:
    """Bytes that were alive at most meanwhile, beyond what was there."""
    work()  # what is made once is there
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.slow
def test_the_journal_is_never_all_in_memory(made: Made) -> None:
    size = made.journal.stat().st_size
    assert size > 1_000_000
    records = sum(1 for _ in read_journal(made.journal).read_records())
    assert records == len(made.records) > 5_000
    assert peak(lambda: read_journal(made.journal)) < size / 4
    assert peak(lambda: compare_replay(made.folder)) < size / 4
    assert peak(lambda: write_records(SessionRecords(made.folder), "jsonl", Nowhere())) < size / 4


class Nowhere(io.BytesIO):
    def write(self, data: object) -> int:
        return 0


@pytest.mark.slow
def test_recovery_keeps_the_state_and_nothing_of_the_way_there(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rise_engine.kernel.view.MAX_ENDED_TASKS", 100)
    monkeypatch.setattr("rise_engine.kernel.view.FORGET_AT_ONCE", 10)
    found = recover(made.folder)
    assert found.inputs == len(made.session.steps)
    assert len(found.view.tasks) < 120 and found.view.forgotten > 2_300
    assert peak(lambda: recover(made.folder)) < made.journal.stat().st_size / 4


def test_a_view_forgets_the_oldest_that_have_ended_and_says_how_many(
    made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = SessionView()
    for record in made.records:
        whole.apply(record)
    monkeypatch.setattr("rise_engine.kernel.view.MAX_ENDED_TASKS", 50)
    monkeypatch.setattr("rise_engine.kernel.view.FORGET_AT_ONCE", 5)
    view, begun = SessionView(), 0
    for record in made.records:
        view.apply(record)
        begun = max(begun, record.id if isinstance(record, TaskRecord) else 0)
        assert len(view.tasks) + view.forgotten == begun, "none is counted twice, and none is lost"
    open = [id for id, task in whole.tasks.items() if task.ended is None]
    assert open and set(open) <= set(view.tasks), "what has not ended is kept"
    assert list(view.tasks)[len(open) :] == list(whole.tasks)[-len(view.tasks) + len(open) :]
    assert (view.memory, view.rules, view.running, view.waiting) == (
        *(whole.memory, whole.rules, whole.running, whole.waiting),
    )


def test_lines_that_stand_in_another_order_than_they_were_written_are_the_same(made: Made) -> None:
    """Inputs before the records of the one before: their numbers say what belongs together."""
    lines = made.whole.splitlines(keepends=True)
    steps = [n for n, line in enumerate(lines) if line.startswith(b'{"n":')]
    at, following = steps[100], steps[101]
    moved = [*lines[: at + 1], lines[following], *lines[at + 1 : following], *lines[following + 1 :]]
    made.write(b"".join(moved))
    try:
        assert compare_replay(made.folder).identical
    finally:
        made.write(made.whole)


def test_who_waits_is_told_how_far_it_is(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal_reader, "PROGRESS_SECONDS", 0.0)
    sentences: list[str] = []
    recover(made.folder, on_progress=sentences.append)
    size = made.journal.stat().st_size
    told = [int(each.removeprefix("reading the record: ").partition(" of ")[0]) for each in sentences]
    assert f"reading the record: 1 of {size / 1e6:,.0f} MB" in sentences
    assert len(told) >= 4 and told == sorted(told) and told[-1] <= round(size / 1e6)


def test_a_replay_gives_one_step_at_a_time(made: Made) -> None:
    steps = Replay(Kernel(made.scenario, 7), made.journal).steps()
    first = next(steps)
    assert first.n == 1 and [encode_record(record) for record in first.records] == [
        encode_record(record) for record in made.session.steps[0][1]
    ]
    steps.close()


async def test_a_console_that_watches_a_replay_has_no_more_than_it_has_seen(made: Made) -> None:
    client = ReplayClient(made.folder, speed=1e9)
    await client.attach()
    seen, most = 0, 0
    async for batch in client.records():
        seen += len(batch)
        most = max(most, len(batch))
    assert seen == len(made.records) and most <= 500


PROGRAM = """
import os, sys
from rise_engine.run.server.process import serve, report_to_pipe
from rise_engine.run.protocol.session_options import SessionOptions
import msgspec
from rise_engine.session import journal_reader
journal_reader.PROGRESS_SECONDS = 0.0
_, order, descriptor = sys.argv
sys.exit(serve(msgspec.json.decode(order, type=SessionOptions), report_to_pipe(int(descriptor))))
"""


def test_a_starter_waits_as_long_as_the_engine_works_and_is_told(
    made: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A process that says how far it is, then that it serves."""
    monkeypatch.setenv("RISE_SESSIONS", str(made.folder.parent))
    (tmp_path / "run").mkdir(0o700)
    monkeypatch.setenv("RISE_RUNTIME", str(tmp_path / "run"))
    program = tmp_path / "program.py"
    program.write_text(PROGRAM, "utf-8")
    python = sys.executable
    script = tmp_path / "python"
    script.write_text(f'#!/bin/sh\nexec {shlex.quote(python)} {shlex.quote(str(program))} "$3" "$4"\n')
    script.chmod(0o755)
    monkeypatch.setattr("sys.executable", str(script))
    sentences: list[str] = []
    found = start_engine(SessionOptions(str(made.study), unfinished=str(made.folder)), sentences.append)
    monkeypatch.setattr("sys.executable", python)
    assert isinstance(found, EngineStarted), found
    stopped = run_engine("stop", found.name)
    assert stopped.returncode == 0, stopped
    made.write(made.whole)
    assert any(each.startswith("recovering: reading the record: ") for each in sentences), sentences

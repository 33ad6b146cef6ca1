"""A recorded session, played again: as an account, and to a console."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from click.testing import CliRunner

from rise_engine.cli import main
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import AnyRecord
from rise_engine.kernel.view import SessionView
from rise_engine.run.client.replay import ReplayClient
from rise_engine.run.protocol.client import EngineGone
from rise_engine.session.journal_reader import read_journal
from tests.patience import PATIENCE

from .journals import Made


@pytest.fixture
def made(tmp_path: Path) -> Made:
    return Made(tmp_path, ended=True)


def test_it_is_told_where_there_is_no_terminal(made: Made) -> None:
    result = CliRunner().invoke(main, ["replay", str(made.folder), "--speed", "1000"])
    assert result.exit_code == 0
    assert "Sample study" in result.output and "Greet" in result.output and "ended" in result.output


@pytest.mark.parametrize("more", [["--json"], ["--scenario", "."]])
def test_played_is_not_compared(made: Made, more: list[str]) -> None:
    result = CliRunner().invoke(main, ["replay", str(made.folder), "--speed", "2", *more])
    assert result.exit_code == 2 and "--speed" in result.output


async def test_a_console_gets_every_record_at_its_time_and_can_change_nothing(made: Made) -> None:
    client = ReplayClient(made.folder, speed=200)
    hello = await client.attach()
    assert hello.replay and hello.mode == "debug" and hello.scenario.title == "Sample study"
    records: list[AnyRecord] = []
    async for batch in client.records():
        for record in batch:
            assert client.now() >= record.t  # type: ignore[union-attr]
            records.append(record)  # type: ignore[arg-type]
    written = [*read_journal(made.journal).read_records()]
    assert records == written
    view = SessionView()
    for record in records:
        view.apply(record)
    assert view.ended
    reply = await client.send(Submit(function="stopAll"))
    assert not reply.accepted and "replay" in reply.reason
    assert not (await client.change_control("take")).accepted


async def test_leaving_in_the_middle(made: Made) -> None:
    client = ReplayClient(made.folder, speed=0.01)
    await client.attach()
    first = await anext(client.records())
    assert first
    await client.close()
    assert [batch async for batch in client.records()] == []


async def test_what_cannot_be_read_is_said(tmp_path: Path) -> None:
    with pytest.raises(EngineGone, match="is not a session"):
        await asyncio.wait_for(ReplayClient(tmp_path).attach(), PATIENCE)

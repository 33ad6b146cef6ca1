"""Whatever the first wizard did and whenever the second one answers: nothing is told too early, and nothing is lost."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import AnyRecord, CueRecord, Record
from rise_engine.run.client.shadow import ShadowClient, _is_deed, _is_hidden
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.shadow import ShadowCue, ShadowKey, read_shadows
from tests.chance import examples
from tests.results.analysis.cues import ACT, Deed, cue_numbers, make_session
from tests.virtual_time import VirtualLoop

WHAT = st.sampled_from(
    [("cue", ""), ("cue", ""), ("act", "Praise"), ("act", "Hm"), ("event", "/next"), ("say", "Hello"), ("undo", "")]
)


@st.composite
def scripts(draw: st.DrawFn) -> list[Deed]:
    """A cue, and then anything, half seconds apart."""
    times = draw(st.lists(st.integers(2, 40), unique=True, max_size=12).map(sorted))
    deeds = [(1.0, "cue", ""), *((at * 0.5 + 0.5, *draw(WHAT)) for at in times)]
    is_open, kept = False, []
    for at, what, which in deeds:
        if what == "undo" and not is_open:
            continue  # it would be refused, and is then a deed like any other
        is_open = what == "cue" or (is_open and which == "Hm")
        kept.append((at, what, which))
    return kept


@pytest.mark.slow
@settings(max_examples=examples(25))
@given(scripts(), st.lists(st.integers(1, 90), unique=True, max_size=8).map(sorted))
def test_nothing_too_early_and_nothing_lost(deeds: list[Deed], presses: list[int]) -> None:
    """`presses`: when the second wizard presses the key of an act, in quarters of a second (and a little later)."""
    with tempfile.TemporaryDirectory() as root:
        folder = make_session(Path(root), deeds, seconds=25.0)
        loop = VirtualLoop()
        try:
            loop.run_until_complete(_judge(folder, [each / 4 + 0.11 for each in presses]))
        finally:
            loop.run_until_complete(loop.shutdown_default_executor())
            loop.close()


async def _judge(folder: Path, presses: list[float]) -> None:
    client = ShadowClient(folder, "ben")
    await client.attach()
    await client.toggle_pause()
    told: list[tuple[float, AnyRecord]] = []
    """When what was shown."""

    async def watch() -> None:
        async for batch in client.records():
            told.extend((client.now(), each) for each in batch if isinstance(each, Record))

    watching = asyncio.ensure_future(watch())
    for at in presses:
        while client.now() < at - 1e-6:  # noqa: ASYNC110  # time passes when nothing is left to do
            await asyncio.sleep(at - client.now())
        await client.send(Submit(function=ACT, behavior="Repeat", pressed=at))
    await watching
    await client.close()

    records = list(read_journal(folder / JOURNAL).read_records())
    seen = [each for _, each in told]
    assert seen == [each for each in records if not _is_hidden(each)]  # all of it, in order, and nothing else
    for at, each in told:
        assert at >= _may_be_told(each, records, presses) - 1e-6, each
    (found,), problems = read_shadows(folder)
    assert not problems and found.complete
    assert [each.cue for each in found.lines if isinstance(each, ShadowCue)] == cue_numbers(folder)
    answers = [each.cue for each in found.lines if isinstance(each, ShadowKey) and each.answers]
    assert len(answers) == len(set(answers))  # one answer to a cue


def _may_be_told(record: AnyRecord, records: Sequence[AnyRecord], presses: list[float]) -> float:
    """From when on: a deed of the first wizard not before the cue that it may be about was answered, or over."""
    turns = [each for each in records if isinstance(each, CueRecord) and each.status in ("marked", "undone")]
    before = [each for each in turns if each.seq < record.seq]
    if not _is_deed(record) or not before or before[-1].status == "undone":
        return record.t
    cue = before[-1]
    over = min((each.t for each in turns if each.seq > cue.seq), default=records[-1].t)
    answered = min((at for at in presses if at >= cue.t), default=over)
    return max(record.t, min(over, answered))

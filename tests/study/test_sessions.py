"""How a session was judged, read from its journal's end: every cut and every block."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.kernel.inputs import Note, OutcomeReport, SessionEnded, SessionStarted
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_format import encode_header, encode_input
from rise_engine.study import verdict as verdict_module
from rise_engine.study.verdict import read_verdict

INPUTS = (
    SessionStarted(),
    OutcomeReport(t=2.0, status="aborted", reason="no"),
    Note(t=3.0, text='a note about "input":"outcome" \\ and an end\n{'),
    OutcomeReport(t=4.0, status="complete", reason="yes"),
    Note(t=5.0, text="x" * 300),
    SessionEnded(t=6.0),
)
LINES = [encode_header("rise-tui test"), *(encode_input(number, each) for number, each in enumerate(INPUTS, 1))]


@pytest.mark.parametrize("block", [17, 40, 100, 1 << 20])
def test_the_last_whole_outcome_counts_wherever_the_journal_is_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    monkeypatch.setattr(verdict_module, "_BLOCK", block)
    whole = b"".join(LINES)
    ends = [len(b"".join(LINES[:number])) for number in range(1, len(LINES) + 1)]
    for cut in range(0, len(whole) + 1, 7):
        (tmp_path / JOURNAL).write_bytes(whole[:cut])
        known = [each for each, end in zip(INPUTS, ends[1:], strict=True) if end - 1 <= cut]  # its line end may be torn
        outcomes = [each for each in known if isinstance(each, OutcomeReport)]
        verdict = read_verdict(tmp_path)
        assert verdict.report == (outcomes[-1] if outcomes else None)
        assert verdict.seconds == (known[-1].t if known else 0.0)


def test_a_damaged_outcome_is_passed_over(tmp_path: Path) -> None:
    (tmp_path / JOURNAL).write_bytes(b"".join(LINES).replace(b'"complete"', b'"complets"'))
    assert read_verdict(tmp_path) == (INPUTS[1], 6.0)
    assert read_verdict(tmp_path / "nowhere") == (None, 0.0)

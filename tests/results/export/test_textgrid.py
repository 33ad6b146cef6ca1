"""TextGrids, read by praatio (which reports what is wrong as errors), and by Praat itself where it is installed."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from praatio import textgrid as praatio

from rise_engine.results.analysis.model import SessionData
from rise_engine.results.export.eaf import write_textgrid
from rise_engine.results.export.format import ExportContext
from rise_engine.results.export.media_clock import TierSet, lay_out, recording_clock
from rise_engine.results.export.spans import spans_of

from .made_sessions import HARD_TEXTS, act, phase, point, session, sessions, video

PRAAT = shutil.which("praat")
needs_praat = pytest.mark.skipif(PRAAT is None, reason="Praat is not installed (apt install praat)")
PRINT_INTERVALS = """form Print
  sentence File
endform
Read from file: file$
tiers = Get number of tiers
for tier to tiers
  name$ = Get tier name: tier
  appendInfoLine: "tier", tab$, name$
  intervals = Get number of intervals: tier
  for interval to intervals
    label$ = Get label of interval: tier, interval
    if label$ <> ""
      start = Get start time of interval: tier, interval
      end = Get end time of interval: tier, interval
      appendInfoLine: fixed$ (start, 3), tab$, fixed$ (end, 3), tab$, label$
    endif
  endfor
endfor
"""
Rows = dict[str, list[tuple[int, int, str]]]


def write(data: SessionData, folder: Path, context: ExportContext | None = None) -> Path:
    out = folder / "session.TextGrid"
    out.unlink(missing_ok=True)
    write_textgrid(out, [data], context or ExportContext("full"))
    return out


def told_by_praatio(file: Path) -> Rows:
    grid = praatio.openTextgrid(
        str(file), includeEmptyIntervals=False, reportingMode="error", duplicateNamesMode="error"
    )
    assert grid.validate(reportingMode="error")
    return {
        tier.name: [(round(start * 1000), round(end * 1000), label) for start, end, label in tier.entries]
        for tier in grid.tiers
    }


def run_praat(file: Path) -> tuple[int, Rows]:
    script = file.with_name("print.praat")
    script.write_text(PRINT_INTERVALS, "utf-8")
    assert PRAAT is not None
    done = subprocess.run([PRAAT, "--utf8", "--run", script, file], capture_output=True, encoding="utf-8", timeout=60)
    rows: Rows = {}
    for line in done.stdout.splitlines():
        first, _, rest = line.partition("\t")
        if first == "tier":
            rows[rest] = told = []
        else:
            end, _, label = rest.partition("\t")
            told.append((round(float(first) * 1000), round(float(end) * 1000), label))
    return done.returncode, rows


def expected(found: TierSet) -> Rows:
    return {tier.name: [(each.start, each.end, each.text) for each in tier.annotations] for tier in found.tiers}


def laid_out(data: SessionData) -> Rows:
    return expected(lay_out(spans_of(data), recording_clock(data, [], first="audio"), data.facts.duration))


def test_praatio_reads_every_interval_of_a_real_session(real: SessionData, tmp_path: Path) -> None:
    told = told_by_praatio(write(real, tmp_path))
    assert told == laid_out(real)
    assert sum(map(len, told.values())) > 50


@needs_praat
def test_praat_reads_every_interval_of_a_real_session(real: SessionData, tmp_path: Path) -> None:
    assert run_praat(write(real, tmp_path)) == (0, laid_out(real))


@given(data=sessions())
def test_praatio_reads_any_session_back(data: SessionData, tmp_path_factory: pytest.TempPathFactory) -> None:
    assert told_by_praatio(write(data, tmp_path_factory.getbasetemp())) == laid_out(data)


@needs_praat
def test_praat_reads_names_and_texts_of_any_characters(tmp_path: Path) -> None:
    runs = tuple(phase(place, place + 1, text, text) for place, text in enumerate(HARD_TEXTS))
    acts = tuple(act(place, place + 1, text) for place, text in enumerate(HARD_TEXTS))
    data = session(phases=runs, acts=acts)
    assert run_praat(write(data, tmp_path)) == (0, laid_out(data))


def test_times_are_those_of_the_sound_file_to_its_end(tmp_path: Path) -> None:
    sound = video("voice.wav", kind="audio", offset=-2.0, duration=75.5, fps=None)
    data = session(tmp_path, media=(video(offset=9.0), sound), points=(point(1.0), point(5.25)))
    file = write(data, tmp_path, context := ExportContext("full"))
    assert told_by_praatio(file) == {"note": [(3250, 3350, "hm")]}
    assert "xmax = 75.5\n" in file.read_text("utf-8")
    assert [each for each in context.warnings if "voice.wav, in which the session begins at -2.000 s" in each]
    assert [each for each in context.warnings if "1 annotation of what happened before is left out" in each]


def test_a_session_of_no_length_without_anything_opens(tmp_path: Path) -> None:
    file = write(session(facts={"duration": 0.0}), tmp_path)
    assert told_by_praatio(file) == {"robot speech": []}
    if PRAAT:
        assert run_praat(file) == (0, {"robot speech": []})


REFUSED_BY_PRAATIO: dict[str, Callable[[str], str]] = {
    "an interval into the next": lambda text: re.sub(
        r'xmax = [\d.]+(\n\s+text = "[^"])', r"xmax = 11.2\1", text, count=1
    ),
    "a tier twice": lambda text: text.replace('name = "robot gaze"', 'name = "robot speech"'),
}
REFUSED_BY_PRAAT: dict[str, Callable[[str], str]] = {
    "cut": lambda text: text[: text.index("item [2]:") + 100],
    "no time": lambda text: re.sub(r"xmin = [\d.]+(\n.*\n\s+text)", r"xmin = soon\1", text, count=1),
}


def broken_copy(change: Callable[[str], str], file: Path) -> Path:
    text = file.read_text("utf-8")
    changed = change(text)
    assert changed != text
    file.write_text(changed, "utf-8")
    return file


@pytest.mark.parametrize("what", REFUSED_BY_PRAATIO)
def test_broken_copies_are_refused_by_praatio(what: str, real: SessionData, tmp_path: Path) -> None:
    file = broken_copy(REFUSED_BY_PRAATIO[what], write(real, tmp_path))
    with pytest.raises(Exception):  # noqa: B017 - it raises what it stumbles over
        told_by_praatio(file)


@needs_praat
@pytest.mark.parametrize("what", REFUSED_BY_PRAAT)
def test_broken_copies_are_refused_by_praat(what: str, real: SessionData, tmp_path: Path) -> None:
    assert run_praat(broken_copy(REFUSED_BY_PRAAT[what], write(real, tmp_path)))[0] != 0

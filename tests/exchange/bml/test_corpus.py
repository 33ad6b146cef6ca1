"""BML found in the wild: whatever is in it, a block becomes an act or is refused with places and reasons.

RISE_BML_CORPUS names a folder of such files, one block each. Nothing of them is in this project.
"""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import pytest
from rise_exchange.bml.names import ConversionFindings
from rise_exchange.bml.reading import read_act
from rise_exchange.bml.writing import write_act

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import SourceFile, decode_text
from tests.exchange.bml.samples import NAMES, parts, read_text

CORPUS = os.environ.get("RISE_BML_CORPUS", "")


def test_blocks_in_the_wild(capsys: pytest.CaptureFixture[str]) -> None:
    if not CORPUS:
        pytest.skip("RISE_BML_CORPUS does not name a folder with files of BML")
    counted: Counter[str] = Counter()
    for path in sorted(Path(CORPUS).glob("*.xml")):
        data = path.read_bytes()
        text = decode_text(path.name, data, Diagnostics()) or data.decode("utf-8", "replace")
        findings = ConversionFindings()
        read = read_act(SourceFile(path.name, data, text), NAMES, findings)
        found = findings.diagnostics.sorted()
        assert (read is None) == bool(found), path
        lines = text.count("\n") + 1
        assert all(each.location.line <= lines for each in found), path
        if read is not None and read.act.actions:
            again = write_act(read.act, read.calling_type, {}, NAMES, ConversionFindings())
            assert parts(read_text(again).act) == parts(read.act), path
        kind = "an act" if read is not None else "+".join(sorted({each.code for each in found}))
        counted[kind + (", nothing lost" if read is not None and not findings.losses else "")] += 1
    with capsys.disabled():
        print(
            f"\n{sum(counted.values())} blocks:",
            *(f"\n  {number:>4}  {kind}" for kind, number in counted.most_common()),
        )
    assert counted

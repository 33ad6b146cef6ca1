"""Charts made into rules and played by the kernel."""

from __future__ import annotations

from pathlib import Path

from rise_exchange.scxml.rules_file import rules_text
from rise_exchange.scxml.rules_of_chart import MadeRules, rules_of_chart

from rise_engine.kernel.records import AnyRecord, MemoryRecord, RuleRecord
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.loader import load
from tests.kernel.harness import Session

EXPECTED_WARNINGS = {"unraised-event", "unheard-event"}
"""What a chart waits for from outside, and what it raises that nobody waits for, is no mistake of the conversion."""


def convert(
    text: str, name: str = "c.scxml", outside: tuple[str, ...] = ()
) -> tuple[MadeRules | None, list[Diagnostic]]:
    """The rules of a chart, or the findings."""
    diagnostics = Diagnostics()
    made = rules_of_chart(SourceFile(name, text.encode(), text), diagnostics, outside=outside)
    return made, diagnostics.sorted()


def converted(text: str, name: str = "c.scxml", outside: tuple[str, ...] = ()) -> MadeRules:
    made, findings = convert(text, name, outside)
    assert made is not None, "\n".join(map(str, findings))
    return made


def codes(text: str) -> set[str]:
    """The kinds of reasons for which a chart is refused."""
    made, findings = convert(text)
    assert made is None
    assert all(finding.severity == "error" for finding in findings)
    return {finding.code for finding in findings}


def session_of(made: MadeRules, folder: Path) -> Session:
    """A session of a study that has these rules and nothing else."""
    held = {"scenario.toml": b"", "rules/r.xml": rules_text(made, "c.scxml").encode(), "memory.json": b"{}"}
    loaded = load(folder, held={**held, "acts/a.xml": b"<Dialogs/>"})
    assert loaded.scenario is not None, "\n".join(map(str, loaded.errors))
    unexpected = [str(each) for each in loaded.diagnostics if each.code not in EXPECTED_WARNINGS]
    assert not unexpected, "\n".join(unexpected)
    return Session(loaded.scenario)


def end_of(text: str, folder: Path, name: str = "c.scxml", seconds: float = 5.0) -> str:
    """The final state in which a chart ends within some time; else where it stands."""
    made = converted(text, name)
    session = session_of(made, folder)
    session.rule(made.name)
    session.wait(seconds)
    ends = [
        r.state for r in session.records if isinstance(r, RuleRecord) and r.name == made.name and r.status == "ended"
    ]
    return ends[0] if ends else f"still in {session.states.get(made.name)}"


def assignments(records: list[AnyRecord], names: tuple[str, ...]) -> list[tuple[str, object]]:
    """What was assigned to these keys, in order."""
    return [
        (record.key, record.value) for record in records if isinstance(record, MemoryRecord) and record.key in names
    ]

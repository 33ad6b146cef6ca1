"""One session of a million records: its recovery and its export.

It has three hours with a hundred records a second, as with nodes that report observations: memory values and events,
between turns of a wizard and a robot. Recovery reads all records, computes them again and compares them, so its floor
is the kernel's time for the inputs alone. The floor of an export is a process that reads the lines. Each runs in a
separate process, whose CPU seconds and maximum memory are measured.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from exports import measured
from measure import Report

from rise_engine.session.journal_reader import read_journal
from tests.results.analysis.samples import act, play_session, task, write_scenario

RECORDS = 1_000_000
ROUND_S = 10.0
ROUND_RECORDS = 950
"""Approximate number in a round."""
NODE = "ros:/seer"
RECOVERY_S = 15.0
"""CPU seconds. A slow machine may miss them although the ratio below holds."""
TIMES_KERNEL = 6.0
"""Maximum ratio of the recovery's time to the kernel's."""
RECOVERY_MB, EXPORT_MB = 150.0, 300.0
FORMATS = ("jsonl", "tables", "eaf")
_READ = "import sys; from pathlib import Path\nfolder = Path(sys.argv[1])\n"
_FLOOR = (
    _READ
    + """
from time import process_time
from rise_engine.kernel import Kernel
from rise_engine.session.folder import read_info
from rise_engine.session.journal_format import InputLine
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.scenario_copies import load_session_scenario

info, contents = read_info(folder), read_journal(folder / "journal.jsonl")
inputs = [found.input for _, _, found in contents.lines() if isinstance(found, InputLine)]
kernel = Kernel(load_session_scenario(folder, info, []), info.seed)
began = process_time()
for each in inputs:
    kernel.handle(each)
print(process_time() - began)
"""
)
_READING = _READ + (
    "from rise_engine.session.journal_reader import read_journal\n"
    "print(sum(1 for _ in read_journal(folder / 'journal.jsonl').read_records()))"
)
_RECOVER = _READ + "from rise_engine.session.recovery import recover; recover(folder)"


WATCH = """  <InteractionRule name="Watch" initial="Idle">
    <State id="Idle"><transition eventTopic="/seen" cond="noise &gt; 10" target="Look"/></State>
    <State id="Look"><onEntry><function assignValue="visits = visits + 1"/></onEntry>
      <transition eventTopic="/seen" target="Idle"/></State>
  </InteractionRule>
</InteractionRules>"""


def play_long(folder: Path, records: int = RECORDS) -> Path:
    """The folder of a session of this many records whose engine has gone."""
    scenario = write_scenario(folder / "scenario")
    rules = scenario / "rules" / "all.xml"
    rules.write_text(rules.read_text("utf-8").replace("</InteractionRules>", WATCH), "utf-8")
    script: list[tuple[float, object]] = [
        (1.0, task("startInteractionRule", "Visit", pressed=0.9)),
        (1.0, task("startInteractionRule", "Watch", source=NODE)),
    ]
    rounds = records // ROUND_RECORDS
    for number in range(rounds):
        at = 5.0 + ROUND_S * number
        for value in range(300):
            script.append((at + value / 31, task("assignValue", f"noise = {value % 97}", source=NODE)))
            if value % 4 == 0:
                script.append((at + value / 31, task("raiseEventTopic", "/seen", source=NODE)))
        script += [
            (at + 1, task("markCue", pressed=at + 1)),
            act("Hm", at + 1.8),
            act("Answer", at + 2.5),
            act("Nod", at + 4.0),
        ]
    script.sort(key=lambda each: each[0])
    return play_session(folder / "sessions", script, scenario=scenario, until=5.0 + ROUND_S * rounds, ends=False)  # type: ignore[arg-type]


def kernel_seconds(session: Path) -> float:
    """CPU seconds of a fresh kernel for all inputs, in a separate process."""
    done = subprocess.run([sys.executable, "-c", _FLOOR, str(session)], capture_output=True, text=True, check=True)
    return float(done.stdout)


def main() -> bool:
    with tempfile.TemporaryDirectory() as name:
        session = play_long(Path(name))
        contents = read_journal(session / "journal.jsonl")
        report = Report(
            f"A session of {contents.records:,} records, {contents.size / 1e6:,.0f} MB", "CPU time and memory"
        )
        report.target("records", contents.records, RECORDS, at_least=True)
        kernel = kernel_seconds(session)
        report.row("floor: the kernel alone", f"{kernel:.1f} s")
        _, seconds, memory = measured([sys.executable, "-c", _READING, str(session)])
        report.row("floor: reading it", f"{seconds:.1f} s", f"{memory:.0f} MB")
        _, seconds, memory = measured([sys.executable, "-c", _RECOVER, str(session)])
        report.target("recovery: CPU seconds", seconds, RECOVERY_S, at_least=False)
        report.target("recovery: times the kernel alone", seconds / kernel, TIMES_KERNEL, at_least=False)
        report.target("recovery: megabytes", memory, RECOVERY_MB, at_least=False)
        for format in FORMATS:
            out = Path(name) / format
            command = (sys.executable, "-m", "rise_engine", "export", str(session), "--format", format, "-o", str(out))
            _, seconds, memory = measured(command)
            report.row(f"{format}", f"{seconds:.1f} s")
            report.target(f"{format}: megabytes", memory, EXPORT_MB, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())

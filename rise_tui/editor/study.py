"""A study's workspace for a screen, and the findings of exploring in it.

Work on the disk runs in a thread, one task after the other; exploring runs in a process of its own.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import NamedTuple, Protocol, TypeAlias, TypeVar

import msgspec
from msgspec import Struct

from rise_engine.author.edit.workspace import Workspace
from rise_engine.base.text import clean, pluralize
from rise_engine.scenario.diagnostics import Diagnostic, Severity
from rise_engine.scenario.model import SourceLocation
from rise_engine.syntax.xml_layout import line_start
from rise_tui.editor.model.draft import StudyDraft, draft_of
from rise_tui.editor.model.fields import NOTE_MARKS
from rise_tui.editor.model.study_rows import find_at
from rise_tui.rendering.text import ListRow, StyledLine, wrap


class ExploredPlace(Struct, frozen=True):
    """A finding of exploring (`rise-engine check --deep --json`)."""

    level: str
    text: str
    file: str = ""
    line: int = 0
    column: int = 1
    rule: str = ""
    state: str = ""
    act: str = ""
    key: str = ""
    way: tuple[str, ...] = ()
    """The path of a session to it, one sentence for each step."""

    @property
    def severity(self) -> Severity:
        return "error" if self.level == "problem" else "warning"


class ExploredStudy(Struct, frozen=True):
    """The result of exploring the saved files."""

    findings: tuple[ExploredPlace, ...] = ()
    """The findings, without remarks."""
    situations: int = 0
    complete: bool = True
    at: str = ""
    """The time of its start: `14:05`; empty: not explored yet."""
    files: Mapping[str, bytes] = {}
    """The files as they were saved then."""
    is_asked_again: bool = False
    """Whether the study is being explored again."""
    has_failed: bool = False
    """Whether the last exploration failed."""

    def is_of(self, draft: StudyDraft) -> bool:
        """Whether the result is about the files on the screen."""
        return self.files == draft.files

    def word(self, draft: StudyDraft) -> str:
        """The word before a finding: its source and, if it is outdated, its time."""
        return f"{'exploring again' if self.is_asked_again else 'explored'}{self._when(draft)}"

    def _when(self, draft: StudyDraft) -> str:
        return "" if self.is_of(draft) else f" (as saved at {self.at})"

    def about(self, kind: str, name: str, state: str = "") -> list[ExploredPlace]:
        """The findings of a page. For a rule, those about the state under the cursor come first."""
        match kind:
            case "rule":
                own = [finding for finding in self.findings if finding.rule == name]
                return sorted(own, key=lambda finding: (finding.state != state, finding.state != ""))
            case "act":
                return [finding for finding in self.findings if finding.act == name]
            case "keys":
                return [finding for finding in self.findings if finding.key]
            case _:
                return []

    def extent_text(self, draft: StudyDraft) -> str:
        """The extent and time of the exploration; empty: none."""
        if not self.at:
            return ""
        number = f"{self.situations:,} {'situation' if self.situations == 1 else 'situations'}"
        return f"explored {number}{'' if self.complete else ', not all'}{self._when(draft)}"

    def sentence(self, draft: StudyDraft) -> str:
        """The result in a sentence; empty: nothing was explored."""
        if self.has_failed:
            return "the saved study could not be explored: `rise-engine explore` says why"
        again = "; exploring again" if self.is_asked_again else ""
        return f"{self.extent_text(draft)}: {self._found}{again}" if self.at else ""

    @property
    def _found(self) -> str:
        problems = sum(finding.level == "problem" for finding in self.findings)
        warnings = len(self.findings) - problems
        found = [pluralize(problems, "problem")] if problems else []
        found += [pluralize(warnings, "warning")] if warnings else []
        return " and ".join(found) or "no problem found"


def read_explored(document: bytes, at: str) -> ExploredStudy | None:
    """The program's output as data; None: the study has errors, or could not be explored."""
    try:
        explored = msgspec.json.decode(document)["explored"]
        findings = msgspec.convert(explored["findings"], tuple[ExploredPlace, ...])
        shown = tuple(finding for finding in findings if finding.level != "remark")
        return ExploredStudy(shown, explored["situations"], explored["complete"], at)
    except (msgspec.DecodeError, msgspec.ValidationError, KeyError):
        return None


def explored_line(explored: ExploredStudy, draft: StudyDraft, findings: Sequence[ExploredPlace]) -> StyledLine:
    """The first of these findings; without one, the result of the exploration (muted if that is empty)."""
    if findings:
        mark, role = NOTE_MARKS[findings[0].severity]
        return ((f" {mark}{explored.word(draft)}: ", role), (clean(findings[0].text), role))
    sentence = explored.sentence(draft)
    if not sentence:
        return ()
    return ((f" {sentence}", "wait" if explored.findings else "muted"),)


def explored_rows(finding: ExploredPlace, width: int) -> list[ListRow]:
    """A finding in full: its sentence, and the path of a session to it, step by step."""
    _, role = NOTE_MARKS[finding.severity]
    rows = [ListRow("", ((f" {line}", role),), selectable=False) for line in wrap(finding.text, width - 2)]
    rows.append(ListRow("", (), selectable=False))
    rows.append(ListRow("", ((" HOW A SESSION GETS THERE", "accent"),), selectable=False))
    for number, step in enumerate(finding.way, 1):
        for at, line in enumerate(wrap(step, max(20, width - 6))):
            head = f" {number:>2}. " if at == 0 else "     "
            rows.append(ListRow("", ((head, "muted"), (line, "plain")), selectable=False))
    return rows


def find_explored(draft: StudyDraft, finding: ExploredPlace) -> tuple[str, str] | None:
    """The page for a finding: its kind and name. It is found by name, because lines move with each change."""
    outline = draft.outline
    if finding.rule and (finding.state or not finding.act):
        return ("rule", f"{finding.rule}\0{finding.state}") if outline.rule(finding.rule) is not None else None
    if finding.act:
        return ("act", finding.act) if outline.act(finding.act) is not None else None
    if finding.key:
        return "keys", ""
    return find_at(draft, finding.file, finding.line) if finding.file else None


def findings_in_rules(explored: ExploredStudy, draft: StudyDraft) -> list[Diagnostic]:
    """Findings in rules, as diagnostics at the present lines."""
    return [
        Diagnostic(finding.severity, "explored", f"{explored.word(draft)}: {finding.text}", place)
        for finding in explored.findings
        for place in _places(finding, draft, is_of=explored.is_of(draft))
    ]


def _places(finding: ExploredPlace, draft: StudyDraft, *, is_of: bool) -> Iterator[SourceLocation]:
    """The place of a finding about a state or a transition: none or one."""
    rule = draft.outline.rule(finding.rule) if finding.rule else None
    if rule is None or not finding.state:
        return
    if is_of and finding.file == rule.file:
        yield SourceLocation(finding.file, finding.line, finding.column)
        return
    for state in rule.states:
        if state.id == finding.state:
            start = state.node.start
            yield SourceLocation(rule.file, state.line, start - line_start(state.node.tree.text, start) + 1)
            return


QUIET_SECONDS = 3.0
"""Seconds between opening or saving and exploring: authors often continue immediately after saving."""
_NICENESS = 10
"""The process gets the processor time that the editor, and a session elsewhere, leave."""

Explorer: TypeAlias = Callable[[str], Awaitable[ExploredStudy | None]]
"""Explores the study in a folder; None: that was impossible."""


async def explore_saved(folder: str, *, after: float = QUIET_SECONDS) -> ExploredStudy | None:
    """Return the findings of `rise-engine check --deep` in a folder, after `after` seconds.

    The process ends with the task that waits for it. None: the study has errors, or the process has failed.
    """
    await asyncio.sleep(after)
    at = f"{datetime.now():%H:%M}"
    arguments = [sys.executable, "-m", "rise_engine", "check", folder, "--deep", "--json"]
    quiet = asyncio.subprocess.DEVNULL
    process = await asyncio.create_subprocess_exec(
        *arguments, stdin=quiet, stdout=asyncio.subprocess.PIPE, stderr=quiet
    )
    try:
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, process.pid, _NICENESS)
        printed, _ = await process.communicate()
    finally:
        if process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
    return read_explored(printed, at)


Result = TypeVar("Result")


class EditedStudy:
    """The content of pages (`draft`), and the workspace that changes it. Belongs to the loop that created it."""

    def __init__(self, workspace: Workspace, draft: StudyDraft) -> None:
        """`draft`: the result of `draft_of(workspace)`. That call blocks, so it also runs in a thread."""
        self.workspace, self.draft = workspace, draft
        self._turn = asyncio.Lock()
        self.busy = ""
        """The current work, in a word; empty: none."""

    async def do(self, busy: str, work: Callable[[Workspace], Result]) -> Result:
        """Let the workspace do something in a thread, after all earlier work, then renew the draft.

        :param busy: the work, in a word. :raises EditRefused: it cannot be done, and nothing has changed.
        """

        def work_and_draft() -> tuple[Result, StudyDraft]:
            result = work(self.workspace)
            return result, draft_of(self.workspace)

        async with self._turn:
            self.busy = busy
            try:
                result, self.draft = await asyncio.to_thread(work_and_draft)
            finally:
                self.busy = ""
        return result

    async def close(self) -> None:
        """Close the study. Unsaved changes stay as a draft."""
        async with self._turn:
            await asyncio.to_thread(self.workspace.close)


class RunningHere(NamedTuple):
    """A running session of the scenario that is being edited."""

    socket: str
    participant: str

    @property
    def sentence(self) -> str:
        """The sentence above the key hints."""
        who = f"a session with {self.participant}" if self.participant else "a session"
        return f"{who} runs on its own copy; what you save counts for the next one"


class SessionWatch(Protocol):
    """Finds such a session, and stops it. Both methods block."""

    def find(self, folder: Path) -> RunningHere | None:
        """The latest session of this scenario on this computer."""

    def stop(self, session: RunningHere) -> str:
        """Stop everything there. Returns the result as a sentence."""

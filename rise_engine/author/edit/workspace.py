"""A study open in an editor: its files with all unsaved changes."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias

from msgspec.structs import replace

from rise_engine.author.edit.drafts import Draft, DraftFile, EditorLock, hashes
from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.history import Change as Change
from rise_engine.author.edit.history import DiskChange as DiskChange
from rise_engine.author.edit.history import History, Step, changed_names
from rise_engine.author.edit.history import Refusal as Refusal
from rise_engine.author.edit.history import SaveReport as SaveReport
from rise_engine.author.edit.history import diff_of as diff_of
from rise_engine.author.edit.outline import Outline
from rise_engine.author.edit.plan import EditRefused, Files, apply_plan
from rise_engine.author.edit.planning import StudyState, plan
from rise_engine.author.edit.study_folder import (
    finish_interrupted,
    read_study_above,
    read_study_files,
    refuse_shipped,
    write_files,
)
from rise_engine.base.text import pluralize
from rise_engine.scenario.checker import ScenarioChecker
from rise_engine.scenario.checking.uses import Uses
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.files.tree import Held
from rise_engine.scenario.loader import LoadResult

StudyCheck: TypeAlias = Callable[[Path, Held], list[Diagnostic]]
"""A check that takes a study's folder and its files in the editor, and returns their diagnostics."""


SETTLE_SECONDS = 0.3
"""Seconds to wait for files that another program is writing: many programs empty a file and then fill it."""


class Workspace:
    """A study's folder, open for editing. It reads and writes the disk and blocks: do not use it in an event loop.

    >>> from tempfile import TemporaryDirectory
    >>> from rise_engine.author.edit.edits import SetStartValue
    >>> with TemporaryDirectory() as folder:
    ...     study = Workspace(Path(folder))
    ...     _ = Path(folder, "memory.json").write_text('{"score": 0}')
    ...     _ = study.read_disk_changes()
    ...     print(*study.apply(SetStartValue("score", 5)).says)
    ...     print(study.save().files)
    ...     study.close()
    score begins as 5 (was 0)
    ('memory.json',)
    """

    files: Files
    """The present files, with all changes."""
    saved: Files
    """The files as last read from or written to the disk."""

    def __init__(self, folder: Path, *, robot: str | None = None, also_check: StudyCheck | None = None) -> None:
        """:param folder: the study's folder, or a scenario.toml in it.
        :param robot: the name of a profile to use instead of the study's.
        :param also_check: checks the files for a study with participants, which this module does not read.
        :raises EditRefused: it is not a folder, cannot be read, or is a study that comes with the program.
        """
        path = Path(os.path.abspath(folder))  # noqa: PTH100  # keeps symbolic links
        self.folder = path.parent if path.suffix == ".toml" else path
        if not self.folder.is_dir():
            raise EditRefused(f"{self.folder}: there is no such folder")
        refuse_shipped(self.folder)
        self._lock = EditorLock(self.folder)
        try:
            self.finished = finish_interrupted(self.folder) if not self.read_only else ()
            """Files of an earlier save that was killed and is now complete."""
            self.files = self.saved = read_study_files(self.folder)
            self.above = read_study_above(self.folder)
            """The study.toml of a folder above, by its path. It is read and not edited here."""
        except BaseException:
            self._lock.release()
            raise
        self._checker, self._also_check = ScenarioChecker(self.folder, robot), also_check
        self._history = History()
        self._draft = DraftFile(self.folder)
        self._is_draft_open = not self._lock.holder and self._draft.read() is not None
        """Whether an earlier editor's draft was neither taken up nor discarded yet."""
        self._state: StudyState | None = None

    @property
    def read_only(self) -> str:
        """Why saving is not possible, as a sentence; empty: it is."""
        if self._lock.holder:
            return f"{self._lock.holder}, has this study open; here you can only look"
        if not os.access(self.folder, os.W_OK):
            return "you may not write into this folder; work on a copy of it"
        return ""

    # --- the state ------------------------------------------------------------------------------------------------

    @property
    def state(self) -> StudyState:
        """The state for planning an edit."""
        if self._state is None or self._state.files is not self.files:
            self._state = self._state_of(self.files)
        return self._state

    @property
    def checked(self) -> LoadResult:
        """The check of the present `files`; `scenario` is None if there is an error."""
        return self.state.checked

    @property
    def outline(self) -> Outline:
        return self.state.outline

    @property
    def uses(self) -> Uses:
        return self.checked.uses

    @property
    def changes(self) -> Sequence[Change]:
        """The unsaved changes in order; first those that were saved and then undone."""
        back, made = self._history.unsaved
        taken = [Change((), tuple(f"taken back: {sentence}" for sentence in step.change.says)) for step in back]
        return [*taken, *(step.change for step in made)]

    def _state_of(self, files: Files) -> StudyState:
        held = {**dict.fromkeys(self.saved.keys() - files.keys()), **files}
        checked = self._checker.check(held)
        if self._also_check is not None and (more := self._also_check(self.folder, held)):
            checked = replace(checked, diagnostics=[*checked.diagnostics, *more])
        return StudyState(files, checked, self.folder, self.above)

    # --- changing -------------------------------------------------------------------------------------------------

    def preview(self, *edits: AnyEdit) -> LoadResult:
        """Check the result of edits without making them. :raises EditRefused: an edit cannot be made."""
        return self._plan(edits)[0].checked

    def preview_edits(self, *edits: AnyEdit) -> tuple[StudyState, Change, tuple[Refusal, ...]]:
        """Compute the effect of edits without making them; impossible ones are omitted, with their reasons."""
        now = self.files, self._state
        says: list[str] = []
        noticed: list[str] = []
        made: list[AnyEdit] = []
        refused: list[Refusal] = []
        state = self.state
        try:
            for number, edit in enumerate(edits):
                try:
                    state, change = self._plan((edit,))
                except EditRefused as why:
                    refused.append(Refusal(number, str(why)))
                    continue
                self.files, self._state = state.files, state
                made.append(edit)
                says += change.says
                noticed += change.noticed
        finally:
            self.files, self._state = now
        return state, Change(tuple(made), tuple(says), tuple(noticed)), tuple(refused)

    def apply(self, *edits: AnyEdit) -> Change:
        """Make edits as one step. :raises EditRefused: one cannot be made; then none is."""
        after, change = self._plan(edits)
        if changed_names(self.files, after.files):
            self._add_step(change, after.files)
            self._state = after
            self._keep_draft()
        return change

    def _add_step(self, change: Change, after: Files) -> None:
        self._history.add(Step(change, self.files, after))
        self.files = after

    def _plan(self, edits: Sequence[AnyEdit]) -> tuple[StudyState, Change]:
        """Compute the effect of edits, with its description."""
        state = self.state
        says: list[str] = []
        noticed: list[str] = []
        for edit in edits:
            planned = plan(edit, state)
            after = self._state_of(apply_plan(state.files, planned))
            says += planned.says
            noticed += planned.noticed
            state = after
        return state, Change(tuple(edits), tuple(says), tuple(noticed))

    def undo(self) -> Change | None:
        """Undo the last step, also across a save, and return its change. None: there is none."""
        step = self._history.undo()
        return None if step is None else self._go_to(step, step.before)

    def redo(self) -> Change | None:
        """Redo the step that was undone last. None: there is none."""
        step = self._history.redo()
        return None if step is None else self._go_to(step, step.after)

    def _go_to(self, step: Step, files: Files) -> Change:
        self.files = files
        self._keep_draft()
        return step.change

    def diff(self) -> str:
        """Return the effect of saving, like `diff -u`."""
        return diff_of(self.saved, self.files)

    # --- changes from outside -------------------------------------------------------------------------------------

    def read_disk_changes(self, *, settled: bool = False) -> DiskChange | None:
        """Read the files that have changed on the disk. None: there are none.

        A file with unsaved changes keeps its content from here. It is listed in `clash`; `take_disk_changes` takes the
        content of the disk.

        :param settled: leave changes to the next call while another program is writing. Takes SETTLE_SECONDS then.
        :raises EditRefused: the folder cannot be read.
        """
        if self._lock.holder:
            self._take_over()
        now, above = read_study_files(self.folder), read_study_above(self.folder)
        if settled and changed_names(self.saved, now):
            time.sleep(SETTLE_SECONDS)  # in the thread that works on the disk
            if read_study_files(self.folder) != now:
                return None
        if above != self.above:
            self.above, self._state = above, None
        changed = changed_names(self.saved, now)
        if not changed:
            return None
        own = changed_names(self.saved, self.files)
        files = _with_files(now, own, self.files)
        forgotten = bool(changed & self._history.touched())
        if forgotten:  # an undo would restore files from before the outside change
            changes = self.changes
            says = tuple(sentence for change in changes for sentence in change.says)
            edits = tuple(edit for change in changes for edit in change.edits)
            self._history.begin_anew([Step(Change(edits, says), now, files)] if own else [])
        else:
            self._history.take_over_disk({name: now.get(name) for name in changed})
        self.files, self.saved = files, now
        self._keep_draft()
        clash = tuple(sorted(name for name in changed & own if files.get(name) != now.get(name)))
        return DiskChange(tuple(sorted(changed)), clash, forgotten)

    def take_disk_changes(self, names: Collection[str]) -> Change:
        """Take files from the disk as a step, so that undo restores the own changes."""
        change = Change((), tuple(f"{name} is as it is on the disk" for name in sorted(names)))
        self._add_step(change, _with_files(self.files, names, self.saved))
        self._keep_draft()
        return change

    def _take_over(self) -> None:
        """Take the lock if the other editor has ended."""
        self._lock.try_again()
        if not self._lock.holder:
            self.finished = finish_interrupted(self.folder)
            self._is_draft_open = self._draft.read() is not None

    # --- the disk -------------------------------------------------------------------------------------------------

    def save(self) -> SaveReport:
        """Write all changed files or none.

        :raises EditRefused: there is an error, the disk cannot be written, or files have changed outside (call
            `read_disk_changes` first).
        """
        if not changed_names(self.saved, self.files):
            return SaveReport(())
        if self.read_only:
            raise EditRefused(self.read_only)
        if errors := self.checked.errors:
            more = f", and {pluralize(len(errors) - 1, 'more error')}" if len(errors) > 1 else ""
            raise EditRefused(
                f"nothing is saved while there is an error: {errors[0].location} {errors[0].message}{more}"
            )
        written = write_files(self.folder, self.saved, self.files)
        self.saved = self.files
        self._history.mark_saved()
        self._keep_draft()
        return SaveReport(written)

    def _keep_draft(self) -> None:
        """Store the draft; a failure does not prevent editing."""
        if self._lock.holder:
            return
        changed = {name: self.files.get(name) for name in sorted(changed_names(self.saved, self.files))}
        says = tuple(sentence for change in self.changes for sentence in change.says)
        with suppress(OSError):
            if self._is_draft_open and changed:
                self._draft.put_aside()
                self._is_draft_open = False
            if not self._is_draft_open:
                self._draft.keep(self.saved, changed, says)

    @property
    def draft(self) -> Draft | None:
        """The unsaved work of an earlier editor; None: there is none. Read it before the first change.

        Later, this is the own draft, and the earlier one is offered when the study is opened next.
        """
        return None if self._lock.holder else self._draft.read()

    def take_up_draft(self, draft: Draft) -> DiskChange:
        """Take the files of a draft as one step. A file that has since changed on the disk is in `clash`."""
        base = hashes(self.saved)
        changed = {name for name in base.keys() | draft.base.keys() if base.get(name) != draft.base.get(name)}
        self._forget_open_draft()
        wanted = _with_files(self.files, draft.files, draft.files)
        clash = tuple(sorted(name for name in changed & draft.files.keys() if wanted.get(name) != self.files.get(name)))
        if changed_names(self.files, wanted):
            self._add_step(Change((), draft.says), wanted)
        self._keep_draft()
        return DiskChange(tuple(sorted(changed)), clash)

    def discard_draft(self) -> None:
        """Delete the unsaved work of an earlier editor."""
        self._forget_open_draft()

    def _forget_open_draft(self) -> None:
        if not self._lock.holder:
            with suppress(OSError):
                self._draft.forget()
            self._is_draft_open = False

    def close(self) -> None:
        """Release the lock; a draft with unsaved changes stays for the next time."""
        self._lock.release()


def _with_files(files: Files, names: Collection[str], source: Mapping[str, bytes | None]) -> Files:
    """Replace some files by those in `source`; files that it lacks are removed."""
    taken = {name: data for name in names if (data := source.get(name)) is not None}
    return {**{name: data for name, data in files.items() if name not in names}, **taken}

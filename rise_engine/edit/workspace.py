"""A study in the hands of an editor: its files with all that was changed and not yet saved."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from msgspec import Struct

from rise_engine.edit.drafts import Draft, DraftChange, DraftFile, EditorLock, hashes
from rise_engine.edit.edits import (
    AddAct,
    AddAction,
    AddBranch,
    AddRow,
    AddRule,
    AddState,
    AddStatement,
    AddTransition,
    AddVariant,
    AnyEdit,
    CopyAct,
    CopyRule,
    Rename,
)
from rise_engine.edit.guard import check_guard
from rise_engine.edit.history import History, Step, changed_names
from rise_engine.edit.outline import Outline
from rise_engine.edit.plan import EditRefused, Files, Plan, apply_plan
from rise_engine.edit.planning import StudyState, plan
from rise_engine.edit.read_outline import read_outline
from rise_engine.edit.saving import finish_interrupted, refuse_shipped, write_files
from rise_engine.edit.study_folder import part_paths, read_study_files
from rise_engine.scenario import LoadResult
from rise_engine.scenario.checker import ScenarioChecker
from rise_engine.scenario.uses import Uses
from rise_engine.text import pluralize

_ADDING = (
    AddAct, AddAction, AddBranch, AddRow, AddRule, AddState, AddStatement, AddTransition, AddVariant, CopyAct, CopyRule
)  # fmt: skip
_LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+")


class Change(Struct, frozen=True):
    """One step that can be undone: an edit, or several that belong together."""

    edits: tuple[AnyEdit, ...]
    says: tuple[str, ...]
    """What it does, in words."""
    noticed: tuple[str, ...] = ()


class OutsideChange(Struct, frozen=True):
    """What somebody else has done to the files meanwhile."""

    files: tuple[str, ...]
    """Those that differ."""
    lost: tuple[Change, ...] = ()
    """Own changes that cannot be made any more on what the files are now."""
    forgotten: bool = False
    """Whether steps from before can no longer be taken back."""


class Refusal(Struct, frozen=True):
    """An edit that cannot be made."""

    edit: int
    """Which one, from 0."""
    why: str


class SaveReport(Struct, frozen=True):
    files: tuple[str, ...]
    """What was written, made or deleted; empty: nothing was to be saved."""


class Workspace:
    """A study's folder, opened for editing. Reads and writes the disk; blocks, not for a loop.

    >>> from tempfile import TemporaryDirectory
    >>> from rise_engine.edit.edits import SetStartValue
    >>> with TemporaryDirectory() as folder:
    ...     study = Workspace(Path(folder))
    ...     _ = Path(folder, "memory.json").write_text('{"score": 0}')
    ...     _ = study.notice_outside()
    ...     print(*study.apply(SetStartValue("score", 5)).says)
    ...     print(study.save().files)
    ...     study.close()
    score begins as 5 (was 0)
    ('memory.json',)
    """

    files: Files
    """As they are now, with all changes."""
    saved: Files
    """As they were last read from the disk or written to it."""

    def __init__(self, folder: Path, *, robot: str | None = None) -> None:
        """
        :param folder: the study's, or a scenario.toml in it.
        :param robot: the name of a profile, instead of the one that the study names.
        :raises EditRefused: it is no folder, cannot be read, or a study that comes with the program.
        """
        path = Path(os.path.abspath(folder))  # noqa: PTH100  # keeps symbolic links
        self.folder = path.parent if path.suffix == ".toml" else path
        if not self.folder.is_dir():
            raise EditRefused(f"{self.folder}: there is no such folder")
        refuse_shipped(self.folder)
        self._lock = EditorLock(self.folder)
        try:
            self.finished = finish_interrupted(self.folder) if not self.read_only else ()
            """Files of an earlier save that was killed, and has come to its end now."""
            self.files = self.saved = read_study_files(self.folder)
        except BaseException:
            self._lock.release()
            raise
        self._checker = ScenarioChecker(self.folder, robot)
        self._history = History()
        self._draft = DraftFile(self.folder)
        self._is_draft_open = not self._lock.holder and self._draft.read() is not None
        """Whether what an earlier editor has left was neither taken up nor given up yet."""
        self.set_aside: tuple[Change, ...] = ()
        """Own changes that somebody else's stand in the way of. `apply(*change.edits)` makes one all the same;
        `forget_set_aside` gives them up. Until then they are in the draft."""
        self._state: StudyState | None = None

    @property
    def read_only(self) -> str:
        """Why nothing can be saved here, as a sentence; empty: it can."""
        if self._lock.holder:
            return f"{self._lock.holder}, has this study open; here you can only look"
        if not os.access(self.folder, os.W_OK):
            return "you may not write into this folder; work on a copy of it"
        return ""

    # --- what is there --------------------------------------------------------------------------------------------

    @property
    def state(self) -> StudyState:
        """What an edit is planned on."""
        if self._state is None or self._state.files is not self.files:
            self._state = self._state_of(self.files)
        return self._state

    @property
    def checked(self) -> LoadResult:
        """The check of `files`, as they are now; `scenario` is None while there is an error."""
        return self.state.checked

    @property
    def outline(self) -> Outline:
        return self.state.outline

    @property
    def uses(self) -> Uses:
        return self.checked.uses

    @property
    def changes(self) -> Sequence[Change]:
        """What is not saved yet, in order; what was saved and then taken back says so."""
        back, made = self._history.unsaved
        taken = [Change((), tuple(f"taken back: {sentence}" for sentence in _change(step).says)) for step in back]
        return [*taken, *map(_change, made)]

    def _state_of(self, files: Files) -> StudyState:
        gone = dict.fromkeys(self.saved.keys() - files.keys())
        return StudyState(
            files, read_outline(files, part_paths(files)), self._checker.check({**gone, **files}), self.folder
        )

    # --- changing -------------------------------------------------------------------------------------------------

    def preview(self, *edits: AnyEdit) -> LoadResult:
        """The check of what the files would be, changing nothing. :raises EditRefused: one cannot be made."""
        return self._plan(edits)[0].checked

    def foresee(self, *edits: AnyEdit) -> tuple[StudyState, Change, tuple[Refusal, ...]]:
        """What edits would come to, changing nothing; those that cannot be made are left out, and say why."""
        now = self.files, self._state
        says: list[str] = []
        noticed: list[str] = []
        refused: list[Refusal] = []
        state = self.state
        try:
            for number, edit in enumerate(edits):
                try:
                    state, change, _ = self._plan((edit,))
                except EditRefused as why:
                    refused.append(Refusal(number, str(why)))
                    continue
                self.files, self._state = state.files, state
                says += change.says
                noticed += change.noticed
        finally:
            self.files, self._state = now
        made = tuple(edit for number, edit in enumerate(edits) if number not in {each.edit for each in refused})
        return state, Change(made, tuple(says), tuple(noticed)), tuple(refused)

    def apply(self, *edits: AnyEdit) -> Change:
        """Make edits as one step. :raises EditRefused: one cannot be made; then none is."""
        after, change, replaced = self._plan(edits)
        self.set_aside = tuple(each for each in self.set_aside if each.edits != change.edits)
        if changed_names(self.files, after.files):
            self._history.add(Step(change, self.files, after.files, replaced))
            self.files, self._state = after.files, after
            self._keep_draft()
        return change

    def forget_set_aside(self) -> None:
        """Give up the changes that were set aside."""
        self.set_aside = ()
        self._keep_draft()

    def _plan(self, edits: Sequence[AnyEdit]) -> tuple[StudyState, Change, tuple[bytes, ...]]:
        """What edits come to, in words too, and what each of them takes away."""
        state = self.state
        says: list[str] = []
        noticed: list[str] = []
        replaced: list[bytes] = []
        for edit in edits:
            planned = plan(edit, state)
            replaced.append(replaced_by(edit, planned, state.files))
            after = self._state_of(apply_plan(state.files, planned))
            check_guard([edit], state, after)
            says += planned.says
            noticed += planned.noticed
            state = after
        return state, Change(tuple(edits), tuple(says), tuple(noticed)), tuple(replaced)

    def undo(self) -> Change | None:
        """Take the last step back, also over a save; gives it. None: there is none."""
        step = self._history.undo()
        return None if step is None else self._go_to(step, step.before)

    def redo(self) -> Change | None:
        """Make the step again that was taken back last. None: there is none."""
        step = self._history.redo()
        return None if step is None else self._go_to(step, step.after)

    def _go_to(self, step: Step, files: Files) -> Change:
        self.files = files
        self._keep_draft()
        return _change(step)

    def diff(self) -> str:
        """What saving would change, as `diff -u` has it."""
        return diff_of(self.saved, self.files)

    # --- what others do -------------------------------------------------------------------------------------------

    def notice_outside(self) -> OutsideChange | None:
        """Look at the disk: take in what was changed there, and make own changes again on it. None: nothing was.

        :raises EditRefused: the folder cannot be read.
        """
        if self._lock.holder:
            self._take_over()
        now = read_study_files(self.folder)
        outside = changed_names(self.saved, now)
        if not outside:
            return None
        renames = any(isinstance(edit, Rename) for change in self.changes for edit in change.edits)
        if not renames and not outside & self._history.touched():
            changed = {name: now.get(name) for name in outside}
            self._history.lay_under(changed)
            merged = {**self.files, **{name: data for name, data in changed.items() if data is not None}}
            self.files = {name: data for name, data in merged.items() if changed.get(name, b"") is not None}
            self.saved = now
            self._keep_draft()
            return OutsideChange(tuple(sorted(outside)))
        back, made = self._history.unsaved
        self.files = self.saved = now
        steps, lost = self._make_again(back, made)
        forgotten = len(self._history.done) > len(made) or bool(self._history.undone)
        self._history.begin_anew(steps)
        self.set_aside += tuple(lost)
        self._keep_draft()
        return OutsideChange(tuple(sorted(outside)), tuple(lost), forgotten)

    def _take_over(self) -> None:
        """Whoever had the study open may have ended."""
        self._lock.try_again()
        if not self._lock.holder:
            self.finished = finish_interrupted(self.folder)
            self._is_draft_open = self._draft.read() is not None

    def _make_again(self, back: list[Step], made: list[Step]) -> tuple[list[Step], list[Change]]:
        """Own steps on what the files are now; what cannot be made any more."""
        steps: list[Step] = []
        lost: list[Change] = []
        for step in back:  # a saved step taken back has no edits: it is made where its files are as it left them
            if all(self.files.get(name) == step.after.get(name) for name in step.files):
                files = {**self.files, **{name: step.before[name] for name in step.files & step.before.keys()}}
                files = {name: data for name, data in files.items() if name not in step.files - step.before.keys()}
                says = tuple(f"taken back: {sentence}" for sentence in _change(step).says)
                steps.append(Step(Change((), says), self.files, files))
                self.files = files
            else:
                lost.append(_change(step))
        for step in made:
            again = self._step_again(_change(step), step.replaced) if _change(step).edits else None
            if again is None:
                lost.append(_change(step))
            elif again.files:
                steps.append(again)
                self.files = again.after
        return steps, lost

    def _step_again(self, change: Change, replaced: tuple[bytes, ...]) -> Step | None:
        """An own step on what the files are now; None: it cannot be made, or somebody else has changed the same."""
        try:
            after, again, now_replaced = self._plan(change.edits)
        except EditRefused:
            return None
        if changed_names(self.files, after.files) and replaced and now_replaced != replaced:
            return None
        return Step(again, self.files, after.files, now_replaced)

    # --- the disk -------------------------------------------------------------------------------------------------

    def save(self) -> SaveReport:
        """Write all changed files or none.

        :raises EditRefused: there is an error, the disk cannot be written, or files have changed outside (call
            `notice_outside` first).
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
        """A draft that cannot be kept is no reason not to edit."""
        if self._lock.holder:
            return
        changed = {name: self.files.get(name) for name in sorted(changed_names(self.saved, self.files))}
        back, made = self._history.unsaved
        changes = [DraftChange(each.edits, each.says) for each in self.changes[: len(back)]]
        for step in made:
            change = _change(step)
            changes.append(DraftChange(change.edits, change.says, change.noticed, step.replaced))
        aside = tuple(DraftChange(each.edits, each.says, each.noticed) for each in self.set_aside)
        with suppress(OSError):
            if self._is_draft_open and (changed or aside):
                self._draft.put_aside()
                self._is_draft_open = False
            if not self._is_draft_open:
                self._draft.keep(self.saved, changed, tuple(changes), aside)

    @property
    def draft(self) -> Draft | None:
        """What an earlier editor has not saved; None: nothing. To be asked before the first change: after it, this is
        the own draft, and the earlier one is offered when the study is opened next."""
        return None if self._lock.holder else self._draft.read()

    def take_up_draft(self, draft: Draft) -> OutsideChange:
        """Make the changes of a draft again, as steps; what can no longer be made is in `lost`."""
        base = hashes(self.saved)
        changed = tuple(
            sorted(name for name in base.keys() | draft.base.keys() if base.get(name) != draft.base.get(name))
        )
        self._forget_open_draft()
        lost: list[Change] = []
        for kept in draft.changes:
            change = Change(kept.edits, kept.says, kept.noticed)
            step = self._step_again(change, kept.replaced) if kept.edits else None
            if step is None:
                lost.append(change)
            elif step.files:
                self._history.add(step)
                self.files = step.after
        if not changed:  # also steps that were taken back over a save, which have no edits
            wanted = {**self.saved, **{name: data for name, data in draft.files.items() if data is not None}}
            wanted = {name: data for name, data in wanted.items() if draft.files.get(name, b"") is not None}
            if changed_names(self.files, wanted):
                says = tuple(sentence for kept in draft.changes for sentence in kept.says)
                self._history.add(Step(Change((), says), self.files, wanted))
                self.files = wanted
            lost = []
        self.set_aside += (*lost, *(Change(kept.edits, kept.says, kept.noticed) for kept in draft.set_aside))
        self._keep_draft()
        return OutsideChange(changed, self.set_aside)

    def discard_draft(self) -> None:
        """Forget what an earlier editor has not saved."""
        self._forget_open_draft()

    def _forget_open_draft(self) -> None:
        if not self._lock.holder:
            with suppress(OSError):
                self._draft.forget()
            self._is_draft_open = False

    def close(self) -> None:
        """Give up the lock; a draft with unsaved changes stays for the next time."""
        self._lock.release()


def _change(step: Step) -> Change:
    assert isinstance(step.change, Change)
    return step.change


def diff_of(before: Files, after: Files) -> str:
    """The lines that differ between two states of files, as `diff -u` has them; CR alone ends a line too."""
    pieces: list[str] = []
    for name in sorted(changed_names(before, after)):
        old, new = (side.get(name) for side in (before, after))
        one, other = (_LINE.findall((data or b"").decode("utf-8", "replace")) for data in (old, new))
        from_name = f"a/{name}" if old is not None else "/dev/null"
        to_name = f"b/{name}" if new is not None else "/dev/null"
        for line in difflib.unified_diff(one, other, from_name, to_name):
            if line.endswith("\r"):
                line = f"{line[:-1]}\n"
            pieces.append(line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n")
    return "".join(pieces)


def replaced_by(edit: AnyEdit, planned: Plan, files: Files) -> bytes:
    """What a plan takes away, as a sum; the same for the same, wherever it stands. Of what only adds: nothing.

    An edit that is made again on files that somebody else has changed, and then takes away something else than it did
    before, would overwrite what they wrote.
    """
    if isinstance(edit, _ADDING):
        return b""
    gone = {files[each.file][each.start : each.end] for each in planned.splices}
    gone |= {files.get(name) or b"" for name in planned.written}
    total = sha256()
    for piece in sorted(gone):
        total.update(b"%d:" % len(piece) + piece)
    return total.digest()[:8]

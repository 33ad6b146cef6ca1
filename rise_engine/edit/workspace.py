"""A study in the hands of an editor: its files with all that was changed and not yet saved."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias

from msgspec.structs import replace

from rise_engine.edit.changes import Change as Change
from rise_engine.edit.changes import OutsideChange as OutsideChange
from rise_engine.edit.changes import Refusal as Refusal
from rise_engine.edit.changes import SaveReport as SaveReport
from rise_engine.edit.changes import diff_of as diff_of
from rise_engine.edit.changes import replaced_by, taken_back
from rise_engine.edit.drafts import Draft, DraftChange, DraftFile, EditorLock, hashes
from rise_engine.edit.edits import AnyEdit, Rename
from rise_engine.edit.guard import check_guard
from rise_engine.edit.history import History, Step, changed_names
from rise_engine.edit.outline import Outline
from rise_engine.edit.plan import EditRefused, Files, apply_plan
from rise_engine.edit.planning import StudyState, plan
from rise_engine.edit.proposals import ProposalFiles
from rise_engine.edit.read_outline import read_outline
from rise_engine.edit.saving import finish_interrupted, refuse_shipped, write_files
from rise_engine.edit.study_above import read_study_above
from rise_engine.edit.study_folder import part_paths, read_study_files
from rise_engine.edit.waiting import Outlook, WaitingChange, WaitingChanges, kept_change, outlook_of
from rise_engine.scenario import LoadResult
from rise_engine.scenario.checker import ScenarioChecker
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.tree import Held
from rise_engine.scenario.uses import Uses
from rise_engine.text import pluralize

StudyCheck: TypeAlias = Callable[[Path, Held], list[Diagnostic]]
"""Gets a study's folder and its files as they are held; gives what is wrong with them."""


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

    def __init__(self, folder: Path, *, robot: str | None = None, also_check: StudyCheck | None = None) -> None:
        """
        :param folder: the study's, or a scenario.toml in it.
        :param robot: the name of a profile, instead of the one that the study names.
        :param also_check: finds what is wrong with the files of a study of participants, which nobody here reads.
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
            self.above = read_study_above(self.folder)
            """The study.toml of a folder above, by its path. It is known, and not edited here."""
        except BaseException:
            self._lock.release()
            raise
        self._checker, self._also_check = ScenarioChecker(self.folder, robot), also_check
        self._history = History()
        self._draft = DraftFile(self.folder)
        self._is_draft_open = not self._lock.holder and self._draft.read() is not None
        """Whether what an earlier editor has left was neither taken up nor given up yet."""
        self._waiting = WaitingChanges(ProposalFiles(self.folder))
        self._outlooks: tuple[Files, tuple[WaitingChange, ...], tuple[Outlook, ...]] = {}, (), ()
        self._state: StudyState | None = None
        for kept in () if self._lock.holder else self._draft.read_given_up():
            self._waiting.add(Change(kept.edits, kept.says, kept.noticed), given_up=True)
        self.notice_proposals()

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
        held = {**dict.fromkeys(self.saved.keys() - files.keys()), **files}
        checked = self._checker.check(held)
        if self._also_check is not None and (more := self._also_check(self.folder, held)):
            checked = replace(checked, diagnostics=[*checked.diagnostics, *more])
        return StudyState(files, read_outline(files, part_paths(files)), checked, self.folder, self.above)

    # --- changing -------------------------------------------------------------------------------------------------

    def preview(self, *edits: AnyEdit) -> LoadResult:
        """The check of what the files would be, changing nothing. :raises EditRefused: one cannot be made."""
        return self._plan(edits)[0].checked

    def foresee(self, *edits: AnyEdit) -> tuple[StudyState, Change, tuple[Refusal, ...]]:
        """What edits would come to, changing nothing; those that cannot be made are left out, and say why."""
        state, changes, refused = self.foresee_each(*edits)
        made = tuple(edit for change in changes for edit in change.edits)
        says = tuple(sentence for change in changes for sentence in change.says)
        noticed = tuple(sentence for change in changes for sentence in change.noticed)
        return state, Change(made, says, noticed), refused

    def foresee_each(self, *edits: AnyEdit) -> tuple[StudyState, list[Change], tuple[Refusal, ...]]:
        """The same, with a change for each of those that can be made."""
        now = self.files, self._state
        changes: list[Change] = []
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
                changes.append(change)
        finally:
            self.files, self._state = now
        return state, changes, tuple(refused)

    def apply(self, *edits: AnyEdit) -> Change:
        """Make edits as one step. :raises EditRefused: one cannot be made; then none is."""
        change = self._apply(edits)
        own = (each for each in self.waiting if each.origin == "yours" and each.change.edits == change.edits)
        if (waited := next(own, None)) is not None:
            self._no_longer_waits(waited.number, change)
        return change

    def _apply(self, edits: Sequence[AnyEdit]) -> Change:
        after, change, replaced = self._plan(edits)
        if changed_names(self.files, after.files):
            self._history.add(Step(change, self.files, after.files, replaced))
            self.files, self._state = after.files, after
            self._keep_draft()
        return change

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

    # --- what waits until somebody chooses --------------------------------------------------------------------------

    @property
    def waiting(self) -> tuple[WaitingChange, ...]:
        """Own changes that somebody else's stand in the way of, and proposed ones, in the order in which they came."""
        return self._waiting.left(_change(step) for step in self._history.done)

    @property
    def set_aside(self) -> tuple[Change, ...]:
        """Own changes that somebody else's stand in the way of, and that nobody has given up."""
        return tuple(each.change for each in self.waiting if each.origin == "yours" and not each.given_up)

    @property
    def outlooks(self) -> tuple[Outlook, ...]:
        """What would come of each of `waiting` as the files are now."""
        waiting = self.waiting
        if self._outlooks[0] is not self.files or self._outlooks[1] != waiting:
            self._outlooks = self.files, waiting, tuple(map(self._outlook, waiting))
        return self._outlooks[2]

    def _outlook(self, waiting: WaitingChange) -> Outlook:
        def plan_all() -> tuple[Files, Change]:
            state, change, _ = self._plan(waiting.change.edits)
            return state.files, change

        return outlook_of(waiting, self.state, plan_all)

    def make_waiting(self, number: int) -> Change:
        """Make a change that waits, also one that was given up, as one step.

        :raises EditRefused: it cannot be made as the files are now.
        """
        waited = self._find_waiting(number)
        if not waited.change.edits:
            raise EditRefused(self._outlook(waited).why_not)
        change = self._apply(waited.change.edits)
        self._no_longer_waits(number, change)
        return change

    def _no_longer_waits(self, number: int, change: Change) -> None:
        if any(_change(step) is change for step in self._history.done):
            self._waiting.note_made(number, change)
        else:  # the files say so already
            self._waiting.drop([number])
        self._keep_draft()

    def give_up(self, number: int, *, given_up: bool = True) -> WaitingChange:
        """A change that waits is not to be made; until the editor is closed it still can be. False: it waits again."""
        self._find_waiting(number)
        self._waiting.give_up(number, given_up=given_up)
        self._keep_draft()
        return self._find_waiting(number)

    def _find_waiting(self, number: int) -> WaitingChange:
        found = next((each for each in self.waiting if each.number == number), None)
        if found is None:
            raise EditRefused("this change does not wait any more")
        return found

    def notice_proposals(self) -> int:
        """Look whether changes were proposed meanwhile (`rise-engine edit --propose`); how many."""
        return 0 if self._lock.holder else self._waiting.notice_proposals()

    # --- what others do -------------------------------------------------------------------------------------------

    def notice_outside(self) -> OutsideChange | None:
        """Look at the disk: take in what was changed there, and make own changes again on it. None: nothing was.

        :raises EditRefused: the folder cannot be read.
        """
        if self._lock.holder:
            self._take_over()
        now, above = read_study_files(self.folder), read_study_above(self.folder)
        if above != self.above:
            self.above, self._state = above, None
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
        steps, lost, stuck = self._make_again(back, made)
        self._waiting.forget_steps(map(_change, (*self._history.done, *stuck)))
        forgotten = len(self._history.done) > len(made) or bool(self._history.undone)
        self._history.begin_anew(steps)
        for change in lost:
            self._waiting.add(change)
        self._keep_draft()
        return OutsideChange(tuple(sorted(outside)), tuple(lost), forgotten)

    def _take_over(self) -> None:
        """Whoever had the study open may have ended."""
        self._lock.try_again()
        if not self._lock.holder:
            self.finished = finish_interrupted(self.folder)
            self._is_draft_open = self._draft.read() is not None
            self.notice_proposals()

    def _make_again(self, back: list[Step], made: list[Step]) -> tuple[list[Step], list[Change], list[Step]]:
        """Own steps on what the files are now; what cannot be made any more; saved steps that cannot be taken back.

        What was made where a step is not taken back, was made on other files than there are: it waits to be looked at.
        """
        steps: list[Step] = []
        lost: list[Change] = []
        stuck: list[Step] = []
        for step in back:  # a saved step taken back has no edits: it is made where its files are as it left them
            if all(self.files.get(name) == step.after.get(name) for name in step.files):
                files = {**self.files, **{name: step.before[name] for name in step.files & step.before.keys()}}
                files = {name: data for name, data in files.items() if name not in step.files - step.before.keys()}
                says = tuple(f"taken back: {sentence}" for sentence in _change(step).says)
                steps.append(Step(Change((), says), self.files, files))
                self.files = files
            else:
                stuck.append(step)
                lost.append(taken_back(_change(step), step.before, step.files))
        other_files = {name for step in stuck for name in step.files}
        for step in made:
            again = None
            if _change(step).edits and not step.files & other_files:
                again = self._step_again(_change(step), step.replaced)
            if again is None:
                lost.append(_change(step))
            elif again.files:
                steps.append(again)
                self.files = again.after
                self._waiting.follow(_change(step), _change(again))
        return steps, lost, stuck

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
            waited = self._waiting.source_of(change)
            changes.append(DraftChange(change.edits, change.says, change.noticed, step.replaced, waited))
        waiting = self.waiting
        aside = tuple(map(kept_change, (each for each in waiting if each.origin == "yours")))
        with suppress(OSError):
            if self._is_draft_open and (changed or aside):
                self._draft.put_aside()
                self._is_draft_open = False
            if not self._is_draft_open:
                self._draft.keep(self.saved, changed, tuple(changes), aside)
        self._waiting.keep_proposals(waiting)

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
                if kept.waited:
                    self._waiting.restore(_change(step), kept.waited)
        if not changed:  # also steps that were taken back over a save, which have no edits
            wanted = {**self.saved, **{name: data for name, data in draft.files.items() if data is not None}}
            wanted = {name: data for name, data in wanted.items() if draft.files.get(name, b"") is not None}
            if changed_names(self.files, wanted):
                says = tuple(sentence for kept in draft.changes for sentence in kept.says)
                self._history.add(Step(Change((), says), self.files, wanted))
                self.files = wanted
            lost = []
        for change in lost:
            self._waiting.add(change)
        for kept in draft.set_aside:
            self._waiting.add(Change(kept.edits, kept.says, kept.noticed), given_up=kept.given_up)
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
        """Give up the lock; a draft with unsaved changes stays for the next time, without what was given up."""
        given_up = [each.number for each in self.waiting if each.given_up]
        if given_up:
            self._waiting.drop(given_up)
            self._keep_draft()
        self._lock.release()


def _change(step: Step) -> Change:
    assert isinstance(step.change, Change)
    return step.change

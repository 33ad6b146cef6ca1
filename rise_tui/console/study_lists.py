"""The head, the lists and the hints of a study's screen: the participants, which can be searched, and the plan."""

from __future__ import annotations

from textual import on
from textual.app import ComposeResult
from textual.containers import Container, Vertical

from rise_engine.study.model import ParticipantStanding, Study, StudyStanding
from rise_engine.study.recording_table import recorders_text
from rise_tui.actions import BY_ID, actions_in
from rise_tui.config.launch import StudyNow
from rise_tui.key_labels import first_key_label
from rise_tui.model.filtering import Filter, InvalidFilter, filter_rows
from rise_tui.model.study_rows import (
    NO_CONDITIONS,
    Conditions,
    due_rows,
    find_participant,
    participant_rows,
    person_rows,
    plan_rows,
    problem_rows,
    rehearsal_rows,
)
from rise_tui.rendering.text import ListRow, StyledLine, StyledSpan, align_at_both_ends, clean, line_width
from rise_tui.widgets.bars import KeyHints
from rise_tui.widgets.fields import PromptBar
from rise_tui.widgets.lines import RowList, RowView, StaticLines


class StudyHead(StaticLines):
    """The study's title, its mode, and the wizard's name."""

    DEFAULT_CSS = "StudyHead { background: $rise-bar; }"

    def draw(self, study: Study | None, wizard: str, *, is_read: bool) -> None:
        if study is None:
            self.show(((" This study has errors", "fault") if is_read else (" A study", "strong"),))
            return
        real = study.mode == "real"
        right: list[StyledSpan] = [(study.mode.upper(), "wait" if real else "accent"), ("  ", "plain")]
        right += [(f"wizard {clean(wizard)} " if wizard else "no wizard named yet ", "muted")]
        left: StyledLine = ((f" {clean(study.title)}", "strong"),)
        recorders = recorders_text(study.recording)
        for note in (f"  recorded by {clean(recorders)}" if recorders else "", "  no session is running"):
            if note and line_width((*left, (note, "muted"), *right)) < self.size.width:
                left = (*left, (note, "muted"))
        self.show(align_at_both_ends(left, tuple(right), self.size.width))


class SubHead(StaticLines):
    """The title of a list, and a note on its right."""

    DEFAULT_CSS = "SubHead { background: $rise-bar; }"

    def draw(self, title: str, note: str = "") -> None:
        left: StyledLine = ((f" {title.upper()} ", "accent"),)
        self.show(align_at_both_ends(left, ((f"{clean(note)} ", "muted"),), self.size.width))


class StudyHints(KeyHints):
    """The keys of a study's screen. Each can be clicked."""

    def draw(self) -> None:  # type: ignore[override]
        actions = [*actions_in("study"), *(BY_ID[id] for id in ("filter", "palette", "help", "quit"))]
        words = {"quit": "leave"}
        self.show_pieces(
            [
                ([(f" {first_key_label(each)}", "key"), (f" {words.get(each.id, each.hint)} ", "plain")], each.id)
                for each in actions
            ]
        )


WIDE = 110
"""From this width on the plan is beside the participants, not below them."""


class StudyLists(Vertical):
    """Shows the current state of a study. A search shows only some participants."""

    DEFAULT_CSS = """
    StudyLists {
        height: 1fr;
        #body { height: 1fr; layout: vertical; }
        #people { height: 1fr; width: 1fr; }
        #beside { height: auto; max-height: 40%; width: 1fr; }
        #plan-rows { height: auto; max-height: 100%; }
        &.-wide #body { layout: horizontal; }
        &.-wide #people { width: 3fr; border-right: vkey $rise-bar; }
        &.-wide #beside { width: 2fr; height: 1fr; max-height: 100%; }
        &.-wide #plan-rows { height: 1fr; }
    }
    """

    def __init__(self) -> None:
        super().__init__()
        self._now, self._conditions = StudyNow(), NO_CONDITIONS
        self._filter: Filter | None = None
        self.people_head, self.beside_head = SubHead(), SubHead()
        self.people, self.beside = RowList(id="people-rows"), RowList(id="plan-rows")
        self.find_bar = PromptBar("find ", "a participant, a state; esc clears")

    def compose(self) -> ComposeResult:
        with Container(id="body"):
            with Vertical(id="people"):
                yield self.people_head
                yield self.people
            with Vertical(id="beside"):
                yield self.beside_head
                yield self.beside
        yield self.find_bar

    def on_mount(self) -> None:
        self.on_resize()

    def on_resize(self) -> None:
        self.set_class(self.app.size.width >= WIDE, "-wide")
        self.call_after_refresh(self.draw)

    def show(self, now: StudyNow, conditions: Conditions) -> None:
        """Show a study in its current state."""
        self._now, self._conditions = now, conditions
        self.draw()

    @property
    def selected(self) -> ParticipantStanding | None:
        """The participant under the cursor."""
        standing = self._now.standing
        return find_participant(standing, self.people.current_id) if standing is not None else None

    def select(self, participant: str) -> None:
        """Put the cursor on a participant."""
        self.people.select(participant)
        self.draw()

    @on(RowView.Resized)
    @on(StaticLines.DrawAgain)
    @on(RowView.CursorMoved)
    def draw(self) -> None:
        """Make every line again. Only differences reach the terminal."""
        width, standing, wide = self.people.row_width, self._now.standing, self.has_class("-wide")
        if width <= 0:
            return
        if standing is None:
            self.people.show(problem_rows(self._now.problems, width) if self._now.problems else ())
            self.people_head.draw("Participants")
            self.query_one("#beside").display = False
            return
        self._draw_people(standing, width)
        if not self.query_one("#beside").display:
            self.query_one("#beside").display = True
            self.call_after_refresh(self.draw)  # its width is known only then
            return
        beside, selected = self.beside.row_width, self.selected
        rows = [*plan_rows(standing, self._conditions, beside), *due_rows(standing, beside)]
        rows += rehearsal_rows(standing, beside)
        rows += person_rows(selected, self._conditions, beside) if wide and selected is not None else []
        due = f" · {len(standing.due)} due" if standing.due else ""
        self.beside_head.draw("Plan", f"{standing.complete} of {standing.wanted} complete{due}")
        self.beside.show(rows)
        if not wide:
            self.beside.styles.height = len(rows)

    def _draw_people(self, standing: StudyStanding, width: int) -> None:
        rows = made = participant_rows(standing, width)
        done = "the study is complete" if standing.complete >= standing.wanted else "no participant can begin now"
        note = f"next: {standing.next}" if standing.next else done
        if self._filter is not None:
            rows = self._found_rows(self._filter, made)
            note = f"find {self._filter.text}  {len(rows)} of {len(made)}"
            rows = rows or [ListRow("", ((" nothing matches; esc clears the search", "muted"),), selectable=False)]
        self.people_head.draw("Participants", note)
        empty = [ListRow("", ((" participants.csv lists nobody yet", "muted"),), selectable=False)]
        self.people.show(rows or empty)

    def _found_rows(self, wanted: Filter, rows: list[ListRow]) -> list[ListRow]:
        try:
            return filter_rows(rows, wanted)
        except InvalidFilter:
            return rows

    # --- focus ------------------------------------------------------------------------------------------------------

    def focus_people(self) -> None:
        """Give the participants the focus."""
        self.screen.set_focus(self.people)

    def focus_other(self) -> None:
        """Switch the focus between the participants and the plan."""
        self.screen.set_focus(self.beside if self.people.has_focus else self.people)

    def open_find(self) -> None:
        """Open the search with the last search text."""
        self.find_bar.open(self._filter.text if self._filter is not None else "")

    @on(PromptBar.Edited)
    def _find(self, event: PromptBar.Edited) -> None:
        try:
            self._filter = Filter(event.bar.text) or None
        except InvalidFilter:
            return
        self.draw()

    @on(PromptBar.Accepted)
    def _keep_find(self) -> None:
        self.people.displaced_at = float("-inf")  # the wizard requested this cursor position
        self._close_find()

    @on(PromptBar.Cancelled)
    def clear_find(self) -> None:
        """Show every participant again."""
        self._filter = None
        self._close_find()

    def _close_find(self) -> None:
        self.find_bar.close()
        self.focus_people()
        self.draw()

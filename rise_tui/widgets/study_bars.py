"""The bars of a study's screen: its head, the titles of its lists, the sentence above the key hints, the hints."""

from __future__ import annotations

from rise_engine.study.model import Study
from rise_engine.study.recording_table import recorders_text
from rise_tui.actions import BY_ID, actions_in
from rise_tui.key_labels import first_key_label
from rise_tui.model.notice import Level, Notice
from rise_tui.rendering.text import StyledLine, StyledSpan, align_at_both_ends, clean, line_width
from rise_tui.widgets.bars import KeyHints, notice_lines
from rise_tui.widgets.lines import StaticLines

READING = "reading the study …"


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


class StudyNotice(StaticLines):
    """One sentence. A longer one takes two or three lines."""

    def __init__(self) -> None:
        super().__init__()
        self._sentence = ""

    @property
    def is_about_reading(self) -> bool:
        """Whether the sentence says that the study is being read."""
        return self._sentence == READING

    def draw(self, sentence: str, level: Level = "info") -> None:
        self._sentence = sentence
        lines = notice_lines(Notice(sentence, level), self.size.width or 80) if sentence else [()]
        self.styles.height = len(lines)
        self.show(*lines)


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

"""The lines that every page has around it: the study, its mode, what is wrong, what is not saved."""

from __future__ import annotations

from rise_tui.editor.model.draft import StudyDraft, count
from rise_tui.rendering.text import StyledLine, StyledSpan, TextRole, align_at_both_ends, clean, line_width, shorten

LEAST_TITLE, MOST_TITLE = 8, 34
"""Cells of the study's title, which has what the rest leaves."""


def top_line(draft: StudyDraft, width: int, *, busy: str = "") -> StyledLine:
    """Which study, that this is EDIT, its robot, errors and warnings, unsaved changes."""
    errors = len(draft.checked.errors)
    warnings = len(draft.checked.diagnostics) - errors
    left: list[StyledSpan] = [("  EDIT", "accent")]
    left.append((f"  {clean(draft.checked.robot.name)}", "muted"))
    left.append((f"  ✗ {count(errors, 'error')}", "fault") if errors else ("  ✓ no errors", "plain"))
    if warnings:
        left.append((f"  ▲ {count(warnings, 'warning')}", "wait"))
    number = len(draft.changes)
    unsaved: StyledSpan = ("saved ", "muted")
    if draft.changed_files:
        unsaved = (f"● {count(number, 'change')} unsaved ", "wait") if number else ("● not saved ", "wait")
    right: StyledLine = ((f"{busy} … ", "muted"), unsaved) if busy else (unsaved,)
    room = width - line_width(left) - line_width(right) - 3
    title: StyledSpan = (f" {shorten(clean(draft.title), max(LEAST_TITLE, min(MOST_TITLE, room)))}", "strong")
    return align_at_both_ends((title, *left), right, width)


def finding_line(draft: StudyDraft, about: str) -> StyledLine:
    """The first thing that is wrong; of what stands in `about` (a file) first."""
    found = draft.findings
    if not found:
        return ()
    errors = [each for each in found if each.severity == "error"]
    near = [each for each in errors or found if each.location.file == about]
    first = (near or found)[0]
    role: TextRole = "fault" if first.severity == "error" else "wait"
    glyph = "✗" if first.severity == "error" else "▲"
    return ((f" {glyph} {first.location.file}:{first.location.line} ", role), (clean(first.message), role))

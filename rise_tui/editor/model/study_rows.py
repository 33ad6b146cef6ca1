"""The list of a study: its acts and rules with their keys, and the other pages."""

from __future__ import annotations

from collections.abc import Sequence

from rise_engine.author.edit.outline import WrittenAct
from rise_engine.base.text import pluralize
from rise_engine.scenario.files.study_paths import PARTICIPANTS_FILE
from rise_engine.scenario.model import KeyBinding, SourceLocation
from rise_tui.editor.model.acts import act_seconds, action_content, action_type, all_texts, when_text
from rise_tui.editor.model.draft import StudyDraft, is_study_alone
from rise_tui.editor.model.text_rows import find_text
from rise_tui.rendering.text import ListRow, StyledLine, StyledSpan, clean, crop, fixed_span, format_seconds, wrap

FURTHER_PAGES = (
    ("texts", "Texts", "the texts of the acts in each language"),
    ("memory", "Memory", "start values"),
    ("keys", "Keys", "what each key does"),
    ("settings", "Settings", "title, robot, fillers, conditions"),
    ("tables", "Tables", "lists of items"),
)
"""Pages other than acts and rules, by their kinds."""
STUDY_PAGES = (
    ("tables", "People", "participants.csv"),
    ("settings", "Design", "study.toml: factors, plan, checks"),
)
"""The pages of a study with participants, whose scenarios are edited separately."""
NAME = 4
"""Cells around a name: the key before it, the mark after it."""


def row_id(kind: str, name: str = "") -> str:
    """The id of a row that opens a page of this kind."""
    return f"{kind}\0{name}"


def split_row_id(id: str) -> tuple[str, str]:
    """Kind and name of a row's id. Both are empty for no row."""
    kind, _, name = id.partition("\0")
    return kind, name


def keys_by_name(draft: StudyDraft) -> dict[tuple[str, str], list[KeyBinding]]:
    """The study's keys by the act or rule that they start: `("act", "R_Yes")`. Empty while there is an error."""
    scenario = draft.checked.scenario
    kinds = {"startCommunicationRobotAct": "act", "startInteractionRule": "rule"}
    if scenario is None:
        return {}
    found: dict[tuple[str, str], list[KeyBinding]] = {}
    for key in scenario.keys.values():
        if key.function in kinds:
            found.setdefault((kinds[key.function], key.behavior), []).append(key)
    return found


def study_rows(draft: StudyDraft, width: int, wanted: str = "") -> list[ListRow]:
    """Acts, rules and the other pages; only those that contain `wanted`."""
    keys, wrong = keys_by_name(draft), wrong_files(draft)

    def fits(*texts: str) -> bool:
        return not wanted or any(wanted.casefold() in text.casefold() for text in texts)

    def heading(title: str, number: int) -> ListRow:
        line: StyledLine = ((f" {title}", "accent"), (f"{number:>{max(1, width - len(title) - 3)}}", "muted"))
        return ListRow("", line, selectable=False)

    rows = [ListRow("", ((f" find {wanted}: esc shows all", "wait"),), selectable=False)] if wanted else []
    if is_study_alone(draft):
        of_study = [each for each in STUDY_PAGES if fits(*each[1:])]
        return [*rows, *(ListRow(row_id(kind), _also_line(title, help, width)) for kind, title, help in of_study)]
    acts = [act for act in draft.outline.acts if fits(act.name, *(all_texts(action) for action in act.actions))]
    rows.append(heading("ACTS", len(acts)))
    for act in acts:
        bad = any(map(act.has_line, wrong.get(act.file, ())))
        note = f"{format_seconds(act_seconds(act, draft.checked)):>5} s  "
        note += _act_note(draft, act, width - NAME - _name_width(width) - len(note))
        key = keys[("act", act.name)][0].label if ("act", act.name) in keys else ""
        rows.append(ListRow(row_id("act", act.name), _line(key, act.name, note, width, bad=bad)))
    rules = [rule for rule in draft.outline.rules if fits(rule.name, *(state.id for state in rule.states))]
    rows.append(heading("RULES", len(rules)))
    for rule in rules:
        transitions = sum(len(state.transitions) for state in rule.states)
        note = f"{pluralize(len(rule.states), 'state'):>9}" + (
            f" {pluralize(transitions, 'transition')}" if width >= 50 else ""
        )
        key = keys[("rule", rule.name)][0].label if ("rule", rule.name) in keys else ""
        rows.append(ListRow(row_id("rule", rule.name), _line(key, rule.name, note, width, bad=False)))
    also = [(kind, title, help) for kind, title, help in FURTHER_PAGES if fits(title, help)]
    if also:
        rows.append(ListRow("", ((" ALSO", "accent"),), selectable=False))
    rows += [ListRow(row_id(kind), _also_line(title, help, width)) for kind, title, help in also]
    if wanted and not acts and not rules and not also:
        rows.append(ListRow("", ((" no name or text matches", "muted"),), selectable=False))
    for file, why in draft.outline.unreadable.items():
        text = f" ✗ {file}: {clean(why)}"
        rows.append(ListRow(row_id("file", file), crop(((text, "fault"),), width)))
    return rows


def best_row(rows: Sequence[ListRow], wanted: str) -> str:
    """The best match of a search: a row whose name begins with the text, or else the first one."""
    titles = {kind: title for kind, title, _ in FURTHER_PAGES}

    def title(id: str) -> str:
        kind, name = split_row_id(id)
        return (name or titles.get(kind, "")).casefold()

    ids = [row.id for row in rows if row.selectable]
    return next((id for id in ids if title(id).startswith(wanted.casefold())), ids[0] if ids else "")


def _line(key: str, name: str, note: str, width: int, *, bad: bool) -> StyledLine:
    mark: StyledSpan = ("✗", "fault") if bad else (" ", "plain")
    return crop(((f" {key[:1] or ' '} ", "key"), fixed_span(name, _name_width(width)), mark, (note, "muted")), width)


def _name_width(width: int) -> int:
    return max(10, min(26, width - 20))


def _also_line(title: str, help: str, width: int) -> StyledLine:
    """A row with a description: names of these pages are short."""
    return crop((("   ", "plain"), fixed_span(title, 10), (help, "muted")), width)


def _act_note(draft: StudyDraft, act: WrittenAct, room: int) -> str:
    """An act's settings and number of wordings, as far as they fit."""
    most = max((len(action.calls) for action in act.actions), default=0)
    notes = [*setting_notes(draft, act), *([f"{most} var."] if most > 1 else [])]
    while notes and len(" ".join(notes)) > room:
        notes.pop()
    return " ".join(notes)


def setting_notes(draft: StudyDraft, act: WrittenAct) -> list[str]:
    """An act's settings in words. None while there is an error."""
    scenario = draft.checked.scenario
    if scenario is None or act.name not in scenario.acts:
        return []
    settings = scenario.settings_of(act.name)
    return [word for word, is_given in (("hold", settings.hold), ("filler", settings.filler)) if is_given]


def wrong_files(draft: StudyDraft) -> dict[str, list[int]]:
    """Lines with an error, by file."""
    found: dict[str, list[int]] = {}
    for each in draft.checked.errors:
        found.setdefault(each.location.file, []).append(each.location.line)
    return found


def find_at(draft: StudyDraft, file: str, line: int) -> tuple[str, str] | None:
    """The page that shows this line: its kind and name."""
    for act in draft.outline.acts:
        if act.file == file and act.has_line(line):
            return "act", act.name
    for rule in draft.outline.rules:
        if rule.file == file and rule.has_line(line):
            return "rule", rule.name
    if (view := find_text(draft, file, line)) is not None:
        return "texts", view.name
    if (file.startswith("tables/") and file.lower().endswith(".csv")) or file == PARTICIPANTS_FILE:
        return "tables", f"{file}:{line}"
    by_file = {"memory.json": "memory", "scenario.toml": "settings"}
    return (by_file[file], "") if file in by_file else None


def used_by(draft: StudyDraft, kind: str, name: str) -> dict[str, SourceLocation]:
    """The places that use an act, a rule or a key, by their description."""
    known = {"act": "act", "rule": "rule", "memory": "key", "event": "event"}.get(kind)
    if known is None:
        return {}
    found = (use for use in draft.uses.of(known, name) if not use.defines)  # type: ignore[arg-type]
    return {f"{use.where}  {use.location.file}:{use.location.line}": use.location for use in found}


def act_preview(draft: StudyDraft, act: WrittenAct, width: int) -> list[StyledLine]:
    """The contents of an act's page, and the uses of the act."""
    lines: list[StyledLine] = [
        ((f" {act.name}", "strong"),),
        ((f" {act.file}:{act.line}  ~{format_seconds(act_seconds(act, draft.checked))} s", "muted"),),
    ]
    for action in act.actions:  # one role: colour changes are most of a cursor move's bytes
        head = f" {when_text(action.wait_for):9}{action.id:>2} {action_type(action)[:9]:9} "
        lines.append(crop(((head + action_content(action), "plain"),), width))
    return [*lines, (), *used_lines(draft, "act", act.name, width)]


def used_lines(draft: StudyDraft, kind: str, name: str, width: int) -> list[StyledLine]:
    """USED BY, and a row for each use."""
    found = used_by(draft, kind, name)
    lines: list[StyledLine] = [((" USED BY", "accent"),)]
    for text in found or ("nothing: no rule and no key starts it",):
        lines += [((f" {'  ' if number else ''}{piece}", "plain" if found else "muted"),)
                  for number, piece in enumerate(wrap(text, max(20, width - 4)))]  # fmt: skip
    return lines

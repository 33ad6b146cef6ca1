"""The text of the study's screen: participants with their state in a word, the plan and its progress. Pure.

A hidden study shows no condition here, not even of sessions that are over: within a block, the earlier conditions
reveal the next one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from itertools import product
from typing import NamedTuple

from rise_engine.study.model import (
    CellStanding,
    Level,
    ParticipantStanding,
    ParticipantState,
    SessionEntry,
    Study,
    StudyStanding,
)
from rise_tui.model.states import StateLabel
from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    StyledSpan,
    TextRole,
    cell_width,
    clean,
    crop,
    fit,
    fixed_span,
    format_seconds,
    wrap,
)

HIDDEN = "hidden until the session begins"
"""The text for a condition in a hidden study."""


class Conditions(NamedTuple):
    """The conditions of one study."""

    labels: Mapping[str, str]
    """The label of each condition, by name, including conditions of the between factors alone."""
    hidden: bool = False
    descriptions: Mapping[str, str] = {}
    """The factors with their levels, by the condition's name: `hesitation: A, noise: quiet`."""

    def label(self, condition: str) -> str:
        """A condition's label in its session. A condition outside the design is shown by its name."""
        return self.labels.get(condition, condition)

    def described(self, condition: str) -> str:
        """The same with its factors, for places with room."""
        return self.descriptions.get(condition) or self.label(condition)

    def shown(self, condition: str) -> str:
        """A condition's label outside its session; empty: a hidden study."""
        return "" if self.hidden else self.label(condition)


NO_CONDITIONS = Conditions({})


def conditions_of(study: Study) -> Conditions:
    """The conditions of a design, in the order of its factors."""
    every = [factor.levels for factor in study.factors]
    between = [factor.levels for factor in study.factors if factor.kind == "between"]
    labels = {_join(levels, named=True): _join(levels, named=False) for levels in product(*every)}
    for levels in product(*between):
        labels.setdefault(_join(levels, named=True), _join(levels, named=False))
    labels.pop("", None)
    names = [factor.name for factor in study.factors]
    descriptions = {
        _join(levels): ", ".join(
            f"{name}: {level.label or level.name}" for name, level in zip(names, levels, strict=True)
        )
        for levels in product(*every)
    }
    return Conditions(labels, study.assignment.hidden, descriptions)


def condition_names(study: Study) -> list[str]:
    """Every condition that a session can have, in the order of the design."""
    return [name for levels in product(*(factor.levels for factor in study.factors)) if (name := _join(levels))]


def _join(levels: tuple[Level, ...], *, named: bool = True) -> str:
    return "+".join(level.name if named else level.label or level.name for level in levels)


STATES: dict[ParticipantState, StateLabel] = {
    "waiting": StateLabel("○", "waiting", "plain"),
    "no-consent": StateLabel("✗", "no consent", "wait"),
    "running": StateLabel("►", "running", "accent"),
    "unfinished": StateLabel("◐", "unfinished", "wait"),
    "to-judge": StateLabel("?", "no outcome", "wait"),
    "to-go-on": StateLabel("◇", "in progress", "plain"),
    "aborted": StateLabel("■", "aborted", "wait"),
    "complete": StateLabel("✓", "complete", "muted"),
    "excluded": StateLabel("-", "excluded", "muted"),
    "withdrawn": StateLabel("-", "withdrawn", "muted"),
}
OUTCOMES = {"complete": "✓ complete", "aborted": "■ aborted", "excluded": "- excluded"}
STATE_WIDTH = 13
NAME_WIDTH = 12
"""Maximum cells for a pseudonym."""
NEXT = "→"
MIN_REASON = 12
"""Cells below which a reason is useless."""
BAR = 12
"""Cells of the longest bar of the plan."""


def participant_rows(standing: StudyStanding, width: int) -> list[ListRow]:
    """One row for each participant in order: next, name, state, runs, slot, strata, and the reason."""
    people = standing.participants
    names = min(NAME_WIDTH, max((cell_width(clean(each.participant)) for each in people), default=4))
    slots = max((len(f"{each.slot}") for each in people if each.slot is not None), default=0)
    runs = max((len(_runs_text(each)) for each in people), default=0)
    return [_participant_row(each, standing.next, width, (names, runs, slots)) for each in people]


def _participant_row(each: ParticipantStanding, next: str, width: int, columns: tuple[int, int, int]) -> ListRow:
    names, runs, slots = columns
    state = STATES[each.state]
    is_next = each.participant == next
    over: TextRole = "muted" if state.role == "muted" else "plain"
    spans: list[StyledSpan] = [
        (f" {NEXT if is_next else ' '} ", "accent"),
        fixed_span(each.participant, names, "strong" if is_next else over),
        ("  ", "plain"),
        fixed_span(state.span[0], STATE_WIDTH, state.role),
    ]
    if runs:
        spans += [("  ", "plain"), fixed_span(_runs_text(each), runs, "muted")]
    if slots:
        slot = "" if each.slot is None else f"slot {each.slot:>{slots}}"
        spans += [("  ", "plain"), fixed_span(slot, slots + 5, "muted")]
    strata = " ".join(clean(value) for value in each.strata.values())
    if strata:
        spans += [("  ", "plain"), (strata, "muted")]
    room = width - sum(cell_width(text) for text, _ in spans) - 3
    if each.why and room >= MIN_REASON:
        spans += [("  ", "plain"), (fit(each.why, room).rstrip(), state.role if state.role == "wait" else "muted")]
    full = f"{each.participant} {state.word} {strata} {each.why} {'next' if is_next else ''}"
    return ListRow(each.participant, crop(tuple(spans), width), full=full)


def _runs_text(each: ParticipantStanding) -> str:
    """`1 of 2 runs`; empty: every participant has one run."""
    return f"{runs_done(each)} of {each.runs} runs" if each.runs > 1 else ""


def runs_done(each: ParticipantStanding) -> int:
    """The number of the participant's completed runs."""
    return len({entry.run for entry in each.sessions if entry.outcome == "complete"})


def session_line(entry: SessionEntry, conditions: Conditions) -> str:
    """`run 1 · ✓ complete · calm · 2026-11-21 14:15 · 24:10`."""
    attempt = f", attempt {entry.attempt}" if entry.attempt > 1 else ""
    what = {"running": "► running", "unfinished": "◐ unfinished"}.get(entry.status, "? no outcome")
    if entry.status == "ended" and entry.outcome is not None:
        what = OUTCOMES[entry.outcome]
    what += f": {entry.reason}" if entry.reason else ""
    parts = [f"run {entry.run}{attempt}", what, conditions.shown(entry.condition), begun_text(entry.started)]
    parts += [format_seconds(round(entry.seconds))] if entry.status != "running" else []
    parts += [f"run as {entry.run_as}, and reassigned: {entry.reassigned}"] if entry.run_as else []
    return " · ".join(filter(None, map(clean, parts)))


def begun_text(started: str) -> str:
    """`2026-11-21 14:15`, in the local time of the session."""
    try:
        return f"{datetime.fromisoformat(started):%Y-%m-%d %H:%M}"
    except ValueError:
        return clean(started)


# --- beside the participants ------------------------------------------------------------------------------------------


def plan_rows(standing: StudyStanding, conditions: Conditions, width: int) -> list[ListRow]:
    """The progress of each cell of the plan; in a hidden study only the strata."""
    cells = [_Cell(_cell_name(cell, conditions), cell.complete, cell.open, _planned(cell)) for cell in standing.cells]
    if conditions.hidden:
        cells = _totals(standing.cells)
    rows: list[ListRow] = []
    if not cells:
        cells = [_Cell("all", standing.complete, 0, standing.wanted)]
    widest = max(cell_width(cell.name) for cell in cells)
    for cell in cells:
        if widest <= max(8, width - 36):
            rows.append(_row(_cell_line(cell, widest), width))
        else:  # cut names could look alike
            rows.append(_row(((f" {cell.name}", "plain"),), width))
            rows.append(_row(_cell_line(cell._replace(name=""), 2), width))
    if conditions.hidden:
        rows.append(_row(((" conditions are hidden until a session begins", "muted"),), width))
    return rows


class _Cell(NamedTuple):
    """A line of the plan. `planned` is 0 if the number is unknown."""

    name: str
    complete: int
    open: int
    planned: int


def _cell_name(cell: CellStanding, conditions: Conditions) -> str:
    strata = " ".join(map(clean, cell.strata.values()))
    return "  ".join(filter(None, (strata, conditions.shown(cell.condition)))) or "all"


def _planned(cell: CellStanding) -> int:
    """The planned number of a cell. With strata, the number of each is unknown."""
    return 0 if cell.strata else cell.planned


def _totals(cells: Sequence[CellStanding]) -> list[_Cell]:
    """The totals of each stratum over its conditions."""
    found: dict[tuple[str, ...], list[CellStanding]] = {}
    for cell in cells:
        found.setdefault(tuple(cell.strata.values()), []).append(cell)
    return [
        _Cell(
            " ".join(map(clean, values)) or "all",
            sum(cell.complete for cell in members),
            sum(cell.open for cell in members),
            sum(map(_planned, members)),
        )
        for values, members in found.items()
    ]


def _cell_line(cell: _Cell, names: int) -> StyledLine:
    """`de  calm   ███░░░   3 of 6, 1 open`: a bar, and the same in numbers."""
    most = cell.planned or max(1, cell.complete + cell.open)
    length = min(BAR, most if cell.planned else cell.complete + cell.open)
    done, begun = (min(length, round(count * length / most)) for count in (cell.complete, cell.complete + cell.open))
    begun = max(done, begun)
    bar: StyledLine = (("█" * done, "accent"), ("▒" * (begun - done), "wait"), ("░" * (length - begun), "muted"))
    pad: StyledLine = ((" " * (BAR - length + 2), "plain"),)
    count = f"{cell.complete:>2} of {cell.planned}" if cell.planned else f"{cell.complete:>2} complete"
    more = f", {cell.open} begun" if cell.open else ""
    return (
        (" ", "plain"),
        fixed_span(cell.name, names),
        ("  ", "plain"),
        *bar,
        *pad,
        (f"{count}{more}", "plain"),
    )


def due_rows(standing: StudyStanding, width: int) -> list[ListRow]:
    """The work that is due."""
    rows: list[ListRow] = []
    for sentence in standing.due:
        lines = wrap(sentence, max(20, width - 4))
        rows += [_row(((" ! " if at == 0 else "   ", "wait"), (line, "plain")), width) for at, line in enumerate(lines)]
    return rows


def person_rows(each: ParticipantStanding, conditions: Conditions, width: int) -> list[ListRow]:
    """The participant under the cursor: state, strata, obstacles, and sessions."""
    state = STATES[each.state]
    strata = " · ".join(f"{clean(name)} {clean(value)}" for name, value in each.strata.items())
    slot = f"slot {each.slot}" if each.slot is not None else "no slot yet"
    facts = " · ".join(filter(None, (strata, slot if state.role != "muted" or each.slot is not None else "")))
    rows = [_row((), width), _row(((f" {each.participant}  ", "accent"), state.span, (f"   {facts}", "muted")), width)]
    for line in wrap(each.why, max(20, width - 5)) if each.why else ():
        rows.append(_row(((f"   {line}", "wait" if state.role == "wait" else "plain"),), width))
    for entry in each.sessions:
        lines = wrap(session_line(entry, conditions), max(20, width - 7))
        rows += [_row(((f"   {'    ' * (at > 0)}{line}", "plain"),), width) for at, line in enumerate(lines)]
    if not each.sessions:
        rows.append(_row((("   no session yet", "muted"),), width))
    return rows


def rehearsal_rows(standing: StudyStanding, width: int) -> list[ListRow]:
    """The number of sessions that do not count. They do not affect the plan."""
    if not standing.rehearsals:
        return []
    if (running := running_rehearsal(standing)) is not None:
        text = f" ► a {running.purpose} session with {clean(running.participant)} is running: enter on them opens it"
        return [_row(((text, "accent"),), width)]
    latest = max(standing.rehearsals, key=lambda entry: entry.started)
    count = len(standing.rehearsals)
    last = f"{latest.purpose} with {clean(latest.participant)}, {begun_text(latest.started)}"
    text = f" {count} rehearsal{'s' * (count > 1)}, not counted; the latest: {last}"
    return [_row(((text, "muted"),), width)]


def problem_rows(problems: Sequence[str], width: int) -> list[ListRow]:
    """Why nothing can be started: every diagnostic, on the lines that it needs."""
    rows = [_row(((" The study has errors: nothing can be started.", "fault"),), width), _row((), width)]
    for finding in problems:
        for at, line in enumerate(wrap(finding, max(30, width - 5))):
            rows.append(_row(((f" {'✗' if at == 0 else ' '} ", "fault"), (line, "plain")), width))
    rows += [_row((), width), _row(((" It is read again when one of its files changes.", "muted"),), width)]
    return rows


def _row(line: StyledLine, width: int) -> ListRow:
    return ListRow("", crop(line, width), selectable=False)


def find_participant(standing: StudyStanding, name: str) -> ParticipantStanding | None:
    """The participant with this pseudonym."""
    return next((each for each in standing.participants if each.participant == name), None)


def open_entry(each: ParticipantStanding) -> SessionEntry | None:
    """The session that runs, did not end, or waits for its outcome."""
    waiting = (entry for entry in reversed(each.sessions) if entry.status != "ended" or entry.outcome is None)
    return next(waiting, None)


def running_rehearsal(standing: StudyStanding, participant: str = "") -> SessionEntry | None:
    """The running rehearsal, of this participant or any."""
    running = (entry for entry in standing.rehearsals if entry.status == "running")
    return next((entry for entry in running if participant in ("", entry.participant)), None)


def running_people(standing: StudyStanding) -> Iterator[ParticipantStanding]:
    """The participants whose session runs now."""
    return (each for each in standing.participants if each.state == "running")

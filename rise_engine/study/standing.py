"""The progress of a study: its plan compared with its log and its session folders. Reads and writes no files.

The rules: A participant takes the first free row of their stratum and keeps it. A row is free if it has no holder, or
if its holder is excluded or withdrawn. A run counts when one of its sessions is complete. After an aborted session, it
may be run again. Sessions that are not `counted` never take a row and never count.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import datetime

from msgspec import Struct

from rise_engine.study.checks import due_after_checks
from rise_engine.study.labels import reassignments
from rise_engine.study.model import (
    CellStanding,
    Participant,
    ParticipantStanding,
    ParticipantState,
    SessionEntry,
    Slot,
    Study,
    StudyStanding,
)
from rise_engine.study.plan import runs as runs_of_design
from rise_engine.study.sessions import StudySession
from rise_engine.study.study_log import LogEntry
from rise_engine.study.traces import is_withdrawn

BEGINNABLE: frozenset[ParticipantState] = frozenset({"waiting", "to-go-on", "aborted"})
"""States in which a session can begin, unless something blocks it (`why`)."""


class Places(Struct):
    """The holders of the plan's rows, and the participants who no longer count."""

    slots: dict[str, int]
    """The row that each participant holds."""
    levels: dict[int, dict[str, str]]
    """The between levels of rows, if they are drawn when the row is taken."""
    excluded: dict[str, str]
    """Excluded participants with the reasons."""
    withdrawn: frozenset[str]

    def is_out(self, participant: str) -> bool:
        """Whether a participant no longer counts."""
        return participant in self.excluded or participant in self.withdrawn

    def free_row(self, plan: Sequence[Slot], strata: Mapping[str, str]) -> Slot | None:
        """Return the row that the next participant of a stratum gets. None: all are held.

        :param plan: the rows in their order.
        :param strata: the participant's values.
        """
        held = set(self.slots.values())
        return next((row for row in plan if row.slot not in held and in_stratum(row, strata)), None)


def in_stratum(row: Slot, strata: Mapping[str, str]) -> bool:
    """Whether a row of the plan is for participants with these values."""
    return all(strata.get(column) == value for column, value in row.strata.items())


def places_of(participants: Sequence[Participant], log: Sequence[LogEntry]) -> Places:
    """Determine the holder of each row, and who no longer counts.

    An excluded participant whose row has another holder stays out, even if the exclusion is undone: rows are not
    exchanged.

    :param participants: the rows of participants.csv.
    :param log: all entries of the log, with `missing_entries`.
    """
    names = {each.participant for each in participants}
    names |= {str(each.get("participant")) for each in log if each.get("participant")}
    withdrawn = frozenset(name for name in names if is_withdrawn(name, log))
    excluded = {each.participant: "participants.csv says so" for each in participants if each.status == "excluded"}
    for each in log:
        if each.kind == "excluded":
            excluded[str(each.get("participant"))] = str(each.get("reason") or "")
    judged = {each.get("session") or each.get("participant"): each for each in log if each.kind == "outcome"}
    moved = reassignments(log)
    for name, each in judged.items():  # the last outcome of each session
        if each.get("status") == "excluded":
            owner = moved[str(name)].participant if name in moved else str(each.get("participant"))
            excluded.setdefault(owner, str(each.get("reason") or ""))
    last_taken: dict[str, int] = {}
    takers: dict[int, str] = {}
    levels: dict[int, dict[str, str]] = {}
    for each in log:
        if each.kind == "taken":
            slot, participant = int(each.get("slot") or 0), str(each.get("participant"))
            last_taken[participant], takers[slot] = slot, participant
            last_taken.pop(str(each.get("instead_of")), None)  # the former participant of the session
            levels[slot] = {str(name): str(level) for name, level in dict(each.get("levels") or {}).items()}
    for participant, slot in last_taken.items():
        if takers[slot] != participant and participant not in withdrawn:
            excluded.setdefault(participant, f"their slot {slot} was given to {takers[slot]}")
    out = withdrawn | excluded.keys()
    slots = {participant: slot for slot, participant in takers.items() if participant not in out}
    return Places(slots, {slot: drawn for slot, drawn in levels.items() if drawn}, excluded, withdrawn)


def study_standing(
    study: Study,
    participants: Sequence[Participant],
    plan: Sequence[Slot],
    log: Sequence[LogEntry],
    sessions: Sequence[StudySession],
    *,
    problems: Sequence[str] = (),
) -> StudyStanding:
    """Compare the plan with what happened.

    :param study: the checked design.
    :param participants: the rows of participants.csv.
    :param plan: the rows in their order; empty: there is no plan yet.
    :param log: all entries of the log, with `missing_entries`.
    :param sessions: from `rise_engine.study.sessions.read_sessions`.
    :param problems: sentences on what blocks all sessions; they come first among the tasks that are due.
    """
    places = places_of(participants, log)
    entries = tuple(each.entry for each in sessions)
    counted = [each for each in entries if each.purpose == "counted"]
    listed = {each.participant for each in participants}
    unlisted = dict.fromkeys(each.participant for each in counted if each.participant not in listed)
    unlisted |= dict.fromkeys(name for name in places.slots if name not in listed)
    kept = tuple(name for name in unlisted if name not in places.withdrawn)
    everybody = [*participants, *map(Participant, kept)]
    standings = tuple(
        _standing_of(study, each, plan, places, [entry for entry in counted if entry.participant == each.participant])
        for each in everybody
    )
    due = [*problems, *_due(standings, plan, sessions, set(unlisted), places.withdrawn)]
    due += due_after_checks(study, entries, log)
    return StudyStanding(
        participants=standings,
        cells=_cells(study, plan, places, standings, _levels_run(study, sessions)),
        complete=sum(each.state == "complete" for each in standings),
        wanted=study.n,
        next="" if problems else _next_of(standings),
        unlisted=kept,
        rehearsals=tuple(each for each in entries if each.purpose != "counted"),
        due=tuple(due),
    )


def missing_consent(study: Study, participant: Participant) -> list[str]:
    """Return the consent columns of participants.csv that need a date and have none."""
    return [f"consent_{name}" for name in study.consent if not participant.consent.get(name)]


def level_text(study: Study, levels: Mapping[str, str]) -> str:
    """Join levels by `+` in the order of the factors: the name of a condition or a cell."""
    return "+".join(levels[factor.name] for factor in study.factors if factor.name in levels)


def describe_entry(entry: SessionEntry) -> str:
    """Describe a session within a sentence: `P03, run 2, attempt 1, begun 2026-11-22 14:15`."""
    return f"{entry.participant}, run {entry.run}, attempt {entry.attempt}, begun {when_text(entry.started)}"


def when_text(moment: str) -> str:
    """Return date and time of day of an ISO 8601 text."""
    try:
        return f"{datetime.fromisoformat(moment):%Y-%m-%d %H:%M}"
    except ValueError:
        return moment


def _standing_of(
    study: Study, participant: Participant, plan: Sequence[Slot], places: Places, sessions: list[SessionEntry]
) -> ParticipantStanding:
    name = participant.participant
    slot = places.slots.get(name)
    row = next((each for each in plan if each.slot == slot), None)
    if row is None and slot is None:
        row = places.free_row(plan, participant.strata)
    runs = (
        len(row.order)
        if row is not None
        else max((len(each.order) for each in plan), default=len(runs_of_design(study)))
    )
    complete = {each.run for each in sessions if each.outcome == "complete"}
    next_run = next((run for run in range(1, runs + 1) if run not in complete), None)
    state, why = _state_of(study, participant, places, sessions, next_run)
    if state in BEGINNABLE and row is None:
        why = _no_row_sentence(plan, participant) if plan else "there is no plan yet"
    begins = state in BEGINNABLE or state == "no-consent"
    return ParticipantStanding(
        participant=name,
        state=state,
        why=why,
        strata=participant.strata,
        slot=slot,
        next_run=next_run if begins else None,
        next_attempt=1 + max((each.attempt for each in sessions if each.run == next_run), default=0),
        runs=runs,
        sessions=tuple(sessions),
    )


def _state_of(
    study: Study, participant: Participant, places: Places, sessions: list[SessionEntry], next_run: int | None
) -> tuple[ParticipantState, str]:
    """Return a participant's state, and what blocks them."""
    name = participant.participant
    if name in places.withdrawn:
        return "withdrawn", "they have withdrawn"
    if name in places.excluded:
        return "excluded", places.excluded[name]
    if running := next((each for each in sessions if each.status == "running"), None):
        return "running", f"begun {when_text(running.started)}"
    if unfinished := next((each for each in sessions if each.status == "unfinished"), None):
        return "unfinished", f"begun {when_text(unfinished.started)}, and its engine has gone"
    if unjudged := next((each for each in sessions if each.outcome is None), None):
        return "to-judge", f"begun {when_text(unjudged.started)}, ended without outcome"
    if next_run is None:
        return "complete", ""
    missing = missing_consent(study, participant)
    why = f"no date in {' and '.join(missing)}" if missing else ""
    if sessions and sessions[-1].outcome == "aborted":
        return "aborted", why
    if sessions:
        return "to-go-on", why
    return ("no-consent" if missing else "waiting"), why


def _no_row_sentence(plan: Sequence[Slot], participant: Participant) -> str:
    rows = sum(in_stratum(row, participant.strata) for row in plan)
    values = {column: participant.strata.get(column, "") for row in plan for column in row.strata}
    stratum = ", ".join(f"{column} {value or '(empty)'}" for column, value in values.items())
    where = f" for {stratum}" if stratum else ""
    return f"all {rows} rows of the plan{where} are taken" if rows else f"the plan has no row{where}"


def _next_of(standings: Sequence[ParticipantStanding]) -> str:
    """Return the first participant who can begin. Those with an aborted session come last."""
    ready = [each for each in standings if each.state in BEGINNABLE and not each.why]
    ready.sort(key=lambda each: each.state == "aborted")
    return ready[0].participant if ready else ""


def _levels_run(study: Study, sessions: Sequence[StudySession]) -> dict[str, dict[str, str]]:
    """Return the between levels of each participant's counted sessions, from the latest journal."""
    between = [factor.name for factor in study.factors if factor.kind == "between"]
    found: dict[str, dict[str, str]] = {}
    for each in sessions:
        if each.info is not None and each.entry.purpose == "counted" and each.info.factors.keys() >= {*between}:
            found[each.entry.participant] = {name: str(each.info.factors[name]) for name in between}
    return found


def _cells(
    study: Study,
    plan: Sequence[Slot],
    places: Places,
    standings: Sequence[ParticipantStanding],
    levels_run: Mapping[str, Mapping[str, str]],
) -> tuple[CellStanding, ...]:
    """Count the participants in each cell: those with sessions by their journals, the others by the plan.

    :param levels_run: the between levels of each participant with sessions.
    """
    by_slot = {each.slot: each for each in standings if each.slot is not None}
    between = [factor.name for factor in study.factors if factor.kind == "between"]
    counts: dict[tuple[tuple[tuple[str, str], ...], str], list[int]] = {}
    rows: Counter[tuple[tuple[str, str], ...]] = Counter()
    for row in plan:
        stratum = tuple(row.strata.items())
        rows[stratum] += 1
        levels = row.levels or places.levels.get(row.slot, {})
        if not between or levels:  # otherwise the cell is not known yet
            count = counts.setdefault((stratum, level_text(study, levels)), [0, 0, 0])
            count[2] += not row.strata and rows[stratum] <= study.n and (not between or bool(row.levels))
        if (holder := by_slot.get(row.slot)) is not None:
            ran = levels_run.get(holder.participant, levels)
            counts.setdefault((stratum, level_text(study, ran)), [0, 0, 0])[holder.state != "complete"] += 1
    return tuple(
        CellStanding(dict(strata), condition, complete, open, planned)
        for (strata, condition), (complete, open, planned) in counts.items()
    )


def _due(
    standings: Sequence[ParticipantStanding],
    plan: Sequence[Slot],
    sessions: Sequence[StudySession],
    unlisted: set[str],
    gone: frozenset[str],
) -> list[str]:
    """List open tasks in sentences. `gone`: the withdrawn participants."""
    due = [
        f"{each.name} was given another label: rise-engine study check says which"
        for each in sessions
        if each.differences
    ]
    for standing in standings:
        name = standing.participant
        for entry in standing.sessions:
            if entry.status == "unfinished" and standing.state == "unfinished":
                due.append(f"{describe_entry(entry)}: its engine has gone; continue it, or give it up")
            elif entry.status == "ended" and entry.outcome is None and standing.state not in ("excluded", "withdrawn"):
                due.append(f"{describe_entry(entry)}: it ended without outcome; say complete, aborted or excluded")
        if name in unlisted:
            continue
        if standing.state == "no-consent":
            due.append(f"{name} has not consented: {standing.why} of participants.csv")
        elif standing.state in BEGINNABLE and standing.why and plan:
            due.append(f"{name} cannot begin: {standing.why}")
    due += [f"{name} is in the study's log, but no longer in participants.csv" for name in sorted(unlisted - gone)]
    due += [
        f"{each.name} of {each.entry.participant} {each.missing}"
        for each in sessions
        if each.info is None and each.entry.participant not in gone
    ]
    return due

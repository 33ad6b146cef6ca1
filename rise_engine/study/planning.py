"""Makes a study's plan once, and again only with a reason. study.jsonl has the hash of the valid plan.

The new plan is written beside the old one, its hash is logged, and then it is moved into place. After an interruption,
the next `rise-engine study plan` completes this.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from msgspec import Struct

from rise_engine import __version__
from rise_engine.base.errors import StudyError
from rise_engine.base.nearest_name import in_backquotes
from rise_engine.scenario.model import Json, Scenario
from rise_engine.study.balance import Balance, prove_balance
from rise_engine.study.model import Participant, Slot, Study
from rise_engine.study.plan import changed_parts, design_of, make_plan
from rise_engine.study.plan_file import (
    NEW_PLAN_FILE,
    PLAN_FILE,
    plan_hash,
    plan_text,
    put_new_plan,
    read_plan,
    set_plan_aside,
    text_hash,
    write_new_plan,
)
from rise_engine.study.standing import places_of
from rise_engine.study.study_log import LockedLog, LogEntry
from rise_engine.study.study_scenarios import scenario_folder


class MadePlan(Struct, frozen=True):
    slots: tuple[Slot, ...]
    balance: Balance
    sentence: str
    """What was done, in a sentence."""


def plan_study(
    study: Study,
    scenarios: Mapping[str, Scenario],
    participants: Sequence[Participant] = (),
    *,
    again: str | None = None,
    anyway: str = "",
) -> MadePlan:
    """Make the plan of a study, or report the existing one.

    Participants who hold a slot keep their row and number in a new plan, with the cell and order that they began with.
    All other rows are new, and their numbers follow the highest slot that was ever taken.

    :param study: the study.
    :param scenarios: the study's scenarios by absolute folder; the log gets their hashes.
    :param participants: from participants.csv, which may exclude some.
    :param again: the reason for a new plan; None: make the first one.
    :param anyway: the reason for planning despite problems of sessions; empty: no problem is known.
    :raises StudyError: there is another plan, or none can be made; one sentence for each problem.
    :raises rise_engine.study.study_log.StudyLogError: the log cannot be read or written.
    """
    folder = Path(study.folder)
    why = {"anyway": anyway} if anyway else {}
    with LockedLog(folder) as log:
        entries = log.entries()
        planned = last_planned(entries)
        if planned is not None and _finish(folder, planned):
            return _read(
                study, "The plan is in its place now: an earlier command had been stopped before it put it there."
            )
        if again is not None:
            return _plan_again(study, scenarios, participants, log, {"reason": again, **why})
        if planned is not None:
            return _keep(study, planned)
        return _plan_first(study, scenarios, log, why)


def last_planned(entries: Sequence[LogEntry]) -> LogEntry | None:
    """Return the entry of the valid plan. None: there is no plan yet."""
    return next((each for each in reversed(entries) if each.kind == "planned"), None)


def held_slots(entries: Sequence[LogEntry], participants: Sequence[Participant]) -> dict[int, str]:
    """Return the holder of each slot: the last who took it, unless excluded or withdrawn."""
    slots = places_of(participants, entries).slots
    return dict(sorted((slot, name) for name, slot in slots.items()))


def scenario_hashes(study: Study, scenarios: Mapping[str, Scenario]) -> dict[str, str]:
    """Return the hash of each scenario of a study, by the folder as written in study.toml."""
    names = dict.fromkeys([study.scenario, *(level.scenario for each in study.factors for level in each.levels)])
    found = {name: scenarios.get(scenario_folder(study, name)) for name in names if name}
    return {name: scenario.hash for name, scenario in found.items() if scenario is not None}


def _plan_first(study: Study, scenarios: Mapping[str, Scenario], log: LockedLog, why: Mapping[str, Json]) -> MadePlan:
    folder = Path(study.folder)
    is_list = study.assignment.between == "list"
    present = plan_hash(folder)
    if is_list:
        if not present:
            raise StudyError(f'with between = "list" you write {PLAN_FILE} yourself, and there is none in {folder}')
        made = _read(study, f"Your {PLAN_FILE} is the plan now.")
        log.append("planned", **_entry_fields(study, scenarios, made.slots, present), **why)
        return made
    slots = make_plan(study)
    text = plan_text(study, slots)
    if present and present != text_hash(text):
        raise StudyError(
            f"{folder / PLAN_FILE} exists, and this program has not made it. If it is meant, write between = "
            f'"list" under [assignment]; if not, move it away'
        )
    if not present:
        write_new_plan(folder, text)
    log.append("planned", **_entry_fields(study, scenarios, slots, text_hash(text)), **why)
    if not present:
        put_new_plan(folder)
    return MadePlan(slots, prove_balance(study, slots), f"Made {folder / PLAN_FILE}.")


def _plan_again(
    study: Study,
    scenarios: Mapping[str, Scenario],
    participants: Sequence[Participant],
    log: LockedLog,
    why: Mapping[str, Json],
) -> MadePlan:
    folder, entries = Path(study.folder), log.entries()
    planned = last_planned(entries)
    if planned is None:
        raise StudyError("there is no plan yet that could be made again; leave --again out")
    holders = held_slots(entries, participants)
    if study.assignment.between == "list":
        return _take_list_again(study, scenarios, log, holders, why)
    if planned.get("design_hash") == study.design_hash and plan_hash(folder) == planned.get("plan_hash"):
        return _take_scenarios(study, scenarios, log, planned, why)
    held = _held_rows(study, planned, holders)
    taken = [int(each.get("slot") or 0) for each in entries if each.kind == "taken"]
    slots = make_plan(study, held, max(taken, default=0) + 1)
    text = plan_text(study, slots)
    write_new_plan(folder, text)
    fields = _entry_fields(study, scenarios, slots, text_hash(text))
    log.append("planned", **fields, **why, kept=[slot.slot for slot in held])
    aside = _put_in_place(folder)
    changed = changed_parts(planned.get("design") or {}, study)
    sentence = f"Made a new {folder / PLAN_FILE}; changed in study.toml: {', '.join(changed) or 'nothing'}."
    sentence += f" The plan before is {aside}." if aside else ""
    if held:
        names = ", ".join(holders[slot.slot] for slot in held)
        sentence += f" These participants keep their slots, with cell and order: {names}."
        if any(part.startswith("factors.") or part == "scenario" for part in changed):
            sentence += (
                " NOTE: conditions now do something else; these participants may have begun with the earlier version."
            )
    return MadePlan(slots, prove_balance(study, slots), sentence)


def _take_scenarios(
    study: Study, scenarios: Mapping[str, Scenario], log: LockedLog, planned: LogEntry, why: Mapping[str, Json]
) -> MadePlan:
    """Keep the plan but accept changed scenarios, for example after a fix. The reason is logged."""
    hashes, before = scenario_hashes(study, scenarios), dict(planned.get("scenarios") or {})
    changed = [name for name, digest in hashes.items() if before.get(name) != digest]
    if not changed:
        raise StudyError("nothing that the plan depends on has changed: the plan stays unchanged")
    what = f"The plan stays unchanged; from now on it means the present {in_backquotes(changed)}, with this robot"
    made = _read(study, f"{what}. Earlier sessions ran the earlier version: each has a copy of it.")
    fields = _entry_fields(study, scenarios, made.slots, plan_hash(Path(study.folder)))
    log.append("planned", **fields, **why)
    return made


def _take_list_again(
    study: Study, scenarios: Mapping[str, Scenario], log: LockedLog, holders: Mapping[int, str], why: Mapping[str, Json]
) -> MadePlan:
    made = _read(study, f"Your {PLAN_FILE} is the plan now.")
    present = plan_hash(Path(study.folder))
    if (planned := last_planned(log.entries())) is not None and planned.get("plan_hash") == present:
        return _take_scenarios(study, scenarios, log, planned, why)
    _refuse_lost(holders, made.slots)
    fields = _entry_fields(study, scenarios, made.slots, present)
    log.append("planned", **fields, **why, kept=list(holders))
    return made


def _held_rows(study: Study, planned: LogEntry, holders: Mapping[int, str]) -> tuple[Slot, ...]:
    """Return the rows that participants hold, from the old plan, if they fit the new design."""
    if not holders:
        return ()
    if plan_hash(Path(study.folder)) != planned.get("plan_hash"):
        raise StudyError(
            f"{PLAN_FILE} is not the file that was planned with, and participants hold slots in it; put it back first"
        )
    loaded = read_plan(study, frozenset(holders))
    if loaded.errors:
        names = ", ".join(dict.fromkeys(holders.values()))
        raise StudyError(
            "\n".join(
                (
                    f"the rows of those who hold a slot ({names}) do not fit into the new design. Participants "
                    "who have begun keep their conditions: put the design back, exclude them "
                    "(`rise-engine study exclude`), or make a new study in another folder",
                    *map(str, loaded.errors),
                )
            )
        )
    slots = loaded.slots or ()
    _refuse_lost(holders, slots)
    return slots


def _refuse_lost(holders: Mapping[int, str], slots: Sequence[Slot]) -> None:
    there = {slot.slot for slot in slots}
    if lost := [f"{name} (slot {slot})" for slot, name in holders.items() if slot not in there]:
        raise StudyError(f"{PLAN_FILE} has no row for {', '.join(lost)}, whose slots they are; put it back")


def _keep(study: Study, planned: LogEntry) -> MadePlan:
    """Return the existing plan if it is unchanged and fits the design."""
    folder = Path(study.folder)
    present, date = plan_hash(folder), planned.at[:10]
    again = "or make a new plan: rise-engine study plan --again REASON"
    if not present:
        if study.assignment.between == "list" or text_hash(text := plan_text(study, make_plan(study))) != planned.get(
            "plan_hash"
        ):
            raise StudyError(f"{folder / PLAN_FILE}, planned on {date}, is gone; put it back, {again}")
        write_new_plan(folder, text)
        put_new_plan(folder)
        return _read(study, f"{folder / PLAN_FILE} was gone; it is made again, the same as on {date}.")
    if problem := plan_problem(study, planned, present):
        raise StudyError(problem)
    return _read(study, f"The plan was made on {date}, and nothing has changed since.")


def plan_problem(study: Study, planned: LogEntry, present: str) -> str:
    """Return why the present plan is not valid, or an empty text.

    :param study: the study now.
    :param planned: the log's last entry of a plan.
    :param present: the hash of plan.csv; empty: there is none.
    """
    when = f" on {planned.at[:10]}" if planned.at else ""
    again = "make a new plan: rise-engine study plan --again REASON"
    if not present:
        return f"{PLAN_FILE}, planned{when}, is gone; put it back"
    if planned.get("design_hash") != study.design_hash:
        parts = in_backquotes(changed_parts(planned.get("design") or {}, study))
        return f"since the plan was made{when}, {parts} of study.toml changed. Put it back, or {again}"
    if planned.get("plan_hash") != present:
        return f"{PLAN_FILE} was changed after it was planned{when}; put it back, or {again}"
    return ""


def _read(study: Study, sentence: str) -> MadePlan:
    loaded = read_plan(study)
    if loaded.slots is None:
        raise StudyError(*map(str, loaded.errors))
    return MadePlan(loaded.slots, prove_balance(study, loaded.slots), sentence)


def _finish(folder: Path, planned: LogEntry) -> bool:
    """Rename a new plan that is already logged. Returns whether there was one."""
    if plan_hash(folder) == planned.get("plan_hash") or plan_hash(folder, NEW_PLAN_FILE) != planned.get("plan_hash"):
        return False
    _put_in_place(folder)
    return True


def _put_in_place(folder: Path) -> str:
    """Rename the new plan to plan.csv. Returns the new name of the old plan, or an empty text."""
    aside = set_plan_aside(folder) if os.path.lexists(folder / PLAN_FILE) else ""
    put_new_plan(folder)
    return aside


def _entry_fields(
    study: Study, scenarios: Mapping[str, Scenario], slots: Sequence[Slot], digest: str
) -> dict[str, Json]:
    return {
        "study_hash": study.hash,
        "design": design_of(study),
        "design_hash": study.design_hash,
        "plan_hash": digest,
        "scenarios": scenario_hashes(study, scenarios),
        "slots": len(slots),
        "program": __version__,
    }

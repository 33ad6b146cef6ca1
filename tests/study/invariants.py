"""What must hold of a study's files after every step of a day, whatever was killed: worked out anew from the files."""

from __future__ import annotations

import csv
import json
import tomllib
from pathlib import Path
from typing import Any

from rise_engine.kernel.inputs import SessionStarted
from rise_engine.session.journal_format import InputLine, LineError, read_line
from rise_engine.study.study_log import WITHDRAWN_PREFIX


def log_lines(folder: Path) -> list[dict[str, Any]]:
    """The whole lines of study.jsonl."""
    try:
        text = (folder / "study.jsonl").read_text("utf-8")
    except FileNotFoundError:
        return []
    return [json.loads(line) for line in text.split("\n")[:-1] if line]


def first_input(path: Path) -> SessionStarted | None:
    """What a session began with; None: nothing ever happened in it."""
    try:
        lines = (path / "journal.jsonl").read_bytes().split(b"\n")
        found = read_line(lines[1]) if len(lines) > 2 else None
    except (FileNotFoundError, LineError):
        return None
    return found.input if isinstance(found, InputLine) and isinstance(found.input, SessionStarted) else None


def begun_sessions(folder: Path) -> list[dict[str, Any]]:
    """What session.toml says of every session that began, with its folder's name."""
    found = []
    for path in sorted((folder / "sessions").glob("*")):
        if first_input(path) is not None:
            found.append({**tomllib.loads((path / "session.toml").read_text("utf-8")), "folder": path.name})
    return found


def _is_free(holder: str | None, out: set[str]) -> bool:
    return holder is None or holder in out or holder.startswith(WITHDRAWN_PREFIX)


def check_day(folder: Path) -> None:
    """No row is taken twice, none is passed over, nobody has two, and every session is what the plan says.

    :raises AssertionError: something of that is not so.
    """
    plan = {int(row["slot"]): row for row in csv.DictReader((folder / "plan.csv").read_text("utf-8").splitlines())}
    order = list(plan)
    holder: dict[int, str] = {}
    slot_of: dict[str, int] = {}
    out: set[str] = set()
    for line in log_lines(folder):
        who = line.get("participant")
        if line["kind"] == "excluded" or (line["kind"] == "outcome" and line["status"] == "excluded"):
            out.add(who)
        elif line["kind"] == "taken":
            slot = line["slot"]
            assert _is_free(holder.get(slot), out), f"slot {slot} of {holder[slot]} was taken by {who}"
            assert who not in slot_of, f"{who} has the slots {slot_of[who]} and {slot}"
            assert who not in out, f"{who} was out and took slot {slot}"
            for earlier in order[: order.index(slot)]:  # when somebody withdrew, the log does not say any more
                named = holder.get(earlier) or ""
                held = bool(named) and (named not in out or named.startswith(WITHDRAWN_PREFIX))
                assert held, f"{who} took slot {slot} although {earlier} was free"
            holder[slot], slot_of[who] = who, slot
    seen: set[tuple[str, int, int]] = set()
    for info in begun_sessions(folder):
        if info["purpose"] != "counted":
            assert info["slot"] == 0
            continue
        who, run = info["participant"], info["run"]
        started = first_input(folder / "sessions" / info["folder"])
        assert started is not None
        known = slot_of.get(who, info["slot"])  # a killed engine's `taken` may still be missing, never another slot
        assert info["slot"] == known == started.slot, f"{who} holds {known} and had a session in slot {info['slot']}"
        within = plan[known]["order"].split()[run - 1]
        assert info["condition"] == started.condition == f"{plan[known]['hesitation']}+{within}"
        assert started.memory == {
            "hesitation": plan[known]["hesitation"] == "yes",
            "noise": {"quiet": 0, "loud": 3}[within],
        }
        key = (who, run, info["attempt"])
        assert key not in seen, f"{key} was begun twice"
        seen.add(key)

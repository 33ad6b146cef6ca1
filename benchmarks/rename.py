"""Renaming everywhere, as in the editor (planned, applied, checked and proved): LabLinking, and twenty copies of it.
The floor: search the name in all files, and replace it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from check_edit import many, study
from measure import Report, interleave

from rise_engine.author.edit.edits import Rename
from rise_engine.author.edit.plan import StudyState, apply_plan
from rise_engine.author.edit.planning import plan
from rise_engine.scenario.checker import ScenarioChecker

RENAMES = (
    Rename("act", "R_Yes", "R_Certainly"),
    Rename("rule", "Next", "Go on"),
    Rename("key", "pause_ms", "pause"),
    Rename("event", "next", "go_on"),
)


def renaming(files: Mapping[str, bytes], edit: Rename) -> tuple[Callable[[], None], Callable[[], None]]:
    """Seconds of a rename; and the floor."""
    checker = ScenarioChecker("/nowhere")
    folder = Path("/nowhere")
    before = StudyState(files, checker.check(files), folder)
    assert before.checked.scenario is not None

    def ours() -> None:
        after = apply_plan(files, plan(edit, before))
        assert checker.check(after).scenario is not None

    def least() -> None:
        for data in files.values():
            data.decode().replace(edit.old, edit.new).encode()

    return ours, least


def main() -> bool:
    report = Report("Renaming everywhere")
    files = study()
    names = {"act": "R0_Yes", "rule": "Next__0", "key": "pause_ms", "event": "next"}
    twenty = many(files, 20)
    for edit in RENAMES:
        more = Rename(edit.kind, names[edit.kind], edit.new)
        for title, held, each in (("LabLinking", files, edit), ("20 x LabLinking", twenty, more)):
            ours, least = renaming(held, each)
            figures = interleave({"ours": (ours, 1), "floor": (least, 1)}, rounds=5)
            report.row(f"{title}, {edit.kind} {each.old}: floor", f"{figures['floor'].median * 1000:.2f} ms")
            if held is files:
                report.target(f"{title}, {edit.kind} {each.old}, ms", figures["ours"].median * 1000, 50, at_least=False)
            else:
                report.row(f"{title}, {edit.kind} {each.old}", f"{figures['ours'].median * 1000:.1f} ms")
    return report.met


if __name__ == "__main__":
    sys.exit(not main())

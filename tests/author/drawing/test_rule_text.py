"""What a block does: with the memory's present values, only what would happen now."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rise_engine.author.drawing.rule_text import functions_in
from tests.kernel.harness import dialog, pause, read, write
from tests.kernel.test_rules import do, rule, state


def branch(condition: str, *functions: str) -> str:
    return f'<if cond="{condition}">{"".join(functions)}<else>{do("startCommunicationRobotAct", "Other")}</else></if>'


SAY, ALSO = (do("startCommunicationRobotAct", name) for name in ("Hm", "Other"))
SET = do("assignValue", "quiet = false")


@pytest.mark.parametrize(
    ("entry", "memory", "found"),
    [
        (branch("quiet", SAY), None, [("Hm", False), ("Other", False)]),
        (branch("quiet", SAY), {"quiet": True}, [("Hm", True)]),
        (branch("quiet", SAY), {"quiet": False}, [("Other", True)]),
        (branch("quiet", SAY), {}, [("Other", True)]),
        (SET + branch("quiet", SAY), {"quiet": True}, [("quiet = false", True), ("Hm", False), ("Other", False)]),
        (
            branch("quiet", SET) + branch("quiet", SAY),
            {"quiet": True},
            [("quiet = false", True), ("Hm", False), ("Other", False)],
        ),
        (f"<oneOf>{SAY}{ALSO}</oneOf>", {"quiet": True}, [("Hm", False), ("Other", False)]),
    ],
)
def test_only_what_would_happen_now(
    tmp_path: Path, entry: str, memory: dict[str, Any] | None, found: list[tuple[str, bool]]
) -> None:
    acts = dialog("Hm", pause(1, 0)) + dialog("Other", pause(1, 0))
    study = read(write(tmp_path, acts=acts, rules=rule("Main", state("a", entry)), memory={"quiet": True}))
    block = study.rules["Main"].states["a"].on_entry
    assert [(function.argument, sure) for function, sure in functions_in(block, memory=memory)] == found

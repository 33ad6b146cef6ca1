"""The pane that docs/how-to/extend-the-program.md shows as an example."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from rise_engine.kernel.records import RobotRecord
from rise_tui.actions import bindings_in
from rise_tui.panes.pane import ListPane
from rise_tui.rendering.text import ListRow, plain_text
from tests.tui.conftest import console

PAGE = Path(__file__).parents[3] / "docs/how-to/extend-the-program.md"


async def test_it_is_one() -> None:
    (code,) = re.findall(r"```python\n( +class RobotPane.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    names: dict[str, Any] = {"ListPane": ListPane, "ListRow": ListRow, "bindings_in": bindings_in}
    exec("if True:\n" + code, names)
    async with console() as it:
        pane = names["RobotPane"](it.screen.store)
        await it.screen.mount(pane)
        await it.pilot.pause()
        pane.repaint()
        assert "ROBOT" in pane.title.text and pane.row_list.text.strip() == "the link is connected"
        it.client.emit(RobotRecord(0, 0.0, "", status="lost", detail=""))
        await it.pilot.pause()
        assert [plain_text(row.line) for row in pane.make_rows(40)] == [" the link is lost"]

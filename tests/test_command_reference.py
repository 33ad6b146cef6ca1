"""The reference pages of both programs have every command and option."""

from __future__ import annotations

import pytest

from docs.commands import MARK, PAGES, PROGRAMS, is_marked, leaves, page_text


@pytest.mark.parametrize("program", PAGES)
def test_the_page_is_up_to_date(program: str) -> None:
    text = PAGES[program].read_text("utf-8")
    assert page_text(program, text) == text, "write it: .venv/bin/python -m docs.commands"


@pytest.mark.parametrize("program", PAGES)
def test_the_page_has_every_command_once(program: str) -> None:
    marks = [name for _, kind, name, _ in MARK.findall(PAGES[program].read_text("utf-8")) if kind == "command"]
    found = {
        each.command_path: [name for name in marks if is_marked(name, each.command_path)]
        for each in leaves(PROGRAMS[program], program)
    }
    assert [command for command, named in found.items() if len(named) != 1] == []

"""What a page says is what is done."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.tutorials.player import Step, key_bytes, play, steps_of
from tests.tutorials.shell import shell

PAGE = """# A page

Words with a **bold** one and `code` in them are for reading.

    rise-engine check .   # a remark

1. Press **a**, type `Hello!` and press **ctrl+o**. You
   see `saved`; you see no `error`.
2. Press **esc**.

```
Press **x**.
```

Not a step: **y**.
"""


def test_the_steps_of_a_page() -> None:
    assert list(steps_of(PAGE)) == [
        Step("command", "rise-engine check .", 5),
        Step("key", "a", 7),
        Step("typed", "Hello!", 7),
        Step("key", "ctrl+o", 7),
        Step("seen", "saved", 7),
        Step("gone", "error", 8),
        Step("key", "esc", 9),
    ]


def test_what_terminals_send() -> None:
    assert [key_bytes(name) for name in ("a", "enter", "ctrl+o", "F9", "?")] == [
        b"a",
        b"\r",
        b"\x0f",
        b"\x1b[20~",
        b"?",
    ]
    with pytest.raises(ValueError, match="`entr` is no key"):
        key_bytes("entr")


@pytest.mark.pty
def test_what_is_not_there_is_told_with_its_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.tui.terminals.PATIENCE", 3.0)
    page = "    echo one two\n\n1. You see `one two`.\n2. You see `three`.\n"
    with shell(tmp_path) as terminal, pytest.raises(AssertionError, match=r"line 4 of the page.*'three' is not"):
        play(page, terminal)


@pytest.mark.pty
def test_a_window_that_is_closed_is_gone_and_its_computer_is_not(tmp_path: Path) -> None:
    page = """
    ssh lab
    echo here > left; echo one''two

1. You see `onetwo`.
2. **close the window**

    cat left

3. You see `here`; you see no `onetwo`.
"""
    with shell(tmp_path) as terminal:
        play(page, terminal)


@pytest.mark.pty
def test_what_stood_before_a_full_screen_program_stands_there_after_it(tmp_path: Path) -> None:
    page = """
    echo be''fore; printf '\\033[?1049h'; echo with''in; read; printf '\\033[?1049l'; echo af''ter

1. You see `within`; you see no `before`.
2. Press **enter**. You see `before`; you see `after`; you see no `within`.
"""
    with shell(tmp_path) as terminal:
        play(page, terminal)

"""The path from Textual's painting to the terminal, and from the terminal to Textual's keys.

Only this package uses undocumented parts of Textual (`tests/tui/terminal/test_private.py`). `docs/decisions/0024` lists
them, and `tests/tui/terminal/test_rendering.py` shows what breaks when a release changes one.

- `terminal_app`: an app that writes only the cells that differ, and sees every key before anything acts on it.
- `cell_buffer`: finds these cells.
- `terminal_driver`: the terminal itself.
"""

"""From what Textual paints to what the terminal gets, and from the terminal to Textual's keys.

All that the console needs of Textual and Textual does not document is used in this package, and in no other
(`tests/tui/terminal/test_private.py`); `docs/decisions/0024` lists it, and
`tests/tui/terminal/test_rendering.py` says for each detail what breaks when a release changes it.

- `terminal_app`: an app that writes only the cells that differ, and sees every key before anything acts on it.
- `diff`, `cell_buffer`: which cells those are.
- `terminal_driver`, `terminal_reader`, `terminal_writer`: the terminal itself.
- `modal`: dialogs that close once.
"""

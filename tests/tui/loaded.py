"""What a console and an editor have loaded when they are there, with the colours of the terminals that tests open.

An editor at such a terminal explores nothing scheduled: what it would find would be painted while bytes are counted.
"""

from __future__ import annotations

import os
from importlib import import_module

from rise_tui.config.display import DisplayOptions, prepare_textual

os.environ |= {"TERM": "xterm-256color", "COLORTERM": "truecolor"}
prepare_textual(DisplayOptions())  # Textual reads it when it is imported
for _module in (
    "cli.open_console",
    "cli.study_folder",
    "cli.edit",
    "cli.info",
    "cli.key_card",
    "editor.screen",
    "editor.study",
):
    import_module(f"rise_tui.{_module}")

explore_saved = import_module("rise_tui.editor.study").explore_saved
explore_saved.__kwdefaults__["after"] = 24 * 60 * 60

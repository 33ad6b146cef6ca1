"""Runs all benchmarks: `./dev bench`, or `./dev bench kernel_events guards`. Exit status 1: a target was missed."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

ALL = (
    *(
        "kernel_events",
        "many_rules",
        "guards",
        "rule_file",
        "check_edit",
        "rename",
        "edit_steps",
        "lsp_typing",
        "check_start",
    ),
    *(
        "journal",
        "acknowledge",
        "commands_under_load",
        "bad_clients",
        "attach",
        "start_console",
        "ros",
        "memory",
        "log",
    ),
    *("console_keys", "console_bytes", "console_day", "editor", "exports", "long_session", "marks", "explore"),
)

names = sys.argv[1:] or ALL
unknown = [name for name in names if name not in ALL]
if unknown:
    sys.exit(f"no benchmark called {', '.join(unknown)}; there are: {', '.join(ALL)}")
results = {name: bool(import_module(name).main()) for name in names}
missed = [name for name, met in results.items() if not met]
print("\nAll targets met." if not missed else f"\nTargets missed in: {', '.join(missed)}")
sys.exit(bool(missed))

"""The import contracts of pyproject.toml, proved once more: by reading the sources, and by looking at what is loaded.

An import linter sees what is written as an import. These tests see what a running engine has in memory.
"""

from __future__ import annotations

import ast
import json
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import rise_engine
from tests.sources import ROOT, circles, classes, dead_files, dead_names, dead_sections, facts, modules, nodes, parsed

FOREIGN = {"textual", "rich", "rclpy", "rise_tui", "rise_adapters", "rise_exchange"}
"""What must never be loaded with the engine."""
IMPURE_MODULES = {
    *("asyncio", "concurrent", "datetime", "http", "io", "locale", "logging", "multiprocessing", "os", "pathlib"),
    *("platform", "queue", "random", "sched", "secrets", "select", "selectors", "shutil", "signal", "socket"),
    *("subprocess", "sys", "tempfile", "threading", "time", "urllib", "uuid"),
}
IMPURE_CALLS = {"open", "print", "input", "exec", "eval", "compile", "__import__", "id", "breakpoint"}
"""Builtins that do I/O, run text as code, or differ from one process to the next."""


def files(package: str) -> list[Path]:
    return [file for name, file in modules().items() if f"{name}.".startswith(f"{package}.")]


def imported(tree: ast.AST, package: str) -> set[str]:
    """Top-level names of what a module imports; `rise_engine.run.engine.engine` in full."""
    names: set[str] = set()
    for node in nodes(tree):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            names.add(node.module or "")
    return names


def loaded_by(code: str) -> set[str]:
    """Names in sys.modules after `code` has run in a Python of its own."""
    result = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport json, sys; sys.stderr.write(json.dumps(sorted(sys.modules)))"],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=60,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return set(json.loads(result.stderr.splitlines()[-1]))


def foreign(loaded: set[str]) -> set[str]:
    return {name for name in loaded if name.partition(".")[0] in FOREIGN}


def all_modules() -> list[str]:
    return [
        module.name
        for module in pkgutil.walk_packages(rise_engine.__path__, "rise_engine.")
        if "__main__" not in module.name
    ]


def test_the_kernel_loads_no_reader_of_files() -> None:
    assert not loaded_by("import rise_engine.kernel") & {"lxml", "rise_engine.scenario.loader", "rise_engine.session"}


def test_the_whole_engine_loads_no_console_adapter_or_ros() -> None:
    assert "rise_engine.cli" in all_modules()
    assert foreign(loaded_by("\n".join(f"import {name}" for name in all_modules()))) == set()


@pytest.mark.parametrize("scenario", ["greeting", "lablinking"])
def test_checking_a_scenario_loads_of_ros_only_what_reads_profiles(scenario: str) -> None:
    code = f"from rise_engine.cli import main\nmain(['check', 'scenarios/{scenario}'], standalone_mode=False)"
    try_exit = "try:\n    " + code.replace("\n", "\n    ") + "\nexcept SystemExit as exit:\n    assert not exit.code"
    reads = ("rise_adapters.robots", "rise_adapters.ros2.mapping", "rise_adapters.ros2.profile_check")
    loaded = foreign(loaded_by(try_exit)) - {"rise_adapters", "rise_adapters.ros2"}
    more = {name for name in loaded if not name.startswith((*reads, "rise_adapters.ros2.transport"))}
    assert more == set() and not {name for name in loaded if "transport.dds" in name}


def test_the_client_that_a_console_holds_brings_no_engine_along() -> None:
    loaded = loaded_by("import rise_engine.run.protocol.client")
    assert {"rise_engine.run.engine.engine", "rise_engine.kernel.kernel", "asyncio"} & loaded <= {
        "rise_engine.kernel.kernel"
    }


def test_a_console_loads_the_editor_when_it_opens_and_not_before() -> None:
    loaded = loaded_by("import rise_tui.console.app")
    late = ("rise_tui.editor", *(f"rise_engine.author.{name}" for name in ("edit", "explore", "trial", "lsp", "texts")))
    assert {name for name in loaded if name.startswith(late)} == set()


@pytest.mark.parametrize(
    "file", files("rise_engine.kernel") + files("rise_engine.expression"), ids=lambda file: file.stem
)
def test_the_kernel_and_the_expressions_are_pure(file: Path) -> None:
    tree = parsed(file)
    names = imported(tree, "rise_engine")
    assert {name for name in names if name.partition(".")[0] in IMPURE_MODULES} == set()
    allowed = {"base", "expression", "kernel", "scenario"}
    assert {name for name in names if name.startswith("rise_engine.") and name.split(".")[1] not in allowed} == set()
    calls = {node.func.id for node in nodes(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
    assert calls & IMPURE_CALLS == set()


@pytest.mark.slow
def test_every_module_says_what_it_is_for() -> None:
    missing = [
        str(file.relative_to(ROOT))
        for file in modules().values()
        if file.stat().st_size and facts(file).docstring is None
    ]
    assert missing == []


# --- one house --------------------------------------------------------------------------------------------------------


def test_no_class_name_stands_for_two_classes() -> None:
    """Private ones and those in classes and functions included: who searches for a name finds one place."""
    where: dict[str, list[str]] = {}
    for name, module in classes():
        where.setdefault(name, []).append(module)
    assert {name: found for name, found in where.items() if len(found) > 1} == {}


@pytest.mark.parametrize("types", [False, True], ids=["run time", "types too"])
def test_no_files_import_one_another_in_a_circle(types: bool) -> None:
    """Imports in functions count as well: they hide a circle, and do not open it."""
    assert circles(types=types) == []


def test_no_file_that_a_docstring_names_is_missing() -> None:
    assert [str(each) for each in dead_files(modules().values())] == []


def test_no_name_in_a_docstring_leads_nowhere() -> None:
    """Modules, classes, functions and attributes in backticks."""
    assert [str(each) for each in dead_names(modules().values())] == []


def test_no_section_that_a_docstring_cites_is_missing() -> None:
    assert [str(each) for each in dead_sections(modules().values())] == []


def test_what_leads_nowhere_would_be_found(tmp_path: Path) -> None:
    file = tmp_path / "module.py"
    file.write_text(
        '''"""`rise_engine.nowhere.Thing`, `NoSuchThing`, `Kernel.no_such_method`, `rise_engine.kernel.kernel.Kernel`;
docs/nowhere.md, docs/README.md (semantics, sections 98 and 99.1; semantics.md 97)."""''',
        encoding="utf-8",
    )
    found = [each for finder in (dead_names, dead_files, dead_sections) for each in finder([file])]
    assert [(each.line, each.text) for each in found] == [
        *((1, "rise_engine.nowhere.Thing"), (1, "NoSuchThing"), (1, "Kernel.no_such_method")),
        (2, "docs/nowhere.md"),
        *((2, "semantics 98"), (2, "semantics 99.1"), (2, "semantics 97")),
    ]

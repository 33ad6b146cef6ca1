"""How large the tree is, and how far one thing goes through it: `./dev shape`. All of it is measured.

    ./dev shape                 a table of everything that is measured, and of what is wanted
    ./dev shape key             one walk (`WALKS`): its files, and how many functions of each

A walk is played in a Python of its own, so that nothing has been read before. `sys.setprofile` counts what is called.
"""

from __future__ import annotations

import ast
import asyncio
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from inspect import CO_OPTIMIZED
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

from tests.sources import PACKAGES, ROOT, imports, modules, parsed

LABLINKING = ROOT / "scenarios" / "lablinking"
EDITOR = ("rise_engine/author/edit", "rise_engine/author/lsp", "rise_tui/editor")
WANTED = {
    "production code, lines": "<= 105,000",
    "production code, files": "<= 480",
    "of it the editor (edit, editing, lsp), lines": "<= 12,500",
    "walk key": "<= 50, <= 300",
    "walk sentence": "<= 20, <= 150",
    "walk load": "<= 25",
    "walk bids": "<= 35",
    "`rise-engine --help`, CPU seconds": "<= 0.4",
    "`import rise_engine.kernel`, own modules": "<= 60, no lxml",
    "import layers of the engine": "<= 12",
    "exception classes": "<= 40",
    "modules with one importer, in their own package": "<= 60",
    "tests, lines": "<= 80,000",
    "documentation, words": "<= 90,000",
    "CONTRIBUTING, words": "<= 1,800",
}


# --- walks ------------------------------------------------------------------------------------------------------------


@contextmanager
def calls() -> Iterator[set[tuple[str, str]]]:
    """The file and the name of everything of ours that is called, on threads that begin meanwhile, too."""
    seen: set[CodeType] = set()

    def profile(frame: FrameType, event: str, _argument: object) -> None:
        if event == "call" and frame.f_code.co_flags & CO_OPTIMIZED:  # not the body of a module or a class
            seen.add(frame.f_code)

    found: set[tuple[str, str]] = set()
    threading.setprofile(profile)
    sys.setprofile(profile)
    try:
        yield found
    finally:
        sys.setprofile(None)
        threading.setprofile(None)  # type: ignore[arg-type]
        for code in seen:
            path = Path(code.co_filename)
            if any(path.is_relative_to(base / package) for package, base in PACKAGES.items()):
                found.add((str(path.relative_to(ROOT)), code.co_qualname))


def walk_key(place: Path) -> set[tuple[str, str]]:
    """One key in the console, to the simulated robot and back, until the row of its act says that it is done."""
    from rise_engine.base.files import Disk
    from rise_engine.run.protocol.session_options import SessionOptions
    from rise_engine.scenario.model import Scenario
    from rise_tui.config.launch import Launcher, load_scenario
    from rise_tui.console.app import ConsoleApp
    from tests.run.server.serving import OwnSession
    from tests.tui.conftest import Console
    from tests.tui.fake import DEMO, FakeClient, FakeLauncher, demo

    async def press() -> set[tuple[str, str]]:
        settings = SessionOptions(DEMO, seed=1)
        scenario = load_scenario(settings)
        assert isinstance(scenario, Scenario)
        launcher = Launcher(
            start=lambda scenario, settings: OwnSession(place, Path(settings.folder), speed=20, disk=Disk())
        )
        app = ConsoleApp(launcher.start(scenario, settings), settings=settings, wizard="anna", launcher=launcher)
        async with app.run_test(size=(200, 50)) as pilot:
            it = Console(pilot, FakeClient(demo()), FakeLauncher())
            await it.until(lambda: app.console_screen is not None and "Greet" in it.text("acts"))
            with calls() as called:
                await it.press("g")
                await it.until(lambda: "✓ done" in it.row("acts", "Greet"))
            await it.screen.session.close(end_session=True)
        return called

    return asyncio.run(press())


def walk_sentence(place: Path) -> set[tuple[str, str]]:
    """One sentence changed in the editor, to the plan of its bytes."""
    from rise_engine.author.edit.edits import SetParameter
    from rise_engine.author.edit.workspace import Workspace

    shutil.copytree(ROOT / "scenarios" / "greeting", place / "greeting")
    study = Workspace(place / "greeting")
    assert study.checked.errors == []
    with calls() as called:
        study.apply(SetParameter("R_Introduction", "1", "message", "I am Floka."))
    study.close()
    return called


def walk_load(_place: Path) -> set[tuple[str, str]]:
    """A scenario's folder, to the checked scenario."""
    from rise_engine.scenario.loader import load

    with calls() as called:
        assert load(LABLINKING).scenario is not None
    return called


def walk_study(place: Path) -> set[tuple[str, str]]:
    """A study's folder, to who comes next."""
    from rise_engine.study.state import read_state
    from tests.results.analysis.samples import make_study

    study = make_study(place / "study")
    with calls() as called:
        assert read_state(study).standing.complete
    return called


def walk_bids(place: Path) -> set[tuple[str, str]]:
    """A journal, to a first export as BIDS."""
    from rise_engine.results.analysis.reading import read_session
    from rise_engine.results.export.format import ExportContext, load_format
    from tests.results.analysis.samples import play_session

    session = play_session(place / "sessions")
    with calls() as called:
        load_format("bids").write(place / "bids", [read_session(session)], ExportContext("full"))
    return called


WALKS: dict[str, tuple[str, Callable[[Path], set[tuple[str, str]]]]] = {
    "key": ("one key in the console to the simulated robot and back, with repaints", walk_key),
    "sentence": ("one sentence changed in the editor, to the plan of its bytes", walk_sentence),
    "load": ("scenario folder to checked scenario", walk_load),
    "study": ("study folder to who comes next", walk_study),
    "bids": ("journal to a first BIDS export", walk_bids),
}


def walked(name: str) -> list[tuple[str, str]]:
    """The files and functions of a walk that is played in a Python of its own."""
    told = _run("-m", "tests.shape", "--walk", name).stdout
    return [(file, function) for file, function in json.loads(told.splitlines()[-1])]


def _play(name: str) -> None:
    with tempfile.TemporaryDirectory(prefix="rise-shape-", dir="/tmp") as place:
        os.environ |= {"RISE_SESSIONS": f"{place}/s", "RISE_RUNTIME": f"{place}/r", "XDG_STATE_HOME": f"{place}/x"}
        called = WALKS[name][1](Path(place))
    print(json.dumps(sorted(called)))


def _run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=True)


# --- the tree ---------------------------------------------------------------------------------------------------------


def _lines(folder: Path) -> tuple[int, int]:
    """Lines and files of Python."""
    files = list(folder.rglob("*.py"))
    return sum(len(file.read_bytes().splitlines()) for file in files), len(files)


def _words(*paths: Path) -> int:
    return sum(len(path.read_text("utf-8").split()) for path in paths)


def only_importers() -> list[str]:
    """Modules that one other module alone imports, which lies in the same folder."""
    importers: dict[str, set[str]] = {}
    for module in modules():
        for name in imports(module, types=True):
            importers.setdefault(name, set()).add(module)
    return [
        name
        for name, known in sorted(importers.items())
        if len(known) == 1 and modules()[name].parent == modules()[next(iter(known))].parent
    ]


def _exceptions() -> int:
    heads = [node for file in modules().values() for node in ast.walk(parsed(file)) if isinstance(node, ast.ClassDef)]
    known = {"Exception", "BaseException", "ValueError", "OSError", "RuntimeError", "LookupError", "ConnectionError"}
    while (
        more := {each.name for each in heads if known & {ast.unparse(base).rpartition(".")[2] for base in each.bases}}
        - known
    ):
        known |= more
    return len({each.name for each in heads} & known)


def _help_seconds() -> float:
    """CPU seconds of `rise-engine --help`, the least of three."""

    def spent() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    times = []
    for _ in range(3):
        before = spent()
        _run("-m", "rise_engine", "--help")
        times.append(spent() - before)
    return min(times)


def rows() -> Iterator[tuple[str, str]]:
    """Each row of the table: what is measured, and what there is today."""
    sizes = {package: _lines(base / package) for package, base in PACKAGES.items()}
    each = ", ".join(f"{package} {lines:,}" for package, (lines, _) in sizes.items())
    yield "production code, lines", f"{sum(lines for lines, _ in sizes.values()):,} ({each})"
    yield "production code, files", f"{sum(files for _, files in sizes.values()):,}"
    yield "of it the editor (edit, editing, lsp), lines", f"{sum(_lines(ROOT / part)[0] for part in EDITOR):,}"
    for name, (what, _) in WALKS.items():
        found = walked(name)
        yield f"walk {name}", f"{len({file for file, _ in found})} files, {len(found)} functions: {what}"
    yield "`rise-engine --help`, CPU seconds", f"{_help_seconds():.2f}"
    code = "import sys, rise_engine.kernel; print(sum(m[:5] == 'rise_' for m in sys.modules), 'lxml' in sys.modules)"
    own, has_lxml = _run("-c", code).stdout.split()
    yield "`import rise_engine.kernel`, own modules", f"{own}, {'with' if has_lxml == 'True' else 'without'} lxml"
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"]
    layers: list[Any] = max((each.get("layers", []) for each in contracts), key=len)
    excepted = sum(len(each.get("ignore_imports", [])) for each in contracts)
    yield "import layers of the engine", f"{len(layers)}, {excepted} imports excepted"
    yield "exception classes", f"{_exceptions()}"
    yield "modules with one importer, in their own package", f"{len(only_importers())}"
    yield "tests, lines", f"{_lines(ROOT / 'tests')[0]:,}"
    pages = [*(ROOT / "docs").rglob("*.md"), *(ROOT / "scenarios").rglob("*.md"), *ROOT.glob("*.md")]
    yield "documentation, words", f"{_words(*pages):,}"
    yield "CONTRIBUTING, words", f"{_words(ROOT / 'CONTRIBUTING.md'):,}"


def main() -> None:
    """Print the table, or the files of the walks that are named."""
    arguments = sys.argv[1:]
    if arguments[:1] == ["--walk"]:
        _play(arguments[1])
        return
    if unknown := [name for name in arguments if name not in WALKS]:
        sys.exit(f"no walk is called {', '.join(unknown)}; there are: {', '.join(WALKS)}")
    for name in arguments:
        for file, functions in sorted(Counter(file for file, _ in walked(name)).items()):
            print(f"{functions:4} {file}")
    if not arguments:
        print("| measured | today | wanted |\n|---|---|---|")
        for what, today in rows():
            print(f"| {what} | {today} | {WANTED.get(what, '')} |", flush=True)


if __name__ == "__main__":
    main()

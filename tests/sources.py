"""The production code as text: its files, what they define, what they import, and what their docstrings refer to."""

from __future__ import annotations

import ast
import gc
import re
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PACKAGES = {
    "rise_engine": ROOT,
    "rise_tui": ROOT,
    "rise_adapters": ROOT / "adapters",
    "rise_exchange": ROOT / "adapters",
}
"""Each package, and the folder that it lies in."""


def parsed(file: Path) -> ast.Module:
    """Collects no garbage meanwhile, which some releases of Python 3.11 do not survive (python/cpython#106905).

    Nobody keeps the trees: those of all files are so large that each collection of garbage takes a second more.
    """
    gc.disable()
    try:
        return ast.parse(file.read_text(encoding="utf-8"))
    finally:
        gc.enable()


def nodes(tree: ast.AST) -> Iterator[ast.AST]:
    """As `ast.walk`, in less time: a node before what is in it, and without the contexts of names."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        for field in node._fields:
            value = getattr(node, field, None)
            if isinstance(value, list):
                waiting += [each for each in reversed(value) if isinstance(each, ast.AST)]
            elif isinstance(value, ast.AST) and field != "ctx":
                waiting.append(value)


@cache
def modules() -> dict[str, Path]:
    """Every module by its dotted name; a package by the name of its folder."""
    found = {}
    for package, base in PACKAGES.items():
        for file in sorted((base / package).rglob("*.py")):
            parts = file.relative_to(base).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


class Class(NamedTuple):
    name: str
    bases: list[str]
    docstring: str | None


class Facts(NamedTuple):
    """What a file has, from one way through its tree."""

    docstring: str | None
    classes: list[Class]
    """Also private ones, and those in classes and functions."""
    docstrings: list[tuple[int, str]]
    """Every string that stands for itself, with its first line: of modules, classes, functions and attributes."""
    names: set[str]
    """Everything that is named: defined, used, given as an argument, imported."""
    texts: list[str]
    """The strings that its code works with."""
    imports: list[ast.Import | ast.ImportFrom]
    for_types: set[int]
    """Which of `imports` are only for types, by their place in it."""


@cache
def facts(file: Path) -> Facts:
    tree = parsed(file)
    found = Facts(ast.get_docstring(tree), [], [], set(), [], [], set())
    described: set[ast.expr] = set()
    typing: set[ast.AST] = set()
    for node in nodes(tree):
        if isinstance(node, ast.Name):
            found.names.add(node.id)
        elif isinstance(node, ast.Attribute):
            found.names.add(node.attr)
        elif isinstance(node, ast.Constant):
            if isinstance(node.value, str) and node not in described:
                found.texts.append(node.value)
        elif isinstance(node, ast.Expr):
            if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
                described.add(node.value)
                found.docstrings.append((node.lineno, node.value.value))
        elif isinstance(node, ast.arg | ast.keyword):
            found.names.add(node.arg or "")
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.names.add(node.name)
            if isinstance(node, ast.ClassDef):
                bases = [ast.unparse(base) for base in node.bases]
                found.classes.append(Class(node.name, bases, ast.get_docstring(node)))
        elif isinstance(node, ast.alias):
            found.names.update(node.name.split("."))
        elif isinstance(node, ast.Import | ast.ImportFrom):
            if node in typing:
                found.for_types.add(len(found.imports))
            found.imports.append(node)
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in (getattr(node.test, at, "") for at in ("id", "attr")):
            typing.update(inner for each in node.body for inner in nodes(each))
    return found


def classes() -> Iterator[tuple[str, str]]:
    """Name and module of every class."""
    for module, file in modules().items():
        for node in facts(file).classes:
            yield node.name, module


# --- imports ----------------------------------------------------------------------------------------------------------


@cache
def imports(module: str, *, types: bool) -> set[str]:
    """The modules of ours that it imports sooner or later, in functions too; with `types` also those for types only."""
    found: set[str] = set()
    known = facts(modules()[module])
    for number, node in enumerate(known.imports):
        if number in known.for_types and not types:
            continue
        if isinstance(node, ast.Import):
            found.update(name for alias in node.names if (name := _ours(alias.name)) is not None)
        else:
            for alias in node.names:
                if (name := _ours(f"{node.module}.{alias.name}")) is not None:
                    found.add(name)
    return found - {module}


def _ours(name: str) -> str | None:
    """The module that this names, or whose name it ends with a name in it."""
    return next((each for each in (name, name.rpartition(".")[0]) if each in modules()), None)


def circles(*, types: bool) -> list[list[str]]:
    """Modules that import one another, by whatever way round; each circle once."""
    reached = {module: _reached(module, types=types) for module in modules()}
    found = {
        tuple(sorted(other for other in reached[module] if module in reached[other]))
        for module in modules()
        if module in reached[module]
    }
    return [list(each) for each in sorted(found)]


def _reached(module: str, *, types: bool) -> set[str]:
    found: set[str] = set()
    waiting = [module]
    while waiting:
        for imported in imports(waiting.pop(), types=types) - found:
            found.add(imported)
            waiting.append(imported)
    return found


# --- references -------------------------------------------------------------------------------------------------------


class Reference(NamedTuple):
    """Something that a docstring names."""

    file: Path
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.file.relative_to(ROOT)}:{self.line}: {self.text}"


QUOTED = re.compile(r"`([^`\n]+)`")
DOTTED = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+(?:\(\))?")
NAME = re.compile(r"_*[A-Z][a-z0-9]+(?:[A-Z][a-z0-9]*)+|_?[a-z0-9]+(?:_[a-z0-9]+)+")
"""A name that is no word of a sentence: CamelCase or snake_case."""
FILE = re.compile(r"[\w./-]*\w\.(?:md|py)\b")
SECTION = re.compile(
    r"(?P<page>semantics|console)(?:\.md)?,? (?:sections? )?(?P<numbers>\d[\d.]*(?:(?:, | and | to )\d[\d.]*)*)"
)
PAGES = {"semantics": "docs/explanation/semantics.md", "console": "docs/explanation/console.md"}
"""Where numbered sections are, and numbered paragraphs."""
FOREIGN = {"App", "Screen", "Widget", "Path", "SampleInfo", "asyncio", "RunInstruction"}
"""What others have: Textual, the standard library, cyclonedds; and what a study might have, as an example."""
DATA = {"json", "toml", "xml", "jsonl", "csv", "rng", "svg", "sock", "lock", "service"}
"""Endings of files that a user has."""


def dead_names(files: Iterable[Path]) -> Iterator[Reference]:
    """Names in backticks that nothing has."""
    known = _identifiers() | FOREIGN
    for file in files:
        for line, text in facts(file).docstrings:
            for match in QUOTED.finditer(text):
                quoted = match[1].strip().removesuffix("()")
                dead = (
                    not _leads_somewhere(quoted)
                    if DOTTED.fullmatch(quoted)
                    else NAME.fullmatch(quoted) is not None and quoted not in known
                )
                if dead:
                    yield Reference(file, line + text[: match.start()].count("\n"), quoted)


def dead_files(files: Iterable[Path]) -> Iterator[Reference]:
    """Files of this project (pages, modules, tests) that are not there."""
    names = {path.name for folder in ("docs", "tests", "benchmarks") for path in (ROOT / folder).rglob("*.*")}
    names |= {path.name for path in (*ROOT.glob("*.md"), *modules().values())}
    for file in files:
        for line, text in facts(file).docstrings:
            for match in FILE.finditer(text):
                named = match[0]
                if not ((ROOT / named).exists() if "/" in named else named in names):
                    yield Reference(file, line + text[: match.start()].count("\n"), named)


def dead_sections(files: Iterable[Path]) -> Iterator[Reference]:
    """Numbers of sections that their page does not have."""
    numbered = {name: _sections(ROOT / page) for name, page in PAGES.items()}
    for file in files:
        for line, text in facts(file).docstrings:
            flat = text.replace("\n", " ")
            for match in SECTION.finditer(flat):
                page = match["page"]
                for number in re.findall(r"\d+(?:\.\d+)*", match["numbers"]):
                    if number not in numbered[page]:
                        at = line + text[: match.start()].count("\n")
                        yield Reference(file, at, f"{page} {number}")


def _sections(page: Path) -> set[str]:
    text = page.read_text(encoding="utf-8") if page.exists() else ""
    return set(re.findall(r"^(?:#+ |\*\*)(\d+(?:\.\d+)*)\b", text, re.MULTILINE))


def _leads_somewhere(dotted: str) -> bool:
    first, *rest = dotted.split(".")
    if (
        rest[-1] in (*DATA, "md", "py")
        or first in FOREIGN
        or (first in sys.stdlib_module_names and first not in _stems())
    ):
        return True
    if first in PACKAGES:
        return resolves(dotted)
    if first == "rise":  # a group of entry points
        return f'entry-points."{dotted}"' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    owners = [name for name in (first, *rest[:-1]) if NAME.fullmatch(name) or name.lstrip("_")[:1].isupper()]
    return _identifiers().issuperset((*owners, rest[-1]))  # also of an object by its usual name: `view.control`


def resolves(dotted: str) -> bool:
    """A module of ours, or a name in one, or a member of a class in one; also of the nodes to copy."""
    known = {**modules(), **_nodes()}
    if dotted in known:
        return True
    before, _, last = dotted.rpartition(".")
    if before in known:
        return last in _defined(parsed(known[before]))
    owner, _, name = before.rpartition(".")
    return owner in known and any(
        isinstance(node, ast.ClassDef) and node.name == name and last in _defined(node)
        for node in ast.walk(parsed(known[owner]))
    )


@cache
def _nodes() -> dict[str, Path]:
    """The modules of `adapters/rise_ros/rise_ros/examples`, which are in no wheel."""
    folder = ROOT / "adapters" / "rise_ros" / "rise_ros" / "examples"
    return {f"rise_ros.examples.{file.stem}": file for file in folder.glob("*.py")}


def _defined(scope: ast.AST) -> set[str]:
    """Names that a module or a class has of its own, or imports."""
    found: set[str] = set()
    for node in nodes(scope):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            found.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            found.add(node.attr)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            found.update(alias.asname or alias.name for alias in node.names)
    return found


@cache
def _stems() -> set[str]:
    return {name.rpartition(".")[2] for name in modules()}


@cache
def _identifiers() -> set[str]:
    """Every name in the code, what its strings say, and the words of the pages, where formats are."""
    found = _stems()
    texts = [page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md")]
    for file in modules().values():
        found |= facts(file).names
        texts += facts(file).texts
    return found | {word for text in texts for word in re.findall(r"\w+", text)}

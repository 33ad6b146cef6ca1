"""What Textual's documentation does not promise is used in one package only, where each use has a test."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import rise_tui

ROOT = Path(rise_tui.__file__).parent
MODULES = sorted(path for path in ROOT.rglob("*.py") if path.parent.name != "rendering")
OURS = ("rise_tui", "rise_engine", "__future__")
PROMISED = {"_replace", "_asdict"}
"""Private by their names only: the standard library documents them."""


def own_names(source: str) -> set[str]:
    """What a module calls its own: what it defines, and what it sets on `self`."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
            case ast.Attribute(value=ast.Name(id="self"), attr=name, ctx=ast.Store()):
                names.add(name)
            case ast.Name(id=name, ctx=ast.Store()):
                names.add(name)
    return names


def private_uses(source: str, own: set[str]) -> Iterator[str]:
    """Private attributes that are not ours, private names of other packages, methods that replace Textual's."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(attr=name) if _private(name) and name not in own and name not in PROMISED:
                yield f"line {node.lineno}: {ast.unparse(node)}"
            case ast.ImportFrom(module=module, names=names) if (module or "").split(".")[0] not in OURS:
                if any(_private(part) for part in (*(module or "").split("."), *(name.name for name in names))):
                    yield f"line {node.lineno}: {ast.unparse(node)}"
            case ast.ClassDef(body=body, bases=[_, *_]) if re.search("^(from|import) textual", source, re.MULTILINE):
                for each in body:
                    if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef) and each.name in TEXTUALS:
                        yield f"line {each.lineno}: {each.name} is Textual's"


def _private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__")


def _textuals() -> frozenset[str]:
    """Private methods that a widget, a screen or an app of Textual has: a subclass must not replace them by chance."""
    from textual.app import App
    from textual.driver import Driver
    from textual.screen import ModalScreen
    from textual.scroll_view import ScrollView
    from textual.widgets import Input

    kinds = (App, Driver, ModalScreen, ScrollView, Input)
    return frozenset(name for kind in kinds for name in dir(kind) if _private(name))


TEXTUALS = _textuals()
OWN = set().union(*(own_names(path.read_text(encoding="utf-8")) for path in MODULES))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_module_uses_what_is_private_to_textual(path: Path) -> None:
    assert list(private_uses(path.read_text(encoding="utf-8"), OWN)) == []


@pytest.mark.parametrize(
    "source",
    [
        "def f(app):\n    app._driver.write('')",
        "class A:\n    def f(self):\n        self._bindings.bind('a', 'b')",
        "from textual._compositor import Compositor",
        "from textual.widgets import _input",
        "import textual\nclass A(B):\n    def _on_focus(self, event): ...",
    ],
)
def test_private_uses_are_found(source: str) -> None:
    assert len(list(private_uses(source, own_names(source)))) == 1


def test_what_is_our_own_is_no_finding() -> None:
    source = "class A:\n    def f(self, other):\n        self._a = other._a\n        other._b()\n    def _b(self): ..."
    assert list(private_uses(source, own_names(source))) == []

"""One tree of errors: every one is under RiseError, and the drawing in rise_engine/errors.py is the tree there is."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import rise_engine.errors

ROOT = Path(__file__).parents[1]
PACKAGES = ("rise_engine", "rise_tui", "adapters/rise_adapters")
_DRAWN = re.compile(r"^    ( *)([A-Z]\w+)(?:  .*)?$", re.MULTILINE)


def bases() -> dict[str, list[str]]:
    """The names of the bases of every class."""
    found: dict[str, list[str]] = {}
    for package in PACKAGES:
        for file in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text("utf-8"))):
                if isinstance(node, ast.ClassDef):
                    found[node.name] = [ast.unparse(base).rpartition(".")[2] for base in node.bases]
    return found


def drawn() -> dict[str, str]:
    """The parent of each error in the drawing."""
    parents: dict[str, str] = {}
    above: list[tuple[int, str]] = []
    for found in _DRAWN.finditer(rise_engine.errors.__doc__ or ""):
        depth, name = len(found[1]), found[2]
        while above and above[-1][0] >= depth:
            above.pop()
        if above:
            parents[name] = above[-1][1]
        above.append((depth, name))
    return parents


def test_the_drawing_is_the_tree() -> None:
    classes = bases()
    tree = {"RiseError"}
    while grown := {name for name, parents in classes.items() if tree & set(parents)} - tree:
        tree |= grown
    parents = {name: next(base for base in classes[name] if base in tree) for name in tree - {"RiseError"}}
    assert {name: parent for name, parent in parents.items() if not name.startswith("_")} == drawn()

"""One tree of errors, and the drawing of it in rise_engine/errors.py is the tree there is.

`python -m tests.test_errors` draws it anew, for whoever adds an error or changes what one says of itself.
"""

from __future__ import annotations

import ast
import builtins
import re
from pathlib import Path

import rise_engine.errors
from tests.sources import parsed

ROOT = Path(__file__).parents[1]
ERRORS = ROOT / "rise_engine" / "errors.py"
PACKAGES = ("rise_engine", "rise_tui", "adapters/rise_adapters")
LONGEST = 110
_DRAWING = re.compile(r"^    RiseError\n(?:     .*\n)*", re.MULTILINE)


def classes() -> dict[str, ast.ClassDef]:
    """Every public class by its name."""
    found: dict[str, ast.ClassDef] = {}
    for package in PACKAGES:
        for file in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(parsed(file)):
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    found.setdefault(node.name, node)
    return found


def drawing() -> str:
    """The tree as the sources have it, each error with the beginning of what it says of itself."""
    known = classes()

    def below(parent: str, depth: int) -> list[str]:
        lines: list[str] = []
        for name, node in sorted(known.items()):
            if parent not in [ast.unparse(base).rpartition(".")[2] for base in node.bases]:
                continue
            sentence = re.split(r"[.;:,] | \(|\.$", (ast.get_docstring(node) or "").replace("\n", " "))[0]
            lines.append(f"{'    ' + '  ' * depth + name:<34}{sentence}"[:LONGEST].rstrip())
            lines += below(name, depth + 1)
        return lines

    return "\n".join(["    RiseError", *below("RiseError", 1), ""])


def test_the_drawing_is_the_tree() -> None:
    found = _DRAWING.search(rise_engine.errors.__doc__ or "")
    assert found is not None and found.group() == drawing(), "give: python -m tests.test_errors"


def test_the_engine_raises_nothing_outside_of_the_tree() -> None:
    """Its own exceptions, that is; a base called so is an exception of Python's."""
    outside: list[str] = []
    for file in (ROOT / "rise_engine").rglob("*.py"):
        for node in ast.walk(parsed(file)):
            bases = [ast.unparse(base) for base in node.bases] if isinstance(node, ast.ClassDef) else []
            if bases and all(hasattr(builtins, base) and base.endswith(("Error", "Exception")) for base in bases):
                outside.append(f"{file.relative_to(ROOT)}: {bases}")
    assert outside == ["rise_engine/errors.py: ['Exception']"]


if __name__ == "__main__":
    ERRORS.write_text(_DRAWING.sub(lambda found: drawing(), ERRORS.read_text("utf-8"), count=1), encoding="utf-8")

"""One tree of errors, and the drawing of it in rise_engine/base/errors.py is the tree there is.

`python -m tests.test_errors` draws it anew, for whoever adds an error or changes what one says of itself.
"""

from __future__ import annotations

import builtins
import re

import rise_engine.base.errors
from tests.sources import ROOT, Class, facts, modules

ERRORS = ROOT / "rise_engine" / "base" / "errors.py"
LONGEST = 110
_DRAWING = re.compile(r"^    RiseError\n(?:     .*\n)*", re.MULTILINE)


def classes() -> dict[str, Class]:
    """Every public class by its name."""
    everything = (node for file in modules().values() for node in facts(file).classes)
    return {node.name: node for node in everything if not node.name.startswith("_")}


def drawing() -> str:
    """The tree as the sources have it, each error with the beginning of what it says of itself."""
    known = classes()

    def below(parent: str, depth: int) -> list[str]:
        lines: list[str] = []
        for name, node in sorted(known.items()):
            if parent not in [base.rpartition(".")[2] for base in node.bases]:
                continue
            sentence = re.split(r"[.;:,] | \(|\.$", (node.docstring or "").replace("\n", " "))[0]
            lines.append(f"{'    ' + '  ' * depth + name:<34}{sentence}"[:LONGEST].rstrip())
            lines += below(name, depth + 1)
        return lines

    return "\n".join(["    RiseError", *below("RiseError", 1), ""])


def test_the_drawing_is_the_tree() -> None:
    found = _DRAWING.search(rise_engine.base.errors.__doc__ or "")
    assert found is not None and found.group() == drawing(), "give: python -m tests.test_errors"


def test_the_engine_raises_nothing_outside_of_the_tree() -> None:
    """Its own exceptions, that is; a base called so is an exception of Python's."""
    outside: list[str] = []
    for module, file in modules().items():
        for node in facts(file).classes if module.startswith("rise_engine") else ():
            if node.bases and all(
                hasattr(builtins, each) and each.endswith(("Error", "Exception")) for each in node.bases
            ):
                outside.append(f"{file.relative_to(ROOT)}: {node.bases}")
    assert outside == ["rise_engine/base/errors.py: ['Exception']"]


if __name__ == "__main__":
    ERRORS.write_text(_DRAWING.sub(lambda found: drawing(), ERRORS.read_text("utf-8"), count=1), encoding="utf-8")

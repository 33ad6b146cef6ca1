"""Links in the documentation lead somewhere, the index has every page, and every file and name in it is there."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import yaml

from rise_engine import __version__
from tests.sources import classes, facts, modules, parsed, resolves

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [
    *(ROOT / "README.md", ROOT / "CONTRIBUTING.md"),
    *sorted(DOCS.rglob("*.md")),
    *sorted((ROOT / "scenarios").rglob("*.md")),
]
LINK = re.compile(r"(?<!!)\[[^\]]+\]\((?!https?:|#|mailto:)([^)#\s]+)[^)]*\)")
FENCED = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
QUOTED = re.compile(r"`([^`\n]+)`")
PLACE = re.compile(
    r"(?P<path>(?:rise_engine|rise_tui|adapters|tests|benchmarks|docs)/[\w./-]*)(?:: (?P<names>[\w.]+(?:, [\w.]+)*))?"
)
"""A file or a folder of this tree, and perhaps names in that file: `tests/sources.py: parsed, Reference`."""
IMPORTED = re.compile(r"^from (rise_[\w.]+) import ([\w, ]+)$", re.MULTILINE)
MODULE = re.compile(r"(?<![\w/.])rise_(?:engine|tui|adapters)(?:\.[A-Za-z_]\w*)+")
TREE_LINE = re.compile(r"^(?P<indent> *)(?P<names>[\w./]+(?:, [\w./]+)*)(?:  |$)")


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def test_links_lead_somewhere() -> None:
    links = ((page, target) for page in PAGES for target in LINK.findall(page.read_text(encoding="utf-8")))
    assert [(name_of(page), target) for page, target in links if not (page.parent / target).exists()] == []


def test_the_index_has_every_page() -> None:
    index = DOCS / "README.md"
    linked = {(DOCS / target).resolve() for target in LINK.findall(index.read_text(encoding="utf-8"))}
    pages = {page for page in DOCS.rglob("*.md") if "decisions" not in page.parts and page != index}
    assert sorted(str(page.relative_to(DOCS)) for page in pages - linked) == []


def test_the_index_of_decisions_has_every_decision_in_order() -> None:
    folder = DOCS / "decisions"
    titles = re.findall(
        r"^- (\d+): \[(.+)\]\(([^)]+)\)(?: · .+)?$", (folder / "README.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    heads = [(page, page.read_text(encoding="utf-8").partition("\n")[0]) for page in sorted(folder.glob("0*.md"))]
    assert [(f"# {number}. {title}", name) for number, title, name in titles] == [
        (head, page.name) for page, head in heads
    ]


def test_every_field_of_every_record_is_documented() -> None:
    from typing import get_args

    from rise_engine.kernel.records import AnyRecord

    page = (DOCS / "reference" / "records.md").read_text(encoding="utf-8")
    items = {item.partition("`")[0]: item for item in re.split(r"^- `", page, flags=re.MULTILINE)}
    for record in get_args(AnyRecord):
        kind = record.__struct_config__.tag
        for field in set(record.__struct_encode_fields__) - {"seq", "t", "wall"}:
            assert f"`{field}`" in items[kind], f"{kind}.{field} is not in docs/reference/records.md"


# --- files and names of the code --------------------------------------------------------------------------------------


@cache
def members(file: Path) -> dict[str, set[str]]:
    """What a file defines: each name of the module, and of each class what it has itself."""
    found: dict[str, set[str]] = {}
    for node in parsed(file).body:
        match node:
            case ast.ClassDef():
                found[node.name] = _class_members(node)
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                found[node.name] = set()
            case ast.Assign() | ast.AnnAssign():
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                found |= {target.id: set() for target in targets if isinstance(target, ast.Name)}
            case _:
                pass
    return found


def _class_members(scope: ast.ClassDef) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(scope):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            found.add(node.attr)
    return found


def has(file: Path, name: str) -> bool:
    """Whether a file defines `function`, `Class` or `Class.member`."""
    owner, _, member = name.partition(".")
    defined = members(file)
    return owner in defined and (not member or member in defined[owner])


def dead_places(text: str) -> Iterator[str]:
    """Files, folders and names in them that a page names and that are not there."""
    for quoted in QUOTED.findall(FENCED.sub("", text)):
        if (place := PLACE.fullmatch(quoted)) is None:
            continue
        path = ROOT / place["path"]
        if not (path.exists() or path.with_name(f"{path.name}.py").exists()):  # a benchmark is given by its name
            yield quoted
        elif place["names"]:
            yield from (f"{place['path']}: {name}" for name in place["names"].split(", ") if not has(path, name))


def dead_modules(text: str) -> Iterator[str]:
    """Modules and what is in them, also in examples; `rise_ros.examples.NAME` means any."""
    for name in MODULE.findall(text):
        known = name.rpartition(".")[0] if name.rpartition(".")[2].isupper() and not resolves(name) else name
        if not resolves(known):
            yield name
    for module, names in IMPORTED.findall(text):
        yield from (f"{module}.{name}" for name in names.split(", ") if not resolves(f"{module}.{name}"))


def test_every_file_and_name_of_the_code_is_there() -> None:
    texts = ((name_of(page), page.read_text(encoding="utf-8")) for page in PAGES)
    assert [(page, dead) for page, text in texts for dead in (*dead_places(text), *dead_modules(text))] == []


def test_what_is_not_there_would_be_found() -> None:
    text = (
        "`tests/nowhere.py`, `tests/test_docs.py: nothing, has`, `rise_engine/kernel/kernel.py: Kernel.handle`, "
        "`rise_engine/kernel/kernel.py: Kernel.nothing` and\n```python\nfrom rise_engine.nowhere import Thing\n"
        "from rise_engine.run.client import connect, disconnect\n```\n"
    )
    assert [*dead_places(text), *dead_modules(text)] == [
        *("tests/nowhere.py", "tests/test_docs.py: nothing", "rise_engine/kernel/kernel.py: Kernel.nothing"),
        *("rise_engine.nowhere", "rise_engine.nowhere.Thing", "rise_engine.run.client.disconnect"),
    ]


# --- the map, the tree, the words -------------------------------------------------------------------------------------


def test_the_drawn_tree_is_the_tree() -> None:
    """Every package of the program is drawn, and everything that is drawn is there."""
    fenced = FENCED.search((DOCS / "explanation" / "architecture.md").read_text(encoding="utf-8"))
    assert fenced is not None
    above: list[tuple[int, Path]] = []
    drawn: set[Path] = set()
    for line in fenced[0].splitlines()[1:-1]:
        if (found := TREE_LINE.match(line)) is None:
            continue
        indent = len(found["indent"])
        above = [(depth, path) for depth, path in above if depth < indent]
        paths = [(above[-1][1] if above else ROOT) / name for name in found["names"].split(", ")]
        assert [name_of(path) for path in paths if not path.exists()] == []
        above.append((indent, paths[0]))
        drawn.update(paths)
    packages = {file.parent for file in modules().values() if file.name == "__init__.py"}
    assert sorted(name_of(folder) for folder in packages - drawn) == []


def defined_names() -> set[str]:
    """Every name that a file of the program defines, and the short texts that its code compares (`wizard`)."""
    found = {name for name, _ in classes()} | {module.rpartition(".")[2] for module in modules()}
    for file in modules().values():
        for name, inner in members(file).items():
            found |= {name, *inner}
        found |= {text for text in facts(file).texts if text.isidentifier()}
    return found


def test_every_name_of_the_glossary_is_in_the_code() -> None:
    page = (DOCS / "explanation" / "glossary.md").read_text(encoding="utf-8")
    known = defined_names()
    owners = {
        owner: inner for file in modules().values() for owner, inner in members(file).items() if owner[0].isupper()
    }
    column, looked_at, dead = -1, 0, []
    for line in page.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        if "in code" in cells:
            column = cells.index("in code")
        elif not cells:
            column = -1
        elif column >= 0:
            for name in QUOTED.findall(cells[column]):
                looked_at += 1
                owner, _, member = name.partition(".")
                exists = member in owners.get(owner, ()) if member else name in known or resolves(name)
                dead += [] if exists else [name]
    assert looked_at > 60 and dead == []


def test_the_citation_names_this_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert (citation["cff-version"], citation["title"], citation["version"]) == ("1.2.0", "rise-tui", __version__)
    assert {"message", "type", "authors", "license"} <= citation.keys()

"""What the documentation shows in its blocks of code is right.

Scenario files are read by the program, TOML and JSON are what they say, Python can be compiled and imports what is
there.
"""

from __future__ import annotations

import json
import re
import tomllib
from importlib import import_module
from pathlib import Path

import pytest
from sybil import Example, Sybil
from sybil.parsers.myst import CodeBlockParser

from rise_engine.scenario.loader import load
from tests.test_docs import PAGES, name_of

ELSEWHERE = frozenset(
    {"unknown-act", "unknown-rule", "unknown-state", "unknown-template", "bad-use", "unreachable-state"}
)
"""What a part of a study names may stand in another part of it."""
OUTERMOST = {
    "acts": ("Dialog", "Dialogs", "AgentDialogs", "CommunicationRobotActs"),
    "rules": ("InteractionRule", "InteractionRules"),
}
ROOT_TAG = re.compile(r"(?:\s|<!--.*?-->|<\?.*?\?>)*<(?P<tag>\w+)", re.DOTALL)
ELLIPSIS = re.compile(r">\s*\.\.\.\s*<")
IMPORT = re.compile(r"^from (?P<module>rise_[\w.]+) import (?P<names>[\w, ]+)$", re.MULTILINE)


def scenario_file(text: str) -> tuple[str, str]:
    """The folder that a piece of XML belongs to, and the file that it would be a part of."""
    first = ROOT_TAG.match(text)
    tag = first["tag"] if first else ""
    for kind, tags in OUTERMOST.items():
        if tag in tags:
            return kind, text if tag != "Dialog" or text.count("<Dialog ") == 1 else f"<Dialogs>{text}</Dialogs>"
    if tag in ("State", "transitions"):
        text = f'<State id="Start"/>{text}' if 'id="Start"' not in text else text
        return "rules", f'<InteractionRule name="R" initial="Start">{text}</InteractionRule>'
    if tag == "transition":
        return scenario_file(f'<State id="Start">{text}</State>')
    if tag in ("onEntry", "onExit"):
        return scenario_file(f'<State id="Start">{text}</State>')
    if tag in ("function", "if", "oneOf"):
        return scenario_file(f"<onEntry>{text}</onEntry>")
    if tag == "Template":
        kind = "acts" if "<Dialog" in text or "actionID" in text else "rules"
        wrapper = "Dialogs" if kind == "acts" else "InteractionRules"
        return kind, f"<{wrapper}>{text}</{wrapper}>"
    if tag == "use" and "then=" not in text:
        return "rules", f"<InteractionRules>{text}</InteractionRules>"
    return "acts", f'<Dialog name="R_Act">{text}</Dialog>'


def read_xml(example: Example) -> None:
    text = str(example.parsed)
    if ELLIPSIS.search(text) or "ros" in text.partition(">")[0] or text.startswith("<CycloneDDS"):
        return
    kind, whole = scenario_file(text)
    folder = Path(example.namespace["folder"]) / f"line {example.line}"
    (folder / kind).mkdir(parents=True)
    (folder / kind / "example.xml").write_text(whole, encoding="utf-8")
    (folder / "scenario.toml").write_text(example.namespace["declared"], encoding="utf-8")
    wrong = [str(each) for each in load(folder).errors if each.code not in ELSEWHERE]
    assert wrong == [], f"{example.path}, line {example.line}: {wrong}"


def read_toml(example: Example) -> None:
    """What a page declares, its acts can use."""
    values = tomllib.loads(str(example.parsed))
    if not example.namespace["declared"] and "actions" in values and values.keys() <= {"title", "robot", "actions"}:
        example.namespace["declared"] = str(example.parsed)


def read_json(example: Example) -> None:
    text = str(example.parsed)
    try:
        json.loads(text)
    except ValueError:  # a line for each value, as in a task file
        for line in text.splitlines():
            json.loads(line)


def compile_python(example: Example) -> None:
    compile(str(example.parsed), f"{example.path}, line {example.line}", "exec")
    for found in IMPORT.finditer(str(example.parsed)):
        module = import_module(found["module"])
        for name in found["names"].split(","):
            assert hasattr(module, name.strip()), f"{example.path}: {found['module']} has no {name.strip()}"


DOCUMENTS = Sybil(
    parsers=[
        CodeBlockParser("xml", read_xml),
        CodeBlockParser("toml", read_toml),
        CodeBlockParser("json", read_json),
        CodeBlockParser("python", compile_python),
    ]
)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_blocks_are_right(page: Path, tmp_path: Path) -> None:
    document = DOCUMENTS.parse(page)
    document.namespace.update(folder=tmp_path, declared="")
    for example in document.examples():
        example.evaluate()

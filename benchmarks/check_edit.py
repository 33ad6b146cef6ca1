"""Checking a study after an edit of one file, like an editor after each key: LabLinking, and twenty copies of it in one
(700 acts, 980 states). The floor of any checker: parse that file, and read the bytes of all."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

from lxml import etree
from measure import Report, interleave

from rise_engine.scenario.checker import ScenarioChecker
from rise_engine.scenario.loader import load

STUDY = Path(__file__).parents[1] / "scenarios" / "lablinking"
EDITED = ("acts/task_1", "acts/templates", "rules/wizard", "rules/table_setting", "memory.json")
_USES = re.compile(r'((?:<Template name|<use template)="\w+)')


def study() -> dict[str, bytes]:
    """The files of LabLinking."""
    files = (path for path in STUDY.rglob("*") if path.is_file())
    return {path.relative_to(STUDY).as_posix(): path.read_bytes() for path in files}


def many(files: dict[str, bytes], copies: int) -> dict[str, bytes]:
    """Many copies of its acts and rules, each under other names."""
    scenario = load(STUDY).scenario
    assert scenario is not None
    names = sorted((*scenario.acts, *scenario.rules), key=len, reverse=True)
    others = "|".join(re.escape(name) for name in names if not name.startswith("R_"))
    name_of_part = re.compile(rf"(?<!\w)({others})(?=\b|_end|_succeeded|_failed)")
    held = {"memory.json": files["memory.json"], "scenario.toml": b'language = "en"\n'}
    for name, data in files.items():
        if name.endswith(".xml"):
            for copy in range(copies):
                text = name_of_part.sub(rf"\1__{copy}", data.decode().replace("R_", f"R{copy}_"))
                text = _USES.sub(rf"\1__{copy}", text)
                held[name.replace(".xml", f"_{copy}.xml")] = text.encode()
    return held


def edits(held: dict[str, bytes], part: str) -> tuple[Callable[[], None], Callable[[], None]]:
    """Seconds of a check after an edit of the file, each time another one; and the floor."""
    name = next(each for each in held if each.startswith(part))
    checker = ScenarioChecker("/nowhere")
    assert checker.check(held).diagnostics == [], checker.check(held).diagnostics[:3]
    count = 0

    def changed() -> dict[str, bytes]:
        nonlocal count
        count += 1
        return {**held, name: held[name] + b"\n" * (count % 97)}

    def ours() -> None:
        assert checker.check(changed()).scenario is not None

    def least() -> None:
        now = changed()
        if name.endswith(".xml"):
            etree.fromstring(now[name])
        for data in now.values():
            sha256(data)

    return ours, least


def main() -> bool:
    report = Report("Checking after an edit of one file")
    files = study()
    for title, held, most in (("LabLinking", files, 15), ("20 x LabLinking", many(files, 20), 40)):
        for part in EDITED:
            ours, least = edits(held, part)
            figures = interleave({"ours": (ours, 1), "floor": (least, 1)}, rounds=9)
            report.row(f"{title}, {part}: floor", f"{figures['floor'].median * 1000:.2f} ms")
            report.target(f"{title}, {part}, ms", figures["ours"].median * 1000, most, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())

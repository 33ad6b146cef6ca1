"""What SCION did with documents, kept, so that it is compared where there is no node.

`python -m tests.exchange.scxml.traces` makes the file anew, with SCION where `RISE_SCION` says. For each case it has
the hash of the document and the lines of SCION. A test makes the document again, which must be the same to the byte,
and lets the kernel play the same inputs.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from rise_exchange.scxml.limits import find_refusals

from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Rule, Scenario
from tests.exchange.scxml.playing import VARIABLE, Played, Steps, alone, document_of, play, run_documents
from tests.exchange.scxml.random_rules import random_script, random_study

FILE = Path(__file__).with_name("traces.json")
STUDIES = Path(__file__).parents[3] / "scenarios"
SEEDS = range(60)
MAX_LINES = 160


class Case:
    """A rule and its inputs, played by the kernel."""

    def __init__(self, name: str, scenario: Scenario, rule: Rule, played: Played) -> None:
        self.name = name
        self.scenario = scenario
        self.rule = rule
        self.document = document_of(scenario, rule)
        self.played = played

    @property
    def digest(self) -> str:
        """Of the document."""
        return hashlib.sha256(self.document.encode()).hexdigest()


def shipped_cases(scripts: int, length: int = 40) -> Iterator[Case]:
    """Every rule of every shipped study, by itself, with some random scripts."""
    for folder in sorted(path for path in STUDIES.iterdir() if (path / "scenario.toml").is_file()):
        scenario = load(folder).scenario
        assert scenario is not None
        for rule in scenario.rules.values():
            one = alone(scenario, rule)
            for number in range(scripts):
                played = play(one, rule, random_script(one, rule, number, length))
                yield Case(f"{folder.name}/{rule.name}/{number}", one, rule, played)


def random_cases(seeds: Iterable[int], length: int = 25) -> Iterator[Case]:
    """Random rules that SCXML can say, and that do not go round in circles."""
    for seed in seeds:
        with TemporaryDirectory() as folder:
            scenario, rule = random_study(Path(folder), seed)
        if find_refusals(scenario, rule).errors:
            continue
        played = play(scenario, rule, random_script(scenario, rule, seed, length))
        if not played.faulted:
            yield Case(f"random/{seed}", scenario, rule, played)


def kept_cases(seeds: Iterable[int] = SEEDS) -> Iterator[Case]:
    """Those whose traces are kept: with random rules, of those seeds whose lines are few."""
    yield from shipped_cases(1)
    yield from (case for case in random_cases(seeds) if sum(map(len, case.played.lines)) <= MAX_LINES)


def main() -> None:
    cases = list(kept_cases())
    results = run_documents(Path(os.environ[VARIABLE]), [(case.document, case.played.steps) for case in cases])
    kept: dict[str, dict[str, str | Steps]] = {
        case.name: {"document": case.digest, "trace": steps} for case, steps in zip(cases, results, strict=True)
    }
    lines = (f"{json.dumps(name)}: {json.dumps(each, separators=(',', ':'))}" for name, each in kept.items())
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")


if __name__ == "__main__":
    main()

"""Reads and checks mutated scenarios, and tells those that make the program fall, hang or blame itself.

    python -m tests.fuzz --count 100000      (./dev fuzz; ctrl+c ends it and tells what was found so far)

Everything happens in one process. Of a scenario only the mutated file is written anew. A mutation is known by the seed
and its number, so that one that went wrong can be had again: --seed S --from N --count 1 --keep FOLDER.
"""

from __future__ import annotations

import argparse
import faulthandler
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from random import Random
from types import FrameType

from lxml import etree
from msgspec import Struct

from rise_engine.scenario.editor_schemas import act_schema_text, rule_schema_text
from rise_engine.scenario.loader import load
from rise_engine.scenario.serialization import decode_scenario, encode_scenario
from tests.fuzz.mutations import mutate

ROOT = Path(__file__).parents[2]
SCENARIOS = (ROOT / "scenarios" / "greeting", ROOT / "scenarios" / "lab_opening", ROOT / "scenarios" / "lablinking")
_PARSER = etree.XMLParser(remove_comments=True, remove_pis=True, resolve_entities=False)
SLOW = 2.0
"""Seconds of processor time from which a scenario counts as slow."""
HANGS = 20.0
"""Seconds of processor time after which a scenario is given up."""


class HangError(Exception):
    """A scenario took more than HANGS."""


class Case(Struct):
    """One mutated scenario, and what came of it."""

    number: int
    scenario: str
    file: str
    content: bytes
    seconds: float = 0.0
    """Of processor time."""
    accepted: bool = False
    diagnostics: int = 0
    wrong: str = ""
    """What the program did that it never may: a traceback, or a sentence."""


class Fuzz:
    """Mutates the shipped scenarios, one file at a time, in a folder of its own."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder = folder
        self.seed = seed
        self.files: list[tuple[Path, str, bytes]] = []
        for scenario in SCENARIOS:
            copy = folder / scenario.name
            shutil.copytree(scenario, copy, ignore=shutil.ignore_patterns("*.md", "session.jsonl"))
            robots = copy / "robots"
            robots.mkdir()
            (robots / "generic.toml").write_text(ROBOT, encoding="utf-8")
            for path in sorted(copy.rglob("*")):
                if path.is_file():
                    self.files.append((copy, path.relative_to(copy).as_posix(), path.read_bytes()))

    def case(self, number: int) -> Case:
        """Mutate, read and check; the folder is as before afterwards."""
        chance = Random(f"{self.seed}/{number}")
        copy, name, before = chance.choice(self.files)
        made = Case(number, copy.name, name, mutate(name, before, chance))
        path = copy / name
        path.write_bytes(made.content)
        began = time.process_time()
        try:
            with _not_for_ever():
                _check(copy, made)
        except HangError:
            made.wrong = f"it took more than {HANGS:g} s"
        except Exception:
            made.wrong = traceback.format_exc()
        made.seconds = time.process_time() - began
        path.write_bytes(before)
        return made


def _check(folder: Path, case: Case) -> None:
    """What `rise-engine check` does, and what a console is given."""
    loaded = load(folder)
    case.accepted = loaded.scenario is not None
    case.diagnostics = len(loaded.diagnostics)
    lines = case.content.decode("utf-8", "replace").removeprefix("\ufeff").split("\n")
    for diagnostic in loaded.diagnostics:
        told = str(diagnostic)
        place = diagnostic.location
        if "mistake of this program" in told or "please report" in told:
            raise AssertionError(f"it blames itself: {told}")
        if "\n" in told or "\x1b" in told or not diagnostic.message:
            raise AssertionError(f"this is not one clean line: {told!r}")
        if place.file == case.file and not (
            1 <= place.line <= len(lines) and 1 <= place.column <= len(lines[place.line - 1]) + 1
        ):
            raise AssertionError(f"there is no such place: {told}")
    if case.accepted == any(diagnostic.severity == "error" for diagnostic in loaded.diagnostics):
        raise AssertionError("it is accepted with errors, or refused without one")
    if loaded.scenario is not None and case.file.endswith(".xml"):
        rules = "/rules/" in f"/{case.file}"
        schema = _schema(rule_schema_text() if rules else act_schema_text(loaded.scenario.robot.actions))
        if not schema.validate(etree.fromstring(case.content, _PARSER)):
            raise AssertionError(f"the schema for editors refuses it: {schema.error_log[0].message}")
    if loaded.scenario is not None and decode_scenario(encode_scenario(loaded.scenario)) != loaded.scenario:
        raise AssertionError("it is another scenario after it was sent to a console")


@cache
def _schema(text: str) -> etree.RelaxNG:
    return etree.RelaxNG(etree.fromstring(text.encode()))


@contextmanager
def _not_for_ever() -> Iterator[None]:
    def give_up(signum: int, frame: FrameType | None) -> None:
        raise HangError

    before = signal.signal(signal.SIGVTALRM, give_up)
    signal.setitimer(signal.ITIMER_VIRTUAL, HANGS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)


ROBOT = """title = "A robot"
driver = "simulated"
[actions.Speech]
channels = ["speech"]
parameters.voice = { type = "name", names = ["a", "b"] }
[actions.LookAt]
[actions.Emotion]
[actions.Animation]
names = ["wave"]
without = ["idle"]
[actions.SocialExpression]
[actions.PointAt]
substitute = "LookAt"
limit = 5
[actions.Dance]
seconds = 3
parameters = { steps = { type = "integer", minimum = 1, maximum = 9, required = true, help = "How many." } }
"""


def main() -> int:
    parser = argparse.ArgumentParser(prog="./dev fuzz", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=2000, help="how many scenarios; 2000 take half a minute")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--from", type=int, default=0, dest="first", metavar="N", help="the number of the first")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="write the files that went wrong there")
    options = parser.parse_args()
    faulthandler.enable()
    for number in (signal.SIGINT, signal.SIGTERM):  # also when it was started in the background of a script
        signal.signal(number, signal.default_int_handler)
    seconds: list[float] = []
    wrong = accepted = diagnostics = slow = 0
    kinds: Counter[str] = Counter()
    with suppress(KeyboardInterrupt), tempfile.TemporaryDirectory(prefix="rise-fuzz-") as folder:
        fuzz = Fuzz(Path(folder), options.seed)
        for number in range(options.first, options.first + options.count):
            case = fuzz.case(number)
            seconds.append(case.seconds)
            accepted += case.accepted
            diagnostics += case.diagnostics
            kinds[Path(case.file).suffix] += 1
            slow += case.seconds > SLOW
            if case.wrong or case.seconds > SLOW or options.count == 1:
                wrong += bool(case.wrong)
                what = case.wrong or f"{case.seconds:.2f} s"
                print(
                    f"--- {case.number}: {case.scenario}/{case.file}, {case.diagnostics} findings\n{what}", flush=True
                )
                if options.keep is not None:
                    options.keep.mkdir(parents=True, exist_ok=True)
                    (options.keep / f"{case.number}-{Path(case.file).name}").write_bytes(case.content)
            if len(seconds) % 5000 == 0:
                print(f"{len(seconds)} ...", file=sys.stderr, flush=True)
    if not seconds:
        return 1
    seconds.sort()
    of_kinds = ", ".join(f"{number} {kind}" for kind, number in kinds.most_common())
    print(
        f"{len(seconds)} scenarios (seed {options.seed}, {of_kinds}), "
        f"{accepted} accepted, {diagnostics} findings; "
        f"processor time: median {seconds[len(seconds) // 2] * 1000:.1f} ms, "
        f"99.9 % {seconds[int(len(seconds) * 0.999)] * 1000:.0f} ms, longest {seconds[-1]:.2f} s; "
        f"{wrong} went wrong, {slow} took more than {SLOW:g} s"
    )
    return 1 if wrong or slow else 0


if __name__ == "__main__":
    sys.exit(main())

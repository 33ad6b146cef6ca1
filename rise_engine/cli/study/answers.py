"""Questions about a new study, and parsers of their answers, for the prompts and options of `study new`.

Every parser returns the meaning of a text, or raises ValueError with a sentence.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.cli.terminal import exit_with_usage
from rise_engine.scenario.files.study_paths import SCENARIO_FILE
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Json, Scenario
from rise_engine.scenario.shipped_studies import shipped_studies
from rise_engine.study.checks import AUTOMATIC
from rise_engine.study.csv_table import WHY, personal_column
from rise_engine.study.model import FactorKind, Level, StudyCheck
from rise_engine.study.plan import PLAN_COLUMNS
from rise_engine.study.study_scenarios import behaviour_key, memory_key_problem, memory_type_problem
from rise_engine.study.study_toml import MAX_PARTICIPANTS, RESERVED_COLUMNS

NOTHING = "-"
"""The answer "nothing", instead of the default."""
DEFAULT_CHECKS = "robot, disk, scenario, wizard"
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
_LEVEL = re.compile(r"[A-Za-z0-9_-]+\Z")
_PAIR = re.compile(r"\s*([^\s=,{}]+)\s*=\s*([A-Za-z_][\w -]*?)\s*(?=,|\Z)")
"""`mood = happy`: a text without quotation marks."""
_ON, _OFF = ("yes", "on", "with", "true"), ("no", "off", "without", "false")
_YES, _NO = ("y", "yes", "j", "ja"), ("n", "no", "nein")


def parse_text(text: str) -> str:
    """Parse any text without invisible characters."""
    if not text.strip() or not text.isprintable():
        raise ValueError("write a word or more")
    return text.strip()


def parse_id(text: str) -> str:
    """Parse the short name of a study."""
    if not re.fullmatch(r"[A-Za-z0-9]+", text):
        raise ValueError("letters (a-z) and digits only, without blanks: it is a part of file names")
    return text


def parse_count(text: str) -> int:
    """Parse the number of participants."""
    if not (text.isascii() and text.isdigit()) or not 1 <= int(text[:9]) <= MAX_PARTICIPANTS:
        raise ValueError(f"a whole number from 1 to {MAX_PARTICIPANTS}")
    return int(text)


def parse_yes(text: str) -> bool:
    """Parse yes or no."""
    if text.casefold() in _YES:
        return True
    if text.casefold() in _NO:
        return False
    raise ValueError("y or n")


def parse_scenario(text: str) -> tuple[Path, Scenario]:
    """Parse the folder of a scenario, shipped or one's own, and load it."""
    studies = shipped_studies()
    path = studies.get(text, Path(text).expanduser())
    path = path.parent if path.name == SCENARIO_FILE else path
    if not path.is_dir():
        near = did_you_mean(text, studies)
        raise ValueError(f"there is no folder {text}, and no scenario of that name comes with the program{near}")
    loaded = load(path)
    if loaded.scenario is None:
        first = "; ".join(map(str, loaded.errors[:3]))
        raise ValueError(f"this scenario has errors, which `rise-engine check {text}` lists: {first}")
    return path, loaded.scenario


def parse_factor_name(text: str, taken: Collection[str]) -> str:
    """Parse the name of a factor."""
    if not _NAME.match(text):
        raise ValueError("one word of letters (a-z), digits and `_`, beginning with a letter: hesitation")
    if text in taken:
        raise ValueError(f"there is a factor `{text}` already")
    if text in PLAN_COLUMNS:
        raise ValueError(f"the plan has a column `{text}` of another meaning; choose another name")
    return text


def parse_kind(text: str) -> FactorKind:
    """Parse between or within, as a word or the beginning of one."""
    if text and "between".startswith(text.casefold()):
        return "between"
    if text and "within".startswith(text.casefold()):
        return "within"
    raise ValueError("between or within")


def parse_level_names(text: str) -> list[str]:
    """Parse the levels of a factor, separated by commas."""
    names = [part.strip() for part in text.split(",")]
    if wrong := next((name for name in names if not _LEVEL.match(name)), None):
        raise ValueError(f"a level is a word of letters (a-z), digits, `_` and `-`, not `{wrong}`")
    if len(names) < 2 or "" in names:
        raise ValueError("two levels or more, with commas between them: yes, no")
    if len(set(names)) < len(names):
        raise ValueError("a level is there twice")
    return names


def parse_level(name: str, text: str, scenario: Scenario) -> Level:
    """Parse the robot's behaviour in a level.

    :param name: the level.
    :param text: memory values, `hesitation = true, pause_ms = 300`; or `scenario PATH`; or nothing.
    :param scenario: the scenario whose memory is set.
    """
    text = text.strip()
    if text in ("", NOTHING):
        return Level(name)
    word, _, path = text.partition(" ")
    if word == "scenario" and "=" not in text:
        parse_scenario(path.strip())
        return Level(name, scenario=path.strip())
    memory = _parse_memory(text)
    for key, value in memory.items():
        if problem := memory_key_problem(scenario, key):
            raise ValueError(problem)
        memory[key] = value = _as_bool(value) if isinstance(scenario.memory.get(key), bool) else value
        if problem := memory_type_problem(scenario, key, value):
            raise ValueError(problem)
    return Level(name, memory)


def _as_bool(value: Json) -> Json:
    """Replace `yes` and `no` by true and false."""
    word = value.casefold() if isinstance(value, str) else ""
    return True if word in _ON else False if word in _OFF else value


def _parse_memory(text: str) -> dict[str, Json]:
    quoted = _PAIR.sub(lambda found: f"{found[1]} = {_quote_word(found[2])}", text)
    try:
        memory = tomllib.loads(f"memory = {{ {quoted} }}")["memory"]
    except ValueError:
        raise ValueError("write KEY = VALUE, with commas between: hesitation = true, pause_ms = 300") from None
    if not isinstance(memory, dict):
        raise ValueError("write KEY = VALUE, with commas between")
    return memory


def _quote_word(word: str) -> str:
    return word if word in ("true", "false") else f'"{word}"'


def usual_level(factor: str, level: str, scenario: Scenario) -> str:
    """Guess the memory value of a level: that of the key with the factor's name; empty: unclear.

    >>> from rise_engine.scenario.loader import load
    >>> scenario = load("scenarios/lablinking").scenario
    >>> usual_level("hesitation", "no", scenario), usual_level("noise", "loud", scenario)
    ('hesitation = false', '')
    """
    start = scenario.memory.get(factor)
    if isinstance(start, bool):
        word = level.casefold()
        return f"{factor} = {'true' if word in _ON else 'false'}" if word in (*_ON, *_OFF) else ""
    return f'{factor} = "{level}"' if isinstance(start, str) else ""


def parse_stratum(text: str, taken: Collection[str]) -> tuple[str, tuple[str, ...]]:
    """Parse a column of participants.csv and its values: `language: de, en`."""
    column, _, rest = re.sub(r"=", ":", text, count=1).partition(":")
    column, values = column.strip(), tuple(part.strip() for part in rest.split(","))
    if not _NAME.match(column) or len(values) < 2 or "" in values:
        raise ValueError("write a word and its values: language: de, en")
    if column in (*taken, *RESERVED_COLUMNS, *PLAN_COLUMNS) or column.startswith("consent_"):
        raise ValueError(f"there is a column `{column}` already; choose another word")
    if kind := personal_column(column):
        raise ValueError(f"`{column}` seems to hold {kind}: {WHY}")
    if len(set(values)) < len(values) or any("/" in value or "=" in value for value in values):
        raise ValueError("give each value once, without `/` and `=`")
    return column, values


def parse_consents(text: str) -> tuple[str, ...]:
    """Parse the necessary consents, separated by commas."""
    if text.strip() in ("", NOTHING):
        return ()
    names = tuple(part.strip().removeprefix("consent_") for part in text.split(","))
    if not all(_NAME.match(name) for name in names):
        raise ValueError(f"words with commas between, as study, recording; or {NOTHING} for none")
    return tuple(dict.fromkeys(names))


def parse_automatic(text: str) -> tuple[StudyCheck, ...]:
    """Parse automatic checks, separated by commas."""
    if text.strip() in ("", NOTHING):
        return ()
    names = list(dict.fromkeys(part.strip() for part in text.split(",")))
    for name in names:
        if name not in AUTOMATIC:
            near = did_you_mean(name, AUTOMATIC, limit=0) or f"; there are {in_backquotes(AUTOMATIC)}"
            raise ValueError(f"there is no automatic check `{name}`{near}")
    return tuple(StudyCheck(name, auto=name, minimum="5 GB" if name == "disk" else "") for name in names)


def asked_check(sentence: str, taken: Collection[str], *, after: bool = False) -> StudyCheck:
    """Make a check that a person confirms, with an id from its words."""
    words = re.findall(r"[a-z0-9]+", sentence.casefold())
    words = [word for word in words if word not in ("the", "is", "are", "a", "an", "was", "were", "has", "have")]
    base = "-".join(words[:3]) or "asked"
    base = base if base[0].isalpha() else f"check-{base}"
    identity, number = base, 2
    while identity in taken:
        identity, number = f"{base}-{number}", number + 1
    return StudyCheck(identity, ask=parse_text(sentence), when="after" if after else "before")


def same_levels(levels: list[Level]) -> list[str]:
    """Return the names of the first two levels with the same behaviour of the robot."""
    for at, level in enumerate(levels):
        for other in levels[:at]:
            if behaviour_key(level) == behaviour_key(other):
                return [other.name, level.name]
    return []


@contextmanager
def meaning(option: str) -> Iterator[None]:
    """End the command with the reason if an answer within the block is invalid; `option` is its source."""
    try:
        yield
    except ValueError as error:
        exit_with_usage(f"{option.strip()}: {error}")


# --- questions ------------------------------------------------------------------------------------------------------


class Question(NamedTuple):
    """A question that is asked once."""

    option: str
    """The option that answers it."""
    question: str
    parse: Callable[[str], Any]
    """Raises ValueError with the reason why an answer is invalid."""
    about: str = ""
    """A paragraph before it."""


NOTHING_TEXT = f"({NOTHING}: nothing)"
TITLE = Question("--title", "Title", parse_text)
IDENTITY = Question("--id", "Short name, letters and digits, for file names", parse_id)
COUNT = Question("--n", "Complete participants that you want", parse_count)
CONSENT = Question(
    "--consent",
    f"Consent to {NOTHING_TEXT}",
    parse_consents,
    "What must participants have consented to before a session? Each is a column of participants.csv with a date; "
    "without one no session begins. Write words with commas between them: study, recording",
)
AUTOMATIC_CHECKS = Question(
    "--auto",
    f"Look at {NOTHING_TEXT}",
    parse_automatic,
    "What should the program check before each session? Write words with commas between them.",
)

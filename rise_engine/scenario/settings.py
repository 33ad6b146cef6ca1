"""The settings of scenario.toml: what each of them does, in a sentence. For the editor, completion and hover.

The readers decide which values are valid (docs/reference/scenario.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple, TypeAlias

SettingKind: TypeAlias = Literal["text", "number", "whole number", "yes or no", "names", "whole numbers", "value"]
"""`names`: a list of texts; `value`: several types are possible."""
ANY = "*"
"""In a path: any name, or the number of an entry of a list."""


class Setting(NamedTuple):
    """One entry of a TOML file."""

    path: str
    """Its keys with dots between them: `explore.faults`, `act.*.hold`."""
    kind: SettingKind
    meaning: str
    """A sentence without its full stop."""
    usual: str = ""
    """The value without this entry, as a form shows it; empty: none."""
    choices: Mapping[str, str] = {}
    """Its values, each with its meaning; empty: any."""


class SettingTable(NamedTuple):
    """A table of a TOML file with its entries."""

    path: str
    """Empty: the entries before all tables."""
    meaning: str
    settings: Sequence[Setting] = ()


FAILURE_CHOICES = {
    "go_on": "rules go on",
    "ask": "the wizard is asked",
    "repeat:1": "the act starts once more",
    "repeat:2": "the act starts up to twice more",
}


def make_table(path: str, meaning: str, *settings: Setting) -> SettingTable:
    """A table whose settings are given by their names in it."""
    inside = f"{path}." if path else ""
    return SettingTable(path, meaning, tuple(each._replace(path=inside + each.path) for each in settings))


SCENARIO_TABLES = (
    make_table(
        "",
        "The scenario",
        Setting("title", "text", "The study's name on screens and in results", "the folder's name"),
        Setting("robot", "text", "The robot's profile", "generic"),
        Setting("mode", "text", "Whether a robot moves", "debug",
                {"debug": "a simulated robot acts", "real": "the robot moves"}),
        Setting("language", "text", "The language in which the acts are written: en, de-AT"),
        Setting("on_failure", "text", "What happens when an act fails", "go_on", FAILURE_CHOICES),
        Setting("private", "names", "Memory keys about a person, which exports for others leave out"),
        Setting("acts", "text", "The folder or file of the acts", "acts"),
        Setting("rules", "text", "The folder or file of the rules", "rules"),
        Setting("memory", "text", "The file of the start values", "memory.json"),
    ),
    make_table("keys", "What each key does"),
    make_table(
        "act.*",
        "What one act, or several (R_Task*), do differently",
        Setting("hold", "yes or no", "Its key must be pressed twice, so that a slip does not start it", "no"),
        Setting("debounce", "number", "Seconds in which a second press of its key is ignored, 0 to 60", "0.5"),
        Setting("filler", "yes or no", "It bridges a pause: the key , starts the next filler", "no"),
        Setting("answers", "yes or no", "It answers the participant's cue", "yes"),
        Setting("calling_type", "text", "Whether other acts wait for it", "Blocking",
                {"Blocking": "other acts wait", "None": "it runs beside other acts and gives way to them"}),
        Setting("on_failure", "text", "What happens when it fails", "as for all acts", FAILURE_CHOICES),
    ),
    make_table(
        "conditions.*",
        "What one condition of the study sets at the start of its sessions",
        Setting("memory.*", "value", "A memory value at the start of its sessions"),
        Setting("label", "text", "What screens show instead of its name"),
        Setting("label_only", "yes or no", "The robot does the same: only people or the room differ", "no"),
    ),
    make_table(
        "study",
        "The study that this scenario is for",
        Setting("participants", "whole number", "How many participants are planned"),
        Setting("conditions", "names", "The order of the conditions", "that of their tables"),
    ),
    make_table(
        "fillers",
        "When the robot bridges a pause after the participant's cue",
        Setting("offer_after", "number", "Seconds until the console offers a filler; 0: never", "1.5"),
        Setting("auto_after", "number", "Seconds until a filler starts by itself if nothing runs", "never"),
    ),
    make_table(
        "cue",
        "The participant's cue, which a key or a program marks",
        Setting("keep", "text", "How long a cue waits for a rule: 3s", "not at all"),
    ),
    make_table(
        "languages",
        "The languages of the study",
        Setting("also", "names", "The languages into which the texts are translated", "those with a file in texts/"),
    ),
    make_table(
        "control",
        "Who else may act",
        Setting("may_release", "names", "Programs that may release a stop: /lab/supervisor", "none"),
    ),
    make_table(
        "trials",
        "What a trial is: a row of trials.csv",
        Setting("state", "text", "Entering this state of a rule begins a trial: STATE or RULE/STATE; * is any text"),
        Setting("key", "text", "Instead of a state: each change of this memory key begins a trial"),
        Setting("columns", "names", "Memory values at the trial's end that become columns"),
        Setting("speech", "text", "The event that a program raises when the participant begins to speak"),
        Setting("measure", "text", "The dependent variable: a column with numbers", "participant_s"),
    ),
    make_table(
        "explore",
        "How much “explore” looks at",
        Setting("end", "text", "The rule whose end ends the study", "the rule of the first key"),
        Setting("faults", "whole number", "How many things go wrong on one path, 0 to 5", "1"),
        Setting("line", "whole number", "How many acts wait at most, 0 to 5", "1"),
        Setting("beside", "whole number", "How many acts of calling type None run at once, 0 to 5", "2"),
        Setting("pace", "value", 'The shortest and longest duration of acts, times the expected one; "any": any time',
                "[0.5, 3.0]"),
        Setting("tries.*", "value", "The values that a person or a program may write for this memory key: [2, 3]"),
        Setting("keys", "text", "Which keys it presses", "rules",
                {"rules": "those that rules wait for", "all": "also those that start acts by hand"}),
    ),
    make_table("always", "Properties that hold in every situation",
           Setting("*", "text", "A condition that holds in every situation")),
    make_table("reachable", "Properties that stay possible: every situation can still lead to them",
           Setting("*", "text", "A condition to which every situation can still lead")),
    make_table(
        "eventually.*",
        "Something that happens without help, as acts end and time passes",
        Setting("after", "text", "The situation from which it must happen", "every situation"),
        Setting("then", "text", "What happens without help"),
        Setting("unless", "text", "What makes it unnecessary"),
    ),
    make_table(
        "check.allow.*",
        "A warning about memory.json or a table that is meant",
        Setting("code", "text", "The warning's code: unwritable-key"),
        Setting("key", "text", "The memory key or column"),
        Setting("reason", "text", "Why it is meant"),
    ),
    make_table("actions", "Actions of the robot that this scenario changes or adds"),
    make_table("places", "Places where the robot looks, points or goes"),
)  # fmt: skip
"""All tables of scenario.toml. `keys`, `actions` and `places` have forms of their own."""


def names_in(tables: Sequence[SettingTable], path: str) -> dict[str, str]:
    """The names that a table may have, of its settings and of the tables in it, each with its meaning.

    >>> list(names_in(SCENARIO_TABLES, "fillers"))
    ['offer_after', 'auto_after']
    """
    inside = f"{path}." if path else ""
    found = {each.path: each.meaning for table in tables if table.path == path for each in table.settings}
    found |= {table.path: table.meaning for table in tables if table.path.startswith(inside) and table.path != path}
    names: dict[str, str] = {}
    for each, meaning in found.items():
        names.setdefault(each.removeprefix(inside).partition(".")[0], meaning)
    names.pop(ANY, None)
    return names


def table_at(tables: Sequence[SettingTable], path: Sequence[str]) -> SettingTable | None:
    """The table of this path, such as `("act", "R_Hello")`; None: none is known."""
    for table in tables:
        if fits(table.path, path):
            return table
    return None


def setting_at(tables: Sequence[SettingTable], path: Sequence[str]) -> Setting | None:
    """The setting of this path, such as `("act", "R_Hello", "hold")`; None: none is known.

    >>> setting_at(SCENARIO_TABLES, ("act", "R_Hello", "hold")).usual
    'no'
    """
    table = table_at(tables, path[:-1])
    return next((each for each in table.settings if fits(each.path, path)), None) if table is not None else None


def fits(pattern: str, path: Sequence[str]) -> bool:
    """Whether a path fits a pattern, as ("act", "R_Hello") fits `act.*`."""
    parts = pattern.split(".") if pattern else []
    return len(parts) == len(path) and all(part in (ANY, name) for part, name in zip(parts, path, strict=True))

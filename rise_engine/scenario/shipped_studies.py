"""The studies that come with the program: complete scenarios to run by name from anywhere, and to copy.

An installation has them in this package, a checkout in the folder `scenarios`. Nothing is written there. A new study
begins with a copy or with its first files.
"""

from __future__ import annotations

import json
import os
import shutil
import tomllib
from collections.abc import Mapping
from pathlib import Path
from shutil import copyfile
from tempfile import mkdtemp

from rise_engine.base.errors import StudyError
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, why_none_written

_PACKAGE = Path(__file__).parents[1]


def shipped_studies() -> dict[str, Path]:
    """The shipped studies by name."""
    for home in (_PACKAGE / "studies", _PACKAGE.parent / "scenarios"):
        found = sorted(home.glob(f"*/{SCENARIO_FILE}")) if home.is_dir() else []
        if found:
            return {file.parent.name: file.parent for file in found}
    return {}


def resolve_study(written: str) -> str:
    """The folder (or file) that is meant: an existing path, or else the shipped study of that name."""
    name = written.strip().rstrip("/")
    if not name or os.path.lexists(written) or "/" in name:
        return written
    folder = shipped_studies().get(name)
    return written if folder is None else str(folder)


def shipped_name(folder: str | os.PathLike[str]) -> str:
    """The name of the shipped study in a folder, or empty."""
    real = os.path.realpath(folder)
    return next((name for name, path in shipped_studies().items() if os.path.realpath(path) == real), "")


def study_title(folder: Path) -> str:
    """The title of a study, or else the name of its folder."""
    try:
        title = tomllib.loads((folder / SCENARIO_FILE).read_text(encoding="utf-8")).get("title")
    except (OSError, ValueError):
        return folder.name
    return title if isinstance(title, str) and title else folder.name


def study_lines() -> list[str]:
    """The shipped studies for people, one per line: name and title."""
    studies = shipped_studies()
    width = max(map(len, studies), default=0)
    return [f"{name:<{width}}  {study_title(path)}" for name, path in studies.items()]


def shipped_hint() -> str:
    """The end of a sentence about a missing folder."""
    names = ", ".join(f"`{name}`" for name in shipped_studies())
    return f"; shipped with the program are {names}" if names else ""


def copy_study(name: str, to: Path) -> int:
    """Copy a shipped study into a new or empty folder. Returns the number of files. Raises StudyError."""
    studies = shipped_studies()
    if name not in studies:
        raise StudyError(f"no study `{name}` is shipped with the program{did_you_mean(name, studies)}")
    source, number = studies[name], 0
    try:
        if to.exists() and not to.is_dir():
            raise StudyError(f"{to} is not a folder")
        if to.is_dir() and any(to.iterdir()):
            raise StudyError(f"{to} is not empty; name a new folder")
        to.mkdir(parents=True, exist_ok=True)
        for path in sorted(source.rglob("*")):
            new = to / path.relative_to(source)
            if path.is_dir():
                new.mkdir(exist_ok=True)
            elif path.is_file():
                copyfile(path, new)  # without permissions, because the copy must be writable
                number += 1
    except OSError as error:
        raise StudyError(f"{error.filename or to}: {error.strerror or error}") from error
    return number


# --- new studies ------------------------------------------------------------------------------------------------------


AGENTS_FILE = "AGENTS.md"
_AGENTS = """\
# For language models, and for everybody who changes these files by hand

This folder is a scenario of rise-tui: what a robot says and does with a participant while a wizard watches and helps.

- Read the reference pages of rise-tui's documentation first: the scenario folder (`scenario.md`), acts (`cra.md`),
  rules (`rules.md`), conditions (`conditions.md`) and the changes that `rise-engine edit` makes (`edits.md`).
- `rise-engine robots .` lists the robots and what each can do.
- `rise-engine check . --json` says everything that is wrong: file, line, what was expected and the nearest right name.
  A study with errors does not run. Check after every change.
- `rise-engine run . --rule NAME --speed max` plays a rule at once, without a robot; a file of tasks can be its wizard.

## How to change it

- Write changes as edits and show them first: `rise-engine edit . EDITS.json --dry-run` prints what would change, and
  writes nothing. A person reads it. Then leave `--dry-run` out: all edits are made or none, and nothing else in the
  files is touched. Put one change that can be judged by itself in one edit: one sentence, one act, one transition.
- Rename with `rise-engine rename . act OLD NEW` (also rule, state, event, key, action), never by search and replace.
- Change one thing at a time; keep comments, order and indentation. `git diff` should show one line for one sentence.
- What the robot says is read aloud to people. Texts that a language model has written are drafts until a person has
  read them. Mark them with a comment `draft`, and say which they are.
- Change nothing that participants have already been through without being asked.
- No names of participants and nothing about them in these files.
"""

_ACTS = """\
<!-- What the robot says and does. -->
<Dialogs>

<Dialog name="R_Hello">
  <Speech>
    <actionID>1</actionID>
    <message>Hello!</message>
  </Speech>
</Dialog>

</Dialogs>
"""
_RULE = """\
<!-- What happens when: the robot says hello, and has done then. -->
<InteractionRule name="Main" initial="Hello">

  <State id="Hello">
    <onEntry>
      <function startCommunicationRobotAct="R_Hello"/>
    </onEntry>
    <transition ended="R_Hello" target="Done"/>
  </State>

  <State id="Done"/>

</InteractionRule>
"""


def blank_study(title: str, robot: str) -> dict[str, str]:
    """The files of a study with one act and one rule, by name.

    :param title: the title of the study. :param robot: the name of a profile.
    """
    settings = f"title = {_toml(title)}\nrobot = {_toml(robot)}\n"
    keys = '\n[keys]\nb = { rule = "Main", label = "begin" }\nh = { act = "R_Hello", label = "hello" }\n'
    return {
        "scenario.toml": settings + keys,
        "acts/acts.xml": _ACTS,
        "rules/main.xml": _RULE,
        "memory.json": "{}\n",
        AGENTS_FILE: _AGENTS,
    }


def _toml(text: str) -> str:
    """A text in quotation marks: TOML has the escapes of JSON, and also one for DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def write_blank_study(folder: Path, title: str, robot: str) -> tuple[str, ...]:
    """Make a study with one act and one rule in a new or empty folder, whole or not at all. Returns its files' names.

    :raises StudyError: the folder is not empty, or it cannot be written.
    """
    files = blank_study(title, robot)
    try:
        if os.path.lexists(folder) and not folder.is_dir():
            raise StudyError(f"{folder} is not a folder")
        if folder.is_dir() and any(folder.iterdir()):
            raise StudyError(f"{folder} is not empty; name a new folder")
        write_new_folder(folder, files)
    except (OSError, UnicodeError) as error:
        raise StudyError(f"{folder}: {getattr(error, 'strerror', None) or error}") from error
    return tuple(files)


def write_new_folder(folder: Path, files: Mapping[str, str]) -> None:
    """Make a folder of a study, or fill an empty one, whole or not at all.

    :param files: texts by their names in the folder.
    :raises StudyError: a name is not allowed in a study.
    :raises OSError, UnicodeError: it cannot be written.
    """
    parent = folder.absolute().parent
    parent.mkdir(parents=True, exist_ok=True)
    made = Path(mkdtemp(prefix=f".{folder.name}.", dir=parent))
    try:
        if problem := why_none_written(made, files.items()):
            raise StudyError(problem)
        for name, text in files.items():
            path = made / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.encode())
        made.chmod(0o755)
        made.replace(folder)  # may replace an empty folder
    finally:  # also after an interruption
        shutil.rmtree(made, ignore_errors=True)


def write_agents_file(folder: Path) -> None:
    """Add the page for language models to a study that has none. Raises StudyError."""
    try:
        with (folder / AGENTS_FILE).open("x", encoding="utf-8") as file:
            file.write(_AGENTS)
    except FileExistsError:
        return
    except OSError as error:
        raise StudyError(f"{error.filename or folder}: {error.strerror or error}") from error

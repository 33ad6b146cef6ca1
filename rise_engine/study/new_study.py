"""Writer of a new study's folder: study.toml with comments, participants.csv, and copies of its scenarios."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path
from tempfile import mkdtemp
from textwrap import wrap

from msgspec import Struct

from rise_engine.base.errors import StudyError
from rise_engine.base.files import error_message
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.files.study_paths import why_no_name, why_not_read
from rise_engine.scenario.model import Json
from rise_engine.study.model import Level, Study, StudyCheck
from rise_engine.study.participants import PARTICIPANTS_FILE, header_line
from rise_engine.study.publishing import REPORT_ITEMS
from rise_engine.study.study_toml import STUDY_FILE, load_study
from rise_engine.syntax.toml import toml_key, toml_value


class NewStudy(Struct, frozen=True):
    """The description of a new study."""

    study: Study
    """The study. Its folder is not used; scenarios have their names in the study."""
    sources: dict[str, Path]
    """The folder from which each scenario is copied, by its name in the study."""
    label_only: frozenset[str] = frozenset()
    """Factors whose levels differ only in what people do."""


def write_new_study(folder: Path, new: NewStudy, *, accept_errors: bool = False) -> list[Diagnostic]:
    """Write a study into a new or empty folder, completely or not at all. Returns its errors.

    :param folder: the new folder.
    :param new: the study.
    :param accept_errors: write the study despite errors, so that a person can fix them in its files.
    :raises StudyError: the folder has contents or cannot be written, or the study has errors.
    """
    if problem := folder_problem(folder):
        raise StudyError(problem)
    folder = folder.resolve()
    for source in new.sources.values():
        if folder.is_relative_to(source.resolve()):
            raise StudyError(f"{folder} lies in the scenario {source}, which would be copied into it")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        made = Path(mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    except OSError as error:
        raise StudyError(f"{folder} cannot be made: {error_message(error)}") from None
    try:
        _fill(made, new)
        loaded = load_study(made)
        if loaded.study is None and not accept_errors:
            raise StudyError("the study would have errors:", *map(str, loaded.errors))
        made.rename(folder)  # replaces an empty folder of that name
        return loaded.errors
    except OSError as error:
        raise StudyError(f"{error.filename or folder} cannot be written: {error_message(error)}") from None
    finally:  # also after an interrupt
        shutil.rmtree(made, ignore_errors=True)


def folder_problem(folder: Path) -> str:
    """Return why no study can be made there. Empty: it can."""
    try:
        if folder.is_dir():
            return f"{folder} is not empty; name a new folder" if any(folder.iterdir()) else ""
    except OSError as error:
        return f"{folder} cannot be read: {error_message(error)}"
    return f"{folder} is not a folder" if folder.exists() or folder.is_symlink() else ""


def _fill(folder: Path, new: NewStudy) -> None:
    for name, source in new.sources.items():
        if problem := why_no_name(name, None):
            raise StudyError(problem)
        _copy_scenario(source, folder / name, source)
    (folder / STUDY_FILE).write_text(study_toml_text(new), encoding="utf-8")
    (folder / PARTICIPANTS_FILE).write_text(f"{header_line(new.study)}\n", encoding="utf-8")
    for name in (STUDY_FILE, PARTICIPANTS_FILE):
        (folder / name).chmod(0o600)


def _copy_scenario(source: Path, to: Path, scenario: Path) -> None:
    """Copy all of a scenario except hidden files and links. Permissions are not copied: the copy must be writable."""
    to.mkdir()
    for path in sorted(source.iterdir()):
        if path.name.startswith(".") or why_not_read(scenario, path.relative_to(scenario)):
            continue
        if path.is_dir() and not path.is_symlink():
            _copy_scenario(path, to / path.name, scenario)
        elif path.is_file():
            shutil.copyfile(path, to / path.name)


def study_toml_text(new: NewStudy) -> str:
    """Write study.toml with comments on possible changes."""
    study = new.study
    lines = [
        "# The design of this study. You change it here; `rise-engine study check` says in",
        "# words what is wrong with it. Once there is a plan, it fixes these:",
        "# seed, n, scenario, factors, assignment, strata. The id stays too, once there is a session.",
        "",
        f"title    = {toml_value(study.title)}",
        f"id       = {toml_value(study.id)}  # letters and digits: a part of file names",
        f"seed     = {study.seed}  # the plan is drawn from it; any whole number",
        f"n        = {study.n}  # complete participants that you want",
        *(f"# {line}" for name, source in new.sources.items() for line in _copy_lines(name, source)),
        f"scenario = {toml_value(study.scenario)}  # the folder with acts and rules",
        f"mode     = {toml_value(study.mode)}  "
        "# real: with the robot; debug: everything is simulated, and nothing counts",
        *([f"robot    = {toml_value(study.robot)}"] if study.robot else []),
        "",
        *_factor_lines(new),
        *_assignment_lines(study),
        *_consent_lines(study),
        *_check_lines(study.checks),
        *_RECORDING_LINES,
        *_report_lines(),
        *_participants_lines(study),
    ]
    return "\n".join(lines) + "\n"


def copy_sentence(name: str, source: str) -> str:
    """Return a sentence that a scenario of a study is a copy.

    >>> copy_sentence("scenario", "../greeting")
    'scenario is a copy: later changes to ../greeting have no effect here'
    """
    return f"{name} is a copy: later changes to {source} have no effect here"


def _copy_lines(name: str, source: Path) -> Iterable[str]:
    """Name the source without its path, which may contain personal names, because others get the study."""
    yield from wrap(f"{copy_sentence(name, source.name)}. Change the copy.", 88)


def _factor_lines(new: NewStudy) -> Iterable[str]:
    yield "# What you vary. between: each participant has one level. within: everybody has every"
    yield "# level, each in a session of its own. A level is what the robot does in it: memory"
    yield "# values that are set before anything runs, or another scenario."
    if not new.study.factors:
        yield "# [factors.hesitation]"
        yield '# kind = "between"'
        yield "# levels.yes.memory = { hesitation = true }"
        yield "# levels.no.memory = { hesitation = false }"
    for factor in new.study.factors:
        yield f"[factors.{factor.name}]"
        yield f"kind = {toml_value(factor.kind)}"
        if factor.name in new.label_only:
            yield "label_only = true  # people make the difference"
        for level in factor.levels:
            yield _level_line(level)
        labels = {level.name: level.label for level in factor.levels if level.label}
        if labels:
            yield f"labels = {toml_value(labels)}"
        yield ""
    if not new.study.factors:
        yield ""


def _level_line(level: Level) -> str:
    key = f"levels.{toml_key(level.name)}"
    values: dict[str, Json] = {}
    if level.memory:
        values["memory"] = level.memory
    if level.scenario:
        values["scenario"] = level.scenario
    if len(values) == 1:
        name, value = next(iter(values.items()))
        return f"{key}.{name} = {toml_value(value)}"
    return f"{key} = {toml_value(values)}"


def _assignment_lines(study: Study) -> Iterable[str]:
    settings = study.assignment
    yield "[assignment]"
    if any(factor.kind == "between" for factor in study.factors):
        yield "# blocks: in each block, every cell comes equally often, as often as one of the numbers in"
        yield "# `block`, drawn at random. Others: minimise, random, list (plan.csv is yours)."
        yield f"between = {toml_value(settings.between)}"
        yield f"block   = {toml_value(list(settings.block))}"
    if settings.strata:
        yield f"strata  = {toml_value(list(settings.strata))}  # columns of participants.csv; balanced in each"
    if any(factor.kind == "within" for factor in study.factors):
        yield "# williams: every level comes at every place, and after every other one, equally often."
        yield "# Others: latin, all, fixed, random."
        yield f"within  = {toml_value(settings.within)}"
    yield f"spare   = {settings.spare:g}  # rows of the plan beyond n, for those who drop out"
    yield f"hidden  = {toml_value(settings.hidden)}  # true: the condition is hidden until the session begins"
    yield ""
    if study.strata:
        yield "[strata]"
        for column, values in study.strata.items():
            yield f"{column} = {toml_value(list(values))}"
        yield ""


def _consent_lines(study: Study) -> Iterable[str]:
    yield "[consent]"
    columns = ", ".join(f"consent_{name}" for name in study.consent)
    why = f"  # without a date in {columns} no session with them begins" if columns else ""
    yield f"needed = {toml_value(list(study.consent))}{why}"
    yield ""


def _check_lines(checks: Iterable[StudyCheck]) -> Iterable[str]:
    yield "# Checks before and after each session, in this order. `ask`: somebody confirms"
    yield '# it. `auto`: the program does it. run = ["./check.sh"]: your own program does it.'
    yield "# A failed check prevents the session, unless it has blocks = false."
    for check in checks:
        yield "[[check]]"
        yield f"id = {toml_value(check.id)}"
        if check.ask:
            yield f"ask = {toml_value(check.ask)}"
        if check.auto:
            yield f"auto = {toml_value(check.auto)}"
        if check.minimum:
            yield f"min = {toml_value(check.minimum)}"
        if check.when == "after":
            yield 'when = "after"'
        yield ""


EXAMPLE = "X00"
"""An unlikely pseudonym, so that a withdrawal does not find it in these lines."""
_RECORDING_LINES = (
    "# Recorders start and end with each session. Remove the # of those that you have.",
    "# Only participants with a date in the column consent_recording of participants.csv are recorded.",
    "# [recording]",
    '# obs = { password_file = "~/.config/rise/obs" }',
    '# camera = { by = "ffmpeg", input = ["-f", "v4l2", "-i", "/dev/video0"] }',
    "# lsl = true   # markers for EEG and other streams",
    "# sync = true  # a sound at the start and the end, to align films with the session",
    "",
)


def _report_lines() -> Iterable[str]:
    yield "# Your answers for the reporting sheet of `rise-engine report`; the record has the rest."
    yield "# Missing items are listed there as still to say. Remove a # and write; you can change it at any time."
    yield "[report]"
    for item in REPORT_ITEMS:
        yield f'# {item.name} = ""  # {item.question}'
    yield ""


def _participants_lines(study: Study) -> Iterable[str]:
    yield f"# {PARTICIPANTS_FILE} has a line for each participant. You write it, with an editor or a"
    yield "# spreadsheet; the program only reads it. Its columns:"
    yield f"#   participant    a pseudonym of letters and digits, as {EXAMPLE}; keep the list of names elsewhere"
    for column, values in study.strata.items():
        yield f"#   {column:<14} {' or '.join(values)}"
    for name in study.consent:
        yield f"#   {f'consent_{name}':<14} the day on which they consented, as 2026-11-21; empty: not yet"
    yield "#   status         empty or invited; excluded: they do not count, and their slot is free again"
    yield "#   comment        what you want; no names, no mail addresses"
    yield "# Further columns: [participants]"
    yield '#                  columns = ["age"]'
    example = {"participant": EXAMPLE, **{column: values[0] for column, values in study.strata.items()}}
    example |= {f"consent_{name}": "2026-11-21" for name in study.consent}
    columns = header_line(study).split(",")
    yield f"# An example of a line: {','.join(example.get(column, '') for column in columns)}"

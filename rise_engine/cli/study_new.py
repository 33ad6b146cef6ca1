"""`rise-engine study new`: the questions about a new study, or the same answers as options."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from random import SystemRandom
from shlex import quote
from shutil import get_terminal_size
from textwrap import fill
from typing import TypeVar

from msgspec import Struct

from rise_engine.cli import study_answers as answers
from rise_engine.cli.arguments import exit_with_usage
from rise_engine.cli.study_planning import look_at_study, look_lines
from rise_engine.exit_status import INTERRUPTED, OK, REFUSED
from rise_engine.nearest_name import in_backquotes
from rise_engine.scenario.model import Mode, Scenario
from rise_engine.scenario.shipped_studies import shipped_studies
from rise_engine.study.balance import with_blocks_that_fit
from rise_engine.study.check_kinds import AUTOMATIC
from rise_engine.study.design import cells, runs
from rise_engine.study.factor_tables import what_it_does
from rise_engine.study.model import AssignmentSettings, Factor, FactorKind, Level, Study, StudyCheck
from rise_engine.study.new_study import NewStudy, NewStudyError, copy_sentence, folder_problem, write_new_study
from rise_engine.study.review import review_study
from rise_engine.text import pluralize

_WIDEST = 88
USUAL_CHECKS = "robot, disk, scenario, wizard"
DEBRIEF = "The participant was debriefed"
_Answer = TypeVar("_Answer")


class NewStudyOptions(Struct, frozen=True):
    """What the command line says of a new study; None or empty: it is asked, or the usual is taken."""

    title: str | None = None
    id: str | None = None
    scenario: str | None = None
    n: str | None = None
    mode: Mode = "real"
    robot: str = ""
    seed: int | None = None
    factors: tuple[str, ...] = ()
    """`NAME=between` or `NAME=within`."""
    levels: tuple[str, ...] = ()
    """`FACTOR.LEVEL=KEY = VALUE, ...`."""
    label_only: tuple[str, ...] = ()
    strata: tuple[str, ...] = ()
    consent: str | None = None
    automatic: str | None = None
    asked: tuple[str, ...] = ()
    asked_after: tuple[str, ...] = ()
    hidden: bool = False
    yes: bool = False


def new_report(folder: str, options: NewStudyOptions) -> int:
    """Ask for a study and write it, or write it as the options say.

    :param folder: where; a new or empty one.
    :param options: what is known already; with `yes`, nothing is asked.
    :return: the exit status.
    """
    path = Path(folder)
    if problem := folder_problem(path):
        print(f"error: {problem}", file=sys.stderr)
        return REFUSED
    if not options.yes and not (sys.stdin is not None and sys.stdin.isatty()):
        exit_with_usage(
            "nobody can be asked, because standard input is no terminal; say --yes, and options for the rest"
        )
    questions = _Questions(path, options, input)
    try:
        new = questions.ask_all()
        if new is None:
            print("Nothing was written.")
            return REFUSED
        errors = write_new_study(path, new, accept_errors=not options.yes)
    except NewStudyError as error:
        print(f"error: {error}", file=sys.stderr)
        return REFUSED
    except (EOFError, KeyboardInterrupt):
        print("\nNothing was written.")
        return INTERRUPTED
    where = quote(folder)
    for diagnostic in errors:
        print(str(diagnostic))
    try:
        look = look_at_study(review_study(path)) if not errors else None
    except KeyboardInterrupt:
        look = None  # the study is there; `study check` explores it
    for line in look_lines(look) if look is not None else ():
        print(fill(line, _width(), break_on_hyphens=False))
    print(f"\n{folder} is there{', with errors that are to be mended in it' * bool(errors)}.")
    for name, source in new.sources.items():
        print(f"{copy_sentence(str(path / name), str(source))}.")
    print("What is next:")
    print("  1. Write a line for each participant into participants.csv; study.toml says")
    print("     how, at its end. Change in study.toml what you like.")
    print(f"  2. rise-engine study check {where}")
    print("     says what is still wrong.")
    print(f"  3. rise-engine study plan {where}")
    print("     makes the plan, once: who gets what, in which order.")
    print(f"  4. rise-tui --config {where}")
    print("     runs it.")
    return REFUSED if errors else OK


class _Questions:
    """One conversation. What options say is not asked."""

    def __init__(self, folder: Path, options: NewStudyOptions, read_line: Callable[[str], str]) -> None:
        self.folder = folder
        self.options = options
        self.asks = not options.yes
        self.read_line = read_line
        self.sources: dict[str, Path] = {}
        self.label_only: set[str] = set(options.label_only)

    def ask_all(self) -> NewStudy | None:
        """Everything about the study; None: it is not to be written."""
        self.say(
            f"A new study in {self.folder}. Enter takes what stands in [brackets]; ctrl+c ends, and nothing is "
            "written before you have said so at the end. Everything can be changed in study.toml later."
        )
        options = self.options
        name = re.sub(r"[^A-Za-z0-9]", "", self.folder.resolve().name) or "study"
        title = self.answer("Title", self.folder.resolve().name, answers.parse_text, options.title, "--title")
        identity = self.answer(
            "Short name, letters and digits, for file names", name, answers.parse_id, options.id, "--id"
        )
        scenario = self.ask_scenario()
        number = self.answer("Complete participants that you want", "24", answers.parse_count, options.n, "--n")
        factors = self.ask_factors(scenario)
        strata = self.ask_strata()
        consent = self.ask_consent()
        checks = self.ask_checks()
        hidden = options.hidden
        if self.asks and factors and not hidden:
            hidden = self.answer(
                "Is the wizard to see the condition only when the session begins (y/n)", "n", answers.parse_yes
            )
        study = Study(
            folder=str(self.folder),
            title=title,
            id=identity,
            seed=options.seed if options.seed is not None else SystemRandom().randrange(10**8, 10**9),
            n=number,
            scenario="scenario",
            mode=options.mode,
            robot=options.robot,
            factors=factors,
            assignment=AssignmentSettings(strata=tuple(strata), hidden=hidden),
            strata=strata,
            consent=consent,
            checks=checks,
        )
        study = with_blocks_that_fit(study)
        new = NewStudy(study, self.sources, frozenset(self.label_only))
        return new if not self.asks or self.confirm(study) else None

    # --- asking ---

    def say(self, text: str) -> None:
        """A paragraph before questions."""
        if self.asks:
            print(f"\n{fill(text, _width())}")

    def answer(
        self,
        question: str,
        usual: str,
        parse: Callable[[str], _Answer],
        given: str | None = None,
        option: str = "",
    ) -> _Answer:
        """What is answered, asked again with a reason until it means something.

        :param question: in words.
        :param usual: what Enter means.
        :param parse: raises ValueError with the reason why an answer means nothing.
        :param given: the answer that an option gives.
        :param option: its name.
        """
        if given is not None:
            try:
                return parse(given)
            except ValueError as error:
                exit_with_usage(f"{option} {given}: {error}")
        if not self.asks:
            return parse(usual)
        while True:
            text = self.read_line(f"{question}{f' [{usual}]' if usual else ''}: ").strip() or usual
            try:
                return parse(text)
            except ValueError as error:
                print(fill(f"-> {error}", _width(), initial_indent="   ", subsequent_indent="      "))

    # --- the parts of a study ---

    def ask_scenario(self) -> Scenario:
        shipped = list(shipped_studies())
        self.say(
            "The scenario is what the robot can do: acts and rules. It is copied into the study. With the program come "
            f"{', '.join(shipped)}; or write the path of yours."
        )
        usual = "greeting" if "greeting" in shipped else next(iter(shipped), ".")
        path, scenario = self.answer("Scenario", usual, answers.parse_scenario, self.options.scenario, "--scenario")
        self.sources["scenario"] = path
        return scenario

    def ask_factors(self, scenario: Scenario) -> tuple[Factor, ...]:
        factors: list[Factor] = []
        for written in self.options.factors:
            factors.append(self.factor_of_option(written, factors, scenario))
        self.check_level_options(factors)
        if factors or not self.asks:
            return tuple(factors)
        self.say(
            "Factors are what you vary. A level of a factor says what the robot does in it, by memory values that are "
            "set before anything runs (hesitation = true), or by another scenario (scenario PATH). The keys of this "
            f"scenario's memory: {', '.join(scenario.memory) or 'none'}."
        )
        while True:
            which = "Next factor, one word (Enter: no more)" if factors else "First factor, one word (Enter: none)"
            name = self.answer(
                which, "", lambda text: text and answers.parse_factor_name(text, [each.name for each in factors])
            )
            if not name:
                return tuple(factors)
            factors.append(self.ask_factor(name, scenario))

    def ask_factor(self, name: str, scenario: Scenario) -> Factor:
        print("   between: each participant has one level. within: everybody has every level,")
        print("   each in a session of its own.")
        kind = self.answer("   Between or within", "between", answers.parse_kind)
        while True:
            names = self.answer("   Its levels, with commas between them", "yes, no", answers.parse_level_names)
            levels: list[Level] = []
            for level in names:
                usual = answers.usual_level(name, level, scenario)
                hint = f"{answers.NOTHING}: nothing" if usual else "KEY = VALUE; Enter: nothing"
                levels.append(
                    self.answer(
                        f"   What {level} sets ({hint})",
                        usual,
                        lambda text, level=level: answers.parse_level(level, text, scenario),  # type: ignore[misc]
                    )
                )
            if not _same_levels(levels):
                break
            print(f"   -> In {in_backquotes(_same_levels(levels))} the robot does the same.")
            if self.answer("   Is what differs done by people, not by the robot (y/n)", "n", answers.parse_yes):
                self.label_only.add(name)
                break
        return self.make_factor(name, kind, levels)

    def make_factor(self, name: str, kind: FactorKind, levels: list[Level]) -> Factor:
        """The factor, with the scenarios of its levels as they are called in the study."""
        named: list[Level] = []
        for level in levels:
            if level.scenario:
                called = f"scenario-{level.name}"
                self.sources[called] = answers.parse_scenario(level.scenario)[0]
                level = Level(level.name, level.memory, called, level.label)
            named.append(level)
        return Factor(name, kind, tuple(named))

    def factor_of_option(self, written: str, before: list[Factor], scenario: Scenario) -> Factor:
        name, _, kind = written.partition("=")
        option = f"--factor {written}"
        try:
            answers.parse_factor_name(name, [factor.name for factor in before])
            parsed = answers.parse_kind(kind)
            levels: list[Level] = []
            for text in self.options.levels:
                path, _, sets = text.partition("=")
                factor, _, level = path.strip().partition(".")
                if factor == name:
                    option = f"--level {text}"
                    levels.append(answers.parse_level(level.strip(), sets, scenario))
            option = f"--factor {written}"
            answers.parse_level_names(", ".join(level.name for level in levels))
        except ValueError as error:
            exit_with_usage(f"{option}: {error}")
        if _same_levels(levels) and name not in self.label_only:
            exit_with_usage(
                f"--factor {written}: in {in_backquotes(_same_levels(levels))} the robot does the same; say "
                f"--label-only {name} if what differs is done by people"
            )
        return self.make_factor(name, parsed, levels)

    def check_level_options(self, factors: list[Factor]) -> None:
        """Every `--level` belongs to a factor."""
        names = [factor.name for factor in factors]
        for text in self.options.levels:
            if text.partition("=")[0].strip().partition(".")[0] not in names:
                exit_with_usage(f"--level {text}: write FACTOR.LEVEL=KEY = VALUE, with --factor FACTOR=between before")

    def ask_strata(self) -> dict[str, tuple[str, ...]]:
        strata: dict[str, tuple[str, ...]] = {}
        for written in self.options.strata:
            column, values = self.answer(
                "", "", lambda text: answers.parse_stratum(text, list(strata)), written, "--stratum"
            )
            strata[column] = values
        if strata or not self.asks:
            return strata
        self.say(
            "Are there groups of people in each of which the conditions are to be equally frequent, as people who "
            "speak German and English? Write a word and its values: language: de, en"
        )
        while True:
            which = "Next groups (Enter: no more)" if strata else "Groups (Enter: none)"
            found = self.answer(which, "", lambda text: answers.parse_stratum(text, list(strata)) if text else None)
            if found is None:
                return strata
            strata[found[0]] = found[1]

    def ask_consent(self) -> tuple[str, ...]:
        self.say(
            "What must participants have consented to before a session? Each is a column of participants.csv with a "
            "date; without one no session begins. Write words with commas between them: study, recording"
        )
        question = f"Consent to ({answers.NOTHING}: nothing)"
        return self.answer(question, "study", answers.parse_consents, self.options.consent, "--consent")

    def ask_checks(self) -> tuple[StudyCheck, ...]:
        options = self.options
        if self.asks and options.automatic is None:
            self.say("What is the program to look at before each session? Words with commas between them.")
            width = max(map(len, AUTOMATIC))
            for name, what in AUTOMATIC.items():
                indent = " " * (width + 5)
                print(fill(f"   {name:<{width}}  {what}", _width(), subsequent_indent=indent))
        question = f"Look at ({answers.NOTHING}: nothing)"
        checks = list(self.answer(question, USUAL_CHECKS, answers.parse_automatic, options.automatic, "--auto"))
        for after, sentences in ((False, options.asked), (True, options.asked_after)):
            for sentence in sentences:
                if sentence.strip() == answers.NOTHING:
                    continue
                checks.append(answers.asked_check(sentence, [check.id for check in checks], after=after))
        if not self.asks:
            if not options.asked_after:
                checks.append(answers.asked_check(DEBRIEF, [check.id for check in checks], after=True))
            return tuple(checks)
        if not options.asked:
            self.say("What is somebody to look at, and to confirm? A sentence: The lamp behind the robot is on")
            while sentence := self.answer("Before each session (Enter: no more)", "", str.strip):
                checks.append(answers.asked_check(sentence, [check.id for check in checks]))
        if not options.asked_after:
            question = f"After each session ({answers.NOTHING}: nothing)"
            sentence = self.answer(question, DEBRIEF, str.strip)
            if sentence != answers.NOTHING:
                checks.append(answers.asked_check(sentence, [check.id for check in checks], after=True))
        return tuple(checks)

    def confirm(self, study: Study) -> bool:
        """Whether it is to be written."""
        self.say(_summary(study))
        return self.answer(f"Write it into {self.folder} (y/n)", "y", answers.parse_yes)


def _width() -> int:
    """How wide paragraphs are."""
    return min(_WIDEST, get_terminal_size().columns - 1)


def _same_levels(levels: list[Level]) -> list[str]:
    """The first two levels in which the robot does the same."""
    for at, level in enumerate(levels):
        for other in levels[:at]:
            if what_it_does(level) == what_it_does(other):
                return [other.name, level.name]
    return []


def _summary(study: Study) -> str:
    parts = [pluralize(study.n, "participant")]
    if len(names := cells(study)) > 1:
        listed = ", ".join("+".join(cell.values()) for cell in names)
        parts.append(f"{len(names)} cells ({listed})")
    each = runs(study)
    if len(each) > 1:
        parts.append(f"{len(each)} sessions each ({', '.join(each)}), in orders that are balanced")
    if study.strata:
        parts.append(f"balanced within {', '.join(study.strata)}")
    return f"{study.title}: {'; '.join(parts)}."

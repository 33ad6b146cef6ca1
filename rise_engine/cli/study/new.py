"""`rise-engine study new`: questions about a new study, or the same answers as options."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path
from random import SystemRandom
from shlex import quote
from shutil import get_terminal_size
from textwrap import fill
from typing import Any, TypeVar

import click

from rise_engine.base.exit_status import INTERRUPTED, OK, REFUSED
from rise_engine.base.nearest_name import in_backquotes
from rise_engine.base.text import pluralize
from rise_engine.cli.options import MODE, ROBOT
from rise_engine.cli.study import answers
from rise_engine.cli.study.answers import DEFAULT_CHECKS
from rise_engine.cli.study.planning import exploration_lines, explore_study
from rise_engine.cli.terminal import Refused, exit_with_usage, print_lines
from rise_engine.scenario.model import Mode, Scenario
from rise_engine.scenario.shipped_studies import shipped_name, shipped_studies
from rise_engine.study.balance import with_blocks_that_fit
from rise_engine.study.checks import AUTOMATIC
from rise_engine.study.model import AssignmentSettings, Factor, FactorKind, Level, Study, StudyCheck
from rise_engine.study.new_study import NewStudy, copy_sentence, folder_problem, write_new_study
from rise_engine.study.plan import cells, runs
from rise_engine.study.review import review_study
from rise_engine.study.study_toml import MAX_SEED

_WIDEST = 88
_DEBRIEF = "The participant was debriefed"
_Answer = TypeVar("_Answer")


@click.command()
@click.argument("folder", metavar="STUDY", type=click.Path())
@click.option("--title", metavar="TEXT", help="Set the title of the study.")
@click.option("--id", metavar="WORD", help="Set its short name, of letters and digits.")
@click.option("--scenario", metavar="NAME|DIR", help="Copy this scenario: a shipped one, or a path.")
@click.option("--n", metavar="N", help="Set the number of complete participants that you want.")
@MODE
@ROBOT
@click.option("--seed", type=click.IntRange(0, MAX_SEED), metavar="N", help="Set the seed of the plan. Default: drawn.")
@click.option(
    "--factor",
    "factors",
    metavar="NAME=KIND",
    multiple=True,
    help="Add a factor, as in noise=between or noise=within. Repeatable.",
)
@click.option(
    "--level",
    "levels",
    metavar="FACTOR.LEVEL=SETS",
    multiple=True,
    help="Add a level, as in 'noise.loud=noise = true' or 'noise.loud=scenario DIR'. Repeatable.",
)
@click.option(
    "--label-only",
    metavar="FACTOR",
    multiple=True,
    help="Let people carry out what differs in this factor. Repeatable.",
)
@click.option(
    "--stratum", "strata", metavar="NAME=A,B", multiple=True, help="Add a stratum, as in language=de,en. Repeatable."
)
@click.option("--consent", metavar="A,B", help="Require consent to these; - for none. Default: study.")
@click.option(
    "--auto",
    "automatic",
    metavar="A,B",
    help=f"Make these automatic checks; - for none. Default: {DEFAULT_CHECKS}.",
)
@click.option(
    "--ask", "asked", metavar="SENTENCE", multiple=True, help="Ask for this confirmation before a session. Repeatable."
)
@click.option(
    "--ask-after",
    "asked_after",
    metavar="SENTENCE",
    multiple=True,
    help="Ask for this confirmation after a session; - for none. Repeatable.",
)
@click.option("--hidden", is_flag=True, help="Show the condition on screens only when the session begins.")
@click.option("--yes", is_flag=True, help="Ask nothing, and use the defaults.")
def new(folder: str, **given: Any) -> int:
    """Make a study in the new or empty folder STUDY: ask what it is about, and write study.toml with comments.

    Exit status: 0; 1 if it could not be made, or has errors or problems; 2 wrong usage; 130 if you broke it off.
    Nothing is left half made.
    """
    path = Path(folder)
    if problem := folder_problem(path):
        raise Refused(problem)
    if not given["yes"] and not (sys.stdin is not None and sys.stdin.isatty()):
        exit_with_usage(
            "standard input is not a terminal, so no questions can be asked; use --yes, and options for the rest"
        )
    try:
        made = _Conversation(path, given).ask_all()
        if made is None:
            print_lines("Nothing was written.")
            return REFUSED
        errors = write_new_study(path, made, accept_errors=not given["yes"])
    except (EOFError, KeyboardInterrupt):
        print_lines("", "Nothing was written.")
        return INTERRUPTED
    print_lines(*errors)
    try:
        exploration = explore_study(review_study(path)) if not errors else None
    except KeyboardInterrupt:
        exploration = None  # the study exists; `study check` explores it
    for line in exploration_lines(exploration):
        _print_filled(line)
    where = quote(folder)
    problems = exploration.problems if exploration is not None else 0
    to_fix = "errors" if errors else "a problem" if problems == 1 else "problems" if problems else ""
    print_lines(
        "",
        f"{folder} was made{f', with {to_fix} that you must fix' if to_fix else ''}.",
        *(
            f"{copy_sentence(str(path / name), shipped_name(source) or str(source))}."
            for name, source in made.sources.items()
        ),
        "What is next:",
        "  1. Write a line for each participant into participants.csv; study.toml says",
        "     how, at its end. Change in study.toml what you like.",
        f"  2. rise-engine study check {where}",
        "     says what is still wrong.",
        f"  3. rise-engine study plan {where}",
        "     makes the plan, once: who gets what, in which order.",
        f"  4. rise-tui --config {where}",
        "     runs it.",
    )
    return REFUSED if to_fix else OK


class _Conversation:
    """All questions; answers from options are not asked again."""

    def __init__(self, folder: Path, given: dict[str, Any]) -> None:
        """Take the answers from options. With `yes`, ask nothing."""
        self.folder = folder
        self.given = given
        self.asks = not given["yes"]
        self.sources: dict[str, Path] = {}
        self.label_only: set[str] = set(given["label_only"])

    def ask_all(self) -> NewStudy | None:
        """Ask everything about the study; None: the user does not want to write it."""
        self.say(
            f"A new study in {self.folder}. Enter takes the value in [brackets]; ctrl+c ends, and nothing is "
            "written until you confirm it at the end. Everything can be changed in study.toml later."
        )
        given, usual = self.given, self.folder.resolve().name
        title: str = self.put(answers.TITLE, usual, given["title"])
        identity: str = self.put(answers.IDENTITY, re.sub(r"[^A-Za-z0-9]", "", usual) or "study", given["id"])
        scenario = self.ask_scenario()
        n: int = self.put(answers.COUNT, "24", given["n"])
        factors = self.ask_factors(scenario)
        strata = self.ask_strata()
        consent: tuple[str, ...] = self.put(answers.CONSENT, "study", given["consent"])
        checks = self.ask_checks()
        hidden: bool = given["hidden"]
        if self.asks and factors and not hidden:
            question = "Hide the condition from the wizard until the session begins (y/n)"
            hidden = self.answer(question, "n", answers.parse_yes)
        mode: Mode = given["mode"] or "real"
        study = with_blocks_that_fit(
            Study(
                folder=str(self.folder),
                title=title,
                id=identity,
                seed=given["seed"] if given["seed"] is not None else SystemRandom().randrange(10**8, 10**9),
                n=n,
                scenario="scenario",
                mode=mode,
                robot=given["robot"] or "",
                factors=factors,
                assignment=AssignmentSettings(strata=tuple(strata), hidden=hidden),
                strata=strata,
                consent=consent,
                checks=checks,
            )
        )
        if self.asks:
            self.say(_summary(study))
            if not self.answer(f"Write it into {self.folder} (y/n)", "y", answers.parse_yes):
                return None
        return NewStudy(study, self.sources, frozenset(self.label_only))

    # --- asking ---

    def say(self, text: str) -> None:
        """Print a paragraph before questions."""
        if self.asks:
            print_lines("")
            _print_filled(text, break_on_hyphens=True)

    def put(self, question: answers.Question, usual: str, given: str | None) -> Any:
        """Ask one of the questions above, unless its option answers it."""
        if given is not None:
            with answers.meaning(f"{question.option} {given}"):
                return question.parse(given)
        if question.about:
            self.say(question.about)
        if question is answers.AUTOMATIC_CHECKS and self.asks:
            width = max(map(len, AUTOMATIC))
            for name, what in AUTOMATIC.items():
                _print_filled(f"   {name:<{width}}  {what}", " " * (width + 5), break_on_hyphens=True)
        return self.answer(question.question, usual, question.parse)

    def answer(self, question: str, usual: str, parse: Callable[[str], _Answer]) -> _Answer:
        """Ask until the answer is valid, each time with the reason; Enter means `usual`."""
        if not self.asks:
            return parse(usual)
        while True:
            text = input(f"{question}{f' [{usual}]' if usual else ''}: ").strip() or usual
            try:
                return parse(text)
            except ValueError as error:
                _print_filled(f"   -> {error}", "      ", break_on_hyphens=True)

    def answers(self, first: str, others: str, parse: Callable[[str], _Answer]) -> Iterator[_Answer]:
        """Yield answers until the user only presses Enter; the caller uses each before the next question."""
        question = first
        while (found := self.answer(question, "", lambda text: parse(text) if text else None)) is not None:
            yield found
            question = others

    # --- the parts of a study ---

    def ask_scenario(self) -> Scenario:
        shipped = list(shipped_studies())
        about = (
            "The scenario is what the robot can do: acts and rules. It is copied into the study. With the program come "
            f"{', '.join(shipped)}; or write the path of yours."
        )
        usual = "greeting" if "greeting" in shipped else next(iter(shipped), ".")
        question = answers.Question("--scenario", "Scenario", answers.parse_scenario, about)
        scenario: Scenario
        self.sources["scenario"], scenario = self.put(question, usual, self.given["scenario"])
        return scenario

    def ask_factors(self, scenario: Scenario) -> tuple[Factor, ...]:
        factors: dict[str, Factor] = {}
        for written in self.given["factors"]:
            factor = self.factor_of_option(written, factors, scenario)
            factors[factor.name] = factor
        for text in self.given["levels"]:
            if text.partition("=")[0].strip().partition(".")[0] not in factors:
                exit_with_usage(f"--level {text}: write FACTOR.LEVEL=KEY = VALUE, with --factor FACTOR=between before")
        if self.asks and not factors:
            self.say(
                "Factors are what you vary. A level of a factor says what the robot does in it, by memory values that "
                "are set before anything runs (hesitation = true), or by another scenario (scenario PATH). The keys of "
                f"this scenario's memory: {', '.join(scenario.memory) or 'none'}."
            )
            first, others = "First factor, one word (Enter: none)", "Next factor, one word (Enter: no more)"
            for name in self.answers(first, others, partial(answers.parse_factor_name, taken=factors)):
                factors[name] = self.ask_factor(name, scenario)
        return tuple(factors.values())

    def ask_factor(self, name: str, scenario: Scenario) -> Factor:
        print_lines(
            "   between: each participant has one level. within: everybody has every level,",
            "   each in a session of its own.",
        )
        kind = self.answer("   Between or within", "between", answers.parse_kind)
        while True:
            names = self.answer("   Its levels, with commas between them", "yes, no", answers.parse_level_names)
            levels = [self.ask_level(name, level, scenario) for level in names]
            if not (same := answers.same_levels(levels)):
                break
            print_lines(f"   -> In {in_backquotes(same)} the robot does the same.")
            if self.answer("   Is what differs done by people, not by the robot (y/n)", "n", answers.parse_yes):
                self.label_only.add(name)
                break
        return self.make_factor(name, kind, levels)

    def ask_level(self, factor: str, level: str, scenario: Scenario) -> Level:
        usual = answers.usual_level(factor, level, scenario)
        hint = f"{answers.NOTHING}: nothing" if usual else "KEY = VALUE; Enter: nothing"
        question = f"   What {level} sets ({hint})"
        return self.answer(question, usual, lambda text: answers.parse_level(level, text, scenario))

    def make_factor(self, name: str, kind: FactorKind, levels: list[Level]) -> Factor:
        """Make the factor, with the names of its levels' scenarios in the study."""
        named: list[Level] = []
        for level in levels:
            if level.scenario:
                called = f"scenario-{level.name}"
                self.sources[called] = answers.parse_scenario(level.scenario)[0]
                level = Level(level.name, level.memory, called, level.label)
            named.append(level)
        return Factor(name, kind, tuple(named))

    def factor_of_option(self, written: str, before: Collection[str], scenario: Scenario) -> Factor:
        name, _, kind = written.partition("=")
        levels: list[Level] = []
        with answers.meaning(f"--factor {written}"):
            answers.parse_factor_name(name, before)
            parsed = answers.parse_kind(kind)
            for text in self.given["levels"]:
                path, _, sets = text.partition("=")
                factor, _, level = path.strip().partition(".")
                if factor == name:
                    with answers.meaning(f"--level {text}"):
                        levels.append(answers.parse_level(level.strip(), sets, scenario))
            answers.parse_level_names(", ".join(level.name for level in levels))
        if (same := answers.same_levels(levels)) and name not in self.label_only:
            exit_with_usage(
                f"--factor {written}: in {in_backquotes(same)} the robot does the same; use "
                f"--label-only {name} if people make the difference"
            )
        return self.make_factor(name, parsed, levels)

    def ask_strata(self) -> dict[str, tuple[str, ...]]:
        strata: dict[str, tuple[str, ...]] = {}
        for written in self.given["strata"]:
            with answers.meaning(f"--stratum {written}"):
                column, values = answers.parse_stratum(written, strata)
            strata[column] = values
        if self.asks and not strata:
            self.say(
                "Are there groups of people that should each get all conditions equally often, such as people who "
                "speak German and English? Write a word and its values: language: de, en"
            )
            first, others = "Groups (Enter: none)", "Next groups (Enter: no more)"
            for column, values in self.answers(first, others, partial(answers.parse_stratum, taken=strata)):
                strata[column] = values
        return strata

    def ask_checks(self) -> tuple[StudyCheck, ...]:
        checks: list[StudyCheck] = [
            *self.put(answers.AUTOMATIC_CHECKS, answers.DEFAULT_CHECKS, self.given["automatic"])
        ]

        def add(sentence: str, *, after: bool = False) -> None:
            if sentence.strip() != answers.NOTHING:
                checks.append(answers.asked_check(sentence, [check.id for check in checks], after=after))

        for option, sentences in (("--ask", self.given["asked"]), ("--ask-after", self.given["asked_after"])):
            for sentence in sentences:
                with answers.meaning(f"{option} {sentence}"):
                    add(answers.parse_text(sentence), after=option == "--ask-after")
        if self.asks and not self.given["asked"]:
            self.say("What should people look at and confirm? A sentence: The lamp behind the robot is on")
            question = "Before each session (Enter: no more)"
            for sentence in self.answers(question, question, answers.parse_text):
                add(sentence)
        if not self.given["asked_after"]:
            add(self.answer(f"After each session {answers.NOTHING_TEXT}", _DEBRIEF, answers.parse_text), after=True)
        return tuple(checks)


def _print_filled(text: str, indent: str = "", *, break_on_hyphens: bool = False) -> None:
    """Print a paragraph as wide as the terminal, with an `indent` from its second line on."""
    width = min(_WIDEST, get_terminal_size().columns - 1)
    print_lines(*fill(text, width, subsequent_indent=indent, break_on_hyphens=break_on_hyphens).split("\n"))


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

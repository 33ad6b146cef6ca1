"""The checks of a study on the command line: options with people's answers, and questions on a terminal.

`gather_check_reports` makes all checks and returns the session's reports, or refuses with all missing ones.
"""

from __future__ import annotations

import asyncio
import shlex
import sys
from pathlib import Path
from typing import Literal

from msgspec import Struct

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.checks.outcome import CheckContext, CheckOutcome, answer_check, kept_check, skipped_check
from rise_engine.checks.runner import append_checked, report_check, run_check
from rise_engine.cli.terminal import Refused, print_notes
from rise_engine.kernel.inputs import CheckReport
from rise_engine.kernel.records import ENGINE
from rise_engine.study.checks import PendingCheck, check_text, made_after, pending_checks, skip_problem
from rise_engine.study.model import Purpose, Study, StudyCheck
from rise_engine.study.study_log import read_log

CONFIRMED = "confirmed on the command line"
_MARKS = {"passed": "ok", "failed": "FAILED", "skipped": "skipped"}
_SLOW = frozenset({"robot", "sound", "replay", "recorder", "explored"})


class CheckOptions(Struct, frozen=True):
    """The answers to checks on the command line."""

    confirmed: tuple[str, ...] = ()
    """`--confirm ID`: a person has looked, or will have heard the word of `sound`."""
    skipped: tuple[str, ...] = ()
    """`--skip-check ID=REASON`."""


class StandardTerminal:
    """Standard input and standard error, on which a person reads the results of checks and answers."""

    @property
    def answers(self) -> bool:
        """Whether a person can answer."""
        return sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty()

    def show(self, line: str) -> None:
        """Show a line."""
        print_notes(line)

    def ask(self, question: str) -> str:
        """Ask a question, and return the answer. :raises EOFError: the input has ended."""
        print(f"{question} ", end="", file=sys.stderr, flush=True)
        line = sys.stdin.readline()
        if not line:
            print_notes("")
            raise EOFError
        return line.strip()


def gather_check_reports(
    context: CheckContext,
    options: CheckOptions,
    when: Literal["before", "after"] = "before",
    terminal: StandardTerminal | None = None,
) -> tuple[CheckReport, ...]:
    """Make the checks of a study, one after the other, and write each result to study.jsonl.

    A session that counts begins only after every check that blocks has passed or was skipped. After a session, and
    before one that does not count, missing checks are only reported. In debug mode no checks are made.

    :param context: the session.
    :param options: the answers on the command line.
    :param when: before or after the session.
    :param terminal: by default standard input and standard error.
    :return: the session's reports, in the order of the file.
    :raises Refused: with all missing checks, and the options for them.
    """
    terminal = terminal or StandardTerminal()
    study = context.study
    chosen = read_check_options(study, context.purpose, options, when)
    if when == "before" and context.purpose == "debug":
        return ()
    log = read_log(Path(study.folder))
    pending = pending_checks(study, when, log, context.now())
    if when == "after":
        made = made_after(log)
        wanted = chosen.confirmed | chosen.reasons.keys()
        pending = tuple(
            each for each in pending if each.check.id in wanted or (context.session, each.check.id) not in made
        )
    gathering = _Gathering(context, chosen, terminal, when == "before" and context.purpose == "counted")
    reports = tuple(filter(None, map(gathering.gather, pending)))
    if gathering.missing:
        raise Refused(*gathering.missing, hints=gathering.hints)
    return reports


class ChosenChecks(Struct, frozen=True):
    """The options after parsing."""

    confirmed: frozenset[str]
    reasons: dict[str, str]
    """The reasons of skipped checks."""


def read_check_options(
    study: Study, purpose: Purpose, options: CheckOptions, when: Literal["before", "after"]
) -> ChosenChecks:
    """Parse the options for a study.

    :param study: the study with the checks.
    :param purpose: the purpose of the session.
    :param options: the options of the command line.
    :param when: before or after the session.
    :raises Refused: with all errors in them.
    """
    problems: list[str] = []
    reasons: dict[str, str] = {}
    for text in options.skipped:
        id, equals, reason = text.partition("=")
        check = _find_check(study, id, when, "--skip-check", problems)
        if check is None:
            continue
        if not equals or not reason.strip():
            problems.append(f"--skip-check {id}: say why: --skip-check {shlex.quote(f'{id}=the reason')}")
        elif problem := skip_problem(check, purpose, reason):
            problems.append(f"--skip-check {problem}")
        reasons[id] = reason
    for id in options.confirmed:
        check = _find_check(study, id, when, "--confirm", problems)
        if check is not None and not is_answered_by_person(check):
            problems.append(f"--confirm {id}: the program checks this itself ({check_text(check)})")
        if id in reasons:
            problems.append(f"{id} is both confirmed and skipped: use one of them")
    if problems:
        raise Refused(*problems)
    return ChosenChecks(frozenset(options.confirmed), reasons)


def is_answered_by_person(check: StudyCheck) -> bool:
    """Return whether a person determines the result of a check."""
    return bool(check.ask) or check.auto == "sound"


def _find_check(study: Study, id: str, when: str, option: str, problems: list[str]) -> StudyCheck | None:
    check = next((each for each in study.checks if each.id == id), None)
    if check is None:
        ids = [each.id for each in study.checks if each.when == when]
        problems.append(f"{option} {id}: the study has no such check{did_you_mean(id, ids)}")
    elif check.when != when:
        problems.append(f"{option} {id}: this check is made {check.when} a session ({check_text(check)})")
        return None
    return check


class _Gathering:
    """One pass through the checks."""

    def __init__(self, context: CheckContext, chosen: ChosenChecks, terminal: StandardTerminal, binding: bool) -> None:
        self._context = context
        self._chosen = chosen
        self._terminal = terminal
        self._binding = binding
        """Whether a missing check prevents the session."""
        self._person = f"wizard:{context.wizard or 'command-line'}"
        self.missing: list[str] = []
        self._to_confirm: list[str] = []
        self._to_skip: list[str] = []

    @property
    def hints(self) -> list[str]:
        """The options for missing checks, to be copied."""
        confirm = " ".join(f"--confirm {id}" for id in self._to_confirm)
        skip = " ".join(f"--skip-check {id}=REASON" for id in self._to_skip)
        return [
            *([f"when it is true, use {confirm}"] if confirm else []),
            *([f"to skip what you cannot fix now, use {skip}"] if skip else []),
        ]

    def gather(self, pending: PendingCheck) -> CheckReport | None:
        """Make one check; None if it has no result."""
        check = pending.check
        reason = self._chosen.reasons.get(check.id)
        if reason is not None:
            return self._keep(check, skipped_check(check, reason), self._person)
        if pending.good_since:
            outcome = kept_check(pending)
            self._show(check, outcome)
            return report_check(outcome)  # already in the log
        if is_answered_by_person(check) and not self._terminal.answers and check.id not in self._chosen.confirmed:
            # The robot does not speak if no person can confirm that it was heard.
            if self._miss(check, f"{check.id}: not confirmed: “{check_text(check)}”"):
                self._to_confirm.append(check.id)
            return None
        return self._make(check)

    def _make(self, check: StudyCheck) -> CheckReport:
        """Make a check. If a person can answer, repeat it until it passes, is skipped, or is left."""
        while True:
            outcome, by = self._run_check(check)
            report = self._keep(check, outcome, by)
            if outcome.result == "passed" or not (check.blocks and self._binding):
                return report
            choice = self._ask_on(check) if self._terminal.answers else None
            if choice is None:
                self._miss(check, f"{check.id}: {outcome.found or outcome.text}")
                if self._may_skip(check):
                    self._to_skip.append(check.id)
                return report
            if choice:
                return self._keep(check, skipped_check(check, choice, outcome), self._person)

    def _keep(self, check: StudyCheck, outcome: CheckOutcome, by: str) -> CheckReport:
        self._show(check, outcome)
        report = report_check(outcome, by)
        append_checked(check, self._context, report)
        return report

    def _run_check(self, check: StudyCheck) -> tuple[CheckOutcome, str]:
        if check.run or check.auto in _SLOW:
            self._terminal.show(f"         {check.id}: {check_text(check)} ...")
        outcome = asyncio.run(run_check(check, self._context))
        if outcome.result != "asked":
            return outcome, ENGINE
        if check.id in self._chosen.confirmed:
            return answer_check(outcome, True, CONFIRMED if check.auto else ""), self._person
        return self._ask(outcome), self._person

    def _ask(self, outcome: CheckOutcome) -> CheckOutcome:
        """Ask for the answer; the end of the input means no."""
        while True:
            try:
                answer = self._terminal.ask(f"?        {outcome.id}: {outcome.question} [y/n, and a word about it]")
            except EOFError:
                return answer_check(outcome, False, "nobody answered")
            word, _, comment = answer.partition(" ")
            if word.lower() in ("y", "yes"):
                return answer_check(outcome, True, comment)
            if word.lower() in ("n", "no"):
                return answer_check(outcome, False, comment)

    def _ask_on(self, check: StudyCheck) -> str | None:
        """Ask what to do with a failed check: empty to repeat it, a reason to skip it, None to leave it."""
        may_skip = self._may_skip(check)
        question = "         a: look again" + (", s REASON: skip it" if may_skip else "") + ", q: leave it for now"
        while True:
            try:
                answer = self._terminal.ask(question)
            except EOFError:
                return None
            word, _, reason = answer.partition(" ")
            match word.lower():
                case "a":
                    return ""
                case "q":
                    return None
                case "s" if may_skip and reason.strip():
                    return reason.strip()

    def _may_skip(self, check: StudyCheck) -> bool:
        return not skip_problem(check, self._context.purpose, "a reason")

    def _miss(self, check: StudyCheck, line: str) -> bool:
        """Note a missing check; return whether it prevents the session."""
        blocks = check.blocks and self._binding
        if blocks:
            self.missing.append(line)
        else:
            self._terminal.show(f"{'warning':8} {line}")
        return blocks

    def _show(self, check: StudyCheck, outcome: CheckOutcome) -> None:
        is_harmless = outcome.result == "failed" and not (check.blocks and self._binding)
        mark = "warning" if is_harmless else _MARKS[outcome.result]
        found = outcome.reason if outcome.result == "skipped" else outcome.found
        self._terminal.show(f"{mark:8} {outcome.id}: {found or outcome.text}")

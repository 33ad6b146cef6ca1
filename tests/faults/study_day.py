"""Days of studies on which everything is killed: engines while they start, run and end, and commands that judge.

    python -m tests.faults.study_day --kills 100

Each engine is a real process (forked from this one) that serves a session of a real study. After every kill: no slot is
held by two, none was passed over, every session is what the plan says (`tests.study.invariants`), no session that had
begun is lost, and every outcome that was acknowledged counts. In between, people withdraw and words are taken out
while exports run (`tests.faults.study_privacy`); then every byte is searched.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from rise_engine.base.errors import StudyError
from rise_engine.base.exit_status import UNFINISHED
from rise_engine.kernel.inputs import Note, OutcomeReport, Submit
from rise_engine.kernel.records import OutcomeStatus
from rise_engine.run.protocol import messages
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.spawn import EngineRefused
from rise_engine.study.judge import judge_session
from rise_engine.study.model import ParticipantStanding
from rise_engine.study.planning import plan_study
from rise_engine.study.standing import BEGINNABLE
from rise_engine.study.state import OpenStudy, StudyStatus, read_state
from rise_engine.study.study_toml import load_study
from tests.faults.soak import Child, Mistake, SoakConnection
from tests.faults.study_privacy import PRIVATE, Leak, Privacy, word
from tests.study.invariants import check_day, first_input
from tests.study.studies import HEAD, MEMORY, PEOPLE, SCENARIO, write_study

OUTCOMES: tuple[OutcomeStatus, ...] = ("complete", "complete", "complete", "aborted", "excluded")


class StudyConnection(SoakConnection):
    """A program that ends sessions."""

    def tell(self, participant: str) -> None:
        """What only this participant says, does and is called."""
        inputs: list[Note | Submit] = [
            Note(text=f"a {word(participant, 'note')} remark"),
            Submit(function="say", behavior=f"Good day, {word(participant, 'said')}"),
            Submit(function="assignValue", behavior=json.dumps({PRIVATE: word(participant, "value")})),
            Submit(function="assignValue", behavior=json.dumps({word(participant, "key"): 1})),
        ]
        for number, each in enumerate(inputs, 10):
            self._put(messages.SendMessage(id=number, message=each))

    def judge(self, status: OutcomeStatus, participant: str = "") -> bool:
        """Whether the outcome was acknowledged."""
        report = OutcomeReport(status=status, reason=f"by {word(participant, 'reason')}")
        self._put(messages.SendMessage(id=1, message=report))
        while 1 not in self.acknowledged:
            if not self.read(5.0):
                return False
        if not self.acknowledged[1]["accepted"]:
            raise Mistake(f"the outcome was refused: {self.acknowledged[1]}")
        return True

    def end(self) -> None:
        self._put(messages.EndMessage(id=2, reason="done"))

    def close(self) -> None:
        self._socket.close()


class StudyDays:
    """One run: as many studies as it takes."""

    def __init__(self, seed: int, scratch: Path, exports: float = 0.35) -> None:
        """:param exports: how often exports, redactions and withdrawals run after a step."""
        self.exports = exports
        self.dice = random.Random(seed)
        self.scratch = scratch
        os.environ["RISE_SESSIONS"] = str(scratch / "sessions")
        os.environ["RISE_RUNTIME"] = str(scratch / "run")
        self.counts: Counter[str] = Counter()
        self.folder = scratch
        self.served: set[str] = set()
        """Folders of sessions in which something has happened."""
        self.judged: dict[str, OutcomeStatus] = {}
        """What was acknowledged of each."""

    def run(self, kills: int) -> None:
        while self.counts["kills"] < kills:
            self.begin_study()
            while self.counts["kills"] < kills and self.step():
                pass

    def begin_study(self) -> None:
        self.counts["studies"] += 1
        self.folder = self.scratch / f"study-{self.counts['studies']}"
        study = write_study(self.folder, people=HEAD + PEOPLE, plan=False)
        (self.folder / "scenario" / "scenario.toml").write_text(SCENARIO + f'private = ["{PRIVATE}"]\n', "utf-8")
        memory = MEMORY.replace('"noise": 1', f'"noise": 1, "{PRIVATE}": "nobody yet"')
        (self.folder / "scenario" / "memory.json").write_text(memory, "utf-8")
        plan_study(study, load_study(self.folder).scenarios)
        self.served.clear()
        self.judged.clear()
        outside = self.scratch / f"outside-{self.counts['studies']}"
        self.privacy = Privacy(self.folder, outside, self.dice, self.counts)

    def step(self) -> bool:
        """Something happens in the study; False when everybody is done."""
        state = read_state(self.folder)
        ready = [
            each
            for each in state.standing.participants
            if (each.state in BEGINNABLE and not each.why) or each.state in ("unfinished", "to-judge")
        ]
        if not ready:
            return False
        busy = [each for each in ready if each.state != "waiting"]
        participant = self.dice.choice(busy or ready[:1]) if self.dice.random() < 0.8 else self.dice.choice(ready)
        if participant.state == "to-judge" or (participant.state == "unfinished" and self.dice.random() < 0.1):
            self.judge_afterwards(participant)
        else:
            self.session(participant)
        self.check()
        if self.exports and self.dice.random() < self.exports:
            self.keep_private()
            self.check()
        return True

    def keep_private(self) -> None:
        """Exports, redactions and withdrawals beside each other."""
        owners: dict[str, list[str]] = {}
        for each in read_state(self.folder).sessions:
            if each.info is not None and each.entry.status != "running":
                owners.setdefault(each.entry.participant, []).append(each.name)
        try:
            self.privacy.go(owners)
        except Leak as leak:
            raise Mistake(f"{self.folder}: {leak}") from leak
        for participant in self.privacy.withdrawn & owners.keys():
            self.served -= {*owners[participant]}
            for name in owners[participant]:
                self.judged.pop(name, None)

    def session(self, participant: ParticipantStanding) -> None:
        dice = self.dice
        how = dice.choice(["recover", "new"]) if participant.state == "unfinished" else "ask"
        options = SessionOptions(
            "", study=str(self.folder), participant=participant.participant, unfinished=how, socket_name="day"
        )
        child = Child(options)
        if dice.random() < 0.35:
            time.sleep(dice.random() * 0.08)
            child.kill()
            self.count_kill("while it starts")
            return
        outcome = child.outcome()
        if isinstance(outcome, EngineRefused):
            child.wait()
            raise Mistake(f"{participant} was refused ({'unfinished' * (outcome.code == UNFINISHED)}): {outcome.lines}")
        name = Path(outcome.folder).name
        self.counts["recovered"] += outcome.recovered
        connection = StudyConnection(self.scratch / "run" / "day.sock")
        connection.tell(participant.participant)
        if dice.random() < 0.3:
            time.sleep(dice.random() * 0.02)
            begun = first_input(Path(outcome.folder)) is not None  # else nothing has gone out yet
            child.kill()
            self.count_kill("while it runs")
            self.served |= {name} if begun else set()
        elif dice.random() < 0.2:
            if child.end() != 0:
                raise Mistake("the engine did not end in order")
            self.counts["ended without outcome"] += 1
            self.served.add(name)
        else:
            self.end_with_outcome(child, connection, name, participant.participant)
        connection.close()

    def end_with_outcome(self, child: Child, connection: StudyConnection, name: str, participant: str) -> None:
        status = self.dice.choice(OUTCOMES)
        if not connection.judge(status, participant):
            raise Mistake("the engine ended by itself")
        self.judged[name] = status
        self.served.add(name)
        self.counts[status] += 1
        connection.end()
        if self.dice.random() < 0.6:
            time.sleep(self.dice.random() * 0.03)
            child.kill()
            self.count_kill("while it ends")
        else:
            child.wait()

    def judge_afterwards(self, participant: ParticipantStanding) -> None:
        """As `rise-engine study outcome` does, in a process that may be killed."""
        pid = os.fork()
        if pid == 0:
            code = 70
            try:
                with OpenStudy(self.folder) as open:
                    judge_session(open, participant.participant, self.dice.choice(OUTCOMES), "said afterwards")
                code = 0
            except StudyError:
                code = 1
            finally:
                os._exit(code)
        if self.dice.random() < 0.5:
            time.sleep(self.dice.random() * 0.03)
            os.kill(pid, 9)
            os.waitpid(pid, 0)
            self.count_kill("while it is judged")
        elif os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) != 0:
            raise Mistake(f"{participant} could not be judged")

    def count_kill(self, when: str) -> None:
        self.counts["kills"] += 1
        self.counts[f"killed {when}"] += 1

    def check(self) -> None:
        try:
            check_day(self.folder)
        except AssertionError as error:
            raise Mistake(f"{self.folder}: {error}") from error
        state = read_state(self.folder)
        self.check_standing(state)
        if self.dice.random() < 0.3:
            with OpenStudy(self.folder) as open:  # what is written down changes nothing
                written = open.state
            before, after = state.standing, written.standing
            if (before.participants, before.cells) != (after.participants, after.cells):
                raise Mistake(f"{self.folder}: what the log did not say was not what was written\n{before}\n{after}")
            check_day(self.folder)

    def check_standing(self, state: StudyStatus) -> None:
        held = [each.slot for each in state.standing.participants if each.slot is not None]
        if len(held) != len(set(held)):
            raise Mistake(f"{self.folder}: a slot is held twice: {held}")
        entries = {each.name: each.entry for each in state.sessions}
        if lost := self.served - entries.keys():
            raise Mistake(f"{self.folder}: sessions are lost: {lost}")
        for name, status in self.judged.items():
            if entries[name].outcome != status:
                raise Mistake(f"{self.folder}: {name} was judged {status} and is {entries[name]}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=1_000)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--exports", type=float, default=0.35, help="how often people withdraw while exports run")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else random.SystemRandom().randrange(10**6)
    print(f"seed {seed}", flush=True)
    scratch = Path(tempfile.mkdtemp(prefix="day-", dir="/tmp"))
    (scratch / "run").mkdir(0o700)
    began = time.monotonic()
    days = StudyDays(seed, scratch, options.exports)
    try:
        days.run(options.kills)
    except Mistake as mistake:
        print(f"MISTAKE (seed {seed}, kept in {scratch}): {mistake}", flush=True)
        return 1
    finally:
        took = time.monotonic() - began
        print(", ".join(f"{name} {number}" for name, number in sorted(days.counts.items())), f"in {took:.0f} s")
    shutil.rmtree(scratch)
    return 0


if __name__ == "__main__":
    sys.exit(main())

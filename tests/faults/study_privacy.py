"""Withdrawals and redactions beside exports that run, on a day of a study, and the search for what they have left.

Whatever a participant is known by is a word of its own: the pseudonym, a note, what was said, a memory value, a memory
key. So whoever searches every byte knows whose it is.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import random
import re
import shutil
import signal
import sys
import time
import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from rise_engine.base.files import tree_hash
from rise_engine.cli import main
from rise_engine.results.export.format import format_names
from rise_engine.study.study_log import LOG_FILE, LockedLog
from rise_engine.study.traces import name_pattern

PRIVATE = "person_name"
"""The memory key that the scenario calls private."""
KINDS = ("note", "said", "value", "key", "reason")
LONGEST = 1.5
"""Seconds after which a command is killed at the latest."""


class Leak(AssertionError):
    """Something of somebody who has withdrawn is left, or something of somebody else is not."""


def word(participant: str, kind: str) -> str:
    """What only this participant has in such a place; letters alone, so that nothing takes it for a number."""
    letters = participant.translate(str.maketrans("0123456789", "abcdefghij")).lower()
    return f"Zq{kind}{letters}qz"


class Command:
    """A command of rise-engine in a process of its own, forked from this one; what it prints goes to a file."""

    def __init__(self, scratch: Path, *arguments: object) -> None:
        self.arguments = tuple(map(str, arguments))
        self._said = scratch / f"said-{time.monotonic_ns()}"
        self.code: int | None = None
        self.pid = os.fork()
        if self.pid == 0:
            code: object = 70
            try:
                descriptor = os.open(self._said, os.O_WRONLY | os.O_CREAT, 0o600)
                os.dup2(descriptor, 1)
                os.dup2(descriptor, 2)
                main([*self.arguments])
                code = 0
            except SystemExit as error:
                code = error.code
            finally:
                with suppress(OSError, ValueError):
                    sys.stdout.flush()
                os._exit(code if isinstance(code, int) else 1)

    def kill(self) -> None:
        os.kill(self.pid, signal.SIGKILL)
        self.wait()

    def wait(self) -> int:
        if self.code is None:
            self.code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return self.code

    @property
    def said(self) -> str:
        return self._said.read_text("utf-8", "replace") if self._said.exists() else ""


def contents_of(path: Path) -> Iterator[tuple[str, bytes]]:
    """Every name and every byte below a path, also of what is packed in zip files."""
    for each in sorted(path.rglob("*")) if path.is_dir() and not path.is_symlink() else [path]:
        name = str(each.relative_to(path.parent))
        data = each.read_bytes() if each.is_file() and not each.is_symlink() else b""
        yield from _unpacked(name, data)


def _unpacked(name: str, data: bytes) -> Iterator[tuple[str, bytes]]:
    """What is packed is looked at as it was before: three letters stand in a megabyte of packed bytes by chance.

    The program in a bundle is nobody's data, and its examples have pseudonyms.
    """
    if not zipfile.is_zipfile(io.BytesIO(data)):
        yield name, data
        return
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        yield name, archive.comment
        for entry in archive.namelist():
            yield from [] if entry.endswith(".whl") else _unpacked(f"{name}:{entry}", archive.read(entry))


def hits(path: Path, words: Sequence[str], participant: str = "") -> list[str]:
    """Where words, or a pseudonym, stand below a path, in names and bytes. A binary file may hold them as UTF-16."""
    patterns = [re.compile(re.escape(each).encode()) for each in words]
    patterns += [re.compile(re.escape(each.encode("utf-16-le"))) for each in words]
    if participant:
        patterns.append(re.compile(name_pattern(participant).pattern.encode()))
    found = []
    for name, data in contents_of(path):
        found += [f"{name}: {each.pattern!r}" for each in patterns if each.search(data) or each.search(name.encode())]
    return found


def hashes(path: Path) -> dict[str, str]:
    """Every file below a path, by its place; links by where they lead to."""
    return {
        str(each): f"-> {each.readlink()}" if each.is_symlink() else hashlib.sha256(each.read_bytes()).hexdigest()
        for each in sorted(path.rglob("*"))
        if each.is_symlink() or each.is_file()
    }


class Privacy:
    """What is exported, redacted and withdrawn in one study, and must be nowhere since."""

    def __init__(self, study: Path, outside: Path, dice: random.Random, counts: Counter[str]) -> None:
        self.study = study
        self.outside = outside
        self.dice = dice
        self.counts = counts
        self.withdrawn: set[str] = set()
        self.redacted: dict[str, str] = {}
        """Words that were taken out of sessions, by the session's name."""
        self._number = 0
        self._listed = ""
        """All that withdrawals and redactions have said is left for people."""
        outside.mkdir()
        (outside / "decoy").mkdir()
        (outside / "decoy" / "mine.csv").write_text("somebody else's")
        (study / "linked").symlink_to(outside / "decoy")

    def go(self, owners: dict[str, list[str]]) -> None:
        """Commands beside each other, some killed; one withdraws or redacts. Then everything is searched.

        :param owners: names of sessions that have begun and do not run, by participant.
        """
        dice = self.dice
        present = sorted(owners.keys() - self.withdrawn)
        if not present:
            return
        participant = dice.choice(present)
        withdraws = dice.random() < 0.5
        session = dice.choice(owners[participant])
        if withdraws and dice.random() < 0.5:
            self._write_hostile(participant, [name for who in present if who != participant for name in owners[who]])
        study = self._copied() if withdraws and dice.random() < 0.2 else self.study
        original = hashes(self.study) if study != self.study else {}
        others = self._of_others(study, participant, owners, session)
        main_command = (
            ("study", "withdraw", study, participant, "--yes")
            if withdraws
            else ("redact", study / "sessions" / session, "--replace", f"{word(participant, 'note')}=NAME1")
        )
        beside = [self._export(study, owners, present) for _ in range(dice.randint(1, 3))]
        self._run_beside([main_command, *beside])
        done = self._until_done(main_command)
        self._check_others(others, done.said)
        if withdraws:
            self._check_withdrawn(study, participant, done)
            if study == self.study:
                self.withdrawn.add(participant)
            self._check_later(study, participant, [word(participant, kind) for kind in KINDS])
        elif done.code in (0, 1) and "error:" not in done.said:
            self._check_redacted(session, word(participant, "note"), done)
            self._check_later(study, "", [word(participant, "note")], study / "sessions" / session)
        if study != self.study:
            if hashes(self.study) != original:
                changed = original.items() ^ hashes(self.study).items()
                raise Leak(f"{self.study} was changed by a withdrawal in its copy: {sorted(changed)}")
            shutil.rmtree(study)

    # --- commands ---

    def _export(self, study: Path, owners: dict[str, list[str]], present: Sequence[str]) -> tuple[object, ...]:
        self._number += 1
        out = self.dice.choice([study, self.outside]) / f"out-{self._number}"
        whose = study / "sessions" / self.dice.choice(owners[self.dice.choice(present)])
        level = ("--level", self.dice.choice(["full", "shared", "public"]))
        match self.dice.randrange(5):
            case 0:
                name = f"{out.name}{self.dice.choice(['', '.zip'])}"
                return ("study", "bundle", study, "-o", out.with_name(name), "--all", *level)
            case 1:
                return ("report", study, "-o", f"{out}.html", "--sheet", f"{out}.md", *level)
            case 2:
                return ("export", whose, "--format", self.dice.choice(format_names()), "-o", out, *level)
            case _:
                return ("export", study, "--all", "--format", self.dice.choice(format_names()), "-o", out, *level)

    def _run_beside(self, commands: list[tuple[object, ...]]) -> None:
        """Start them in any order, kill some of them, and wait for the others."""
        self.dice.shuffle(commands)
        running: list[tuple[float, Command]] = []
        for each in commands:
            running.append((self.dice.random() * LONGEST, Command(self.outside, *each)))
            self.counts[f"commands {each[0] if each[0] != 'study' else each[1]}"] += 1
            time.sleep(self.dice.random() * 0.2)
        began = time.monotonic()
        for after, command in sorted(running, key=lambda each: each[0]):
            if self.dice.random() < 0.5:
                time.sleep(max(0.0, began + after - time.monotonic()))
                command.kill()
                self.counts["commands killed"] += command.code == -signal.SIGKILL
            elif command.wait() not in (0, 1, 2):
                raise Leak(f"{command.arguments} ended with {command.code}: {command.said}")

    def _until_done(self, command: tuple[object, ...]) -> Command:
        """Once more, undisturbed: what it says is what people are told at last. A second time changes nothing more."""
        done = Command(self.outside, *command)
        if done.wait() not in (0, 1):
            raise Leak(f"{done.arguments} ended with {done.code}: {done.said}")
        self._listed += "".join(each.read_text("utf-8", "replace") for each in self.outside.glob("said-*"))
        for each in self.outside.glob("said-*"):
            if each.name != done._said.name:
                each.unlink()
        return done

    def _copied(self) -> Path:
        copy = self.study.with_name(f"{self.study.name}-copy")
        shutil.copytree(self.study, copy, symlinks=True)
        self.counts["copies"] += 1
        return copy

    def _write_hostile(self, participant: str, others: Sequence[str]) -> None:
        """Lines of the log that call something an export which is none, hash included."""
        self.counts["hostile logs"] += 1
        decoy = self.outside / "decoy"
        named = [
            "study.toml",
            "scenario",
            "sessions",
            "linked",
            "linked/mine.csv",
            "/etc",
            "..",
            ".",
            str(decoy),
            "a\0b",
        ]
        named += [f"sessions/{name}" for name in others[:2]] + [f"scenario/../sessions/{name}" for name in others[2:3]]
        with LockedLog(self.study) as log:
            for path in named:
                log.append("exported", path=path, participants=[participant], sessions=[], folder=True)
                place = self.study / path
                if "\0" not in path and path not in ("/etc", "..", ".") and place.exists():
                    log.append("written", path=path, participants=[participant], sha256=tree_hash(place))

    # --- what must be so since ---

    def _of_others(self, study: Path, participant: str, owners: dict[str, list[str]], session: str) -> dict[str, str]:
        """Every file of the study and outside of it that is nobody's who withdraws, and no export; with its hash."""
        own = {str(study / "sessions" / name) for name in (*owners[participant], session)}
        killed = study.glob(f"sessions/*_{participant}_*")  # theirs, although nothing has happened there
        own |= {str(each) for each in killed}
        kept = {**hashes(study), **hashes(self.outside)}
        legitimate: tuple[str, ...] = (
            str(study / LOG_FILE),
            str(study / "out-"),
            str(study / ".out-"),
            str(self.outside / "said-"),
        )
        legitimate += (str(self.outside / "."), str(study / f"{LOG_FILE}."))
        return {
            path: digest
            for path, digest in kept.items()
            if not path.startswith(legitimate) and not any(path.startswith(f"{each}/") for each in own)
        }

    def _check_others(self, before: dict[str, str], said: str) -> None:
        after = {**hashes(self.study), **hashes(self.outside)}
        root = next((str(Path(path).parent) for path in before if path.endswith("/study.toml")), "")
        after |= hashes(Path(root)) if root else {}
        if changed := {path for path, digest in before.items() if after.get(path) != digest}:
            raise Leak(f"what is somebody else's was changed or erased: {sorted(changed)}\n{said}")

    def _check_withdrawn(self, study: Path, participant: str, done: Command) -> None:
        if "has withdrawn:" not in done.said and "error:" in done.said:
            raise Leak(f"{done.arguments} was refused: {done.said}")
        self.counts["withdrawn"] += 1
        words = [word(participant, kind) for kind in KINDS]
        for each in sorted(study.iterdir()):
            found = hits(each, words, participant if each.name != "participants.csv" else "")
            if found and not (each.name.startswith("out-") and f"{each}" in self._listed):
                raise Leak(f"{participant} has withdrawn and is still in {study}: {found[:5]}\n{done.said}")
        named = [each for each in sorted(self.outside.glob("out-*")) if hits(each, words, participant)]
        if unsaid := [str(each) for each in named if str(each) not in self._listed]:
            raise Leak(f"nobody was told that {participant} is in {unsaid}\n{done.said}")
        if done.code == 0 and "participants.csv, line" in done.said:
            raise Leak(f"something is left, and the exit status says done: {done.said}")

    def _check_redacted(self, session: str, gone: str, done: Command) -> None:
        self.counts["redacted"] += 1
        self.redacted[session] = gone
        folder = self.study / "sessions" / session
        if found := hits(folder, [gone]):
            raise Leak(f"{gone} was taken out of {session} and is there: {found}\n{done.said}")
        made = [*self.study.glob("out-*"), *self.outside.glob("out-*")]
        for each in made:
            if hits(each, [gone]) and session in self._sessions_in(each) and each.name not in self._listed:
                raise Leak(f"nobody was told that {gone} is still in {each}\n{done.said}")

    def _sessions_in(self, export: Path) -> set[str]:
        """As the log has it."""
        names: set[str] = set()
        for line in (self.study / LOG_FILE).read_text("utf-8").splitlines():
            entry = json.loads(line)
            if entry["kind"] == "exported" and Path(entry["path"]).name == export.name:
                names.update(entry["sessions"])
        return names

    def _check_later(self, study: Path, participant: str, words: list[str], only: Path | None = None) -> None:
        """Exports that are made now."""
        later = self.outside / "later"
        later.mkdir()
        ways: list[tuple[object, ...]] = [
            ("study", "bundle", study, "-o", later / "bundle.zip", "--level", "full", "--all")
        ]
        ways.append(("report", study, "-o", later / "report.html", "--sheet", later / "sheet.md"))
        for name in self.dice.sample(format_names(), 2):
            ways.append(("export", only or study, *(() if only else ("--all",)), "--format", name, "-o", later / name))
        for each in ways if only is None else ways[2:]:
            command = Command(self.outside, *each)
            if command.wait() not in (0, 1, 2):
                raise Leak(f"{command.arguments} ended with {command.code}: {command.said}")
            self.counts["later exports"] += command.code == 0
        if found := hits(later, words, participant):
            raise Leak(f"{participant or words} is in exports that were made afterwards: {found[:5]}")
        shutil.rmtree(later)
        with LockedLog(study) as log:  # a test's own exports are of no interest to what comes
            log.rewrite([each for each in log.entries() if str(later) not in str(each.get("path"))])

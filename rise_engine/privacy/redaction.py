"""Redaction: removes words from a session's record, and the session still replays.

The words are removed from the inputs. A fresh kernel makes the records again, and each must be the old one without the
words (`rise_engine.privacy.changed_session`). If one differs, nothing is changed. The new journal is written beside the
old one, replayed from the file, and then replaces the old one, of which nothing is kept.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any, get_args

import msgspec
from msgspec import Struct, field

from rise_engine.base.errors import SessionError
from rise_engine.base.files import Disk, error_message, is_locked, lines_with
from rise_engine.base.text import name_some
from rise_engine.base.words import WordError, Words
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import AnyInput, TaskFunction
from rise_engine.privacy.changed_session import ChangedSession, why_not_replayed
from rise_engine.session.coded import CODED_FILE, CODED_FOLDER, redacted_files
from rise_engine.session.folder import INFO, JOURNAL, SCENARIO_COPY, SessionInfo, read_info
from rise_engine.session.journal_format import InputLine, encode_line
from rise_engine.session.journal_reader import JournalContents, read_journal
from rise_engine.session.lock import HOLDER_FILE, JournalLock
from rise_engine.session.replay import Replay, require_inputs
from rise_engine.session.scenario_copies import load_session_scenario
from rise_engine.session.shadow import SHADOW_FOLDER, replace_words, shadow_files
from rise_engine.session.unfinished_files import has_other_names

NEW_SUFFIX = ".redacting"
"""The suffix of new files until they are in place. They contain none of the words."""
_KEPT_BY_RECOVERY = re.compile(r"journal\.(torn-\d+|damaged-\d+\.jsonl)")
_OWN_WORDS: frozenset[str] = frozenset({*get_args(TaskFunction), "None", "Blocking", "Interrupt"})
_FIXED_FIELDS = frozenset({"input", "n", "t", "versions", "study_hash", "purpose", "status", "result", "mark"})
"""Fields of inputs that the program writes, not people."""
_OWN_SOURCES = frozenset({"engine", "file", "study", "condition"})
_STUDY_FIELDS = frozenset({"participant", "condition", "factors", "study"})
"""Fields of inputs and session.toml that identify the session in a study and are not texts."""
_REDACTED_LINE = re.compile(r"^redacted = \[(.*)\]$")
_BY = re.compile(r'(?<=by = )"(?:[^"\\]|\\.)*"')
_INFO_FIELDS = frozenset({"participant", "condition", "wizard", "scenario_folder", "ros_args"})
"""Entries of session.toml with people's texts. Title and robot come from the scenario, which is not changed."""
_INFO_TABLES = frozenset({"[machine]", "[factors]", "[memory]"})


class RedactionReport(Struct):
    """The changes of a redaction, done or planned."""

    lines: int = 0
    """Changed lines of the journal."""
    info_lines: int = 0
    """Changed lines of session.toml."""
    shadow_lines: int = 0
    """Changed lines of second wizards' files (`rise_engine.session.shadow`)."""
    coded_files: int = 0
    """Changed annotation files (`rise_engine.session.coded`)."""
    log_lines: int = 0
    """Changed lines of the study's log (`study.jsonl`)."""
    longer_words: dict[str, int] = field(default_factory=dict)
    """Longer words of the inputs that contain one of the words, with their counts."""
    erased: list[str] = field(default_factory=list)
    """Deleted files beside the journal that contained the words."""
    remains: list[str] = field(default_factory=list)
    """Sentences on where the words still are."""

    @property
    def changed(self) -> bool:
        """Whether anything was or would be changed."""
        return bool(self.lines or self.info_lines or self.shadow_lines or self.coded_files or self.log_lines)


def redact(
    folder: Path,
    words: Words,
    *,
    by: str = "",
    here: bool = False,
    try_only: bool = False,
    disk: Disk | None = None,
    before: Callable[[RedactionReport], None] | None = None,
) -> RedactionReport:
    """Replace words in the record of the session in `folder`: journal, session.toml, shadows and annotations.

    `by`: the person who redacts, for session.toml. `here`: a person has confirmed that the other computer which had the
    session last no longer runs it. `try_only`: nothing is changed. `disk`: for tests. `before`: gets the report before
    anything is changed.

    Raises SessionError if the session runs (JournalLockedError), its journal is torn or damaged, the words had an
    effect (with the place), or the disk fails. The session is unchanged then.
    """
    disk = disk or Disk()
    read_info(folder, compare=False)  # fails if this is not a session
    lock = JournalLock(folder / JOURNAL, here=here)
    try:
        return _Redaction(folder, words, disk, lock).run(by, before or (lambda report: None), try_only=try_only)
    except WordError as error:
        raise SessionError(f"{error}. Nothing was changed") from None
    except OSError as error:
        raise SessionError(
            f"{folder} cannot be redacted: {error_message(error)}. It replays as before; "
            "fix that and repeat the command"
        ) from None
    finally:
        lock.release()


class _Redaction:
    """A redaction of a session whose journal is locked."""

    def __init__(self, folder: Path, words: Words, disk: Disk, lock: JournalLock) -> None:
        self._folder = folder
        self._words = words
        self._disk = disk
        self._lock = lock
        self._path = folder / JOURNAL
        self._new = folder / (JOURNAL + NEW_SUFFIX)
        self._new_info = folder / (INFO + NEW_SUFFIX)
        self._new_beside: dict[Path, Path] = {}
        """New files of second wizards and annotators, each with the file that it replaces."""
        self._report = RedactionReport()
        self._longer: Counter[str] = Counter()
        self._fixed = _FIXED_FIELDS

    def run(self, by: str, before: Callable[[RedactionReport], None], *, try_only: bool) -> RedactionReport:
        for path in self._folder.glob(f"*{NEW_SUFFIX}"):  # from an interrupted redaction
            path.unlink()
        contents = read_journal(self._path)
        self._refuse_damaged(contents)
        info = read_info(self._folder, compare=False)  # an interrupted redaction changed only one of the two
        if info.study:
            self._refuse_pseudonym(info)
            self._fixed = _FIXED_FIELDS | _STUDY_FIELDS
        try:
            self._disk.write_new(self._new, self._new_lines(contents, info))
            self._prove_replay(info)
            self._write_shadows()
            self._write_coded()
            changed = self._write_info(by)
            self._report.longer_words = dict(self._longer.most_common())
            before(self._report)
            if try_only:
                return self._report
            if self._report.lines:
                self._put_in_place(self._new, self._path)
            for new, path in self._new_beside.items():
                self._put_in_place(new, path)
            if changed:
                self._put_in_place(self._new_info, self._folder / INFO)
            self._erase_kept_files()
            self._report.remains += find_words(self._folder, self._words)
            return self._report
        finally:
            for path in (self._new, self._new_info, *self._new_beside):
                path.unlink(missing_ok=True)

    def _refuse_damaged(self, contents: JournalContents) -> None:
        if contents.torn and not contents.ended:
            raise SessionError(
                f"{self._path} is torn at its end: recover the session first (rise-engine serve --session "
                f"{self._folder.name}), and end it; nothing was changed"
            )
        if contents.torn or contents.damaged or contents.gaps or contents.header is None:
            raise SessionError(
                f"{self._path} is damaged, so no replay can prove that it still says what happened without the words. "
                "Nothing was changed; what can be read can be exported, and the folder can be deleted"
            )
        require_inputs(contents)

    def _refuse_pseudonym(self, info: SessionInfo) -> None:
        if self._words.find(info.participant):
            raise SessionError(
                f"the study knows this session by {info.participant!r}, a pseudonym, so that word stays. Nothing was "
                "changed. To erase a participant who withdraws, use `rise-engine study withdraw`"
            )

    # --- the journal ---

    def _new_lines(self, contents: JournalContents, info: SessionInfo) -> Iterator[bytes]:
        """Give the lines of the new journal. Raises SessionError at the first record that differs."""

        def mask(record: dict[str, Any]) -> dict[str, Any]:
            return {name: self._words.mask(each) for name, each in record.items()}

        kernel = Kernel(load_session_scenario(self._folder, info, []), info.seed)
        changed = ChangedSession(self._folder, kernel, contents, self._new_input, self._difference)
        for line, found, new in changed.lines(mask, mask):
            after = encode_line(new)
            if after == encode_line(found):
                after = line + b"\n"  # another version may have written the same record differently
            self._report.lines += after[:-1] != line
            yield after

    def _new_input(self, line: bytes, found: InputLine) -> AnyInput:
        input = found.input
        if not self._words.may_find(line.decode()):
            return input
        body: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(input))
        replaced = {name: self._new_value(name, value) for name, value in body.items()}
        if replaced == body:
            return input
        try:
            return msgspec.convert(replaced, type(input))
        except msgspec.ValidationError as error:
            raise SessionError(f"an input would not be one any more ({error}). Nothing was changed") from None

    def _new_value(self, name: str, value: Any) -> Any:
        if name in self._fixed or (name in ("function", "calling_type") and value in _OWN_WORDS):
            return value
        if name in ("source", "by", "holder") and isinstance(value, str):
            kind, colon, who = value.partition(":")
            if colon or value in _OWN_SOURCES:
                return kind + colon + self._words.replace(who)
        self._longer.update(_longer_words_in(value, self._words))
        return self._words.replace_in(value)

    def _difference(self, line: int, what: str) -> SessionError:
        """Explain why nothing was changed: the words had an effect, or the session does not replay anyway."""
        if why := why_not_replayed(self._folder):
            return SessionError(f"{why}; redact it with the version that wrote it. Nothing was changed")
        sentence = f"{JOURNAL}:{line}: without the words {what}: they decide what happened, so the session would not "
        sentence += "replay. Nothing was changed"
        if longer := sorted(self._longer):
            sentence += (
                f". They are also part of longer words ({', '.join(longer[:8])}): --whole-words leaves those unchanged"
            )
        return SessionError(sentence + ". If the words must not be kept, delete the session's folder")

    def _prove_replay(self, info: SessionInfo) -> None:
        """Raise SessionError unless the new file replays identically."""
        replay = Replay(Kernel(load_session_scenario(self._folder, info, []), info.seed), self._new)
        for _ in replay.steps():
            pass
        contents = replay.contents
        if replay.difference is not None or replay.missing or contents.damaged or contents.torn:
            raise SessionError(f"the new journal does not replay ({replay.difference}). Nothing was changed")

    # --- session.toml ---

    def _write_info(self, by: str) -> bool:
        """Write the new session.toml beside the old one. Returns False if nothing changes in the whole session."""
        table, lines = "", []
        for line in (self._folder / INFO).read_text(encoding="utf-8").split("\n"):
            table = line if line.startswith("[") else table
            key = line.partition(" =")[0]
            theirs = line.startswith("#") or (table in _INFO_TABLES if table else key in _INFO_FIELDS)
            if theirs and (table.strip("[]") or key) in self._fixed:
                theirs = False
            new = self._words.replace(line) if theirs else line
            if _REDACTED_LINE.match(line):
                new = _BY.sub(lambda found: self._words.replace(found[0]), line)
            self._report.info_lines += new != line
            lines.append(new)
        if not self._report.changed:
            return False
        now = datetime.now().astimezone().isoformat(timespec="seconds")
        entry = f'{{at = "{now}", by = {msgspec.json.encode(by).decode()}, lines = {self._report.lines}}}'
        at = next((index for index, line in enumerate(lines) if line.startswith("[")), len(lines))
        for index, line in enumerate(lines[:at]):
            if found := _REDACTED_LINE.match(line):
                lines[index] = f"redacted = [{', '.join(filter(None, (found[1], entry)))}]"
                break
        else:
            while at and not lines[at - 1].strip():
                at -= 1
            lines.insert(at, f"redacted = [{entry}]")
        self._disk.write_new(self._new_info, "\n".join(lines).encode())
        return True

    # --- what second wizards did ---

    def _write_shadows(self) -> None:
        """Write the new files of shadows beside the journal. They had no effect, so they need no proof."""
        for path in shadow_files(self._folder):
            if is_locked(path):
                raise SessionError(f"{path} is being written by a console: leave that first. Nothing was changed")
            old = path.read_bytes().split(b"\n")
            new = [replace_words(line, self._words.replace) for line in old]
            if changed := sum(before != after for before, after in zip(old, new, strict=True)):
                target = self._folder / f"{SHADOW_FOLDER}-{path.name}{NEW_SUFFIX}"
                self._new_beside[target] = path
                self._disk.write_new(target, b"\n".join(new))
                self._report.shadow_lines += changed

    def _write_coded(self) -> None:
        """Write the new annotation files beside the journal."""
        for path, data in redacted_files(self._folder, self._words.replace).items():
            target = self._folder / f"{CODED_FOLDER}-{path.name}{NEW_SUFFIX}"
            self._new_beside[target] = path
            self._disk.write_new(target, data)
            self._report.coded_files += path.name != CODED_FILE

    # --- into place ---

    def _put_in_place(self, new: Path, path: Path) -> None:
        """Move a new file into place atomically."""
        kept = has_other_names(path)
        if path == self._path:
            with self._lock.move_to(new):
                new.replace(path)
        else:
            new.replace(path)
        self._disk.sync_folder(path.parent)
        if kept:
            self._report.remains.append(
                f"{path.name} has another name elsewhere on this disk (a hard link, as backups make them): "
                "the old bytes stay there"
            )

    def _erase_kept_files(self) -> None:
        """Delete parts of old journals that a recovery kept, if they contain the words or end within one."""
        for path in sorted(self._folder.iterdir()):
            if _KEPT_BY_RECOVERY.fullmatch(path.name) and path.is_file() and self._contains_words(path):
                path.unlink()
                self._report.erased.append(path.name)

    # --- what remains ---

    def _contains_words(self, path: Path) -> bool:
        text = path.read_bytes().decode("utf-8", "ignore")
        return self._words.is_cut_off(text) or any(self._words.find(line) for line in text.splitlines())


def find_words(folder: Path, words: Words) -> list[str]:
    """List where the words are in a session's folder, including its name: file, lines, and kind of text."""
    found = []
    if words.find(folder.name):
        found.append(f"the folder's own name ({folder.name}): rename the folder")
    for path in sorted(folder.rglob("*")):
        if not path.is_file() or path.is_symlink() or path.name in (HOLDER_FILE, "clock"):
            continue
        if path.name.endswith(NEW_SUFFIX):
            continue
        places = lines_with(path, words.find)
        name = path.relative_to(folder)
        if not places:
            if words.find(str(name)):
                found.append(f"the name of {name}")
            continue
        found.append(f"{name}, line{'s' if len(places) > 1 else ''} {name_some(places)}{_owner_note(name)}")
    return found


def _owner_note(name: Path) -> str:
    if name.parts[0].partition(".")[0] == SCENARIO_COPY:
        return ": the scenario's own words, which are not changed"
    if name.parts[0] == SHADOW_FOLDER:
        return ": the scenario's own words, or a line that cannot be read"
    if name.parts[0] == CODED_FOLDER:
        return ": a name of the file's own format, or something that cannot be read"
    if name.name in (JOURNAL, INFO):
        return ": what the scenario or this program says itself"
    return ": not a file of the record"


def _longer_words_in(value: Any, words: Words) -> Iterator[str]:
    if isinstance(value, str):
        yield from words.longer_words(value)
    elif isinstance(value, list):
        for each in value:
            yield from _longer_words_in(each, words)
    elif isinstance(value, dict):
        for key, each in value.items():
            yield from words.longer_words(key)
            yield from _longer_words_in(each, words)

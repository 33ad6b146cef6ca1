"""How the sessions of a study count, as its log and its list of participants say it after the sessions."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from msgspec import Struct

from rise_engine.kernel.records import OutcomeStatus
from rise_engine.study.participants import load_participants
from rise_engine.study.standing import places_of
from rise_engine.study.study_log import LOG_FILE, LogEntry, StudyLogError, file_stamp, read_log
from rise_engine.study.study_toml import load_study
from rise_engine.study.traces import PARTICIPANTS_FILE, STUDY_FILE


class Judgement(Struct, frozen=True):
    """How a session counts."""

    status: OutcomeStatus
    reason: str
    """As somebody typed it."""


class Judgements(Struct, frozen=True):
    """Of all sessions of a study."""

    sessions: dict[str, Judgement] = {}
    """By the name of the session's folder: what was said last."""
    excluded: dict[str, str] = {}
    """Participants who do not count, whatever became of their sessions, and why."""

    def of(self, session: str, participant: str) -> Judgement | None:
        """How a session counts; None: nobody has said it here.

        :param session: the folder's name.
        :param participant: whose it is.
        """
        if participant in self.excluded:
            return Judgement("excluded", self.excluded[participant])
        return self.sessions.get(session)


NO_JUDGEMENTS = Judgements()


def read_judgements(study: Path | None) -> Judgements:
    """What the log and the participants.csv of a study say; of a study whose files are not right, what the log says.

    :param study: its folder; None: no study.
    """
    if study is None:
        return NO_JUDGEMENTS
    files = (LOG_FILE, PARTICIPANTS_FILE, STUDY_FILE)
    return _read(study, tuple(file_stamp(study / name) for name in files))


@lru_cache(maxsize=4)
def _read(study: Path, changed: tuple[tuple[int, int], ...]) -> Judgements:
    """Kept for files that were not changed: whoever reads a study's sessions asks for each."""
    try:
        log = read_log(study)
    except StudyLogError:
        log = []
    said = {
        str(each.get("session")): Judgement(each.get("status"), str(each.get("reason") or ""))
        for each in log
        if each.kind == "outcome" and each.get("status") in ("complete", "aborted", "excluded")
    }
    return Judgements(said, _excluded(study, log))


def _excluded(study: Path, log: list[LogEntry]) -> dict[str, str]:
    loaded = load_study(study, check_scenarios=False).study
    participants = load_participants(loaded).participants if loaded is not None else ()
    return dict(places_of(participants, log).excluded)

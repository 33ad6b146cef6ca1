"""Whether a session of a study is recorded: by whom it runs, why, and what its participant has consented to."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.study.model import Participant, Purpose, RecordingSettings, Study

RECORDED: frozenset[Purpose] = frozenset({"counted", "pilot"})
"""Sessions that are recorded unless somebody says otherwise: those in which a person takes part."""


class RecordingDecision(Struct, frozen=True):
    """What records a session."""

    settings: RecordingSettings
    """What runs: `[recording]` of study.toml, or a part of it."""
    remark: str = ""
    """Why less than the whole of it runs, in a sentence for people and for the record; empty: all of it does."""


def decide_recording(
    study: Study, participants: Sequence[Participant], name: str, purpose: Purpose, asked: bool | None = None
) -> RecordingDecision:
    """Decide what records a session, before it begins.

    Markers on LSL hold nothing of a person but what the session does, so that they need no consent; all else does.

    :param study: whose session it is.
    :param participants: those of participants.csv.
    :param name: of the participant; empty: nobody takes part.
    :param purpose: why the session is run.
    :param asked: whether somebody asked for it (`--record`, `--no-record`); None: as usual for the purpose.
    """
    settings = study.recording
    nothing = RecordingSettings(folder=settings.folder, consent=settings.consent)
    if not is_recording(settings):
        return RecordingDecision(nothing)
    if asked is False:
        return RecordingDecision(nothing, "nothing is recorded: somebody said so (--no-record)")
    if asked is None and purpose not in RECORDED:
        how = "a session in debug mode" if purpose == "debug" else f"a {purpose} session"
        return RecordingDecision(nothing, f"nothing is recorded: this is {how} (--record records it)")
    if (problem := recording_consent_problem(study, participants, name)) and (settings.recorders or settings.sync):
        kept = replace(nothing, markers=settings.markers)
        return RecordingDecision(kept, f"nothing is recorded: {problem}")
    return RecordingDecision(settings)


def is_recording(settings: RecordingSettings) -> bool:
    """Whether anything runs with these settings."""
    return bool(settings.recorders) or settings.markers is not None or settings.sync is not None


def recording_consent_problem(study: Study, participants: Sequence[Participant], name: str) -> str:
    """Why a participant may not be recorded, in a sentence; empty: they may, or nobody takes part."""
    if not name:
        return ""
    found = next((each for each in participants if each.participant == name), None)
    if found is None:
        return f"{name} is not in participants.csv, so nothing is known of consent"
    column = study.recording.consent
    if found.consent.get(column):
        return ""
    return f"{name} has not consented to it (consent_{column} of participants.csv has no date)"


def recorders_text(settings: RecordingSettings) -> str:
    """What records, in a few words, for screens: `camera (ffmpeg), bag (rosbag2), markers on LSL`; or empty."""
    words = [each.name if each.name == each.driver else f"{each.name} ({each.driver})" for each in settings.recorders]
    if settings.markers is not None:
        words.append("markers on LSL")
    return ", ".join(words)


def recording_lines(decision: RecordingDecision) -> list[str]:
    """What to say of it before the session begins, a line each; nothing of a study that has nothing recorded."""
    text = recorders_text(decision.settings)
    return [*([f"recorded by {text}"] if text else []), *([decision.remark] if decision.remark else [])]

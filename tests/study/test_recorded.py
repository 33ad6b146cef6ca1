"""Whether a session is recorded: purpose, consent, and what somebody asked for."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.study.model import Purpose, RecordingSettings
from rise_engine.study.participants import load_participants
from rise_engine.study.recording_table import decide_recording, recorders_text, recording_lines
from tests.study.studies import DESIGN, write_study

RECORDING = '[recording]\nobs = {}\ncamera = { by = "ffmpeg", input = ["-i", "x"] }\nlsl = true\nsync = true\n'
PEOPLE = (
    "participant,consent_study,consent_recording,consent_video,status,comment\n"
    "P01,2026-11-01,2026-11-01,,,\nP02,2026-11-01,,2026-11-01,,\n"
)


def test_one_who_has_consented_is_recorded_with_everything(tmp_path: Path) -> None:
    study = write_study(tmp_path, DESIGN + RECORDING, PEOPLE, plan=False)
    listed = load_participants(study).participants
    decision = decide_recording(study, listed, "P01", "counted")
    assert decision.settings == study.recording and not decision.remark
    assert recording_lines(decision) == ["recorded by obs, camera (ffmpeg), markers on LSL"]


def test_without_consent_only_what_the_session_does_is_told_to_others(tmp_path: Path) -> None:
    study = write_study(tmp_path, DESIGN + RECORDING, PEOPLE, plan=False)
    listed = load_participants(study).participants
    for name, why in {
        "P02": "P02 has not consented to it (consent_recording of participants.csv has no date)",
        "P09": "P09 is not in participants.csv, so nothing is known of consent",
    }.items():
        for asked in (None, True):  # nobody can ask for it in their place
            decision = decide_recording(study, listed, name, "counted", asked)
            assert decision.settings == RecordingSettings(markers=study.recording.markers)
            assert decision.remark == f"nothing is recorded: {why}"
    assert decide_recording(study, listed, "", "pilot").settings == study.recording  # nobody takes part


def test_study_toml_says_which_consent_counts(tmp_path: Path) -> None:
    study = write_study(tmp_path, DESIGN + RECORDING + 'consent = "consent_video"\n', PEOPLE, plan=False)
    listed = load_participants(study).participants
    assert study.recording.consent == "video"
    assert decide_recording(study, listed, "P02", "counted").settings == study.recording
    assert "consent_video" in decide_recording(study, listed, "P01", "counted").remark


@pytest.mark.parametrize(
    ("purpose", "asked", "remark"),
    [
        ("counted", None, ""),
        ("pilot", None, ""),
        ("training", None, "nothing is recorded: this is a training session (--record records it)"),
        ("debug", None, "nothing is recorded: this is a session in debug mode (--record records it)"),
        ("debug", True, ""),
        ("counted", False, "nothing is recorded: somebody said so (--no-record)"),
    ],
)
def test_rehearsals_are_recorded_when_somebody_asks(
    tmp_path: Path, purpose: Purpose, asked: bool | None, remark: str
) -> None:
    study = write_study(tmp_path, DESIGN + RECORDING, PEOPLE, plan=False)
    listed = load_participants(study).participants
    decision = decide_recording(study, listed, "P01", purpose, asked)
    assert decision.remark == remark
    assert decision.settings == (RecordingSettings() if remark else study.recording)


def test_a_study_without_recorders_says_nothing(tmp_path: Path) -> None:
    study = write_study(tmp_path, plan=False)
    decision = decide_recording(study, (), "P01", "debug")
    assert recording_lines(decision) == [] and recorders_text(study.recording) == ""


def test_a_study_in_which_nobody_could_be_recorded_is_told_so(tmp_path: Path) -> None:
    people = "participant,consent_study,status,comment\nP01,2026-11-01,,\n"
    study = write_study(tmp_path, DESIGN + RECORDING, people, plan=False)
    (found,) = load_participants(study).diagnostics
    assert str(found) == (
        "participants.csv:1:1: warning no-recording-consent: there is no column `consent_recording`, so no participant "
        "is recorded; did you mean `consent_study`? add it, or name another one in study.toml: "
        '[recording] consent = "study"'
    )
    other = write_study(tmp_path / "other", DESIGN + RECORDING + 'consent = "study"\n', people, plan=False)
    assert load_participants(other).diagnostics == []

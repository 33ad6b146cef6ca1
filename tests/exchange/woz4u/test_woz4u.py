"""A configuration of WoZ4U becomes a study that loads, and says what it did."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from rise_exchange.woz4u.woz4u_file import SpeechReader

from rise_engine.cli.program import main
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Parameter

# Its lists and their fields are WoZ4U's, as its README describes them; the contents are ours.
CONFIG = r"""
pepper_ips: [10.0.0.1]
voice_speed: 80
volume: 0.5
tablet_root_location: static/
animated_speech:
  - title: Hello
    string: "Don&apos;t be shy {really}: ^start(animations/Stand/Gestures/Hey_3) hello!
      ^wait(animations/Stand/Gestures/Hey_3) \\rspd=50\\ Slowly."
    key_comb: ["ctrl", "1"]
  - title: A story
    string: story.txt
  - title: Lost
    string: static/lost.txt
gestures:
  - title: Hello
    gesture: animations/Stand/Gestures/Hey_1
    key_comb: ["shift", "1"]
  - title: "Ça va?"
    gesture: animations/Stand/Emotions/Positive/VeryHappy_4
tablet_items:
  - title: Map
    file_name: map.png
    is_default_img: True
  - title: Web
    file_name: https://example.org/
audio_files:
  - {title: March, location: /home/nao/march.wav, key_comb: [alt, 1]}
colors:
  - {title: Red, red: 1.0, green: 0, blue: 0, key_comb: [c, r], is_default: True}
rasta_anim: {duration: 2.5, key_comb: [ctrl, alt, 1]}
"""


def imported(tmp_path: Path, config: str, *more: str) -> Result:
    (tmp_path / "config.yaml").write_text(config, "utf-8")
    (tmp_path / "story.txt").write_text("Once upon\na time.", "utf-8")
    return CliRunner().invoke(
        main, ["import", "woz4u", str(tmp_path / "config.yaml"), "-o", str(tmp_path / "study"), *more]
    )


def test_every_button_is_an_act_with_a_key(tmp_path: Path) -> None:
    found = imported(tmp_path, CONFIG, "--title", "A fair")
    assert found.exit_code == 0, found.output
    loaded = load(tmp_path / "study")
    assert loaded.diagnostics == [] and loaded.scenario is not None
    scenario = loaded.scenario
    assert scenario.title == "A fair" and scenario.robot.name == "pepper"
    assert {key.label: key.behavior for key in scenario.keys.values()} == {
        "1": "Hello",
        "2": "A_story",
        "3": "Hello_gesture",
        "4": "Ça_va",
        "5": "Map",
        "6": "Web",
        "7": "March",
        "r": "Red",
        "8": "Eyes_rasta",
        "f5": "Beginning",
    }
    calls = {
        name: [
            (a.calls[0].type, {k: v.text for k, v in a.calls[0].parameters.items()}, a.wait_for) for a in act.actions
        ]
        for name, act in scenario.acts.items()
    }
    assert calls["Hello"] == [
        ("Speech", {"message": "Don't be shy {{really}}:", "rate": "0.8", "volume": "0.5"}, ()),
        ("Animation", {"value": "hey"}, ("1",)),
        ("Speech", {"message": "hello!", "rate": "0.8", "volume": "0.5"}, ("1",)),
        ("Speech", {"message": "Slowly.", "rate": "0.4", "volume": "0.5"}, ("2", "3")),
    ]
    assert calls["A_story"][0][1]["message"] == "Once upon a time."
    assert calls["Ça_va"] == [("Animation", {"value": "very_happy"}, ())]
    assert calls["March"] == [("PlaySound", {"file": "/home/nao/march.wav"}, ())]
    assert calls["Eyes_rasta"] == [("EyeMovement", {"value": "rasta", "duration": "2500"}, ())]
    starts = [function.argument for function in scenario.rules["Beginning"].states["Start"].on_entry]  # type: ignore[union-attr]
    assert starts == ["Map", "Red"]


def test_it_says_what_it_did_and_what_it_could_not(tmp_path: Path) -> None:
    output = imported(tmp_path, CONFIG).output
    page = (tmp_path / "study/README.md").read_text("utf-8")
    assert "9 acts, 9 keys" in output and "was ctrl+1" in output and "| `r` | Red | c+r |" in page
    for sentence in (
        "line 13: “Lost” says the text file static/lost.txt, which does not exist",
        "“Web” is a page or a video",
        "files of WoZ4U's own server (static/): map.png",
        "`pepper_ips`",
        "does not list these movements: very_happy",
    ):
        assert sentence in output and sentence in page


@pytest.mark.parametrize(
    ("config", "sentences"),
    [
        (
            "gestures:\n  - title: A\n  - 3\n  - {gesture: x}\n"
            "colors:\n  - {title: R, red: 2, green: 0, blue: 0}\nvolume: loud",
            [
                "config.yaml:2:1: error woz4u: this item of `gestures` has no `gesture`",
                "config.yaml:3:1: error woz4u: an item of `gestures` has a `title`",
                "config.yaml:4:1: error woz4u: this item of `gestures` has no `title`",
                "config.yaml:6:1: error woz4u: `red` is a number from 0 to 1",
                "config.yaml:7:1: error woz4u: `volume` is a number from 0 to 1",
            ],
        ),
        ("gestures: 3", ["config.yaml:1:1: error woz4u: `gestures` is a list of items"]),
    ],
)
def test_everything_that_is_wrong_is_told_with_its_line_and_nothing_is_made(
    tmp_path: Path, config: str, sentences: list[str]
) -> None:
    found = imported(tmp_path, config)
    assert found.exit_code == 1 and not (tmp_path / "study").exists()
    for sentence in sentences:
        assert sentence in found.output


@pytest.mark.parametrize(
    ("config", "sentence"),
    [
        ("a: [1", "this is not YAML"),
        ("title: x\ntitle: y", "this is not YAML"),
        ("other: 1", "is not a configuration of WoZ4U"),
        ("- 1", "is not a configuration of WoZ4U"),
        ("", "is not a configuration of WoZ4U"),
        ("[" * 20_000, "config.yaml:1:21: values are nested more than 20 deep"),
        ("gestures: " + "{a: " * 20_000, "values are nested more than 20 deep"),
        ("- " * 20_000, "config.yaml:1:41: values are nested more than 20 deep"),
        ("gestures:\n  - title: &a [x]\n    gesture: [*a, *a]", "config.yaml:3:15: `*` means a value from elsewhere"),
        ("#" * 300_001, "is longer than 300,000 characters"),
    ],
)
def test_what_is_no_configuration_is_refused(tmp_path: Path, config: str, sentence: str) -> None:
    found = imported(tmp_path, config)
    assert found.exit_code == 2 and sentence in found.output and not (tmp_path / "study").exists()


def test_a_folder_that_is_not_empty_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "study").mkdir()
    (tmp_path / "study/mine").write_text("x")
    found = imported(tmp_path, CONFIG)
    assert found.exit_code == 2 and [each.name for each in (tmp_path / "study").iterdir()] == ["mine"]


def test_a_text_file_outside_of_its_folder_is_not_read(tmp_path: Path) -> None:
    outside = tmp_path / "secret.txt"
    outside.write_text("secret")
    (tmp_path / "inner").mkdir()
    found = imported(
        tmp_path / "inner", "animated_speech:\n  - {title: A, string: ../secret.txt}\n  - {title: B, string: b}"
    )
    assert found.exit_code == 0 and "secret" not in (tmp_path / "inner/study/acts/speech.xml").read_text("utf-8")


NAMES = Parameter("value", "name", names=("hey", "show_sky"))


@pytest.mark.parametrize(
    ("text", "actions", "omitted"),
    [
        ("Hello.", ["Speech Hello. []"], []),
        ("", [], []),
        ("^wait(a)...", [], ["^wait(a)"]),
        (r"A \vct=150\ b ^mode(disabled) c.", ["Speech A b c. []"], [r"\vct=150" + "\\", "^mode(disabled)"]),
        ("A. ^run(x/ShowSky_8) B.", ["Speech A. []", "Animation show_sky [1]", "Speech B. [2]"], []),
        (
            "^start(Hey_1) A. ^start(Hey_2) B.",
            ["Animation hey []", "Speech A. []", "Animation hey [2]", "Speech B. [2]"],
            [],
        ),
        (r"A. \pau=500\ B. \rst\ C.", ["Speech A. []", "Wait 500 [1]", "Speech B. [2]", "Speech C. [3]"], []),
    ],
)
def test_annotated_text_is_actions(text: str, actions: list[str], omitted: list[str]) -> None:
    reader = SpeechReader(NAMES)
    found = [f"{each.type} {next(iter(each.parameters.values()))} {each.wait_for}" for each in reader.read(text)]
    assert (found, reader.omitted, reader.new_animations) == (actions, omitted, [])

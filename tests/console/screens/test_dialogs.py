"""Dialogs: what they show is what happens, and none outlives what it asks about."""

from __future__ import annotations

from pathlib import Path
from time import monotonic

import pytest
from msgspec.structs import replace
from textual import events
from textual.widgets import Button

from rise_engine.kernel.records import SessionRecord
from rise_engine.protocol.client import Client, EngineGone
from rise_engine.protocol.session_options import SessionOptions
from rise_engine.protocol.session_start import first_input
from rise_engine.scenario.model import Condition, Scenario
from rise_tui.config.launch import ScenarioProblems, load_scenario, read_summary
from rise_tui.config.paths import expand_home
from rise_tui.model.key_action import HELD_KEY_SECONDS
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.end_session import EndSessionDialog
from rise_tui.screens.settings import ChoiceField, SettingsScreen
from rise_tui.widgets.memory_editor import TextField
from tests.console.conftest import Console, console
from tests.console.fake import DEMO, FakeClient, FakeLauncher, demo

pytestmark = pytest.mark.slow  # many keys each


async def asking_to_release(it: Console) -> Dialog:
    it.client.stop("latched", ("pepper/speech",))
    await it.until(lambda: "STOPPED" in it.bars.status_line.text)
    await it.press("ctrl+r")
    await it.until(lambda: isinstance(it.app.screen, Dialog))
    dialog = it.app.screen
    assert isinstance(dialog, Dialog)
    return dialog


async def test_a_new_stop_closes_the_question_whether_to_release_the_old_one() -> None:
    async with console() as it:
        await asking_to_release(it)
        await it.press("f9")
        await it.sent("stopAll", "")
        await it.until(lambda: it.app.screen is it.screen)
        assert "was closed" in it.notice
        await it.press("r")
        assert ("releaseStop", "") not in it.client.asked()


async def test_a_key_on_its_way_to_a_closed_question_releases_nothing() -> None:
    async with console() as it:
        dialog = await asking_to_release(it)
        it.screen.stop_all()
        dialog.action_answer("r")
        await it.sent("stopAll", "")
        assert ("releaseStop", "") not in it.client.asked()


async def test_the_question_is_closed_also_below_another_one() -> None:
    async with console() as it:
        await asking_to_release(it)
        await it.press("ctrl+c")
        await it.until(lambda: it.app.screen.has_class("-quit"))
        await it.press("f9")
        await it.sent("stopAll", "")
        assert it.app.screen.has_class("-quit")
        await it.press("escape")
        await it.until(lambda: it.app.screen is it.screen)
        assert ("releaseStop", "") not in it.client.asked()


async def test_the_key_that_asks_also_answers() -> None:
    async with console() as it:
        await asking_to_release(it)
        await it.press("ctrl+r")
        await it.sent("releaseStop", "")
        await it.until(lambda: it.app.screen is it.screen)


async def test_a_key_that_is_held_down_releases_nothing() -> None:
    async with console() as it:
        dialog = await asking_to_release(it)
        at = monotonic()
        for number in range(20):  # as a keyboard repeats it, whatever the clock of this machine says
            event = events.Key("ctrl+r", None)
            event.time = at + 0.4 + number * 0.03
            dialog.on_key(event)
        await it.pilot.pause(2 * HELD_KEY_SECONDS)
        assert it.app.screen is dialog and ("releaseStop", "") not in it.client.asked()
        await it.press("escape")
        await it.until(lambda: it.app.screen is it.screen)


# --- settings -------------------------------------------------------------------------------------------------------


async def settings_of(it: Console) -> SettingsScreen:
    it.screen.action_do("settings")
    await it.until(lambda: isinstance(it.app.screen, SettingsScreen))
    screen = it.app.screen
    assert isinstance(screen, SettingsScreen)
    await it.until(lambda: screen.query("#apply"))
    return screen


def a_scenario(folder: Path, text: str) -> str:
    folder.mkdir()
    (folder / "scenario.toml").write_text(text, encoding="utf-8")
    return str(folder)


async def test_an_empty_folder_field_is_refused_before_anything_is_read() -> None:
    async with console() as it:
        screen = await settings_of(it)
        screen.query_one("#folder", TextField).value = "  "
        screen.query_one("#apply", Button).press()
        await it.until(lambda: "name a folder" in str(screen.findings.content))
        assert it.launcher.prepared_with == []


async def test_a_folder_without_a_scenario_is_refused(tmp_path: Path) -> None:
    client = FakeClient(demo())
    launcher = FakeLauncher(client)
    object.__setattr__(launcher, "load_scenario", load_scenario)
    async with console(client=client, launcher=launcher) as it:
        screen = await settings_of(it)
        screen.query_one("#folder", TextField).value = str(tmp_path)
        screen.query_one("#apply", Button).press()
        await it.until(lambda: f"there is no scenario in {tmp_path}: no scen" in str(screen.findings.content))
        assert client.closed == []


async def test_another_folder_shows_its_own_robot_mode_and_places_and_those_run(tmp_path: Path) -> None:
    other = a_scenario(tmp_path / "other", 'robot = "floka"\nmode = "real"\nacts = "mine"\n')
    async with console() as it:
        screen = await settings_of(it)
        robot, mode = screen.query_one("#robot", ChoiceField), screen.query_one("#mode", ChoiceField)
        assert (robot.value, mode.value) == ("pepper", "debug")
        screen.query_one("#folder", TextField).value = other
        await it.until(lambda: (robot.value, mode.value) == ("floka", "real"))
        assert screen.query_one("#acts", TextField).value == "mine"
        await it.until(lambda: [each.name for each in robot.query(".-chosen").results(Button)] == ["floka"])
        chosen = screen.chosen_options()
        assert (chosen.folder, chosen.robot, chosen.mode, chosen.paths) == (other, "floka", "real", {})
        screen.query_one("#folder", TextField).value = DEMO
        await it.until(lambda: (robot.value, mode.value) == ("pepper", "debug"))


async def test_apply_right_after_a_change_shows_and_takes_the_new_folder(tmp_path: Path) -> None:
    other = a_scenario(tmp_path / "other", 'robot = "floka"\nmode = "real"\n')
    async with console() as it:
        screen = await settings_of(it)
        screen.query_one("#folder", TextField).value = other
        screen.query_one("#apply", Button).press()
        await it.until(lambda: isinstance(it.app.screen, EndSessionDialog) and it.app.screen.query("#word"))
        asked = it.launcher.prepared_with[0]
        assert (asked.folder, asked.robot, asked.mode) == (other, "floka", "real")
        assert screen.query_one("#robot", ChoiceField).value == "floka"


async def test_a_next_session_that_cannot_be_started_is_told_after_leaving() -> None:
    def fail(scenario: Scenario, settings: SessionOptions) -> Client:
        raise EngineGone("the robot cannot be made")

    async with console() as it:
        object.__setattr__(it.launcher, "start", fail)
        screen = await settings_of(it)
        screen.query_one("#apply", Button).press()
        await it.until(lambda: isinstance(it.app.screen, EndSessionDialog) and it.app.screen.query("#word"))
        await it.press("e", "n", "d", "enter")
        await it.until(lambda: it.app.return_code is not None)
        assert it.app.return_code == 1
        assert it.app.exit_message == "the session could not start: the robot cannot be made"


@pytest.mark.slow
async def test_every_group_is_one_stop_and_enter_on_it_changes_nothing() -> None:
    async with console() as it:
        screen = await settings_of(it)
        stops = []
        for _ in range(11):
            await it.press("tab")
            assert it.app.focused is not None
            stops.append(it.app.focused.id or "")
        assert sorted(set(stops)) == sorted(
            ["folder", "acts", "rules", "memory", "robot", "mode", "participant", "condition", "leave", "apply"]
        )
        robot = screen.query_one("#robot", ChoiceField)
        robot.focus()
        await it.press("enter", "space")
        assert robot.value == "pepper" and "Nothing is changed yet" in str(screen.changes.content)
        await it.press("right")
        assert robot.value == "rise" and it.app.focused is robot
        await it.press("right", "right", "right", "left")
        assert robot.value == "rise", "the last one is the last one"
        said = str(screen.changes.content)
        assert "robot: pepper → rise" in said and "Not applied yet" in said and "starts a new one for nobody" in said
        assert it.client.closed == [] and it.launcher.prepared_with == []


@pytest.mark.slow
@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
async def test_a_new_session_does_not_keep_the_label_of_the_one_before(size: tuple[int, int]) -> None:
    client = FakeClient(demo())
    client.emit(SessionRecord(0, 0.0, "", status="started", participant="P07", condition="calm"))
    async with console(client=client, size=size) as it:
        screen = await settings_of(it)
        ends = "ends the session of P07 · calm and starts a new one for nobody named"
        await it.until(lambda: ends in str(screen.changes.content))
        chosen = screen.chosen_options()
        assert (chosen.participant, chosen.condition, chosen.seed) == ("", "", None)
        screen.query_one("#participant", TextField).value = "P08"
        await it.until(lambda: "for P08" in str(screen.changes.content))
        box = screen.query_one("#box").region
        assert screen.query_one("#apply").region.bottom < box.bottom <= size[1]
        screen.query_one("#apply", Button).press()
        await it.until(lambda: isinstance(it.app.screen, EndSessionDialog) and it.app.screen.query("#word"))
        question = it.app.screen
        assert isinstance(question, EndSessionDialog)
        said = "\n".join(question._lines)
        assert "P07 · calm" in said and "Then a new one starts for P08" in said


CONDITIONS = {
    "calm": Condition({"voice": "low", "pause": 2}, label="blue"),
    "loud": Condition({"voice": "high"}),
    "light": Condition(label_only=True),
}


async def test_a_condition_is_chosen_among_those_that_there_are_and_what_it_sets_is_shown() -> None:
    client = FakeClient(replace(demo(), conditions=CONDITIONS))
    async with console(client=client) as it:
        screen = await settings_of(it)
        field = screen.query_one("#condition", ChoiceField)
        assert [str(button.label) for button in field.query(Button)] == ["● none", "○ blue", "○ loud", "○ light"]
        assert "for nobody named; its memory begins with the start values." in str(screen.changes.content)
        field.focus()
        for word, shown in (
            (
                "calm",
                'for blue; its memory begins with the start values, and the condition sets voice = "low", pause = 2.',
            ),
            ("loud", 'for loud; its memory begins with the start values, and the condition sets voice = "high".'),
            (
                "light",
                "for light; its memory begins with the start values, and the condition sets nothing: what it stands",
            ),
        ):
            await it.press("right")
            await it.until(lambda shown=shown: shown in str(screen.changes.content))
            assert screen.chosen_options().condition == word
        await it.press("left", "left", "left")
        assert screen.chosen_options().condition == ""


async def test_a_real_session_needs_a_condition_and_is_refused_without_before_anything_ends() -> None:
    client = FakeClient(replace(demo(), conditions=CONDITIONS))
    async with console(client=client) as it:
        screen = await settings_of(it)
        object.__setattr__(it.launcher, "load_scenario", lambda _: replace(client.scenario, mode="real"))
        screen.query_one("#apply", Button).press()
        await it.until(lambda: "a real session is run in a condition" in str(screen.findings.content))
        assert "`calm`, `loud`, `light`" in str(screen.findings.content) and client.closed == []


async def test_the_memory_follows_the_condition_that_is_chosen_not_the_one_before() -> None:
    """What was said at the start, of the condition before, is not taken along."""
    client = FakeClient(replace(demo(), conditions=CONDITIONS))
    client.emit(SessionRecord(0, 0.0, "", status="started", participant="P07", condition="calm"))
    async with console(client=client) as it:
        screen = await settings_of(it)
        assert screen.chosen_options().condition == ""
        screen.query_one("#condition", ChoiceField).focus()
        await it.press("right", "right")
        chosen = screen.chosen_options()
        assert (chosen.condition, chosen.first_tasks) == ("loud", ())
        assert first_input(client.scenario, chosen).memory == {"voice": "high"}


@pytest.mark.parametrize("size", [(80, 24), (200, 50)])
async def test_many_conditions_with_long_names_are_shown_one_at_a_time(size: tuple[int, int]) -> None:
    names = [f"hesitation with filler and gaze, level {number}" for number in range(1, 7)]
    client = FakeClient(replace(demo(), conditions={name: Condition({"level": name[-1]}) for name in names}))
    async with console(client=client, size=size) as it:
        screen = await settings_of(it)
        field = screen.query_one("#condition", ChoiceField)
        field.focus()
        labels = [str(button.label) for button in field.query(Button)]
        assert labels == ["‹ none ›  1 of 7"]
        await it.press("right", "right")
        assert [str(button.label) for button in field.query(Button)] == [f"‹ {names[1]} ›  3 of 7"]
        assert screen.chosen_options().condition == names[1]
        button = field.query_one(Button)
        assert button.region.right <= screen.query_one("#box").region.right
        for _ in range(5):
            button.press()
            await it.pilot.pause()
        assert screen.chosen_options().condition == "", "after the last one comes the first"


async def test_another_folder_has_its_own_conditions(tmp_path: Path) -> None:
    other = a_scenario(tmp_path / "other", "[conditions.A]\nmemory = { x = 1 }\n[conditions.B]\nlabel_only = true\n")
    async with console() as it:
        screen = await settings_of(it)
        field = screen.query_one("#condition", ChoiceField)
        assert "no [conditions.NAME]" in str(field.query_one(Button).label)
        screen.query_one("#folder", TextField).value = other
        await it.until(lambda: [each.name for each in field.query(Button)] == ["", "A", "B"])
        field.focus()
        await it.press("right")
        await it.until(lambda: "the condition sets x = 1." in str(screen.changes.content))


async def test_a_home_folder_that_nobody_has_can_be_typed() -> None:
    async with console() as it:
        screen = await settings_of(it)
        screen.query_one("#folder", TextField).value = "~nobody-has-this"
        await it.until(lambda: screen._folder_read == "~nobody-has-this")
        assert screen.query_one("#robot", ChoiceField).value == "pepper"
    assert str(expand_home("~nobody-has-this/x")) == "~nobody-has-this/x"


@pytest.mark.parametrize("name", ["scenario.toml", "acts", "rules", "memory.json", "other.toml"])
def test_any_part_makes_a_scenario(name: str, tmp_path: Path) -> None:
    if name in ("acts", "rules"):
        (tmp_path / name).mkdir()
    else:
        (tmp_path / name).write_text("{}" if name == "memory.json" else "", encoding="utf-8")
    folder = tmp_path / name if name == "other.toml" else tmp_path
    assert not isinstance(load_scenario(SessionOptions(str(folder))), ScenarioProblems)


def test_what_cannot_be_read_is_not_shown(tmp_path: Path) -> None:
    assert read_summary("") is None and read_summary(str(tmp_path / "nowhere")) is None
    assert read_summary(a_scenario(tmp_path / "bad", "robot = ")) is None
    found = read_summary(a_scenario(tmp_path / "odd", 'robot = "nobody"\nmode = 5\n'))
    assert found is not None and found.robot == "nobody" and "nobody" in found.robots and found.mode == "debug"


# --- all of them ----------------------------------------------------------------------------------------------------

OPENINGS = {
    "help": "question_mark",
    "palette": "colon",
    "control": "f8",
    "leave": "ctrl+c",
    "jump": "ctrl+d",
}


@pytest.mark.slow
@pytest.mark.parametrize("opening", OPENINGS.values(), ids=OPENINGS)
async def test_esc_leaves_it_does_nothing_and_a_second_one_finds_the_console(opening: str) -> None:
    async with console() as it:
        before = it.app.focused
        await it.press(opening)
        await it.until(lambda: it.app.screen is not it.screen)
        for _ in range(2):  # both are on their way before the first has done anything
            it.app.post_message(events.Key("escape", "\x1b"))
        await it.until(lambda: it.app.screen is it.screen)
        await it.pilot.pause(0.1)
        assert it.app.screen is it.screen and it.app.focused is before
        assert it.client.sent == [] and it.client.verbs == [] and it.client.closed == []


@pytest.mark.parametrize("opening", OPENINGS.values(), ids=OPENINGS)
async def test_stop_works_in_it_and_leaves_it_open_or_closes_it(opening: str) -> None:
    async with console() as it:
        await it.press(opening)
        await it.until(lambda: it.app.screen is not it.screen)
        await it.press("f9")
        await it.sent("stopAll", "")


@pytest.mark.slow
@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
@pytest.mark.parametrize("key", ["ctrl+c", "f8", "ctrl+r"])
async def test_every_word_and_answer_of_a_question_is_on_the_screen(key: str, size: tuple[int, int]) -> None:
    client = FakeClient(demo())
    client.stop("latched", ("pepper/speech", "pepper/gaze"), ("pepper/base",))
    client.control_record("asked", "wizard:ben", "wizard:anna")
    async with console(client=client, size=size) as it:
        await it.press(key)
        await it.until(lambda: isinstance(it.app.screen, Dialog) and it.app.screen.query("#buttons"))
        await it.pilot.pause()
        screen = it.app.screen
        box = screen.query_one("#box").region
        assert (box.height, box.right, box.bottom) <= (size[1], size[0], size[1])
        for shown in screen.query("#lines, Button"):
            where = screen.find_widget(shown)
            assert where.region.area and where.clip.contains_region(where.region), f"{shown} is cut off"


@pytest.mark.slow
@pytest.mark.parametrize("action", ["settings", "theme", "tour"])
async def test_what_the_palette_opens_can_be_left_and_stops_too(action: str) -> None:
    async with console() as it:
        it.screen.action_do(action)
        await it.until(lambda: it.app.screen is not it.screen)
        await it.press("f9")
        await it.sent("stopAll", "")
        await it.press("escape")
        await it.until(lambda: it.app.screen is it.screen)
        assert it.client.asked() == [("stopAll", "")]


async def test_every_answer_can_be_reached_and_given_by_keys() -> None:
    async with console() as it:
        await it.press("ctrl+c")
        await it.until(lambda: isinstance(it.app.screen, Dialog) and it.app.screen.query("#buttons"))
        buttons = list(it.app.screen.query(Button))
        seen = set()
        for _ in buttons:
            await it.press("right")
            seen.add(it.app.focused)
        assert seen == set(buttons)
        assert isinstance(it.app.screen, Dialog)
        while it.app.focused is not it.app.screen.query_one("#no"):
            await it.press("left")
        await it.press("enter")
        await it.until(lambda: it.app.screen is it.screen)
        assert it.client.closed == []

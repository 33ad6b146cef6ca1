"""Dialogs: what they show is what happens, and none outlives what it asks about."""

from __future__ import annotations

from pathlib import Path
from time import monotonic

import pytest
from msgspec.structs import replace
from textual import events
from textual.widgets import Button

from rise_engine.kernel.records import SessionRecord
from rise_engine.run.protocol.client import Client, EngineGone
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.protocol.session_start import first_input
from rise_engine.scenario.model import Condition, Scenario
from rise_tui.config.launch import ScenarioProblems, load_scenario, read_summary
from rise_tui.config.preferences import expand_home
from rise_tui.model.control import HELD_KEY_SECONDS
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.session_forms import EndSessionDialog
from rise_tui.screens.settings import SettingsScreen
from rise_tui.widgets.fields import ChoiceField, TextField
from tests.tui.conftest import Console, console
from tests.tui.fake import DEMO, FakeClient, demo

pytestmark = pytest.mark.slow  # many keys each


async def asking_to_release(it: Console) -> Dialog:
    it.client.stop("latched", ("pepper/speech",))
    await it.until(lambda: it.screen.session.store.view.stop.latched and it.app.screen is it.screen)
    await it.pilot.pause(0.2)
    await it.press("ctrl+r")
    return await it.shows(Dialog)


async def test_the_question_whether_to_release_a_stop_is_answered_on_purpose_and_closed_by_a_new_stop() -> None:
    async with console() as it:

        def released() -> bool:
            return "releaseStop" in [function for function, _ in it.client.asked()]

        dialog = await asking_to_release(it)
        at = monotonic()
        for number in range(20):  # as a keyboard repeats it, whatever the clock of this machine says
            event = events.Key("ctrl+r", None)
            event.time = at + 0.4 + number * 0.03
            dialog.on_key(event)
        await it.pilot.pause(2 * HELD_KEY_SECONDS)
        assert it.app.screen is dialog and not released(), "a key that is held down releases nothing"
        await it.press("f9")
        await it.sent("stopAll", "")
        await it.back()
        assert "was closed" in it.notice
        await it.press("r")
        assert not released()
        dialog = await asking_to_release(it)
        it.screen.stop_all()
        dialog.action_answer("r")
        await it.back()
        assert not released(), "the answer was on its way when the question was closed"
        await asking_to_release(it)
        await it.press("ctrl+c")
        await it.until(lambda: it.app.screen.has_class("-quit"))
        await it.press("f9")
        assert it.app.screen.has_class("-quit")
        await it.press("escape")
        await it.back()
        assert not released() and it.client.asked() == [("stopAll", "")] * 3, "it is closed also below another one"
        await asking_to_release(it)
        await it.press("ctrl+r")  # the key that asks also answers
        await it.until(released)
        await it.back()


# --- settings -------------------------------------------------------------------------------------------------------


async def settings_of(it: Console) -> SettingsScreen:
    it.screen.action_do("settings")
    return await it.shows(SettingsScreen)


async def apply(it: Console, screen: SettingsScreen) -> EndSessionDialog:
    """What is asked before another session starts."""
    screen.query_one("#apply", Button).press()
    question = await it.shows(EndSessionDialog)
    await it.until(lambda: question.query("#word"))
    return question


def a_scenario(folder: Path, text: str) -> str:
    folder.mkdir()
    (folder / "scenario.toml").write_text(text, encoding="utf-8")
    return str(folder)


CONDITIONS = {
    "calm": Condition({"voice": "low", "pause": 2}, label="blue"),
    "loud": Condition({"voice": "high"}),
    "light": Condition(label_only=True),
}


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
        assert robot.value == "pepper" and "No changes yet" in str(screen.changes.content)
        await it.press("right")
        assert robot.value == "rise" and it.app.focused is robot
        await it.press("right", "right", "right", "left")
        assert robot.value == "rise", "the last one is the last one"
        said = str(screen.changes.content)
        assert "robot: pepper → rise" in said and "Not applied yet" in said and "starts a new one for nobody" in said
        assert it.client.closed == [] and it.launcher.prepared_with == []


async def test_a_folder_shows_what_it_says_itself_and_one_that_is_none_is_refused(tmp_path: Path) -> None:
    other = a_scenario(tmp_path / "other", 'robot = "floka"\nmode = "real"\nacts = "mine"\n')
    conditions = a_scenario(
        tmp_path / "conditions", "[conditions.A]\nmemory = { x = 1 }\n[conditions.B]\nlabel_only = true\n"
    )
    async with console() as it:
        screen = await settings_of(it)
        folder, robot, mode, condition = (
            screen.query_one("#folder", TextField),
            screen.query_one("#robot", ChoiceField),
            screen.query_one("#mode", ChoiceField),
            screen.query_one("#condition", ChoiceField),
        )
        assert (robot.value, mode.value) == ("pepper", "debug")
        folder.value = "  "
        screen.query_one("#apply", Button).press()
        await it.until(lambda: "enter a folder" in str(screen.findings.content))
        assert it.launcher.prepared_with == []
        folder.value = "~nobody-has-this"
        await it.until(lambda: screen._folder_read == "~nobody-has-this")
        assert robot.value == "pepper"
        folder.value = other
        await it.until(lambda: (robot.value, mode.value) == ("floka", "real"))
        assert screen.query_one("#acts", TextField).value == "mine"
        await it.until(lambda: [each.name for each in robot.query(".-chosen").results(Button)] == ["floka"])
        chosen = screen.chosen_options()
        assert (chosen.folder, chosen.robot, chosen.mode, chosen.paths) == (other, "floka", "real", {})
        folder.value = DEMO
        await it.until(lambda: (robot.value, mode.value) == ("pepper", "debug"))
        assert "no [conditions.NAME]" in str(condition.query_one(Button).label)
        folder.value = conditions
        await it.until(lambda: [each.name for each in condition.query(Button)] == ["", "A", "B"])
        condition.focus()
        await it.press("right")
        await it.until(lambda: "the condition sets x = 1." in str(screen.changes.content))
        folder.value = other
        await apply(it, screen)  # right after the change
        asked = it.launcher.prepared_with[0]
        assert (asked.folder, asked.robot, asked.mode, robot.value) == (other, "floka", "real", "floka")
        await it.press("escape")
        await it.shows(SettingsScreen)
        object.__setattr__(it.launcher, "load_scenario", load_scenario)
        folder.value = str(tmp_path)
        screen.query_one("#apply", Button).press()
        await it.until(lambda: f"there is no scenario in {tmp_path}: no scen" in str(screen.findings.content))
        assert it.client.closed == []
    assert str(expand_home("~nobody-has-this/x")) == "~nobody-has-this/x"


async def test_a_next_session_that_cannot_be_started_is_told_after_leaving() -> None:
    def fail(scenario: Scenario, settings: SessionOptions) -> Client:
        raise EngineGone("the robot cannot be made")

    async with console() as it:
        object.__setattr__(it.launcher, "start", fail)
        await apply(it, await settings_of(it))
        await it.press("e", "n", "d", "enter")
        await it.until(lambda: it.app.return_code is not None)
        assert it.app.return_code == 1
        assert it.app.exit_message == "the session could not start: the robot cannot be made"


async def test_a_new_session_does_not_keep_the_label_of_the_one_before() -> None:
    client = FakeClient(demo())
    client.emit(SessionRecord(0, 0.0, "", status="started", participant="P07", condition="calm"))
    async with console(client=client, size=(80, 24)) as it:
        screen = await settings_of(it)
        ends = "ends the session of P07 · calm and starts a new one for nobody named"
        await it.until(lambda: ends in str(screen.changes.content))
        chosen = screen.chosen_options()
        assert (chosen.participant, chosen.condition, chosen.seed) == ("", "", None)
        screen.query_one("#participant", TextField).value = "P08"
        await it.until(lambda: "for P08" in str(screen.changes.content))
        for size in ((120, 40), (80, 24)):
            await it.pilot.resize_terminal(*size)
            box = screen.query_one("#box").region
            assert screen.query_one("#apply").region.bottom < box.bottom <= size[1]
        said = "\n".join((await apply(it, screen))._lines)
        assert "P07 · calm" in said and "Then a new one starts for P08" in said


async def test_a_condition_is_chosen_among_those_that_there_are_and_the_memory_follows_it() -> None:
    client = FakeClient(replace(demo(), conditions=CONDITIONS))
    client.emit(SessionRecord(0, 0.0, "", status="started", participant="P07", condition="calm"))
    async with console(client=client) as it:
        screen = await settings_of(it)
        field = screen.query_one("#condition", ChoiceField)
        assert [str(button.label) for button in field.query(Button)] == ["● none", "○ blue", "○ loud", "○ light"]
        assert "for nobody named; its memory begins with the start values." in str(screen.changes.content)
        assert screen.chosen_options().condition == ""
        field.focus()
        sets = "its memory begins with the start values, and the condition sets"
        for word, shown in (
            ("calm", f'for blue; {sets} voice = "low", pause = 2.'),
            ("loud", f'for loud; {sets} voice = "high".'),
            ("light", f"for light; {sets} nothing: "),
        ):
            await it.press("right")
            await it.until(lambda shown=shown: shown in str(screen.changes.content))  # type: ignore[misc]
            chosen = screen.chosen_options()
            assert (chosen.condition, chosen.first_tasks) == (word, ()), "what was said of the one before is gone"
            assert (first_input(client.scenario, chosen).memory or {}) == CONDITIONS[word].memory
        await it.press("left", "left", "left")
        assert screen.chosen_options().condition == ""
        it.launcher.prepared = replace(client.scenario, mode="real")
        screen.query_one("#apply", Button).press()
        await it.until(lambda: "a real session is run in a condition" in str(screen.findings.content))
        assert "`calm`, `loud`, `light`" in str(screen.findings.content) and client.closed == []


async def test_many_conditions_with_long_names_are_shown_one_at_a_time() -> None:
    names = [f"hesitation with filler and gaze, level {number}" for number in range(1, 7)]
    client = FakeClient(replace(demo(), conditions={name: Condition({"level": name[-1]}) for name in names}))
    async with console(client=client, size=(80, 24)) as it:
        for size in ((80, 24), (200, 50)):
            await it.pilot.resize_terminal(*size)
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
            await it.press("escape")
            await it.back()


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


async def test_every_dialog_can_be_left_by_esc_and_stops_too() -> None:
    async with console() as it:
        before, client = it.app.focused, it.client

        async def open_it(opening: str) -> None:
            if opening in ("settings", "theme", "tour"):
                it.screen.action_do(opening)
            else:
                await it.press(opening)
            await it.until(lambda: it.app.screen is not it.screen, opening)
            await it.pilot.pause()

        for opening in ("question_mark", "colon", "f8", "ctrl+c", "ctrl+d", "settings", "theme", "tour"):
            await open_it(opening)
            for _ in range(2):  # both are on their way before the first has done anything
                it.app.post_message(events.Key("escape", "\x1b"))
            await it.back()
            await it.pilot.pause(0.1)
            assert it.app.screen is it.screen and it.app.focused is before, opening
            assert client.sent == [] and client.verbs == [] and client.closed == []
            await open_it(opening)
            await it.press("f9")
            await it.sent("stopAll", "")
            if it.app.screen is not it.screen:
                await it.press("escape")
            await it.back()
            assert client.asked() == [("stopAll", "")], opening
            client.sent.clear()


async def test_every_word_and_answer_of_a_question_is_on_the_screen_and_reached_by_keys() -> None:
    client = FakeClient(demo())
    client.stop("latched", ("pepper/speech", "pepper/gaze"), ("pepper/base",))
    client.control_record("asked", "wizard:ben", "wizard:anna")
    async with console(client=client, size=(80, 24)) as it:
        for size in ((80, 24), (120, 40)):
            await it.pilot.resize_terminal(*size)
            for key in ("f8", "ctrl+r", "ctrl+c"):
                await it.press(key)
                screen = await it.shows(Dialog)
                await it.until(lambda screen=screen: screen.query("#buttons"))  # type: ignore[misc]
                box = screen.query_one("#box").region
                assert (box.height, box.right, box.bottom) <= (size[1], size[0], size[1])
                for shown in screen.query("#lines, Button"):
                    where = screen.find_widget(shown)
                    assert where.region.area and where.clip.contains_region(where.region), f"{shown} is cut off"
                buttons = list(screen.query(Button))
                seen = set()
                for _ in buttons:
                    await it.press("right")
                    seen.add(it.app.focused)
                assert seen == set(buttons)
                while it.app.focused is not screen.query_one("#no"):
                    await it.press("left")
                await it.press("enter")
                await it.back()
        assert client.closed == [] and client.sent == [] and client.verbs == []

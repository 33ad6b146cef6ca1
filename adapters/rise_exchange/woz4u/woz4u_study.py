"""Makes a scenario folder from a configuration of WoZ4U: an act for each button (docs/how-to/move-from-woz4u.md)."""

from __future__ import annotations

import re
import string
from collections.abc import Callable, Iterator
from xml.sax.saxutils import escape, quoteattr

from msgspec import Struct

from rise_engine.base.text import pluralize
from rise_engine.scenario.keys import KeyRefusedError, bindable_key_name
from rise_engine.scenario.model import RobotProfile
from rise_engine.scenario.reading.scenario_toml import MAX_LABEL_LENGTH
from rise_engine.syntax.toml import toml_key
from rise_exchange.woz4u.woz4u_file import MadeAction, SpeechReader, WozFile, WozItem

_FILES = {
    "animated_speech": ("acts/speech.xml", "What the robot says."),
    "gestures": ("acts/gestures.xml", "Movements."),
    "tablet_items": ("acts/tablet.xml", "What is shown on the tablet."),
    "audio_files": ("acts/sounds.xml", "Sounds, which are on the robot."),
    "colors": ("acts/eyes.xml", "Colours and movements of the eyes."),
    "eyes": ("acts/eyes.xml", "Colours and movements of the eyes."),
}
_ENDINGS = {
    "animated_speech": "says",
    "gestures": "gesture",
    "tablet_items": "tablet",
    "audio_files": "sound",
    "colors": "eyes",
    "eyes": "eyes",
}
"""The ending of an act's name if another act already has the name."""
_BEGINNING = "Beginning"
_POOL = string.digits[1:] + "0" + string.ascii_lowercase + string.ascii_uppercase
_CARRIER = (
    'carrier = {{ topic = "pepper/{topic}", type = "std_msgs/msg/String", message = {{ data = "{{@parameters}}" }} }}'
)
_DECLARATIONS = {
    "PlaySound": f"""[actions.PlaySound]
help = "Plays a sound file on the robot."
channels = ["speech"]
seconds = 5
parameters.file = {{ type = "text", required = true, help = "Its path on the robot." }}
{_CARRIER.format(topic="sound")}
""",
    "EyeColor": f"""[actions.EyeColor]
help = "Gives the eyes a colour."
channels = ["eyes"]
seconds = 0.5
parameters.red = {{ type = "number", required = true, minimum = 0, maximum = 1 }}
parameters.green = {{ type = "number", required = true, minimum = 0, maximum = 1 }}
parameters.blue = {{ type = "number", required = true, minimum = 0, maximum = 1 }}
{_CARRIER.format(topic="eyes")}
""",
    "EyeMovement": f"""[actions.EyeMovement]
help = "Lets the lights of the eyes move."
channels = ["eyes"]
parameters.value = {{ type = "name", required = true, names = ["rasta", "random", "rotate"] }}
parameters.duration = {{ type = "number", unit = "ms", minimum = 0 }}
{_CARRIER.format(topic="eyes")}
""",
}
"""Actions that Pepper's profile does not have."""


class ImportedStudy(Struct, frozen=True):
    """An unfinished scenario folder."""

    files: dict[str, str]
    says: tuple[str, ...]
    """The result for each part, for the screen."""
    omitted: tuple[str, ...]
    """Omitted parts, with the reason."""


class _MadeAct(Struct):
    name: str
    item: WozItem
    actions: list[MadeAction]
    key: str = ""


def make_study(title: str, woz: WozFile, robot: RobotProfile, read_text: Callable[[str], str | None]) -> ImportedStudy:
    """Make a scenario with an act for each item of a configuration.

    :param robot: the profile of its robot, Pepper.
    :param read_text: returns the content of a text file that an item speaks, by its name; None: it does not exist.
    """
    return _StudyMaker(title, woz, robot, read_text).make()


class _StudyMaker:
    def __init__(self, title: str, woz: WozFile, robot: RobotProfile, read_text: Callable[[str], str | None]) -> None:
        self.title = title
        self.woz = woz
        self.robot = robot
        self.read_text = read_text
        self.acts: list[_MadeAct] = []
        self.omitted: list[str] = []
        animation = robot.actions["Animation"].parameters["value"] if "Animation" in robot.actions else None
        self.animations: list[str] = []
        self.animation = animation
        self.local_files: list[str] = []
        """Files that WoZ4U's own server shows on the tablet."""

    def make(self) -> ImportedStudy:
        for item in self.woz.items:
            actions = self._actions(item)
            if actions:
                self.acts.append(_MadeAct(self._name(item), item, actions))
        self._give_keys()
        files: dict[str, str] = {"scenario.toml": self._settings(), "memory.json": '{"WorkingMemory": []}\n'}
        for file, comment in dict(_FILES.values()).items():
            of_file = [act for act in self.acts if _FILES[act.item.section][0] == file]
            if of_file:
                files[file] = "\n".join(
                    [f"<!-- {comment} -->", "<Dialogs>", "", *map(_act_text, of_file), "</Dialogs>", ""]
                )
        if defaults := [act.name for act in self.acts if act.item.is_default]:
            files["rules/beginning.xml"] = _beginning_text(defaults)
        if self.local_files:
            names = ", ".join(self.local_files)
            self.omitted.append(
                f"files of WoZ4U's own server ({self.woz.tablet_folder}): {names}; put them where the tablet can reach "
                "them, and write their addresses into acts/tablet.xml"
            )
        if self.woz.omitted:
            self.omitted.append(
                f"settings of the robot or of WoZ4U itself: {', '.join(f'`{key}`' for key in self.woz.omitted)}"
            )
        if self.animations:
            self.omitted.append(
                f"to be tried, because Pepper's profile does not list these movements: {', '.join(self.animations)}; "
                "scenario.toml names them under [actions.Animation], as NAOqi may have them"
            )
        files["README.md"] = self._page()
        counted = (f"{pluralize(len(self.acts), 'act')}, {pluralize(sum(bool(act.key) for act in self.acts), 'key')}",)
        return ImportedStudy(files, (*counted, *self._key_lines()), tuple(self.omitted))

    # --- acts -------------------------------------------------------------------------------------------------------

    def _actions(self, item: WozItem) -> list[MadeAction]:
        values = item.values
        match item.section:
            case "animated_speech":
                return self._speech(item, str(values["string"]))
            case "gestures":
                reader = SpeechReader(self.animation)
                name = reader.animation(str(values["gesture"]))
                self._note_animations(reader)
                return [MadeAction("Animation", {"value": name}, [], str(values["gesture"]))]
            case "tablet_items":
                return [MadeAction("ShowOnTablet", {"image": self._tablet_address(item)}, [])]
            case "audio_files":
                return [MadeAction("PlaySound", {"file": str(values["location"]).strip()}, [])]
            case "colors":
                return [MadeAction("EyeColor", {key: f"{values[key]:g}" for key in ("red", "green", "blue")}, [])]
        milliseconds = f"{float(values['duration']) * 1000:g}"
        return [MadeAction("EyeMovement", {"value": values["movement"], "duration": milliseconds}, [])]

    def _speech(self, item: WozItem, text: str) -> list[MadeAction]:
        if text.strip().lower().endswith(".txt"):
            found = self.read_text(text.strip())
            if found is None:
                self.omitted.append(
                    f"line {item.line}: “{item.title}” says the text file {text.strip()}, which does not exist"
                )
                return []
            text = found
        reader = SpeechReader(self.animation, self.woz.rate, self.woz.volume)
        actions = reader.read(text)
        if not actions:
            self.omitted.append(f"line {item.line}: “{item.title}” says and does nothing")
        self._note_animations(reader)
        if reader.omitted:
            marks = ", ".join(f"`{mark}`" for mark in dict.fromkeys(reader.omitted))
            self.omitted.append(f"line {item.line}: in “{item.title}”, acts have nothing for {marks}")
        return actions

    def _note_animations(self, reader: SpeechReader) -> None:
        self.animations += [name for name in reader.new_animations if name not in self.animations]

    def _tablet_address(self, item: WozItem) -> str:
        name = str(item.values["file_name"]).strip()
        if "://" in name:
            if not re.search(r"\.(?:png|jpe?g|gif|bmp|svg|webp)\Z", name, re.IGNORECASE):
                self.omitted.append(
                    f"line {item.line}: “{item.title}” is a page or a video; ShowOnTablet is for pictures, so try it"
                )
            return name
        self.local_files.append(name)
        return name

    def _name(self, item: WozItem) -> str:
        """Return a unique name for an act."""
        plain = "_".join(re.findall(r"\w+", item.title)) or _ENDINGS[item.section]
        taken = {act.name for act in self.acts} | {_BEGINNING}
        names: Iterator[str] = (
            name for name in (plain, f"{plain}_{_ENDINGS[item.section]}", *(f"{plain}_{n}" for n in range(2, 10_000)))
        )
        return next(name for name in names if name not in taken)

    # --- keys -------------------------------------------------------------------------------------------------------

    def _give_keys(self) -> None:
        """Give each act a key: the last of its keys in WoZ4U if that is free, otherwise the next free one."""
        free = [key for key in _POOL if _is_bindable(key)]
        for act in self.acts:
            wanted = act.item.keys[-1] if act.item.keys else ""
            if len(wanted) == 1 and wanted in free:
                act.key = wanted
                free.remove(wanted)
        for act in self.acts:
            if not act.key and free:
                act.key = free.pop(0)
        if without := [act.item.title for act in self.acts if not act.key]:
            self.omitted.append(f"without a key, because there are no more: {', '.join(without)}")

    def _key_lines(self) -> Iterator[str]:
        for act in self.acts:
            before = "+".join(act.item.keys)
            yield f"  {act.key or '-':<3} {act.name:<28} {f'was {before}' if before else ''}".rstrip()

    # --- files ------------------------------------------------------------------------------------------------------

    def _settings(self) -> str:
        lines = [f"title = {_toml_text(self.title)}", 'robot = "pepper"', 'mode  = "debug"', "", "[keys]"]
        for act in self.acts:
            if act.key:
                label = " ".join(act.item.title.split())[:MAX_LABEL_LENGTH].strip()
                lines.append(f"{toml_key(act.key)} = {{ act = {_toml_text(act.name)}, label = {_toml_text(label)} }}")
        if any(act.item.is_default for act in self.acts):
            lines.append(f'f5 = {{ rule = "{_BEGINNING}", label = "beginning" }}')
        if self.animations:
            names = ", ".join(_toml_text(name) for name in self.animations)
            lines += [
                "",
                "# Not in Pepper's profile; NAOqi may have them as tags.",
                "[actions.Animation]",
                f"names = [{names}]",
            ]
        used = {action.type for act in self.acts for action in act.actions}
        if used & _DECLARATIONS.keys():
            lines += [
                "",
                "# What Pepper's profile does not have. A program on the robot's side has to take these topics.",
            ]
        lines += [line for name, text in _DECLARATIONS.items() if name in used for line in (text,)]
        return "\n".join(lines).rstrip("\n") + "\n"

    def _page(self) -> str:
        rows = [
            f"| {f'`{act.key}`' if act.key else ''} | {act.name} | {'+'.join(act.item.keys)} |" for act in self.acts
        ]
        left = "\n".join(f"- {sentence}" for sentence in self.omitted) or "- nothing"
        table = "\n".join(["| key | act | before |", "|---|---|---|", *rows])
        head = f"# {self.title}\n\nMade from a configuration of WoZ4U.\n"
        return f"{head}\n{table}\n\nNot imported, or to be checked:\n\n{left}\n"


def _act_text(act: _MadeAct) -> str:
    lines = [f"<Dialog name={quoteattr(act.name)}>"]
    for number, action in enumerate(act.actions, start=1):
        lines.append(f"  <{action.type}>" + (f" <!-- {_comment(action.comment)} -->" if action.comment else ""))
        lines.append(f"    <actionID>{number}</actionID>")
        if action.wait_for:
            lines.append(f"    <waitForActions>{', '.join(map(str, action.wait_for))}</waitForActions>")
        lines += [f"    <{name}>{escape(value)}</{name}>" for name, value in action.parameters.items()]
        lines.append(f"  </{action.type}>")
    return "\n".join([*lines, "</Dialog>", ""])


def _beginning_text(acts: list[str]) -> str:
    calls = "".join(f"      <function startCommunicationRobotAct={quoteattr(name)}/>\n" for name in acts)
    return f"""<!-- What WoZ4U does when it connects to the robot. -->
<InteractionRule name="{_BEGINNING}" initial="Start">
  <State id="Start">
    <onEntry>
{calls}    </onEntry>
  </State>
</InteractionRule>
"""


def _comment(text: str) -> str:
    return re.sub(r"-{2,}", "-", text).rstrip("-")


def _toml_text(text: str) -> str:
    printable = "".join(character if character.isprintable() else " " for character in text)
    return '"' + printable.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _is_bindable(key: str) -> bool:
    try:
        bindable_key_name(key)
    except KeyRefusedError:
        return False
    return True

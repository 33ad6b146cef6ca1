"""Converts behaviours of BML to actions, by the table of names, and reports what is lost."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.model import ActionCall
from rise_engine.scenario.parameters import is_bare_key
from rise_engine.scenario.speech.ssml import write_element
from rise_engine.scenario.speech.template import Template, TemplateError, key_template, parse_template
from rise_exchange.bml.block_file import BmlElement
from rise_exchange.bml.core_behavior import MODES, length_of, milliseconds, read_seconds
from rise_exchange.bml.names import FORM, NAME, NO_ACTION, TIME, BmlNames, ConversionFindings, LexemeKind
from rise_exchange.bml.timing import BlockTimes, PlannedBehavior
from rise_exchange.bml.vocabulary import BEHAVIORS, DESCRIPTION_TYPE, DRAFT_NAMESPACES, MARKS, PROSODY, SSML_TYPE

_NO_COUNTERPART = {
    "amount": "how strongly it is done is the robot's choice",
    "overshoot": "how strongly it is done is the robot's choice",
    "influence": "with what it turns is the robot's choice",
    "offsetAngle": "it looks at the target itself",
    "offsetDirection": "it looks at the target itself",
    "mode": "which hand it takes is the robot's choice",
}
"""Attributes without a counterpart in acts, with the consequence."""
_NO_ACTION = {
    "faceFacs": "no action moves single muscles of a face; use a lexeme",
    "locomotion": "no action moves the robot from its place",
}


class CallReader:
    """Reads what behaviours do. Errors in them, and actions that acts do not have, become diagnostics."""

    def __init__(self, names: BmlNames, times: BlockTimes, findings: ConversionFindings) -> None:
        self._names = names
        self._times = times
        self._findings = findings

    def read(self, behavior: PlannedBehavior) -> ActionCall | None:
        """The action that BML's core describes; None, after a diagnostic: there is none."""
        element = behavior.element
        self._refuse_inner_points(element)
        self._report_foreign(element)
        match element.tag:
            case "speech":
                return self._speech(behavior)
            case "gaze" | "gazeShift" | "headDirectionShift" | "pointing":
                return self._at_target(behavior)
            case "wait":
                return self._wait(behavior)
            case "head" | "gesture":
                return self._by_lexeme(behavior, element.tag, element)
            case "faceLexeme":
                return self._by_lexeme(behavior, "face", element)
            case "face" | "faceShift" | "posture" | "postureShift":
                return self._by_part(behavior)
        why = _NO_ACTION.get(element.tag, "no action does that")
        self._findings.diagnostics.error(NO_ACTION, element.location, f"`<{element.tag}>`: {why}")
        return None

    def read_own(self, element: BmlElement) -> tuple[ActionCall, ...]:
        """The calls of an action in our namespace: one, or several in `<Variants>`; none after a diagnostic."""
        if element.tag == "Variants":
            return tuple(call for child in element for call in self.read_own(child))
        spec = self._names.robot.actions.get(element.tag)
        if spec is None or not spec.supported:
            robot = self._names.robot
            usable = [each.name for each in robot.actions.values() if each.supported]
            message = f"the robot {robot.title} (`{robot.name}`) has no action `{element.tag}`"
            self._error(NO_ACTION, element, message + did_you_mean(element.tag, usable))
            return ()
        parameters: dict[str, Template] = {}
        for child in element:
            if child.tag not in spec.parameters:
                self._error(
                    FORM, child, f"`{spec.name}` has no `{child.tag}`{did_you_mean(child.tag, spec.parameters)}"
                )
                continue
            try:
                text = _one_line(child.text)
                is_key = is_bare_key(spec.parameters[child.tag], text)
                parameters[child.tag] = key_template(text) if is_key else parse_template(text)
            except TemplateError as error:
                self._error(FORM, child, str(error))
        return (ActionCall(spec.name, parameters),)

    # --- actions ----------------------------------------------------------------------------------------------------

    def _speech(self, behavior: PlannedBehavior) -> ActionCall | None:
        element = behavior.element
        self._refuse_end(behavior, "an act says a sentence in the time that it takes")
        texts = [child for child in element if child.is_bml and child.tag == "text"]
        holders = texts or ([element] if element.namespace in DRAFT_NAMESPACES else [])
        for child in element:
            if child not in texts and child.is_bml and child.tag not in ("description", *MARKS, *PROSODY):
                near = did_you_mean(child.tag, ("text", "description"))
                self._error(FORM, child, f"`<{child.tag}>` is not allowed in `<speech>`{near}")
        words = _one_line(" ".join("".join(self._words(each)) for each in holders))
        if any(len(each) for each in holders):  # a mark may leave two blanks
            words = " ".join(words.split())
        marked = next((each for each in self._descriptions(element) if each.get("type") == SSML_TYPE), None)
        if marked is not None and len(marked) == 1 and marked[0].tag == "speak":
            words = _one_line(write_element(marked[0].written))
        if not words:
            self._error(FORM, element, "nothing is said here: `<speech>` needs its words in `<text>`")
            return None
        parameters = {"message": _literal(words)}
        if (language := element.get("language")) is not None:
            self._report_loss(element, "language", f"`{language}` is of a draft of BML, and no language by BCP 47")
        return ActionCall("Speech", parameters)

    def _words(self, holder: BmlElement) -> Iterator[str]:
        """The words of a text, without marks and prosody."""
        yield holder.text
        for child in holder:
            if child.is_bml and child.tag in MARKS:
                message = f"the mark `{child.get('id') or ''}` in the words: an act knows no point within a sentence"
                self._findings.lose(child.location, message)
            elif child.is_bml and child.tag in PROSODY:
                self._findings.lose(
                    child.location, f"`<{child.tag}>`: how a sentence is stressed is the robot's choice"
                )
            elif not child.is_bml:
                self._findings.lose(
                    child.location, f"`<{child.written.tag}>` in the words: its meaning is unknown here"
                )
            yield child.tail

    def _at_target(self, behavior: PlannedBehavior) -> ActionCall | None:
        element = behavior.element
        type = "PointAt" if element.tag == "pointing" else "LookAt"
        parameters: dict[str, Template] = {}
        if element.tag in ("gaze", "pointing"):
            self._refuse_end(behavior, "it would have to be held until then; an act's action ends with the movement")
            after = (
                "the eyes stay where they are"
                if type == "LookAt"
                else "when the hand is taken back is the robot's choice"
            )
            self._findings.lose(element.location, f"`<{element.tag}>` goes back after it; here {after}")
        elif element.tag == "headDirectionShift":
            self._findings.lose(element.location, "only the head should turn; here the eyes look, too")
        mode = element.get("mode")
        hand = next((hand for hand, each in MODES.items() if each == mode), None)
        if hand is not None:
            parameters["hand"] = _literal(hand)
        self._report_no_counterpart(element, () if hand is not None else ("mode",))
        if not self._has_action(element, type) or not self._add_duration(behavior, parameters):
            return None
        target = element.get("target")
        if target is None:
            return None  # BML requires it, so it was reported
        point = self._names.targets.get(target)
        if point is None:
            self._findings.diagnostics.error(NAME, element.value_location("target"), self._names.unknown_target(target))
            return None
        coordinates = {
            f"point{axis}": _literal(each) for axis, each in zip("xyz", (point.x, point.y, point.z), strict=True)
        }
        if point.frame:
            coordinates["frame"] = _literal(point.frame)
        return ActionCall(type, coordinates | parameters)

    def _wait(self, behavior: PlannedBehavior) -> ActionCall | None:
        element = behavior.element
        if "max-wait" in element.attributes:
            message = "`max-wait` cannot be kept: an act waits a fixed number of seconds"
            self._findings.diagnostics.error(TIME, element.attribute_location("max-wait"), message)
            return None
        written = element.get("duration")
        length = self._times.duration(behavior) if behavior.end is not None else None
        if written is not None:
            seconds = read_seconds(written)
            if seconds is None:
                message = f"`{written}` is not a number of seconds"
                self._findings.diagnostics.error(FORM, element.value_location("duration"), message)
            elif length is not None and length != seconds:
                message = f"by `duration` it waits {seconds} s, by `end` {length} s"
                self._findings.diagnostics.error(TIME, behavior.end_location, message)
            else:
                return ActionCall("Wait", {"duration": _literal(milliseconds(seconds))})
            return None
        if length is None:
            if behavior.end is None:
                self._error(FORM, element, "`<wait>` needs its `duration`, in seconds")
            return None
        return ActionCall("Wait", {"duration": _literal(milliseconds(length))})

    def _by_part(self, behavior: PlannedBehavior) -> ActionCall | None:
        """A face or a posture, whose lexeme is in a child element."""
        element = behavior.element
        kind: LexemeKind = "face" if element.tag.startswith("face") else "posture"
        wanted = "lexeme" if kind == "face" else "pose"
        parts = [child for child in element if child.is_bml and child.tag == wanted]
        if kind == "face" and element.get("lexeme") is not None:
            parts.insert(0, element)
        for child in element:
            if child.is_bml and child.tag == "stance" and parts:
                self._findings.lose(child.location, "`<stance>`: an act has the movement alone")
            elif child.is_bml and child.tag == "stance":
                return self._by_lexeme(behavior, kind, child, "type")
        if len(parts) != 1:
            number = "several" if parts else "no"
            self._error(NO_ACTION, element, f"`<{element.tag}>` with {number} `<{wanted}>`: an action is one of them")
            return None
        self._report_no_counterpart(element, ("amount",))
        return self._by_lexeme(behavior, kind, parts[0])

    def _by_lexeme(
        self, behavior: PlannedBehavior, kind: LexemeKind, holder: BmlElement, attribute: str = "lexeme"
    ) -> ActionCall | None:
        """The action of a lexeme."""
        lexeme = holder.get(attribute)
        if lexeme is None:
            return None  # BML requires it, so it was reported
        self._report_no_counterpart(holder, ())
        found = self._names.find_lexeme(kind, lexeme)
        if found is None:
            location = holder.value_location(attribute)
            self._findings.diagnostics.error(NAME, location, self._names.unknown_lexeme(kind, lexeme))
        type = found[0] if found is not None else "Emotion" if kind == "face" else "Animation"
        parameters: dict[str, Template] = {}
        repetition = behavior.element.get("repetition")
        if repetition is not None and type == "Animation":
            parameters["repetitions"] = _literal(repetition)
        elif repetition is not None:
            self._report_loss(behavior.element, "repetition", "it is shown once")
        if not self._add_duration(behavior, parameters, repetition or "1") or found is None:
            return None
        return ActionCall(type, {"value": _literal(found[1])} | parameters)

    # --- times ------------------------------------------------------------------------------------------------------

    def _add_duration(self, behavior: PlannedBehavior, parameters: dict[str, Template], repetitions: str = "1") -> bool:
        """Add an action's length to its parameters. False, after a diagnostic: it cannot be kept."""
        if behavior.end is None or behavior.element.tag in ("gaze", "pointing"):
            return True
        length: Decimal | None = self._times.duration(behavior)
        if length is None:
            return False
        each = length_of(length, repetitions)
        if each is None:
            message = f"{length} s cannot be shared out among `repetition` {repetitions}"
            self._findings.diagnostics.error(TIME, behavior.end_location, message)
            return False
        parameters["duration"] = _literal(milliseconds(each))
        return True

    def _refuse_end(self, behavior: PlannedBehavior, why: str) -> None:
        if behavior.end is not None:
            message = f"`end` cannot be kept for `<{behavior.element.tag}>`: {why}"
            self._findings.diagnostics.error(TIME, behavior.end_location, message)

    def _refuse_inner_points(self, element: BmlElement) -> None:
        for point in BEHAVIORS[element.tag].points:
            if point in element.attributes:
                message = f"`{point}` cannot be kept: an act's action has a start and an end, and no point between them"
                self._findings.diagnostics.error(TIME, element.attribute_location(point), message)

    # --- losses -----------------------------------------------------------------------------------------------------

    def _descriptions(self, element: BmlElement) -> Iterator[BmlElement]:
        return (child for child in element if child.is_bml and child.tag == "description")

    def _report_foreign(self, element: BmlElement) -> None:
        """Report the parts of a behaviour that are not BML's core."""
        for child in element:
            known = (DESCRIPTION_TYPE, SSML_TYPE) if element.tag == "speech" else (DESCRIPTION_TYPE,)
            if child.is_bml and child.tag == "description" and child.get("type") not in known:
                message = f"a description of the type `{child.get('type') or ''}`: it is for another program"
                self._findings.lose(child.location, message)
            elif not child.is_bml and not child.is_own and element.tag != "speech":
                self._findings.lose(child.location, f"`<{child.written.tag}>`: its meaning is unknown here")

    def _report_no_counterpart(self, element: BmlElement, more: tuple[str, ...]) -> None:
        """Report attributes without a counterpart in acts."""
        for name, becomes in _NO_COUNTERPART.items():
            if name in element.attributes and (name != "mode" or element.tag == "gesture" or name in more):
                self._report_loss(element, name, becomes)

    def _report_loss(self, element: BmlElement, attribute: str, becomes: str) -> None:
        self._findings.lose(element.attribute_location(attribute), f"`{attribute}` of `<{element.tag}>`: {becomes}")

    def _has_action(self, element: BmlElement, type: str) -> bool:
        robot = self._names.robot
        spec = robot.actions.get(type)
        if spec is not None and spec.supported:
            return True
        self._error(NO_ACTION, element, f"the robot {robot.title} (`{robot.name}`) has no `{type}`")
        return False

    def _error(self, code: str, element: BmlElement, message: str) -> None:
        self._findings.diagnostics.error(code, element.location, message)


def _literal(text: str) -> Template:
    """A text without memory values."""
    return parse_template(text.replace("{", "{{").replace("}", "}}"))


def _one_line(text: str) -> str:
    text = text.strip()
    return " ".join(text.split()) if "\n" in text else text

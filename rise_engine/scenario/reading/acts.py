"""Reads CommunicationRobotActs (paper, section 4.2.1; semantics.md 2; docs/reference/cra.md)."""

from __future__ import annotations

import re
from collections.abc import Collection
from functools import lru_cache, partial

from rise_engine.base.nearest_name import Correction, suggest
from rise_engine.base.text import BLANKS, character_name, find_unseen, pluralize
from rise_engine.scenario.diagnostics import Diagnostics, unknown_code
from rise_engine.scenario.draft import BareKey, Mention, PartMention, ScenarioDraft
from rise_engine.scenario.files.xml import XmlFile
from rise_engine.scenario.grammar import COMMON
from rise_engine.scenario.model import Act, Action, ActionCall, ActionSpec, Parameter, RobotProfile
from rise_engine.scenario.parameters import (
    LANGUAGE,
    MESSAGE,
    ParameterError,
    check_template,
    convert_parameter,
    says_message,
)
from rise_engine.scenario.reading.element_reader import ElementReader
from rise_engine.scenario.reading.graph import find_cycles
from rise_engine.scenario.reading.ssml_checks import find_ssml_problems, languages_in
from rise_engine.scenario.speech.ssml import begins_as_ssml, write_element
from rise_engine.scenario.speech.template import Template, TemplateError, key_template, parse_template
from rise_engine.syntax.xml import Element
from rise_engine.syntax.xml_writing import ACT_WRAPPERS

_SLOT = re.compile(r"\{\{|\{\s*+(?:\"[^\"]*+\"\s*+)?([^\W\d][\w.]*+)(?!\s*\[)")
_LONGEST_PIECE = 12
"""Number of characters that are searched for to find a place again."""
_ID = re.compile(r"[^,;\s]+")
_KEY = re.compile(r"[^\W\d][\w.]*\Z")


def read_acts(file: XmlFile, robot: RobotProfile, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Read every act of a file into `draft`."""
    _ActReader(file, robot, draft, diagnostics).read_acts()


def report_unsent_ssml(robot: RobotProfile, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Warn once about messages with pauses and emphasis that this robot cannot render."""
    if draft.unsent_ssml:
        others = len(draft.unsent_ssml) - 1
        more = f" (here, and in {pluralize(others, 'further message')})" if others else ""
        message = (
            f"the robot {robot.title} (`{robot.name}`) does not take SSML: it gets only the words{more}; if yours "
            "does, write `ssml = true` under [actions.Speech]"
        )
        diagnostics.warning("no-ssml", draft.unsent_ssml[0], message)


class _ActReader(ElementReader):
    def __init__(self, file: XmlFile, robot: RobotProfile, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
        super().__init__(file, draft, diagnostics)
        self.robot = robot
        self.usable = (*(spec.name for spec in robot.actions.values() if spec.supported), "Variants")
        """The elements that an act may contain."""
        self.waits: dict[str, Element] = {}
        """The `<waitForActions>` elements of the current act, by actionID."""

    def read_acts(self) -> None:
        self.read_parts("Dialog", ACT_WRAPPERS, self.draft.act_definitions, self.read_act)

    def read_act(self, element: Element) -> Act | None:
        self.waits.clear()
        self.check_attributes(element)
        self.check_no_text(element)
        name = (self.read_meant(element, "name") or "").strip()
        if not name:
            self.report_missing(["name"], element, 'an act needs a name: <Dialog name="...">')
            self.draft.unreadable_parts.add("acts")
        actions: dict[str, Action] = {}
        channels: set[str] = set()
        for child in element:
            action = self.read_action(child)
            if action is None:
                continue
            if action.id in actions:
                line = actions[action.id].location.line
                self.report_error("duplicate-id", child, f"the actionID `{action.id}` is taken already, in line {line}")
                continue
            actions[action.id] = action
            for call in action.calls:
                channels.update(self.robot.actions[call.type].channels)
        if len(element) == 0 and self.file.is_complete(element):
            self.report_warning("empty-act", element, f"the act `{name}` has no actions")
        if self.file.is_complete(element):
            self.check_waits(actions)
        if not name:
            return None
        return Act(name, tuple(actions.values()), frozenset(channels), self.file.element_location(element))

    def check_waits(self, actions: dict[str, Action]) -> None:
        """Report actions that wait for an unknown action or, in a cycle, for themselves."""
        for action in actions.values():
            for wanted in action.wait_for:
                if wanted not in actions:
                    message, near = f"there is no action `{wanted}` in this act", suggest(wanted, actions)
                    self.report_wait(unknown_code("unknown-id", wanted, actions), action.id, wanted, message, near)
        waits = {action.id: [id for id in action.wait_for if id in actions] for action in actions.values()}
        for cycle in find_cycles(waits):
            shown = cycle if len(cycle) <= 20 else [*cycle[:10], "...", *cycle[-10:]]
            message = f"these actions wait for each other: {' -> '.join((*shown, cycle[0]))}"
            self.report_wait("cycle", cycle[0], "", message)

    def report_wait(self, code: str, action: str, id: str, message: str, suggestion: Correction | None = None) -> None:
        """Report an error at an actionID in `<waitForActions>`; at the first one if `id` is not there."""
        element = self.waits[action]
        offsets = _id_offsets(element.text)
        index = offsets[id] if id in offsets else min(offsets.values(), default=0)
        self.diagnostics.error(code, self.file.text_location(element, index), message, suggestion)

    def read_action(self, element: Element) -> Action | None:
        if element.tag == "Variants":
            return self.read_variants(element)
        spec = self.find_spec(element)
        common = {child.tag: child for child in element if child.tag in COMMON}
        if spec is None:  # other actions may still wait for it
            return self.make_action(element, common, ()) if "actionID" in common else None
        self.check_attributes(element, ())
        call = self.read_call(element, spec, COMMON)
        return self.make_action(element, common, (call,))

    def read_variants(self, element: Element) -> Action | None:
        self.check_attributes(element, ())
        self.check_no_text(element)
        common: dict[str, Element] = {}
        calls: list[ActionCall] = []
        first: str | None = None
        for child in element:
            if child.tag in COMMON:
                if child.tag in common:
                    self.report_error("duplicate-parameter", child, f"`{child.tag}` is given twice here")
                common.setdefault(child.tag, child)
                continue
            if child.tag == "Variants":
                message = "`<Variants>` is not allowed inside `<Variants>`; write all its actions in one"
                self.report_error("variants", child, message)
                continue
            spec = self.find_spec(child)
            if spec is None:
                continue
            self.check_attributes(child, ())
            if first is None:
                first = spec.name
            elif spec.name != first:
                message = f"variants are of one type: the first is `{first}`, this is `{spec.name}`"
                self.report_error("variants", child, message)
                continue
            calls.append(self.read_call(child, spec, ()))
        if not calls:
            if first is None and all(child.tag in COMMON for child in element):
                self.report_error("variants", element, "`<Variants>` holds actions and picks one of them; it has none")
            return self.make_action(element, common, ()) if "actionID" in common else None
        if len(calls) == 1:
            self.report_warning("variants", element, "there is only one variant to pick")
        return self.make_action(element, common, tuple(calls))

    def find_spec(self, element: Element) -> ActionSpec | None:
        """The declaration of an action element; None, after a diagnostic, if this robot lacks it."""
        name = element.tag
        spec = self.robot.actions.get(name)
        if spec is None:
            self.report_error("unknown-action", element, f"there is no action `{name}`", suggest(name, self.usable))
            return None
        if not spec.supported:
            self.report_error(
                "robot-cannot", element, f"the robot {self.robot.title} (`{self.robot.name}`) has no `{name}`"
            )
            return None
        return spec

    def make_action(self, element: Element, common: dict[str, Element], calls: tuple[ActionCall, ...]) -> Action | None:
        """Build an action of these calls from the COMMON elements; None, after a diagnostic, without a valid id."""
        name = self.read_plain_text(common.get("actionID"))
        if not name:
            message = f"`<{element.tag}>` needs an <actionID> of its own, such as <actionID>1</actionID>"
            self.report_error("missing-id", common.get("actionID", element), message)
            return None
        if not _ID.fullmatch(name):
            self.report_error("bad-name", common["actionID"], f"an actionID is one word or number, not `{name}`")
            return None
        wait = common.get("waitForActions")
        wait_for = tuple(dict.fromkeys(_ID.findall(self.read_plain_text(wait))))
        if wait is not None:
            self.waits.setdefault(name, wait)
        failure = common.get("onFailure")
        proceed = self.read_plain_text(failure)
        if failure is not None and proceed != "continue":
            self.diagnostics.error(
                "wrong-value",
                self.file.text_location(failure),
                f"onFailure can only be `continue`, not `{proceed}`; without it, a failure ends the act",
            )
        elif failure is not None and failure.text.strip(BLANKS) != proceed:
            at = find_unseen(failure.text)
            message = f"the character {character_name(failure.text[at])} is not allowed beside `continue`; delete it"
            self.diagnostics.error("wrong-value", self.file.text_location(failure, at), message)
        return Action(name, calls, wait_for, proceed == "continue", self.file.element_location(element))

    def read_plain_text(self, element: Element | None) -> str:
        """The text of a child that contains only text."""
        if element is None:
            return ""
        self.check_attributes(element, ())
        for child in element:
            ssml = "; SSML is one <speak>...</speak> and nothing else" if element.tag == MESSAGE else ""
            self.report_error("unknown-element", child, f"`<{element.tag}>` holds only text{ssml}")
        return element.text.strip()

    def read_call(self, element: Element, spec: ActionSpec, besides: tuple[str, ...]) -> ActionCall:
        self.check_no_text(element)
        parameters: dict[str, Template] = {}
        seen: dict[str, Element] = {}
        for child in element:
            name = child.tag
            if name in seen:
                self.report_error("duplicate-parameter", child, f"`{name}` is given twice here")
                continue
            seen[name] = child
            parameter = spec.parameters.get(name)
            if parameter is not None:
                template = self.read_template(child, parameter)
                if template is not None:
                    parameters[name] = template
                    if name == LANGUAGE and says_message(spec):
                        self.note_language(template.constant)
                    elif name == MESSAGE and parameter.type == "text":
                        self.check_ssml(child, spec, template)
            elif name not in besides:
                self.report_unknown_parameter(child, spec, besides)
        for parameter in spec.parameters.values():
            if parameter.required and parameter.name not in seen:
                message = f"`<{spec.name}>` needs `<{parameter.name}>`{_explain(parameter)}"
                self.report_error("missing-parameter", element, message)
        return ActionCall(spec.name, parameters)

    def note_language(self, language: str | None) -> None:
        """Note the language of an action; None: the memory determines it."""
        if language is None:
            self.draft.has_languages_from_memory = True
        else:
            self.draft.spoken_languages.add(language.strip())

    def check_ssml(self, element: Element, spec: ActionSpec, template: Template) -> None:
        """Report errors in a message that is meant as SSML."""
        for problem in find_ssml_problems(template):
            if len(element):
                index = problem.index_in(self.file.written(element[0]))
                location = self.file.written_location(element[0], index)
            else:
                location = self.file.text_location(element, problem.index_in(element.text))
            if problem.is_error:
                self.diagnostics.error("ssml", location, problem.text)
            else:
                self.diagnostics.warning("ssml", location, problem.text)
        if not begins_as_ssml(template.text):
            return
        for language in languages_in(template):
            self.note_language(language)
        sent = self.robot.actions[spec.substitute] if spec.substitute is not None else spec
        if not sent.ssml:
            self.draft.unsent_ssml.append(self.file.element_location(element))

    def report_unknown_parameter(self, element: Element, spec: ActionSpec, besides: tuple[str, ...]) -> None:
        name = element.tag
        if name in COMMON:
            self.report_error(
                "unknown-parameter", element, f"`{name}` belongs in `<Variants>`, not in its single actions"
            )
        elif name in self.robot.actions or name == "Variants":
            self.report_error(
                "unknown-parameter", element, f"an action is not allowed inside `<{spec.name}>`; close that first"
            )
        else:
            known = (*spec.parameters, *besides)
            self.report_error("unknown-parameter", element, f"`<{spec.name}>` has no `{name}`", suggest(name, known))

    def read_message(self, element: Element) -> str:
        """The message: a text, or one `<speak>` element as text."""
        if len(element) != 1 or element[0].tag != "speak":
            return self.read_plain_text(element)
        self.check_attributes(element, ())
        self.check_no_text(element)
        return write_element(element[0])

    def read_template(self, element: Element, parameter: Parameter) -> Template | None:
        is_message = parameter.name == MESSAGE and parameter.type == "text"
        text = self.read_message(element) if is_message else self.read_plain_text(element)
        if "\n" in text:
            text = " ".join(text.split())
        if not text:
            if len(element) == 0 and (parameter.required or parameter.type != "text"):
                self.report_error("missing-parameter", element, f"`{parameter.name}` is empty{_explain(parameter)}")
            return parse_template("")
        try:
            template = parse_template(text)
        except TemplateError as error:
            location = self.file.text_location(element, _raw_index(element.text, error.column - 1))
            if len(element):
                piece = text[error.column - 1 : error.column + _LONGEST_PIECE].split()[0]
                index = max(self.file.written(element[0]).find(piece), 0)
                location = self.file.written_location(element[0], index)
            self.diagnostics.error("template", location, str(error), error.suggestion)
            return None
        constant = template.constant
        if constant is None:
            self.note_slots(element, template)
            try:
                check_template(parameter, template)
            except ParameterError as error:
                self.report_parameter(element, parameter, error)
            return template
        if parameter.type == "text":
            return template
        try:
            convert_parameter(parameter, constant)
        except ParameterError as error:
            if parameter.type != "name" and _KEY.match(constant):
                locate = partial(self.file.text_location, element, _raw_index(element.text, 0))
                self.draft.bare_keys.append(BareKey(constant, locate, str(error)))
                return key_template(constant)
            self.report_parameter(element, parameter, error)
            return None
        return template

    def note_slots(self, element: Element, template: Template) -> None:
        """Note the memory keys that a parameter reads."""
        written, place = element.text, partial(self.file.text_location, element)
        if len(element):
            written, place = self.file.written(element[0]), partial(self.file.written_location, element[0])
        index = {found.group(1): found.start() for found in reversed(list(_SLOT.finditer(written)))}
        draft = self.draft
        behind = 0
        for slot in template.slots:
            start = index.get(slot.key, 0)
            if slot.part is not None:
                start = max(written.rfind("{", behind, written.find(slot.key, behind)), 0)
                behind = start + 1
            locate = partial(place, start)
            draft.spoken_keys.append(Mention(slot.key, locate))
            if slot.part is not None:
                root = slot.part.root
                if slot.fallback is None:
                    draft.key_reads += [Mention(key, locate) for key in slot.part.keys]
                    draft.part_reads += [PartMention(part, locate, spoken=part is root) for part in slot.part.parts]
                else:
                    draft.optional_key_reads += [Mention(key, locate) for key in slot.part.keys]
            elif slot.fallback is None or slot.before or slot.after:
                reads = draft.key_reads if slot.fallback is None else draft.optional_key_reads
                reads.append(Mention(slot.key, locate))

    def report_parameter(self, element: Element, parameter: Parameter, error: ParameterError) -> None:
        """Report an error at the beginning of a parameter's text."""
        location = self.file.text_location(element, _raw_index(element.text, 0))
        code = "unknown-name" if parameter.type == "name" else error.code
        self.diagnostics.error(code, location, str(error), error.suggestion)

    def report_unknown_attribute(self, element: Element, name: str, known: Collection[str]) -> None:
        spec = self.robot.actions.get(element.tag)
        if spec is None or (name not in spec.parameters and name not in COMMON):
            super().report_unknown_attribute(element, name, known)
            return
        written = f"<{name}>{element.get(name)}</{name}>"
        message = f"parameters are elements, not attributes; write {written} inside `<{spec.name}>`"
        self.report_attribute("unknown-attribute", element, name, message)


@lru_cache(maxsize=1)
def _id_offsets(text: str) -> dict[str, int]:
    """The offset of the first occurrence of each actionID in the text of a `<waitForActions>`."""
    return {found.group(): found.start() for found in reversed(list(_ID.finditer(text)))}


def _explain(parameter: Parameter) -> str:
    return f" ({parameter.help.rstrip('.')})" if parameter.help else ""


def _raw_index(raw: str, index: int) -> int:
    """The offset in `raw` of a character of the stripped, single-spaced text."""
    at = len(raw) - len(raw.lstrip())
    if "\n" not in raw.strip():
        return at + index
    while index > 0 and at < len(raw):
        if raw[at].isspace():
            while at + 1 < len(raw) and raw[at + 1].isspace():
                at += 1
        at += 1
        index -= 1
    while at < len(raw) and raw[at].isspace():
        at += 1
    return at

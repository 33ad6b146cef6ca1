"""Reading CommunicationRobotActs (paper, section 4.2.1; semantics.md 2; docs/reference/cra.md)."""

from __future__ import annotations

import re

from rise_engine.nearest_name import did_you_mean
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import BareKey, Mention, ScenarioDraft
from rise_engine.scenario.graph import find_cycles
from rise_engine.scenario.model import Act, Action, ActionCall, ActionSpec, Parameter, RobotProfile
from rise_engine.scenario.parameters import OutOfRangeError, ParameterError, check_template, convert_parameter
from rise_engine.scenario.template import Template, TemplateError, key_template, parse_template
from rise_engine.scenario.xml import Element, LazyLocation, XmlFile
from rise_engine.scenario.xml_checks import check_no_text, top_elements
from rise_engine.text import BLANKS, character_name, find_unseen

WRAPPERS = ("Dialogs", "AgentDialogs", "CommunicationRobotActs")
COMMON = ("actionID", "waitForActions", "onFailure")
_SEPARATORS = re.compile(r"[,;\s]+")
_SLOT = re.compile(r"\{\{|\{\s*+(?:\"[^\"]*+\"\s*+)?([^\W\d][\w.]*)")
_WAITED = re.compile(r"[^,;\s]+")
_KEY = re.compile(r"[^\W\d][\w.]*\Z")


def read_acts(file: XmlFile, robot: RobotProfile, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Read every act of a file into `draft`."""
    usable = (*(spec.name for spec in robot.actions.values() if spec.supported), "Variants")
    for element in top_elements(file, "Dialog", WRAPPERS, diagnostics):
        reader = _ActReader(file, robot, usable, draft, diagnostics)
        act = reader.act(element)
        if act is None:
            continue
        if act.name in draft.acts:
            first = draft.acts[act.name].location
            diagnostics.error(
                "duplicate-name",
                file.value_location(element, "name"),
                f"there is another act `{act.name}` in {first.file}, line {first.line}",
            )
        else:
            draft.acts[act.name] = act


class _ActReader:
    def __init__(
        self,
        file: XmlFile,
        robot: RobotProfile,
        usable: tuple[str, ...],
        draft: ScenarioDraft,
        diagnostics: Diagnostics,
    ) -> None:
        self.file = file
        self.robot = robot
        self.usable = usable
        """What can stand in an act."""
        self.draft = draft
        self.diagnostics = diagnostics
        self.waits: dict[str, Element] = {}
        self._indexed: tuple[Element, dict[str, int]] | None = None

    def error(self, code: str, element: Element, message: str) -> None:
        self.diagnostics.error(code, self.file.element_location(element), message)

    def act(self, element: Element) -> Act | None:
        self.attributes(element, ("name",))
        check_no_text(self.file, element, self.diagnostics)
        name = (element.get("name") or "").strip()
        if not name:
            self.error("missing-attribute", element, 'an act needs a name: <Dialog name="...">')
        actions: dict[str, Action] = {}
        channels: set[str] = set()
        for child in element:
            action = self.action(child)
            if action is None:
                continue
            if action.id in actions:
                first = actions[action.id].location
                self.error("duplicate-id", child, f"the actionID `{action.id}` is taken already, in line {first.line}")
                continue
            actions[action.id] = action
            for call in action.calls:
                channels.update(self.robot.actions[call.type].channels)
        if len(element) == 0:
            self.diagnostics.warning(
                "empty-act", self.file.element_location(element), f"the act `{name}` has no actions"
            )
        self.check_graph(actions)
        if not name:
            return None
        return Act(name, tuple(actions.values()), frozenset(channels), self.file.element_location(element))

    def check_graph(self, actions: dict[str, Action]) -> None:
        for action in actions.values():
            for wanted in action.wait_for:
                if wanted not in actions:
                    self.diagnostics.error(
                        "unknown-id",
                        self.file.text_location(self.waits[action.id], self._index(action.id, wanted)),
                        f"there is no action `{wanted}` in this act{did_you_mean(wanted, actions)}",
                    )
        for cycle in find_cycles(
            {action.id: [w for w in action.wait_for if w in actions] for action in actions.values()}
        ):
            shown = cycle if len(cycle) <= 20 else [*cycle[:10], "...", *cycle[-10:]]
            self.diagnostics.error(
                "cycle",
                self.file.text_location(self.waits[cycle[0]], self._index(cycle[0], "")),
                f"these actions wait for each other: {' -> '.join((*shown, cycle[0]))}",
            )

    def _index(self, action: str, word: str) -> int:
        """Where a word stands in the text of an action's waitForActions; without a word, where the first one does."""
        element = self.waits[action]
        if self._indexed is None or self._indexed[0] is not element:
            words: dict[str, int] = {}
            for found in _WAITED.finditer(element.text):
                words.setdefault(found.group(), found.start())
            self._indexed = element, words
        words = self._indexed[1]
        return words.get(word, next(iter(words.values()), 0))

    def action(self, element: Element) -> Action | None:
        if element.tag == "Variants":
            return self.variants(element)
        spec = self.spec(element)
        common = {child.tag: child for child in element if child.tag in COMMON}
        if spec is None:  # others may wait for it all the same
            return self.node(element, common, ()) if "actionID" in common else None
        self.attributes(element, ())
        call = self.call(element, spec, COMMON)
        return self.node(element, common, (call,))

    def variants(self, element: Element) -> Action | None:
        self.attributes(element, ())
        check_no_text(self.file, element, self.diagnostics)
        common: dict[object, Element] = {}
        calls: list[ActionCall] = []
        first: str | None = None
        for child in element:
            if child.tag in COMMON:
                if child.tag in common:
                    self.error("duplicate-parameter", child, f"`{child.tag}` stands here twice")
                common.setdefault(child.tag, child)
                continue
            if child.tag == "Variants":
                message = "`<Variants>` cannot stand inside `<Variants>`; write all its actions in one"
                self.error("variants", child, message)
                continue
            spec = self.spec(child)
            if spec is None:
                continue
            self.attributes(child, ())
            if first is None:
                first = spec.name
            elif spec.name != first:
                self.error(
                    "variants", child, f"variants are of one type: the first is `{first}`, this is `{spec.name}`"
                )
                continue
            calls.append(self.call(child, spec, ()))
        if not calls:
            if first is None and all(child.tag in COMMON for child in element):
                self.error("variants", element, "`<Variants>` holds the actions of which one is picked; it has none")
            return self.node(element, common, ()) if "actionID" in common else None
        if len(calls) == 1:
            self.diagnostics.warning(
                "variants", self.file.element_location(element), "there is only one variant to pick"
            )
        return self.node(element, common, tuple(calls))

    def spec(self, element: Element) -> ActionSpec | None:
        """The declaration of an action element; None, after a finding, when this robot has none."""
        name = element.tag
        spec = self.robot.actions.get(name)
        if spec is None:
            self.error("unknown-action", element, f"there is no action `{name}`{did_you_mean(name, self.usable)}")
            return None
        if not spec.supported:
            self.error("robot-cannot", element, f"the robot {self.robot.title} (`{self.robot.name}`) has no `{name}`")
            return None
        return spec

    def node(
        self, element: Element, common: dict[object, Element] | dict[str, Element], calls: tuple[ActionCall, ...]
    ) -> Action | None:
        get = dict(common).get
        name = self.plain(get("actionID"))
        if not name:
            where = get("actionID")
            self.error(
                "missing-id",
                element if where is None else where,
                f"`<{element.tag}>` needs an <actionID> of its own, such as <actionID>1</actionID>",
            )
            return None
        if _SEPARATORS.search(name):
            self.error("bad-name", get("actionID", element), f"an actionID is one word or number, not `{name}`")
            return None
        wait = get("waitForActions")
        wait_for: tuple[str, ...] = ()
        if wait is not None:
            wait_for = tuple(dict.fromkeys(word for word in _SEPARATORS.split(self.plain(wait)) if word))
            self.waits.setdefault(name, wait)
        failure = get("onFailure")
        proceed = self.plain(failure)
        if failure is not None and proceed != "continue":
            self.diagnostics.error(
                "wrong-value",
                self.file.text_location(failure),
                f"onFailure can only be `continue`, not `{proceed}`; without it, a failure ends the act",
            )
        elif failure is not None and failure.text.strip(BLANKS) != proceed:
            at = find_unseen(failure.text)
            message = f"the character {character_name(failure.text[at])} cannot stand beside `continue`; delete it"
            self.diagnostics.error("wrong-value", self.file.text_location(failure, at), message)
        return Action(name, calls, wait_for, proceed == "continue", self.file.element_location(element))

    def plain(self, element: Element | None) -> str:
        """The text of a child that holds nothing but text."""
        if element is None:
            return ""
        self.attributes(element, ())
        for child in element:
            self.error("unknown-element", child, f"`<{element.tag}>` holds only text")
        return element.text.strip()

    def call(self, element: Element, spec: ActionSpec, besides: tuple[str, ...]) -> ActionCall:
        check_no_text(self.file, element, self.diagnostics)
        parameters: dict[str, Template] = {}
        seen: dict[str, Element] = {}
        for child in element:
            name = child.tag
            if name in seen:
                self.error("duplicate-parameter", child, f"`{name}` stands here twice")
                continue
            seen[name] = child
            parameter = spec.parameters.get(name)
            if parameter is not None:
                template = self.template(child, parameter)
                if template is not None:
                    parameters[name] = template
            elif name not in besides:
                self.unknown_parameter(child, spec, besides)
        for parameter in spec.parameters.values():
            if parameter.required and parameter.name not in seen:
                self.error(
                    "missing-parameter", element, f"`<{spec.name}>` needs `<{parameter.name}>`{_explained(parameter)}"
                )
        return ActionCall(spec.name, parameters)

    def unknown_parameter(self, element: Element, spec: ActionSpec, besides: tuple[str, ...]) -> None:
        name = element.tag
        if name in COMMON:
            self.error("unknown-parameter", element, f"`{name}` stands in `<Variants>`, not in its single actions")
        elif name in self.robot.actions or name == "Variants":
            self.error("unknown-parameter", element, f"an action cannot stand inside `<{spec.name}>`; close it before")
        else:
            known = (*spec.parameters, *besides)
            self.error("unknown-parameter", element, f"`<{spec.name}>` has no `{name}`{did_you_mean(name, known)}")

    def template(self, element: Element, parameter: Parameter) -> Template | None:
        text = self.plain(element)
        if "\n" in text:
            text = " ".join(text.split())
        if not text:
            if parameter.required or parameter.type != "text":
                self.error("missing-parameter", element, f"`{parameter.name}` is empty{_explained(parameter)}")
            return parse_template("")
        try:
            template = parse_template(text)
        except TemplateError as error:
            location = self.file.text_location(element, _raw_index(element.text, error.column - 1))
            self.diagnostics.error("template", location, str(error))
            return None
        constant = template.constant
        if constant is None:
            index = {found.group(1): found.start() for found in reversed(list(_SLOT.finditer(element.text)))}
            for slot in template.parts:
                if isinstance(slot, str) or (slot.fallback is not None and not (slot.before or slot.after)):
                    continue
                mention = Mention(slot.key, LazyLocation(self.file, element, None, index.get(slot.key, 0)))
                (self.draft.key_reads if slot.fallback is None else self.draft.optional_key_reads).append(mention)
            try:
                check_template(parameter, template)
            except ParameterError as error:
                location = self.file.text_location(element, _raw_index(element.text, 0))
                self.diagnostics.error(_code(parameter, error), location, str(error))
            return template
        if parameter.type == "text":
            return template
        try:
            convert_parameter(parameter, constant)
        except ParameterError as error:
            where = LazyLocation(self.file, element, None, _raw_index(element.text, 0))
            if parameter.type != "name" and _KEY.match(constant):
                self.draft.bare_keys.append(BareKey(constant, where, str(error)))
                self.draft.key_reads.append(Mention(constant, where))
                return key_template(constant)
            self.diagnostics.error(_code(parameter, error), where.location, str(error))
            return None
        return template

    def attributes(self, element: Element, known: tuple[str, ...]) -> None:
        for name in element.attributes:
            if name in known:
                continue
            message = f"`<{element.tag}>` has no attribute `{name}`{did_you_mean(name, known)}"
            spec = self.robot.actions.get(element.tag)
            if spec is not None and (name in spec.parameters or name in COMMON):
                value = element.get(name)
                message = (
                    f"parameters are elements, not attributes; write <{name}>{value}</{name}> inside `<{spec.name}>`"
                )
            self.diagnostics.error("unknown-attribute", self.file.attribute_location(element, name), message)


def _code(parameter: Parameter, error: ParameterError) -> str:
    if parameter.type == "name":
        return "unknown-name"
    return "out-of-range" if isinstance(error, OutOfRangeError) else "wrong-type"


def _explained(parameter: Parameter) -> str:
    return f" ({parameter.help.rstrip('.')})" if parameter.help else ""


def _raw_index(raw: str, index: int) -> int:
    """Where the character `index` of a stripped, single-spaced text was before."""
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

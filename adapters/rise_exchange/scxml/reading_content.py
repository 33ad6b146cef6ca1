"""Reads executable content of SCXML (section 4, 6.2 and 6.3), from states and transitions of a chart."""

from __future__ import annotations

import json
import re
from collections.abc import Collection

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.xml import XmlFile
from rise_engine.syntax.xml import Element
from rise_exchange.scxml.chart import (
    ERROR,
    AssignNode,
    CallNode,
    CancelNode,
    Content,
    FailNode,
    ForEachNode,
    IfNode,
    Node,
    RaiseNode,
    SendNode,
    SendPlace,
)
from rise_exchange.scxml.script import (
    REFUSED_NODE,
    ChartRefusedError,
    Constant,
    InState,
    Operation,
    Script,
    ScriptNode,
    Variable,
    is_variable_name,
    read_assignments,
    read_script,
)

RISE_PROCESSOR = "x-rise"
"""The type of a `<send>` whose events are functions of rules."""
CALLED_FUNCTIONS = (
    "startCommunicationRobotAct",
    "stopCommunicationRobotAct",
    "startInteractionRule",
    "stopInteractionRule",
)
SHORTEST = 0.01
"""The shortest delay in seconds: the external queue itself takes 1 ms."""
LONGEST = 86400.0
_OWN_PROCESSORS = ("http://www.w3.org/TR/scxml/#SCXMLEventProcessor", "http://www.w3.org/TR/scxml/", "scxml")
_TIME = re.compile(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(ms|s|m|min|h)\s*", re.ASCII)
_UNITS = {"ms": 0.001, "s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0}
_ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "raise": ("event",),
    "assign": ("location", "expr"),
    "if": ("cond",),
    "elseif": ("cond",),
    "else": (),
    "foreach": ("array", "item", "index"),
    "log": ("label", "expr"),
    "send": (
        "event", "eventexpr", "target", "targetexpr", "type", "typeexpr", "id", "idlocation", "delay", "delayexpr",
        "namelist",
    ),
    "cancel": ("sendid", "sendidexpr"),
    "script": ("src",),
}  # fmt: skip
_COMPUTED = ("eventexpr", "targetexpr", "typeexpr", "sendidexpr")


class ContentReader:
    """Reads executable content; diagnostics go to `diagnostics`."""

    def __init__(self, file: XmlFile, diagnostics: Diagnostics) -> None:
        self.file = file
        self.diagnostics = diagnostics
        self.places: list[SendPlace] = []
        self.notes: list[str] = []
        self.is_null_model = False
        self.asked: list[tuple[str, Element, str]] = []
        """Ids in `In(...)`, with their element and attribute."""

    def refuse(self, code: str, element: Element, message: str, attribute: str = "", index: int = 0) -> None:
        """Report a diagnostic about an element, or about the value of one of its attributes."""
        location = self.file.element_location(element)
        if attribute in element.attributes:
            location = self.file.value_location(element, attribute, index)
        self.diagnostics.error(code, location, message)

    def is_foreign(self, element: Element) -> bool:
        """Whether an element is in another namespace than SCXML's."""
        return ":" in element.tag or "xmlns" in element.attributes

    def check_attributes(self, element: Element, known: Collection[str]) -> None:
        for name in element.attributes:
            if name not in known and ":" not in name and name != "xmlns":
                message = f"`<{element.tag}>` has no attribute `{name}` in SCXML 1.0"
                location = self.file.attribute_location(element, name)
                self.diagnostics.error("chart", location, message)

    # --- scripts ---

    def read_expression(self, element: Element, attribute: str) -> Script:
        """Read the expression in an attribute; after a diagnostic, a placeholder."""
        text = element.attributes[attribute]
        location = self.file.value_location(element, attribute)
        try:
            script = read_script(text, location)
        except ChartRefusedError as error:
            self.refuse(error.code, element, str(error), attribute, error.index)
            return Script(text, REFUSED_NODE, location)
        if script.root is not None:
            self.asked += ((id, element, attribute) for id in _asked_ids(script.root))
        if self.is_null_model and script.root is not None and _has_variables(script.root):
            self.refuse("expression", element, 'with datamodel="null" a condition can only ask In(...)', attribute)
        return script

    def expression_of_text(self, element: Element) -> Script:
        """Read a value from the text of an element: JSON, or else the text itself (B.2.8.1)."""
        text, location = element.text.strip(), self.file.element_location(element)
        try:
            json.loads(text)
        except ValueError:
            return Script(text, Constant(" ".join(text.split())), location)
        try:
            return read_script(text, location)
        except ChartRefusedError as error:
            self.refuse(error.code, element, str(error))
            return Script(text, REFUSED_NODE, location)

    def read_script_element(self, element: Element) -> list[AssignNode]:
        """The assignments in a `<script>`."""
        self.check_attributes(element, _ATTRIBUTES["script"])
        if "src" in element.attributes:
            self.refuse("data", element, "scripts in other files (`src`) are not read", "src")
            return []
        location = self.file.element_location(element)
        try:
            found = read_assignments(element.text)
        except ChartRefusedError as error:
            self.diagnostics.error(error.code, self.file.text_location(element, error.index), str(error))
            return []
        return [
            AssignNode(each.name, Script(element.text, each.value, location), location, declares=True) for each in found
        ]

    # --- content ---

    def read_content(self, parent: Element) -> Content:
        """The content of `<onentry>`, `<transition>` and similar elements."""
        nodes: list[Node] = []
        for child in parent:
            if self.is_foreign(child):
                if child.tag.endswith(":editorinfo"):
                    continue  # Qt Creator's own layout of the state
                self.refuse("foreign-element", child, f"`<{child.tag}>` is not SCXML's; its effect is unknown")
                continue
            if child.tag not in _ATTRIBUTES or child.tag in ("else", "elseif"):
                self.refuse("chart", child, f"`<{child.tag}>` is not allowed in `<{parent.tag}>`")
                continue
            self.check_attributes(child, _ATTRIBUTES[child.tag])
            nodes += self.read_node(child)
        return tuple(nodes)

    def read_node(self, element: Element) -> list[Node]:
        match element.tag:
            case "raise":
                event = (element.get("event") or "").strip()
                if not event:
                    self.refuse("chart", element, "`<raise>` needs an `event`")
                return [RaiseNode(event)] if event else []
            case "assign":
                return self.read_assign(element)
            case "if":
                return [self.read_if(element)]
            case "foreach":
                return self.read_foreach(element)
            case "log":
                self.read_log(element)
                return []
            case "send":
                return self.read_send(element)
            case "cancel":
                return self.read_cancel(element)
        return list(self.read_script_element(element))

    def read_assign(self, element: Element) -> list[Node]:
        location = self.file.element_location(element)
        name = (element.get("location") or "").strip()
        if not name:
            self.refuse("chart", element, "`<assign>` needs a `location`")
            return []
        if name.startswith("_"):
            self.refuse("system-variable", element, f"`{name}` is a system variable; rules have none", "location")
            return []
        value = (
            self.read_expression(element, "expr") if "expr" in element.attributes else self.expression_of_text(element)
        )
        if len(element) or ("expr" not in element.attributes and not element.text.strip()):
            self.refuse("data", element, "`<assign>` needs a value: expr=...")
            return []
        root = re.split(r"[.\[]", name, maxsplit=1)[0].strip()
        if root != name and is_variable_name(root):
            return [AssignNode(name, value, location)]
        return [AssignNode(name if is_variable_name(name) else None, value, location)]

    def read_if(self, element: Element) -> Node:
        branches: list[tuple[Script | None, list[Node]]] = [(self.read_cond(element), [])]
        has_else = False
        pending = Element(element.tag, {}, element.start, element.tree, None)
        for child in element:
            if child.tag in ("elseif", "else"):
                self.check_attributes(child, _ATTRIBUTES[child.tag])
                branches[-1][1].extend(self.read_content(pending))
                pending.clear()
                if has_else:
                    self.refuse("chart", child, f"`<{child.tag}/>` is after `<else/>`")
                has_else = has_else or child.tag == "else"
                branches.append((None if child.tag == "else" else self.read_cond(child), []))
            else:
                pending.append(child)
        branches[-1][1].extend(self.read_content(pending))
        return IfNode(tuple((cond, tuple(inner)) for cond, inner in branches), self.file.element_location(element))

    def read_cond(self, element: Element) -> Script:
        script = self.read_expression(element, "cond") if "cond" in element.attributes else None
        if "cond" not in element.attributes:
            self.refuse("chart", element, f"`<{element.tag}>` needs a condition: cond=...")
        return script or Script("", Constant(False), self.file.element_location(element))

    def read_foreach(self, element: Element) -> list[Node]:
        array = self.read_expression(element, "array") if "array" in element.attributes else None
        names = [(element.get(name) or "").strip() for name in ("item", "index")]
        if "array" not in element.attributes or not names[0]:
            self.refuse("chart", element, "`<foreach>` needs `array` and `item`")
        body = self.read_content(element)
        if array is None:
            return []
        item, index = (name if is_variable_name(name) else None for name in names)
        location = self.file.element_location(element)
        if names[1] and index is None:
            return [FailNode(ERROR, ends_block=True)]
        return [ForEachNode(array, item, index, body, location)]

    def read_log(self, element: Element) -> None:
        line = self.file.element_location(element).line
        if "expr" in element.attributes:
            script = self.read_expression(element, "expr")
            if script.root is None:
                self.refuse("expression", element, "the value to log is not an expression", "expr")
        self.notes.append(f"line {line}: `<log>` is left out; the record of a session has every state and every value")

    # --- sending ---

    def read_send(self, element: Element) -> list[Node]:
        before = self.diagnostics.errors
        get = element.get
        for name in _COMPUTED:
            if name in element.attributes:
                message = f"`{name}` is a name that is worked out while the chart runs; rules name what they mean"
                self.refuse("computed", element, message, name)
        for name in ("idlocation", "namelist"):
            if name in element.attributes:
                self.refuse("idlocation", element, f"`{name}` cannot be taken over: {_WHY[name]}", name)
        kind = (get("type") or "").strip()
        if kind == RISE_PROCESSOR:
            return self.read_call(element)
        if len(element):
            message = f"`<{element[0].tag}>` puts values into an event; events of rules carry nothing"
            self.refuse("payload", element[0], message)
        seconds = self.read_delay(element)
        if kind and kind not in _OWN_PROCESSORS:
            if re.match(r"[A-Za-z]", kind):
                message = f"nothing here takes what is sent to an I/O processor of the type `{kind}`"
                self.refuse("foreign-type", element, message, "type")
                return []
            return [FailNode(ERROR, ends_block=True)]  # no type has this name
        event = (get("event") or "").strip()
        if not event and "eventexpr" not in element.attributes:
            self.refuse("chart", element, "`<send>` needs an `event`")
        if self.diagnostics.errors > before or seconds is None:
            return []
        return self.send_to((get("target") or "").strip(), event, seconds, element)

    def send_to(self, target: str, event: str, seconds: float, element: Element) -> list[Node]:
        """The nodes for a `<send>` to a target: to the chart itself, or an error."""
        if target == "#_internal":
            return [FailNode(ERROR, ends_block=True)] if seconds else [RaiseNode(event)]
        if target.startswith("#_scxml_"):
            if seconds:
                self.refuse("foreign-type", element, "the failure of a send to another session comes later", "target")
            return [FailNode("error.communication", ends_block=False)]  # other sessions are unreachable
        if target.startswith("#_"):
            message = f"`{target}` is another session; a rule was started by none and has invoked none"
            self.refuse("invoke", element, message, "target")
            return []
        if re.match(r"[A-Za-z][A-Za-z0-9+.-]*:", target):
            self.refuse("foreign-type", element, f"nothing here can send to `{target}`", "target")
            return []
        if target:
            return [FailNode(ERROR, ends_block=True)]
        location = self.file.element_location(element)
        place = SendPlace(len(self.places) + 1, event, seconds, (element.get("id") or "").strip(), location)
        self.places.append(place)
        return [SendNode(place)]

    def read_delay(self, element: Element) -> float | None:
        """Seconds; None after a diagnostic."""
        text, attribute = element.get("delay"), "delay"
        if "delayexpr" in element.attributes:
            attribute = "delayexpr"
            script = self.read_expression(element, "delayexpr")
            if script.root is REFUSED_NODE:
                return None
            if not isinstance(script.root, Constant) or not isinstance(script.root.value, str):
                message = "a time that is worked out while the chart runs cannot be taken over; write delay=..."
                self.refuse("computed", element, message, "delayexpr")
                return None
            text = script.root.value
        if text is None:
            return 0.0
        found = _TIME.fullmatch(text)
        if found is None:
            self.refuse("chart", element, f"`{text}` is not a time; write 500ms or 2s", attribute)
            return None
        seconds = round(float(found.group(1)) * _UNITS[found.group(2)], 6)
        if seconds and not SHORTEST <= seconds <= LONGEST:
            message = f"`{text}`: a delay is 0, or from 10ms to 24 hours"
            self.refuse("delay", element, message, attribute)
            return None
        return seconds

    def read_cancel(self, element: Element) -> list[Node]:
        if "sendidexpr" in element.attributes:
            message = "`sendidexpr` is a name that is worked out while the chart runs; rules name what they mean"
            self.refuse("computed", element, message, "sendidexpr")
            return []
        id = (element.get("sendid") or "").strip()
        if not id:
            self.refuse("chart", element, "`<cancel>` needs a `sendid`")
        return [CancelNode(id)] if id else []

    def read_call(self, element: Element) -> list[Node]:
        """`<send type="x-rise" event="startCommunicationRobotAct">` with the behaviour in a `<param>`."""
        function = (element.get("event") or "").strip()
        if function not in CALLED_FUNCTIONS:
            names = ", ".join(CALLED_FUNCTIONS)
            message = f"of the functions of rules, {names} can be sent; the others are `<raise>`, `<assign>`"
            self.refuse("foreign-type", element, message, "event")
            return []
        known = [child for child in element if child.tag == "param" and child.get("name") == "behavior"]
        if len(known) != 1 or len(element) != 1 or "expr" not in known[0].attributes or self.read_delay(element) != 0.0:
            message = """it holds one <param name="behavior" expr="'R_Hello'"/>, and has no delay"""
            self.refuse("payload", element, message)
            return []
        script = self.read_expression(known[0], "expr")
        if script.root is REFUSED_NODE:
            return []
        if not isinstance(script.root, Constant) or not isinstance(script.root.value, str):
            self.refuse("computed", known[0], "the behaviour is a name in quotation marks", "expr")
            return []
        return [CallNode(function, script.root.value)]


_WHY = {
    "idlocation": "it keeps an id that is made while the chart runs",
    "namelist": "it puts values into an event, and events of rules carry nothing",
}


def _asked_ids(node: ScriptNode) -> list[str]:
    """The ids in a script's `In` calls."""
    match node:
        case InState(id):
            return [id]
        case Operation(_, operands):
            return [id for operand in operands for id in _asked_ids(operand)]
    return []


def _has_variables(node: ScriptNode) -> bool:
    match node:
        case Variable():
            return True
        case Operation(_, operands):
            return any(_has_variables(operand) for operand in operands)
    return False

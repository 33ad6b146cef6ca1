"""Reads an SCXML 1.0 document (https://www.w3.org/TR/scxml/) into a chart, and reports what cannot become rules."""

from __future__ import annotations

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.files.xml import XmlFile, read_xml
from rise_engine.syntax.xml import Element
from rise_exchange.scxml.chart import (
    AssignNode,
    Chart,
    ChartState,
    ChartTransition,
    ChartVariable,
    StateKind,
)
from rise_exchange.scxml.reading_content import ContentReader
from rise_exchange.scxml.script import Script, is_variable_name

SCXML = "http://www.w3.org/2005/07/scxml"
"""The namespace."""
_DATAMODELS = ("ecmascript", "null")
_STATES: dict[str, StateKind] = {"state": "state", "parallel": "parallel", "final": "final", "history": "history"}
_ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "scxml": ("initial", "name", "version", "datamodel", "binding", "exmode"),
    "state": ("id", "initial"),
    "parallel": ("id",),
    "final": ("id",),
    "history": ("id", "type"),
    "initial": (),
    "transition": ("event", "cond", "target", "type"),
    "datamodel": (),
    "data": ("id", "expr", "src"),
    "onentry": (),
    "onexit": (),
}
_CHILDREN: dict[str, tuple[str, ...]] = {
    "scxml": ("state", "parallel", "final", "datamodel", "script"),
    "state": (
        "onentry", "onexit", "transition", "initial", "state", "parallel", "final", "history", "datamodel", "invoke",
    ),
    "parallel": ("onentry", "onexit", "transition", "state", "parallel", "history", "datamodel", "invoke"),
    "final": ("onentry", "onexit", "donedata"),
    "history": ("transition",),
    "initial": ("transition",),
    "datamodel": ("data",),
}  # fmt: skip


def read_chart(source: SourceFile, diagnostics: Diagnostics) -> Chart | None:
    """Read a document; None after diagnostics that prevent further checks."""
    file = read_xml(source, diagnostics)
    if file is None:
        return None
    root = file.root
    if root.tag != "scxml" or root.get("xmlns") != SCXML:
        message = f'this is no SCXML document: its outermost element is <scxml xmlns="{SCXML}" version="1.0">'
        diagnostics.error("namespace", file.element_location(root), message)
        return None
    return _ChartReader(file, diagnostics).read()


class _ChartReader(ContentReader):
    def __init__(self, file: XmlFile, diagnostics: Diagnostics) -> None:
        super().__init__(file, diagnostics)
        self.states: dict[str, ChartState] = {}
        self.transitions: list[tuple[ChartTransition, Element]] = []
        self.initials: list[tuple[ChartState, Element, str]] = []
        """The compound states and their `initial` attribute; empty: not given."""
        self.variables: list[ChartVariable] = []
        self.order = 0

    def read(self) -> Chart:
        element = self.file.root
        self.check(element, "scxml")
        model = element.get("datamodel")
        if model is not None and model not in _DATAMODELS:
            message = f"the data model `{model}` cannot be read here; `ecmascript` and `null` can"
            self.refuse("data", element, message, "datamodel")
        self.is_null_model = model == "null"
        self.is_late = element.get("binding") == "late"
        root = self.new_state("scxml", element, None)
        scripts: list[AssignNode] = []
        for child in element:
            if child.tag == "script":
                scripts += self.read_script_element(child)
        self.read_inside(root, element)
        self.resolve_targets()
        for id, place, attribute in self.asked:
            if id not in self.states:
                self.refuse("chart", place, f"there is no state `{id}`{did_you_mean(id, self.states)}", attribute)
        if not root.children:
            self.refuse("chart", element, "this chart has no states")
        name = (element.get("name") or "").strip()
        return Chart(name, root, self.states, self.variables, tuple(scripts), self.places, self.notes)

    # --- states ---

    def new_state(self, kind: StateKind, element: Element, parent: ChartState | None) -> ChartState:
        location = self.file.element_location(element)
        id = (element.get("id") or "").strip() if kind != "scxml" else ""
        state = ChartState(
            id or f"{kind} in line {location.line}", kind, parent, self.order, location, [], [], [], [], []
        )
        self.order += 1
        if id in self.states:
            message = f"there is another state `{id}`, in line {self.states[id].location.line}"
            self.refuse("chart", element, message, "id")
        elif kind != "scxml":
            while state.id in self.states:
                state.id += "'"
            self.states[state.id] = state
        return state

    def read_inside(self, state: ChartState, element: Element) -> None:
        for child in element:
            match child.tag:
                case "state" | "parallel" | "final" | "history":
                    self.check(child, child.tag)
                    inner = self.new_state(_STATES[child.tag], child, state)
                    inner.is_deep = child.tag == "history" and self.history_type(child) == "deep"
                    (state.histories if child.tag == "history" else state.children).append(inner)
                    self.read_inside(inner, child)
                case "onentry" | "onexit":
                    self.check(child, child.tag)
                    (state.on_entry if child.tag == "onentry" else state.on_exit).append(self.read_content(child))
                case "transition" if state.kind != "history":
                    state.transitions.append(self.read_transition(state, child))
                case "transition":
                    state.initial = self.read_transition(state, child, is_initial=True)
                case "datamodel":
                    self.read_data(child, state)
                case "invoke":
                    message = (
                        "`<invoke>` starts another program, and ends it with the state; a rule can start another "
                        "rule, but does not own it"
                    )
                    self.refuse("invoke", child, message)
                case "donedata":
                    message = "`<donedata>` puts values into an event; events of rules carry nothing"
                    self.refuse("donedata", child, message)
        if state.kind == "history":
            if state.initial is None or not state.initial.target_ids:
                self.refuse("chart", element, "a history says where it leads at first: <transition target=...>")
        elif state.children and state.kind != "parallel":
            self.read_initial(state, element)

    def read_initial(self, state: ChartState, element: Element) -> None:
        written = next((child for child in element if child.tag == "initial"), None)
        if written is not None and state.kind == "state":
            self.check(written, "initial")
            inner = next((child for child in written if child.tag == "transition"), None)
            if inner is None or "initial" in element.attributes:
                message = "a state says once where it begins: initial=..., or <initial><transition target=.../>"
                self.refuse("chart", written, message)
            else:
                state.initial = self.read_transition(state, inner, is_initial=True)
                return
        ids = tuple((element.get("initial") or "").split()) or (state.children[0].id,)
        location = self.file.element_location(element)
        state.initial = ChartTransition(state, None, None, ids, False, (), -1, location)
        self.transitions.append((state.initial, element))

    def history_type(self, element: Element) -> str:
        kind = element.get("type") or "shallow"
        if kind not in ("shallow", "deep"):
            self.refuse("chart", element, f"a history is `shallow` or `deep`, not `{kind}`", "type")
        return kind

    # --- transitions ---

    def read_transition(self, source: ChartState, element: Element, is_initial: bool = False) -> ChartTransition:
        self.check(element, "transition")
        events = tuple(element.attributes["event"].split()) if "event" in element.attributes else None
        condition = self.read_expression(element, "cond") if "cond" in element.attributes else None
        if is_initial and (events is not None or condition is not None):
            self.refuse("chart", element, "a transition that is not a choice has neither `event` nor `cond`")
        kind = element.get("type") or "external"
        if kind not in ("internal", "external"):
            self.refuse("chart", element, f"a transition is `internal` or `external`, not `{kind}`", "type")
        transition = ChartTransition(
            source,
            tuple(_descriptor(each) for each in events) if events is not None else None,
            condition,
            tuple((element.get("target") or "").split()),
            kind == "internal",
            self.read_content(element),
            len(self.transitions),
            self.file.element_location(element),
        )
        if is_initial and not transition.target_ids:
            self.refuse("chart", element, "this transition says where to begin; it needs a `target`")
        if events == ():
            self.refuse("chart", element, "`event` is empty; leave it out for a transition without event", "event")
        self.transitions.append((transition, element))
        return transition

    def resolve_targets(self) -> None:
        for transition, element in self.transitions:
            attribute = "target" if element.tag == "transition" else "initial"
            for id in transition.target_ids:
                if id not in self.states:
                    message = f"there is no state `{id}`{did_you_mean(id, self.states)}"
                    self.refuse("chart", element, message, attribute)
                elif transition.order < 0 and not self.states[id].is_inside(transition.source):
                    message = f"`{transition.source.id}` cannot begin in `{id}`, which is not inside it"
                    self.refuse("chart", element, message, attribute)
            transition.targets = tuple(self.states[id] for id in transition.target_ids if id in self.states)

    # --- data ---

    def read_data(self, element: Element, state: ChartState) -> None:
        self.check(element, "datamodel")
        for child in element:
            if child.tag != "data":
                continue
            self.check(child, "data")
            name = (child.get("id") or "").strip()
            if self.is_null_model:
                self.refuse("data", child, 'with datamodel="null" there are no variables')
            if not is_variable_name(name):
                self.refuse("data", child, f"`{name}` cannot be the name of a variable", "id")
            elif any(each.name == name for each in self.variables):
                self.refuse("data", child, f"there is another variable `{name}`", "id")
            if self.is_late and state.kind != "scxml":
                message = (
                    'binding="late": this variable comes into being when its state is first entered; rules set all'
                )
                self.refuse("data", child, f"{message} at their start")
            if "src" in child.attributes:
                self.refuse("data", child, "values from other files (`src`) are not read; write the value here", "src")
            value, location = self.data_value(child), self.file.element_location(child)
            self.variables.append(ChartVariable(name, value, location))

    def data_value(self, element: Element) -> Script | None:
        if "expr" in element.attributes:
            value = self.read_expression(element, "expr")
        elif len(element):
            self.refuse("data", element, "a variable can hold a number, a text, true, false or a list, but no XML")
            return None
        elif element.text.strip():
            value = self.expression_of_text(element)
        else:
            return None
        if value.root is None:
            message = f"`{value.text.strip()}` is not a value that can be computed, so the variable would be unbound"
            self.refuse("data", element, message)
        return value

    # --- forms ---

    def check(self, element: Element, tag: str) -> None:
        self.check_attributes(element, _ATTRIBUTES[tag])
        for child in element:
            if tag in _CHILDREN and not self.is_foreign(child) and child.tag not in _CHILDREN[tag]:
                message = f"`<{child.tag}>` is not allowed in `<{tag}>`{did_you_mean(child.tag, _CHILDREN[tag])}"
                self.refuse("chart", child, message)


def _descriptor(text: str) -> str:
    """Return an event descriptor without an ending that has no meaning (3.12.1)."""
    return text.removesuffix(".*").removesuffix(".") or "*"

"""Completion: proposals for a place of a study's file, even if the rest of the file has errors."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import get_args

from msgspec import Struct

from rise_engine.author.lsp.hover import table_path
from rise_engine.expression.functions import SITUATION_SIGNATURES
from rise_engine.scenario.checking.cross_references import engine_topics
from rise_engine.scenario.explore_settings import MEASURES, ExploredKeys
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.grammar import COMMON, AttributeForm, form_of
from rise_engine.scenario.loader import LoadResult
from rise_engine.scenario.model import ActionSpec, SourceLocation
from rise_engine.scenario.parameters import listed_names
from rise_engine.scenario.reading.explore_tables import PROPERTY_TABLES
from rise_engine.scenario.settings import SCENARIO_TABLES, names_in, table_at

_TAG = re.compile(r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<(/?)([\w.:-]+)((?:[^<>\"']|\"[^\"]*\"|'[^']*')*?)(/?)>", re.DOTALL)
_NAME = re.compile(r"""\s(?:name|id)\s*=\s*["']([^"']*)["']""")
_STARTED = re.compile(r"""\sstartInteractionRule\s*=\s*["']([^"']*)["']""")
_IN_ATTRIBUTE = re.compile(r"""([\w.:-]+)\s*=\s*(["'])([^"'<]*)\Z""")
_TOML_TEXT = re.compile(r"""([\w-]+)\s*=\s*\[?\s*(?:["'][^"']*["']\s*,\s*)*["']([^"']*)\Z""")
_TOML_RULE = re.compile(r"""\brule\s*=\s*["']([^"']*)["']""")
_TOML_HEADER = re.compile(r"""^[ \t]*\[+[ \t]*([^\]\r\n#]*?)[ \t]*\]""", re.MULTILINE)
_TOML_KEY = re.compile(r"(?:^|[{,])[ \t]*([\w-]*)\Z")
"""An unfinished key, on its own line or in braces."""
_TOML_CONDITION = re.compile(r"""=\s*(["'])((?:(?!\1)[^\\]|\\.)*)\Z""")
_IN_TRIES = re.compile(r"\btries\s*=\s*\{(?:[^{}]*,)?[^{},=]*\Z")
_ASKED_NAME = re.compile(r"""\b(in|rule|runs|waits)\s*\(\s*\\?["'](?:([^"'\\]*)\\?["']\s*,\s*\\?["'])?([^"'\\]*)\Z""")
_WORD = re.compile(r"[\w.]*\Z")


class Proposal(Struct, frozen=True):
    """A proposed text."""

    text: str
    kind: str
    """act, rule, state, event, key, action, element, attribute, value."""
    note: str = ""


class _OpenElement(Struct, frozen=True):
    tag: str
    attributes: str
    start: int


def proposals(checked: LoadResult, name: str, text: str, offset: int) -> tuple[int, list[Proposal]]:
    """Return the start of the text to replace before `offset`, and the proposals for it."""
    if name.lower().endswith(".toml"):
        start, found = _in_toml(checked, text[:offset])
    elif name.lower().endswith(".xml"):
        start, found = _XmlPlace(checked, text, offset).find()
    else:
        return offset, []
    place = SourceFile(name, b"", text).location(start)
    return start, [each for each in found if not _is_being_written(checked, each, place)]


def _is_being_written(checked: LoadResult, proposal: Proposal, place: SourceLocation) -> bool:
    """Return whether a memory key or an event is only known from the place where it is being typed."""
    if proposal.kind not in ("key", "event"):
        return False
    name = proposal.text.removeprefix("/")
    uses = checked.uses.of("key" if proposal.kind == "key" else "event", name)
    columns = {place.column + slash for slash in range(1 + (proposal.kind == "event"))}
    known = {(each.place.file, each.place.line, each.place.column in columns) for each in uses}
    return known == {(place.file, place.line, True)}


def _in_toml(checked: LoadResult, before: str) -> tuple[int, list[Proposal]]:
    line = before[before.rfind("\n") + 1 :]
    headers = _TOML_HEADER.findall(before)
    table = headers[-1] if headers else ""
    entry = _TOML_KEY.search(line)
    if entry is not None and entry.start() == 0 and (names := _setting_names(before)):
        return len(before) - len(entry.group(1)), names
    if table.partition(".")[0] in ("explore", *PROPERTY_TABLES):
        return _in_explored(checked, table, line, len(before))
    found = _TOML_TEXT.search(line)
    if found is None:
        return len(before), []
    key, written = found.groups()
    start = len(before) - len(written)
    match key:
        case "act" | "stop_act":
            return start, _name_proposals(checked.draft.acts, "act")
        case "rule" | "stop_rule":
            return start, _name_proposals(checked.draft.rules, "rule")
        case "event" | "speech":
            return start, _events(checked)
        case "measure" if table == "trials":
            return start, [Proposal(each, "value") for each in MEASURES]
        case "state" if table == "trials":
            return start, [each for rule in checked.draft.rules for each in _states(checked, rule)]
        case "state":
            rule = _TOML_RULE.search(line)
            return start, _states(checked, rule.group(1) if rule else "")
        case "set":
            return len(before) - len(_word(written)), _keys(checked)
        case "private" | "key" | "columns":
            return start, _keys(checked)
    return len(before), []


def _setting_names(before: str) -> list[Proposal]:
    """The names that the table at the end of a text may have."""
    table = table_at(SCENARIO_TABLES, table_path(before))
    names = names_in(SCENARIO_TABLES, table.path) if table is not None else {}
    return [Proposal(name, "value", meaning) for name, meaning in names.items()]


def _in_explored(checked: LoadResult, table: str, line: str, end: int) -> tuple[int, list[Proposal]]:
    """Complete in `[explore]` and in the tables of properties."""
    key = _TOML_KEY.search(line)
    if table == "explore":
        if _IN_TRIES.search(line) is not None and key is not None:
            return end - len(key.group(1)), _keys(checked)
        found = _TOML_TEXT.search(line)
        name, written = found.groups() if found is not None else ("", "")
        values = {"keys": get_args(ExploredKeys), "pace": ("any",)}.get(name, ())
        names = (
            _name_proposals(checked.draft.rules, "rule")
            if name == "end"
            else [Proposal(each, "value") for each in values]
        )
        return end - len(written), names
    if table == "explore.tries":
        return (end - len(key.group(1)), _keys(checked)) if key is not None and key.start() == 0 else (end, [])
    asked = _ASKED_NAME.search(line)
    if asked is not None:
        function, rule, written = asked.groups()
        start = end - len(written)
        if function in ("runs", "waits"):
            return start, _name_proposals(checked.draft.acts, "act") if rule is None else []
        if rule is None:
            return start, _name_proposals(checked.draft.rules, "rule")
        return start, _states(checked, rule) if function == "in" else []
    text = _TOML_CONDITION.search(line)
    if text is not None:
        inner = "'" if text.group(1) == '"' else '"'
        if text.group(2).count(inner) % 2:  # inside a text
            return end, []
        functions = [Proposal(f"{each.name}(", "value", each.meaning) for each in SITUATION_SIGNATURES]
        return end - len(_word(text.group(2))), [*_keys(checked), *functions]
    if key is not None and table == "eventually" and "{" in line:
        return end - len(key.group(1)), _setting_names("[eventually.a]")
    return end, []


class _XmlPlace:
    def __init__(self, checked: LoadResult, text: str, offset: int) -> None:
        self.checked = checked
        self.text = text
        self.before = text[:offset]
        self.elements = list(_open_elements(self.before))

    def find(self) -> tuple[int, list[Proposal]]:
        end = max((found.end() for found in _TAG.finditer(self.before)), default=0)
        rest = self.before[end:]
        if "<!--" in rest or "<![CDATA[" in rest:
            return len(self.before), []
        opened = rest.rfind("<")
        return self.in_tag(rest[opened + 1 :]) if opened >= 0 else self.in_text(rest)

    def in_tag(self, tag: str) -> tuple[int, list[Proposal]]:
        end = len(self.before)
        name = re.match(r"/?[\w.:-]*", tag)
        element = name.group() if name else ""
        if element == tag:
            return end - len(tag), self.elements_here() if not tag.startswith("/") else []
        attribute = _IN_ATTRIBUTE.search(tag)
        if attribute is not None:
            form = form_of(element).attributes.get(attribute.group(1), AttributeForm())
            return self.in_value(tag, form, attribute.group(3))
        written = _word(tag)
        return end - len(written), [Proposal(each, "attribute") for each in form_of(element).attributes]

    def in_value(self, tag: str, form: AttributeForm, written: str) -> tuple[int, list[Proposal]]:
        checked, end = self.checked, len(self.before)
        part = written.rpartition("|")[2].lstrip() if form.holds in ("states", "choices") else written
        start = end - len(part)
        if form.defines:
            return end, []
        match form.holds:
            case "act":
                return start, _name_proposals(checked.draft.acts, "act")
            case "rule":
                return start, _name_proposals(checked.draft.rules, "rule")
            case "event":
                return start, _events(checked)
            case "state" if form.of:
                started = _STARTED.search(tag)
                return start, _states(checked, started.group(1) if started else "")
            case "state" | "states":
                return start, _states(checked, self.enclosing("InteractionRule"))
            case "expression" | "assignment":
                return end - len(_word(written)), _keys(checked)
            case "delay" if "{" in written:
                return end - len(_word(written)), _keys(checked)
            case "choice" | "choices":
                return start, [Proposal(each, "value") for each in form.choices]
        return end, []

    def in_text(self, written: str) -> tuple[int, list[Proposal]]:
        end = len(self.before)
        if written.rfind("{") > written.rfind("}"):
            return end - len(_word(written)), _keys(self.checked)
        if len(self.elements) < 2:
            return end, []
        action, element = self.elements[-2:]
        if element.tag == "waitForActions":
            act = self.checked.draft.acts.get(self.enclosing("Dialog"))
            ids = [each.id for each in act.actions] if act else []
            return end - len(_word(written)), [Proposal(id, "action") for id in ids]
        spec = self.checked.robot.actions.get(action.tag)
        parameter = spec.parameters.get(element.tag) if spec is not None else None
        if parameter is not None and parameter.type == "name":
            return end - len(written.lstrip()), [Proposal(each, "value") for each in listed_names(parameter)]
        if parameter is not None and parameter.type == "boolean":
            return end - len(written.lstrip()), [Proposal(each, "value") for each in ("true", "false")]
        return end, []

    def elements_here(self) -> list[Proposal]:
        actions = self.checked.robot.actions
        if not self.elements:
            return []
        inside = self.elements[-1].tag
        if inside in ("Dialog", "Variants"):
            own = [Proposal(each.name, "element", each.help) for each in actions.values() if each.supported]
            rest = ("Variants",) if inside == "Dialog" else COMMON
            return [*own, *(Proposal(each, "element") for each in rest)]
        if (spec := actions.get(inside)) is not None:
            return list(_parameters(spec))
        return [Proposal(each, "element") for each in form_of(inside).children]

    def enclosing(self, tag: str) -> str:
        """Return the name of the enclosing act or rule."""
        around = next((each for each in reversed(self.elements) if each.tag == tag), None)
        if around is None:  # its start tag is unfinished
            around = _OpenElement(tag, self.before[self.before.rfind("<") :], 0)
        name = _NAME.search(around.attributes)
        return name.group(1).strip() if name else ""


def _open_elements(before: str) -> Iterator[_OpenElement]:
    """Yield the elements that are open at the end, the outermost first."""
    elements: list[_OpenElement] = []
    for found in _TAG.finditer(before):
        closing, tag, attributes, empty = found.groups()
        if tag is None or empty:
            continue
        if not closing:
            elements.append(_OpenElement(tag, attributes, found.start()))
            continue
        at = next((at for at in range(len(elements) - 1, -1, -1) if elements[at].tag == tag), None)
        if at is not None:
            del elements[at:]
    yield from elements


def _parameters(spec: ActionSpec) -> Iterator[Proposal]:
    for each in spec.parameters.values():
        yield Proposal(each.name, "element", each.help)
    yield from (Proposal(each, "element") for each in COMMON)


def _name_proposals(names: Iterable[str], kind: str) -> list[Proposal]:
    return [Proposal(name, kind) for name in names]


def _states(checked: LoadResult, rule: str) -> list[Proposal]:
    found = checked.draft.rules.get(rule)
    return _name_proposals(found.states, "state") if found is not None else []


def _events(checked: LoadResult) -> list[Proposal]:
    names = {*checked.uses.names("event"), *engine_topics(checked.draft)}
    return [Proposal(f"/{name}", "event") for name in sorted(names)]


def _keys(checked: LoadResult) -> list[Proposal]:
    names = {*checked.draft.settable_keys, *checked.draft.tables, *checked.uses.names("key")}
    return _name_proposals(sorted(names), "key")


def _word(written: str) -> str:
    found = _WORD.search(written)
    return found.group() if found else ""

"""Converts an act to a block of BML 1.0. The core has everything that other programs understand; our own parts have the
rest.

Parts that BML cannot express are in an element of our namespace, or in a `<description>` of our own type within the
behaviour. Programs that do not know the type use the core. To find the actions that need such a part, the block is read
again: actions that come back unchanged need none. Acts made from BML are written as files of a scenario.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from xml.sax.saxutils import escape, quoteattr

from msgspec.structs import replace

from rise_engine.base.text import pluralize
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.model import Act, Action, ActionCall, CallingType, Json
from rise_engine.scenario.speech.ssml import begins_as_ssml
from rise_engine.scenario.speech.template import MemorySlot, MissingValueError, Template
from rise_engine.syntax.toml import toml_key
from rise_exchange.bml.core_behavior import CoreBehavior, core_behavior, point_of, target_name
from rise_exchange.bml.names import BmlNames, ConversionFindings, TargetPoint
from rise_exchange.bml.reading import read_actions
from rise_exchange.bml.vocabulary import DESCRIPTION_TYPE, NAMESPACE, OWN_NAMESPACE, PRIORITY, SSML_TYPE

_ID = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_NOT_IN_ID = re.compile(r"\W", re.ASCII)
_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""Characters that memory values may have, but XML may not."""
_COMPOSITION: Mapping[CallingType, str] = {"None": "MERGE", "Blocking": "APPEND"}
_SSML_NAMESPACE = "http://www.w3.org/2001/10/synthesis"
_SAFE = {"\n": "&#10;", "\t": "&#9;", "\r": "&#13;"}


def write_act(
    act: Act, calling_type: CallingType, memory: Mapping[str, Json], names: BmlNames, findings: ConversionFindings
) -> str:
    """Return the text of a block. Parts of the act that other programs will not do go to `findings` as losses.

    :param calling_type: the act's usual calling type, which becomes the block's composition.
    :param memory: the start values, which replace the act's memory values.
    :param names: the names of points and movements.
    """
    writer = _BlockWriter(act, calling_type, memory, names)
    plain = writer.text(frozenset())
    read = read_actions(SourceFile("block.xml", b"", plain), names)
    described = frozenset(action.id for action in act.actions if not _is_same(action, read.get(action.id)))
    located = replace(names, targets=writer.points() | names.targets)
    read = read_actions(SourceFile("block.xml", b"", plain), located)
    for action in act.actions:
        _note_losses(action, read.get(action.id), writer, findings)
    return writer.text(described) if described else plain


def _is_same(action: Action, read: Action | None) -> bool:
    return read is not None and read.calls == action.calls


def _note_losses(action: Action, read: Action | None, writer: _BlockWriter, findings: ConversionFindings) -> None:
    """Report what another program will not do of an action."""

    def lose(message: str) -> None:
        findings.lose(action.location, f"`{writer.act.name}`, action {action.id}: {message}")

    if len(action.wait_for) > 1:
        lose("it begins when several have ended, for which BML has only <after>: another program may begin it later")
    call = action.calls[0]
    if len(action.calls) > 1:
        number = pluralize(len(action.calls), "variant")
        lose(f"BML has no variants: another program takes the first of {number}")
    core = writer.core(call)
    if core is None:
        lose(f"BML has nothing for `{call.type}`: another program leaves it out")
        return
    kept = read.calls[0].parameters if read is not None else {}
    for name, template in call.parameters.items():
        if template.slots:
            lose(_slot_loss(name, template, writer.memory))
    different = [
        name for name, template in call.parameters.items() if not template.slots and kept.get(name) != template
    ]
    target = core.attributes.get("target")
    if target is not None and target not in writer.names.targets:
        lose(f"BML has names and no points: another program has to know what `{target}` is")
    if different and (len(action.calls) == 1 or any(name != "message" for name in different)):
        shown = ", ".join(f"`{name}`" for name in different)
        lose(f"BML's core has no exact counterpart of {shown}: another program does something close")


def _slot_loss(name: str, template: Template, memory: Mapping[str, Json]) -> str:
    """The loss for a parameter that contains memory values."""
    try:
        filled = template.fill(memory)
    except MissingValueError as error:
        return (
            f"`{name}` has a memory value, BML has no memory, and `{error.key}` has no start value: it stays as it is"
        )
    return f"`{name}` has a memory value, and BML has no memory: its start value is written, “{filled}”"


class _BlockWriter:
    def __init__(self, act: Act, calling_type: CallingType, memory: Mapping[str, Json], names: BmlNames) -> None:
        self.act = act
        self.calling_type = calling_type
        self.memory = memory
        self.names = names
        self.ids = _make_ids(action.id for action in act.actions)
        self.block_id = _make_ids([act.name])[act.name]

    def core(self, call: ActionCall) -> CoreBehavior | None:
        """The core's behaviour for an action, with the memory's start values."""
        return core_behavior(call, self.names, self.fill)

    def points(self) -> dict[str, TargetPoint]:
        """The act's points, by their names in the block."""
        found: dict[str, TargetPoint] = {}
        for action in self.act.actions:
            written = {name: self.fill(template) for name, template in action.calls[0].parameters.items()}
            if "pointx" in written:
                found[target_name(written, self.names)] = point_of(written)
        return found

    def fill(self, template: Template) -> str:
        """Return a parameter's text with the start values. A key without one stays in its braces."""
        parts = tuple(self.with_value(part) for part in template.parts)
        return _NOT_XML.sub("", Template(template.text, parts).fill(self.memory))

    def with_value(self, part: str | MemorySlot) -> str | MemorySlot:
        """Return a part of a template; a text if the memory has no value for it."""
        if isinstance(part, MemorySlot):
            try:
                part.read(self.memory)
            except MissingValueError:
                return f"{{{part.key}}}"
        return part

    def text(self, described: frozenset[str]) -> str:
        """Return the text of the block. Actions in `described` get our own description."""
        lines: list[str] = []
        inside = False
        for action in self.act.actions:
            if action.continue_on_failure == inside:  # all other actions are required
                lines.append("  </required>" if inside else "  <required>")
                inside = not inside
            lines += self.behavior(action, "    " if inside else "  ", action.id in described)
        if inside:
            lines.append("  </required>")
        for action in self.act.actions:
            if len(action.wait_for) > 1:
                lines += self.constraint(action)
        attributes = f'xmlns="{NAMESPACE}"'
        if any("rise:" in line or "rise+xml" in line for line in lines) or self.block_id != self.act.name:
            attributes += f' xmlns:rise="{OWN_NAMESPACE}"'
        attributes += f' id="{self.block_id}"'
        if self.block_id != self.act.name:
            attributes += f" rise:act={_quote(self.act.name)}"
        attributes += f' composition="{_COMPOSITION[self.calling_type]}"'
        return "\n".join(('<?xml version="1.0" encoding="UTF-8"?>', f"<bml {attributes}>", *lines, "</bml>", ""))

    def behavior(self, action: Action, indent: str, described: bool) -> list[str]:
        """The lines of an action."""
        core = self.core(action.calls[0])
        id = self.ids[action.id]
        timing = f'id="{id}"' + (f" rise:id={_quote(action.id)}" if id != action.id else "")
        if len(action.wait_for) == 1:
            timing += f' start="{self.ids[action.wait_for[0]]}:end"'
        if core is None:
            return self.own_action(action, timing, indent)
        attributes = "".join(f" {name}={_quote(value)}" for name, value in core.attributes.items())
        if core.seconds is not None:
            attributes += f' end="{id}:start+{core.seconds}"'
        inside = [] if core.text is None else [f"<text>{escape(core.text)}</text>"]
        if core.ssml is not None:
            inside.append(
                f'<description priority="{PRIORITY}" type="{SSML_TYPE}">{_with_namespace(core.ssml)}</description>'
            )
        if described:
            inside.append(f'<description priority="{PRIORITY}" type="{DESCRIPTION_TYPE}">')
            inside += [f"  {line}" for line in self.own_action(action, "", "")]
            inside.append("</description>")
        if not inside:
            return [f"{indent}<{core.tag} {timing}{attributes}/>"]
        return [
            f"{indent}<{core.tag} {timing}{attributes}>",
            *(f"{indent}  {line}" for line in inside),
            f"{indent}</{core.tag}>",
        ]

    def own_action(self, action: Action, timing: str, indent: str) -> list[str]:
        """An action in an act's own form, in our namespace."""
        timing = f" {timing}" if timing else ""
        if len(action.calls) == 1:
            return _own_call(action.calls[0], timing, indent)
        calls = [line for call in action.calls for line in _own_call(call, "", f"{indent}  ")]
        return [f"{indent}<rise:Variants{timing}>", *calls, f"{indent}</rise:Variants>"]

    def constraint(self, action: Action) -> list[str]:
        """Write the constraint for an action that waits for several: not before the end of any of them."""
        sync = f'<sync ref="{self.ids[action.id]}:start"/>'
        relations = [f'    <after ref="{self.ids[each]}:end">{sync}</after>' for each in action.wait_for]
        return ["  <constraint>", *relations, "  </constraint>"]


def _own_call(call: ActionCall, timing: str, indent: str) -> list[str]:
    parameters = [
        f"{indent}  <rise:{name}>{escape(template.text, _SAFE)}</rise:{name}>"
        for name, template in call.parameters.items()
    ]
    return [f"{indent}<rise:{call.type}{timing}>", *parameters, f"{indent}</rise:{call.type}>"]


def _with_namespace(ssml: str) -> str:
    """Return SSML with its own namespace if it names none; otherwise it would be in BML's."""
    head, bracket, rest = ssml.partition(">")
    return ssml if "xmlns" in head else f'{head[:6]} xmlns="{_SSML_NAMESPACE}"{head[6:]}{bracket}{rest}'


def _make_ids(names: Iterable[str]) -> dict[str, str]:
    """Make valid XML ids for times, by the names that they stand for."""
    found: dict[str, str] = {}
    for name in names:
        plain = name if _ID.fullmatch(name) else "a" + _NOT_IN_ID.sub("_", name)
        taken = {*found.values()}
        found[name] = next(id for n in range(1, 100_000) if (id := plain if n == 1 else f"{plain}_{n}") not in taken)
    return found


def _quote(value: str) -> str:
    return quoteattr(value, _SAFE)


def act_file_text(act: Act, origin: str) -> str:
    """Return the text of a file with one act.

    :param origin: the name of its source file.
    """
    lines = [
        f"<!-- Made from {origin.replace('--', '- -').rstrip('-')} (BML 1.0). -->",
        f"<Dialog name={quoteattr(act.name)}>",
    ]
    for action in act.actions:
        lines += _action_lines(action)
    return "\n".join((*lines, "</Dialog>", ""))


def calling_type_setting(act: str) -> str:
    """Return the table of scenario.toml for an act that does not wait for others."""
    return f'\n[act.{toml_key(act)}]\ncalling_type = "None"\n'


def _action_lines(action: Action) -> Iterator[str]:
    common = [f"<actionID>{escape(action.id)}</actionID>"]
    if action.wait_for:
        common.append(f"<waitForActions>{escape(', '.join(action.wait_for))}</waitForActions>")
    if action.continue_on_failure:
        common.append("<onFailure>continue</onFailure>")
    yield ""
    if len(action.calls) == 1:
        call = action.calls[0]
        yield from _element_lines(call.type, [*common, *_parameter_lines(call)], "  ")
        return
    variants = [f"<{call.type}>{''.join(_parameter_lines(call))}</{call.type}>" for call in action.calls]
    yield from _element_lines("Variants", [*common, *variants], "  ")


def _element_lines(tag: str, lines: list[str], indent: str) -> list[str]:
    return [f"{indent}<{tag}>", *(f"{indent}  {line}" for line in lines), f"{indent}</{tag}>"]


def _parameter_lines(call: ActionCall) -> list[str]:
    return [
        f"<{name}>{template.text if begins_as_ssml(template.text) else escape(template.text)}</{name}>"
        for name, template in call.parameters.items()
    ]

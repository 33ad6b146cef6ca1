"""The notes that an editor shows about the text under the mouse or the cursor."""

from __future__ import annotations

import re
from collections.abc import Iterator

from rise_engine.author.lsp.served_study import ServedStudy
from rise_engine.base.json_codec import encode
from rise_engine.base.text import pluralize
from rise_engine.expression import Expression, ExpressionError
from rise_engine.expression.functions import SITUATION_SIGNATURES
from rise_engine.scenario.checking.uses import Use
from rise_engine.scenario.model import Parameter
from rise_engine.scenario.parameters import listed_names
from rise_engine.scenario.reading.explore_tables import PROPERTY_TABLES
from rise_engine.scenario.settings import ANY, SCENARIO_TABLES, setting_at, table_at
from rise_engine.syntax.toml import KEY_PART

_HEADER = re.compile(r"^[ \t]*\[([^\]\n]*)\]", re.MULTILINE)


def table_path(before: str) -> tuple[str, ...]:
    """Return the path of the table at the end of a text. Empty: the top of the file.

    >>> table_path('[explore]\\nfaults = 1\\n[eventually."it ends"]\\nthen')
    ('eventually', 'it ends')
    """
    headers = _HEADER.findall(before)
    return tuple(part.strip("\"'") for part in KEY_PART.findall(headers[-1])) if headers else ()


def opened_text(line: str) -> int | None:
    """Return the start of the text that is still open at the end of a line; None: there is none.

    >>> opened_text("a = \\"runs('R_"), opened_text("a = 'b' # \\"")
    (4, None)
    """
    at, opened = 0, None
    while at < len(line):
        character = line[at]
        if opened is None:
            if character == "#":
                return None
            if character in "\"'":
                opened = at
        elif character == "\\" and line[opened] == '"':
            at += 1
        elif character == line[opened]:
            opened = None
        at += 1
    return opened


# --- scenario.toml ----------------------------------------------------------------------------------------------------


_ENTRY = re.compile(r"([\w-]+)\s*=")
_CALL = re.compile(r"\b(in|rule|runs|waits)\s*\(")
_TEXT = re.compile(r""""([^"\\]*)"|'([^']*)'""")


def setting_notes(text: str, offset: int) -> Iterator[str]:
    """Yield notes in Markdown about a place of scenario.toml, apart from the names there."""
    start = text.rfind("\n", 0, offset) + 1
    line, column = text[start:].partition("\n")[0], offset - start
    if (header := _HEADER.match(line)) is not None and column <= header.end():
        if (table := table_at(SCENARIO_TABLES, table_path(line))) is not None:
            yield f"**{header.group().strip()}**: {table.meaning}"
        return
    path = table_path(text[:start])
    opened = opened_text(line[:column])
    if opened is None:
        for found in _ENTRY.finditer(line):
            if found.start() <= column <= found.end(1):
                yield from _setting_note(path, found.group(1))
    elif path[:1] and path[0] in PROPERTY_TABLES and line[:opened].rstrip().endswith("="):
        for found in _CALL.finditer(line, opened):
            signature = next(each for each in SITUATION_SIGNATURES if each.name == found.group(1))
            if found.start() <= column <= found.end(1):
                yield f"{signature.usage}: {signature.meaning}"
        if (whole := _TEXT.match(line, opened)) is not None:
            yield from _reading(whole.group(1) if whole.group(1) is not None else whole.group(2))


def _setting_note(path: tuple[str, ...], name: str) -> Iterator[str]:
    """Yield the meaning of an entry of a table, or of an inline table in it."""
    for inside in ((), (ANY,)):
        if (setting := setting_at(SCENARIO_TABLES, (*path, *inside, name))) is not None:
            usual = f" (default: {setting.usual})" if setting.usual else ""
            yield f"**{name}**: {setting.meaning}{usual}"
            return


def _reading(written: str) -> Iterator[str]:
    """Yield the program's reading of a property's condition."""
    try:
        yield f"read as `{Expression.parse_property(written).with_all_brackets}`"
    except ExpressionError:
        return


# --- all files --------------------------------------------------------------------------------------------------------


_ELEMENT = re.compile(r"</?([\w.:-]+)")
_CONDITION = re.compile(r"""\s(?:cond|while)\s*=\s*(?:"([^"<]*)"|'([^'<]*)')""")
_ENTITIES = {"&lt;": "<", "&gt;": ">", "&quot;": '"', "&apos;": "'", "&amp;": "&"}
_MAX_TEXTS, _LONGEST = 4, 200


def hover_text(study: ServedStudy, name: str, offset: int) -> str:
    """Return the note in Markdown; empty: there is none."""
    source = study.source(name)
    if source is None:
        return ""
    use = study.use_at(name, offset)
    parts = [_describe_use(study, use)] if use is not None else []
    line_start = source.text.rfind("\n", 0, offset) + 1
    line = source.text[line_start : source.text.find("\n", offset) + 1 or None]
    if name.lower().endswith(".xml"):
        for found in _CONDITION.finditer(line):
            if found.start() <= offset - line_start <= found.end():
                parts.append(_describe_condition(found.group(1) if found.group(1) is not None else found.group(2)))
        for found in _ELEMENT.finditer(line):
            if found.start() <= offset - line_start <= found.end():
                parts.append(_describe_element(study, found.group(1)))
    elif name.lower().endswith(".toml"):
        parts += setting_notes(source.text, offset)
    return "\n\n".join(part for part in parts if part)


def _describe_use(study: ServedStudy, use: Use) -> str:
    draft = study.checked.draft
    count = sum(not each.defines for each in study.uses_like(use))
    lines = [f"**{use.name}** ({use.kind}), named in {pluralize(count, 'place')}"]
    if use.kind == "act" and (act := draft.acts.get(use.name)) is not None:
        lines[0] += f", {pluralize(len(act.actions), 'action')}"
        calls = [call for action in act.actions for call in action.calls]
        texts = [call.parameters["message"].text for call in calls if "message" in call.parameters]
        lines += [f"> {text[:_LONGEST]}" for text in texts[:_MAX_TEXTS]]
    elif use.kind == "rule" and (rule := draft.rules.get(use.name)) is not None:
        lines[0] += f", {pluralize(len(rule.states), 'state')}, begins in {rule.initial}"
    elif use.kind == "key" and use.name in draft.memory:
        lines.append(f"start value: `{encode(draft.memory[use.name]).decode()[:_LONGEST]}`")
    return "\n\n".join(lines)


def _describe_condition(written: str) -> str:
    """Return the program's reading of a rule's condition."""
    text = re.sub(r"&\w+;", lambda found: _ENTITIES.get(found.group(), found.group()), written)
    try:
        return f"read as `{Expression.parse(text).with_all_brackets}`"
    except ExpressionError:
        return ""


def _describe_element(study: ServedStudy, tag: str) -> str:
    """Return the purpose of an action or a parameter."""
    actions = study.checked.robot.actions
    if (spec := actions.get(tag)) is not None:
        return f"**{tag}**: {spec.help}" if spec.help else ""
    parameters = {encode(each): each for spec in actions.values() for each in [spec.parameters.get(tag)] if each}
    return "\n\n".join(_describe_parameter(each) for each in list(parameters.values())[:3])


def _describe_parameter(parameter: Parameter) -> str:
    limits = [
        f"{word} {limit:g}"
        for word, limit in (("from", parameter.minimum), ("to", parameter.maximum))
        if limit is not None
    ]
    names = f": {', '.join(listed_names(parameter)[:12])}" if parameter.type == "name" else ""
    about = " ".join(filter(None, (parameter.type + names, parameter.unit, *limits)))
    return f"**{parameter.name}** ({about}): {parameter.help}".rstrip(": ")

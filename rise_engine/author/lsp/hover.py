"""What is told about a thing under the mouse, or under the cursor."""

from __future__ import annotations

import re

from rise_engine.author.lsp.explore_hover import explore_notes
from rise_engine.author.lsp.served_study import ServedStudy
from rise_engine.base.json_codec import encode
from rise_engine.base.text import pluralize
from rise_engine.expression import Expression, ExpressionError
from rise_engine.scenario.model import Parameter
from rise_engine.scenario.parameters import listed_names
from rise_engine.scenario.uses import Use

_ELEMENT = re.compile(r"</?([\w.:-]+)")
_CONDITION = re.compile(r"""\s(?:cond|while)\s*=\s*(?:"([^"<]*)"|'([^'<]*)')""")
_ENTITIES = {"&lt;": "<", "&gt;": ">", "&quot;": '"', "&apos;": "'", "&amp;": "&"}
_MOST_TEXTS, _LONGEST = 4, 200


def hover_text(study: ServedStudy, name: str, offset: int) -> str:
    """In Markdown; empty: nothing."""
    source = study.source(name)
    if source is None:
        return ""
    use = study.use_at(name, offset)
    parts = [_of_use(study, use)] if use is not None else []
    line_start = source.text.rfind("\n", 0, offset) + 1
    line = source.text[line_start : source.text.find("\n", offset) + 1 or None]
    if name.lower().endswith(".xml"):
        for found in _CONDITION.finditer(line):
            if found.start() <= offset - line_start <= found.end():
                parts.append(_of_condition(found.group(1) if found.group(1) is not None else found.group(2)))
        for found in _ELEMENT.finditer(line):
            if found.start() <= offset - line_start <= found.end():
                parts.append(_of_element(study, found.group(1)))
    elif name.lower().endswith(".toml"):
        parts += explore_notes(source.text, offset)
    return "\n\n".join(part for part in parts if part)


def _of_use(study: ServedStudy, use: Use) -> str:
    draft = study.checked.draft
    count = sum(not each.defines for each in study.uses_like(use))
    lines = [f"**{use.name}** ({use.kind}), named in {pluralize(count, 'place')}"]
    if use.kind == "act" and (act := draft.acts.get(use.name)) is not None:
        lines[0] += f", {pluralize(len(act.actions), 'action')}"
        calls = [call for action in act.actions for call in action.calls]
        texts = [call.parameters["message"].text for call in calls if "message" in call.parameters]
        lines += [f"> {text[:_LONGEST]}" for text in texts[:_MOST_TEXTS]]
    elif use.kind == "rule" and (rule := draft.rules.get(use.name)) is not None:
        lines[0] += f", {pluralize(len(rule.states), 'state')}, begins in {rule.initial}"
    elif use.kind == "key" and use.name in draft.memory:
        lines.append(f"start value: `{encode(draft.memory[use.name]).decode()[:_LONGEST]}`")
    return "\n\n".join(lines)


def _of_condition(written: str) -> str:
    """How a condition is read."""
    text = re.sub(r"&\w+;", lambda found: _ENTITIES.get(found.group(), found.group()), written)
    try:
        return f"read as `{Expression.parse(text).with_all_brackets}`"
    except ExpressionError:
        return ""


def _of_element(study: ServedStudy, tag: str) -> str:
    """What an action or a parameter is for."""
    actions = study.checked.robot.actions
    if (spec := actions.get(tag)) is not None:
        return f"**{tag}**: {spec.help}" if spec.help else ""
    parameters = {encode(each): each for spec in actions.values() for each in [spec.parameters.get(tag)] if each}
    return "\n\n".join(_of_parameter(each) for each in list(parameters.values())[:3])


def _of_parameter(parameter: Parameter) -> str:
    limits = [
        f"{word} {limit:g}"
        for word, limit in (("from", parameter.minimum), ("to", parameter.maximum))
        if limit is not None
    ]
    names = f": {', '.join(listed_names(parameter)[:12])}" if parameter.type == "name" else ""
    about = " ".join(filter(None, (parameter.type + names, parameter.unit, *limits)))
    return f"**{parameter.name}** ({about}): {parameter.help}".rstrip(": ")

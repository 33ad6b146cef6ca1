"""Rules and acts as Mermaid diagrams (https://mermaid.js.org/syntax/stateDiagram.html)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rise_engine.author.drawing.pictures import call_text
from rise_engine.author.drawing.rule_text import transition_label
from rise_engine.author.drawing.state_graph import find_state_order
from rise_engine.base.text import clean
from rise_engine.scenario.model import Act, Action, Rule

_MERMAID_MARKS = {"#": "#35;", '"': "#quot;", ";": "#59;", ":": "#58;", "<": "#lt;", ">": "#gt;", "%": "#37;"}
"""Characters with a special meaning in Mermaid, and their replacements."""


def mermaid_of_rules(rules: Sequence[Rule]) -> str:
    """Draw a state diagram; several rules become composite states beside each other."""
    lines = ["stateDiagram-v2"]
    for number, rule in enumerate(rules):
        if len(rules) == 1:
            lines += [f"    %% rule {_mermaid(rule.name)}", *_mermaid_states(rule, "s", "    ")]
        else:
            inside = _mermaid_states(rule, f"r{number}s", "        ")
            lines += [f'    state "{_mermaid(rule.name)}" as r{number} {{', *inside, "    }"]
    return "\n".join(lines) + "\n"


def _mermaid_states(rule: Rule, prefix: str, indent: str) -> Iterator[str]:
    ids = {name: f"{prefix}{number}" for number, name in enumerate(find_state_order(rule).states)}
    for name, id in ids.items():
        yield f'{indent}state "{_mermaid(name)}" as {id}'
    yield f"{indent}[*] --> {ids[rule.initial]}"
    for name, id in ids.items():
        transitions = rule.states[name].transitions
        for transition in transitions:
            target = name if transition.target is None else transition.target
            stays = " (stays)" if transition.target is None else ""
            yield f"{indent}{id} --> {ids[target]} : {_mermaid(transition_label(transition, condition=True) + stays)}"
        if not transitions:
            yield f"{indent}{id} --> [*]"


def mermaid_of_acts(acts: Sequence[Act]) -> str:
    """Draw a flowchart from top to bottom; an arrow means "has to end before"."""
    lines = ["flowchart TD"]
    for number, act in enumerate(acts):
        ids = {action.id: f"a{number}_{index}" for index, action in enumerate(act.actions)}
        lines.append(f'    subgraph g{number} ["{_mermaid(act.name)}"]')
        lines += [f'        {ids[action.id]}["{_mermaid(action_text(action))}"]' for action in act.actions]
        for action in act.actions:
            lines += [f"        {ids[before]} --> {ids[action.id]}" for before in _waits(action, ids)]
        lines.append("    end")
    return "\n".join(lines) + "\n"


def _mermaid(text: str) -> str:
    return "".join(_MERMAID_MARKS.get(character, character) for character in clean(text))


def action_text(action: Action) -> str:
    """Describe an action for its box: its id, its type, and its words."""
    words = " / ".join(filter(None, map(call_text, action.calls)))
    types = " / ".join(dict.fromkeys(call.type for call in action.calls))
    return f"{action.id} {types}  {words}".strip()


def _waits(action: Action, known: dict[str, str]) -> Iterator[str]:
    return (before for before in dict.fromkeys(action.wait_for) if before in known)

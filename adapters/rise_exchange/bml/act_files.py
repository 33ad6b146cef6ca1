"""Writes acts that came from BML as files of a scenario."""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import escape, quoteattr

from rise_engine.scenario.model import Act, Action, ActionCall
from rise_engine.scenario.speech.ssml import begins_as_ssml
from rise_engine.syntax.toml import toml_key


def act_file_text(act: Act, origin: str) -> str:
    """The text of a file with one act.

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
    """The table of scenario.toml for an act that does not wait for others."""
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

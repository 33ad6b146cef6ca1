"""What an act says, changed where it is written; of an act made from a template, in its `<use>`."""

from __future__ import annotations

from rise_engine.author.edit.edits import AnyEdit, SetParameter, SetUseParameter
from rise_engine.author.edit.outline import Outline, WrittenValue
from rise_engine.author.edit.plan import EditRefused
from rise_engine.scenario.spoken_texts import SpokenText


def edit_of_original(text: SpokenText, said: str, outline: Outline) -> AnyEdit:
    """The edit after which the act says something else in the place of a text.

    :raises EditRefused: it is written in a way in which it can be changed in its file only.
    """
    act, written = outline.act(text.act), written_original(text, outline)
    if act is None or written is None:
        raise EditRefused("it cannot be found in the files")
    if written.parameter:
        use = next((each for each in outline.uses if each.node is written.node), None)
        if use is not None:
            return SetUseParameter(use.file, use.line, use.template, written.parameter, said)
    if reason := written.reason or act.reason:
        raise EditRefused(reason)
    return SetParameter(text.act, text.action.id, text.parameter, said, text.variant)


def written_original(text: SpokenText, outline: Outline) -> WrittenValue | None:
    """What stands in the file of its act for a text; None: it cannot be found there."""
    act = outline.act(text.act)
    action = next((each for each in act.actions if each.id == text.action.id), None) if act is not None else None
    if action is None or text.variant >= len(action.calls):
        return None
    return action.calls[text.variant].parameters.get(text.parameter)

"""Notes the keys that conditions and assignments read and set."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial

from rise_engine.base.typography import typography_problem
from rise_engine.expression import Assignment, Expression, ExpressionError
from rise_engine.expression.key_places import keys_in_expression, names_in_property
from rise_engine.expression.nodes import Defined, walk
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import Mention, PartMention, ScenarioDraft, StateMention
from rise_engine.scenario.model import SourceLocation

_PIECE = re.compile(r""" "(?:[^"\\]|\\.)*+" | '(?:[^'\\]|\\.)*+' | ([^\S\ \t\r\n]) """, re.VERBOSE | re.DOTALL)
UNREADABLE_CONDITION = Expression.parse("false")
"""Replaces an unreadable condition. Its scenario is refused anyway."""


def expression_message(error: ExpressionError) -> str:
    """The message and the remedy, without the column (the diagnostic has the location)."""
    return f"{error.message}; {error.hint}" if error.hint else error.message


def note_expression(
    expression: Expression,
    locate: partial[SourceLocation],
    draft: ScenarioDraft,
    diagnostics: Diagnostics,
) -> None:
    """Note the keys that a condition reads, and warn of characters that only look like blanks.

    :param locate: returns the location of the condition, or of a character in it by its index.
    """
    _note_reads(expression, locate, draft)
    blank = _find_unusual_space(expression.text)
    if blank >= 0:
        sentence = typography_problem(expression.text, blank)
        diagnostics.warning("odd-blank", locate(blank), f"{sentence} (RISE does not take it for one)")


def _find_unusual_space(text: str) -> int:
    """The offset of the first character outside texts that only looks like a blank; -1: none."""
    if text.isascii():
        return -1
    return next((found.start() for found in _PIECE.finditer(text) if found.group(1)), -1)


def note_assignment(assignment: Assignment, locate: Callable[[], SourceLocation], draft: ScenarioDraft) -> None:
    """Note the key that an assignment sets and the keys that it reads."""
    if assignment.target is None:
        draft.settable_keys.add(assignment.key)
        draft.key_writes.append(Mention(assignment.key, locate))
    else:
        draft.part_writes.append(Mention(assignment.key, locate))
        for index in assignment.target.parts:
            if index is not assignment.target.root:
                draft.part_reads.append(PartMention(index, locate))
        for key in assignment.target.keys:
            draft.key_reads.append(Mention(key, locate))
    word = assignment.bare_word
    if word is not None:
        draft.bare_words.append(Mention(word, locate))
        return
    if assignment.expression is not None:
        _note_reads(assignment.expression, locate, draft)


def note_property(expression: Expression, locate: Callable[[int], SourceLocation], draft: ScenarioDraft) -> None:
    """Note the keys, rules, states and acts in a property of a study.

    :param locate: returns the location of a character in it by its index.
    """
    places: dict[str, int] = {}
    for place in keys_in_expression(expression.text):
        places.setdefault(place.key, place.start)
    for key in expression.keys:
        mentions = draft.property_reads if key in expression.keys_read else draft.optional_key_reads
        mentions.append(Mention(key, partial(locate, places.get(key, 0))))
    _note_parts(expression, partial(locate, 0), draft)
    for asked in names_in_property(expression.text):
        locate_name = partial(locate, asked.start)
        if asked.kind == "state":
            draft.asked_states.append(StateMention(asked.name, locate_name, asked.rule))
        else:
            mentions = draft.act_mentions if asked.kind == "act" else draft.rule_mentions
            mentions.append(Mention(asked.name, locate_name))


def _note_reads(expression: Expression, locate: Callable[[], SourceLocation], draft: ScenarioDraft) -> None:
    """Note the keys, and the parts of values, that an expression reads."""
    values = expression.keys_read
    for key in expression.keys:
        (draft.key_reads if key in values else draft.optional_key_reads).append(Mention(key, locate))
    _note_parts(expression, locate, draft)


def _note_parts(expression: Expression, locate: Callable[[], SourceLocation], draft: ScenarioDraft) -> None:
    asked = {node.part for node, _ in walk(expression.root) if isinstance(node, Defined)} if expression.parts else ()
    draft.part_reads += [PartMention(part, locate) for part in expression.parts if part not in asked]

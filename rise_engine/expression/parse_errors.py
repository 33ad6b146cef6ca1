"""The parser's messages about probable mistakes, used only for incorrect expressions."""

from __future__ import annotations

import re
from collections.abc import Sequence

from rise_engine.base.nearest_name import Correction, nearest_name
from rise_engine.expression.errors import ExpressionError, shorten
from rise_engine.expression.functions import ANY_NUMBER_OF_ARGUMENTS, ARITY, SITUATION_ARITY, find_signature
from rise_engine.expression.nodes import Compare, with_all_brackets
from rise_engine.expression.tokens import RESERVED, Token

_TEXT_OPERATORS = {
    "startswith": "starts with",
    "starts_with": "starts with",
    "beginswith": "starts with",
    "endswith": "ends with",
    "ends_with": "ends with",
    "contain": "contains",
    "includes": "contains",
    "starts": "starts with",
    "ends": "ends with",
    "contains": "contains",
}
_OTHER_WORDS = {"is": "=", "equals": "=", "eq": "=", "ne": "!=", "mod": "floor", "none": "null"}


def is_reserved_in_wrong_case(word: str) -> bool:
    """Whether a word is a reserved word in the wrong case."""
    return word not in RESERVED and word.lower() in RESERVED


def wrong_case_error(text: str, token: Token) -> ExpressionError:
    """`AND`, `True`, ..."""
    word: str = token.value
    hint = f"write `{word.lower()}` in lower case"
    return ExpressionError(f"`{word}` is not known", text, token.start + 1, hint, Correction(word, word.lower()))


def too_deep_error(text: str, start: int) -> ExpressionError:
    """The error for brackets or operators that are nested too deeply."""
    return ExpressionError(
        "the expression is nested too deeply", text, start + 1, "split it: assign parts of it to keys of their own"
    )


def chained_comparison_error(text: str, first: Compare, following: Token) -> ExpressionError:
    """`1 < n < 10`."""
    left, right = with_all_brackets(first.left), with_all_brackets(first.right)
    again = f"{following.value} with" if following.value in ("starts", "ends") else following.value
    hint = f"join two comparisons by `and`: `{left} {first.operator} {right} and {right} {again} ...`"
    if first.operator in ("==", "!="):
        hint += f", or put the first in brackets: `({left} {first.operator} {right}) {again} ...`"
    return ExpressionError(
        "comparisons cannot be chained", text, following.start + 1, hint if len(hint) < 300 else "join them by `and`"
    )


def missing_operand_error(text: str, tokens: Sequence[Token], at: int) -> ExpressionError:
    """The error for a missing value at this token."""
    token = tokens[at]
    column = token.start + 1
    before = tokens[at - 1] if at else None
    if token.kind == "end":
        if before is None:
            return ExpressionError("the expression is empty", text, 1, "write a key, or `true`")
        return ExpressionError(f"something is missing after `{before.value}`", text, column)
    if before is not None and before.kind == "==" and token.kind in ("<", ">"):
        written = before.value + token.value
        return _wrong_operator(text, before.start, written, f"{token.kind}=")
    if token.kind == "+":
        hint = "it is allowed only before a literal number; omit it"
        return ExpressionError("`+` needs a value on its left", text, column, hint)
    if token.kind == "[":
        hint = "a list has to be a memory value; `range(3)` makes 0, 1, 2"
        return ExpressionError("`[` must follow a key or a function", text, column, hint)
    if token.kind == ")" and before is not None and before.kind == "(":
        return ExpressionError("there is nothing between the brackets", text, column)
    if token.kind == "," and before is not None and before.kind in (",", "("):
        return ExpressionError("an argument is missing", text, column)
    if token.kind == "/" and re.compile(r"/\w").match(text, token.start):
        hint = "an event topic is not allowed in a condition; a key is written without `/`"
        return ExpressionError("`/` needs a value on its left", text, column, hint)
    if before is None or before.kind in ("(", ","):
        return ExpressionError(f"`{token.value}` needs a value on its left", text, column)
    return ExpressionError(f"a value is missing between `{before.value}` and `{token.value}`", text, column)


def unclosed_bracket_error(text: str, tokens: Sequence[Token], at: int, opening: Token) -> ExpressionError:
    """The error for an unclosed bracket at this token: it is missing, or another token is in its place."""
    if tokens[at].kind == "end" or tokens[at].kind in (")", "]"):
        closing = {"(": ")", "[": "]"}[opening.kind]
        return ExpressionError("this bracket is not closed", text, opening.start + 1, f"add `{closing}`")
    return stray_token_error(text, tokens, at)


def stray_token_error(text: str, tokens: Sequence[Token], at: int) -> ExpressionError:
    """The error for a complete expression that is followed by a token other than an operator."""
    token = tokens[at]
    column = token.start + 1
    before = tokens[at - 1]
    shown = shorten(text[token.start : token.end], 40)
    if token.kind in (")", "]"):
        opening = "(" if token.kind == ")" else "["
        return ExpressionError("this bracket was never opened", text, column, f"remove it, or add `{opening}`")
    if token.kind == "[":
        return ExpressionError("`[` must follow a key or a function", text, column, "write `items[i].text`")
    if token.kind == "," and before.kind == "number" and tokens[at + 1].kind == "number":
        number = f"{text[before.start : before.end]}.{text[tokens[at + 1].start : tokens[at + 1].end]}"
        return ExpressionError("numbers have a point, not a comma", text, column, f"write `{number}`")
    if token.kind == ",":
        return ExpressionError("a comma separates the arguments of a function only", text, column)
    if token.kind == "word":
        word = token.value.lower()
        if is_reserved_in_wrong_case(token.value):
            return wrong_case_error(text, token)
        if meant := _TEXT_OPERATORS.get(word) or _OTHER_WORDS.get(word):
            return _wrong_operator(text, token.start, shown, meant)
        if word == "with" and before.value in ("starts", "ends"):
            return ExpressionError(
                f"`{before.value} with` needs a value on its left", text, before.start + 1, "write the key before it"
            )
        near = nearest_name(word, [*sorted(RESERVED - {"true", "false", "null"}), "contains"])
        if near and token.value != "with":
            hint = f"did you mean `{near}`?"
            return ExpressionError(f"`{shown}` is not an operator", text, column, hint, Correction(shown, near))
    if token.kind == "(" and before.kind in ("number", ")"):
        return ExpressionError("an operator is missing before the bracket", text, column, "a product needs its `*`")
    two_words = before.kind == "word" and token.kind == "word"
    hint = "put texts in quotes, and join conditions by `and` or `or`" if two_words else ""
    return ExpressionError(f"an operator is missing before `{shown}`", text, column, hint)


def _wrong_operator(text: str, start: int, written: str, meant: str) -> ExpressionError:
    return ExpressionError(
        f"`{written}` is not an operator", text, start + 1, f"write `{meant}`", Correction(written, meant)
    )


def unknown_function_error(text: str, token: Token, *, of_property: bool = False) -> ExpressionError:
    """The error for an unknown function before a bracket (RISE's parser would drop the name)."""
    name: str = token.value
    suggestion = None
    if is_reserved_in_wrong_case(name):
        return wrong_case_error(text, token)
    if name.lower() in _TEXT_OPERATORS:
        operator = _TEXT_OPERATORS[name.lower()]
        hint = f'`{operator}` belongs between two values: `key {operator} "text"`'
    else:
        known = ARITY | SITUATION_ARITY if of_property else ARITY
        near = nearest_name(name, known)
        hint = f"did you mean `{near}`?" if near else "the functions are " + ", ".join(sorted(known))
        suggestion = Correction(name, near) if near else None
    message = f"there is no function `{shorten(name, 40)}`"
    return ExpressionError(message, text, token.start + 1, hint, suggestion)


def situation_unknown_error(text: str, token: Token) -> ExpressionError:
    """`in('Main', 'Start')` outside a property of a study."""
    hint = "only [always], [reachable] and [eventually] in scenario.toml can ask for the situation"
    return ExpressionError(f"`{token.value}` cannot be asked here", text, token.start + 1, hint)


def situation_names_error(text: str, token: Token, wrong: Token) -> ExpressionError:
    """The error for `in(Main, Start)` or `runs()`: a name is missing, unquoted, or one too many."""
    known = find_signature(token.value)
    usage = known.usage if known is not None else ""
    if wrong.kind == "word":
        usage = f"`'{shorten(wrong.value, 40)}'`"
    return ExpressionError(f"`{token.value}` takes names in quotation marks", text, wrong.start + 1, f"write {usage}")


def argument_count_error(text: str, token: Token, given: int, arguments: Sequence[Token]) -> ExpressionError:
    """The error for a function with too few or too many arguments."""
    least, most = ARITY[token.value]
    wanted = (
        f"{least} or more" if most == ANY_NUMBER_OF_ARGUMENTS else str(least) if least == most else f"{least} or {most}"
    )
    plural = "" if wanted == "1" else "s"
    hint = ""
    for left, comma, right in zip(arguments, arguments[1:], arguments[2:], strict=False):
        adjacent = left.end == comma.start and comma.end == right.start
        if given > most and adjacent and (left.kind, comma.kind, right.kind) == ("number", ",", "number"):
            number = f"{text[left.start : left.end]}.{text[right.start : right.end]}"
            hint = f"numbers have a point, not a comma: write `{number}`"
    if not hint and (known := find_signature(token.value)) is not None:
        hint = f"write {known.usage}: {known.meaning.partition(';')[0].partition('. ')[0]}"
    return ExpressionError(f"`{token.value}` takes {wanted} argument{plural}, not {given}", text, token.start + 1, hint)

"""What is refused when it is parsed, where the mistake is, and what remedy the author is given."""

from __future__ import annotations

import pytest

from rise_engine.expression import EvaluationError, Expression, ExpressionError, LanguageError

# text, column, a part of the remedy (or of the message, where there is no remedy)
REFUSED = [
    ("", 1, "empty"),
    ("   ", 1, "empty"),
    ("()", 2, "nothing between the brackets"),
    ("(a", 1, "add `)`"),
    ("a and (b or (c)", 7, "add `)`"),
    ("a)", 2, "never opened"),
    ("(a) b", 5, "operator is missing"),
    ("b (a)", 1, "no function `b`"),
    ("(2)(3)", 4, "a product needs its `*`"),
    ("2(3)", 2, "a product needs its `*`"),
    ("2 3", 3, "operator is missing"),
    ("a b", 3, "put texts in quotes"),
    ("foo(7)", 1, "no function `foo`"),
    ("rnd(7)", 1, "did you mean `rand`?"),
    ("ABS(n)", 1, "did you mean `abs`?"),
    ("contains(name, 'x')", 1, "`contains` belongs between two values"),
    ("startsWith(name, 'x')", 1, "`starts with` belongs between two values"),
    ("2 +", 4, "missing after `+`"),
    ("/ 2", 1, "needs a value on its left"),
    ("/topic", 1, "event topic"),
    ("+a", 1, "omit it"),
    ("++5", 1, "omit it"),
    ("Gru\u0308n = 1", 4, "type it again as one character"),
    ("a" + ".a" * 64, 1, "more than 64 parts"),
    ("a &&", 5, "missing after `&&`"),
    ("&& a", 1, "needs a value on its left"),
    ("a and or b", 7, "between `and` and `or`"),
    ("a not b", 3, "operator is missing before `not`"),
    ("not", 4, "missing after `not`"),
    ("1 < n < 10", 7, "`1 < n and n < ...`"),
    ("n == 5 == true", 8, "`(n == 5) == ...`"),
    ("a != b == c", 8, "join two comparisons by `and`"),
    ("a == not b == c", 12, "join two comparisons by `and`"),
    ("a < b starts with c", 7, "join two comparisons by `and`"),
    ("a contains b > c", 14, "join two comparisons by `and`"),
    ("a AND b", 3, "write `and` in lower case"),
    ("a Or b", 3, "write `or` in lower case"),
    ("a == True", 6, "write `true` in lower case"),
    ("NOT a", 1, "write `not` in lower case"),
    ("NOT(a)", 1, "write `not` in lower case"),
    ("NULL", 1, "write `null` in lower case"),
    ("a adn b", 3, "did you mean `and`?"),
    ("name is 'x'", 6, "write `=`"),
    ("name startswith 'x'", 6, "write `starts with`"),
    ("name STARTS with 'x'", 6, "write `starts with`"),
    ("name starts 'x'", 13, "write `starts with`"),
    ("name ends", 10, "write `ends with`"),
    ("starts with 'x'", 1, "write the key before it"),
    ("name contain 'x'", 6, "write `contains`"),
    ("abs()", 1, "takes 1 argument, not 0"),
    ("abs(1, 2)", 1, "takes 1 argument, not 2"),
    ("abs(1,5)", 1, "write `1.5`"),
    ("pow(2)", 1, "takes 2 arguments, not 1"),
    ("rand()", 1, "takes 1 or 2 arguments, not 0"),
    ("min(1)", 1, "takes 2 or more arguments, not 1"),
    ("clamp(1, 2)", 1, "takes 3 arguments, not 2"),
    ("max(1,,2)", 7, "an argument is missing"),
    ("max(1; 2)", 6, "separate arguments by a comma"),
    ("max(1, 2", 4, "add `)`"),
    ("defined('a')", 9, "without quotes"),
    ("defined(a, b)", 9, "`defined` takes one key"),
    ("defined(", 9, "`defined` takes one key"),
    ("x > 0,5", 6, "write `0.5`"),
    ("a, b", 2, "separates the arguments"),
    ("5 % 3", 3, "n - 2 * floor(n / 2)"),
    ("a & b", 3, "write `and` or `&&`"),
    ("a | b", 3, "write `or` or `||`"),
    ("a === b", 3, "write `=` or `==`"),
    ("a !== b", 3, "write `!=`"),
    ("a =! b", 3, "write `!=`"),
    ("a <> b", 3, "write `!=`"),
    ("a => b", 3, "write `>=`"),
    ("a =< b", 3, "write `<=`"),
    ("a ** 2", 3, "write `^` for powers"),
    ("a ≥ b", 3, "write `>=`"),
    ("n² > 4", 2, "write `^2`"),
    ("a &amp;&amp; b", 3, "escape it once"),
    ("a &lt; b", 3, "escape it once"),
    ('name = "An', 8, 'add " at its end'),
    ("name = 'An", 8, "add ' at its end"),
    ("name = “An”", 8, "straight quotes"),
    ("name = 'a\\x'", 10, "write `\\\\` for a backslash"),
    ("name = '\\ud800'", 8, "half a character"),
    ("3x > 1", 1, "a key begins with a letter"),
    ("1.2.3", 1, "neither a number nor a key"),
    ("1e999", 1, "too large"),
    ("{key}", 1, "write the key alone"),
    ("list[0", 5, "add `]`"),
    ("list[0)", 5, "add `]`"),
    ("list[]", 5, "there is nothing between `[` and `]`"),
    ("list]", 5, "add `[`"),
    ("[1]", 1, "must follow a key or a function"),
    ("n = [1]", 5, "must follow a key or a function"),
    ("(list)[0]", 7, "write `items[i].text`"),
    ("'text'[0]", 7, "must follow a key or a function"),
    ("list.[0]", 5, "write `list[`"),
    ("list[0].", 8, "a name follows a dot"),
    ("list[0] .a", 9, "a name follows a dot"),
    ("list[0]" + ".a" * 63, 1, "more than 64 parts"),
    ("list[0].a²", 10, "has no meaning here"),
    ("defined(list[0)", 13, "add `]`"),
    ("shuffle()", 1, "write `shuffle(list)`"),
    ("range(1, 2, 3)", 1, "takes 1 or 2 arguments, not 3"),
    ("a\u200bb", 2, "U+200B"),
    ("a ? b : c", 3, "`if` and `else`"),
    ("(" * 1000 + "a" + ")" * 1000, 251, "split it"),
    ("not " * 1000 + "a", 1001, "split it"),
    ("2^" * 5000 + "2", 501, "split it"),
    ("(1+" * 120 + "1" + ")" * 120, 1, "split it"),
    ("a" * 100_001, 1, "longer than 100,000 characters"),
]


@pytest.mark.parametrize(("text", "column", "part"), REFUSED, ids=[text[:30] for text, _, _ in REFUSED])
def test_refused(text: str, column: int, part: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        Expression.parse(text)
    error = caught.value
    assert part in str(error)
    assert error.column == column
    assert text.startswith(error.text)
    assert error.message in str(error)
    assert error.hint in str(error)
    assert isinstance(error, LanguageError)


def test_as_deep_as_allowed() -> None:
    assert Expression.parse("(" * 200 + "a" + ")" * 200).bare_key == "a"
    deep = Expression.parse("not " * 99 + "a")
    assert deep.as_condition({"a": 0}) is True
    assert Expression.parse(deep.with_all_brackets).as_condition({"a": 0}) is True


def test_text_comparisons_do_not_chain() -> None:
    with pytest.raises(ExpressionError, match="a starts with b and b starts with"):
        Expression.parse("a starts with b starts with c")


def test_errors_do_not_repeat_themselves() -> None:
    for text in ("a > 5", "a>5", "a contains 5"):
        with pytest.raises(EvaluationError) as error:
            Expression.parse(text).as_condition({"a": "t"})
        assert str(error.value).count("in `") == 1
    with pytest.raises(EvaluationError, match=r"\(in `b and a > 5`\)"):
        Expression.parse("b and a > 5").as_condition({"a": "t", "b": 1})

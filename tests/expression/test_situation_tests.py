"""`in`, `rule`, `runs` and `waits`: what only a property of a study can ask."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.expression import AskedSituation, Assignment, Environment, EvaluationError, Expression, ExpressionError
from rise_engine.expression.functions import ARITY, SITUATION_ARITY, SITUATION_SIGNATURES
from rise_engine.expression.key_places import keys_in_expression, names_in_property
from rise_engine.expression.nodes import SituationTest
from tests.expression.situation_tests import situation_tests

DOCS = Path(__file__).parents[2] / "docs/reference/conditions.md"


class Situation:
    """One that knows what it was asked."""

    def __init__(self, *true: str) -> None:
        self.true = true

    def in_state(self, rule: str, state: str) -> bool:
        return f"in {rule}/{state}" in self.true

    def rule_runs(self, rule: str) -> bool:
        return f"rule {rule}" in self.true

    def act_runs(self, act: str) -> bool:
        return f"runs {act}" in self.true

    def act_waits(self, act: str) -> bool:
        return f"waits {act}" in self.true


def holds(text: str, *true: str, **memory: object) -> bool:
    situation: AskedSituation = Situation(*true)
    return Expression.parse_property(text).compiled_condition(Environment(memory, situation=situation))


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        ("in('Main', 'Start')", "in Main/Start"),
        ('rule("Main")', "rule Main"),
        ("runs('R_Yes')", "runs R_Yes"),
        ("waits('R_Yes')", "waits R_Yes"),
        (r"in( 'It\'s' , 'a \"b\"' )", 'in It\'s/a "b"'),
    ],
)
def test_each_asks_the_situation(text: str, asked: str) -> None:
    assert holds(text, asked)
    assert not holds(text, "runs Other")
    assert holds(f"not {text}")


def test_they_stand_wherever_a_condition_can() -> None:
    assert holds("greeted and (in('A', 'B') or runs('C'))", "runs C", greeted=True)
    assert not holds("greeted and (in('A', 'B') or runs('C'))", greeted=True)
    assert holds("runs('A') + runs('B') = 2", "runs A", "runs B")
    assert holds("rule('A') = open", "rule A", open=True)
    assert Expression.parse_property("runs('A')").compiled_value(Environment({}, situation=Situation("runs A"))) is True


def test_a_memory_key_may_still_be_called_so() -> None:
    """As a name without brackets they are what they always were."""
    assert holds("in and runs and rule = 2 and runs('A')", "runs A", **{"in": True, "runs": True, "rule": 2})
    assert Expression.parse("waits > 1").as_condition({"waits": 2})


@pytest.mark.parametrize("name", SITUATION_ARITY)
def test_elsewhere_they_are_refused_with_the_place_where_they_may_stand(name: str) -> None:
    text = f"greeted and {name}('A')"
    for read in (Expression.parse, lambda each: Assignment.parse(f"x = {each}")):
        with pytest.raises(
            ExpressionError, match=r"\[always\], \[reachable\] and \[eventually\] in scenario.toml"
        ) as error:
            read(text)
        assert error.value.message == f"`{name}` cannot be asked here"
    with pytest.raises(ExpressionError) as error:
        Expression.parse(text)
    assert error.value.column == text.index(name) + 1


@pytest.mark.parametrize(
    ("text", "column", "hint"),
    [
        ("in('Main')", 10, ""),
        ("in('Main', 'Start', 'End')", 19, ""),
        ("in(Main, Start)", 4, "'Main'"),
        ("in('Main', state)", 12, "'state'"),
        ("in('Main' 'Start')", 11, ""),
        ("rule()", 6, ""),
        ("rule('')", 6, ""),
        ("rule('A' + 'B')", 10, ""),
        ("runs('A', 'B')", 9, ""),
        ("runs(3)", 6, ""),
        ("waits(", 7, ""),
    ],
)
def test_names_are_written_out(text: str, column: int, hint: str) -> None:
    with pytest.raises(ExpressionError) as error:
        Expression.parse_property(f"x or {text}")
    name = text.partition("(")[0]
    usage = next(each.usage for each in SITUATION_SIGNATURES if each.name == name)
    assert (error.value.message, error.value.column) == (f"`{name}` takes names in quotation marks", 5 + column)
    assert error.value.hint == f"write {f'`{hint}`' if hint else usage}"


def test_an_open_bracket_is_told_as_one() -> None:
    with pytest.raises(ExpressionError, match="this bracket is not closed") as error:
        Expression.parse_property("x or in('A', 'B'")
    assert error.value.column == 8


def test_a_slip_names_the_nearest_function() -> None:
    with pytest.raises(ExpressionError, match="did you mean `waits`"):
        Expression.parse_property("wait('A')")


def test_without_a_situation_they_are_an_evaluation_error() -> None:
    with pytest.raises(EvaluationError, match="there is no situation here"):
        Expression.parse_property("runs('A')").as_condition({})


def test_what_it_asks_and_reads() -> None:
    expression = Expression.parse_property("not (greeted and in('A', 'B')) or max(runs('C'), n) > 1")
    assert expression.keys == {"greeted", "n"}
    assert set(situation_tests(expression)) == {SituationTest("in", ("A", "B")), SituationTest("runs", ("C",))}
    assert situation_tests(Expression.parse("greeted")) == []
    again = Expression.parse_property(expression.with_all_brackets)
    assert again.with_all_brackets == expression.with_all_brackets


def test_where_the_names_stand() -> None:
    text = r"""runs ( "R_Yes" ) and in('It\'s', 'Start') and not rule('Main') and rule"""
    places = {(each.kind, each.name, text[each.start : each.start + each.length]) for each in names_in_property(text)}
    assert places == {
        ("act", "R_Yes", "R_Yes"),
        ("rule", "It's", r"It\'s"),
        ("state", "Start", "Start"),
        ("rule", "Main", "Main"),
    }
    assert [each.rule for each in names_in_property(text) if each.kind == "state"] == ["It's"]
    assert [(each.key, each.start) for each in keys_in_expression(text)] == [("rule", text.rindex("rule"))]
    assert [*names_in_property("runs('A') and")] == []


def test_the_documentation_has_the_same_table() -> None:
    rows = [f"| {each.usage} | {each.meaning} | `{each.example}` |" for each in SITUATION_SIGNATURES]
    assert "\n".join(("| function | gives | example |", "|---|---|---|", *rows)) in DOCS.read_text("utf-8")


def test_each_has_a_signature_and_none_is_a_function_of_conditions() -> None:
    assert [each.name for each in SITUATION_SIGNATURES] == [*SITUATION_ARITY]
    assert not SITUATION_ARITY.keys() & ARITY.keys()
    for each in SITUATION_SIGNATURES:
        assert situation_tests(Expression.parse_property(each.example))
        for written in each.written:
            assert len(situation_tests(Expression.parse_property(written))[0].names) == SITUATION_ARITY[each.name]

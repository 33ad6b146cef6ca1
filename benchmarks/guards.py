"""Conditions: evaluations and parses per CPU second, compared with an unchecked Python function."""

from __future__ import annotations

import sys

from measure import Report, interleave

from rise_engine.expression import Environment, Expression

TEXT = '(H_score > 3 and name starts with "An") or not finished'
COUNT = 200_000
PARSES = 2_000


def main() -> bool:
    memory = {"H_score": 4, "name": "Andre", "finished": True}
    env = Environment(memory, lambda: 0.5, set())
    condition = Expression.parse(TEXT).compiled_condition

    def floor(memory: dict[str, object]) -> bool:
        return (memory["H_score"] > 3 and memory["name"].startswith("An")) or not memory["finished"]  # type: ignore[operator, attr-defined, no-any-return]

    assert condition(env) is floor(memory) is True

    def evaluate() -> None:
        for _ in range(COUNT):
            condition(env)

    def plain() -> None:
        for _ in range(COUNT):
            floor(memory)

    def parse() -> None:
        for n in range(PARSES):
            Expression.parse(f'(H_score > {n} and name starts with "An") or not finished')

    figures = interleave(
        {
            "condition, checked types and missing keys": (evaluate, COUNT),
            "Python function (floor)": (plain, COUNT),
            "parse and compile": (parse, PARSES),
        }
    )
    report = Report(f"Guards: {TEXT}")
    for name, figure in figures.items():
        report.row(name, f"{figure.per_second:,.0f}/s")
    mine, plain_seconds, _ = (figure.median for figure in figures.values())
    report.row("times the floor", f"{mine / plain_seconds:.1f}")
    report.target("million evaluations per second", 1e-6 / mine, 1, at_least=True)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())

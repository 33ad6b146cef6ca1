"""The cost of an event and the memory of a running rule, with a thousand running rules.

Routing must not cost more: this is the row with 999 waiting rules. If all rules take events in turn, the row also shows
that the processor's caches contain one rule and not a thousand.
"""

from __future__ import annotations

import gc
import sys
import tracemalloc
from collections.abc import Callable

from kernel_events import EVENTS, ours, scenario
from measure import Report, interleave

from rise_engine.expression import Expression
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import SessionStarted, Submit
from rise_engine.scenario.model import Delay, Json, RobotProfile, Rule, Scenario, State, Transition

RULES = 1_000


def held(rules: int) -> Callable[[], None]:
    """Changes of one key, for which one rule checks a held condition, while `rules` others wait for their own."""
    made = {}
    for n in range(rules):
        way = Transition(after=Delay("8s", 8.0), held=Expression.parse(f"quiet_{n}"), target="Prompt")
        back = Transition("back", target="Listen")
        made[f"R{n}"] = Rule(
            f"R{n}", "Listen", {"Listen": State("Listen", (), (), (way,)), "Prompt": State("Prompt", (), (), (back,))}
        )
    robot = RobotProfile("none", "none", "none", {})
    start: dict[str, Json] = {f"quiet_{n}": False for n in range(rules)}
    kernel = Kernel(Scenario("held", "/", "debug", robot, {}, made, start, topics=frozenset({"back"})), 1)
    kernel.handle(SessionStarted())
    for n in range(rules):
        kernel.handle(Submit(function="startInteractionRule", behavior=f"R{n}", source="file"))

    def run() -> None:
        for n in range(EVENTS):
            value = "false" if n % 2 else "true"
            kernel.handle(Submit(function="assignValue", behavior=f"quiet_0 = {value}", source="file"))

    return run


def kib_per_running_rule() -> float:
    """The memory of starting one more rule, without the scenario and its compiled form."""
    kernel = Kernel(scenario(RULES, same_topic=False), 1)
    kernel.handle(SessionStarted())
    gc.collect()
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for n in range(RULES):
        kernel.handle(Submit(function="startInteractionRule", behavior=f"R{n}", source="file"))
    gc.collect()
    used = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    return used / RULES / 1024


def main() -> bool:
    figures = interleave(
        {
            "1 rule": (ours(1)[1], EVENTS),
            f"{RULES} rules on their own topics, events for one": (ours(RULES, same_topic=False, used=1)[1], EVENTS),
            f"{RULES} rules on their own topics, in turn": (ours(RULES, same_topic=False)[1], EVENTS),
            f"{RULES} rules, all on one topic": (ours(RULES, same_topic=True)[1], EVENTS),
            "1 rule, changes of what must hold": (held(1), EVENTS),
            f"{RULES} rules with `while`, changes for one": (held(RULES), EVENTS),
        }
    )
    report = Report("Events with many running rules")
    for name, figure in figures.items():
        report.row(name, f"{figure.per_second:,.0f} events/s")
    one, routed, apart, together, one_held, held_by_one = (figure.median for figure in figures.values())
    report.target("slower when 999 others wait elsewhere", routed / one, 1.3, at_least=False)
    report.target("slower with events for all 1,000 in turn", apart / one, 1.3, at_least=False)
    report.target("slower with 1,000 on the same topic", together / one, 1.3, at_least=False)
    report.target("slower with 999 other `while`", held_by_one / one_held, 1.3, at_least=False)
    report.target("KiB per running rule", kib_per_running_rule(), 4, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())

"""Does an event cost more when a thousand rules run? And what does a running rule weigh?

Routing must not: that is the row in which 999 others wait. When all take events in turn, it shows as well that the
processor's caches hold one rule and not a thousand.
"""

from __future__ import annotations

import gc
import sys
import tracemalloc

from kernel_events import EVENTS, ours, scenario
from measure import Report, interleave

from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import SessionStarted, Submit

RULES = 1_000


def kib_per_running_rule() -> float:
    """Memory that starting one more rule takes, the scenario itself and its compiled form not counted."""
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
        }
    )
    report = Report("Events with many running rules")
    for name, figure in figures.items():
        report.row(name, f"{figure.per_second:,.0f} events/s")
    one, routed, apart, together = (figure.median for figure in figures.values())
    report.target("slower when 999 others wait elsewhere", routed / one, 1.3, at_least=False)
    report.target("slower with events for all 1,000 in turn", apart / one, 1.3, at_least=False)
    report.target("slower with 1,000 on the same topic", together / one, 1.3, at_least=False)
    report.target("KiB per running rule", kib_per_running_rule(), 4, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())

"""A kernel that is restored from a snapshot, again and again.

`Kernel.restore` makes a new kernel, and compiling its rules is nine tenths of what a step of exploring would cost. So
one kernel is emptied instead, and told to restore itself; the tests prove that nothing is left over in it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from rise_engine.kernel import Kernel
from rise_engine.kernel.compiled_rules import CompiledRule
from rise_engine.kernel.snapshot import Snapshot
from rise_engine.scenario.model import Scenario

Restore: TypeAlias = Callable[[Snapshot], Kernel]


def restoring_anew(scenario: Scenario) -> Restore:
    """A new kernel each time."""
    return lambda snapshot: Kernel.restore(scenario, snapshot)


def restoring_in_place(scenario: Scenario) -> Restore:
    """The same kernel each time: what is done with it must be done before the next."""
    kernel = Kernel(scenario, seed=0)

    def restore(snapshot: Snapshot) -> Kernel:
        _empty(kernel)
        kernel._restore(snapshot.copy())
        return kernel

    return restore


def _empty(kernel: Kernel) -> None:
    """Take out all that `Kernel._restore` adds to, and what an input has left."""
    core, rules = kernel.core, kernel.rules
    rules_made_ready: dict[str, CompiledRule] = vars(rules).get("compiled") or vars(rules)["compiled"]
    for compiled in rules_made_ready.values():
        for state in compiled.states.values():
            for some in (*state.wait_lists, *state.watch_lists):
                some.clear()
    rules.stack.clear()
    rules.stack.top = None
    rules.kept.clear()
    rules._frames.clear()
    rules._to_reevaluate.clear()
    core.events.clear()
    core.memory.clear()
    core.memory.update(core.scenario.table_memory)
    core.env.parts = None
    if core.env.missing is not None:
        core.env.missing.clear()

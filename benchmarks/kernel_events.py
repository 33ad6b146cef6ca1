"""Events per CPU second through the kernel, compared with the usual state machine libraries.

One event is the loop of the paper's listing 2: an external event, a transition, a condition on a memory value, an
internal event raised by the entered state, a second transition. All engines do the same; only ours also submits the
event as a DomainTask and writes its seven records.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from measure import Report, interleave

from rise_engine.expression import Expression
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import SessionStarted, Submit
from rise_engine.scenario.model import Branch, Function, If, RobotProfile, Rule, Scenario, State, Transition

EVENTS = 20_000
XSTATE = "5.33.3"


def scenario(rules: int = 1, same_topic: bool = True) -> Scenario:
    """`rules` copies of the loop, on one topic or on a topic each."""
    made = {}
    topics = set()
    for n in range(rules):
        suffix = "" if same_topic else f"_{n}"
        again, nobody = f"R_RequestInteraction_end{suffix}", f"H_no_interaction{suffix}"
        topics |= {again, nobody}
        entry = If(
            (
                Branch(Expression.parse("H_interaction_detected"), (Function("raiseEventTopic", "/H_interaction"),)),
                Branch(None, (Function("raiseEventTopic", f"/{nobody}"),)),
            )
        )
        made[f"R{n}"] = Rule(
            f"R{n}",
            "State 3",
            {
                "State 2": State("State 2", (entry,), (), (Transition(nobody, None, None, "State 3"),)),
                "State 3": State("State 3", (), (), (Transition(again, None, None, "State 2"),)),
            },
        )
    robot = RobotProfile("none", "none", "none", {})
    return Scenario("bench", "/", "debug", robot, {}, made, {"H_interaction_detected": False}, topics=frozenset(topics))


def ours(rules: int = 1, same_topic: bool = True, used: int | None = None) -> tuple[Kernel, Callable[[], None]]:
    kernel = Kernel(scenario(rules, same_topic), 1)
    kernel.handle(SessionStarted())
    for n in range(rules):
        kernel.handle(Submit(function="startInteractionRule", behavior=f"R{n}", source="file"))
    topics = ["/R_RequestInteraction_end" + ("" if same_topic else f"_{n}") for n in range(used or rules)]

    def run() -> None:
        handle = kernel.handle
        count = len(topics)
        for n in range(EVENTS):
            handle(Submit(function="raiseEventTopic", behavior=topics[n % count], source="file"))

    return kernel, run


def with_transitions() -> Callable[[], None]:
    from transitions import Machine

    class Model:
        detected = False

        def on_enter_two(self) -> None:
            if self.detected:
                self.interaction()  # type: ignore[attr-defined]
            else:
                self.nobody()  # type: ignore[attr-defined]

    model = Model()
    machine = Machine(model, states=["two", "three"], initial="three", queued=True, auto_transitions=False)
    machine.add_transition("again", "three", "two")
    machine.add_transition("nobody", "two", "three")
    machine.add_transition("interaction", "two", "two")

    def run() -> None:
        for _ in range(EVENTS):
            model.again()  # type: ignore[attr-defined]

    return run


def with_statemachine(events: int) -> Callable[[], None]:
    from statemachine import State as PsmState
    from statemachine import StateMachine

    class Loop(StateMachine):
        two = PsmState()
        three = PsmState(initial=True)
        again = three.to(two)
        nobody = two.to(three)
        detected = False

        def on_enter_two(self) -> None:
            if not self.detected:
                self.send("nobody")

    machine = Loop()

    def run() -> None:
        for _ in range(events):
            machine.send("again")

    return run


def with_sismic(events: int) -> Callable[[], None]:
    from sismic.interpreter import Interpreter
    from sismic.io import import_from_yaml

    chart = import_from_yaml(
        """
statechart:
  name: loop
  preamble: detected = False
  root state:
    name: root
    initial: three
    states:
      - name: two
        on entry: |
          if not detected:
              send('nobody')
        transitions:
          - target: three
            event: nobody
      - name: three
        transitions:
          - target: two
            event: again
"""
    )
    interpreter = Interpreter(chart)
    interpreter.execute()

    def run() -> None:
        for _ in range(events):
            interpreter.queue("again")
            interpreter.execute()

    return run


XSTATE_PROGRAM = """
const { createMachine, createActor, raise } = require('xstate');
const machine = createMachine({
  initial: 'three', context: { detected: false },
  states: {
    two: { entry: [{ type: 'look' }], on: { nobody: 'three' } },
    three: { on: { again: 'two' } },
  },
}, { actions: { look: raise(({ context }) => ({ type: context.detected ? 'interaction' : 'nobody' })) } });
const actor = createActor(machine); actor.start();
const events = 20000, rounds = 7, seconds = [];
for (let r = 0; r < rounds; r++) {
  const start = process.cpuUsage();
  for (let n = 0; n < events; n++) actor.send({ type: 'again' });
  const used = process.cpuUsage(start);
  if (r >= 3) seconds.push((used.user + used.system) / 1e6 / events);
}
seconds.sort((a, b) => a - b);
console.log(JSON.stringify({ seconds: seconds[Math.floor(seconds.length / 2)], state: actor.getSnapshot().value }));
"""


def with_xstate(folder: Path) -> Callable[[], float] | None:
    """A function that returns xstate's CPU seconds per event with node; None: node or the package is missing."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        return None
    install = ["npm", "install", "--silent", "--no-audit", "--no-fund", f"xstate@{XSTATE}"]
    if subprocess.run(install, cwd=folder, capture_output=True).returncode != 0:
        return None
    program = folder / "loop.cjs"
    program.write_text(XSTATE_PROGRAM, encoding="utf-8")

    def run() -> float:
        done = subprocess.run(["node", str(program)], cwd=folder, capture_output=True, text=True, check=True)
        answer = json.loads(done.stdout)
        assert answer["state"] == "three", answer
        return float(answer["seconds"])

    return run


def main() -> bool:
    kernel, run = ours()
    few = 1_000
    works: dict[str, tuple[Callable[[], object], int]] = {
        "rise-tui kernel, records and all": (run, EVENTS),
        f"transitions {_version('transitions')}": (with_transitions(), EVENTS),
        f"python-statemachine {_version('python-statemachine')}": (with_statemachine(few), few),
        f"sismic {_version('sismic')}": (with_sismic(few), few),
    }
    with tempfile.TemporaryDirectory() as folder:
        xstate = with_xstate(Path(folder))
        if xstate is not None:
            works[f"xstate {XSTATE} (node)"] = (xstate, 0)
        figures = interleave(works)
    assert [run.state.id for run in kernel.rules.stack.values()] == ["State 3"]
    report = Report("Events through one rule (listing 2's loop)")
    for name, figure in figures.items():
        report.row(name, f"{figure.per_second:,.0f} events/s", f"[{1 / figure.high:,.0f} - {1 / figure.low:,.0f}]")
    if xstate is None:
        report.row(f"xstate {XSTATE}", "not measured", "node or npm is missing")
    mine = next(iter(figures.values()))
    for (name, figure), wanted in zip(list(figures.items())[1:], (6, 10, 10, 2), strict=False):
        report.target(f"times {name}", figure.median / mine.median, wanted, at_least=True)
    return report.met


def _version(package: str) -> str:
    from importlib.metadata import version

    return version(package)


if __name__ == "__main__":
    sys.exit(not main())

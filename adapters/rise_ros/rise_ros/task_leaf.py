"""A leaf for behaviour trees of py_trees: one tick starts a task in a RISE session (an act, a rule, an event, a value),
and the leaf runs until the task has ended.

Copy this file into your own package, or import it from here. What you get:

- SUCCESS when the task SUCCEEDED, FAILURE in every other case, with the reason in `feedback_message`;
- halting the leaf (a branch of higher priority, `tree.root.stop(Status.INVALID)`) cancels the task, even one that was
  only just sent;
- no call that waits: the tree continues to tick, whatever the session does;
- FAILURE instead of silence when there is no session, when it does not answer, and when it disappears.

    root = py_trees.composites.Sequence("Greet", memory=True)
    root.add_children([start_act("R_Greeting"), raise_event("/W_greeted"), start_rule("Gaze")])
    tree = py_trees.trees.BehaviourTree(root)
    tree.setup(node=node)      # an rclpy node that is being spun; py_trees_ros does all this itself

Try it beside a session (docs/how-to/behaviour-trees.md):

    ros2 run rise_ros task_tree act:R_Greeting event:/W_close
"""

from __future__ import annotations

import json
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import py_trees
import rclpy
from py_trees.common import Status
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rise_interfaces.action import DomainTask

ACTION = "rise/domain_task"
"""Relative: a namespace or a remapping of the node applies to it, as to the session's."""


def start_act(act: str, **options: Any) -> TaskLeaf:
    """A leaf that runs until the act has ended. `options`: those of `TaskLeaf`."""
    return TaskLeaf(act, "startCommunicationRobotAct", act, **options)


def start_rule(rule: str, **options: Any) -> TaskLeaf:
    """A leaf that runs until the rule has ended."""
    return TaskLeaf(rule, "startInteractionRule", rule, **options)


def raise_event(topic: str, **options: Any) -> TaskLeaf:
    """A leaf that ends as soon as the session has the event, whether or not a rule waits for it."""
    return TaskLeaf(topic, "raiseEventTopic", topic, **options)


def assign(key: str, value: Any, **options: Any) -> TaskLeaf:
    """A leaf that writes a JSON value into the working memory."""
    return TaskLeaf(key, "assignValue", json.dumps({key: value}, ensure_ascii=False), **options)


class TaskLeaf(py_trees.behaviour.Behaviour):
    """One task of a session. Ticked again after its end, it is a new task."""

    def __init__(
        self,
        name: str,
        function: str,
        behavior: str,
        *,
        calling_type: str = "",
        patience: float = 5.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`name`: in the tree. `function`, `behavior`, `calling_type`: as explained in DomainTask.action. `patience`:
        seconds for the session to appear, and again to accept the task. `clock`: seconds that only increase."""
        super().__init__(name)
        self.task = DomainTask.Goal(function_type=function, domain_task_behavior=behavior, calling_type=calling_type)
        self.patience = patience
        self.clock = clock
        self._client: Any = None
        self._goal: Goal | None = None
        self._deadline = 0.0

    @property
    def is_over(self) -> bool:
        """Whether nothing of it is known to run in the session. (A halted task ends a little later.)"""
        return self._goal is None or self._goal.is_over

    def setup(self, **options: Any) -> None:
        """Prepare the leaf. `node`: the rclpy node. Raises KeyError without one."""
        self._client = ActionClient(options["node"], DomainTask, ACTION)

    def initialise(self) -> None:
        self._goal = None
        self._deadline = self.clock() + self.patience
        self.feedback_message = "waits for a session"

    def update(self) -> Status:
        is_ready = self._client.server_is_ready()
        if self._goal is None and is_ready:
            self._goal = Goal(self._client, self.task)
            self._deadline = self.clock() + self.patience
            self.feedback_message = "sent"
        goal = self._goal
        if goal is not None and goal.result is not None:
            return self._end(goal.result.status == "SUCCEEDED", goal.result.reason or goal.result.status)
        if goal is not None and goal.is_refused:
            return self._end(False, "the session refused the task; rise/task_state and its record say why")
        if goal is not None and not is_ready:
            return self._end(False, "the session went before the task had ended")
        if goal is not None and goal.handle is not None:
            self.feedback_message = goal.progress
        elif self.clock() >= self._deadline:
            return self._end(False, "no session is there" if goal is None else "the session did not answer")
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        """Cancel the task if the leaf ends before it."""
        if self._goal is not None and not self._goal.is_over:
            self._goal.cancel()

    def shutdown(self) -> None:
        if self._client is not None:
            self._client.destroy()

    def _end(self, succeeded: bool, why: str) -> Status:
        self.feedback_message = why
        return Status.SUCCESS if succeeded else Status.FAILURE


class Goal:
    """One goal, from its sending to its end. A restarted leaf has a new one, and ignores the old one's messages."""

    def __init__(self, client: Any, task: DomainTask.Goal) -> None:
        self.handle: Any = None
        """rclpy's handle, once the session has accepted the task."""
        self.result: DomainTask.Result | None = None
        self.is_refused = False
        self.progress = "sent"
        self._is_unwanted = False
        client.send_goal_async(task, feedback_callback=self._take_feedback).add_done_callback(self._take_answer)

    @property
    def is_over(self) -> bool:
        return self.is_refused or self.result is not None

    def cancel(self) -> None:
        """Cancel the task, perhaps only after the session has answered."""
        self._is_unwanted = True
        if self.handle is not None:
            self.handle.cancel_goal_async()

    def _take_answer(self, answer: Any) -> None:
        handle = answer.result()
        if handle is None or not handle.accepted:
            self.is_refused = True
            return
        self.handle = handle
        handle.get_result_async().add_done_callback(self._take_result)
        if self._is_unwanted:
            handle.cancel_goal_async()

    def _take_feedback(self, message: Any) -> None:
        self.progress = message.feedback.reason or message.feedback.status

    def _take_result(self, answer: Any) -> None:
        response = answer.result()
        self.result = response.result if response is not None else DomainTask.Result(status="ABORTED")


# --- a program to try it --------------------------------------------------------------------------------------------

KINDS = {"act": start_act, "rule": start_rule, "event": raise_event}
PERIOD = 0.1
"""Seconds between two ticks."""
LAST_WAIT = 2.0
"""Maximum seconds for which an interrupted tree waits until the session has cancelled its task."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run tasks one after the other, `act:NAME`, `rule:NAME`, `event:/TOPIC`, until one fails; ctrl+c halts the tree.

    Exit status: 0 all succeeded, 1 one did not, 2 wrong usage.
    """
    words = rclpy.utilities.remove_ros_args(sys.argv if arguments is None else ["task_tree", *arguments])[1:]
    named = [word.partition(":") for word in words]
    if not named or any(kind not in KINDS or not name for kind, _, name in named):
        print("usage: task_tree act:NAME | rule:NAME | event:/TOPIC ...", file=sys.stderr)
        sys.exit(2)
    root = py_trees.composites.Sequence("Tasks", memory=True)
    root.add_children([KINDS[kind](name) for kind, _, name in named])
    # With rclpy's own signal handlers, the connection would be gone before the tree could cancel its task.
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    ending = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ending.set())
    node = rclpy.create_node("task_tree")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    tree = py_trees.trees.BehaviourTree(root)
    tree.setup(node=node)
    known: list[str] = []

    def tick() -> None:
        tree.tick()
        now = [f"{leaf.name}: {leaf.status.name}, {leaf.feedback_message}" for leaf in root.children]
        for line in now:
            if line not in known and "INVALID" not in line:
                print(line, flush=True)
        known[:] = now

    timer = node.create_timer(PERIOD, tick)
    try:
        while root.status not in (Status.SUCCESS, Status.FAILURE) and not ending.is_set():
            executor.spin_once(timeout_sec=PERIOD)
        if ending.is_set():
            timer.cancel()
            root.stop(Status.INVALID)
            until = time.monotonic() + LAST_WAIT
            while not all(leaf.is_over for leaf in root.children) and time.monotonic() < until:
                executor.spin_once(timeout_sec=PERIOD)
            print("halted", flush=True)
    finally:
        succeeded = root.status == Status.SUCCESS
        tree.shutdown()
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    sys.exit(0 if succeeded else 1)


if __name__ == "__main__":
    main()

"""The reference robot wrapper: it takes RISE's behaviours from ROS and passes them to a robot's own API.

Copy this file and `session_watch.py` into your own package, and fill in the class `MyRobot`. The rest can stay
unchanged. It has:

- a ROS 2 action server for each behaviour of your robot, under the names of the robot profile `rise`
  (rise/robot/speech, rise/robot/look_at, ...), relative, so that a namespace or a remapping moves them;
- one goal of a behaviour at a time; a newer one replaces it (or is rejected: parameter `when_busy`);
- cancelling that reaches the robot, also for RISE's stop-all, which asks every server to cancel everything;
- progress as feedback, and a sentence for every failure;
- a dead man's switch: without a sign of life from the session the robot stops, and accepts no goals until it returns
  (parameters `session_timeout`, in seconds, 0: off; and `require_session`);
- a clean end on ctrl+c: the robot stops first, and waiting clients get an answer.

    ros2 run rise_ros robot_wrapper
    ros2 action send_goal -f rise/robot/speech rise_interfaces/action/Speech "{message: 'Hello!'}"
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rise_interfaces.action import Animation, Emotion, LookAt, PointAt, SocialExpression, Speech
from std_msgs.msg import String

from rise_ros.session_watch import TOPIC, SessionWatch

EMOTIONS = {
    Emotion.Goal.NEUTRAL: "neutral",
    Emotion.Goal.HAPPY: "happy",
    Emotion.Goal.SAD: "sad",
    Emotion.Goal.ANGRY: "angry",
    Emotion.Goal.SURPRISED: "surprised",
    Emotion.Goal.FEAR: "fear",
}


class RobotError(Exception):
    """The robot cannot do it, or it failed. The text is for the wizard."""


class MyRobot:
    """YOUR ROBOT. Each method carries out one behaviour: it receives the goal (see the .action files of rise_interfaces
    for fields and units), starts the movement, and returns at its end.

    - Wait with `run.wait(seconds)`, never with time.sleep. When the goal is cancelled, `run.wait` raises `Stopped`:
      stop the robot in a `finally` or `except Stopped`, and let the exception pass.
    - Report the progress with `run.progress(0.5)`, if you know it.
    - Raise RobotError("...") if the robot cannot do it.
    - Methods of different behaviours are called at the same time, from several threads: the robot speaks while it looks
      somewhere. If your API does not allow that, put a lock around its calls (not around the waiting).
    - Delete the methods that your robot cannot do. Their actions are then not offered, and RISE reports this before the
      study.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self.log = log
        # Here: connect to the robot.  self.api = RobotApi("192.168.1.20")

    def speech(self, goal: Speech.Goal, run: Run) -> None:
        self.log(f'says "{goal.message}"')
        # Here: self.api.say(goal.message), and then
        #     while self.api.is_speaking():
        #         run.wait(0.05)
        # except Stopped:
        #     self.api.be_quiet()
        #     raise
        run.wait_about(0.3 + len(goal.message) / (14.0 * (goal.rate or 1.0)))  # rate 0: the robot's own rate

    def look_at(self, goal: LookAt.Goal, run: Run) -> None:
        point = goal.target.point  # metres in goal.target.header.frame_id: x forward, y left, z up
        self.log(f"looks at {point.x:g} {point.y:g} {point.z:g} in {goal.target.header.frame_id or 'its own frame'}")
        # Here: transform the point into the robot's frame (tf2), and turn the head.
        run.wait_about(seconds(goal.duration) or 1.0)  # duration 0: the robot's choice

    def emotion(self, goal: Emotion.Goal, run: Run) -> None:
        if goal.value not in EMOTIONS:
            raise RobotError(f"there is no emotion {goal.value}")
        self.log(f"shows {EMOTIONS[goal.value]}")
        run.wait_about(seconds(goal.duration) or 2.0)
        # Here: back to the neutral face, if a duration was given.

    def animation(self, goal: Animation.Goal, run: Run) -> None:
        self.log(f"plays {goal.name}")
        for _ in range(max(goal.repetitions, 1)):
            # Here: self.api.play(goal.name, size=goal.scale)
            run.wait_about(seconds(goal.duration) or 2.0)

    def social_expression(self, goal: SocialExpression.Goal, run: Run) -> None:
        self.log(f"shows {goal.name}")
        run.wait_about(seconds(goal.duration) or 2.0)

    def point_at(self, goal: PointAt.Goal, run: Run) -> None:
        point = goal.target.point
        self.log(f"points at {point.x:g} {point.y:g} {point.z:g} with the hand {goal.hand or 'auto'}")
        run.wait_about(seconds(goal.duration) or 2.0)

    def close(self) -> None:
        """Here: disconnect the robot. Everything has already been stopped."""


BEHAVIOURS = {
    "speech": Speech,
    "look_at": LookAt,
    "emotion": Emotion,
    "animation": Animation,
    "social_expression": SocialExpression,
    "point_at": PointAt,
}
"""The methods of MyRobot and their behaviours; the action is rise/robot/METHOD. For your own behaviour, add a line
here, your own .action, and a table in your robot's profile."""


def seconds(duration: Any) -> float:
    """The seconds of a builtin_interfaces/Duration."""
    return duration.sec + duration.nanosec / 1e9


# --- nothing below needs to be changed ------------------------------------------------------------------------------


class Stopped(Exception):
    """The goal is no longer wanted. The text gives the reason."""


class Run:
    """One goal while the robot carries it out."""

    def __init__(self, goal_handle: Any, feedback: Any) -> None:
        self.goal_handle = goal_handle
        self.over = threading.Event()
        self._feedback = feedback
        self._reported_at = 0.0
        self._reason = ""
        self._stop = threading.Event()

    def stop(self, reason: str) -> None:
        """Make `wait` raise Stopped with this reason. May be called on any thread."""
        self._reason = self._reason or reason
        self._stop.set()

    def check(self) -> None:
        """Raise Stopped if the goal was cancelled or replaced."""
        if self._stop.is_set():
            raise Stopped(self._reason)

    def wait(self, seconds: float) -> None:
        """Wait. Raises Stopped immediately when the goal is cancelled or replaced."""
        self._stop.wait(max(seconds, 0.0))
        self.check()

    def wait_about(self, seconds: float) -> None:
        """Wait for a movement of known length, and report the progress."""
        begun = time.monotonic()
        while (passed := time.monotonic() - begun) < seconds:
            self.progress(passed / seconds)
            self.wait(min(0.1, seconds - passed))
        self.check()

    def progress(self, part: float) -> None:
        """Report the finished part, from 0 to 1. It is sent at most 5 times a second."""
        now = time.monotonic()
        if now - self._reported_at >= 0.2:
            self._reported_at = now
            self._feedback.progress = float(min(max(part, 0.0), 1.0))
            self.goal_handle.publish_feedback(self._feedback)


class Behaviour:
    """One action server: one goal at a time."""

    def __init__(
        self,
        node: Node,
        name: str,
        type: Any,
        do: Callable[[Any, Run], None],
        when_busy: str,
        why_not_move: Callable[[], str],
    ) -> None:
        self._node, self._name, self._type, self._do, self._when_busy = node, name, type, do, when_busy
        self._why_not_move = why_not_move
        self._runs: dict[bytes, Run] = {}
        """The goals that have not ended, by goal id; the newest comes last."""
        self._lock = threading.Lock()
        self._turn = threading.Lock()
        """Held by the goal that the robot is carrying out."""
        self._server = ActionServer(
            node,
            type,
            f"rise/robot/{name}",
            execute_callback=self._execute,
            goal_callback=self._goal,
            handle_accepted_callback=self._accepted,
            cancel_callback=self._cancel,
            callback_group=ReentrantCallbackGroup(),
            # Seconds for which a result can be requested. With rclpy's 15 minutes, the list of goals, sent at every
            # change, grows: after ten minutes of work an act takes 150 ms instead of 28.
            result_timeout=10,
        )

    def stop(self, reason: str) -> list[Run]:
        """Stop all goals. Returns those that must still end."""
        with self._lock:
            runs = list(self._runs.values())
        for run in runs:
            run.stop(reason)
        return runs

    # An exception in one of these three would leave the client without an answer, so they do very little.

    def _goal(self, request: Any) -> GoalResponse:
        with self._lock:
            busy = bool(self._runs) and self._when_busy == "reject"
        return GoalResponse.REJECT if busy or self._why_not_move() else GoalResponse.ACCEPT

    def _accepted(self, goal_handle: Any) -> None:
        run = Run(goal_handle, self._type.Feedback())
        with self._lock:
            earlier = list(self._runs.values())
            self._runs[bytes(goal_handle.goal_id.uuid)] = run
        for each in earlier:
            each.stop("a newer goal took its place")
        goal_handle.execute()

    def _cancel(self, goal_handle: Any) -> CancelResponse:
        with self._lock:
            run = self._runs.get(bytes(goal_handle.goal_id.uuid))
        if run is None:
            return CancelResponse.REJECT
        run.stop("canceled")
        return CancelResponse.ACCEPT

    def _execute(self, goal_handle: Any) -> Any:
        """Carry out a goal, in a thread of the executor. Without a result of the right type, the client would wait
        forever."""
        id = bytes(goal_handle.goal_id.uuid)
        run = self._runs[id]
        reason = ""
        try:
            with self._turn:  # until the robot has stopped its previous goal
                run.check()
                self._do(goal_handle.request, run)
            goal_handle.succeed()
        except Stopped as stopped:
            reason = str(stopped)
            if self._being_cancelled(goal_handle, reason):
                goal_handle.canceled()
            else:
                goal_handle.abort()
        except Exception as error:
            reason = str(error) or type(error).__name__
            if not isinstance(error, RobotError):
                self._node.get_logger().error(f"{self._name}: {type(error).__name__}: {error}")
            goal_handle.abort()
        finally:
            with self._lock:
                self._runs.pop(id, None)
            run.over.set()
        return self._type.Result(reason=reason)

    def _being_cancelled(self, goal_handle: Any, reason: str) -> bool:
        """Whether the goal is being cancelled. Its state changes a moment after `_cancel` has returned."""
        deadline = time.monotonic() + 1.0
        while reason == "canceled" and not goal_handle.is_cancel_requested and time.monotonic() < deadline:
            time.sleep(0.001)
        return bool(goal_handle.is_cancel_requested)


class DeadMansSwitch:
    """Stops the robot while the session gives no sign of life."""

    def __init__(self, node: Node, stop: Callable[[str], object]) -> None:
        self._log, self._stop, self._reported = node.get_logger(), stop, ""
        timeout = float(node.declare_parameter("session_timeout", 2.0).value)
        required = bool(node.declare_parameter("require_session", value=False).value)
        self._watch = SessionWatch(timeout, required=required)
        qos = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(String, TOPIC, lambda message: self._watch.hear(message.data, time.monotonic()), qos)
        node.create_timer(0.1, self._watch_session)

    def why_not_move(self) -> str:
        return self._watch.why_not_move(time.monotonic())

    def _watch_session(self) -> None:
        why = self.why_not_move()
        if why != self._reported:
            self._log.warning(f"{why}: the robot stops, and takes no goals" if why else "the robot takes goals again")
            self._reported = why
        if why:  # every time: a goal may just have been accepted
            self._stop(why)


def main(arguments: list[str] | None = None) -> None:
    """Offer the robot's behaviours until ctrl+c or SIGTERM."""
    ending = threading.Event()
    # With rclpy's own signal handlers, the context would be gone before the robot has stopped.
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ending.set())
    node = Node("robot_wrapper")
    when_busy = node.declare_parameter("when_busy", "replace").value
    if when_busy not in ("replace", "reject"):
        raise SystemExit(f"the parameter when_busy is replace or reject, not {when_busy}")
    log = node.get_logger().info
    robot = MyRobot(log)
    behaviours: list[Behaviour] = []

    def stop(reason: str) -> list[Run]:
        return [run for behaviour in behaviours for run in behaviour.stop(reason)]

    switch = DeadMansSwitch(node, stop)
    behaviours += [
        Behaviour(node, name, type, getattr(robot, name), when_busy, switch.why_not_move)
        for name, type in BEHAVIOURS.items()
        if hasattr(robot, name)
    ]
    # One thread for each running behaviour, one for each goal that waits to replace it, and some for requests.
    executor = MultiThreadedExecutor(num_threads=2 * len(behaviours) + 4)
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    log(f"ready: {', '.join(name for name in BEHAVIOURS if hasattr(robot, name))}")

    ending.wait()
    stopping = stop("the robot's wrapper was ended")
    deadline = time.monotonic() + 5.0
    for run in stopping:
        run.over.wait(max(deadline - time.monotonic(), 0.0))
    if stopping:
        time.sleep(0.2)  # so that the results are sent
    robot.close()
    executor.shutdown(timeout_sec=2.0)
    spinning.join(timeout=2.0)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()

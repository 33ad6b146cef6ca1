"""One node of rclpy and the thread that spins it, in a context of its own, so that it does not affect other users of
rclpy."""

from __future__ import annotations

import asyncio
import atexit
import logging
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib import import_module
from typing import Any

from rise_adapters.ros2.transport.inbox import Inbox
from rise_adapters.ros2.transport.port import PortError, QoS
from rise_adapters.ros2.transport.rclpy.installation import Rclpy, first_line, load_rclpy

_log = logging.getLogger(__name__)

_JOIN_SECONDS = 2.0
_CLOSED_KEPT = 256
"""The number of closed entities that are kept for a while."""
_MAX_FAILURES = 20
"""Number of successive failures of the executor after which it is given up."""


class SpinningNode:
    """All methods belong to the loop's thread."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        node: str,
        arguments: Sequence[str],
    ) -> None:
        """Create the node and begin to spin, with `RclpyTransport`'s arguments. Raises PortError if rclpy refuses."""
        self.rclpy = load_rclpy()
        self._context: Any = self.rclpy.Context()
        try:
            flag = ["--ros-args"] if arguments and "--ros-args" not in arguments else []
            self._context.init([*flag, *arguments])
            self.rclpy_node: Any = _node_class(self.rclpy)(
                node,
                context=self._context,
                start_parameter_services=False,  # ours are the same on both transports (parameters.py)
            )
        except Exception as error:  # rclpy and its C code raise many kinds
            self._context.try_shutdown()
            raise PortError(f"ROS does not start the node {node!r}: {first_line(error)}") from error
        self.name: str = self.rclpy_node.get_fully_qualified_name()
        self.rmw = self.rclpy.rmw
        self.domain: int = self._context.get_domain_id()
        self.loop = loop
        self._inbox = Inbox(loop)
        self._lost = ""
        self._closed = False
        self._closed_things: deque[Any] = deque(maxlen=_CLOSED_KEPT)
        self._executor, self.spins_on = _make_executor(self._context, self.rclpy)
        self._executor.add_node(self.rclpy_node)
        self._thread = threading.Thread(target=self._spin, name=f"rclpy {self.name}", daemon=True)
        self._thread.start()
        # A thread inside rclpy at the end of the interpreter would abort the process.
        atexit.register(self.close)

    # --- between the threads --------------------------------------------------------------------------------------

    def call_on_loop(self, callback: Callable[..., object], *arguments: Any) -> None:
        """Call a function on the loop's thread. May be called on any thread."""
        self._inbox.put(partial(callback, *arguments), wait=threading.current_thread() is self._thread)

    def call_on_thread(self, callback: Callable[..., Any], *arguments: Any) -> None:
        """Call a function on the spinning thread."""
        self._executor.create_task(callback, *arguments)

    def destroy(self, destroy: Callable[[Any], Any], thing: Any) -> None:
        """Destroy an entity in the spinning thread, which may be using it.

        The executor may still have events with only its address, so it is kept for a while.
        """
        self._closed_things.append(thing)
        if not self.failure():
            self.call_on_thread(destroy, thing)

    # --- quality of service -----------------------------------------------------------------------------------------

    def read_profile(self, profile: Any) -> QoS | None:
        """Convert a quality of service of rclpy for the port; None: the middleware does not report it."""
        policies = self.rclpy.qos
        reliable = {policies.ReliabilityPolicy.RELIABLE: True, policies.ReliabilityPolicy.BEST_EFFORT: False}
        latched = {policies.DurabilityPolicy.TRANSIENT_LOCAL: True, policies.DurabilityPolicy.VOLATILE: False}
        try:
            return QoS(reliable=reliable[profile.reliability], latched=latched[profile.durability])
        except KeyError:
            return None

    def make_profile(self, qos: QoS) -> Any:
        """Convert a quality of service for rclpy."""
        policies = self.rclpy.qos
        return policies.QoSProfile(
            history=policies.HistoryPolicy.KEEP_LAST,
            depth=qos.depth,
            reliability=policies.ReliabilityPolicy.RELIABLE if qos.reliable else policies.ReliabilityPolicy.BEST_EFFORT,
            durability=policies.DurabilityPolicy.TRANSIENT_LOCAL if qos.latched else policies.DurabilityPolicy.VOLATILE,
        )

    # --- the end --------------------------------------------------------------------------------------------------

    def failure(self) -> str:
        """Why the node no longer works; empty while it does."""
        if not self._lost and not self._context.ok():
            self._lost = "the ROS context was shut down"
        return self._lost

    def check_works(self) -> None:
        """Raise PortError if the node has ended."""
        if self.failure():
            raise PortError(f"The ROS node {self.name} can be used no more: {self.failure()}.")

    def close(self) -> None:
        """End the thread and wait for it briefly."""
        if self._closed:
            return
        self._closed = True
        self._lost = self._lost or "it was closed"
        atexit.unregister(self.close)
        self._inbox.close()
        if self.spins_on:
            self._executor.shutdown(timeout_sec=_JOIN_SECONDS)
        elif self._context.ok():
            self._executor.create_task(lambda: None)  # wakes the thread, which then ends
        self._thread.join(_JOIN_SECONDS)
        if self._thread.is_alive():
            _log.warning("the thread of the ROS node %s did not end", self.name)
            self._context.try_shutdown()
            return
        for step in (self._executor.shutdown, self.rclpy_node.destroy_node, self._context.try_shutdown):
            try:
                step()
            except Exception as error:  # the other steps must still be done
                _log.warning("closing the ROS node %s: %s", self.name, first_line(error))

    def _spin(self) -> None:
        spin = self._executor.spin if self.spins_on else self._executor.spin_once
        failures = 0
        while not self._closed and self._context.ok():
            try:
                spin()
                failures = 0
            except self.rclpy.executors.ExternalShutdownException:
                break
            except Exception as error:
                # One bad message, or an entity that was closed meanwhile. Everything else follows in the next turn.
                failures += 1
                _log.warning("the executor of the ROS node %s failed: %s", self.name, first_line(error))
                if failures >= _MAX_FAILURES:
                    self._lost = f"rclpy's executor fails again and again: {first_line(error)}"
                    break


def _node_class(rclpy: Rclpy) -> Any:
    """Return a node class of rclpy whose raw subscriptions are read by their owners, not by its executor."""

    def subscriptions(node: Any) -> Iterator[Any]:
        return (each for each in rclpy.Node.subscriptions.fget(node) if not each.raw)

    return type("Node", (rclpy.Node,), {"subscriptions": property(subscriptions)})


def _make_executor(context: Any, rclpy: Rclpy) -> tuple[Any, bool]:
    """Return an executor, and whether its `spin` runs until `shutdown`, which can end it.

    rclpy's executor of events costs the same for a node with a hundred endpoints as for one with three: 0.5 ms for a
    call that arrives and is answered. The usual executor examines all endpoints again for each message: 2 to 3 ms with
    the thirty endpoints of a robot with six actions. The executor of events exists from rclpy 7.1.4 on.
    """
    try:
        events = import_module("rclpy.experimental.events_executor")
        return events.EventsExecutor(context=context), True
    except Exception as error:  # missing or changed: it is experimental
        _log.info("rclpy's executor of events cannot be used (%s); the usual one is", first_line(error))
        return rclpy.executors.SingleThreadedExecutor(context=context), False

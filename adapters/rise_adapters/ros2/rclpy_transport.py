"""The port over rclpy (Jazzy, 7.1 or newer), with any RMW: for machines on which ROS is installed.

One thread spins one executor for the life of the node, on a context of its own, so that other users of rclpy in the
same process are not disturbed. It takes messages, turns them into plain values, and hands them to the asyncio loop in
batches. When the loop is far behind it stops taking, and the middleware's own queues decide what is kept, as they do
for every slow ROS node. Sending, making and looking is done on the loop's thread.
"""

from __future__ import annotations

import asyncio
import atexit
import logging
import re
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from time import perf_counter
from typing import Any, Literal

from rise_adapters.ros2 import vendors
from rise_adapters.ros2.port import RELIABLE, End, Handle, Message, PortError, QoS, Reply
from rise_adapters.ros2.rclpy_types import Form, Types

_log = logging.getLogger(__name__)

_MOST_WAITING = 4096
"""Messages that may wait for the loop before the thread stops taking more."""
SLICE = 0.0005
"""Seconds that one turn of the loop may be taken for them: a wizard's key waits for some turns."""
_SERVICE_DEPTH = 1000
"""Requests and replies that may wait in the middleware. ROS's own 10 are overrun by a burst, and then they are lost."""
_JOIN_SECONDS = 2.0
_KEPT = 256
"""Closed publishers, subscriptions, services and clients that are kept from being reused."""
_UNKNOWN = "_UNKNOWN_"
"""Within the name of a node that ROS does not know (yet): `_NODE_NAME_UNKNOWN_`."""
_MOST_FAILURES = 20
"""Failures of the executor, one after the other, after which it is given up."""


def rclpy_missing() -> str:
    """Why rclpy cannot be used here, as a sentence; empty when it can."""
    try:
        rclpy = import_module("rclpy")
        import_module("rclpy.node")  # loads the compiled part, which fails under another Python
        rclpy.get_rmw_implementation_identifier()
    except ImportError as error:
        if isinstance(error, ModuleNotFoundError) and error.name == "rclpy":
            return (
                "rclpy cannot be imported: ROS 2 is not installed, or not sourced (`. /opt/ros/jazzy/setup.sh`), or "
                "this Python is not the one it was made for."
            )
        return f"rclpy is here, but it cannot be loaded: {_first_line(error)}"
    except Exception as error:  # an RMW that is asked for but not installed
        return f"rclpy is here, but it does not start: {_first_line(error)}"
    return ""


class RclpyTransport:
    """Implements `rise_adapters.ros2.port.Transport`."""

    kind: Literal["rclpy", "dds", "memory"] = "rclpy"

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        *,
        node: str,
        namespace: str = "",
        arguments: Sequence[str] = (),
        domain: int | None = None,
    ) -> None:
        """Make the node `node` and begin to spin. Must be called on the thread of `loop`.

        `arguments` are those of `--ros-args` (remappings, parameters, enclave, log levels), with or without the flag
        itself. `domain` None: what ROS_DOMAIN_ID says. Raises PortError when rclpy cannot be used or refuses them.
        """
        why = rclpy_missing()
        if why:
            raise PortError(why)
        self._qos = import_module("rclpy.qos")
        executors = import_module("rclpy.executors")
        events = import_module("rclpy.event_handler")
        self._types = Types()
        self._inbox = _Inbox(loop)
        self._making = threading.Lock()
        self._lost = ""
        self._closed = False
        self._context: Any = import_module("rclpy.context").Context()
        try:
            self._context.init(_ros_arguments(arguments), domain_id=domain)
            self._node: Any = import_module("rclpy.node").Node(
                node,
                context=self._context,
                namespace=namespace,
                start_parameter_services=False,  # ours are the same on both transports (parameters.py)
            )
        except Exception as error:
            self._context.try_shutdown()
            raise PortError(f"ROS does not start the node {node!r}: {_first_line(error)}") from error
        # rclpy's own callbacks for these would only write log lines, and each makes every turn of the executor longer.
        self._no_publisher_events = events.PublisherEventCallbacks(use_default_callbacks=False)
        self._no_subscription_events = events.SubscriptionEventCallbacks(use_default_callbacks=False)
        self._gone = executors.ExternalShutdownException
        self._executor, self._spins_on = _executor(self._context, executors)
        self._executor.add_node(self._node)
        self._closed_things: deque[Any] = deque(maxlen=_KEPT)
        self.node: str = self._node.get_fully_qualified_name()
        rmw = import_module("rclpy").get_rmw_implementation_identifier()
        self.vendor = vendors.of_rmw(rmw)
        self.about = f"rclpy, {rmw}, domain {self._context.get_domain_id()}"
        self._thread = threading.Thread(target=self._spin, name=f"rclpy {self.node}", daemon=True)
        self._inbox.taker = self._thread
        self._thread.start()
        # A thread that is inside of rclpy while the interpreter ends would abort the process.
        atexit.register(self.close)

    # --- names and types ------------------------------------------------------------------------------------------

    def resolve(self, name: str) -> str:
        # A rule for topics only (`rostopic://a:=b`) or services only names the other kind not at all, so the first one
        # that applies is meant. An action's name is resolved before `/_action/...` is added, so all its parts follow.
        try:
            plain: str = self._node.resolve_topic_name(name, only_expand=True)
            topic: str = self._node.resolve_topic_name(name)
            return topic if topic != plain else str(self._node.resolve_service_name(name))
        except Exception as error:
            raise PortError(f"{name!r} cannot be the name of a topic or service: {_first_line(error)}") from error

    def fields(self, type: str) -> Mapping[str, str]:
        return dict(self._types.message(type)[1].fields)

    def type_hash(self, type: str) -> str:
        return self._types.hash(type)

    # --- topics ---------------------------------------------------------------------------------------------------

    def publisher(self, topic: str, type: str, qos: QoS = RELIABLE) -> _Publisher:
        self._check()
        made, form = self._types.message(type)
        publisher = self._make(
            topic, type, self._node.create_publisher, made, qos=qos, event_callbacks=self._no_publisher_events
        )
        return _Publisher(self, publisher, form)

    def subscribe(self, topic: str, type: str, taken: Callable[[Message], None], qos: QoS = RELIABLE) -> _Subscription:
        self._check()
        made, form = self._types.message(type)
        subscription = _Subscription(self, form, taken)
        subscription.made = self._make(
            topic,
            type,
            self._node.create_subscription,
            made,
            callback=subscription.take,
            qos=qos,
            event_callbacks=self._no_subscription_events,
        )
        return subscription

    # --- services -------------------------------------------------------------------------------------------------

    def serve(self, name: str, type: str, asked: Callable[[Message, Reply], None]) -> Handle:
        self._check()
        made, request, response = self._types.service(type)
        server = _Server(self, request, response, asked)
        with self._making:
            if self._spins_on:
                self._executor.create_task(self._pass_on, None, None)  # holds it before it sees the service
            service = self._make(name, type, self._node.create_service, made, callback=self._pass_on)
            server.open(service)
        return server

    def client(self, name: str, type: str) -> _Client:
        self._check()
        made, request, response = self._types.service(type)
        return _Client(self, self._make(name, type, self._node.create_client, made), request, response)

    # --- the graph ------------------------------------------------------------------------------------------------

    def publisher_ends(self, topic: str) -> list[End]:
        return self._ends(self._node.get_publishers_info_by_topic, self.resolve(topic))

    def subscriber_ends(self, topic: str) -> list[End]:
        return self._ends(self._node.get_subscriptions_info_by_topic, self.resolve(topic))

    def server_ends(self, service: str) -> list[End]:
        full = self.resolve(service)
        # RMWs on DDS carry a service on two topics: what reads the one and writes the other are the servers.
        found = [
            *self._ends(self._node.get_subscriptions_info_by_topic, f"rq{full}Request", no_mangle=True),
            *self._ends(self._node.get_publishers_info_by_topic, f"rr{full}Reply", no_mangle=True),
        ]
        return found or self._services(full)

    def topics(self) -> list[str]:
        if self._ended():
            return []
        return [
            name
            for name, _ in self._node.get_topic_names_and_types()
            if self.publisher_ends(name) or self.subscriber_ends(name)
        ]

    def strangers(self) -> list[tuple[str, str]]:
        if not self.vendor or self._ended():
            return []
        # By what they have: what a program is carried by is nowhere else to be seen.
        found = {
            (end.node, end.vendor)
            for name, _ in self._node.get_topic_names_and_types(no_demangle=True)
            for look in (self._node.get_publishers_info_by_topic, self._node.get_subscriptions_info_by_topic)
            for end in self._ends(look, name, no_mangle=True)
            if end.vendor != self.vendor
        }
        named = {vendor for node, vendor in found if node}  # of those, what has no name is their middleware's own
        return sorted((node or "without a name", vendor) for node, vendor in found if node or vendor not in named)

    def nodes(self) -> list[str]:
        return [] if self._ended() else list(self._node.get_fully_qualified_node_names())

    def clients_of(self, service: str) -> list[str]:
        if self._ended():
            return []
        # As in `server_ends`: on DDS, who writes this topic calls the service.
        infos = self._node.get_publishers_info_by_topic(f"rq{self.resolve(service)}Request", no_mangle=True)
        return sorted({f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos if not self._own(info)})

    def lost(self) -> str:
        if not self._lost and not self._context.ok():
            self._lost = "the ROS context was shut down"
        return self._lost

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        self._lost = self._lost or "it was closed"
        atexit.unregister(self.close)
        self._inbox.close()
        if self._spins_on:
            self._executor.shutdown(timeout_sec=_JOIN_SECONDS)
        elif self._context.ok():
            self._executor.create_task(_nothing)  # wakes the thread, which then sees that it is to end
        self._thread.join(_JOIN_SECONDS)
        if self._thread.is_alive():
            _log.warning("the thread of the ROS node %s did not end", self.node)
            self._context.try_shutdown()
            return
        for step in (self._executor.shutdown, self._node.destroy_node, self._context.try_shutdown):
            try:
                step()
            except Exception as error:
                _log.warning("closing the ROS node %s: %s", self.node, _first_line(error))

    # --- inside ---------------------------------------------------------------------------------------------------

    def _spin(self) -> None:
        spin = self._executor.spin if self._spins_on else self._executor.spin_once
        failures = 0
        while not self._closed and self._context.ok():
            try:
                spin()
                failures = 0
            except self._gone:
                break
            except Exception as error:
                # One bad message or one entity that was closed meanwhile; what else is ready comes in the next turn.
                failures += 1
                _log.warning("the executor of the ROS node %s failed: %s", self.node, _first_line(error))
                if failures >= _MOST_FAILURES:
                    self._lost = f"rclpy's executor fails again and again: {_first_line(error)}"
                    break

    def _make(self, name: str, type: str, create: Callable[..., Any], made: Any, **more: Any) -> Any:
        """Create something of the node's; rclpy's manifold complaints become one sentence."""
        topic = "event_callbacks" in more
        more["qos_profile"] = self._profile(more.pop("qos", QoS(depth=_SERVICE_DEPTH)))
        try:
            return create(made, name, **more)
        except Exception as error:
            what = "topic" if topic else "service"
            raise PortError(f"The {what} {name} of the type {type} cannot be made: {_first_line(error)}") from error

    def _profile(self, qos: QoS) -> Any:
        of = self._qos
        return of.QoSProfile(
            history=of.HistoryPolicy.KEEP_LAST,
            depth=qos.depth,
            reliability=of.ReliabilityPolicy.RELIABLE if qos.reliable else of.ReliabilityPolicy.BEST_EFFORT,
            durability=of.DurabilityPolicy.TRANSIENT_LOCAL if qos.latched else of.DurabilityPolicy.VOLATILE,
        )

    def _drop(self, destroy: Callable[[Any], Any], thing: Any) -> None:
        """Destroy it in the spinning thread, which may be in the middle of looking at it.

        The executor may still hold events for it that name it by its address only, so it is kept for a while.
        """
        self._closed_things.append(thing)
        if not self._ended():
            self._executor.create_task(destroy, thing)

    def _pass_on(self, request: Any, response: Any) -> Any:
        """The callback of every service, in the spinning thread. What it returns goes to the service's `send_response`,
        together with the request's header: to `_Server.take`. `_making` is held until that stands there."""
        with self._making:
            return request

    def _check(self) -> None:
        if self._ended():
            raise PortError(f"The ROS node {self.node} can be used no more: {self.lost()}.")

    def _ended(self) -> bool:
        return self._closed or bool(self.lost())

    @property
    def _over(self) -> bool:
        """The same as far as it is known already: asking ROS costs as much as a third of a small message."""
        return self._closed or bool(self._lost)

    def _ends(self, look: Callable[..., Any], name: str, **more: Any) -> list[End]:
        """What the graph lists of others under a name."""
        if self._ended():
            return []
        try:
            found = look(name, **more)
        except Exception as error:
            _log.debug("%s cannot be looked up: %s", name, _first_line(error))
            return []
        return [self._end(info) for info in found if not self._own(info)]

    def _end(self, info: Any) -> End:
        node = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
        return End(
            "" if _UNKNOWN in node else node,
            _plain_type(info.topic_type),
            _hash_text(info.topic_type_hash),
            bytes(info.endpoint_gid[:2]).hex() if self.vendor else "",
            self._quality(info.qos_profile),
        )

    def _quality(self, profile: Any) -> QoS | None:
        reliable = {self._qos.ReliabilityPolicy.RELIABLE: True, self._qos.ReliabilityPolicy.BEST_EFFORT: False}
        latched = {self._qos.DurabilityPolicy.TRANSIENT_LOCAL: True, self._qos.DurabilityPolicy.VOLATILE: False}
        try:
            return QoS(reliable=reliable[profile.reliability], latched=latched[profile.durability])
        except KeyError:  # the middleware does not say
            return None

    def _own(self, info: Any) -> bool:
        return f"{info.node_namespace.rstrip('/')}/{info.node_name}" == self.node

    def _services(self, full: str) -> list[End]:
        """The service of that name as far as other nodes, each by itself, are known to offer it."""
        found: list[End] = []
        if self._ended():
            return found
        for name, namespace in self._node.get_node_names_and_namespaces():
            node = f"{namespace.rstrip('/')}/{name}"
            if node == self.node:
                continue
            try:
                offered = self._node.get_service_names_and_types_by_node(name, namespace)
            except Exception:  # the node went away meanwhile
                continue
            found += [End(node, f"{type}_Request") for service, types in offered if service == full for type in types]
        return found


class _Publisher:
    def __init__(self, transport: RclpyTransport, made: Any, form: Form) -> None:
        self._transport = transport
        self._made = made
        self._form = form
        self._closed = False

    def publish(self, message: Message) -> None:
        written = self._form.write(message)
        if self._closed or self._transport._over:
            return
        try:
            self._made.publish(written)
        except Exception as error:
            if not self._transport._ended():
                raise PortError(f"{self._made.topic_name}: not published: {_first_line(error)}") from error

    def subscribers(self) -> int:
        return 0 if self._closed or self._transport._ended() else int(self._made.get_subscription_count())

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            self._transport._drop(self._transport._node.destroy_publisher, self._made)


class _Subscription:
    def __init__(self, transport: RclpyTransport, form: Form, taken: Callable[[Message], None]) -> None:
        self._transport = transport
        self._form = form
        self._taken = taken
        self._closed = False
        self.made: Any = None

    def take(self, message: Any) -> None:
        """In the spinning thread."""
        self._transport._inbox.put(self._deliver, self._form.read(message))

    def _deliver(self, message: Message) -> None:
        if not self._closed:
            self._taken(message)

    def publishers(self) -> int:
        return 0 if self._closed or self._transport._ended() else int(self.made.get_publisher_count())

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            self._transport._drop(self._transport._node.destroy_subscription, self.made)


class _Server:
    """Answers at any time: it takes the header of each request from rclpy, instead of having rclpy wait for the answer
    in a coroutine, which would cost each turn of the executor something for every request that waits."""

    def __init__(
        self, transport: RclpyTransport, request: Form, response: Form, asked: Callable[[Message, Reply], None]
    ) -> None:
        self._transport = transport
        self._request = request
        self._response = response
        self._asked = asked
        self._closed = False
        self._made: Any = None
        self._send: Callable[[Any, Any], None] = _nowhere

    def open(self, made: Any) -> None:
        self._made = made
        self._send = made.send_response
        made.send_response = self.take

    def take(self, request: Any, header: Any) -> None:
        """In the spinning thread, where the executor believes to send an answer."""
        self._transport._inbox.put(self._deliver, self._request.read(request), header)

    def _deliver(self, request: Message, header: Any) -> None:
        if self._closed:
            return
        answered = False

        def reply(message: Message) -> None:
            nonlocal answered
            if answered or self._closed or self._transport._over:
                return
            written = self._response.write(message)
            answered = True
            try:
                self._send(written, header)
            except Exception as error:  # the client is gone, or cannot be reached: nobody to tell
                _log.info("an answer could not be sent: %s", _first_line(error))

        self._asked(request, reply)

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            self._transport._drop(self._transport._node.destroy_service, self._made)


class _Client:
    def __init__(self, transport: RclpyTransport, made: Any, request: Form, response: Form) -> None:
        self._transport = transport
        self._made = made
        self._request = request
        self._response = response
        self._closed = False

    def servers(self) -> int:
        if self._closed or self._transport._ended() or not self._made.service_is_ready():
            return 0  # not ready: the graph may know one already, but it could not answer yet
        return max(1, int(self._transport._node.count_services(self._made.service_name)))

    def call(self, request: Message, answer: Callable[[Message], None]) -> None:
        written = self._request.write(request)
        if self._closed or self._transport._ended():
            return
        try:
            future = self._made.call_async(written)
        except Exception as error:
            raise PortError(f"{self._made.service_name}: not asked: {_first_line(error)}") from error
        future.add_done_callback(lambda done: self._take(done, answer))

    def _take(self, done: Any, answer: Callable[[Message], None]) -> None:
        """In the spinning thread; on the loop's when the answer was quicker than `call`."""
        response = done.result()
        if response is not None:
            self._transport._inbox.put(self._deliver, answer, self._response.read(response))

    def _deliver(self, answer: Callable[[Message], None], response: Message) -> None:
        if not self._closed:
            answer(response)

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            self._transport._drop(self._transport._node.destroy_client, self._made)


class _Inbox:
    """What waits for the loop: filled by the spinning thread, emptied in batches by one callback of the loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._waiting: deque[tuple[Callable[..., None], tuple[Any, ...]]] = deque()
        self._room = threading.Condition()
        self._scheduled = False
        self._closed = False
        self.taker: threading.Thread | None = None
        """The thread that waits for room; others never do."""

    def put(self, callback: Callable[..., None], *arguments: Any) -> None:
        with self._room:
            while len(self._waiting) >= _MOST_WAITING and not self._closed and threading.current_thread() is self.taker:
                self._room.wait()
            if self._closed:
                return
            self._waiting.append((callback, arguments))
            if self._scheduled:
                return
            self._scheduled = True
            try:
                self._loop.call_soon_threadsafe(self._deliver)
            except RuntimeError:  # the loop was closed before the transport
                self._closed = True

    def close(self) -> None:
        with self._room:
            self._closed = True
            self._waiting.clear()
            self._room.notify_all()

    def _deliver(self) -> None:
        """Some of it, and the rest after the loop's other work."""
        until = perf_counter() + SLICE
        while True:
            with self._room:
                if not self._waiting or self._closed:
                    self._scheduled = False
                    return
                callback, arguments = self._waiting.popleft()
                self._room.notify_all()
            try:
                callback(*arguments)
            except Exception as error:
                self._loop.call_exception_handler(
                    {"message": f"what was received from ROS was not dealt with: {error}", "exception": error}
                )
            if perf_counter() > until:
                self._loop.call_soon(self._deliver)
                return


def _executor(context: Any, executors: Any) -> tuple[Any, bool]:
    """What waits for the middleware, and whether its `spin` goes on until `shutdown` and may be ended by it.

    rclpy's executor of events costs the same for a node with a hundred endpoints as for one with three, 0.5 ms for a
    call that comes and is answered; the usual one looks at all of them again for each message, 2 to 3 ms with the
    thirty endpoints of a robot with six actions. It is there from rclpy 7.1.4 on.
    """
    try:
        events = import_module("rclpy.experimental.events_executor")
        return events.EventsExecutor(context=context), True
    except Exception as error:
        _log.info("rclpy's executor of events cannot be used (%s); the usual one is", _first_line(error))
        return executors.SingleThreadedExecutor(context=context), False


# --- small things -----------------------------------------------------------------------------------------------------


def _ros_arguments(arguments: Sequence[str]) -> list[str]:
    given = list(arguments)
    return ["--ros-args", *given] if given and "--ros-args" not in given else given


def _hash_text(value: Any) -> str:
    """A type hash of an endpoint; `INVALID` when the endpoint does not say."""
    text = "" if value is None else str(value)
    return text if text.startswith("RIHS") else ""


def _plain_type(name: str) -> str:
    """`std_srvs::srv::dds_::Trigger_Request_` -> `std_srvs/srv/Trigger_Request`."""
    match = re.fullmatch(r"(\w+)::(\w+)::dds_::(\w+)_", name)
    return "/".join(match.groups()) if match else name


def _first_line(error: BaseException) -> str:
    """rclpy's messages end in places of C files; the first line says it."""
    if type(error).__name__ == "UnknownROSArgsError":
        return f"it does not know the arguments {error}"
    text = str(error).strip() or type(error).__name__
    return re.sub(r",? at .*\.(c|cpp):\d+.*$", "", text.splitlines()[0]).strip()


def _nothing() -> None:
    pass


def _nowhere(response: Any, header: Any) -> None:
    pass

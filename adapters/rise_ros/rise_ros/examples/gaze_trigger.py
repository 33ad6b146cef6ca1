"""Feature node: follows what a person looks at. It raises `/gaze/TARGET` when they have looked at a target for a while,
and `/gaze/nothing` when they have looked at nothing for longer. A blink or a glance elsewhere that is shorter than the
gap does not end a look. (The gaze node of the RISE paper, section 5.1.2.)

    python -m rise_ros.examples.gaze_trigger --dwell 0.8                     # names, as std_msgs/String
    python -m rise_ros.examples.gaze_trigger --region robot=0,0,1.2,0.3      # points, as PointStamped

Copy this file for your own node. All that it knows about RISE is `SessionClient`.
"""

from __future__ import annotations

import asyncio
from argparse import ArgumentTypeError, Namespace
from math import dist, inf

from rise_adapters.ros2.transport.port import Message, Transport

from rise_ros.examples.run_node import node_parser, run_node
from rise_ros.examples.session_client import SessionClient, SessionGoneError
from rise_ros.examples.topic_listener import TopicListener

NOTHING = "nothing"
_POLL_SECONDS = 0.02


class Region:
    """`robot=0,0,1.2,0.3`: a sphere with centre x, y, z and a radius, all in metres in the frame of the points."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.name, _, numbers = text.partition("=")
        try:
            *self.centre, self.radius = map(float, numbers.split(","))
        except ValueError:
            self.centre = []
        if not self.name or len(self.centre) != 3:
            raise ArgumentTypeError(f"{text!r} is not of the form NAME=X,Y,Z,RADIUS")

    def __str__(self) -> str:
        return self.text

    def contains(self, point: Message) -> bool:
        return dist(self.centre, (point["x"], point["y"], point["z"])) <= self.radius


class LookTimer:
    """Decides when a look has lasted long enough. All times are seconds on one clock."""

    def __init__(self, dwell: float, gap: float, away: float) -> None:
        self.dwell, self.gap, self.away = dwell, gap, away
        self.target, self.since = NOTHING, 0.0
        """The present target, and since when."""
        self._instead: tuple[str, float] | None = None
        """The other target seen, and since when, while it may be a blink ..."""
        self._interrupted_at = 0.0
        """... and since when the look is interrupted."""
        self._seen_at = 0.0
        """When the last message came; after `away` seconds of silence, nobody is there."""
        self._last_raised = NOTHING

    def update(self, target: str, now: float) -> None:
        """Note that the person looks at this target now."""
        self.advance_to(now)
        self._seen_at = now
        if target == self.target:
            self._instead = None
        elif self.target == NOTHING or not self.gap:
            self._turn_to(target, now)
        elif self._instead is None or self._instead[0] != target:
            self._interrupted_at = now if self._instead is None else self._interrupted_at
            self._instead = (target, now)

    def advance_to(self, now: float) -> None:
        """Update the look for the passed time."""
        if self._instead is not None and now - self._interrupted_at >= self.gap:
            self._turn_to(*self._instead)
        if self.target != NOTHING and now - self._seen_at > self.away:
            self._turn_to(NOTHING, self._seen_at)

    def take_completed_look(self, now: float) -> str:
        """The target that has just been looked at for long enough, once for each look; else empty."""
        self.advance_to(now)
        needed = self.away if self.target == NOTHING else self.dwell
        if self._instead is not None or self.target == self._last_raised or now - self.since < needed:
            return ""
        self._last_raised = self.target
        return self._last_raised

    def _turn_to(self, target: str, since: float) -> None:
        self.target, self.since, self._instead = target, since, None


class GazeTrigger:
    """Raises one event for each look, once it has lasted."""

    def __init__(self, session: SessionClient, timer: LookTimer, regions: list[Region]) -> None:
        self.session, self.timer, self.regions = session, timer, regions

    def take_name(self, message: Message) -> None:
        self.take_target(message["data"].strip().strip("/") or NOTHING)

    def take_point(self, message: Message) -> None:
        self.take_target(next((region.name for region in self.regions if region.contains(message["point"])), NOTHING))

    def take_target(self, target: str) -> None:
        self.timer.update(target, asyncio.get_running_loop().time())

    async def work(self) -> None:
        while True:
            await asyncio.sleep(_POLL_SECONDS)
            now = asyncio.get_running_loop().time()
            target = self.timer.take_completed_look(now)
            if not target:
                continue
            print(f"/gaze/{target}, after {now - self.timer.since:.1f} s")
            try:
                await self.session.raise_event(f"/gaze/{target}")
            except SessionGoneError as error:
                print(f"the event was not raised: {error}")


async def work(transport: Transport, options: Namespace) -> None:
    timer = LookTimer(options.dwell, options.gap, options.away)
    trigger = GazeTrigger(SessionClient(transport), timer, options.region)
    if options.region:
        TopicListener(
            transport, options.topic, "geometry_msgs/msg/PointStamped", trigger.take_point, pause=_POLL_SECONDS
        )
    else:
        TopicListener(transport, options.topic, "std_msgs/msg/String", trigger.take_name, pause=_POLL_SECONDS)
    print(f"watching {transport.resolve(options.topic)} ({transport.about})")
    await trigger.work()


def _parse_seconds(text: str) -> float:
    seconds = float(text)
    if not 0 <= seconds < inf:
        raise ValueError
    return seconds


def main() -> None:
    parser = node_parser("gaze_trigger", "Raises /gaze/TARGET when a person has looked at something for a while.")
    parser.add_argument("--topic", default="gaze", help="where the gaze comes from (default: %(default)s)")
    parser.add_argument(
        "--region", type=Region, action="append", default=[], metavar="NAME=X,Y,Z,RADIUS", help="metres; repeatable"
    )
    parser.add_argument(
        "--dwell", type=_parse_seconds, default=0.8, help="seconds that a look lasts (default: %(default)s)"
    )
    parser.add_argument(
        "--gap",
        type=_parse_seconds,
        default=0.3,
        help="seconds of a blink, which does not end a look (default: %(default)s)",
    )
    parser.add_argument(
        "--away", type=_parse_seconds, default=10.0, help="seconds until nobody looks (default: %(default)s)"
    )
    run_node(parser, work)


if __name__ == "__main__":
    main()

"""Feature node: hears what the person looks at, and raises `/gaze/TARGET` when they have looked at it for a while;
`/gaze/nothing` when they have looked at nothing for longer. (The gaze node of the RISE paper, section 5.1.2.)

    python -m rise_adapters.ros2.nodes.gaze_trigger --dwell 0.8                     # names, as std_msgs/String
    python -m rise_adapters.ros2.nodes.gaze_trigger --region robot=0,0,1.2,0.3      # points, as PointStamped

Copy this file for a node of your own; all that it knows about RISE is `SessionClient`.
"""

from __future__ import annotations

import asyncio
from argparse import ArgumentTypeError, Namespace
from math import dist

from rise_adapters.ros2.nodes.running import node_parser, run_node
from rise_adapters.ros2.nodes.session import SessionClient, SessionGoneError
from rise_adapters.ros2.port import Message, Transport

NOTHING = "nothing"
_LOOK_SECONDS = 0.02


class Region:
    """`robot=0,0,1.2,0.3`: a ball around x, y, z with a radius, all in metres in the frame of the points."""

    def __init__(self, text: str) -> None:
        self.name, _, numbers = text.partition("=")
        try:
            *self.centre, self.radius = map(float, numbers.split(","))
        except ValueError:
            self.centre = []
        if not self.name or len(self.centre) != 3:
            raise ArgumentTypeError(f"{text!r} is not of the form NAME=X,Y,Z,RADIUS")

    def holds(self, point: Message) -> bool:
        return dist(self.centre, (point["x"], point["y"], point["z"])) <= self.radius


class GazeTrigger:
    """`target` is what the person looks at; each look at it raises one event, once it has lasted."""

    def __init__(self, session: SessionClient, dwell: float, away: float, regions: list[Region]) -> None:
        self.session, self.dwell, self.away, self.regions = session, dwell, away, regions
        self.target, self.since = NOTHING, 0.0
        self.last = 0.0
        """When the last message came; after `away` seconds of silence nobody is there."""
        self.raised = NOTHING

    def take_name(self, message: Message) -> None:
        self.look(message["data"].strip().strip("/") or NOTHING)

    def take_point(self, message: Message) -> None:
        self.look(next((region.name for region in self.regions if region.holds(message["point"])), NOTHING))

    def look(self, target: str) -> None:
        self.last = asyncio.get_running_loop().time()
        if target != self.target:
            self.target, self.since = target, self.last

    async def work(self) -> None:
        while True:
            await asyncio.sleep(_LOOK_SECONDS)
            now = asyncio.get_running_loop().time()
            if self.target != NOTHING and now - self.last > self.away:
                self.target, self.since = NOTHING, self.last
            needed = self.away if self.target == NOTHING else self.dwell
            if self.target == self.raised or now - self.since < needed:
                continue
            self.raised = self.target
            print(f"/gaze/{self.raised}, after {now - self.since:.1f} s")
            try:
                await self.session.raise_event(f"/gaze/{self.raised}")
            except SessionGoneError as error:
                print(f"the event came to nothing: {error}")


async def work(transport: Transport, options: Namespace) -> None:
    trigger = GazeTrigger(SessionClient(transport), options.dwell, options.away, options.region)
    if options.region:
        transport.subscribe(options.topic, "geometry_msgs/msg/PointStamped", trigger.take_point)
    else:
        transport.subscribe(options.topic, "std_msgs/msg/String", trigger.take_name)
    print(f"watching {transport.resolve(options.topic)} ({transport.about})")
    await trigger.work()


def main() -> None:
    parser = node_parser("gaze_trigger", "Raises /gaze/TARGET when a person has looked at something for a while.")
    parser.add_argument("--topic", default="gaze", help="where the gaze comes from (default: %(default)s)")
    parser.add_argument(
        "--region", type=Region, action="append", default=[], metavar="NAME=X,Y,Z,RADIUS", help="metres; repeatable"
    )
    parser.add_argument("--dwell", type=float, default=0.8, help="seconds that a look lasts (default: %(default)s)")
    parser.add_argument("--away", type=float, default=10, help="seconds until nobody looks (default: %(default)s)")
    run_node(parser, work)


if __name__ == "__main__":
    main()

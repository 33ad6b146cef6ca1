"""The nodes that run beside a session: each against a real session, on a wire in memory."""

from __future__ import annotations

import asyncio
import json
import re
from argparse import ArgumentTypeError, Namespace
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from rise_adapters.ros2.transport.port import Message, Publisher, QoS
from rise_ros.examples import run_node
from rise_ros.examples.answer_node import SYSTEM, AnswerNode
from rise_ros.examples.gaze_trigger import NOTHING, GazeTrigger, LookTimer, Region
from rise_ros.examples.keyword_spotter import Keyword, KeywordSpotter, split_words
from rise_ros.examples.session_client import SessionClient, SessionGoneError
from rise_ros.examples.topic_listener import TopicListener

from tests.ros.memory import MemoryTransport, MemoryWire
from tests.ros.model_server import ModelServer
from tests.ros.session_node_bench import Faced, faced, until

pytestmark = pytest.mark.slow  # its sessions run twenty times as fast as life, and no faster
LAB = Path(__file__).parents[2] / "scenarios" / "lab_opening"
SPEED = 20.0
"""Of the session; nodes live in real time."""
WITH_MODEL = 3.0
"""Of one in which a language model answers: its rule waits 15 s for that, which are 5 s on a busy machine."""


class Lab:
    """The opening of the laboratory, and a wire on which nodes take part in it."""

    def __init__(self, session: Faced, wire: MemoryWire) -> None:
        self.session, self.wire = session, wire
        self.tasks: list[asyncio.Task[None]] = []
        self.client = SessionClient(self.transport("/test"))

    def transport(self, node: str) -> MemoryTransport:
        return MemoryTransport(self.wire, asyncio.get_running_loop(), node)

    def run(self, work: Coroutine[Any, Any, None]) -> None:
        self.tasks.append(asyncio.get_running_loop().create_task(work))

    def publisher(self, topic: str, type: str) -> Publisher:
        return self.transport("/sensor").publisher(topic, type)

    def value(self, key: str) -> Any:
        return self.session.hub.view.memory[key].value

    def state(self, rule: str) -> str | None:
        view = self.session.hub.view.rules.get(rule)
        return view.state if view is not None else None

    async def until_in(self, rule: str, state: str) -> None:
        await until(lambda: self.state(rule) == state)

    async def begin(self, rule: str = "Conversation", state: str = "Listening") -> None:
        # A task that starts a rule ends with it, so nobody waits for that.
        self.run(self._submit("startInteractionRule", rule))
        await self.until_in(rule, state)

    async def _submit(self, function: str, behavior: str) -> None:
        with suppress(SessionGoneError):
            await self.client.submit(function, behavior)

    def said(self) -> list[str]:
        return [
            record["parameters"]["message"]
            for record in (json.loads(each["json"]) for each in self.wire.messages("/rise/record"))
            if record["kind"] == "action" and record["type"] == "Speech" and record["status"] == "started"
        ]

    def events(self) -> list[str]:
        records = (json.loads(each["json"]) for each in self.wire.messages("/rise/record"))
        return [
            record["topic"].removeprefix("/")
            for record in records
            if record["kind"] == "event" and record["source"] != "engine"
        ]


@asynccontextmanager
async def lab(place: Path, speed: float = SPEED) -> AsyncIterator[Lab]:
    wire = MemoryWire()
    transport = MemoryTransport(wire, asyncio.get_running_loop(), "/rise")
    async with faced(place, transport, speed=speed, scenario=LAB) as session:
        made = Lab(session, wire)
        try:
            yield made
        finally:
            for task in made.tasks:
                task.cancel()
            await asyncio.gather(*made.tasks, return_exceptions=True)


# --- what all nodes share ---------------------------------------------------------------------------------------------


async def test_tasks_and_memory(tmp_path: Path) -> None:
    async with lab(tmp_path) as it:
        done = await it.client.assign("who", {"name": "Ägypt", "age": [1, None]})
        assert (done.succeeded, done.status, done.reason) == (True, "SUCCEEDED", "")
        assert done.task > 0
        assert await it.client.read_memory("who") == {"name": "Ägypt", "age": [1, None]}
        assert await it.client.read_memory("who.name") == "Ägypt"
        assert await it.client.read_memory("nobody", "x") == "x"
        assert (await it.client.start_act("R_LookAhead")).succeeded
        assert (await it.client.start_act("R_Nonsense")).status in ("REJECTED", "ABORTED")


async def test_without_a_session_a_node_hears_so_in_time() -> None:
    transport = MemoryTransport(MemoryWire(), asyncio.get_running_loop(), "/alone")
    client = SessionClient(transport, patience=0.05)
    with pytest.raises(SessionGoneError, match="no session offers rise/domain_task"):
        await client.raise_event("/x")
    with pytest.raises(SessionGoneError, match="no session offers rise/get_memory"):
        await client.read_memory("x")


async def test_a_session_that_dies_leaves_nobody_waiting(tmp_path: Path) -> None:
    async with lab(tmp_path) as it:
        rule = asyncio.ensure_future(it.client.submit("startInteractionRule", "Conversation"))
        await it.until_in("Conversation", "Listening")
        await it.client.raise_event("/nobody-waits-for-it")  # after its answer, that about the rule has come too
        it.wire.forget("/rise")
        with pytest.raises(SessionGoneError, match="ended before the task did"):
            await rule


async def test_a_session_that_does_not_answer_leaves_nobody_waiting(tmp_path: Path) -> None:
    async with lab(tmp_path) as it:
        client = SessionClient(it.transport("/other"), patience=0.1)
        it.wire.kill("/rise")
        with pytest.raises(SessionGoneError, match="did not take a task"):
            await client.raise_event("/x")
        with pytest.raises(SessionGoneError, match="did not say"):
            await client.read_memory("x")


# --- keyword spotter --------------------------------------------------------------------------------------------------


def test_words_and_phrases() -> None:
    assert split_words("Good-bye, then! It's O’Hara's 2nd.") == ["good", "bye", "then", "it's", "o’hara's", "2nd"]
    keyword = Keyword("control room,Küche = /there")
    assert (keyword.phrases, keyword.event.strip()) == (["control room", "küche"], "/there")
    assert keyword.find_phrase("Is that the Control  Room?") == "control room"
    assert keyword.find_phrase("Wo ist die KÜCHE?") == "küche"
    assert keyword.find_phrase("control the rooms") is None
    for wrong in ("hello", "=/x", "hello=", ",=/x", "!?=/x"):
        with pytest.raises(ArgumentTypeError, match="not of the form"):
            Keyword(wrong)


def spotter(it: Lab) -> KeywordSpotter:
    keywords = [Keyword("control room=/H_control_room"), Keyword("kitchen=/H_kitchen")]
    made = KeywordSpotter(SessionClient(it.transport("/spotter")), keywords, "RecognizedSpeech", "/H_question")
    it.run(made.work())
    return made


async def test_a_key_word_moves_the_rule(tmp_path: Path) -> None:
    async with lab(tmp_path) as it:
        await it.begin()
        made = spotter(it)
        it.transport("/ears").subscribe("/speech", "std_msgs/msg/String", made.take_string)
        it.publisher("/speech", "std_msgs/msg/String").publish({"data": " What is in the kitchen? "})
        await it.until_in("Conversation", "Kitchen")
        assert it.value("RecognizedSpeech") == "What is in the kitchen?"
        await it.until_in("Conversation", "Listening")
        assert it.events() == ["H_kitchen"]


async def test_the_memory_is_written_before_the_event_is_raised(tmp_path: Path) -> None:
    async with lab(tmp_path) as it:
        made = spotter(it)
        for n in range(3):
            made.take_string({"data": f"question {n}"})
        await until(lambda: len(it.events()) == 3)
        records = [json.loads(each["json"]) for each in it.wire.messages("/rise/record")]
        assert [
            record.get("value", "/H_question")
            for record in records
            if record["kind"] == "event" or (record["kind"] == "memory" and record["key"] == "RecognizedSpeech")
        ][-6:] == ["question 0", "/H_question", "question 1", "/H_question", "question 2", "/H_question"]


async def test_live_speech_counts_when_it_is_final(tmp_path: Path) -> None:
    async with lab(tmp_path) as it:
        await it.begin()
        made = spotter(it)
        it.transport("/ears").subscribe("/voice", "hri_msgs/msg/LiveSpeech", made.take_live_speech)
        voice = it.publisher("/voice", "hri_msgs/msg/LiveSpeech")
        voice.publish({"incremental": "the kitchen"})
        voice.publish({"final": "the control room"})
        await it.until_in("Conversation", "Control room")
        assert it.events() == ["H_control_room"]


async def test_the_spotter_outlives_a_session(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    async with lab(tmp_path) as it:
        made = spotter(it)
        made.session.patience = 0.05
        it.wire.forget("/rise")
        made.take_string({"data": "hello?"})
        await until(lambda: not made.utterances.qsize() and "went unheard" in capsys.readouterr().out)
        it.wire.heal("/rise")
        made.take_string({"data": "hello again"})
        await until(lambda: it.value("RecognizedSpeech") == "hello again")


# --- gaze trigger -----------------------------------------------------------------------------------------------------


@asynccontextmanager
async def gaze(it: Lab, dwell: float = 0.1, away: float = 2.0, *regions: str) -> AsyncIterator[GazeTrigger]:
    session = SessionClient(it.transport("/gaze_trigger"))
    made = GazeTrigger(session, LookTimer(dwell, 0.0, away), [Region(each) for each in regions])
    it.run(made.work())
    yield made


async def look(trigger: Callable[[], None], true: Callable[[], Any]) -> None:
    """Look there until something is true."""

    def looking() -> Any:
        trigger()
        return true()

    await until(looking)


async def test_a_look_that_lasts_raises_one_event(tmp_path: Path) -> None:
    async with lab(tmp_path) as it, gaze(it) as trigger:
        await it.begin("Opening", "Nobody")
        trigger.take_name({"data": "robot"})
        await look(lambda: trigger.take_name({"data": "/robot"}), lambda: it.state("Opening") == "Welcome")
        trigger.take_name({"data": "door"})  # a glance elsewhere, too short to count
        await look(lambda: trigger.take_name({"data": "robot"}), lambda: it.state("Opening") == "Conversation")
        assert it.events() == ["gaze/robot"]
        await it.until_in("Opening", "Default pose")  # no message any more: nobody is there
        assert it.events() == ["gaze/robot", "gaze/nothing", "conversation_over"]


async def test_points_in_named_regions(tmp_path: Path) -> None:
    async with lab(tmp_path) as it, gaze(it, 0.05, 1.5, "robot=0,0,1.2,0.3", "door=-2,3,1,0.5") as trigger:
        it.transport("/eyes").subscribe("/gaze", "geometry_msgs/msg/PointStamped", trigger.take_point)
        eyes = it.publisher("/gaze", "geometry_msgs/msg/PointStamped")

        def at(x: float, y: float, z: float) -> Callable[[], None]:
            return lambda: eyes.publish({"point": {"x": x, "y": y, "z": z}})

        await look(at(0.1, 0.1, 1.3), lambda: it.events() == ["gaze/robot"])
        await look(at(-2.3, 3.0, 1.0), lambda: it.events() == ["gaze/robot", "gaze/door"])
        await look(at(float("nan"), 0.0, 0.0), lambda: it.events() == ["gaze/robot", "gaze/door", "gaze/nothing"])


@pytest.mark.parametrize("wrong", ["robot", "robot=1,2,3", "robot=1,2,3,4,5", "=1,2,3,4", "robot=a,b,c,d"])
def test_what_is_no_region(wrong: str) -> None:
    with pytest.raises(ArgumentTypeError, match="not of the form NAME=X,Y,Z,RADIUS"):
        Region(wrong)


class Eyes:
    """Looks by the clock, and what has lasted."""

    def __init__(self, dwell: float = 0.8, gap: float = 0.3, away: float = 10.0) -> None:
        self.dwell, self.now = LookTimer(dwell, gap, away), 0.0
        self.raised: list[tuple[float, str]] = []

    def on(self, target: str, seconds: float) -> None:
        """Ten words a second about one thing."""
        for _ in range(round(seconds * 10)):
            self.dwell.update(target, self.now)
            self.pass_time(0.1)

    def pass_time(self, seconds: float) -> None:
        for _ in range(round(seconds * 50)):
            self.now = round(self.now + 0.02, 6)
            if target := self.dwell.take_completed_look(self.now):
                self.raised.append((round(self.now, 1), target))


@pytest.mark.parametrize("meanwhile", [NOTHING, "door"])
def test_a_blink_ends_no_look(meanwhile: str) -> None:
    eyes = Eyes()
    eyes.on("robot", 0.5)
    eyes.on(meanwhile, 0.2)
    eyes.on("robot", 0.5)
    assert eyes.raised == [(0.8, "robot")]
    eyes.on(meanwhile, 0.2)
    eyes.on("robot", 2.0)
    assert len(eyes.raised) == 1, "and begins no second one"


def test_a_tracker_that_is_silent_during_a_blink() -> None:
    eyes = Eyes()
    eyes.on("robot", 0.5)
    eyes.pass_time(0.25)
    eyes.on("robot", 0.2)
    assert eyes.raised == [(0.8, "robot")]


def test_what_is_longer_than_a_blink_ends_the_look() -> None:
    eyes = Eyes()
    eyes.on("robot", 0.7)
    eyes.on("door", 0.5)  # has turned away: the look at the robot was too short
    assert eyes.raised == []
    eyes.on("robot", 0.7)
    eyes.on(NOTHING, 0.4)
    assert eyes.raised == []
    eyes.on("door", 0.9)
    assert [target for _, target in eyes.raised] == ["door"]


def test_eyes_that_wander_look_at_nothing_for_long() -> None:
    eyes = Eyes()
    eyes.on("robot", 0.6)
    for _ in range(20):
        eyes.on("door", 0.2)
        eyes.on("window", 0.2)
        eyes.on("floor", 0.2)
    assert eyes.raised == []
    eyes.on("robot", 0.7)
    assert eyes.raised == [], "what was seen before counts no more"


def test_a_look_during_which_the_person_has_just_turned_away_is_not_called_long_enough() -> None:
    eyes = Eyes()
    eyes.on("robot", 0.7)
    eyes.on(NOTHING, 5.0)
    assert eyes.raised == []


@pytest.mark.parametrize("first", [True, False])
async def test_feature_nodes_hear_publishers_that_promise_nothing(first: bool) -> None:
    """Trackers and recognisers publish best effort; of those a reliable subscription hears nothing, silently."""
    wire = MemoryWire()
    loop = asyncio.get_running_loop()
    heard: list[str] = []
    sensor = MemoryTransport(wire, loop, "/sensor")
    tracker = sensor.publisher("/gaze", "std_msgs/msg/String", QoS(reliable=False)) if first else None
    made = TopicListener(
        MemoryTransport(wire, loop, "/node"),
        "gaze",
        "std_msgs/msg/String",
        lambda m: heard.append(m["data"]),
        interval=0.01,
    )
    reliable = sensor.publisher("/gaze", "std_msgs/msg/String")
    reliable.publish({"data": "at once"})
    await until(lambda: heard == ["at once"])
    tracker = tracker or sensor.publisher("/gaze", "std_msgs/msg/String", QoS(reliable=False))
    await until(tracker.count_subscribers)
    tracker.publish({"data": "robot"})
    await until(lambda: heard == ["at once", "robot"])
    reliable.publish({"data": "door"})
    await until(lambda: heard == ["at once", "robot", "door"])
    made.close()
    assert not tracker.count_subscribers()


async def test_what_is_promised_is_asked_for() -> None:
    """A text that somebody said once must not get lost because the subscription did not ask for it again."""
    wire = MemoryWire()
    loop = asyncio.get_running_loop()
    node, mouth = MemoryTransport(wire, loop, "/node"), MemoryTransport(wire, loop, "/mouth")
    mouth.publisher("/speech", "std_msgs/msg/String")
    made = TopicListener(node, "speech", "std_msgs/msg/String", lambda m: None, interval=0.001)
    await asyncio.sleep(0.05)
    assert [each.qos.reliable for each in node.subscriptions] == [True]
    made.close()


async def test_a_node_says_why_it_hears_nothing() -> None:
    wire = MemoryWire()
    loop = asyncio.get_running_loop()
    said: list[str] = []
    heard: list[Message] = []
    node = MemoryTransport(wire, loop, "/node")
    TopicListener(node, "gaze", "std_msgs/msg/String", heard.append, report=said.append, interval=0.01, patience=0.02)
    await until(lambda: said)
    assert said == ["nobody publishes on /gaze (yet); is its node running, and is the topic called so?"]
    sensor = MemoryTransport(wire, loop, "/sensor")
    wrong = sensor.publisher("/gaze", "geometry_msgs/msg/PointStamped")
    await until(lambda: len(said) == 2)
    assert said[1] == (
        "geometry_msgs/msg/PointStamped is published on /gaze, and this node hears std_msgs/msg/String: "
        "nothing of it arrives"
    )
    wrong.close()
    sensor.publisher("/gaze", "std_msgs/msg/String").publish({"data": "robot"})
    await until(lambda: heard)


async def test_a_node_takes_nothing_of_another_version() -> None:
    """A place that is read as another one would raise the wrong event, and nobody would know."""
    wire = MemoryWire()
    loop = asyncio.get_running_loop()
    said: list[str] = []
    heard: list[Message] = []
    sensor = MemoryTransport(wire, loop, "/sensor")
    sensor.hashes["std_msgs/msg/String"] = "RIHS01_other"
    publisher = sensor.publisher("/gaze", "std_msgs/msg/String")
    node = MemoryTransport(wire, loop, "/node")
    made = TopicListener(
        node, "gaze", "std_msgs/msg/String", heard.append, report=said.append, interval=0.01, patience=0.02
    )
    publisher.publish({"data": "at once"})
    await until(lambda: said)
    assert said[0].startswith(
        "the node /sensor publishes /gaze with another version of std_msgs/msg/String than this node listens for"
    )
    assert heard == []
    sensor.hashes.clear()
    await until(lambda: not made._other_versions)
    publisher.publish({"data": "robot"})
    await until(lambda: heard == [{"data": "robot"}])
    made.close()


# --- answer node ------------------------------------------------------------------------------------------------------


def answer_node(it: Lab, server: ModelServer, **more: Any) -> AnswerNode:
    options = {
        "rule": "Conversation", "state": "Thinking", "question_key": "RecognizedSpeech",
        "answer_key": "GeneratedAnswer", "act": "R_Answer", "event": None, "failure_event": "/answer_failed",
        "fallback": "I do not know.", "base_url": server.url, "model": "small", "timeout": 5.0,
    }  # fmt: skip
    session = SessionClient(it.transport("/answer_node"))
    made = AnswerNode(session, Namespace(**{**options, **more}), SYSTEM, "secret")
    session.watch_rule_states(made.take_rule_state)
    return made


async def ask(it: Lab, question: str) -> None:
    await it.client.assign("RecognizedSpeech", question)
    await it.client.raise_event("/H_question")


async def test_a_question_is_answered_and_the_answer_is_said(tmp_path: Path, model_server: ModelServer) -> None:
    async with lab(tmp_path, speed=WITH_MODEL) as it:
        await it.begin()
        answer_node(it, model_server)
        model_server.answer = "  We have\n three. "
        await ask(it, "How many “robots” do you have?")
        await it.until_in("Conversation", "Answering")
        assert it.value("GeneratedAnswer") == "We have three."
        await it.until_in("Conversation", "Listening")
        assert it.said()[-1] == "We have three."
        assert it.value("questions_without_answer") == 0
        (request,) = model_server.requests
        assert request.path == "/v1/chat/completions"
        assert request.headers["Authorization"] == "Bearer secret"
        assert request.body == {
            "model": "small",
            "messages": [
                {"role": "system", "content": SYSTEM},
                {"role": "user", "content": "How many “robots” do you have?"},
            ],
        }


@pytest.mark.parametrize("how", ["error", "garbage", "empty", "no choices", "broken off", "nobody"])
async def test_without_an_answer_there_is_the_fallback(tmp_path: Path, model_server: ModelServer, how: str) -> None:
    async with lab(tmp_path, speed=WITH_MODEL) as it:
        await it.begin()
        model_server.how = how
        answer_node(it, model_server, **({"base_url": "http://127.0.0.1:1/v1"} if how == "nobody" else {}))
        await ask(it, "Why?")
        await it.until_in("Conversation", "Answering")
        await it.until_in("Conversation", "Listening")
        assert it.said()[-1] == "I do not know."
        assert it.events()[-2:] == ["H_question", "answer_failed"]
        assert it.value("questions_without_answer") == 1


async def test_a_model_that_takes_too_long(tmp_path: Path, model_server: ModelServer) -> None:
    async with lab(tmp_path, speed=1.0) as it:
        await it.begin()
        model_server.how = "hang"
        answer_node(it, model_server, timeout=0.2)
        await ask(it, "Why?")
        await it.until_in("Conversation", "Answering")
        assert it.value("GeneratedAnswer") == "I do not know."
        assert "answer_failed" in it.events()


async def test_an_answer_that_comes_when_the_rule_has_gone_on_is_not_said(
    tmp_path: Path, model_server: ModelServer
) -> None:
    async with lab(tmp_path) as it:  # 15 s of the rule pass in less than one
        await it.begin()
        model_server.how = "hang"
        made = answer_node(it, model_server)
        await ask(it, "Why?")
        await it.until_in("Conversation", "No answer")
        await until(lambda: made.thinking is not None and made.thinking.cancelled())
        model_server.let_go()
        await it.until_in("Conversation", "Listening")
        assert it.value("GeneratedAnswer") == ""
        assert "R_Answer" not in [view.behavior for view in it.session.hub.view.tasks.values()]


async def test_the_rule_may_say_the_answer_itself(tmp_path: Path, model_server: ModelServer) -> None:
    async with lab(tmp_path, speed=1.0) as it:
        await it.begin()
        answer_node(it, model_server, act=None, event="/answer_ready")
        await ask(it, "Why?")
        await until(lambda: it.events()[-1:] == ["answer_ready"])
        assert it.value("GeneratedAnswer") == "Because."


# --- figure 8 ---------------------------------------------------------------------------------------------------------


async def test_the_loop_of_figure_8(tmp_path: Path, model_server: ModelServer) -> None:
    async with lab(tmp_path, speed=5.0) as it, gaze(it) as trigger:
        await it.begin("Opening", "Nobody")
        made = spotter(it)
        answer_node(it, model_server)
        await look(lambda: trigger.take_name({"data": "robot"}), lambda: it.state("Opening") == "Conversation")
        made.take_string({"data": "Do you dream?"})
        await look(lambda: trigger.take_name({"data": "robot"}), lambda: "Because." in it.said())
        assert it.value("questions") == 1
        records = [json.loads(each["json"]) for each in it.wire.messages("/rise/record")]
        sources = {record["source"] for record in records if record["kind"] == "task"}
        assert sources == {"ros:domain_task", "rule:Opening", "rule:Conversation"}


# --- running ----------------------------------------------------------------------------------------------------------


async def test_what_waits_outside_keeps_nobody_from_ending() -> None:
    assert await run_node.run_in_thread(lambda a: a + 1, 2) == 3
    with pytest.raises(ValueError, match="no"):
        await run_node.run_in_thread(int, "no")
    hanging = asyncio.ensure_future(run_node.run_in_thread(__import__("time").sleep, 0.2))
    await asyncio.sleep(0)
    hanging.cancel()
    with pytest.raises(asyncio.CancelledError):
        await hanging


async def test_the_node_of_the_documentation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (LAB.parents[1] / "docs" / "how-to" / "feature-nodes.md").read_text("utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    made: dict[str, Any] = {}
    monkeypatch.setattr(
        run_node, "run_node", lambda parser, work: made.update(options=parser.parse_args([]), work=work)
    )
    exec(code, {})
    async with lab(tmp_path) as it:
        it.run(made["work"](it.transport("/distance_node"), made["options"]))
        await asyncio.sleep(0)
        sensor = it.publisher("/distance", "std_msgs/msg/Float64")
        sensor.publish({"data": 1.0})
        await until(lambda: "person_near" in it.session.hub.view.memory and it.value("person_near") is True)
        sensor.publish({"data": 1.2})
        sensor.publish({"data": 3.0})
        await until(lambda: it.value("person_near") is False)

"""Feature node: receives what was said as a text, writes it into the memory, and raises the event of the first keyword
in it. Arrows (1) to (3) of figure 8 of the RISE paper, after a speech recogniser.

    python -m rise_ros.examples.keyword_spotter --keyword "goodbye,bye bye=/H_goodbye" --otherwise /H_question

Copy this file for your own node. All that it knows about RISE is `SessionClient`.
"""

from __future__ import annotations

import asyncio
import re
from argparse import ArgumentTypeError, Namespace

from rise_adapters.ros2.transport.port import Message, Transport

from rise_ros.examples.run_node import node_parser, run_node
from rise_ros.examples.session_client import SessionClient, SessionGoneError
from rise_ros.examples.topic_listener import TopicListener


class Keyword:
    """`hello,good morning=/H_greets`: words or phrases, and the event that they raise."""

    def __init__(self, text: str) -> None:
        self.text = text
        phrases, equals, self.event = text.rpartition("=")
        self.phrases = [" ".join(split_words(phrase)) for phrase in phrases.split(",") if split_words(phrase)]
        if not equals or not self.event.strip() or not self.phrases:
            raise ArgumentTypeError(f"{text!r} is not of the form WORD,ANOTHER WORD=/EVENT")

    def __str__(self) -> str:
        return self.text

    def find_phrase(self, utterance: str) -> str | None:
        heard = f" {' '.join(split_words(utterance))} "
        return next((phrase for phrase in self.phrases if f" {phrase} " in heard), None)


def split_words(text: str) -> list[str]:
    """The words in lower case, without punctuation."""
    return re.findall(r"[^\W_]+(?:['\u2019][^\W_]+)*", text.casefold())


class KeywordSpotter:
    """Handles utterances one after the other, in order."""

    def __init__(self, session: SessionClient, keywords: list[Keyword], key: str, otherwise: str | None) -> None:
        self.session, self.keywords, self.key, self.otherwise = session, keywords, key, otherwise
        self.utterances: asyncio.Queue[str] = asyncio.Queue()

    def take_string(self, message: Message) -> None:
        self.utterances.put_nowait(message["data"])

    def take_live_speech(self, message: Message) -> None:
        """Take only whole utterances: `incremental` changes while the person speaks."""
        self.utterances.put_nowait(message["final"])

    async def work(self) -> None:
        while True:
            utterance = (await self.utterances.get()).strip()
            if not utterance:
                continue
            try:
                await self.handle_utterance(utterance)
            except SessionGoneError as error:
                print(f'"{utterance}" went unheard: {error}')

    async def handle_utterance(self, utterance: str) -> None:
        # First the memory, then the event, so that the rule that takes the event can rely on the memory.
        await self.session.assign(self.key, utterance)
        event, why = self.otherwise, "no key word"
        for keyword in self.keywords:
            if phrase := keyword.find_phrase(utterance):
                event, why = keyword.event, phrase
                break
        if event:
            await self.session.raise_event(event)
        print(f'"{utterance}": {why} -> {event or "no event"}')


async def work(transport: Transport, options: Namespace) -> None:
    spotter = KeywordSpotter(SessionClient(transport), options.keyword, options.key, options.otherwise)
    if options.live_speech:
        TopicListener(transport, options.topic, "hri_msgs/msg/LiveSpeech", spotter.take_live_speech)
    else:
        TopicListener(transport, options.topic, "std_msgs/msg/String", spotter.take_string)
    print(f"listening to {transport.resolve(options.topic)} ({transport.about})")
    await spotter.work()


def main() -> None:
    parser = node_parser("keyword_spotter", "Writes what was said into the memory, and raises an event for key words.")
    parser.add_argument("--topic", default="speech", help="where the text comes from (default: %(default)s)")
    parser.add_argument("--live-speech", action="store_true", help="it is hri_msgs/LiveSpeech, not std_msgs/String")
    parser.add_argument("--key", default="RecognizedSpeech", help="the memory key (default: %(default)s)")
    parser.add_argument("--keyword", type=Keyword, action="append", default=[], metavar="WORD,...=/EVENT")
    parser.add_argument("--otherwise", metavar="/EVENT", help="the event when no key word was said; default: none")
    run_node(parser, work)


if __name__ == "__main__":
    main()

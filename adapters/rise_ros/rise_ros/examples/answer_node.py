"""Feature node: when a rule enters a state, it asks a language model for an answer to a text in the memory, writes the
answer into the memory, and starts the act that says it. Arrows (4) to (8) of figure 8 of the RISE paper.

    python -m rise_ros.examples.answer_node --rule Conversation --state Thinking --act R_Answer \\
        --base-url http://localhost:8080/v1 --model local

Any model works that answers `POST BASE_URL/chat/completions` like OpenAI's: llama.cpp, Ollama, vLLM, GPT4All, or a
service. A key, if needed, comes from the environment: OPENAI_API_KEY (and OPENAI_BASE_URL, OPENAI_MODEL).

Copy this file for your own node. All that it knows about RISE is `SessionClient`.
"""

from __future__ import annotations

import asyncio
import json
import os
from argparse import Namespace
from http.client import HTTPException
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

from rise_adapters.ros2.transport.port import Message, Transport

from rise_ros.examples.run_node import NodeError, node_parser, run_in_thread, run_node, wait_forever
from rise_ros.examples.session_client import SessionClient, SessionGoneError

SYSTEM = "You are a robot that talks with a visitor. Answer in one or two short sentences that can be spoken aloud."
LONGEST = 2_000_000
"""Maximum number of bytes of an answer."""


def ask_model(url: str, model: str, key: str, system: str, question: str, seconds: float) -> str:
    """Return the model's answer. Blocks, so call it in a thread. Raises OSError, ValueError, LookupError."""
    messages = [{"role": "system", "content": system}, {"role": "user", "content": question}]
    body = json.dumps({"model": model, "messages": messages}).encode()
    headers = {"Content-Type": "application/json", **({"Authorization": f"Bearer {key}"} if key else {})}
    try:
        with urlopen(Request(f"{url}/chat/completions", body, headers), timeout=seconds) as answer:
            text = json.loads(answer.read(LONGEST))["choices"][0]["message"]["content"]
    except HTTPError as error:
        error.close()
        raise
    if not isinstance(text, str) or not text.strip():
        raise ValueError("the answer is empty")
    return " ".join(text.split())


class AnswerNode:
    """Handles one question at a time: the latest."""

    def __init__(self, session: SessionClient, options: Namespace, system: str, key: str) -> None:
        self.session, self.options, self.system, self.key = session, options, system, key
        self.url = options.base_url.rstrip("/")
        self.thinking: asyncio.Task[None] | None = None
        """The running request, cancelled when the rule leaves its state. An answer that has arrived is always used."""

    def take_rule_state(self, message: Message) -> None:
        if message["rule"] != self.options.rule or message["status"] not in ("entered", "ended", "stopped", "faulted"):
            return
        if self.thinking is not None:
            self.thinking.cancel()  # the rule has left its state: an answer would be too late
        if message["status"] == "entered" and message["state"] == self.options.state:
            self.thinking = asyncio.get_running_loop().create_task(self.answer_question())

    async def answer_question(self) -> None:
        options, session = self.options, self.session
        try:
            question = str(await session.read_memory(options.question_key, ""))
            print(f'asked "{question}"')
            try:
                async with asyncio.timeout(options.timeout):
                    answer = await run_in_thread(
                        ask_model, self.url, options.model, self.key, self.system, question, options.timeout
                    )
            except (OSError, HTTPException, ValueError, LookupError, TypeError) as error:
                print(f"no answer: {error or type(error).__name__}")
                answer = options.fallback
                await session.raise_event(options.failure_event)
            self.thinking = None
            await session.assign(options.answer_key, answer)
            print(f'answered "{answer}"')
            if options.event:
                await session.raise_event(options.event)
            if options.act:
                result = await session.start_act(options.act)
                print(f"{options.act} {result.status.lower()}{result.reason and ': ' + result.reason}")
        except SessionGoneError as error:
            print(f"the question failed: {error}")


async def work(transport: Transport, options: Namespace) -> None:
    try:
        system = options.system.read_text(encoding="utf-8") if options.system else SYSTEM
    except (OSError, UnicodeDecodeError) as error:
        raise NodeError(f"the system prompt cannot be read: {error}") from error
    if not options.base_url.startswith(("http://", "https://")):
        raise NodeError(f"--base-url is an address such as http://localhost:8080/v1, not {options.base_url}")
    session = SessionClient(transport)
    node = AnswerNode(session, options, system, os.environ.get("OPENAI_API_KEY", ""))
    session.watch_rule_states(node.take_rule_state)
    print(f"answers when {options.rule} enters {options.state}, by {options.base_url} ({transport.about})")
    await wait_forever()


def main() -> None:
    parser = node_parser("answer_node", "Answers questions by a language model.")
    parser.add_argument("--rule", required=True, help="the rule whose state asks for an answer")
    parser.add_argument("--state", required=True, help="that state")
    parser.add_argument("--question-key", default="RecognizedSpeech", help="memory key (default: %(default)s)")
    parser.add_argument("--answer-key", default="GeneratedAnswer", help="memory key (default: %(default)s)")
    parser.add_argument("--act", help="the act that says the answer; it is started")
    parser.add_argument("--event", metavar="/EVENT", help="an event to raise when the answer is in the memory")
    parser.add_argument("--failure-event", default="/answer_failed", metavar="/EVENT", help="(default: %(default)s)")
    parser.add_argument("--fallback", default="I am sorry, I cannot answer that now.", help="the answer when none came")
    parser.add_argument("--base-url", default=os.environ.get("OPENAI_BASE_URL", "http://localhost:8080/v1"))
    parser.add_argument("--model", default=os.environ.get("OPENAI_MODEL", "local"))
    parser.add_argument("--system", type=Path, metavar="FILE", help="a file with the system prompt: who the robot is")
    parser.add_argument("--timeout", type=float, default=10, help="seconds for an answer (default: %(default)s)")
    run_node(parser, work)


if __name__ == "__main__":
    main()

"""A language model for tests: `POST /v1/chat/completions` on this machine, right or wrong on request."""

from __future__ import annotations

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from msgspec import Struct


class Request(Struct):
    path: str
    headers: dict[str, str]
    body: Any


class ModelServer:
    def __init__(self) -> None:
        self.answer = "Because."
        self.how = "right"
        self.requests: list[Request] = []
        self._go = threading.Event()
        server = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                server.requests.append(Request(self.path, dict(self.headers), body))
                server._reply(self)

            def log_message(self, format: str, *args: Any) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.01,), daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._server.server_address[1]}/v1"

    def let_go(self) -> None:
        """Answer those that hang."""
        self._go.set()

    def close(self) -> None:
        self.let_go()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def _reply(self, handler: BaseHTTPRequestHandler) -> None:
        if self.how == "hang":
            self._go.wait(30)
        answer: Any = {"choices": [{"message": {"role": "assistant", "content": self.answer}}]}
        if self.how == "empty":
            answer["choices"][0]["message"]["content"] = " "
        elif self.how == "no choices":
            answer = {"choices": []}
        data = b"<html>" if self.how == "garbage" else json.dumps(answer).encode()
        try:
            handler.send_response(500 if self.how == "error" else 200)
            handler.send_header("Content-Type", "application/json")
            handler.send_header("Content-Length", str(len(data)))
            handler.end_headers()
            handler.wfile.write(data[:40] if self.how == "broken off" else data)
        except OSError:
            pass  # who asked has gone

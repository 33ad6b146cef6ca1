"""Who gets in: whoever has the token, from a page of ours, by a name of this machine. Pure.

The port is open to every user of the machine, and every page that a browser shows can send requests to it. So there is
a token that nobody can guess; a cookie that no other site's requests carry; and the two headers that no page can forge:
by which name the browser came here (`Host`), and whose page opens a connection (`Origin`).
"""

from __future__ import annotations

import re
from hmac import compare_digest
from secrets import token_hex, token_urlsafe

_LOCAL = re.compile(r"(?:127\.0\.0\.1|localhost|\[::1\])(?::\d{1,5})?")
"""Any port: the far end of an SSH tunnel has its own."""


class TokenAuth:
    """The token of one server."""

    def __init__(self) -> None:
        self.token = token_urlsafe(32)
        self.cookie = f"rise-tui-{token_hex(4)}"
        """Its own for each server, because a browser keeps one set of cookies for all ports of a machine."""

    def is_token(self, token: str | None) -> bool:
        """In a time that says nothing about how much of it is right."""
        return compare_digest((token or "").encode("utf-8", "surrogatepass"), self.token.encode())

    @staticmethod
    def is_local_host(host: str | None) -> bool:
        """Another name that leads here is an attack: a page of that name could read what is answered."""
        return host is not None and _LOCAL.fullmatch(host) is not None

    @staticmethod
    def is_own_origin(origin: str | None, host: str) -> bool:
        """Whether a connection is opened by a page that came from here."""
        return origin == f"http://{host}"

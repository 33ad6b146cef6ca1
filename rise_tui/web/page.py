"""The page in the browser: a terminal, and nothing from any other host."""

from __future__ import annotations

from html import escape

STATIC = "/static"
"""Where the terminal's script, style and font lie (those of textual-serve)."""

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{title}</title>
<link rel="icon" href="data:,">
<link rel="stylesheet" href="{static}/css/xterm.css">
<script src="{static}/js/textual.js"></script>
<style>
@font-face {{ font-family: "Roboto Mono"; src: url("{static}/fonts/RobotoMono-VariableFont_wght.ttf"); }}
html, body {{ margin: 0; height: 100%; background: #12151a; color: #d7dce2;
  font: 16px "Roboto Mono", Menlo, monospace; overflow: hidden; }}
.textual-terminal {{ position: absolute; inset: 0; }}
.notice {{ position: absolute; inset: 0; display: none; align-items: center; justify-content: center; z-index: 10;
  background: #12151ae0; text-align: center; }}
body:not(.-first-byte):not(.-closed) .waiting, body.-closed .ended {{ display: flex; }}
a {{ color: #8ab4f8; }}
</style>
</head>
<body>
<div class="notice waiting"><p>{title}: the console comes</p></div>
<div class="notice ended"><p>This console has ended; the session is not touched by that.<br><br><a href="/">Open it
again</a></p></div>
<div id="terminal" class="textual-terminal" data-session-websocket-url="ws://{host}/ws" data-font-size="{size}"></div>
</body>
</html>
"""

_WELCOME = """<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><meta http-equiv="refresh" content="0;url=/?fontsize={size}"><title>rise-tui</title></head>
<body><a href="/?fontsize={size}">The console</a></body>
</html>
"""


def console_page(title: str, host: str, font_size: int) -> str:
    """The terminal. `host`: by which name the browser came here, checked already."""
    return _PAGE.format(title=escape(title), static=STATIC, host=escape(host), size=font_size)


def token_page(font_size: int) -> str:
    """What the address with the token shows: on to the address without it.

    A redirection would not do: after one, a browser that followed a link on another site leaves the cookie out.
    """
    return _WELCOME.format(size=font_size)


def security_headers(host: str) -> dict[str, str]:
    """What keeps a browser from loading anything from elsewhere, and the token from going anywhere."""
    policy = {
        "default-src": "'none'",
        "script-src": "'self'",
        "style-src": "'self' 'unsafe-inline'",
        "font-src": "'self'",
        "img-src": "'self' data:",
        "connect-src": f"'self' ws://{host}",
        "base-uri": "'none'",
        "form-action": "'none'",
        "frame-ancestors": "'none'",
    }
    return {
        "Content-Security-Policy": "; ".join(f"{name} {value}" for name, value in policy.items()),
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cache-Control": "no-store",
    }

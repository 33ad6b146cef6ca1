"""HTML of text that others wrote: nothing in it becomes an element, an address or a script.

A report's file must hold no address at all, so that anybody can see with one search that it fetches nothing. Texts may
name one; they are written so that they read the same and can never be taken for one.
"""

from __future__ import annotations

import re
from html import escape as escape_html

from rise_engine.base.text import clean

_ADDRESSES = re.compile(r"http|url\(", re.IGNORECASE)


def escape(text: str) -> str:
    """A text for the inside of an element or an attribute: unseen characters marked, everything else as it reads.

    >>> escape("<b>see http://x</b>")
    '&lt;b&gt;see &#104;ttp://x&lt;/b&gt;'
    """
    safe = escape_html(clean(text), quote=True)
    return _ADDRESSES.sub(lambda found: f"&#{ord(found[0][0])};{found[0][1:]}", safe)


def element(tag: str, inner: str = "", **attributes: str) -> str:
    """An element.

    :param tag: its name.
    :param inner: markup, made by this module.
    :param attributes: texts by name; `class_` is `class`, `_` stands for `-`. Empty ones are left out.
    """
    given = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(value)}"' for name, value in attributes.items() if value
    )
    return f"<{tag}{given}>{inner}</{tag}>"

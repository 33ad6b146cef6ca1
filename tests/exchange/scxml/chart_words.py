"""Words to write charts with, shorter than XML."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr


def element(tag: str, *inside: str, **attributes: str) -> str:
    written = "".join(f" {name.rstrip('_')}={quoteattr(value)}" for name, value in attributes.items() if value)
    return f"<{tag}{written}>{''.join(inside)}</{tag}>"


def chart(*inside: str, data: dict[str, str] | None = None, **attributes: str) -> str:
    """A whole document, with the final states `pass` and `fail`; `data` are variables with their expressions."""
    variables = "".join(element("data", id=name, expr=value) for name, value in (data or {}).items())
    ends = element("final", id="pass") + element("final", id="fail")
    model = element("datamodel", variables) if variables else ""
    attributes = {"datamodel": "ecmascript", **attributes}
    return element("scxml", model, *inside, ends, xmlns="http://www.w3.org/2005/07/scxml", version="1.0", **attributes)


def state(id: str, *inside: str, **attributes: str) -> str:
    return element("state", *inside, id=id, **attributes)


def parallel(id: str, *inside: str) -> str:
    return element("parallel", *inside, id=id)


def final(id: str, *inside: str) -> str:
    return element("final", *inside, id=id)


def history(id: str, target: str, *content: str, deep: bool = False) -> str:
    return element("history", on("", target, *content), id=id, type="deep" if deep else "shallow")


def begin(target: str, *content: str) -> str:
    return element("initial", on("", target, *content))


def on(event: str, target: str = "", *content: str, cond: str = "", type: str = "") -> str:
    return element("transition", *content, event=event, target=target, cond=cond, type=type)


def entry(*content: str) -> str:
    return element("onentry", *content)


def leave(*content: str) -> str:
    return element("onexit", *content)


def throw(*events: str) -> str:
    """`<raise>` for each."""
    return "".join(element("raise", event=event) for event in events)


def put(name: str, value: str) -> str:
    """`<assign>`."""
    return element("assign", location=name, expr=value)


def more(name: str, by: str = "1") -> str:
    return put(name, f"{name} + {by}")


def send(event: str, **attributes: str) -> str:
    return element("send", event=event, **attributes)


def when(cond: str, *content: str) -> str:
    return element("if", *content, cond=cond)


def each(item: str, array: str, *content: str, index: str = "") -> str:
    return element("foreach", *content, item=item, array=array, index=index)


def other(cond: str = "") -> str:
    """`<else/>`, or `<elseif/>` with a condition."""
    return element("elseif", cond=cond) if cond else "<else/>"


def script(text: str) -> str:
    return f"<script>{text}</script>"


def judge(cond: str, id: str = "judge") -> str:
    """A state that knows the answer: on to `pass` if the condition holds, else to `fail`."""
    return state(id, on("", "pass", cond=cond), on("", "fail"))

"""What rules cannot keep: the kinds of reasons, the tests of the W3C suite that have them, and charts of our own."""

from __future__ import annotations

from tests.exchange.scxml.chart_words import chart, each, element, entry, final, on, put, script, send, state, throw

_DATA = {"n": "1"}
_VALUE = element("param", name="x", expr="n")


def _ending(*inside: str) -> str:
    return chart(
        state("a", state("b", on("x", "f")), element("final", element("donedata", *inside), id="f")), data=_DATA
    )


REFUSED: dict[str, tuple[str, tuple[str, ...]]] = {
    "invoke": (
        "187 191 192 207 215 216 220 223 224 225 226 228 229 232 233 234 235 236 237 239 240 241 242 243 244 245 247 "
        "252 253 276 338 347 422 530 554",
        (
            chart(state("a", element("invoke", type="scxml", src="other.scxml"), on("done.invoke", "pass"))),
            chart(state("a", entry(send("x", target="#_parent")))),
        ),
    ),
    "payload": (
        "176 179 186 205 331 332 333 351 354",
        (
            chart(state("a", entry(element("send", _VALUE, event="e")), on("e", "pass")), data=_DATA),
            chart(state("a", entry(element("send", "<content>5</content>", event="e")), on("e", "pass"))),
            chart(state("a", on("e", "pass", cond="_event.data == 5"))),
            chart(state("a", on("e", "pass", cond="_event.type == 'external'"))),
            chart(state("a", on("e", "pass", cond="_event.sendid"))),
        ),
    ),
    "donedata": ("294 298 343 488 527 528 529", (_ending(_VALUE), _ending("<content>5</content>"))),
    "computed": (
        "172 173 174 175 190 210 336 342 349 350 501",
        (
            chart(state("a", entry(element("send", eventexpr="n"))), data=_DATA),
            chart(state("a", entry(send("e", targetexpr="n"))), data=_DATA),
            chart(state("a", entry(send("e", typeexpr="n"))), data=_DATA),
            chart(state("a", entry(send("e", delayexpr="n"))), data=_DATA),
            chart(state("a", entry(element("cancel", sendidexpr="n"))), data=_DATA),
            chart(
                state("a", on("e", "b"), on("f", "b")),
                state("b", on("", "pass", cond="_event.name == 'e'")),
                data=_DATA,
            ),
            chart(state("a", on("", "pass", cond="In(n)")), data=_DATA),
        ),
    ),
    "system-variable": (
        "198 319 321 322 323 324 325 326 329 330 337 346 352 500",
        (
            chart(state("a", on("e", "pass", cond="_event.origintype == 'x'"))),
            chart(state("a", on("", "pass", cond="_event"))),
            chart(state("a", on("", "pass", cond="'name' in _event"))),
            chart(state("a", on("", "pass", cond="_sessionid"))),
            chart(state("a", on("", "pass", cond="_name == 'x'"))),
            chart(state("a", on("", "pass", cond="_ioprocessors"))),
            chart(state("a", entry(put("_name", "'x'")))),
        ),
    ),
    "data": (
        "277 280 552",
        (
            chart(state("a", on("", "pass")), data={"n": "return"}),
            chart(state("a", element("datamodel", element("data", id="m", expr="n"))), data=_DATA, binding="late"),
            chart(element("datamodel", element("data", id="n", src="file.txt")), state("a")),
            chart(element("datamodel", element("data", "<x/>", id="n")), state("a")),
            chart(state("a"), data={"xor": "1"}),
            chart(state("a"), data={"m": "n"}),
            chart(state("a"), datamodel="xpath"),
            chart('<script src="file.js"/>', state("a")),
        ),
    ),
    "idlocation": (
        "183 553",
        (
            chart(state("a", entry(send("e", idlocation="n"))), data=_DATA),
            chart(state("a", entry(send("e", namelist="n"))), data=_DATA),
        ),
    ),
    "condition-error": (
        "344",
        (
            chart(state("a", on("", "fail", cond="return"), on("error.execution", "pass"))),
            chart(state("a", on("", "fail", cond="nobody == 1"), on("error", "pass"))),
        ),
    ),
    "list-arithmetic": (
        "525",
        (
            chart(state("a", entry(put("n", "[].concat(n, [4])"))), data={"n": "[1, 2]"}),
            chart(state("a", entry(each("x", "n", put("n", "[1, x]")))), data={"n": "[1, 2]"}),
        ),
    ),
    "foreign-type": (
        "577 201 509 510 518 519 520 522 531 532 534 567",
        (
            chart(state("a", entry(send("e", type="http://www.w3.org/TR/scxml/#BasicHTTPEventProcessor")))),
            chart(state("a", entry(send("e", target="http://localhost/there")))),
            chart(state("a", entry(send("raiseEventTopic", type="x-rise")))),
        ),
    ),
    # --- not in the suite ---
    "namespace": ("", ('<scxml version="1.0"><state id="a"/></scxml>', "<statechart/>")),
    "expression": (
        "",
        (
            chart(state("a", entry(put("n", "n % 2"))), data=_DATA),
            chart(state("a", entry(put("n", "n / m"))), data={**_DATA, "m": "2"}),
            chart(state("a", entry(put("n", "'a' + n"))), data=_DATA),
            chart(state("a", on("", "pass", cond="n == '1'")), data=_DATA),
            chart(state("a", entry(put("n", "n || 5"))), data=_DATA),
            chart(state("a", on("", "pass", cond="n > 'x'")), data=_DATA),
            chart(state("a", on("", "pass", cond="n ? true : false")), data=_DATA),
            chart(state("a", on("", "pass", cond="n === true")), data=_DATA),
            chart(state("a", on("", "pass", cond="Math.random() > 0.5"))),
            chart(state("a", entry(put("n.part", "2"))), data=_DATA),
            chart(script("function f() {}"), state("a")),
            chart(state("a", on("x", "", put("n", "'text'")), on("", "pass", cond="n")), data=_DATA),
            chart(state("a", on("", "pass", cond="n == 1")), data=_DATA, datamodel="null"),
            chart(state("a", on("", "pass", cond="n == 9007199254740993")), data=_DATA),
            chart(state("a", on("", "pass", cond="n == '\U0001f600'")), data=_DATA),
        ),
    ),
    "endless": (
        "",
        (
            chart(state("a", on(""))),
            chart(state("a", on("", "b")), state("b", on("", "a"))),
            chart(state("a", on("", "", throw("x")))),
        ),
    ),
    "pending": (
        "",
        (chart(state("a", entry(send("late", delay="9s")), on("x", "a")), state("b", on("late", "pass"))),),
    ),
    "delay": ("", (chart(state("a", entry(send("e", delay="3ms")))), chart(state("a", entry(send("e", delay="25h")))))),
    "foreign-element": ("", (chart(state("a", entry('<my:thing xmlns:my="urn:x"/>'))),)),
    "chart": (
        "",
        (
            chart(state("a", on("x", "nobody"))),
            chart(state("a", on("x", "pass", cond="In('nobody')"))),
            chart(state("a"), state("a")),
            chart(state("a", state("b")), state("c"), initial="c b"),
            chart(state("a", state("b"), initial="c"), state("c")),
            chart(state("a", "<transitoin/>")),
            chart(state("a", element("history", id="h"))),
            chart(state("a", on("x", "b c"), state("b"), state("c"))),
            chart(state("a", entry(send("e", delay="soon")))),
            chart(state("a", "<onentry><final/></onentry>")),
            chart(state("a", '<transition colour="red" event="x"/>')),
            chart(final("a", "<transition/>")),
        ),
    ),
}

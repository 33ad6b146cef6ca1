"""A chart of our own for each assertion that the W3C suite (https://www.w3.org/Voice/2013/scxml-irp/) tests, and that
rules can keep: by the number of its test. Each ends in `pass` if what is said beside it holds, and else in `fail`."""

from __future__ import annotations

from tests.exchange.scxml.chart_words import (
    begin,
    chart,
    each,
    element,
    entry,
    final,
    history,
    judge,
    leave,
    more,
    on,
    other,
    parallel,
    put,
    script,
    send,
    state,
    throw,
    when,
)

_BAD = put("nowhere", "1")
"""An assignment that fails: there is no such variable."""
_ORDER = {"seen": "0"}
_NOT_SO = on("*", "fail")


def digit(number: int) -> str:
    """Note a number behind those that were noted before."""
    return put("seen", f"seen * 10 + {number}")


PASSING: dict[str, tuple[str, str]] = {
    # --- flat ---
    "144": (
        "raised events come in the order in which they were raised",
        chart(
            state("a", entry(throw("one", "two", "three")), on("one", "b"), _NOT_SO),
            state("b", on("two", "c"), _NOT_SO),
            state("c", on("three", "pass"), _NOT_SO),
        ),
    ),
    "145": (
        "a transition without event is taken after one with an event",
        chart(state("a", entry(throw("one")), on("one", "b")), state("b", on("", "pass")), initial="a"),
    ),
    "147": (
        "of if and elseif, only the first that holds runs",
        chart(
            state(
                "a",
                entry(when("false", throw("no"), other("n == 0"), throw("yes"), more("n"), other("true"), throw("no"))),
                on("yes", "pass", cond="n == 1"),
                _NOT_SO,
            ),
            data={"n": "0"},
        ),
    ),
    "148": (
        "else runs when nothing before it holds",
        chart(
            state(
                "a",
                entry(when("n > 0", throw("no"), other("n < 0"), throw("no"), other(), throw("yes"))),
                on("yes", "pass"),
                _NOT_SO,
            ),
            data={"n": "0"},
        ),
    ),
    "149": (
        "when nothing holds and there is no else, nothing runs",
        chart(
            state(
                "a",
                entry(when("n > 0", throw("no"), other("n < 0"), throw("no")), throw("yes")),
                on("yes", "pass"),
                _NOT_SO,
            ),
            data={"n": "0"},
        ),
    ),
    "150": (
        "foreach makes the variable for its items when there is none",
        chart(
            state("a", entry(each("fresh", "list")), on("", "b")),
            judge("fresh == 30", "b"),
            data={"list": "[10, 20, 30]"},
        ),
    ),
    "151": (
        "foreach makes the variable for the index when there is none, which counts from 0",
        chart(
            state("a", entry(each("item", "list", index="at")), on("", "b")),
            judge("at == 2 && item == 7", "b"),
            data={"list": "[5, 6, 7]"},
        ),
    ),
    "152": (
        "foreach over no list, or into no variable, is an error, and nothing of it runs",
        chart(
            state("a", entry(each("x", "n", more("n"))), on("error.execution", "b"), on("", "fail", cond="n != 3")),
            state("b", entry(each("'x'", "list", more("n"))), on("error.execution", "c")),
            judge("n == 3", "c"),
            data={"n": "3", "list": "[1, 2]"},
        ),
    ),
    "153": (
        "foreach goes from the first entry to the last",
        chart(
            state("a", entry(each("x", "list", put("seen", "seen * 10 + x"))), on("", "b")),
            judge("seen == 482", "b"),
            data={**_ORDER, "list": "[4, 8, 2]"},
        ),
    ),
    "155": (
        "foreach runs what it holds once for each entry",
        chart(
            state("a", entry(each("x", "list", more("sum", "x"))), on("", "b")),
            judge("sum == 111", "b"),
            data={"sum": "0", "list": "[1, 10, 100]"},
        ),
    ),
    "156": (
        "an error ends foreach",
        chart(
            state("a", entry(each("x", "list", more("n"), _BAD)), on("", "b")),
            judge("n == 1", "b"),
            data={"n": "0", "list": "[1, 2, 3]"},
        ),
    ),
    "158": (
        "content runs in document order",
        chart(
            state("a", entry(digit(1), throw("x"), digit(2)), on("x", "b", digit(3))),
            judge("seen == 123", "b"),
            data=_ORDER,
        ),
    ),
    "159": (
        "an error leaves out the rest of its block",
        chart(
            state("a", entry(more("n"), send("x", target="nobody"), more("n")), on("", "b")),
            judge("n == 1", "b"),
            data={"n": "0"},
        ),
    ),
    "279": (
        "variables have their values from the start, wherever they stand",
        chart(
            state("a", on("", "pass", cond="inner == 5"), on("", "fail")),
            state("b", element("datamodel", element("data", id="inner", expr="5"))),
        ),
    ),
    "286": (
        "to assign to what does not exist is an error",
        chart(state("a", entry(_BAD, throw("x")), on("error.execution", "pass"), _NOT_SO)),
    ),
    "287": (
        "a legal value goes into an existing variable",
        chart(
            state("a", entry(put("word", "'new'")), on("", "pass", cond="word === 'new'"), on("", "fail")),
            data={"word": "'old'"},
        ),
    ),
    "302": ("a script runs when the chart starts", chart(script("n = 7;"), judge("n == 7"))),
    "303": (
        "a script runs where it stands among the content",
        chart(
            state("a", entry(put("n", "2"), script("n = n * 5"), more("n")), on("", "b")),
            judge("n == 11", "b"),
            data={"n": "0"},
        ),
    ),
    "304": (
        "what a script declares is a variable like others",
        chart(script("var n = 1; n += 2"), state("a", entry(more("n")), on("", "b")), judge("n == 4", "b")),
    ),
    "309": (
        "a condition that is none counts as false",
        chart(state("a", on("", "fail", cond="return"), on("", "pass"))),
    ),
    "311": (
        "to assign to a place that cannot be is an error",
        chart(state("a", entry(put("'n'", "1"), throw("x")), on("error.execution", "pass"), _NOT_SO), data={"n": "0"}),
    ),
    "312": (
        "to assign what is no expression is an error",
        chart(
            state("a", entry(put("n", "while"), throw("x")), on("error.execution", "pass"), _NOT_SO), data={"n": "0"}
        ),
    ),
    "318": (
        "the event stays known until the next one",
        chart(
            state("a", entry(throw("one")), on("one", "b")),
            state("b", entry(throw("two"), put("name", "_event.name")), on("", "c")),
            judge("name == 'one'", "c"),
            data={"name": "''"},
        ),
    ),
    "335": (
        "an event from inside has no origin",
        chart(state("a", entry(throw("x")), on("x", "pass", cond="typeof _event.origin == 'undefined'"), _NOT_SO)),
    ),
    "339": (
        "an event that no invoked chart has sent has no invokeid",
        chart(state("a", entry(throw("x")), on("x", "pass", cond="typeof _event.invokeid === 'undefined'"), _NOT_SO)),
    ),
    "355": (
        "without a word about it, a chart begins in its first state",
        chart(state("a", on("", "pass")), state("b", on("", "fail"))),
    ),
    "375": (
        "handlers of entering run in document order",
        chart(state("a", entry(digit(1)), entry(digit(2)), on("", "b")), judge("seen == 12", "b"), data=_ORDER),
    ),
    "376": (
        "an error in one handler of entering leaves the others alone",
        chart(state("a", entry(_BAD, digit(1)), entry(digit(2)), on("", "b")), judge("seen == 2", "b"), data=_ORDER),
    ),
    "377": (
        "handlers of leaving run in document order",
        chart(state("a", leave(digit(1)), leave(digit(2)), on("", "b")), judge("seen == 12", "b"), data=_ORDER),
    ),
    "378": (
        "an error in one handler of leaving leaves the others alone",
        chart(state("a", leave(_BAD, digit(1)), leave(digit(2)), on("", "b")), judge("seen == 2", "b"), data=_ORDER),
    ),
    "396": (
        "what is matched is the name that the event has",
        chart(state("a", entry(throw("x.y")), on("x.y", "pass", cond="_event.name == 'x.y'"), _NOT_SO)),
    ),
    "407": (
        "leaving runs onexit",
        chart(state("a", leave(more("n")), on("", "b")), judge("n == 1", "b"), data={"n": "0"}),
    ),
    "496": (
        "what cannot be delivered is an error of communication",
        chart(
            state("a", entry(send("x", target="#_scxml_42"), throw("y")), on("error.communication", "pass"), _NOT_SO)
        ),
    ),
    "503": (
        "a transition without target does not leave its state",
        chart(
            state(
                "a",
                entry(throw("x", "y")),
                leave(more("left")),
                on("x", "", more("taken")),
                on("y", "b", cond="left == 0 && taken == 1"),
                on("y", "fail"),
            ),
            judge("left == 1", "b"),
            data={"left": "0", "taken": "0"},
        ),
    ),
    "550": ("a variable has the value of its expression", chart(judge("n == 2"), data={"n": "4 - 2"})),
    "551": (
        "a variable has the value that stands in it",
        chart(
            element("datamodel", '<data id="w">  a   b </data>', '<data id="n">12</data>'),
            judge("w == 'a b' && n == 12"),
        ),
    ),
    # --- flat, with what is sent ---
    "185": (
        "what is sent with a delay comes later",
        chart(
            state("a", entry(send("late", delay="600ms"), send("soon")), on("soon", "b"), _NOT_SO),
            state("b", on("late", "pass"), _NOT_SO),
        ),
    ),
    "189": (
        "what is sent to the internal queue comes before what is sent outside earlier",
        chart(state("a", entry(send("x"), send("y", target="#_internal")), on("y", "pass"), _NOT_SO)),
    ),
    "194": (
        "a target that there cannot be is an error",
        chart(state("a", entry(send("x", target="!?"), send("y")), on("error.execution", "pass"), _NOT_SO)),
    ),
    "199": (
        "a type that there cannot be is an error",
        chart(state("a", entry(send("x", type="00"), send("y")), on("error.execution", "pass"), _NOT_SO)),
    ),
    "200": (
        "the standard's own processor is there",
        chart(
            state(
                "a",
                entry(send("x", type="http://www.w3.org/TR/scxml/#SCXMLEventProcessor"), send("y", delay="1s")),
                on("x", "pass"),
                _NOT_SO,
            )
        ),
    ),
    "208": (
        "what is cancelled does not come",
        chart(
            state(
                "a",
                entry(send("x", id="one", delay="200ms"), send("y", delay="400ms"), element("cancel", sendid="one")),
                on("y", "pass"),
                _NOT_SO,
            )
        ),
    ),
    "348": (
        "what is sent has the name that stands there",
        chart(state("a", entry(send("x.y")), on("x.y", "pass"), _NOT_SO)),
    ),
    "401": (
        "errors go into the internal queue",
        chart(state("a", entry(send("x"), _BAD), on("x", "fail"), on("error", "pass"))),
    ),
    "419": (
        "transitions without event come before events",
        chart(state("a", entry(throw("x"), send("y")), on("x", "fail"), on("y", "fail"), on("", "pass"))),
    ),
    "421": (
        "all of the internal queue comes before the external one",
        chart(
            state(
                "a",
                entry(send("out"), throw("one", "two", "three")),
                on("out", "fail"),
                state("b", on("two", "c")),
                state("c", on("three", "pass")),
            )
        ),
    ),
    "423": (
        "what nobody waits for is dropped until something fits",
        chart(
            state("a", entry(send("x"), send("y", delay="300ms"), throw("in")), on("in", "b"), _NOT_SO),
            state("b", on("y", "pass")),
        ),
    ),
    "495": (
        "events go into the queue that they are sent to",
        chart(
            state(
                "a",
                entry(send("out", type="scxml"), send("in", target="#_internal", type="scxml")),
                on("in", "b"),
                _NOT_SO,
            ),
            state("b", on("out", "pass"), _NOT_SO),
        ),
    ),
    "521": (
        "a session that is not there cannot be reached, which is an error",
        chart(
            state(
                "a",
                entry(send("x", target="#_scxml_foreign"), send("late")),
                on("error.communication", "pass"),
                _NOT_SO,
            )
        ),
    ),
    # --- states within states ---
    "372": (
        "done.state comes when the final state has been entered, and its onentry has run",
        chart(
            state(
                "a",
                on("done.state.a", "pass", cond="n == 1"),
                on("done.state.a", "fail"),
                state("b", on("", "f")),
                final("f", entry(more("n")), leave(more("n"))),
            ),
            data={"n": "0"},
        ),
    ),
    "399": (
        "a transition waits for names, for what they begin with, and for several",
        chart(
            state(
                "a",
                entry(throw("p", "p.q", "pq", "r.s.t", "u.v")),
                _NOT_SO,
                state("b", on("o p", "c")),
                state("c", on("p.*", "d")),
                state("d", on("p", "fail"), on("pq", "e")),
                state("e", on("r.s", "f")),
                state("f", on("*", "pass")),
            )
        ),
    ),
    "402": (
        "errors are pulled off the queue in their turn, by prefixes too",
        chart(
            state(
                "a",
                _NOT_SO,
                state("b", entry(throw("one"), _BAD), on("one", "c", throw("two"))),
                state("c", on("error", "d")),
                state("d", on("two", "pass")),
            )
        ),
    ),
    "403a": (
        "the transition of the innermost state comes first, and of one state the first whose condition holds",
        chart(
            state(
                "a",
                entry(throw("x", "y")),
                on("x", "fail"),
                on("y", "pass"),
                state("b", on("x", "fail", cond="false"), on("x", "c"), on("x", "fail")),
                state("c", on("y", "fail", cond="n == 1")),
            ),
            data={"n": "0"},
        ),
    ),
    "409": (
        "a state that was left is not active any more while those around it are left",
        chart(
            state(
                "a",
                leave(when("In('b')", throw("no"), other(), throw("yes"))),
                state("b", on("", "c")),
            ),
            state("c", on("yes", "pass"), _NOT_SO),
        ),
    ),
    "411": (
        "a state is active before its onentry runs, and those within it are not yet",
        chart(
            state(
                "a",
                entry(when("In('a') && !In('b')", throw("yes"), other(), throw("no"))),
                on("no", "fail"),
                state("b", entry(when("In('b')", throw("and")))),
                on("yes", "c"),
            ),
            state("c", on("and", "pass"), _NOT_SO),
        ),
    ),
    "412": (
        "the content of an initial transition runs between the onentry of the state and that of its child",
        chart(
            state("a", entry(digit(1)), begin("b", digit(2)), state("b", entry(digit(3)), on("", "c"))),
            judge("seen == 123", "c"),
            data=_ORDER,
        ),
    ),
    "416": (
        "done.state comes when a final child is entered",
        chart(state("a", state("b", state("c", on("", "f")), final("f"), on("done.state.b", "pass")))),
    ),
    "505": (
        "an internal transition does not leave its source",
        chart(
            state(
                "a",
                entry(throw("x", "y")),
                leave(more("outer")),
                on("x", "b", more("taken"), type="internal"),
                on("y", "c", cond="taken == 1"),
                state("b", leave(more("inner"))),
            ),
            judge("outer == 1 && inner == 2", "c"),
            data={"outer": "0", "inner": "0", "taken": "0"},
        ),
    ),
    "506": (
        "an internal transition that leads out of its source leaves it",
        chart(
            state(
                "a",
                leave(more("outer")),
                on("x", "a", more("taken"), type="internal"),
                on("y", "c", cond="taken == 1"),
                state("b", leave(more("inner"))),
                entry(when("taken == 0", throw("x", "y"))),
            ),
            judge("outer == 2 && inner == 2", "c"),
            data={"outer": "0", "inner": "0", "taken": "0"},
        ),
    ),
    # --- histories ---
    "387": (
        "a history that remembers nothing leads where it says",
        chart(
            state(
                "a",
                on("flat", "pass", cond="In('a21')"),
                on("flat", "fail"),
                history("h", "a2"),
                state("a1"),
                state("a2", state("a21", entry(throw("flat")))),
            ),
            initial="h",
        ),
    ),
    "388": (
        "a shallow history remembers a child, a deep one what is in it",
        chart(
            state(
                "a",
                history("hs", "a1"),
                history("hd", "a1", deep=True),
                on("go", "b"),
                state("a1", on("", "a22", cond="n == 0")),
                state(
                    "a2",
                    state("a21", on("", "b", cond="n == 2")),
                    state("a22", on("", "b", cond="n == 0"), on("", "b", cond="n == 1", type="internal")),
                ),
            ),
            state(
                "b",
                entry(more("n")),
                on("", "hd", cond="n == 1"),
                on("", "hs", cond="n == 2"),
                on("", "pass", cond="n == 3"),
            ),
            data={"n": "0"},
        ),
    ),
    "579": (
        "what stands with a history runs only as long as it remembers nothing, behind the onentry of its parent",
        chart(
            state(
                "a",
                entry(digit(1)),
                begin("h", digit(2)),
                history("h", "a1", digit(3)),
                state("a1", entry(digit(4)), on("", "b")),
            ),
            state("b", on("", "a", cond="seen == 1234"), on("", "pass", cond="seen == 1234124"), on("", "fail")),
            data=_ORDER,
        ),
    ),
    "580": (
        "a history is never active itself",
        chart(
            parallel(
                "p",
                state("l", on("", "fail", cond="In('h')")),
                state(
                    "r",
                    begin("h"),
                    history("h", "r1"),
                    state("r1", entry(when("In('h')", throw("no"))), on("", "r2")),
                    state("r2"),
                ),
                on("no", "fail"),
                on("", "pass", cond="In('r2') && !In('h')"),
            )
        ),
    ),
    # --- parallel states ---
    "310": (
        "In tells of a state in another region",
        chart(parallel("p", state("l", on("", "pass", cond="In('r')"), on("", "fail")), state("r"))),
    ),
    "364": (
        "default initial states: the attribute, the element, else the first child",
        chart(
            state(
                "a",
                on("wrong", "fail"),
                state("a1", entry(throw("wrong"))),
                parallel(
                    "q",
                    state("l", state("l1", entry(throw("wrong"))), state("l2", on("right", "b"))),
                    state("r", state("r1", entry(throw("wrong"))), state("r2", entry(throw("right")))),
                ),
                initial="l2 r2",
            ),
            state(
                "b", begin("b2"), state("b1", on("", "fail")), state("b2", state("b21", on("", "pass")), state("b22"))
            ),
        ),
    ),
    "403b": (
        "a transition that several regions select is taken once",
        chart(
            parallel(
                "p",
                on("x", "", more("n")),
                on("y", "c", cond="n == 1"),
                on("y", "fail"),
                entry(throw("x", "y")),
                state("l"),
                state("r"),
            ),
            judge("n == 1", "c"),
            data={"n": "0"},
        ),
    ),
    "403c": (
        "of transitions that leave one state, the inner and the earlier one is taken; those that leave nothing all are",
        chart(
            parallel(
                "p",
                entry(throw("x", "y")),
                state("one", on("x", "one", digit(1)), on("y", "", digit(2))),
                state("two", on("x", "fail", digit(9)), on("y", "c", digit(3))),
                state("three", on("x", "", digit(4)), on("y", "fail")),
                on("x", "fail"),
            ),
            judge("seen == 1423", "c"),
            data=_ORDER,
        ),
    ),
    "404": (
        "states are left from the inside out, the later region first, before the transition does something",
        chart(
            parallel(
                "p",
                leave(digit(3)),
                on("", "c", digit(4)),
                state("l", leave(digit(2))),
                state("r", leave(digit(1))),
            ),
            judge("seen == 1234", "c"),
            data=_ORDER,
        ),
    ),
    "405": (
        "what several transitions do comes in document order, after the leaving",
        chart(
            parallel(
                "p",
                on("done", "c"),
                state("l", state("l1", leave(digit(2)), on("", "l2", digit(3))), state("l2")),
                state("r", state("r1", leave(digit(1)), on("", "r2", digit(4))), state("r2", entry(throw("done")))),
            ),
            judge("seen == 1234", "c"),
            data=_ORDER,
        ),
    ),
    "406": (
        "states are entered from the outside in, in document order, after the transition",
        chart(
            state("a", on("", "p", digit(1))),
            parallel("p", entry(digit(2)), state("l", entry(digit(3))), state("r", entry(digit(4))), on("", "c")),
            judge("seen == 1234", "c"),
            data=_ORDER,
        ),
    ),
    "413": (
        "a chart can begin in several states at once",
        chart(
            parallel(
                "p",
                state("l", state("l1", on("", "fail")), state("l2", on("", "pass", cond="In('r2')"))),
                state("r", state("r1", on("", "fail")), state("r2")),
            ),
            initial="l2 r2",
        ),
    ),
    "417": (
        "done.state of a parallel state comes when all its regions are done",
        chart(
            parallel(
                "p",
                on("done.state.p", "pass"),
                state("l", state("l1", on("", "lf")), final("lf")),
                state("r", state("r1", on("", "rf")), final("rf")),
            )
        ),
    ),
    "504": (
        "an external transition leaves all up to what holds source and targets",
        chart(
            state(
                "a",
                leave(more("outer")),
                on("y", "c"),
                parallel(
                    "p",
                    entry(when("inner == 0", throw("x", "y"))),
                    leave(more("inner")),
                    on("x", "l"),
                    state("l", leave(more("left"))),
                    state("r"),
                ),
            ),
            judge("outer == 1 && inner == 2 && left == 2", "c"),
            data={"outer": "0", "inner": "0", "left": "0"},
        ),
    ),
    "533": (
        "an internal transition of a parallel state leaves it all the same",
        chart(
            parallel(
                "p",
                entry(when("n == 0", throw("x", "y"))),
                leave(more("n")),
                on("x", "l", type="internal"),
                on("y", "c"),
                state("l"),
                state("r"),
            ),
            judge("n == 2", "c"),
            data={"n": "0"},
        ),
    ),
    "570": (
        "done.state of a parallel state comes after those of its regions, and only then",
        chart(
            parallel(
                "p",
                on("done.state.p", "pass", cond="n == 2"),
                on("done.state.p", "fail"),
                state("l", on("done.state.l", "", more("n")), state("l1", on("go", "lf")), final("lf")),
                state(
                    "r", on("done.state.r", "", more("n")), state("r1", entry(throw("go")), on("", "rf")), final("rf")
                ),
            ),
            data={"n": "0"},
        ),
    ),
    "576": (
        "a chart can begin deep inside",
        chart(
            state(
                "a",
                parallel(
                    "p",
                    state("l", state("l1", on("", "fail")), state("l2", on("right", "pass"))),
                    state("r", state("r1", on("", "fail")), state("r2", entry(throw("right")))),
                ),
            ),
            initial="l2 r2",
        ),
    ),
}

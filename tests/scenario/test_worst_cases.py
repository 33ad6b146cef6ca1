"""Reading takes time in proportion to a file's length, whatever stands in it.

Each of these took minutes or for ever in some form, because something went back over what it had passed, compared
everything with everything, or looked for the nearest right name for each of a hundred thousand wrong ones.

Each is read in less than a second; it has many of processor time (not of the clock: a machine that is busy with other
things fails nothing here).
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from types import FrameType

import pytest

from rise_engine.scenario.loader import load
from tests.chance import SEARCH, some
from tests.scenario.folders import folder

SIZE, SECONDS = (150_000, 20.0) if SEARCH else (50_000, 6.0)
"""Of processor time; what grows with the square of the size takes minutes, and all else a moment."""


def rule(body: str) -> str:
    return f'<InteractionRule name="R" initial="S"><State id="S">{body}</State></InteractionRule>'


def act(body: str) -> str:
    return f'<Dialog name="A">{body}</Dialog>'


def many(piece: str, size: int = SIZE) -> str:
    """A piece again and again; `{}` is another number each time."""
    if "{}" not in piece:
        return piece * (size // len(piece))
    return "".join(piece.replace("{}", str(number)) for number in range(size // (len(piece) + 4)))


def speech(message: str, id: str = "1") -> str:
    return f"<Speech><actionID>{id}</actionID><message>{message}</message></Speech>"


def cdata(text: str) -> str:
    return f"<![CDATA[{text}]]>"


CASES: dict[str, tuple[str, Callable[[], str]]] = {
    # SSML
    "slots in SSML": ("acts/a.xml", lambda: act(speech("<speak>" + many("{a{}} ") + "</speak>"))),
    "slots in SSML as a text": ("acts/a.xml", lambda: act(speech(cdata("<speak>" + many("{a{}} ") + "</speak>")))),
    "fallbacks in SSML": ("acts/a.xml", lambda: act(speech(cdata("<speak>" + many("{a|&amp;} {a|<} ") + "</speak>")))),
    "unknown elements in SSML": ("acts/a.xml", lambda: act(speech("<speak>" + many("<a{}/>") + "</speak>"))),
    "breaks in SSML": ("acts/a.xml", lambda: act(speech("<speak>" + many('<break time="{}"/>') + "</speak>"))),
    "open tags in SSML": ("acts/a.xml", lambda: act(speech(cdata("<speak>" + many("<s>"))))),
    "open tags and ends in SSML": (
        "acts/a.xml",
        lambda: act(speech(cdata("<speak>" + "<s>" * 250 + many("a<s></s>") + "</s>" * 250 + "</speak>"))),
    ),
    "ampersands in SSML": ("acts/a.xml", lambda: act(speech(cdata("<speak>" + many("& ") + "</speak>")))),
    "many messages in SSML": ("acts/a.xml", lambda: act(many(speech("<speak>a<b/></speak>", "{}")))),
    # how words are said
    "words": ("lexicon.toml", lambda: "[en]\n" + many('w{} = "a"\n')),
    "languages": ("lexicon.toml", lambda: many('[x{}]\na = "b"\n')),
    "robots": ("lexicon.toml", lambda: many('[en.robot{}]\na = "b"\n')),
    # the XML itself
    "comments at the head": ("rules/r.xml", lambda: many("<!-- a -->\n") + rule("")),
    "instructions at the head": ("rules/r.xml", lambda: many("<?a b?> ") + rule("")),
    "an open tag and line ends": ("rules/r.xml", lambda: '<InteractionRule name="R" initial="S' + "\n" * SIZE),
    "an open value and line ends": ("rules/r.xml", lambda: '<InteractionRule name="R>' + "\n" * SIZE + '"'),
    "open tags": ("rules/r.xml", lambda: many('<a b="')),
    "open tags in one line": ("rules/r.xml", lambda: many('<a b="x"1 ')),
    "quotation marks": ("rules/r.xml", lambda: '<a b="' + '"' * SIZE),
    "quotation marks and blanks": ("rules/r.xml", lambda: '<a b="' + '" ' * (SIZE // 2)),
    "raw ampersands": ("rules/r.xml", lambda: rule(many("& "))),
    "raw ampersands in values": ("rules/r.xml", lambda: rule(many('<transition cond="a & b"/>\n'))),
    "raw less-than signs in values": ("rules/r.xml", lambda: rule(many('<transition cond="a < b"/>\n'))),
    "inner quotation marks": ("rules/r.xml", lambda: rule(many('<transition cond="a = "b""/>\n'))),
    "attributes that nobody knows": ("rules/r.xml", lambda: rule("<transition " + many('a{}="" ') + "/>")),
    "long names of elements": (
        "rules/r.xml",
        lambda: rule("".join(f'<{"a" * 40_000}{n} b="1" c="2"/>' for n in range(SIZE // 40_000))),
    ),
    "text between tags": ("rules/r.xml", lambda: rule(many('<transition cond="a"/>x'))),
    "text with comments": ("rules/r.xml", lambda: rule(many("<!--a-->b&lt;\r\n"))),
    # rules
    "transitions": ("rules/r.xml", lambda: rule(many('<transition eventTopic="/e" target="S"/>'))),
    "transitions to nowhere": ("rules/r.xml", lambda: rule(many('<transition eventTopic="/e" target="T{}"/>'))),
    "functions": ("rules/r.xml", lambda: rule("<onEntry>" + many('<function raiseEventTopic="/e{}"/>') + "</onEntry>")),
    "acts that are not there, and their ends": (
        "rules/r.xml",
        lambda: rule(
            "<onEntry>"
            + many('<function startCommunicationRobotAct="A{}"/>', SIZE // 2)
            + "</onEntry>"
            + many('<transition eventTopic="/A{}x_end" target="S"/>', SIZE // 2)
        ),
    ),
    "elseif behind if": (
        "rules/r.xml",
        lambda: rule('<onEntry><if cond="a"/>' + many('<elseif cond="a"/>') + "</onEntry>"),
    ),
    "elseif in if": (
        "rules/r.xml",
        lambda: rule('<onEntry><if cond="a">' + many('<elseif cond="a"/>') + "</if></onEntry>"),
    ),
    "keys in a condition": (
        "rules/r.xml",
        lambda: rule(many('<transition cond="' + " or ".join(f"k{n}" for n in range(9000)) + ' or k{}"/>')),
    ),
    "keys of a thousand parts": ("rules/r.xml", lambda: rule(many('<transition cond="a{}' + ".a" * 20_000 + '"/>'))),
    "brackets in brackets": (
        "rules/r.xml",
        lambda: rule(many('<transition cond="' + "(" * 140 + "a{}" + " or a" * 9000 + ")" * 140 + '"/>')),
    ),
    "states whose names are alike": (
        "rules/r.xml",
        lambda: (
            "<InteractionRule name='R' initial='0'>"
            + "".join(
                f'<State id="{n:024b}"><transition cond="a" target="{n:023b}2"/></State>' for n in range(SIZE // 100)
            )
            + "</InteractionRule>"
        ),
    ),
    # acts
    "actions that wait in a circle": (
        "acts/a.xml",
        lambda: act(
            "".join(
                f"<Wait><actionID>{n}</actionID><waitForActions>0,{n},{n + 1}</waitForActions></Wait>"
                for n in range(SIZE // 80)
            )
        ),
    ),
    "waiting for actions that are not there": (
        "acts/a.xml",
        lambda: act(f"<Wait><actionID>1</actionID><waitForActions>{many('x{},')}</waitForActions></Wait>"),
    ),
    "memory keys in a text": (
        "acts/a.xml",
        lambda: act(
            "<Speech><actionID>1</actionID><message>"
            + "".join(f"{{k{n}}} {{ j{n} }} " for n in range(SIZE // 20))
            + "</message></Speech>"
        ),
    ),
    "memory keys in a name": (
        "acts/a.xml",
        lambda: act(f"<Animation><actionID>1</actionID><value>{'{a}' * 40}{{a|1}}x</value></Animation>"),
    ),
    # memory and settings
    "keys that are one but for their case": (
        "memory.json",
        lambda: (
            "{"
            + ",".join(
                '"' + "".join(key) + '":[]' for key in product(*((each, each.upper()) for each in "workingmemory"))
            )
            + ","
            + many('"k{}":1,')
            + '"end":1}'
        ),
    ),
    "digits": ("memory.json", lambda: '{"a":' + "1" * SIZE + "x}"),
    "a key of many parts": ("scenario.toml", lambda: ".".join("a" * (SIZE // 3)) + " = 1"),
    "a table of many parts": ("scenario.toml", lambda: "[" + ".".join("a" * (SIZE // 3)) + "]"),
    "settings that nobody knows": ("scenario.toml", lambda: many("k{} = 1\n", SIZE // 2)),
    "a line twice": ("scenario.toml", lambda: many("a = 1\n", SIZE // 2)),
    "names that are left out": (
        "scenario.toml",
        lambda: (
            "[actions.Animation]\nnames = ["
            + many('"n{}",', SIZE // 3)
            + "]\nwithout = ["
            + many('"m{}",', SIZE // 3)
            + "]\n"
        ),
    ),
    "actions instead of which there are none": (
        "scenario.toml",
        lambda: many('[actions.A{}]\nsubstitute = "B{}"\n', SIZE // 2),
    ),
}


@pytest.fixture(autouse=True)
def _not_for_ever() -> Iterator[None]:
    def give_up(signum: int, frame: FrameType | None) -> None:
        raise AssertionError(f"it took more than {SECONDS:g} s of processor time")

    before = signal.signal(signal.SIGVTALRM, give_up)
    signal.setitimer(signal.ITIMER_VIRTUAL, SECONDS)
    yield
    signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    signal.signal(signal.SIGVTALRM, before)


@pytest.mark.search
@pytest.mark.slow
@pytest.mark.parametrize("name", some(CASES))
def test_the_worst_is_read_soon(tmp_path: Path, name: str) -> None:
    file, make = CASES[name]
    diagnostics = load(folder(tmp_path, {file: make()})).diagnostics
    for diagnostic in diagnostics:
        assert len(diagnostic.message) < 200_000

"""When everything begins: by the block, worked out from its text alone, and by the act that is made of it."""

from __future__ import annotations

from decimal import Decimal
from functools import cache

from hypothesis import given, settings
from hypothesis import strategies as st
from rise_exchange.bml.core_behavior import milliseconds, parse_sync, seconds_text

from tests.chance import examples
from tests.exchange.bml.samples import read

OFFSETS = st.one_of(st.just(Decimal(0)), st.decimals("0", "3", places=2))


@st.composite
def times(draw: st.DrawFn, before: list[str]) -> str:
    """A time of BML that depends on behaviours before."""
    offset = draw(OFFSETS)
    kind = draw(st.sampled_from(["number", "end", "end", "start", "start"])) if before else "number"
    if kind == "number":
        return f"{offset}"
    written = "" if not offset else f" + {offset}"
    return f"{draw(st.sampled_from(before[-3:]))}:{'end' if kind == 'end' else 'start'}{written}"


@settings(max_examples=examples(400))
@given(st.data())
def test_an_act_begins_everything_when_its_block_does(data: st.DataObject) -> None:
    ids = [f"s{number}" for number in range(data.draw(st.integers(1, 8)))]
    lengths = {id: data.draw(st.decimals("0.1", "4", places=2)) for id in ids}
    starts: dict[str, list[str]] = {}
    lines: list[str] = []
    for number, id in enumerate(ids):
        several = data.draw(st.booleans()) and number > 1
        starts[id] = [data.draw(times(ids[:number])) for _ in range(2 if several else data.draw(st.integers(0, 1)))]
        start = f' start="{starts[id][0]}"' if len(starts[id]) == 1 else ""
        lines.append(f'<speech id="{id}"{start}><text>Words.</text></speech>')
        after = "".join(f'<after ref="{each}"><sync ref="{id}:start"/></after>' for each in starts[id] if several)
        lines.append(f"<constraint>{after}</constraint>" if several else "")

    @cache
    def begins(id: str) -> Decimal:
        return max([at(each) for each in starts[id]], default=Decimal(0))

    def at(text: str) -> Decimal:
        if ":" not in text:
            return Decimal(text)
        id, _, rest = text.partition(":")
        point, _, offset = rest.partition(" ")
        moved = Decimal(offset.replace(" ", "") or "0")
        return begins(id) + moved + (lengths[id] if point == "end" else 0)

    found = read("\n".join(lines))
    if any("with this offset cannot be kept" in each for each in found.errors):
        return  # so many seconds after the start of what waits for several, some of them so many seconds, too
    waits = found.waits
    pauses = {id: Decimal(does["duration"]) / 1000 for id, does in found.does.items() if does["type"] == "Wait"}

    @cache
    def starts_in_act(id: str) -> Decimal:
        return max([starts_in_act(each) + {**lengths, **pauses}[each] for each in waits[id]], default=Decimal(0))

    assert {id: starts_in_act(id) for id in ids} == {id: begins(id) for id in ids}


@given(st.decimals("0", "1000000", places=6))
def test_no_time_is_rounded(seconds: Decimal) -> None:
    again = seconds_text(milliseconds(seconds))
    assert again is not None and Decimal(again) == seconds


def test_what_is_a_time_and_what_is_none() -> None:
    for text in ("1", "0.5", ".5", "a:end", " a:end+.5 ", "a:end - 2", "b:a:stroke", "a-b:end"):
        assert parse_sync(text) is not None, text
    for text in ("", "-1", "a", "a:", ":end", "a:end+", "a:end+x", "a:end++1", "1e3", "١", "a:b:c:d:e f"):
        assert parse_sync(text) is None, text

"""Clocks: what zones say holds for times that are counted one by one."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from rise_engine.author.explore.zones import NO_CLOCKS, carry, elapse, hull, includes, narrow, widen, widest

limits = st.lists(st.integers(0, 8), min_size=1, max_size=3)


def points(zone: tuple[tuple[int, ...], ...]) -> set[tuple[int, ...]]:
    """All whole times in a zone of at most three clocks."""
    found: set[tuple[int, ...]] = {()}
    for _ in range(len(zone) - 1):
        found = {(*point, time) for point in found for time in range(10)}
    return {point for point in found if _is_in(zone, (0, *point))}


def _is_in(zone: tuple[tuple[int, ...], ...], clocks: tuple[int, ...]) -> bool:
    size = range(len(zone))
    return all(clocks[i] - clocks[j] <= zone[i][j] for i in size for j in size)


@given(limits, st.data())
def test_narrowing_keeps_what_lies_between(tops: list[int], data: st.DataObject) -> None:
    zone = widest(tops)
    clock = data.draw(st.integers(1, len(tops)))
    least = data.draw(st.integers(0, 9))
    most = data.draw(st.integers(least, 9))
    wanted = {point for point in points(zone) if least <= point[clock - 1] <= most}
    narrowed = narrow(zone, clock, least, most)
    assert (points(narrowed) if narrowed is not None else set()) == wanted


@given(limits, st.data())
def test_time_passes_until_the_first_limit(tops: list[int], data: st.DataObject) -> None:
    start = tuple(data.draw(st.integers(0, top)) for top in tops)
    zone = carry(NO_CLOCKS, [None] * len(tops))
    zone = tuple(tuple(a - b for b in (0, *start)) for a in (0, *start)) if zone else zone
    wanted = {
        tuple(time + passed for time in start)
        for passed in range(10)
        if all(time + passed <= top for time, top in zip(start, tops, strict=True))
    }
    assert points(elapse(zone, tops)) == wanted


def test_a_new_clock_begins_at_nothing_and_an_old_one_goes_on() -> None:
    zone = elapse(carry(NO_CLOCKS, [None]), [5])
    both = carry(zone, [1, None])
    assert points(both) == {(time, 0) for time in range(6)}
    assert points(elapse(both, [7, 3])) == {(old, new) for new in range(4) for old in range(new, min(7, new + 5) + 1)}


@given(limits, st.data())
def test_hulls_and_widened_zones_have_both_in_them(tops: list[int], data: st.DataObject) -> None:
    def some_zone() -> tuple[tuple[int, ...], ...]:
        clock = data.draw(st.integers(1, len(tops)))
        least = data.draw(st.integers(0, tops[clock - 1]))
        zone = narrow(widest(tops), clock, least, data.draw(st.integers(least, 9)))
        assert zone is not None
        return zone

    one, other = some_zone(), some_zone()
    for joined in (hull(one, other), widen(one, other, tops)):
        assert includes(joined, one)
        assert includes(joined, other)
        assert points(joined) >= points(one) | points(other)
        assert includes(widest(tops), joined)

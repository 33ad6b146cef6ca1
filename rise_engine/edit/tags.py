"""The attributes of a start tag: other values, new ones, ones that go, and nothing else in the tag changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set

from rise_engine.edit.documents import Node, WrittenAttribute
from rise_engine.edit.plan import Splice
from rise_engine.edit.writing import check_characters, quoted, value_splice


def set_attributes(file: str, node: Node, values: Mapping[str, str | None], order: Sequence[str]) -> list[Splice]:
    """The splices that give an element these attributes; those that are not named stay as they are.

    :param values: None: the attribute goes. A value that is there already changes nothing.
    :param order: of all attributes that there may be: a new one stands behind the last one before it.
    """
    written = node.written_attributes()
    gone = {name for name, value in values.items() if value is None and name in written}
    new = [name for name in order if values.get(name) is not None and name not in written]
    splices = [
        value_splice(file, node, name, value)
        for name, value in values.items()
        if value is not None and name in written and node.attributes[name] != value
    ]
    replaced: dict[str, str] = {}
    for name in list(new):  # one thing instead of another takes its place
        kept = [order.index(each) for each in written if each in order and each not in gone]
        if (old := _place_of_gone(name, gone - replaced.keys(), kept, order)) is not None:
            replaced[old] = name
            new.remove(name)
    for name in sorted(gone, key=list(written).index):
        place = written[name]
        instead = replaced.get(name)
        if instead is None:
            splices.append(Splice(file, place.start, place.end, b""))
        else:
            value = values[instead]
            assert value is not None, "only what has a value is new"
            start = place.start + len(_blanks(node, place))
            splices.append(Splice(file, start, place.end, _written(instead, value)))
    splices += _additions(file, node, {name: str(values[name]) for name in new}, order)
    return splices


def _place_of_gone(name: str, gone: Set[str], kept: list[int], order: Sequence[str]) -> str | None:
    """The attribute that goes whose place a new one takes: the first, if nothing that stays belongs between them."""
    rank = order.index(name)
    for each in sorted(gone, key=order.index):
        between = range(*sorted((rank, order.index(each))))
        if not any(other in between for other in kept):
            return each
    return None


def _additions(file: str, node: Node, values: Mapping[str, str], order: Sequence[str]) -> list[Splice]:
    written = node.written_attributes()
    at_places: dict[int, list[bytes]] = {}
    for name, value in values.items():
        rank = order.index(name)
        before = [each for each in written if each in order and order.index(each) < rank]
        place = max((written[each].end for each in before), default=node.start + 1 + len(node.tag.encode()))
        blanks = _blanks(node, written[before[-1]]) if before else b" "
        at_places.setdefault(place, []).append(blanks + _written(name, value))
    return [Splice(file, place, place, b"".join(pieces)) for place, pieces in at_places.items()]


def _written(name: str, value: str) -> bytes:
    check_characters(value)
    return f"{name}={quoted(value)}".encode()


def _blanks(node: Node, attribute: WrittenAttribute) -> bytes:
    """What stands before an attribute: a blank, or a line end with indentation."""
    raw = node.document.data[attribute.start : attribute.end]
    return raw[: len(raw) - len(raw.lstrip())]

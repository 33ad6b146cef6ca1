"""libxml2's message about a file that is not well-formed, as a sentence with the place to look at."""

from __future__ import annotations

import re

from lxml import etree

_POSITION = re.compile(r", line \d+, column \d+.*\Z", re.DOTALL)
_MISMATCH = re.compile(r"tag mismatch: (\S+) line (\d+) and (\S+)")
_UNFINISHED = re.compile(r"in tag (\S+) line (\d+)")
_REDEFINED = re.compile(r"Attribute (\S+) redefined")
_SENTENCES = {
    "Extra content": "the file goes on after its outermost element; several acts or rules need one wrapper around them",
    "Start tag expected": "an XML file begins with `<`",
    "AttValue": "the value of an attribute needs quotation marks, closed before the tag ends",
    "attributes construct error": 'attributes are written name="value" and separated by a blank',
    "Specification mandates value": 'this attribute has no value; write name="value"',
    "Double hyphen": "a comment cannot have `--` inside it; only `-->` ends it",
}
"""Our sentence for a part of libxml2's message."""


def parse_error(text: str) -> etree.XMLSyntaxError | None:
    """The first error that lxml finds, or None. :raises ValueError: the text contains half a character, or the like."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        etree.fromstring(text.encode(), parser)
    except etree.XMLSyntaxError as error:
        return error
    return None


def find_syntax_error(text: str) -> tuple[str, int, str] | None:
    """The first error: the code of a diagnostic, the offset, and a sentence. None: there is none."""
    error = parse_error(text)
    return None if error is None else describe_syntax_error(error, text)


def describe_syntax_error(error: etree.XMLSyntaxError, text: str) -> tuple[str, int, str]:
    """Describe an error of lxml in a text: the code of a diagnostic, the offset, and a sentence."""
    message = _POSITION.sub("", error.msg or "")  # error.error_log collects the errors of all files so far
    line, column = error.position
    offset = _offset(text, line or 1, column or 1)
    code = "not-well-formed"
    if not text.strip():
        offset, sentence = 0, "this file is empty"
    elif (found := _MISMATCH.search(message)) is not None:
        opened, opened_at, closed = found.groups()
        offset = max(text.rfind("</", 0, offset + 1), 0)
        sentence = f"`</{closed}>` does not close `<{opened}>` of line {opened_at}; tags close in reverse order"
    elif (found := _UNFINISHED.search(message)) is not None:
        sentence = f"`<{found.group(1)}>` of line {found.group(2)} is never closed; add `</{found.group(1)}>`"
    elif (found := _REDEFINED.search(message)) is not None:
        name = found.group(1)
        before = [match.start() for match in re.finditer(rf"{re.escape(name)}\s*=", text[:offset])]
        offset = before[-1] if before else offset
        sentence = f"the attribute `{name}` is given twice"
    elif "depth" in message:
        code, sentence = "too-deep", "elements are nested too deeply"
    elif "Comment not terminated" in message:
        offset = max(text.rfind("<!--", 0, offset + 4), 0)
        sentence = "this comment is never closed; write `-->` at its end"
    else:
        unknown = f"this is not well-formed XML: {' '.join(message.split())}"
        sentence = next((ours for theirs, ours in _SENTENCES.items() if theirs in message), unknown)
    return code, offset, sentence


def _offset(text: str, line: int, column: int) -> int:
    """The offset of a position. libxml2 counts bytes in a line, from 1, and points behind the error."""
    lines = text.split("\n")
    line = min(line, len(lines))
    content = lines[line - 1].encode()[: max(column - 1, 0)].decode("utf-8", "replace")
    return sum(len(before) + 1 for before in lines[: line - 1]) + len(content)

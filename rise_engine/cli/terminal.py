"""Where every command writes: standard output and standard error, so that nothing of a file reaches the terminal raw.

`clean_standard_streams` is put around a whole program. Within it, text passes `clean`: a title or a file name can
neither move the cursor nor rename the window. Documents (`--json`, a schema) go another way and keep every character,
those that a terminal would obey written as the format's own escapes.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO

import msgspec

from rise_engine.errors import RiseError
from rise_engine.exit_status import NOT_WRITTEN
from rise_engine.json_codec import encode
from rise_engine.session.disk import error_message
from rise_engine.text import UNSEEN, clean, escape_unseen_json


class OutputError(RiseError):
    """Standard output cannot be written; the text says why."""


class CleanStream:
    """A text stream through which only printable characters, line ends and tabs go; otherwise the stream itself.

    A failing standard output is an OutputError. A failing standard error is nobody's business: there is no one to tell.
    """

    def __init__(self, stream: TextIO, *, may_fail: bool) -> None:
        self._stream = stream
        self._may_fail = may_fail

    def write(self, text: str) -> int:
        with self._report_failure():
            self._stream.write(clean(text, keep="\n\t"))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        with self._report_failure():
            self._stream.flush()

    @contextmanager
    def _report_failure(self) -> Iterator[None]:
        try:
            with _output_errors():
                yield
        except OutputError:
            if not self._may_fail:
                raise
            discard_rest(self._stream)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def clean_standard_streams() -> Iterator[None]:
    """Within it, standard output and error are clean, and fail with a sentence.

    What a terminal cannot show is shown as an escape (`\\xe9`, `\\udcff`): no command fails because of it.
    """
    _guard_streams()
    try:
        try:
            yield
        finally:
            with suppress(BrokenPipeError):
                sys.stdout.flush()
    except OutputError as error:
        discard_rest(sys.stdout)
        sys.stderr.write(f"error: standard output cannot be written: {error}\n")
        sys.exit(NOT_WRITTEN)


def write_json(value: Any, *, indent: int = 2) -> None:
    """Write a JSON document and a line end: UTF-8 on every terminal, because an escaped character would spoil it.

    :param value: what the document says: JSON-like, or a Struct.
    :param indent: blanks for each level; -1: all in one line.
    """
    _write(escape_json(msgspec.json.format(encode(value), indent=indent)))


def write_xml(text: str) -> None:
    """Write an XML document and a line end, in UTF-8 as `write_json` does."""
    _write(UNSEEN.sub(_xml_escape, text).encode("utf-8", "backslashreplace"))


def escape_json(data: bytes) -> bytes:
    """JSON in UTF-8, the same values, with escapes for all that a terminal would obey or nobody would see."""
    if data.isascii() and b"\x7f" not in data:
        return data
    return escape_unseen_json(data.decode("utf-8", "backslashreplace")).encode()


def _xml_escape(found: re.Match[str]) -> str:
    return found[0] if found[0] in "\t\r\n" else f"&#x{ord(found[0]):X};"


def _write(data: bytes) -> None:
    with _output_errors():
        sys.stdout.flush()
        sys.stdout.buffer.write(data + b"\n")
        sys.stdout.buffer.flush()


@contextmanager
def _output_errors() -> Iterator[None]:
    """An OSError within it becomes an OutputError; but for a closed pipe, which ends the program in its own way."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(error_message(error)) from error


def _guard_streams() -> None:
    for name, may_fail in (("stdout", False), ("stderr", True)):
        stream = getattr(sys, name)
        if stream is None:  # closed by whoever started this
            stream = open(os.devnull, "w")  # noqa: PTH123, SIM115
        if isinstance(stream, CleanStream):
            continue
        with suppress(AttributeError):  # a test's own stream
            stream.reconfigure(errors="backslashreplace")
        setattr(sys, name, CleanStream(stream, may_fail=may_fail))


def discard_rest(stream: Any) -> None:
    """Let what is still buffered in a standard stream, and its flush at exit, go nowhere."""
    with suppress(AttributeError, OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)

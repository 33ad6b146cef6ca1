"""The output and the end of every command: standard output, standard error and the exit status.

A whole program runs inside `clean_standard_streams`. There, text passes through `clean`, so that a title or a file name
can neither move the cursor nor rename the window. Documents (`--json`, a schema) keep every character, but write
control characters as escapes of the format.

A command that fails raises `Refused`.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import IO, Any, BinaryIO, NoReturn, TextIO

import click
import msgspec

from rise_engine.base.errors import FileError, RiseError
from rise_engine.base.exit_status import NOT_WRITTEN, REFUSED, USAGE
from rise_engine.base.files import error_message
from rise_engine.base.json_codec import encode
from rise_engine.base.text import UNSEEN, clean, escape_unseen_json

# --- lines and documents --------------------------------------------------------------------------------------------


def print_lines(*lines: object) -> None:
    """Write lines to standard output, immediately. A line end inside a line does not begin a new one."""
    _print(sys.stdout, lines)


def print_notes(*lines: object) -> None:
    """Write lines to standard error: messages beside the result of a command."""
    _print(sys.stderr, lines)


def show(lines: Iterable[object], document: Any, *, as_json: bool) -> None:
    """Write a command's result: as a JSON document, or else as lines."""
    if as_json:
        write_json(document)
    else:
        print_lines(*lines)


def table_lines(rows: Sequence[Sequence[str]], *, indent: str = "  ") -> list[str]:
    """Align the columns of rows of text."""
    widths = [max(len(row[at]) for row in rows) for at in range(len(rows[0]))]
    return [indent + "  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def _print(stream: TextIO, lines: Iterable[object]) -> None:
    stream.write("".join(f"{clean(str(line))}\n" for line in lines))
    stream.flush()


def write_json(value: Any, *, indent: int = 2) -> None:
    """Write a JSON document and a line end, in UTF-8 on every terminal: other encodings would need invalid escapes.

    :param value: the content: JSON-like, or a Struct.
    :param indent: blanks for each level; 0: everything on one line; -1: without any blank.
    """
    write_bytes(json_document(value, indent=indent) + b"\n")


def json_document(value: Any, *, indent: int = 2) -> bytes:
    """Return a JSON document, without line end."""
    return escape_json(msgspec.json.format(encode(value), indent=indent))


def write_xml(text: str) -> None:
    """Write an XML document and a line end, in UTF-8 as `write_json` does."""
    write_bytes(UNSEEN.sub(_xml_escape, text).encode("utf-8", "backslashreplace") + b"\n")


def escape_json(data: bytes) -> bytes:
    """Escape invisible and control characters in JSON; the values stay the same."""
    if data.isascii() and b"\x7f" not in data:
        return data
    return escape_unseen_json(data.decode("utf-8", "backslashreplace")).encode()


def _xml_escape(found: re.Match[str]) -> str:
    return found[0] if found[0] in "\t\r\n" else f"&#x{ord(found[0]):X};"


def write_bytes(data: bytes) -> None:
    """Write bytes to standard output unchanged."""
    with standard_output() as file:
        file.write(data)


@contextmanager
def standard_output() -> Iterator[BinaryIO]:
    """Provide standard output for bytes. Within the block, a full disk ends the command."""
    with _output_errors():
        sys.stdout.flush()
        yield sys.stdout.buffer
        sys.stdout.buffer.flush()


# --- refusals -------------------------------------------------------------------------------------------------------


class Refused(click.ClickException):
    """Ends a command, with lines on standard error and an exit status."""

    def __init__(
        self, *problems: str, status: int = REFUSED, findings: Iterable[object] = (), hints: Iterable[str] = ()
    ) -> None:
        """:param problems: one sentence for each problem; each gets the prefix `error: `.
        :param status: the exit status.
        :param findings: complete messages with their places, before the problems.
        :param hints: lines after the problems.
        """
        self.lines = [*map(str, findings), *(f"error: {each}" for each in problems), *hints]
        super().__init__("\n".join(self.lines))
        self.exit_code = status  # type: ignore[misc]  # a class attribute in click, which reads it from the instance

    @classmethod
    def of(cls, error: RiseError, status: int = REFUSED, *, where: str = "") -> Refused:
        """Turn an error into a refusal. `where`: the subject of its sentences, if they lack it."""
        if isinstance(error, FileError):
            return cls(status=status, findings=error.lines)
        return cls(*(f"{where}: {line}" if where else line for line in error.lines), status=status)

    def with_hint(self, hint: str) -> Refused:
        """Add a line after the others, and return the same refusal."""
        self.lines.append(hint)
        return self

    def show(self, file: IO[Any] | None = None) -> None:
        """Write the lines."""
        print_notes(*self.lines)


@contextmanager
def refusing(status: int, *, of: type[RiseError] = RiseError, where: str = "") -> Iterator[None]:
    """Make an error end the command, within a block or a decorated function.

    :param status: the exit status.
    :param of: the kind of error.
    :param where: the subject of the error's sentences, if they lack it.
    """
    try:
        yield
    except of as error:
        raise Refused.of(error, status, where=where) from None


def exit_with_usage(problem: str) -> NoReturn:
    """End the command because of its command line."""
    raise Refused(problem, status=USAGE)


def not_written(what: object, error: OSError) -> Refused:
    """Make the refusal for a file or folder that the system cannot write."""
    return Refused(f"{what} cannot be written: {reason_of(error)}", status=NOT_WRITTEN)


def reason_of(error: OSError) -> str:
    """Return the system's reason for an error."""
    return error.strerror or str(error)


# --- streams --------------------------------------------------------------------------------------------------------


class CleanStream:
    """A text stream that passes only printable characters, line ends and tabs; otherwise like the stream itself.

    A failing standard output raises Refused. A failing standard error is ignored, because no message could be shown.
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
        except (Refused, BrokenPipeError):
            if not self._may_fail:
                raise
            discard_rest(self._stream)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def clean_standard_streams() -> Iterator[None]:
    """Clean standard output and error within the block; their failures become a sentence.

    Characters that a terminal cannot show become escapes (`\\xe9`, `\\udcff`), and never make a command fail.
    """
    _guard_streams()
    try:
        try:
            yield
        except SystemExit as ended:
            if ended.code == NOT_WRITTEN:  # this failure is already reported
                with suppress(Refused):
                    sys.stdout.flush()
                discard_rest(sys.stdout)
            raise
        finally:
            with suppress(BrokenPipeError):
                sys.stdout.flush()
    except Refused as refused:  # at the last flush; click shows all others
        discard_rest(sys.stdout)
        refused.show()
        sys.exit(refused.exit_code)


@contextmanager
def _output_errors() -> Iterator[None]:
    """Turn an OSError into a Refused, except for a closed pipe, which ends the program in its own way."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        problem = f"standard output cannot be written: {error_message(error)}"
        raise Refused(problem, status=NOT_WRITTEN) from error


def _guard_streams() -> None:
    for name, may_fail in (("stdout", False), ("stderr", True)):
        stream = getattr(sys, name)
        if stream is None:  # closed by the parent process
            stream = open(os.devnull, "w")  # noqa: PTH123, SIM115
        if isinstance(stream, CleanStream):
            continue
        with suppress(AttributeError):  # a test's own stream
            stream.reconfigure(errors="backslashreplace")
        setattr(sys, name, CleanStream(stream, may_fail=may_fail))


def discard_rest(stream: Any) -> None:
    """Discard the rest of a standard stream's buffer, and its flush at exit."""
    with suppress(AttributeError, OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)

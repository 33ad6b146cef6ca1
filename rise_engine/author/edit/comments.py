"""Comments and notes that have a name in them, which a rename leaves alone and lists."""

from __future__ import annotations

import re
from collections.abc import Iterator

from rise_engine.author.edit.plan import EditRefused, Files, Splice
from rise_engine.author.edit.text_edits import EditedText

_COMMENTS = {
    ".xml": re.compile(r"<!--.*?-->", re.DOTALL),
    ".toml": re.compile(r"#[^\n]*"),
    ".jsonl": re.compile(r"^[ \t]*#[^\n]*", re.MULTILINE),
    ".md": re.compile(r".+"),
    ".txt": re.compile(r".+"),
}
_MOST = 10
"""Comments that are listed one by one."""


def comments_with(name: str, files: Files, splices: list[Splice]) -> Iterator[str]:
    """A sentence for each comment, or line of a README, that has the name as a word of its own.

    :param name: the old name.
    :param files: the files before the change.
    :param splices: what is changed; places in them are none.
    """
    word = re.compile(rf"(?<![\w.]){re.escape(name)}(?!\w)")
    found: list[str] = []
    for file in sorted(files):
        pattern = next((each for suffix, each in _COMMENTS.items() if file.endswith(suffix)), None)
        if pattern is None or name.encode() not in files[file]:
            continue
        try:
            text = EditedText(file, files[file])
        except EditRefused:
            continue
        changed = [(each.start, each.end) for each in splices if each.file == file]
        for comment in pattern.finditer(text.text):
            for place in word.finditer(text.text, *comment.span()):
                if not any(start <= place.start() < end for start, end in changed):
                    what = "the text" if file.endswith((".md", ".txt")) else "the comment"
                    found.append(f"{what} in {file}, line {text.line(place.start())}, still has `{name}`")
    unique = list(dict.fromkeys(found))
    yield from unique[:_MOST]
    if len(unique) > _MOST:
        yield f"and {len(unique) - _MOST} more comments still have `{name}`"

"""The band below the top line: the robot's speech, and the next steps without any input. Pure.

Its height is fixed for a session and a terminal size. It depends on the scenario's longest sentence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rise_engine.author.drawing.study_keys import RULE, key_title, short_title
from rise_engine.scenario.model import KeyBinding, Scenario
from rise_tui.model.control import KeyNames
from rise_tui.model.notice import act_label
from rise_tui.model.speech import CurrentSentence, longest_sentence, remaining_sentences
from rise_tui.model.store import Store
from rise_tui.model.upcoming import UpcomingStep, find_upcoming
from rise_tui.model.wait_explanations import key_owner
from rise_tui.rendering.text import (
    StyledLine,
    StyledSpan,
    TextRole,
    align_at_both_ends,
    cell_width,
    clean,
    crop,
    fit,
    format_age,
    format_duration,
    line_width,
    quoted,
    wrap,
)

GLYPH = 3
"""Cells before a sentence."""
NOTE = 15
"""Cells at the end of the first line: `12.3 s left`, `said 12 min ago`."""
BAR, BAR_WIDTH = 10, 70
"""Cells of the bar of a sentence's time, and the width from which there is room for it."""
MAX_LINES, MAX_LINES_TALL = 3, 4
"""Lines for a sentence: in a terminal of less than TALL rows, and in others."""
TALL = 30
WIDEST = 130
"""Cells beyond which a sentence and its time would be too far apart to read together."""
MIN_SENTENCE_WIDTH = 20
"""Minimum cells of a sentence beside other upcoming steps."""
LABEL = " next  "
GAP: StyledSpan = ("  ·  ", "muted")
KIND_STYLES: dict[str, StyledSpan] = {
    "nothing": ("·", "muted"),
    "sent": ("↑", "wait"),
    "says": ("►", "strong"),
    "said": ("✓", "muted"),
    "unsaid": ("✗", "fault"),
    "unknown": ("✗", "fault"),
}
"""The look of a sentence by its kind: the glyph before it, and its role."""


def sentence_height(scenario: Scenario, memory: Mapping[str, Any], width: int, height: int) -> int:
    """Lines for a sentence: at least two if there is room, so that a short sentence leaves one for the next."""
    most = MAX_LINES_TALL if height >= TALL else MAX_LINES
    longest, width = longest_sentence(scenario, memory), min(width, WIDEST)
    if not longest:
        return 1
    return min(most, max(len(_wrap_sentence(quoted(longest), width)), 2 if height >= TALL else 1))


def speech_band_lines(store: Store, width: int, rows: int, key_name: KeyNames) -> tuple[StyledLine, ...]:
    """`rows` lines about the sentence and one about the next steps, each in exactly `width` cells."""
    sentence = store.current_sentence()
    rest = [] if _why_nothing_comes(store, key_name) else remaining_sentences(store.scenario, store.view, store.memory)
    lines = _sentence_lines(sentence, store, min(width, WIDEST), rows)
    rest_shown = len(lines) < rows and bool(rest)
    if rest_shown:
        lines.append(crop((("   then  ", "muted"), *_quoted_line(rest)), width))
    lines += [()] * (rows - len(lines))
    return (*lines, upcoming_line(store, [] if rest_shown else rest, width, key_name))


def changes_by_tenths(store: Store) -> bool:
    """Whether a part of the band changes by tenths of a second."""
    if store.gone_reason or store.cut_since is not None:
        return False
    return bool(store.view.running) or any(step.when in ("timer", "filler") for step in find_upcoming(store).steps)


# --- the sentence --------------------------------------------------------------------------------------------------


def _sentence_lines(sentence: CurrentSentence, store: Store, width: int, rows: int) -> list[StyledLine]:
    (glyph, role) = KIND_STYLES[sentence.kind]
    note: StyledLine = (_status_note(sentence),)
    if sentence.kind == "nothing":
        return [align_at_both_ends(((" · the robot has said nothing yet", "muted"),), (), width)]
    if store.gone_reason and sentence.kind in ("says", "sent"):
        role, note = "fault", (("not known", "fault"),)
    elif sentence.kind == "says" and sentence.seconds is not None and width >= BAR_WIDTH:
        note = (*_time_bar(sentence.share, note[0][1]), (" ", "plain"), *note)
    prefix = _ending_prefix(sentence)
    more = f" and {sentence.others} more" if sentence.others and sentence.kind in ("unsaid", "unknown") else ""
    text = f"{prefix}{quoted(sentence.text)}{more}"
    shown, first = _wrap_sentence(text, width), 0
    if len(shown) > rows:
        shown, first = _window_lines(text, width, rows, sentence.share)
    lines: list[StyledLine] = []
    for at, text in enumerate(shown):
        lead = "   " if at else " … " if first else f" {glyph} "
        line: StyledLine = ((lead, "accent" if sentence.kind == "says" else role), (text, role))
        lines.append(align_at_both_ends(line, (*note, (" ", "plain")), width) if at == 0 else line)
    return lines


def _time_bar(share: float, role: TextRole) -> StyledLine:
    """`━━━━━━────`: the share of a sentence that is probably over."""
    over = round(share * BAR)
    return (("━" * over, role), ("─" * (BAR - over), "muted"))


def _note_width(width: int) -> int:
    """The cells at the end of the first line."""
    return NOTE + (BAR + 1 if width >= BAR_WIDTH else 0)


def _ending_prefix(sentence: CurrentSentence) -> str:
    """The words before a sentence that did not reach its end."""
    if sentence.kind == "unsaid":
        return "NOT FINISHED: " if sentence.seconds else "NOT SAID: "
    return "PERHAPS NOT SAID: " if sentence.kind == "unknown" else ""


def _status_note(sentence: CurrentSentence) -> StyledSpan:
    """The state of the sentence, in at most NOTE cells."""
    more = f" +{sentence.others}" if sentence.others else ""
    match sentence.kind:
        case "sent":
            return f"sent{more}", "wait"
        case "says":
            if sentence.replaced_by:
                return fit(f"by {sentence.replaced_by}", NOTE - 1).strip(), "wait"
            if sentence.seconds is None:
                return f"speaking{more}", "accent"
            if sentence.seconds < 0:
                return f"{format_duration(-sentence.seconds)} over{more}", "wait"
            return f"{format_duration(sentence.seconds)} left{more}", "accent"
        case "said":
            ago = sentence.seconds or 0.0
            return f"said {format_age(ago)} ago" if ago >= 1 else "said just now", "muted"
        case "unsaid" | "unknown":
            return f"after {format_duration(sentence.seconds)}" if sentence.seconds else "", "fault"
        case _:
            return "", "muted"


def _wrap_sentence(text: str, width: int) -> list[str]:
    """The sentence on the lines that it needs; the first leaves room for the note."""
    first, others = max(10, width - GLYPH - _note_width(width) - 2), max(10, width - GLYPH - 1)
    text = " ".join(clean(text).split())
    head = wrap(text, first)[0]
    rest = text[len(head) :].strip()
    return [head, *wrap(rest, others)] if rest else [head]


def _window_lines(text: str, width: int, rows: int, share: float) -> tuple[list[str], int]:
    """The lines around the words that are probably being spoken, and the number of the first line."""
    every = wrap(text, max(10, width - GLYPH - _note_width(width) - 2))
    here = min(len(every) - 1, int(share * len(every)))
    first = min(max(0, here - (rows - 1) // 2), max(0, len(every) - rows))
    shown = every[first : first + rows]
    if first + rows < len(every):
        shown[-1] = f"{shown[-1]} …"
    return shown, first


def _quoted_line(texts: Sequence[str]) -> StyledLine:
    return tuple((f"{'  ' if at else ''}{quoted(text)}", "muted") for at, text in enumerate(texts))


# --- what comes next -----------------------------------------------------------------------------------------------


class _Piece(NamedTuple):
    """A part of the line."""

    line: StyledLine
    least: int | None = None
    """The cells to which it can be cut if there is no room; None: it stays whole, or is omitted."""


def upcoming_line(store: Store, rest: Sequence[str], width: int, key_name: KeyNames) -> StyledLine:
    """The line about the next steps. `rest`: this act's next sentences, if they are not shown elsewhere."""
    pieces = [_Piece(((quoted(rest[0]), "plain"),), MIN_SENTENCE_WIDTH)] if rest else []
    room = width - cell_width(LABEL)
    return crop(((LABEL, "muted"), *_fit_pieces([*pieces, *_rule_pieces(store, room, key_name)], room)), width)


def _fit_pieces(pieces: Sequence[_Piece], width: int) -> StyledLine:
    """Join the pieces. The last ones are omitted first, so that only a sentence is ever cut."""
    kept = list(pieces)
    while len(kept) > 1 and _joined_width([piece.least or line_width(piece.line) for piece in kept]) > width:
        kept.pop()
    over = _joined_width([line_width(piece.line) for piece in kept]) - width
    line: list[StyledSpan] = []
    for at, piece in enumerate(kept):
        if at:
            line.append(GAP)
        if piece.least is not None and over > 0:
            room = max(piece.least, line_width(piece.line) - over)
            line += crop(piece.line, room)
        else:
            line += piece.line
    return tuple(line)


def _joined_width(widths: Sequence[int]) -> int:
    return sum(widths) + cell_width(GAP[0]) * (len(widths) - 1)


def _rule_pieces(store: Store, room: int, key_name: KeyNames) -> list[_Piece]:
    if why := _why_nothing_comes(store, key_name):
        return [_Piece(why)]
    if asked := next((store.view.tasks[id] for id in store.view.questions if id in store.view.tasks), None):
        act = short_title(act_label(asked.function, asked.behavior))
        choices = (("repeat", "repeats"), ("go-on", "goes on"))
        line: list[StyledSpan] = [(f"waits for {key_owner(store)}: {act} failed", "wait")]
        for id, word in choices:
            line += [(f"  {key_name(id)} ", "key"), (word, "plain")]
        return [_Piece(tuple(line)), *(_Piece(_step_line(step)) for step in find_upcoming(store).steps)]
    found = find_upcoming(store)
    pieces = [_Piece(_step_line(step)) for step in found.steps]
    if found.keys:  # after the first step: later steps matter less
        word = "then" if found.after_first else "or" if found.steps else "waits for"
        pieces.insert(1, _Piece(_keys_line(found.keys, f"{word} {key_owner(store)}: ", room)))
    elif found.waits_for:
        pieces.append(_Piece(((f"{'then ' if found.after_first else ''}waits for {clean(found.waits_for)}", "plain"),)))
    if pieces:
        return pieces
    if found.any_rule_runs:
        return [_Piece((("nothing scheduled", "muted"),))]
    nothing: StyledLine = (("nothing scheduled; no rule running", "muted"),)
    first = next((key for key in store.scenario.keys.values() if key.function == RULE), None)
    if first is None or store.view.running:
        return [_Piece(nothing)]
    return [_Piece(nothing), _Piece(_keys_line((first,), f"{key_owner(store)}: ", room))]


def _why_nothing_comes(store: Store, key_name: KeyNames) -> StyledLine:
    """Why nothing will come, whatever the rules have; empty: something may."""
    if store.gone_reason:
        return (("nothing: the session is over" if store.ended_in_order else "nothing: the engine has gone", "muted"),)
    if store.cut_since is not None:
        return (("not known: the connection is cut", "wait"),)
    if store.key_state == "STOPPED":
        return (("nothing until the stop is released: ", "muted"), (key_name("release"), "key"))
    if store.journal_status.trouble:
        return (("nothing: the session is paused, because it is not recorded", "wait"),)
    return ()


def _step_line(step: UpcomingStep) -> StyledLine:
    if step.when == "turn":
        more = f" and {len(step.starts) - 1} more" if len(step.starts) > 1 else ""
        return ((short_title(step.starts[0]), "plain"), (f" (waits{more})", "muted"))
    when = (
        f"in {format_duration(step.seconds)}: " if step.when in ("timer", "filler") and step.seconds is not None else ""
    )
    spans: list[StyledSpan] = [(when, "wait")] if when else []
    if step.condition:
        spans.append((f"if {clean(step.condition)}: ", "muted"))
    if step.target:
        spans.append((f"→ {clean(step.target)}", "plain"))
    acts = [*map(short_title, step.starts), *(f"perhaps {short_title(name)}" for name in step.may_start)]
    if acts:
        spans.append((f"{': ' if step.target else ''}{', '.join(acts)}", "plain" if step.starts else "muted"))
    if step.ends_rule:
        spans.append((f", and {clean(step.rule)} ends", "muted"))
    if not (step.target or acts or step.ends_rule):
        spans.append((f"{clean(step.rule)} stays where it is", "muted"))
    return tuple(spans)


def _keys_line(keys: Sequence[KeyBinding], prefix: str, room: int) -> StyledLine:
    """As many keys as fit, and the number of others."""
    spans: list[StyledSpan] = [(prefix, "muted")]
    for at, key in enumerate(keys):
        more: list[StyledSpan] = [(f"{'  ' if at else ''}{key.label} ", "key"), (clean(key_title(key)), "plain")]
        rest = f"  +{len(keys) - at}"
        last = at == len(keys) - 1
        if at and line_width((*spans, *more)) + (0 if last else cell_width(rest)) > room:
            spans.append((rest, "muted"))
            break
        spans += more
    return tuple(spans)

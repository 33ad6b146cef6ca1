"""The sound of a mark: a tone that sweeps between 1 and 4 kHz within half a second, fading in and out.

Odd marks sweep up and even marks down, so that they differ. A sweep that fades (a Hann window) can be located far more
exactly than a beep or a clap. This holds even under speech, with a cheap microphone or lossy compression.
"""

from __future__ import annotations

import math
import struct
from array import array
from typing import Literal, TypeAlias

CHIRP_SECONDS = 0.5
LOW_HZ, HIGH_HZ = 1_000.0, 4_000.0
LEAD_SECONDS = 0.4
"""Silence before the tone, because a sound card that wakes up drops the beginning."""
TAIL_SECONDS = 0.3
"""Silence after it, because players that exit early cut off the end."""
SOUND_SECONDS = LEAD_SECONDS + CHIRP_SECONDS + TAIL_SECONDS
PLAYED_RATE = 48_000
_LOUDNESS = 0.8
"""Fraction of the card's maximum."""
Sweep: TypeAlias = Literal["up", "down"]


def sweep_of(number: int) -> Sweep:
    """Return the sweep of the mark with this number."""
    return "up" if number % 2 else "down"


def chirp(sweep: Sweep, rate: int) -> array[float]:
    """Make the tone alone, between -1 and 1.

    :param sweep: up or down.
    :param rate: samples in a second.

    >>> up, down = chirp("up", 8_000), chirp("down", 8_000)
    >>> len(up), round(up[0], 6), round(max(up), 2)
    (4000, 0.0, 1.0)
    """
    first, last = (LOW_HZ, HIGH_HZ) if sweep == "up" else (HIGH_HZ, LOW_HZ)
    slope = (last - first) / CHIRP_SECONDS
    count = round(CHIRP_SECONDS * rate)
    samples = array("d")
    for index in range(count):
        t = index / rate
        window = 0.5 - 0.5 * math.cos(2 * math.pi * index / count)
        samples.append(window * math.sin(2 * math.pi * (first * t + slope * t * t / 2)))
    return samples


def mark_sound(number: int) -> bytes:
    """Make the mark of this number as a WAV file: 48 kHz, one channel, 16 bit, silence around the tone.

    >>> mark_sound(1)[:4], len(mark_sound(1)) == 44 + 2 * round(SOUND_SECONDS * PLAYED_RATE)
    (b'RIFF', True)
    """
    lead, tail = (b"\0\0" * round(seconds * PLAYED_RATE) for seconds in (LEAD_SECONDS, TAIL_SECONDS))
    tone = [round(32_767 * _LOUDNESS * each) for each in chirp(sweep_of(number), PLAYED_RATE)]
    data = lead + struct.pack(f"<{len(tone)}h", *tone) + tail
    head = struct.pack("<4sI4s4sIHHIIHH", b"RIFF", 36 + len(data), b"WAVE", b"fmt ", 16, 1, 1, PLAYED_RATE,
                       2 * PLAYED_RATE, 2, 16)  # fmt: skip
    return head + struct.pack("<4sI", b"data", len(data)) + data

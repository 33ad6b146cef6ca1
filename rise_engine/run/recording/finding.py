"""Finds marks in the sound of a file: cross-correlation with the sweeps, in blocks, so that a file of two hours takes
no more memory than one of a minute. Needs numpy (extra `sync`).

At each moment the sound of the last half second, from 0.8 to 4.2 kHz, is compared with a sweep as a correlation
coefficient between 0 and 1, whatever its loudness: a mark that is as loud as the noise around it comes to 0.7, one of a
tenth of its power to 0.3, an hour of noise to 0.1 at most.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib import import_module
from typing import TYPE_CHECKING, Any, get_args

from rise_engine.base.errors import SessionError
from rise_engine.run.recording.alignment import HeardMark
from rise_engine.run.recording.chirp import CHIRP_SECONDS, HIGH_HZ, LOW_HZ, Sweep, chirp

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Samples = NDArray[np.float32]

BELIEVED = 3.0
"""A mark stands so many times above all else in the file."""
_LEAST = 0.15
"""Below this nothing is a mark, however quiet the file is otherwise."""
MOST = 200
"""Marks in one file; a camera that runs for a whole day has those of all sessions."""
_FEW, _SHARE = 4, 0.1
"""In a short file so many, in a longer one this share of its time, can be marks."""
_BLOCK = 1 << 18
"""Samples that are compared at once."""
_BIN_SECONDS = 0.25
"""Of each such piece of the file the best match is kept."""
_APART_SECONDS = 0.5
"""Two marks are no nearer to each other; what is nearer is an echo."""
_QUIET = 1e-5
"""Loudness (of 1) below which there is nothing to compare."""
_MARGIN_HZ = 200.0
"""By which the band is wider than the sweep."""
SWEEPS: tuple[Sweep, ...] = get_args(Sweep)


def load_numpy() -> Any:
    """numpy. Raises SessionError where it is not installed."""
    try:
        return import_module("numpy")
    except ImportError:
        raise SessionError('marks are found with numpy: pip install "rise-tui[sync]"') from None


def find_marks(blocks: Iterable[Samples], rate: int) -> list[HeardMark]:
    """Every sound that is a mark, in the order of the file.

    :param blocks: the sound, one channel, between -1 and 1, in pieces of any length.
    :param rate: samples in a second, 9,000 at least: the sweeps reach 4 kHz.
    :return: those that stand `BELIEVED` times above everything else that sounds alike.
    :raises SessionError: numpy is missing, or the rate is too low.
    """
    numpy = load_numpy()
    if rate < 2 * HIGH_HZ + 1_000:
        raise SessionError(f"the sound has {rate} samples a second, and marks need 9,000 at least")
    matcher = _Matcher(numpy, rate)
    best: list[tuple[float, float, Sweep]] = []
    for start, block in _overlapping(numpy, blocks, matcher.length):
        best.extend(matcher.best_matches(start, block))
    return _select(best)


def _overlapping(numpy: Any, blocks: Iterable[Samples], length: int) -> Iterator[tuple[int, Samples]]:
    """Blocks of one size, each with the place of its first sample; the last samples of one are the first of the next,
    so that no mark is cut in two. The file's end is filled with silence."""
    buffer = numpy.zeros(_BLOCK, dtype=numpy.float32)
    filled = start = 0
    step = _BLOCK - length + 1
    for samples in blocks:
        while len(samples):
            count = min(_BLOCK - filled, len(samples))
            buffer[filled : filled + count] = samples[:count]
            filled, samples = filled + count, samples[count:]
            if filled == _BLOCK:
                yield start, buffer
                kept = buffer[step:].copy()
                buffer[: len(kept)] = kept
                filled, start = len(kept), start + step
    if filled:
        buffer[filled:] = 0
        yield start, buffer


class _Matcher:
    """Compares blocks with both sweeps."""

    def __init__(self, numpy: Any, rate: int) -> None:
        self._numpy, self._rate = numpy, rate
        self.length = round(CHIRP_SECONDS * rate)
        frequencies = numpy.fft.rfftfreq(_BLOCK, 1 / rate)
        inside = (frequencies >= LOW_HZ - _MARGIN_HZ) & (frequencies <= HIGH_HZ + _MARGIN_HZ)
        self._band = inside.astype(numpy.float32)
        self._spectra = {sweep: self._spectrum(sweep) for sweep in SWEEPS}
        self._bin = round(_BIN_SECONDS * rate)

    def _spectrum(self, sweep: Sweep) -> Any:
        numpy = self._numpy
        tone = numpy.zeros(_BLOCK, dtype=numpy.float32)
        tone[: self.length] = numpy.array(chirp(sweep, self._rate), dtype=numpy.float32)
        tone /= numpy.sqrt(numpy.sum(tone.astype(numpy.float64) ** 2))
        return numpy.conj(numpy.fft.rfft(tone)) * self._band

    def best_matches(self, start: int, block: Samples) -> Iterator[tuple[float, float, Sweep]]:
        """Of each piece of the block the best match of each sweep: how good it is, when in the file it begins."""
        numpy = self._numpy
        spectrum = numpy.fft.rfft(block)
        heard = numpy.fft.irfft(spectrum * self._band, _BLOCK).astype(numpy.float64)
        energy = numpy.concatenate(([0.0], numpy.cumsum(heard * heard)))
        count = _BLOCK - self.length + 1
        loudness = numpy.sqrt(numpy.maximum(energy[self.length :] - energy[:count], _QUIET**2 * self.length))
        for sweep in SWEEPS:
            matches = numpy.abs(numpy.fft.irfft(spectrum * self._spectra[sweep], _BLOCK)[:count]) / loudness
            whole = count // self._bin * self._bin
            places = matches[:whole].reshape(-1, self._bin).argmax(axis=1) + numpy.arange(0, whole, self._bin)
            if whole < count:
                places = numpy.append(places, whole + matches[whole:].argmax())
            for place in places:
                yield float(matches[place]), (start + self._peak(matches, int(place))) / self._rate, sweep

    def _peak(self, matches: Any, place: int) -> float:
        """Where the top of a peak lies between samples: of a parabola through its three highest."""
        if not 0 < place < len(matches) - 1:
            return place
        before, top, after = (float(each) for each in matches[place - 1 : place + 2])
        bend = before - 2 * top + after
        return place + (0.5 * (before - after) / bend if bend < 0 else 0.0)


def _select(best: list[tuple[float, float, Sweep]]) -> list[HeardMark]:
    """Those that stand above all else. All else begins behind as many of the best as can be marks."""
    places = max((at for _, at, _ in best), default=0.0) / _APART_SECONDS
    most = min(MOST, max(_FEW, int(places * _SHARE)))
    apart: list[tuple[float, float, Sweep]] = []
    for match in sorted(best, reverse=True):
        if len(apart) > most:
            break
        if all(abs(match[1] - each[1]) >= _APART_SECONDS for each in apart):
            apart.append(match)
    floor = max(apart[most][0] if len(apart) > most else 0.0, _LEAST / 100)
    least = max(_LEAST, BELIEVED * floor)
    heard = [HeardMark(sweep, at, round(quality / floor, 2)) for quality, at, sweep in apart[:most] if quality >= least]
    return sorted(heard, key=lambda mark: mark.at)

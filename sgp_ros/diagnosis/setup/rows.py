"""Rows of a recording on which errors of its connection are looked for.

They are the fewest that show the motion: stretches that are spread over the recording, thinned as
the band allows in which the joints move.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sgp_ros.robots.observed_motion import ObservedMotion

_MOST_ROWS = 1000
_STRETCHES = 4
"""Parts of the recording, spread evenly, that are looked at."""
PER_PERIOD = 8.0
"""Rows per period of the cut-off before the filter."""
WIDE = 2.5
"""Cut-off before rows are left out, by that of the filter: motion passes, what would alias not."""
_BAND, _MOTION = 4.0, 0.99
"""Cut-off, by the frequency that the motion has below it: this part of its mean squares.

Friction turns at once, and forces of several joints multiply.
"""


def most_hz(motion: ObservedMotion) -> float:
    """Return the cut-off above which a motion says no more of its connection [Hz].

    Fewer rows a second are then needed, and those that are looked at show more of the motion, up
    to all of it. A steady turn has no frequency.
    """
    if motion.is_static or not motion.moves.any():
        return math.inf
    power = np.abs(np.fft.rfft(motion.velocity[:, motion.moves], axis=0)) ** 2
    power[0] = 0.0
    part = power.cumsum(axis=0) / np.maximum(power.sum(axis=0), 1e-300)
    frequency = np.fft.rfftfreq(len(motion.time), motion.step)
    whole = _MOST_ROWS / (PER_PERIOD * motion.step * len(motion.time))
    highest = frequency[np.minimum((part < _MOTION).sum(axis=0), len(frequency) - 1)].max()
    return max(_BAND * float(highest), whole)


def spread(segments: Sequence[slice], every: int, margin: int) -> list[np.ndarray]:
    """Return rows of stretches that are spread over a recording, every `every`-th each.

    None are within a margin of the ends of segments.
    """
    whole = [np.arange(s.start + margin, s.stop - margin, every) for s in segments]
    total = sum(len(rows) for rows in whole)
    if total <= _MOST_ROWS:
        return whole
    share, kept = _MOST_ROWS / total, []
    for rows in whole:
        parts = max(1, round(_STRETCHES * len(rows) / total))
        split = np.array_split(rows, parts)
        kept += [part[: max(64, int(share * len(part)))] for part in split]
    return kept

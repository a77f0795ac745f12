"""Fills the basis of a stream before the first sample leaves the buffer.

Whole at that moment, it would be the work of a buffer between two samples.
"""

from __future__ import annotations

import math

from sgp_ros.gp.sample_buffer import SampleBuffer
from sgp_ros.gp.stream_basis import StreamBasis


class BasisAhead:
    """A basis that holds the first samples of a buffer which no sample has left.

    Attributes:
        basis: what they tell.
        count: of them.

    Args:
        basis: before any sample.
    """

    def __init__(self, basis: StreamBasis) -> None:
        self.basis = basis
        self.count = 0

    def catch_up(self, samples: SampleBuffer, room: int) -> None:
        """Absorb so many samples that at this pace none is left when `room` more have come.

        With room for none, all of them.
        """
        share = math.ceil((samples.size - self.count) / max(room, 1))
        self.basis.absorb_samples(samples, self.count, self.count + share)
        self.count += share

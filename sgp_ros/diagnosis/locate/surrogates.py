"""Disturbances with the spectra of a residual that know nothing of the motion.

The phases of the Fourier coefficients are drawn anew, the same for all joints: what is kept are
all correlations in time and between joints, what is lost is every relation to the motion and to
the clock (Theiler and others 1992; for several signals Prichard and Theiler 1994).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np


def surrogates(residual: np.ndarray, count: int) -> Iterator[np.ndarray]:
    """Yield `count` disturbances like a residual (N, k), (N, k) each; always the same ones.

    Cost O(N k log N) each.
    """
    rng = np.random.default_rng(0)
    n = len(residual)
    spectrum = np.fft.rfft(residual, axis=0)
    for _ in range(count):
        turns = np.exp(2j * np.pi * rng.random(len(spectrum)))
        turns[0] = 1.0
        if n % 2 == 0:
            turns[-1] = rng.choice([-1.0, 1.0])
        yield np.fft.irfft(spectrum * turns[:, None], n, axis=0)

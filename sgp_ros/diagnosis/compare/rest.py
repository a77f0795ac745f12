"""Where the joints of a recording rest."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from sgp_ros.diagnosis.compare.trajectory import Bandwidth, RawTrajectory
from sgp_ros.robots.observed_motion import ObservedMotion

_SLOW, _CREEP = 1e-3, 1e-2
"""Speeds, of the mean square one, below which a joint rests, and below which it may."""
_NOISES = 4.0
"""Noises below which a speed is none."""
_PERIODS = 1.0
"""Time over which the noise of positions is averaged, in periods of their cut-off."""
_PUSHED = 0.1
"""Acceleration, of the mean square one, below which a slow joint neither stops nor starts."""
_PASSING = 0.5
"""Standard deviation of the velocities below a limit, in its parts; 0.58 of a joint that passes
zero steadily."""
_NARROW = 1e-2
"""Part of its range within which a joint stays that rests, as dry friction gives way a little."""


def resting(raw: RawTrajectory, motion: ObservedMotion, bandwidth: Bandwidth) -> np.ndarray:
    """Return where joints rest, (n, k).

    They are slower there than the noise of the velocity for some time: than that of the whole
    recording, and than that of the time, unless they creep. Or they creep, and stay within a small
    part of their range: friction is elastic before it slides. What leads there is motion.
    """
    per = (2 * np.pi) ** 2 * bandwidth.state_cutoff**3 / 3.0
    noise, now = (np.sqrt(per * x) for x in (raw.noise_density, _density(raw, motion, bandwidth)))
    typical, pushes = (
        np.sqrt((x**2).mean(axis=0)) for x in (motion.velocity, motion.acceleration)
    )
    shortest = max(4, round(0.03 / raw.step))
    rests = np.zeros(motion.velocity.shape, dtype=bool)
    for j in range(motion.velocity.shape[1]):
        q, velocity = motion.position[:, j], motion.velocity[:, j]
        speed = np.abs(velocity)
        push = motion.acceleration[:, j] / max(float(pushes[j]), 1e-300)
        least, creep = (x * float(typical[j]) for x in (_SLOW, _CREEP))
        noisy = np.minimum(_NOISES * noise[j], np.maximum(_NOISES * now[:, j], creep))
        surely, perhaps = np.maximum(noisy, least), np.maximum(noisy, creep)
        slow = _slow(velocity, push, surely, shortest)
        narrow = _NARROW * np.ptp(q)
        slow += [x for x in _slow(velocity, push, perhaps, shortest) if np.ptp(q[x]) < narrow]
        for part in slow:
            rests[_standing(speed, np.abs(push), part, least), j] = True
    return rests


def _density(
    raw: RawTrajectory, motion: ObservedMotion, bandwidth: Bandwidth
) -> np.ndarray:  # fmt: skip
    """Return the density of the positions' noise at each time, (n, k) [rad^2/Hz or m^2/Hz].

    From what smoothing takes away: jitter of stamps makes a noise of fast motions, none of
    slow ones, which are no rest because of it.
    """
    squares = (raw.position - motion.position) ** 2
    count = max(4, round(_PERIODS / (bandwidth.state_cutoff * raw.step)))
    mean = ndimage.uniform_filter1d(squares, count, axis=0, mode='nearest')
    above = max(0.5 / raw.step - bandwidth.state_cutoff, bandwidth.state_cutoff)
    return np.asarray(np.maximum(mean, 0.0) / above)


def _standing(speed: np.ndarray, push: np.ndarray, part: slice, least: float) -> slice:
    """Return a stretch without the rows at its ends in which a joint still slows down, or starts.

    Noise of a velocity is that of the whole recording, with what jitter of stamps makes of the
    motion: a joint that slows down is slower than that before it stands.
    """
    noise = max(_NOISES * float(np.median(speed[part])), least)
    there = np.flatnonzero((speed[part] <= noise) | (push[part] < _PUSHED))
    return slice(part.start + int(there[0]), part.start + int(there[-1]) + 1)


def _slow(velocity: np.ndarray, push: np.ndarray, limit: np.ndarray, shortest: int) -> list[slice]:
    """Return the stretches below three times a speed (n,) that have enough rows below it.

    Without those in which a joint is pushed through zero: it has all these speeds equally long,
    forwards and backwards.
    """
    speed = np.abs(velocity)
    wide = np.concatenate([[False], speed <= 3.0 * limit, [False]])
    edges = np.flatnonzero(np.diff(wide.astype(int)))
    parts = (slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True))
    share = velocity / np.maximum(limit, 1e-300)
    cores = ((part, np.flatnonzero(speed[part] <= limit[part]) + part.start) for part in parts)
    return [
        part for part, at in cores if len(at) >= shortest
        and (abs(push[at].mean()) < _PUSHED or share[at].std() < _PASSING)
    ]  # fmt: skip

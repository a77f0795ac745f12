"""Flaws of recordings of real machines, from the sensors to the file.

Efforts are currents times a constant, with noise and bias. Encoders stand behind gears. Velocities
are differences or missing. Stamps jitter, some come twice, stretches are missing, and a file may
be joined from two recordings.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from sgp_ros.engine.samples import JointSample
from sgp_ros.recordings.writer import RecordingWriter

VELOCITIES = ('absent', 'differences', 'measured')
_EFFORT_STEPS = 2**12
_VELOCITY_NOISE = 0.01
_MESSAGE_LATE_S = 1e-3


@dataclass(frozen=True)
class Blemishes:
    """Of the recordings of one machine.

    Attributes:
        effort_noise: standard deviation, relative to the effort's root mean square [1].
        effort_bias: (k,) relative to the same [1].
        velocity: one of `VELOCITIES`.
        stamp_noise_s: standard deviation of stamps [s].
        repeated: share of the messages that come twice [1].
        gaps: number of stretches that are missing.
        parts: recordings that one file is joined from.
        pause_s: between the stamps of such parts, 0 where they go on [s].
        is_permuted: whether the joints stand in another order.
        is_one_size: whether noise and resolution of all efforts are those of the greatest one, as
            of drives of one size.
    """

    effort_noise: float
    effort_bias: tuple[float, ...]
    velocity: str
    stamp_noise_s: float
    repeated: float
    gaps: int
    parts: int
    pause_s: float
    is_permuted: bool
    is_one_size: bool = False

    def described(self):
        """Return them as an answer holds them."""
        return asdict(self)


def draw_blemishes(rng, joints, period_s):
    """Return the blemishes of a machine of so many joints, sampled every `period_s`."""
    return Blemishes(
        float(rng.uniform(0.01, 0.03)),
        tuple(rng.uniform(-0.01, 0.01, joints).tolist()),
        str(rng.choice(VELOCITIES, p=[0.5, 0.35, 0.15])),
        float(rng.choice([0.0, 5e-5, min(3e-4, 0.1 * period_s)])),
        float(rng.choice([0.0, 0.0, 0.003])),
        int(rng.choice([0, 0, 1, 3])),
        int(rng.choice([1, 1, 2])),
        float(rng.choice([0.0, 30.0])),
        bool(rng.random() < 0.3),
    )


def sizes_of(parts, blemishes):
    """Return what bias and noise of efforts are relative to, and their resolution, (k,) each."""
    clean = np.vstack([part.effort for part in parts])
    sizes = np.sqrt(np.mean(clean**2, axis=0)) + 1e-12
    steps = 8.0 * np.abs(clean).max(axis=0) / _EFFORT_STEPS + 1e-12
    if blemishes.is_one_size:
        return sizes, np.full_like(sizes, sizes.max()), np.full_like(steps, steps.max())
    return sizes, sizes, steps


def samples(parts, every, blemishes, rng):
    """Return what a file holds of simulated recordings, as messages.

    Args:
        parts: simulated recordings, joined to one file.
        every: which of their samples is recorded, 4 for every fourth.
        blemishes: of the machine.
        rng: of the noise.
    """
    found, shift_ns, end_ns = [], 0, None
    period_ns = every * int(np.median(np.diff(parts[0].stamps_ns)))
    own, scale, step = sizes_of(parts, blemishes)
    order = np.arange(len(scale))
    if blemishes.is_permuted:
        order = rng.permutation(order)
    for part in parts:
        rows = np.arange(0, len(part.stamps_ns), every)
        stamps = part.stamps_ns[rows]
        if end_ns is not None:
            shift_ns = end_ns + int(1e9 * blemishes.pause_s) + period_ns - int(stamps[0])
        end_ns = int(stamps[-1]) + shift_ns
        noise = np.round(1e9 * blemishes.stamp_noise_s * rng.normal(size=len(rows)))
        shown = np.maximum.accumulate(stamps + shift_ns + noise.astype(np.int64))
        white = blemishes.effort_noise * scale * rng.normal(size=(len(rows), len(scale)))
        effort = part.effort[rows] + white + own * np.array(blemishes.effort_bias)
        effort = step * np.round(effort / step)
        velocity = _velocities(part, blemishes.velocity, rng)
        for i, row in enumerate(rows):
            sample = JointSample(
                int(shown[i]),
                tuple(part.joint_names[j] for j in order),
                part.position[row][order],
                None if velocity is None else velocity[row][order],
                effort[i][order],
            )
            found += [sample] * (2 if rng.random() < blemishes.repeated else 1)
    return _with_gaps(found, blemishes.gaps, rng)


def write_samples(found, path, rng):
    """Write messages as an MCAP file, logged a little late."""
    with RecordingWriter(path) as writer:
        log_ns = 0
        for sample in found:
            log_ns = max(log_ns + 1, sample.stamp_ns + int(1e9 * _MESSAGE_LATE_S * rng.random()))
            writer.write_event(sample, log_ns)


def _velocities(part, kind, rng):
    """Return velocities (n, k), or None."""
    if kind == 'absent':
        return None
    if kind == 'differences':
        seconds = np.diff(1e-9 * part.stamps_ns)[:, None]
        return np.vstack([0.0 * part.position[:1], np.diff(part.position, axis=0) / seconds])
    scale = _VELOCITY_NOISE * part.shown_velocity.std(axis=0)
    return part.shown_velocity + scale * rng.normal(size=part.shown_velocity.shape)


def _with_gaps(found, count, rng):
    """Leave stretches of 0.1 to 2 s out."""
    kept = found
    for _ in range(count):
        begin = found[int(rng.uniform(0.05, 0.9) * len(found))].stamp_ns
        end = begin + 1e9 * rng.uniform(0.1, 2.0)
        kept = [sample for sample in kept if not begin < sample.stamp_ns < end]
    return kept

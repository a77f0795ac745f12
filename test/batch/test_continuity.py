"""Jumps between joined recordings are found, and no motion is taken for one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sgp_ros.batch.continuity import braked, jumps, unwrapped
from sgp_ros.batch.signals import collect_signals
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.physics.term import Joint
from sgp_ros.robots.robot import Robot

START_NS = 1_700_000_000_000_000_000
HINGE = Robot('hinge', (Joint('hinge'),), 'effort', (), ((),))


def _stamps(rng, n, rate_hz):
    """Return stamps (n,) with jitter, late arrivals and drop-outs, as drawn [ns]."""
    t = np.arange(n) / rate_hz
    if rng.random() < 0.4:
        t = t + rng.uniform(0.0, 0.4) / rate_hz * rng.random(n)
    if rng.random() < 0.3:  # messages that wait are stamped together
        for i in rng.integers(0, n - 8, n // 100):
            t[i : i + 8] = t[i + 7] + 1e-5 * np.arange(8) - 7e-5
    kept = np.ones(n, dtype=bool)
    if rng.random() < 0.4:
        for i in rng.integers(0, n, 5):
            kept[i : i + rng.integers(2, 12)] = False
    t = np.maximum.accumulate(t[kept]) + 1e-9 * np.arange(kept.sum())
    return START_NS + np.round(1e9 * t).astype(np.int64)


def _motion(rng, t):
    """Return a drawn motion at times (n,) [rad]: smooth, hit, dwelling, stepping or at rest."""
    kind = rng.choice(['sines', 'bounces', 'dwells', 'slips', 'trapezoids', 'rest'])
    size = 10.0 ** rng.uniform(-2.0, 0.5)
    if kind == 'sines':
        f = rng.uniform(0.05, 3.0, 4)
        return size * np.sin(2.0 * np.pi * np.outer(t, f) + rng.uniform(0.0, 6.0, 4)).sum(axis=1)
    if kind == 'bounces':  # the speed changes its sign at once, at 7 rad/s and more
        phase = rng.uniform(1.0, 10.0) * t / size + rng.random()
        return size * np.abs((phase % 2.0) - 1.0)
    if kind == 'dwells':  # seldom and briefly in motion: a smooth step of some samples
        at = rng.uniform(0.0, t[-1], 3)
        return size * sum(np.tanh((t - x) / rng.uniform(0.04, 0.4)) for x in at)
    if kind == 'slips':  # a joint sticks, lets go and swings out
        held = np.sort(rng.uniform(0.0, t[-1], int(t[-1]) + 2))
        q = np.zeros(len(t))
        for x in held:
            late = np.maximum(t - x, 0.0)
            q += size * (1.0 - np.exp(-late / 0.05) * np.cos(40.0 * late))
        return q
    if kind == 'trapezoids':
        return np.cumsum(size * np.clip(4.0 * np.sin(rng.uniform(0.3, 3.0) * t), -1.0, 1.0)) * (
            t[1] - t[0]
        )
    return np.zeros(len(t))


def _recorded(rng, q):
    """Return positions as an encoder shows them: fine or coarse, with and without noise."""
    noise = 10.0 ** rng.uniform(-7.0, -2.5) if rng.random() < 0.6 else 0.0
    shown = q + noise * rng.normal(size=len(q))
    if rng.random() < 0.6:
        count = 10.0 ** rng.uniform(-6.0, -1.7)
        shown = count * np.round(shown / count)
    return shown


def _drawn(seed):
    """Return stamps (m,) and positions (m, 2) of a drawn motion, and its generator."""
    rng = np.random.default_rng(seed)
    stamps = _stamps(rng, int(rng.integers(300, 3000)), rng.choice([50.0, 100.0, 500.0, 1000.0]))
    t = 1e-9 * (stamps - START_NS)
    return stamps, np.column_stack([_recorded(rng, _motion(rng, t)) for _ in range(2)]), rng


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_motion_is_taken_for_a_jump(seed):
    stamps, position, _ = _drawn(seed)
    found = np.flatnonzero(jumps(stamps, position))
    assert not len(found), (found, position[found[0] - 2 : found[0] + 4])


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_jump_far_beyond_the_usual_steps_is_found(seed):
    """And nothing else is. Of a joint that never moves it cannot be told from one count."""
    stamps, position, rng = _drawn(seed)
    steps = np.abs(np.diff(position, axis=0))
    at, j = int(rng.integers(1, len(stamps) - 1)), int(rng.integers(2))
    assume(np.count_nonzero(steps[:, j]) > 2)
    taken = np.maximum(np.diff(stamps) / np.median(np.diff(stamps)), 1.0)
    position[at:, j] += rng.choice([-1.0, 1.0]) * (30.0 * steps[:, j].max() + 1e-3) * taken[at - 1]
    assert np.flatnonzero(jumps(stamps, position)).tolist() == [at - 1]


def test_a_lost_count_that_comes_back_is_cut_out():
    t = np.arange(500) * 0.01
    position = np.sin(t)[:, None]
    position[200] += 1.0
    found = jumps(START_NS + np.round(1e9 * t).astype(np.int64), position)
    assert np.flatnonzero(found).tolist() == [199, 200]


def _wrapped(speed, rate_hz=100.0, n=800):
    t = np.arange(n) / rate_hz
    q = (speed * t + 0.3 * np.sin(t))[:, None]
    return START_NS + np.round(1e9 * t).astype(np.int64), q, (q + np.pi) % (2.0 * np.pi) - np.pi


@pytest.mark.parametrize('speed', [-40.0, -3.0, 1.0, 9.0, 40.0])
def test_turns_are_counted_on(speed):
    stamps, q, shown = _wrapped(speed)
    assert unwrapped(stamps, shown) - shown[0] == pytest.approx(q - q[0], abs=1e-9)
    assert not jumps(stamps, unwrapped(stamps, shown)).any()


def test_what_does_not_wrap_is_left_as_it_is():
    """Steps above half a turn of an encoder that counts turns, and joins of another phase."""
    stamps, q, _ = _wrapped(320.0)
    assert unwrapped(stamps, q).tolist() == q.tolist()
    joined = np.where(np.arange(800)[:, None] < 400, -2.0, 2.0) + 0.1 * np.sin(0.02 * q)
    assert unwrapped(stamps, joined).tolist() == joined.tolist()
    assert np.flatnonzero(jumps(stamps, joined)).tolist() == [399]


def _joined_events(turn=np.inf):
    """Return states of a sine of 8 s whose second half starts elsewhere, stamped without pause."""
    for i in range(1600):
        q = (5.8 + np.sin(0.005 * i) + (0.5 if i >= 800 else 0.0)) % turn
        arrays = frozen_array([q]), None, frozen_array([np.cos(0.02 * i)])
        yield JointSample(START_NS + i * 5_000_000, ('hinge',), *arrays)


def test_joined_recordings_are_taken_apart_and_said():
    """All states stay in use, on either side of the join."""
    for found in (collect(_joined_events(), HINGE), collect_signals(_joined_events(), HINGE)):
        assert found.segments == (slice(0, 800), slice(800, 1600))
        assert found.remarks == ('Positions jump at t = 4 s: treated as 2 recordings.',)


def test_only_turns_of_a_joint_without_limits_are_no_joins():
    events = list(_joined_events(turn=2.0 * np.pi))
    limited = Joint('hinge', lower=-9.0, upper=9.0)
    for joint, count in ((Joint('hinge'), 2), (limited, 5), (Joint('hinge', 'prismatic'), 5)):
        robot = Robot('hinge', (joint,), 'effort', (), ((),))
        assert len(collect_signals(events, robot).segments) == count


def _held(fall, rest, load):
    """Return stamps, positions and efforts of an arm that moves, is switched off, and moves."""
    step, noise = 0.004, np.random.default_rng(4)
    moving = np.arange(0.0, 8.0, step)
    swing = np.column_stack([np.sin(moving), 0.5 * np.cos(1.7 * moving)])
    down = np.arange(0.0, fall, step)
    falls = swing[-1] + np.column_stack([-0.3 * down**2, 0.1 * down**2])
    held = np.repeat(falls[-1:], round(rest / step), axis=0)
    q = np.concatenate([swing, falls, held, held[-1] + swing - swing[0]])
    off = np.zeros(len(q), dtype=bool)
    off[len(swing) : len(swing) + len(falls) + len(held)] = True
    effort = np.where(off[:, None], 0.0, load + np.cos(q)) + noise.normal(0.0, 0.02, q.shape)
    return np.round(np.arange(len(q)) * step * 1e9).astype(np.int64), q, effort, off


def test_what_brakes_hold_is_left_out_and_said():
    """From when the drives go off, and the arm sags, until they are on."""
    stamps, q, effort, off = _held(0.15, 6.0, 3.0)
    assert (braked(stamps, q, effort) == off).all()
    unmeasured = np.column_stack([effort, np.full(len(q), np.nan)])
    assert (braked(stamps, q, unmeasured) == off).all()
    events = [
        JointSample(int(t), ('a', 'b'), frozen_array(x), None, frozen_array(u))
        for t, x, u in zip(stamps, q, effort, strict=True)
    ]
    robot = Robot('arm', (Joint('a'), Joint('b')), 'effort', (), ((), ()))
    raw = collect(events, robot)
    assert len(raw.segments) == 2
    assert sum(len(raw.time[s]) for s in raw.segments) == pytest.approx((~off).sum(), abs=2)
    (said,) = (x for x in raw.remarks if 'brakes' in x)
    assert said.startswith(f'{off.sum()} states')


@pytest.mark.parametrize(
    ('fall', 'rest', 'load'), [(2.0, 6.0, 3.0), (0.15, 0.5, 3.0), (0.15, 6.0, np.nan)]
)
def test_free_motion_short_rests_and_commanded_efforts_are_kept(fall, rest, load):
    """A pendulum that swings out has no brake, and what no sensor measures is not zero."""
    stamps, q, effort, _ = _held(fall, rest, load)
    assert not braked(stamps, q, effort).any()

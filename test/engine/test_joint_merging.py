"""Whole states from messages that bring a part of the joints each."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.engine.joint_merging import JointMerger
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.ros.verdict import LOST_SHARE

MS = 10**6
JOINTS = ('a', 'b', 'c')


def _sample(stamp_ns, **position):
    return JointSample(stamp_ns, tuple(position), frozen_array([*position.values()]))


def _merged(samples, joints=JOINTS):
    merger = JointMerger(joints)
    return merger, [state for sample in samples for state in merger.take(sample)]


def test_a_whole_message_passes_as_it_is():
    """In any order of its joints, and with a joint more."""
    sent = [_sample(0, c=1, a=2, b=3), _sample(5, a=2, gripper=0, b=3, c=1)]
    _, states = _merged(sent)
    assert all(state is sample for state, sample in zip(states, sent, strict=True))


def test_parts_of_one_stamp_are_one_state():
    """In either order of arrival; nothing is interpolated."""
    sent = [_sample(0, b=2), _sample(0, c=3, a=1), _sample(MS, a=4, c=6), _sample(MS, b=5)]
    _, states = _merged(sent)
    assert [state.stamp_ns for state in states] == [0, MS]
    assert [state.names for state in states] == [JOINTS] * 2
    np.testing.assert_array_equal([s.position for s in states], [[1, 2, 3], [4, 5, 6]])


def test_the_slowest_part_sets_the_times_and_the_others_are_interpolated():
    """Exactly for motions that a cubic follows, where velocities are known."""

    def fast(t):
        values = frozen_array([t**3 - t, 2 * t**2])
        rates = frozen_array([3 * t**2 - 1, 4 * t])
        return JointSample(round(t * 1e9), ('a', 'b'), values, rates, frozen_array([t, 1 - t]))

    sent = [fast(0.002 * i) for i in range(200)]
    sent += [_sample(round((0.0201 + 0.02 * i) * 1e9), c=i) for i in range(18)]
    sent.sort(key=lambda sample: sample.stamp_ns)
    _, states = _merged(sent)
    late = [state for state in states if state.stamp_ns > 10**8]
    assert len(late) >= 13
    for state in late:
        t = state.stamp_ns * 1e-9
        np.testing.assert_allclose(state.position[:2], [t**3 - t, 2 * t**2], rtol=1e-12)
        np.testing.assert_allclose(state.effort[:2], [t, 1 - t], rtol=1e-12)
        assert state.position[2] == pytest.approx((t - 0.0201) / 0.02)
        assert np.isnan(state.velocity[2])


def test_joints_that_nobody_brings_are_named():
    merger, states = _merged([_sample(0, a=1, b=2), _sample(1, gripper=1)])
    assert states == []
    assert merger.missing == ('c',)
    assert merger.foreign == 1


def test_a_joint_of_two_sources_is_named_and_taken_from_the_first():
    sent = [s for i in range(5) for s in (_sample(i * MS, a=i, b=i, c=i), _sample(i * MS, b=9))]
    merger, states = _merged(sent)
    assert merger.shared == ('b',)
    assert [state.position[1] for state in states] == [0, 1, 2, 3, 4]


@pytest.mark.parametrize('positions', [(0.5, 0.1), (0.1, 0.1)])
def test_two_publishers_of_the_same_joints_are_noticed_where_they_disagree(positions):
    """Only a repeated jump there and back tells them apart, so only a disagreement is seen."""
    merger = JointMerger(('a',))
    merger.looks_for_returns = True
    for i in range(40):
        merger.take(_sample(i * MS, a=positions[i % 2] + 1e-4 * i))
    assert merger.shared == (('a',) if positions[0] != positions[1] else ())


def test_a_source_that_fell_silent_leaves_its_joints_to_another():
    """Such as a driver that was restarted and now sends all joints in one message."""
    sent = [s for i in range(5) for s in (_sample(i * MS, a=i), _sample(i * MS, b=i, c=i))]
    sent += [_sample(10**10 + i * MS, a=7, b=7, c=7) for i in range(5)]
    _, states = _merged(sent)
    assert len(states) == 9  # one message alone tells no time
    assert states[-1].position.tolist() == [7, 7, 7]


def test_a_pause_of_one_source_costs_the_states_of_the_pause_alone():
    sent = [_sample(i * 100 * MS, a=i) for i in range(100)]
    sent += [_sample(i * 100 * MS, b=i, c=i) for i in range(100) if not 30 <= i < 60]
    sent.sort(key=lambda sample: sample.stamp_ns)
    merger, states = _merged(sent)
    assert len(states) == 70
    assert merger.unmatched == 30


def test_a_clock_that_is_set_back_begins_anew():
    loop = [
        s for i in range(50) for s in (_sample(i * 50 * MS, a=i), _sample(i * 50 * MS, b=i, c=i))
    ]
    _, states = _merged(loop + loop)
    assert len(states) == 100


@pytest.mark.parametrize('jitter', [0.0, 0.3])
def test_lost_messages_are_counted_by_the_period(jitter):
    """Each one, however many in a row, while stamps jitter by less than half a period."""
    rng = np.random.default_rng(0)
    kept = np.flatnonzero(rng.uniform(size=3000) > 0.1)
    kept = kept[kept > 40]
    merger = JointMerger(('a',))
    for i in [*range(41), *kept]:
        stamp = round((i + jitter * rng.uniform(-0.5, 0.5)) * 2 * MS)
        merger.take(_sample(stamp, a=0.0))
    missing = int(kept[-1]) + 1 - 41 - len(kept)
    assert missing > 200
    assert abs(merger.lost - missing) <= (0 if jitter == 0.0 else 0.02 * missing)


def _count(periods, period_ms=1):
    merger = JointMerger(('a',))
    for stamp in periods:
        merger.take(_sample(round(stamp * period_ms * MS), a=0.0))
    return merger.lost


_N = 10_000
_STEPS = np.arange(_N)


def _slept(rng):
    """Return the stamps of a publisher that sleeps, and sometimes too long."""
    late = np.where(rng.uniform(size=_N) < 0.01, rng.uniform(0.2, 1.0, size=_N), 0.0)
    return np.cumsum(1.006 + 0.03 * rng.exponential(size=_N) + late)


def _woken_late(rng):
    """Return the stamps of a timer that is late by most of a period, and makes up for it."""
    late = np.where(rng.uniform(size=_N) < 0.03, rng.uniform(0.3, 0.95, size=_N), 0.0)
    return _STEPS + 0.02 * rng.normal(size=_N) + late


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize(
    'stamps',
    [
        *(
            lambda rng, jitter=jitter: _STEPS + jitter * rng.normal(size=_N)
            for jitter in (0.1, 0.15, 0.2, 0.3)
        ),
        *(
            lambda rng, width=width: _STEPS + rng.uniform(-width, width, size=_N)
            for width in (0.1, 0.25, 0.4)
        ),
        *(
            lambda rng, width=width: np.cumsum(1.0 + rng.uniform(-width, width, size=_N))
            for width in (0.1, 0.3)
        ),
        lambda rng: np.cumsum(1.0 + 0.1 * np.sin(_STEPS / 2000)),
        _woken_late,
        pytest.param(_slept, id='slept'),
    ],
)
def test_what_comes_early_or_late_is_not_lost(stamps, seed):
    """Jitter of the stamps, of the spacings, a rate that drifts: too little to warn of."""
    assert _count(stamps(np.random.default_rng(seed))) < LOST_SHARE * _N


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize('jitter', [0.0, 0.02, 0.1, 0.2])
@pytest.mark.parametrize('share', [0.01, 0.25, 'every fourth', 'bursts'])
def test_losses_are_counted_whatever_their_share(share, jitter, seed):
    """Exactly where stamps are regular; of many beside strong jitter, enough to warn of."""
    rng = np.random.default_rng(seed)
    if share == 'bursts':
        is_kept = ~(((_STEPS > 500) & (_STEPS < 4500)) | ((_STEPS > 6000) & (_STEPS < 8500)))
    elif share == 'every fourth':
        is_kept = _STEPS % 4 != 0
    else:
        is_kept = rng.uniform(size=_N) > share
    is_kept[:100] = is_kept[-9:] = True
    lost = int(np.sum(~is_kept))
    found = _count((_STEPS + jitter * rng.normal(size=_N))[is_kept])
    if jitter == 0.2 and share in {0.25, 'every fourth'}:
        assert LOST_SHARE * is_kept.sum() < found <= lost
    else:
        assert abs(found - lost) <= (0 if jitter == 0.0 else max(4, 0.005 * lost))


@pytest.mark.parametrize('spacings', [(1, 2), (2, 1), (1, 1.3), (1.3, 1), (1, 5)])
def test_a_rate_that_changes_is_called_loss_no_longer_than_it_takes_to_tell(spacings):
    before, after = spacings
    stamps = np.cumsum([before] * 1000 + [after] * 3000)
    assert _count(stamps) <= 183 * max(after / before - 1.0, 0.0)
    assert _count(np.append(stamps, stamps[-1] + after * np.array([2, 3]))) == _count(stamps) + 1


@pytest.mark.parametrize('stamp_ns', [0, 10**18, 5 * 10**8])
def test_one_wrong_message_takes_no_joint_away_for_long(stamp_ns):
    """Its name may be damaged, and its stamp of a far future."""
    sent = [_sample(10 * MS * i, a=1, b=2, c=3) for i in range(300)]
    wrong = _sample(stamp_ns, a=1, x=2, c=3)
    _, states = _merged([wrong, *sent])
    assert states[-150:] == sent[-150:]
    _, states = _merged([*sent[:20], wrong, *sent[20:]])
    assert states == sent


def test_messages_of_a_source_with_another_clock_are_held_in_bounded_number():
    merger = JointMerger(('a', 'b'))
    for i in range(12_000):
        merger.take(_sample(10**15 + MS * i, a=1))
        merger.take(_sample(2 * MS * i, b=1))
    assert sum(len(source.parts) for source in merger.sources.values()) < 11_000

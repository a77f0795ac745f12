"""Laws of the grid that a recording is brought to."""

from __future__ import annotations

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.bandwidth import LOWEST_CUTOFF_HZ, choose_bandwidth
from sgp_ros.diagnosis.compare.effort_noise import effort_noise, measured_noise, noise_beside_laws
from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.compare.thinning import every_row_needed, thinned
from sgp_ros.diagnosis.compare.trajectory import (
    HIGHEST_CUTOFF_HZ,
    SHORTEST_ROWS,
    Bandwidth,
    collect,
    observe,
)
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.errors import RecordingError
from test.diagnosis.worlds import (
    CHAINS,
    PERIOD,
    START_NS,
    World,
    events_of,
    robot_of,
    shown,
    simulate,
)


def _states(events):
    return [i for i, e in enumerate(events) if isinstance(e, JointSample)]


def test_time_zero_is_the_first_stamp_though_its_state_is_refused(robots, perfect):
    """As the schema counts; the refused state shows up in the counts."""
    robot, _ = robots[1]
    events = events_of(perfect[1])
    whole = collect(events, robot)
    first = _states(events)[0]
    events[first] = replace(events[first], position=frozen_array([np.nan]))
    raw = collect(events, robot)
    assert raw.refused['nonfinite'] == 1
    assert whole.time[0] == 0.0
    assert raw.time[0] == pytest.approx(PERIOD)
    assert raw.start_ns == whole.start_ns == START_NS
    np.testing.assert_allclose(raw.drive.effort(0), whole.drive.effort(0)[1:], atol=1e-9)


def test_the_grid_is_uniform_and_passes_through_the_states(robots, perfect):
    """Positions as they were measured where the stamps are even."""
    raw = collect(events_of(perfect[2]), robots[2][0])
    np.testing.assert_allclose(np.diff(raw.time), raw.step, rtol=1e-9)
    np.testing.assert_allclose(raw.position, shown(perfect[2].position), atol=1e-9)
    assert raw.segments == (slice(0, len(raw.time)),)
    assert raw.velocity is None
    assert raw.effort is None


def test_a_pause_splits_the_recording_and_short_pieces_are_left_out(robots, perfect):
    """No row of the grid stands in a pause."""
    world = perfect[1]
    events = events_of(world)
    gone = ((world.time > 3.0) & (world.time < 4.0)) | (
        (world.time > 4.0 + 0.9 * SHORTEST_ROWS * PERIOD) & (world.time < 5.5)
    )
    kept = [e for e in events if not (
        isinstance(e, JointSample) and gone[round((e.stamp_ns - START_NS) * 1e-9 / PERIOD)]
    )]  # fmt: skip
    raw = collect(kept, robots[1][0])
    assert len(raw.segments) == 2
    ends = [(raw.time[s.start], raw.time[s.stop - 1]) for s in raw.segments]
    assert ends[0][1] == pytest.approx(3.0)
    assert ends[1][0] == pytest.approx(5.5 + PERIOD)  # the state after the pause is refused
    motion = observe(raw, robots[1][1], choose_bandwidth(raw, robots[1][1]))
    assert motion.starts == tuple(s.start for s in raw.segments)


def test_too_short_a_recording_is_refused(robots, perfect):
    """With what was found and what to do."""
    events = events_of(perfect[1])[: 2 * SHORTEST_ROWS - 4]
    with pytest.raises(RecordingError, match='longer recording') as caught:
        collect(events, robots[1][0])
    assert str(SHORTEST_ROWS - 2) in caught.value.found


def test_velocity_and_effort_are_kept_where_they_were_measured(robots, perfect):
    """A measured effort takes the place of commands."""
    world = perfect[1]
    events = events_of(world, velocity=world.velocity, effort=world.command, commands=False)
    raw = collect(events, robots[1][0])
    np.testing.assert_allclose(raw.velocity, world.velocity, atol=1e-9)
    np.testing.assert_allclose(raw.effort, world.command, atol=1e-9)
    assert raw.drive is None
    motion = observe(raw, robots[1][1], choose_bandwidth(raw, robots[1][1]))
    np.testing.assert_array_equal(motion.effort, raw.effort)


def test_a_passive_joint_has_no_effort(tmp_path, perfect):
    """No matter what was commanded to it."""
    robot, tree = robot_of(tmp_path, CHAINS[2], passive=(1,))
    world = replace(perfect[2], command=perfect[2].command[:, :1])
    raw = collect(events_of(world), robot)
    motion = observe(raw, tree, choose_bandwidth(raw, tree))
    assert not motion.effort[:, 1].any()
    assert motion.effort[:, 0].any()


@pytest.mark.parametrize('sigma', [1e-5, 1e-3])
def test_the_density_of_white_noise_is_its_variance_over_half_the_rate(robots, perfect, sigma):
    """One-sided; the motion is far below the third of the spectrum that is looked at."""
    world = perfect[1]
    noise = np.random.default_rng(0).normal(0.0, sigma, world.position.shape)
    noisy = replace(world, position=world.position + noise)
    raw = collect(events_of(noisy, quantum=0.0), robots[1][0])
    # a median of some 300 exponential variables
    np.testing.assert_allclose(raw.noise_density, 2.0 * sigma**2 * PERIOD, rtol=0.35)


def test_more_noise_lowers_the_cutoff_within_its_range(robots, perfect):
    """And the states are smoothed less than the rows."""
    robot, tree = robots[1]
    found = []
    for quantum in (1e-6, 1e-3, 1e-1):
        raw = collect(events_of(perfect[1], quantum=quantum), robot)
        bandwidth = choose_bandwidth(raw, tree)
        assert LOWEST_CUTOFF_HZ <= bandwidth.cutoff <= HIGHEST_CUTOFF_HZ
        assert bandwidth.cutoff < bandwidth.state_cutoff < 0.5 / raw.step
        found.append(bandwidth.cutoff)
    assert found == sorted(found, reverse=True)
    assert found[0] > found[-1]


def test_smoothed_states_are_those_of_the_truth(robots, perfect):
    """Position and velocity; accelerations jump with the commands and are not smooth."""
    for k, world in perfect.items():
        raw = collect(events_of(world), robots[k][0])
        motion = observe(raw, robots[k][1], choose_bandwidth(raw, robots[k][1]))
        inner = slice(60, -60)
        for seen, true, share in (
            (motion.position, world.position, 1e-4), (motion.velocity, world.velocity, 3e-3),
        ):  # fmt: skip
            error = np.sqrt(((seen - true)[inner] ** 2).mean(axis=0))
            assert np.all(error < share * true.std(axis=0))


def test_a_robot_without_inertia_or_motion_still_gets_a_filter(robots, perfect):
    """No division by what is zero."""
    robot, tree = robots[1]
    raw = collect(events_of(perfect[1]), robot)
    empty = replace(tree, parameters=np.zeros_like(tree.parameters))
    assert choose_bandwidth(raw, empty).cutoff == pytest.approx(HIGHEST_CUTOFF_HZ)
    zeros = World(*(np.zeros_like(x) for x in vars(perfect[1]).values()))
    still = collect(events_of(replace(zeros, time=perfect[1].time)), robot)
    assert choose_bandwidth(still, tree).cutoff > 0.0


def test_a_measured_effort_behind_a_drive_leaves_the_commands_in_their_place(robots, perfect):
    """Delay, dead zone and saturation are told from commands, which the effort follows."""
    world = perfect[1]
    late = np.roll(world.command, 6, axis=0)
    size = np.abs(late).max()
    seen = np.clip(late - np.clip(late, -0.1 * size, 0.1 * size), -0.5 * size, 0.5 * size)
    raw = collect(events_of(world, effort=seen), robots[1][0])
    assert raw.drive is not None
    assert raw.remarks == ()


@pytest.mark.parametrize('kind', ['position', 'noise', 'constant', 'scaled'])
def test_commands_of_another_kind_never_replace_a_measured_effort(robots, perfect, kind):
    """A topic of positions beside the states of a real machine."""
    world = perfect[1]
    rng = np.random.default_rng(0)
    given = {
        'position': np.roll(world.position, -2, axis=0),
        'noise': rng.normal(size=world.command.shape),
        'constant': np.zeros(world.command.shape),
        'scaled': 100.0 * world.command,
    }[kind]
    events = events_of(replace(world, command=given), effort=world.command)
    raw = collect(events, robots[1][0])
    assert raw.drive is None
    assert 'are not efforts' in raw.remarks[0]
    motion = observe(raw, robots[1][1], choose_bandwidth(raw, robots[1][1]))
    np.testing.assert_array_equal(motion.effort, raw.effort)


@pytest.mark.parametrize('source', ['state', 'command'])
def test_the_source_of_efforts_can_be_stated(robots, perfect, source):
    """No matter what the efforts look like."""
    events = events_of(perfect[1], effort=perfect[1].command)
    raw = collect(events, robots[1][0], config=EngineConfig(effort_source=source))
    assert (raw.drive is None) == (source == 'state')
    assert (raw.effort is None) == (source == 'command')
    assert raw.remarks == ()


@pytest.mark.parametrize('cutoff', [5.0, 25.0])
def test_the_noise_of_efforts_is_told_from_motion_and_ripple(cutoff):
    """It is neither missed nor taken for more than chance allows: white noise in the band."""
    step, n, sigma = 0.005, 4000, 0.02
    t = step * np.arange(n)
    seen = 3.0 * np.sin(2.0 * np.pi * 0.5 * t) + 0.1 * np.sin(2.0 * np.pi * 57.0 * t)
    noise = sigma * np.random.default_rng(0).standard_normal((n, 40))
    in_band = 2.0 * sigma**2 * step * cutoff
    found = effort_noise(seen[:, None] + noise, [slice(0, n)], step, cutoff) / in_band
    assert np.quantile(found, 0.1) > 1.0
    assert found.max() < 1.6
    (none,) = effort_noise(seen[:, None], [slice(0, n)], step, cutoff)
    assert none < 0.01 * in_band


@pytest.mark.parametrize('every', [1, 3])
@pytest.mark.parametrize(('jitter', 'late'), [(0.0, 0.0), (0.3, 0.0), (0.0, 0.5)])
def test_noise_of_efforts_between_samples_is_as_large_as_at_them(robots, jitter, late, every):
    """Stamps that jitter, or come late after a while, blur it where it is looked for."""
    rng, rate, sigma = np.random.default_rng(4), 200.0 * every, 0.02
    n = int(60.0 * rate)
    t = (np.arange(n) + rng.uniform(-jitter, jitter, n) + late * (np.arange(n) > n // 3)) / rate
    q = 0.8 * np.sin(2.0 * np.pi * 0.4 * t)
    effort = 1.5 * np.cos(2.0 * np.pi * 0.4 * t) + sigma * rng.standard_normal(n)
    names = robots[1][0].joint_names
    events = [JointSample(round(1e9 * x), names, np.array([a]), None, np.array([b]))
              for x, a, b in zip(t, q, effort, strict=True)]  # fmt: skip
    raw = collect(events, robots[1][0])
    fewer = every_row_needed(raw)
    assert (fewer > 1) is (every > 1)
    assert thinned(raw).blur == raw.blur / fewer**2
    assert collect(events, robots[1][0], least_step=2.0 / rate).blur == 0.0  # noise folds there
    raw = thinned(raw)
    (found,) = effort_noise(raw.effort, raw.segments, raw.step, 8.0, raw.blur)
    assert found / (2.0 * sigma**2 / rate * 8.0) == pytest.approx(1.1, abs=0.25)
    assert (raw.blur > 0.01) is (jitter + late > 0.0)


@pytest.mark.parametrize('level', [0.0, 0.5])
def test_friction_of_a_slow_motion_is_no_noise(level):
    """At a low rate its steps fill the spectrum; without them the bound is as before."""
    step, n, sigma, cutoff = 0.02, 4000, 0.02, 3.0
    t = step * np.arange(n)
    v = np.sin(2.0 * np.pi * 0.25 * t) + 0.4 * np.sin(2.0 * np.pi * 0.61 * t)
    noise = sigma * np.random.default_rng(0).standard_normal((n, 20))
    effort = level * np.sign(v)[:, None] + noise
    low = ParallelFilter(1.0 / step, cutoff, (slice(0, n),))
    d = low(effort)
    motion = SimpleNamespace(
        velocity=np.repeat(v[:, None], 20, axis=1), bandwidth=cutoff, step=step
    )
    spectral = effort_noise(effort, [slice(0, n)], step, cutoff)
    in_band = 2.0 * sigma**2 * step * cutoff
    bases = [np.zeros((len(d), 0))] * 20
    found = noise_beside_laws(spectral, d, bases, motion, low) / in_band
    assert (np.median(spectral) > 5.0 * in_band) == (level > 0.0)
    assert np.quantile(found, 0.1) > 0.9
    assert found.max() < 1.6


def test_equations_hold_no_more_noise_than_their_bodies_leave(equations_for):
    """Of efforts measured at a low rate, whose control fills the spectrum above the cut-off."""
    world = simulate(CHAINS[1], 3, 24.0)
    slow = World(*(getattr(world, f.name)[::4] for f in fields(World)))
    sigma = 0.01 * slow.command.std()
    noise = sigma * np.random.default_rng(0).standard_normal(slow.command.shape)
    raw, equations = equations_for(slow, effort=slow.command + noise, commands=False)
    cutoff = equations.motion.bandwidth
    spectral = measured_noise(raw, equations.motion, Bandwidth(cutoff, np.inf))
    in_band = 2.0 * sigma**2 * raw.step * cutoff
    assert spectral > 1.5 * in_band
    assert equations.effort_noise == pytest.approx(in_band, rel=0.2)

"""Evidence of recordings whose connection is corrected."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.compare.volume import Loop
from sgp_ros.diagnosis.setup import rows
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.diagnosis.setup.evidence import Probe
from sgp_ros.diagnosis.setup.rows import most_hz
from sgp_ros.diagnosis.setup.search import search
from sgp_ros.diagnosis.setup.unknowns import EVERYDAY, SETS, Products, explained
from sgp_ros.physics.catalogue import ARMATURE
from sgp_ros.physics.effect_at import EffectAt
from test.diagnosis.worlds import CHAINS, PERIOD, events_of, robot_of, simulate

KGF_CM = 100.0 / 9.80665


@pytest.fixture(scope='module')
def slow(tmp_path_factory):
    """A robot that moves so slowly that gravity and friction are nearly all of its efforts.

    It stops between motions, and dry friction holds it there.
    """
    world = simulate(CHAINS[1], 3, 16.0, dry=lambda t, q, s: 0.8, reach=0.5)
    robot, tree = robot_of(tmp_path_factory.mktemp('robot'), CHAINS[1])
    return world, robot, tree


def probe_of(world, robot, tree):
    raw = collect(events_of(world), robot)
    return Probe(raw, tree, choose_bandwidth(raw, tree))


@pytest.mark.long
def test_efforts_in_another_unit_are_found_beside_friction(slow):
    """And not a scale of the positions that makes all accelerations large."""
    world, robot, tree = slow
    (error,) = search(probe_of(replace(world, command=KGF_CM * world.command), robot, tree)).errors
    assert error.hypothesis.effect == 'effort_scale'
    assert error.numbers[0] > 5.0


def test_efforts_that_are_recorded_prize_no_inertia(slow):
    """A hundred times the positions, which leave more than all of the efforts."""
    world, *robot = slow
    probe = probe_of(replace(world, command=KGF_CM * world.command), *robot)
    none = Correction.none(1)
    far = replace(none, scale=np.full(1, 0.01))
    assert probe.agreement(far, 0).left[0] > 1.0
    assert probe.agreement(far).evidence < probe.agreement(none).evidence


def test_columns_so_large_that_nothing_can_be_computed_explain_nothing():
    """A search may try a scale of a position that makes them so."""
    count = 2 + EVERYDAY
    equal = Products(np.full((1, count, count), 1e40), np.ones((1, count)), np.ones(1))
    one = np.ones(1)
    assert explained(equal, SETS[1], one, 1e-5 * one, 100.0).evidence == -math.inf


def test_less_of_a_rotor_than_stated_may_be(slow):
    """Where it is most of the inertia of a joint; less than nothing cannot be."""
    world, robot, tree = slow
    rotor = {'inertia': 10.0 * float(probe_of(*slow).motion.mass_diagonal.max())}
    stated = (EffectAt.stated(ARMATURE, tree.moving_names[0], rotor, tree),)
    raw = collect(events_of(world), robot, stated)
    probe = Probe(raw, tree, choose_bandwidth(raw, tree), knows_bodies=True)
    poses = probe.motion.position[probe._pose]
    half, none = (probe._log_inertia(tree, np.full(1, -x), poses) for x in (0.5, 1.1))
    np.testing.assert_allclose(half, np.log(0.5), atol=0.05)
    assert none == -np.inf


@pytest.mark.parametrize('gain', [0.0, 1e5, 401.0])
def test_another_unit_of_positions_is_no_prize_where_a_drive_is_stiff(gain):
    """Its gains are stated in that unit; given efforts are one, as the inertia is."""
    loop = Loop(np.ones(1), gain * np.ones(1), np.zeros(1), np.linspace(0.1, 12.0, 100))
    probe = SimpleNamespace(
        _loop=loop, _pose=slice(0), _log_inertia=lambda *_: np.zeros(1),
        full=SimpleNamespace(has_all_efforts=False), driven=np.ones(1), power=np.ones(1),
        _noise_part=np.zeros(1),
    )  # fmt: skip
    motion = SimpleNamespace(tree=None, position=np.zeros((1, 1)))
    halved = replace(Correction.none(1), scale=np.full(1, 0.5))
    shift = Probe._shift(probe, motion, halved, np.ones(1), np.zeros(1))
    expected = np.log(np.abs(gain - 2.0 * loop.omega**2) / np.abs(gain - loop.omega**2)).mean()
    assert shift == pytest.approx(expected, abs=1e-6)
    assert abs(shift) < 0.01 or gain < 1e5
    probe._noise_part = np.ones(1)  # of measured efforts, which no unit of the motion changes
    noisy = Probe._shift(probe, motion, halved, np.ones(1), np.zeros(1))
    assert noisy == pytest.approx(shift if gain else 0.0)


def test_where_forces_cancel_their_accuracy_counts(slow, tmp_path, monkeypatch):
    """Inertial forces are larger than a fast robot's effort, and nothing in a slow one's."""
    monkeypatch.setattr(rows, '_BAND', math.inf)
    world = simulate(CHAINS[1], 5, 12.0)
    robot, tree = robot_of(tmp_path, CHAINS[1])
    swinging, none = probe_of(world, robot, tree), Correction.none(1)
    force = (swinging.motion.mass_diagonal * swinging.motion.acceleration)[:, 0]
    cancelled = force.var() / swinging.power[0] - 1.0
    assert cancelled > 0.0
    assert swinging.agreement(none).share[0] >= 0.01 * cancelled
    assert probe_of(*slow).agreement(none, 2).share[0] < 0.005


def test_beside_friction_rows_of_a_held_joint_say_nothing_of_it(slow):
    """The friction that takes up the command there is no rest of any model."""
    probe = probe_of(*slow)
    moving = probe._moving
    assert 0.02 < np.mean(~moving[:, 0]) < 0.9
    found = probe.agreement(Correction.none(1), 2)
    probe._moving = np.ones_like(moving)
    probe._columns.clear()
    assert found.left[0] < 0.2 * probe.agreement(Correction.none(1), 2).left[0]


@pytest.mark.long
@pytest.mark.parametrize(('periods', 'expected'), [(0.7, []), (2.0, ['clock_offset'])])
def test_efforts_read_within_a_period_of_the_positions_have_no_other_clock(
    tmp_path, periods, expected
):
    """States and efforts of one stamp are read one after the other."""
    world = simulate(CHAINS[2], 5, 12.0)
    robot, tree = robot_of(tmp_path, CHAINS[2])
    late = world.time - 4.0 * periods * PERIOD
    read = np.column_stack([np.interp(late, world.time, x) for x in world.command.T])
    raw = collect(events_of(world, effort=read, commands=False)[::4], robot)
    errors = search(Probe(raw, tree, choose_bandwidth(raw, tree))).errors
    assert [e.hypothesis.effect for e in errors] == expected


def test_noise_does_not_alias_where_rows_are_left_out(tmp_path):
    """That of a controller's feedback said as much of another clock as of the right one."""
    world = simulate(CHAINS[2], 5, 12.0)
    noise = 0.1 * world.command.std(axis=0)
    noisy = world.command + np.random.default_rng(4).normal(0.0, noise, world.command.shape)
    robot, tree = robot_of(tmp_path, CHAINS[2])
    raw = collect(events_of(replace(world, command=noisy)), robot)
    probe = Probe(raw, tree, replace(choose_bandwidth(raw, tree), cutoff=3.0))
    assert probe.every == 8
    inside = noise**2 * 2.0 * 3.0 * PERIOD
    left = probe.agreement(Correction.none(2), 0).left
    assert (left < 1.6 * inside / probe.power).all()


@pytest.mark.parametrize('k', [1, pytest.param(2, marks=pytest.mark.long)])
def test_a_load_is_no_error_of_the_connection(tmp_path, k):
    """As heavy as the last link: a scale of the efforts would leave less to bodies."""
    *others, last = CHAINS[k]
    far = last.centre + 0.15
    centre = 0.5 * (last.centre + far)
    inertia = last.inertia + last.mass * ((last.centre - centre) ** 2 + (far - centre) ** 2)
    loaded = replace(last, mass=2.0 * last.mass, centre=centre, inertia=inertia)
    world = simulate((*others, loaded), 1, 12.0, reach=1.5)
    assert not search(probe_of(world, *robot_of(tmp_path, CHAINS[k]))).errors


@pytest.mark.parametrize(('hz', 'noise', 'most'), [(0.5, 1e-3, 2.0), (0.5, 10.0, 200.0)])
def test_the_band_is_that_of_the_motion(hz, noise, most):
    """Of slow motion fewer rows a second say as much; noise is no motion, and lowers nothing."""
    time = 0.004 * np.arange(50_000)
    rng = np.random.default_rng(0)
    velocity = np.cos(2.0 * np.pi * hz * time) + noise * rng.normal(size=len(time))
    motion = SimpleNamespace(
        is_static=False, moves=np.array([True, False]), time=time, step=0.004,
        velocity=np.column_stack([velocity, np.zeros(len(time))]),
    )  # fmt: skip
    found = most_hz(motion)
    assert found == pytest.approx(most, rel=0.05) if noise < 1.0 else found > most


@pytest.mark.parametrize('noise', [0.0, 1e-3])
def test_the_mean_of_a_steady_turn_is_no_band(noise):
    """A slow change is looked at as a whole: no filter is slower than all rows need."""
    time = 0.004 * np.arange(50_000)
    velocity = (
        3.0 + 0.01 * np.cos(0.1 * time) + noise * np.random.default_rng(0).normal(size=50_000)
    )
    motion = SimpleNamespace(
        is_static=False, moves=np.array([True]), time=time, step=0.004, velocity=velocity[:, None]
    )
    found = most_hz(motion)
    assert found == pytest.approx(0.625) if noise == 0.0 else found > 0.625

"""Settled points: one row a pose, no clock, statics alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.batch.acceptance import USUAL
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.settled import approaches, collect_settled, every_fourth, shows
from sgp_ros.diagnosis.compare.trajectory import observe
from sgp_ros.diagnosis.gathered import Knowledge, gather
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.errors import RecordingError
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree
from test.diagnosis.worlds import CHAINS, GRAVITY, urdf

LEVEL, STIFF, REST = 0.3, 1.5, 0.4


def _points(n=400):
    """A hanging link, there and back, held by a motor against friction, a spring and gravity."""
    link = CHAINS[1][0]
    rng = np.random.default_rng(5)
    q = np.concatenate([np.linspace(-1.2, 1.2, n), np.linspace(1.2, -1.2, n)])
    s = np.repeat([1.0, -1.0], n)
    effort = link.mass * GRAVITY * link.centre * np.sin(q) + STIFF * (q - REST) + LEVEL * s
    effort += 0.01 * rng.normal(size=len(q))
    return [
        JointSample(
            7, ('joint0',), frozen_array([x]), None, frozen_array([u])
        )  # one stamp for all
        for x, u in zip(q, effort, strict=True)
    ]


def _with_friction_alone(point):
    link, q = CHAINS[1][0], point.position[0]
    others = link.mass * GRAVITY * link.centre * np.sin(q) + STIFF * (q - REST)
    return replace(point, effort=frozen_array(point.effort - others))


def test_directions_of_approach_ignore_the_flicker_of_an_encoder():
    """Back by one count is no reversal; the turn at the end is."""
    q = 0.1 * np.array([0, 1, 2, 1, 2, 3, 4, 4, 5, 4, 2, 1, 0, 1, 0, -1])
    np.testing.assert_array_equal(approaches(q), [1] * 10 + [-1] * 6)


def test_directions_of_approach_ignore_the_noise_about_a_slow_sweep():
    """The encoder resolves the noise, which is many steps of the sweep; poses have no noise."""
    rng = np.random.default_rng(3)
    way = np.concatenate([np.linspace(0.0, 6.0, 5000), np.linspace(6.0, 0.0, 5000)])
    found = approaches(way + 1e-3 * rng.normal(size=len(way)))
    assert (found == np.repeat([1.0, -1.0], 5000)).mean() > 0.995
    here_and_there = rng.uniform(-2.0, 2.0, 300)
    moves = np.sign(np.diff(here_and_there))
    assert (approaches(here_and_there)[1:] == moves).mean() > 0.98


def test_statics_of_a_link_names_friction_and_a_spring_without_a_clock(robots):
    """Gravity is known; what holds the rest is found in the same equations as of a motion."""
    found = diagnose(_points(), *robots[1], {}, holds_out=True, is_static=True)
    named = {f.effect: {k: p.value for k, p in f.parameters.items()} for f in found.findings}
    assert set(named) == {'coulomb_friction', 'spring'}
    assert named['coulomb_friction']['level'] == pytest.approx(LEVEL, rel=0.02)
    assert named['spring']['stiffness'] == pytest.approx(STIFF, rel=0.02)
    assert named['spring']['rest'] == pytest.approx(REST, abs=0.01)
    assert found.proofs['held_out'].nmse_after['joint0'] < 1e-3
    assert found.proofs['held_out'].acceleration_after == {}
    assert {effect for _, effect, _ in found.visibility} == {'coulomb_friction'}


@pytest.fixture
def upright(tmp_path):
    """The link on an axis without gravity."""
    path = tmp_path / 'upright.urdf'
    path.write_text(urdf(CHAINS[1]).replace('axis xyz="0 1 0"', 'axis xyz="0 0 1"'))
    return load_robot(str(path))


@pytest.mark.long
def test_all_waves_of_a_cogging_are_named(upright):
    """Beside a wave that stands, a smaller one of the same law is nothing unusual."""
    sizes, rng = {12.0: 1.0, 24.0: 0.6, 36.0: 0.16}, np.random.default_rng(2)
    points = [
        replace(p, effort=frozen_array(
            p.effort + 0.2 * rng.normal(size=1)
            + sum(a * np.sin(n * p.position + n) for n, a in sizes.items())
        ))
        for p in map(_with_friction_alone, _points(1500))
    ]  # fmt: skip
    found = diagnose(points, upright, nominal_tree(upright), {}, holds_out=True, is_static=True)
    waves = {round(f.parameters['periods'].value): f.parameters['amplitude'].value
             for f in found.findings if f.effect == 'cogging'}  # fmt: skip
    assert waves == pytest.approx(sizes, rel=0.1)


def test_efforts_of_an_axis_without_gravity_are_compared_by_their_size(upright):
    """Two levels that are nearly equal are no other law, though the nominal robot needs none."""
    robot = upright
    points = [_with_friction_alone(point) for point in _points()]
    found = diagnose(points, robot, nominal_tree(robot), {}, holds_out=True, is_static=True)
    assert [f.effect for f in found.findings] == ['coulomb_friction']
    assert found.equivalents == ()


def test_only_what_shows_at_rest_is_a_candidate(robots):
    """Nothing that depends on speed, acceleration, time or the way between the poses."""
    robot, tree = robots[1]
    raw = collect_settled(_points(100), robot)
    motion = observe(raw, tree, choose_bandwidth(raw, tree))
    shown = {
        name for name, effect in EFFECTS.items() for place in effect.places(motion)
        if shows(effect, place, motion)
    }  # fmt: skip
    assert {'coulomb_friction', 'asymmetric_coulomb', 'spring', 'cogging', 'constant_load',
            'gravity_tilt', 'payload'} <= shown  # fmt: skip
    assert not {'viscous_friction', 'quadratic_drag', 'armature', 'friction_drift', 'hysteresis',
                'stribeck_friction',
                'backlash', 'command_delay'} & shown  # fmt: skip


def test_each_fourth_pose_is_held_out_with_its_direction(robots):
    raw = collect_settled(_points(100), robots[1][0])
    learned, held = every_fourth(raw)
    assert (len(learned.time), len(held.time)) == (150, 50)
    np.testing.assert_array_equal(held.approach, raw.approach[3::4])


def test_too_few_points_are_refused_in_one_line(robots):
    with pytest.raises(RecordingError, match='40 poses with a measured effort'):
        collect_settled(_points(20), robots[1][0])


def test_few_points_may_prove_what_many_say(robots):
    robot, tree = robots[1]
    known = Knowledge(robot, (), USUAL, is_static=True)
    points = {'few': _points(20)}
    found = gather({'many': _points(100)}, points, tree, known, holds_out=False)
    assert len(found.held['few'].time) == 40
    with pytest.raises(RecordingError, match='40 poses'):
        gather(points, {}, tree, known, holds_out=False)


def test_velocities_of_one_size_tell_from_which_side_poses_were_approached(robots):
    """Poses in any order, each approached from the side that its row tells; a speed tells none."""
    points, side = _points(100), np.where(np.arange(200) % 3, 1.0, -1.0)
    told = [replace(p, velocity=frozen_array([x])) for p, x in zip(points, side, strict=True)]
    assert collect_settled(told, robots[1][0]).approach[:, 0] == pytest.approx(side)
    noise = np.random.default_rng(1).normal(size=200)
    seen = [replace(p, velocity=frozen_array([x])) for p, x in zip(points, noise, strict=True)]
    followed = collect_settled(points, robots[1][0]).approach
    np.testing.assert_array_equal(collect_settled(seen, robots[1][0]).approach, followed)

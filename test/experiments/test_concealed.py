"""Laws of the worlds with concealed physics."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.concealed import draw, robots, sizes
from benchmarks.concealed.kinds import SCORED
from sgp_ros.simulation.registry import EFFECTS
from sgp_ros.simulation.tree_text import read_tree

KEYS = {
    'case', 'key', 'tier', 'robot', 'joints', 'verdict', 'effects', 'accepted', 'location',
    'parameter_errors', 'joint_range', 'sensor', 'rate_hz', 'durations', 'effect_share_of_torque',
    'nmse', 'fit_scored',
}  # fmt: skip


def test_plan_has_every_effect():
    """The 26 effects of the contract and `gravity_tilt` among them, in turn."""
    assert set(EFFECTS) <= set(draw.PLAN)
    assert set(SCORED) | {'joint_coupling'} == set(EFFECTS)


@pytest.mark.parametrize('family', robots.FAMILIES)
def test_drawn_robots_are_trees_with_bodies_that_can_exist(family):
    """The principal moments of each body obey the triangle inequality."""
    for seed in range(5):
        bodies = robots.FAMILIES[family][0](np.random.default_rng(seed))
        for body in bodies:
            moments = np.linalg.eigvalsh(body.inertia)
            assert moments[0] > 0.0
            assert moments[0] + moments[1] >= moments[2]


def test_drawn_case_has_the_layout_and_the_size_that_was_promised(tmp_path, monkeypatch):
    """Recordings, URDF, answers and true accelerations of one world."""
    monkeypatch.setattr(draw, '_SECONDS', dict.fromkeys(('real', 'real_test', 'real_far'), 4.0))
    monkeypatch.setattr(sizes, '_PILOT_S', 4.0)
    for folder in ('cases', 'answers'):
        (tmp_path / folder).mkdir()
    draw.draw_case(0, 'A', 'viscous_friction', tmp_path)
    answer = json.loads((tmp_path / 'answers' / 'case_000.json').read_text(encoding='utf-8'))
    assert set(answer) >= KEYS
    found = {path.name for path in (tmp_path / 'cases' / 'case_000').iterdir()}
    assert found == {'robot.urdf', 'sim.mcap', 'real.mcap', 'real_test.mcap', 'real_far.mcap'}
    joint = answer['effects'][0]['joint']
    assert answer['effect_share_of_torque'][joint] > sizes.SMALLEST_SHARE
    assert answer['verdict'] == 'missing_physics'
    urdf = (tmp_path / 'cases' / 'case_000' / 'robot.urdf').read_text(encoding='utf-8')
    assert [j.name for j in read_tree(urdf).joints] == answer['joints']
    truth = np.load(tmp_path / 'answers' / 'case_000_truth.npz', allow_pickle=False)
    assert truth['real_far_a'].shape == (len(truth['real_far_t']), len(answer['joints']))

"""Laws of what a replay leaves behind."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sgp_ros.apps.replay import write_identified_robot
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import JointSample
from sgp_ros.report.files import replacing_results
from sgp_ros.rigid import consistent
from sgp_ros.robots.registry import load_robot

PANDA = Path(__file__).parents[2] / 'config' / 'robots' / 'panda.yaml'


def test_bodies_that_are_not_found_do_not_cost_the_replay(monkeypatch, tmp_path):
    """The estimate stays, and a remark says what it is."""
    robot = load_robot(str(PANDA))
    settings = {'learning.initial': 20, 'filter.hop': 0.05, 'refit.enabled': False}
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    rng = np.random.default_rng(0)
    for i in range(400):
        q, v, tau = np.sin(0.3 * i * np.arange(1, 8)), rng.normal(size=7), rng.normal(size=7)
        engine.push(JointSample(10**18 + 10**7 * i, robot.joint_names, q, v, tau))
    make = consistent.clarabel.DefaultSettings

    def impatient():
        found = make()
        found.max_iter = 1
        return found

    with replacing_results(tmp_path, 'replay'):
        assert write_identified_robot(tmp_path, engine) == ''
    assert (tmp_path / 'robot_identified.urdf').exists()
    monkeypatch.setattr(consistent.clarabel, 'DefaultSettings', impatient)
    with replacing_results(tmp_path, 'replay'):
        remark = write_identified_robot(tmp_path, engine)
    assert 'may be physically impossible' in remark
    assert '\n' not in remark
    assert not (tmp_path / 'robot_identified.urdf').exists()
    again = load_robot(str(tmp_path / 'robot_identified.yaml'))
    np.testing.assert_array_equal(
        [c.prior_mean for c in again.coefficients], engine.information()[0]
    )

"""Bodies stated beside a URDF that lacks them."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.robots.given_bodies import with_bodies
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree

URDF = """<robot name="r"><link name="base"/><link name="arm"/>
<joint name="j" type="continuous">
<parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>
</robot>"""


@pytest.fixture
def robot(tmp_path):
    path = tmp_path / 'r.urdf'
    path.write_text(URDF, encoding='utf-8')
    return load_robot(str(path))


def test_a_stated_body_stands_in_the_tree_about_the_joint(robot, tmp_path):
    """Steiner: 2 kg at 0.1 m and 0.03 kg m^2 about the centre."""
    path = tmp_path / 'bodies.yaml'
    path.write_text('arm: {mass: 2.0, com: [0, 0, -0.1], inertia: [0.03, 0, 0.03, 0, 0, 0.04]}')
    tree = nominal_tree(with_bodies(robot, path))
    expected = [2.0, 0.0, 0.0, -0.2, 0.05, 0.0, 0.05, 0.0, 0.0, 0.04]
    np.testing.assert_allclose(tree.parameters[0], expected, atol=1e-12)


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        (
            'leg: {mass: 1.0, inertia: [1, 0, 1, 0, 0, 1]}',
            "link 'leg' is not one of the moving links",
        ),
        ('arm: {mas: 1.0}', "unknown key 'arm.mas'"),
        ('arm: {mass: 1.0, inertia: [1, 0, 1, 0, 0, 5]}', 'no body can have the inertia'),
        ('arm: {mass: 1.0}', 'no body can have the inertia'),
        ('[]', 'name no link'),
    ],
)
def test_what_is_wrong_with_a_file_of_bodies_is_said(robot, tmp_path, text, said):
    path = tmp_path / 'bodies.yaml'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(ConfigError, match=said.replace('[', r'\[')):
        with_bodies(robot, path)

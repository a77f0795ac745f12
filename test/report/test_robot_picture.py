"""Laws of the picture of a robot."""

from __future__ import annotations

import numpy as np
import pinocchio
import pytest

from sgp_ros.report.robot_picture import link_places
from sgp_ros.rigid.tree import read_urdf
from test.rigid.random_urdf import random_urdf


@pytest.mark.parametrize('seed', range(4))
def test_links_stand_where_pinocchio_puts_them(seed):
    """In postures far from zero: a joint that turned the other way would stand elsewhere."""
    text, names = random_urdf(seed, 5), [f'j{i}' for i in range(5)]
    tree = read_urdf(text, joints=names)
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    posture = np.random.default_rng(seed).uniform(-1.5, 1.5, size=len(names))
    q = pinocchio.neutral(model)
    for name, x in zip(names, posture, strict=True):
        joint = model.joints[model.getJointId(name)]
        turn = (np.cos(x), np.sin(x))  # how Pinocchio holds a joint without end
        q[joint.idx_q : joint.idx_q + joint.nq] = x if joint.nq == 1 else turn
    pinocchio.forwardKinematics(model, data, q)
    _, origins = link_places(tree, posture)
    for i, name in enumerate(tree.joint_names):
        assert origins[i] == pytest.approx(data.oMi[model.getJointId(name)].translation, abs=1e-12)

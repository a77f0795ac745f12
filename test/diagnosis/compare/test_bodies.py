"""Changes of efforts and inertia with the bodies."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.bodies import BodyChange


@pytest.mark.parametrize(
    ('w', 'largest'), [((9.0, 1.0, 0.0), 0.5), ((9.0, 0.0, -2.0), 0.6), ((9.0, 2.0, 1.0), 1.0)]
)
def test_the_larger_change_of_efforts_or_inertia_counts(w, largest):
    """Instants of efforts, which come first, are no bodies."""
    change = BodyChange((np.array([[0.3, 0.0], [0.4, 0.0]]),), np.array([[0.0, 0.3]]))
    assert change.largest(np.array(w)) == pytest.approx(largest)


def test_bodies_change_the_inertia_of_a_robot_whose_efforts_are_friction(equations_for, heavy):
    """Where efforts hide them, it is the inertia that tells bodies apart."""
    _, equations = equations_for(heavy[2])
    motion, directions = equations.motion, equations.directions
    change = BodyChange.of(
        equations.factors, 1e9 * equations.power, len(equations.d), motion.tree, directions,
        equations.poses[0].position,
    )  # fmt: skip
    w = 0.1 * np.eye(equations.size)[equations.instants]  # mass of the first body
    assert 1e-3 < change.largest(w) < 0.1
    none = BodyChange.of(
        equations.factors, 0.0 * equations.power, len(equations.d), motion.tree, directions,
        equations.poses[0].position,
    )  # fmt: skip
    assert none.largest(w) == pytest.approx(change.largest(w))

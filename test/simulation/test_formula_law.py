"""Laws from formulas in the simulation, against built-in laws and differential equations."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.robots.observed_motion import ObservedMotion
from sgp_ros.robots.stated_effects import read_effects
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.tree_simulator import tree_simulator
from test.simulation.trees import arm

URDF = arm()
TREE = read_urdf(URDF)
SIMULATOR = tree_simulator(URDF)
SHOULDER, ELBOW = TREE.moving_names[:2]
SAME = {
    '-level*sign(dq[{j}])': ({'level': 'N m'}, 'coulomb_friction:joint={j},level=0.4'),
    '-level*sign(dq[{j}]) - b*dq[{j}]': (
        {'level': 'N m', 'b': 'N m s/rad'},
        'coulomb_friction:joint={j},level=0.4 viscous_friction:joint={j},b=0.4',
    ),
    '-level*(q[{j}] - r)': (
        {'level': 'N m/rad', 'r': 'rad'}, 'spring:joint={j},stiffness=0.4,rest=0.4',
    ),
    '-(level + b*abs(tau[{j}]))*sign(dq[{j}])': (
        {'level': 'N m', 'b': '1'}, 'load_friction:joint={j},level=0.4,mu=0.4',
    ),
}  # fmt: skip


def _law(formula, units, value=0.4, joint=ELBOW):
    problems = []
    (law,) = read_effects(
        [{'law': {'joint': joint, 'formula': formula.format(j=joint),
                  'parameters': {n: {'value': value, 'unit': u} for n, u in units.items()}}}],
        TREE, problems,
    )  # fmt: skip
    assert problems == []
    return law


def _recorded(effects, seconds=2.0):
    return simulate(make_simulation(SIMULATOR, effects=effects, seed=1), seconds)


@pytest.mark.parametrize('formula', SAME)
def test_a_formula_moves_the_robot_as_the_built_in_law_does(formula):
    """Friction that holds a joint exactly at rest among them."""
    units, texts = SAME[formula]
    ours = _recorded([_law(formula, units)])
    theirs = _recorded(texts.format(j=ELBOW).split())
    np.testing.assert_allclose(ours.true_position, theirs.true_position, atol=1e-9)
    still = ours.true_velocity[:, TREE.moving_names.index(ELBOW)] == 0.0
    assert still[1:].any() == ('sign' in formula)


def test_what_remembers_has_a_state():
    """A force behind a lag drives the joint as its differential equation says."""
    law = _law('-k*lag(q[{j}], T)', {'k': 'N m/rad', 'T': 's'})
    found, free = _recorded([law]), _recorded([])
    j = TREE.moving_names.index(ELBOW)
    time = 1e-9 * (found.stamps_ns - found.stamps_ns[0])
    motion = ObservedMotion(
        TREE, time, time[1], found.true_position, found.true_velocity, found.true_acceleration,
        np.zeros_like(found.true_position), None,
    )  # fmt: skip
    needed = motion.nominal_effort[:, j] - found.command[:, j]
    np.testing.assert_allclose(needed, law.force(motion)[:, j], atol=2e-3)
    assert np.abs(found.true_position - free.true_position).max() > 0.01


@pytest.mark.parametrize('formula', ['-k*delay(q[{j}], T)', '-k*T*ddq[{j}]'])
def test_what_cannot_be_simulated_is_refused(formula):
    """In one line with what there is instead."""
    law = _law(
        formula, {'k': 'N m/rad', 'T': 's'} if 'delay' in formula else {'k': 'kg', 'T': 'm2'}
    )
    with pytest.raises(ConfigError, match='cannot be simulated'):
        _recorded([law])

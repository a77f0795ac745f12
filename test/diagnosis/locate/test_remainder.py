"""What no effect describes: what it depends on, and the process that follows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.locate.dependence import dependences
from sgp_ros.diagnosis.locate.remainder import learn_remainder, process_inputs


def _planted(equations, of):
    """Put a function of the motion into the residual of joint 1."""
    motion, low = equations.motion, equations.filter
    residual = 1e-4 * np.random.default_rng(0).normal(size=equations.d.shape)
    residual[:, 1] += low(of(motion))
    return residual


FUNCTIONS = {
    'position': lambda m: np.sin(3.0 * m.position[:, 1]),
    'velocity': lambda m: np.tanh(m.velocity[:, 1]),
    'position of joint0': lambda m: np.cos(4.0 * m.position[:, 0]),
}


@pytest.mark.parametrize('name', FUNCTIONS)
def test_the_discrepancy_depends_on_what_it_was_made_of(equations_for, perfect, name):
    """More than on anything else, and the other joint on nothing."""
    _, equations = equations_for(perfect[2])
    quiet, loud = dependences(equations, _planted(equations, FUNCTIONS[name]))
    assert (quiet.joint, loud.joint) == ('joint0', 'joint1')
    assert max(loud.scores, key=loud.scores.get) == name
    assert loud.scores[name] > 0.8
    assert max(quiet.scores.values()) < 0.2
    assert loud.share > quiet.share
    assert all(0.0 <= x <= 1.0 for x in loud.scores.values())


def test_something_that_fades_depends_on_time(equations_for, perfect):
    """Judged by neighbouring stretches, so that time can explain at all."""
    _, equations = equations_for(perfect[2])
    residual = _planted(equations, lambda m: np.exp(-m.time / 3.0))
    scores = dependences(equations, residual)[1].scores
    assert max(scores, key=scores.get) == 'time'


def test_nothing_depends_on_nothing(equations_for, perfect):
    """A residual of zeros has scores of zero, not 0/0."""
    _, equations = equations_for(perfect[2])
    for dependence in dependences(equations, np.zeros_like(equations.d)):
        assert set(dependence.scores.values()) == {0.0}


def test_a_passive_joint_depends_on_no_effort_of_its_own(equations_for, perfect):
    """It has none; an actuated joint has."""
    _, equations = equations_for(perfect[2])
    tree = replace(equations.motion.tree, is_actuated=np.array([True, False]))
    passive = replace(equations, motion=replace(equations.motion, tree=tree))
    first, second = dependences(passive, equations.d)
    assert 'effort' in first.scores
    assert 'effort' not in second.scores
    assert 'effort of joint1' not in process_inputs(passive.motion, 1)[1]


def test_the_process_learns_a_function_and_says_of_what(equations_for, perfect):
    """Its mean is the planted force, also on the whole motion at the full rate."""
    _, equations = equations_for(perfect[2])
    of = FUNCTIONS['position']
    found = learn_remainder(equations, _planted(equations, of), 1)
    assert 'position of joint1' in found.inputs
    assert found.joint == 1
    force = found.force(equations.motion)
    true = of(equations.motion)
    inner = slice(50, -50)
    assert np.mean((force - true)[inner] ** 2) < 0.02 * true.var()


def test_white_noise_leaves_no_process(equations_for, perfect):
    """Evidence asks for no input; then there is none, or it is next to nothing."""
    _, equations = equations_for(perfect[2])
    noise = np.random.default_rng(1).normal(size=equations.d.shape)
    found = learn_remainder(equations, noise, 0)
    assert found is None or found.force(equations.motion).std() < 0.3


def test_what_happens_once_is_no_process_of_the_motion(equations_for, perfect):
    """A burst teaches Z nothing that helps where it was not seen."""
    _, equations = equations_for(perfect[2])

    def burst(motion):
        t = motion.time - 0.42 * motion.time[-1]
        return np.sin(25.0 * t) * np.exp(-((2.0 * t) ** 2))

    assert learn_remainder(equations, _planted(equations, burst), 1) is None

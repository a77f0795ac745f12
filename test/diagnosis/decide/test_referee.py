"""How much of what a model leaves is no noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.decide.referee import LEAST_ROWS, structure
from test.diagnosis.worlds import CHAINS, simulate


@pytest.fixture(scope='module')
def equations(equations_for):
    return equations_for(simulate(CHAINS[2], 7, 30.0))[1]


def _white(equations, seed=0):
    return np.random.default_rng(seed).normal(size=equations.d.shape) * np.sqrt(equations.power)


@pytest.mark.parametrize('seed', range(5))
def test_white_noise_has_little_structure(equations, seed):
    """No more than a twentieth above its own uncertainty."""
    found = structure(equations, _white(equations, seed))
    assert found.shape == (2,)
    assert np.all(found < 0.05 + 1.0 / np.sqrt(len(equations.d)))


def test_a_function_of_the_motion_is_structure(equations):
    """Nearly all of it, though its neighbours in time say nothing."""
    q = equations.motion.position[equations.filter.rows]
    rest = np.sin(6.0 * q) * np.sqrt(equations.power)
    assert np.all(structure(equations, rest) > 0.9)


def test_noise_on_top_of_a_function_counts_as_noise(equations):
    """Of equal power each: half."""
    q = equations.motion.position[equations.filter.rows]
    rest = _white(equations) + np.sqrt(2.0 * equations.power) * np.sin(3.0 * q)
    found = structure(equations, rest)
    assert np.all((found > 0.2) & (found < 0.7))


def test_what_its_own_past_foretells_is_structure(equations):
    """Though it has nothing to do with the motion."""
    rows = np.arange(len(equations.d))[:, None]
    for period in (31.0, 4.1):  # a quarter of a period on, a sine has no correlation
        rest = np.sin(2.0 * np.pi * rows / period) * np.sqrt(equations.power)
        assert np.all(structure(equations, rest) > 0.9)


def test_filtered_white_noise_foretells_nothing_of_itself(equations):
    """Though rows behind a low-pass are correlated."""
    white = np.random.default_rng(5).normal(size=equations.motion.effort.shape)
    rest = equations.filter(white * np.sqrt(equations.power))
    assert float(rest[1:, 0] @ rest[:-1, 0]) > 0.3 * float(rest[:, 0] @ rest[:, 0])
    assert np.all(structure(equations, rest) < 0.15)


def test_an_effort_does_not_explain_itself(equations):
    """A rest that is the measured effort, of which the motion shows nothing, is noise."""
    motion = replace(equations.motion, effort=_noise_at_full_rate(equations))
    loaded = replace(equations, motion=motion)
    assert np.all(structure(loaded, loaded.filter(motion.effort)) < 0.1)


def _noise_at_full_rate(equations):
    white = np.random.default_rng(4).normal(size=equations.motion.effort.shape)
    return white * np.sqrt(equations.power)


def test_few_rows_let_the_referee_say_nothing(equations):
    rows = LEAST_ROWS - 1
    assert np.all(structure(equations, _white(equations)[:rows]) == 1.0)


def test_a_joint_that_leaves_next_to_nothing_is_not_looked_at(equations):
    rest = _white(equations) * np.array([1.0, 1e-3])
    found = structure(equations, rest)
    assert found[0] < 0.2
    assert found[1] == 1.0
    assert np.all(structure(equations, np.zeros_like(rest)) == 1.0)

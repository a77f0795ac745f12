"""How sure it is that a discrepancy depends on something."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.locate.dependence import (
    DISTURBANCES,
    dependences,
    own_variables,
    surrogates,
)
from sgp_ros.diagnosis.shown import Dependence
from test.diagnosis.locate.nulls import disturbance
from test.diagnosis.worlds import CHAINS, simulate

NULLS = 120


@pytest.fixture(scope='module')
def equations(equations_for):
    return equations_for(simulate(CHAINS[2], 7, 12.0))[1]


@pytest.mark.long
def test_the_least_p_value_is_uniform_where_the_motion_has_no_part(equations):
    """Of all joints and variables together, beside white noise and red; within three errors."""
    least = []
    for seed in range(NULLS):
        found = dependences(equations, disturbance(equations, seed))
        least.append(min(min(d.p_values.values()) for d in found))
    for level in (0.05, 0.25, 0.5):
        error = np.sqrt(level * (1.0 - level) / NULLS)
        assert abs(np.mean(np.array(least) <= level) - level) < 3.0 * error


@pytest.mark.parametrize('seed', [0, 1])
def test_what_is_there_is_as_sure_as_the_disturbances_can_tell(equations, seed):
    """A spring as large as the noise, whether that is white or red."""
    noise = disturbance(equations, seed)
    residual = noise / noise.std(axis=0)
    residual[:, 1] += 1.5 * np.sin(3.0 * own_variables(equations, 1)['position'])
    quiet, loud = dependences(equations, residual)
    assert loud.p_values['position'] == 1.0 / (1.0 + DISTURBANCES)
    assert loud.is_significant('position')
    assert loud.p_values.keys() == loud.scores.keys()
    assert not any(quiet.is_significant(name) for name in quiet.scores)


def test_a_law_is_told_from_chance_on_a_motion_that_repeats(equations):
    """Most of a disturbance in step with it is explained as well; friction leaves far less."""
    motion, low = equations.motion, equations.filter
    phase = np.pi * motion.time[:, None] + np.array([0.0, 0.7])
    position = np.sin(phase) + 0.1 * np.sin(3.0 * phase)
    velocity = np.gradient(position, motion.step, axis=0)
    periodic = replace(motion, position=position, velocity=velocity)
    world = replace(equations, motion=periodic)
    friction = low(-np.tanh(periodic.velocity / 0.1))
    residual = friction * [0.0, 1.0] + 0.03 * disturbance(world, 0)
    _, loud = dependences(world, residual)
    assert loud.is_significant('velocity')


def test_what_explains_nothing_is_not_significant(equations):
    """Neither where nothing is left, nor where chance would do worse than that."""
    for d in dependences(equations, np.zeros_like(equations.d)):
        assert set(d.p_values.values()) == {1.0}
    lucky = Dependence('joint0', 0.1, {'time': 0.0, 'position': 0.1}, {'time': 0.005})
    assert not lucky.is_significant('time')
    assert not lucky.is_significant('position')


@pytest.mark.parametrize('rows', [200, 201])
def test_a_disturbance_keeps_all_correlations_and_nothing_else(equations, rows):
    """In time and between joints, of even and odd numbers of rows; always the same draws."""
    residual = disturbance(equations, 1)[:rows]
    assert len(residual) == rows
    spectrum = np.fft.rfft(residual, axis=0)
    drawn = list(surrogates(residual, 3))
    for r in drawn:
        other = np.fft.rfft(r, axis=0)
        assert np.abs(other) == pytest.approx(np.abs(spectrum))
        cross = spectrum[:, 0] * spectrum[:, 1].conj()
        assert other[:, 0] * other[:, 1].conj() == pytest.approx(cross)
        assert abs(np.corrcoef(r[:, 0], residual[:, 0])[0, 1]) < 0.5
    assert np.array_equal(drawn[2], list(surrogates(residual, 3))[2])
    assert not np.allclose(drawn[0], drawn[1])

"""The region of a discrepancy without a name, and its process Z."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from sgp_ros.diagnosis.criteria import REGION_ROWS
from sgp_ros.diagnosis.locate.dependence import dependences, own_variables
from sgp_ros.diagnosis.locate.remainder import (
    confined,
    explained_share,
    learn_remainder,
    parts_of,
    process_inputs,
    region,
)
from sgp_ros.gp.model import CoefficientPrior, Observations
from sgp_ros.gp.model import Model as Hyperparameters
from sgp_ros.gp.selection import select_inputs
from test.diagnosis.worlds import CHAINS, simulate


@pytest.fixture(scope='module')
def equations(equations_for):
    return equations_for(simulate(CHAINS[2], 7, 30.0))[1]


def _overlap(a, b):
    return max(min(a[1], b[1]) - max(a[0], b[0]), 0.0) / (max(a[1], b[1]) - min(a[0], b[0]))


def test_a_homogeneous_rest_is_confined_to_nothing():
    """In none of a thousand, white or correlated over twenty rows, of any variable."""
    rng = np.random.default_rng(0)
    shares = []
    for seed in range(1000):
        rows = int(rng.integers(100, 600))
        r = rng.normal(size=rows)
        if seed % 2:
            r = signal.lfilter([1.0], [1.0, -0.9], r)
        x = np.sin(np.linspace(0.0, rng.uniform(3.0, 60.0), rows))
        shares += [confined(x, r)[2], confined(np.arange(rows, dtype=float), r)[2]]
    assert min(shares) > REGION_ROWS


def test_a_burst_is_found_in_time(equations):
    rest = np.where((equations.time > 8.0) & (equations.time < 12.0), 1.0, 0.01)
    found = region(equations, rest, 1)
    assert found.variables == ('time',)
    assert found.intervals == {}
    assert _overlap(found.time[0], (8.0, 12.0)) > 0.8


@pytest.mark.parametrize('name', ['position', 'velocity'])
def test_a_part_of_the_motion_is_found(equations, name):
    """Where it is confined to, not to what else goes with it."""
    motion, low = equations.motion, equations.filter
    x = {'position': motion.wrapped[low.rows, 0], 'velocity': low(motion.velocity)[:, 0]}[name]
    lo, hi = np.quantile(x, [0.6, 0.85])
    rest = np.where((x > lo) & (x < hi), np.sign(np.sin(40.0 * equations.time)), 0.01)
    found = region(equations, rest, 0)
    assert found.variables == (name,)
    assert found.time == ()
    assert _overlap(found.intervals[name][0], (lo, hi)) > 0.85


def test_nothing_is_said_of_few_rows_or_of_nothing(equations):
    rest = np.zeros(len(equations.time))
    assert region(equations, rest, 0).variables == ()
    rest[3] = 1.0
    short = rest[:60]
    assert confined(equations.time[:60], short)[2] < 0.1


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
    assert 'effort of joint1' not in process_inputs(passive.motion, 1, sees_effort=False)[1]


def test_a_measured_effort_explains_nothing(equations_for, perfect):
    """It is what has to be predicted; a command is known before it acts."""
    world = perfect[1]
    _, measured = equations_for(world, effort=world.command, commands=False)
    _, commanded = equations_for(world)
    assert 'effort' not in own_variables(measured, 0)
    assert 'effort' in own_variables(commanded, 0)
    rest = measured.filter(measured.motion.effort) ** 3  # a function of the effort and no other
    found = learn_remainder(measured, rest, 0)
    assert found is None or not any('effort' in name for name in found.inputs)
    found = learn_remainder(commanded, rest, 0)
    assert 'effort of joint0' in found.inputs


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


def test_a_process_without_noise_explains_nothing_where_states_repeat():
    """Its covariance has no factor; a diagnosis goes on without it."""
    rng = np.random.default_rng(2)
    U, r = rng.normal(size=(300, 1)), rng.normal(size=300)
    U = np.repeat(U[:30], 10, axis=0)
    data = Observations(U, np.zeros((300, 1, 0)), np.sin(3.0 * U))
    found = select_inputs(data, CoefficientPrior.flat(0), 0, (0,), 100)
    model = Hyperparameters((found.kernel,), (1e-300,))
    assert explained_share(model, U, r, parts_of(300)) == -np.inf


def _wider(equations, factor):
    motion = equations.motion
    return replace(motion, position=factor * motion.position, velocity=factor * motion.velocity)


@pytest.mark.parametrize(
    ('of', 'beyond', 'error'),
    [
        (lambda m: np.tanh(4.0 * m.position[:, 1]), 1.0, 0.01),
        (lambda m: np.sin(9.0 * m.position[:, 1]), 0.14, 0.5),
        (lambda m: np.cos(9.0 * m.position[:, 1]) * m.velocity[:, 1], 1.0, 1.0),
    ],
    ids=['stays', 'turns', 'grows'],
)
def test_a_process_beyond_its_data_is_no_worse_than_none(
    equations_for, perfect, of, beyond, error
):
    """A mean that grows like a polynomial would be; what holds at the edges may hold beyond."""
    _, equations = equations_for(perfect[2])
    found = learn_remainder(equations, _planted(equations, of), 1)
    assert found.beyond == pytest.approx(beyond, abs=0.1)
    wide = _wider(equations, 2.0)
    true = of(wide)
    assert np.mean((found.force(wide) - true) ** 2) < error * np.mean(true**2)

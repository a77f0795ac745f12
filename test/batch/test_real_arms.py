"""Real arms, identified with the robot files that come with the package.

Scores are mean squared errors over the variance of the target on rows that were not learned from,
of torques under the same filter as the columns. The bounds are the acceptance limits of the two
recordings, with their cut-offs; the published friction is that of Gaz et al. (2019).

The Panda repeats its path after 13.35 s of 21 s. So its last 40 per cent are a second pass over
what was learned from: they tell of repeatability and noise, not of motions of another kind.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from sgp_ros.batch.blocks import distance_to, holdout
from sgp_ros.batch.fit import fit_offline
from sgp_ros.batch.regression_data import FilterPlan, filtered_data
from sgp_ros.batch.signals import collect_signals
from sgp_ros.engine.config import EngineConfig
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.table_map import read_map
from sgp_ros.recordings.tables import read_table
from sgp_ros.robots.registry import load_robot
from test.batch.worlds import ROOT

DATA = ROOT.parent / 'shared' / 'data'
# phi1 [N m], phi2 [s/rad], phi3 [rad/s] of the seven joints
PUBLISHED_FRICTION = np.array([
    [0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489],
    [5.1181, 9.0657, 10.136, 5.5903, 8.3469, 17.133, 10.336],
    [0.039533, 0.025882, -0.04607, 0.036194, 0.026226, -0.021047, 0.0035526],
])  # fmt: skip


def _robot(name):
    return load_robot(str(ROOT / 'config' / 'robots' / f'{name}.yaml'))


@pytest.fixture(scope='module')
def panda():
    mapping = read_map(ROOT / 'config' / 'import' / 'panda.yaml')
    events = list(read_table(DATA / 'panda' / 'panda_exciting.npz', mapping).events())
    robot = _robot('panda')
    plan = FilterPlan(5.0, 25.0, 60, 'measured')
    return robot, holdout(_filtered(events, robot, plan), 'tail', 0.4)


@pytest.fixture(scope='module')
def tiago():
    robot = _robot('tiago_arm')
    events = open_recording(DATA / 'tiago' / 'mcap_tiago_dynamic').events()
    data = _filtered(events, robot, FilterPlan(4.0, 20.0, 12, 'position'))
    return robot, holdout(data, 'alternate', 0.5, 6.0)


def _filtered(events, robot, plan):
    return filtered_data(collect_signals(events, robot, EngineConfig(max_gap=0.1)), robot, plan)


def _squares(fit, data):
    return ((fit.predict(data)[0] - data.y) ** 2).mean(axis=0)


def _without(data, robot, *endings):
    kept = [i for i, c in enumerate(robot.coefficients) if not c.name.endswith(endings)]
    return dataclasses.replace(data, F=data.F[:, :, kept])


def _least_squares(known, asked):
    """Return the held-out error of plain least squares, joint by joint as precise as they are."""
    k, p = known.F.shape[1:]
    weight = np.ones(k)
    for _ in range(4):
        A = (known.F * weight[:, None]).reshape(-1, p)
        w = np.linalg.lstsq(A, (known.y * weight).ravel(), rcond=1e-9)[0]
        weight = 1.0 / (known.y - known.F @ w).std(axis=0)
    return ((asked.y - asked.F @ w) ** 2).mean(axis=0) / asked.y.var(axis=0)


def test_panda_is_predicted_on_what_it_does_next(panda):
    """The acceptance split: the last forty per cent of the time; mean over seven joints."""
    robot, (known, asked) = panda
    errors = _squares(fit_offline(known, robot, 'PR'), asked) / asked.y.var(axis=0)
    assert errors.mean() < 0.0049
    assert errors.max() < 0.03


def test_every_term_of_the_panda_earns_its_place(panda):
    robot, rows = panda
    left_out = [('.viscous', '.coulomb', '.offset'), ('.coulomb', '.offset'), ('.offset',)]
    errors = [
        _least_squares(*(_without(data, robot, *endings) for data in rows)).mean()
        for endings in left_out
    ]
    errors.append(_least_squares(*rows).mean())
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 20.0 * errors[-1]


def test_panda_friction_found_here_predicts_better_than_the_published(panda):
    """Both with the rigid part fitted to the same rows; the published one was fitted elsewhere."""
    robot, rows = panda
    height, slope, shift = PUBLISHED_FRICTION
    rigid, variance = [], rows[1].y.var(axis=0)
    for data in rows:
        v = data.motion.velocity
        friction = height / (1 + np.exp(-slope * (v + shift))) - height / (
            1 + np.exp(-slope * shift)
        )
        bare = _without(data, robot, '.viscous', '.coulomb', '.offset')
        rigid.append(dataclasses.replace(bare, y=data.y - friction))
    published = _least_squares(*rigid) * rigid[1].y.var(axis=0) / variance
    ours = _least_squares(*rows)
    assert published.mean() < 0.012
    assert ours.mean() < 0.6 * published.mean()


def test_the_panda_retraces_the_path_it_was_learned_from(panda):
    """Why the scores here say nothing of unseen motions: the states were nearly all seen."""
    _, (known, asked) = panda
    assert np.median(distance_to(known, asked)) < 0.05


def test_a_process_halves_what_physics_leaves_on_a_path_seen_before(panda):
    """It sees position and velocity of its own joint, which on the second pass tell the time.

    On phases of the path that neither pass of the training rows holds it gains nothing.
    """
    robot, (known, asked) = panda
    physics = _squares(fit_offline(known, robot, 'PR'), asked) / asked.y.var(axis=0)
    both = _squares(fit_offline(known, robot, 'PRGP'), asked) / asked.y.var(axis=0)
    assert both.mean() < 0.6 * physics.mean()


def test_variances_of_the_panda_are_those_of_a_real_robot(panda):
    """Positive, though 26 of 91 coefficients are undetermined, and not narrower than the noise."""
    robot, (known, asked) = panda
    fit = fit_offline(known, robot, 'PR')
    mean, variance = fit.predict(asked)
    assert np.all(variance > np.array(fit.model.noise))
    inside = np.abs(asked.y - mean) < 1.96 * np.sqrt(variance)
    assert 0.85 < inside.mean() < 0.99


def test_tiago_is_predicted_on_stretches_between_the_learned_ones(tiago):
    """All four joints together, in the units of their torques, alternate stretches of 6 s."""
    robot, (known, asked) = tiago
    total = _squares(fit_offline(known, robot, 'PR'), asked).sum()
    assert total / asked.y.var(axis=0).sum() < 0.058


def test_dry_friction_is_most_of_what_tiago_feels(tiago):
    robot, rows = tiago
    bare = _least_squares(*(_without(data, robot, '.viscous', '.coulomb') for data in rows))
    assert _least_squares(*rows).mean() < 0.1 * bare.mean()

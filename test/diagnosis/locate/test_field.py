"""The process Z over one variable: noise, hyper-parameters, posterior."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize, signal

from sgp_ros.diagnosis.locate.field import (
    _Evidence,
    _geometry,
    cells_of,
    learn_field,
    noise_density,
)


@pytest.fixture
def motion():
    """Position and direction of a joint that moves to and fro, 600 rows."""
    time = np.linspace(0.0, 30.0, 600)
    angle = 2.0 * time + np.sin(0.7 * time)
    return np.sin(angle), np.cos(angle) > 0.0


def test_every_row_lies_in_the_cell_of_its_value_and_direction(motion):
    x, forward = motion
    cells = cells_of(x, forward)
    assert cells.count.sum() == len(x)
    assert (cells.of % 2 == forward).all()
    lo, hi = cells.edges[cells.of // 2].T
    assert ((lo <= x) & (x <= hi)).all()
    assert (cells.edges[1:, 0] > cells.edges[:-1, 1]).all()


def test_few_or_equal_values_make_few_cells():
    """No cell is empty, whatever is seen."""
    x = np.repeat([0.0, 1.0], 50)
    cells = cells_of(x, np.arange(100) % 2 == 0)
    assert len(cells.centre) == 2
    assert len(cells_of(np.zeros(100), x > 0.0).centre) == 1
    assert (cells.count > 0.0).all()


@pytest.mark.parametrize('pole', [0.0, 0.5, 0.9])
def test_the_density_of_noise_is_that_of_its_slowest_part(pole):
    """Of an autoregression 1 / (1 - pole)^2; never below it by much, for a band must not be."""
    found = [
        noise_density(
            signal.lfilter([1.0], [1.0, -pole], np.random.default_rng(seed).normal(size=1500))
        )
        for seed in range(20)
    ]
    assert 0.9 < np.median(found) * (1.0 - pole) ** 2 < 2.0


def test_the_slopes_of_the_evidence_are_its_differences(motion):
    cells = cells_of(*motion)
    squares, signs = _geometry(cells.centre, is_angle=False)
    y = np.random.default_rng(0).normal(size=len(cells.count))
    evidence = _Evidence(y, np.full(len(y), 0.3), squares, signs)
    theta = np.log([0.7, 0.4, 0.5])
    slopes = optimize.approx_fprime(theta, lambda t: evidence(t)[0], 1e-6)
    assert evidence(theta)[1] == pytest.approx(slopes, rel=1e-4)


def test_friction_is_odd_and_a_spring_is_not(motion):
    """What is learned is the function, in each direction."""
    x, forward = motion
    noise = 0.1 * np.random.default_rng(1).normal(size=len(x))
    for law in (np.where(forward, -1.0, 1.0) * np.cos(2.0 * x), np.sin(2.0 * x)):
        cells = cells_of(x, forward)
        field = learn_field(cells, law + noise, noise_density(noise), is_angle=False)
        seen = cells.count > 0.0
        true = np.bincount(cells.of, weights=law)[seen] / cells.count[seen]
        assert abs(field.mean[seen] - true).max() < 0.1
        assert field.gain > 10.0


def test_noise_alone_is_worth_no_process(motion):
    x, forward = motion
    noise = np.random.default_rng(2).normal(size=len(x))
    field = learn_field(cells_of(x, forward), noise, noise_density(noise), is_angle=False)
    assert field.gain < 1.0
    assert abs(field.mean).max() < 0.3
    nothing = learn_field(cells_of(x, forward), 0.0 * noise, 0.0, is_angle=False)
    assert not nothing.mean.any()


def test_both_ends_of_a_turn_are_one_place():
    """What was seen just before the angle wraps tells of just after."""
    angle = np.linspace(-np.pi, np.pi, 400, endpoint=False)
    cells = cells_of(angle, np.arange(400) % 2 == 0)
    turning = _geometry(cells.centre, is_angle=True)[0]
    assert turning[0, -1] == pytest.approx(turning[0, 2], rel=1e-2)
    assert _geometry(cells.centre, is_angle=False)[0][0, -1] > 100.0 * turning[0, -1]

"""Z over a variable and its simultaneous band: how often it is left by chance, what it finds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize, signal

from sgp_ros.diagnosis.criteria import REGION_ROWS, SIGNIFICANT
from sgp_ros.diagnosis.locate.bands import (
    _Evidence,
    _geometry,
    bands,
    cells_of,
    critical_value,
    learn_field,
    merged,
    noise_density,
)
from sgp_ros.diagnosis.locate.dependence import dependences, own_variables
from sgp_ros.diagnosis.locate.remainder import region
from sgp_ros.diagnosis.result import Location
from test.diagnosis.locate.nulls import disturbance
from test.diagnosis.worlds import CHAINS, simulate


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
    """The learned object is the function, in each direction."""
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
    """Data from just before the angle wraps inform the estimate just after."""
    angle = np.linspace(-np.pi, np.pi, 400, endpoint=False)
    cells = cells_of(angle, np.arange(400) % 2 == 0)
    turning = _geometry(cells.centre, is_angle=True)[0]
    assert turning[0, -1] == pytest.approx(turning[0, 2], rel=1e-2)
    assert _geometry(cells.centre, is_angle=False)[0][0, -1] > 100.0 * turning[0, -1]


DRAWS = 200


@pytest.fixture(scope='module')
def equations(equations_for):
    return equations_for(simulate(CHAINS[2], 7, 20.0))[1]


def _fields(equations, residual):
    found = []
    for j in range(residual.shape[1]):
        variables = own_variables(equations, j)
        density = noise_density(residual[:, j])
        for x in variables.values():
            cells = cells_of(x, variables['velocity'] > 0.0)
            found.append(learn_field(cells, residual[:, j], density, is_angle=False))
    return found


@pytest.mark.long
def test_the_band_is_left_by_chance_in_one_recording_of_twenty_at_most(equations):
    """Anywhere, on any joint, over any variable; white noise and red. Before any p-value."""
    false = 0
    for seed in range(DRAWS):
        fields = _fields(equations, disturbance(equations, seed))
        c = critical_value(fields)
        false += any((np.abs(f.mean) > c * f.std).any() for f in fields)
    error = np.sqrt(SIGNIFICANT * (1.0 - SIGNIFICANT) / DRAWS)
    assert false / DRAWS <= SIGNIFICANT + 2.0 * error


def test_the_band_holds_a_function_everywhere_at_once(equations):
    """In nineteen recordings of twenty, beside noise of which the density is known."""
    x = own_variables(equations, 0)['position']
    forward = own_variables(equations, 0)['velocity'] > 0.0
    cells, true = cells_of(x, forward), np.sin(3.0 * x) * np.where(forward, 1.0, -0.5)
    seen = cells.count > 0.0
    means = np.bincount(cells.of, weights=true)[seen] / cells.count[seen]
    held = 0
    for seed in range(60):
        noise = 0.3 * np.random.default_rng(seed).normal(size=len(x))
        field = learn_field(cells, true + noise, 0.09, is_angle=False)
        error = np.abs(field.mean[seen] - means)
        held += bool((error <= critical_value([field]) * field.std[seen]).all())
    assert held / 60 > 0.95 - 2.0 * np.sqrt(0.05 * 0.95 / 60)


def test_one_factor_holds_for_more_fields_only_if_it_is_larger(equations):
    fields = _fields(equations, disturbance(equations, 0))
    assert 1.96 < critical_value(fields[:1]) < critical_value(fields)


@pytest.mark.parametrize('seed', [2, 3])
def test_friction_in_a_part_of_the_range_is_found_there(equations, seed):
    """Where it is, on its joint, over its variable, beside white noise and red."""
    variables = own_variables(equations, 1)
    x, way = variables['position'], np.sign(variables['velocity'])
    lo, hi = np.quantile(x, [0.3, 0.55])
    noise = disturbance(equations, seed)
    residual = 0.2 * noise / noise.std(axis=0)
    residual[:, 1] -= way * ((x > lo) & (x < hi))
    found = bands(equations, residual, dependences(equations, residual))
    assert not any(b.regions for b in found if b.joint == 'joint0')
    (band,) = (b for b in found if (b.joint, b.variable) == ('joint1', 'position'))
    ((a, b),) = band.regions
    assert max(min(b, hi) - max(a, lo), 0.0) / (max(b, hi) - min(a, lo)) > 0.7
    assert band.rows == pytest.approx(np.mean((x >= a) & (x <= b)))


def test_a_region_needs_a_significant_variable(equations):
    """Without one, none is drawn, however far Z is from zero."""
    x = own_variables(equations, 1)['position']
    residual = disturbance(equations, 0)
    residual[:, 1] += 5.0 * residual.std() * np.sin(3.0 * x)
    depends = dependences(equations, residual)
    assert any(b.regions for b in bands(equations, residual, depends))
    for d in depends:
        d.p_values.update(dict.fromkeys(d.p_values, 0.06))
    found = bands(equations, residual, depends)
    assert len(found) == 8
    assert not any(b.regions for b in found)


def test_what_acts_everywhere_is_seen_where_it_is_strong_and_confined_to_nothing(equations):
    """That Z is not seen elsewhere is no proof that it is zero: its energy decides."""
    speed = own_variables(equations, 1)['velocity']
    residual = 0.1 * disturbance(equations, 4)
    residual[:, 1] += (speed / speed.std()) ** 3 * residual[:, 1].std()
    found = bands(equations, residual, dependences(equations, residual))
    (band,) = (b for b in found if (b.joint, b.variable) == ('joint1', 'velocity'))
    assert 0.0 < band.rows < REGION_ROWS
    assert region(equations, residual[:, 1], 1) == Location()


def test_nothing_is_drawn_where_the_joint_never_moved_so(equations):
    """At positive velocities it does not move backward."""
    residual = disturbance(equations, 0)
    found = bands(equations, residual, dependences(equations, residual))
    (band,) = (b for b in found if (b.joint, b.variable) == ('joint0', 'velocity'))
    fast = band.x > 0.5
    assert np.isnan(band.mean[fast, 0]).all()
    assert np.isfinite(band.mean[fast, 1]).all()


def test_a_gap_of_one_cell_is_none():
    assert merged(np.array([1, 0, 1, 0, 0, 1, 1, 0], dtype=bool)) == [(0, 2), (5, 6)]
    assert merged(np.zeros(3, dtype=bool)) == []


def test_nothing_is_said_of_few_rows(equations_for):
    _, short = equations_for(simulate(CHAINS[1], 7, 2.0))
    assert len(short.d) < 100
    assert bands(short, short.d, dependences(short, short.d)) == ()

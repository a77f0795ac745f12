"""Laws of the weight of Z beside the physics alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.gp.stacking import MEMORY, ProcessWeight


def _after(pairs):
    weight = ProcessWeight()
    for model, physics in pairs:
        weight.add(model, physics)
    return weight


def test_z_counts_in_full_before_any_error():
    """The model is what was asked for."""
    assert ProcessWeight().value == ProcessWeight().mean == 1.0


@pytest.mark.parametrize('scale', [1e-12, 1.0, 1e12])
def test_the_weight_is_the_share_of_profile_likelihoods(scale):
    """`S^(-n/2)` of each, with S its mean square; no unit enters."""
    rng = np.random.default_rng(0)
    errors = scale * rng.standard_normal((MEMORY, 2)) * [1.0, 1.3]
    squares = (errors**2).mean(axis=0)
    likelihoods = (squares / squares[0]) ** (-0.5 * MEMORY)
    expected = likelihoods[0] / likelihoods.sum()
    assert _after(errors).value == pytest.approx(expected, rel=1e-9)


def test_z_that_errs_three_times_as_much_is_silenced_and_comes_back():
    """Ten errors suffice in either direction."""
    bad, good = [(3.0, 1.0)] * MEMORY, [(1.0, 3.0)] * (3 * MEMORY)
    assert _after(bad).value < 1e-4
    assert _after(bad + good).value > 1.0 - 1e-4


def test_equal_errors_share():
    """Neither is preferred."""
    assert _after([(1.0, -1.0)] * 50).value == pytest.approx(0.5)


@given(st.lists(st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)), max_size=40))
def test_the_weight_is_a_share_for_any_errors(pairs):
    """Zero errors, of one or of both, are errors like any other."""
    assert 0.0 <= _after(pairs).value <= 1.0


def test_the_mixture_is_hardly_ever_worse_than_the_physics():
    """Z wins on a half of the stream and is absurd on the other: the mean of both beats each."""
    rng = np.random.default_rng(1)
    size = np.where(np.arange(2000) < 1000, 0.3, 30.0)
    z, physics = size * rng.standard_normal(2000), rng.standard_normal(2000)
    weight, mixed = ProcessWeight(), []
    for one, other in zip(z, physics, strict=True):
        mixed.append(weight.value * one + (1.0 - weight.value) * other)
        weight.add(one, other)
    late = np.array(mixed)[1000 + MEMORY :]
    assert np.mean(np.square(mixed[:1000])) < 0.12
    assert np.mean(late**2) < 1.01 * np.mean(physics[1000 + MEMORY :] ** 2)

"""The pseudo-inertia of clouds of mass points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.rigid.pseudo_inertia import (
    PSEUDO_BASIS,
    inertia_tensor,
    inertial_parameters,
    is_consistent,
    pseudo_inertia,
)
from test.rigid.bodies import cloud, parameters_of, random_body

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS)
def test_pseudo_inertia_is_the_second_moment_of_the_mass(seed):
    """`J = sum m [x; 1] [x; 1]^T`, the definition."""
    masses, places = cloud(np.random.default_rng(seed))
    lifted = np.column_stack([places, np.ones(len(places))])
    expected = (lifted.T * masses) @ lifted
    assert np.allclose(pseudo_inertia(parameters_of(masses, places)), expected, atol=1e-13)


@given(SEEDS)
def test_parameters_come_back(seed):
    """The map is linear and invertible, for real bodies and for others; leading axes pass."""
    w = np.random.default_rng(seed).normal(size=(2, 3, 10))
    J = pseudo_inertia(w)
    assert np.allclose(inertial_parameters(J), w, atol=1e-14)
    assert np.allclose(np.einsum('abi,ijk->abjk', w, PSEUDO_BASIS), J, atol=1e-14)
    assert np.array_equal(J, J.swapaxes(-1, -2))


@given(SEEDS)
def test_every_body_of_positive_mass_is_consistent(seed):
    """Four points that do not lie in a plane suffice."""
    assert is_consistent(random_body(seed))


@given(SEEDS)
def test_a_consistent_body_has_a_positive_tensor_that_obeys_the_triangle(seed):
    """About its centre of mass, no principal moment exceeds the sum of the two others."""
    w = random_body(seed)
    c = w[1:4] / w[0]
    tensor = inertia_tensor(w) - w[0] * ((c @ c) * np.eye(3) - np.outer(c, c))
    moments = np.linalg.eigvalsh(tensor)
    assert moments[0] > 0.0
    assert moments[2] < moments[0] + moments[1]


@pytest.mark.parametrize(
    ('change', 'what'),
    [
        ({0: -1.0}, 'negative mass'),
        ({0: 0.0}, 'no mass'),
        ({1: 9.0}, 'a centre outside what its inertia allows'),
        ({4: 9.0}, 'a moment larger than the sum of the others'),
        ({9: -0.1}, 'a negative moment'),
        ({5: 0.5}, 'a product of inertia that is too large'),
        ({6: np.nan}, 'not a number'),
    ],
)
def test_what_no_body_has_is_not_consistent(change, what):
    """Each of the ways in which least squares goes wrong."""
    w = parameters_of(np.ones(6), 0.3 * np.vstack([np.eye(3), -np.eye(3)]))
    assert is_consistent(w)
    for index, value in change.items():
        w[index] = value
    assert not is_consistent(w), what


def test_consistency_does_not_depend_on_units():
    """A watch wheel in kilograms and metres is a body as well."""
    w = random_body(3)
    tiny = w * np.array([1e-6] + 3 * [1e-10] + 6 * [1e-14])
    assert is_consistent(tiny)
    tiny[0] = -tiny[0]
    assert not is_consistent(tiny)


def test_ten_parameters_are_expected():
    """Anything else is a mistake of the caller."""
    with pytest.raises(ValueError, match=r'\(9,\)'):
        pseudo_inertia(np.ones(9))

"""Random trees, beside Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio
import pytest

from sgp_proof.numerics.random_tree import random_tree
from sgp_proof.numerics.trees import pinocchio_model


@pytest.mark.parametrize('seed', range(6))
def test_torques_are_those_of_pinocchio(seed):
    """Branches, prismatic joints and gravity included; friction adds to them."""
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, 2 + seed)
    q, v, a = rng.normal(size=(3, 5, 2 + seed))
    model = pinocchio_model(tree)
    data = model.createData()
    rigid = np.array([pinocchio.rnea(model, data, *state) for state in zip(q, v, a, strict=True)])
    expected = rigid + tree.viscous * v + tree.coulomb * np.sign(v)
    found = tree.columns(q, v, a) @ tree.parameters
    assert np.allclose(found, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


def test_extended_precision_rounds_to_double():
    """The same numbers with more digits."""
    rng = np.random.default_rng(0)
    tree = random_tree(rng, 4)
    state = rng.normal(size=(3, 5, 4))
    fine = tree.columns(*state, precision=np.longdouble)
    assert fine.dtype == np.longdouble
    assert np.allclose(fine.astype(float), tree.columns(*state), rtol=0.0, atol=1e-13)


def test_trees_differ_in_shape():
    """Chains and branches, both kinds of joints, over thirty seeds."""
    trees = [random_tree(np.random.default_rng(seed), 6) for seed in range(30)]
    assert len({tree.parents for tree in trees}) > 5
    assert any(all(np.diff(tree.parents) == 1) for tree in trees)
    assert any(any(tree.is_prismatic) for tree in trees)

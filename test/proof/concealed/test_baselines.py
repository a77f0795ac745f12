"""Sparse regression on a generous library, scored as any tool is."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sgp_proof.concealed.baselines import columns, formula_of, lasso, library, score
from sgp_ros.physics.formula import read_formula

P = {'kind': 'magnetic_brake', 'a': 0.5, 'v': 1.5, 'reach': 1.0, 'source': -1.0, 'source_v': 1.0}
ANSWER = {'effects': [{'effect': 'unknown', 'joint': 'elbow', 'parameters': P}]}


def _motion(names):
    rng = np.random.default_rng(0)
    position, velocity = rng.normal(0.0, 0.5, (2, 400, len(names)))
    tree = SimpleNamespace(moving_names=names)
    return SimpleNamespace(position=position, velocity=velocity, tree=tree)


def test_every_term_is_a_formula():
    """It is read by the usual grammar, and no term stands twice."""
    texts = library(['hip', 'elbow'])
    assert len(texts) == len(set(texts)) > 60
    X = columns(texts, _motion(['hip', 'elbow']))
    assert X.shape == (400, len(texts))
    assert np.isfinite(X).all()
    assert X[:, 0] == pytest.approx(1.0)
    for text in texts:
        read_formula(text, is_law=True)


def test_a_sparse_law_is_found():
    """Of a force that is in the library its term alone is of size."""
    pytest.importorskip('sklearn')
    motion = _motion(['elbow'])
    texts = library(['elbow'])
    X = columns(texts, motion)
    size = np.sqrt((X**2).mean(axis=0))
    y = -0.7 * X[:, texts.index('dq[elbow]**3')]
    c = lasso(X / size, y) / size
    assert c[texts.index('dq[elbow]**3')] == pytest.approx(-0.7, rel=0.05)


def test_a_formula_of_symbolic_regression_is_one_of_the_grammar():
    text = formula_of('((-0.0044) + (1.9767 * (abs((X4 * 2.71)) - sin(X1))))', ['hip', 'elbow'])
    assert text == '((-0.0044) + (1.9767 * (abs((dq[elbow] * 2.71)) - sin(q[hip]))))'
    motion = _motion(['hip', 'elbow'])
    q, v = motion.position[:, 0], motion.velocity[:, 1]
    expected = 1.9767 * (np.abs(2.71 * v) - np.sin(q)) - 0.0044
    np.testing.assert_allclose(columns([text], motion)[:, 0], expected)


@pytest.mark.parametrize(('found', 'is_right'), [(-0.5 * 2.0 / 1.5, True), (-0.9, False)])
def test_a_formula_is_right_or_wrong(found, is_right):
    """With the true law alone a world is right; what is left far away is relative."""
    far = SimpleNamespace(d=np.ones((10, 1)), motion=_motion(['elbow']))
    finding = {
        'formula': f'tau_x[elbow] = c0*(dq[elbow]/(1 + (dq[elbow]/{0.7 * 1.5})**2))',
        'parameters': {'c0': {'value': found}}, 'share': 0.1, 'terms': 1,
    }  # fmt: skip
    row = score(ANSWER, {'elbow': finding}, np.array([0.25]), far)
    assert (row['found'], row['wrong']) == (is_right, not is_right)
    assert row['far'] == pytest.approx(0.25)
    assert row['right_joint']
    silent = score(ANSWER, {}, np.array([1.0]), far)
    assert not silent['found']
    assert not silent['wrong']

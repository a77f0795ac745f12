"""The search of shapes in small products against the same in all rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.explain.candidates import fit, split
from sgp_ros.diagnosis.explain.fitted_model import floors
from sgp_ros.diagnosis.explain.frame import Frame
from sgp_ros.diagnosis.explain.regression import Columns, with_shapes
from sgp_ros.diagnosis.explain.shape_search import Bench, searched
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from test.diagnosis.worlds import CHAINS, simulate

LAWS = {
    'a shape alone': ['command_delay'],
    'a shape and a coefficient': ['cogging'],
    'no shape': ['viscous_friction'],
    'of all joints': ['payload', 'mount_elasticity'],
    'friction that may hold': ['stribeck_friction', 'spring', 'command_delay'],
}
STEP = 1e-3


@pytest.fixture(scope='module')
def equations(equations_for):
    force = lambda t, q, v: (-4.0 * (q[0] - 0.3) - 1.5 * v[0], -0.8 * v[1])  # noqa: E731
    return equations_for(simulate(CHAINS[2], 7, 10.0, force=force))[1]


def _candidates(motion, names):
    found = []
    for name in names:
        law = EFFECTS[name]
        place = law.places(motion)[-1]
        starts = law.starts(motion, place) if law.shape_names(place.kind) else [np.zeros(0)]
        found.append(EffectAt(law, place, np.asarray(starts[len(starts) // 2])))
    return tuple(found)


def _moved(candidates):
    """Each candidate with each of its shapes moved."""
    x = np.concatenate([s.shape for s in candidates])
    owner = np.repeat(np.arange(len(candidates)), [len(s.shape) for s in candidates])
    return [
        (int(n), with_shapes(candidates, x + STEP * x * (np.arange(len(x)) == i))[n], STEP)
        for i, n in enumerate(owner)
    ]


def _residual(frame, columns, candidates):
    y, A, _ = split(frame, columns, candidates)
    return y - A @ np.linalg.lstsq(A, y, rcond=1e-10)[0] if A.shape[1] else y


@pytest.mark.parametrize('is_free', [False, True], ids=['bodies as they are', 'free bodies'])
@pytest.mark.parametrize('names', LAWS.values(), ids=LAWS)
def test_squares_and_slopes_are_those_of_all_rows(equations, names, is_free):
    candidates = _candidates(equations.motion, names)
    dry = frozenset(j for s in candidates for j in s.held_joints)
    columns = Columns(equations)
    frame = Frame.of(columns.equations(dry), np.array([0.3, 0.1]), is_free=is_free)
    bench = Bench(frame, columns, None)
    r = _residual(frame, columns, candidates)
    assert bench.cost(candidates) == pytest.approx(r @ r, rel=1e-8)
    moved = _moved(candidates)
    J, tried = np.zeros((len(r), len(moved))), []
    for i, (n, s, h) in enumerate(moved):
        changed = (*candidates[:n], s, *candidates[n + 1 :])
        tried.append((changed, h))
        J[:, i] = (_residual(frame, columns, changed) - r) / h
    H, g = bench.slopes(candidates, tried)
    np.testing.assert_allclose(H, J.T @ J, rtol=1e-5, atol=1e-7 * (r @ r))
    np.testing.assert_allclose(g, J.T @ r, rtol=1e-5, atol=1e-7 * (r @ r))


def test_columns_that_bodies_explain_change_nothing(equations):
    """Gravity on a body whose mass and centre are free."""
    columns = Columns(equations)
    sigma = np.sqrt((equations.d**2).mean(axis=0) + floors(equations))
    frame = Frame.of(equations, sigma, is_free=True)
    bench = Bench(frame, columns, None)
    one, *_ = _candidates(equations.motion, ['viscous_friction'])
    assert bench.cost((one,)) < bench.cost(())
    assert bench.cost((one, one)) == pytest.approx(bench.cost((one,)), rel=1e-9)


def test_a_shape_is_found_from_afar(equations_for):
    truth = simulate(CHAINS[1], 11, 10.0, force=lambda t, q, v: (0.8 * np.sin(7.0 * q[0] + 0.4),))
    equations = equations_for(truth)[1]
    columns, law = Columns(equations), EFFECTS['cogging']
    start = EffectAt(law, law.places(equations.motion)[0], np.array([6.4]))
    sigma = np.sqrt((equations.d**2).mean(axis=0))
    found = fit(columns, (start,), sigma, is_free=False)
    assert found.effects[0].shape[0] == pytest.approx(7.0, abs=0.005)


@pytest.mark.parametrize('size', [0.0, 1.0])
def test_a_search_without_a_residual_ends(equations, size):
    """All of the discrepancy is a law, whose shape the search begins with; or there is none."""
    columns, law = Columns(equations), EFFECTS['cogging']
    place = law.places(equations.motion)[0]
    s = EffectAt(law, place, np.asarray(law.starts(equations.motion, place)[0]))
    d = np.zeros_like(equations.d)
    d[:, place.joint] = size * columns.local(s, equations, equations.motion)[:, 0]
    exact = replace(equations, d=d)
    frame = Frame.of(exact, np.array([0.3, 0.1]), is_free=False)
    (found,) = searched(Bench(frame, Columns(exact), None), (s,), 4, 0)
    np.testing.assert_allclose(found.shape, s.shape, rtol=1e-4)
    cost = Bench(frame, Columns(exact), None).cost((s,))
    assert cost == pytest.approx(1e-14 * ((d / frame.sigma) ** 2).sum())

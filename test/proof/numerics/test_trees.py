"""The study of random trees, in small: ten of the trees that the benchmark runs over."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_proof.numerics.trees import exact_identifiability, study, summary

pytestmark = pytest.mark.skipif(
    np.finfo(np.longdouble).eps > 1e-18, reason='needs extended precision for the exact rank'
)


@pytest.fixture(scope='module')
def found():
    """Outcome of ten trees of two to six joints."""
    return summary([study(seed, 2 + seed % 5) for seed in range(10)])


def test_every_unidentifiable_direction_is_flagged_and_no_other(found):
    """Beside ranks and flags in extended precision, by another recursion and another algorithm."""
    assert found['unidentifiable_directions'] > 100
    assert found['directions_missed'] == found['directions_false'] == 0
    assert found['flags_missed'] == found['flags_false'] == 0
    assert found['structural_rank_errors'] == 0


def test_intervals_of_base_parameters_hold_the_truth(found):
    """95 % of some 250, up to four standard deviations of a tenth as many independent ones."""
    spread = 4.0 * np.sqrt(0.95 * 0.05 / (found['base_parameters'] / 10.0))
    assert abs(found['coverage95_base'] - 0.95) < min(spread, 0.05)


def test_projection_makes_bodies_of_what_least_squares_gave(found):
    """Always, and never further from the truth in the metric of the data."""
    assert found['trees_inconsistent_before'] > 5
    assert found['trees_inconsistent_after'] == 0
    assert found['projections_not_converged'] == 0
    assert found['projections_further_from_truth'] == 0


def test_the_exact_rank_sees_what_double_precision_cannot():
    """A direction of size 1e-13, below the tolerance of the double, is still one."""
    A = np.random.default_rng(0).normal(size=(20, 4)).astype(np.longdouble)
    A[:, 3] = A[:, 0] + A[:, 1]
    assert exact_identifiability(A)[0] == 3
    assert list(exact_identifiability(A)[1]) == [False, False, True, False]
    A[0, 3] += np.longdouble(1e-13)
    assert exact_identifiability(A)[0] == 4

"""Findings of errors of the connection."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.setup.said import error_finding


@pytest.mark.parametrize(('is_of_gains', 'expected'), [(True, 0.0671), (False, 0.005)])
def test_gains_are_as_uncertain_as_the_bodies_of_the_robot_file(is_of_gains, expected):
    """By 5 %; a number that nothing determines, or that is exact, has no deviation."""
    hypothesis = SimpleNamespace(
        joint='knee', effect='scale', words={}, is_of_gains=is_of_gains,
        names=('kp', 'kd', 'of'), units=('1', '1', '1'),
    )  # fmt: skip
    error = SimpleNamespace(
        hypothesis=hypothesis, worth=50.0, needed=60.0,
        numbers=np.array([1.34, 1.0, 1.0]), std=np.array([0.005, 0.0, np.inf]),
    )  # fmt: skip
    found = error_finding(SimpleNamespace(errors=[error], rivals=[()]), 0, 40.0)
    assert found.probability > 0.9
    assert found.parameters['kp'].std == pytest.approx(expected, rel=1e-2)
    assert found.parameters['kd'].std is None
    assert found.parameters['of'].std is None
